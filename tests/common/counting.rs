//! Allocator that counts the allocations of each thread, for tests that a call does not allocate.
#![allow(unsafe_code)] // an allocator requires unsafe code

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every request is passed to the system's allocator unchanged. Counting accesses a thread-local without a
// destructor and does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        // SAFETY: `System.alloc` has the same requirement on `layout`, which the caller fulfils.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller got `pointer` from this allocator, and so from `System.alloc`, with the same `layout`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the number of allocations that this thread has made so far.
#[allow(dead_code)] // only some tests use it
pub(crate) fn allocated() -> usize {
    COUNT.get()
}

/// Returns the number of allocations that a call makes on this thread.
pub(crate) fn allocations(f: impl FnOnce()) -> usize {
    let before = COUNT.get();
    f();
    COUNT.get() - before
}

/// Returns the number of bytes that a call allocates on this thread, including bytes that the call frees again.
#[allow(dead_code)] // only some tests use it
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
