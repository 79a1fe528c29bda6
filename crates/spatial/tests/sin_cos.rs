//! Sine and cosine of `f64` and `f32` in this crate, compared with the platform's functions.

use condyle_spatial::Scalar;

/// Error bound: 2.3e-16 for this crate, plus half a unit in the last place of numbers below 1 for the platform.
const DOUBLE: f64 = 2.3e-16 + 0.6e-16;
/// Error bound in single precision: a few rounding errors.
const SINGLE: f64 = 2e-7;

/// Returns angles of all magnitudes, including multiples of π/4 and numbers next to them.
fn angles(largest: f64) -> impl Iterator<Item = f64> {
    let steps = 400_000;
    let spread = (0..=steps).map(move |k| largest * (2.0 * f64::from(k) / f64::from(steps) - 1.0));
    let small = (0..2_000).map(|k| 1e-9 * 1.01_f64.powi(k)).take_while(move |&x| x < largest);
    let eighths = (-2_000..2_000).flat_map(|k| {
        let x = f64::from(k) * core::f64::consts::FRAC_PI_4;
        [x.next_down(), x, x.next_up()]
    });
    spread.chain(small).chain(eighths)
}

#[test]
fn double_precision() {
    for x in angles(1e5) {
        let ((sin, cos), (s, c)) = (Scalar::sin_cos(x), x.sin_cos());
        assert!((sin - s).abs() <= DOUBLE && (cos - c).abs() <= DOUBLE, "{x}: {sin} {cos}, expected {s} {c}");
    }
}

#[test]
fn single_precision() {
    for x in angles(8192.0) {
        let x = x as f32;
        let ((sin, cos), (s, c)) = (Scalar::sin_cos(x), f64::from(x).sin_cos());
        let off = (f64::from(sin) - s).abs().max((f64::from(cos) - c).abs());
        assert!(off <= SINGLE, "{x}: {sin} {cos}, expected {s} {c}");
    }
}

/// Checks angles beyond the limit of the crate's method. For such angles, the three parts of π/2 are not exact enough,
/// so the platform's functions are used.
#[test]
fn beyond() {
    for x in [1e5_f64.next_up(), 1e9, -3e22, f64::MAX] {
        assert_eq!(Scalar::sin_cos(x), x.sin_cos());
    }
    let (sin, cos) = Scalar::sin_cos(f64::NAN);
    assert!(sin.is_nan() && cos.is_nan());
    assert!(Scalar::sin_cos(f64::INFINITY).0.is_nan());
}
