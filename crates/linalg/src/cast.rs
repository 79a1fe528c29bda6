//! Conversion of slices of a generic type to slices of `f64`, if the type is `f64`.
#![allow(unsafe_code)]

use condyle_spatial::gate::is;

/// Returns the slice as `f64`, or `None` if `S` is another type.
#[inline(always)]
pub(crate) fn as_f64<S: 'static>(x: &[S]) -> Option<&[f64]> {
    // SAFETY: S is f64.
    is::<S, f64>().then(|| unsafe { core::slice::from_raw_parts(x.as_ptr().cast(), x.len()) })
}

/// Returns the mutable slice as `f64`, or `None` if `S` is another type.
#[inline(always)]
pub(crate) fn as_f64_mut<S: 'static>(x: &mut [S]) -> Option<&mut [f64]> {
    // SAFETY: S is f64.
    is::<S, f64>().then(|| unsafe { core::slice::from_raw_parts_mut(x.as_mut_ptr().cast(), x.len()) })
}
