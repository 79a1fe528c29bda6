//! Tests of one generic function with every scalar type: values and derivatives agree.
#![allow(non_snake_case)]

use condyle_spatial::{Constant, Scalar, Vec3, lie};
use num_dual::{Dual, Dual2_64, Dual3_64, Dual64, DualSVec64, HyperDual64, HyperHyperDual64};

/// Rounding error of some tens of operations on numbers of about 1, in double precision.
const ROUNDING: f64 = 1e-14;
/// Rounding error of the same operations in single precision.
const ROUNDING_F32: f64 = 1e-5;
/// Error of central differences with a step of 1e-5: the sum of step² and rounding error/step.
const DIFFERENCES: f64 = 1e-8;
/// Error of central second differences with a step of 1e-4.
const SECOND_DIFFERENCES: f64 = 1e-6;

const AT: [f64; 3] = [0.7, -0.4, 1.3];

/// Function that uses every operation of a scalar.
fn everything<S: Scalar>(x: S, y: S, z: S) -> S {
    let (sin, cos) = (x * y).sin_cos();
    let smaller = S::select(S::and(x.lt(z), y.lt(z)), x * x, z * z * z);
    let other = S::select(S::or(z.lt(x), y.lt(x)), y * z, x);
    let mut sum = sin.mul_add(z, cos) - x.recip() + y.abs().sqrt() + y.atan2(x) + x.atan2(-z) / z;
    sum += smaller + S::splat(0.25);
    sum -= other * S::one() + S::zero();
    sum
}

fn f(x: [f64; 3]) -> f64 {
    everything(x[0], x[1], x[2])
}

/// Returns the gradient and the matrix of second derivatives by central differences.
fn differences() -> ([f64; 3], [[f64; 3]; 3]) {
    let moved = |steps: &[(usize, f64)]| {
        let mut x = AT;
        steps.iter().for_each(|&(k, h)| x[k] += h);
        f(x)
    };
    let gradient = core::array::from_fn(|k| (moved(&[(k, 1e-5)]) - moved(&[(k, -1e-5)])) / 2e-5);
    let h = 1e-4;
    let second = |j: usize, k: usize| {
        let s = |a: f64, b: f64| moved(&[(j, a * h), (k, b * h)]);
        (s(1.0, 1.0) - s(1.0, -1.0) - s(-1.0, 1.0) + s(-1.0, -1.0)) / (4.0 * h * h)
    };
    (gradient, core::array::from_fn(|j| core::array::from_fn(|k| second(j, k))))
}

fn seed(k: usize, j: usize) -> f64 {
    f64::from(u8::from(k == j))
}

#[test]
fn floats() {
    let single = everything(AT[0] as f32, AT[1] as f32, AT[2] as f32);
    assert!((f64::from(single) - f(AT)).abs() < ROUNDING_F32);
    assert_eq!((f64::LANES, f32::LANES, Dual64::LANES, <Dual<Dual64> as Scalar>::LANES), (1, 1, 1, 1));
    assert_eq!(<f64 as Constant<f32>>::lift(0.5), 0.5_f32);
    assert_eq!(<f64 as Constant<Dual64>>::lift(0.5), Dual64::new(0.5, 0.0));
}

#[test]
fn first_derivatives() {
    let (gradient, _) = differences();
    let x: [DualSVec64<3>; 3] = core::array::from_fn(|k| {
        DualSVec64::new(AT[k], num_dual::Derivative::derivative_generic(nalgebra::U3, nalgebra::U1, k))
    });
    let all = everything(x[0], x[1], x[2]);
    assert!((all.re - f(AT)).abs() < ROUNDING);
    let all = all.eps.unwrap_generic(nalgebra::U3, nalgebra::U1);
    for k in 0..3 {
        let x: [Dual64; 3] = core::array::from_fn(|j| Dual64::new(AT[j], seed(j, k)));
        let one = everything(x[0], x[1], x[2]);
        assert!((one.re - f(AT)).abs() < ROUNDING);
        assert!((one.eps - gradient[k]).abs() < DIFFERENCES, "{k}: {} and {}", one.eps, gradient[k]);
        assert!((one.eps - all[k]).abs() < ROUNDING);
    }
}

#[test]
fn second_derivatives() {
    let (_, second) = differences();
    for j in 0..3 {
        for k in 0..3 {
            let hyper: [HyperDual64; 3] =
                core::array::from_fn(|i| HyperDual64::new(AT[i], seed(i, j), seed(i, k), 0.0));
            let hyper = everything(hyper[0], hyper[1], hyper[2]).eps1eps2;
            assert!((hyper - second[j][k]).abs() < SECOND_DIFFERENCES, "{j} {k}: {hyper} and {}", second[j][k]);
            let nested: [Dual<Dual64>; 3] =
                core::array::from_fn(|i| Dual::new(Dual64::new(AT[i], seed(i, j)), Dual64::new(seed(i, k), 0.0)));
            let nested = everything(nested[0], nested[1], nested[2]).eps.eps;
            assert!((hyper - nested).abs() < ROUNDING, "{j} {k}: {hyper} and {nested}");
        }
        let dual2: [Dual2_64; 3] = core::array::from_fn(|i| Dual2_64::new(AT[i], seed(i, j), 0.0));
        let dual3: [Dual3_64; 3] = core::array::from_fn(|i| Dual3_64::new(AT[i], seed(i, j), 0.0, 0.0));
        let hyper3: [HyperHyperDual64; 3] = core::array::from_fn(|i| {
            HyperHyperDual64::new(AT[i], seed(i, j), seed(i, j), seed(i, j), 0.0, 0.0, 0.0, 0.0)
        });
        let (d2, d3) = (everything(dual2[0], dual2[1], dual2[2]), everything(dual3[0], dual3[1], dual3[2]));
        let h3 = everything(hyper3[0], hyper3[1], hyper3[2]);
        assert!((d2.v2 - second[j][j]).abs() < SECOND_DIFFERENCES);
        assert!((d2.v2 - d3.v2).abs() < ROUNDING && (d3.v3 - h3.eps1eps2eps3).abs() < 100.0 * ROUNDING);
    }
}

/// Checks atan2 on every half axis and in every quadrant, with the derivatives ∂/∂y = x/r², ∂/∂x = −y/r².
#[test]
fn atan2_of_duals() {
    for (y, x) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 2.0), (0.0, -2.0), (1.0, 2.0), (2.0, -1.0), (-2.0, -1.0), (-1.0, 2.0)]
    {
        let r2: f64 = x * x + y * y;
        let by_y = Scalar::atan2(Dual64::new(y, 1.0), Dual64::new(x, 0.0));
        let by_x = Scalar::atan2(Dual64::new(y, 0.0), Dual64::new(x, 1.0));
        assert_eq!((by_y.re, by_x.re), (y.atan2(x), y.atan2(x)));
        assert!((by_y.eps - x / r2).abs() < ROUNDING && (by_x.eps + y / r2).abs() < ROUNDING, "{y} {x}: {by_y} {by_x}");
        // ∂²/∂x∂y = (y² − x²)/r⁴
        let mixed = Scalar::atan2(HyperDual64::new(y, 1.0, 0.0, 0.0), HyperDual64::new(x, 0.0, 1.0, 0.0));
        assert!((mixed.eps1eps2 - (y * y - x * x) / (r2 * r2)).abs() < ROUNDING, "{y} {x}: {mixed}");
        let nested = Scalar::atan2(
            Dual::new(Dual64::new(y, 1.0), Dual64::new(0.0, 0.0)),
            Dual::new(Dual64::new(x, 0.0), Dual64::new(1.0, 0.0)),
        );
        assert!((nested.eps.eps - mixed.eps1eps2).abs() < ROUNDING);
        assert_eq!(nested.re.re, y.atan2(x));
    }
}

/// Converts rotation vectors to quaternions and back in single precision, for angles up to π.
#[test]
fn single_precision() {
    for k in 0..64 {
        let angle = core::f32::consts::PI * k as f32 / 64.0;
        let w = Vec3::new(0.6 * angle, 0.0, -0.8 * angle);
        let back = lie::log3(lie::exp3(w));
        assert!((back - w).norm_squared().sqrt() < 2e-6, "{angle}: {back:?}");
    }
}
