//! Karush, Kuhn and Tucker's conditions of a tick's program as it is assembled, before anything is eliminated or scaled.
#![allow(dead_code, non_snake_case, unreachable_pub)] // each test file uses its part

use condyle_wholebody::inspection::{Optimum, Program};
use condyle_wholebody::{References, WholeBodyController};
use nalgebra::{DMatrix, DVector};

/// Of the conditions of optimality, relative to the terms that they are differences of. The solver's tolerance is 1e-9 where
/// all is scaled to size one; here forces of 1000 N stand beside accelerations of 1 m/s².
pub const OPTIMALITY: f64 = 1e-7;
/// Of complementarity, relative to 1 and the terms of the objective: the solver's is relative to what remains of the objective
/// after the elimination, from which constants are missing.
const GAP: f64 = 1e-6;

/// The errors of stationarity, of primal and dual feasibility, and of complementarity.
fn errors(program: &Program, optimum: &Optimum) -> [f64; 4] {
    let Optimum { x, rows: z, cones: w, .. } = optimum;
    let Program { P, c, A, b, G, lower, upper, F, h, cones } = program;
    // P x + c = Aᵀ y + Gᵀ z + Fᵀ w for some y
    let terms = [P * x, c.clone(), -G.transpose() * z, -F.transpose() * w];
    let gradient = terms.iter().sum::<DVector<f64>>();
    let size = 1.0 + terms.iter().map(DVector::amax).fold(0.0, f64::max);
    let Q = A.transpose().qr().q(); // what of the gradient is not in the range of Aᵀ
    let stationarity = (&gradient - &Q * Q.tr_mul(&gradient)).amax() / size;

    let norm = |M: &DMatrix<f64>, i: usize| M.row(i).norm() * (1.0 + x.norm());
    let (equalities, g, s) = (A * x - b, G * x, F * x + h);
    let (mut primal, mut dual, mut gap) = (0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..b.len() {
        primal = primal.max(equalities[i].abs() / norm(A, i));
    }
    for i in 0..g.len() {
        let (below, above) = (g[i] - lower[i], upper[i] - g[i]);
        primal = primal.max(f64::max(-below, -above) / norm(G, i));
        // z⁺ belongs to the lower bound and z⁻ to the upper one, where there is one
        for (z, slack) in [(z[i].max(0.0), below), ((-z[i]).max(0.0), above)] {
            if z > 0.0 {
                gap += z * slack;
            }
        }
    }
    let mut first = 0;
    for &dim in cones {
        let (s, w) = (s.rows(first, dim), w.rows(first, dim));
        let margin = |x: &nalgebra::DVectorView<f64>| x.rows(1, dim - 1).norm() - x[0];
        primal = primal.max(margin(&s) / norm(F, first));
        dual = dual.max(margin(&w) / (1.0 + w[0].abs()));
        gap += s.dot(&w);
        first += dim;
    }
    let objective = 0.5 * x.dot(&(P * x)) + c.dot(x).abs();
    [stationarity, primal, dual, gap.abs() / (1.0 + objective)]
}

/// Looks at what the last step of a controller found: its program's first priority.
///
/// # Panics
/// If it is not the optimum, with a text that says where.
pub fn check_optimality(
    controller: &mut WholeBodyController,
    q: &[f64],
    v: &[f64],
    references: &References,
    place: &str,
) {
    let optimum = controller.optimum();
    let errors = errors(&controller.program(q, v, references), &optimum);
    let allowed = [OPTIMALITY, OPTIMALITY, OPTIMALITY, GAP];
    assert!(errors.iter().zip(allowed).all(|(e, most)| *e < most), "{place}: {errors:?}");
}
