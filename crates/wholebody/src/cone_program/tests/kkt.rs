//! Errors of a solution in the Karush–Kuhn–Tucker conditions.

use crate::cone_program::{ConeProgram, Multipliers};

fn column(matrix: &nalgebra::DMatrix<f64>, j: usize, x: &[f64]) -> f64 {
    (0..x.len()).map(|i| matrix[(i, j)] * x[i]).sum()
}

fn radius(s: &[f64]) -> f64 {
    s.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Errors in the Karush–Kuhn–Tucker conditions. Each error is relative to the terms from which it is computed.
#[derive(Debug, Default)]
pub(super) struct Errors {
    /// Gradient of the Lagrangian, P x + c − Aᵀ y − Gᵀ z − Fᵀ w.
    pub stationarity: f64,
    /// Violation of the constraints.
    pub primal: f64,
    /// Distance of the multipliers w from their cones.
    pub dual: f64,
    /// Complementarity zᵀ s over all bounds and cones, relative to the objective.
    pub complementarity: f64,
}

impl Errors {
    pub(super) fn new(program: &ConeProgram, x: &[f64], multipliers: Multipliers<'_>) -> Self {
        let (n, mut errors) = (program.size.unknowns, Self::default());
        assert_eq!(x.len(), n);
        let Multipliers { equalities, rows, cones } = multipliers;
        assert!(x.iter().chain(equalities).chain(rows).chain(cones).all(|x| x.is_finite()));
        let (mut gradient, mut size) = (program.c[..n].to_vec(), vec![1.0_f64; n]);
        let mut add = |i: usize, a: f64| {
            gradient[i] += a;
            size[i] = size[i].max(a.abs());
        };
        for i in 0..n {
            for j in 0..n {
                add(i, program.P[(i.max(j), i.min(j))] * x[j]);
            }
            equalities.iter().enumerate().for_each(|(j, y)| add(i, -program.At[(i, j)] * y));
            rows.iter().enumerate().for_each(|(j, z)| add(i, -program.Gt[(i, j)] * z));
            cones.iter().enumerate().for_each(|(j, w)| add(i, -program.Ft[(i, j)] * w));
        }
        for (a, size) in gradient.iter().zip(&size) {
            errors.stationarity = errors.stationarity.max(a.abs() / size);
        }
        let mut primal = |excess: f64, size: f64| errors.primal = errors.primal.max(excess / size);
        let mut gap = 0.0_f64;
        for j in 0..program.size.equalities {
            let norm = radius(program.At.column(j).as_slice());
            primal((column(&program.At, j, x) - program.b[j]).abs(), norm * (1.0 + radius(x)));
        }
        for j in 0..program.size.rows {
            let (g, norm) = (column(&program.Gt, j, x), radius(&program.Gt.column(j).as_slice()[..n]));
            let (below, above) = (g - program.lower[j], program.upper[j] - g);
            primal(f64::max(-below, -above), norm * (1.0 + radius(x)));
            gap += if rows[j] > 0.0 {
                rows[j] * below
            } else if rows[j] < 0.0 {
                -rows[j] * above
            } else {
                0.0
            };
        }
        let mut first = 0;
        for &dim in &program.cones {
            let s: Vec<f64> = (first..first + dim).map(|j| program.h[j] + column(&program.Ft, j, x)).collect();
            let w = &cones[first..first + dim];
            let norm = (first..first + dim).map(|j| radius(&program.Ft.column(j).as_slice()[..n])).fold(0.0, f64::max);
            primal(radius(&s[1..]) - s[0], norm.max(1e-300) * (1.0 + radius(x)));
            errors.dual = errors.dual.max((radius(&w[1..]) - w[0]) / (1.0 + w[0].abs()));
            gap += s.iter().zip(w).map(|(s, w)| s * w).sum::<f64>();
            first += dim;
        }
        errors.complementarity = gap.abs() / (1.0 + program.objective(x).abs());
        errors
    }

    pub(super) fn worst(&self) -> f64 {
        self.stationarity.max(self.primal).max(self.dual).max(self.complementarity)
    }
}
