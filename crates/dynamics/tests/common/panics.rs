//! Checks of the source location that a panic reports.

#[path = "../../../../tests/common/panics.rs"]
mod shared;

pub(crate) use shared::{Panic, panic_of};

/// Fails unless `call` panics with a message that contains `expected`. The file that the panic reports must have a path
/// that ends with `end`.
#[track_caller]
pub(crate) fn assert_panic(end: &str, expected: &str, call: impl FnOnce()) {
    let Panic { file, message, .. } = panic_of(call).unwrap_or_else(|| panic!("expected a panic: {expected}"));
    assert!(message.contains(expected), "expected {expected:?}, found {message:?}");
    assert!(file.ends_with(end), "expected a panic in {end}, found {message:?} in {file}");
}
