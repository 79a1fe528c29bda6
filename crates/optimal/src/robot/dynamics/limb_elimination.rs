//! Elimination of unknowns from the equations of motion of several knots in contact, with one lane for each knot. The
//! limb of each contact is eliminated first, then the base.
//!
//! The module [`kkt_elimination`](super::kkt_elimination) describes the tableau. The rows of a contact have entries for
//! the base, for the limb, and for joints between base and limb. The joints of the limb move no other contact. Let B be
//! the block of the limb's joints. If B is square, the contact's rows are solved for these joints, which are then
//! eliminated from the equations of motion:
//!
//! ```text
//! Y = B⁻¹ J,     M_i ← M_i − M_il Y     for each row i with entries in the limb's columns l
//! ```
//!
//! Then the rows of the base are solved in the same way for forces. If there are not enough forces, accelerations are
//! used too. Without contacts, the rows of the base are solved for the accelerations of the base. The rows and columns
//! depend only on the robot and its contacts, so they are determined once; the columns of the base are determined at
//! one posture. The entries are computed for as many knots as a SIMD register has lanes. If B is close to singular at a
//! knot (a straight knee), this knot keeps its original equations, and the pivots of this knot are chosen one by one.
#![allow(non_snake_case)] // names follow the literature: B, J, M, T, Y

use super::kkt_elimination::{PREFERENCE, Tableau, own_coordinates};
use crate::robot::contact::path;
use condyle_dynamics::Model;
use condyle_spatial::{Matrix, Scalar, kernel, same_layout};
use core::ops::Range;
use std::sync::Arc;

/// Number of rows that are solved together: 3 for a point contact; 6 for a rigid contact and for a free base.
const SIZES: [usize; 2] = [3, 6];
const MOST: usize = SIZES[1];
/// Smallest accepted pivot for a base without contacts, relative to the row's largest entry. Without contacts, B is
/// positive definite, so a smaller pivot is a rounding error.
const DEFINITE: f64 = 1e-9;
/// Smallest accepted pivot for a base in contact, relative to the row's largest entry. The columns were chosen at
/// another posture. A smaller pivot would lose more digits than a pivot that is chosen at the knot itself.
const CHOSEN_ELSEWHERE: f64 = 1e-3;

/// Block of the tableau: a number of rows that are solved for the same number of columns.
#[derive(Clone, Debug, PartialEq)]
struct Block {
    /// Range of the block's rows in the tableau.
    rows: Range<usize>,
    /// Columns for which the rows are solved. They belong to coordinates or to forces.
    solved: Vec<usize>,
    /// Other columns in which the rows of the block have entries, as ranges.
    columns: Vec<Range<usize>>,
    /// Other rows that have entries in the solved columns.
    others: Vec<usize>,
    /// Columns over which the largest entry of a row is determined. They are solved columns and other columns.
    compared: Vec<usize>,
    /// Smallest accepted pivot of B, relative to the row's largest entry.
    least: f64,
}

/// Sparsity pattern of a tableau: the positions of its nonzero entries.
#[derive(Debug)]
struct Pattern {
    width: usize,
    has: Vec<bool>,
}

impl Pattern {
    /// Returns the pattern for a robot in contact, with or without damping. `moved_by` lists, for each contact row, the
    /// coordinates that move the contact.
    fn new(model: &Model, tableau: Tableau, moved_by: &[Vec<usize>], damped: bool) -> Self {
        let (Tableau { nv, rows }, coupled) = (tableau, coupled(model));
        let width = 3 * nv + rows;
        let mut pattern = Self { width, has: vec![false; (nv + rows) * width] };
        for (r, moved) in moved_by.iter().enumerate() {
            for &k in moved {
                for column in [k, nv + rows + k, 2 * nv + rows + k] {
                    pattern.has[r * width + column] = true; // J, c_v, c_q
                }
                pattern.has[(rows + k) * width + nv + r] = true; // −Jᵀ
            }
            pattern.has[r * width + nv + r] |= damped;
        }
        for (i, j) in (0..nv).flat_map(|i| (0..nv).map(move |j| (i, j))).filter(|(i, j)| coupled[i * nv + j]) {
            for column in [j, nv + rows + j, 2 * nv + rows + j] {
                pattern.has[(rows + i) * width + column] = true; // M, r_v, r_q
            }
        }
        pattern
    }

    /// Returns the block that solves `rows` for the columns `solved`. Also updates the pattern to the pattern after
    /// this elimination.
    fn solve(&mut self, rows: Range<usize>, solved: Vec<usize>, compared: Range<usize>, least: f64) -> Block {
        let Self { width, has } = self;
        let mut all = vec![false; *width];
        for row in has.chunks_exact(*width).skip(rows.start).take(rows.len()) {
            all.iter_mut().zip(row).for_each(|(all, has)| *all |= has);
        }
        solved.iter().for_each(|&k| all[k] = false);
        let mut others = Vec::new();
        for (i, row) in has.chunks_exact_mut(*width).enumerate() {
            let own = rows.contains(&i);
            if !own && !solved.iter().any(|&k| row[k]) {
                continue;
            }
            row.iter_mut().zip(&all).for_each(|(has, all)| *has |= all);
            solved.iter().for_each(|&k| row[k] = false);
            if own {
                row[solved[i - rows.start]] = true; // 1
            } else {
                others.push(i);
            }
        }
        let columns = runs((0..*width).filter(|&k| all[k]));
        let compared = compared.filter(|&k| all[k]).chain(solved.iter().copied()).collect();
        Block { rows, solved, columns, others, compared, least }
    }
}

/// Elimination: blocks of rows that are solved one after the other, with the positions of their entries in the tableau.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LimbElimination {
    blocks: Vec<Block>,
}

same_layout!(LimbElimination);

impl LimbElimination {
    /// Returns the eliminations of a robot whose first `passive` coordinates have no motor: first of the limbs, then of
    /// the base. The columns of the base are determined from the elimination of the limbs. An elimination without
    /// blocks is left out.
    pub(crate) fn new(
        model: &Model,
        passive: usize,
        moved_by: &[Vec<usize>],
        damped: bool,
        base: impl FnOnce(&Arc<Self>) -> Option<Vec<usize>>,
    ) -> Vec<Arc<Self>> {
        let (nv, rows) = (model.nv(), moved_by.len());
        let mut pattern = Pattern::new(model, Tableau { nv, rows }, moved_by, damped);
        let (mut limbs, mut first) = (Vec::new(), 0);
        while first < rows {
            let moved = &moved_by[first];
            let count = moved_by[first..].iter().take_while(|other| *other == moved).count();
            let twins = moved_by.iter().filter(|other| *other == moved).count();
            let solved = own_coordinates(moved_by, first, passive);
            if solved.len() == count && twins == count && SIZES.contains(&count) {
                limbs.push(pattern.solve(first..first + count, solved, 0..nv, PREFERENCE));
            }
            first += count;
        }
        let all = limbs.iter().map(|limb: &Block| limb.rows.len()).sum::<usize>() == rows;
        let limbs = Arc::new(Self { blocks: limbs });
        let base = if !all || !SIZES.contains(&passive) {
            None
        } else if rows == 0 {
            Some(((0..passive).collect(), 0..nv, DEFINITE))
        } else {
            base(&limbs).map(|solved| (solved, nv..nv + rows, CHOSEN_ELSEWHERE))
        };
        let base = base.map(|(solved, compared, least)| pattern.solve(rows..rows + passive, solved, compared, least));
        let base = Arc::new(Self { blocks: base.into_iter().collect() });
        [limbs, base].into_iter().filter(|elimination| !elimination.blocks.is_empty()).collect()
    }

    /// Returns the rows that this elimination solves, each with the column for which the row is solved.
    pub(crate) fn solved(&self) -> Vec<(usize, usize)> {
        self.blocks.iter().flat_map(|block| block.rows.clone().zip(block.solved.iter().copied())).collect()
    }

    /// Returns the number of entries of all inverses B⁻¹ together.
    pub(crate) fn room(&self) -> usize {
        self.blocks.iter().map(|block| block.rows.len() * block.rows.len()).sum()
    }

    /// Returns the number of entries of the largest matrix Y of a block.
    pub(crate) fn columns(&self) -> usize {
        let count = |block: &Block| block.columns.iter().map(ExactSizeIterator::len).sum::<usize>();
        self.blocks.iter().map(|block| block.rows.len() * count(block)).max().unwrap_or(0)
    }
}

/// Returns, for each pair of coordinates, whether both coordinates move a common body. M has a nonzero entry only for
/// such pairs. Shape: nv × nv.
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

/// Returns the ranges of consecutive numbers in an increasing list.
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
    /// Writes the rows [M · r_v r_q] of the equations of motion into a tableau, without the columns of forces (the
    /// dot). M is symmetric.
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
    /// Writes the rows [· μ1 c_v c_q] of the contacts into a tableau, without the columns of J (the dot).
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
    /// Writes the blocks J and −Jᵀ into a tableau.
    pub(crate) fn write_jacobian<S>(tableau: Tableau, J: &Matrix<S>, T: &mut [S]) {
        let (Tableau { nv, rows }, stride) = (tableau, tableau.stride());
        let (contacts, motion) = T.split_at_mut(rows * stride);
        for (r, row) in contacts.chunks_exact_mut(stride).enumerate() {
            copy_row(&mut row[..nv], J, r);
        }
        for i in 0..nv {
            let (row, column) = (&mut motion[i * stride + nv..][..rows], &J.as_slice()[i * rows..][..rows]);
            for r in 0..rows {
                row[r] = -column[r];
            }
        }
    }
}

/// Copies row i of the matrix `from` to `to`.
#[inline(always)]
fn copy_row<S: Scalar>(to: &mut [S], from: &Matrix<S>, i: usize) {
    let (rows, from) = (from.nrows(), from.as_slice());
    assert!(i < rows && to.len() * rows <= from.len(), "a row that does not exist");
    for k in 0..to.len() {
        to[k] = from[k * rows + i];
    }
}

kernel! {
    /// Computes B⁻¹ of each block by Gauss–Jordan elimination. The row exchanges may differ from knot to knot.
    /// `singular` is set to 1 in the lanes of knots with a pivot that is too small.
    pub(crate) fn invert_blocks<S>(
        elimination: &LimbElimination, tableau: Tableau, T: &[S], inverses: &mut [S], singular: &mut S,
    ) {
        let stride = tableau.stride();
        let mut rest = inverses;
        for Block { rows, solved, compared, least, .. } in &elimination.blocks {
            let n = rows.len();
            // initialises W = [D B, D], where the diagonal matrix D contains the scale factors of the rows
            let mut W = [[S::zero(); 2 * MOST]; MOST];
            for (k, r) in rows.clone().enumerate() {
                let row = &T[r * stride..][..stride];
                let mut largest = S::zero();
                for &c in compared {
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
                // a NaN counts as too small
                *singular = S::select(S::splat(*least).lt(W[k][k].abs()), *singular, S::one());
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
    /// Restores the tableau in the lanes of knots with a singular block.
    pub(crate) fn restore<S>(singular: S, before: &[S], T: &mut [S]) {
        let singular = S::zero().lt(singular);
        for (to, before) in T.iter_mut().zip(before) {
            *to = S::select(singular, *before, *to);
        }
    }
}

kernel! {
    /// Solves the rows of each block for the block's columns, and eliminates these columns from the other rows.
    pub(crate) fn solve_blocks<S>(
        elimination: &LimbElimination, tableau: Tableau, T: &mut [S], inverses: &[S], Y: &mut [S],
    ) {
        let mut rest = inverses;
        for block in &elimination.blocks {
            let n = block.rows.len();
            let (inverse, others) = rest.split_at(n * n);
            match n == MOST {
                true => solve::<S, 6>(block, tableau.stride(), T, inverse, Y),
                false => solve::<S, 3>(block, tableau.stride(), T, inverse, Y),
            }
            rest = others;
        }
    }
}

/// Solves the N rows of a block. Also stores Y column by column, for the elimination from the other rows.
#[inline(always)]
fn solve<S: Scalar, const N: usize>(block: &Block, stride: usize, T: &mut [S], inverse: &[S], Y: &mut [S]) {
    let Block { rows, solved, columns, others, .. } = block;
    let (before, rest) = T.split_at_mut(rows.start * stride);
    let (own, after) = rest.split_at_mut(N * stride);
    let Y = Y.as_chunks_mut::<N>().0;
    let mut at = 0;
    for run in columns {
        for c in run.start..run.end {
            let (mut x, y) = ([S::zero(); N], &mut Y[at]);
            for k in 0..N {
                x[k] = own[k * stride + c];
            }
            for i in 0..N {
                let mut sum = inverse[i * N] * x[0];
                for k in 1..N {
                    sum = inverse[i * N + k].mul_add(x[k], sum);
                }
                (own[i * stride + c], y[i]) = (sum, sum); // Y = B⁻¹ J
            }
            at += 1;
        }
    }
    for (i, row) in own.chunks_exact_mut(stride).enumerate() {
        for (k, &c) in solved.iter().enumerate() {
            row[c] = S::splat(if i == k { 1.0 } else { 0.0 });
        }
    }
    for &i in others {
        let row = match i < rows.start {
            true => &mut before[i * stride..][..stride],
            false => &mut after[(i - rows.end) * stride..][..stride],
        };
        let (mut g, mut Y) = ([S::zero(); N], &*Y);
        for k in 0..N {
            g[k] = -row[solved[k]];
        }
        for run in columns {
            let (some, rest) = Y.split_at(run.len());
            let row = &mut row[run.clone()];
            for j in 0..some.len() {
                let mut sum = row[j];
                for k in 0..N {
                    sum = g[k].mul_add(some[j][k], sum);
                }
                row[j] = sum; // M_i − M_il Y
            }
            Y = rest;
        }
        solved.iter().for_each(|&c| row[c] = S::zero());
    }
}

/// Returns the larger of x and |y|.
#[inline(always)]
fn larger<S: Scalar>(x: S, y: S) -> S {
    S::select(x.lt(y.abs()), y.abs(), x)
}
