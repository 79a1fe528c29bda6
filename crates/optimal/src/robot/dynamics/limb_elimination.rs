//! The equations of several knots in contact, solved side by side for what each contact's own limb does.
//!
//! In the tableau of [`kkt_elimination`](super::kkt_elimination) the rows of a contact hold the base, what stands between it
//! and the limb, and the limb, whose joints move no other contact. Where these are as many as the rows, with B their block,
//! the rows are solved for them, and they go out of the equations of motion:
//!
//! ```text
//! Y = B⁻¹ J,     M_i ← M_i − M_il Y     for each row i of the equations that the limb is in
//! ```
//!
//! Which rows and columns these are depends on the robot and its contacts only, so it is found once; the numbers are worked
//! on for as many knots as a vector has lanes. A robot that touches nothing is solved for its base's accelerations in the
//! same way. Where B is close to singular in some knot (a straight knee), that knot keeps the equations as they were, and
//! its pivots are chosen one by one.
#![allow(non_snake_case)] // B, J, M, T, Y

use super::kkt_elimination::{PREFERENCE, Tableau, own_coordinates};
use crate::robot::contact::path;
use condyle_dynamics::Model;
use condyle_spatial::{Matrix, Scalar, alike, kernel};
use core::ops::Range;

/// How many rows are solved together: those of a point and of a sole, or of a base that moves freely.
const SIZES: [usize; 2] = [3, 6];
const MOST: usize = SIZES[1];
/// B of a base is positive definite: a pivot so much smaller than its row's largest entry is rounding.
const DEFINITE: f64 = 1e-9;

/// Some rows of the tableau that are solved for as many coordinates.
#[derive(Clone, Debug, PartialEq)]
struct Limb {
    /// The rows.
    rows: Range<usize>,
    /// The coordinates.
    solved: Vec<usize>,
    /// The other columns in which the rows have entries, in runs.
    columns: Vec<Range<usize>>,
    /// The other rows in which the coordinates have entries.
    others: Vec<usize>,
    /// The least pivot of B, over the row's largest entry.
    least: f64,
}

/// The limbs of a robot in contact, and where their entries are.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LimbElimination {
    limbs: Vec<Limb>,
}

alike!(LimbElimination);

impl LimbElimination {
    /// The limbs of a robot whose first `passive` coordinates are not driven, for contacts whose rows are moved by some
    /// coordinates each, with damping or without.
    pub(crate) fn new(model: &Model, passive: usize, moved_by: &[Vec<usize>], damped: bool) -> Self {
        let (nv, rows) = (model.nv(), moved_by.len());
        let coupled = coupled(model);
        // M's rows that a set of coordinates has entries in
        let in_motion = |solved: &[usize], but: &Range<usize>| -> Vec<usize> {
            let rows = (0..nv).filter(|&i| solved.iter().any(|&j| coupled[i * nv + j])).map(|i| rows + i);
            rows.filter(|row| !but.contains(row)).collect()
        };
        let mut limbs = Vec::new();
        if rows == 0 && SIZES.contains(&passive) {
            let (base, solved) = (0..passive, (0..passive).collect::<Vec<_>>());
            let others = in_motion(&solved, &base);
            limbs.push(Limb { columns: runs(passive..3 * nv), others, rows: base, solved, least: DEFINITE });
        }
        let mut first = 0;
        while first < rows {
            let moved = &moved_by[first];
            let count = moved_by[first..].iter().take_while(|other| *other == moved).count();
            let twins = moved_by.iter().filter(|other| *other == moved).count();
            let solved = own_coordinates(moved_by, first, passive);
            if solved.len() == count && twins == count && SIZES.contains(&count) {
                let range = first..first + count;
                let held = moved.iter().copied().filter(|k| !solved.contains(k));
                let forces = range.clone().filter(|_| damped).map(|r| nv + r);
                let states = moved.iter().map(|k| nv + rows + k).chain(moved.iter().map(|k| 2 * nv + rows + k));
                let columns = runs(held.chain(forces).chain(states));
                let others = in_motion(&solved, &range);
                limbs.push(Limb { rows: range, solved, columns, others, least: PREFERENCE });
            }
            first += count;
        }
        Self { limbs }
    }

    /// The column that each row of a tableau was solved for, if it was.
    pub(crate) fn solved(&self) -> impl Iterator<Item = (usize, usize)> {
        self.limbs.iter().flat_map(|limb| limb.rows.clone().zip(limb.solved.iter().copied()))
    }

    /// Room for the inverses B⁻¹.
    pub(crate) fn room(&self) -> usize {
        self.limbs.iter().map(|limb| limb.rows.len() * limb.rows.len()).sum()
    }
}

/// Whether two coordinates move one body, so that M has an entry for them. Shape: nv × nv.
fn coupled(model: &Model) -> Vec<bool> {
    let nv = model.nv();
    let mut coupled = vec![false; nv * nv];
    for body in 1..model.bodies().len() {
        let path = path(model, body);
        for &i in &path {
            path.iter().for_each(|&j| coupled[i * nv + j] = true);
        }
    }
    coupled
}

/// Runs of numbers that ascend.
fn runs(columns: impl IntoIterator<Item = usize>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for k in columns {
        match runs.last_mut() {
            Some(last) if last.end == k => last.end += 1,
            _ => runs.push(k..k + 1),
        }
    }
    runs
}

kernel! {
    /// Writes the rows of the equations of motion, [M · r_v r_q], into a tableau; M is symmetric.
    pub(crate) fn write_motion<S>(
        tableau: Tableau, M: &Matrix<S>, dtau_dv: &Matrix<S>, dtau_dq: &Matrix<S>, T: &mut [S],
    ) {
        let (Tableau { nv, rows }, stride) = (tableau, tableau.stride());
        for (i, row) in T[rows * stride..].chunks_exact_mut(stride).enumerate() {
            row[..nv].copy_from_slice(&M.as_slice()[i * nv..][..nv]);
            copy_row(&mut row[nv + rows..][..nv], dtau_dv, i);
            copy_row(&mut row[2 * nv + rows..][..nv], dtau_dq, i);
        }
    }
}

kernel! {
    /// Writes the rows of the contacts but for J, [· μ1 c_v c_q], into a tableau.
    pub(crate) fn write_drift<S>(
        tableau: Tableau, dgamma_dv: &Matrix<S>, dgamma_dq: &Matrix<S>, mu: f64, T: &mut [S],
    ) {
        let (Tableau { nv, rows }, stride) = (tableau, tableau.stride());
        for (r, row) in T[..rows * stride].chunks_exact_mut(stride).enumerate() {
            row[nv..][..rows].fill(S::zero());
            row[nv + r] = S::splat(mu);
            copy_row(&mut row[nv + rows..][..nv], dgamma_dv, r);
            copy_row(&mut row[2 * nv + rows..][..nv], dgamma_dq, r);
        }
    }
}

kernel! {
    /// Writes J and −Jᵀ into a tableau.
    pub(crate) fn write_jacobian<S>(tableau: Tableau, J: &Matrix<S>, T: &mut [S]) {
        let (Tableau { nv, rows }, stride) = (tableau, tableau.stride());
        let (contacts, motion) = T.split_at_mut(rows * stride);
        for (r, row) in contacts.chunks_exact_mut(stride).enumerate() {
            copy_row(&mut row[..nv], J, r);
        }
        for (row, column) in motion.chunks_exact_mut(stride).zip(J.as_slice().chunks_exact(rows.max(1))) {
            for (to, from) in row[nv..][..rows].iter_mut().zip(column) {
                *to = -*from;
            }
        }
    }
}

/// Copies row i of a matrix.
#[inline(always)]
fn copy_row<S: Scalar>(to: &mut [S], from: &Matrix<S>, i: usize) {
    for (to, column) in to.iter_mut().zip(from.as_slice().chunks_exact(from.nrows())) {
        *to = column[i];
    }
}

kernel! {
    /// Computes each limb's B⁻¹, by Gauss and Jordan with the rows exchanged in each knot as it needs; `regular` is 1 for
    /// the knots of which all pivots are large enough, 0 for the others.
    pub(crate) fn invert_limbs<S>(
        elimination: &LimbElimination, tableau: Tableau, T: &[S], inverses: &mut [S], regular: &mut S,
    ) {
        let (nv, stride) = (tableau.nv, tableau.stride());
        *regular = S::one();
        let mut rest = inverses;
        for Limb { rows, solved, columns, least, .. } in &elimination.limbs {
            let n = rows.len();
            // [B D], with the rows scaled by D
            let mut W = [[S::zero(); 2 * MOST]; MOST];
            for (k, r) in rows.clone().enumerate() {
                let row = &T[r * stride..][..nv];
                let mut largest = S::zero();
                for &c in solved {
                    largest = larger(largest, row[c]);
                }
                for c in columns.iter().flat_map(Range::clone).take_while(|c| *c < nv) {
                    largest = larger(largest, row[c]);
                }
                let scale = largest.recip();
                for (i, &c) in solved.iter().enumerate() {
                    W[k][i] = row[c] * scale;
                }
                W[k][n + k] = scale;
            }
            for k in 0..n {
                for i in k + 1..n {
                    let exchange = W[k][k].abs().lt(W[i][k].abs());
                    for j in k..2 * n {
                        let (upper, lower) = (W[k][j], W[i][j]);
                        W[k][j] = S::select(exchange, lower, upper);
                        W[i][j] = S::select(exchange, upper, lower);
                    }
                }
                // a NaN is not large enough
                *regular = S::select(S::splat(*least).lt(W[k][k].abs()), *regular, S::zero());
                let inverse = W[k][k].recip();
                for j in k + 1..2 * n {
                    W[k][j] = W[k][j] * inverse;
                }
                for i in 0..n {
                    if i != k {
                        let factor = -W[i][k];
                        for j in k + 1..2 * n {
                            W[i][j] = W[k][j].mul_add(factor, W[i][j]);
                        }
                    }
                }
            }
            let (inverse, others) = rest.split_at_mut(n * n);
            for (to, row) in inverse.chunks_exact_mut(n).zip(&W) {
                to.copy_from_slice(&row[n..2 * n]);
            }
            rest = others;
        }
    }
}

kernel! {
    /// Restores the tableau of the knots that are not regular.
    pub(crate) fn restore<S>(regular: S, before: &[S], T: &mut [S]) {
        let keep = S::zero().lt(regular);
        for (to, before) in T.iter_mut().zip(before) {
            *to = S::select(keep, *to, *before);
        }
    }
}

kernel! {
    /// Solves the rows of each limb for its coordinates, and puts these into the equations of motion.
    pub(crate) fn solve_limbs<S>(elimination: &LimbElimination, tableau: Tableau, T: &mut [S], inverses: &[S]) {
        let mut rest = inverses;
        for limb in &elimination.limbs {
            let n = limb.rows.len();
            let (inverse, others) = rest.split_at(n * n);
            match n == MOST {
                true => solve::<S, 6>(limb, tableau.stride(), T, inverse),
                false => solve::<S, 3>(limb, tableau.stride(), T, inverse),
            }
            rest = others;
        }
    }
}

/// Solves N rows.
#[inline(always)]
fn solve<S: Scalar, const N: usize>(limb: &Limb, stride: usize, T: &mut [S], inverse: &[S]) {
    let Limb { rows, solved, columns, others, .. } = limb;
    let (before, rest) = T.split_at_mut(rows.start * stride);
    let (own, after) = rest.split_at_mut(N * stride);
    for run in columns {
        for c in run.clone() {
            let x: [S; N] = core::array::from_fn(|k| own[k * stride + c]);
            for i in 0..N {
                let mut sum = inverse[i * N] * x[0];
                for k in 1..N {
                    sum = inverse[i * N + k].mul_add(x[k], sum);
                }
                own[i * stride + c] = sum;
            }
        }
    }
    for (i, row) in own.chunks_exact_mut(stride).enumerate() {
        for (k, &c) in solved.iter().enumerate() {
            row[c] = S::splat(if i == k { 1.0 } else { 0.0 });
        }
    }
    let Y: [&[S]; N] = core::array::from_fn(|k| &own[k * stride..][..stride]);
    for &i in others {
        let row = match i < rows.start {
            true => &mut before[i * stride..][..stride],
            false => &mut after[(i - rows.end) * stride..][..stride],
        };
        let g: [S; N] = core::array::from_fn(|k| -row[solved[k]]);
        for run in columns {
            let x = &mut row[run.clone()];
            let y: [&[S]; N] = core::array::from_fn(|k| &Y[k][run.clone()][..x.len()]); // so no entry need be checked
            for (j, x) in x.iter_mut().enumerate() {
                let mut sum = *x;
                for k in 0..N {
                    sum = g[k].mul_add(y[k][j], sum);
                }
                *x = sum;
            }
        }
        solved.iter().for_each(|&c| row[c] = S::zero());
    }
}

/// The larger of x and |y|.
#[inline(always)]
fn larger<S: Scalar>(x: S, y: S) -> S {
    S::select(x.lt(y.abs()), y.abs(), x)
}
