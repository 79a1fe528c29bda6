//! Tests of programs without a solution, and of solves that end early.

use super::random::{Draw, Kind};
use crate::cone_program::{Clarabel, ConeProgram, InteriorPoint, Settings, Size, Solver, Start, Status};

/// Function that writes an invalid number into a program.
type Spoil = fn(&mut ConeProgram, f64);

fn ours(program: &ConeProgram) -> InteriorPoint {
    InteriorPoint::new(program.capacity(), Settings::default())
}

/// Returns a feasible program. The tests write invalid numbers into its last row, its last equality and its last cone.
fn program(seed: u64) -> ConeProgram {
    Draw::new(seed).program(Kind::Plain, 12, [2, 20, 4])
}

#[test]
fn constraints_that_exclude_each_other_are_proved_to() {
    for seed in 0..20 {
        let last = 19;
        let mut rows = program(seed);
        let first = rows.Gt.column(0).into_owned();
        rows.Gt.set_column(last, &first);
        (rows.lower[0], rows.upper[0]) = (-1.0, 1.0);
        (rows.lower[last], rows.upper[last]) = (1.1, f64::INFINITY);

        let mut equalities = program(seed);
        let first = equalities.At.column(0).into_owned();
        equalities.At.set_column(1, &(first * 2.0));
        (equalities.b[0], equalities.b[1]) = (1.0, 2.5);

        // The cone requires s₀ ≥ ‖s₁‖ ≥ 0, but a row requires s₀ ≤ −0.1.
        let mut cone = program(seed);
        let head = cone.Ft.column(0).into_owned();
        cone.Gt.set_column(last, &head);
        (cone.lower[last], cone.upper[last]) = (f64::NEG_INFINITY, -0.1 - cone.h[0]);

        let mut bounds = program(seed);
        (bounds.lower[3], bounds.upper[3]) = (1.0, 0.5);

        for (name, program) in [("rows", rows), ("equalities", equalities), ("cone", cone), ("bounds", bounds)] {
            let mut solver = ours(&program);
            let outcome = solver.solve(&program, Start::Cold);
            assert_eq!(outcome.stopped, Some(Status::Infeasible), "{name} {seed}: {outcome:?}");
            assert!(solver.x().iter().all(|x| x.is_finite()));
            let mut clarabel = Clarabel::new(program.capacity(), Settings::default());
            assert_eq!(clarabel.solve(&program, Start::Cold).stopped, Some(Status::Infeasible), "clarabel: {name}");
        }
    }
}

/// Checks that an unbounded objective is reported: min −x₀ + ½ x₁² with x₀ ≥ 0 and ‖x₂‖ ≤ 1 + x₀.
#[test]
fn an_objective_without_a_lower_bound_is_named() {
    let mut program = ConeProgram::new(Size { unknowns: 3, rows: 1, cone_rows: 2, equalities: 0 });
    program.P[(1, 1)] = 1.0;
    program.c[0] = -1.0;
    (program.Gt[(0, 0)], program.lower[0]) = (1.0, 0.0);
    (program.Ft[(0, 0)], program.Ft[(2, 1)], program.h[0]) = (1.0, 1.0, 1.0);
    program.cones.push(2);
    program.size.cone_rows = 2;
    let mut solver = ours(&program);
    let outcome = solver.solve(&program, Start::Cold);
    assert_eq!(outcome.stopped, Some(Status::Unbounded), "{outcome:?}");
    let mut clarabel = Clarabel::new(program.capacity(), Settings::default());
    assert_eq!(clarabel.solve(&program, Start::Cold).stopped, Some(Status::Unbounded));
}

#[test]
fn numbers_that_are_not_finite_are_named() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let spoil: [(&str, usize, Spoil); 6] = [
            ("P", 12 * 3 + 5, |program, bad| program.P[(5, 3)] = bad),
            ("c", 2, |program, bad| program.c[2] = bad),
            ("At", 12 + 1, |program, bad| program.At[(1, 1)] = bad),
            ("b", 1, |program, bad| program.b[1] = bad),
            ("Gt", 12 * 7, |program, bad| program.Gt[(0, 7)] = bad),
            ("h", 4, |program, bad| program.h[4] = bad),
        ];
        for (name, index, spoil) in spoil {
            let mut program = program(1);
            let mut solver = ours(&program);
            assert_eq!(solver.solve(&program, Start::Cold).stopped, None);
            spoil(&mut program, bad);
            assert_eq!(solver.solve(&program, Start::Warm).stopped, Some(Status::NotFinite { name, index }));
            assert!(solver.x().iter().all(|x| *x == 0.0));
        }
    }
    let mut program = program(1);
    program.P[(3, 5)] = f64::NAN; // solvers do not read the upper triangle
    program.lower[2] = f64::INFINITY;
    let stopped = ours(&program).solve(&program, Start::Cold).stopped;
    assert_eq!(stopped, Some(Status::NotFinite { name: "lower", index: 2 }));
    (program.lower[2], program.upper[4]) = (0.0, f64::NAN);
    let stopped = ours(&program).solve(&program, Start::Cold).stopped;
    assert_eq!(stopped, Some(Status::NotFinite { name: "upper", index: 4 }));
}

#[test]
fn limits_end_a_solve_with_a_finite_iterate() {
    let program = program(2);
    for (settings, expected) in [
        (Settings { max_iterations: 2, ..Settings::default() }, Status::IterationLimit),
        (Settings { time_limit: 0.0, ..Settings::default() }, Status::TimeLimit),
    ] {
        let mut solver = InteriorPoint::new(program.capacity(), settings);
        let outcome = solver.solve(&program, Start::Cold);
        assert_eq!(outcome.stopped, Some(expected));
        assert!(outcome.iterations <= 2 && solver.x().iter().all(|x| x.is_finite()));
    }
}

/// Checks that no result is NaN, whatever the status, if numbers are too large for any solver or differ too much in
/// size.
#[test]
fn wild_numbers_never_become_nan() {
    for seed in 0..200 {
        let mut draw = Draw::new(seed);
        let mut program = draw.program(Kind::ALL[seed as usize % 8], 6, [1, 10, 2]);
        for matrix in [&mut program.P, &mut program.At, &mut program.Gt, &mut program.Ft] {
            for x in matrix.as_mut_slice() {
                *x *= 10.0_f64.powf(150.0 * draw.number() * draw.share().powi(4));
            }
        }
        let mut solver = ours(&program);
        for start in [Start::Cold, Start::Warm] {
            let outcome = solver.solve(&program, start);
            let multipliers = solver.multipliers();
            let numbers = [solver.x(), multipliers.equalities, multipliers.rows, multipliers.cones];
            assert!(numbers.into_iter().flatten().all(|x| x.is_finite()), "{seed}: {outcome:?}");
        }
        let tame = Draw::new(seed).program(Kind::Plain, 6, [1, 10, 2]);
        assert_eq!(solver.solve(&tame, Start::Cold).stopped, None, "after {seed}");
    }
}
