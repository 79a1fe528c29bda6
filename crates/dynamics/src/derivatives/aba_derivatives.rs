//! The derivatives of forward dynamics, by hand.
//!
//! M(q) q̈ + h(q, v) = τ holds for every q and v, so with the derivatives of inverse dynamics at that q̈ (Carpentier and
//! Mansard, *Analytical derivatives of rigid body dynamics algorithms*, 2018, equation 18)
//!
//! ```text
//! ∂q̈/∂q = −M⁻¹ ∂τ/∂q,   ∂q̈/∂v = −M⁻¹ ∂τ/∂v,   ∂q̈/∂τ = M⁻¹
//! ```

use crate::derivatives::tree_solve::{self, minus_solve};
use crate::passes::aba::{self};
use crate::passes::kinematics::World;
use crate::workspace::{Size, filled, zero_matrix};
use alloc::vec::Vec;
use condyle_model::Model;
use condyle_spatial::Scalar;
use condyle_spatial::kernel;
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// The acceleration. Shape: nv. Written by: `aba_derivatives`.
    pub a: Vec<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dv: DMatrix<S>,
    pub solve: tree_solve::Workspace<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new<R>(size: Size, model: &Model<R>) -> Self {
        let square = zero_matrix(size.nv, size.nv);
        let solve = tree_solve::Workspace::new(model.columns(), size.nv);
        Self { a: filled(S::zero, size.nv), da_dq: square.clone(), da_dv: square, solve }
    }
}

kernel! {
    /// ∂q̈ = −M⁻¹ ∂τ by the factors of the articulated bodies.
    pub(crate) fn solves<S>(world: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>, dtau: [&[S]; 2]) {
        let Workspace { da_dq, da_dv, solve, .. } = d;
        minus_solve(world, f, solve, dtau, [da_dq.as_mut_slice(), da_dv.as_mut_slice()]);
    }
}
