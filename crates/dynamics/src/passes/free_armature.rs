//! Armature of free joints. It acts like a mass without weight, along the axes of the joint's parent.
//!
//! The armature a along the linear coordinates of a free joint resists the acceleration of the body's origin, as in
//! MuJoCo. MuJoCo expresses this acceleration along the axes of the parent (for a floating base, the axes of the
//! world). The velocities v and ω of the joint are expressed in the axes of the body. In these axes, the acceleration
//! of the origin is v̇ + ω × v. With the kinetic energy T = ½ a vᵀ v of the armature, the efforts are
//!
//! ```text
//! τ_v = a (v̇ + ω × v)     ∂τ_v/∂v = a ω×     ∂τ_v/∂ω = −a v×
//! ```
//!
//! The diagonal of M contains the first term, a v̇, together with all other armature. This file adds the second term,
//! the bias a (ω × v). The bias depends only on the joint's velocity and does no work: v · (ω × v) = 0. The matrix a ω×
//! of the bias is skew-symmetric, as Ṁ = C + Cᵀ requires for a constant M. Armature of the angular coordinates gives a
//! ω̇ without a bias.
//!
//! [`Model::free_armature`] lists the free joints with armature. If the list is empty, the functions of this file
//! compute nothing. The model checks that the three armatures a of a joint are equal. Nevertheless, each row uses its
//! own armature, because code that was recorded from these functions may take the three armatures as separate
//! arguments.

use condyle_model::Model;
use condyle_spatial::{Constant, Scalar, Vec3, kernel};

/// Returns three adjacent numbers of `x`, beginning at index `first`, as a vector.
#[inline(always)]
fn three<S: Scalar>(x: &[S], first: usize) -> Vec3<S> {
    Vec3::new(x[first], x[first + 1], x[first + 2])
}

/// Multiplies the components of `x` by the armatures of the coordinates `first`, `first` + 1 and `first` + 2.
#[inline(always)]
fn times<S: Scalar, R: Constant<S>>(model: &Model<R>, first: usize, x: Vec3<S>) -> Vec3<S> {
    let a = model.armature();
    Vec3::new(a[first].lift() * x.x, a[first + 1].lift() * x.y, a[first + 2].lift() * x.z)
}

/// Returns the bias a (ω × v) of the free joint whose first coordinate is `first`.
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

/// Subtracts the bias a (ω × v) of each free joint with armature from the efforts of the joint. The remaining efforts
/// accelerate the joint.
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

/// Multiplies the rows of the 3 × 3 matrix `skew` by the armatures of the joint, and adds the product to a block of an
/// nv × nv matrix. The block begins at row `first` and column `column`. Both matrices are stored by columns.
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

/// Adds the derivative of the armature's bias a (ω × v) with respect to the velocities to ∂τ/∂v, an nv × nv matrix
/// stored by columns.
#[inline(always)]
pub(crate) fn add_slope<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], dtau_dv: &mut [S]) {
    for &first in model.free_armature() {
        let (v, w) = (three(qd, first), three(qd, first + 3));
        add_block(model, first, first, w.skew().columns(), dtau_dv); // ∂τ_v/∂v = a ω×
        add_block(model, first, first + 3, (-v).skew().columns(), dtau_dv); // ∂τ_v/∂ω = −a v×
    }
}

/// Adds the matrix a ω× of the armature's bias a (ω × v) to the Coriolis matrix C (nv × nv, stored by columns), in the
/// rows and columns of the linear velocity v.
#[inline(always)]
pub(crate) fn add_coriolis<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S], C: &mut [S]) {
    for &first in model.free_armature() {
        add_block(model, first, first, three(qd, first + 3).skew().columns(), C);
    }
}

/// Adds the second derivative ∂²(λᵀ τ)/∂v∂v of the armature's bias τ = a (ω × v) to an nv × nv matrix stored by
/// columns. With μ = a λ_v, where λ_v are the linear components of λ, λᵀ τ = μ · (ω × v). So the block ∂²/∂v∂ω is μ×,
/// and the block ∂²/∂ω∂v is −μ×.
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
    /// Writes the efforts `tau` minus the bias of all free joints with armature to `effort`.
    pub(crate) fn without_bias<S, R>(model: &Model<R>, v: &[S], tau: &[S], effort: &mut [S]) {
        effort.copy_from_slice(tau);
        subtract_armature_bias(model, v, effort);
    }
}
