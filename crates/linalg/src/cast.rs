//! Numbers by another name, where they are the same.
#![allow(unsafe_code)]

use condyle_spatial::gate::Fused;
use core::any::TypeId;

macro_rules! casts {
    ($($(#[$doc:meta])* $name:ident $name_mut:ident $type:ty;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        pub fn $name<S: 'static>(x: &[S]) -> Option<&[$type]> {
            // SAFETY: S is f64, of which `Fused` is a transparent wrapper.
            is_f64::<S>().then(|| unsafe { core::slice::from_raw_parts(x.as_ptr().cast(), x.len()) })
        }

        $(#[$doc])*
        #[inline(always)]
        pub fn $name_mut<S: 'static>(x: &mut [S]) -> Option<&mut [$type]> {
            // SAFETY: S is f64, of which `Fused` is a transparent wrapper.
            is_f64::<S>().then(|| unsafe { core::slice::from_raw_parts_mut(x.as_mut_ptr().cast(), x.len()) })
        }
    )*};
}

casts! {
    /// Numbers that are `f64`, as such.
    as_f64 as_f64_mut f64;
    /// Numbers that are `f64`, as numbers whose products and sums are fused.
    as_fused as_fused_mut Fused;
}

#[inline(always)]
fn is_f64<S: 'static>() -> bool {
    TypeId::of::<S>() == TypeId::of::<f64>()
}
