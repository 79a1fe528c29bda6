//! Tests of the controller of arms: a tool on a circle, limits, and bad input.

use condyle_dynamics::distances::{Geometry, GeometryPair, Shape};
use condyle_dynamics::simulation::{Settings as SimulationSettings, Simulation};
use condyle_dynamics::{Data, Mat3, Model, Motion, Se3, Vec3, forward_kinematics, robots};
use condyle_mpc::{ArmMpc, ArmSettings, Error, TickStatus};
use std::sync::Arc;

const STEP: f64 = 1e-3;
const PERIOD: usize = 10;
/// Radius of the circle (m) and speed of the tool (m/s).
const RADIUS: f64 = 0.12;
const SPEED: f64 = 0.25;

fn start() -> Vec<f64> {
    [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat()
}

fn tool(arm: &Model, q: &[f64]) -> Se3<f64> {
    forward_kinematics(arm, &mut Data::new(arm), q).frame(arm.frame("tool").unwrap())
}

/// Returns the pose on the circle at the time t. The tool starts from rest.
fn circle(begin: Se3<f64>, t: f64) -> Se3<f64> {
    let angle = SPEED / RADIUS * if t < 1.0 { 0.5 * t * t } else { t - 0.5 };
    let by = Vec3::new(0.0, angle.sin(), angle.cos() - 1.0).scale(RADIUS);
    Se3 { translation: begin.translation + by, ..begin }
}

#[test]
fn the_tool_follows_a_circle_within_the_limits() {
    let arm = Arc::new(robots::arm7());
    let begin = tool(&arm, &start()[..7]);
    let mut mpc = ArmMpc::new(arm.clone(), "tool", ArmSettings::default()).unwrap();
    mpc.reset(0.0, &start(), |t| circle(begin, t)).unwrap();
    let mut simulation = Simulation::new(arm.clone(), SimulationSettings { dt: STEP, ..Default::default() });
    simulation.set_state(&start()[..7], &[0.0; 7]).unwrap();
    let (mut policy, mut tau, mut worst) = (mpc.policy(), [0.0; 7], 0.0f64);
    for step in 0..4000 {
        let t = STEP * step as f64;
        let x = [simulation.q(), simulation.v()].concat();
        if step % PERIOD == 0 && step > 0 {
            let report = mpc.update(t, &x, |t| circle(begin, t)).unwrap().clone();
            assert_eq!(report.status, TickStatus::Planned, "{report:?} {:?}", mpc.solver().outcome().worst);
        }
        policy.control(t, &x, &mut tau);
        assert!(simulation.step(&tau, &[]).is_taken());
        let miss = tool(&arm, simulation.q()).translation - circle(begin, t + STEP).translation;
        worst = worst.max(miss.norm_squared().sqrt());
    }
    assert!(worst < 2e-3, "{worst} m");
}

#[test]
fn limits_hold_where_the_path_is_too_fast() {
    let arm = robots::arm7();
    let mut limits = arm.limits().clone();
    limits.velocity.fill(0.6);
    let arm = Arc::new(arm.with_limits(limits).unwrap());
    let begin = tool(&arm, &start()[..7]);
    let fast = |t: f64| Se3 { translation: begin.translation + Vec3::new(0.0, 0.8 * t.min(0.4), 0.0), ..begin };
    let mut mpc = ArmMpc::new(arm.clone(), "tool", ArmSettings::default()).unwrap();
    mpc.reset(0.0, &start(), fast).unwrap();
    let plan = mpc.solver().solution();
    let fastest = plan.xs.chunks(14).flat_map(|x| &x[7..]).fold(0.0f64, |most, v| most.max(v.abs()));
    assert!(fastest > 0.55 && fastest < 0.62, "{fastest} rad/s");
}

#[test]
fn bad_input_is_refused() {
    let arm = Arc::new(robots::arm7());
    let begin = tool(&arm, &start()[..7]);
    let error = ArmMpc::new(arm.clone(), "paw", ArmSettings::default()).unwrap_err().to_string();
    assert!(error.contains("paw"), "{error}");
    let mut mpc = ArmMpc::new(arm, "tool", ArmSettings::default()).unwrap();
    mpc.reset(0.0, &start(), |_| begin).unwrap();
    let mut broken = start();
    broken[3] = f64::NAN;
    assert_eq!(mpc.update(0.02, &broken, |_| begin).unwrap().status, TickStatus::InvalidState);
    let nowhere = Se3 { translation: Vec3::new(f64::NAN, 0.0, 0.0), ..begin };
    let error = mpc.update(0.04, &start(), |_| nowhere).unwrap_err().to_string();
    assert!(error.contains("pose") && error.contains("NaN"), "{error}");
    assert_eq!(mpc.update(0.06, &start(), |_| begin).unwrap().status, TickStatus::Planned);
    assert_eq!(mpc.update(0.05, &start(), |_| begin).unwrap_err(), Error::Time { t: 0.05, last: 0.06 });
}

/// Moves the tool to the other side of a ball, on whose straight line it would touch the ball.
#[test]
fn the_arm_moves_around_an_obstacle() {
    let arm = Arc::new(robots::arm7());
    let (begin, by, ball) = (tool(&arm, &start()[..7]), Vec3::new(0.0, 0.3, 0.0), 0.08);
    let center = begin.translation + by.scale(0.5) + Vec3::new(0.0, 0.0, 0.03);
    let end = Se3 { translation: begin.translation + by, ..begin };
    let obstacle = Geometry::in_world(Shape::sphere(center, ball));
    let tip = Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.03));
    let obstacles = vec![GeometryPair::new(tip, obstacle)];
    let [touching, apart] = [Vec::new(), obstacles].map(|obstacles| {
        let settings = ArmSettings { obstacles, ..ArmSettings::default() };
        let mut mpc = ArmMpc::new(arm.clone(), "tool", settings).unwrap();
        mpc.reset(0.0, &start(), |_| begin).unwrap();
        let mut simulation = Simulation::new(arm.clone(), SimulationSettings { dt: STEP, ..Default::default() });
        simulation.set_state(&start()[..7], &[0.0; 7]).unwrap();
        let (mut policy, mut tau, mut nearest) = (mpc.policy(), [0.0; 7], f64::INFINITY);
        for step in 0..3000 {
            let x = [simulation.q(), simulation.v()].concat();
            if step % PERIOD == 0 && step > 0 {
                mpc.update(STEP * step as f64, &x, |_| end).unwrap();
            }
            policy.control(STEP * step as f64, &x, &mut tau);
            assert!(simulation.step(&tau, &[]).is_taken());
            let away = tool(&arm, simulation.q()).translation - center;
            nearest = nearest.min(away.norm_squared().sqrt() - ball - 0.03);
        }
        let miss = tool(&arm, simulation.q()).translation - end.translation;
        assert!(miss.norm_squared().sqrt() < 5e-3, "{:?}", miss.to_array());
        nearest
    });
    assert!(touching < 0.0 && apart > 0.01, "{touching} {apart}"); // the limit of 0.02 m holds at knots
}

/// Checks that an arm, which should stay in its place, yields to a ball that comes along.
#[test]
fn an_arm_yields_to_a_ball_that_moves() {
    let arm = Arc::new(robots::arm7());
    let (begin, speed) = (tool(&arm, &start()[..7]), Vec3::new(0.0, -0.4, 0.0));
    let from = begin.translation + Vec3::new(0.0, 0.4, 0.05);
    let at = |t: f64| Se3::new(Mat3::identity(), from + speed.scale(t));
    let ball = Geometry::in_world(Shape::sphere(Vec3::zero(), 0.08)).named("ball").at(at(0.0));
    let tip = Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.03));
    let settings = ArmSettings { obstacles: vec![GeometryPair::new(tip, ball)], ..ArmSettings::default() };
    let mut mpc = ArmMpc::new(arm.clone(), "tool", settings).unwrap();
    mpc.place("ball", 0.0, at(0.0), Motion::new(speed, Vec3::zero())).unwrap();
    let report = mpc.reset(0.0, &start(), |_| begin).unwrap();
    assert_eq!(report.status, TickStatus::Planned);
    let mut simulation = Simulation::new(arm.clone(), SimulationSettings { dt: STEP, ..Default::default() });
    simulation.set_state(&start()[..7], &[0.0; 7]).unwrap();
    let (mut policy, mut tau, mut nearest) = (mpc.policy(), [0.0; 7], f64::INFINITY);
    for step in 0..2000 {
        let (t, x) = (STEP * step as f64, [simulation.q(), simulation.v()].concat());
        if step % PERIOD == 0 && step > 0 {
            mpc.update(t, &x, |_| begin).unwrap();
        }
        policy.control(t, &x, &mut tau);
        assert!(simulation.step(&tau, &[]).is_taken());
        let away = tool(&arm, simulation.q()).translation - at(t + STEP).translation;
        nearest = nearest.min(away.norm_squared().sqrt() - 0.08 - 0.03);
    }
    assert!(nearest > 0.01, "{nearest}"); // the limit of 0.02 m may give way at a high cost
    let error = mpc.place("bal", 0.0, at(0.0), Motion::zero()).unwrap_err().to_string();
    assert!(error.contains("no pair of the obstacles has a geometry called `bal`"), "{error}");
}

#[test]
fn invalid_obstacles_are_named() {
    let arm = Arc::new(robots::arm7());
    let ball = Geometry::in_world(Shape::sphere(Vec3::zero(), 0.1));
    let on = |frame: &str| GeometryPair::new(Geometry::on(frame, Shape::sphere(Vec3::zero(), 0.1)), ball.clone());
    let fails = |settings: ArmSettings| ArmMpc::new(arm.clone(), "tool", settings).unwrap_err().to_string();
    let error = fails(ArmSettings { obstacles: vec![on("tool"), on("tol")], ..ArmSettings::default() });
    assert!(error.contains("pairs[1]") && error.contains("tol"), "{error}");
    let quadruped = Arc::new(robots::quadruped());
    let error = ArmMpc::new(quadruped, "LF_foot", ArmSettings::default()).unwrap_err().to_string();
    assert!(error.contains("expected a fixed base"), "{error}");
    let error = fails(ArmSettings { clearance: f64::NAN, ..ArmSettings::default() });
    assert!(error.contains("clearance"), "{error}");
    let error = fails(ArmSettings { threads: 0, ..ArmSettings::default() });
    assert!(error.contains("threads") && error.contains("from 1 to 1024"), "{error}");
}
