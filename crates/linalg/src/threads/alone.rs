//! Threads that share work where there are none: the calling one does it all, with the same bits.

/// The number of threads that share work: one.
pub fn threads() -> usize {
    1
}

/// Does two pieces of work, one after the other.
pub fn join(one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    one();
    other();
}

/// Waits a little for another thread.
pub fn pause() {
    core::hint::spin_loop();
}
