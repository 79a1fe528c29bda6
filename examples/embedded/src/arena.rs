//! Memory allocator for a program without an operating system. Each allocation takes the next bytes of a fixed array,
//! and memory is never freed.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Size of the array (bytes).
const SIZE: usize = 1 << 20;

/// Fixed array of memory, with the number of bytes in use and the number of allocations.
#[repr(align(16))]
pub(crate) struct Arena {
    memory: UnsafeCell<[u8; SIZE]>,
    end: AtomicUsize,
    count: AtomicUsize,
}

// SAFETY: an atomic counter ensures that each byte is handed out only once.
unsafe impl Sync for Arena {}

impl Arena {
    /// Creates an array with no bytes in use.
    pub(crate) const fn new() -> Self {
        Self { memory: UnsafeCell::new([0; SIZE]), end: AtomicUsize::new(0), count: AtomicUsize::new(0) }
    }

    /// Returns the number of bytes in use.
    pub(crate) fn bytes(&self) -> usize {
        self.end.load(Ordering::Relaxed)
    }

    /// Returns the number of allocations so far.
    pub(crate) fn allocations(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }
}

// SAFETY: allocations do not overlap, are within the array, and have the requested alignment.
unsafe impl GlobalAlloc for Arena {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let start = |end: usize| end.next_multiple_of(layout.align());
        let fits =
            |end: usize| start(end).checked_add(layout.size()).filter(|&end| end <= SIZE && layout.align() <= 16);
        self.count.fetch_add(1, Ordering::Relaxed);
        match self.end.fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits) {
            // SAFETY: the address is within the array.
            Ok(before) => unsafe { self.memory.get().cast::<u8>().add(start(before)) },
            Err(_) => core::ptr::null_mut(),
        }
    }
    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}
