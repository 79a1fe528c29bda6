//! What joints lose by themselves: viscous damping and Coulomb friction, the latter smoothed.
//!
//! ```text
//! τ_k = −d_k v_k − f_k tanh(v_k/ε)
//! ```
//!
//! d and f are the model's [`damping`](Model::damping) and [`friction`](Model::friction) (a URDF's
//! `<dynamics damping friction>`). No other algorithm knows of them: whoever wants them adds them to τ.
//!
//! Coulomb's law jumps at v = 0. tanh replaces the jump by the slope f/ε: the law is right to 1 % from |v| = 2.65 ε on
//! and to 1e-6 from 7.25 ε, and at rest a joint creeps (a load below f moves it with less than ε artanh(load/f))
//! instead of sticking. An explicit integrator needs steps shorter than 2 ε m/f, m the inertia that the joint feels.

use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::elementary::tanh;
use condyle_spatial::{Scalar, kernel};

/// τ = −d v − f tanh(v/ε): the efforts of damping and smoothed friction, in O(n).
///
/// v: nv numbers; smoothing: ε > 0, the speed (rad/s, m/s) at which friction is 76 % of f; tau: nv (N m, N), overwritten.
/// They always take power: vᵀ τ ≤ 0. The smoothed law is right to 1 % from |v| = 2.65 ε on. At rest a joint creeps instead of
/// sticking: a load below f moves it with less than ε artanh(load/f). An explicit integrator needs steps shorter than 2 ε m/f,
/// with m the inertia that the joint feels. Allocates nothing.
///
/// ```
/// use condyle_dynamics::{Joint, JointOptions, ModelBuilder, Inertia, Se3, Sym3, Vec3, WORLD, passive_torque};
/// let mut robot = ModelBuilder::new("slider");
/// let I = Inertia::from_com(1.0, Vec3::zero(), Sym3::zero());
/// let losses = JointOptions { damping: 0.5, friction: 2.0, ..JointOptions::default() };
/// let x = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
/// robot.body_with(("cart", "rail"), WORLD, x, Se3::identity(), I, losses);
/// let mut tau = [0.0];
/// passive_torque(&robot.build()?, &[3.0], 0.01, &mut tau);
/// assert!(f64::abs(tau[0] + 0.5 * 3.0 + 2.0) < 1e-15);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `smoothing` is not positive.
#[track_caller]
pub fn passive_torque<S: Scalar, R>(model: &Model<R>, v: &[S], smoothing: f64, tau: &mut [S]) {
    check_arguments(model, v, smoothing, "tau", tau.len());
    losses(model.damping(), model.friction(), v, smoothing, tau);
}

kernel! {
    /// −d v − f tanh(v/ε).
    fn losses<S>(damping: &[f64], friction: &[f64], v: &[S], smoothing: f64, tau: &mut [S]) {
        for k in 0..tau.len() {
            let friction = tanh(v[k] * S::splat(1.0 / smoothing)) * S::splat(friction[k]);
            tau[k] = v[k].mul_add(S::splat(-damping[k]), -friction); // −d v − f tanh(v/ε)
        }
    }
}

/// ∂τ/∂v = −d − f/ε (1 − tanh²(v/ε)) of [`passive_torque`]: the diagonal of a matrix without other entries, in O(n).
///
/// v: nv numbers; smoothing: ε > 0 (rad/s, m/s); dtau_dv: nv (N m s/rad, N s/m), overwritten. Allocates nothing.
///
/// ```
/// use condyle_dynamics::{passive_torque_derivative, robots};
/// let humanoid = robots::humanoid();
/// let mut dtau_dv = vec![0.0; humanoid.nv()];
/// passive_torque_derivative(&humanoid, &vec![0.1; humanoid.nv()], 0.01, &mut dtau_dv);
/// assert!(dtau_dv.iter().all(|&x| x <= 0.0));
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `smoothing` is not positive.
#[track_caller]
pub fn passive_torque_derivative<S: Scalar, R>(model: &Model<R>, v: &[S], smoothing: f64, dtau_dv: &mut [S]) {
    check_arguments(model, v, smoothing, "dtau_dv", dtau_dv.len());
    slopes(model.damping(), model.friction(), v, smoothing, dtau_dv);
}

kernel! {
    /// −d − f/ε (1 − tanh²(v/ε)).
    fn slopes<S>(damping: &[f64], friction: &[f64], v: &[S], smoothing: f64, dtau_dv: &mut [S]) {
        for k in 0..dtau_dv.len() {
            let t = tanh(v[k] * S::splat(1.0 / smoothing));
            let slope = (S::one() - t * t) * S::splat(friction[k] / smoothing);
            dtau_dv[k] = -S::splat(damping[k]) - slope; // −d − f/ε (1 − tanh²)
        }
    }
}

#[track_caller]
fn check_arguments<S, R>(model: &Model<R>, v: &[S], smoothing: f64, name: &str, out: usize) {
    check("v", v.len(), model.nv());
    check(name, out, model.nv());
    check_smoothing(smoothing);
}

/// Panics unless a smoothing is positive.
#[track_caller]
pub(crate) fn check_smoothing(smoothing: f64) {
    assert!(smoothing > 0.0, "smoothing: expected a positive speed, found {smoothing}");
}
