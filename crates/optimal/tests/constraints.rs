//! Constrained problems: comparison with IPOPT's optima, optimality conditions, and infeasible problems.

#![allow(non_snake_case)] // names follow the literature: Q

mod common;

use common::{Linear, Unicycle, cartpole_action, random, random_knot, random_matrix};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, Constrained, ConstraintSettings, InteriorPoint, LqKnot, NumDiff, PathConstraint,
    Problem, Solution, Status, ViolationKind,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

/// Tolerance of costs in comparisons with IPOPT. Both solvers stop at residuals of 1e-7 or less. Near an optimum, costs
/// change less than the residuals, but states and controls change as much as the residuals.
const COST: f64 = 1e-6;
const TRAJECTORY: f64 = 1e-4;

/// Constraint lower ≤ C (x, u) + distance ≤ upper. If `disc` is set, the first row is the squared distance from a point
/// instead.
struct Rows {
    c: DMatrix<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    disc: Option<[f64; 2]>,
}

impl Rows {
    fn new(rows: &[(&[f64], f64, f64)]) -> Self {
        Self {
            c: DMatrix::from_fn(rows.len(), rows[0].0.len(), |i, j| rows[i].0[j]),
            lower: rows.iter().map(|row| row.1).collect(),
            upper: rows.iter().map(|row| row.2).collect(),
            disc: None,
        }
    }
}

impl PathConstraint for Rows {
    fn size(&self) -> usize {
        self.lower.len()
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        let z = DVector::from_iterator(x.len() + u.len(), x.iter().chain(u).copied());
        g.copy_from_slice((&self.c * z).as_slice());
        if let Some([a, b]) = self.disc {
            g[0] = (x[0] - a).powi(2) + (x[1] - b).powi(2);
        }
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        let n = x.len();
        gx.copy_from(&self.c.columns(0, n));
        gu.copy_from(&self.c.columns(n, self.c.ncols() - n));
        if let Some([a, b]) = self.disc {
            (gx[(0, 0)], gx[(0, 1)]) = (2.0 * (x[0] - a), 2.0 * (x[1] - b));
        }
        true
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    let of = |v: &Value| if v.is_array() { numbers(v) } else { vec![v.as_f64().unwrap()] };
    value.as_array().unwrap().iter().flat_map(of).collect()
}

fn reference(name: &str) -> Value {
    let data: Value = serde_json::from_str(include_str!("data/ipopt.json")).unwrap();
    data[name].clone()
}

/// Solves a problem and compares the solution with IPOPT's solution.
fn compare(reference: &Value, running: Constrained, terminal: Constrained) {
    let (x0, horizon) = (numbers(&reference["x0"]), reference["horizon"].as_u64().unwrap() as usize);
    let mut problem = Problem::new(x0.clone(), vec![Box::new(running)], vec![0; horizon], Box::new(terminal)).unwrap();
    let xs = common::straight(&x0, &vec![0.0; x0.len()], horizon);
    let us = vec![0.0; problem.control_range(horizon).end];
    let mut solver = AugmentedLagrangian::new(&problem);
    solver.settings = ConstraintSettings { tolerance: 1e-7, tolerance_dual: 1e-6, ..ConstraintSettings::default() };
    let solution = solver.solve(&mut problem, &xs, &us).unwrap().clone();
    let outcome = solver.outcome();
    println!(
        "{:?}: primal {:e}, dual {:e}, penalty {:e}, {} solves, {} iterations, cost {}",
        solution.status,
        outcome.primal,
        outcome.dual,
        outcome.penalty,
        outcome.solves,
        outcome.iterations,
        outcome.cost
    );
    assert_eq!(solution.status, Status::Converged);
    assert!(outcome.primal <= 1e-7 && outcome.dual <= 1e-6);
    compare_solution(reference, &solution, outcome.cost);

    let mut solver = InteriorPoint::new(&problem);
    for second_order in [false, true] {
        solver.settings.second_order = second_order;
        let solution = solver.solve(&mut problem, &xs, &us).unwrap().clone();
        assert_eq!(solution.status, Status::Converged);
        assert!(solver.outcome().primal <= 1e-7);
        compare_solution(reference, &solution, solution.cost);
    }
}

/// Compares the trajectory and the cost of a solution with IPOPT's.
fn compare_solution(reference: &Value, solution: &Solution, found: f64) {
    let cost = reference["cost"].as_f64().unwrap();
    assert!((found - cost).abs() < COST * (1.0 + cost.abs()), "{found} {cost}");
    for (name, ours, theirs) in [("xs", &solution.xs, &reference["xs"]), ("us", &solution.us, &reference["us"])] {
        let theirs = numbers(theirs);
        assert_eq!(ours.len(), theirs.len());
        let error = ours.iter().zip(&theirs).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(error < TRAJECTORY, "{name} differs by {error:e}");
    }
}

/// Compares a unicycle's optimum with IPOPT's: the unicycle moves around a disc and comes to rest at the origin. The
/// problem has a nonconvex inequality on the state, bounds, and terminal equalities.
#[test]
fn parking_is_ipopts() {
    let reference = reference("park");
    let disc = numbers(&reference["disc"]);
    let infinite = f64::INFINITY;
    let mut rows = Rows::new(&[
        (&[0.0; 5], disc[2] * disc[2], infinite),
        (&[0.0, 0.0, 0.0, 1.0, 0.0], -2.0, 2.0),
        (&[0.0, 0.0, 0.0, 0.0, 1.0], -1.5, 1.5),
    ]);
    rows.disc = Some([disc[0], disc[1]]);
    let end = Rows::new(&[(&[1.0, 0.0, 0.0], 0.0, 0.0), (&[0.0, 1.0, 0.0], 0.0, 0.0), (&[0.0, 0.0, 1.0], 0.0, 0.0)]);
    let running = Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows));
    let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
    compare(&reference, running, terminal);
}

/// Compares a cart-pole's optimum with IPOPT's: a falling pole is caught on a short track with a small force.
#[test]
fn catching_a_pole_is_ipopts() {
    let rows = Rows::new(&[(&[1.0, 0.0, 0.0, 0.0, 0.0], -0.42, 0.3), (&[0.0, 0.0, 0.0, 0.0, 1.0], -11.0, 8.0)]);
    let unit = |i: usize| -> Vec<f64> { (0..4).map(|j| f64::from(u8::from(i == j))).collect() };
    let units: Vec<Vec<f64>> = (0..4).map(unit).collect();
    let end: Vec<(&[f64], f64, f64)> = units.iter().map(|row| (row.as_slice(), 0.0, 0.0)).collect();
    let running = Constrained::new(Box::new(cartpole_action()), Box::new(rows));
    let last = common::Cartpole { nu: 0, lanes: 1, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
    compare(&reference("catch"), running, Constrained::new(Box::new(last), Box::new(Rows::new(&end))));
}

/// Compares the optimum of a linear-quadratic problem with terminal equalities with the solution of one linear system.
#[test]
fn equalities_of_a_linear_problem_are_a_linear_system() {
    let mut random = random();
    let (n, m, horizon) = (4, 2, 5);
    let mut knot = random_knot(&mut random, n, m);
    knot.A *= 0.5;
    let end = random_knot(&mut random, n, 0);
    let c = random_matrix(&mut random, 2, n);
    let d = [0.3, -0.7];
    let rows = Rows { c: c.clone(), lower: d.to_vec(), upper: d.to_vec(), disc: None };
    let x0 = random_matrix(&mut random, n, 1).column(0).into_owned();
    let terminal = Constrained::new(Box::new(Linear(end.clone())), Box::new(rows));
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(Linear(knot.clone()))];
    let mut problem = Problem::new(x0.as_slice().to_vec(), models, vec![0; horizon], Box::new(terminal)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let solution = solver.solve(&mut problem, &vec![0.0; n * (horizon + 1)], &vec![0.0; m * horizon]).unwrap();
    assert_eq!(solution.status, Status::Converged);

    // unknowns of the system: u₀, x₁, u₁, …, x_N, then the multipliers of the dynamics, then y
    let (block, primal) = (n + m, (n + m) * horizon);
    let size = primal + n * horizon + 2;
    let (mut kkt, mut rhs) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for t in 0..horizon {
        let (u, next, lambda) = (t * block, t * block + m, primal + t * n);
        kkt.view_mut((u, u), (m, m)).copy_from(&knot.R);
        rhs.rows_mut(u, m).copy_from(&-&knot.r);
        kkt.view_mut((u, lambda), (m, n)).copy_from(&knot.B.transpose());
        kkt.view_mut((next, lambda), (n, n)).copy_from(&-DMatrix::identity(n, n));
        rhs.rows_mut(lambda, n).copy_from(&-&knot.f);
        let (Q, q) = if t + 1 < horizon { (&knot.Q, &knot.q) } else { (&end.Q, &end.q) };
        kkt.view_mut((next, next), (n, n)).copy_from(Q);
        rhs.rows_mut(next, n).copy_from(&-q);
        if t == 0 {
            let moved = rhs.rows(u, m) - knot.S.transpose() * &x0;
            rhs.rows_mut(u, m).copy_from(&moved);
            let moved = rhs.rows(lambda, n) - &knot.A * &x0;
            rhs.rows_mut(lambda, n).copy_from(&moved);
        } else {
            let x = u - n;
            kkt.view_mut((x, u), (n, m)).copy_from(&knot.S);
            kkt.view_mut((x, lambda), (n, n)).copy_from(&knot.A.transpose());
        }
    }
    let last = primal - n;
    kkt.view_mut((last, size - 2), (n, 2)).copy_from(&c.transpose());
    rhs.rows_mut(size - 2, 2).copy_from_slice(&d);
    kkt.fill_lower_triangle_with_upper_triangle();
    let exact = kkt.lu().solve(&rhs).unwrap();
    for t in 0..horizon {
        for j in 0..m {
            assert!((solution.u(t)[j] - exact[t * block + j]).abs() < 1e-5, "u{t}[{j}]");
        }
    }
    for i in 0..2 {
        assert!((solver.outcome().multipliers[horizon][i] - exact[size - 2 + i]).abs() < 1e-4);
    }
    // one sweep of the interior point solves the problem
    let mut solver = InteriorPoint::new(&problem);
    let solution = solver.solve(&mut problem, &vec![0.0; n * (horizon + 1)], &vec![0.0; m * horizon]).unwrap();
    assert_eq!(solution.status, Status::Converged);
    assert!(solution.trace.len() <= 3, "{} iterations", solution.trace.len());
    for t in 0..horizon {
        for j in 0..m {
            assert!((solution.u(t)[j] - exact[t * block + j]).abs() < 1e-7, "u{t}[{j}]");
        }
    }
    for i in 0..2 {
        assert!((solver.outcome().multipliers[horizon][i] - exact[size - 2 + i]).abs() < 1e-6);
    }
}

/// Checks the derivatives of the augmented Lagrangian's terms, within and outside a constraint's bounds.
#[test]
fn derivatives_are_those_of_the_terms() {
    let rows = || {
        let mut rows =
            Rows::new(&[(&[0.0; 5], 1.5, 2.0), (&[1.0, 0.5, 0.0, 2.0, 0.0], -0.1, 0.1), (&[0.3; 5], 0.0, 0.0)]);
        rows.disc = Some([0.4, 0.1]);
        rows
    };
    let action = || Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows()));
    for x in [[0.3, -0.2, 0.7], [1.7, -0.2, 0.7], [2.7, 0.2, 0.7]] {
        let (mut ours, mut numeric) = (LqKnot::zeros(3, 2), LqKnot::zeros(3, 2));
        action().calc_diff(0, &x, &[0.5, -1.5], &mut ours);
        NumDiff(action()).calc_diff(0, &x, &[0.5, -1.5], &mut numeric);
        assert!((&ours.q - &numeric.q).amax() < 1e-5 && (&ours.r - &numeric.r).amax() < 1e-5);
    }
}

/// Constraint whose value is NaN if the state differs from the initial state.
struct Broken;

impl PathConstraint for Broken {
    fn size(&self) -> usize {
        1
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&[0.5], &[1.0])
    }
    fn calc(&mut self, _: usize, x: &[f64], _: &[f64], g: &mut [f64]) {
        g[0] = if x[0] < 0.1 { x[0] } else { f64::NAN };
    }
    fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        gx.copy_from_slice(&[1.0, 0.0, 0.0]);
        gu.fill(0.0);
        true
    }
}

#[test]
fn a_constraint_that_is_not_a_number_never_counts_as_met() {
    let running = Box::new(Unicycle { nu: 2, lanes: 1 });
    let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(Broken));
    let mut problem = Problem::new(vec![0.0; 3], vec![running], vec![0; 5], Box::new(terminal)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let solution = solver.solve(&mut problem, &[0.0; 18], &[0.0; 10]).unwrap();
    assert!(solution.xs.iter().chain(&solution.us).all(|x| x.is_finite()));
    assert_ne!(solution.status, Status::Converged);
    solver.settings.restart = false;
    let at_start = solver.solve(&mut problem, &[0.2; 18], &[0.0; 10]).unwrap();
    assert_eq!(at_start.status, Status::NotFinite);
    let worst = solver.outcome().worst.as_ref().unwrap();
    assert_eq!((worst.knot, worst.row, worst.amount), (5, 0, f64::INFINITY));
    solver.settings.restart = true;
    let again = solver.solve(&mut problem, &[0.2; 18], &[0.0; 10]).unwrap();
    assert!(again.status != Status::Converged && again.status != Status::Infeasible);
}

#[test]
fn what_cannot_be_met_is_said() {
    let solve = |lower: f64, upper: f64, u: f64| {
        // after 10 steps of 0.1 with u ≤ 1, x has increased by at most 1
        let rows = Rows::new(&[(&[0.0, 0.0, 0.0, 1.0, 0.0], -u, u)]);
        let end = Rows::new(&[(&[1.0, 0.0, 0.0], lower, upper)]);
        let running = Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows));
        let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
        let mut problem = Problem::new(vec![0.0; 3], vec![Box::new(running)], vec![0; 10], Box::new(terminal)).unwrap();
        let mut solver = AugmentedLagrangian::new(&problem);
        let result = solver.solve(&mut problem, &[0.0; 33], &[0.0; 20]).map(|solution| solution.status);
        (result, solver.outcome().clone())
    };
    let (status, outcome) = solve(3.0, 3.0, 1.0);
    assert_eq!(status, Ok(Status::ConstraintsViolated));
    assert!(outcome.primal > 0.1);
    let worst = outcome.worst.unwrap();
    assert_eq!((worst.kind, worst.knot, worst.name), (ViolationKind::Constraint, 10, None));
    assert_eq!((worst.row, worst.entry, worst.amount), (0, 0, outcome.primal));
    let (status, outcome) = solve(0.5, 0.8, 1.0);
    assert_eq!(status, Ok(Status::Converged));
    assert!(outcome.multipliers[10][0] < 0.0); // the lower bound is active
    assert!(outcome.worst.is_none_or(|worst| worst.amount == outcome.primal && outcome.primal <= 1e-6));
    let error = solve(2.0, 1.0, 1.0).0.unwrap_err().to_string();
    assert_eq!(error, "knot 10: constraint 0 must be at least 2 and at most 1");
}

/// Checks that an inner solve does not depend on the unit of an inequality. Two problems differ only in the factor of a
/// row and of its bounds; their multipliers differ by the same factor.
#[test]
fn a_row_is_measured_in_its_unit() {
    let solve = |unit: f64, max_solves: usize| {
        let rows = Rows::new(&[(&[0.0, 0.0, 0.0, unit, 0.0], -unit, unit)]);
        let running = Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows));
        let end = Rows::new(&[(&[1.0, 0.0, 0.0], 0.95, 0.95)]);
        let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
        let mut problem = Problem::new(vec![0.0; 3], vec![Box::new(running)], vec![0; 10], Box::new(terminal)).unwrap();
        let mut solver = AugmentedLagrangian::new(&problem);
        (solver.settings.max_solves, solver.settings.penalty_start) = (max_solves, 1e3);
        let solution = solver.solve(&mut problem, &[0.0; 33], &[0.0; 20]).unwrap().clone();
        let multipliers: Vec<f64> = solver.outcome().multipliers[..10].iter().map(|y| y[0] * unit).collect();
        (solution, multipliers)
    };
    // a power of two: both problems have the same rounding errors
    let (one, other) = (solve(1.0, 1).0, solve(64.0, 1).0);
    assert!(one.us.iter().any(|u| *u > 1.0 + 1e-6), "{:?}", one.us);
    assert_eq!((one.us, one.trace), (other.us, other.trace));
    let ((one, y), (other, others)) = (solve(1.0, 50), solve(64.0, 50));
    assert_eq!([one.status, other.status], [Status::Converged; 2]);
    assert!(y.iter().any(|y| *y > 1e-2));
    assert!(y.iter().zip(&others).all(|(y, other)| (y - other).abs() < 1e-4), "{y:?} {others:?}");
}

/// Checks that an inner solve that stops early at the largest penalty keeps its status, because it does not prove that
/// constraints are violated. With `accept` above 1, no step of the expected size is accepted.
#[test]
fn a_solve_that_stops_early_claims_nothing() {
    let rows = Rows::new(&[(&[0.0, 0.0, 0.0, 1.0, 0.0], -1.0, 1.0)]);
    let end = Rows::new(&[(&[1.0, 0.0, 0.0], 0.5, 0.8)]);
    let running = Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows));
    let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
    let mut problem = Problem::new(vec![0.0; 3], vec![Box::new(running)], vec![0; 10], Box::new(terminal)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    (solver.settings.penalty_start, solver.settings.penalty_max) = (1e8, 1e8);
    (solver.inner.max_iterations, solver.settings.max_solves) = (1, 1);
    let status = solver.solve(&mut problem, &[0.0; 33], &[0.0; 20]).unwrap().status;
    assert_eq!(status, Status::MaxIterations);
    (solver.inner.max_iterations, solver.settings.max_solves) = (100, 50);
    solver.inner.accept = 1e3; // no step lowers the cost by so much
    let status = solver.solve(&mut problem, &[0.0; 33], &[0.0; 20]).unwrap().status;
    assert!(!matches!(status, Status::Infeasible | Status::ConstraintsViolated), "{status:?}");
    assert_eq!(status, Status::RegularisationLimit);
}

/// Checks that a solve whose constraints cannot hold leaves the multipliers and the penalty of the solve before it. A
/// second failure in succession deletes them.
#[test]
fn one_failed_solve_leaves_the_multipliers() {
    let rows = Rows::new(&[(&[0.0, 0.0, 0.0, 1.0, 0.0], -1.0, 1.0)]);
    let end = Rows::new(&[(&[1.0, 0.0, 0.0], 0.5, 0.5)]);
    let running = Constrained::new(Box::new(Unicycle { nu: 2, lanes: 1 }), Box::new(rows));
    let terminal = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
    let mut problem = Problem::new(vec![0.0; 3], vec![Box::new(running)], vec![0; 10], Box::new(terminal)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    assert_eq!(solver.solve(&mut problem, &[0.0; 33], &[0.0; 20]).unwrap().status, Status::Converged);
    let penalty = solver.outcome().penalty;
    for (failures, kept) in [(1, true), (2, false)] {
        let mut solver = solver.clone();
        problem.set_x0(&[-3.0, 0.0, 0.0]).unwrap();
        for _ in 0..failures {
            assert_eq!(solver.resume(&mut problem).unwrap().status, Status::ConstraintsViolated);
        }
        problem.set_x0(&[0.0; 3]).unwrap();
        (solver.inner.max_iterations, solver.settings.max_solves) = (0, 1);
        solver.resume(&mut problem).unwrap();
        assert_eq!(solver.outcome().multipliers.iter().flatten().any(|y| *y != 0.0), kept);
        assert!(!kept || solver.outcome().penalty == penalty);
    }
}

/// Checks when a violated constraint on the initial state proves infeasibility: at a knot without controls. At a knot
/// with controls there is no proof, because a user-defined constraint may depend on the controls.
#[test]
fn what_is_infeasible_is_proved() {
    let solve = |nu: usize| {
        let first = Rows::new(&[(&[vec![1.0, 0.0, 0.0], vec![0.0; nu]].concat(), 0.25, 1.0)]);
        let first = Constrained::new(Box::new(Unicycle { nu, lanes: 1 }), Box::new(first));
        let then = Box::new(Unicycle { nu: 2, lanes: 1 });
        let end = Rows::new(&[(&[1.0, 0.0, 0.0], 0.5, 0.5)]);
        let end = Constrained::new(Box::new(Unicycle { nu: 0, lanes: 1 }), Box::new(end));
        let knot_models = [vec![0], vec![1; 9]].concat();
        let mut problem = Problem::new(vec![0.0; 3], vec![Box::new(first), then], knot_models, Box::new(end)).unwrap();
        let mut solver = AugmentedLagrangian::new(&problem);
        let us = vec![0.0; problem.control_range(10).end];
        let solution = solver.solve(&mut problem, &[0.0; 33], &us).unwrap().clone();
        (solution, solver.outcome().clone())
    };
    let (solution, outcome) = solve(0);
    assert_eq!(solution.status, Status::Infeasible);
    let worst = outcome.worst.unwrap();
    assert_eq!((worst.knot, worst.row, worst.amount), (0, 0, 0.25));
    assert_eq!(worst.to_string(), "knot 0: constraint 0 is 2.500e-1 beyond its bound");
    // the other constraint is satisfied, and the penalty stays below 1e8
    assert!((solution.x(10)[0] - 0.5).abs() < 1e-6 && outcome.penalty < 1e8, "{}", outcome.penalty);
    let (solution, outcome) = solve(2);
    assert!(!matches!(solution.status, Status::Infeasible | Status::Converged), "{:?}", solution.status);
    assert_eq!(outcome.worst.map(|worst| worst.knot), Some(0));
}
