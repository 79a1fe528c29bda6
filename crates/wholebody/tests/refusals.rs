//! What is wrong is named: descriptions by `Error`, states and failed solves by `Status`, lengths by a panic.

mod common;

use common::*;
use condyle_dynamics::{Vec3, robots};
use condyle_wholebody::{Error, FrameTask, FrictionContact, Gains, Settings, Status, Tasks, WholeBodyController};

fn refusal(contacts: &[FrictionContact], tasks: Tasks, settings: Settings) -> Error {
    WholeBodyController::new(&robots::quadruped(), contacts, tasks, settings).unwrap_err()
}

#[test]
fn descriptions() {
    let plain = Settings::default;
    assert_eq!(refusal(&[], tasks(), plain()), Error::NoContacts);
    let unknown = refusal(&[FrictionContact::new("LF_fot", 0.7)], tasks(), plain());
    assert_eq!(unknown.to_string(), "unknown frame `LF_fot`; nearest is `LF_foot`");
    let twice = [
        FrictionContact::new("LF_foot", 0.7),
        FrictionContact::new("RF_foot", 0.7),
        FrictionContact::new("LF_foot", 0.5),
    ];
    assert_eq!(refusal(&twice, tasks(), plain()), Error::DuplicateContact { frame: "LF_foot".to_owned() });

    let gains = Gains::critical(100.0);
    let missing =
        FrameTask { frame: "trunc".to_owned(), linear: Vec3::zero(), angular: Vec3::new(1.0, 1.0, 1.0), gains };
    let error = refusal(&feet(0.7), Tasks { frames: vec![missing], ..Tasks::default() }, plain());
    assert_eq!(error.to_string(), "unknown frame `trunc`; nearest is `trunk`");

    let foot = || FrictionContact::new("LF_foot", 0.7);
    for (contact, expected) in [
        (FrictionContact { friction: 0.0, ..foot() }, "contact `LF_foot`: friction is 0, but it must be above 0"),
        (
            FrictionContact { friction: f64::NAN, ..foot() },
            "contact `LF_foot`: friction is NaN, but it must be above 0",
        ),
        (
            FrictionContact { normal: Vec3::zero(), ..foot() },
            "contact `LF_foot`: normal (its length) is 0, but it must be above 0",
        ),
        (
            FrictionContact { min_force: -1.0, ..foot() },
            "contact `LF_foot`: min_force is -1, but it must be at least 0",
        ),
        (
            FrictionContact { min_force: 5.0, max_force: 4.0, ..foot() },
            "contact `LF_foot`: max_force is 4, but it must be at least min_force",
        ),
    ] {
        assert_eq!(refusal(&[contact], tasks(), plain()).to_string(), expected);
    }

    let mut heavy = tasks();
    heavy.com.weight.y = -1.0;
    assert_eq!(refusal(&feet(0.7), heavy, plain()).to_string(), "task `com`: weight is -1, but it must be at least 0");

    let settings = Settings { effort: Some(vec![80.0; 12]), ..plain() };
    assert_eq!(refusal(&feet(0.7), tasks(), settings), Error::Length { name: "effort", expected: 18, found: 12 });
    let settings = Settings { tolerance: 0.0, ..plain() };
    assert_eq!(
        refusal(&feet(0.7), tasks(), settings).to_string(),
        "setting `tolerance` is 0, but it must be between 0 and 1"
    );
}

#[test]
fn numbers_that_are_not_finite() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&q);
    let good = controller.step(&q, &v, &references).unwrap().clone();

    let mut bad = q.clone();
    bad[8] = f64::NAN;
    let status = controller.step(&bad, &v, &references).unwrap_err();
    assert_eq!(status.to_string(), "`q[8]` is NaN, which is not finite");
    let mut bad = v.clone();
    bad[3] = f64::INFINITY;
    let status = controller.step(&q, &bad, &references).unwrap_err();
    assert_eq!(status, Status::NotFinite { name: "v", index: 3, value: f64::INFINITY });
    let mut bad = references.clone();
    bad.contacts[1].force.z = f64::NAN;
    let status = controller.step(&q, &v, &bad).unwrap_err();
    assert_eq!(status.to_string(), "`contacts[11]` is NaN, which is not finite");

    assert_eq!(controller.command(), &good, "the last command stands");
    assert_eq!(controller.step(&q, &v, &references).unwrap(), &good, "and nothing of the bad steps stays behind");
}

#[test]
fn iterations_run_out() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let settings = Settings { max_iterations: 2, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &feet(0.7), tasks(), settings).unwrap();
    let references = controller.hold(&q);
    assert_eq!(controller.step(&q, &v, &references), Err(Status::IterationLimit));
    assert_eq!(controller.command().iterations, 2);
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
