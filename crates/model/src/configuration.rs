//! Space of positions: a product of vector spaces and Lie groups. q ⊕ v is the position q moved by the tangent vector
//! v.

use crate::joint::GroupJacobian;
use crate::model::Model;
use crate::tree::Space;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_spatial::Scalar;
use condyle_spatial::simd::Kernel;
use nalgebra::DMatrix;

/// Largest magnitude (rad, m) of a random coordinate without limits.
const UNLIMITED: f64 = 3.0;

/// Returns the position in which every body is at the frame of its joint: coordinates are zero, and rotations are the
/// identity.
///
/// ```
/// use condyle_model::{neutral, robots};
/// assert_eq!(neutral(&robots::quadruped())[..7], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
/// ```
pub fn neutral<R>(model: &Model<R>) -> Vec<f64> {
    let mut q = vec![0.0; model.nq()];
    for (joint, iq, _) in model.tree.coordinates() {
        joint.neutral(&mut q[iq]);
    }
    q
}

/// Returns a uniformly distributed random position. Coordinates are between their limits, or within ±3 (rad, m) if they
/// have no limits. Rotations are drawn from the whole group. The result depends only on the model and the generator.
///
/// ```
/// use condyle_model::{random_configuration, robots};
/// use rand::SeedableRng;
/// let q = random_configuration(&robots::arm7(), &mut rand::rngs::StdRng::seed_from_u64(1));
/// assert_eq!(q.len(), 7);
/// ```
pub fn random_configuration<R>(model: &Model<R>, rng: &mut impl rand::Rng) -> Vec<f64> {
    let mut q = vec![0.0; model.nq()];
    for (joint, iq, _) in model.tree.coordinates() {
        let bound = |limits: &[f64], otherwise: f64| -> Vec<f64> {
            limits.iter().map(|&x| if x.abs() < 1e6 { x } else { otherwise }).collect()
        };
        let mut lower = bound(&model.limits.lower[iq.clone()], -UNLIMITED);
        let mut upper = bound(&model.limits.upper[iq.clone()], UNLIMITED);
        for (k, i) in iq.clone().enumerate() {
            // If a coordinate has only one limit and this limit lies outside ±3, both bounds of the range become this
            // limit.
            lower[k] = if lower[k] > upper[k] && model.limits.upper[i] == upper[k] { upper[k] } else { lower[k] };
            upper[k] = upper[k].max(lower[k]);
        }
        joint.random(rng, &lower, &upper, &mut q[iq]);
    }
    q
}

/// Computes q ⊕ v: the position reached from q by moving with the velocity v for one unit of time.
///
/// q: nq numbers; v: nv numbers; out: nq numbers. Does not allocate.
///
/// ```
/// use condyle_model::{difference, integrate, neutral, robots};
/// let quadruped = robots::quadruped();
/// let (q, v) = (neutral(&quadruped), vec![0.1; 18]);
/// let (mut moved, mut back) = (vec![0.0; 19], vec![0.0; 18]);
/// integrate(&quadruped, &q, &v, &mut moved);
/// difference(&quadruped, &q, &moved, &mut back);
/// assert!(back.iter().all(|x| (x - 0.1).abs() < 1e-15));
/// ```
///
/// # Panics
/// If an argument has the wrong length.
#[track_caller]
pub fn integrate<S: Scalar, R>(model: &Model<R>, q: &[S], v: &[S], out: &mut [S]) {
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check("out", out.len(), model.nq());
    S::enter(Integrate { model, q, v, out });
}

/// Kernel that computes q ⊕ v, compiled for the SIMD level of its scalar.
struct Integrate<'a, S, R> {
    model: &'a Model<R>,
    q: &'a [S],
    v: &'a [S],
    out: &'a mut [S],
}

impl<S: Scalar, R> Kernel for Integrate<'_, S, R> {
    #[inline(always)]
    fn run(self) {
        let Self { model, q, v, out } = self;
        for space in &model.tree.spaces {
            space.joint.integrate(&q[space.q.clone()], &v[space.v.clone()], &mut out[space.q.clone()]);
        }
    }
}

/// Computes q₁ ⊖ q₀: the tangent vector v with q₀ ⊕ v = q₁. For rotations, v is the shortest such vector.
///
/// q0, q1: nq numbers; out: nv numbers. Does not allocate.
///
/// # Panics
/// If an argument has the wrong length.
#[track_caller]
pub fn difference<S: Scalar, R>(model: &Model<R>, q0: &[S], q1: &[S], out: &mut [S]) {
    check("q0", q0.len(), model.nq());
    check("q1", q1.len(), model.nq());
    check("out", out.len(), model.nv());
    for space in &model.tree.spaces {
        space.joint.difference(&q0[space.q.clone()], &q1[space.q.clone()], &mut out[space.v.clone()]);
    }
}

/// Computes q₁ ⊖ q₀ like [`difference`], for the joints whose positions are a vector space or an angle. The other
/// entries of `out` are not changed.
#[doc(hidden)]
pub fn commuting_difference<S: Scalar, R>(model: &Model<R>, q0: &[S], q1: &[S], out: &mut [S]) {
    for space in model.tree.spaces.iter().filter(|space| space.joint.commutes()) {
        space.joint.difference(&q0[space.q.clone()], &q1[space.q.clone()], &mut out[space.v.clone()]);
    }
}

/// Computes q₀ ⊕ t (q₁ ⊖ q₀): a position on the path with constant velocity from q₀ (t = 0) to q₁ (t = 1).
///
/// q0, q1, out: nq numbers; tangent: scratch of nv numbers, which contains t (q₁ ⊖ q₀) after the call. Does not
/// allocate.
///
/// ```
/// use condyle_model::{interpolate, robots};
/// let (mut q, mut tangent) = ([0.0; 7], [0.0; 7]);
/// interpolate(&robots::arm7(), &[0.0; 7], &[1.0; 7], 0.25, &mut tangent, &mut q);
/// assert_eq!(q, [0.25; 7]);
/// ```
///
/// # Panics
/// If an argument has the wrong length.
#[track_caller]
pub fn interpolate<S: Scalar, R>(model: &Model<R>, q0: &[S], q1: &[S], t: S, tangent: &mut [S], out: &mut [S]) {
    check("tangent", tangent.len(), model.nv());
    difference(model, q0, q1, tangent);
    for x in tangent.iter_mut() {
        *x = *x * t;
    }
    integrate(model, q0, tangent, out);
}

/// Returns ‖q₁ ⊖ q₀‖. Lengths (m) and angles (rad) have equal weight.
///
/// q0, q1: nq numbers; tangent: scratch of nv numbers, which contains q₁ ⊖ q₀ after the call. Does not allocate.
///
/// # Panics
/// If an argument has the wrong length.
#[track_caller]
pub fn distance<S: Scalar, R>(model: &Model<R>, q0: &[S], q1: &[S], tangent: &mut [S]) -> S {
    check("tangent", tangent.len(), model.nv());
    difference(model, q0, q1, tangent);
    let mut sum = S::zero();
    for &x in tangent.iter() {
        sum = x.mul_add(x, sum);
    }
    sum.sqrt()
}

/// Scales quaternions and (cos, sin) pairs in q to length 1, in place. If a length is 0 or a number is not finite, the
/// result is not finite.
///
/// q: nq numbers. Does not allocate.
///
/// ```
/// use condyle_model::{neutral, normalize, robots};
/// let quadruped = robots::quadruped();
/// let mut q = neutral(&quadruped);
/// q[6] = 2.0;
/// normalize(&quadruped, &mut q);
/// assert_eq!(q, neutral(&quadruped));
/// ```
///
/// # Panics
/// If `q` does not have nq numbers.
#[track_caller]
pub fn normalize<S: Scalar, R>(model: &Model<R>, q: &mut [S]) {
    check("q", q.len(), model.nq());
    for (joint, iq, _) in model.tree.coordinates() {
        if let Some(unit) = joint.unit_part() {
            let unit = &mut q[iq][unit];
            let mut sum = S::zero();
            for &x in unit.iter() {
                sum = x.mul_add(x, sum);
            }
            let r = sum.sqrt().recip();
            for x in unit {
                *x = *x * r;
            }
        }
    }
}

/// Maps the columns of X from the tangent space at q ⊕ v to the tangent space at q. Applies the inverse of ∂(q ⊕ v)/∂q
/// to X, in place.
///
/// Components of a vector space do not change. Components of a group are turned from the body's frame at q ⊕ v to the
/// body's frame at q, by exp(v). v: nv numbers; X: nv rows. Does not allocate.
///
/// # Panics
/// If `v` does not have nv numbers or `X` does not have nv rows.
#[track_caller]
pub fn transport<S: Scalar, R>(model: &Model<R>, v: &[S], X: &mut DMatrix<S>) {
    check("v", v.len(), model.nv());
    assert!(X.nrows() == model.nv(), "X: expected {} rows, found {}", model.nv(), X.nrows());
    for (joint, _, iv) in model.tree.coordinates() {
        let mut back = [S::zero(); 6];
        for (back, &v) in back.iter_mut().zip(&v[iv.clone()]) {
            *back = -v; // uses (Ad exp(v)⁻¹)⁻¹ = Ad exp(−v)⁻¹
        }
        let Some(map) = joint.jacobian(GroupJacobian::Transport, &back[..iv.len()]) else { continue };
        for mut column in X.column_iter_mut() {
            let mut m = [S::zero(); 6];
            for (k, &axis) in joint.axes().iter().enumerate() {
                m[axis] = column[iv.start + k];
            }
            let m = (map * condyle_spatial::Motion::from(m)).to_array();
            for (k, &axis) in joint.axes().iter().enumerate() {
                column[iv.start + k] = m[axis];
            }
        }
    }
}

/// Argument of [`integrate`] with respect to which a Jacobian is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegrateArgument {
    /// Position q.
    Position,
    /// Velocity v.
    Velocity,
}

impl IntegrateArgument {
    fn jacobian(self) -> GroupJacobian {
        match self {
            Self::Position => GroupJacobian::Transport,
            Self::Velocity => GroupJacobian::Exp,
        }
    }
}

/// Computes the Jacobian ∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v between tangent spaces. J is nv × nv and block-diagonal, and does
/// not depend on q.
///
/// v: nv numbers; J is overwritten. Does not allocate.
///
/// # Panics
/// If `v` does not have nv numbers or `J` is not nv × nv.
#[track_caller]
pub fn integrate_jacobian<S: Scalar, R>(model: &Model<R>, v: &[S], argument: IntegrateArgument, J: &mut DMatrix<S>) {
    block_diagonal(model, ("v", v), argument.jacobian(), S::one(), J);
}

/// Argument of [`difference`] with respect to which a Jacobian is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DifferenceArgument {
    /// Position q₀, which is subtracted.
    From,
    /// Position q₁.
    To,
}

impl DifferenceArgument {
    /// Returns the sign s with which the Jacobian of a difference d is s · J(s · d), where J is the right Jacobian of
    /// the logarithm.
    fn sign<S: Scalar>(self) -> S {
        match self {
            Self::From => -S::one(),
            Self::To => S::one(),
        }
    }
}

/// Computes the Jacobian ∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁ between tangent spaces, given d = q₁ ⊖ q₀. J is nv × nv and
/// block-diagonal.
///
/// d: nv numbers; J is overwritten. Does not allocate.
///
/// # Panics
/// If `d` does not have nv numbers or `J` is not nv × nv.
#[track_caller]
pub fn difference_jacobian<S: Scalar, R>(model: &Model<R>, d: &[S], argument: DifferenceArgument, J: &mut DMatrix<S>) {
    block_diagonal(model, ("d", d), GroupJacobian::Log, argument.sign(), J);
}

/// Computes sign · J(sign · v), joint by joint, where J is the Jacobian `which` of the joint's Lie group. `name` is the
/// name of the tangent vector v in error messages.
#[track_caller]
fn block_diagonal<S: Scalar, R>(
    model: &Model<R>,
    (name, v): (&str, &[S]),
    which: GroupJacobian,
    sign: S,
    J: &mut DMatrix<S>,
) {
    check(name, v.len(), model.nv());
    assert!(J.shape() == (model.nv(), model.nv()), "J: expected {0} × {0}, found {1:?}", model.nv(), J.shape());
    J.as_mut_slice().fill(S::zero());
    (0..model.nv()).for_each(|k| J[(k, k)] = sign);
    group_blocks(model, v, which, sign, J);
}

/// Computes the blocks of [`integrate_jacobian`] for joints whose positions are not a vector space. The rest of J is
/// not changed.
#[doc(hidden)]
pub fn integrate_jacobian_groups<S: Scalar>(model: &Model, v: &[S], argument: IntegrateArgument, J: &mut DMatrix<S>) {
    group_blocks(model, v, argument.jacobian(), S::one(), J);
}

/// Computes the blocks of [`difference_jacobian`] for joints whose positions are not a vector space. The rest of J is
/// not changed.
#[doc(hidden)]
pub fn difference_jacobian_groups<S: Scalar>(model: &Model, d: &[S], argument: DifferenceArgument, J: &mut DMatrix<S>) {
    group_blocks(model, d, GroupJacobian::Log, argument.sign(), J);
}

/// Computes the blocks of sign · J(sign · v) for joints whose positions are not a vector space. J is the Jacobian
/// `which` of the joint's Lie group.
fn group_blocks<S: Scalar, R>(model: &Model<R>, v: &[S], which: GroupJacobian, sign: S, J: &mut DMatrix<S>) {
    for Space { joint, v: iv, .. } in model.tree.spaces.iter().filter(|space| !space.joint.commutes()) {
        let mut signed = [S::zero(); 6];
        for (signed, &v) in signed.iter_mut().zip(&v[iv.clone()]) {
            *signed = v * sign;
        }
        let Some(map) = joint.jacobian(which, &signed[..iv.len().min(6)]) else { continue };
        let columns = map.columns();
        for (k, &column) in joint.axes().iter().enumerate() {
            let column = columns[column].scale(sign).to_array();
            let to = &mut J.as_mut_slice()[(iv.start + k) * model.nv() + iv.start..][..joint.axes().len()];
            if let Ok(to) = <&mut [S; 6]>::try_from(&mut *to) {
                *to = column; // all axes, in order
            } else {
                to.iter_mut().zip(joint.axes()).for_each(|(to, &row)| *to = column[row]);
            }
        }
    }
}
