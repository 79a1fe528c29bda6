//! Which algorithm when: every threshold of this crate, with the measurement behind it.
//!
//! Choices that depend on the model alone are made when [`Data`](crate::Data) is made. How the limbs of a robot are
//! scheduled, and whether they are, is decided when its model is built (`condyle_model::limbs`).

use crate::passes::factored_dynamics::ForwardDynamicsMethod;
use condyle_model::Model;
use condyle_model::tree::Column;
use condyle_spatial::Scalar;
use condyle_spatial::gate::{Fused, is};

/// The length that the rows of the factor of M may have, in the mean, for M⁻¹ to come from the factor. Measured by
/// `benches/factorisation.rs`: equal at 12.5 on a chain of 24; the humanoid has 9.7, the arm 4.
const SHORT_ROWS: usize = 12;

/// The length that the way to the root must have, in the mean, for −M⁻¹ B to be solved by the articulated bodies instead of
/// being multiplied out. Measured by `benches/peers/dynamics.py` on chains.
const LONG_WAY: usize = 24;

/// The length that the way to the root must have, in the mean, for ∂τ to be computed four columns at a time instead of pair
/// by pair. Measured by `benches/peers/dynamics.py`.
const LONG_SUPPORT: usize = 4;

/// Whether M⁻¹ comes from the factor of M, of which there are `nonzeros` entries. It is the only way for joints that share
/// coordinates.
pub fn inverse_by_factor<R>(model: &Model<R>, nonzeros: usize) -> bool {
    model.has_mimic() || nonzeros <= SHORT_ROWS * model.nv()
}

/// The most coordinates of an arm whose M is inverted without a factor: so many entries of a column are registers, and loops over them
/// are none. The sparse factor of an arm of seven takes five times the instructions.
pub const SHORT_CHAIN: usize = 8;

/// Whether a robot is a chain of few coordinates. Its M has no zeros, and M⁻¹ comes from M without a factor.
pub fn is_short_chain<R>(model: &Model<R>) -> bool {
    let chain = model.columns().iter().enumerate().all(|(k, column)| column.depth == k);
    chain && !model.has_mimic() && model.nv() <= SHORT_CHAIN
}

/// Whether −M⁻¹ B is solved by the articulated bodies. Joints must not share coordinates.
pub(crate) fn solve_by_tree(columns: &[Column], nv: usize) -> bool {
    let depths: usize = columns.iter().map(|c| c.depth).sum();
    columns.len() == nv && depths >= LONG_WAY * nv
}

/// Whether ∂τ is computed four columns at a time: of single states, where there are vectors of four.
#[inline(always)]
pub(crate) fn pairs_by_rows<S: Scalar, R>(model: &Model<R>) -> bool {
    is::<S, Fused>() && !model.has_mimic() && model.support_len() > LONG_SUPPORT * model.columns().len()
}

/// Returns the fastest method of forward dynamics: ABA, unless joints share a coordinate, for which ABA's recursion does not close.
///
/// Measured by `benches/factorisation.rs` on the embedded robots, and on chains, binary trees and stars of 6 to 200 joints. A factor
/// of M never wins: h and M together take nearly as long as ABA on an arm of 7 and up to 3 times as long on the others.
/// `docs/performance.md` has the table.
pub(crate) fn forward_dynamics<R>(model: &Model<R>) -> ForwardDynamicsMethod {
    if model.has_mimic() { ForwardDynamicsMethod::Sparse } else { ForwardDynamicsMethod::ArticulatedBody }
}
