//! Tests of programs whose solutions are known in closed form.

use crate::cone_program::{Clarabel, ConeProgram, InteriorPoint, Settings, Size, Solver, Start};

/// Relative tolerance of x. Where the objective is flat, it is the square root of the remaining gap.
const TOLERANCE: f64 = 1e-7;

const SHARP: Settings = Settings { tolerance: 1e-13, max_iterations: 50, time_limit: f64::INFINITY };

fn solvers(program: &ConeProgram) -> Vec<Box<dyn Solver>> {
    vec![Box::new(Clarabel::new(program.capacity(), SHARP)), Box::new(InteriorPoint::new(program.capacity(), SHARP))]
}

fn near(a: &[f64], b: &[f64]) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < TOLERANCE * (1.0 + b.abs())), "{a:?} is not {b:?}");
}

/// Projects p onto a cone: min ½ ‖x − p‖² with x ∈ Q. The multiplier is the projection of −p.
#[test]
fn projection_onto_a_cone() {
    for p in [[1.0, 2.0, -2.0], [3.0, 1.0, 1.0], [-3.0, 1.0, 1.0], [0.0, 3.0, 4.0]] {
        let mut program = ConeProgram::new(Size { unknowns: 3, cone_rows: 3, ..Size::default() });
        program.P.fill_with_identity();
        program.Ft.fill_with_identity();
        program.c.copy_from_slice(&p.map(|x| -x));
        program.cones.push(3);
        program.size.cone_rows = 3;
        let radius = f64::hypot(p[1], p[2]);
        let project = |t: f64| {
            let a = if radius <= t { 1.0 } else { f64::max(0.0, 0.5 * (t + radius)) / radius };
            if radius <= -t { [0.0; 3] } else { [if radius <= t { t } else { a * radius }, a * p[1], a * p[2]] }
        };
        let x = project(p[0]);
        let w = [0, 1, 2].map(|i| x[i] - p[i]);
        for mut solver in solvers(&program) {
            assert_eq!(solver.solve(&program, Start::Cold).stopped, None);
            near(solver.x(), &x);
            near(solver.multipliers().cones, &w);
        }
    }
}

/// Projects a point p onto a box and a plane: min ½ ‖x − p‖² with l ≤ x ≤ u, with and without Σ x = 1. The solution is
/// p, shifted by the multiplier of the sum and then clipped.
#[test]
fn projection_onto_a_box_and_a_plane() {
    let (p, lower, upper) = ([2.0, -1.0, 0.3, 0.5], [0.0, -0.5, 0.5, -9.0], [1.0, f64::INFINITY, 0.5, 9.0]);
    let clipped = |shift: f64| [0, 1, 2, 3].map(|i| f64::clamp(p[i] - shift, lower[i], upper[i]));
    for equalities in [0, 1] {
        let mut program = ConeProgram::new(Size { unknowns: 4, equalities, rows: 4, cone_rows: 0 });
        program.P.fill_with_identity();
        program.Gt.fill_with_identity();
        program.At.fill(1.0);
        program.b.fill(1.0);
        program.c.copy_from_slice(&p.map(|x| -x));
        program.lower.copy_from_slice(&lower);
        program.upper.copy_from_slice(&upper);
        let (mut low, mut high) = (-20.0, 20.0);
        for _ in 0..100 {
            let shift = 0.5 * (low + high);
            if clipped(shift).iter().sum::<f64>() > 1.0 { low = shift } else { high = shift }
        }
        let shift = if equalities == 1 { low } else { 0.0 };
        let x = clipped(shift);
        let z = [0, 1, 2, 3].map(|i| x[i] - p[i] + shift);
        for mut solver in solvers(&program) {
            assert_eq!(solver.solve(&program, Start::Cold).stopped, None);
            near(solver.x(), &x);
            near(solver.multipliers().rows, &z);
            near(solver.multipliers().equalities, &[-shift][..equalities]);
        }
    }
}

/// Computes the force f on a block of mass m on an incline of angle α, with the friction coefficient μ and the gravity
/// g. Friction holds the block if tan α ≤ μ. The minimum of ½ ‖f − m g‖² over the friction cone is then f = m g. For
/// larger α, f is the projection of m g onto the cone, of length m g cos(α − arctan μ) along the cone's edge.
#[test]
fn a_block_on_an_incline() {
    let (weight, friction) = (9.81 * 3.0, 0.6_f64);
    for degrees in [0.0, 10.0, 29.0, 33.0, 45.0, 80.0_f64] {
        let (alpha, edge) = (degrees.to_radians(), friction.atan());
        let mut program = ConeProgram::new(Size { unknowns: 3, cone_rows: 3, ..Size::default() });
        program.P.fill_with_identity();
        program.c.copy_from_slice(&[-weight * alpha.sin(), 0.0, -weight * alpha.cos()]);
        (program.Ft[(2, 0)], program.Ft[(0, 1)], program.Ft[(1, 2)]) = (friction, 1.0, 1.0);
        program.cones.push(3);
        program.size.cone_rows = 3;
        let length = if alpha <= edge { weight } else { weight * (alpha - edge).cos() };
        let angle = alpha.min(edge);
        for mut solver in solvers(&program) {
            assert_eq!(solver.solve(&program, Start::Cold).stopped, None);
            near(solver.x(), &[length * angle.sin(), 0.0, length * angle.cos()]);
        }
    }
}
