//! Tests of rotations and rigid motions: exponentials are compared with logarithms and matrix exponentials, Jacobians
//! with dual numbers.
#![allow(non_snake_case)]

mod common;

use common::{axis, config, distance, flat, pose, rotation_vector, twist, vec3};
use condyle_spatial::lie::{self, MotionMap};
use condyle_spatial::{Act, Mat3, Motion, Quaternion, Scalar, Se3, Vec3};
use core::f64::consts::{PI, TAU};
use nalgebra::{Matrix3, Matrix4, Vector3};
use num_dual::{Dual, Dual64};
use proptest::prelude::*;

/// Rounding error of a dozen operations on numbers between 1 and 4.
const ROUNDING: f64 = 2e-14;
/// Rounding error of nalgebra's matrix exponential. This error is larger than the error of `exp6`, because nalgebra
/// scales the matrix and squares the result.
const MATRIX_EXPONENTIAL: f64 = 1e-12;

fn four(q: Quaternion<f64>) -> [f64; 4] {
    [q.vector.x, q.vector.y, q.vector.z, q.scalar]
}

/// Returns the dual numbers x + ε d with the dual unit ε, one per component.
fn dual(x: Vec3<f64>, d: Vec3<f64>) -> Vec3<Dual64> {
    let (x, d) = (x.to_array(), d.to_array());
    core::array::from_fn(|k| Dual64::new(x[k], d[k])).into()
}

fn real(x: Vec3<Dual64>) -> Vec3<f64> {
    x.to_array().map(|x| x.re).into()
}

fn eps(x: Vec3<Dual64>) -> Vec3<f64> {
    x.to_array().map(|x| x.eps).into()
}

fn basis(k: usize) -> Motion<f64> {
    core::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }).into()
}

fn is_identity(A: MotionMap<f64>, tolerance: f64) -> bool {
    distance(flat(A.diagonal), flat(Mat3::identity())) < tolerance && distance(flat(A.coupling), [0.0; 9]) < tolerance
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn log3_undoes_exp3(w in rotation_vector()) {
        prop_assert!(distance(lie::log3(lie::exp3(w)).to_array(), w.to_array()) < ROUNDING);
    }

    /// Checks rotations by more than π: their logarithm is the shorter rotation in the opposite direction.
    #[test]
    fn log3_is_the_shortest(n in axis(), angle in PI + 1e-9..TAU) {
        let w = lie::log3(lie::exp3(n.scale(angle)));
        prop_assert!(distance(w.to_array(), n.scale(angle - TAU).to_array()) < ROUNDING);
    }

    #[test]
    fn exp3_undoes_log3(q in (vec3(), -2.0..2.0).prop_filter("a direction", |(v, _)| v.norm_squared() > 1e-6)) {
        let q = Quaternion { vector: q.0, scalar: q.1 }.normalize();
        let back = lie::exp3(lie::log3(q));
        let sign = if q.scalar < 0.0 { -1.0 } else { 1.0 }; // q and −q are the same rotation
        prop_assert!(distance(four(back), four(q).map(|x| sign * x)) < ROUNDING);
    }

    #[test]
    fn exp3_is_the_matrix_exponential(w in rotation_vector()) {
        let W = Matrix3::new(0.0, -w.z, w.y, w.z, 0.0, -w.x, -w.y, w.x, 0.0);
        let R = flat(lie::exp3(w).to_rotation());
        prop_assert!(distance(R, W.exp().as_slice()) < MATRIX_EXPONENTIAL);
    }

    #[test]
    fn exp6_is_the_matrix_exponential(m in twist()) {
        let (v, w) = (m.linear, m.angular);
        let T = Matrix4::new(
            0.0, -w.z, w.y, v.x,
            w.z, 0.0, -w.x, v.y,
            -w.y, w.x, 0.0, v.z,
            0.0, 0.0, 0.0, 0.0,
        );
        let (q, p) = lie::exp6(m);
        let expected = T.exp();
        let (rotation, translation) = (expected.fixed_view::<3, 3>(0, 0), expected.fixed_view::<3, 1>(0, 3));
        prop_assert!(distance(flat(q.to_rotation()), rotation.into_owned().as_slice()) < MATRIX_EXPONENTIAL);
        prop_assert!(distance(p.to_array(), translation.into_owned().as_slice()) < MATRIX_EXPONENTIAL);
    }

    #[test]
    fn log6_undoes_exp6(m in twist()) {
        let (q, p) = lie::exp6(m);
        prop_assert!(distance(lie::log6(q, p).to_array(), m.to_array()) < ROUNDING);
    }

    #[test]
    fn exp6_undoes_log6(X in pose()) {
        let (q, p) = lie::exp6(lie::log6(Quaternion::from_rotation(X.rotation), X.translation));
        prop_assert!(distance(flat(q.to_rotation()), flat(X.rotation)) < ROUNDING);
        prop_assert!(distance(p.to_array(), X.translation.to_array()) < ROUNDING);
    }

    /// Checks that the Jacobian J of exp satisfies exp(w + ε d) = exp(w) exp(ε J d) for the dual unit ε.
    #[test]
    fn jexp3_is_the_derivative(w in rotation_vector(), stretch in 0.0..2.0, d in vec3()) {
        let w = w.scale(stretch); // up to angles of 2π
        let q = lie::exp3(dual(w, d));
        let still = Quaternion { vector: real(q.vector), scalar: q.scalar.re };
        let turn = Quaternion { vector: eps(q.vector), scalar: q.scalar.eps };
        let d_body = (still.conjugate() * turn).vector.scale(2.0);
        prop_assert!(distance((lie::jexp3(w) * d).to_array(), d_body.to_array()) < ROUNDING);
    }

    /// Checks that the Jacobian J of log satisfies log(exp(w) exp(ε d)) = w + ε J d for the dual unit ε.
    #[test]
    fn jlog3_is_the_derivative(w in rotation_vector(), d in vec3()) {
        let turned = lie::exp3(dual(w, Vec3::zero())) * lie::exp3(dual(Vec3::zero(), d));
        let derivative = eps(lie::log3(turned));
        prop_assert!(distance((lie::jlog3(w) * d).to_array(), derivative.to_array()) < ROUNDING);
    }

    #[test]
    fn jexp6_is_the_derivative(m in twist(), stretch in 0.0..2.0, d_linear in vec3(), d_angular in vec3()) {
        let m = Motion::new(m.linear, m.angular.scale(stretch));
        let (q, p) = lie::exp6(Motion { linear: dual(m.linear, d_linear), angular: dual(m.angular, d_angular) });
        let still = Quaternion { vector: real(q.vector), scalar: q.scalar.re };
        let turn = Quaternion { vector: eps(q.vector), scalar: q.scalar.eps };
        let angular = (still.conjugate() * turn).vector.scale(2.0);
        let linear = still.to_rotation().transpose_mul(eps(p));
        let expected = lie::jexp6(m) * Motion::new(d_linear, d_angular);
        prop_assert!(distance(expected.to_array(), Motion::new(linear, angular).to_array()) < 5.0 * ROUNDING);
    }

    #[test]
    fn jlog6_is_the_derivative(m in twist(), d_linear in vec3(), d_angular in vec3()) {
        let o = Vec3::zero();
        let (q, p) = lie::exp6(Motion { linear: dual(m.linear, o), angular: dual(m.angular, o) });
        let (dq, dp) = lie::exp6(Motion { linear: dual(o, d_linear), angular: dual(o, d_angular) });
        let moved = lie::log6(q * dq, p + q.to_rotation() * dp);
        let expected = lie::jlog6(m) * Motion::new(d_linear, d_angular);
        let found = Motion::new(eps(moved.linear), eps(moved.angular));
        prop_assert!(distance(expected.to_array(), found.to_array()) < 5.0 * ROUNDING);
    }

    #[test]
    fn jexp_and_jlog_are_inverse(m in twist()) {
        let one = lie::jexp3(m.angular) * lie::jlog3(m.angular);
        prop_assert!(distance(flat(one), flat(Mat3::identity())) < ROUNDING);
        prop_assert!(is_identity(lie::jexp6(m) * lie::jlog6(m), 5.0 * ROUNDING));
        prop_assert!(is_identity(lie::jlog6(m) * lie::jexp6(m), 5.0 * ROUNDING));
    }

    #[test]
    fn adjoint_is_the_action(X in pose(), m in twist()) {
        let map = MotionMap::adjoint(X);
        prop_assert!(distance((map * m).to_array(), X.act(m).to_array()) < ROUNDING);
        for (k, column) in map.columns().into_iter().enumerate() {
            prop_assert!(distance(column.to_array(), X.act(basis(k)).to_array()) < ROUNDING);
        }
    }

    /// Checks the conversion of a quaternion to a matrix and back. All four branches are covered: the largest component
    /// is x, y, z or w.
    #[test]
    fn quaternion_and_rotation(q in prop::array::uniform4(-1.0..1.0), large in 0..4_usize) {
        let mut q = q;
        q[large] += 2.0;
        let q = Quaternion::new(q[0], q[1], q[2], q[3]).normalize();
        let R = q.to_rotation();
        let back = Quaternion::from_rotation(R);
        let sign = if four(q)[large] * four(back)[large] < 0.0 { -1.0 } else { 1.0 };
        prop_assert!(distance(four(back), four(q).map(|x| sign * x)) < ROUNDING);
        let peer = nalgebra::Quaternion::new(q.scalar, q.vector.x, q.vector.y, q.vector.z);
        let peer = nalgebra::UnitQuaternion::new_normalize(peer).to_rotation_matrix();
        prop_assert!(distance(flat(R), peer.matrix().as_slice()) < ROUNDING);
    }

    #[test]
    fn quaternion_product(a in rotation_vector(), b in rotation_vector()) {
        let (a, b) = (lie::exp3(a), lie::exp3(b));
        prop_assert!(distance(flat((a * b).to_rotation()), flat(a.to_rotation() * b.to_rotation())) < ROUNDING);
        prop_assert!(distance(four(a * a.conjugate()), four(Quaternion::identity())) < ROUNDING);
    }

    /// Checks the conversion of poses from and to nalgebra. Half turns are included, because their rotation matrices
    /// are symmetric and iterative methods fail on them.
    #[test]
    fn nalgebra_isometry(X in pose(), x in vec3()) {
        let peer = nalgebra::Isometry3::from(X);
        let moved = peer * nalgebra::Point3::from(Vector3::from(x.to_array()));
        prop_assert!(distance(X.act(x).to_array(), moved.coords.as_slice()) < ROUNDING);
        let back = Se3::from(peer);
        prop_assert!(distance(flat(back.rotation), flat(X.rotation)) < ROUNDING);
        prop_assert!(distance(back.translation.to_array(), X.translation.to_array()) < ROUNDING);
    }
}

/// Checks the logarithm of half turns. Both signs of the rotation vector are correct.
#[test]
fn log3_of_half_turns() {
    for w in [[PI, 0.0, 0.0], [0.0, -PI, 0.0], [0.0, 0.6 * PI, 0.8 * PI], [PI / 3.0, -2.0 * PI / 3.0, 2.0 * PI / 3.0]] {
        let back = lie::log3(lie::exp3(Vec3::from(w))).to_array();
        assert!(distance(back, w).min(distance(back.map(|x| -x), w)) < ROUNDING, "{w:?}: {back:?}");
    }
}

/// Checks second derivatives at the removable singularity w = 0: the derivative of J_exp(w) d along e is −½ e × d.
#[test]
fn second_derivatives_at_zero() {
    type Second = Dual<Dual64>;
    let (d, e) = ([0.3, -0.2, 0.9], [0.5, 0.7, -0.4]);
    let cross = Vec3::from(e).cross(Vec3::from(d)).to_array();
    let J: Mat3<Dual64> = lie::jexp3(dual(Vec3::zero(), e.into()));
    let moved = J * dual(d.into(), Vec3::zero());
    assert!(distance(eps(moved).to_array(), cross.map(|x| -0.5 * x)) < ROUNDING);
    // the composition log(exp(w)) is the identity: its first derivative is 1 and its second derivative is 0
    let w: [Second; 3] = core::array::from_fn(|k| Dual::new(Dual64::new(0.0, d[k]), Dual64::new(e[k], 0.0)));
    let back = lie::log3(lie::exp3(Vec3::from(w))).to_array();
    assert!(distance(back.map(|x| x.re.eps), d) < ROUNDING);
    assert!(distance(back.map(|x| x.eps.re), e) < ROUNDING);
    assert!(distance(back.map(|x| x.eps.eps), [0.0; 3]) < ROUNDING);
}

/// Returns cₖ(n/64) with an error of 2⁻⁹⁰, from its series in integer arithmetic.
fn stumpff_exactly(k: u32, n: i128) -> f64 {
    const ONE: i128 = 1 << 100;
    let mut term = ONE / (1..=i128::from(k)).product::<i128>();
    let mut sum = term;
    for j in 0..60 {
        let m = i128::from(k) + 2 * j;
        term = -term * n / (64 * (m + 1) * (m + 2));
        sum += term;
    }
    sum as f64 / ONE as f64
}

/// Checks the error of the Stumpff functions cₖ(t). Below t = 1, the error is the rounding error relative to cₖ. Above
/// 1, the recurrence adds the rounding errors of sine and cosine twice, relative to 1.
#[test]
fn stumpff_functions() {
    const ABSOLUTE: f64 = 4.0 * f64::EPSILON;
    const SERIES: f64 = 2.0 * f64::EPSILON;
    let mut worst = [0f64; 6];
    for n in 0..=40 * 64 {
        let t = n as f64 / 64.0;
        for (k, c) in lie::stumpff(t).into_iter().enumerate() {
            let expected = stumpff_exactly(k as u32, n);
            let error = (c - expected).abs();
            if t < 1.0 {
                assert!(error <= SERIES * expected.abs(), "c{k}({t}) = {c}, expected {expected}");
            }
            assert!(error <= ABSOLUTE, "c{k}({t}) = {c}, expected {expected}");
            worst[k] = worst[k].max(error / expected.abs().max(1e-3));
        }
    }
    println!("largest relative errors: {}", worst.map(|x| format!("{x:.1e}")).join(" "));
}

#[test]
fn stumpff_is_continuous_at_the_switch() {
    let (below, above) = (lie::stumpff(1f64.next_down()), lie::stumpff(1.0));
    assert!(distance(below, above) < 4.0 * f64::EPSILON);
    // the derivatives satisfy c_k' = (k c_{k+2} − c_{k+1}) / 2, so the derivatives are continuous, too
    for t in [1f64.next_down(), 1.0, 1e-300, 0.0, 9.0] {
        let c = lie::stumpff(Dual64::new(t, 1.0));
        for k in 0..4 {
            let expected = 0.5 * (k as f64 * c[k + 2].re - c[k + 1].re);
            assert!((c[k].eps - expected).abs() < 8.0 * f64::EPSILON, "c{k}'({t}) = {}, expected {expected}", c[k].eps);
        }
        assert!(c.iter().all(|c| c.eps.is_finite()));
    }
}

/// Checks that NaN gives NaN. Lanes with NaN take the same branch as lanes with large t, and nothing panics.
#[test]
fn stumpff_of_nan_is_nan() {
    assert!(lie::stumpff(f64::NAN).iter().all(|c| c.is_nan()));
    assert!(lie::log3(Quaternion::new(f64::NAN, 0.0, 0.0, 1.0)).x.is_nan());
    assert_eq!(f64::select(f64::NAN.lt(1.0), 1.0, 2.0), 2.0);
}
