//! Sweeps in several segments at the same time, which give the same result as a sweep in one segment.
#![allow(non_snake_case)]

mod common;

use common::{random, random_euler_knot, random_knot, random_matrix};
use condyle_dynamics::{ContactConstraint, Vec3, neutral, robots};
use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FreeDynamics, Residual};
use condyle_optimal::{Error, Fddp, KnotFeedback, LqKnot, Problem, Sweep, SweepError};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use std::sync::Arc;

/// Tolerance relative to the largest entry. As in the other tests of the sweep, random problems with entries of size
/// one have value functions of about 1e3. The value functions of robot problems have a condition number of 1e6 or more.
const SAME: f64 = 1e-9;

/// Tolerance of the cost of an iterate, which is insensitive to errors of the step.
const COST: f64 = 1e-9;

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest, x| largest.max(x.abs()))
}

#[track_caller]
fn assert_same(found: &[KnotFeedback], expected: &[KnotFeedback], case: &str) {
    let fields = |knot: &KnotFeedback| {
        [&knot.Vxx, &knot.K, &knot.Quu]
            .map(|matrix| matrix.as_slice().to_vec())
            .into_iter()
            .chain([&knot.Vx, &knot.k, &knot.Qu].map(|vector| vector.as_slice().to_vec()))
            .collect::<Vec<_>>()
    };
    // vectors vanish at an optimal trajectory, so errors are relative to the largest entry of the whole horizon
    let mut scales = [0.0_f64; 6];
    for knot in expected {
        for (scale, field) in scales.iter_mut().zip(fields(knot)) {
            *scale = scale.max(largest(&field));
        }
    }
    for (t, (a, b)) in found.iter().zip(expected).enumerate() {
        for (i, (a, b)) in fields(a).iter().zip(fields(b)).enumerate() {
            let scale = if i < 3 { largest(&b) } else { scales[i] };
            let error = a.iter().zip(&b).fold(0.0, |error: f64, (a, b)| error.max((a - b).abs()));
            let name = ["Vxx", "K", "Quu", "Vx", "k", "Qu"][i];
            assert!(error <= SAME * scale, "{case}, knot {t}: {name} differs by {error:e} of {scale:e}");
        }
    }
}

/// Returns the feedback of a sweep in one segment, and the feedback of a sweep in several segments. Both sweeps must
/// succeed.
fn both(lq_knots: &[LqKnot], segments: usize, regularisation: f64) -> (Vec<KnotFeedback>, Vec<KnotFeedback>) {
    let mut sweep = Sweep::new(lq_knots);
    sweep.run(lq_knots, regularisation).unwrap();
    let as_one = sweep.feedback().to_vec();
    let mut sweep = Sweep::new(lq_knots);
    sweep.set_segments(segments);
    sweep.run(lq_knots, regularisation).unwrap();
    (as_one, sweep.feedback().to_vec())
}

/// Returns problems with all kinds of knots: dense or Euler steps, with or without blocks, and with different numbers
/// of controls.
fn problems() -> Vec<Vec<LqKnot>> {
    let (mut random, root) = (random(), 0..6);
    let root = std::slice::from_ref(&root);
    let mut all = Vec::new();
    for (ndx, nus) in [
        (1, vec![1; 4]),
        (2, vec![1; 11]),
        (5, vec![3, 0, 2, 0, 0, 4, 1, 3, 3, 2, 0, 0, 5]),
        (14, vec![7; 23]),
        (17, vec![4; 30]),
        (33, vec![9, 12, 40, 9, 12, 9, 15]),
    ] {
        let mut lq_knots: Vec<_> = nus.iter().map(|&nu| random_knot(&mut random, ndx, nu)).collect();
        lq_knots.push(random_knot(&mut random, ndx, 0));
        all.push(lq_knots);
    }
    for (nv, nus, blocks) in
        [(9, vec![4; 17], &[][..]), (10, vec![3, 0, 10, 11, 0, 2, 5, 5, 5, 1], root), (38, vec![32; 9], root)]
    {
        let mut lq_knots: Vec<_> = nus.iter().map(|&nu| random_euler_knot(&mut random, nv, nu, blocks)).collect();
        lq_knots[nus.len() / 2].structure.set_dense();
        lq_knots.push(random_knot(&mut random, 2 * nv, 0));
        all.push(lq_knots);
    }
    all
}

#[test]
fn segments_change_nothing_but_rounding() {
    for lq_knots in problems() {
        let (ndx, horizon) = (lq_knots[0].ndx(), lq_knots.len() - 1);
        for segments in [2, 3, 4, 7, 16] {
            for regularisation in [0.0, 1e-3] {
                let (as_one, knots) = both(&lq_knots, segments, regularisation);
                assert_same(&knots, &as_one, &format!("ndx {ndx}, horizon {horizon}, {segments} segments"));
                assert!(knots != as_one, "ndx {ndx}: not in segments"); // sums in segments are rounded differently
            }
        }
    }
}

#[test]
fn a_horizon_too_short_for_two_segments_is_swept_as_one() {
    let mut random = random();
    for horizon in 0..4 {
        let mut lq_knots: Vec<_> = (0..horizon).map(|_| random_knot(&mut random, 4, 2)).collect();
        lq_knots.push(random_knot(&mut random, 4, 0));
        let (as_one, knots) = both(&lq_knots, 5, 1e-6);
        assert_eq!(knots, as_one, "horizon {horizon}");
    }
    let lq_knots = &problems()[3];
    let (as_one, knots) = both(lq_knots, 1, 1e-6);
    assert_eq!(knots, as_one);
}

/// Checks that a sweep in segments finds the minimum of the whole problem. One Karush–Kuhn–Tucker system in all states
/// and controls gives the reference.
#[test]
fn segments_solve_the_whole_problem() {
    let mut random = random();
    for lq_knots in problems().into_iter().take(3) {
        let (n, horizon) = (lq_knots[0].ndx(), lq_knots.len() - 1);
        let x0: DVector<f64> = random_matrix(&mut random, n, 1).column(0).into_owned();
        // the unknowns are x₁, …, then u₀, …, then the multipliers of xₜ₊₁ = A x + B u + f
        let mut offsets = vec![horizon * n];
        for knot in &lq_knots[..horizon] {
            offsets.push(offsets[offsets.len() - 1] + knot.nu());
        }
        let (unknown, all) = (offsets[horizon], offsets[horizon] + horizon * n);
        let mut kkt = DMatrix::zeros(all, all);
        let mut right = DVector::zeros(all);
        for (t, knot) in lq_knots.iter().enumerate() {
            let (x, row) = (t.wrapping_sub(1).wrapping_mul(n), unknown + t * n);
            if t > 0 {
                kkt.view_mut((x, x), (n, n)).copy_from(&knot.Q);
                right.rows_mut(x, n).copy_from(&-&knot.q);
            }
            if t == horizon {
                continue;
            }
            let (u, m) = (offsets[t], knot.nu());
            kkt.view_mut((u, u), (m, m)).copy_from(&knot.R);
            right.rows_mut(u, m).copy_from(&-&knot.r);
            kkt.view_mut((row, t * n), (n, n)).fill_diagonal(-1.0);
            kkt.view_mut((row, u), (n, m)).copy_from(&knot.B);
            right.rows_mut(row, n).copy_from(&-&knot.f);
            if t > 0 {
                kkt.view_mut((u, x), (m, n)).copy_from(&knot.S.transpose());
                kkt.view_mut((row, x), (n, n)).copy_from(&knot.A);
            } else {
                right.rows_mut(u, m).axpy(-1.0, &(knot.S.transpose() * &x0), 1.0);
                right.rows_mut(row, n).axpy(-1.0, &(&knot.A * &x0), 1.0);
            }
        }
        kkt.fill_upper_triangle_with_lower_triangle();
        let solution = kkt.lu().solve(&right).unwrap();
        for segments in [2, 5] {
            let mut sweep = Sweep::new(&lq_knots);
            sweep.set_segments(segments);
            sweep.run(&lq_knots, 0.0).unwrap();
            let mut x = x0.clone();
            for (t, knot) in lq_knots[..horizon].iter().enumerate() {
                let gains = &sweep.feedback()[t];
                let u = &gains.k + &gains.K * &x;
                x = &knot.A * &x + &knot.B * &u + &knot.f;
                let expected = solution.rows(t * n, n);
                let scale = 1.0 + largest(solution.rows(0, unknown).as_slice());
                assert!((&x - expected).amax() < SAME * scale, "ndx {n}, {segments} segments, knot {t}");
                let expected = solution.rows(offsets[t], knot.nu());
                assert!(u.iter().zip(&expected).all(|(a, b)| (a - b).abs() < SAME * scale), "ndx {n}, knot {t}: u");
            }
        }
    }
}

#[test]
fn any_number_of_threads_finds_the_same_bits() {
    for lq_knots in problems() {
        for segments in [2, 3, 8] {
            let mut sweep = Sweep::new(&lq_knots);
            sweep.set_segments(segments);
            let mut first = None;
            for threads in 1..5 {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| sweep.run(&lq_knots, 1e-9)).unwrap();
                let knots = first.get_or_insert_with(|| sweep.feedback().to_vec());
                assert!(sweep.feedback() == *knots, "{segments} segments, {threads} threads");
            }
        }
    }
}

/// Checks that a fault at any knot stops a sweep in segments with the same error as a sweep in one segment.
#[test]
fn failures_are_those_of_a_sweep_as_one() {
    let mut random = random();
    let good: Vec<_> = (0..=20).map(|t| random_knot(&mut random, 4, if t < 20 { 3 } else { 0 })).collect();
    for knot in 0..=20 {
        for wrong in ["R", "A", "q"] {
            let mut lq_knots = good.clone();
            match wrong {
                "R" if knot < 20 => lq_knots[knot].R[(2, 2)] = -1e6,
                "A" if knot < 20 => lq_knots[knot].A[(1, 0)] = f64::NAN,
                _ => lq_knots[knot].q[3] = f64::INFINITY,
            }
            let mut sweep = Sweep::new(&lq_knots);
            let expected = sweep.run(&lq_knots, 1e-9).unwrap_err();
            for segments in [2, 4] {
                let mut sweep = Sweep::new(&lq_knots);
                sweep.set_segments(segments);
                let found = sweep.run(&lq_knots, 1e-9).unwrap_err();
                match (found, expected) {
                    (SweepError::NotPositive { .. }, SweepError::NotPositive { .. }) => assert_eq!(found, expected),
                    (SweepError::NotFinite { knot: found }, SweepError::NotFinite { knot: t }) => assert_eq!(found, t),
                    _ => panic!("{wrong} of knot {knot}: {found:?} instead of {expected:?}"),
                }
                sweep.run(&good, 1e-9).unwrap();
            }
        }
    }
}

/// Checks problems that a sweep in segments does not support: a segment alone has no minimum, its value function is not
/// convex, or controls are bounded.
#[test]
fn what_segments_cannot_do_is_swept_as_one() {
    let mut random = random();
    let good: Vec<_> = (0..=16).map(|t| random_knot(&mut random, 5, if t < 16 { 2 } else { 0 })).collect();
    let mut without_effort = good.clone();
    for knot in &mut without_effort {
        knot.R.fill(0.0);
        knot.S.fill(0.0);
    }
    let mut concave = good.clone();
    for knot in &mut concave {
        knot.R.fill_diagonal(1e4);
        knot.Q.fill_diagonal(-0.1);
        knot.A *= 0.1;
    }
    let mut bounded = good.clone();
    bounded[3].upper[1] = 0.1;
    for (name, lq_knots) in [("no effort", without_effort), ("concave", concave), ("bounded", bounded)] {
        let (as_one, knots) = both(&lq_knots, 3, 0.0);
        assert_eq!(knots, as_one, "{name}");
    }
}

/// Checks a problem in which controls cost 1e-12 of the states' cost. A link then loses digits, but the sweep still
/// gives the accurate result.
#[test]
fn cheap_controls_lose_no_digits() {
    let mut random = random();
    for effort in [1e-3, 1e-6, 1e-9, 1e-12] {
        let mut lq_knots: Vec<_> = (0..=24).map(|t| random_knot(&mut random, 6, if t < 24 { 2 } else { 0 })).collect();
        for knot in &mut lq_knots {
            knot.S.fill(0.0);
            knot.R.fill(0.0);
            knot.R.fill_diagonal(effort);
        }
        let (as_one, knots) = both(&lq_knots, 4, 0.0);
        assert_same(&knots, &as_one, &format!("effort {effort:e}"));
    }
}

/// Checks a problem in which some states do not affect the cost, so that the value function is singular.
#[test]
fn states_may_cost_nothing() {
    let mut random = random();
    let mut lq_knots: Vec<_> = (0..=15).map(|t| random_knot(&mut random, 7, if t < 15 { 3 } else { 0 })).collect();
    for knot in &mut lq_knots {
        for free in [2, 6] {
            knot.Q.row_mut(free).fill(0.0);
            knot.Q.column_mut(free).fill(0.0);
            knot.S.row_mut(free).fill(0.0);
            knot.A.column_mut(free).fill(0.0);
        }
    }
    let (as_one, knots) = both(&lq_knots, 4, 0.0);
    assert_same(&knots, &as_one, "singular");
    assert!(knots != as_one);
}

#[test]
#[should_panic(expected = "`segments` is 0, expected at least 1")]
fn no_segment_at_all_is_refused() {
    Sweep::new(&[LqKnot::zeros(2, 0)]).set_segments(0);
}

/// Creates the problem of a quadruped that moves its trunk over four feet and then reaches with one foot. Also returns
/// a warm start with gaps.
fn quadruped() -> (Problem, Vec<f64>, Vec<f64>) {
    let model = Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let foot = |name: &str| {
        Contact::new(name, ContactConstraint { kd: 20.0, ..ContactConstraint::point(model.frame(name).unwrap()) })
    };
    let quadratic = |name: &str, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let costs = |target| {
        vec![
            quadratic("state", 1e-1, Residual::State { reference: x0.clone() }),
            quadratic("com", 1e3, Residual::CenterOfMass { target: Vec3::new(0.03, 0.02, 0.36) }),
            quadratic("foot", 1e2, Residual::FrameTranslation { frame: "RF_foot".into(), target }),
        ]
    };
    let driven = |target| {
        let effort = quadratic("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] });
        [costs(target), vec![effort]].concat()
    };
    let near = Vec3::new(0.35, -0.2, 0.05);
    let feet = ["LF_foot", "LH_foot", "RH_foot", "RF_foot"].map(foot);
    let mut stance = ContactDynamics::running(model.clone(), &feet, 0.02, driven(near)).unwrap();
    let us = stance.quasi_static(&x0).repeat(30);
    let reach = ContactDynamics::running(model.clone(), &feet[..3], 0.02, driven(near)).unwrap();
    let end = FreeDynamics::terminal(model.clone(), costs(near)).unwrap();
    let knot_models = (0..30).map(|t| usize::from(t >= 12)).collect();
    let problem =
        Problem::new(x0.clone(), vec![Box::new(stance), Box::new(reach)], knot_models, Box::new(end)).unwrap();
    let mut xs = x0.repeat(31);
    let mut random = random();
    for t in 1..31 {
        (7..19).for_each(|i| xs[37 * t + i] += random.random_range(-0.02..0.02));
    }
    (problem, xs, us)
}

#[test]
fn a_robots_solve_makes_the_same_iterates() {
    let (mut problem, xs, us) = quadruped();
    let mut as_one = Fddp::new(&problem);
    as_one.settings.max_iterations = 15;
    let expected = as_one.solve(&mut problem, &xs, &us).unwrap().clone();
    assert!(expected.trace.len() > 4 && expected.trace.iter().any(|i| i.step < 1.0), "{:?}", expected.trace);
    for segments in [2, 4, 9] {
        let mut solver = Fddp::new(&problem);
        solver.settings.max_iterations = 15;
        solver.settings.segments = segments;
        let solution = solver.solve(&mut problem, &xs, &us).unwrap();
        assert_eq!(solution.status, expected.status);
        assert_eq!(solution.trace.len(), expected.trace.len());
        for (a, b) in solution.trace.iter().zip(&expected.trace) {
            assert_eq!((a.step, a.accepted, a.feasible), (b.step, b.accepted, b.feasible), "{a:?} {b:?}");
            assert_eq!(a.regularisation, b.regularisation);
            assert!((a.cost - b.cost).abs() < COST * b.cost.abs(), "{a:?} {b:?}");
        }
        assert!(solution.xs != expected.xs, "not in segments");
        // solves again with the same number of segments, and then with one segment
        let again = solver.solve(&mut problem, &xs, &us).unwrap().xs.clone();
        assert_eq!(again, solver.solve(&mut problem, &xs, &us).unwrap().xs);
        solver.settings.segments = 1;
        assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap().xs, expected.xs);
    }

    // also compares the sweeps at the last derivatives, knot by knot
    let mut lq_knots = problem.lq_knots();
    problem.calc_diff(&expected.xs, &expected.us, &mut lq_knots);
    let mut random = random();
    for knot in &mut lq_knots {
        knot.f.copy_from(&(random_matrix(&mut random, 36, 1) * 1e-3).column(0));
    }
    for segments in [2, 4, 9] {
        let (as_one, knots) = both(&lq_knots, segments, 1e-9);
        assert_same(&knots, &as_one, "quadruped");
        assert!(knots != as_one);
    }
}

#[test]
fn a_solve_without_segments_is_refused() {
    let (mut problem, xs, us) = quadruped();
    let mut solver = Fddp::new(&problem);
    solver.settings.segments = 0;
    let expected = Error::Setting { name: "segments", value: 0.0, allowed: "at least 1 and at most 1024" };
    assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap_err(), expected);
}
