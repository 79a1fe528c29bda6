//! Tests of distances: certificates by support functions, differences, symmetry, and movements of both shapes.
//!
//! The signed distance of convex sets A and B is the largest separation along a direction,
//!
//! ```text
//! d = max over unit vectors n of  min_{x in A} n·x − max_{y in B} n·y
//! ```
//!
//! So each direction gives a lower bound, and the normal of the result must attain the distance.

use crate::common::{all_models, normal3, random_pose, random_rotation, rng};
use crate::counting::allocations;
use condyle_dynamics::distances::prepared::PreparedPairs;
use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
use condyle_dynamics::{
    Act, Data, Error, Mat3, Model, Motion, Se3, Vec3, forward_kinematics, integrate, lie, neutral, robots,
};
use nalgebra::DMatrix;
use rand::RngExt;
use rand::rngs::StdRng;

/// Tolerance of closed forms, in m: rounding errors of numbers of about 1 m, times the number of operations.
const ROUNDING: f64 = 1e-12;
/// Tolerance of witness points and of bounds along directions that are found by a search, in m.
const SEARCHED: f64 = 1e-9;
/// Step of central differences.
const STEP: f64 = 1e-6;
/// Tolerance of central differences, relative to 1 + the largest entry: rounding errors divided by the step, and the
/// step's square times third derivatives.
const DIFFERENCES: f64 = 1e-7;

fn length(x: Vec3<f64>) -> f64 {
    x.norm_squared().sqrt()
}

pub(crate) fn random_shape(kind: usize, rng: &mut StdRng) -> Shape {
    let mut size = || 0.05 + 0.3 * rng.random::<f64>();
    let (a, b, c) = (size(), size(), size());
    match kind {
        0 => Shape::sphere(normal3(rng).scale(0.2), a),
        1 => Shape::capsule(normal3(rng).scale(0.3), normal3(rng).scale(0.3), 0.5 * a),
        2 => Shape::cuboid([a, b, c]),
        3 => Shape::Cylinder { radius: a, half_length: b },
        4 => Shape::Ellipsoid { radii: Vec3::new(a, b, c) },
        _ => Shape::HalfSpace { normal: random_rotation(rng).x, offset: 0.3 * (a - 0.2) },
    }
}

/// Returns max n·x of the points x of a shape whose coordinates have a pose.
fn reach(shape: &Shape, pose: &Se3<f64>, n: Vec3<f64>) -> f64 {
    let m = pose.rotation.transpose_mul(n);
    let local = match *shape {
        Shape::Sphere { center, radius } => m.dot(center) + radius,
        Shape::Capsule { ends, radius } => m.dot(ends[0]).max(m.dot(ends[1])) + radius,
        Shape::Box { half_sizes: h } => h.x * m.x.abs() + h.y * m.y.abs() + h.z * m.z.abs(),
        Shape::Cylinder { radius, half_length } => radius * m.x.hypot(m.y) + half_length * m.z.abs(),
        Shape::Ellipsoid { radii: r } => length(Vec3::new(r.x * m.x, r.y * m.y, r.z * m.z)),
        Shape::HalfSpace { normal, offset } => {
            if length(m - normal) < 1e-12 {
                offset
            } else {
                f64::INFINITY
            }
        }
        _ => unreachable!(),
    };
    local + n.dot(pose.translation)
}

/// Returns the separation of two placed shapes along n, which is at most their distance.
fn separation([a, b]: &[(Shape, Se3<f64>); 2], n: Vec3<f64>) -> f64 {
    -reach(&a.0, &a.1, -n) - reach(&b.0, &b.1, n)
}

/// Returns the largest separation: the best of many directions, improved by a search with smaller and smaller steps.
fn searched(both: &[(Shape, Se3<f64>); 2], rng: &mut StdRng) -> f64 {
    let mut best = (f64::NEG_INFINITY, Vec3::zero());
    for _ in 0..2000 {
        let n = random_rotation(rng).x;
        best = if separation(both, n) > best.0 { (separation(both, n), n) } else { best };
    }
    let mut step = 0.1;
    while step > 1e-10 {
        let mut better = false;
        for _ in 0..40 {
            let n = best.1 + normal3(rng).scale(step);
            let n = n.scale(1.0 / length(n));
            if separation(both, n) > best.0 {
                (best, better) = ((separation(both, n), n), true);
            }
        }
        step *= if better { 1.3 } else { 0.5 };
    }
    best.0
}

/// Returns whether a point is in a placed shape, up to a tolerance.
fn contains(shape: &Shape, pose: &Se3<f64>, p: Vec3<f64>) -> bool {
    let x = pose.act_inv(p);
    let tolerance = 1e-9;
    match *shape {
        Shape::Sphere { center, radius } => length(x - center) < radius + tolerance,
        Shape::Capsule { ends: [a, b], radius } => {
            let along = b - a;
            let t = (along.dot(x - a) / along.norm_squared().max(1e-30)).clamp(0.0, 1.0);
            length(x - a - along.scale(t)) < radius + tolerance
        }
        Shape::Box { half_sizes: h } => (0..3).all(|i| x.to_array()[i].abs() < h.to_array()[i] + tolerance),
        Shape::Cylinder { radius, half_length } => {
            x.x.hypot(x.y) < radius + tolerance && x.z.abs() < half_length + tolerance
        }
        Shape::Ellipsoid { radii: r } => length(Vec3::new(x.x / r.x, x.y / r.y, x.z / r.z)) < 1.0 + tolerance / 0.05,
        Shape::HalfSpace { normal, offset } => normal.dot(x) < offset + tolerance,
        _ => unreachable!(),
    }
}

/// Computes the distance of two shapes with poses in the world. The first shape is on the tool of an arm.
pub(crate) fn measured([a, b]: &[(Shape, Se3<f64>); 2]) -> (f64, [Vec3<f64>; 2], Vec3<f64>) {
    let (arm, q) = (robots::arm7(), [0.3; 7]);
    let mut data = Data::new(&arm);
    let placements = forward_kinematics(&arm, &mut data, &q);
    let tool = placements.frame(arm.frame("tool").unwrap());
    let first = Geometry::on("tool", a.0).at(tool.inverse() * a.1);
    let pair = GeometryPair::new(first, Geometry::in_world(b.0).at(b.1));
    let pairs = DistancePairs::new(&arm, &[pair]).unwrap();
    let mut distances = Distances::new(&pairs);
    pairs.values(placements, &mut distances);
    (distances.distance(0), distances.points(0), distances.normal(0))
}

/// Returns all kinds of pairs with an exact distance.
pub(crate) fn exact_kinds() -> impl Iterator<Item = [usize; 2]> {
    let exact = |[a, b]: [usize; 2]| {
        let (curved, simple) = (|k: usize| k == 3 || k == 4, |k: usize| k == 0 || k == 5);
        [a, b] != [5, 5] && (!curved(a) || simple(b)) && (!curved(b) || simple(a))
    };
    (0..36).map(|k| [k / 6, k % 6]).filter(move |&kinds| exact(kinds))
}

/// Checks each pair of kinds at random poses, apart and overlapping: the normal attains the distance, no other
/// direction separates more, and the witness points are in the shapes.
#[test]
fn the_normal_certifies_the_distance() {
    let mut random = rng(1);
    for kinds in exact_kinds() {
        let mut overlapping = 0;
        for case in 0..60 {
            let both = kinds.map(|kind| {
                let mut pose = random_pose(&mut random);
                pose.translation = pose.translation.scale([0.1, 0.5, 1.5][case % 3]);
                (random_shape(kind, &mut random), pose)
            });
            let (d, [p, q], n) = measured(&both);
            let text = format!("{both:?}: {d}");
            assert!((length(n) - 1.0).abs() < ROUNDING, "{text}");
            assert!(length(p - q - n.scale(d)) < SEARCHED, "{text}");
            if kinds.contains(&5) {
                let side = usize::from(kinds[0] == 5);
                let (Shape::HalfSpace { normal, offset }, pose) = both[1 - side] else { unreachable!() };
                let m = pose.rotation * normal;
                let expected = -reach(&both[side].0, &both[side].1, -m) - offset - m.dot(pose.translation);
                assert!((d - expected).abs() < ROUNDING, "{text}, expected {expected}");
            } else {
                assert!((separation(&both, n) - d).abs() < SEARCHED, "{text}, along n {}", separation(&both, n));
                let found = searched(&both, &mut random);
                assert!(found < d + SEARCHED, "{text}, found {found}");
            }
            for ((shape, pose), point) in both.iter().zip([p, q]) {
                assert!(contains(shape, pose, point), "{text}, {point:?} is outside of {shape:?}");
            }
            overlapping += usize::from(d < 0.0);
        }
        assert!(overlapping > 5, "{kinds:?}: {overlapping} pairs overlap");
    }
}

/// Checks that the order of both shapes changes only signs, and that a movement of both changes nothing.
#[test]
fn order_and_movement_do_not_matter() {
    let mut random = rng(2);
    for kinds in exact_kinds() {
        for _ in 0..20 {
            let both = kinds.map(|kind| (random_shape(kind, &mut random), random_pose(&mut random)));
            let X = random_pose(&mut random);
            let (d, [p, q], n) = measured(&both);
            let (swapped, [q2, p2], m) = measured(&[both[1], both[0]]);
            let (moved, points, turned) = measured(&both.map(|(shape, pose)| (shape, X * pose)));
            assert!((d - swapped).abs() < ROUNDING && (d - moved).abs() < 1e-10, "{both:?}: {d} {swapped} {moved}");
            assert!(length(n + m) < 1e-7 && length(X.rotation * n - turned) < 1e-7, "{both:?}: {n:?} {m:?} {turned:?}");
            let apart = [length(p - p2), length(q - q2), length(X.act(p) - points[0]), length(X.act(q) - points[1])];
            assert!(apart.iter().all(|&x| x < 1e-6), "{both:?}: {apart:?}");
        }
    }
}

/// Checks parallel, crossing and degenerate capsules, whose distances are known.
#[test]
fn special_capsules() {
    let at = |x: f64, y: f64, z: f64| Se3::new(Mat3::identity(), Vec3::new(x, y, z));
    let along_x = Shape::capsule([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0.1);
    let along_y = Shape::capsule([0.0, -0.5, 0.0], [0.0, 0.5, 0.0], 0.2);
    let point = Shape::capsule([0.0; 3], [0.0; 3], 0.1);
    let d = |a: Shape, x: Se3<f64>, b: Shape, y: Se3<f64>| measured(&[(a, x), (b, y)]).0;
    let check = |found: f64, expected: f64| assert!((found - expected).abs() < ROUNDING, "{found} {expected}");
    check(d(along_x, at(0.0, 0.0, 0.5), along_x, at(0.0, 0.0, 0.0)), 0.3); // parallel, side by side
    check(d(along_x, at(0.7, 0.4, 0.3), along_x, at(0.0, 0.0, 0.0)), 0.3); // parallel, they overlap along x in part
    check(d(along_x, at(1.3, 0.0, 0.4), along_x, at(0.0, 0.0, 0.0)), 0.3); // parallel, one after the other
    check(d(along_x, at(1.5, 0.0, 0.0), along_x, at(0.0, 0.0, 0.0)), 0.3); // on one line
    check(d(along_x, at(0.2, 0.0, 0.0), along_x, at(0.0, 0.0, 0.0)), -0.2); // on one line, inside of each other
    check(d(along_x, at(0.1, 0.2, 0.4), along_y, at(0.0, 0.0, 0.0)), 0.1); // crossing
    check(d(along_x, at(0.1, 0.2, 0.0), along_y, at(0.0, 0.0, 0.0)), -0.3); // crossing in one plane
    check(d(point, at(0.0, 0.3, 0.4), along_x, at(0.0, 0.0, 0.0)), 0.3);
    check(d(point, at(0.0, 0.0, 0.0), point, at(0.0, 0.0, 0.0)), -0.2);
    check(d(point, at(0.2, 0.0, 0.0), along_x, at(0.0, 0.0, 0.0)), -0.2);
    let (.., n) = measured(&[(along_x, at(0.1, 0.2, 0.0)), (along_y, at(0.0, 0.0, 0.0))]);
    assert!((n.z.abs() - 1.0).abs() < ROUNDING, "{n:?}");
    // nearly parallel, for all orders of magnitude of the angle
    for k in 0..40 {
        let angle = 10.0_f64.powf(-0.5 * f64::from(k));
        let turned = Shape::capsule([-0.5, 0.0, -0.5 * angle], [0.5, 0.0, 0.5 * angle], 0.0);
        check(d(turned, at(0.1, 0.3, 0.0), along_x, at(0.0, 0.0, 0.0)), 0.2);
    }
}

/// Checks points at the centre, on the axes and near the surface of an ellipsoid and a cylinder.
#[test]
fn special_points_of_curved_shapes() {
    let distance = |shape, p: [f64; 3]| measured(&[(Shape::sphere(p, 0.0), Se3::identity()), (shape, Se3::identity())]);
    let check = |shape, p: [f64; 3], expected: f64| {
        let (d, [_, x], n) = distance(shape, p);
        assert!((d - expected).abs() < ROUNDING, "{p:?}: {d} {expected}");
        assert!(length(Vec3::from(p) - x - n.scale(d)) < ROUNDING, "{p:?}: {x:?} {n:?}");
    };
    let egg = Shape::Ellipsoid { radii: Vec3::new(0.3, 0.2, 0.1) };
    check(egg, [0.0; 3], -0.1);
    check(egg, [0.4, 0.0, 0.0], 0.1);
    check(egg, [0.0, 0.0, 0.05], -0.05);
    check(egg, [0.0, 0.2, 0.0], 0.0);
    check(egg, [0.29, 0.0, 0.0], -0.01); // beyond the centre of curvature at the tip, 0.3 − 0.1²/0.3
    check(egg, [0.29, 0.0, 1e-30], -0.01);
    let ball = Shape::Ellipsoid { radii: Vec3::new(0.2, 0.2, 0.2) };
    check(ball, [0.0; 3], -0.2);
    check(ball, [0.1, -0.2, 0.2], 0.1);
    let disc = Shape::Ellipsoid { radii: Vec3::new(0.3, 0.3, 0.1) };
    check(disc, [0.0, 0.0, -0.2], 0.1);
    check(disc, [0.0, -0.5, 0.0], 0.2);
    let can = Shape::Cylinder { radius: 0.1, half_length: 0.3 };
    check(can, [0.0; 3], -0.1);
    check(can, [0.0, 0.0, 0.29], -0.01);
    check(can, [0.0, 0.0, -0.5], 0.2);
    check(can, [0.0, 0.3, 0.0], 0.2);
    check(can, [0.4, 0.0, 0.7], 0.5);
}

/// Returns pairs of all kinds on random bodies of a robot; every third pair has an obstacle in the world.
fn pairs_on(model: &Model, random: &mut StdRng) -> Vec<GeometryPair> {
    let kinds: Vec<_> = exact_kinds().chain([[3, 3], [4, 2], [1, 3]]).collect();
    let pair = |(k, kinds): (usize, &[usize; 2])| loop {
        let [a, b] = kinds.map(|kind| {
            let frame = &model.frames()[random.random_range(0..model.frames().len())];
            Geometry::on(frame, random_shape(kind, random)).at(random_pose(random))
        });
        let pair = match k % 3 {
            0 => GeometryPair::new(a, Geometry { frame: None, ..b }),
            1 => GeometryPair::new(Geometry { frame: None, ..a }, b),
            _ => GeometryPair::new(a, b),
        };
        if pair.resolve(model, k).is_ok() {
            break pair; // two geometries of one body are refused
        }
    };
    kinds.iter().enumerate().map(pair).collect()
}

/// Compares gradients with central differences of the distances along each coordinate, on trees with all joints.
#[test]
fn gradients_are_derivatives() {
    for (seed, model) in all_models(4).iter().enumerate() {
        let mut random = rng(seed as u64);
        let pairs = DistancePairs::new(model, &pairs_on(model, &mut random)).unwrap();
        let q = condyle_dynamics::random_configuration(model, &mut random);
        let mut data = Data::new(model);
        let mut distances = [(); 3].map(|()| Distances::new(&pairs));
        pairs.gradients(forward_kinematics(model, &mut data, &q), &mut distances[0]);
        for i in 0..model.nv() {
            for (side, step) in [(1, STEP), (2, -STEP)] {
                let mut delta = vec![0.0; model.nv()];
                delta[i] = step;
                let mut moved = vec![0.0; model.nq()];
                integrate(model, &q, &delta, &mut moved);
                pairs.values(forward_kinematics(model, &mut data, &moved), &mut distances[side]);
            }
            for k in 0..pairs.len() {
                let [_, up, down] = [0, 1, 2].map(|side| distances[side].distance(k));
                let (difference, found) = ((up - down) / (2.0 * STEP), distances[0].gradient(k)[i]);
                assert!(
                    (difference - found).abs() < DIFFERENCES * (1.0 + found.abs()) * 10.0,
                    "robot {seed}, pair {k}, coordinate {i}: {difference} {found}"
                );
            }
        }
    }
}

/// Checks Jᵀ W J, the broad phase, and the nearest pair.
#[test]
fn results_of_many_pairs() {
    let (model, mut random) = (robots::humanoid(), rng(5));
    let mut pairs = DistancePairs::new(&model, &pairs_on(&model, &mut random)).unwrap();
    let (mut data, q) = (Data::new(&model), neutral(&model));
    let mut distances = Distances::new(&pairs);
    pairs.gradients(forward_kinematics(&model, &mut data, &q), &mut distances);
    let weights: Vec<f64> = (0..pairs.len()).map(|k| 1.0 + k as f64).collect();
    let mut H = DMatrix::zeros(model.nv(), model.nv());
    distances.add_gauss_newton(&weights, &mut H);
    let J = DMatrix::from_row_slice(pairs.len(), model.nv(), distances.gradients());
    let expected = J.transpose() * DMatrix::from_diagonal(&weights.into()) * &J;
    assert!((H - &expected).amax() < ROUNDING * (1.0 + expected.amax()));

    let exact = distances.clone();
    let (nearest, least) = exact.nearest().unwrap();
    assert!(exact.distances().iter().all(|&d| d >= least) && exact.distance(nearest) == least);
    let cutoff = 0.3;
    pairs.set_cutoff(cutoff);
    pairs.gradients(forward_kinematics(&model, &mut data, &q), &mut distances);
    let mut far = 0;
    for k in 0..pairs.len() {
        if distances.is_near(k) {
            assert!(distances.distance(k) == exact.distance(k) && distances.gradient(k) == exact.gradient(k));
        } else {
            assert!(distances.distance(k) > cutoff && distances.distance(k) <= exact.distance(k) + ROUNDING);
            assert!(distances.gradient(k).iter().all(|&x| x == 0.0));
            far += 1;
        }
    }
    assert!(far > 0 && far < pairs.len(), "{far}");
}

/// Checks that evaluations, changes of placements and copies of results do not allocate later.
#[test]
fn evaluations_do_not_allocate() {
    for (seed, model) in all_models(1).iter().enumerate() {
        let mut random = rng(seed as u64);
        let mut pairs = DistancePairs::new(model, &pairs_on(model, &mut random)).unwrap();
        let mut data = Data::new(model);
        let mut distances = Distances::new(&pairs).clone();
        let mut H = DMatrix::zeros(model.nv(), model.nv());
        let weights = vec![1.0; pairs.len()];
        let q = neutral(model);
        for cutoff in [f64::INFINITY, 0.2] {
            pairs.set_cutoff(cutoff);
            let count = allocations(|| {
                let placements = forward_kinematics(model, &mut data, &q);
                pairs.place(0, Se3::identity());
                pairs.values(placements, &mut distances);
                pairs.gradients(placements, &mut distances);
                distances.add_gauss_newton(&weights, &mut H);
            });
            assert_eq!(count, 0);
        }
    }
}

/// Checks that a replaced cylinder is reported, that its capsule contains it, and that equal geometries are shared.
#[test]
fn replaced_shapes_are_reported() {
    let (arm, mut random) = (robots::arm7(), rng(6));
    let can = Geometry::on("tool", Shape::Cylinder { radius: 0.1, half_length: 0.2 });
    let others = [random_shape(2, &mut random), random_shape(0, &mut random), random_shape(3, &mut random)];
    let list = others.map(|shape| GeometryPair::new(can.clone(), Geometry::in_world(shape)));
    let pairs = DistancePairs::new(&arm, &list).unwrap();
    let found: Vec<_> = pairs.replacements().iter().map(|r| (r.pair, r.side)).collect();
    assert_eq!(found, [(0, 0), (2, 0), (2, 1)]);
    assert_eq!(pairs.geometry_count(), 5); // the cylinder and its capsule, and three obstacles
    assert_eq!(pairs.geometries_of(0)[0], pairs.geometries_of(2)[0]);
    for kind in [3, 4] {
        for _ in 0..20 {
            let shape = random_shape(kind, &mut random);
            for _ in 0..200 {
                let n = random_rotation(&mut random).x;
                let inside = reach(&shape, &Se3::identity(), n);
                let outside = reach(&shape.containing_capsule(), &Se3::identity(), n);
                assert!(inside <= outside + ROUNDING, "{shape:?} {n:?}");
            }
        }
    }
}

/// Checks the rate ∂d/∂t of obstacles that move and turn against differences of distances.
#[test]
fn rates_are_differences() {
    const STEP: f64 = 1e-6;
    let (arm, mut random) = (robots::arm7(), rng(8));
    let (mut data, mut compared) = (Data::new(&arm), 0);
    for trial in 0..200 {
        let part = Geometry::on("tool", random_shape(trial % 3, &mut random));
        let pose = random_pose(&mut random);
        let obstacle = Geometry::in_world(random_shape(trial / 3 % 3, &mut random)).named("obstacle").at(pose);
        let sides = if trial % 2 == 0 { [part, obstacle] } else { [obstacle, part] };
        let [first, second] = sides;
        let mut pairs = DistancePairs::new(&arm, &[GeometryPair::new(first, second)]).unwrap();
        let (geometry, mut found) = (pairs.find("obstacle").unwrap(), Distances::new(&pairs));
        let velocity = Motion::new(normal3(&mut random), normal3(&mut random));
        let placements = forward_kinematics(&arm, &mut data, &[0.3; 7]);
        let mut distance = |pairs: &mut DistancePairs, dt: f64| {
            let turn = lie::exp3(velocity.angular.scale(dt)).to_rotation();
            pairs.place(geometry, Se3::new(turn * pose.rotation, pose.translation + velocity.linear.scale(dt)));
            pairs.values(placements, &mut found);
            (found.distance(0), pairs.rate(&found, 0), found.normal(0))
        };
        assert_eq!(distance(&mut pairs, 0.0).1, 0.0); // at rest
        pairs.set_velocity(geometry, velocity);
        let [before, now, after] = [-STEP, 0.0, STEP].map(|dt| distance(&mut pairs, dt));
        if (before.2 - after.2).norm_squared() > 1e-6 {
            continue; // the nearest points jump between two edges
        }
        let difference = (after.0 - before.0) / (2.0 * STEP);
        assert!((difference - now.1).abs() < 1e-6 * (1.0 + now.1.abs()), "trial {trial}: {difference}, {}", now.1);
        compared += 1;
    }
    assert!(compared > 180, "{compared}");
}

#[test]
fn wrong_geometries_are_refused() {
    let arm = robots::arm7();
    let good = || Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    let said = |first: Geometry, second: Geometry| match DistancePairs::new(&arm, &[GeometryPair::new(first, second)]) {
        Err(error @ Error::Geometry { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let world = |shape| Geometry::in_world(shape);
    let text = said(world(Shape::cuboid([1.0, -0.1, 0.2])).named("crate"), good());
    assert_eq!(text, "pairs[0].first (`crate`): half_sizes is -0.1, expected at least 0");
    let text = said(good(), world(Shape::Ellipsoid { radii: Vec3::new(0.1, 0.0, 0.1) }));
    assert_eq!(text, "pairs[0].second (ellipsoid in the world): radii holds 0, expected more than 0");
    let text = said(good(), world(Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 2.0), offset: 0.0 }));
    assert_eq!(text, "pairs[0].second (half-space in the world): normal has the length 2, expected a unit vector");
    let text = said(good(), world(Shape::capsule([f64::NAN, 0.0, 0.0], [0.0; 3], 0.1)));
    assert_eq!(text, "pairs[0].second (capsule in the world): ends holds a NaN");
    let text = said(world(Shape::sphere([0.0; 3], 0.1)), world(Shape::sphere([0.0; 3], 0.1)));
    assert!(text.starts_with("pairs[0] (sphere in the world and sphere in the world): "), "{text}");
    assert!(text.ends_with("has no frame: expected at least one geometry on the robot"), "{text}");
    let floor = Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 };
    let text = said(Geometry::on("tool", floor), world(floor));
    assert!(text.starts_with("pairs[0] (half-space on `tool` and half-space in the world): "), "{text}");
    assert!(text.ends_with("has two half-spaces, whose distance is not defined"), "{text}");
    let scaled = Se3::new(Mat3::identity().scale(2.0), Vec3::zero());
    let text = said(good().at(scaled), good());
    assert_eq!(text, "pairs[0].first (sphere on `tool`): placement.rotation is not a rotation matrix");
    let text = said(Geometry::on("tol", Shape::sphere([0.0; 3], 0.1)), good());
    assert!(text.starts_with("pairs[0].first (sphere on `tol`): frame: unknown frame `tol`"), "{text}");
    let huge = said(good(), world(Shape::sphere([0.0; 3], 1e200)));
    assert_eq!(huge, "pairs[0].second (sphere in the world): radius holds 1e200, expected at most 1e30");
}

/// Checks lists whose pairs are valid one by one, and pairs whose distance has no meaning.
#[test]
fn ambiguous_pairs_are_refused() {
    let arm = robots::arm7();
    let said = |list: &[GeometryPair]| {
        let text = DistancePairs::new(&arm, list).unwrap_err().to_string();
        assert_eq!(PreparedPairs::new(&arm, list).unwrap_err().to_string(), text);
        text
    };
    let ball = |radius| Shape::sphere([0.5, 0.0, 0.4], radius);
    let (tool, elbow) = (Geometry::on("tool", ball(0.05)).named("tip"), Geometry::on("link4", ball(0.1)));
    let crate_ = Geometry::in_world(ball(0.1)).named("crate");
    let pair = |a: &Geometry, b: &Geometry| GeometryPair::new(a.clone(), b.clone());
    let shift = Se3::new(Mat3::identity(), Vec3::new(0.0, 0.1, 0.0));
    for (other, field) in [
        (Geometry { shape: Shape::cuboid([0.1; 3]), ..crate_.clone() }, "shape"),
        (Geometry { shape: ball(0.2), ..crate_.clone() }, "shape"),
        (Geometry { frame: Some("link1".into()), ..crate_.clone() }, "frame"),
        (crate_.clone().at(shift), "placement"),
    ] {
        let text = said(&[pair(&tool, &crate_), pair(&elbow, &other)]);
        assert_eq!(text, format!("pairs[1].second (`crate`): has the name of pairs[0].second, but another {field}"));
    }
    let text = said(&[pair(&crate_, &tool), pair(&elbow, &Geometry { name: "tip".to_owned(), ..crate_.clone() })]);
    assert_eq!(text, "pairs[1].second (`tip`): has the name of pairs[0].second, but another shape");
    let text = said(&[pair(&tool, &crate_), pair(&elbow, &crate_), pair(&crate_, &tool)]);
    assert_eq!(text, "pairs[2] (`crate` and `tip`): is the same pair as pairs[0]");
    assert_eq!(
        said(&[pair(&tool, &tool)]),
        "pairs[0] (`tip` and `tip`): is a geometry with itself: expected two \
        different geometries"
    );
    let text = said(&[pair(&tool, &Geometry { name: "other".to_owned(), ..tool.clone() }.at(shift))]);
    let body = &arm.bodies()[tool.resolve(&arm).unwrap().0].name;
    let expected = format!("has two geometries of the body `{body}`, whose distance never changes");
    assert_eq!(text, format!("pairs[0] (`tip` and `other`): {expected}"));
    // equal geometries without a name, and one name in several pairs, are valid
    let unnamed = Geometry { name: String::new(), ..crate_.clone() };
    let list = [pair(&tool, &crate_), pair(&tool, &unnamed), pair(&elbow, &crate_), pair(&elbow, &unnamed)];
    assert_eq!(DistancePairs::new(&arm, &list).unwrap().geometry_count(), 4);
}

/// Checks that the smallest and the largest shapes have finite distances and gradients.
#[test]
fn extreme_sizes_have_finite_results() {
    let (arm, up) = (robots::arm7(), Vec3::new(0.0, 0.0, 1.0));
    let mut data = Data::new(&arm);
    for size in [0.0_f64, 1e-300, 1e-30, 1.0, 1e30] {
        let egg = Vec3::new(1.0, 2.0, 3.0).scale(size.clamp(1e-30, 1e29));
        let shapes = [
            Shape::sphere([0.0, 0.0, 0.1 * size], size),
            Shape::capsule([0.0; 3], [0.0, 0.5 * size, size], size),
            Shape::cuboid([size, 0.5 * size, 0.0]),
            Shape::Cylinder { radius: size, half_length: 0.5 * size },
            Shape::Ellipsoid { radii: egg },
            Shape::HalfSpace { normal: up, offset: -size },
        ];
        let ours =
            [Shape::sphere([0.0; 3], size), Shape::capsule([0.0; 3], [0.0, 0.0, 0.1], 0.0), shapes[2], shapes[4]];
        let each = ours.iter().flat_map(|&on| shapes.iter().map(move |&other| (on, other)));
        let list: Vec<_> =
            each.map(|(on, other)| GeometryPair::new(Geometry::on("tool", on), Geometry::in_world(other))).collect();
        let pairs = DistancePairs::new(&arm, &list).unwrap();
        let mut found = Distances::new(&pairs);
        pairs.gradients(forward_kinematics(&arm, &mut data, &[0.3; 7]), &mut found);
        for (k, pair) in list.iter().enumerate() {
            let numbers = [found.distance(k), length(found.normal(k))];
            let is_finite = numbers.iter().chain(found.gradient(k)).all(|x| x.is_finite());
            assert!(is_finite && (numbers[1] - 1.0).abs() < 1e-9, "{pair} of size {size}: {numbers:?}");
        }
    }
}

/// Checks that a cylinder moves in all pairs, also where a capsule replaces it.
#[test]
fn a_replaced_obstacle_moves_in_all_pairs() {
    let (arm, q) = (robots::arm7(), [0.3; 7]);
    let mut data = Data::new(&arm);
    let placements = forward_kinematics(&arm, &mut data, &q);
    let tool = placements.frame(arm.frame("tool").unwrap()).translation;
    let at = |height: f64| Se3::new(Mat3::identity(), tool + Vec3::new(0.0, 0.0, height));
    let parts = [Shape::sphere([0.0; 3], 0.05), Shape::capsule([0.0; 3], [0.0, 1e-3, 0.0], 0.05)];
    let can = Geometry::in_world(Shape::Cylinder { radius: 0.1, half_length: 0.2 }).named("can");
    let list = parts.map(|part| GeometryPair::new(Geometry::on("tool", part), can.clone()));
    let mut pairs = DistancePairs::new(&arm, &list).unwrap();
    let (index, mut found) = (pairs.find("can").unwrap(), Distances::new(&pairs));
    let velocity = Motion::new(Vec3::new(0.0, 0.0, 0.5), Vec3::zero());
    pairs.set_velocity(index, velocity);
    for height in [1.0, 2.0] {
        pairs.place(index, at(height));
        pairs.values(placements, &mut found);
        // the flat end of the cylinder, and the round end of the capsule
        assert!((found.distance(0) - (height - 0.2 - 0.05)).abs() < ROUNDING, "{}", found.distance(0));
        assert!((found.distance(1) - (height - 0.3 - 0.05)).abs() < 1e-3, "{}", found.distance(1));
        for pair in 0..2 {
            assert!((pairs.rate(&found, pair) - 0.5).abs() < 1e-5, "{}", pairs.rate(&found, pair));
        }
    }
}
