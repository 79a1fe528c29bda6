//! A step allocates once, inside clarabel.
#![allow(unsafe_code)] // a counting allocator cannot be written without

mod common;

use common::*;
use condyle_dynamics::robots;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every request goes to the system's allocator unchanged; counting touches a thread-local without a destructor
// and allocates nothing itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller's promise about `layout` is the one that is asked for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System.alloc` with this `layout`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_allocates_once() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&q);
    for _ in 0..3 {
        let before = COUNT.get();
        controller.step(&q, &v, &references).unwrap();
        assert_eq!(COUNT.get() - before, 1);
    }
}
