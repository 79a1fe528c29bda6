//! Tests that the panic for a caller's mistake reports the line of the call, which is in this file.

use condyle::{Data, robots};

#[path = "../../common/panics.rs"]
mod shared;

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
        let panic = shared::panic_of(call).expect(word);
        assert!(panic.file.ends_with("downstream/src/panics.rs") || panic.file == "src/panics.rs", "{panic:?}");
        assert!(panic.line > 0 && panic.message.contains(word), "{panic:?}");
    }
}
