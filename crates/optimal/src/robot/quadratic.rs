//! How residuals' gradients and Gauss–Newton Hessians come into a node: the rows of their Jacobians are collected, and
//! each entry of Q, S and R is then written once, as the sum of their outer products.
#![allow(non_snake_case)] // the names of the literature

use crate::dense::{SLACK, tile_rows};
use crate::lq::LqNode;
use crate::vector::{Dense, Vector, at_level};
use core::ops::Range;

/// q += d and Q += diag(dd) on some entries, for a residual whose Jacobian is the identity there.
#[inline(always)]
pub(super) fn add_diagonal(q: &mut [f64], Q: &mut [f64], entries: Range<usize>, d: &[f64], dd: &[f64]) {
    let n = q.len();
    for i in entries {
        q[i] += d[i];
        Q[i * n + i] += dd[i];
    }
}

/// Some rows of Jacobians, each with the derivatives a′ and a″ of its activation.
#[derive(Clone, Debug)]
struct List {
    /// How many numbers a row has, and how far it is to the next one.
    width: usize,
    stride: usize,
    count: usize,
    rows: Vec<f64>,
    /// a′ and a″.
    slopes: Vec<[f64; 2]>,
}

impl List {
    fn new(width: usize, most: usize) -> Self {
        let stride = width + SLACK;
        Self { width, stride, count: 0, rows: vec![0.0; most * stride], slopes: vec![[0.0; 2]; most] }
    }

    fn push(&mut self, d: f64, dd: f64) -> &mut [f64] {
        self.slopes[self.count] = [d, dd];
        self.count += 1;
        let row = &mut self.rows[(self.count - 1) * self.stride..][..self.width];
        row.fill(0.0);
        row
    }
}

/// The rows of all residuals of a knot.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    nv: usize,
    /// With respect to (q, v, u).
    whole: List,
    /// With respect to q, of residuals that depend on nothing else.
    positions: List,
    /// The rows times √|a″|, those of `whole` before those of `positions`, and the same with the sign of a″. Shape: as
    /// many rows of the stride of `whole`.
    left: Vec<f64>,
    right: Vec<f64>,
}

impl Rows {
    /// Room for so many rows with respect to (q, v, u), and to q alone, of a robot with nv coordinates and nu controls.
    pub(super) fn new(nv: usize, nu: usize, [whole, positions]: [usize; 2]) -> Self {
        let whole = List::new(2 * nv + nu, whole);
        let positions = List::new(nv, positions);
        let most = (whole.slopes.len() + positions.slopes.len()).max(1);
        let scaled = vec![0.0; most * whole.stride];
        Self { nv, whole, positions, left: scaled.clone(), right: scaled }
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) {
        (self.whole.count, self.positions.count) = (0, 0);
    }

    /// A row of zeros with respect to (q, v, u), to be written.
    pub(super) fn push(&mut self, d: f64, dd: f64) -> &mut [f64] {
        self.whole.push(d, dd)
    }

    /// The rows of a Jacobian with respect to q that has entries in some columns alone; J has at least as many rows.
    pub(super) fn push_positions(&mut self, J: &[f64], height: usize, columns: &[usize], d: &[f64], dd: &[f64]) {
        for i in 0..d.len() {
            let row = self.positions.push(d[i], dd[i]);
            for &c in columns {
                row[c] = J[c * height + i];
            }
        }
    }

    /// Writes q, r, Q, S and R: q = Gᵀ a′ and so on, for G of all rows.
    pub(super) fn write(&mut self, node: &mut LqNode) {
        node.q.as_mut_slice().fill(0.0);
        node.r.as_mut_slice().fill(0.0);
        at_level(Write { rows: self, node });
    }
}

struct Write<'a> {
    rows: &'a mut Rows,
    node: &'a mut LqNode,
}

impl Dense for Write<'_> {
    #[inline(always)]
    fn run<V: Vector, const NR: usize>(self) {
        let Self { rows: Rows { nv, whole, positions, left, right }, node } = self;
        let (nv, n, m, stride) = (*nv, 2 * *nv, node.r.len(), whole.stride);
        for (list, first) in [(&*whole, 0), (&*positions, whole.count)] {
            for k in 0..list.count {
                let [d, dd] = list.slopes[k];
                let row = &list.rows[k * list.stride..][..list.stride];
                let (x, u) = row[..list.width].split_at(n.min(list.width));
                add_multiple(node.q.as_mut_slice(), x, d);
                add_multiple(node.r.as_mut_slice(), u, d);
                let scale = dd.abs().sqrt();
                let at = (first + k) * stride..(first + k) * stride + list.stride;
                let (left, right) = (&mut left[at.clone()], &mut right[at]);
                for i in 0..list.stride {
                    left[i] = row[i] * scale;
                    right[i] = if dd < 0.0 { -left[i] } else { left[i] };
                }
            }
        }
        let (some, all) = (whole.count, whole.count + positions.count);
        let Q = node.Q.as_mut_slice();
        let products = [left.as_slice(), right.as_slice()];
        if some == 0 {
            Q.fill(0.0);
            node.S.as_mut_slice().fill(0.0);
            node.R.as_mut_slice().fill(0.0);
        } else {
            outer::<V, NR>(Q, n, [nv..n, 0..nv], [0, 0], products, stride, some);
            outer::<V, NR>(Q, n, [0..n, nv..n], [0, 0], products, stride, some);
            outer::<V, NR>(node.S.as_mut_slice(), n, [0..n, 0..m], [0, n], products, stride, some);
            outer::<V, NR>(node.R.as_mut_slice(), m, [0..m, 0..m], [n, n], products, stride, some);
        }
        if all > 0 {
            outer::<V, NR>(Q, n, [0..nv, 0..nv], [0, 0], products, stride, all);
        }
    }
}

/// y += a x on the entries of x.
#[inline(always)]
fn add_multiple(y: &mut [f64], x: &[f64], a: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// C = Σ left right ᵀ over the first `length` rows of both, for some rows and columns of C, whose entries in the rows of
/// `left` and `right` stand `shift` after their own number. The sums are the same on both sides of the diagonal.
#[inline(always)]
fn outer<V: Vector, const NR: usize>(
    C: &mut [f64],
    ldc: usize,
    [rows, columns]: [Range<usize>; 2],
    shift: [usize; 2],
    [left, right]: [&[f64]; 2],
    stride: usize,
    length: usize,
) {
    let (left, right) = (&left[shift[0]..], &right[shift[1]..]);
    let mut j = columns.start;
    while j < columns.end {
        let width = NR.min(columns.end - j);
        let mut i = rows.start;
        while i < rows.end {
            if rows.end - i >= 2 * V::N {
                let tile = tile_rows::<V, 2, NR>(left, stride, i, right, stride, j, length);
                for jj in 0..NR {
                    if jj < width {
                        let to = &mut C[(j + jj) * ldc + i..][..2 * V::N];
                        tile[jj][0].store(to);
                        tile[jj][1].store(&mut to[V::N..]);
                    }
                }
                i += 2 * V::N;
                continue;
            }
            if rows.len() >= V::N {
                i = i.min(rows.end - V::N); // the last strip overlaps the one before
            }
            let tile = tile_rows::<V, 1, NR>(left, stride, i, right, stride, j, length);
            for jj in 0..NR {
                if jj < width {
                    let to = &mut C[(j + jj) * ldc + i..];
                    if rows.len() >= V::N {
                        tile[jj][0].store(to);
                        continue;
                    }
                    let mut numbers = [0.0; SLACK];
                    tile[jj][0].store(&mut numbers);
                    for k in 0..V::N {
                        if k < rows.len() {
                            to[k] = numbers[k]; // one by one: no function call
                        }
                    }
                }
            }
            i += V::N;
        }
        j += NR;
    }
}
