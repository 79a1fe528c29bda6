//! Inverse and forward dynamics of an arm of six joints, without an operating system. Memory is a fixed array. After
//! the model and its data are constructed, nothing is allocated.
//!
//! ```text
//! rustup target add thumbv7em-none-eabihf
//! cargo run --release    # on a Cortex-M4, which qemu-system-arm plays
//! ```
#![no_std]
#![no_main]

mod arena;
mod arm;
mod motions;

use core::panic::PanicInfo;
use cortex_m_semihosting::{debug, hprintln};

#[global_allocator]
static ARENA: arena::Arena = arena::Arena::new();

/// Entry point of the program. A debugger prints the output; qemu emulates this debugger.
#[cortex_m_rt::entry]
fn main() -> ! {
    let empty = (ARENA.bytes(), ARENA.allocations());
    let arm = arm::model();
    let mut data = condyle_dynamics::Data::new(&arm);
    let full = (ARENA.bytes(), ARENA.allocations());
    let efforts = motions::efforts(&arm, &mut data);
    let more = ARENA.allocations() - full.1;

    for (motion, tau) in efforts.iter().enumerate() {
        hprintln!("tau {}: {:?}", motion, tau);
    }
    let (bytes, pieces) = (full.0 - empty.0, full.1 - empty.1);
    hprintln!("memory: {} bytes in {} pieces, then {} more", bytes, pieces, more);
    assert!(more == 0, "memory was taken after construction");
    debug::exit(debug::EXIT_SUCCESS);
    unreachable!("the debugger ends the program")
}

#[panic_handler]
fn panic(what: &PanicInfo) -> ! {
    hprintln!("{}", what);
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
