//! A solve allocates nothing, once the solver and its trace exist.
#![allow(unsafe_code)] // a counting allocator cannot be written without

mod common;

use common::{HANGING, cartpole, random, random_node, straight};
use condyle_optimal::{Fddp, Sweep};
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

#[test]
fn a_sweep_allocates_nothing() {
    let mut random = random();
    let nodes: Vec<_> = [7, 0, 3, 0].map(|nu| random_node(&mut random, 11, nu)).into();
    let mut sweep = Sweep::new(&nodes);
    assert_eq!(allocations(|| sweep.run(&nodes, 1e-9).unwrap()), 0);
}

#[test]
fn a_solve_allocates_nothing() {
    for lanes in [1, 4] {
        let mut problem = cartpole(&HANGING, 50, lanes);
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        let mut iterations = 0;
        // The first solve reserves the trace and the step lengths: two allocations.
        let first = allocations(|| {
            solver.solve_with(&mut problem, &xs, &[0.0; 50], |_| iterations += 1).unwrap();
        });
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        });
        assert_eq!((iterations, first, second), (34, 2, 0));
    }
}
