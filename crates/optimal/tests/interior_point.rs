//! Interior point: optima of robots under limits, steps at a rate, outcomes, and equal bits on several threads.

mod common;
#[path = "interior_point/soft.rs"]
mod soft;

use common::{Linear, Unicycle, random, random_knot};
use condyle_dynamics::{ContactConstraint, Vec3, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, FrictionCone,
    ImpulseDynamics, Integrator, Limit, Residual,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, Constrained, InteriorPoint, Iteration, LqKnot, NumDiff, PathConstraint, Problem,
    Solution, Status, ViolationKind,
};
use core::ops::ControlFlow;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use std::sync::Arc;
use std::time::Duration;

/// Tolerance of costs that two solvers find, relative to 1 + cost. The solvers stop at residuals of 1e-6.
const COST: f64 = 1e-5;
/// Tolerance of limits.
const LIMIT: f64 = 1e-6;

/// Problem with a warm start.
struct Case {
    name: &'static str,
    problem: Problem,
    xs: Vec<f64>,
    us: Vec<f64>,
}

fn quadratic(name: &str, weight: f64, residual: Residual) -> Cost {
    Cost::new(name, weight, residual, Activation::Quadratic)
}

/// Creates the reach of an arm whose efforts and speeds are limited, so tightly that the limits are active.
fn reach(effort: f64) -> Case {
    reach_with(effort, |limit| limit)
}

/// Creates the same reach with changed limits.
fn reach_with(effort: f64, change: impl Fn(Limit) -> Limit) -> Case {
    let model = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let tool = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.4, 0.5) };
    let state = || Residual::State { reference: vec![0.0; 14] };
    let control = || Residual::Control { reference: vec![0.0; 7] };
    let costs = vec![quadratic("effort", 1e-4, control()), quadratic("rest", 1e-2, state())];
    let (low, high) = ([vec![-2.0; 7], vec![-0.8; 7]].concat(), [vec![2.0; 7], vec![0.8; 7]].concat());
    let limits = vec![
        Limit::new("effort", control(), vec![-effort; 7], vec![effort; 7]),
        Limit::new("state", state(), low.clone(), high.clone()),
    ];
    let limits = limits.into_iter().map(&change).collect();
    let mut knot = FreeDynamics::running(model.clone(), 0.03, costs).unwrap().with_limits(limits).unwrap();
    let us = knot.quasi_static(&x0).repeat(25);
    let end = FreeDynamics::terminal(model, vec![quadratic("tool", 50.0, tool)]).unwrap();
    let end = end.with_limits(vec![change(Limit::new("state", state(), low, high))]).unwrap();
    let problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 25], Box::new(end)).unwrap();
    Case { name: "reach", problem, xs: x0.repeat(26), us }
}

/// Creates a hop of a quadruped: stance under friction cones, an impact, flight by Euler and by Runge–Kutta. If
/// `copies` is not set, an impact with finite differences cannot be copied for other threads.
fn hop(copies: bool) -> Case {
    hop_with(copies, |limit| limit)
}

/// Creates the same hop with changed limits.
fn hop_with(copies: bool, change: impl Fn(Limit) -> Limit) -> Case {
    let model = Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let contacts = feet.map(|name| {
        let point = ContactConstraint::point(model.frame(name).unwrap());
        Contact::new(name, ContactConstraint { kd: 20.0, ..point })
    });
    let cone = FrictionCone::new(0.3);
    let (lower, upper) = cone.bounds();
    let grip = |foot: &str| {
        let residual = Residual::FrictionCone { contact: foot.into(), cone: cone.clone() };
        change(Limit::new(foot, residual, lower.clone(), upper.clone()))
    };
    let com = || Residual::CenterOfMass { target: Vec3::new(0.05, 0.02, 0.45) };
    let control = || Residual::Control { reference: vec![0.0; 12] };
    let costs = |effort: bool| {
        let mut costs =
            vec![quadratic("state", 1.0, Residual::State { reference: x0.clone() }), quadratic("com", 2e1, com())];
        costs.extend(effort.then(|| quadratic("effort", 1e-3, control())));
        costs
    };
    let weak = || change(Limit::new("weak", control(), vec![-38.0; 12], vec![38.0; 12]));
    let limits = [feet.map(grip).to_vec(), vec![weak()]].concat();
    let stance = ContactDynamics::running(model.clone(), &contacts, 0.02, costs(true)).unwrap();
    let mut stance = stance.with_limits(limits).unwrap();
    let us = stance.quasi_static(&x0);
    let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, costs(false)).unwrap();
    let impact: Box<dyn ActionModel> = if copies { Box::new(impact) } else { Box::new(NumDiff(impact)) };
    let free = FreeAcceleration::new(model.clone(), Actuation::joints(&model), costs(true)).unwrap();
    let free = FreeDynamics::new(free, Integrator::RungeKutta2, 0.02).unwrap().with_limits(vec![weak()]).unwrap();
    let flying = FreeDynamics::running(model.clone(), 0.02, costs(true)).unwrap().with_limits(vec![weak()]).unwrap();
    let end = FreeDynamics::terminal(model.clone(), costs(false)).unwrap();
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(stance), impact, Box::new(free), Box::new(flying)];
    let knot_models = [vec![0; 9], vec![2], vec![3; 2], vec![1], vec![0; 9]].concat();
    let us = knot_models.iter().flat_map(|&index| if index == 1 { vec![] } else { us.clone() }).collect();
    let xs = x0.repeat(knot_models.len() + 1);
    let problem = Problem::new(x0, models, knot_models, Box::new(end)).unwrap();
    Case { name: "hop", problem, xs, us }
}

fn cases() -> [Case; 2] {
    [reach(34.0), hop(true)]
}

fn solve(case: &mut Case, set: impl FnOnce(&mut InteriorPoint)) -> (Solution, InteriorPoint) {
    let mut solver = InteriorPoint::new(&case.problem);
    set(&mut solver);
    let solution = solver.solve(&mut case.problem, &case.xs, &case.us).unwrap().clone();
    (solution, solver)
}

fn without_times(mut solution: Solution) -> Solution {
    solution.timings = Default::default();
    solution
}

/// Compares optima with the optima of the augmented Lagrangian, whose steps are rollouts and whose limits are
/// penalties.
#[test]
fn optima_are_those_of_the_augmented_lagrangian() {
    for mut case in cases() {
        let (solution, solver) = solve(&mut case, |_| {});
        assert_eq!(solution.status, Status::Converged, "{}", case.name);
        assert!(solver.outcome().primal <= LIMIT, "{}: {:e}", case.name, solver.outcome().primal);
        assert!(solver.outcome().multipliers.iter().flatten().any(|y| y.abs() > 1e-3), "{}: nothing active", case.name);
        let mut other = AugmentedLagrangian::new(&case.problem);
        other.inner.max_iterations = 300;
        let status = other.solve(&mut case.problem, &case.xs, &case.us).unwrap().status;
        assert_eq!(status, Status::Converged, "{}", case.name);
        let (ours, theirs) = (solution.cost, other.outcome().cost);
        assert!((ours - theirs).abs() < COST * (1.0 + theirs.abs()), "{}: {ours} {theirs}", case.name);
        let largest = |y: &[Vec<f64>]| y.iter().flatten().fold(0.0, |largest: f64, y| largest.max(y.abs()));
        let scale = 1.0 + largest(&other.outcome().multipliers);
        for (ours, theirs) in solver.outcome().multipliers.iter().zip(&other.outcome().multipliers) {
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() < 1e-3 * scale, "{}: multipliers {a} {b}", case.name);
            }
        }
    }
}

/// Checks that the sweep makes the same steps whether it eliminates controls, or accelerations and contact forces.
#[test]
fn both_forms_make_the_same_steps() {
    for mut case in cases() {
        let costs: Vec<Vec<f64>> = [true, false]
            .map(|form| {
                let (solution, _) = solve(&mut case, |solver| {
                    solver.settings.inverse_dynamics_form = form;
                    solver.settings.max_iterations = 4;
                });
                solution.trace.iter().map(|iteration| iteration.cost).collect()
            })
            .into();
        assert_eq!(costs[0].len(), 4);
        for (a, b) in costs[0].iter().zip(&costs[1]) {
            assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{}: {costs:?}", case.name);
        }
    }
}

#[test]
fn any_number_of_threads_finds_the_same_bits() {
    for mut case in [reach(34.0), hop(true), hop(false)] {
        let expected = without_times(solve(&mut case, |solver| solver.settings.max_iterations = 6).0);
        for threads in [2, 3, 7] {
            let (solution, _) = solve(&mut case, |solver| {
                solver.settings.max_iterations = 6;
                solver.settings.threads = threads;
            });
            assert_eq!(without_times(solution), expected, "{}: {threads} threads", case.name);
        }
    }
}

/// Bounds ±b on all controls, as a path constraint.
struct ControlBox([Vec<f64>; 2]);

impl PathConstraint for ControlBox {
    fn size(&self) -> usize {
        self.0[0].len()
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.0[0], &self.0[1])
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

/// Checks that the gains predict the optimum after a small change of the initial state. The problem is linear-quadratic
/// and has active bounds: controls at a bound do not move.
#[test]
fn gains_predict_the_optimum_nearby() {
    let mut random = random();
    let (n, m, horizon) = (4, 2, 12);
    let mut knot = random_knot(&mut random, n, m);
    knot.A *= 0.8;
    knot.f.fill(0.0);
    let running = Constrained::new(Box::new(Linear(knot)), Box::new(ControlBox([vec![-0.2; m], vec![0.2; m]])));
    let end = Box::new(Linear(random_knot(&mut random, n, 0)));
    let x0 = [1.0, -0.5, 0.3, 0.8];
    let mut problem = Problem::new(x0.to_vec(), vec![Box::new(running)], vec![0; horizon], end).unwrap();
    let mut solver = InteriorPoint::new(&problem);
    solver.settings.tolerance = 1e-9;
    let solution = solver.solve(&mut problem, &x0.repeat(horizon + 1), &[0.0; 24]).unwrap().clone();
    assert_eq!(solution.status, Status::Converged);
    let step = 1e-5;
    let moved: Vec<f64> = x0.iter().enumerate().map(|(i, x)| x + step * (1.0 + i as f64).sin()).collect();
    problem.set_x0(&moved).unwrap();
    let again = solver.resume(&mut problem).unwrap();
    assert_eq!(again.status, Status::Converged);
    let (mut active, mut free) = (0, 0);
    for t in 0..horizon {
        let change = DVector::from_iterator(n, (0..n).map(|i| again.x(t)[i] - solution.x(t)[i]));
        let predicted = &solution.K[t] * change;
        for j in 0..m {
            let actual = again.u(t)[j] - solution.u(t)[j];
            assert!((actual - predicted[j]).abs() < 1e-3 * step, "knot {t}: {actual} {}", predicted[j]);
            match solution.u(t)[j].abs() > 0.2 - 1e-6 {
                true => active += 1,
                false => free += 1,
            }
        }
    }
    assert!(active > 2 && free > 2, "{active} active, {free} free");
}

/// Checks a receding horizon: resumed solves take fewer iterations, and their first controls stay within the limits.
#[test]
fn a_shifted_solve_starts_from_its_multipliers() {
    let mut case = reach(34.0);
    let (solution, mut solver) = solve(&mut case, |_| {});
    let cold = solution.trace.len();
    let mut random = random();
    for tick in 0..6 {
        let x: Vec<f64> = solver.solution().x(1).iter().map(|x| x + random.random_range(-0.01..0.01)).collect();
        case.problem.shift(0).unwrap();
        solver.shift(&mut case.problem).unwrap();
        case.problem.set_x0(&x).unwrap();
        let solution = solver.resume(&mut case.problem).unwrap();
        assert!(matches!(solution.status, Status::Converged | Status::Infeasible), "{tick}: {:?}", solution.status);
        assert!(solution.trace.len() < cold, "{tick}: {} and {cold} iterations", solution.trace.len());
        assert!(solution.us.iter().all(|u| u.abs() <= 34.0 + LIMIT), "{tick}");
    }
}

/// Checks that ticks follow a plan: the applied efforts stay within their limits, and a few ticks at a fixed state
/// reach the optimum of that state.
#[test]
fn ticks_converge_to_the_optimum() {
    let mut case = reach(34.0);
    let (optimum, _) = solve(&mut case, |_| {});
    let mut solver = InteriorPoint::new(&case.problem);
    solver.settings.max_iterations = 3;
    solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    let errors: Vec<f64> = (0..12)
        .map(|_| {
            let solution = solver.tick(&mut case.problem, 2).unwrap();
            assert!(solution.xs.iter().chain(&solution.us).all(|x| x.is_finite()));
            let difference = |(a, b): (&f64, &f64)| (a - b).abs();
            solution.us.iter().zip(&optimum.us).map(difference).fold(0.0, f64::max)
        })
        .collect();
    // the curvature of the dynamics is left out, so the rate is linear
    assert!(errors[11] < 0.01 * errors[0], "{errors:?}");
    assert!(solver.solution().K.iter().all(|gain| gain.iter().all(|k| k.is_finite()) && gain.amax() > 0.0));
}

/// Checks the outcome where no trajectory satisfies the constraints: the row with the largest violation is named.
#[test]
fn infeasible_problems_are_never_solved() {
    let mut case = reach(1.0); // too weak to hold the arm
    let (solution, solver) = solve(&mut case, |_| {});
    let refused = [Status::Infeasible, Status::ConstraintsViolated, Status::RegularisationLimit];
    assert!(refused.contains(&solution.status), "{:?}", solution.status);
    let worst = solver.outcome().worst.clone().unwrap();
    assert!(worst.amount > 0.1 && worst.amount == solver.outcome().primal, "{worst:?}");

    // x̂₀ violates a limit of the state: the rest of the problem is solved, and the violation is reported
    let mut case = reach(30.0);
    let mut x0 = case.problem.x0().to_vec();
    x0[9] = 0.9;
    case.problem.set_x0(&x0).unwrap();
    let (solution, solver) = solve(&mut case, |_| {});
    assert_eq!(solution.status, Status::Infeasible);
    let worst = solver.outcome().worst.clone().unwrap();
    assert_eq!(worst.to_string(), "knot 0: entry 9 of `state` is 1.000e-1 beyond its bound");
    assert!(solver.outcome().primal <= LIMIT);
}

/// Checks bounds on the controls of actions, which are rows of the sweep here.
#[test]
fn bounds_on_controls_hold() {
    struct Bounded(Unicycle, [f64; 2]);
    impl ActionModel for Bounded {
        fn nx(&self) -> usize {
            self.0.nx()
        }
        fn nu(&self) -> usize {
            self.0.nu()
        }
        fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
            self.0.calc(t, x, u, next)
        }
        fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
            self.0.calc_diff(t, x, u, knot);
        }
        fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
            Some((&[-0.5, -0.4], &self.1))
        }
    }
    let bounded = |upper| Box::new(Bounded(Unicycle { nu: 2, lanes: 1 }, [upper, 0.4]));
    let end = || Box::new(Unicycle { nu: 0, lanes: 1 });
    let mut problem = Problem::new(vec![-1.0, -1.0, 1.0], vec![bounded(0.5)], vec![0; 20], end()).unwrap();
    let mut solver = InteriorPoint::new(&problem);
    let solution = solver.solve(&mut problem, &[-1.0, -1.0, 1.0].repeat(21), &[0.0; 40]).unwrap().clone();
    assert_eq!(solution.status, Status::Converged);
    let largest = |of: usize| solution.us.iter().skip(of).step_by(2).fold(0.0, |most: f64, u| most.max(u.abs()));
    assert!(largest(0) <= 0.5 + LIMIT && largest(1) <= 0.4 + LIMIT && largest(0) > 0.499, "{solution:?}");
    // multipliers of bounds follow the multipliers of constraints
    assert!(solver.outcome().multipliers[..20].iter().all(|y| y.len() == 2));

    solver.settings.max_iterations = 0;
    let solution = solver.solve(&mut problem, &[-1.0, -1.0, 1.0].repeat(21), &[0.9; 40]).unwrap();
    assert_eq!(solution.status, Status::MaxIterations);
}

#[test]
fn a_solve_can_be_ended_and_resumed() {
    let mut case = reach(34.0);
    let mut solver = InteriorPoint::new(&case.problem);
    let stop = |now: &Iteration| if now.iteration == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let solution = solver.solve_with(&mut case.problem, &case.xs, &case.us, stop).unwrap();
    assert_eq!((solution.status, solution.trace.len()), (Status::Interrupted, 3));
    assert_eq!(solver.resume(&mut case.problem).unwrap().status, Status::Converged);
    solver.settings.time_budget = Some(Duration::ZERO);
    let solution = solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    assert_eq!(solution.status, Status::TimeLimit);
    assert!(solution.xs.iter().chain(&solution.us).all(|x| x.is_finite()));
}

#[test]
fn settings_and_starts_are_checked() {
    let mut case = reach(34.0);
    let mut solver = InteriorPoint::new(&case.problem);
    assert!(solver.resume(&mut case.problem).is_err() && solver.tick(&mut case.problem, 1).is_err());
    for (set, name) in [
        ((|solver| solver.settings.tolerance = f64::NAN) as fn(&mut InteriorPoint), "tolerance"),
        (|solver| solver.settings.barrier_start = Some(0.0), "barrier_start"),
        (|solver| solver.settings.threads = 0, "threads"),
        (|solver| solver.settings.regularisation_max = 0.0, "regularisation_max"),
    ] {
        let mut solver = InteriorPoint::new(&case.problem);
        set(&mut solver);
        let error = solver.solve(&mut case.problem, &case.xs, &case.us).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
    case.us[3] = f64::INFINITY;
    assert!(solver.solve(&mut case.problem, &case.xs, &case.us).is_err());
    case.us[3] = 1e300; // finite, but the dynamics are not
    let solution = solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    assert_ne!(solution.status, Status::Converged);
    assert_eq!(solver.outcome().worst.as_ref().map(|worst| worst.kind), Some(ViolationKind::Constraint));
}

/// Checks that names lead to the rows that the flat list has: efforts at the knots before the last, states at all.
#[test]
fn multipliers_are_read_by_the_limits_name() {
    let mut case = reach(34.0);
    let (_, solver) = solve(&mut case, |_| {});
    let mut augmented = AugmentedLagrangian::new(&case.problem);
    augmented.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    for outcome in [solver.outcome(), augmented.outcome()] {
        assert_eq!(outcome.limits, case.problem.limit_rows());
        let (effort, state) = (outcome.multipliers_of("effort").unwrap(), outcome.multipliers_of("state").unwrap());
        for (t, all) in outcome.multipliers.iter().enumerate() {
            assert_eq!([effort[t], state[t]].concat(), *all, "knot {t}");
            assert_eq!([effort[t].len(), state[t].len()], [if t < 25 { 7 } else { 0 }, 14]);
        }
        assert!(effort.iter().chain(&state).any(|y| y.iter().any(|y| y.abs() > 1e-3)));
        let error = outcome.multipliers_of("efort").unwrap_err().to_string();
        assert_eq!(error, "multipliers of `efort`: no limit has this name; the limits are `effort`, `state`");
    }
}

/// Checks that a new solver with the solution and its multipliers needs few iterations, fewer than without them.
#[test]
fn multipliers_that_are_set_save_iterations() {
    let mut case = reach(34.0);
    let (solution, solver) = solve(&mut case, |_| {});
    let outcome = solver.outcome().clone();
    let names = ["effort", "state"];

    let [mut with, mut without] = [(); 2].map(|()| InteriorPoint::new(&case.problem));
    for name in names {
        with.set_multipliers(&mut case.problem, name, &outcome.multipliers_of(name).unwrap()).unwrap();
    }
    for solver in [&mut with, &mut without] {
        let again = solver.solve(&mut case.problem, &solution.xs, &solution.us).unwrap();
        assert_eq!(again.status, Status::Converged);
        assert!((again.cost - solution.cost).abs() < COST * (1.0 + solution.cost));
    }
    let [warm, cold] = [&with, &without].map(|solver| solver.outcome().iterations);
    assert!(warm < cold && 2 * warm < outcome.iterations, "{warm} with, {cold} without, {} in all", outcome.iterations);

    // before the first iteration, the outcome has the numbers that were set; a resumed solve converges soon
    let mut resumed = solver.clone();
    let doubled: Vec<Vec<f64>> =
        outcome.multipliers_of("effort").unwrap().iter().map(|y| y.iter().map(|y| 2.0 * y).collect()).collect();
    resumed.set_multipliers(&mut case.problem, "effort", &doubled).unwrap();
    resumed.settings.max_iterations = 0;
    resumed.resume(&mut case.problem).unwrap();
    let found = resumed.outcome().multipliers_of("effort").unwrap();
    for (found, set) in found.iter().zip(&doubled) {
        assert!(found.iter().zip(set).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + b.abs())), "{found:?} {set:?}");
    }
    resumed.settings.max_iterations = 100;
    resumed.set_multipliers(&mut case.problem, "effort", &outcome.multipliers_of("effort").unwrap()).unwrap();
    assert_eq!(resumed.resume(&mut case.problem).unwrap().status, Status::Converged);
    assert!(resumed.outcome().iterations <= 8, "{}", resumed.outcome().iterations);

    let mut first = AugmentedLagrangian::new(&case.problem);
    let solution = first.solve(&mut case.problem, &case.xs, &case.us).unwrap().clone();
    let [mut with, mut without] = [(); 2].map(|()| AugmentedLagrangian::new(&case.problem));
    for name in names {
        with.set_multipliers(&mut case.problem, name, &first.outcome().multipliers_of(name).unwrap()).unwrap();
    }
    for solver in [&mut with, &mut without] {
        let again = solver.solve(&mut case.problem, &solution.xs, &solution.us).unwrap();
        assert_eq!(again.status, Status::Converged);
    }
    let [warm, cold] = [&with, &without].map(|solver| solver.outcome().iterations);
    assert!(2 * warm < cold, "{warm} with, {cold} without");
    with.set_multipliers(&mut case.problem, "effort", &first.outcome().multipliers_of("effort").unwrap()).unwrap();
    with.resume(&mut case.problem).unwrap();
    assert!(2 * with.outcome().iterations < cold, "{}", with.outcome().iterations);
}

#[test]
fn wrong_multipliers_are_refused() {
    let mut case = reach(34.0);
    let (_, mut solver) = solve(&mut case, |_| {});
    let mut augmented = AugmentedLagrangian::new(&case.problem);
    let right: Vec<Vec<f64>> = (0..26).map(|t| vec![0.0; if t < 25 { 7 } else { 0 }]).collect();
    let (mut long, mut nan) = (right.clone(), right.clone());
    long[25].push(1.0);
    nan[3][2] = f64::NAN;
    for (name, values, what) in [
        ("joints", &right, "multipliers of `joints`: no limit has this name; the limits are `effort`, `state`"),
        ("effort", &right[1..].to_vec(), "multipliers of `effort`: expected an entry for each of 26 knots, found 25"),
        ("effort", &long, "multipliers of `effort`: knot 25: expected 0 numbers, found 1"),
        ("state", &right, "multipliers of `state`: knot 0: expected 14 numbers, found 7"),
        ("effort", &nan, "multipliers of `effort`: knot 3: entry 2 is NaN, which is not finite"),
    ] {
        for error in [
            solver.set_multipliers(&mut case.problem, name, values).unwrap_err(),
            augmented.set_multipliers(&mut case.problem, name, values).unwrap_err(),
        ] {
            assert_eq!(error.to_string(), what);
        }
    }
    assert_eq!(solver.resume(&mut case.problem).unwrap().status, Status::Converged);
    assert!(solver.outcome().iterations <= 5, "{}", solver.outcome().iterations); // the multipliers were kept
    let x0 = case.problem.x0().to_vec();
    let model = Arc::new(robots::arm7());
    let (knot, end) = (FreeDynamics::running(model.clone(), 0.03, vec![]), FreeDynamics::terminal(model, vec![]));
    let mut free = Problem::new(x0, vec![Box::new(knot.unwrap())], vec![0], Box::new(end.unwrap())).unwrap();
    let error = InteriorPoint::new(&free).set_multipliers(&mut free, "effort", &[[0.0; 7]; 2]).unwrap_err();
    assert_eq!(error.to_string(), "multipliers of `effort`: no limit has this name, and no limit has any name");
}

/// Checks that names still lead to the right rows after shifts, also where the last knots have other limits.
#[test]
fn names_follow_a_shifted_horizon() {
    let mut case = hop(true);
    let mut solver = AugmentedLagrangian::new(&case.problem);
    solver.settings.max_solves = 2;
    solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    for _ in 0..4 {
        case.problem.shift(0).unwrap();
        solver.shift(&mut case.problem).unwrap();
        assert_eq!(solver.outcome().limits, case.problem.limit_rows());
        for (t, y) in solver.outcome().multipliers_of("weak").unwrap().iter().enumerate() {
            let all = &solver.outcome().multipliers[t];
            assert_eq!(y.len(), all.len().min(12), "knot {t}");
            assert_eq!(*y, &all[all.len() - y.len()..]);
        }
    }
}
