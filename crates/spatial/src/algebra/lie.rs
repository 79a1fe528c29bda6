//! Rotations and rigid motions as Lie groups: exponentials, logarithms, Jacobians.
//!
//! Results are accurate for angles near 0 and near π, with every scalar type: functions with a removable singularity
//! are computed from the entire functions of [`stumpff`]. Rotation vectors are in rad. A twist is a [`Motion`], linear
//! part first. Jacobians J are *right* Jacobians, exp(x + δ) = exp(x) exp(J δ), because tangent vectors of a
//! configuration are in the body's frame.

use crate::algebra::motion::Motion;
pub use crate::algebra::quaternion::Quaternion;
use crate::algebra::se3::Se3;
use crate::algebra::vector::{Mat3, Sym3, Vec3};
use crate::scalar::Scalar;

/// Computes the entire functions cₖ(t) = Σⱼ (−t)ʲ / (k + 2j)!, k = 0 … 5, at t = θ²:
/// cos θ, sin θ/θ, (1 − cos θ)/θ², (θ − sin θ)/θ³, (cos θ − 1 + θ²/2)/θ⁴, (sin θ − θ + θ³/6)/θ⁵.
///
/// Source: Stumpff (1959). For t < 1, c₄ and c₅ are computed by their series. The others follow from the recurrence cₖ
/// = 1/k! − t cₖ₊₂ with full relative precision, because nothing cancels. For t ≥ 1, c₀ and c₁ are computed by cosine
/// and sine, and the others by the same recurrence upwards, with errors within 1e-15.
///
/// ```
/// let c = condyle_spatial::lie::stumpff(0.0_f64);
/// assert_eq!(c, [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0]);
/// ```
#[inline(always)]
pub fn stumpff<S: Scalar>(t: S) -> [S; 6] {
    let small = t.lt(S::one());
    if S::all(small) {
        return stumpff_near(t);
    }
    // Both formulas are evaluated in every lane. Lanes that do not use the result of a formula get a valid constant, 1
    // or 0, as its argument.
    let far = stumpff_far(S::select(small, S::one(), t));
    if !S::any(small) {
        return far;
    }
    let mut c = stumpff_near(S::select(small, t, S::zero()));
    for k in 0..6 {
        c[k] = S::select(small, c[k], far[k]);
    }
    c
}

/// Reciprocal factorials: 1/k! at index k.
const INVERSE_FACTORIAL: [f64; 4] = [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0];

/// Computes the functions from the series, for t < 1.
#[inline(always)]
fn stumpff_near<S: Scalar>(t: S) -> [S; 6] {
    let (s4, s5) =
        (stumpff_series::<S, 4>(t) * S::splat(1.0 / 24.0), stumpff_series::<S, 5>(t) * S::splat(1.0 / 120.0));
    let s3 = S::splat(INVERSE_FACTORIAL[3]) - t * s5;
    let s2 = S::splat(INVERSE_FACTORIAL[2]) - t * s4;
    let s1 = S::splat(INVERSE_FACTORIAL[1]) - t * s3;
    let s0 = S::splat(INVERSE_FACTORIAL[0]) - t * s2;
    [s0, s1, s2, s3, s4, s5]
}

/// Computes the functions from the closed forms, for t ≥ 1.
#[inline(always)]
fn stumpff_far<S: Scalar>(t: S) -> [S; 6] {
    let angle = t.sqrt();
    let (sin, cos) = angle.sin_cos();
    let (r, l0, l1) = (t.recip(), cos, sin * angle.recip());
    let l2 = (S::splat(INVERSE_FACTORIAL[0]) - l0) * r;
    let l3 = (S::splat(INVERSE_FACTORIAL[1]) - l1) * r;
    let l4 = (S::splat(INVERSE_FACTORIAL[2]) - l2) * r;
    let l5 = (S::splat(INVERSE_FACTORIAL[3]) - l3) * r;
    [l0, l1, l2, l3, l4, l5]
}

/// Number of terms of the series of k! cₖ(t) in even powers of t, and in odd powers. The omitted terms are below double
/// precision for t < 1.
const TERMS: usize = 5;

/// Returns the coefficients (−1)ʲ k!/(k + 2j)! of the series of k! cₖ(t), for even j and for odd j.
const fn series_coefficients(k: u32) -> [[f64; 2]; TERMS] {
    let (mut c, mut last, mut j) = ([[0.0; 2]; TERMS], 1.0, 0);
    while j < 2 * TERMS {
        c[j / 2][j % 2] = last;
        j += 1;
        let n = k + 2 * j as u32;
        last /= -(((n - 1) * n) as f64);
    }
    c
}

/// Computes k! cₖ(t) for t < 1 as E(t²) + t O(t²), each with Horner's rule. Two short chains of products run in less
/// time than one long chain.
#[inline(always)]
fn stumpff_series<S: Scalar, const K: u32>(t: S) -> S {
    let c = const { series_coefficients(K) };
    let square = t * t;
    let (mut even, mut odd) = (S::splat(c[TERMS - 1][0]), S::splat(c[TERMS - 1][1]));
    for j in (0..TERMS - 1).rev() {
        even = even.mul_add(square, S::splat(c[j][0]));
        odd = odd.mul_add(square, S::splat(c[j][1]));
    }
    odd.mul_add(t, even)
}

/// Computes the exponential of a rotation vector w: the rotation by the angle |w| about the axis w.
#[inline(always)]
pub fn exp3<S: Scalar>(w: Vec3<S>) -> Quaternion<S> {
    let [cos, sinc, ..] = stumpff(w.norm_squared() * S::splat(0.25)); // Stumpff functions at half the angle
    Quaternion { vector: w.scale(sinc * S::splat(0.5)), scalar: cos }
}

/// Returns the rotation vector of a rotation. Its length is at most π.
#[inline(always)]
pub fn log3<S: Scalar>(q: Quaternion<S>) -> Vec3<S> {
    // q and −q are the same rotation; the logarithm is taken of the quaternion with w ≥ 0
    let negative = q.scalar.lt(S::zero());
    let v = q.vector.scale(S::select(negative, S::splat(-1.0), S::one()));
    let w = S::select(negative, -q.scalar, q.scalar);
    // With n = |v| for the quaternion (v, w), the angle is θ = 2 atan(n/w). Near 0, θ/n = (2/w)(1 − r/3 + r²/5 − …)
    // with r = n²/w².
    let n2 = v.norm_squared();
    let small = n2.lt(S::splat(1e-3));
    let half = if S::all(small) {
        log3_near(n2, w)
    } else {
        let n = S::select(small, S::one(), n2).sqrt();
        let far = n.atan2(w) * n.recip();
        if S::any(small) {
            let near = log3_near(S::select(small, n2, S::zero()), S::select(small, w, S::one()));
            S::select(small, near, far)
        } else {
            far
        }
    };
    v.scale(half * S::splat(2.0))
}

/// Computes θ/(2n) from its series, for a quaternion with a vector part of length n near 0 and the angle θ.
#[inline(always)]
fn log3_near<S: Scalar>(n2: S, w: S) -> S {
    let r = n2 * (w * w).recip();
    let mut sum = S::splat(1.0 / 15.0);
    for k in [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = S::splat(1.0 / k) - r * sum;
    }
    sum * w.recip()
}

/// Returns the coefficient a = 1/θ² − (cot(θ/2))/(2θ) of w×² in the inverse Jacobians, and its derivative a' with
/// respect to t = θ².
///
/// With cₖ at the angle θ/2, a = (c₂ − c₃)/(4 c₁). From cₖ' = (k cₖ₊₂ − cₖ₊₁)/2 follows a' = a²/2 − (c₃ − 3 c₄ + 3
/// c₅)/(32 c₁).
#[inline(always)]
fn inverse_coefficient<S: Scalar>(t: S) -> [S; 2] {
    let c = stumpff(t * S::splat(0.25));
    let r = (c[1] * S::splat(4.0)).recip();
    let a = (c[2] - c[3]) * r;
    [a, a * a * S::splat(0.5) - (c[3] - (c[4] - c[5]) * S::splat(3.0)) * r * S::splat(0.125)]
}

/// Returns 1 + a w× + b w×².
#[inline(always)]
fn rotation_series<S: Scalar>(w: Vec3<S>, a: S, b: S) -> Mat3<S> {
    // [w]ₓ² = w wᵀ − |w|² 1
    let bw = w.scale(b);
    let square = Mat3 { x: w.scale(bw.x), y: w.scale(bw.y), z: w.scale(bw.z) };
    (square + w.scale(a).skew()).add_diagonal(S::one() - bw.dot(w))
}

/// Returns the right Jacobian of [`exp3`]: 1 − c₂ w× + c₃ w×², with the functions cₖ of `stumpff` at |w|².
#[inline(always)]
pub fn jexp3<S: Scalar>(w: Vec3<S>) -> Mat3<S> {
    let c = stumpff(w.norm_squared());
    rotation_series(w, -c[2], c[3])
}

/// Returns the inverse of [`jexp3`], the right Jacobian of [`log3`]: 1 + w×/2 + (1/θ² − cot(θ/2)/(2θ)) w×² with θ =
/// |w|.
#[inline(always)]
pub fn jlog3<S: Scalar>(w: Vec3<S>) -> Mat3<S> {
    rotation_series(w, S::splat(0.5), inverse_coefficient(w.norm_squared())[0])
}

/// Computes the exponential of a twist: the pose reached by moving with the twist for one unit of time.
///
/// Returns the rotation as a quaternion, as in configurations, and the translation V v with V = 1 + c₂ w× + c₃ w×².
/// Here v and w are the linear and angular parts of the twist, and cₖ are the functions of `stumpff` at |w|².
#[inline(always)]
pub fn exp6<S: Scalar>(m: Motion<S>) -> (Quaternion<S>, Vec3<S>) {
    let c = stumpff(m.angular.norm_squared());
    (exp3(m.angular), rotation_series(m.angular, c[2], c[3]) * m.linear)
}

/// Returns the twist [V⁻¹ p; w] of a pose with translation p and rotation vector w, with V as in [`exp6`]. The angle
/// |w| is at most π.
#[inline(always)]
pub fn log6<S: Scalar>(rotation: Quaternion<S>, translation: Vec3<S>) -> Motion<S> {
    let w = log3(rotation);
    let V_inverse = rotation_series(w, S::splat(-0.5), inverse_coefficient(w.norm_squared())[0]);
    Motion { linear: V_inverse * translation, angular: w }
}

/// Linear map of motions: [[A, B], [0, A]] on [linear; angular]. The angular part of the result depends only on the
/// angular part of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionMap<S> {
    /// Block A: maps the linear part to the linear part, and the angular part to the angular part.
    pub diagonal: Mat3<S>,
    /// Block B: maps the angular part to the linear part.
    pub coupling: Mat3<S>,
}

impl<S: Scalar> MotionMap<S> {
    /// Returns the map that the pose aXb defines: from motions in b to motions in a.
    #[inline(always)]
    pub fn adjoint(aXb: Se3<S>) -> Self {
        Self { diagonal: aXb.rotation, coupling: aXb.translation.skew() * aXb.rotation }
    }
    /// Returns the six columns: the images of the six unit motions, in order.
    #[inline(always)]
    pub fn columns(self) -> [Motion<S>; 6] {
        let (A, B, o) = (self.diagonal, self.coupling, Vec3::zero());
        [
            Motion::new(A.x, o),
            Motion::new(A.y, o),
            Motion::new(A.z, o),
            Motion::new(B.x, A.x),
            Motion::new(B.y, A.y),
            Motion::new(B.z, A.z),
        ]
    }
}

impl<S: Scalar> core::ops::Mul<Motion<S>> for MotionMap<S> {
    type Output = Motion<S>;
    #[inline(always)]
    fn mul(self, m: Motion<S>) -> Motion<S> {
        Motion { linear: self.diagonal * m.linear + self.coupling * m.angular, angular: self.diagonal * m.angular }
    }
}

impl<S: Scalar> core::ops::Mul for MotionMap<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self { diagonal: self.diagonal * o.diagonal, coupling: self.diagonal * o.coupling + self.coupling * o.diagonal }
    }
}

/// Returns the map [[A, B], [0, A]] with A = 1 + a w× + b w×² for the twist (v, w). B is the derivative of A with
/// respect to w along v.
///
/// `da` and `db` are the derivatives a', b' with respect to |w|². B = y× + w× x× + x× w×,
/// with y = a v + 2 a' (v·w) w and x = b v + b' (v·w) w.
#[inline(always)]
fn series_map<S: Scalar>(
    Motion { linear: v, angular: w }: Motion<S>,
    [a, b]: [S; 2],
    [da, db]: [S; 2],
) -> MotionMap<S> {
    let along = w.scale(v.dot(w));
    let (y, x) = (v.scale(a) + along.scale(da + da), v.scale(b) + along.scale(db));
    let twice = x.dot(w) * S::splat(-2.0);
    // w× x× = x wᵀ − w·x 1
    let coupling = Sym3::outer_sum(w, x).add_diagonal(twice).full() + y.skew();
    MotionMap { diagonal: rotation_series(w, a, b), coupling }
}

/// Returns the right Jacobian of [`exp6`]: [[J, J'], [0, J]] with J = [`jexp3`]. J' is the derivative of J along the
/// linear part.
///
/// Source: Barfoot and Furgale (2014), equations 100 and 102. The code computes J' as a derivative along a vector,
/// which takes less code than both equations.
#[inline(always)]
pub fn jexp6<S: Scalar>(m: Motion<S>) -> MotionMap<S> {
    let [_, _, c2, c3, c4, c5] = stumpff(m.angular.norm_squared());
    let half = S::splat(0.5);
    // cₖ' = (k cₖ₊₂ − cₖ₊₁)/2
    series_map(m, [-c2, c3], [c3 * half - c4, c5 * S::splat(1.5) - c4 * half])
}

/// Returns the inverse of [`jexp6`], the right Jacobian of [`log6`], at the twist m: [[J, J'], [0, J]] with J =
/// [`jlog3`]. J' is the derivative of J along the linear part.
#[inline(always)]
pub fn jlog6<S: Scalar>(m: Motion<S>) -> MotionMap<S> {
    let [a, da] = inverse_coefficient(m.angular.norm_squared());
    series_map(m, [S::splat(0.5), a], [S::zero(), da])
}
