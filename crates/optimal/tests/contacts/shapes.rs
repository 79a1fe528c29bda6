//! Distances between shapes of all kinds as residuals: comparisons with the distances of the library, and limits that
//! the interior point holds.

use super::groups::check_group;
use super::*;
use condyle_dynamics::distances::{DistancePairs, Distances};
use condyle_dynamics::{Quaternion, Se3};
use condyle_optimal::InteriorPoint;
use condyle_optimal::robot::{Geometry, GeometryPair, Limit, Shape};

/// Returns a random shape of a kind.
fn shape(kind: usize, rng: &mut StdRng) -> Shape {
    let mut size = || 0.05 + 0.1 * rng.random::<f64>();
    let (a, b, c) = (size(), size(), size());
    match kind {
        0 => Shape::sphere([a, 0.0, b], c),
        1 => Shape::capsule([a, 0.0, -b], [0.0, c, b], a),
        2 => Shape::cuboid([a, b, c]),
        3 => Shape::Cylinder { radius: a, half_length: b },
        4 => Shape::Ellipsoid { radii: Vec3::new(a, b, c) },
        _ => Shape::HalfSpace { normal: Vec3::new(0.6, 0.0, 0.8), offset: -2.0 },
    }
}

/// Returns a geometry with a random placement on a random frame.
fn geometry(model: &Model, kind: usize, rng: &mut StdRng) -> Geometry {
    let [x, y, z, w] = core::array::from_fn(|_| rng.random::<f64>() - 0.5);
    let rotation = Quaternion::new(x, y, z, w).normalize().to_rotation();
    let frame = &model.frames()[rng.random_range(0..model.frames().len())];
    Geometry::on(frame, shape(kind, rng)).at(Se3::new(rotation, Vec3::new(0.2 * y, 0.2 * z, 0.2 * x)))
}

/// Returns pairs of all kinds, some with an obstacle in the world.
fn pairs(model: &Model, rng: &mut StdRng) -> Vec<GeometryPair> {
    let kinds = (0..36).map(|k| [k / 6, k % 6]).filter(|kinds| kinds[0] != 5 || kinds[1] != 5);
    let pair = |[a, b]: [usize; 2]| loop {
        let (first, second) = (geometry(model, a, rng), geometry(model, b, rng));
        let pair = match b {
            2 | 5 => GeometryPair::new(first, Geometry { frame: None, ..second }),
            _ => GeometryPair::new(first, second),
        };
        if pair.resolve(model, 0).is_ok() {
            break pair; // two geometries of one body are refused
        }
    };
    kinds.map(pair).collect()
}

/// Compares the sum of the distances and its gradient, weighted by random numbers, with the distances of the library.
#[test]
fn residuals_are_distances_of_the_library() {
    let mut rng = StdRng::seed_from_u64(71);
    for model in [robots::arm7(), robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let list = pairs(&model, &mut rng);
        let prepared = DistancePairs::new(&model, &list).unwrap();
        let (mut data, mut distances) = (Data::new(&model), Distances::new(&prepared));
        let x = random_state(&model, &mut rng);
        prepared.gradients(forward_kinematics(&model, &mut data, &x[..model.nq()]), &mut distances);
        let (mut far, mut near) = (0, 0);
        for (k, pair) in list.into_iter().enumerate() {
            let d = distances.distance(k);
            // with a range r, an entry is min(d, r), without derivatives above r
            for range in [f64::INFINITY, 0.3, 0.05] {
                let residual = Residual::Distances { pairs: vec![pair.clone()], range };
                let costs = vec![Cost::new("one", 1.0, residual, Activation::Sum)];
                let mut action = FreeDynamics::terminal(model.clone(), costs).unwrap();
                let mut knot = LqKnot::zeros(action.ndx(), 0);
                let value = action.calc(0, &x, &[], &mut vec![0.0; x.len()]);
                action.calc_diff(0, &x, &[], &mut knot);
                assert!((value - d.min(range)).abs() < ROUNDING, "{k}: {value} {d} {range}");
                let row = &knot.q.as_slice()[..model.nv()];
                let zeros = vec![0.0; model.nv()];
                let expected = if d < range { distances.gradient(k) } else { &zeros };
                assert!(largest_difference(row, expected) < ROUNDING, "{k}: {row:?}");
            }
            (far, near) = (far + usize::from(d > 0.3), near + usize::from(d < 0.3));
        }
        assert!(far > 3 && near > 3, "{far} far and {near} near pairs");
    }
}

/// Checks that knots with other shapes of the same kinds, and with other kinds, have the bits of single knots.
#[test]
fn knots_with_other_shapes_are_single_knots() {
    let mut rng = StdRng::seed_from_u64(72);
    let model = Arc::new(robots::quadruped().with_limbs(false)); // parallel branches change the order of sums
    let common = pairs(&model, &mut rng);
    let apart = |pairs| vec![Cost::new("apart", 0.7, Residual::distances(pairs), Activation::Smooth1 { epsilon: 0.1 })];
    let mut action = FreeDynamics::running(model.clone(), DT, apart(common.clone())).unwrap();
    for knot in [1, 2, 5, 6] {
        let mut moved = common.clone();
        for GeometryPair { first, .. } in &mut moved {
            first.placement.translation = Vec3::new(0.1 * rng.random::<f64>(), 0.2, 0.1);
        }
        action.set_costs(knot, apart(moved)).unwrap();
    }
    action.set_costs(3, apart(common.iter().rev().cloned().collect())).unwrap();
    check_group(action, &model, &mut rng);
}

/// Lower bound of distances in the tests of limits (m).
const MARGIN: f64 = 0.02;

/// Solves the problem of an arm that turns from one posture to another with a limit of distances, by the interior
/// point. Returns the distances of all pairs at all knots, with and without the limit.
fn around(list: Vec<GeometryPair>, postures: [[f64; 7]; 2]) -> [Vec<f64>; 2] {
    let (arm, horizon) = (Arc::new(robots::arm7()), 20);
    let [x0, goal] = postures.map(|q| [q.to_vec(), vec![0.0; 7]].concat());
    [true, false].map(|limited| {
        let costs = vec![
            Cost::new("rest", 1e-1, Residual::State { reference: goal.clone() }, Activation::Quadratic),
            Cost::new("effort", 1e-4, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
        ];
        let mut knot = FreeDynamics::running(arm.clone(), 0.05, costs).unwrap();
        let us = knot.quasi_static(&x0).repeat(horizon);
        if limited {
            let clear = Residual::distances(list.clone());
            let n = list.len();
            let limit = Limit::new("clear", clear, vec![MARGIN; n], vec![f64::INFINITY; n]);
            knot = knot.with_limits(vec![limit]).unwrap();
        }
        let end = Cost::new("goal", 1e2, Residual::State { reference: goal.clone() }, Activation::Quadratic);
        let end = FreeDynamics::terminal(arm.clone(), vec![end]).unwrap();
        let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; horizon], Box::new(end)).unwrap();
        let mut solver = InteriorPoint::new(&problem);
        let solution = solver.solve(&mut problem, &x0.repeat(horizon + 1), &us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        let prepared = DistancePairs::new(&arm, &list).unwrap();
        let (mut data, mut distances) = (Data::new(&arm), Distances::new(&prepared));
        let mut all = Vec::new();
        for x in solution.xs.chunks(14).take(horizon) {
            prepared.values(forward_kinematics(&arm, &mut data, &x[..7]), &mut distances);
            all.extend_from_slice(distances.distances());
        }
        all
    })
}

/// Returns the smallest number.
fn least(numbers: &[f64]) -> f64 {
    numbers.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Checks that an arm of capsules passes a box and stays above the floor with a margin, which it does not do without
/// the limit.
#[test]
fn the_interior_point_holds_distances_to_a_box_and_the_floor() {
    let (arm, mut data) = (robots::arm7(), Data::new(&robots::arm7()));
    let posture = |q: f64| [q, 0.9, 0.0, 1.2, 0.0, 0.4, 0.0];
    let tool = forward_kinematics(&arm, &mut data, &posture(0.0)).frame(arm.frame("tool").unwrap()).translation;
    let crate_at = Se3::new(Mat3::identity(), tool);
    let hand = || Geometry::on("tool", Shape::capsule([0.0, 0.0, -0.1], [0.0; 3], 0.04));
    let floor = Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 };
    let list = vec![
        GeometryPair::new(hand(), Geometry::in_world(Shape::cuboid([0.05, 0.05, 0.1])).at(crate_at)),
        GeometryPair::new(hand(), Geometry::in_world(floor)),
    ];
    let [held, free] = around(list, [posture(-0.6), posture(0.6)]);
    assert!(least(&held) > MARGIN - 1e-6 && least(&held) < MARGIN + 1e-3, "{}", least(&held));
    assert!(least(&free) < 0.0, "{}", least(&free));
}

/// Checks that an arm keeps its hand away from its own base, on which it would pass through a capsule.
#[test]
fn the_interior_point_holds_self_distances() {
    let (arm, mut data) = (robots::arm7(), Data::new(&robots::arm7()));
    let posture = |q: f64| [0.0, q, 0.0, 1.6, 0.0, 0.6, 0.0];
    let middle = forward_kinematics(&arm, &mut data, &posture(0.0)).frame(arm.frame("tool").unwrap()).translation;
    // a capsule on the first link, whose end is near the path of the hand
    let link = &arm.frames()[arm.frame("link1").unwrap()];
    let end = [middle.x, middle.y, middle.z - link.placement.translation.z - 0.15];
    let hand = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    let list = vec![GeometryPair::new(hand, Geometry::on("link1", Shape::capsule([0.0; 3], end, 0.05)))];
    let [held, free] = around(list, [posture(-0.5), posture(0.5)]);
    assert!(least(&held) > MARGIN - 1e-6, "{}", least(&held));
    assert!(least(&held) > least(&free) + 1e-3, "{} {}", least(&held), least(&free));
}
