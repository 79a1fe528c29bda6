//! Numbers of a generic type, by their own name where they are `f64`.
#![allow(unsafe_code)]

use condyle_spatial::gate::is;

/// Numbers as `f64`, if that is what they are.
#[inline(always)]
pub(crate) fn as_f64<S: 'static>(x: &[S]) -> Option<&[f64]> {
    // SAFETY: S is f64.
    is::<S, f64>().then(|| unsafe { core::slice::from_raw_parts(x.as_ptr().cast(), x.len()) })
}

/// Numbers to be written as `f64`, if that is what they are.
#[inline(always)]
pub(crate) fn as_f64_mut<S: 'static>(x: &mut [S]) -> Option<&mut [f64]> {
    // SAFETY: S is f64.
    is::<S, f64>().then(|| unsafe { core::slice::from_raw_parts_mut(x.as_mut_ptr().cast(), x.len()) })
}
