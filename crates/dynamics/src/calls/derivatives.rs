//! First derivatives of inverse and forward dynamics, of the centroidal momentum, and of the energies.

use super::differentiated::State;
use super::forward_dynamics;
use super::inverse_dynamics::check_arguments;
use super::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use super::limbs;
use crate::data::{Data, check_forces};
use crate::derivatives::centroidal_derivatives::{self as centroidal, CentroidalDerivatives};
use crate::derivatives::{aba_derivatives as aba, rnea_derivatives as rnea};
use crate::lanes::limbs::LaneView;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::energy::{self, EnergyDerivatives};
use crate::passes::kinematics::{PlacementCache, positions};
use crate::passes::{minv, statics};
use crate::selection::{AbaDerivativesMethod, InverseMethod};
use condyle_linalg::check;
use condyle_linalg::tree_product::neg_products;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Matrix, Scalar, Vec3};

/// Computes ∂τ/∂q of [`static_torque`](crate::static_torque()), exactly, in O(n · depth). Without external forces,
/// ∂τ/∂q is the derivative of [`gravity`](crate::gravity).
///
/// q: nq numbers; f_ext: one force per body, in the body's frame (the force moves with the body), or empty for no
/// forces. Returns the full nv × nv matrix (N m/rad, N/m); entry (i, j) is ∂τᵢ/∂q_j. Allocates nothing. Source: the
/// equations of [`rnea_derivatives`] for a robot at rest.
///
/// ```
/// use condyle_dynamics::{Data, robots, static_torque_derivative};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let stiffness = static_torque_derivative(&arm, &mut data, &[0.3; 7], &[]);
/// assert!((stiffness - stiffness.transpose()).amax() < 1e-12); // gravity has a potential
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another size.
#[track_caller]
pub fn static_torque_derivative<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    f_ext: &[Force<S>],
) -> &'d Matrix<S> {
    check_forces(f_ext.len(), model.nodes().len());
    forward_kinematics(model, data, q);
    statics::run_derivative(model, &data.world, &mut data.statics, f_ext);
    &data.statics.dtau_dq
}

/// Computes the exact derivatives of kinetic and potential energy with respect to q and v, in O(n) for n bodies.
///
/// q: nq numbers; v: nv numbers. Returns ∂T/∂q, ∂T/∂v and ∂V/∂q, nv numbers each (J/rad, J s/rad, J/rad; for sliding
/// joints m instead of rad). Allocates nothing. Source: T = ½ Σ ⟨v, I v⟩ + ½ Σ armature q̇² and V = −Σ m gᵀ c, with
/// ∂v/∂q from `frame_derivatives.rs`.
///
/// ```
/// use condyle_dynamics::{Data, energy_derivatives, gravity, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let dV_dq = energy_derivatives(&arm, &mut data, &[0.3; 7], &[0.1; 7]).dV_dq.to_vec();
/// for (dV, g) in dV_dq.iter().zip(gravity(&arm, &mut data, &[0.3; 7])) {
///     assert!(f64::abs(dV - g) < 1e-12);
/// }
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another size.
#[track_caller]
pub fn energy_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> EnergyDerivatives<'d, S> {
    forward_velocities(model, data, q, v);
    energy::run(model, &data.world, &data.moving, &mut data.energy);
    data.energy.view()
}

/// Derivatives of τ = rnea(q, v, a): three full nv × nv matrices. [`with_respect_to`](Self::with_respect_to) computes
/// the derivatives with respect to other inputs.
#[derive(Clone, Copy, Debug)]
pub struct RneaDerivatives<'d, S, R = f64> {
    /// Derivative ∂τ/∂q of the joint efforts in the tangent space: the change of τ per δ when q moves to q ⊕ δ.
    pub dtau_dq: &'d Matrix<S>,
    /// Derivative ∂τ/∂v of the joint efforts.
    pub dtau_dv: &'d Matrix<S>,
    /// Derivative ∂τ/∂a = M(q) of the joint efforts, including armature.
    pub dtau_da: &'d Matrix<S>,
    pub(crate) state: State<'d, S, R>,
}

/// Computes the exact derivatives of [`rnea`](crate::rnea) with respect to q, v and a, in O(n · depth).
///
/// q: nq numbers; v, a: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with the
/// body), or empty for no forces. Returns three nv × nv matrices; row i of each contains the derivatives of τᵢ.
/// Allocates nothing. Source: Singh, Russell, Wensing (2022), algorithm 1.
///
/// ```
/// use condyle_dynamics::{Data, crba, rnea_derivatives, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
/// let M = rnea_derivatives(&arm, &mut data, &q, &v, &a, &[]).dtau_da.clone();
/// assert!((M - crba(&arm, &mut data, &q)).amax() < 1e-14);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn rnea_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
) -> RneaDerivatives<'d, S, R> {
    let arguments = Arguments { q, v, x: a, f_ext };
    check_arguments(model, data, "a", arguments);
    if !limbs::rnea_derivatives(model, data, arguments) {
        run_rnea_serially(model, data, arguments);
    }
    view(model, data)
}

/// Computes the derivatives of inverse dynamics body by body, and keeps the terms that their second derivatives need.
/// The arguments must be valid.
pub(crate) fn run_rnea_serially<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) {
    let Arguments { q, v, x: a, f_ext } = arguments;
    positions(model, &mut data.world, q);
    data.rnea_derivatives.qdd.copy_from_slice(a);
    rnea::run(model, &data.world, &mut data.rnea_derivatives, v, a, f_ext, &[]);
}

/// Returns a view of the derivatives of inverse dynamics that the last call computed. That call ran body by body or
/// with limbs in parallel lanes.
pub(crate) fn view<'d, S, R>(model: &'d Model<R>, data: &'d Data<S>) -> RneaDerivatives<'d, S, R> {
    let d = &data.rnea_derivatives;
    let state = state(model, data, &d.qdd);
    RneaDerivatives { dtau_dq: &d.dtau_dq, dtau_dv: &d.dtau_dv, dtau_da: &d.dtau_da, state }
}

/// Returns the state at which the last call computed the derivatives of τ. `qdd` is q̈ in this state.
fn state<'d, S, R>(model: &'d Model<R>, data: &'d Data<S>, qdd: &'d [S]) -> State<'d, S, R> {
    let in_limbs = matches!(data.world.placed, PlacementCache::Limbs(_));
    let limbs = data.limbs.as_ref().zip(model.limbs()).filter(|_| in_limbs);
    let limbs = limbs.map(|(scratch, plan)| LaneView::new(plan, scratch));
    State { model, world: &data.world, pass: &data.rnea_derivatives, qdd, limbs }
}

/// Derivatives of the Coriolis product C(q, v) v, each a full nv × nv matrix.
#[derive(Clone, Copy, Debug)]
pub struct CoriolisDerivatives<'d, S> {
    /// Derivative ∂(C v)/∂q of the Coriolis efforts.
    pub dq: &'d Matrix<S>,
    /// Derivative ∂(C v)/∂v of the Coriolis efforts.
    pub dv: &'d Matrix<S>,
}

/// Computes the exact derivatives of the Coriolis and centrifugal efforts C(q, v) v = h(q, v) − g(q), in O(n · depth).
///
/// q: nq numbers; v: nv numbers. Returns two nv × nv matrices (N m/rad, N m s/rad). Allocates nothing. Source: the
/// equations of [`rnea_derivatives`] for a = 0 and no gravity.
///
/// ```
/// use condyle_dynamics::{Data, coriolis_derivatives, coriolis_matrix, robots};
/// let arm = robots::arm7();
/// let (mut data, q, v) = (Data::new(&arm), [0.3; 7], [0.1; 7]);
/// let dv = coriolis_derivatives(&arm, &mut data, &q, &v).dv.clone();
/// assert!((dv - coriolis_matrix(&arm, &mut data, &q, &v) * 2.0).amax() < 1e-13); // C v is quadratic in v
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another size.
#[track_caller]
pub fn coriolis_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> CoriolisDerivatives<'d, S> {
    check("v", v.len(), model.nv());
    forward_kinematics(model, data, q);
    let still = core::mem::take(&mut data.rnea_derivatives.still);
    rnea::run(model, &data.world, &mut data.rnea_derivatives, v, &still, &[], &[Vec3::zero()]);
    let d = &mut data.rnea_derivatives;
    d.still = still;
    CoriolisDerivatives { dq: &d.dtau_dq, dv: &d.dtau_dv }
}

/// Accelerations q̈ = aba(q, v, τ), and the derivatives of q̈: three full nv × nv matrices.
/// [`with_respect_to`](Self::with_respect_to) computes the derivatives with respect to other inputs.
#[derive(Clone, Copy, Debug)]
pub struct AbaDerivatives<'d, S, R = f64> {
    /// Joint accelerations q̈, nv numbers.
    pub a: &'d [S],
    /// Derivative ∂q̈/∂q of the joint accelerations in the tangent space: the change of q̈ per δ when q moves to q ⊕ δ.
    pub da_dq: &'d Matrix<S>,
    /// Derivative ∂q̈/∂v of the joint accelerations.
    pub da_dv: &'d Matrix<S>,
    /// Derivative ∂q̈/∂τ = M(q)⁻¹ of the joint accelerations.
    pub da_dtau: &'d Matrix<S>,
    pub(crate) state: State<'d, S, R>,
}

/// Computes q̈ as [`aba`](crate::aba) does, and the exact derivatives of q̈ with respect to q, v and τ.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with the
/// body), or empty for no forces. Returns q̈ and three nv × nv matrices. Costs O(n · depth) for the derivatives of τ
/// and O(n³) for the products with M⁻¹. Allocates nothing. Source: Carpentier and Mansard (2018), equation 18.
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
/// Panics if an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn aba_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> AbaDerivatives<'d, S, R> {
    let arguments = Arguments { q, v, x: tau, f_ext };
    model.check_regular();
    check_arguments(model, data, "tau", arguments);
    let by_limbs = data.methods.aba_derivatives == AbaDerivativesMethod::Limbs;
    if by_limbs && limbs::aba_derivatives(model, data, arguments) {
        multiply(model, data);
    } else {
        run_aba_serially(model, data, arguments);
    }
    view_of_aba(model, data)
}

/// Computes the derivatives of forward dynamics body by body, and keeps the terms that their second derivatives need.
/// The arguments must be valid.
pub(crate) fn run_aba_serially<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) {
    let Arguments { v, f_ext, .. } = arguments;
    forward_dynamics::run_serially(model, data, arguments);
    rnea::run(model, &data.world, &mut data.rnea_derivatives, v, &data.aba.qdd, f_ext, &[]);
    match data.methods.inverse {
        InverseMethod::ArticulatedBodies => {
            minv::from_factors(model.columns(), &data.world, &data.aba, &mut data.minv); // factors of `aba`
        }
        method => minv::from_matrix(&mut data.minv, &data.rnea_derivatives.dtau_da, method),
    }
    match data.methods.aba_derivatives {
        AbaDerivativesMethod::TreeSolve => {
            let dtau = [data.rnea_derivatives.dtau_dq.as_slice(), data.rnea_derivatives.dtau_dv.as_slice()];
            aba::solves(&data.world, &data.aba, &mut data.aba_derivatives, dtau);
        }
        AbaDerivativesMethod::Limbs | AbaDerivativesMethod::Product => multiply(model, data),
    }
}

/// Computes ∂q̈/∂x = −M⁻¹ ∂τ/∂x for x = q and x = v. Runs after `rnea_derivatives` and `minv`.
fn multiply<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let (d, out) = (&data.rnea_derivatives, &mut data.aba_derivatives);
    let float_freely = out.float_freely(model);
    let nonzero_rows = if float_freely { &out.nonzero_rows } else { model.nonzero_rows() };
    let dtau = [d.dtau_dq.as_slice(), d.dtau_dv.as_slice()];
    let da = [out.da_dq.as_mut_slice(), out.da_dv.as_mut_slice()];
    neg_products(data.minv.Minv.as_slice(), dtau, da, nonzero_rows);
    if float_freely {
        aba::set_floating_columns(out, &d.qd);
    }
}

/// Computes the exact derivatives of the centroidal momentum, of the rate of this momentum, and of the position,
/// velocity and acceleration of the centre of mass, in O(n) for n bodies.
///
/// q: nq numbers; v, a: nv numbers each. Returns derivatives with respect to q, v and a. Accelerations exclude gravity.
/// Bodies fixed to the world are ignored; results are NaN if no moving body has mass. Allocates nothing. Source:
/// Carpentier and Mansard (2018).
///
/// ```
/// use condyle_dynamics::{Data, centroidal_derivatives, centroidal_map, neutral, robots};
/// let quadruped = robots::quadruped();
/// let (mut data, q, o) = (Data::new(&quadruped), neutral(&quadruped), [0.0; 18]);
/// let Ag = centroidal_derivatives(&quadruped, &mut data, &q, &o, &o).drate_da.clone();
/// assert!((Ag - centroidal_map(&quadruped, &mut data, &q).Ag).amax() < 1e-13);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another size.
#[track_caller]
pub fn centroidal_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> CentroidalDerivatives<'d, S> {
    forward_accelerations(model, data, q, v, a);
    centroidal::run(model, &data.world, &data.moving, &mut data.centroidal_derivatives);
    data.centroidal_derivatives.view()
}

/// Returns a view of the results of `aba_derivatives`.
pub(crate) fn view_of_aba<'d, S, R>(model: &'d Model<R>, data: &'d Data<S>) -> AbaDerivatives<'d, S, R> {
    let (a, aba::Workspace { da_dq, da_dv, .. }) = (&data.aba.qdd[..], &data.aba_derivatives);
    AbaDerivatives { a, da_dq, da_dv, da_dtau: &data.minv.Minv, state: state(model, data, a) }
}
