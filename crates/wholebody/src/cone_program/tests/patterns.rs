//! Tests that clarabel's pattern grows when numbers become non-zero, and that its set of rows grows when limits bind.

use super::random::{Draw, Kind};
use crate::cone_program::{Clarabel, ConeProgram, Settings, Size, Solver, Start, Status};

/// Tolerance of the difference between two solutions whose numbers have size one. Both solves have the tolerance 1e-9.
const AGREEMENT: f64 = 1e-6;

fn assert_same(kept: &mut Clarabel, program: &ConeProgram) {
    let mut new = Clarabel::new(program.capacity(), Settings::default());
    let (a, b) = (kept.solve(program, Start::Cold), new.solve(program, Start::Cold));
    assert!(a.stopped.is_none() && b.stopped.is_none());
    for (a, b) in kept.x().iter().zip(new.x()) {
        assert!((a - b).abs() < AGREEMENT, "{a} {b}");
    }
}

/// Checks solutions when zeros of the matrices P, A, G and F of a program become non-zero, and when they become zero
/// again.
#[test]
fn numbers_come_where_there_were_zeros() {
    for seed in 0..10 {
        let mut draw = Draw::new(seed);
        let full = draw.program(Kind::Plain, 6, [2, 5, 2]);
        let mut sparse = full.clone();
        (0..6).for_each(|j| (j + 1..6).for_each(|i| sparse.P[(i, j)] = 0.0));
        for matrix in [&mut sparse.At, &mut sparse.Gt, &mut sparse.Ft] {
            matrix.iter_mut().step_by(4).for_each(|x| *x = 0.0);
        }
        let mut kept = Clarabel::new(full.capacity(), Settings::default());
        kept.solve(&sparse, Start::Cold);
        assert_same(&mut kept, &full);
        assert_same(&mut kept, &full);
        assert_eq!(kept.solve(&sparse, Start::Cold).stopped, {
            Clarabel::new(full.capacity(), Settings::default()).solve(&sparse, Start::Cold).stopped
        });
    }
}

/// Returns the program that minimises ½ ‖x − a‖² within −1 ≤ x ≤ 1. Its solution is a clipped to this interval.
fn within_a_box(a: [f64; 3]) -> ConeProgram {
    let mut program = ConeProgram::new(Size { unknowns: 3, equalities: 0, rows: 3, cone_rows: 0 });
    for i in 0..3 {
        program.P[(i, i)] = 1.0;
        program.Gt[(i, i)] = 1.0;
        program.c[i] = -a[i];
    }
    program.lower.fill(-1.0);
    program.upper.fill(1.0);
    program
}

/// Checks that limits that a solution violates are added within the same solve, with their multipliers, whatever was
/// solved before.
#[test]
fn limits_that_were_far_away_bind() {
    let mut kept = Clarabel::new(within_a_box([0.0; 3]).capacity(), Settings::default());
    for a in
        [[0.1, 0.2, -0.3], [0.5, 7.0, 0.0], [-2.0, 0.95, 3.0], [0.0, 0.0, 0.0], [9.0, -9.0, 9.0], [0.3, -0.99, 20.0]]
    {
        for _ in 0..2 {
            assert_eq!(kept.solve(&within_a_box(a), Start::Cold).stopped, None);
            for i in 0..3 {
                let x = a[i].clamp(-1.0, 1.0);
                assert!((kept.x()[i] - x).abs() < AGREEMENT, "{a:?}: {:?}", kept.x());
                // The multiplier is z = x − a.
                assert!((kept.multipliers().rows[i] - (x - a[i])).abs() < AGREEMENT * (1.0 + a[i].abs()), "{a:?}");
            }
        }
    }
}

/// Checks that a program with rows left out is not reported as unbounded. The iterations of its first solve must count
/// towards the limit.
#[test]
fn rows_left_out_change_no_status() {
    let mut program = within_a_box([0.5, 0.5, 4.0]);
    program.P[(2, 2)] = 0.0;
    let solve = |settings| {
        let mut solver = Clarabel::new(program.capacity(), settings);
        (solver.solve(&program, Start::Cold), solver.x()[2])
    };
    let (outcome, x) = solve(Settings::default());
    assert_eq!(outcome.stopped, None);
    assert!((x - 1.0).abs() < AGREEMENT, "{x}");
    for max_iterations in 1..outcome.iterations {
        let (outcome, _) = solve(Settings { max_iterations, ..Settings::default() });
        assert_eq!(outcome.iterations, max_iterations);
        assert!(outcome.reduced || outcome.stopped == Some(Status::IterationLimit), "{outcome:?}");
    }
}

/// Checks that a row is left out after many solutions far from it, and that it returns later.
#[test]
fn limits_come_and_go() {
    let mut kept = Clarabel::new(within_a_box([0.0; 3]).capacity(), Settings::default());
    for _ in 0..2 {
        for (a, times) in [([2.0; 3], 3), ([0.0; 3], 1100)] {
            for _ in 0..times {
                assert_eq!(kept.solve(&within_a_box(a), Start::Cold).stopped, None);
                assert!((kept.x()[1] - a[1].clamp(-1.0, 1.0)).abs() < AGREEMENT);
            }
        }
        assert!(kept.multipliers().rows.iter().all(|&z| z == 0.0), "left out, so exactly zero");
    }
}
