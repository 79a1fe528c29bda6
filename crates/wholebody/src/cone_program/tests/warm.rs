//! Tests of sequences of programs: a warm start saves iterations, and earlier solves do not change results.

use super::kkt::Errors;
use super::random::{Draw, Kind};
use super::walk::Walk;
use crate::cone_program::{InteriorPoint, Settings, Solver, Start};

/// Tolerance of the Karush–Kuhn–Tucker conditions. The solver's tolerance of 1e-9 is relative to the largest term of
/// all rows. Here the error of each row is relative to the largest term of this row.
const KKT_TOLERANCE: f64 = 1e-7;
/// Tolerance of the objective, relative to the objective. It covers the duality gaps of both solves.
const OBJECTIVE_TOLERANCE: f64 = 1e-8;
const TICKS: usize = 200;

#[test]
fn a_sequence_that_moves_slowly_takes_half_the_iterations() {
    for (name, walk) in [("humanoid", Walk::humanoid(1)), ("quadruped", Walk::quadruped(1))] {
        for noise in [[0.0, 0.0], [0.1, 0.5]] {
            let mut program = walk.program();
            let walk = walk.clone().disturbed(noise);
            let [mut cold, mut warm] = [(); 2].map(|()| InteriorPoint::new(program.capacity(), Settings::default()));
            let mut iterations = [0, 0];
            for tick in 0..TICKS {
                walk.write(tick, &mut program);
                let outcomes = [cold.solve(&program, Start::Cold), warm.solve(&program, Start::Warm)];
                assert_eq!(outcomes[1].warm, tick > 0);
                for (k, outcome) in outcomes.into_iter().enumerate() {
                    assert!(outcome.stopped.is_none() && !outcome.reduced, "{name}, tick {tick}: {outcome:?}");
                    iterations[k] += outcome.iterations;
                }
                let errors = Errors::new(&program, warm.x(), warm.multipliers());
                assert!(errors.worst() < KKT_TOLERANCE, "{name}, tick {tick}: {errors:?}");
                let (a, b) = (program.objective(cold.x()), program.objective(warm.x()));
                assert!((a - b).abs() < OBJECTIVE_TOLERANCE * a.abs(), "{name}, tick {tick}: {a} is not {b}");
            }
            assert!(2 * iterations[1] <= iterations[0], "{name}: {iterations:?}");
        }
    }
}

/// Starts each solve from the solution of a very different program, which may have another size.
#[test]
fn a_useless_start_gives_way() {
    let mut solver = None;
    for seed in 0..60 {
        let kind = Kind::ALL[seed as usize % Kind::ALL.len()];
        let mut program = Draw::new(seed).program(kind, 12, [2, 24, 4]);
        if seed % 3 == 0 {
            program.size.rows = 20;
            program.cones.truncate(3);
            program.size.cone_rows = program.cones.iter().sum();
        }
        let solver = solver.get_or_insert_with(|| InteriorPoint::new(program.capacity(), Settings::default()));
        let outcome = solver.solve(&program, Start::Warm);
        assert!(outcome.stopped.is_none() && !outcome.reduced, "{kind:?} {seed}: {outcome:?}");
        let errors = Errors::new(&program, solver.x(), solver.multipliers());
        assert!(errors.worst() < KKT_TOLERANCE, "{kind:?} {seed}: {errors:?}");
    }
}

/// Checks that earlier solves do not affect a cold start: it gives the same bits as a new solver.
#[test]
fn a_cold_start_has_no_memory() {
    let mut used: Option<InteriorPoint> = None;
    for seed in 0..40 {
        let mut program = Draw::new(seed).program(Kind::Plain, 20, [2, 30, 4]);
        program.size.unknowns = 20 - seed as usize % 5;
        program.size.equalities = seed as usize % 3;
        program.size.rows = 30 - seed as usize % 4;
        let mut new = InteriorPoint::new(program.capacity(), Settings::default());
        let used = used.get_or_insert_with(|| InteriorPoint::new(program.capacity(), Settings::default()));
        let (a, b) = (new.solve(&program, Start::Cold), used.solve(&program, Start::Cold));
        assert_eq!((a.iterations, a.stopped), (b.iterations, b.stopped));
        assert_eq!(new.x(), used.x());
        assert_eq!(new.multipliers().rows, used.multipliers().rows);
        assert_eq!(new.multipliers().cones, used.multipliers().cones);
    }
}
