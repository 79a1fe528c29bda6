//! Efforts of the springs of joints, and the derivatives of these efforts.
//!
//! ```text
//! τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ                        (one degree of freedom)
//! τ = −g(|Δ|) Δ,   g(r) = k₀ + k₁ r + k₂ r²     ∂τ/∂Δ = −(g 1 + (k₁/r + 2 k₂) Δ Δᵀ)     (others)
//! ```
//!
//! k₀, k₁ and k₂ are the coefficients of a spring. Δ is the displacement of the joint from the rest position q₀ or R₀
//! of the spring. For joints with one degree of freedom and for translation joints, Δ = q − q₀. For a continuous joint,
//! this angle is mapped to (−π, π]. For a spherical joint, Δ is the rotation vector log(R₀ᵀ R), and ∂Δ/∂q is the
//! Jacobian J_log(Δ) of the logarithm. A free or planar joint has two displacements, each with its own r: the
//! displacement u of the origin, along the axes of the body, and the displacement Δ of the rotation:
//!
//! ```text
//! u = Rᵀ (p − p₀),   ∂u/∂(p, θ) = [1, u×]     Δ = log(R₀ᵀ R)
//! ```
//!
//! All spring forces have a potential. The formulas are the same as in MuJoCo (`mj_passive`). On a joint with one
//! degree of freedom, k₁ makes the stiffness depend on the sign of Δ. The spring of a mimic joint uses the mimic
//! joint's own displacement, and the layout adds the spring's effort to the leader's coordinate.

use condyle_model::joint::Joint;
use condyle_model::layout::{Layout, Pairs};
use condyle_model::{Model, Spring};
use condyle_spatial::lie::{jlog3, log3};
use condyle_spatial::{Quaternion, Scalar, Vec3};

/// Minimum of |Δ|² (rad², m²). Smaller values are replaced by this minimum before the square root r is taken, to avoid
/// a division by r = 0.
const LEAST: f64 = 1e-30;

/// Returns the stiffness g at a displacement Δ of length r, and the coefficient s = k₁/r + 2 k₂ of the term Δ Δᵀ in the
/// derivative of the force.
#[inline(always)]
fn stiffness<S: Scalar>([k0, k1, k2]: [f64; 3], displacement: Vec3<S>) -> (S, S) {
    if k1 == 0.0 && k2 == 0.0 {
        return (S::splat(k0), S::zero());
    }
    let (square, least) = (displacement.norm_squared(), S::splat(LEAST));
    let r = S::select(square.lt(least), least, square).sqrt();
    let g = r.mul_add(r.mul_add(S::splat(k2), S::splat(k1)), S::splat(k0)); // k₀ + k₁ r + k₂ r²
    (g, S::splat(k1) * r.recip() + S::splat(2.0 * k2)) // k₁/r + 2 k₂
}

/// Returns the force −g Δ of a spring with stiffness g at the displacement Δ.
#[inline(always)]
fn pull<S: Scalar>(k: [f64; 3], displacement: Vec3<S>) -> Vec3<S> {
    displacement.scale(-stiffness(k, displacement).0)
}

/// Returns −(g 1 + s Δ Δᵀ) x, the derivative of the spring's force in the direction x, with the stiffness g and the
/// coefficient s from `stiffness`.
#[inline(always)]
fn slope<S: Scalar>(k: [f64; 3], displacement: Vec3<S>, x: Vec3<S>) -> Vec3<S> {
    let (g, s) = stiffness(k, displacement);
    -displacement.scale_add(s * displacement.dot(x), x.scale(g))
}

/// Returns the angle from the direction (cos₀, sin₀) to the direction (cos, sin).
#[inline(always)]
fn angle<S: Scalar>([cos, sin]: [S; 2], [cos0, sin0]: [S; 2]) -> S {
    (cos0 * sin - sin0 * cos).atan2(cos0 * cos + sin0 * sin)
}

/// Returns the rest position of a spring on a joint with one degree of freedom, as an angle or a length.
#[inline(always)]
fn rest_of_one<R>(model: &Model<R>, spring: &Spring) -> f64 {
    match model.bodies()[spring.body].joint {
        Joint::Continuous { .. } => spring.rest[1].atan2(spring.rest[0]),
        _ => spring.rest[0],
    }
}

/// Returns the displacement of a joint with one degree of freedom from the rest position of the joint's spring.
#[inline(always)]
fn displacement_of_one<L: Layout, R>(l: &L, model: &Model<R>, spring: &Spring, q: &[L::S]) -> L::S {
    let (i, rest) = (spring.body, rest_of_one(model, spring));
    let turns = |joint| matches!(joint, Joint::Continuous { .. });
    let (node, own) = (&model.nodes()[i], model.bodies()[i].joint);
    let position = l.position(q, i, 0);
    if turns(node.joint) {
        // The position of a continuous mimic joint does not include the joint's offset, because the joint's placement
        // includes this offset. So the offset is subtracted from the rest position.
        let offset = node.mimic.map_or(0.0, |mimic| mimic.offset);
        let (sin0, cos0) = Scalar::sin_cos(rest - offset);
        return angle([position, l.position(q, i, 1)], [L::S::splat(cos0), L::S::splat(sin0)]);
    }
    let displacement = position - L::S::splat(rest);
    if turns(own) {
        let (sin, cos) = displacement.sin_cos(); // the leader is not continuous, so the angle is mapped to (−π, π] here
        return sin.atan2(cos);
    }
    displacement
}

#[inline(always)]
fn vector<S: Scalar>(q: &[S]) -> Vec3<S> {
    Vec3::new(q[0], q[1], q[2])
}

#[inline(always)]
fn quaternion<S: Scalar>(q: &[S]) -> Quaternion<S> {
    Quaternion::new(q[0], q[1], q[2], q[3])
}

/// Returns the two displacements of a joint with several degrees of freedom: the displacement u of the origin and the
/// rotation vector Δ, along the axes of the body.
#[inline(always)]
fn displacements<L: Layout, R>(l: &L, model: &Model<R>, spring: &Spring, q: &[L::S]) -> (Vec3<L::S>, Vec3<L::S>) {
    let (joint, o) = (l.joint(spring.body), L::S::zero());
    let mut rest = [o; 7];
    for k in 0..joint.nq() {
        rest[k] = L::S::splat(spring.rest[k]);
    }
    let q = &q[model.nodes()[spring.body].idx_q..];
    match joint {
        Joint::Spherical => (Vec3::zero(), log3((quaternion(&rest).conjugate() * quaternion(q)).normalize())),
        Joint::Planar => {
            let (x, y, cos, sin) = (q[0] - rest[0], q[1] - rest[1], q[2], q[3]);
            let u = Vec3::new(cos * x + sin * y, cos * y - sin * x, o); // Rᵀ (p − p₀)
            (u, Vec3::new(o, o, angle([cos, sin], [rest[2], rest[3]])))
        }
        Joint::FreeFlyer => {
            let (R0, R) = (quaternion(&rest[3..]), quaternion(&q[3..]));
            let u = R.to_rotation().transpose_mul(vector(q) - vector(&rest)); // Rᵀ (p − p₀)
            (u, log3((R0.conjugate() * R).normalize())) // log(R₀ᵀ R)
        }
        _ => (vector(q) - vector(&rest), Vec3::zero()),
    }
}

/// Adds the efforts of all springs to `tau`.
#[inline(always)]
pub(super) fn add_efforts<L: Layout, R>(l: &L, model: &Model<R>, q: &[L::S], tau: &mut [L::S]) {
    for spring in model.springs() {
        let (i, k) = (spring.body, spring.stiffness);
        if l.joint(i).nv() == 1 {
            let x = displacement_of_one(l, model, spring, q);
            let g = x.mul_add(x.mul_add(L::S::splat(k[2]), L::S::splat(k[1])), L::S::splat(k[0]));
            l.add_joint_effort(tau, i, 0, -(g * x)); // τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ
            continue;
        }
        let (u, turn) = displacements(l, model, spring, q);
        let (force, moment) = (pull(k, u).to_array(), pull(k, turn).to_array());
        for (c, &axis) in l.joint(i).axes().iter().enumerate() {
            l.add_joint_effort(tau, i, c, if axis < 3 { force[axis] } else { moment[axis - 3] });
        }
    }
}

/// Adds ∂τ/∂q of all springs to an nv × nv matrix.
#[inline(always)]
pub(super) fn add_slopes<L: Pairs, R>(l: &L, model: &Model<R>, q: &[L::S], dtau_dq: &mut [L::S]) {
    for spring in model.springs() {
        let (i, k) = (spring.body, spring.stiffness);
        let (joint, support) = (l.joint(i), l.support(i));
        let own = &support[support.len() - joint.nv()..];
        if joint.nv() == 1 {
            let (x, [k0, k1, k2]) = (displacement_of_one(l, model, spring, q), [k[0], 2.0 * k[1], 3.0 * k[2]]);
            let g = x.mul_add(x.mul_add(L::S::splat(k2), L::S::splat(k1)), L::S::splat(k0));
            l.add_entry(dtau_dq, own[0], own[0], -g); // −(k₀ + 2 k₁ Δ + 3 k₂ Δ²)
            continue;
        }
        let (u, turn) = displacements(l, model, spring, q);
        for (e, &axis) in joint.axes().iter().enumerate() {
            let mut unit = [L::S::zero(); 3];
            unit[axis % 3] = L::S::one();
            let unit = Vec3::from(unit);
            let (du, mut dturn) = if axis < 3 { (unit, Vec3::zero()) } else { (u.cross(unit), unit) }; // [1, u×]
            if let (Joint::Spherical | Joint::FreeFlyer, true) = (joint, axis >= 3) {
                dturn = jlog3(turn) * unit; // ∂Δ/∂θ = J_log(Δ)
            }
            let (force, moment) = (slope(k, u, du).to_array(), slope(k, turn, dturn).to_array());
            for (d, &axis) in joint.axes().iter().enumerate() {
                l.add_entry(dtau_dq, own[d], own[e], if axis < 3 { force[axis] } else { moment[axis - 3] });
            }
        }
    }
}
