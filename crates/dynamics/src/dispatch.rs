//! Where an algorithm is compiled for the vector instructions that this processor has.
//!
//! `kernel!` wraps the body of an algorithm, which is generic and inlined throughout, and lets the scalar choose the
//! function in which it is compiled ([`Kernel`]):
//!
//! - a scalar that is made of vector instructions brings its level along;
//! - a single `f64` computes with fused products and sums where the processor has them, as [`Fused`], which is the same
//!   64 bits under another name: model, arguments and `Data` are looked at as if they were made of it;
//! - all other scalars run as they are.
#![allow(unsafe_code)]

use crate::data::Data;
use condyle_spatial::lanes::Fused;
pub(crate) use condyle_spatial::lanes::{Kernel, short};
use condyle_spatial::{Constant, Scalar};
use core::any::TypeId;

/// Whether a kernel computes on `f64` throughout, so that it may do so under another name.
#[inline(always)]
pub(crate) fn is_f64<S: Scalar, R: Constant<S>>() -> bool {
    TypeId::of::<(S, R)>() == TypeId::of::<(f64, f64)>()
}

/// An argument under another name of its numbers.
///
/// # Safety
/// `A` and `B` are the same type but for `f64` in place of [`Fused`], or the same type.
#[inline(always)]
pub(crate) unsafe fn slice<A, B>(a: &[A]) -> &[B] {
    assert!(size_of::<A>() == size_of::<B>() && align_of::<A>() == align_of::<B>());
    // SAFETY: the elements are equal in size, alignment and validity: `Fused` is a transparent wrapper, and the structs of
    // spatial algebra that it may be in are `repr(C)`.
    unsafe { core::slice::from_raw_parts(a.as_ptr().cast(), a.len()) }
}

/// What is to be written, under another name of its numbers.
///
/// # Safety
/// As for `slice`.
#[inline(always)]
pub(crate) unsafe fn slice_mut<A, B>(a: &mut [A]) -> &mut [B] {
    assert!(size_of::<A>() == size_of::<B>() && align_of::<A>() == align_of::<B>());
    // SAFETY: as for `slice`.
    unsafe { core::slice::from_raw_parts_mut(a.as_mut_ptr().cast(), a.len()) }
}

/// The same thing under another name.
///
/// # Safety
/// `A` and `B` are the same type.
#[inline(always)]
pub(crate) unsafe fn same<A, B>(a: &A) -> &B {
    assert!(size_of::<A>() == size_of::<B>() && align_of::<A>() == align_of::<B>());
    // SAFETY: by the caller.
    unsafe { &*core::ptr::from_ref(a).cast() }
}

/// Scratch whose numbers are looked at as [`Fused`].
///
/// # Safety
/// `S` is `f64`.
#[inline(always)]
pub(crate) unsafe fn fused<S>(data: &mut Data<S>) -> &mut Data<Fused> {
    assert!(size_of::<Data<S>>() == size_of::<Data<Fused>>());
    // SAFETY: `Fused` is a transparent wrapper of `f64`; `Data`, the workspaces in it and the structs of spatial algebra are
    // `repr(C)`, hence laid out alike; nalgebra's matrices are transparent and `repr(C)` structs over a `Vec`. Of `Vec` it is
    // taken for granted that its three words stand in the same order whatever it holds; `tests::one_layout` looks.
    unsafe { &mut *core::ptr::from_mut(data).cast() }
}

impl Data<f64> {
    /// The same scratch, for one who computes as algorithms on `f64` do.
    #[doc(hidden)]
    pub fn fused(&mut self) -> &mut Data<Fused> {
        // SAFETY: S is f64.
        unsafe { fused(self) }
    }
}

/// A function that runs its body, generic over the scalar `S` and the model's constants `R`, compiled for the right level.
///
/// The body may return nothing: what it computes is in the data.
macro_rules! kernel {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($model:ident, $data:ident $(, $arg:ident: $type:ty)* $(,)?) $body:block) => {
        $(#[$doc])*
        #[inline(always)]
        #[allow(unsafe_code, clippy::too_many_arguments)]
        $vis fn $name<S: Scalar, R: Constant<S>>($model: &Model<R>, $data: &mut Data<S> $(, $arg: $type)*) {
            #[inline(always)]
            fn body<S: Scalar, R: Constant<S>>($model: &Model<R>, $data: &mut Data<S> $(, $arg: $type)*) $body

            #[allow(unused_imports)] // by kernels without slices
            use $crate::dispatch::{Kernel, fused, is_f64, same, short, slice};

            struct Work<M, D, T>(M, D, T);
            impl<S: Scalar, R: Constant<S>> Kernel for Work<&Model<R>, &mut Data<S>, ($($type,)*)> {
                #[inline(always)]
                fn run(self) {
                    let Work(model, data, ($($arg,)*)) = self;
                    body(model, data $(, $arg)*);
                }
                #[inline(always)]
                fn run_fused(self) {
                    if !is_f64::<S, R>() {
                        return self.run();
                    }
                    let Work(model, data, ($($arg,)*)) = self;
                    // SAFETY: S and R are f64, and by contract the processor has the level.
                    unsafe {
                        let model: &Model<f64> = same(model);
                        short(Work(model, fused(data), ($(slice($arg),)*)));
                    }
                }
            }
            S::enter(Work($model, $data, ($($arg,)*)));
        }
    };
}
pub(crate) use kernel;

#[cfg(test)]
mod tests {
    use super::*;

    /// A `Vec` of either kind is the same three words.
    #[test]
    fn one_layout() {
        let plain = vec![1.0_f64, 2.0, 3.0];
        // SAFETY: what this test is about; nothing is read but the vector's words and its numbers.
        let fused = unsafe { &*core::ptr::from_ref(&plain).cast::<Vec<Fused>>() };
        assert_eq!((fused.as_ptr().cast(), fused.len(), fused.capacity()), (plain.as_ptr(), 3, plain.capacity()));
        assert_eq!(fused[2].0, 3.0);
    }
}
