//! Panics for a caller's mistake point into this file.

use condyle::{Data, robots};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::{Arc, Mutex};

/// Runs a call that panics, and returns the file and the message of its panic.
fn panic_of(call: impl FnOnce()) -> (String, String) {
    let seen = Arc::new(Mutex::new((String::new(), String::new())));
    let (kept, hook) = (seen.clone(), take_hook());
    set_hook(Box::new(move |info| {
        let file = info.location().map_or(String::new(), |place| place.file().to_owned());
        *kept.lock().unwrap() = (file, info.payload_as_str().unwrap_or_default().to_owned());
    }));
    let result = catch_unwind(AssertUnwindSafe(call));
    set_hook(hook);
    assert!(result.is_err(), "no panic");
    let seen = seen.lock().unwrap().clone();
    seen
}

#[test]
fn panics_are_the_callers() {
    let arm = robots::arm7();
    let mut data = Data::new(&arm);
    let mut other = Data::new(&robots::quadruped());
    let calls: [(&str, Box<dyn FnOnce() + '_>); 4] = [
        ("q", Box::new(|| _ = condyle::rnea(&arm, &mut data, &[0.0; 6], &[0.0; 7], &[0.0; 7], &[]))),
        ("data", Box::new(|| _ = condyle::crba(&arm, &mut other, &[0.0; 7]))),
        ("1000", Box::new(|| _ = condyle::forward_kinematics(&arm, &mut Data::new(&arm), &[0.0; 7]).frame(1000))),
        ("3", Box::new(|| _ = condyle::Batch::new(&arm, 3, 1).crba(&arm, &[0.0; 21]).at(3))),
    ];
    for (word, call) in calls {
        let (file, message) = panic_of(call);
        assert!(file.ends_with("panics.rs"), "{file}: {message}");
        assert!(message.contains(word), "{message}");
    }
}
