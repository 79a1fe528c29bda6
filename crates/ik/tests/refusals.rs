//! Invalid descriptions and arguments give errors that name them.

use condyle_dynamics::{Mat3, Vec3, robots};
use condyle_ik::{DifferentialIk, GlobalIk, JointLimits, SearchSettings, Settings, Task};

fn refusal(tasks: &[Task], settings: Settings) -> String {
    DifferentialIk::new(&robots::arm7(), tasks, settings).unwrap_err().to_string()
}

#[test]
fn descriptions_are_checked() {
    let cases = [
        (Task::pose("tol"), "tol"),
        (Task { weight: -1.0, ..Task::pose("tool") }, "task `tool`: weight is -1, but it must be at least 0"),
        (Task { gain: 1.5, ..Task::com() }, "task `com`: gain is 1.5, but it must be from 0 to 1"),
        (Task { damping: f64::NAN, ..Task::com() }, "task `com`: damping is NaN"),
        (Task { priority: 3, ..Task::posture() }, "task `posture`: priority is 3, but it must be 0, 1 or 2"),
        (
            Task { factors: vec![1.0; 5], ..Task::pose("tool") },
            "task `tool`: factors: expected 6 numbers or none, found 5",
        ),
        (Task { factors: vec![-1.0; 3], ..Task::com() }, "task `com`: factors is -1"),
        (Task { root: Some("tool".into()), ..Task::com() }, "task `com`: root `tool`: only pose"),
        (Task::relative_pose("tool", "nowhere"), "nowhere"),
        (Task::coupling(&[("nowhere", 1.0)], 0.0), "nowhere"),
        (Task::coupling(&[], f64::INFINITY), "task `coupling`: offset is inf, but it must be finite"),
    ];
    for (task, expected) in cases {
        let found = refusal(&[task], Settings::default());
        assert!(found.contains(expected), "{found}\nexpected: {expected}");
    }
    let limits = |limits| Settings { limits: Some(limits), ..Settings::default() };
    let cases = [
        (Settings { dt: 0.0, ..Settings::default() }, "setting `dt` is 0, but it must be above 0"),
        (Settings { damping: 0.0, ..Settings::default() }, "setting `damping` is 0"),
        (limits(JointLimits { gain: 0.0, ..JointLimits::default() }), "setting `limits.gain` is 0"),
        (
            limits(JointLimits { velocity: Some(vec![1.0; 3]), ..JointLimits::default() }),
            "`limits.velocity`: expected 7",
        ),
        (
            limits(JointLimits { acceleration: Some(vec![-1.0; 7]), ..JointLimits::default() }),
            "setting `limits.acceleration` is -1, but it must be at least 0",
        ),
        (limits(JointLimits { lower: Some(vec![9.0; 7]), ..JointLimits::default() }), "lower is 9, above upper"),
    ];
    for (settings, expected) in cases {
        let found = refusal(&[Task::com()], settings);
        assert!(found.contains(expected), "{found}\nexpected: {expected}");
    }
}

/// Checks that limits of a free-flyer are refused, but not the model's own numbers.
#[test]
fn limits_that_cannot_be_held_are_refused() {
    let quadruped = robots::quadruped();
    let own = quadruped.limits();
    let limits = |lower: Vec<f64>| JointLimits { lower: Some(lower), ..JointLimits::default() };
    let make = |lower| {
        let settings = Settings { limits: Some(limits(lower)), ..Settings::default() };
        DifferentialIk::new(&quadruped, &[Task::com()], settings).map(|_| ())
    };
    assert!(make(own.lower.clone()).is_ok());
    let mut lower = own.lower.clone();
    lower[2] = 0.3; // the height of the trunk
    let error = make(lower.clone()).unwrap_err().to_string();
    assert!(error.contains("entry 2 is finite, but positions of such joints have no limits"), "{error}");
    let settings = SearchSettings { lower: Some(lower), ..SearchSettings::default() };
    let error = GlobalIk::new(&quadruped, &["LF_foot"], settings).unwrap_err().to_string();
    assert!(error.contains("entry 2"), "{error}");
}

#[test]
fn arguments_are_checked() {
    let arm = robots::arm7();
    let mut ik =
        DifferentialIk::new(&arm, &[Task::pose("tool"), Task::posture(), Task::com()], Settings::default()).unwrap();
    let good = ik.hold(&[0.0; 7]).unwrap();
    let mut wrong = |q: &[f64], v0: &[f64], targets: &condyle_ik::Targets, expected: &str| {
        let found = ik.step(q, v0, targets).unwrap_err().to_string();
        assert!(found.contains(expected), "{found}\nexpected: {expected}");
    };
    wrong(&[0.0; 6], &[0.0; 7], &good, "`q`: expected 7 numbers, found 6");
    wrong(&[f64::NAN; 7], &[0.0; 7], &good, "NaN");
    wrong(&[0.0; 7], &[f64::INFINITY; 7], &good, "`v0[0]` is inf, which is not finite");
    let mut targets = good.clone();
    targets.frames[0].translation.y = f64::NAN;
    wrong(&[0.0; 7], &[0.0; 7], &targets, "`targets.frames[10]` is NaN");
    let mut targets = good.clone();
    targets.frames[0].rotation = Mat3::identity().add_diagonal(1.0);
    wrong(&[0.0; 7], &[0.0; 7], &targets, "no rotation");
    let mut targets = good.clone();
    targets.frames.clear();
    wrong(&[0.0; 7], &[0.0; 7], &targets, "`targets.frames`: expected 1 numbers, found 0");
    let mut targets = good.clone();
    targets.posture = vec![f64::NAN; 7];
    wrong(&[0.0; 7], &[0.0; 7], &targets, "NaN");
    let mut targets = good;
    targets.com = Vec3::new(0.0, f64::NAN, 0.0);
    wrong(&[0.0; 7], &[0.0; 7], &targets, "`targets.com[1]` is NaN");
}

#[test]
fn searches_are_checked() {
    let arm = robots::arm7();
    let refusal = |frames: &[&str], settings| GlobalIk::new(&arm, frames, settings).unwrap_err().to_string();
    let usual = SearchSettings::default;
    assert!(refusal(&["tol"], usual()).contains("tol"));
    assert!(refusal(&[], usual()).contains("at least one frame"));
    assert!(refusal(&["tool"], SearchSettings { starts: 0, ..usual() }).contains("setting `starts` is 0"));
    assert!(
        refusal(&["tool"], SearchSettings { tolerance: [0.0, 1.0], ..usual() }).contains("setting `tolerance` is 0")
    );
    assert!(
        refusal(&["tool"], SearchSettings { orientation_weight: f64::NAN, ..usual() }).contains("orientation_weight")
    );
    assert!(refusal(&["tool"], SearchSettings { lower: Some(vec![0.0]), ..usual() }).contains("`lower`: expected 7"));
    let ik = GlobalIk::new(&arm, &["tool"], usual()).unwrap();
    assert!(ik.solve(&[], &[0.0; 7]).unwrap_err().to_string().contains("`targets`: expected 1"));
    let target = condyle_dynamics::Se3::new(Mat3::identity(), Vec3::new(f64::NAN, 0.0, 0.0));
    assert!(ik.solve(&[target], &[0.0; 7]).unwrap_err().to_string().contains("`targets[9]` is NaN"));
    let target = condyle_dynamics::Se3::identity();
    assert!(ik.solve(&[target], &[f64::NAN; 7]).unwrap_err().to_string().contains("NaN"));
    assert!(ik.solve(&[target], &[0.0; 6]).unwrap_err().to_string().contains("`posture`: expected 7 numbers, found 6"));
}

#[test]
fn a_robot_without_joints_has_no_velocity() {
    let fixed = condyle_dynamics::ModelBuilder::new("fixed").build().unwrap();
    let mut ik = DifferentialIk::new(&fixed, &[Task::posture(), Task::rest()], Settings::default()).unwrap();
    let targets = ik.hold(&[]).unwrap();
    assert!(ik.step(&[], &[], &targets).unwrap().v.is_empty());
    let refused = DifferentialIk::new(&fixed, &[Task::com()], Settings::default()).unwrap_err();
    assert!(refused.to_string().contains("no moving body"), "{refused}");
}
