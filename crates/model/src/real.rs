//! Real parts of scalars of any type. With the real parts, a model of dual numbers is checked in the same way as a
//! model of `f64`.

use condyle_spatial::{Inertia, Scalar, Sym3, Vec3};
use core::any::Any;

/// Returns the real part of a scalar x that has one lane.
///
/// Scalars can only be compared, so the real part is found by comparisons: it is the largest number y for which x < y
/// is false. The number y is found by bisection over ranks. The rank of a number is computed from its bits and has the
/// same order as the numbers.
fn real<S: Scalar>(x: S) -> f64 {
    if let Some(&x) = (&x as &dyn Any).downcast_ref::<f64>() {
        return x;
    }
    let is_below = |y: f64| S::all(x.lt(S::splat(y)));
    let equals = |y: f64| !is_below(y) && !S::all(S::splat(y).lt(x));
    if equals(0.0) && equals(1.0) {
        return f64::NAN;
    }
    let (mut least, mut beyond) = (place(f64::NEG_INFINITY), place(f64::INFINITY) + 1);
    while beyond - least > 1 {
        let middle = least + (beyond - least) / 2;
        *if is_below(number(middle)) { &mut beyond } else { &mut least } = middle;
    }
    let (double, single) = (number(least), f64::from(number(least) as f32));
    if equals(single) { single } else { double } // many `f64` numbers compare as equal to one `f32`
}

/// Returns the rank of a number in the order of all `f64` numbers.
fn place(x: f64) -> u64 {
    let bits = x.to_bits();
    if x.is_sign_negative() { !bits } else { bits | 1 << 63 }
}

/// Returns the number that has a given rank.
fn number(bits: u64) -> f64 {
    f64::from_bits(if bits >> 63 == 0 { !bits } else { bits & !(1 << 63) })
}

/// Returns the real parts of a vector.
pub(crate) fn real_vector<S: Scalar>(x: Vec3<S>) -> Vec3<f64> {
    Vec3::from(x.to_array().map(real))
}

/// Returns the real parts of an inertia.
pub(crate) fn real_inertia<S: Scalar>(I: Inertia<S>) -> Inertia<f64> {
    let Sym3 { xx, xy, yy, xz, yz, zz } = I.rotational;
    let [xx, xy, yy, xz, yz, zz] = [xx, xy, yy, xz, yz, zz].map(real);
    let rotational = Sym3 { xx, xy, yy, xz, yz, zz };
    Inertia { mass: real(I.mass), mass_com: real_vector(I.mass_com), rotational }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::real;
    use num_dual::{Dual32, Dual64, HyperDual64};

    #[test]
    fn real_parts_are_exact() {
        let all = [0.0, 1.0, -1.0, 0.1, -1e-300, 5e-324, 1e300, f64::MAX, -f64::MAX, f64::INFINITY, f64::NEG_INFINITY];
        for x in all {
            assert_eq!(real(x), x);
            assert_eq!(real(Dual64::new(x, 3.0)), x);
            assert_eq!(real(HyperDual64::new(x, 3.0, f64::NAN, 1.0)), x);
        }
        for x in [0.0_f32, 0.1, -3e-40, 1.0, f32::MAX] {
            assert_eq!(real(Dual32::new(x, 1.0)), f64::from(x));
        }
        assert!(real(f64::NAN).is_nan() && real(Dual64::new(f64::NAN, 0.0)).is_nan());
    }
}
