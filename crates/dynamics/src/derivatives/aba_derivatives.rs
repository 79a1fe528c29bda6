//! Analytical derivatives of forward dynamics.
//!
//! M(q) q̈ + h(q, v) = τ holds for every q and v. So the derivatives of forward dynamics follow from the derivatives of
//! inverse dynamics τ(q, v, q̈) at the computed acceleration q̈. Source: Carpentier and Mansard, *Analytical
//! derivatives of rigid body dynamics algorithms* (2018), equation 18.
//!
//! ```text
//! ∂q̈/∂q = −M⁻¹ ∂τ/∂q,   ∂q̈/∂v = −M⁻¹ ∂τ/∂v,   ∂q̈/∂τ = M⁻¹
//! ```
//!
//! The dynamics of a floating body, and of the bodies that it carries, do not depend on position or common velocity.
//! Gravity accelerates all of these bodies equally. So some derivatives with respect to the linear and angular
//! coordinates of the free joint are known in advance. p₀, v₀, ω and R are the position, linear velocity, angular
//! velocity and rotation of the floating body; θ₀ are its angular coordinates. With the acceleration g of free fall:
//!
//! ```text
//! ∂q̈/∂p₀ = 0,   ∂v̇₀/∂v₀ = −ω×,   ∂v̇₀/∂θ₀ = (Rᵀ g)×,   and zeros in all other rows
//! ```

use crate::derivatives::tree_solve::{self, minus_solve};
use crate::passes::aba::{self};
use crate::passes::kinematics::World;
use crate::workspace::{workspace, zero_matrix};
use alloc::vec::Vec;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Matrix, Scalar, Vec3};
use core::any::Any;

workspace! {
    pub(crate) struct Workspace<S>(size, model: &Model<R>) {
        /// Derivative ∂q̈/∂q of the joint accelerations. Written by: `aba_derivatives`.
        pub da_dq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Derivative ∂q̈/∂v of the joint accelerations. Written by: `aba_derivatives`.
        pub da_dv: Matrix<S> = zero_matrix(size.nv, size.nv),
        pub solve: tree_solve::Workspace<S> = tree_solve::Workspace::new(model.columns(), size.nv),
    } same {
        /// Index of the first coordinate of each floating body. Written by: `new`.
        pub floating: Vec<usize> = model.floating().map(|i| model.nodes()[i].idx_v).collect(),
        /// Rows of ∂τ/∂q and ∂τ/∂v that may be nonzero, one list per column. The product with M⁻¹ uses only these rows.
        /// The list is empty for the linear coordinates of floating bodies. Written by: `new`.
        pub nonzero_rows: Vec<NonzeroRows> = NonzeroRows::of_columns(rows_that_count(model, &floating)),
    }
}

/// Returns for each column of ∂τ/∂q and ∂τ/∂v the rows that the product with M⁻¹ uses: the rows that may be nonzero.
/// The list is empty for the linear coordinates of floating bodies, because their columns of the result are known.
fn rows_that_count<R>(model: &Model<R>, floating: &[usize]) -> Vec<Vec<usize>> {
    let mut rows: Vec<Vec<usize>> = model.nonzero_rows().iter().map(|column| column.rows.clone()).collect();
    for &first in floating {
        rows[first..first + 3].iter_mut().for_each(Vec::clear);
    }
    rows
}

impl<S: Scalar> Workspace<S> {
    /// Returns true if the model has floating bodies and none of their linear coordinates has armature. Returns false
    /// if the scalar of the model is not `f64`.
    pub(crate) fn float_freely<R: 'static>(&self, model: &Model<R>) -> bool {
        let model = (model as &dyn Any).downcast_ref::<Model>();
        let is_free = |model: &Model| self.floating.iter().all(|&first| model.armature()[first..first + 3] == [0.0; 3]);
        !self.floating.is_empty() && model.is_some_and(is_free)
    }
}

kernel! {
    /// Writes the block ∂v̇₀/∂v₀ = −ω× of each floating body into ∂q̈/∂v. v₀ is the body's linear velocity. All other
    /// entries in the columns of v₀ are zero.
    pub(crate) fn set_floating_columns<S>(d: &mut Workspace<S>, v: &[S]) {
        let n = v.len();
        for &first in &d.floating {
            let omega = Vec3::new(v[first + 3], v[first + 4], v[first + 5]);
            for (k, x) in (-omega).skew().columns().into_iter().enumerate() {
                d.da_dv.as_mut_slice()[(first + k) * n + first..][..3].copy_from_slice(&x.to_array());
            }
        }
    }
}

kernel! {
    /// Computes ∂q̈/∂x = −M⁻¹ ∂τ/∂x for x = q and x = v, with the factors of the articulated-body algorithm.
    pub(crate) fn solves<S>(world: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>, dtau: [&[S]; 2]) {
        let Workspace { da_dq, da_dv, solve, .. } = d;
        minus_solve(world, f, solve, dtau, [da_dq.as_mut_slice(), da_dv.as_mut_slice()]);
    }
}
