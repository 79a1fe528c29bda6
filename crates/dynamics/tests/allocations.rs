//! Nothing is allocated once a `Data` exists, by any function that a control loop calls.
#![allow(unsafe_code)] // a counting allocator cannot be written without
#![allow(non_snake_case)]

mod common;

use common::table::{Input, Output, functions};
use common::{all_models, rng};
use condyle_dynamics::{Data, Scalar};
use num_dual::Dual64;
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

fn allocations(f: impl FnOnce()) -> usize {
    let before = COUNT.get();
    f();
    COUNT.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(7)))), 1);
}

/// On the three robots, on a tree of every joint type, and on one with joints that follow; from the first call on.
fn check<S: Scalar>() {
    for (seed, model) in all_models(1).iter().enumerate() {
        let input = Input::<S>::random(model, &mut rng(seed as u64));
        for (name, function) in functions() {
            let (mut data, mut output) = (Data::new(model), Output::new(model));
            for call in ["first", "second"] {
                output.numbers.clear();
                let count = allocations(|| function(model, &mut data, &input, &mut output));
                assert_eq!(count, 0, "{name}, {call} call, on\n{model}");
            }
        }
    }
}

#[test]
fn numbers() {
    check::<f64>();
}

#[test]
fn dual_numbers() {
    check::<Dual64>();
}
