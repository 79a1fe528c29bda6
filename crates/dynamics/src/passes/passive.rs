//! Passive efforts of a robot: damping and friction of joints, springs, and gravity compensation.
//!
//! ```text
//! τ_k = −(d + d₁ |v_k| + d₂ v_k²) v_k − f tanh(v_k/ε) − (spring of the joint)_k + (gravity compensation)_k
//! ```
//!
//! v_k is the velocity of coordinate k, and ε is the smoothing speed of friction. d is the model's
//! [`damping`](Model::damping), and f is the model's [`friction`](Model::friction) (a URDF's `<dynamics damping
//! friction>`). d₁ and d₂ are the model's [`damping_polynomial`](Model::damping_polynomial). Springs are in
//! `springs.rs`, gravity compensation is in `gravity_compensation.rs`. Other algorithms do not include passive efforts:
//! callers add them to τ.
//!
//! Coulomb friction of magnitude f jumps from −f to f at the velocity v = 0. The smoothed friction f tanh(v/ε) replaces
//! this jump by a slope of f/ε. The relative error of the friction is below 1 % for |v| ≥ 2.65 ε and below 1e-6 for |v|
//! ≥ 7.25 ε. A loaded joint creeps instead of sticking: a load below f moves the joint with a speed of at most ε
//! artanh(load/f). An explicit integrator needs steps shorter than 2 ε m/f, where m is the inertia at the joint.
//!
//! Damping and friction of a free joint's linear coordinates act along the axes of the joint's parent, as in MuJoCo.
//! With the rotation R of the joint, the velocity along these axes is u = R v. L(u) is the damping and friction effort
//! of each component of u. The joint's effort is τ = −Rᵀ L(u). For constant damping with three equal coefficients, the
//! choice of axes has no effect. When the body turns by δ, u changes by R (δ × v), and Rᵀ changes by −δ× Rᵀ. With the
//! slopes L′ of L, and A = Rᵀ diag(L′) R,
//!
//! ```text
//! ∂τ/∂v = −A     ∂τ/∂δ = τ× + A v×
//! ```

use super::{gravity_compensation, springs};
use condyle_linalg::check;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::layout::Single;
use condyle_spatial::elementary::tanh;
use condyle_spatial::{Constant, Dense, DenseMatrix, Mat3, Matrix, Quaternion, Scalar, Vec3, kernel};

/// Computes the passive efforts of a robot: τ = −d v − f tanh(v/ε) + springs + gravity compensation, with damping d,
/// friction f and smoothing ε.
///
/// q: nq numbers; v: nv numbers; smoothing: ε > 0, the speed (rad/s, m/s) at which the friction f tanh(v/ε) is 76 % of
/// f (tanh 1 = 0.76); tau: nv numbers (N m, N), overwritten.
///
/// - Damping and friction dissipate power. Damping may be a polynomial, d = d₀ + d₁ |v| + d₂ v²
///   ([`Model::damping_polynomial`]). The error of the smoothed friction is below 1 % for |v| ≥ 2.65 ε. A loaded joint
///   creeps instead of sticking: a load below f moves the joint with a speed of at most ε artanh(load/f). An explicit
///   integrator needs steps shorter than 2 ε m/f, where m is the inertia at the joint.
/// - A spring ([`Spring`](crate::Spring)) acts against the displacement Δ of the joint from the rest position of the
///   spring. With the coefficients k₀, k₁ and k₂ of the spring, its effort is −(k₀ + k₁ Δ + k₂ Δ²) Δ on a joint with
///   one degree of freedom, and −(k₀ + k₁ |Δ| + k₂ |Δ|²) Δ on other joints. For a spherical joint, Δ is a rotation
///   vector along the body's axes. A free or planar joint has two displacements, a translation of the origin and a
///   rotation, each with its own |Δ|. The spring of a mimic joint acts on the coordinate of the joint's leader.
/// - Gravity compensation ([`GravityCompensation`](crate::GravityCompensation)) carries a fraction of the weight of
///   each body with gravity compensation: τ = −Σ Jᵀ m g. m are the carried masses, and J the Jacobians of the points at
///   which these masses are carried.
///
/// For n bodies, the cost is O(n), plus O(depth) for each body with gravity compensation. Allocates nothing. The
/// formulas are the same as in MuJoCo (`mj_passive`).
///
/// ```
/// use condyle_dynamics::{Joint, JointOptions, ModelBuilder, Inertia, Se3, Sym3, Vec3, WORLD, passive_torque};
/// let mut robot = ModelBuilder::new("slider");
/// let I = Inertia::from_com(1.0, Vec3::zero(), Sym3::zero());
/// let losses = JointOptions { damping: 0.5, friction: 2.0, ..JointOptions::default() };
/// let x = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
/// let cart = robot.body_with(("cart", "rail"), WORLD, x, Se3::identity(), I, losses);
/// robot.spring(cart, [10.0, 0.0, 0.0], &[0.2]); // 10 N/m, at rest at 0.2 m
/// let mut tau = [0.0];
/// passive_torque(&robot.build()?, &[0.3], &[3.0], 0.01, &mut tau);
/// assert!(f64::abs(tau[0] + 0.5 * 3.0 + 2.0 + 10.0 * 0.1) < 1e-14);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `smoothing` is not positive.
#[track_caller]
pub fn passive_torque<S: Scalar, R: Constant<S>>(model: &Model<R>, q: &[S], v: &[S], smoothing: f64, tau: &mut [S]) {
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check("tau", tau.len(), model.nv());
    check_smoothing(smoothing);
    efforts(model, q, v, smoothing, tau);
}

/// Computes the exact derivatives of [`passive_torque`] with respect to q and v.
///
/// q: nq numbers; v: nv numbers; smoothing: ε > 0 (rad/s, m/s). The results are two nv × nv matrices, which are
/// overwritten: dtau_dq, in the tangent space (N m/rad, N/m), and dtau_dv (N m s/rad, N s/m). ∂τ/∂v is diagonal, except
/// for free joints with friction, polynomial damping or three unequal dampings. ∂τ/∂q has a diagonal block for each
/// spring. Gravity compensation couples the joints on the path to the root. Allocates nothing.
///
/// ```
/// use condyle_dynamics::{passive_torque_derivatives, robots};
/// use nalgebra::DMatrix;
/// let humanoid = robots::humanoid();
/// let (nv, q) = (humanoid.nv(), condyle_dynamics::neutral(&humanoid));
/// let [mut dtau_dq, mut dtau_dv] = [(); 2].map(|()| DMatrix::zeros(nv, nv));
/// passive_torque_derivatives(&humanoid, &q, &vec![0.1; nv], 0.01, &mut dtau_dq, &mut dtau_dv);
/// assert!(dtau_dv.diagonal().iter().all(|&x: &f64| x <= 0.0) && dtau_dq.amax() == 0.0); // it has no springs
/// ```
///
/// # Panics
/// Panics if an argument has the wrong shape, or `smoothing` is not positive.
#[track_caller]
pub fn passive_torque_derivatives<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    v: &[S],
    smoothing: f64,
    dtau_dq: &mut DenseMatrix<S, impl Dense<S>>,
    dtau_dv: &mut DenseMatrix<S, impl Dense<S>>,
) {
    let nv = model.nv();
    check("q", q.len(), model.nq());
    check("v", v.len(), nv);
    for (name, found) in [("dtau_dq", dtau_dq.shape()), ("dtau_dv", dtau_dv.shape())] {
        assert!(found == (nv, nv), "{name}: expected {nv} × {nv}, found {found:?}");
    }
    check_smoothing(smoothing);
    slopes(model, q, v, smoothing, dtau_dq.as_mut_slice(), dtau_dv.as_mut_slice());
}

/// Derivatives of passive efforts, as the result type for batches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassiveDerivatives<'d, S> {
    pub dtau_dq: &'d Matrix<S>,
    pub dtau_dv: &'d Matrix<S>,
}

/// Coefficients of the damping and friction of one coordinate: damping, polynomial damping and Coulomb friction.
#[derive(Clone, Copy)]
struct Loss {
    damping: f64,
    polynomial: [f64; 2],
    friction: f64,
    smoothing: f64,
}

impl Loss {
    #[inline(always)]
    fn of<R>(model: &Model<R>, k: usize, smoothing: f64) -> Self {
        let (damping, friction) = (model.damping()[k], model.friction()[k]);
        Self { damping, polynomial: model.damping_polynomial()[k], friction, smoothing }
    }

    /// Returns the effort −(d + d₁ |v| + d₂ v²) v − f tanh(v/ε).
    #[inline(always)]
    fn effort<S: Scalar>(self, v: S) -> S {
        let friction = tanh(v * S::splat(1.0 / self.smoothing)) * S::splat(self.friction);
        if self.polynomial == [0.0; 2] {
            return v.mul_add(S::splat(-self.damping), -friction);
        }
        let ([d1, d2], speed) = (self.polynomial, v.abs());
        let d = speed.mul_add(speed.mul_add(S::splat(d2), S::splat(d1)), S::splat(self.damping)); // d + d₁ |v| + d₂ v²
        v.mul_add(-d, -friction)
    }

    /// Returns the derivative of `effort` with respect to v: −d − 2 d₁ |v| − 3 d₂ v² − f/ε (1 − tanh²(v/ε)).
    #[inline(always)]
    fn slope<S: Scalar>(self, v: S) -> S {
        let t = tanh(v * S::splat(1.0 / self.smoothing));
        let friction = (S::one() - t * t) * S::splat(self.friction / self.smoothing);
        if self.polynomial == [0.0; 2] {
            return -S::splat(self.damping) - friction;
        }
        let ([d1, d2], speed) = (self.polynomial, v.abs());
        let d = speed.mul_add(speed.mul_add(S::splat(3.0 * d2), S::splat(2.0 * d1)), S::splat(self.damping));
        -d - friction
    }
}

/// Returns whether damping and friction of a free joint's linear coordinates differ between two cases: along the axes
/// of the joint's parent, and along the axes of the body.
#[inline(always)]
fn is_turned<R>(model: &Model<R>, first: usize) -> bool {
    let (d, of) = (model.damping(), first..first + 3);
    let uneven = d[first] != d[first + 1] || d[first] != d[first + 2];
    uneven
        || model.friction()[of.clone()] != [0.0; 3]
        || model.damping_polynomial()[of].iter().any(|&polynomial| polynomial != [0.0; 2])
}

/// Returns the rotation of a free joint, and the velocity of the body's origin along the axes of the body.
#[inline(always)]
fn turn<S: Scalar>(q: &[S], v: &[S]) -> (Mat3<S>, Vec3<S>) {
    (Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation(), Vec3::new(v[0], v[1], v[2]))
}

/// Returns the damping and friction effort for each component of u, or the slope of this effort if `slope` is set. u is
/// the linear velocity of a free joint along the axes of the joint's parent.
#[inline(always)]
fn each<S: Scalar, R>(model: &Model<R>, first: usize, smoothing: f64, u: Vec3<S>, slope: bool) -> Vec3<S> {
    let mut x = u.to_array();
    for k in 0..3 {
        let loss = Loss::of(model, first + k, smoothing);
        x[k] = if slope { loss.slope(x[k]) } else { loss.effort(x[k]) };
    }
    Vec3::from(x)
}

kernel! {
    /// Computes the sum of all passive efforts.
    pub(crate) fn efforts<S, R>(model: &Model<R>, q: &[S], v: &[S], smoothing: f64, tau: &mut [S]) {
        for k in 0..tau.len() {
            tau[k] = Loss::of(model, k, smoothing).effort(v[k]);
        }
        for node in &model.nodes()[1..] {
            if node.joint == Joint::FreeFlyer && is_turned(model, node.idx_v) {
                let (rotation, velocity) = turn(&q[node.idx_q..], &v[node.idx_v..]);
                let effort = each(model, node.idx_v, smoothing, rotation * velocity, false);
                let effort = rotation.transpose_mul(effort).to_array(); // τ = −Rᵀ L(R v)
                tau[node.idx_v..node.idx_v + 3].copy_from_slice(&effort);
            }
        }
        if model.springs().is_empty() && model.gravity_compensation().is_empty() {
            return;
        }
        let l = Single::new(model);
        springs::add_efforts(&l, model, q, tau);
        gravity_compensation::add_efforts(&l, model, q, tau);
    }
}

kernel! {
    /// Computes ∂τ/∂q and ∂τ/∂v of the passive efforts, as matrices stored by columns.
    pub(crate) fn slopes<S, R>(
        model: &Model<R>,
        q: &[S],
        v: &[S],
        smoothing: f64,
        dtau_dq: &mut [S],
        dtau_dv: &mut [S],
    ) {
        let nv = model.nv();
        dtau_dq.fill(S::zero());
        dtau_dv.fill(S::zero());
        for k in 0..nv {
            dtau_dv[k * (nv + 1)] = Loss::of(model, k, smoothing).slope(v[k]);
        }
        for node in &model.nodes()[1..] {
            if node.joint == Joint::FreeFlyer && is_turned(model, node.idx_v) {
                let first = node.idx_v;
                let (rotation, velocity) = turn(&q[node.idx_q..], &v[first..]);
                let u = rotation * velocity;
                let effort = rotation.transpose_mul(each(model, first, smoothing, u, false));
                let slope = each(model, first, smoothing, u, true).to_array(); // −L′(u)
                let (by_turn, moved) = (effort.skew().columns(), velocity.skew().columns());
                for k in 0..3 {
                    let mut unit = [S::zero(); 3];
                    unit[k] = S::one();
                    let by_v = stretched(rotation, slope, Vec3::from(unit)); // ∂τ/∂v = −A
                    let by_q = by_turn[k] - stretched(rotation, slope, moved[k]); // ∂τ/∂δ = τ× + A v×
                    dtau_dv[(first + k) * nv + first..][..3].copy_from_slice(&by_v.to_array());
                    dtau_dq[(first + 3 + k) * nv + first..][..3].copy_from_slice(&by_q.to_array());
                }
            }
        }
        if model.springs().is_empty() && model.gravity_compensation().is_empty() {
            return;
        }
        let l = Single::new(model);
        springs::add_slopes(&l, model, q, dtau_dq);
        gravity_compensation::add_slopes(&l, model, q, dtau_dq);
    }
}

/// Returns the product Rᵀ diag(s) R x.
#[inline(always)]
fn stretched<S: Scalar>(R: Mat3<S>, s: [S; 3], x: Vec3<S>) -> Vec3<S> {
    let u = R * x;
    R.transpose_mul(Vec3::new(s[0] * u.x, s[1] * u.y, s[2] * u.z))
}

/// Panics unless `smoothing` is positive.
#[track_caller]
pub(crate) fn check_smoothing(smoothing: f64) {
    assert!(smoothing > 0.0, "smoothing: expected a positive speed, found {smoothing}");
}
