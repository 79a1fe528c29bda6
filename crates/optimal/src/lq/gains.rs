//! Gains of knots in inverse-dynamics form, from the result of the elimination of their unknowns.
#![allow(non_snake_case)] // the names of the literature, and Y, U

use super::node::{LqKnot, LqNode};
use condyle_linalg::{SLACK, View, add_product_vector, copy_matrix, eliminate_rows, transpose};

/// Computation of gains, with its scratch. Its input is [L; X; yᵀ], the eliminated columns of the unknowns w, and the
/// controls δu = U (w, δx):
///
/// ```text
/// Y = U_w L⁻ᵀ,     K = U_x − Y Xᵀ,     k = −Y y
/// ```
///
/// No other knot needs the gains, so a sweep on several threads leaves them to idle threads.
#[derive(Debug, Clone)]
pub(crate) struct Gains {
    /// U over (w, δv, δq), and later [Y K], with padding rows.
    rows: Vec<f64>,
    /// [L; X; yᵀ] of a knot whose gains were deferred, with padding rows.
    left: Vec<f64>,
    /// Scratch of [`take_gains`].
    y: Vec<f64>,
}

impl Gains {
    /// Allocates the scratch for knots of n states and at most m controls.
    pub(super) fn new(n: usize, m: usize) -> Self {
        Self { rows: vec![0.0; (m + SLACK) * (m + n)], left: Vec::new(), y: vec![0.0; 2 * m + SLACK] }
    }

    /// Allocates the same scratch, with storage for deferred gains.
    pub(super) fn to_finish(n: usize, m: usize) -> Self {
        Self { left: vec![0.0; (m + n + 1 + SLACK) * m], ..Self::new(n, m) }
    }

    /// Writes the gains of a knot, from [L; X; yᵀ].
    pub(super) fn write(&mut self, left: View<'_>, node: &LqNode, knot: &mut LqKnot) {
        let (n, m, efforts) = (node.ndx(), node.nu(), &node.inverse_dynamics.efforts.numbers);
        let (Self { rows, y, .. }, ld, all) = (self, m + SLACK, m + n);
        transpose(rows, ld, View::new(efforts, node.inverse_dynamics.stride), [all, m]);
        eliminate_rows(rows, ld, [m, all, m], left);
        take_gains(View::new(rows, ld), left.at(all, 0), node, knot, y);
    }

    /// Stores [L; X; yᵀ] in the knot, for [`finish`](Self::finish).
    pub(super) fn put_off(left: View<'_>, node: &LqNode, knot: &mut LqKnot) {
        let (n, m) = (node.ndx(), node.nu());
        copy_matrix(knot.Quu.as_mut_slice(), m, left, [m, m]);
        copy_matrix(knot.K.as_mut_slice(), n, left.at(m, 0), [n, m]);
        copy_matrix(knot.Qu.as_mut_slice(), 1, left.at(m + n, 0), [1, m]);
    }

    /// Writes the gains of all knots whose gains were deferred.
    pub(crate) fn finish(&mut self, nodes: &[LqNode], knots: &mut [LqKnot]) {
        let mut left = core::mem::take(&mut self.left);
        for (node, knot) in nodes.iter().zip(knots).filter(|(_, knot)| knot.is_put_off) {
            let (n, m) = (node.ndx(), node.nu());
            let ld = m + n + 1 + SLACK;
            copy_matrix(&mut left, ld, View::new(knot.Quu.as_slice(), m), [m, m]);
            copy_matrix(&mut left[m..], ld, View::new(knot.K.as_slice(), n), [n, m]);
            copy_matrix(&mut left[m + n..], ld, View::new(knot.Qu.as_slice(), 1), [1, m]);
            self.write(View::new(&left, ld), node, knot);
            knot.is_put_off = false;
        }
        self.left = left;
    }
}

/// Computes K, and k = −Y y,   Quᵀk = −yᵀy = −kᵀQuu k, from rows [Y K] over (w, δv, δq) and yᵀ. The length of `scratch`
/// is twice the number of controls, plus padding.
pub(super) fn take_gains(rows: View<'_>, yt: View<'_>, node: &LqNode, knot: &mut LqKnot, scratch: &mut [f64]) {
    let (n, m) = (node.ndx(), node.nu());
    let (nv, K) = (n / 2, knot.K.as_mut_slice());
    copy_matrix(K, m, rows.at(0, m + nv), [m, nv]);
    copy_matrix(&mut K[nv * m..], m, rows.at(0, m), [m, nv]);
    let ((k, y), mut square) = (scratch.split_at_mut(m + SLACK), 0.0);
    k.fill(0.0);
    for j in 0..m {
        y[j] = -yt.data[j * yt.stride];
        square += y[j] * y[j];
    }
    add_product_vector(k, m, rows, &y[..m]);
    knot.k.as_mut_slice().copy_from_slice(&k[..m]);
    knot.expected = [-square, square];
}
