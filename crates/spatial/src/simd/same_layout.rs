//! Types with the same memory layout for two scalars: `f64`, and [`FusedF64`], which is a transparent wrapper of `f64`.
#![allow(unsafe_code)]

use crate::algebra::inertia::{ArticulatedInertia, Inertia};
use crate::algebra::motion::{Force, Motion};
use crate::algebra::quaternion::Quaternion;
use crate::algebra::se3::Se3;
use crate::algebra::vector::{Mat3, Sym3, Vec3};
use crate::simd::fused_f64::FusedF64;
use core::mem::ManuallyDrop;

/// Type whose values in memory may be read and written as values of type `B`. Two such types are called alike.
///
/// Kernels take only arguments of such types. The compiler accepts an [`Array`](crate::storage::Array) in a workspace.
/// It rejects a `Vec<S>`, whose layout is not guaranteed. The macro [`same_layout!`](crate::same_layout) implements
/// this trait for a struct.
///
/// # Safety
/// Both types have the same size, the same alignment, and fields at the same offsets. The fields at each offset have
/// the same type or are alike. So a valid value of one type is a valid value of the other.
pub unsafe trait SameLayout<B>: Rename<B> {}

/// Value that can be converted to a `B` without changing its bits. Arguments of kernels have this trait.
pub trait Rename<B> {
    /// Returns the value as a `B`.
    fn renamed(self) -> B;
}

/// Reinterprets a value as another type.
///
/// # Safety
/// The caller guarantees one of two conditions: `A` and `B` are the same type, or they are [`SameLayout`].
#[inline(always)]
pub unsafe fn same<A, B>(a: A) -> B {
    assert!(size_of::<A>() == size_of::<B>() && align_of::<A>() == align_of::<B>());
    // SAFETY: guaranteed by the caller. `a` is not dropped, so the value exists only once.
    unsafe { core::mem::transmute_copy(&ManuallyDrop::new(a)) }
}

#[doc(hidden)]
impl<'a, A: SameLayout<B>, B> Rename<&'a B> for &'a A {
    #[inline(always)]
    fn renamed(self) -> &'a B {
        // SAFETY: a valid A is also a valid B, by `SameLayout`.
        unsafe { &*core::ptr::from_ref(self).cast() }
    }
}

#[doc(hidden)]
impl<'a, A: SameLayout<B>, B> Rename<&'a mut B> for &'a mut A {
    #[inline(always)]
    fn renamed(self) -> &'a mut B {
        // SAFETY: by `SameLayout`, the value is a valid B, and each B that is written through the reference is a valid
        // A.
        unsafe { &mut *core::ptr::from_mut(self).cast() }
    }
}

#[doc(hidden)]
impl<'a, A: SameLayout<B>, B> Rename<&'a [B]> for &'a [A] {
    #[inline(always)]
    fn renamed(self) -> &'a [B] {
        // SAFETY: by `SameLayout`, each entry is also a valid entry of the other type, and both types have the same
        // size.
        unsafe { &*(core::ptr::from_ref(self) as *const [B]) }
    }
}

#[doc(hidden)]
impl<'a, A: SameLayout<B>, B> Rename<&'a mut [B]> for &'a mut [A] {
    #[inline(always)]
    fn renamed(self) -> &'a mut [B] {
        // SAFETY: by `SameLayout`, each entry is also a valid entry of the other type, and both types have the same
        // size.
        unsafe { &mut *(core::ptr::from_mut(self) as *mut [B]) }
    }
}

#[doc(hidden)]
impl<A: Rename<B>, B> Rename<Option<B>> for Option<A> {
    #[inline(always)]
    fn renamed(self) -> Option<B> {
        self.map(Rename::renamed)
    }
}

#[doc(hidden)]
impl<A: Rename<B>, B, const N: usize> Rename<[B; N]> for [A; N] {
    #[inline(always)]
    fn renamed(self) -> [B; N] {
        self.map(Rename::renamed)
    }
}

// SAFETY: an array stores its entries one after another, without gaps.
#[doc(hidden)]
unsafe impl<A: SameLayout<B>, B, const N: usize> SameLayout<[B; N]> for [A; N] {}

// SAFETY: `FusedF64` is a transparent wrapper.
#[doc(hidden)]
unsafe impl SameLayout<FusedF64> for f64 {}

#[doc(hidden)]
impl Rename<FusedF64> for f64 {
    #[inline(always)]
    fn renamed(self) -> FusedF64 {
        FusedF64(self)
    }
}

// SAFETY: `FusedF64` is a transparent wrapper.
#[doc(hidden)]
unsafe impl SameLayout<f64> for FusedF64 {}

#[doc(hidden)]
impl Rename<f64> for FusedF64 {
    #[inline(always)]
    fn renamed(self) -> f64 {
        self.0
    }
}

/// Implements [`SameLayout`] for a struct over a scalar: it declares that the struct over `f64` and the struct over
/// [`FusedF64`] are alike, which means that their memory layouts are the same.
///
/// Name first the fields that depend on the scalar and, after `same`, the other fields. The compiler checks three
/// conditions. No field is missing. The types of each field in the two structs are alike or the same. Each field has
/// the same offset in both structs. Offsets are equal if the struct is `repr(C)`.
///
/// For a type that does not depend on a scalar, the macro declares that the type is alike to itself.
///
/// ```
/// use condyle_spatial::{Array, Motion, same_layout};
/// #[repr(C)]
/// struct Workspace<S> { v: Array<Motion<S>>, tau: Array<S>, order: Vec<usize> }
/// same_layout!(Workspace { v, tau } same { order });
/// ```
///
/// A field with a different layout, or a missing field, does not compile:
///
/// ```compile_fail,E0277
/// # use condyle_spatial::{Array, same_layout};
/// #[repr(C)]
/// struct Workspace<S> { tau: Vec<S> }
/// same_layout!(Workspace { tau });
/// ```
///
/// ```compile_fail,E0027
/// # use condyle_spatial::{Array, same_layout};
/// #[repr(C)]
/// struct Workspace<S> { tau: Array<S>, order: Vec<usize> }
/// same_layout!(Workspace { tau });
/// ```
#[macro_export]
#[doc(hidden)]
macro_rules! same_layout {
    ($($type:ty),+ $(,)?) => {$(
        // SAFETY: the type is compared with itself.
        #[doc(hidden)]
        #[allow(unsafe_code)]
        unsafe impl $crate::simd::same_layout::SameLayout<$type> for $type {}
        #[doc(hidden)]
        impl $crate::simd::same_layout::Rename<$type> for $type {
            #[inline(always)]
            fn renamed(self) -> $type {
                self
            }
        }
    )+};
    ($name:ident { $($field:ident),* $(,)? } $(same { $($same:ident),* $(,)? })?) => {
        // SAFETY: the fields have `SameLayout` or the same type, and equal offsets. Otherwise the checks below would
        // not compile.
        #[doc(hidden)]
        #[allow(unsafe_code)]
        unsafe impl $crate::simd::same_layout::SameLayout<$name<$crate::simd::FusedF64>> for $name<f64> {}
        #[doc(hidden)]
        impl $crate::simd::same_layout::Rename<$name<$crate::simd::FusedF64>> for $name<f64> {
            #[inline(always)]
            fn renamed(self) -> $name<$crate::simd::FusedF64> {
                // SAFETY: both types have the same layout, by `SameLayout`.
                #[allow(unsafe_code)]
                unsafe {
                    $crate::simd::same_layout::same(self)
                }
            }
        }
        const _: () = {
            type One = $name<f64>;
            type Other = $name<$crate::simd::FusedF64>;
            #[allow(dead_code)]
            fn look(one: &One, other: &Other) {
                fn check<A: $crate::simd::same_layout::SameLayout<B>, B>(_: &A, _: &B) {}
                fn same<T>(_: &T, _: &T) {}
                let $name { $($field: _,)* $($($same: _,)*)? } = one;
                $(check(&one.$field, &other.$field);)*
                $($(same(&one.$same, &other.$same);)*)?
            }
            assert!(size_of::<One>() == size_of::<Other>() && align_of::<One>() == align_of::<Other>());
            $(assert!(core::mem::offset_of!(One, $field) == core::mem::offset_of!(Other, $field));)*
            $($(assert!(core::mem::offset_of!(One, $same) == core::mem::offset_of!(Other, $same));)*)?
        };
    };
}

same_layout!(bool, usize, f64);
same_layout!(Vec3 { x, y, z });
same_layout!(Mat3 { x, y, z });
same_layout!(Sym3 { xx, xy, yy, xz, yz, zz });
same_layout!(Quaternion { vector, scalar });
same_layout!(Motion { linear, angular });
same_layout!(Force { linear, angular });
same_layout!(Inertia { mass, mass_com, rotational });
same_layout!(ArticulatedInertia { linear, coupling, rotational });
same_layout!(Se3 { rotation, translation });
