//! Knots of a linear-quadratic problem, and the results of a sweep at them.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use super::inverse_dynamics_form::InverseDynamicsForm;
use super::structure::{DynamicsStructure, EulerBlock, LARGEST_BLOCK};
use crate::error::assert_length;
use core::fmt;
use nalgebra::{DMatrix, DVector};

/// Absolute value beyond which a number has diverged; the sweep or trial is then abandoned.
pub(crate) const DIVERGED: f64 = 1e30;

/// Knot of a linear-quadratic problem in the changes δx (ndx), δu (nu):
///
/// ```text
/// minimise   Σₜ ½ δxᵀQδx + δxᵀSδu + ½ δuᵀRδu + qᵀδx + rᵀδu    subject to   δx⁺ = A δx + B δu + f
/// ```
///
/// with lower ≤ δu ≤ upper. Q and R are symmetric, with both triangles filled. At the terminal knot (nu = 0) only Q and
/// q are read.
#[derive(Clone, PartialEq)]
pub struct LqKnot {
    /// ∂x⁺/∂x, ndx × ndx.
    pub A: DMatrix<f64>,
    /// ∂x⁺/∂u, ndx × nu.
    pub B: DMatrix<f64>,
    /// Gap: the predicted next state ⊖ the next state of the trajectory, ndx. Written by the solver.
    pub f: DVector<f64>,
    /// ∂²ℓ/∂x², ndx × ndx.
    pub Q: DMatrix<f64>,
    /// ∂²ℓ/∂x∂u, ndx × nu.
    pub S: DMatrix<f64>,
    /// ∂²ℓ/∂u², nu × nu.
    pub R: DMatrix<f64>,
    /// ∂ℓ/∂x, ndx.
    pub q: DVector<f64>,
    /// ∂ℓ/∂u, nu.
    pub r: DVector<f64>,
    /// Lower bound of δu, nu; −∞ for none. Written by the solver.
    pub lower: DVector<f64>,
    /// Upper bound of δu, nu; ∞ for none. Written by the solver.
    pub upper: DVector<f64>,
    /// Structure of A and B, as far as it is known.
    pub structure: DynamicsStructure,
    /// Equations of inverse dynamics, which replace A, B, S, R and part of Q if solver and action support them.
    pub(crate) inverse_dynamics: InverseDynamicsForm,
}

/// Formats the fields that a user writes, without the scratch of the sweep.
impl fmt::Debug for LqKnot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { A, B, f: gap, Q, S, R, q, r, lower, upper, structure, .. } = self;
        let mut shown = f.debug_struct("LqKnot");
        shown.field("A", A).field("B", B).field("f", gap).field("Q", Q).field("S", S).field("R", R);
        shown.field("q", q).field("r", r).field("lower", lower).field("upper", upper).field("structure", structure);
        shown.finish_non_exhaustive()
    }
}

impl LqKnot {
    /// Maximum number of states, and of controls: it bounds the size of a knot's matrices.
    pub const MOST_SIZE: usize = 4096;

    /// Creates a knot of zeros with ndx states and nu controls without bounds.
    ///
    /// # Panics
    /// If ndx or nu is above [`MOST_SIZE`](Self::MOST_SIZE).
    #[track_caller]
    pub fn zeros(ndx: usize, nu: usize) -> Self {
        let most = Self::MOST_SIZE;
        assert!(ndx <= most && nu <= most, "expected at most {most} states and controls, found {ndx} and {nu}");
        Self {
            A: DMatrix::zeros(ndx, ndx),
            B: DMatrix::zeros(ndx, nu),
            f: DVector::zeros(ndx),
            Q: DMatrix::zeros(ndx, ndx),
            S: DMatrix::zeros(ndx, nu),
            R: DMatrix::zeros(nu, nu),
            q: DVector::zeros(ndx),
            r: DVector::zeros(nu),
            lower: DVector::from_element(nu, f64::NEG_INFINITY),
            upper: DVector::from_element(nu, f64::INFINITY),
            structure: DynamicsStructure::default(),
            inverse_dynamics: InverseDynamicsForm::default(),
        }
    }

    /// Returns the number of states, ndx.
    pub fn ndx(&self) -> usize {
        self.q.len()
    }

    /// Returns the number of controls, nu.
    pub fn nu(&self) -> usize {
        self.r.len()
    }

    /// Returns whether a control has a bound.
    pub(crate) fn is_bounded(&self) -> bool {
        self.lower.iter().chain(&self.upper).any(|bound| bound.is_finite())
    }

    /// Panics with the name of the first field whose shape does not fit q and r.
    #[track_caller]
    pub(crate) fn assert_shapes(&self, ndx: usize, nu: usize) {
        assert_length("q", self.q.len(), ndx);
        assert_length("r", self.r.len(), nu);
        assert_length("f", self.f.len(), ndx);
        assert_length("lower", self.lower.len(), nu);
        assert_length("upper", self.upper.len(), nu);
        if let Some((_, blocks)) = self.structure.euler() {
            assert!(ndx.is_multiple_of(2), "`structure` is that of x = (q, v), but ndx is {ndx}");
            let inside = |block: &EulerBlock| block.range().end <= ndx / 2 && block.range().len() <= LARGEST_BLOCK;
            assert!(blocks.iter().all(inside), "a block of `structure` has more than 6 rows or leaves those of q");
        }
        assert_shape("A", &self.A, (ndx, ndx));
        assert_shape("B", &self.B, (ndx, nu));
        assert_shape("Q", &self.Q, (ndx, ndx));
        assert_shape("S", &self.S, (ndx, nu));
        assert_shape("R", &self.R, (nu, nu));
    }
}

#[inline]
#[track_caller]
fn assert_shape(name: &str, matrix: &DMatrix<f64>, shape: (usize, usize)) {
    assert!(matrix.shape() == shape, "`{name}` has shape {:?}, expected {shape:?}", matrix.shape());
}

/// Result of a sweep at one knot: the feedback δu = k + K δx, and the value function V(δx) = ½ δxᵀ Vxx δx + Vxᵀ δx +
/// const of the rest of the horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct KnotFeedback {
    /// Feedback gain −Quu⁻¹ Qux, nu × ndx; zero for a control at its bound.
    pub K: DMatrix<f64>,
    /// Feed-forward −Quu⁻¹ Qu, nu; with bounds, the optimal δu at δx = 0.
    pub k: DVector<f64>,
    /// Gradient of the value function at δx = 0, ndx.
    pub Vx: DVector<f64>,
    /// Hessian of the value function, with the regularisation on its diagonal; ndx × ndx, symmetric.
    pub Vxx: DMatrix<f64>,
    /// r + Bᵀ(Vx⁺ + Vxx⁺ f), nu; zero for a control at its bound.
    pub Qu: DVector<f64>,
    /// R + BᵀVxx⁺B with the regularisation on its diagonal; nu × nu, symmetric.
    pub Quu: DMatrix<f64>,
    /// Quᵀk and kᵀQuu k: the change of the cost that a full step is expected to make, to first order and (twice) to
    /// second order.
    pub expected: [f64; 2],
    /// Whether K, Qu and Quu store the data from which K and k are computed later: see [`Gains`](super::gains::Gains).
    pub(super) is_put_off: bool,
}

impl KnotFeedback {
    /// Creates a knot of zeros with ndx states and nu controls.
    pub(crate) fn zeros(ndx: usize, nu: usize) -> Self {
        Self {
            K: DMatrix::zeros(nu, ndx),
            k: DVector::zeros(nu),
            Vx: DVector::zeros(ndx),
            Vxx: DMatrix::zeros(ndx, ndx),
            Qu: DVector::zeros(nu),
            Quu: DMatrix::zeros(nu, nu),
            expected: [0.0; 2],
            is_put_off: false,
        }
    }
}

/// Second derivatives of a function ψ(δx, δu) of one knot; see
/// [`dynamics_hessian`](crate::ActionModel::dynamics_hessian).
#[derive(Debug, Clone, PartialEq)]
pub struct Hessian {
    /// ∂²ψ/∂x², ndx × ndx, symmetric.
    pub xx: DMatrix<f64>,
    /// ∂²ψ/∂x∂u, ndx × nu.
    pub xu: DMatrix<f64>,
    /// ∂²ψ/∂u², nu × nu, symmetric.
    pub uu: DMatrix<f64>,
}

impl Hessian {
    /// Creates zeros for ndx states and nu controls.
    #[track_caller]
    pub fn zeros(ndx: usize, nu: usize) -> Self {
        Self { xx: DMatrix::zeros(ndx, ndx), xu: DMatrix::zeros(ndx, nu), uu: DMatrix::zeros(nu, nu) }
    }

    /// Sets all entries to x.
    pub fn fill(&mut self, x: f64) {
        [&mut self.xx, &mut self.xu, &mut self.uu].into_iter().for_each(|part| part.fill(x));
    }
}
