//! Dense quadratic program with bounds, solved by a dual active-set method.
//!
//! ```text
//! minimise     ½ xᵀ H x + cᵀ x                      H positive definite
//! subject to   E x = e
//!              lower ≤ x ≤ upper
//!              a_iᵀ x ≥ b_i
//! ```
//!
//! The method starts at the minimiser without constraints and adds one violated constraint after another. Each iterate
//! is the minimiser under the active constraints, so the method ends after a finite number of steps. With the Cholesky
//! factor H = L Lᵀ and the normals N of the active constraints, it keeps J = L⁻ᵀ Q and the triangle R of
//! L⁻¹ N = Q (R; 0). A bound on x_i has the normal ±e_i, and its product with J is a row of J. If no constraint is
//! violated, J is not computed.
//!
//! Source: Goldfarb and Idnani, *A numerically stable dual method for solving strictly convex quadratic programs*
//! (1983), algorithm 2.

use condyle_linalg::{Vector, Vectorized, at_level};

/// Maximum violation of a constraint, relative to 1 + |bound|. It is far above the rounding of a program with the
/// default damping, and far below any displacement that matters.
const TOLERANCE: f64 = 1e-11;

/// Maximum violation of a constraint in programs with equalities. The equalities keep the results of earlier programs,
/// whose rounding may contradict bounds that were active there.
const TOLERANCE_WITH_EQUALITIES: f64 = 1e-8;

/// Square of the ratio below which a normal depends linearly on the active normals. The compared numbers are the parts
/// of the normal outside and inside the space of the active normals, in the norm of H⁻¹.
const DEPENDENT: f64 = 1e-16;

/// Number of active constraints that the solver may add, as a multiple of the numbers of unknowns and constraints. The
/// method needs about one step for each active constraint at the solution.
const MOST_STEPS: usize = 4;

/// Constraint of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Constraint {
    /// Equality with this index.
    Equality(usize),
    /// Lower bound of this unknown.
    Lower(usize),
    /// Upper bound of this unknown.
    Upper(usize),
    /// Row with this index.
    Row(usize),
}

/// Reason for which a program was not solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unsolved {
    /// No point satisfies this constraint together with the active constraints.
    Infeasible(Constraint),
    /// H is not positive definite, or the number of steps is exhausted.
    Numerical,
}

/// Program and memory of its solver. The caller fills the program; the solver overwrites H.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSet {
    n: usize,
    /// H, n × n, column by column; only the lower triangle is read. The solver overwrites it with its factor L.
    pub H: Vec<f64>,
    /// Linear cost c, n numbers.
    pub c: Vec<f64>,
    /// Lower bounds, n numbers; −∞ for none. At most the upper bounds.
    pub lower: Vec<f64>,
    /// Upper bounds, n numbers; ∞ for none.
    pub upper: Vec<f64>,
    /// Normals of the equalities, n numbers for each, one after the other.
    pub E: Vec<f64>,
    /// Right sides of the equalities.
    pub e: Vec<f64>,
    /// Normals a_i of the rows, n numbers for each.
    pub A: Vec<f64>,
    /// Right sides b_i of the rows.
    pub b: Vec<f64>,
    /// Solution, n numbers.
    pub x: Vec<f64>,
    /// J, n × n, column by column.
    J: Vec<f64>,
    /// R, column by column with stride n.
    R: Vec<f64>,
    /// Jᵀ n⁺ for the normal n⁺ of the constraint that is added.
    d: Vec<f64>,
    /// Direction of the step in x.
    z: Vec<f64>,
    /// Direction of the step in the multipliers.
    r: Vec<f64>,
    /// Active constraints, with their multipliers.
    active: Vec<(Constraint, f64)>,
    /// Equalities that depend on the equalities before them, so that they are left out.
    pub redundant: usize,
}

impl ActiveSet {
    /// Allocates a program with n unknowns and at most this many equalities and rows.
    pub(crate) fn new(n: usize, equalities: usize, rows: usize) -> Self {
        Self {
            n,
            H: vec![0.0; n * n],
            c: vec![0.0; n],
            lower: vec![f64::NEG_INFINITY; n],
            upper: vec![f64::INFINITY; n],
            E: Vec::with_capacity(n * equalities),
            e: Vec::with_capacity(equalities),
            A: Vec::with_capacity(n * rows),
            b: Vec::with_capacity(rows),
            x: vec![0.0; n],
            J: vec![0.0; n * n],
            R: vec![0.0; n * n],
            d: vec![0.0; n],
            z: vec![0.0; n],
            r: vec![0.0; n],
            active: Vec::with_capacity(n + 1),
            redundant: 0,
        }
    }

    /// Returns the active constraints and their multipliers at the solution.
    pub(crate) fn active(&self) -> &[(Constraint, f64)] {
        &self.active
    }

    /// Lowers the right sides of the rows until the point of the bounds that is nearest to 0 satisfies the rows.
    /// Returns whether there are rows.
    pub(crate) fn relax(&mut self) -> bool {
        let n = self.n;
        for i in 0..n {
            self.x[i] = 0.0_f64.max(self.lower[i]).min(self.upper[i]);
        }
        for (row, b) in self.A.chunks_exact(n.max(1)).zip(&mut self.b) {
            *b = b.min(dot(row, &self.x));
        }
        !self.b.is_empty()
    }

    /// Solves the program. Afterwards x is within its bounds exactly, and satisfies equalities and rows up to rounding.
    pub(crate) fn solve(&mut self) -> Result<(), Unsolved> {
        let mut result = Ok(());
        at_level(Solve { program: self, result: &mut result });
        result
    }
}

/// Solve of a program, compiled for the vector instructions in use.
struct Solve<'a> {
    program: &'a mut ActiveSet,
    result: &'a mut Result<(), Unsolved>,
}

impl Vectorized for Solve<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        *self.result = self.program.minimise();
    }
}

impl ActiveSet {
    #[inline(always)]
    fn minimise(&mut self) -> Result<(), Unsolved> {
        let n = self.n;
        self.active.clear();
        self.redundant = 0;
        factorize(&mut self.H, n)?;
        // x = −H⁻¹ c
        for i in 0..n {
            self.x[i] = -self.c[i];
        }
        solve(&self.H, &mut self.x);
        if self.e.is_empty() && self.most_violated().is_none() {
            return Ok(());
        }
        invert_transposed(&self.H, &mut self.J, n);
        for i in 0..self.e.len() {
            self.add(Constraint::Equality(i))?;
        }
        for _ in 0..MOST_STEPS * (2 * n + self.b.len()) {
            let Some(constraint) = self.most_violated() else {
                for i in 0..n {
                    self.x[i] = self.x[i].max(self.lower[i]).min(self.upper[i]);
                }
                return Ok(());
            };
            self.add(constraint)?;
        }
        Err(Unsolved::Numerical)
    }

    /// Returns the constraint with the largest violation, if any violation is above the tolerance.
    #[inline(always)]
    fn most_violated(&self) -> Option<Constraint> {
        let tolerance = if self.e.is_empty() { TOLERANCE } else { TOLERANCE_WITH_EQUALITIES };
        let (mut most, mut found) = (tolerance, None);
        for i in 0..self.n {
            let below = (self.lower[i] - self.x[i]) / (1.0 + self.lower[i].abs());
            let above = (self.x[i] - self.upper[i]) / (1.0 + self.upper[i].abs());
            if below > most {
                (most, found) = (below, Some(Constraint::Lower(i)));
            }
            if above > most {
                (most, found) = (above, Some(Constraint::Upper(i)));
            }
        }
        for (i, &b) in self.b.iter().enumerate() {
            let violation = (b - dot(&self.A[i * self.n..][..self.n], &self.x)) / (1.0 + b.abs());
            if violation > most {
                (most, found) = (violation, Some(Constraint::Row(i)));
            }
        }
        found
    }

    /// Returns n⁺ᵀ x − b, negative if the constraint is violated.
    #[inline(always)]
    fn slack(&self, constraint: Constraint) -> f64 {
        let n = self.n;
        match constraint {
            Constraint::Lower(i) => self.x[i] - self.lower[i],
            Constraint::Upper(i) => self.upper[i] - self.x[i],
            Constraint::Equality(i) => dot(&self.E[i * n..][..n], &self.x) - self.e[i],
            Constraint::Row(i) => dot(&self.A[i * n..][..n], &self.x) - self.b[i],
        }
    }

    /// Writes d = Jᵀ n⁺.
    #[inline(always)]
    fn normal(&mut self, constraint: Constraint) {
        let n = self.n;
        let (row, J) = match constraint {
            Constraint::Lower(i) => return (0..n).for_each(|k| self.d[k] = self.J[k * n + i]),
            Constraint::Upper(i) => return (0..n).for_each(|k| self.d[k] = -self.J[k * n + i]),
            Constraint::Equality(i) => (&self.E[i * n..][..n], &self.J),
            Constraint::Row(i) => (&self.A[i * n..][..n], &self.J),
        };
        for (d, column) in self.d.iter_mut().zip(J.chunks_exact(n.max(1))) {
            *d = dot(column, row);
        }
    }

    /// Makes a violated constraint active, and drops active inequalities whose multipliers would become negative.
    /// Equalities are added before all inequalities, so their steps may have any sign.
    #[inline(always)]
    fn add(&mut self, constraint: Constraint) -> Result<(), Unsolved> {
        let n = self.n;
        let equality = matches!(constraint, Constraint::Equality(_));
        let mut multiplier = 0.0;
        loop {
            let q = self.active.len();
            let slack = self.slack(constraint);
            self.normal(constraint);
            // z = J₂ d₂ and n⁺ᵀ z = ‖d₂‖²
            let outside = dot(&self.d[q..n], &self.d[q..n]);
            let inside = dot(&self.d[..q], &self.d[..q]);
            let dependent = outside <= DEPENDENT * (outside + inside);
            self.z.fill(0.0);
            if !dependent {
                for k in q..n {
                    axpy(self.d[k], &self.J[k * n..][..n], &mut self.z);
                }
            }
            // R r = d₁
            self.r[..q].copy_from_slice(&self.d[..q]);
            for k in (0..q).rev() {
                let x = self.r[k] / self.R[k * n + k];
                self.r[k] = x;
                axpy(-x, &self.R[k * n..][..k], &mut self.r[..k]);
            }
            if dependent && equality {
                // The equality follows from the active equalities. Its right side is then consistent with them.
                self.redundant += 1;
                return Ok(());
            }
            // Maximum step without a negative multiplier.
            let (mut partial, mut dropped) = (f64::INFINITY, None);
            for (k, &(other, u)) in self.active.iter().enumerate() {
                if self.r[k] > 0.0 && !matches!(other, Constraint::Equality(_)) && u / self.r[k] < partial {
                    (partial, dropped) = (u / self.r[k], Some(k));
                }
            }
            // Step after which the constraint is satisfied.
            let full = if dependent { f64::INFINITY } else { -slack / outside };
            let t = partial.min(full);
            if t == f64::INFINITY {
                return Err(Unsolved::Infeasible(constraint));
            }
            if !dependent {
                axpy(t, &self.z, &mut self.x);
            }
            for (k, (_, u)) in self.active.iter_mut().enumerate() {
                *u -= t * self.r[k];
            }
            multiplier += t;
            if full <= partial {
                self.extend(outside);
                self.active.push((constraint, multiplier));
                return Ok(());
            }
            self.drop(dropped.expect("the step ends at a multiplier"));
        }
    }

    /// Reflects columns q to n of J so that d becomes (d₁, α, 0) with |α| = ‖d₂‖, and adds this column to R. The
    /// Householder vector is w = d₂ − α e₁, and J₂ w follows from z = J₂ d₂.
    #[inline(always)]
    fn extend(&mut self, outside: f64) {
        let (n, q) = (self.n, self.active.len());
        let first = self.d[q];
        let alpha = if first > 0.0 { -outside.sqrt() } else { outside.sqrt() };
        self.d[q] = first - alpha; // w
        let square = outside - alpha * first; // ½ wᵀ w
        axpy(-alpha, &self.J[q * n..][..n], &mut self.z); // J₂ w = z − α J_q
        for k in q..n {
            axpy(-self.d[k] / square, &self.z, &mut self.J[k * n..][..n]); // J₂ ← J₂ − J₂ w (2 w / wᵀ w)ᵀ
        }
        self.d[q] = alpha;
        self.R[q * n..][..=q].copy_from_slice(&self.d[..=q]);
    }

    /// Removes active constraint k, and makes R triangular again.
    #[inline(always)]
    fn drop(&mut self, k: usize) {
        let n = self.n;
        self.active.remove(k);
        let q = self.active.len();
        for j in k..q {
            self.R.copy_within((j + 1) * n..(j + 1) * n + j + 2, j * n);
        }
        for j in k..q {
            let (a, b) = (self.R[j * n + j], self.R[j * n + j + 1]);
            if b == 0.0 {
                continue;
            }
            let length = (a * a + b * b).sqrt();
            let (c, s) = (a / length, b / length);
            for column in j..q {
                let (x, y) = (self.R[column * n + j], self.R[column * n + j + 1]);
                (self.R[column * n + j], self.R[column * n + j + 1]) = (c * x + s * y, c * y - s * x);
            }
            let (left, right) = self.J[j * n..(j + 2) * n].split_at_mut(n);
            rotate(c, s, left, right);
        }
    }
}

/// Replaces the columns (x, y) by (c x + s y, c y − s x).
#[inline(always)]
fn rotate(c: f64, s: f64, x: &mut [f64], y: &mut [f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
    }
}

/// Adds a x to y.
#[inline(always)]
pub(crate) fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// Returns Σ xᵢ yᵢ with eight partial sums. Both slices have the same length.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let ((xs, x), (ys, y)) = (x.as_chunks::<8>(), y.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (x, y) in xs.iter().zip(ys) {
        for i in 0..8 {
            sums[i] += x[i] * y[i];
        }
    }
    let rest: f64 = x.iter().zip(y).map(|(x, y)| x * y).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// Replaces the lower triangle of H by its factor L.
#[inline(always)]
fn factorize(H: &mut [f64], n: usize) -> Result<(), Unsolved> {
    for j in 0..n {
        let (left, rest) = H.split_at_mut(j * n);
        let column = &mut rest[j..n];
        for k in 0..j {
            let other = &left[k * n + j..(k + 1) * n];
            axpy(-other[0], other, column);
        }
        if column[0].is_nan() || column[0] <= 0.0 {
            return Err(Unsolved::Numerical);
        }
        let r = column[0].sqrt().recip();
        column.iter_mut().for_each(|x| *x *= r);
    }
    Ok(())
}

/// Solves L Lᵀ x = b in place.
#[inline(always)]
fn solve(L: &[f64], b: &mut [f64]) {
    let n = b.len();
    for j in 0..n {
        let x = b[j] / L[j * n + j];
        b[j] = x;
        axpy(-x, &L[j * n + j + 1..(j + 1) * n], &mut b[j + 1..]);
    }
    for j in (0..n).rev() {
        let x = b[j] - dot(&L[j * n + j + 1..(j + 1) * n], &b[j + 1..]);
        b[j] = x / L[j * n + j];
    }
}

/// Computes J = L⁻ᵀ, an upper triangle. Column j of J is the solution of Lᵀ x = e_j.
#[inline(always)]
fn invert_transposed(L: &[f64], J: &mut [f64], n: usize) {
    J.fill(0.0);
    // Row j of L⁻¹ is column j of J: L⁻¹ = D⁻¹ (1 − (L − D) L⁻¹), row by row.
    for j in 0..n {
        let (done, rest) = J.split_at_mut(j * n);
        let column = &mut rest[..n];
        for k in 0..j {
            axpy(-L[k * n + j], &done[k * n..][..=k], &mut column[..=k]);
        }
        column[j] = 1.0;
        let r = L[j * n + j].recip();
        column[..=j].iter_mut().for_each(|x| *x *= r);
    }
}

#[cfg(test)]
mod tests;
