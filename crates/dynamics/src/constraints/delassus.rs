//! Delassus matrix J M⁻¹ Jᵀ of a robot's constraints. The inverse Λ of this matrix is the inertia of the robot along
//! the constraints.
//!
//! A slot is the index of a coordinate in the order of the sparse factor M = Lᵀ D L. A row of Y = J L⁻¹ has entries
//! only in the slots of the same row of J, and in the slots between these slots and the root. The entries of J M⁻¹ Jᵀ =
//! Y D⁻¹ Yᵀ for two constraints need only the slots that the two constraints share. J M⁻¹ Jᵀ is factorised as C E Cᵀ,
//! with a unit lower triangular matrix C and a diagonal matrix E. If a row depends on earlier rows, its pivot is only a
//! rounding error, and its force is set to zero. An [island](Island) is a group of trees and constraints that is
//! independent of all others. Each island is factorised separately, in its own columns and rows of the common arrays.
//! Source: Featherstone, *Exploiting sparsity in operational-space dynamics* (2010); Golub and Van Loan, *Matrix
//! Computations* (4th edition), section 4.1.

use crate::constraints::islands::Island;
use crate::constraints::plan::{Plan, ProximalSettings};
use crate::workspace::{filled, zero_matrix};
use condyle_linalg::Ltdl;
use condyle_linalg::axpy::{axpy, dot};
use condyle_spatial::{Array, Matrix, Scalar, same_layout};
use core::ops::Range;

/// Minimum pivot, as a multiple of the rounding error of the pivot's diagonal entry. A smaller pivot is treated as
/// zero.
const ROUNDINGS: f64 = 1e3;

/// Returns the number of entries that loops over columns process at once. Columns are padded to a multiple of this
/// step, so these loops have no remainder. Entries above the diagonal, and entries after the last row, are never used.
pub(crate) const fn step<S: Scalar>() -> usize {
    if S::LANES == 1 { STEP } else { 1 }
}

/// Number of entries that loops over columns process at once, for scalars without lanes.
const STEP: usize = 8;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Delassus<S> {
    /// Matrices Y = J L⁻¹ and Z = J L⁻¹ D⁻¹, with the factors M = Lᵀ D L, in the slots of each constraint. Shape:
    /// number of entries in all rows of J. Written by: `multiply`.
    Y: Array<S>,
    Z: Array<S>,
    /// Distance between the columns of `CE` and between the rows of `rows`: the number of rows plus 1, rounded up to a
    /// multiple of `step`.
    pub stride: usize,
    /// Lower triangle of J M⁻¹ Jᵀ, which `decompose` overwrites by the lower triangle of C E (J M⁻¹ Jᵀ + μ 1 = C E Cᵀ).
    /// Stored by columns. Shape: stride × rows, plus one step. Written by: `multiply`, or in lanes by `limbs`; then by
    /// `decompose`.
    pub CE: Array<S>,
    /// Lower triangle of C E, where J M⁻¹ Jᵀ + μ 1 = C E Cᵀ, stored by rows. Shape: stride × rows, plus one step.
    /// Written by: `decompose`.
    rows: Array<S>,
    /// Reciprocal 1/E of the pivot of each row, or 0 if the pivot counts as zero. Shape: rows. Written by: `decompose`.
    E_inv: Array<S>,
    /// Number of rows whose pivot counts as zero. Written by: `decompose`.
    pub redundant: S,
    /// Right-hand side b, which the solution overwrites. Shape: stride. Written by: `decompose`, `solve`, `invert`.
    x: Array<S>,
    /// Vector y = C⁻¹ b, the result of the forward substitution with the factor C for the right-hand side b. Shape:
    /// rows. Written by: `substitute`.
    y: Array<S>,
    /// Matrix Λ, the inverse of J M⁻¹ Jᵀ. Shape: rows × rows. Written by: `invert`.
    pub inverse: Matrix<S>,
}

same_layout!(Delassus { Y, Z, CE, rows, E_inv, redundant, x, y, inverse } same { stride });

/// Returns the machine epsilon, the distance from 1 to the next number.
#[inline(always)]
fn epsilon<S: Scalar>() -> S {
    let third = S::splat(4.0) / S::splat(3.0) - S::one();
    (third + third + third - S::one()).abs()
}

impl<S: Scalar> Delassus<S> {
    pub(crate) fn new(rows: usize, entries: usize) -> Self {
        let (o, stride) = (S::zero(), (rows + 1).next_multiple_of(step::<S>()));
        let square = filled(|| o, stride * rows + step::<S>());
        Self {
            Y: filled(|| o, entries),
            Z: filled(|| o, entries),
            stride,
            CE: square.clone(),
            rows: square,
            E_inv: filled(|| o, rows),
            redundant: o,
            x: filled(|| o, stride),
            y: filled(|| o, rows),
            inverse: zero_matrix(rows, rows),
        }
    }

    /// Computes the Delassus matrix J M⁻¹ Jᵀ of one island (trees and constraints that are independent of all others)
    /// from the rows of J. Each row is stored in the slots of its constraint.
    #[inline(always)]
    pub(crate) fn multiply(&mut self, plans: &[Plan], island: &Island, J: &[S], M: &Ltdl<S>) {
        let D_inv = M.inverse_diagonal();
        self.clear(island);
        let (G, stride, first) = (&mut self.CE, self.stride, island.constraints.start);
        for i in island.constraints.clone() {
            let plan = &plans[i];
            let Plan { places, shared, second, .. } = plan;
            self.Y[plan.start..plan.end()].copy_from_slice(&J[plan.start..plan.end()]);
            for r in 0..plan.rows() {
                let (y, z) = (&mut self.Y[plan.range(r)], &mut self.Z[plan.range(r)]);
                for (j, &k) in places.iter().enumerate().rev() {
                    let (x, row) = (-y[j], M.row_from_root(k));
                    if j < *second {
                        axpy(x, row, &mut y[..j]); // y_e −= L_ke y_k in the slots e between k and the root
                    } else {
                        axpy(x, &row[..*shared], &mut y[..*shared]);
                        axpy(x, &row[*shared..], &mut y[*second..j]);
                    }
                    z[j] = y[j] * D_inv[k];
                }
            }
            for (other, runs) in plans[first..=i].iter().zip(&plan.common[first..]) {
                for r in 0..plan.rows() {
                    let z = &self.Z[plan.range(r)];
                    for c in 0..if other.row == plan.row { r + 1 } else { other.rows() } {
                        let y = &self.Y[other.range(c)];
                        let mut sum = S::zero();
                        for &[here, there, n] in runs {
                            sum += dot(&z[here..here + n], &y[there..there + n]);
                        }
                        G[(other.row + c) * stride + plan.row + r] = sum; // z_r · y_c
                    }
                }
            }
        }
    }

    /// Sets the Delassus matrix J M⁻¹ Jᵀ of one island (trees and constraints that are independent of all others) to
    /// zero, and also the extra row after the island's last row.
    #[inline(always)]
    pub(crate) fn clear(&mut self, Island { rows, .. }: &Island) {
        for j in rows.clone() {
            self.CE[j * self.stride + j - j % step::<S>()..][..room::<S>(rows, j)].fill(S::zero());
        }
    }

    /// For one island (trees and constraints that are independent of all others), factorises J M⁻¹ Jᵀ + μ 1 = C E Cᵀ,
    /// with a unit lower triangular C and a diagonal E. With this factor, the function solves the equation without μ, J
    /// M⁻¹ Jᵀ λ = b, by the proximal iterations of `solve`. On entry, `CE` contains J M⁻¹ Jᵀ, and `lambda` contains b.
    /// The elimination treats b as an additional row of the matrix. Adds the number of rows whose pivot counts as zero
    /// to `redundant`.
    #[inline(always)]
    pub(crate) fn decompose(&mut self, island: &Island, proximal: ProximalSettings, lambda: &mut [S]) {
        let Self { CE, rows, E_inv, stride, .. } = self;
        let (Range { start, end: n }, stride) = (island.rows.clone(), *stride);
        let smallest = epsilon::<S>() * S::splat(ROUNDINGS);
        for j in start..n {
            CE[j * (stride + 1)] += S::splat(proximal.mu);
            CE[j * stride + n] = lambda[j];
        }
        for j in start..n {
            let (left, column) = CE.split_at_mut(j * stride);
            let (first, row) = (j - j % step::<S>(), &mut rows[j * stride..(j + 1) * stride]);
            let column = &mut column[first..][..room::<S>(&island.rows, j)];
            let diagonal = column[j - first];
            for k in start..j {
                row[k] = left[k * stride + j];
            }
            let left = &left[start * stride..];
            subtract(left, stride, first, &row[start..j], &E_inv[start..], column); // G_ij − Σ C_ik E_k C_jk
            let pivot = column[j - first];
            let kept = (diagonal * smallest).lt(pivot);
            E_inv[j] = S::select(kept, S::select(kept, pivot, S::one()).recip(), S::zero());
            self.redundant += S::select(kept, S::zero(), S::one());
            self.x[j] = column[n - first]; // y = C⁻¹ b
        }
        self.back_substitute(&island.rows);
        self.repeat(island, proximal, lambda);
    }

    /// Solves J M⁻¹ Jᵀ λ = b for the constraint forces λ of one island (trees and constraints that are independent of
    /// all others). If the regularisation μ is positive, the solution uses proximal iterations. On entry, `lambda`
    /// contains b.
    #[inline(always)]
    pub(crate) fn solve(&mut self, island: &Island, proximal: ProximalSettings, lambda: &mut [S]) {
        self.x[island.rows.clone()].copy_from_slice(&lambda[island.rows.clone()]);
        self.substitute(&island.rows, island.rows.start);
        self.back_substitute(&island.rows);
        self.repeat(island, proximal, lambda);
    }

    /// Runs all proximal iterations except the first. On entry, `lambda` contains the right-hand side b, and `x`
    /// contains the solution of the first iteration.
    #[inline(always)]
    fn repeat(&mut self, Island { rows, .. }: &Island, proximal: ProximalSettings, lambda: &mut [S]) {
        let mu = S::splat(proximal.mu);
        for _ in 1..rounds(proximal) {
            for r in rows.clone() {
                self.x[r] = self.x[r].mul_add(mu, lambda[r]); // b + μ λ'
            }
            self.substitute(rows, rows.start);
            self.back_substitute(rows);
        }
        lambda[rows.clone()].copy_from_slice(&self.x[rows.clone()]);
    }

    /// Computes the matrix Λ = (J M⁻¹ Jᵀ)⁻¹ of one island, which maps the right-hand side b to the constraint forces λ.
    /// Entries outside the island stay zero.
    #[inline(always)]
    pub(crate) fn invert(&mut self, Island { rows, .. }: &Island, proximal: ProximalSettings) {
        let (n, mu) = (self.E_inv.len(), S::splat(proximal.mu));
        for j in rows.clone() {
            self.x[rows.clone()].fill(S::zero());
            self.x[j] = S::one();
            self.substitute(rows, j);
            self.back_substitute(rows);
            for _ in 1..rounds(proximal) {
                for x in &mut self.x[rows.clone()] {
                    *x = *x * mu;
                }
                self.x[j] += S::one();
                self.substitute(rows, rows.start);
                self.back_substitute(rows); // Λ = (G + μ)⁻¹ (1 + μ Λ')
            }
            let column = &mut self.inverse.as_mut_slice()[j * n..(j + 1) * n];
            column[rows.clone()].copy_from_slice(&self.x[rows.clone()]);
        }
    }

    /// Replaces x = b by y = C⁻¹ b in the given rows, by forward substitution with the factor C. b is zero before the
    /// row `start`.
    #[inline(always)]
    fn substitute(&mut self, rows: &Range<usize>, start: usize) {
        let Self { CE, E_inv, x, y, stride, .. } = self;
        y[rows.start..start].fill(S::zero());
        for j in start..rows.end {
            let first = j - j % step::<S>();
            let n = room::<S>(rows, j);
            y[j] = x[j];
            update(-(x[j] * E_inv[j]), &CE[j * *stride + first..], &mut x[first..first + n]); // b_i − C_ij y_j
        }
        x[rows.clone()].copy_from_slice(&y[rows.clone()]);
    }

    /// Replaces x = y by C⁻ᵀ E⁻¹ y in the given rows, by backward substitution with the factors C and E.
    #[inline(always)]
    fn back_substitute(&mut self, range: &Range<usize>) {
        let Self { rows, E_inv, x, stride, .. } = self;
        let first = range.start - range.start % step::<S>();
        for j in range.clone().rev() {
            let (x_j, row) = (x[j] * E_inv[j], &rows[j * *stride + first..]);
            update(-x_j, row, &mut x[first..j.next_multiple_of(step::<S>())]); // y_k − E_k C_jk x_j
            x[j] = x_j;
        }
    }
}

/// Returns the length of column j, a multiple of `step`. The column begins with the step that contains its diagonal
/// entry and ends with the step that contains the row after the last row.
#[inline(always)]
fn room<S: Scalar>(rows: &Range<usize>, j: usize) -> usize {
    (rows.end + 1).next_multiple_of(step::<S>()) - (j - j % step::<S>())
}

/// Computes y += x s for a number s. Loops over whole steps, including the padding.
#[inline(always)]
fn update<S: Scalar>(s: S, x: &[S], y: &mut [S]) {
    if step::<S>() == 1 {
        return axpy(s, x, y);
    }
    for (x, y) in x.as_chunks::<STEP>().0.iter().zip(y.as_chunks_mut::<STEP>().0) {
        for j in 0..STEP {
            y[j] = x[j].mul_add(s, y[j]);
        }
    }
}

/// Computes y −= Σ xₖ sₖ Eₖ⁻¹, where xₖ is column k of a matrix, beginning at row `first`, and Eₖ⁻¹ is `E_inv[k]`.
/// Loops over whole steps, including the padding.
#[inline(always)]
fn subtract<S: Scalar>(columns: &[S], stride: usize, first: usize, s: &[S], E_inv: &[S], y: &mut [S]) {
    if step::<S>() == 1 {
        for k in 0..s.len() {
            axpy(-(s[k] * E_inv[k]), &columns[k * stride + first..], y);
        }
        return;
    }
    for (i, y) in y.as_chunks_mut::<STEP>().0.iter_mut().enumerate() {
        let mut sum = *y;
        for k in 0..s.len() {
            let (x, s) = (&columns[k * stride + first + i * STEP..][..STEP], -(s[k] * E_inv[k]));
            for j in 0..STEP {
                sum[j] = x[j].mul_add(s, sum[j]);
            }
        }
        *y = sum;
    }
}

/// Returns the number of proximal iterations. The number is 1 if the regularisation μ is 0, because one iteration is
/// then exact.
fn rounds(proximal: ProximalSettings) -> usize {
    if proximal.mu > 0.0 { proximal.iterations.max(1) } else { 1 }
}
