//! Functions of `shared.rs` for builds without the feature `threads`. The calling thread does all work, and results
//! have the same bits.

/// Returns the number of threads that share work: one.
pub fn threads() -> usize {
    1
}

/// Executes two closures, one after the other.
pub fn join(one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    one();
    other();
}

/// Waits briefly for another thread.
pub fn pause() {
    core::hint::spin_loop();
}
