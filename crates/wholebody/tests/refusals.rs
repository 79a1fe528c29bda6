//! What is wrong is named: descriptions by `Error`, states and failed solves by `Status`, lengths by a panic.

mod common;

use common::*;
use condyle_dynamics::{Vec3, robots};
use condyle_wholebody::{Axes, Error, Friction, FrictionContact, Normal, Settings, Task, WholeBodyController};

fn refusal(contacts: &[FrictionContact], tasks: &[Task], settings: Settings) -> String {
    WholeBodyController::new(&robots::quadruped(), contacts, tasks, settings).unwrap_err().to_string()
}

#[test]
fn descriptions() {
    let plain = Settings::default;
    let unknown = refusal(&[FrictionContact::point("LF_fot", 0.7)], &tasks(), plain());
    assert_eq!(unknown, "unknown frame `LF_fot`; nearest is `LF_foot`");
    let twice = ["LF_foot", "RF_foot", "LF_foot"].map(|foot| FrictionContact::point(foot, 0.7));
    let model = robots::quadruped();
    let error = WholeBodyController::new(&model, &twice, &tasks(), plain()).unwrap_err();
    assert_eq!(error, Error::DuplicateContact { frame: "LF_foot".to_owned() });

    for (task, expected) in [
        (Task::orientation("trunc"), "unknown frame `trunc`; nearest is `trunk`"),
        (Task { axes: Axes::Frame("trunc".to_owned()), ..Task::com() }, "unknown frame `trunc`; nearest is `trunk`"),
        (Task::contact_force("trunk"), "task `trunk`: there is no contact of this frame"),
        (Task { weight: -1.0, ..Task::com() }, "task `com`: weight is -1, but it must be at least 0"),
        (Task { weight: f64::NAN, ..Task::posture() }, "task `posture`: weight is NaN, but it must be at least 0"),
        (Task { priority: 3, ..Task::com() }, "task `com`: priority is 3, but it must be 0, 1 or 2"),
        (Task { joints: vec![1.0; 3], ..Task::posture() }, "`joints`: expected 18 numbers, found 3"),
    ] {
        assert_eq!(refusal(&feet(0.7), &[task], plain()), expected);
    }

    let foot = || FrictionContact::point("LF_foot", 0.7);
    let corners = |corners: &[[f64; 3]]| {
        FrictionContact::surface("LF_foot", 0.7, &corners.iter().map(|&c| Vec3::from(c)).collect::<Vec<_>>())
    };
    for (contact, expected) in [
        (FrictionContact { friction: 0.0, ..foot() }, "friction is 0, but it must be above 0"),
        (FrictionContact { friction: f64::NAN, ..foot() }, "friction is NaN, but it must be above 0"),
        (
            FrictionContact { normal: Normal::Frame(Vec3::zero()), ..foot() },
            "normal (its length) is 0, but it must be above 0",
        ),
        (FrictionContact { min_force: -1.0, ..foot() }, "min_force is -1, but it must be at least 0"),
        (
            FrictionContact { min_force: 5.0, max_force: 4.0, ..foot() },
            "max_force is 4, but it must be at least min_force, above 0",
        ),
        (corners(&[[0.0; 3]]), "corners is 1, but it must be at least 2, and finite"),
        (corners(&[[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]), "corners is 2, but it must be apart from each other"),
        (
            corners(&[[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.05]]),
            "corners is 3, but it must be in one plane across the normal",
        ),
        (
            corners(&[[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]),
            "corners is 4, but it must be in their order around a convex polygon",
        ),
        (
            FrictionContact { normal: Normal::World(Vec3::new(0.0, 0.0, 1.0)), ..corners(&[[0.1; 3], [0.2; 3]]) },
            "corners is 2, but it must be those of a point where the normal is the world's",
        ),
    ] {
        assert_eq!(refusal(&[contact], &tasks(), plain()), format!("contact `LF_foot`: {expected}"));
    }

    for (settings, expected) in [
        (Settings { effort: Some(vec![80.0; 12]), ..plain() }, "`effort`: expected 18 numbers, found 12"),
        (Settings { tolerance: 0.0, ..plain() }, "setting `tolerance` is 0, but it must be between 0 and 1"),
        (
            Settings { friction: Friction::Pyramid { sides: 2, inscribed: true }, ..plain() },
            "setting `friction.sides` is 2, but it must be at least 3",
        ),
    ] {
        assert_eq!(refusal(&feet(0.7), &tasks(), settings), expected);
    }
}

#[test]
#[should_panic(expected = "references.contacts: expected 4 entries, found 3")]
fn lengths() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &feet(0.7));
    let mut references = controller.hold(&stance());
    references.contacts.pop();
    let _ = controller.step(&stance(), &[0.0; 18], &references);
}

#[test]
fn a_controller_moves_between_threads() {
    fn is_send<T: Send>() {}
    is_send::<WholeBodyController>();
}
