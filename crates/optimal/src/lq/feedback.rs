//! Result of a sweep at one knot, and the computation of gains if the eliminated unknowns are not the controls.
#![allow(non_snake_case)] // names follow the literature: K, Vxx, and Y, U

use super::knot::LqKnot;
use condyle_linalg::{Aligned, SLACK, View, add_product_vector, copy_matrix, eliminate_rows, padded, transpose};
use nalgebra::{DMatrix, DVector};

/// Result of a sweep at one knot: the feedback δu = k + K δx, and the value function V(δx) = ½ δxᵀ Vxx δx + Vxᵀ δx +
/// const of the rest of the horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct KnotFeedback {
    /// Feedback gain K = −Quu⁻¹ Qux, nu × ndx; its row is zero for a control at its bound.
    pub K: DMatrix<f64>,
    /// Feed-forward term k = −Quu⁻¹ Qu, nu; with bounds, the optimal δu at δx = 0.
    pub k: DVector<f64>,
    /// Gradient of the value function at δx = 0, ndx.
    pub Vx: DVector<f64>,
    /// Hessian of the value function, with the regularisation on its diagonal; ndx × ndx, symmetric.
    pub Vxx: DMatrix<f64>,
    /// Gradient r + Bᵀ(Vx⁺ + Vxx⁺ f) with respect to δu, nu; zero for a control at its bound.
    pub Qu: DVector<f64>,
    /// Hessian R + BᵀVxx⁺B with respect to δu, with the regularisation on its diagonal; nu × nu, symmetric.
    pub Quu: DMatrix<f64>,
    /// Expected change of the cost by a full step, [Quᵀk, kᵀQuu k]: the first entry is the first-order term, the second
    /// entry is twice the second-order term.
    pub expected: [f64; 2],
    /// Whether K, Qu and Quu store factors instead of results. [`Gains::finish`] computes K and k from these factors.
    pub(super) gains_deferred: bool,
    /// Product Vxx⁺ f of the next knot's Hessian Vxx⁺ and the gap f, ndx; zero without a gap.
    pub(crate) curved_gap: DVector<f64>,
    /// Factors for the forward pass, if the sweep was asked for them instead of gains.
    pub(crate) factors: Factors,
}

impl KnotFeedback {
    /// Creates a feedback of zeros for a knot with ndx states and nu controls.
    pub(crate) fn zeros(ndx: usize, nu: usize) -> Self {
        Self {
            K: DMatrix::zeros(nu, ndx),
            k: DVector::zeros(nu),
            Vx: DVector::zeros(ndx),
            Vxx: DMatrix::zeros(ndx, ndx),
            Qu: DVector::zeros(nu),
            Quu: DMatrix::zeros(nu, nu),
            expected: [0.0; 2],
            gains_deferred: false,
            curved_gap: DVector::zeros(ndx),
            factors: Factors::default(),
        }
    }
}

/// Columns [L; X; yᵀ] of the unknowns that a step eliminated, from which the forward pass computes the unknowns.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Factors {
    /// Columns, one after the other. Shape: (unknowns + ndx + 1) × unknowns.
    pub(crate) numbers: Vec<f64>,
    /// Rotation of the states in the rows X: row i belongs to state (i + turn) mod ndx.
    pub(crate) turn: usize,
}

impl Factors {
    /// Copies the columns of the m unknowns of a knot with n states. Allocates at the first call.
    pub(super) fn copy(&mut self, H: View<'_>, [m, n]: [usize; 2], turn: usize) {
        self.numbers.resize((m + n + 1) * m, 0.0);
        self.turn = turn;
        copy_matrix(&mut self.numbers, m + n + 1, H, [m + n + 1, m]);
    }
}

/// Computation of gains, with scratch. Its inputs are the matrix [L; X; yᵀ], which is the result of eliminating the
/// unknowns w, and the matrix U of the controls δu = U (w, δx):
///
/// ```text
/// Y = U_w L⁻ᵀ,     K = U_x − Y Xᵀ,     k = −Y y
/// ```
///
/// The steps of other knots do not need the gains. A sweep on several threads therefore defers the gains, and idle
/// threads compute them.
#[derive(Debug, Clone)]
pub(crate) struct Gains {
    /// Matrix U with columns for (w, δv, δq), overwritten by [Y K]; with padding rows.
    rows: Aligned,
    /// Matrix [L; X; yᵀ] of a knot whose gains were deferred, with padding rows.
    left: Vec<f64>,
    /// Scratch of [`take_gains`].
    y: Vec<f64>,
}

impl Gains {
    /// Allocates the scratch for knots of n states and at most m controls.
    pub(super) fn new(n: usize, m: usize) -> Self {
        Self { rows: Aligned::zeros(padded(m) * (m + n)), left: Vec::new(), y: vec![0.0; 2 * m + SLACK] }
    }

    /// Allocates the scratch of [`new`](Self::new), and the matrix for deferred gains.
    pub(super) fn to_finish(n: usize, m: usize) -> Self {
        Self { left: vec![0.0; (m + n + 1 + SLACK) * m], ..Self::new(n, m) }
    }

    /// Computes the gains of a knot from [L; X; yᵀ], and writes them to the feedback.
    pub(super) fn write(&mut self, left: View<'_>, knot: &LqKnot, feedback: &mut KnotFeedback) {
        let (n, m, efforts) = (knot.ndx(), knot.nu(), &knot.inverse_dynamics.efforts.numbers);
        let (Self { rows, y, .. }, ld, all) = (self, padded(m), m + n);
        transpose(rows, ld, View::new(efforts, knot.inverse_dynamics.stride), [all, m]);
        eliminate_rows(rows, ld, [m, all, m], left);
        take_gains(View::new(rows, ld), left.at(all, 0), knot, feedback, y);
    }

    /// Stores [L; X; yᵀ] in the feedback, from which [`finish`](Self::finish) computes the gains later.
    pub(super) fn defer(left: View<'_>, knot: &LqKnot, feedback: &mut KnotFeedback) {
        let (n, m) = (knot.ndx(), knot.nu());
        copy_matrix(feedback.Quu.as_mut_slice(), m, left, [m, m]);
        copy_matrix(feedback.K.as_mut_slice(), n, left.at(m, 0), [n, m]);
        copy_matrix(feedback.Qu.as_mut_slice(), 1, left.at(m + n, 0), [1, m]);
        feedback.gains_deferred = true;
    }

    /// Writes the gains of all knots whose gains were deferred.
    pub(crate) fn finish(&mut self, knots: &[LqKnot], feedback: &mut [KnotFeedback]) {
        let mut left = core::mem::take(&mut self.left);
        for (knot, feedback) in knots.iter().zip(feedback).filter(|(_, feedback)| feedback.gains_deferred) {
            let (n, m) = (knot.ndx(), knot.nu());
            let ld = m + n + 1 + SLACK;
            copy_matrix(&mut left, ld, View::new(feedback.Quu.as_slice(), m), [m, m]);
            copy_matrix(&mut left[m..], ld, View::new(feedback.K.as_slice(), n), [n, m]);
            copy_matrix(&mut left[m + n..], ld, View::new(feedback.Qu.as_slice(), 1), [1, m]);
            self.write(View::new(&left, ld), knot, feedback);
            feedback.gains_deferred = false;
        }
        self.left = left;
    }
}

/// Writes K, k = −Y y and Quᵀk = −yᵀy = −kᵀQuu k to the feedback, from the vector yᵀ and the matrix [Y K] with columns
/// for (w, δv, δq). The length of `scratch` is twice the number of controls, plus padding.
pub(super) fn take_gains(
    rows: View<'_>,
    yt: View<'_>,
    knot: &LqKnot,
    feedback: &mut KnotFeedback,
    scratch: &mut [f64],
) {
    let (n, m) = (knot.ndx(), knot.nu());
    let (nv, K) = (n / 2, feedback.K.as_mut_slice());
    copy_matrix(K, m, rows.at(0, m + nv), [m, nv]);
    copy_matrix(&mut K[nv * m..], m, rows.at(0, m), [m, nv]);
    let ((k, y), mut square) = (scratch.split_at_mut(m + SLACK), 0.0);
    k.fill(0.0);
    for j in 0..m {
        y[j] = -yt.data[j * yt.stride];
        square += y[j] * y[j];
    }
    add_product_vector(k, m, rows, &y[..m]);
    feedback.k.as_mut_slice().copy_from_slice(&k[..m]);
    feedback.expected = [-square, square];
}
