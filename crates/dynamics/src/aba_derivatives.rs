//! The derivatives of forward dynamics, by hand.
//!
//! M(q) q̈ + h(q, v) = τ holds for every q and v, so with the derivatives of inverse dynamics at that q̈ (Carpentier and
//! Mansard, *Analytical derivatives of rigid body dynamics algorithms*, 2018, equation 18)
//!
//! ```text
//! ∂q̈/∂q = −M⁻¹ ∂τ/∂q,   ∂q̈/∂v = −M⁻¹ ∂τ/∂v,   ∂q̈/∂τ = M⁻¹
//! ```

use crate::aba::{self, check_arguments, one_by_one};
use crate::articulated_solve::{self, minus_solve};
use crate::data::Data;
use crate::inputs::State;
use crate::kinematics::World;
use crate::limbs;
use crate::minv;
use crate::rnea_derivatives;
use crate::workspace::{Size, filled, zero_matrix};
use condyle_linalg::tree_product::minus_products;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Constant, Force, Scalar};
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// The acceleration. Shape: nv. Written by: `aba_derivatives`.
    a: Vec<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dv: DMatrix<S>,
    solve: articulated_solve::Workspace<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new<R>(size: Size, model: &Model<R>) -> Self {
        let square = zero_matrix(size.nv, size.nv);
        let solve = articulated_solve::Workspace::new(model.columns(), size.nv);
        Self { a: filled(S::zero(), size.nv), da_dq: square.clone(), da_dv: square, solve }
    }
}

/// q̈ = aba(q, v, τ) and its derivatives: three full nv × nv matrices, and [all others](Self::with_respect_to) when asked.
#[derive(Clone, Copy, Debug)]
pub struct AbaDerivatives<'d, S, R = f64> {
    /// q̈ itself, nv numbers.
    pub a: &'d [S],
    /// ∂q̈/∂q in the tangent space: the change of q̈ when q moves to q ⊕ δ, per δ.
    pub da_dq: &'d DMatrix<S>,
    /// ∂q̈/∂v.
    pub da_dv: &'d DMatrix<S>,
    /// ∂q̈/∂τ = M(q)⁻¹.
    pub da_dtau: &'d DMatrix<S>,
    pub(crate) state: State<'d, S, R>,
}

kernel! {
    /// ∂q̈ = −M⁻¹ ∂τ by the factors of the articulated bodies.
    fn solves<S>(world: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>, dtau: [&[S]; 2]) {
        let Workspace { da_dq, da_dv, solve, .. } = d;
        minus_solve(world, f, solve, dtau, [da_dq.as_mut_slice(), da_dv.as_mut_slice()]);
    }
}

/// [`aba`](crate::aba) and its derivatives with respect to q, v and τ, exact.
///
/// q: nq numbers; v, tau: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for none.
/// Returns q̈ and three nv × nv matrices, in O(n · depth) for what goes into them and O(n³) for the products with M⁻¹.
/// Allocates nothing. Source: Carpentier and Mansard (2018), equation 18.
///
/// ```
/// use condyle_dynamics::{Data, aba_derivatives, minv, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let da_dtau = aba_derivatives(&arm, &mut data, &q, &v, &tau, &[]).da_dtau.clone();
/// assert_eq!(&da_dtau, minv(&arm, &mut data, &q));
/// ```
///
/// # Panics
/// If an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
pub fn aba_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> AbaDerivatives<'d, S, R> {
    check_arguments(model, data, q, v, tau, f_ext);
    if data.minv.by_factor()
        && !data.aba_derivatives.solve.pays()
        && limbs::run(limbs::Task::AbaDerivatives, model, data, q, v, tau, f_ext)
    {
        data.aba_derivatives.a.copy_from_slice(&data.aba.qdd);
        data.rnea_derivatives.qd.copy_from_slice(v);
        data.rnea_derivatives.qdd.copy_from_slice(&data.aba.qdd);
        multiply(model, data);
    } else {
        in_turn(model, data, q, v, tau, f_ext);
    }
    let state = rnea_derivatives::view(model, data).state;
    data.aba_derivatives.view(data.minv.matrix(), state)
}

/// Body by body, for arguments that fit; leaves what second derivatives are made of.
pub(crate) fn in_turn<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) {
    one_by_one(model, data, q, v, tau, f_ext);
    let mut a_kept = core::mem::take(&mut data.aba_derivatives.a);
    a_kept.copy_from_slice(&data.aba.qdd);
    rnea_derivatives::run(model, &data.world, &mut data.rnea_derivatives, v, &a_kept, f_ext, &[]);
    data.aba_derivatives.a = a_kept;
    if data.minv.by_factor() {
        minv::from_matrix(&mut data.minv, &data.rnea_derivatives.dtau_da);
    } else {
        minv::from_factors(model.columns(), &data.world, &data.aba, &mut data.minv); // those of `aba`
    }
    if data.aba_derivatives.solve.pays() {
        let dtau = [data.rnea_derivatives.dtau_dq.as_slice(), data.rnea_derivatives.dtau_dv.as_slice()];
        solves(&data.world, &data.aba, &mut data.aba_derivatives, dtau);
    } else {
        multiply(model, data);
    }
}

/// ∂q̈ = −M⁻¹ ∂τ, after `rnea_derivatives` and `minv`.
fn multiply<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let (d, out) = (&data.rnea_derivatives, &mut data.aba_derivatives);
    let dtau = [d.dtau_dq.as_slice(), d.dtau_dv.as_slice()];
    let da = [out.da_dq.as_mut_slice(), out.da_dv.as_mut_slice()];
    minus_products(data.minv.matrix().as_slice(), dtau, da, model.nonzero_rows());
}

impl<S> Workspace<S> {
    pub(crate) fn a(&self) -> &[S] {
        &self.a
    }

    /// What `aba_derivatives` has left.
    pub(crate) fn view<'d, R>(&'d self, Minv: &'d DMatrix<S>, state: State<'d, S, R>) -> AbaDerivatives<'d, S, R> {
        AbaDerivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_dtau: Minv, state }
    }
}
