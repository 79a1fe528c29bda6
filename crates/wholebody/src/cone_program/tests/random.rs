//! Random programs of several kinds. Each kind has a property that can make a solver fail.

use crate::cone_program::{ConeProgram, Size};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Special property of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Strictly convex and strictly feasible.
    Plain,
    /// Rows, equalities and cones that occur twice.
    Duplicates,
    /// Rows with l = u.
    Fixed,
    /// Cones without coefficients: the apex of a cone, or a point in its interior.
    ZeroCones,
    /// A minimiser at a vertex: P is almost zero.
    Vertex,
    /// Cost matrix P with half the full rank; bounds keep all unknowns in a box.
    Semidefinite,
    /// Rows and cones scaled by factors from 1e-4 to 1e4.
    BadlyScaled,
    /// A single row or a single cone as the only constraint.
    Few,
}

impl Kind {
    pub(super) const ALL: [Self; 8] = [
        Self::Plain,
        Self::Duplicates,
        Self::Fixed,
        Self::ZeroCones,
        Self::Vertex,
        Self::Semidefinite,
        Self::BadlyScaled,
        Self::Few,
    ];
}

pub(super) struct Draw(pub StdRng);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(StdRng::seed_from_u64(seed))
    }

    /// Returns a number from −1 to 1.
    pub(super) fn number(&mut self) -> f64 {
        2.0 * self.0.random::<f64>() - 1.0
    }

    /// Returns a number from 0 to 1.
    pub(super) fn share(&mut self) -> f64 {
        self.0.random()
    }

    pub(super) fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.number()).collect()
    }

    /// Sets the cost matrix P = R Rᵀ + a I with a random matrix R of the given rank.
    pub(super) fn cost(&mut self, program: &mut ConeProgram, rank: usize, a: f64) {
        let n = program.size.unknowns;
        let R = nalgebra::DMatrix::from_fn(n, rank, |_, _| self.number());
        let P = &R * R.transpose();
        for (i, j) in (0..n).flat_map(|j| (j..n).map(move |i| (i, j))) {
            program.P[(i, j)] = P[(i, j)] + if i == j { a } else { 0.0 };
        }
    }

    /// Returns a feasible and bounded program with `n` unknowns, and with these numbers of equalities, rows and cones.
    pub(super) fn program(&mut self, kind: Kind, n: usize, [equalities, rows, cones]: [usize; 3]) -> ConeProgram {
        let dims: Vec<usize> = (0..cones).map(|k| [3, 3, 4, 2, 5, 1][k % 6]).collect();
        let cone_rows = dims.iter().sum();
        let mut program = ConeProgram::new(Size { unknowns: n, equalities, rows, cone_rows });
        program.cones.extend(&dims);
        program.size.cone_rows = cone_rows;
        let inside = self.vector(n);
        match kind {
            Kind::Vertex => self.cost(&mut program, 1, 1e-6),
            Kind::Semidefinite => self.cost(&mut program, n / 2, 0.0),
            _ => self.cost(&mut program, n, 0.1),
        }
        for x in &mut program.c {
            *x = 3.0 * self.number();
        }
        for matrix in [&mut program.At, &mut program.Gt, &mut program.Ft] {
            for x in matrix.as_mut_slice() {
                *x = self.number();
            }
        }
        if matches!(kind, Kind::Semidefinite | Kind::Vertex) {
            // The first rows become a box around the unknowns, because the objective may leave them free.
            for i in 0..rows.min(n) {
                program.Gt.column_mut(i).fill(0.0);
                program.Gt[(i, i)] = 1.0;
            }
        }
        let product =
            |matrix: &nalgebra::DMatrix<f64>, j: usize| -> f64 { (0..n).map(|i| matrix[(i, j)] * inside[i]).sum() };
        if kind == Kind::Duplicates {
            for k in (1..rows).step_by(3) {
                let (a, b) = (program.Gt.column(k - 1).into_owned(), self.number());
                program.Gt.set_column(k, &(a * b.signum()));
            }
            for k in (1..equalities).step_by(2) {
                let a = program.At.column(k - 1).into_owned();
                program.At.set_column(k, &a);
            }
        }
        for i in 0..equalities {
            program.b[i] = product(&program.At, i);
        }
        for i in 0..rows {
            let g = product(&program.Gt, i);
            let boxed = matches!(kind, Kind::Semidefinite | Kind::Vertex) && i < n;
            let (below, above) = (self.share(), self.share());
            program.lower[i] = if i % 3 != 0 || boxed { g - 0.01 - below } else { f64::NEG_INFINITY };
            program.upper[i] = if i % 4 != 0 || boxed { g + 0.01 + above } else { f64::INFINITY };
            if kind == Kind::Fixed && i % 5 == 1 && i / 5 + equalities < n / 2 {
                (program.lower[i], program.upper[i]) = (g, g);
            }
        }
        let mut first = 0;
        for (k, &dim) in dims.iter().enumerate() {
            if kind == Kind::Duplicates && k > 0 && dims[k - 1] == dim {
                for i in 0..dim {
                    let a = program.Ft.column(first - dim + i).into_owned();
                    program.Ft.set_column(first + i, &a);
                }
            }
            let mut s = self.vector(dim);
            s[0] = 0.01 + self.share() + s[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
            for i in 0..dim {
                program.h[first + i] = s[i] - product(&program.Ft, first + i);
            }
            if kind == Kind::ZeroCones && k % 2 == 0 {
                for i in 0..dim {
                    program.Ft.column_mut(first + i).fill(0.0);
                    program.h[first + i] = if k % 4 == 0 { 0.0 } else { s[i] };
                }
            }
            first += dim;
        }
        if kind == Kind::BadlyScaled {
            let mut scale = || 10.0_f64.powf(4.0 * self.number());
            for i in 0..rows {
                let a = scale();
                program.Gt.column_mut(i).scale_mut(a);
                program.lower[i] *= a;
                program.upper[i] *= a;
            }
            let mut first = 0;
            for &dim in &dims {
                let a = scale();
                for i in first..first + dim {
                    program.Ft.column_mut(i).scale_mut(a);
                    program.h[i] *= a;
                }
                first += dim;
            }
        }
        if kind == Kind::Few {
            program.size.rows = rows.min(1);
            program.cones.truncate(1);
            program.size.cone_rows = program.cones.iter().sum();
        }
        program
    }
}
