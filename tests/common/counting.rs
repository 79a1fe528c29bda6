//! An allocator that counts what each thread asks for.
#![allow(unsafe_code)] // it cannot be written without

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every request goes to the system's allocator unchanged; counting touches a thread-local without a destructor
// and allocates nothing itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
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

/// The number of allocations of this thread so far.
#[allow(dead_code)] // by some of the tests
pub(crate) fn allocated() -> usize {
    COUNT.get()
}

/// How often a call allocates, on this thread.
pub(crate) fn allocations(f: impl FnOnce()) -> usize {
    let before = COUNT.get();
    f();
    COUNT.get() - before
}

/// How many bytes a call allocates on this thread, freed or not.
#[allow(dead_code)] // by some of the tests
pub(crate) fn bytes(f: impl FnOnce()) -> usize {
    let before = BYTES.get();
    f();
    BYTES.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(bytes(|| drop(std::hint::black_box(Box::new(7_u64)))), 8);
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(7)))), 1);
}
