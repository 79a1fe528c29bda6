//! Selection of algorithms: every threshold of this crate, with the measurement on which it is based.
//!
//! Choices that depend only on the model and the scalar are made when [`Data`](crate::Data) is created (`Methods`). The
//! schedule of limbs is planned when the model of a robot with limbs is built (`condyle_model::limbs`).

use crate::passes::factored_dynamics::ForwardDynamicsMethod;
use condyle_model::Model;
use condyle_model::limbs::Plan;
use condyle_model::tree::Column;
use condyle_spatial::gate::{FusedF64, Level, is, level};
use condyle_spatial::{Scalar, same_layout};

/// Maximum mean number of entries per row of the sparse factor of the inertia matrix M. If the mean is larger, M⁻¹ is
/// not computed from the factor. Measured by `benches/factorisation.rs`: on a chain of 24 joints, with a mean of 12.5,
/// M⁻¹ takes equally long with and without the factor. The mean is 9.7 for the humanoid and 4 for the arm.
const SHORT_ROWS: usize = 12;

/// Minimum mean length of the paths from the joint columns to the root at which products −M⁻¹ B are computed by
/// recursions over the articulated bodies. If the mean is smaller, −M⁻¹ B is computed as a matrix product. Measured by
/// `benches/peers/dynamics.py` on chains.
const LONG_WAY: usize = 24;

/// Mean length of the paths from the columns to the root. Above this length, the derivatives ∂τ of inverse dynamics are
/// computed for four columns at a time instead of one pair of columns at a time. Measured by
/// `benches/peers/dynamics.py`.
const LONG_SUPPORT: usize = 4;

/// Selected method of each function that has several methods, for one model and one type of scalar.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Methods {
    pub inverse: InverseMethod,
    pub aba_derivatives: AbaDerivativesMethod,
}

impl Methods {
    /// Selects the methods. The factor of M has `nonzeros` entries.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>, nonzeros: usize) -> Self {
        let inverse = InverseMethod::fastest(model, nonzeros);
        Self { inverse, aba_derivatives: AbaDerivativesMethod::fastest::<S, R>(model, inverse) }
    }
}

/// Method by which M⁻¹ is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InverseMethod {
    /// Gauss–Jordan elimination of M, for short chains.
    GaussJordan,
    /// Sparse factor of M. If limbs are computed in parallel lanes, the factors of the articulated bodies are used
    /// instead.
    SparseFactor,
    /// Factors of the articulated bodies, without M.
    ArticulatedBodies,
}

same_layout!(InverseMethod);

impl InverseMethod {
    fn fastest<R>(model: &Model<R>, nonzeros: usize) -> Self {
        if is_short_chain(model) {
            Self::GaussJordan
        } else if inverse_by_factor(model, nonzeros) {
            Self::SparseFactor
        } else {
            Self::ArticulatedBodies
        }
    }
}

/// Method by which the derivatives ∂q̈ = −M⁻¹ ∂τ are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AbaDerivativesMethod {
    /// Product of M⁻¹ and the derivatives ∂τ of inverse dynamics, after both matrices are computed with the limbs in
    /// parallel lanes. Calls that cannot use lanes use `Product` instead.
    Limbs,
    /// Product of M⁻¹ and the derivatives ∂τ of inverse dynamics, after both matrices are computed body by body.
    Product,
    /// Computation of the derivatives ∂τ of inverse dynamics body by body, and of −M⁻¹ ∂τ by recursions over the
    /// articulated bodies.
    TreeSolve,
}

impl AbaDerivativesMethod {
    fn fastest<S: 'static, R>(model: &Model<R>, inverse: InverseMethod) -> Self {
        if solve_by_tree(model.columns(), model.nv()) {
            Self::TreeSolve
        } else if inverse != InverseMethod::ArticulatedBodies && limbs::<S, R>(model).is_some() && !model.has_mimic() {
            Self::Limbs
        } else {
            Self::Product
        }
    }
}

/// Returns the plan of a robot's limbs if calls for a single state with this scalar compute the limbs in parallel
/// lanes.
pub(crate) fn limbs<S: 'static, R>(model: &Model<R>) -> Option<&Plan> {
    model.limbs().filter(|_| is::<S, f64>() && level() > Level::Baseline)
}

/// Returns whether M⁻¹ is computed from the sparse factor of M. The factor has `nonzeros` entries. Joints that share
/// coordinates always use the factor.
pub fn inverse_by_factor<R>(model: &Model<R>, nonzeros: usize) -> bool {
    model.has_mimic() || nonzeros <= SHORT_ROWS * model.nv()
}

/// Maximum nv of a chain whose M is inverted by Gauss–Jordan elimination. Up to this size, a column of M fits in
/// registers and loops are unrolled. For an arm with 7 joints, the sparse factor needs five times as many instructions.
pub const SHORT_CHAIN: usize = 8;

/// Returns whether a robot is a chain of at most [`SHORT_CHAIN`] coordinates. The inertia matrix M of a chain has no
/// zeros, so no sparse factor of M is needed.
pub fn is_short_chain<R>(model: &Model<R>) -> bool {
    let chain = model.columns().iter().enumerate().all(|(k, column)| column.depth == k);
    chain && !model.has_mimic() && model.nv() <= SHORT_CHAIN
}

/// Returns whether products −M⁻¹ B are computed by recursions over the articulated bodies. The result is false if
/// joints share coordinates.
pub(crate) fn solve_by_tree(columns: &[Column], nv: usize) -> bool {
    let depths: usize = columns.iter().map(|c| c.depth).sum();
    columns.len() == nv && depths >= LONG_WAY * nv
}

/// Returns whether the derivatives ∂τ of inverse dynamics are computed four columns at a time. The result is true only
/// for single states and only if the processor has vectors of four numbers.
#[inline(always)]
pub(crate) fn pairs_by_rows<S: Scalar, R>(model: &Model<R>) -> bool {
    is::<S, FusedF64>() && !model.has_mimic() && model.support_len() > LONG_SUPPORT * model.columns().len()
}

/// Returns the fastest method of forward dynamics: ABA, unless joints share a coordinate. The recursion of ABA does not
/// support such joints.
///
/// Measured by `benches/factorisation.rs` on the embedded robots, and on chains, binary trees and stars of 6 to 200
/// joints. Methods with a factor of M are never faster than ABA, because they must compute the bias efforts h and the
/// inertia matrix M. This computation alone takes nearly as long as ABA on an arm with 7 joints, and up to 3 times as
/// long on the other robots. `docs/performance.md` has the table.
pub(crate) fn forward_dynamics<R>(model: &Model<R>) -> ForwardDynamicsMethod {
    if model.has_mimic() { ForwardDynamicsMethod::Sparse } else { ForwardDynamicsMethod::ArticulatedBody }
}
