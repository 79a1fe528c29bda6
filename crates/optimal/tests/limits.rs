//! Robots with limits: comparisons with closed forms, with IPOPT's optimum, and with other formulations. Also checks
//! friction cones.
#![allow(non_snake_case)] // names follow the literature: G

#[path = "limits/rules.rs"]
mod rules;
#[path = "limits/starts.rs"]
mod starts;

use condyle_dynamics::{
    ConstraintSet, ContactConstraint as Held, Data, Inertia, Joint, Model, ModelBuilder, ReferenceFrame, Se3, Sym3,
    Vec3, WORLD, constrained_dynamics, forward_kinematics, neutral, robots,
};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, FreeInverseDynamics,
    FrictionCone, Integrated, Integrator, Limit, Residual,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, Constrained, ConstraintSettings, Fddp, LqKnot, PathConstraint, Problem, Status,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use std::sync::Arc;
use std::time::Duration;

/// Tolerance of costs in the comparison with IPOPT. Both solvers stop at residuals of 1e-7 or less. Near the optimum,
/// costs change less than the residuals, but states and controls change as much.
const COST: f64 = 1e-6;
const TRAJECTORY: f64 = 1e-4;
/// Tolerance of the constraints at the end of a solve; the next constant is the tolerance of the gradient.
const PRIMAL: f64 = 1e-7;
const DUAL: f64 = 1e-6;

fn quadratic(name: &str, weight: f64, residual: Residual) -> Cost {
    Cost::new(name, weight, residual, Activation::Quadratic)
}

fn control(nu: usize) -> Residual {
    Residual::Control { reference: vec![0.0; nu] }
}

/// Returns a solver with tight tolerances.
fn solver(problem: &Problem) -> AugmentedLagrangian {
    let mut solver = AugmentedLagrangian::new(problem);
    solver.settings = ConstraintSettings { tolerance: PRIMAL, tolerance_dual: DUAL, ..ConstraintSettings::default() };
    solver
}

/// Solves a problem, and asserts that the residuals are below the tolerances.
fn solve(problem: &mut Problem, xs: &[f64], us: &[f64]) -> AugmentedLagrangian {
    let mut solver = solver(problem);
    let status = solver.solve(problem, xs, us).unwrap().status;
    let outcome = solver.outcome();
    println!(
        "{status:?}: primal {:.1e}, dual {:.1e}, penalty {:e}, {} solves, {} iterations, cost {}",
        outcome.primal, outcome.dual, outcome.penalty, outcome.solves, outcome.iterations, outcome.cost
    );
    assert_eq!(status, Status::Converged);
    assert!(outcome.primal <= PRIMAL && outcome.dual <= DUAL);
    solver
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
}

/// Maximum effort of the arm's joints (N m). To hold the initial posture, the second joint needs 29.6 N m.
const WEAK: f64 = 30.0;
const ARM: [f64; 14] = [0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Compares the motion of a cart on rails with its closed form. The cart moves to a point and stops there, G u = d, at
/// the cost ½ Δt ‖u‖². The solution is u = Gᵀ(G Gᵀ)⁻¹ d, with the multipliers −Δt (G Gᵀ)⁻¹ d. An additional bound on u
/// is satisfied too.
#[test]
fn a_cart_is_a_closed_form() {
    let mut builder = ModelBuilder::new("cart");
    let (mass, dt, horizon) = (2.0, 0.1, 10);
    let inertia = Inertia::from_com(mass, Vec3::zero(), Sym3::diagonal(0.1));
    let rails = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
    builder.body("cart", WORLD, rails, Se3::identity(), inertia);
    let cart = Arc::new(builder.build().unwrap());
    let solve_with = |limits: Vec<Limit>| {
        let costs = vec![quadratic("effort", 1.0, control(1))];
        let knot = FreeDynamics::running(cart.clone(), dt, costs).unwrap().with_limits(limits).unwrap();
        let there = Residual::State { reference: vec![1.0, 0.0] };
        let there = Limit::equality("there", there);
        let end = FreeDynamics::terminal(cart.clone(), vec![]).unwrap().with_limits(vec![there]).unwrap();
        let mut problem = Problem::new(vec![0.0; 2], vec![Box::new(knot)], vec![0; horizon], Box::new(end)).unwrap();
        let solver = solve(&mut problem, &[0.0; 22], &[0.0; 10]);
        (solver.solution().us.clone(), solver.outcome().multipliers.clone())
    };
    // final velocity and position: v_N = Σ u Δt / m, x_N = Σ (N − t) u Δt² / m
    let G = DMatrix::from_fn(2, horizon, |i, t| {
        let a = dt / mass;
        if i == 0 { a * dt * (horizon - t) as f64 } else { a }
    });
    let d = DVector::from_vec(vec![1.0, 0.0]);
    let w = (&G * G.transpose()).lu().solve(&d).unwrap();
    let (us, multipliers) = solve_with(vec![]);
    assert!(largest_difference(&us, (G.transpose() * &w).as_slice()) < TRAJECTORY);
    assert!(largest_difference(&multipliers[horizon], (-dt * w).as_slice()) < 1e-3);
    assert!(multipliers[..horizon].iter().all(Vec::is_empty));
    let most = 0.9 * us[0];
    let (us, multipliers) = solve_with(vec![Limit::new("effort", control(1), vec![-most], vec![most])]);
    assert!((us[0] - most).abs() < 1e-6 && (us[9] + most).abs() < 1e-6);
    assert!(multipliers[0][0] > 0.0 && multipliers[9][0] < 0.0 && multipliers[4][0] == 0.0);
}

fn numbers(value: &Value) -> Vec<f64> {
    let of = |v: &Value| if v.is_array() { numbers(v) } else { vec![v.as_f64().unwrap()] };
    value.as_array().unwrap().iter().flat_map(of).collect()
}

/// Compares the optimum of an arm with IPOPT's. The arm comes to rest with its tool at a point, with active bounds on
/// efforts and speeds. The controls are efforts in one problem, and accelerations in the other.
#[test]
fn reaching_is_ipopts() {
    let data: Value = serde_json::from_str(include_str!("data/ipopt.json")).unwrap();
    let data = &data["reach"];
    let (x0, effort, target) = (numbers(&data["x0"]), numbers(&data["effort"]), numbers(&data["target"]));
    let (speed, horizon) = (data["speed"].as_f64().unwrap(), data["horizon"].as_u64().unwrap() as usize);
    let (dt, cost) = (data["dt"].as_f64().unwrap(), data["cost"].as_f64().unwrap());
    let arm = Arc::new(robots::arm7());
    let point = Vec3::new(target[0], target[1], target[2]);
    let state = || Residual::State { reference: x0.clone() };
    let tau = || Residual::JointEffort { reference: vec![0.0; 7] };
    let costs = || vec![quadratic("rest", 0.1, state()), quadratic("effort", 1e-3, tau())];
    let within = |q: f64, v: f64| [vec![q; 7], vec![v; 7]].concat();
    let infinite = f64::INFINITY;
    let limits = || {
        vec![
            Limit::new("effort", tau(), effort.iter().map(|x| -x).collect(), effort.clone()),
            Limit::new("speed", state(), within(-infinite, -speed), within(infinite, speed)),
        ]
    };
    let end = || {
        let reach = Residual::FrameTranslation { frame: "tool".into(), target: point };
        let limits = vec![
            Limit::equality("reach", reach),
            Limit::new("stop", state(), within(-infinite, 0.0), within(infinite, 0.0)),
        ];
        FreeDynamics::terminal(arm.clone(), vec![]).unwrap().with_limits(limits).unwrap()
    };
    let mut free = FreeDynamics::running(arm.clone(), dt, costs()).unwrap().with_limits(limits()).unwrap();
    let hold = free.quasi_static(&x0).repeat(horizon);
    let inverse = FreeInverseDynamics::running(arm.clone(), dt, costs()).unwrap().with_limits(limits()).unwrap();
    let knots: [(Box<dyn ActionModel>, _); 2] = [(Box::new(free), hold), (Box::new(inverse), vec![0.0; 7 * horizon])];
    for (k, (knot, us)) in knots.into_iter().enumerate() {
        let mut problem = Problem::new(x0.clone(), vec![knot], vec![0; horizon], Box::new(end())).unwrap();
        let solver = solve(&mut problem, &x0.repeat(horizon + 1), &us);
        let (solution, outcome) = (solver.solution(), solver.outcome());
        assert!((outcome.cost - cost).abs() < COST * (1.0 + cost), "{} {cost}", outcome.cost);
        let error = largest_difference(&solution.xs, &numbers(&data["xs"]));
        println!("cost differs by {:e}, states by {error:e}", (outcome.cost - cost).abs());
        assert!(error < TRAJECTORY, "states differ by {error:e}");
        if k == 0 {
            let error = largest_difference(&solution.us, &numbers(&data["us"]));
            assert!(error < 20.0 * TRAJECTORY, "efforts, of up to 38 N m, differ by {error:e}");
        }
        let tool =
            forward_kinematics(&arm, &mut Data::new(&arm), &solution.x(horizon)[..7]).frame(arm.frame("tool").unwrap());
        assert!(largest_difference(&tool.translation.to_array(), &target) < 2.0 * PRIMAL);
        // each knot limits 7 efforts and 14 states, the terminal knot 3 + 14 entries; some of the limits are active
        assert!(outcome.multipliers[..horizon].iter().all(|y| y.len() == 21));
        assert_eq!(outcome.multipliers[horizon].len(), 17);
        assert!(outcome.multipliers.iter().flatten().filter(|y| **y != 0.0).count() > 20);
    }
}

/// User-defined constraint |u| ≤ bound.
struct Weak {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl PathConstraint for Weak {
    fn size(&self) -> usize {
        self.lower.len()
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn calc(&mut self, _: usize, _: &[f64], u: &[f64], g: &mut [f64]) {
        g.copy_from_slice(u);
    }
    fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        gx.fill(0.0);
        gu.fill_with_identity();
        true
    }
}

/// Checks that the same bounds give the same optimum as a robot's limit, as a user-defined constraint, as a mixture of
/// both, and with other settings.
#[test]
fn limits_and_constraints_find_one_optimum() {
    let arm = Arc::new(robots::arm7());
    let bounds = |rows: core::ops::Range<usize>| {
        let bound = |i: usize| if rows.contains(&i) { WEAK } else { f64::INFINITY };
        let upper: Vec<_> = (0..7).map(bound).collect();
        (upper.iter().map(|x| -x).collect::<Vec<_>>(), upper)
    };
    let knot = || {
        let costs = vec![
            quadratic("rest", 1e-1, Residual::State { reference: ARM.to_vec() }),
            quadratic("effort", 1e-3, control(7)),
        ];
        FreeDynamics::running(arm.clone(), 0.05, costs).unwrap()
    };
    let limited = |rows| {
        let (lower, upper) = bounds(rows);
        knot().with_limits(vec![Limit::new("weak", control(7), lower, upper)]).unwrap()
    };
    let written = |knot: FreeDynamics, rows| {
        let (lower, upper) = bounds(rows);
        Box::new(Constrained::new(Box::new(knot), Box::new(Weak { lower, upper })))
    };
    let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.35, 0.2, 0.6) };
    let infinite = vec![f64::INFINITY; 7];
    let (below, above) = (infinite.iter().map(|x| -x).collect::<Vec<_>>(), infinite);
    let stop = Residual::State { reference: ARM.to_vec() };
    let stop = Limit::new("stop", stop, [below, vec![0.0; 7]].concat(), [above, vec![0.0; 7]].concat());
    let reach = || vec![Limit::equality("reach", reach.clone()), stop.clone()];
    let horizon = 12;
    let run = |knot: Box<dyn ActionModel>, change: &dyn Fn(&mut AugmentedLagrangian)| {
        let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap().with_limits(reach()).unwrap();
        let mut problem = Problem::new(ARM.to_vec(), vec![knot], vec![0; horizon], Box::new(end)).unwrap();
        let mut solver = solver(&problem);
        change(&mut solver);
        let us = FreeDynamics::running(arm.clone(), 0.05, vec![]).unwrap().quasi_static(&ARM).repeat(horizon);
        let solution = solver.solve(&mut problem, &ARM.repeat(horizon + 1), &us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        (solution.us.clone(), solver.outcome().clone())
    };
    let (us, outcome) = run(Box::new(limited(0..7)), &|_| ());
    assert!(us.iter().any(|u| (u.abs() - WEAK).abs() < 1e-6) && us.iter().all(|u| u.abs() < WEAK + 1e-6));
    type Way<'a> = (Box<dyn ActionModel>, &'a dyn Fn(&mut AugmentedLagrangian));
    let ways: [Way<'_>; 3] = [
        (written(knot(), 0..7), &|_| ()),
        (written(limited(0..2), 2..7), &|_| ()),
        (Box::new(limited(0..7)), &|solver| solver.inner.inverse_dynamics_form = false),
    ];
    for (k, (knot, change)) in ways.into_iter().enumerate() {
        let (other, theirs) = run(knot, change);
        assert!((theirs.cost - outcome.cost).abs() < COST * outcome.cost, "way {k}");
        assert!(largest_difference(&other, &us) < 10.0 * TRAJECTORY, "way {k}");
        for (y, found) in outcome.multipliers[..horizon].iter().zip(&theirs.multipliers) {
            // the rows of a robot's limits come first, then the rows of the constraint that wraps the robot's action
            let found: Vec<_> = match found.len() {
                7 => found.clone(),
                _ => [&found[..2], &found[9..]].concat(),
            };
            assert!(largest_difference(y, &found) < 1e-3, "way {k}");
        }
    }
    // the copies for threads have the same multipliers as their models
    let (threaded, theirs) = run(Box::new(limited(0..7)), &|solver| solver.inner.threads = 2);
    assert_eq!((threaded, theirs), (us, outcome));
}

/// Checks the friction cones of a quadruped that moves its trunk so fast that it would slip. The cone of each foot is
/// satisfied, and is active.
#[test]
fn a_stance_does_not_slip() {
    let model = Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let reference = ReferenceFrame::LocalWorldAligned;
    let held = feet.map(|foot| Held { reference, kd: 20.0, ..Held::point(model.frame(foot).unwrap()) });
    let contacts: Vec<_> = feet.iter().zip(held).map(|(foot, held)| Contact::new(foot, held)).collect();
    let com = condyle_dynamics::centroidal_map(&model, &mut Data::new(&model), &x0[..19]).com;
    let horizon = 12;
    let (cone, dt) = (FrictionCone { least: 5.0, ..FrictionCone::new(0.3) }, 0.02);
    let stance = |limits| {
        let costs = vec![
            quadratic("state", 1e-1, Residual::State { reference: x0.clone() }),
            quadratic("effort", 1e-3, control(12)),
        ];
        ContactDynamics::running(model.clone(), &contacts, dt, costs).unwrap().with_limits(limits).unwrap()
    };
    let (lower, upper) = cone.bounds();
    let grip = |foot: &str| {
        let residual = Residual::FrictionCone { contact: foot.into(), cone: cone.clone() };
        Limit::new(foot, residual, lower.clone(), upper.clone())
    };
    // returns the largest excess of a force beyond its cone along a trajectory, and the number of rows at their bounds
    let slip = |xs: &[f64], us: &[f64]| {
        let (mut data, mut set) = (Data::new(&model), ConstraintSet::new(&model, &held).unwrap());
        let (mut worst, mut active) = (f64::NEG_INFINITY, 0);
        for t in 0..horizon {
            let (q, v) = xs[37 * t..][..37].split_at(19);
            let tau = [&[0.0; 6], &us[12 * t..][..12]].concat();
            let d = constrained_dynamics(&model, &mut data, &mut set, q, v, &tau, &[]);
            for f in d.lambda.chunks_exact(3) {
                for (row, (l, u)) in cone.rows().iter().zip(lower.iter().zip(&upper)) {
                    let value: f64 = row.iter().zip(f).map(|(w, f)| w * f).sum();
                    worst = worst.max((value - u).max(l - value));
                    active += usize::from((value - u).abs().min((value - l).abs()) < 1e-5);
                }
            }
        }
        (worst, active)
    };
    let run = |limits: Vec<Limit>| {
        let ahead = Residual::CenterOfMass { target: com + Vec3::new(0.04, 0.0, 0.0) };
        let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
        let end = end.with_limits(vec![Limit::equality("ahead", ahead)]).unwrap();
        let mut knot = stance(limits);
        let us = knot.quasi_static(&x0).repeat(horizon);
        let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; horizon], Box::new(end)).unwrap();
        let solver = solve(&mut problem, &x0.repeat(horizon + 1), &us);
        let found = solver.solution();
        (slip(&found.xs, &found.us), solver.outcome().clone())
    };
    let ((worst, _), free) = run(vec![]);
    assert!(worst > 1.0, "without limits the feet slip: {worst} N");
    let ((worst, active), bound) = run(feet.map(grip).into());
    println!("largest excess {worst:e} N, {active} rows active");
    assert!(worst < 2.0 * PRIMAL && active > 0);
    assert!(bound.cost > free.cost, "what is bound costs more");
}

/// Checks that limits are satisfied at the knots with another integrator.
#[test]
fn limits_hold_with_runge_kutta() {
    let arm = Arc::new(robots::arm7());
    let costs = vec![quadratic("effort", 1e-3, control(7))];
    let inner = FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), costs).unwrap();
    let speed = Residual::State { reference: ARM.to_vec() };
    let bounds = |b: f64| [vec![b * f64::INFINITY; 7], vec![b * 0.3; 7]].concat();
    let speed = Limit::new("speed", speed, bounds(-1.0), bounds(1.0));
    let knot = Integrated::new(inner, Integrator::RungeKutta2, 0.05).unwrap().with_limits(vec![speed]).unwrap();
    let there = Residual::State { reference: [&[0.1; 7][..], &[0.0; 7]].concat() };
    let end = FreeDynamics::terminal(arm.clone(), vec![quadratic("there", 10.0, there)]).unwrap();
    let us = FreeDynamics::running(arm.clone(), 0.05, vec![]).unwrap().quasi_static(&ARM).repeat(10);
    let mut problem = Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; 10], Box::new(end)).unwrap();
    let solver = solve(&mut problem, &ARM.repeat(11), &us);
    let speeds: Vec<f64> =
        (1..10).map(|t| solver.solution().x(t)[7..].iter().fold(0.0, |m: f64, v| m.max(v.abs()))).collect();
    assert!(speeds.iter().all(|v| *v < 0.3 + PRIMAL) && speeds.iter().any(|v| (v - 0.3).abs() < 1e-6), "{speeds:?}");
}

/// Checks the value of a limit in a solve by FDDP alone: the barrier 10 · ½ (excess)². A cost with this weight per Δt
/// gives the same value.
#[test]
fn alone_a_limit_is_a_barrier() {
    let arm: Arc<Model> = Arc::new(robots::arm7());
    let (lower, upper, dt) = (vec![-8.0; 7], vec![8.0; 7], 0.05);
    let costs = || vec![quadratic("rest", 1.0, Residual::State { reference: ARM.to_vec() })];
    let barrier = Activation::Barrier { lower: lower.clone(), upper: upper.clone() };
    let barrier = Cost::new("weak", 10.0 / dt, control(7), barrier);
    let tiny = || quadratic("effort", 1e-2, control(7));
    let by_cost = FreeDynamics::running(arm.clone(), dt, [costs(), vec![tiny(), barrier]].concat()).unwrap();
    let limit = Limit::new("weak", control(7), lower, upper);
    let by_limit = FreeDynamics::running(arm.clone(), dt, [costs(), vec![tiny()]].concat()).unwrap();
    let by_limit = by_limit.with_limits(vec![limit]).unwrap();
    let [one, other] = [by_cost, by_limit].map(|knot| {
        let end = FreeDynamics::terminal(arm.clone(), costs()).unwrap();
        let mut problem = Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; 10], Box::new(end)).unwrap();
        // after a constrained solve, the problem's multipliers are zero again
        AugmentedLagrangian::new(&problem).solve(&mut problem, &ARM.repeat(11), &[0.0; 70]).unwrap();
        Fddp::new(&problem).solve(&mut problem, &ARM.repeat(11), &[0.0; 70]).unwrap().clone()
    });
    assert_eq!((one.status, other.status), (Status::Converged, Status::Converged));
    assert!((one.cost - other.cost).abs() < 1e-9 * one.cost && largest_difference(&one.us, &other.us) < 1e-6);
}

/// User-defined residual: the height of a foot, and the product of this height with a control. The Jacobian is
/// optional.
struct Step {
    model: Arc<Model>,
    frame: usize,
    data: Data<f64>,
    written: bool,
}

impl PathConstraint for Step {
    fn size(&self) -> usize {
        2
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&[0.0, -1.0], &[0.0, -0.5])
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        let height = forward_kinematics(&self.model, &mut self.data, &x[..19]).frame(self.frame).translation.z;
        g.copy_from_slice(&[height, height * u[3]]);
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        if !self.written {
            return false;
        }
        let mut J = DMatrix::zeros(6, 18);
        let placed = forward_kinematics(&self.model, &mut self.data, &x[..19]);
        placed.frame_jacobian(self.frame, ReferenceFrame::LocalWorldAligned, &mut J);
        gx.fill(0.0);
        gu.fill(0.0);
        for k in 0..18 {
            (gx[(0, k)], gx[(1, k)]) = (J[(2, k)], J[(2, k)] * u[3]);
        }
        gu[(1, 3)] = placed.frame(self.frame).translation.z;
        true
    }
}

/// Checks constraints without derivatives, for which the solver takes differences in the tangent space.
#[test]
fn constraints_need_no_derivatives() {
    let model = Arc::new(robots::quadruped());
    let mut q = vec![0.0; 19];
    condyle_dynamics::integrate(&model, &neutral(&model), &[0.3; 18], &mut q);
    let (x, u) = ([q, vec![0.2; 18]].concat(), [0.7; 12]);
    let [written, other] = [true, false].map(|written| {
        let frame = model.frame("RH_foot").unwrap();
        let step = Step { model: model.clone(), frame, data: Data::new(&model), written };
        let action = FreeDynamics::running(model.clone(), 0.02, vec![]).unwrap();
        let mut knot = LqKnot::zeros(36, 12);
        Constrained::new(Box::new(action), Box::new(step)).calc_diff(0, &x, &u, &mut knot);
        knot
    });
    for (name, a, b) in
        [("q", written.q.as_slice(), other.q.as_slice()), ("r", written.r.as_slice(), other.r.as_slice())]
    {
        assert!(largest_difference(a, b) < 1e-7, "{name}");
        assert!(a.iter().any(|x| x.abs() > 1e-2), "{name}");
    }
    assert!((written.Q - other.Q).amax() < 1e-7 && (written.S - other.S).amax() < 1e-7);
}

/// Checks a receding horizon that keeps its multipliers. It finds the same solution as a horizon without them, in fewer
/// iterations.
#[test]
fn a_receding_horizon_keeps_its_multipliers() {
    let (arm, horizon) = (Arc::new(robots::arm7()), 12);
    let rest = Residual::State { reference: ARM.to_vec() };
    let costs = vec![quadratic("rest", 1e-1, rest.clone()), quadratic("effort", 1e-3, control(7))];
    let weak = Limit::new("weak", control(7), vec![-WEAK; 7], vec![WEAK; 7]);
    let knot = FreeDynamics::running(arm.clone(), 0.05, costs).unwrap().with_limits(vec![weak]).unwrap();
    let tool = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.35, 0.2, 0.6) };
    let reach = Limit::equality("reach", tool);
    let end = FreeDynamics::terminal(arm.clone(), vec![quadratic("rest", 1.0, rest)]).unwrap();
    let end = end.with_limits(vec![reach]).unwrap();
    let us = knot.clone().quasi_static(&ARM).repeat(horizon);
    let mut problem = Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; horizon], Box::new(end)).unwrap();
    let mut solver = solver(&problem);
    solver.solve(&mut problem, &ARM.repeat(horizon + 1), &us).unwrap();
    let (mut iterations, mut active) = ([0, 0], 0);
    for step in 0..6 {
        let before = (solver.solution().clone(), solver.outcome().clone());
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        let moved = solver.outcome();
        assert!((0..horizon - 1).all(|t| moved.multipliers[t] == before.1.multipliers[t + 1]));
        assert_eq!(moved.multipliers[horizon - 1], before.1.multipliers[horizon - 1]);
        let measured: Vec<f64> = before.0.x(1).iter().map(|x| x + 1e-3 * f64::from(step % 3 - 1)).collect();
        problem.set_x0(&measured).unwrap();
        let (xs, us) = (solver.solution().xs.clone(), solver.solution().us.clone());
        let warm = solver.resume(&mut problem).unwrap().clone();
        let mut cold_solver = self::solver(&problem);
        let cold = cold_solver.solve(&mut problem, &xs, &us).unwrap();
        assert_eq!((warm.status, cold.status), (Status::Converged, Status::Converged), "step {step}");
        assert!(largest_difference(&warm.us, &cold.us) < 10.0 * TRAJECTORY, "step {step}");
        assert!(warm.us.iter().all(|u| u.abs() <= WEAK + PRIMAL));
        active += warm.us.iter().filter(|u| u.abs() > WEAK - 1e-6).count();
        for (sum, solver) in iterations.iter_mut().zip([&solver, &cold_solver]) {
            *sum += solver.outcome().iterations;
        }
    }
    println!("{} iterations with multipliers, {} without, {active} controls at a limit", iterations[0], iterations[1]);
    assert!(active > 0 && 3 * iterations[0] < 2 * iterations[1]);
    // a solve that starts from the solution has nothing to improve
    let (us, multipliers) = (solver.solution().us.clone(), solver.outcome().multipliers.clone());
    let again = solver.resume(&mut problem).unwrap();
    assert!(again.status == Status::Converged && largest_difference(&again.us, &us) < TRAJECTORY);
    let us = again.us.clone();
    assert_eq!(solver.outcome().solves, 1);
    let worst = multipliers.iter().zip(&solver.outcome().multipliers).map(|(a, b)| largest_difference(a, b));
    assert!(worst.fold(0.0, f64::max) < 1e-3);
    // the time limit applies to all inner solves together, and the remaining violation is measured
    solver.inner.time_budget = Some(Duration::ZERO);
    problem.set_x0(&ARM).unwrap();
    let late = solver.resume(&mut problem).unwrap();
    assert_eq!((late.status, &late.us), (Status::TimeLimit, &us));
    assert!(solver.outcome().primal > 1e-3 && solver.outcome().solves == 1);
}
