//! Allocations of a solve: none, once the solver and its trace exist.

mod common;
#[path = "../../../tests/common/counting.rs"]
mod counting;

use common::{HANGING, cartpole, limited_cartpole, random, random_knot, straight};
use condyle_dynamics::{ConstraintKind, ContactConstraint, Force, Motion, ReferenceFrame, Se3, Vec3, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, ContactInverseDynamics, ControlPolynomial, Cost, FreeAcceleration,
    FreeDynamics, FrictionCone, GenericResidual, Geometry, GeometryPair, ImpulseDynamics, Integrator, Limit,
    OwnResidual, Residual, RobotState, Shape,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, DdpMethod, Fddp, InteriorPoint, Iteration, PolicyPublisher, Problem,
    RolloutResults, Rollouts, Schedule, Status, Sweep,
};
use condyle_spatial::Scalar;
use counting::{allocated, allocations};

#[test]
fn a_sweep_allocates_nothing() {
    let mut random = random();
    let lq_knots: Vec<_> = [7, 0, 3, 0].map(|nu| random_knot(&mut random, 11, nu)).into();
    let mut sweep = Sweep::new(&lq_knots);
    assert_eq!(allocations(|| sweep.run(&lq_knots, 1e-9).unwrap()), 0);
}

/// Counts the allocations of solves on one thread. (With several threads, rayon itself allocates.)
#[test]
fn a_sweep_in_segments_allocates_nothing() {
    let mut random = random();
    let lq_knots: Vec<_> = (0..=12).map(|t| random_knot(&mut random, 11, if t < 12 { t % 5 } else { 0 })).collect();
    let mut sweep = Sweep::new(&lq_knots);
    sweep.set_segments(4);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let count = pool.install(|| {
        allocations(|| {
            sweep.set_segments(4);
            sweep.run(&lq_knots, 1e-9).unwrap();
        })
    });
    assert_eq!(count, 0);
}

#[test]
fn a_solve_allocates_nothing() {
    for lanes in [1, 4] {
        let mut problem = cartpole(&HANGING, 50, lanes);
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        let mut iterations = 0;
        // the first solve makes two allocations: the trace and the step lengths
        let first = allocations(|| {
            solver.solve_with(&mut problem, &xs, &[0.0; 50], |_: &Iteration| iterations += 1).unwrap();
        });
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        });
        assert_eq!((iterations, first, second), (34, 2, 0));
    }
}

#[test]
fn a_bounded_solve_allocates_nothing() {
    for method in [DdpMethod::Ddp, DdpMethod::Fddp] {
        let mut problem = limited_cartpole(&HANGING, 50, 4, Some([vec![-8.0], vec![6.0]]));
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        solver.settings.method = method;
        solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        });
        assert_eq!(second, 0, "{method:?}");
    }
}

#[test]
fn a_step_of_a_closed_loop_allocates_nothing() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 3;
    solver.settings.time_budget = Some(std::time::Duration::from_secs(10));
    solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    let count = allocations(|| {
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        problem.set_x0(&[0.1, 3.1, 0.0, 0.0]).unwrap();
        solver.resume(&mut problem).unwrap();
    });
    assert_eq!(count, 0);
}

#[test]
fn rollouts_allocate_nothing() {
    let model = std::sync::Arc::new(robots::arm7());
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let cost = Cost::new("effort", 1.0, effort, Activation::Quadratic);
    let knot = FreeDynamics::running(model.clone(), 0.01, vec![cost]).unwrap();
    let end = FreeDynamics::terminal(model, vec![]).unwrap();
    let problem = Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 6], Box::new(end)).unwrap();
    let mut rollouts = Rollouts::new(&problem, 1).unwrap();
    let (us, mut costs, mut du) = (vec![0.1; 9 * 42], [0.0; 9], vec![0.0; 9 * 42]);
    let run = || {
        let results = RolloutResults { costs: &mut costs, du: &mut du, ..Default::default() };
        rollouts.run(&[0.1; 14], &us, results).unwrap();
    };
    assert_eq!(allocations(run), 0);
    assert!(costs.iter().all(|cost| *cost == costs[0] && cost.is_finite()) && du[0] != 0.0);
}

#[test]
fn a_robots_solve_allocates_nothing() {
    for model in [robots::arm7(), robots::quadruped()].map(std::sync::Arc::new) {
        let x0 = [neutral(&model), vec![0.0; model.nv()]].concat();
        let nu = model.nv() - if model.nq() == model.nv() { 0 } else { 6 };
        let frame = || model.frames().last().unwrap().into();
        let goal = Vec3::new(0.3, 0.2, 0.1);
        let costs = || {
            vec![
                Cost::new("state", 1e-2, Residual::State { reference: x0.clone() }, Activation::Quadratic),
                Cost::new(
                    "place",
                    1.0,
                    Residual::FrameTranslation { frame: frame(), target: goal },
                    Activation::Quadratic,
                ),
                Cost::new(
                    "pose",
                    1.0,
                    Residual::FramePlacement { frame: frame(), target: Se3::identity() },
                    Activation::Quadratic,
                ),
            ]
        };
        let effort = Residual::Control { reference: vec![0.0; nu] };
        let bounds = Activation::Barrier { lower: vec![-1.0; nu], upper: vec![1.0; nu] };
        let running = [costs(), vec![Cost::new("effort", 1e-3, effort, bounds)]].concat();
        let mut action = FreeDynamics::running(model.clone(), 0.01, running).unwrap();
        let us = action.quasi_static(&x0).repeat(10);
        let end = FreeDynamics::terminal(model.clone(), costs()).unwrap();
        let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 10], Box::new(end)).unwrap();
        let xs = x0.repeat(11);
        let mut solver = Fddp::new(&problem);
        solver.settings.max_iterations = 5;
        for second_order in [false, true] {
            solver.settings.second_order = second_order;
            solver.solve(&mut problem, &xs, &us).unwrap();
            let second = allocations(|| {
                solver.solve(&mut problem, &xs, &us).unwrap();
            });
            assert_eq!(second, 0, "{}, second order: {second_order}", model.name());
        }
    }
}

/// Counts the allocations of a gait with every kind of knot and residual: stance, an impact, and flight by Runge–Kutta.
#[test]
fn a_gait_allocates_nothing() {
    let model = std::sync::Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let foot = |name: &str| ContactConstraint::point(model.frame(name).unwrap());
    let contacts = ["LF_foot", "RH_foot"].map(|name| Contact::new(name, ContactConstraint { kd: 20.0, ..foot(name) }));
    let cone = FrictionCone::new(0.7);
    let (lower, upper) = cone.bounds();
    let contact = || "LF_foot".to_owned();
    let leg = |frame: &str| Geometry::on(frame, Shape::sphere([0.0; 3], 0.03));
    let legs = ["LF_foot", "RF_foot", "LH_foot"].map(|frame| GeometryPair::new(leg(frame), leg("RH_foot")));
    let ball = |k: u8| Geometry::in_world(Shape::sphere([0.4, 0.1 * f64::from(k), 0.2], 0.1));
    let balls = (0..7).map(|k| GeometryPair::new(leg("LF_foot"), ball(k)));
    let pairs: Vec<_> = legs.into_iter().chain(balls).collect(); // more than one slot
    let target = Motion::zero();
    let reference = ReferenceFrame::LocalWorldAligned;
    let quadratic = |name: &str, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let standing = || {
        vec![
            quadratic("state", 1e-1, Residual::State { reference: x0.clone() }),
            quadratic("com", 1e0, Residual::CenterOfMass { target: Vec3::new(0.0, 0.0, 0.4) }),
            quadratic("momentum", 1e-3, Residual::CentroidalMomentum { target: Force::zero() }),
            quadratic("apart", 1e-2, Residual::distances(pairs.clone())),
            quadratic("speed", 1e-3, Residual::FrameVelocity { frame: "RF_foot".into(), target, reference }),
        ]
    };
    let driven = || {
        let effort = Residual::Control { reference: vec![0.0; 12] };
        let own = [quadratic("effort", 1e-3, effort), quadratic("gravity", 1e-5, Residual::ControlGravity)];
        [standing(), own.into()].concat()
    };
    let grip = Residual::FrictionCone { contact: contact(), cone };
    let force = Residual::ContactForce { contact: contact(), target: Force::zero() };
    let pushing = [
        driven(),
        vec![
            Cost::new("grip", 1e-2, grip, Activation::RelaxedBarrier { lower, upper, mu: 0.1, delta: 5.0 }),
            quadratic("force", 1e-6, force),
        ],
    ]
    .concat();
    let landing = [standing(), vec![quadratic("jump", 1e-2, Residual::ImpulseCenterOfMass)]].concat();
    let mut stance = ContactDynamics::running(model.clone(), &contacts, 0.01, pushing).unwrap();
    let mut touch = contacts.clone();
    (touch[0].constraint.kind, touch[1].constraint.kind) = (ConstraintKind::Line, ConstraintKind::Plane);
    let impact = ImpulseDynamics::instant(model.clone(), &touch, 0.0, 1e-9, landing).unwrap();
    let drives = Actuation::joints(&model);
    let flight = FreeAcceleration::new(model.clone(), drives, driven()).unwrap();
    let flight = FreeDynamics::new(flight, Integrator::RungeKutta4, 0.01).unwrap();
    let flight = flight.with_controls(ControlPolynomial::Quadratic);
    let end = FreeDynamics::terminal(model.clone(), standing()).unwrap();
    let effort = Residual::JointEffort { reference: vec![0.0; 18] };
    let backwards = [standing(), vec![quadratic("effort", 1e-4, effort)]].concat();
    let mut backwards = ContactInverseDynamics::running(model.clone(), &contacts, 0.01, backwards).unwrap();
    let us = [stance.quasi_static(&x0).repeat(2), vec![0.0; 72], backwards.quasi_static(&x0)].concat();
    let models: Vec<Box<dyn condyle_optimal::ActionModel>> =
        vec![Box::new(stance), Box::new(impact), Box::new(flight), Box::new(backwards)];
    let mut problem = Problem::new(x0.clone(), models, vec![0, 0, 1, 2, 2, 3], Box::new(end)).unwrap();
    let xs = x0.repeat(7);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 3;
    solver.solve(&mut problem, &xs, &us).unwrap();
    let second = allocations(|| {
        solver.solve(&mut problem, &xs, &us).unwrap();
    });
    assert_eq!(second, 0);
    assert!(solver.solution().trace.iter().any(|i| i.accepted));
    // with three threads, nothing is allocated once the copies for these threads exist
    solver.settings.threads = 3;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let count = pool.install(|| {
        solver.solve(&mut problem, &xs, &us).unwrap();
        allocations(|| {
            solver.solve(&mut problem, &xs, &us).unwrap();
        })
    });
    assert_eq!(count, 0);
}

/// Checks that shifts do not allocate where the contacts of the last knot change, which then gets a quasi-static
/// control. Policies allocate nothing, either.
#[test]
fn a_shift_to_other_contacts_allocates_nothing() {
    let model = std::sync::Arc::new(robots::quadruped());
    let x0 = [neutral(&model), vec![0.0; model.nv()]].concat();
    let knots = [&["LF_foot", "RH_foot"][..], &["RF_foot", "LH_foot"], &[]].map(|feet| {
        let contact = |foot: &&str| Contact::new(foot, ContactConstraint::point(model.frame(foot).unwrap()));
        let contacts: Vec<_> = feet.iter().map(contact).collect();
        let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic);
        let knot = ContactDynamics::running(model.clone(), &contacts, 0.01, vec![effort]).unwrap();
        Box::new(knot) as Box<dyn condyle_optimal::ActionModel>
    });
    let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
    let mut problem = Problem::new(x0.clone(), knots.into(), vec![0; 4], Box::new(end)).unwrap();
    let us = problem.quasi_static(&x0.repeat(5)).unwrap();
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 1;
    solver.solve(&mut problem, &x0.repeat(5), &us).unwrap();
    let mut publisher = PolicyPublisher::new(&problem).unwrap();
    let (mut policy, mut u) = (publisher.policy(), [0.0; 12]);
    publisher.publish(&problem, solver.solution(), 0.0).unwrap();
    policy.control(0.0, &x0, &mut u).unwrap();
    for last in [0, 1, 2, 0, 2, 1] {
        let count = allocations(|| {
            problem.shift(last).unwrap();
            solver.shift(&mut problem).unwrap();
            solver.resume(&mut problem).unwrap();
            publisher.publish(&problem, solver.solution(), 0.0).unwrap();
            policy.control(0.015, &x0, &mut u).unwrap();
        });
        assert_eq!(count, 0, "model {last}");
    }
}

/// Checks that new references of all knots allocate nothing in a loop that shifts the horizon, also with copies of
/// actions for a second thread, which get the same references.
#[test]
fn references_of_a_moving_horizon_allocate_nothing() {
    let arm = std::sync::Arc::new(robots::arm7());
    let x0 = vec![0.1; 14];
    let knot = |weight: f64| {
        let follow = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.3, 0.0, 0.5) };
        let costs = vec![
            Cost::new("follow", weight, follow, Activation::Quadratic),
            Cost::new("rest", 0.1, Residual::State { reference: x0.clone() }, Activation::Weighted(vec![1.0; 14])),
            Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
        ];
        let knot = FreeDynamics::running(arm.clone(), 0.02, costs).unwrap();
        Box::new(knot) as Box<dyn condyle_optimal::ActionModel>
    };
    let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
    let mut problem = Problem::new(x0.clone(), vec![knot(1.0), knot(2.0)], vec![0; 8], Box::new(end)).unwrap();
    let (mut solver, us) = (Fddp::new(&problem), vec![0.0; 56]);
    let mut same = problem.try_clone().unwrap();
    let mut other = Fddp::new(&same);
    (solver.settings.max_iterations, other.settings.max_iterations) = (2, 2);
    solver.settings.threads = 2;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| solver.solve(&mut problem, &x0.repeat(9), &us).map(drop)).unwrap();
    other.solve(&mut same, &x0.repeat(9), &us).unwrap();
    let mut counts = Vec::new();
    for tick in 0..24 {
        let numbers: Vec<f64> =
            (0..9).flat_map(|t| [0.3 + 0.1 * (0.2 * f64::from(tick + t)).sin(), 0.0, 0.5]).collect();
        let weights: Vec<f64> = (0..9).map(|t| 1.0 + f64::from((tick + t) % 3)).collect();
        let last = usize::from(tick % 3 == 0);
        let run = |problem: &mut Problem, solver: &mut Fddp| {
            problem.shift(last).unwrap();
            solver.shift(problem).unwrap();
            assert!(problem.set_references("follow", &numbers).unwrap());
            assert!(problem.set_weights("rest", &weights).unwrap());
            solver.resume(problem).unwrap();
        };
        counts.push(pool.install(|| allocations(|| run(&mut problem, &mut solver))));
        run(&mut same, &mut other);
        assert_eq!(solver.solution().xs, other.solution().xs, "tick {tick}");
    }
    assert_eq!(counts[12..], [0; 12], "{counts:?}");
}

/// Checks that changes of multipliers, bounds and penalties do not allocate.
#[test]
fn a_constrained_solve_of_a_robot_allocates_nothing() {
    count_of_constrained_solves(|limit| limit);
}

#[test]
fn a_solve_with_soft_limits_allocates_nothing() {
    count_of_constrained_solves(|limit| limit.softened(1e-2, 1e-2));
}

/// Counts the allocations of solves with limits, some of which `change` changes.
fn count_of_constrained_solves(change: fn(Limit) -> Limit) {
    let arm = std::sync::Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let control = || Residual::Control { reference: vec![0.0; 7] };
    let costs = vec![
        Cost::new("rest", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic),
        Cost::new("effort", 1e-3, control(), Activation::Quadratic),
    ];
    let weak = Limit::new("weak", control(), vec![-34.0; 7], vec![34.0; 7]);
    let ball = Geometry::in_world(Shape::sphere([0.5, 0.1, 0.4], 0.1));
    let pair = GeometryPair::new(Geometry::on("tool", Shape::sphere([0.0; 3], 0.05)), ball);
    let clear = Limit::new("clear", Residual::distances(vec![pair]), vec![0.0], vec![f64::INFINITY]);
    let target = Vec3::new(0.35, 0.2, 0.6);
    let reach = Residual::FrameTranslation { frame: "tool".into(), target };
    let (weak, reach) = (change(weak), change(Limit::equality("reach", reach)));
    let (none, zero) = ([f64::INFINITY; 7], [0.0; 7]);
    let (low, high) = ([none.map(|x| -x), zero].concat(), [none, zero].concat());
    let stop = Limit::new("stop", Residual::State { reference: vec![0.0; 14] }, low, high);
    let mut knot = FreeDynamics::running(arm.clone(), 0.05, costs).unwrap().with_limits(vec![weak, clear]).unwrap();
    knot.set_limits(3, vec![]).unwrap();
    let us = knot.quasi_static(&x0).repeat(10);
    let end = FreeDynamics::terminal(arm, vec![]).unwrap().with_limits(vec![reach, stop]).unwrap();
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 10], Box::new(end)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let xs = x0.repeat(11);
    for threads in [1, 2] {
        solver.inner.threads = threads;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let count = pool.install(|| {
            solver.solve(&mut problem, &xs, &us).unwrap();
            allocations(|| {
                solver.solve(&mut problem, &xs, &us).unwrap();
            })
        });
        assert_eq!(count, 0, "{threads} threads");
        assert_eq!(solver.solution().status, Status::Converged);
        assert!(solver.outcome().multipliers.iter().flatten().any(|y| *y != 0.0));
    }
    let mut solver = InteriorPoint::new(&problem);
    for threads in [1, 2] {
        solver.settings.threads = threads;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let counts = pool.install(|| {
            solver.solve(&mut problem, &xs, &us).unwrap();
            solver.tick(&mut problem, 2).unwrap();
            let solve = allocations(|| {
                solver.solve(&mut problem, &xs, &us).unwrap();
            });
            assert_eq!(solver.solution().status, Status::Converged);
            let tick = allocations(|| {
                solver.tick(&mut problem, 2).unwrap();
                solver.resume(&mut problem).unwrap();
            });
            let parts = allocations(|| {
                solver.prepare(&mut problem, 2).unwrap();
                solver.feedback(&mut problem, &x0).unwrap();
            });
            [solve, tick, parts]
        });
        assert_eq!(counts, [0; 3], "{threads} threads");
    }
    solver.settings.threads = 1;
    solver.solve(&mut problem, &xs, &us).unwrap();
    let next = solver.solution().x(1).to_vec();
    let count = allocations(|| {
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        problem.set_x0(&next).unwrap();
        solver.tick(&mut problem, 2).unwrap();
    });
    assert!(count <= 16, "{count}"); // memory for old multipliers, and for rows that move to other knots
    let next = solver.solution().x(1).to_vec();
    let count = allocations(|| {
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        problem.set_x0(&next).unwrap();
        solver.tick(&mut problem, 2).unwrap();
    });
    assert_eq!(count, 0);
    // At the second of these shifts, the knot without limits leaves the horizon. There are then more rows than ever,
    // also for the copy before the third shift.
    for (shift, push) in [0.0, 0.1, 0.0, 0.0, 0.5].into_iter().enumerate() {
        let mut next = solver.solution().x(1).to_vec();
        next[8] += push;
        let count = allocations(|| {
            problem.shift(0).unwrap();
            solver.shift(&mut problem).unwrap();
            solver.prepare(&mut problem, 2).unwrap();
            solver.feedback(&mut problem, &next).unwrap();
        });
        let plan = solver.solution();
        assert!(plan.is_executable() && plan.fallback.is_none(), "{push} {:?}", plan.fallback);
        assert!(count == 0 || shift == 1 || shift == 2, "{count} {push}");
    }
}

/// Checks that iterations in two halves allocate nothing, while the horizon moves.
#[test]
fn halves_of_iterations_allocate_nothing() {
    let mut problem = cartpole(&[0.0, 0.2, 0.0, 0.0], 40, 1);
    let mut solver = Fddp::new(&problem);
    solver.solve(&mut problem, &[0.0, 0.2, 0.0, 0.0].repeat(41), &[0.0; 40]).unwrap();
    let mut x = [0.0, 0.2, 0.0, 0.0];
    for tick in 0..10 {
        let count = allocations(|| {
            problem.shift(0).unwrap();
            solver.shift(&mut problem).unwrap();
            x.copy_from_slice(solver.solution().x(0));
            x[3] += if tick == 5 { 0.3 } else { 0.0 };
            solver.prepare(&mut problem).unwrap();
            solver.feedback(&mut problem, &x, 3).unwrap();
        });
        assert_eq!(count, 0, "tick {tick}");
        assert!(solver.solution().is_executable());
    }
}

/// Counts the allocations of periods shorter than a knot, in which contacts change at times within knots.
#[test]
fn a_horizon_at_other_times_allocates_nothing() {
    let model = std::sync::Arc::new(robots::quadruped());
    let q = [vec![0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0], [0.0, 0.7, -1.4, 0.0, -0.7, 1.4].repeat(2)].concat();
    let x0 = [q, vec![0.0; 18]].concat();
    let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
    let cone = FrictionCone::new(0.7);
    let (lower, upper) = cone.bounds();
    let rest = || Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic);
    let stance = |feet: &[&str]| {
        let contact = |foot: &&str| {
            let point = ContactConstraint::point(model.frame(foot).unwrap());
            Contact::new(foot, ContactConstraint { kd: 50.0, ..point })
        };
        let contacts: Vec<_> = feet.iter().map(contact).collect();
        let limit = |foot: &&str| {
            let residual = Residual::FrictionCone { contact: (*foot).into(), cone: cone.clone() };
            Limit::new(foot, residual, lower.clone(), upper.clone())
        };
        let knot = ContactDynamics::running(model.clone(), &contacts, 0.02, vec![rest()]).unwrap();
        Box::new(knot.with_limits(feet.iter().map(limit).collect()).unwrap()) as Box<dyn ActionModel>
    };
    let models = vec![stance(&feet), stance(&[feet[0], feet[3]]), stance(&[feet[1], feet[2]])];
    let end = FreeDynamics::terminal(model.clone(), vec![rest()]).unwrap();
    let mut problem = Problem::new(x0.clone(), models, vec![0; 12], Box::new(end)).unwrap();
    let mut schedule = Schedule::new(0.02, 0).unwrap();
    for step in 0..12 {
        let begin = 0.05 + 0.1 * f64::from(step);
        schedule.switch(begin, 1 + step as usize % 2).unwrap();
        schedule.switch(begin + 0.07, 0).unwrap();
    }
    let xs = x0.repeat(13);
    let us = problem.quasi_static(&xs).unwrap();
    let references = x0.repeat(13);
    problem.set_references("rest", &references).unwrap(); // each knot gets memory for its references
    let (mut fddp, mut solver) = (Fddp::new(&problem), InteriorPoint::new(&problem));
    fddp.settings.max_iterations = 1;
    fddp.solve(&mut problem, &xs, &us).unwrap();
    solver.solve(&mut problem, &xs, &us).unwrap();
    let (mut knot_models, mut durations, mut ahead) = ([0; 12], [0.0; 12], vec![0.0; x0.len()]);
    let mut period = |problem: &mut Problem, solver: &mut InteriorPoint, tick: u32| {
        schedule.write_knots(0.007 * f64::from(tick), &mut knot_models, &mut durations);
        solver.solution().predict(problem, &x0, 0.0, 0.007, &mut ahead).unwrap();
        solver.retime(problem, 0.007, &knot_models, &durations).unwrap();
        problem.set_x0(&ahead).unwrap();
        problem.set_references("rest", &references).unwrap();
        solver.tick(problem, 2).unwrap();
    };
    // in the first steps, knots get memory for references and rows of limits
    (1..100).for_each(|tick| period(&mut problem, &mut solver, tick));
    let counts: Vec<_> = (100..160).map(|tick| allocations(|| period(&mut problem, &mut solver, tick))).collect();
    assert_eq!(counts, [0; 60]);
    let mut retime = |problem: &mut Problem, tick: u32| {
        schedule.write_knots(0.007 * f64::from(tick), &mut knot_models, &mut durations);
        fddp.retime(problem, 0.007, &knot_models, &durations).unwrap();
    };
    retime(&mut problem, 160);
    assert_eq!(allocations(|| (161..175).for_each(|tick| retime(&mut problem, tick))), 0);
}

/// Counts the allocations of solves in which limits become active. The robot first stands; then the forces of its feet
/// exceed the limits.
#[test]
fn active_rows_allocate_nothing() {
    let model = std::sync::Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let contacts = feet.map(|name| Contact::new(name, ContactConstraint::point(model.frame(name).unwrap())));
    let cone = FrictionCone::new(0.7);
    let (lower, upper) = cone.bounds();
    let limited = |foot: &str| {
        let force = Residual::ContactForce { contact: foot.into(), target: Force::zero() };
        let bounds = Activation::Barrier { lower: vec![-200.0; 3], upper: vec![200.0; 3] };
        let grip = Residual::FrictionCone { contact: foot.into(), cone: cone.clone() };
        let grips = Activation::Barrier { lower: lower.clone(), upper: upper.clone() };
        [
            Cost::new(&format!("{foot} force"), 1e-2, force, bounds),
            Cost::new(&format!("{foot} grip"), 1e-2, grip, grips),
        ]
    };
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic);
    let running = [vec![effort], feet.map(limited).concat()].concat();
    let mut stance = ContactDynamics::running(model.clone(), &contacts, 0.01, running).unwrap();
    let us = stance.quasi_static(&x0).repeat(8);
    let ahead = Residual::CenterOfMass { target: Vec3::new(0.3, 0.0, 0.4) };
    let end = FreeDynamics::terminal(model, vec![Cost::new("ahead", 1e5, ahead, Activation::Quadratic)]).unwrap();
    let mut problem = Problem::new(x0.clone(), vec![Box::new(stance)], vec![0; 8], Box::new(end)).unwrap();
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 3;
    let mut counts = [None; 4];
    solver
        .solve_with(&mut problem, &x0.repeat(9), &us, |i: &Iteration| counts[i.iteration] = Some(allocated()))
        .unwrap();
    assert_eq!(counts[0], counts[2], "{counts:?}");
}

/// Residual: the height of the tool above a slope.
struct Height(usize);

impl GenericResidual for Height {
    fn size(&self) -> usize {
        1
    }
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let p = state.placements().frame(self.0).translation;
        r[0] = p.z - p.x * S::splat(0.1);
    }
}

/// Checks that user-defined residuals and changes of their targets do not allocate.
#[test]
fn own_residuals_and_changed_targets_allocate_nothing() {
    let arm = std::sync::Arc::new(robots::arm7());
    let height = || Residual::Own(OwnResidual::autodiff(arm.clone(), Height(arm.frame("tool").unwrap())));
    let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    let costs = || {
        vec![
            Cost::new("height", 1.0, height(), Activation::Quadratic),
            Cost::new("reach", 1.0, reach.clone(), Activation::Quadratic),
            Cost::new("rest", 1e-2, Residual::State { reference: vec![0.1; 14] }, Activation::Quadratic),
        ]
    };
    let knot = FreeDynamics::running(arm.clone(), 0.02, costs()).unwrap();
    let end = FreeDynamics::terminal(arm.clone(), costs()).unwrap();
    let mut problem = Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 10], Box::new(end)).unwrap();
    let (xs, us, mut solver) = ([0.1; 14].repeat(11), [0.0; 70], Fddp::new(&problem));
    solver.solve(&mut problem, &xs, &us).unwrap();
    let reference = [0.2; 14];
    let count = allocations(|| {
        problem.cost_mut(0, "reach").unwrap().set_target(Vec3::new(0.3, 0.2, 0.5)).unwrap();
        problem.cost_at_mut(10, "height").unwrap().set_weight(2.0).unwrap();
        problem.change_costs("rest", |cost| cost.set_target(&reference)).unwrap();
        solver.solve(&mut problem, &xs, &us).unwrap();
    });
    assert_eq!(count, 0);
}
