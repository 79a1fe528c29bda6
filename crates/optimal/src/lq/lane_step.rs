//! Step of the Riccati recursion for several problems, one in each lane.
//!
//! The step has the form of [`driven`](super::forms): a small arm in which every coordinate has a motor, given as
//! equations of inverse dynamics. H is stored column after column, with columns for (w, δv, δq). Below the rows of its
//! quadratic form are the row of the gradient and the rows of U, which become the gains:
//!
//! ```text
//!     ⎡ Π  ·  ·   ⎤                                                     ⎡ L  ·    ⎤
//! H = ⎢ Π  Π  ·   ⎥ + cost + Σ x xᵀ over the rows x of √weight (U, G)  →  ⎢ X  Vxx  ⎥
//!     ⎢ Nᵀ Nᵀ P₁₁ ⎥                                                     ⎢ yᵀ Vxᵀ  ⎥
//!     ⎣ gᵀ        ⎦                                                     ⎣ Y  K    ⎦
//!       U
//! ```
//!
//! The value function of the next knot is read from the H of its step. All loops run over whole vectors of lanes, so
//! the result in a lane does not depend on the other lanes.
#![allow(non_snake_case)] // names follow the literature: H, K, L, P, Q, U, X, Y

use super::knot::DIVERGED;
use condyle_spatial::{Scalar, kernel, same_layout};

/// Number of columns, and of rows, of a tile of H that is summed in registers.
const COLUMNS: usize = 3;
const ROWS: usize = 4;

/// Sizes of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepSize {
    /// Number of coordinates, which is also the number of controls.
    pub(super) nv: usize,
    /// Number of rows of G.
    pub(super) costs: usize,
    /// Stride of the rows of U and G.
    pub(super) width: usize,
}

same_layout!(StepSize);

impl StepSize {
    /// Returns the number of columns of H: w, δv and δq.
    pub(super) fn all(self) -> usize {
        3 * self.nv
    }

    /// Returns the stride of H.
    pub(super) fn stride(self) -> usize {
        self.all() + 1 + self.nv
    }

    /// Returns the numbers of entries of a knot's parts, which follow one another: [Δt, ϱ], the gradient [q, r], the
    /// diagonal of (Q_vv, R), the gap f, the columns of Q for δq, the slopes [a′, a″] of G, and the rows of U and G.
    pub(super) fn parts(self) -> [usize; 7] {
        let Self { nv, costs, width } = self;
        [2, 3 * nv, 2 * nv, 2 * nv, 2 * nv * nv, 2 * costs, (nv + costs) * width]
    }

    /// Returns the numbers of entries of a step's results, which follow one another: k, K and P f.
    pub(super) fn results(self) -> [usize; 3] {
        [self.nv, 2 * self.nv * self.nv, 2 * self.nv]
    }
}

/// Sums over the steps of a sweep.
pub(super) const SUMS: usize = 4;

/// Value function ½ δxᵀP δx + pᵀδx in the lower triangle of an H, whose states are in the order (v, q).
#[derive(Clone, Copy)]
struct Value<'a, S> {
    H: &'a [S],
    nv: usize,
    stride: usize,
}

impl<S: Scalar> Value<'_, S> {
    /// Returns entry (i, j) of the block of P for δq.
    #[inline(always)]
    fn qq(&self, i: usize, j: usize) -> S {
        self.H[(2 * self.nv + i.min(j)) * self.stride + 2 * self.nv + i.max(j)]
    }

    /// Returns entry (i, j) of the block of P for δv.
    #[inline(always)]
    fn vv(&self, i: usize, j: usize) -> S {
        self.H[(self.nv + i.min(j)) * self.stride + self.nv + i.max(j)]
    }

    /// Returns entry (i, j) of the block of P with the rows of δq and the columns of δv.
    #[inline(always)]
    fn qv(&self, i: usize, j: usize) -> S {
        self.H[(self.nv + j) * self.stride + 2 * self.nv + i]
    }

    /// Computes P f, adds pᵀf and fᵀP f to the sums, and then P f to p.
    #[inline(always)]
    fn move_by(&self, f: &[S], p: &mut [S], Pf: &mut [S], sums: &mut [S]) {
        let nv = self.nv;
        for i in 0..nv {
            let (mut q, mut v) = (S::zero(), S::zero());
            for j in 0..nv {
                q = self.qv(i, j).mul_add(f[nv + j], self.qq(i, j).mul_add(f[j], q));
                v = self.vv(i, j).mul_add(f[nv + j], self.qv(j, i).mul_add(f[j], v));
            }
            (Pf[i], Pf[nv + i]) = (q, v);
        }
        for i in 0..2 * nv {
            sums[1] = f[i].mul_add(p[i], sums[1]);
            sums[2] = f[i].mul_add(Pf[i], sums[2]);
            p[i] += Pf[i];
        }
    }
}

/// Adds ϱ to the diagonal of Vxx in H, copies Vx to p in the order (q, v), and marks the lanes that have diverged.
#[inline(always)]
fn finish<S: Scalar>(H: &mut [S], StepSize { nv, .. }: StepSize, stride: usize, rho: S, p: &mut [S], sums: &mut [S]) {
    let all = 3 * nv;
    let mut squares = S::zero();
    for j in nv..all {
        let column = &mut H[j * stride..][..all + 1];
        column[j] += rho;
        for i in j..all + 1 {
            squares = column[i].mul_add(column[i], squares);
        }
    }
    for j in 0..nv {
        p[j] = H[(2 * nv + j) * stride + all];
        p[nv + j] = H[(nv + j) * stride + all];
    }
    fail_unless::<S>(squares.lt(S::splat(DIVERGED * DIVERGED)), sums); // false for NaN
}

/// Marks the lanes in which `holds` is false as failed.
#[inline(always)]
fn fail_unless<S: Scalar>(holds: S::Mask, sums: &mut [S]) {
    sums[3] = S::select(holds, sums[3], S::one());
}

/// Computes R rows and C columns of H, from row i and column j on: H ← H + Σ x xᵀ − Σ h hᵀ, where x are the rows of X
/// and h the first `done` columns of H.
#[inline(always)]
fn add_tile<S: Scalar, const R: usize, const C: usize>(
    H: &mut [S],
    stride: usize,
    [i, j]: [usize; 2],
    (X, width): (&[S], usize),
    done: usize,
) {
    let mut sums = [[S::zero(); R]; C];
    for c in 0..C {
        sums[c].copy_from_slice(&H[(j + c) * stride + i..][..R]);
    }
    for x in X.chunks_exact(width) {
        let (a, b) = (&x[i..][..R], &x[j..][..C]);
        for c in 0..C {
            for r in 0..R {
                sums[c][r] = a[r].mul_add(b[c], sums[c][r]);
            }
        }
    }
    for h in H[..done * stride].chunks_exact(stride) {
        let (a, b) = (&h[i..][..R], &h[j..][..C]);
        for c in 0..C {
            let b = -b[c];
            for r in 0..R {
                sums[c][r] = a[r].mul_add(b, sums[c][r]);
            }
        }
    }
    for c in 0..C {
        H[(j + c) * stride + i..][..R].copy_from_slice(&sums[c]);
    }
}

/// Computes the tiles of C columns, with the rows from `from` to `to`.
#[inline(always)]
fn add_columns<S: Scalar, const C: usize>(
    H: &mut [S],
    stride: usize,
    ([from, to], j): ([usize; 2], usize),
    X: (&[S], usize),
    done: usize,
) {
    let mut i = from;
    while i + ROWS <= to {
        add_tile::<S, ROWS, C>(H, stride, [i, j], X, done);
        i += ROWS;
    }
    match to - i {
        1 => add_tile::<S, 1, C>(H, stride, [i, j], X, done),
        2 => add_tile::<S, 2, C>(H, stride, [i, j], X, done),
        3 => add_tile::<S, 3, C>(H, stride, [i, j], X, done),
        _ => {}
    }
}

/// Computes the columns from j on, at most [`COLUMNS`]: the rows of the quadratic form, with the sum over the rows of
/// X, and the rows of the gains, without this sum.
#[inline(always)]
fn add_to_columns<S: Scalar>(H: &mut [S], size: StepSize, j: usize, count: usize, X: &[S], done: usize) {
    let (stride, rows) = (size.stride(), size.all() + 1);
    for (range, X) in [([j, rows], X), ([rows, stride], &X[..0])] {
        match count {
            1 => add_columns::<S, 1>(H, stride, (range, j), (X, rows), done),
            2 => add_columns::<S, 2>(H, stride, (range, j), (X, rows), done),
            _ => add_columns::<S, COLUMNS>(H, stride, (range, j), (X, rows), done),
        }
    }
}

kernel! {
    /// Writes the value function of the terminal knot to H and p. `Q` has all entries, column after column.
    pub(super) fn begin_sweep<S>(size: StepSize, Q: &[S], q: &[S], rho: &S, H: &mut [S], p: &mut [S], sums: &mut [S]) {
        let (nv, stride) = (size.nv, size.stride());
        let (n, all) = (2 * nv, 3 * nv);
        for j in 0..nv {
            for i in 0..nv {
                H[(n + j) * stride + n + i] = Q[j * n + i];
                H[(nv + j) * stride + n + i] = Q[(nv + j) * n + i];
                H[(nv + j) * stride + nv + i] = Q[(nv + j) * n + nv + i];
            }
            H[(n + j) * stride + all] = q[j];
            H[(nv + j) * stride + all] = q[nv + j];
        }
        finish(H, size, stride, *rho, p, sums);
    }
}

kernel! {
    /// Adds the terms pᵀf and fᵀP f of the first gap to the sums, and writes P f.
    pub(super) fn end_sweep<S>(size: StepSize, f: &[S], H: &[S], p: &mut [S], Pf: &mut [S], sums: &mut [S]) {
        Value { H, nv: size.nv, stride: size.stride() }.move_by(f, p, Pf, sums);
    }
}

kernel! {
    /// Makes one step. Reads the value function from `next` and p, and writes it to H and p. `X` is scratch for the
    /// rows of U and G, multiplied by the roots of their weights.
    pub(super) fn step<S>(
        size: StepSize, knot: &[S], next: &[S], p: &mut [S], H: &mut [S], X: &mut [S], results: &mut [S],
        sums: &mut [S],
    ) {
        let (StepSize { nv, costs, width }, stride, all) = (size, size.stride(), size.all());
        let n = 2 * nv;
        let [times, gradients, diagonals, gaps, blocks, slopes, _] = size.parts();
        let (times, rest) = knot.split_at(times);
        let (g, rest) = rest.split_at(gradients);
        let (diagonal, rest) = rest.split_at(diagonals);
        let (f, rest) = rest.split_at(gaps);
        let (Q, rest) = rest.split_at(blocks);
        let (slopes, rows) = rest.split_at(slopes);
        let (dt, rho) = (times[0], times[1]);
        let (k, rest) = results.split_at_mut(nv);
        let (K, Pf) = rest.split_at_mut(n * nv);

        let P = Value { H: next, nv, stride };
        P.move_by(f, p, Pf, sums);
        // writes Nᵀ = Δt P₁₁ + P₁₂, Π = Δt (Nᵀ + P₂₁) + P₂₂, and Q + P₁₁ in the block of δq
        for j in 0..nv {
            for i in 0..nv {
                let (Ni, Nj) = (dt.mul_add(P.qq(i, j), P.qv(i, j)), dt.mul_add(P.qq(i, j), P.qv(j, i)));
                H[j * stride + n + i] = Ni;
                H[(nv + j) * stride + n + i] = Ni;
                // Π is symmetric: the same order of additions in both triangles
                let mixed = if i >= j { (Ni, P.qv(j, i)) } else { (Nj, P.qv(i, j)) };
                let Pi = dt.mul_add(mixed.0 + mixed.1, P.vv(i, j));
                H[j * stride + i] = Pi;
                H[j * stride + nv + i] = Pi;
                H[(nv + j) * stride + nv + i] = Pi;
                H[(n + j) * stride + n + i] = Q[j * n + i] + P.qq(i, j);
            }
        }
        for j in 0..nv {
            let y = dt.mul_add(p[j], p[nv + j]);
            H[j * stride + all] = y;
            H[(nv + j) * stride + nv + j] += diagonal[j];
            H[(nv + j) * stride + all] = y + g[nv + j];
            H[(n + j) * stride + all] = p[j] + g[j];
        }
        // scales each row x of U and G to √a″ x, and its entry of the gradient to a′ / √a″, and copies U below H
        for (r, (row, x)) in rows.chunks_exact(width).zip(X.chunks_exact_mut(all + 1)).enumerate() {
            let (d, dd) = match r < nv {
                true => (g[n + r], diagonal[nv + r] + rho),
                false => (slopes[2 * (r - nv)], slopes[2 * (r - nv) + 1]),
            };
            let root = dd.sqrt();
            for i in 0..all {
                x[i] = row[i] * root;
            }
            x[all] = d / root;
        }
        for (j, column) in H.chunks_exact_mut(stride).enumerate() {
            for r in 0..nv {
                column[all + 1 + r] = rows[r * width + j];
            }
        }
        let X = &X[..(nv + costs) * (all + 1)];

        // eliminates w, several columns at a time
        let mut j = 0;
        while j < nv {
            let end = nv.min(j + COLUMNS);
            add_to_columns(H, size, j, end - j, X, j);
            for c in j..end {
                let (before, after) = H.split_at_mut((c + 1) * stride);
                let column = &mut before[c * stride..];
                fail_unless::<S>(S::zero().lt(column[c]), sums);
                let inverse = column[c].sqrt().recip();
                for i in c..stride {
                    column[i] = column[i] * inverse;
                }
                for (d, to) in after[..(end - c - 1) * stride].chunks_exact_mut(stride).enumerate() {
                    let factor = -column[c + 1 + d];
                    for i in c + 1 + d..stride {
                        to[i] = column[i].mul_add(factor, to[i]);
                    }
                }
            }
            j = end;
        }
        while j < all {
            let count = COLUMNS.min(all - j);
            add_to_columns(H, size, j, count, X, nv);
            j += count;
        }
        // writes k = −Y y and K, and adds yᵀy = kᵀQuu k to the sums
        k.fill(S::zero());
        for column in H[..nv * stride].chunks_exact(stride) {
            let y = column[all];
            sums[0] = y.mul_add(y, sums[0]);
            for i in 0..nv {
                k[i] = column[all + 1 + i].mul_add(-y, k[i]);
            }
        }
        for (j, K) in K.chunks_exact_mut(nv).enumerate() {
            let from = if j < nv { n + j } else { j };
            K.copy_from_slice(&H[from * stride + all + 1..][..nv]);
        }
        finish(H, size, stride, rho, p, sums);
    }
}
