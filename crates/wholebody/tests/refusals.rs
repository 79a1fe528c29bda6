//! Tests that errors name the invalid argument. An invalid description gives an `Error`. An invalid state or a failed
//! solve gives a `Status`. A wrong length gives a panic.

mod common;
#[path = "../../../tests/common/panics.rs"]
mod panics;

use common::*;
use condyle_dynamics::{Vec3, robots};
use condyle_wholebody::{
    Axes, Backend, Command, CommandSource, Error, Friction, FrictionContact, Normal, Plan, PlanData, References,
    Settings, Status, Task, WholeBodyController,
};

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
#[should_panic(expected = "references.contacts: expected 4 numbers, found 3")]
fn lengths() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &feet(0.7));
    let mut references = controller.hold(&stance()).unwrap();
    references.contacts.pop();
    let _ = controller.step(&stance(), &[0.0; 18], &references);
}

/// Checks that an effort limit of 0 is an error, because the joint cannot be controlled. The error names the joint, and
/// a setting can replace the limit.
#[test]
fn efforts_are_above_0() {
    let model = robots::quadruped();
    let mut limits = model.limits().clone();
    limits.effort_upper[7] = 0.0; // effort limit of the joint LF_HFE
    let powerless = model.clone().with_limits(limits).unwrap();
    let new = |model, settings| WholeBodyController::new(model, &feet(0.7), &tasks(), settings).map(drop);
    let error = new(&powerless, Settings::default()).unwrap_err().to_string();
    let expected =
        "joint `LF_HFE`: the model's limit of effort (the setting `effort` replaces it) is 0, but it must be above 0";
    assert_eq!(error, expected);
    let effort = |joint: f64, base: f64| {
        let mut effort = vec![80.0; 18];
        (effort[7], effort[2]) = (joint, base);
        Settings { effort: Some(effort), ..Settings::default() }
    };
    assert_eq!(new(&powerless, effort(80.0, 0.0)), Ok(()), "no motor acts on the base");
    assert_eq!(
        new(&model, effort(80.0, -1.0)).unwrap_err().to_string(),
        "setting `effort` is -1, but it must be at least 0"
    );
    for value in [0.0, -0.0, -80.0, f64::NAN] {
        let error = new(&model, effort(value, 80.0)).unwrap_err().to_string();
        assert_eq!(error, format!("joint `LF_HFE`: setting `effort` is {value}, but it must be above 0"));
    }
}

/// Checks that the message of a panic gives the line of the caller.
#[test]
fn panics_point_at_the_caller() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&stance()).unwrap();
    let x = [stance(), vec![0.0; 18]].concat();
    let data = PlanData { times: vec![0.0, 0.5], states: x.repeat(2), touches: vec![true; 4], ..PlanData::default() };
    let plan = Plan::new(&model, 4, data).unwrap();
    let mut short = references.clone();
    short.contacts.pop();
    let (q, v) = (stance(), [0.0; 18]);

    type Call<'a> = &'a mut dyn FnMut(&mut WholeBodyController);
    let calls: [(&str, Call<'_>); 8] = [
        ("q: expected 19 numbers, found 3", &mut |c| drop(c.hold(&q[..3]))),
        ("q: expected 19 numbers, found 3", &mut |c| drop(c.step(&q[..3], &v, &references).clone())),
        ("v: expected 18 numbers, found 3", &mut |c| drop(c.step(&q, &v[..3], &references).clone())),
        ("references.contacts: expected 4 numbers, found 3", &mut |c| drop(c.step(&q, &v, &short).clone())),
        ("references.contacts: expected 4 numbers, found 3", &mut |c| c.track(&plan, 0.0, &mut short.clone())),
        ("references.contacts: expected 4 numbers, found 3", &mut |c| _ = c.kkt_residuals(&q, &v, &short)),
        ("contact: expected one of 4, found 4", &mut |_| _ = plan.activation(4, 0.0)),
        ("controls: the plan has none", &mut |_| drop(plan.feedback(0.0, &q, &v, &mut [0.0; 18]))),
    ];
    for (expected, call) in calls {
        let panic = panics::panic_of(|| call(&mut controller)).expect(expected);
        assert_eq!(panic.message, expected);
        assert!(panic.file.ends_with("refusals.rs"), "{panic:?}");
    }
}

#[test]
fn a_controller_is_shared_between_threads() {
    fn is_usual<T: Clone + Send + Sync + std::fmt::Debug>() {}
    is_usual::<WholeBodyController>();
    is_usual::<References>();
    is_usual::<Plan>();
    is_usual::<Command>();
    is_usual::<Settings>();
    is_usual::<Error>();
    is_usual::<Status>();
}

/// Checks that the command before the first step is not reported as a solution.
#[test]
fn nothing_is_solved_before_the_first_step() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &feet(0.7));
    assert_eq!(controller.command().solved().unwrap_err(), Status::NotStarted);
    assert_eq!(controller.clone().command().status, Status::NotStarted);
    let references = controller.hold(&stance()).unwrap();
    assert!(controller.step(&stance(), &[0.0; 18], &references).solved().is_ok());
}

#[test]
fn words_for_users() {
    let sources = [CommandSource::Solution, CommandSource::LastSolution, CommandSource::GravityCompensation];
    assert_eq!(sources.map(|s| s.to_string()), ["solution", "last solution", "gravity compensation"]);
    assert_eq!([Backend::Clarabel, Backend::InteriorPoint].map(|b| b.to_string()), ["clarabel", "interior point"]);
}
