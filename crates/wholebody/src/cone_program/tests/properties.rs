//! Tests that solutions of random programs satisfy the optimality conditions, and agree with clarabel's solutions.

use super::kkt::Errors;
use super::random::{Draw, Kind};
use crate::cone_program::{Clarabel, ConeProgram, InteriorPoint, Settings, Size, Solver, Start};

/// Tolerance of the Karush–Kuhn–Tucker conditions. The solver's own tolerance is 1e-9, relative to terms in the
/// solver's units.
const KKT_TOLERANCE: f64 = 1e-8;
/// Tolerance of the objective, relative to 1 + |objective|. It covers the duality gaps of both solvers.
const OBJECTIVE_TOLERANCE: f64 = 1e-6;
/// Tolerance of x, whose numbers have size one. It applies to solutions with the settings [`SHARP`], if the cost matrix
/// P has no eigenvalue below 0.1.
const X_TOLERANCE: f64 = 1e-6;
const SHARP: Settings = Settings { tolerance: 1e-12, max_iterations: 50, time_limit: f64::INFINITY };

/// Sizes of the programs: number of unknowns, and numbers of equalities, rows and cones.
const SHAPES: [(usize, [usize; 3]); 8] = [
    (1, [0, 3, 0]),
    (2, [0, 2, 1]),
    (5, [2, 8, 2]),
    (12, [0, 30, 0]),
    (12, [0, 12, 6]),
    (18, [3, 40, 4]),
    (44, [0, 96, 8]),
    (60, [6, 120, 16]),
];
/// Number of programs of each shape.
const DRAWS: u64 = 8;

fn each(mut check: impl FnMut(Kind, &ConeProgram, String)) {
    for kind in Kind::ALL {
        for (k, (n, shape)) in SHAPES.into_iter().enumerate() {
            for seed in (0..DRAWS).map(|i| DRAWS * k as u64 + i) {
                let program = Draw::new(seed).program(kind, n, shape);
                check(kind, &program, format!("{kind:?}, {n} unknowns, {shape:?}, seed {seed}"));
            }
        }
    }
}

#[test]
fn random_programs_meet_the_conditions_of_optimality() {
    each(|_, program, name| {
        let mut ours = InteriorPoint::new(program.capacity(), Settings::default());
        let outcome = ours.solve(program, Start::Cold);
        assert!(outcome.stopped.is_none() && !outcome.reduced, "{name}: {outcome:?}");
        let errors = Errors::new(program, ours.x(), ours.multipliers());
        assert!(errors.worst() < KKT_TOLERANCE, "{name}: {errors:?}");
    });
}

#[test]
fn both_back_ends_find_the_same_optimum() {
    each(|kind, program, name| {
        let mut ours = InteriorPoint::new(program.capacity(), SHARP);
        let mut clarabel = Clarabel::new(program.capacity(), SHARP);
        assert_eq!(ours.solve(program, Start::Cold).stopped, None, "{name}");
        let reference = clarabel.solve(program, Start::Cold);
        let sharp = reference.stopped.is_none() && !reference.reduced;
        if !sharp {
            // Clarabel cannot reach the tolerance 1e-12 here.
            clarabel = Clarabel::new(program.capacity(), Settings::default());
            assert_eq!(clarabel.solve(program, Start::Cold).stopped, None, "{name}");
        }
        let (a, b) = (program.objective(ours.x()), program.objective(clarabel.x()));
        assert!((a - b).abs() < OBJECTIVE_TOLERANCE * (1.0 + b.abs()), "{name}: {a} is not {b}");
        if !matches!(kind, Kind::Vertex | Kind::Semidefinite) {
            let apart = ours.x().iter().zip(clarabel.x()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if apart > X_TOLERANCE {
                println!("{name}: {apart:.1e} apart");
            }
        }
    });
}

/// Replaces each cone by a pyramid with this number of sides. The pyramid lies inside or around the cone.
fn pyramids(program: &ConeProgram, sides: usize, inside: bool) -> ConeProgram {
    let (n, cones) = (program.size.unknowns, program.cones.len());
    let rows = program.size.rows + sides * cones;
    let mut out = ConeProgram::new(Size { unknowns: n, rows, ..Size::default() });
    out.P.copy_from(&program.P);
    out.c.copy_from_slice(&program.c);
    for i in 0..program.size.rows {
        out.Gt.set_column(i, &program.Gt.column(i));
        (out.lower[i], out.upper[i]) = (program.lower[i], program.upper[i]);
    }
    let half = std::f64::consts::PI / sides as f64;
    let shrink = if inside { half.cos() } else { 1.0 };
    for k in 0..cones {
        for i in 0..sides {
            // One face of the pyramid: s₀ − (cos, sin)ᵀ (s₁, s₂) ≥ 0, where `shrink` multiplies s₀ first.
            let (sin, cos) = (2.0 * half * i as f64).sin_cos();
            let (to, weights) = (program.size.rows + sides * k + i, [shrink, -cos, -sin]);
            for (j, a) in weights.into_iter().enumerate() {
                let column = program.Ft.column(3 * k + j) * a;
                let mut sum = out.Gt.column_mut(to);
                sum += column;
            }
            out.lower[to] = -(0..3).map(|j| weights[j] * program.h[3 * k + j]).sum::<f64>();
        }
    }
    out
}

/// Checks that the optimum lies between the optima with inscribed and with circumscribed pyramids. The difference of
/// these two optima must become smaller as the number of sides grows.
#[test]
fn the_optimum_lies_between_those_of_pyramids() {
    let walk = super::walk::Walk::humanoid(3);
    let mut program = walk.program();
    let objective = |program: &ConeProgram| {
        let mut solver = InteriorPoint::new(program.capacity(), Settings::default());
        assert_eq!(solver.solve(program, Start::Cold).stopped, None);
        program.objective(solver.x())
    };
    for tick in [0, 100, 200] {
        walk.write(tick, &mut program);
        let cone = objective(&program);
        let mut before = f64::INFINITY;
        for sides in [4, 16, 64] {
            let (above, below) =
                (objective(&pyramids(&program, sides, true)), objective(&pyramids(&program, sides, false)));
            let room = 1e-8 * cone.abs();
            assert!(below < cone + room && cone < above + room, "{below} {cone} {above}");
            assert!(above - below < before / 8.0 + room, "{before} {}", above - below); // in theory the ratio is 16
            before = above - below;
        }
    }
}
