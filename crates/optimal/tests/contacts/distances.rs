//! Distances between spheres on the robot and in the world: comparisons with user-defined residuals, with differences,
//! and with closed forms.

use super::groups::check_group;
use super::own::compare;
use super::*;
use condyle_dynamics::{Act, FrameKind, Mimic, Se3};
use condyle_optimal::robot::{
    ContactInverseDynamics, GenericResidual, Geometry, GeometryPair, Inputs, Knot, Limit, OwnResidual, RobotProblem,
    RobotState, Shape,
};
use condyle_optimal::{AugmentedLagrangian, InteriorPoint, LqKnot};
use condyle_spatial::Scalar;

/// Number of pairs in most tests. A residual with this number of entries needs more than one slot of 8 entries.
const PAIRS: usize = 11;

fn vector(scale: f64, rng: &mut StdRng) -> Vec3<f64> {
    let [x, y, z] = core::array::from_fn(|_| scale * (2.0 * rng.random::<f64>() - 1.0));
    Vec3::new(x, y, z)
}

/// Returns pairs of spheres with random frames, centres and radii. Every third pair has an obstacle in the world as its
/// second geometry, and another third as its first geometry.
fn pairs(model: &Model, count: usize, rng: &mut StdRng) -> Vec<GeometryPair> {
    let mut geometry = |in_world: bool| {
        let shape = Shape::sphere(vector(0.3, rng), 0.1 * rng.random::<f64>());
        let frame = &model.frames()[rng.random_range(0..model.frames().len())];
        if in_world { Geometry::in_world(shape) } else { Geometry::on(frame, shape) }
    };
    let mut pair = |k: usize| GeometryPair::new(geometry(k % 3 == 1), geometry(k.is_multiple_of(3)));
    // two geometries of one body are refused
    (0..)
        .map(|k| (k, pair(k)))
        .filter(|(k, pair)| pair.resolve(model, *k).is_ok())
        .map(|(_, pair)| pair)
        .take(count)
        .collect()
}

/// Frame of a sphere (`None` for the world), centre and radius.
type Placed = (Option<usize>, Vec3<f64>, f64);

/// Residual that computes the distances of pairs of spheres from the poses of their frames.
struct Written {
    pairs: Vec<[Placed; 2]>,
}

impl Written {
    fn new(model: &Model, pairs: &[GeometryPair]) -> Self {
        let read = |geometry: &Geometry| match geometry.shape {
            Shape::Sphere { center, radius } => {
                (geometry.frame.as_ref().map(|frame| frame.number(model).unwrap()), center, radius)
            }
            other => panic!("{other:?}"),
        };
        Self { pairs: pairs.iter().map(|pair| [read(&pair.first), read(&pair.second)]).collect() }
    }
}

impl GenericResidual for Written {
    fn size(&self) -> usize {
        self.pairs.len()
    }
    fn inputs(&self) -> Inputs {
        Inputs::POSITIONS
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let placements = state.placements();
        for (r, [(first, a, radius), (second, b, its)]) in r.iter_mut().zip(&self.pairs) {
            let place = |frame: &Option<usize>, center: &Vec3<f64>| match frame {
                Some(frame) => placements.frame(*frame).act(center.lift()),
                None => center.lift(),
            };
            *r = (place(first, a) - place(second, b)).norm_squared().sqrt() - S::splat(radius + its);
        }
    }
}

fn cost(name: &str, residual: Residual, activation: Activation) -> Cost {
    Cost::new(name, 0.7, residual, activation)
}

/// Returns costs with native distances, and the same costs with user-defined distances. Other kinematic residuals
/// precede and follow the distances.
fn both(model: &Arc<Model>, rng: &mut StdRng) -> [Vec<Cost>; 2] {
    let (pairs, frame) = (pairs(model, PAIRS, rng), FrameName::from(model.frames().last().unwrap()));
    let written = OwnResidual::autodiff(model.clone(), Written::new(model, &pairs));
    let (com, place, other) = (vector(0.5, rng), vector(0.5, rng), self::pairs(model, 2, rng));
    let barrier = Activation::Barrier { lower: vec![0.2; PAIRS], upper: vec![0.6; PAIRS] };
    [Residual::distances(pairs), Residual::Own(written)].map(|distances| {
        vec![
            cost("com", Residual::CenterOfMass { target: com }, Activation::Quadratic),
            cost("distances", distances, barrier.clone()),
            cost("place", Residual::FrameTranslation { frame: frame.clone(), target: place }, Activation::Quadratic),
            cost("others", Residual::distances(other.clone()), Activation::Smooth1 { epsilon: 0.2 }),
        ]
    })
}

/// Returns the embedded robots, and an arm with a joint that follows another joint and with a frame of the world.
fn all_robots() -> [Arc<Model>; 4] {
    let arm = robots::arm7();
    let followed = arm.with_mimic(6, 2, Mimic { ratio: -1.5, offset: 0.2 }).unwrap();
    let placement = Se3::new(Mat3::identity(), Vec3::new(0.2, -0.3, 0.6));
    let post = followed.with_frame("post", condyle_dynamics::FrameParent::Body(0), placement).unwrap();
    [arm, robots::quadruped(), robots::humanoid(), post].map(Arc::new)
}

#[test]
fn distances_are_those_of_a_written_residual() {
    let mut rng = StdRng::seed_from_u64(51);
    for model in all_robots() {
        let name = model.name().to_owned();
        let [a, b] = both(&model, &mut rng).map(|costs| FreeDynamics::terminal(model.clone(), costs).unwrap());
        compare(&format!("terminal knot of {name}"), a, b, &model, &mut rng);
        let methods =
            [Integrator::SemiImplicitEuler, Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4];
        for method in methods {
            let [a, b] = both(&model, &mut rng).map(|costs| {
                let drives = Actuation::joints(&model);
                FreeDynamics::new(FreeAcceleration::new(model.clone(), drives, costs).unwrap(), method, DT).unwrap()
            });
            compare(&format!("{method:?} of {name}"), a, b, &model, &mut rng);
        }
        let [a, b] = both(&model, &mut rng).map(|c| FreeInverseDynamics::running(model.clone(), DT, c).unwrap());
        compare(&format!("inverse dynamics of {name}"), a, b, &model, &mut rng);
        if model.nq() == model.nv() {
            continue;
        }
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let make = |costs| ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
        let [a, b] = both(&model, &mut rng).map(make);
        compare(&format!("contacts of {name}"), a, b, &model, &mut rng);
        let make = |costs| ContactInverseDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
        let [a, b] = both(&model, &mut rng).map(make);
        compare(&format!("inverse dynamics in contact of {name}"), a, b, &model, &mut rng);
        let make = |costs| ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, costs).unwrap();
        let [a, b] = both(&model, &mut rng).map(make);
        compare(&format!("impact of {name}"), a, b, &model, &mut rng);
    }
}

/// Returns the gradient of the sum of the distances, with its value, at a state x of a terminal knot.
fn sum_at(model: &Arc<Model>, pairs: Vec<GeometryPair>, x: &[f64]) -> (f64, Vec<f64>) {
    let costs = vec![Cost::new("sum", 1.0, Residual::distances(pairs), Activation::Sum)];
    let mut action = FreeDynamics::terminal(model.clone(), costs).unwrap();
    let mut knot = LqKnot::zeros(action.ndx(), 0);
    let value = action.calc(0, x, &[], &mut vec![0.0; x.len()]);
    action.calc_diff(0, x, &[], &mut knot);
    (value, knot.q.as_slice().to_vec())
}

/// Checks the value and the Jacobian row of single pairs: the value against the poses of the frames, and the row
/// against central differences.
#[test]
fn rows_are_central_differences_of_distances() {
    let (mut rng, h) = (StdRng::seed_from_u64(52), 1e-6);
    for model in all_robots() {
        let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
        for pair in pairs(&model, PAIRS, &mut rng) {
            let x = random_state(&model, &mut rng);
            let (value, row) = sum_at(&model, vec![pair.clone()], &x);
            let mut data = Data::new(&model);
            let placements = forward_kinematics(&model, &mut data, &x[..model.nq()]);
            let [a, b] = [&pair.first, &pair.second].map(|geometry| {
                let Shape::Sphere { center, radius } = geometry.shape else { unreachable!("all are spheres") };
                let frame = geometry.frame.as_ref().map(|frame| frame.number(&model).unwrap());
                (frame.map_or(center, |frame| placements.frame(frame).act(center)), radius)
            });
            let expected = (a.0 - b.0).norm_squared().sqrt() - a.1 - b.1;
            assert!((value - expected).abs() < ROUNDING, "{value} and {expected}");
            let mut moved = x.clone();
            for k in 0..2 * model.nv() {
                let [plus, minus] = [h, -h].map(|h| {
                    let mut dx = vec![0.0; 2 * model.nv()];
                    dx[k] = h;
                    end.integrate(&x, &dx, &mut moved);
                    sum_at(&model, vec![pair.clone()], &moved).0
                });
                let numeric = (plus - minus) / (2.0 * h);
                assert!((row[k] - numeric).abs() < DIFFERENCES, "{k}: {} and {numeric}", row[k]);
            }
        }
    }
}

/// Checks that a joint which carries both spheres of a pair has an exactly zero entry in the row of this pair.
#[test]
fn a_common_joint_changes_no_distance() {
    let (mut rng, model) = (StdRng::seed_from_u64(53), Arc::new(robots::quadruped()));
    let on = |frame: &str, rng: &mut StdRng| Geometry::on(frame, Shape::sphere(vector(0.1, rng), 0.05));
    let pair = GeometryPair::new(on("LF_foot", &mut rng), on("RH_foot", &mut rng));
    let (_, row) = sum_at(&model, vec![pair], &random_state(&model, &mut rng));
    assert!(row[..6].iter().all(|entry| *entry == 0.0) && row[6..18].iter().any(|entry| entry.abs() > 1e-2), "{row:?}");
}

/// Checks coinciding centres: the distance is minus the radii, and the row is the derivative of the height difference.
#[test]
fn coinciding_centres_have_finite_derivatives() {
    let (mut rng, model) = (StdRng::seed_from_u64(54), Arc::new(robots::arm7()));
    let (x, tool) = (random_state(&model, &mut rng), model.frame("tool").unwrap());
    let (mut data, mut J) = (Data::new(&model), DMatrix::zeros(6, 7));
    let placements = forward_kinematics(&model, &mut data, &x[..7]);
    let p = placements.frame(tool).translation;
    placements.frame_jacobian(tool, ReferenceFrame::LocalWorldAligned, &mut J);
    let pair = |center: Vec3<f64>| {
        let tool = Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.1));
        GeometryPair::new(tool, Geometry::in_world(Shape::sphere(center, 0.2)))
    };
    let (value, row) = sum_at(&model, vec![pair(p)], &x);
    assert!((value + 0.3).abs() < ROUNDING);
    let expected: Vec<f64> = (0..7).map(|k| J[(2, k)]).collect();
    assert!(largest_difference(&row[..7], &expected) < ROUNDING, "{row:?} and {expected:?}");
    // a centre that is 1e-12 m away has a direction: minus the x axis
    let (_, row) = sum_at(&model, vec![pair(p + Vec3::new(1e-12, 0.0, 0.0))], &x);
    let expected: Vec<f64> = (0..7).map(|k| -J[(0, k)]).collect();
    assert!(largest_difference(&row[..7], &expected) < 1e-3, "{row:?} and {expected:?}"); // 1e-12 has four digits here
}

/// Checks that knots with different obstacles, and with pairs of other bodies, have the bits of single knots.
#[test]
fn knots_with_other_obstacles_are_single_knots() {
    let mut rng = StdRng::seed_from_u64(55);
    let model = Arc::new(robots::quadruped().with_limbs(false)); // parallel branches change the order of sums
    let common = pairs(&model, PAIRS, &mut rng);
    let mut moved = |count: usize| {
        let mut pairs = common[..count].to_vec();
        for GeometryPair { first, second } in &mut pairs {
            (first.shape, second.shape) = (Shape::sphere(vector(0.3, &mut rng), 0.1), Shape::sphere([0.1; 3], 0.2));
        }
        Residual::distances(pairs)
    };
    let apart = |residual| vec![cost("apart", residual, Activation::Smooth1 { epsilon: 0.1 })];
    let limit = |residual, count: usize| vec![Limit::new("limit", residual, vec![0.3; count], vec![0.4; count])];
    let mut action = FreeDynamics::running(model.clone(), DT, apart(moved(PAIRS))).unwrap();
    action = action.with_limits(limit(moved(9), 9)).unwrap();
    for knot in [1, 2, 5, 6] {
        action.set_costs(knot, apart(moved(PAIRS))).unwrap();
        action.set_limits(knot, limit(moved(9), 9)).unwrap();
    }
    action.set_costs(3, apart(moved(4))).unwrap();
    action.set_limits(7, limit(moved(PAIRS), PAIRS)).unwrap();
    let mut rng = StdRng::seed_from_u64(56);
    action.set_costs(9, apart(Residual::distances(pairs(&model, PAIRS, &mut rng)))).unwrap();
    check_group(action, &model, &mut rng);
}

/// Creates the problem of an arm that moves from one side of a ball to the other side. The ball has another size at
/// each knot. If `apart`, each knot has its own action; otherwise one action represents all knots. Also returns the
/// centre of the ball.
fn around(apart: bool, lower: f64) -> (Problem, Vec<f64>, Vec<f64>, Vec3<f64>) {
    let (arm, horizon) = (Arc::new(robots::arm7()), 16);
    let posture = |q: f64| [vec![q, 0.9, 0.0, 1.2, 0.0, 0.4, 0.0], vec![0.0; 7]].concat();
    let (x0, goal, between) = (posture(-0.6), posture(0.6), posture(0.0));
    let mut data = Data::new(&arm);
    let tool = forward_kinematics(&arm, &mut data, &between[..7]).frame(arm.frame("tool").unwrap()).translation;
    let limits = |t: usize| {
        let radius = 0.1 + 0.001 * t as f64;
        let ball = |frame: &str| {
            let obstacle = Geometry::in_world(Shape::sphere(tool, radius));
            GeometryPair::new(Geometry::on(frame, Shape::sphere(Vec3::zero(), 0.05)), obstacle)
        };
        let clear = Residual::distances(vec![ball("tool"), ball(&arm.frames()[5].name)]);
        vec![Limit::new("clear", clear, vec![lower; 2], vec![f64::INFINITY; 2])]
    };
    let costs = vec![
        Cost::new("rest", 1e-1, Residual::State { reference: goal.clone() }, Activation::Quadratic),
        Cost::new("effort", 1e-4, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
    ];
    let knot = || FreeDynamics::running(arm.clone(), 0.05, costs.clone()).unwrap();
    let us = knot().quasi_static(&x0).repeat(horizon);
    let models: Vec<Box<dyn ActionModel>> = match apart {
        true => {
            (0..horizon).map(|t| Box::new(knot().with_limits(limits(t)).unwrap()) as Box<dyn ActionModel>).collect()
        }
        false => {
            let mut one = knot();
            (0..horizon).for_each(|t| one.set_limits(t, limits(t)).unwrap());
            vec![Box::new(one)]
        }
    };
    let knot_models = (0..horizon).map(|t| if apart { t } else { 0 }).collect();
    let end = Cost::new("goal", 1e2, Residual::State { reference: goal }, Activation::Quadratic);
    let end = FreeDynamics::terminal(arm.clone(), vec![end]).unwrap();
    let problem = Problem::new(x0.clone(), models, knot_models, Box::new(end)).unwrap();
    (problem, x0.repeat(horizon + 1), us, tool)
}

/// Checks that the optimum keeps the margin of 0.01 m exactly, and that threads and merged actions do not change the
/// bits of the result.
#[test]
fn an_arm_passes_a_ball_with_a_margin() {
    let margin = 0.01;
    let solve = |apart: bool, threads: usize| {
        let (mut problem, xs, us, _) = around(apart, margin);
        let mut solver = AugmentedLagrangian::new(&problem);
        solver.inner.threads = threads;
        let solution = solver.solve(&mut problem, &xs, &us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        solution.xs.clone()
    };
    let alone = solve(false, 1);
    let (.., ball) = around(false, margin);
    let (arm, mut data, mut nearest) = (robots::arm7(), Data::new(&robots::arm7()), f64::INFINITY);
    for (t, x) in alone.chunks(14).enumerate().take(16) {
        let tool = forward_kinematics(&arm, &mut data, &x[..7]).frame(arm.frame("tool").unwrap()).translation;
        nearest = f64::min(nearest, (tool - ball).norm_squared().sqrt() - 0.15 - 0.001 * t as f64);
    }
    assert!((nearest - margin).abs() < 1e-5, "{nearest}");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    for (apart, threads) in [(false, 3), (true, 1), (true, 3)] {
        assert!(pool.install(|| solve(apart, threads)) == alone, "apart: {apart}, {threads} threads");
    }
}

/// Checks that placements of all knots have the bits of knots that are described one by one. The obstacle moves in
/// costs and in limits.
#[test]
fn an_obstacle_moves_in_all_knots() {
    const HORIZON: usize = 10;
    let (arm, x0) = (Arc::new(robots::arm7()), [vec![0.0, 0.9, 0.0, 1.2, 0.0, 0.4, 0.0], vec![0.0; 7]].concat());
    let tool = forward_kinematics(&arm, &mut Data::new(&arm), &x0[..7]).frame(arm.frame("tool").unwrap()).translation;
    let at = |t: usize| Se3::new(Mat3::identity(), tool + Vec3::new(0.0, 0.3 - 0.02 * t as f64, 0.0));
    let ball = |t: usize| {
        let ball = Geometry::in_world(Shape::sphere([0.0; 3], 0.1)).named("ball").at(at(t));
        let floor = Geometry::in_world(Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: -0.2 });
        let part = || Geometry::on("tool", Shape::capsule([0.0; 3], [0.0, 0.0, -0.1], 0.05));
        Residual::distances(vec![GeometryPair::new(part(), ball), GeometryPair::new(floor, part())])
    };
    let costs = |t: usize| {
        let barrier = Activation::Barrier { lower: vec![0.1; 2], upper: vec![f64::INFINITY; 2] };
        let state = Residual::State { reference: x0.clone() };
        let effort = Residual::Control { reference: vec![0.0; 7] };
        let quadratic = |name, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
        vec![Cost::new("apart", 10.0, ball(t), barrier), quadratic("rest", 1.0, state), quadratic("tau", 1e-3, effort)]
    };
    let limits = |t: usize| vec![Limit::new("clear", ball(t), vec![0.02; 2], vec![f64::INFINITY; 2])];
    let problem = |each: bool| {
        let last = if each { HORIZON } else { 0 };
        let knot = FreeDynamics::running(arm.clone(), 0.05, costs(0)).unwrap().with_limits(limits(0));
        let mut knot = knot.unwrap();
        for t in 0..if each { HORIZON } else { 0 } {
            knot.set_costs(t, costs(t)).unwrap();
            knot.set_limits(t, limits(t)).unwrap();
        }
        let end = FreeDynamics::terminal(arm.clone(), costs(last)[..2].to_vec()).unwrap().with_limits(limits(last));
        let us = knot.quasi_static(&x0).repeat(HORIZON);
        let models: Vec<Box<dyn ActionModel>> = vec![Box::new(knot)];
        (Problem::new(x0.clone(), models, vec![0; HORIZON], Box::new(end.unwrap())).unwrap(), us)
    };
    let plan = |problem: &mut Problem, us: &[f64]| {
        let mut solver = InteriorPoint::new(problem);
        solver.solve(problem, &x0.repeat(HORIZON + 1), us).unwrap();
        solver.solution().xs.clone()
    };
    let ((mut each, us), (mut moved, _)) = (problem(true), problem(false));
    let (one_by_one, at_rest) = (plan(&mut each, &us), plan(&mut moved, &us));
    assert!(moved.set_placements("ball", &(0..=HORIZON).map(at).collect::<Vec<_>>()).unwrap());
    assert!(plan(&mut moved, &us) == one_by_one && one_by_one != at_rest);
    assert!(!moved.set_placements("bal", &[at(0); HORIZON + 1]).unwrap());
    let text = moved.set_placements("ball", &[at(0); 3]).unwrap_err().to_string();
    assert_eq!(text, "`placements`: expected length 11, found 3");
    let mut placements = [at(0); HORIZON + 1];
    placements[4].translation.x = f64::NAN;
    let text = moved.set_placements("ball", &placements).unwrap_err().to_string();
    assert_eq!(text, "geometry `ball`, knot 4: its placement is not a rotation with a finite translation");
    assert!(plan(&mut moved, &us) == one_by_one); // nothing changed
}

/// Checks that the message about a limit of distances names the shapes.
#[test]
fn a_violated_distance_is_named() {
    let arm = Arc::new(robots::arm7());
    let part = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05)).named("hand");
    let floor = Geometry::in_world(Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 5.0 });
    let pairs = vec![GeometryPair::new(part, floor)];
    for (range, text) in [
        (0.1, "limit `clear`: entry 0 must be at least 0.2, but its range is 0.1"),
        (0.0, "limit `clear`: its range is 0, expected a number above 0"),
    ] {
        let clear = Residual::Distances { pairs: pairs.clone(), range };
        let limit = Limit::new("clear", clear, vec![0.2], vec![f64::INFINITY]);
        let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
        assert_eq!(end.with_limits(vec![limit]).map(|_| ()).unwrap_err().to_string(), text);
    }
    let limit = Limit::new("clear", Residual::distances(pairs), vec![0.0], vec![f64::INFINITY]);
    let effort = Cost::new("tau", 1.0, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let knot = FreeDynamics::running(arm.clone(), DT, vec![effort]).unwrap().with_limits(vec![limit]).unwrap();
    let end = FreeDynamics::terminal(arm, vec![]).unwrap();
    let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 3], Box::new(end)).unwrap();
    let mut solver = InteriorPoint::new(&problem);
    solver.solve(&mut problem, &[0.0; 56], &[0.0; 21]).unwrap();
    let worst = solver.outcome().worst.clone().unwrap();
    assert_eq!(worst.what.as_deref(), Some("`hand` and half-space in the world"));
    let text = "distance of `hand` and half-space in the world in `clear` is ";
    assert!(worst.to_string().contains(text), "{worst}");
}

#[test]
fn a_wrong_geometry_is_refused_by_its_field() {
    let arm = Arc::new(robots::arm7());
    let good = || Geometry::on("tool", Shape::sphere([0.0, 0.0, 0.1], 0.05));
    let world = |center: [f64; 3], radius| Geometry::in_world(Shape::sphere(center, radius));
    let said = |first: Geometry, second: Geometry| {
        let pairs = vec![GeometryPair::new(good(), world([2.0; 3], 0.1)), GeometryPair::new(first, second)];
        let costs = vec![cost("apart", Residual::distances(pairs.clone()), Activation::Quadratic)];
        let error = FreeDynamics::terminal(arm.clone(), costs).map(|_| ()).unwrap_err().to_string();
        let limit = Limit::new("apart", Residual::distances(pairs), vec![0.0; 2], vec![1.0; 2]);
        let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
        let same = end.with_limits(vec![limit]).map(|_| ()).unwrap_err().to_string();
        assert_eq!(same.replace("limit", "cost"), error);
        error
    };
    let text = "cost `apart`: its pairs[1].first (sphere on `tool`): radius is -0.1, expected at least 0";
    assert_eq!(said(Geometry::on("tool", Shape::sphere([0.0; 3], -0.1)), good()), text);
    let text = "cost `apart`: its pairs[1].second (sphere in the world): radius holds a NaN";
    assert_eq!(said(good(), world([0.0; 3], f64::NAN)), text);
    let text = "cost `apart`: its pairs[1].second (sphere in the world): center holds an infinite number";
    assert_eq!(said(good(), world([0.0, f64::INFINITY, 0.0], 0.1)), text);
    let text = said(world([0.0; 3], 0.1), world([1.0; 3], 0.1));
    assert!(text.starts_with("cost `apart`: its pairs[1] (sphere in the world and sphere in the world): "), "{text}");
    assert!(text.ends_with("has no frame: expected at least one geometry on the robot"), "{text}");
    let unknown = said(good(), Geometry::on("tol", Shape::sphere([0.0; 3], 0.1)));
    assert!(unknown.starts_with("cost `apart`: its pairs[1].second (sphere on `tol`): frame: "), "{unknown}");
    assert!(unknown.contains("`tol`") && unknown.contains("`tool`"), "{unknown}");
    let text = "cost `apart`: its pairs[1] (sphere on `tool` and sphere in the world): is the same pair as pairs[0]";
    assert_eq!(said(good(), world([2.0; 3], 0.1)), text);
    let residual = Residual::distances(vec![GeometryPair::new(good(), world([1.0; 3], 0.1))]);
    let short = Limit::new("short", residual, vec![0.0; 2], vec![1.0; 1]);
    let end = FreeDynamics::terminal(arm, vec![]).unwrap();
    let error = end.with_limits(vec![short]).map(|_| ()).unwrap_err().to_string();
    assert_eq!(error, "limit `short`: its lower bound has 2 numbers, expected 1");
}

#[test]
fn distances_in_a_file_are_the_same() {
    let (mut rng, model) = (StdRng::seed_from_u64(57), robots::humanoid());
    let residual = Residual::distances(pairs(&model, PAIRS, &mut rng));
    let costs = vec![cost("apart", residual.clone(), Activation::Quadratic)];
    let mut terminal = Knot::new(condyle_optimal::robot::Dynamics::Terminal, costs);
    terminal.limits.push(Limit::new("apart", residual, vec![0.0; PAIRS], vec![f64::INFINITY; PAIRS]));
    let x0 = random_state(&model, &mut rng);
    let data = RobotProblem { model, x0, knots: vec![], knot_models: vec![], terminal };
    let read: RobotProblem = serde_json::from_str(&serde_json::to_string(&data).unwrap()).unwrap();
    assert_eq!(read, data);
    let text = r#"{"distances":{"pairs":[{"first":{"frame":{"name":"tool"},
        "shape":{"sphere":{"center":{"x":0.0,"y":0.0,"z":0.1},"radius":0.05}}},
        "second":{"shape":{"sphere":{"center":{"x":0.4,"y":0.0,"z":0.5},"radius":0.2}}}}]}}"#;
    let tool = Geometry::on("tool", Shape::sphere([0.0, 0.0, 0.1], 0.05));
    let pair = GeometryPair::new(tool, Geometry::in_world(Shape::sphere([0.4, 0.0, 0.5], 0.2)));
    let residual = Residual::distances(vec![pair]);
    assert_eq!(serde_json::from_str::<Residual>(text).unwrap(), residual);
    let compact: String = text.split_whitespace().collect();
    assert_eq!(serde_json::to_string(&residual).unwrap(), compact);
    let wrong = serde_json::from_str::<Residual>(&text.replace("radius", "radios")).unwrap_err().to_string();
    assert!(wrong.contains("unknown field `radios`"), "{wrong}");
}

/// Checks that a frame of the world is an obstacle, with the pose of the frame.
#[test]
fn a_frame_of_the_world_is_an_obstacle() {
    let (mut rng, model) = (StdRng::seed_from_u64(58), all_robots()[3].clone());
    let tool = || Geometry::on("tool", Shape::sphere([0.1, 0.0, 0.0], 0.1));
    let post = Geometry::on("post", Shape::sphere([0.0, 0.0, 0.1], 0.2));
    let same = Geometry::in_world(Shape::sphere([0.2, -0.3, 0.7], 0.2));
    let x = random_state(&model, &mut rng);
    let [a, b] = [&post, &same].map(|second| sum_at(&model, vec![GeometryPair::new(tool(), second.clone())], &x));
    assert!((a.0 - b.0).abs() < ROUNDING && largest_difference(&a.1, &b.1) < ROUNDING);
    let both = sum_at(&model, vec![GeometryPair::new(post, same)], &x);
    assert!((both.0 + 0.4).abs() < ROUNDING && both.1 == vec![0.0; 2 * model.nv()]);
}

/// Checks an empty list of pairs, and a frame that is chosen by its kind.
#[test]
fn no_pairs_add_nothing() {
    let arm = Arc::new(robots::arm7());
    let x = [0.1; 14];
    assert_eq!(sum_at(&arm, vec![], &x), (0.0, vec![0.0; 14]));
    let link = FrameName { name: "tool".to_owned(), kind: Some(FrameKind::Link) };
    let pair = |frame| {
        GeometryPair::new(
            Geometry::on(frame, Shape::sphere([0.0; 3], 0.0)),
            Geometry::in_world(Shape::sphere([0.0; 3], 0.0)),
        )
    };
    assert_eq!(sum_at(&arm, vec![pair(link)], &x), sum_at(&arm, vec![pair("tool".into())], &x));
}
