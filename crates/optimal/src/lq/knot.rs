//! Knots of a linear-quadratic problem.
#![allow(non_snake_case)] // names follow the literature: A, B, Q, …

use super::rows::ConstraintRows;
use super::structure::{DynamicsStructure, EulerBlock, InverseDynamicsForm, LARGEST_BLOCK};
use crate::error::assert_length;
use core::fmt;
use nalgebra::{DMatrix, DVector};

/// Absolute value above which a number has diverged. The sweep or trial is then abandoned.
pub(crate) const DIVERGED: f64 = 1e30;

/// Knot of a linear-quadratic problem. The variables are the changes δx (ndx) of the state and δu (nu) of the controls:
///
/// ```text
/// minimise   Σₜ ½ δxᵀQδx + δxᵀSδu + ½ δuᵀRδu + qᵀδx + rᵀδu    subject to   δx⁺ = A δx + B δu + f
/// ```
///
/// with lower ≤ δu ≤ upper, and with the constraints in `rows`. Q and R are symmetric, with both triangles filled. At
/// the terminal knot (nu = 0) only Q, q and `rows` are read.
#[derive(Clone, PartialEq)]
pub struct LqKnot {
    /// Jacobian ∂x⁺/∂x of the dynamics, ndx × ndx.
    pub A: DMatrix<f64>,
    /// Jacobian ∂x⁺/∂u of the dynamics, ndx × nu.
    pub B: DMatrix<f64>,
    /// Gap, ndx: the predicted next state minus (⊖) the next state of the trajectory. Written by the solver.
    pub f: DVector<f64>,
    /// Hessian ∂²ℓ/∂x² of the cost, ndx × ndx.
    pub Q: DMatrix<f64>,
    /// Hessian ∂²ℓ/∂x∂u of the cost, ndx × nu.
    pub S: DMatrix<f64>,
    /// Hessian ∂²ℓ/∂u² of the cost, nu × nu.
    pub R: DMatrix<f64>,
    /// Gradient ∂ℓ/∂x of the cost, ndx.
    pub q: DVector<f64>,
    /// Gradient ∂ℓ/∂u of the cost, nu.
    pub r: DVector<f64>,
    /// Lower bound of δu, nu; −∞ for none. Written by the solver.
    pub lower: DVector<f64>,
    /// Upper bound of δu, nu; ∞ for none. Written by the solver.
    pub upper: DVector<f64>,
    /// General constraints on δx and δu; empty unless the action writes them. A [`Sweep`](crate::Sweep) does not ignore
    /// them: it returns [`SweepError::ConstraintRows`](crate::SweepError::ConstraintRows) for a knot with rows. A
    /// solver panics.
    pub rows: ConstraintRows,
    /// Structure of A and B, if the action has set it.
    pub structure: DynamicsStructure,
    /// Equations of inverse dynamics. They replace A, B, S, R and part of Q if both the solver and the action support
    /// this.
    pub(crate) inverse_dynamics: InverseDynamicsForm,
}

/// Formats the public fields, without the scratch of the sweep.
impl fmt::Debug for LqKnot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { A, B, f: gap, Q, S, R, q, r, lower, upper, rows, structure, .. } = self;
        let mut shown = f.debug_struct("LqKnot");
        shown.field("A", A).field("B", B).field("f", gap).field("Q", Q).field("S", S).field("R", R);
        shown.field("q", q).field("r", r).field("lower", lower).field("upper", upper).field("rows", rows);
        shown.field("structure", structure);
        shown.finish_non_exhaustive()
    }
}

impl LqKnot {
    /// Maximum number of states, and of controls. It limits the size of a knot's matrices.
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
            rows: ConstraintRows::default(),
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

    /// Returns the number of bytes that a sweep reads from the knot. A knot in inverse-dynamics form has U, D, G and
    /// the block of Q for δq instead of A, B, S, R and Q.
    pub(crate) fn bytes(&self) -> usize {
        let vectors = self.q.len() + self.f.len() + self.r.len();
        let form = &self.inverse_dynamics;
        let numbers = match self.structure.is_inverse_dynamics() {
            true => {
                let rows = form.efforts.numbers.len() + form.steps.numbers.len() + form.costs.numbers.len();
                rows + 2 * form.slopes.len() + form.diagonal.len() + (self.ndx() / 2) * (self.ndx() / 2)
            }
            false => self.A.len() + self.B.len() + self.Q.len() + self.S.len() + self.R.len(),
        };
        (vectors + numbers) * size_of::<f64>()
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
        self.rows.assert_columns(ndx + nu);
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

/// Second derivatives of a function ψ(δx, δu) of one knot; see
/// [`dynamics_hessian`](crate::ActionModel::dynamics_hessian).
#[derive(Debug, Clone, PartialEq)]
pub struct Hessian {
    /// Second derivatives ∂²ψ/∂x², ndx × ndx, symmetric.
    pub xx: DMatrix<f64>,
    /// Second derivatives ∂²ψ/∂x∂u, ndx × nu.
    pub xu: DMatrix<f64>,
    /// Second derivatives ∂²ψ/∂u², nu × nu, symmetric.
    pub uu: DMatrix<f64>,
}

impl Hessian {
    /// Creates a Hessian of zeros for ndx states and nu controls.
    #[track_caller]
    pub fn zeros(ndx: usize, nu: usize) -> Self {
        Self { xx: DMatrix::zeros(ndx, ndx), xu: DMatrix::zeros(ndx, nu), uu: DMatrix::zeros(nu, nu) }
    }

    /// Sets all entries to x.
    pub fn fill(&mut self, x: f64) {
        [&mut self.xx, &mut self.xu, &mut self.uu].into_iter().for_each(|part| part.fill(x));
    }
}
