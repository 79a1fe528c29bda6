//! Steps and searches keep the distances of pairs.

use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
use condyle_dynamics::{
    Data, Mat3, Model, Motion, Se3, Vec3, forward_kinematics, integrate, random_configuration, robots,
};
use condyle_ik::{
    DifferentialIk, DistanceLimits, GlobalIk, Held, Outcome, Rank, SearchSettings, Settings, Status, Task,
};
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Amount by which a distance may fall below its minimum (m): a step takes distances as linear in q.
const CURVED: f64 = 2e-3;

fn ball(frame: &str, radius: f64) -> Geometry {
    Geometry::on(frame, Shape::sphere(Vec3::zero(), radius)).named(frame)
}

fn obstacle(at: Vec3<f64>, radius: f64) -> Geometry {
    Geometry::in_world(Shape::sphere(at, radius)).named("obstacle")
}

/// Returns the smallest distance of the pairs at q.
fn smallest(model: &Model, pairs: &[GeometryPair], q: &[f64]) -> f64 {
    let pairs = DistancePairs::new(model, pairs).unwrap();
    let mut distances = Distances::new(&pairs);
    pairs.values(forward_kinematics(model, &mut Data::new(model), q), &mut distances);
    distances.distances().iter().copied().fold(f64::INFINITY, f64::min)
}

fn advance(ik: &mut DifferentialIk, q: &mut [f64], targets: &condyle_ik::Targets) {
    let dt = ik.settings().dt;
    let v0 = vec![0.0; ik.model().nv()];
    let x: Vec<f64> = ik.step(q, &v0, targets).unwrap().v.iter().map(|v| dt * v).collect();
    let from = q.to_vec();
    integrate(ik.model(), &from, &x, q);
}

fn arm(pairs: Vec<GeometryPair>) -> DifferentialIk {
    let limits = DistanceLimits { minimum: 0.02, ..DistanceLimits::new(pairs) };
    let settings = Settings { distances: Some(limits), ..Settings::default() };
    let tasks = [Task { damping: 0.1, gain: 0.2, ..Task::position("tool") }, Task::posture()];
    DifferentialIk::new(&robots::arm7(), &tasks, settings).unwrap()
}

#[test]
fn an_obstacle_in_the_way_is_kept_at_a_distance() {
    let model = robots::arm7();
    let mut q = vec![0.3, 0.6, 0.0, 1.2, 0.0, 0.8, 0.0];
    let tool = model.frame("tool").unwrap();
    let from = forward_kinematics(&model, &mut Data::new(&model), &q).frame(tool).translation;
    let shift = Vec3::new(0.0, -0.3, 0.0);
    let pairs = vec![GeometryPair::new(ball("tool", 0.04), obstacle(from + shift.scale(0.5), 0.06))];
    let mut ik = arm(pairs.clone());
    let mut targets = ik.hold(&q).unwrap();
    targets.frames[0].translation = from + shift;
    let mut held = false;
    for _ in 0..400 {
        advance(&mut ik, &mut q, &targets);
        held |= ik.last().held.contains(&Held::Pair(0));
        assert_eq!(ik.last().status, Status::Solved);
        let d = smallest(&model, &pairs, &q);
        assert!(d > 0.02 - CURVED, "{d}");
    }
    assert!(held);
    assert_eq!(ik.describe(Held::Pair(0)), "distance of `tool` and `obstacle`");
}

#[test]
fn pairs_that_are_too_near_move_apart() {
    let model = robots::arm7();
    let mut q = vec![0.3, 0.6, 0.0, 1.2, 0.0, 0.8, 0.0];
    let tool = model.frame("tool").unwrap();
    let at = forward_kinematics(&model, &mut Data::new(&model), &q).frame(tool).translation;
    let pairs = vec![GeometryPair::new(ball("tool", 0.04), obstacle(at + Vec3::new(0.05, 0.02, 0.0), 0.06))];
    let mut ik = arm(pairs.clone());
    let targets = ik.hold(&q).unwrap();
    let (mut before, first) = (smallest(&model, &pairs, &q), smallest(&model, &pairs, &q));
    assert!(first < 0.0);
    for _ in 0..200 {
        advance(&mut ik, &mut q, &targets);
        let d = smallest(&model, &pairs, &q);
        assert!(d > before.min(0.02 - CURVED) - 1e-9, "{d} after {before}");
        before = d;
    }
    assert!(before > 0.02 - CURVED, "{before}");
}

/// Checks that steps take into account how an obstacle moves.
#[test]
fn an_obstacle_that_comes_nearer_is_kept_at_a_distance() {
    let model = robots::arm7();
    let speed = Vec3::new(0.0, -0.5, 0.0);
    let start = vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0];
    let tool = model.frame("tool").unwrap();
    let from = forward_kinematics(&model, &mut Data::new(&model), &start).frame(tool).translation;
    let at = |t: f64| Se3::new(Mat3::identity(), from + Vec3::new(0.0, 0.4, 0.0) + speed.scale(t));
    let least = |is_known: bool| {
        let mut ik = arm(vec![GeometryPair::new(ball("tool", 0.03), obstacle(Vec3::zero(), 0.08))]);
        let (mut q, targets) = (start.clone(), ik.hold(&start).unwrap());
        let (dt, mut least) = (ik.settings().dt, f64::INFINITY);
        for k in 0..120 {
            let pairs = ik.pairs_mut().unwrap();
            let moving = pairs.find("obstacle").unwrap();
            pairs.place(moving, at(dt * f64::from(k)));
            if is_known {
                pairs.set_velocity(moving, Motion::new(speed, Vec3::zero()));
            }
            advance(&mut ik, &mut q, &targets);
            least = least.min(ik.nearest().unwrap().1);
        }
        least
    };
    let (known, unknown) = (least(true), least(false));
    assert!(known > 0.02 - CURVED, "{known}");
    assert!(unknown < known - 5e-3, "{unknown} without the velocity, {known} with it");
}

/// Two obstacles squeeze the tool from both sides: it cannot leave both at once, but it does not come nearer.
#[test]
fn contradictory_distances_are_relaxed() {
    let model = robots::arm7();
    let q = vec![0.3, 0.6, 0.0, 1.2, 0.0, 0.8, 0.0];
    let tool = model.frame("tool").unwrap();
    let at = forward_kinematics(&model, &mut Data::new(&model), &q).frame(tool).translation;
    let squeeze = [Vec3::new(0.05, 0.0, 0.0), Vec3::new(-0.05, 0.0, 0.0)];
    let mut pairs = squeeze.map(|by| GeometryPair::new(ball("tool", 0.04), obstacle(at + by, 0.06))).to_vec();
    pairs[1].second = pairs[1].second.clone().named("other obstacle");
    let mut ik = arm(pairs.clone());
    let targets = ik.hold(&q).unwrap();
    let mut next = q.clone();
    advance(&mut ik, &mut next, &targets);
    assert_eq!(ik.last().status, Status::Relaxed);
    assert!(smallest(&model, &pairs, &next) > smallest(&model, &pairs, &q) - 1e-6);
}

/// Pairs between the links of an arm, and between its links and a table.
fn self_pairs() -> Vec<GeometryPair> {
    let link = |name: &str| ball(name, 0.07);
    let table = Geometry::in_world(Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.3 }).named("table");
    let mut pairs: Vec<_> =
        ["link4", "link5", "link6", "tool"].map(|n| GeometryPair::new(link(n), table.clone())).into();
    pairs.extend(
        [("link1", "link5"), ("link1", "link6"), ("link2", "tool")].map(|(a, b)| GeometryPair::new(link(a), link(b))),
    );
    pairs
}

#[test]
fn searches_keep_pairs_apart() {
    let model = robots::arm7();
    let pairs = self_pairs();
    let settings = SearchSettings { pairs: pairs.clone(), minimum_distance: 0.01, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings).unwrap();
    let (mut rng, mut data) = (StdRng::seed_from_u64(1), Data::new(&model));
    let tool = model.frame("tool").unwrap();
    let (mut targets, mut refused) = (Vec::new(), 0);
    while targets.len() < 200 {
        let q = random_configuration(&model, &mut rng);
        match smallest(&model, &pairs, &q) > 0.01 {
            true => targets.push(forward_kinematics(&model, &mut data, &q).frame(tool)),
            false => refused += 1,
        }
    }
    assert!(refused > 20, "{refused}");
    let answers = ik.solve_many(&targets, &[0.5; 7]).unwrap();
    let mut reached = 0;
    for answer in answers.iter().filter(|answer| answer.reached()) {
        assert!(smallest(&model, &pairs, &answer.q) >= 0.01 - 1e-9);
        reached += 1;
    }
    assert!(reached >= 198, "{reached} of 200");
}

/// A single start pushes pairs apart only if postures are ranked by distance, so both ranks show what the push does.
#[test]
fn starts_push_pairs_apart() {
    let model = robots::arm7();
    let mut pairs = self_pairs();
    for k in 0..8 {
        let (sin, cos) = (f64::from(k) * core::f64::consts::FRAC_PI_4).sin_cos();
        let at = Se3::new(Mat3::identity(), Vec3::new(0.4 * cos, 0.4 * sin, 0.6));
        let post = Geometry::in_world(Shape::Box { half_sizes: Vec3::new(0.03, 0.03, 0.4) }).at(at);
        let post = post.named(format!("post {k}"));
        let ball = |frame: &str| ball(frame, 0.06).named(format!("ball of {frame}"));
        pairs.extend(["link4", "link5", "link6", "tool"].map(|n| GeometryPair::new(ball(n), post.clone())));
    }
    let (mut rng, mut data) = (StdRng::seed_from_u64(3), Data::new(&model));
    let tool = model.frame("tool").unwrap();
    let mut targets = Vec::new();
    while targets.len() < 200 {
        let q = random_configuration(&model, &mut rng);
        if smallest(&model, &pairs, &q) > 0.02 {
            targets.push(forward_kinematics(&model, &mut data, &q).frame(tool));
        }
    }
    let reached = |rank: Rank| {
        let once = SearchSettings { starts: 1, orientation_weight: 0.0, rank, ..SearchSettings::default() };
        let settings = SearchSettings { pairs: pairs.clone(), minimum_distance: 0.01, ..once };
        let answers = GlobalIk::new(&model, &["tool"], settings).unwrap().solve_many(&targets, &[0.5; 7]).unwrap();
        for answer in answers.iter().filter(|answer| answer.reached()) {
            assert!(smallest(&model, &pairs, &answer.q) >= 0.01 - 1e-9 && answer.error[0] <= 1e-4);
            model.check_position(&answer.q).unwrap();
        }
        answers.iter().filter(|answer| answer.reached()).count()
    };
    let (without, with) = (reached(Rank::First), reached(Rank::Nearest));
    assert!(without < 160 && with >= without + 30, "{without} without pushes, {with} with pushes, of 200");
}

#[test]
fn the_pair_that_excludes_a_target_is_named() {
    let model = robots::arm7();
    let tool = model.frame("tool").unwrap();
    let q = [0.3, 0.6, 0.0, 1.2, 0.0, 0.8, 0.0];
    let target: Se3<f64> = forward_kinematics(&model, &mut Data::new(&model), &q).frame(tool);
    let pairs = vec![GeometryPair::new(ball("tool", 0.05), obstacle(target.translation, 0.05))];
    let settings = SearchSettings { pairs, starts: 20, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings).unwrap();
    let answer = ik.solve(&[target], &[0.0; 7]).unwrap();
    let Outcome::Unreached { held } = &answer.outcome else { panic!("reached inside of an obstacle") };
    assert!(held.contains(&Held::Pair(0)), "{held:?}");
    assert_eq!(ik.describe(Held::Pair(0)), "distance of `tool` and `obstacle`");
}

#[test]
fn invalid_limits_are_refused() {
    let model = robots::arm7();
    let refused = |limits: DistanceLimits| {
        let settings = Settings { distances: Some(limits), ..Settings::default() };
        DifferentialIk::new(&model, &[Task::posture()], settings).unwrap_err().to_string()
    };
    let good = || DistanceLimits::new(vec![GeometryPair::new(ball("tool", 0.1), obstacle(Vec3::zero(), 0.1))]);
    assert!(refused(DistanceLimits { minimum: f64::NAN, ..good() }).contains("`distances.minimum` is NaN"));
    assert!(refused(DistanceLimits { look_ahead: 0.0, ..good() }).contains("`distances.look_ahead` is 0"));
    assert!(refused(DistanceLimits { range: -1.0, ..good() }).contains("`distances.range` is -1"));
    let pair = GeometryPair::new(ball("nowhere", 0.1), obstacle(Vec3::zero(), 0.1));
    assert!(refused(DistanceLimits::new(vec![pair.clone()])).contains("nowhere"));
    let settings = SearchSettings { pairs: vec![pair], ..SearchSettings::default() };
    assert!(GlobalIk::new(&model, &["tool"], settings).unwrap_err().to_string().contains("nowhere"));
}
