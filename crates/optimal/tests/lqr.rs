//! Linear-quadratic problems, which the sweep solves exactly and FDDP solves in one iteration.
#![allow(non_snake_case)]

mod common;

use common::{Linear, random, random_euler_knot, random_knot, random_matrix};
use condyle_optimal::{
    ActionModel, ConstraintRow, ConstraintRows, Fddp, LqKnot, Lqr, NumDiff, Problem, Settings, Status, Sweep,
    SweepError,
};
use nalgebra::{DMatrix, DVector};

/// Tolerance for random problems with entries of size one. Their value functions grow to about 1e3 over the horizon.
const RESIDUAL: f64 = 1e-9;

/// Tolerance for a sum of a few dozen products that is added in another order.
const ROUNDING: f64 = 1e-13;

/// Tolerance of second differences, which are accurate to about 1e-7 with steps of 1e-4.
const DIFFERENCES: f64 = 1e-6;

/// Checks the Karush–Kuhn–Tucker conditions of a random LQ problem. The solution follows from the gains and value
/// functions.
#[test]
fn kkt_residual_vanishes() {
    let mut random = random();
    for (ndx, nus) in
        [(1, vec![1]), (3, vec![2; 10]), (4, vec![3, 0, 1, 6, 0, 2]), (18, vec![12; 5]), (37, vec![31; 3])]
    {
        let mut lq_knots: Vec<LqKnot> = nus.iter().map(|&nu| random_knot(&mut random, ndx, nu)).collect();
        lq_knots.push(random_knot(&mut random, ndx, 0));
        let mut sweep = Sweep::new(&lq_knots);
        sweep.run(&lq_knots, 0.0).unwrap();
        let (horizon, feedback) = (nus.len(), sweep.feedback());

        // states, controls and multipliers: δu = k + K δx,   δx⁺ = A δx + B δu + f,   λ = Vxx δx + Vx
        let x0: DVector<f64> = random_matrix(&mut random, ndx, 1).column(0).into_owned();
        let (mut xs, mut us) = (vec![x0], vec![]);
        for (knot, feedback) in lq_knots.iter().zip(feedback).take(horizon) {
            let x = xs.last().unwrap();
            us.push(&feedback.k + &feedback.K * x);
            xs.push(&knot.A * x + &knot.B * us.last().unwrap() + &knot.f);
        }
        let multiplier = |t: usize| &feedback[t].Vxx * &xs[t] + &feedback[t].Vx;
        for t in 0..horizon {
            let (knot, x, u, next) = (&lq_knots[t], &xs[t], &us[t], multiplier(t + 1));
            let scale = 1.0 + next.amax();
            // the Karush–Kuhn–Tucker conditions are Q δx + S δu + q + Aᵀλ⁺ = λ, Sᵀδx + R δu + r + Bᵀλ⁺ = 0
            let state = &knot.Q * x + &knot.S * u + &knot.q + knot.A.transpose() * &next - multiplier(t);
            let control = knot.S.transpose() * x + &knot.R * u + &knot.r + knot.B.transpose() * &next;
            assert!(state.amax() < RESIDUAL * scale, "ndx {ndx}, knot {t}: {:e}", state.amax());
            assert!(control.iter().all(|c| c.abs() < RESIDUAL * scale), "ndx {ndx}, knot {t}: {control}");
        }
        let end = &lq_knots[horizon].Q * &xs[horizon] + &lq_knots[horizon].q - multiplier(horizon);
        assert!(end.amax() < RESIDUAL);
    }
}

/// Checks a sweep with the regularisation ϱ: Quu = R + BᵀVB + ϱ I, K = −Quu⁻¹(Sᵀ + BᵀVA), V = Q + AᵀVA − KᵀQuu K + ϱ I.
#[test]
fn regularised_step_is_the_textbook_one() {
    let (mut random, regularisation) = (random(), 0.3);
    let lq_knots = [random_knot(&mut random, 5, 3), random_knot(&mut random, 5, 0)];
    let mut sweep = Sweep::new(&lq_knots);
    sweep.run(&lq_knots, regularisation).unwrap();
    let (knot, feedback) = (&lq_knots[0], &sweep.feedback()[0]);

    let V = &lq_knots[1].Q + DMatrix::identity(5, 5) * regularisation;
    let v = &lq_knots[1].q + &V * &knot.f;
    let Quu = &knot.R + knot.B.transpose() * &V * &knot.B + DMatrix::identity(3, 3) * regularisation;
    let Qux = knot.S.transpose() + knot.B.transpose() * &V * &knot.A;
    let Qu = &knot.r + knot.B.transpose() * &v;
    let inverse = Quu.clone().try_inverse().unwrap();
    let (K, k) = (-&inverse * &Qux, -&inverse * &Qu);
    let Vx = &knot.q + knot.A.transpose() * &v + K.transpose() * &Qu;
    let Qxx = &knot.Q + knot.A.transpose() * &V * &knot.A;
    let Vxx = Qxx + Qux.transpose() * &K + DMatrix::identity(5, 5) * regularisation;
    for (found, expected) in [(&feedback.K, &K), (&feedback.Vxx, &Vxx), (&feedback.Quu, &Quu)] {
        assert!((found - expected).amax() < RESIDUAL, "{found} {expected}");
    }
    for (found, expected) in [(&feedback.k, &k), (&feedback.Vx, &Vx), (&feedback.Qu, &Qu)] {
        assert!((found - expected).amax() < RESIDUAL, "{found} {expected}");
    }
}

/// Checks that a sweep gives the same result with known and unknown structure of A and B, at knots of all sizes.
#[test]
fn the_form_of_euler_steps_changes_nothing() {
    let mut random = random();
    let root = 0..6;
    let humanoid = std::slice::from_ref(&root);
    let several = [1..4, 6..9, 10..16];
    for (nv, nus, blocks) in [
        (1, vec![1; 3], &[][..]),
        (2, vec![1, 0, 2], &[]),
        (4, vec![3, 0, 4], &[]),
        (7, vec![7; 5], &[]),
        (9, vec![9; 4], &[]),
        (12, vec![3; 4], &[]),
        (18, vec![12; 4], humanoid),
        (17, vec![5, 17, 0, 1], &several),
        (38, vec![32; 3], humanoid),
    ] {
        let mut lq_knots: Vec<LqKnot> = nus.iter().map(|&nu| random_euler_knot(&mut random, nv, nu, blocks)).collect();
        lq_knots.push(random_knot(&mut random, 2 * nv, 0));
        let mut structured = Sweep::new(&lq_knots);
        structured.run(&lq_knots, 1e-3).unwrap();
        for knot in &mut lq_knots {
            knot.structure.set_dense();
        }
        let mut dense = Sweep::new(&lq_knots);
        dense.run(&lq_knots, 1e-3).unwrap();
        for (t, (a, b)) in structured.feedback().iter().zip(dense.feedback()).enumerate() {
            for (name, a, b) in [("K", &a.K, &b.K), ("Vxx", &a.Vxx, &b.Vxx), ("Quu", &a.Quu, &b.Quu)] {
                let scale = 1.0 + b.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
                let error = (a - b).iter().fold(0.0, |largest: f64, x| largest.max(x.abs())) / scale;
                assert!(error < RESIDUAL, "nv {nv}, knot {t}: {name} differs by {error:e}");
            }
            for (name, a, b) in [("k", &a.k, &b.k), ("Vx", &a.Vx, &b.Vx), ("Qu", &a.Qu, &b.Qu)] {
                let scale = 1.0 + b.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
                let error = (a - b).iter().fold(0.0, |largest: f64, x| largest.max(x.abs())) / scale;
                assert!(error < RESIDUAL, "nv {nv}, knot {t}: {name} differs by {error:e}");
            }
        }
    }
}

#[test]
#[should_panic(expected = "`structure` is that of x = (q, v), but ndx is 3")]
fn the_form_of_euler_steps_needs_as_many_velocities() {
    let mut lq_knots = [LqKnot::zeros(3, 1), LqKnot::zeros(3, 0)];
    lq_knots[0].structure.set_euler(0.1, &[]);
    Sweep::new(&lq_knots);
}

#[test]
fn sweep_names_the_knot_that_is_not_convex() {
    let mut random = random();
    let mut lq_knots: Vec<LqKnot> = (0..4).map(|t| random_knot(&mut random, 3, if t < 3 { 2 } else { 0 })).collect();
    let mut sweep = Sweep::new(&lq_knots);
    lq_knots[1].R[(1, 1)] = -1e4;
    assert!(matches!(sweep.run(&lq_knots, 0.0), Err(SweepError::NotPositive { knot: 1, row: 1, .. })));
    assert_eq!(sweep.run(&lq_knots, 1e5), Ok(()));
    lq_knots[2].A[(0, 0)] = f64::NAN;
    assert_eq!(sweep.run(&lq_knots, 1e5), Err(SweepError::NotFinite { knot: 2 }));
    lq_knots[3].q[1] = f64::INFINITY;
    assert_eq!(sweep.run(&lq_knots, 1e5), Err(SweepError::NotFinite { knot: 3 }));
}

/// Checks that a sweep and a solver return an error for a knot with constraint rows, and that the error names the knot.
#[test]
fn constraint_rows_are_refused() {
    let mut random = random();
    let knots: Vec<LqKnot> = (0..12).map(|t| random_knot(&mut random, 4, if t < 11 { 2 } else { 0 })).collect();
    let mut sweep = Sweep::new(&knots);
    for segments in [1, 3] {
        sweep.set_segments(segments);
        for t in [0, 5, 11] {
            let mut knots = knots.clone();
            let (lower, upper) = (-1.0, f64::INFINITY);
            knots[t].rows.push(ConstraintRow { first: 1, entries: &[1.0, 0.5], c: 0.0, lower, upper });
            assert_eq!(sweep.run(&knots, 0.0), Err(SweepError::ConstraintRows { knot: t }));
            knots[t].rows.clear();
            assert_eq!(sweep.run(&knots, 0.0), Ok(()));
        }
    }
}

/// Action whose derivatives contain a constraint row.
struct Limited;

impl ActionModel for Limited {
    fn nx(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        1
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        next[0] = x[0] + u[0];
        0.5 * u[0] * u[0]
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        knot.A.fill(1.0);
        knot.B.fill(1.0);
        knot.R.fill(1.0);
        knot.r[0] = u[0];
        knot.rows.push(ConstraintRow { first: 0, entries: &[1.0], c: x[0], lower: 0.0, upper: 1.0 });
    }
}

/// Checks that the constraint rows of new derivatives replace the old rows.
#[test]
fn an_action_writes_constraint_rows() {
    let end = Lqr::new(LqKnot::zeros(1, 0));
    let mut problem = Problem::new(vec![0.5], vec![Box::new(Limited)], vec![0; 2], Box::new(end)).unwrap();
    let mut knots = problem.lq_knots();
    for _ in 0..2 {
        problem.calc_diff(&[0.5; 3], &[0.0; 2], &mut knots);
        assert_eq!(knots.iter().map(|knot| knot.rows.len()).collect::<Vec<_>>(), [1, 1, 0]);
    }
    assert!(knots[0].rows.bounds().eq([[0.5, 0.0, 1.0]]));
    assert_eq!(knots[0].rows.dense(1, 1)[0][(0, 0)], 1.0);
}

#[test]
#[should_panic(expected = "knot 1: the sweep does not treat constraint rows")]
fn a_solver_refuses_constraint_rows() {
    let end = Lqr::new(LqKnot::zeros(1, 0));
    let mut problem = Problem::new(vec![0.5], vec![Box::new(Limited)], vec![0; 2], Box::new(end)).unwrap();
    let _ = Fddp::new(&problem).solve(&mut problem, &[0.5; 3], &[0.0; 2]);
}

/// Checks the matrices of rows that have zeros at their ends.
#[test]
fn rows_with_zeros_at_their_ends() {
    let mut rows = ConstraintRows::default();
    for (first, entries) in [(0, &[0.0, 0.0, 2.0, 0.0, 3.0, 0.0][..]), (4, &[0.0, 0.0]), (5, &[1.0])] {
        rows.push(ConstraintRow { first, entries, c: 0.0, lower: 0.0, upper: 0.0 });
    }
    let [C, D] = rows.dense(4, 2);
    assert_eq!((C[(0, 2)], D[(0, 0)], D[(2, 1)]), (2.0, 3.0, 1.0));
    assert_eq!((C.sum(), D.sum()), (2.0, 4.0));
}

#[test]
#[should_panic(expected = "row 0 of `rows` ends at column 4, but [C D] has 3")]
fn constraint_rows_fit_their_knot() {
    let mut knots = [LqKnot::zeros(2, 1), LqKnot::zeros(2, 0)];
    knots[0].rows.push(ConstraintRow { first: 3, entries: &[1.0], c: 0.0, lower: 0.0, upper: 0.0 });
    Sweep::new(&knots);
}

/// Checks that one full step solves the problem from any start, with or without gaps. The second iteration only
/// confirms convergence.
#[test]
fn fddp_solves_an_lqr_in_one_iteration() {
    let mut random = random();
    let (ndx, horizon) = (6, 12);
    let mut models: Vec<Box<dyn ActionModel>> = vec![];
    for nu in [3, 0, 2] {
        models.push(Box::new(Linear(random_knot(&mut random, ndx, nu))));
    }
    let knot_models: Vec<usize> = (0..horizon).map(|t| t / 2 % 3).collect();
    let terminal = Box::new(Linear(random_knot(&mut random, ndx, 0)));
    let x0 = random_matrix(&mut random, ndx, 1);
    let mut problem = Problem::new(x0.as_slice().to_vec(), models, knot_models, terminal).unwrap();
    let xs = random_matrix(&mut random, ndx, horizon + 1);
    let us = random_matrix(&mut random, problem.control_range(horizon).end, 1);

    let mut solver = Fddp::new(&problem);
    // the regularisation changes the first step by about its own value
    solver.settings =
        Settings { tolerance: 1e-6, regularisation_start: 1e-15, regularisation_min: 1e-15, ..Settings::default() };
    let solution = solver.solve(&mut problem, xs.as_slice(), us.as_slice()).unwrap();
    assert_eq!(solution.status, Status::Converged);
    assert_eq!(solution.trace.len(), 2);
    let [first, second] = solution.trace[..] else { panic!() };
    assert!(first.accepted && first.feasible && first.step == 1.0);
    assert!((first.cost - second.cost).abs() < RESIDUAL * (1.0 + first.cost.abs()));
    assert!((first.decrease - first.expected_decrease).abs() < RESIDUAL * (1.0 + first.decrease.abs()));
    assert!(solution.gap < 1e-12 && solution.feasible);
}

/// Compares the action's derivatives, cost and next state with explicit sums.
#[test]
fn an_lqr_is_its_knot() {
    let mut random = random();
    let knot = random_knot(&mut random, 5, 3);
    let (x, u) = (random_matrix(&mut random, 5, 1), random_matrix(&mut random, 3, 1));
    let mut action = Lqr::new(knot.clone());
    let mut next = [0.0; 5];
    let cost = action.calc(0, x.as_slice(), u.as_slice(), &mut next);
    let expected = &knot.A * &x + &knot.B * &u + &knot.f;
    assert!(expected.iter().zip(next).all(|(a, b)| (a - b).abs() < ROUNDING));
    let quadratic = (x.transpose() * &knot.Q * &x + u.transpose() * &knot.R * &u)[0] / 2.0;
    let value = quadratic + (x.transpose() * &knot.S * &u)[0] + knot.q.dot(&x.column(0)) + knot.r.dot(&u.column(0));
    assert!((cost - value).abs() < ROUNDING);
    let (mut written, mut numeric) = (LqKnot::zeros(5, 3), LqKnot::zeros(5, 3));
    action.calc_diff(0, x.as_slice(), u.as_slice(), &mut written);
    NumDiff(action).calc_diff(0, x.as_slice(), u.as_slice(), &mut numeric);
    for (a, b) in
        [(&written.A, &numeric.A), (&written.B, &numeric.B), (&written.Q, &numeric.Q), (&written.S, &numeric.S)]
    {
        assert!((a - b).amax() < DIFFERENCES);
    }
    assert!((&written.q - &numeric.q).amax() < DIFFERENCES && (&written.r - &numeric.r).amax() < DIFFERENCES);
}

/// Checks that a control equals its bound if the optimum without bounds is far outside.
#[test]
fn bounds_of_a_node_are_those_of_its_action() {
    let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
    (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0, 1.0);
    knot.lower[0] = -0.1;
    let mut problem =
        Problem::new(vec![1.0], vec![Box::new(Lqr::new(knot))], vec![0; 5], Box::new(Lqr::new(end))).unwrap();
    let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 6], &[0.0; 5]).unwrap().clone();
    assert_eq!((solution.status, solution.us), (Status::Converged, vec![-0.1; 5]));
}
