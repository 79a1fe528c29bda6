//! First derivatives of inverse and forward dynamics, of momentum and of energies.

use super::differentiated::State;
use super::forward_dynamics::one_by_one as accelerate;
use super::inverse_dynamics::check_arguments;
use super::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use super::limbs::{Task, run as run_limbs};
use crate::data::{Data, check_forces};
use crate::derivatives::centroidal_derivatives::{self as centroidal, CentroidalDerivatives};
use crate::derivatives::{aba_derivatives as aba, rnea_derivatives as rnea};
use crate::lanes::limbs::LaneView;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::energy::{self, EnergyDerivatives};
use crate::passes::kinematics::{PlacementCache, positions};
use crate::passes::{minv, statics};
use condyle_linalg::check;
use condyle_linalg::tree_product::minus_products;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Matrix, Scalar, Vec3};

/// ∂τ/∂q of [`static_torque`](crate::static_torque()), and without forces of [`gravity`](crate::gravity): exact, in O(n · depth).
///
/// q: nq numbers; f_ext: a force on each body in its frame (it moves with the body), or empty for none. Returns the full
/// nv × nv matrix (N m/rad, N/m), entry (i, j) being ∂τᵢ/∂q_j. Allocates nothing. Source: as of
/// [`rnea_derivatives`], at rest.
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
/// If an argument has the wrong length, or `data` was made for a model of another size.
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

/// The derivatives of kinetic and potential energy with respect to q and v, exact, in O(n).
///
/// q: nq numbers; v: nv. Returns nv numbers each (J/rad, J s/rad, J/rad; per m for axes that slide). Allocates nothing.
/// Source: T = ½ Σ ⟨v, I v⟩ + ½ Σ armature q̇² and V = −Σ m gᵀ c, with ∂v/∂q of `frame_derivatives.rs`.
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
/// If an argument has the wrong length, or `data` was made for a model of another size.
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

/// The derivatives of τ = rnea(q, v, a): three full nv × nv matrices, and [all others](Self::with_respect_to) when asked.
#[derive(Clone, Copy, Debug)]
pub struct RneaDerivatives<'d, S, R = f64> {
    /// ∂τ/∂q in the tangent space: the change of τ when q moves to q ⊕ δ, per δ.
    pub dtau_dq: &'d Matrix<S>,
    /// ∂τ/∂v.
    pub dtau_dv: &'d Matrix<S>,
    /// ∂τ/∂a = M(q), armature included.
    pub dtau_da: &'d Matrix<S>,
    pub(crate) state: State<'d, S, R>,
}

/// The derivatives of [`rnea`](crate::rnea) with respect to q, v and a, exact, in O(n · depth).
///
/// q: nq numbers; v, a: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for none.
/// Returns three nv × nv matrices, row by row ∂τᵢ/∂·. Allocates nothing. Source: Singh, Russell, Wensing (2022),
/// algorithm 1.
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
/// If an argument has the wrong length, or `data` was made for a model of another tree.
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
    if run_limbs(Task::RneaDerivatives, model, data, arguments) {
        data.rnea_derivatives.qd.copy_from_slice(v);
        data.rnea_derivatives.qdd.copy_from_slice(a);
    } else {
        one_by_one(model, data, arguments);
    }
    view(model, data)
}

/// Body by body, for arguments that fit; leaves what second derivatives are made of.
pub(crate) fn one_by_one<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, arguments: Arguments<'_, S>) {
    let Arguments { q, v, x: a, f_ext } = arguments;
    positions(model, &mut data.world, q);
    rnea::run(model, &data.world, &mut data.rnea_derivatives, v, a, f_ext, &[]);
}

/// What `pass` has left, body by body or in the limbs' lanes.
pub(crate) fn view<'d, S, R>(model: &'d Model<R>, data: &'d Data<S>) -> RneaDerivatives<'d, S, R> {
    let d = &data.rnea_derivatives;
    let in_limbs = matches!(data.world.placed, PlacementCache::Limbs(_));
    let limbs = data.limbs.as_ref().zip(model.limbs()).filter(|_| in_limbs);
    let limbs = limbs.map(|(scratch, plan)| LaneView::new(plan, scratch));
    let state = State { model, world: &data.world, pass: d, limbs };
    RneaDerivatives { dtau_dq: &d.dtau_dq, dtau_dv: &d.dtau_dv, dtau_da: &d.dtau_da, state }
}

/// The derivatives of the Coriolis product C(q, v) v, each a full nv × nv matrix.
#[derive(Clone, Copy, Debug)]
pub struct CoriolisDerivatives<'d, S> {
    /// ∂(C v)/∂q.
    pub dq: &'d Matrix<S>,
    /// ∂(C v)/∂v.
    pub dv: &'d Matrix<S>,
}

/// The derivatives of C(q, v) v = h(q, v) − g(q), the Coriolis and centrifugal efforts, exact, in O(n · depth).
///
/// q: nq numbers; v: nv. Returns two nv × nv matrices (N m/rad, N m s/rad). Allocates nothing. Source: those of
/// [`rnea`](crate::rnea) at a = 0 where nothing weighs anything.
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
/// If an argument has the wrong length, or `data` was made for a model of another size.
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

/// q̈ = aba(q, v, τ) and its derivatives: three full nv × nv matrices, and [all others](Self::with_respect_to) when asked.
#[derive(Clone, Copy, Debug)]
pub struct AbaDerivatives<'d, S, R = f64> {
    /// q̈ itself, nv numbers.
    pub a: &'d [S],
    /// ∂q̈/∂q in the tangent space: the change of q̈ when q moves to q ⊕ δ, per δ.
    pub da_dq: &'d Matrix<S>,
    /// ∂q̈/∂v.
    pub da_dv: &'d Matrix<S>,
    /// ∂q̈/∂τ = M(q)⁻¹.
    pub da_dtau: &'d Matrix<S>,
    pub(crate) state: State<'d, S, R>,
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
    if data.minv.by_factor
        && !data.aba_derivatives.solve.pays()
        && run_limbs(Task::AbaDerivatives, model, data, arguments)
    {
        data.aba_derivatives.a.copy_from_slice(&data.aba.qdd);
        data.rnea_derivatives.qd.copy_from_slice(v);
        data.rnea_derivatives.qdd.copy_from_slice(&data.aba.qdd);
        multiply(model, data);
    } else {
        in_turn(model, data, arguments);
    }
    view_of_aba(model, data)
}

/// Body by body, for arguments that fit; leaves what second derivatives are made of.
pub(crate) fn in_turn<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, arguments: Arguments<'_, S>) {
    let Arguments { v, f_ext, .. } = arguments;
    accelerate(model, data, arguments);
    let mut a_kept = core::mem::take(&mut data.aba_derivatives.a);
    a_kept.copy_from_slice(&data.aba.qdd);
    rnea::run(model, &data.world, &mut data.rnea_derivatives, v, &a_kept, f_ext, &[]);
    data.aba_derivatives.a = a_kept;
    if data.minv.by_factor {
        minv::from_matrix(&mut data.minv, &data.rnea_derivatives.dtau_da);
    } else {
        minv::from_factors(model.columns(), &data.world, &data.aba, &mut data.minv); // those of `aba`
    }
    if data.aba_derivatives.solve.pays() {
        let dtau = [data.rnea_derivatives.dtau_dq.as_slice(), data.rnea_derivatives.dtau_dv.as_slice()];
        aba::solves(&data.world, &data.aba, &mut data.aba_derivatives, dtau);
    } else {
        multiply(model, data);
    }
}

/// ∂q̈ = −M⁻¹ ∂τ, after `rnea_derivatives` and `minv`.
fn multiply<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let (d, out) = (&data.rnea_derivatives, &mut data.aba_derivatives);
    let float_freely = out.float_freely(model);
    let nonzero_rows = if float_freely { &out.nonzero_rows } else { model.nonzero_rows() };
    let dtau = [d.dtau_dq.as_slice(), d.dtau_dv.as_slice()];
    let da = [out.da_dq.as_mut_slice(), out.da_dv.as_mut_slice()];
    minus_products(data.minv.Minv.as_slice(), dtau, da, nonzero_rows);
    if float_freely {
        aba::boost(out, &d.qd);
    }
}

/// The derivatives of the centroidal momentum, its rate, and the centre of mass and its velocity and acceleration, with
/// respect to q, v and a, exact, in O(n).
///
/// q: nq numbers; v, a: nv. Gravity is not among the accelerations. What is fixed to the world does not count; not a
/// number if nothing that moves has a mass. Allocates nothing. Source: Carpentier and Mansard (2018).
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
/// If an argument has the wrong length, or `data` was made for a model of another size.
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

/// What `aba_derivatives` has left.
pub(crate) fn view_of_aba<'d, S, R>(model: &'d Model<R>, data: &'d Data<S>) -> AbaDerivatives<'d, S, R> {
    let aba::Workspace { a, da_dq, da_dv, .. } = &data.aba_derivatives;
    AbaDerivatives { a, da_dq, da_dv, da_dtau: &data.minv.Minv, state: view(model, data).state }
}
