//! Step of the Riccati recursion for several problems, one in each lane.
//!
//! The step has the form of [`driven`](super::forms): a small arm in which every coordinate has a motor, given as
//! equations of inverse dynamics. H is stored column after column, with columns for (w, δv, δq). Below the rows of its
//! quadratic form are the row of the gradient and the rows of √weight U, which become the gains:
//!
//! ```text
//!     ⎡ Π  ·  ·   ⎤                                                     ⎡ L  ·    ⎤
//! H = ⎢ Π  Π  ·   ⎥ + cost + Σ x xᵀ over the rows x of √weight (U, G)  →  ⎢ X  Vxx  ⎥
//!     ⎢ Nᵀ Nᵀ P₁₁ ⎥                                                     ⎢ yᵀ Vxᵀ  ⎥
//!     ⎣ gᵀ        ⎦                                                     ⎣ Y  K    ⎦
//!       √weight U
//! ```
//!
//! The value function of the next knot is read from the H of its step. All loops run over whole vectors of lanes, so
//! the result in a lane does not depend on the other lanes.
#![allow(non_snake_case)] // names follow the literature: H, K, L, P, Q, U, X, Y

use super::forms::DRIVEN_MOST;
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
    /// Whether some problem has a gap f that is not zero.
    pub(super) gaps: bool,
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
        let Self { nv, costs, width, .. } = self;
        [2, 3 * nv, 2 * nv, 2 * nv, 2 * nv * nv, 2 * costs, (nv + costs) * width]
    }

    /// Returns the numbers of entries of a step's results, which follow one another: k, K and P f.
    pub(super) fn results(self) -> [usize; 3] {
        [self.nv, 2 * self.nv * self.nv, 2 * self.nv]
    }
}

/// Sums over the steps of a sweep.
pub(super) const SUMS: usize = 4;

/// Value function ½ δxᵀP δx + pᵀδx in an H, whose states are in the order (v, q). The blocks of P for δv and for δq
/// have both triangles.
#[derive(Clone, Copy)]
struct Value<'a, S> {
    H: &'a [S],
    nv: usize,
    stride: usize,
}

impl<'a, S: Scalar> Value<'a, S> {
    /// Returns column j of the block of P for δq.
    #[inline(always)]
    fn qq(&self, j: usize) -> &'a [S] {
        &self.H[(2 * self.nv + j) * self.stride + 2 * self.nv..][..self.nv]
    }

    /// Returns column j of the block of P for δv.
    #[inline(always)]
    fn vv(&self, j: usize) -> &'a [S] {
        &self.H[(self.nv + j) * self.stride + self.nv..][..self.nv]
    }

    /// Returns column j of the block of P with the rows of δq and the columns of δv.
    #[inline(always)]
    fn qv(&self, j: usize) -> &'a [S] {
        &self.H[(self.nv + j) * self.stride + 2 * self.nv..][..self.nv]
    }

    /// Computes P f, adds pᵀf and fᵀP f to the sums, and then P f to p.
    #[inline(always)]
    fn move_by(&self, f: &[S], p: &mut [S], Pf: &mut [S], sums: &mut [S]) {
        let (by_q, by_v) = f.split_at(self.nv);
        Pf.fill(S::zero());
        let (Pf_q, Pf_v) = Pf.split_at_mut(self.nv);
        for j in 0..self.nv {
            let (qq, vv, qv) = (self.qq(j), self.vv(j), self.qv(j));
            let mut sum = Pf_v[j];
            for i in 0..self.nv {
                Pf_q[i] = qv[i].mul_add(by_v[j], qq[i].mul_add(by_q[j], Pf_q[i]));
                sum = vv[i].mul_add(by_v[i], qv[i].mul_add(by_q[i], sum));
            }
            Pf_v[j] = sum;
        }
        for i in 0..2 * self.nv {
            sums[1] = f[i].mul_add(p[i], sums[1]);
            sums[2] = f[i].mul_add(Pf[i], sums[2]);
            p[i] += Pf[i];
        }
    }
}

/// Adds ϱ to the diagonal of Vxx in H, and copies Vx to p in the order (q, v). Also fills the upper triangles of the
/// blocks of Vxx, and marks the lanes that have diverged.
#[inline(always)]
fn finish<S: Scalar>(H: &mut [S], StepSize { nv, .. }: StepSize, stride: usize, rho: S, p: &mut [S], sums: &mut [S]) {
    let all = 3 * nv;
    let mut squares = [S::zero(); ROWS];
    for j in nv..all {
        let column = &mut H[j * stride..][..all + 1];
        column[j] += rho;
        for x in column[j..].chunks(ROWS) {
            for (square, x) in squares.iter_mut().zip(x) {
                *square = x.mul_add(*x, *square);
            }
        }
    }
    for j in 0..nv {
        p[j] = H[(2 * nv + j) * stride + all];
        p[nv + j] = H[(nv + j) * stride + all];
        for i in j + 1..nv {
            H[(nv + i) * stride + nv + j] = H[(nv + j) * stride + nv + i];
            H[(2 * nv + i) * stride + 2 * nv + j] = H[(2 * nv + j) * stride + 2 * nv + i];
        }
    }
    let squares = (squares[0] + squares[1]) + (squares[2] + squares[3]);
    fail_unless::<S>(squares.lt(S::splat(DIVERGED * DIVERGED)), sums); // false for NaN
}

/// Marks the lanes in which `holds` is false as failed.
#[inline(always)]
fn fail_unless<S: Scalar>(holds: S::Mask, sums: &mut [S]) {
    sums[3] = S::select(holds, sums[3], S::one());
}

/// Returns R rows and C columns of H, from row i and column j on: S + Σ x xᵀ − Σ h hᵀ, where S is `start`, x are the
/// rows of X, and h are the first `done` columns of H.
#[inline(always)]
fn tile<S: Scalar, const R: usize, const C: usize>(
    start: [[S; R]; C],
    (H, stride): (&[S], usize),
    [i, j]: [usize; 2],
    (X, width): (&[S], usize),
    done: usize,
) -> [[S; R]; C] {
    let mut sums = start;
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
    sums
}

/// Computes a tile of H, from row i and column j on. A tile of the quadratic form starts from H and adds the rows of X.
/// A tile of the gains, which begin at row `form`, starts from the first rows of X.
#[inline(always)]
fn add_tile<S: Scalar, const R: usize, const C: usize>(
    H: &mut [S],
    (stride, form): (usize, usize),
    [i, j]: [usize; 2],
    (X, width): (&[S], usize),
    done: usize,
) {
    let mut start = [[S::zero(); R]; C];
    if i < form {
        for c in 0..C {
            start[c].copy_from_slice(&H[(j + c) * stride + i..][..R]);
        }
    } else {
        for r in 0..R {
            let x = &X[(i - form + r) * width + j..][..C];
            for c in 0..C {
                start[c][r] = x[c];
            }
        }
    }
    let X = if i < form { X } else { &[] };
    let sums = tile::<S, R, C>(start, (H, stride), [i, j], (X, width), done);
    for c in 0..C {
        H[(j + c) * stride + i..][..R].copy_from_slice(&sums[c]);
    }
}

/// Computes the tiles of C columns from column j on: the rows of the quadratic form from row j on, and of the gains.
#[inline(always)]
fn add_columns<S: Scalar, const C: usize>(H: &mut [S], size: StepSize, j: usize, X: &[S], done: usize) {
    let (places, X) = ((size.stride(), size.all() + 1), (X, size.width));
    for [from, to] in [[j, places.1], [places.1, places.0]] {
        let mut i = from;
        while i + ROWS <= to {
            add_tile::<S, ROWS, C>(H, places, [i, j], X, done);
            i += ROWS;
        }
        match to - i {
            1 => add_tile::<S, 1, C>(H, places, [i, j], X, done),
            2 => add_tile::<S, 2, C>(H, places, [i, j], X, done),
            3 => add_tile::<S, 3, C>(H, places, [i, j], X, done),
            _ => {}
        }
    }
}

/// Computes `count` columns from column j on, at most [`COLUMNS`].
#[inline(always)]
fn add_to_columns<S: Scalar>(H: &mut [S], size: StepSize, j: usize, count: usize, X: &[S], done: usize) {
    match count {
        1 => add_columns::<S, 1>(H, size, j, X, done),
        2 => add_columns::<S, 2>(H, size, j, X, done),
        _ => add_columns::<S, COLUMNS>(H, size, j, X, done),
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
    /// Makes one step. Reads the value function from `next` and p, and writes it to H and p. Multiplies the rows of U
    /// and G in `knot` by the roots of their weights; the gains are divided by them.
    pub(super) fn step<S>(
        size: StepSize, knot: &mut [S], next: &[S], p: &mut [S], H: &mut [S], results: &mut [S], sums: &mut [S],
    ) {
        let (StepSize { nv, width, .. }, stride, all) = (size, size.stride(), size.all());
        let n = 2 * nv;
        let [times, gradients, diagonals, gaps, blocks, slopes, _] = size.parts();
        let (numbers, X) = knot.split_at_mut(times + gradients + diagonals + gaps + blocks + slopes);
        let (times, rest) = numbers.split_at(times);
        let (g, rest) = rest.split_at(gradients);
        let (diagonal, rest) = rest.split_at(diagonals);
        let (f, rest) = rest.split_at(gaps);
        let (Q, slopes) = rest.split_at(blocks);
        let (dt, rho) = (times[0], times[1]);
        let (k, rest) = results.split_at_mut(nv);
        let (K, Pf) = rest.split_at_mut(n * nv);

        let P = Value { H: next, nv, stride };
        match size.gaps {
            true => P.move_by(f, p, Pf, sums),
            false => {
                Pf.fill(S::zero());
                for p in p.iter_mut() {
                    *p += S::zero(); // as if P f = 0 was added: a zero has the same sign
                }
            }
        }
        // writes Nᵀ = Δt P₁₁ + P₁₂, Π = Δt (Nᵀ + P₂₁) + P₂₂, and Q + P₁₁ in the block of δq
        for j in 0..nv {
            let (qq, vv, qv) = (P.qq(j), P.vv(j), P.qv(j));
            let (by_w, rest) = H[j * stride..].split_at_mut(nv * stride);
            let (by_v, by_q) = rest.split_at_mut(nv * stride);
            let N = &mut by_w[n..][..nv];
            for i in 0..nv {
                N[i] = dt.mul_add(qq[i], qv[i]);
                by_v[n + i] = N[i];
                by_q[n + i] = Q[j * n + i] + qq[i];
            }
            for i in j..nv {
                let Pi = dt.mul_add(N[i] + P.qv(i)[j], vv[i]);
                by_v[nv + i] = Pi;
            }
            by_w[..nv].copy_from_slice(&by_v[nv..n]); // above the diagonal, these numbers have no meaning
        }
        for j in 0..nv {
            for i in 0..nv {
                let (row, column) = (i.max(j), i.min(j));
                H[j * stride + nv + i] = H[(nv + column) * stride + nv + row];
            }
        }
        for j in 0..nv {
            let y = dt.mul_add(p[j], p[nv + j]);
            H[j * stride + all] = y;
            H[(nv + j) * stride + nv + j] += diagonal[j];
            H[(nv + j) * stride + all] = y + g[nv + j];
            H[(n + j) * stride + all] = p[j] + g[j];
        }
        // scales each row x of U and G to √a″ x, and its entry of the gradient to a′ / √a″
        let mut inverses = [S::zero(); DRIVEN_MOST];
        for (r, x) in X.chunks_exact_mut(width).enumerate() {
            let (d, dd) = match r < nv {
                true => (g[n + r], diagonal[nv + r] + rho),
                false => (slopes[2 * (r - nv)], slopes[2 * (r - nv) + 1]),
            };
            let root = dd.sqrt();
            let inverse = root.recip();
            for x in &mut x[..all] {
                *x = *x * root;
            }
            x[all] = d * inverse;
            if r < nv {
                inverses[r] = inverse;
            }
        }
        let (X, inverses) = (&*X, &inverses[..nv]);

        // eliminates w, several columns at a time
        let mut j = 0;
        while j < nv {
            let end = nv.min(j + COLUMNS);
            add_to_columns(H, size, j, end - j, X, j);
            for c in j..end {
                let (before, after) = H.split_at_mut((c + 1) * stride);
                let column = &mut before[c * stride..][..stride];
                fail_unless::<S>(S::zero().lt(column[c]), sums);
                let inverse = column[c].sqrt().recip();
                for x in &mut column[c..] {
                    *x = *x * inverse;
                }
                for (d, to) in after[..(end - c - 1) * stride].chunks_exact_mut(stride).enumerate() {
                    let first = c + 1 + d;
                    let factor = -column[first];
                    for (to, x) in to[first..].iter_mut().zip(&column[first..]) {
                        *to = x.mul_add(factor, *to);
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
            let column = &H[from * stride + all + 1..][..nv];
            for i in 0..nv {
                K[i] = column[i] * inverses[i];
            }
        }
        for i in 0..nv {
            k[i] = k[i] * inverses[i];
        }
        finish(H, size, stride, rho, p, sums);
    }
}
