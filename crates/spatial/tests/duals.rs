//! Tests of dual numbers over lanes, and of tanh and exp on dual numbers, compared with num-dual.

use condyle_spatial::Scalar;
use condyle_spatial::elementary::{exp, tanh};
use condyle_spatial::lane_dual::LaneDual;
use num_dual::{Dual64, DualNum};

/// Error bound: a few rounding errors of double precision.
const ROUNDING: f64 = 2e-15;

fn all<S: Scalar>(x: S, y: S) -> Vec<S> {
    let (sin, cos) = x.sin_cos();
    let least = S::select(x.lt(y), x, y);
    let both = S::and(x.lt(y), S::zero().lt(x));
    let mut sum = x;
    sum += y * y;
    sum -= -x;
    let one_of = S::select(S::or(y.lt(x), both), x * y, y);
    let angles = [x.atan2(y), x.atan2(-y), (-x).atan2(y), y.atan2(-x)];
    let roots = [(x * x).sqrt(), y.recip(), x / y, x.mul_add(y, x)];
    let rest = [sin, cos, least, one_of, sum, (-x).abs(), x.abs(), x + y, x - y, S::one() * x];
    [&angles[..], &roots, &rest].concat()
}

#[test]
fn lane_duals_agree_with_num_dual() {
    for (x, y) in [(0.7, 1.9), (-0.7, 1.9), (1.9, -0.7), (-3.0, -0.1)] {
        for (dx, dy) in [(0.3, -0.4), (1.0, 0.0), (0.0, 1.0)] {
            let mine = all(LaneDual { re: x, eps: dx }, LaneDual { re: y, eps: dy });
            let theirs = all(Dual64::new(x, dx), Dual64::new(y, dy));
            for (a, b) in mine.iter().zip(&theirs) {
                assert!((a.re - b.re).abs() <= ROUNDING * b.re.abs().max(1.0), "{a:?} {b:?}");
                assert!((a.eps - b.eps).abs() <= ROUNDING * b.eps.abs().max(1.0), "{a:?} {b:?}");
            }
        }
    }
}

/// Checks tanh against num-dual, and exp against the standard library. The error bound of exp grows with the magnitude
/// of its argument.
#[test]
fn tanh_and_exp_agree_with_the_library() {
    for k in -4000..=4000 {
        let x = f64::from(k) * 0.01;
        let (found, expected) = (tanh(Dual64::new(x, 1.0)), Dual64::new(x, 1.0).tanh());
        assert!((found.re - expected.re).abs() <= ROUNDING * expected.re.abs(), "tanh {x}");
        assert!((found.eps - x.cosh().powi(-2)).abs() <= ROUNDING, "slope of tanh {x}");
        let (found, expected) = (exp(Dual64::new(x, 1.0)), x.exp());
        let bound = ROUNDING * (1.0 + x.abs()) * expected;
        assert!((found.re - expected).abs() <= bound && (found.eps - expected).abs() <= bound, "exp {x}");
    }
    assert_eq!((tanh(0.0), tanh(1e3), tanh(-1e3), exp(0.0)), (0.0, 1.0, -1.0, 1.0));
    assert_eq!(tanh(1e-300), 1e-300);
}
