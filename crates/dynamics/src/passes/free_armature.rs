//! Armature of free joints: an apparent mass without weight, in the axes of the joint's parent.
//!
//! The armature a along the linear coordinates of a free joint resists the acceleration of the body's origin, as in
//! MuJoCo. This acceleration is in the axes of the parent (for a floating base, the world's). In the body's axes, which
//! v and ω use, it is v̇ + ω × v. The kinetic energy T = ½ a vᵀ v of this mass gives
//!
//! ```text
//! τ_v = a (v̇ + ω × v)     ∂τ_v/∂v = a ω×     ∂τ_v/∂ω = −a v×
//! ```
//!
//! The first term is on the diagonal of M together with all other armature. This file adds the second term, the bias.
//! It depends only on the joint's velocity and does no work: v · (ω × v) = 0. Its matrix a ω× is skew, as required by Ṁ
//! = C + Cᵀ for a constant M. Armature of the angular coordinates gives a ω̇ without a bias.
//!
//! A model lists these joints ([`free_armature`](Model::free_armature)). If the list is empty, nothing is computed
//! here. The model checks that the three numbers a are equal. Each row still uses its own number, so that recorded code
//! can take them as arguments.

use condyle_model::Model;
use condyle_spatial::{Constant, Scalar, Vec3, kernel};

/// Returns three consecutive numbers as a vector.
#[inline(always)]
fn three<S: Scalar>(x: &[S], first: usize) -> Vec3<S> {
    Vec3::new(x[first], x[first + 1], x[first + 2])
}

/// Multiplies each component of a vector with its armature.
#[inline(always)]
fn times<S: Scalar, R: Constant<S>>(model: &Model<R>, first: usize, x: Vec3<S>) -> Vec3<S> {
    let a = model.armature();
    Vec3::new(a[first].lift() * x.x, a[first + 1].lift() * x.y, a[first + 2].lift() * x.z)
}

/// Returns a (ω × v) of the free joint whose first coordinate is `first`.
#[inline(always)]
fn bias<S: Scalar, R: Constant<S>>(model: &Model<R>, first: usize, qd: &[S]) -> [S; 3] {
    times(model, first, three(qd, first + 3).cross(three(qd, first))).to_array() // a (ω × v)
}

/// Adds the bias a (ω × v) to the efforts of all free joints with armature.
#[doc(hidden)]
#[inline(always)]
pub fn add_armature_bias<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], tau: &mut [S]) {
    for &first in model.free_armature() {
        let bias = bias(model, first, qd);
        for k in 0..3 {
            tau[first + k] += bias[k];
        }
    }
}

/// Subtracts the bias from the efforts. The remaining efforts accelerate the joint.
#[doc(hidden)]
#[inline(always)]
pub fn subtract_armature_bias<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], tau: &mut [S]) {
    for &first in model.free_armature() {
        let bias = bias(model, first, qd);
        for k in 0..3 {
            tau[first + k] -= bias[k];
        }
    }
}

/// Multiplies the rows of a 3-row matrix with their armature, and adds its columns to a block of an nv × nv matrix,
/// stored by columns.
#[inline(always)]
fn add_block<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    first: usize,
    column: usize,
    skew: [Vec3<S>; 3],
    matrix: &mut [S],
) {
    for (k, x) in skew.into_iter().enumerate() {
        let (x, at) = (times(model, first, x).to_array(), (column + k) * model.nv() + first);
        for r in 0..3 {
            matrix[at + r] += x[r];
        }
    }
}

/// Adds ∂τ/∂v of the bias to an nv × nv matrix, stored by columns.
#[inline(always)]
pub(crate) fn add_slope<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], dtau_dv: &mut [S]) {
    for &first in model.free_armature() {
        let (v, w) = (three(qd, first), three(qd, first + 3));
        add_block(model, first, first, w.skew().columns(), dtau_dv); // ∂τ_v/∂v = a ω×
        add_block(model, first, first + 3, (-v).skew().columns(), dtau_dv); // ∂τ_v/∂ω = −a v×
    }
}

/// Adds the bias to the Coriolis matrix, nv × nv, stored by columns: a ω× in the rows and columns of v.
#[inline(always)]
pub(crate) fn add_coriolis<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], C: &mut [S]) {
    for &first in model.free_armature() {
        add_block(model, first, first, three(qd, first + 3).skew().columns(), C);
    }
}

/// Adds ∂²(λᵀ τ)/∂v∂v of the bias to an nv × nv matrix, stored by columns. With μ = a λ_v, λᵀ τ = μ · (ω × v), so that
/// ∂²/∂v∂ω = μ× and ∂²/∂ω∂v = −μ×.
#[inline(always)]
pub(crate) fn add_curvature<S: Scalar, R: Constant<S>>(model: &Model<R>, lambda: &[S], dvdv: &mut [S]) {
    let nv = model.nv();
    for &first in model.free_armature() {
        let mu = times(model, first, three(lambda, first)).skew().columns();
        for (k, x) in mu.into_iter().enumerate() {
            let x = x.to_array();
            for r in 0..3 {
                dvdv[(first + 3 + k) * nv + first + r] += x[r]; // ∂²/∂v∂ω
                dvdv[(first + k) * nv + first + 3 + r] -= x[r]; // ∂²/∂ω∂v
            }
        }
    }
}

kernel! {
    /// Computes the efforts without the bias.
    pub(crate) fn without_bias<S, R>(model: &Model<R>, v: &[S], tau: &[S], effort: &mut [S]) {
        effort.copy_from_slice(tau);
        subtract_armature_bias(model, v, effort);
    }
}
