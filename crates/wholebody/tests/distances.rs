//! Limits of distances: an arm around a ball, a limit that is violated at the start, and invalid settings.

use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
use condyle_dynamics::{Data, Mat3, Model, Motion, Se3, Vec3, forward_kinematics, integrate, robots};
use condyle_wholebody::{DistanceLimits, Settings, Status, Task, WholeBodyController};

const DT: f64 = 1e-3;
/// Minimum distance (m).
const MINIMUM: f64 = 0.02;

/// Returns pairs of two parts of the arm and a ball.
fn pairs(ball: Vec3<f64>) -> Vec<GeometryPair> {
    let ball = || Geometry::in_world(Shape::sphere(ball, 0.08));
    let forearm = Shape::capsule(Vec3::zero(), Vec3::new(0.0, 0.0, 0.2), 0.05);
    let parts = [Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.03)), Geometry::on("link5", forearm)];
    parts.into_iter().map(|part| GeometryPair::new(part, ball())).collect()
}

fn start() -> Vec<f64> {
    vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0]
}

fn tool(arm: &Model, q: &[f64]) -> Vec3<f64> {
    forward_kinematics(arm, &mut Data::new(arm), q).frame(arm.frame("tool").unwrap()).translation
}

/// Moves the tool of the arm by `by` for 2 s. Returns the smallest distance of each time step, and the last error of
/// the tool.
fn moved(settings: Settings, ball: Vec3<f64>, by: Vec3<f64>) -> (Vec<f64>, f64) {
    let arm = robots::arm7();
    let (mut q, mut v) = (start(), vec![0.0; 7]);
    let tasks = [Task::position("tool"), Task { weight: 1e-3, ..Task::posture() }];
    let mut controller = WholeBodyController::new(&arm, &[], &tasks, settings).unwrap();
    let mut references = controller.hold(&q).unwrap();
    references.frames[0].pose.translation += by;
    let goal = references.frames[0].pose.translation;
    let pairs = DistancePairs::new(&arm, &pairs(ball)).unwrap();
    let (mut distances, mut data, mut nearest) = (Distances::new(&pairs), Data::new(&arm), Vec::new());
    for _ in 0..2000 {
        let command = controller.step(&q, &v, &references);
        assert_eq!(command.status, Status::Solved);
        let step: Vec<f64> = v.iter().zip(&command.a).map(|(v, a)| DT * v + 0.5 * DT * DT * a).collect();
        v.iter_mut().zip(&command.a).for_each(|(v, a)| *v += DT * a);
        let before = q.clone();
        integrate(&arm, &before, &step, &mut q);
        pairs.values(forward_kinematics(&arm, &mut data, &q), &mut distances);
        nearest.push(distances.distances().iter().copied().fold(f64::INFINITY, f64::min));
    }
    (nearest, (tool(&arm, &q) - goal).norm_squared().sqrt())
}

fn limits(ball: Vec3<f64>) -> Settings {
    let limits = DistanceLimits { minimum: MINIMUM, ..DistanceLimits::new(pairs(ball)) };
    Settings { distances: Some(limits), ..Settings::default() }
}

#[test]
fn an_arm_moves_around_a_ball() {
    let (by, begin) = (Vec3::new(0.0, 0.3, 0.0), tool(&robots::arm7(), &start()));
    let ball = begin + by.scale(0.5) + Vec3::new(0.0, 0.0, 0.03);
    let least = |distances: &[f64]| distances.iter().copied().fold(f64::INFINITY, f64::min);
    let (free, _) = moved(Settings::default(), ball, by);
    let (held, error) = moved(limits(ball), ball, by);
    assert!(least(&free) < 0.0, "the straight way touches the ball: {}", least(&free));
    assert!(least(&held) > MINIMUM - 1e-4, "{}", least(&held));
    assert!(error < 5e-3, "{error}");
}

#[test]
fn a_pair_that_is_too_near_moves_apart() {
    let ball = tool(&robots::arm7(), &start()) + Vec3::new(0.0, 0.0, 0.115); // the forearm overlaps the ball by 66 mm
    let (distances, _) = moved(limits(ball), ball, Vec3::zero());
    assert!(distances[0] < -0.06, "{}", distances[0]);
    // the time constant is 0.1 s: after 0.4 s, (1 + 4) e⁻⁴ of the initial error of 86 mm is left
    assert!((distances[400] - (MINIMUM - 0.086 * 5.0 * (-4.0_f64).exp())).abs() < 2e-3, "{}", distances[400]);
    assert!(distances[1000..].iter().all(|d| *d > MINIMUM - 1e-4), "{}", distances[1000]);
}

/// Checks that the arm yields to a ball that comes nearer, and earlier if the controller knows the ball's velocity.
#[test]
fn a_ball_that_comes_nearer_is_avoided() {
    let arm = robots::arm7();
    let speed = Vec3::new(0.0, -0.4, 0.0);
    let least = |is_known: bool| {
        let (mut q, mut v) = (start(), vec![0.0; 7]);
        let from = tool(&arm, &q) + Vec3::new(0.0, 0.4, 0.0);
        let at = |t: f64| Se3::new(Mat3::identity(), from + speed.scale(t));
        let ball = Geometry::in_world(Shape::sphere(Vec3::zero(), 0.08)).named("ball").at(at(0.0));
        let pairs = vec![GeometryPair::new(Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.03)), ball)];
        let mut seen = DistancePairs::new(&arm, &pairs).unwrap();
        let limits = DistanceLimits { minimum: MINIMUM, ..DistanceLimits::new(pairs) };
        let settings = Settings { distances: Some(limits), ..Settings::default() };
        let tasks = [Task::position("tool"), Task { weight: 1e-3, ..Task::posture() }];
        let mut controller = WholeBodyController::new(&arm, &[], &tasks, settings).unwrap();
        let references = controller.hold(&q).unwrap();
        let (mut distances, mut data, mut least) = (Distances::new(&seen), Data::new(&arm), f64::INFINITY);
        for k in 0..1000 {
            let t = DT * k as f64;
            let pairs = controller.pairs_mut().unwrap();
            let ball = pairs.find("ball").unwrap();
            pairs.place(ball, at(t));
            if is_known {
                pairs.set_velocity(ball, Motion::new(speed, Vec3::zero()));
            }
            let command = controller.step(&q, &v, &references);
            assert_eq!(command.status, Status::Solved);
            let step: Vec<f64> = v.iter().zip(&command.a).map(|(v, a)| DT * v + 0.5 * DT * DT * a).collect();
            v.iter_mut().zip(&command.a).for_each(|(v, a)| *v += DT * a);
            let before = q.clone();
            integrate(&arm, &before, &step, &mut q);
            seen.place(seen.find("ball").unwrap(), at(t + DT));
            seen.values(forward_kinematics(&arm, &mut data, &q), &mut distances);
            least = least.min(distances.distance(0));
        }
        least
    };
    let (known, unknown) = (least(true), least(false));
    assert!(known > MINIMUM - 1e-3, "{known}");
    assert!(unknown < known - 5e-3, "{unknown} without the velocity, {known} with it");
}

#[test]
fn invalid_limits_are_named() {
    let arm = robots::arm7();
    let fails = |limits: DistanceLimits| {
        let settings = Settings { distances: Some(limits), ..Settings::default() };
        WholeBodyController::new(&arm, &[], &[], settings).unwrap_err().to_string()
    };
    let good = || DistanceLimits::new(pairs(Vec3::zero()));
    for (limits, name) in [
        (DistanceLimits { minimum: f64::NAN, ..good() }, "distances.minimum"),
        (DistanceLimits { look_ahead: 0.0, ..good() }, "distances.look_ahead"),
        (DistanceLimits { max_acceleration: -1.0, ..good() }, "distances.max_acceleration"),
        (DistanceLimits { range: 0.0, ..good() }, "distances.range"),
    ] {
        assert!(fails(limits).contains(name));
    }
    let on_tol = Geometry::on("tol", Shape::sphere(Vec3::zero(), 0.1));
    let pair = GeometryPair::new(on_tol, Geometry::in_world(Shape::sphere(Vec3::zero(), 0.1)));
    let error = fails(DistanceLimits::new(vec![pair]));
    assert!(error.contains("pairs[0]") && error.contains("tol"), "{error}");
}
