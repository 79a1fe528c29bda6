//! Location and message of a panic, for tests which check that a caller's mistake is reported at the caller's line.
#![allow(dead_code)] // each program uses only some of the items

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

/// Location and message of a panic.
#[derive(Debug, Default)]
pub(crate) struct Panic {
    pub(crate) file: String,
    pub(crate) line: u32,
    pub(crate) message: String,
}

thread_local! {
    /// Last panic of this thread. It is recorded only while `panic_of` runs.
    static SEEN: RefCell<Option<Panic>> = const { RefCell::new(None) };
}

/// Calls a function and returns its panic, or `None` if the function does not panic. Panics of other threads at the
/// same time have no effect on the result.
pub(crate) fn panic_of(call: impl FnOnce()) -> Option<Panic> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            let place = info.location();
            let seen = Panic {
                file: place.map_or(String::new(), |place| place.file().replace('\\', "/")),
                line: place.map_or(0, |place| place.line()),
                message: String::new(),
            };
            let waits = SEEN.with_borrow_mut(|last| last.is_some() && last.replace(seen).is_some());
            if !waits {
                before(info);
            }
        }));
    });
    SEEN.set(Some(Panic::default()));
    let outcome = catch_unwind(AssertUnwindSafe(call));
    let seen = SEEN.take();
    let payload = outcome.err()?;
    let text = payload.downcast_ref::<&str>().map(|&text| text.to_owned());
    let message = text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
    Some(Panic { message, ..seen? })
}
