//! Where a panic says that it happened.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread waits for a panic.
    static WAITS: Cell<bool> = const { Cell::new(false) };
    /// The file of the last panic on this thread.
    static FILE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Calls a function, and returns the file and the message of its panic, if it panics.
pub(crate) fn panic_of(call: impl FnOnce()) -> Option<(String, String)> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            if WAITS.get() {
                let file = info.location().map_or(String::new(), |location| location.file().replace('\\', "/"));
                FILE.set(file);
            } else {
                before(info);
            }
        }));
    });
    WAITS.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(call));
    WAITS.set(false);
    let message = outcome.err()?;
    let text = message.downcast_ref::<String>().cloned();
    let text = text.or_else(|| message.downcast_ref::<&str>().map(|&text| text.to_owned()));
    Some((FILE.take(), text.unwrap_or_default()))
}

/// Panics unless a call panics with a message that contains `expected`, in a file with this end of its path.
#[track_caller]
pub(crate) fn assert_panic(end: &str, expected: &str, call: impl FnOnce()) {
    let (file, message) = panic_of(call).unwrap_or_else(|| panic!("expected a panic: {expected}"));
    assert!(message.contains(expected), "expected {expected:?}, found {message:?}");
    assert!(file.ends_with(end), "expected a panic in {end}, found {message:?} in {file}");
}
