//! Diverging solves, which return their best iterate. A resumed solve starts from that iterate.
#![allow(non_snake_case)] // names follow the literature: K

use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle_optimal::{AugmentedLagrangian, Fddp, Problem, Status, Sweep};
use std::sync::Arc;

/// Creates the problem of an arm that reaches for a point in 50 knots. Only a tiny weight and distant bounds limit the
/// efforts.
fn reckless_reach(dt: f64, effort: f64, point: f64, bound: Option<f64>) -> (Problem, Vec<f64>) {
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let there = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    let effort = Cost::new("effort", effort, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let point = Cost::new("point", point, there, Activation::Quadratic);
    let mut knot = FreeDynamics::running(arm.clone(), dt, vec![effort]).unwrap();
    if let Some(bound) = bound {
        knot = knot.with_bounds(vec![-bound; 7], vec![bound; 7]);
    }
    let end = FreeDynamics::terminal(arm, vec![point]).unwrap();
    let problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 50], Box::new(end)).unwrap();
    (problem, x0.repeat(51))
}

/// Returns time steps, weights of efforts and weights of the point. The last digit of sums decides which of these
/// problems diverge, and this digit depends on the processor's SIMD level. There are enough problems for some to
/// diverge on each processor.
fn reckless() -> impl Iterator<Item = (f64, f64, f64)> {
    const EFFORTS: [f64; 7] = [1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2];
    let weights = |dt| EFFORTS.into_iter().flat_map(move |effort| [1e2, 1e3, 1e4].map(|point| (dt, effort, point)));
    [0.02, 0.05, 0.03, 0.04].into_iter().flat_map(weights)
}

/// Number of diverging solves that are checked.
const ENOUGH: usize = 4;

/// Checks solves in which Crocoddyl's rules accept a step to an iterate that costs 1e16 times as much. No search
/// direction can be computed at this iterate. The trace records the step, the solution is the iterate before the step,
/// and a resumed solve begins at the solution.
#[test]
fn a_solve_that_blows_up_returns_its_best_iterate() {
    let mut blown_up = 0;
    for (dt, effort, point) in reckless() {
        if blown_up == ENOUGH {
            break;
        }
        let run = |threads: usize| {
            let (mut problem, xs) = reckless_reach(dt, effort, point, None);
            let mut solver = Fddp::new(&problem);
            solver.settings.threads = threads;
            let first = solver.solve(&mut problem, &xs, &[0.0; 350]).unwrap().clone();
            let next = solver.resume(&mut problem).unwrap().clone();
            (first, next, problem)
        };
        let (solution, next, mut problem) = run(1);
        let trace = &solution.trace;
        let explodes = |i: &usize| trace[*i].cost > 1e8 * (1.0 + trace[0].cost);
        let Some(before) = (1..trace.len()).find(explodes).filter(|_| solution.status == Status::NotFinite) else {
            continue;
        };
        if trace[before - 1].cost > 1e5 {
            continue; // skips a solve that diverges in several steps
        }
        blown_up += 1;
        let last = trace.last().unwrap();
        assert!(last.accepted && last.cost > 1e8 * (1.0 + trace[0].cost), "{last:?}");
        // the solution is the iterate before the divergence; one record of the trace has its cost, the next record its
        // gap
        assert!(solution.cost < 1e5, "{}", solution.cost);
        assert_eq!((solution.cost, solution.gap), (trace[before - 1].cost, trace[before].gap));
        let (mut lq_knots, mut numbers) = (vec![0.0; 50 * 14], vec![0.0; 51]);
        problem.calc(&solution.xs, &solution.us, &mut lq_knots, &mut numbers);
        assert!((numbers.iter().sum::<f64>() - solution.cost).abs() < 1e-12 * (1.0 + solution.cost));
        assert!(solution.K.iter().flat_map(|K| K.iter()).all(|x| x.is_finite()));
        assert!(solution.k.iter().any(|k| k.amax() > 0.0));
        // a resumed solve begins at the solution, and its result is not worse
        assert!(next.gap <= solution.gap && next.cost.is_finite(), "{} {}", next.gap, next.cost);
        assert!(next.trace.first().is_some_and(|first| first.gap == solution.gap));
        let (other, again, _) = run(2);
        assert!(other.xs == solution.xs && other.us == solution.us && other.K == solution.K && other.k == solution.k);
        assert!(again.xs == next.xs && again.trace == next.trace);
    }
    assert_eq!(blown_up, ENOUGH);
}

/// Checks diverging solves with bounds on the controls, whose steps are quadratic programs. Such a solve accepts an
/// iterate that costs more than a hundred times as much. No search direction exists there, so the solve restores an
/// earlier iterate.
#[test]
fn a_bounded_solve_that_blows_up_returns_its_best_iterate() {
    let mut blown_up = 0;
    for (dt, effort, point) in reckless() {
        if blown_up == ENOUGH {
            break;
        }
        let (mut problem, xs) = reckless_reach(dt, effort, point, Some(1e6));
        let mut solver = Fddp::new(&problem);
        let solution = solver.solve(&mut problem, &xs, &[0.0; 350]).unwrap().clone();
        let (first, last) = (&solution.trace[0], solution.trace.last().unwrap());
        if solution.status != Status::NotFinite || last.cost < 1e2 * (1.0 + first.cost) {
            continue;
        }
        blown_up += 1;
        assert!(last.accepted, "{last:?}");
        let most = solution.trace.iter().map(|i| i.gap).fold(0.0, f64::max);
        // if the first step fails, the solve restores the warm start, whose gap is not yet closed
        let is_guess = solution.xs == xs;
        assert!(solution.cost < last.cost && (solution.gap < most || is_guess), "{} {}", solution.cost, solution.gap);
        assert!(solution.us.iter().all(|u| u.abs() <= 1e6));
        let (mut next, mut costs) = (vec![0.0; 50 * 14], vec![0.0; 51]);
        problem.calc(&solution.xs, &solution.us, &mut next, &mut costs);
        assert!((costs.iter().sum::<f64>() - solution.cost).abs() < 1e-12 * (1.0 + solution.cost));
        assert!(solution.K.iter().flat_map(|K| K.iter()).all(|x| x.is_finite()));
        let next = solver.resume(&mut problem).unwrap();
        assert!(next.trace[0].gap == solution.gap && next.gap <= solution.gap && next.cost.is_finite());
    }
    assert_eq!(blown_up, ENOUGH);
}

/// Checks that the feedback of a solution comes from a sweep at the restored iterate.
#[test]
fn the_feedback_is_that_of_the_iterate() {
    let mut blown_up = reckless().filter_map(|(dt, effort, point)| {
        let (mut problem, xs) = reckless_reach(dt, effort, point, None);
        let mut solver = Fddp::new(&problem);
        let solution = solver.solve(&mut problem, &xs, &[0.0; 350]).unwrap().clone();
        (solution.status == Status::NotFinite).then_some((problem, solver, solution))
    });
    let (mut problem, solver, solution) = blown_up.next().expect("one of them blows up");
    let (mut lq_knots, mut next, mut costs) = (problem.lq_knots(), vec![0.0; 50 * 14], vec![0.0; 51]);
    problem.calc(&solution.xs, &solution.us, &mut next, &mut costs);
    problem.calc_diff(&solution.xs, &solution.us, &mut lq_knots);
    for (t, knot) in lq_knots.iter_mut().enumerate() {
        for (i, f) in knot.f.iter_mut().enumerate() {
            *f = if t < 50 { next[14 * t + i] - solution.x(t + 1)[i] } else { 0.0 };
        }
    }
    let mut sweep = Sweep::new(&lq_knots);
    sweep.run(&lq_knots, solver.settings.regularisation_start).unwrap();
    for (t, knot) in sweep.feedback()[..50].iter().enumerate() {
        assert!((&knot.K - &solution.K[t]).amax() < 1e-6 * (1.0 + knot.K.amax()), "knot {t}");
        assert!((&knot.k - &solution.k[t]).amax() < 1e-6 * (1.0 + knot.k.amax()), "knot {t}");
    }
}

/// Checks that a diverging solve by the augmented Lagrangian also returns its best iterate, with measured residuals.
#[test]
fn a_constrained_solve_that_blows_up_says_how_far_its_best_iterate_is() {
    let mut blown_up = reckless().filter_map(|(dt, effort, point)| {
        let (mut problem, xs) = reckless_reach(dt, effort, point, None);
        let mut solver = AugmentedLagrangian::new(&problem);
        let solution = solver.solve(&mut problem, &xs, &[0.0; 350]).unwrap().clone();
        (solution.status == Status::NotFinite).then_some((problem, solver, solution))
    });
    let (mut problem, mut solver, solution) = blown_up.next().expect("one of them blows up");
    let outcome = solver.outcome().clone();
    assert!(solution.cost < 1e5 && solution.gap < 1.0, "{} {}", solution.cost, solution.gap);
    assert!(outcome.primal == solution.gap && outcome.dual.is_finite() && (outcome.cost - solution.cost).abs() < 1e-9);
    let next = solver.resume(&mut problem).unwrap();
    assert!(next.gap <= solution.gap && next.cost.is_finite());
}
