//! The gate to vector instructions: where kernels are compiled, for which scalars, and with what.
//!
//! [`kernel!`](crate::kernel) wraps a pass, a tile or a factor, whose body is generic and inlined throughout, into a
//! function that is called:
//!
//! - for the scalars of every day, `f64` and its lanes, it is compiled in the crate that owns it, once, with the vector
//!   instructions that the scalar is made of; whoever uses the library calls that code;
//! - a single `f64` computes with fused products and sums where the processor has them, as [`Fused`], which is the same
//!   64 bits under another name: arguments, workspaces included, are taken for the same over [`Fused`], which they are
//!   [`Alike`];
//! - a single `f32` is compiled there too, without vector instructions, so that debug builds of users do not slow it down;
//! - for all other scalars (dual numbers, lanes of `f32`, a user's own) it is compiled where it is used.
//!
//! [`register_kernel!`](crate::register_kernel) does the same for work on `f64` that uses the level's registers within one
//! state, and [`level_function!`](crate::level_function) for small functions that are called often, such as the tiles of dense
//! kernels: it passes arguments in registers, where the two others pass them as one value in memory.
#![allow(unsafe_code)]

pub use crate::simd::alike::{Alike, Rename, same};
pub use crate::simd::fused::Fused;
pub use crate::simd::kernel::Kernel;
pub use crate::simd::level::{Level, level};
pub use crate::simd::pack::{Real, Witness};
use core::any::TypeId;

/// Four numbers at once, with AVX2, NEON or SIMD128.
pub type Short<W> = <f64 as Real>::Short<W>;
/// Eight numbers at once, with AVX-512; elsewhere the same as `Short`.
pub type Long<W> = <f64 as Real>::Long<W>;

/// Whether two types are the same one.
#[inline(always)]
pub fn is<A: 'static, B: 'static>() -> bool {
    TypeId::of::<A>() == TypeId::of::<B>()
}

/// Statements for vectors, where the processor may have some ([`VECTORS`](crate::simd::level::VECTORS)), else others: so that
/// nothing is compiled for vectors that a microcontroller has not.
#[cfg(any(
    all(target_arch = "x86_64", feature = "std"),
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
#[macro_export]
#[doc(hidden)]
macro_rules! if_vectors {
    ({ $($with:tt)* } else { $($without:tt)* }) => { $($with)* };
}
/// What stands in the place of code for vectors, which are not here.
#[cfg(not(any(
    all(target_arch = "x86_64", feature = "std"),
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
#[macro_export]
#[doc(hidden)]
macro_rules! if_vectors {
    ({ $($with:tt)* } else { $($without:tt)* }) => { $($without)* };
}

/// A function that runs a pass, generic over the scalar `S` and, where it sees a model, over the type `R` of its constants; see
/// [`gate`](crate::simd::gate). It returns nothing: what it computes is in its arguments.
#[macro_export]
#[doc(hidden)]
macro_rules! kernel {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$S:ident $(, $R:ident)?>($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[inline]
        #[allow(unsafe_code, clippy::too_many_arguments)]
        $vis fn $name<$S: $crate::Scalar $(, $R: $crate::Constant<$S>)?>($($arg: $type),*) {
            use $crate::simd::gate::{Kernel, is};

            struct Work<T, Scalars>(T, ::core::marker::PhantomData<Scalars>);
            impl<$S: $crate::Scalar $(, $R: $crate::Constant<$S>)?> Kernel for Work<($($type,)*), ($S, $($R)?)> {
                #[inline(always)]
                fn run(self) {
                    let Work(($($arg,)*), _) = self;
                    $body
                }
            }

            $crate::kernel!(@call f32, is::<$S, f32>() $(&& is::<$R, f64>())?, $S $($R)?, ($($arg: $type),*));
            if !$S::COMPILED {
                return $S::enter(Work::<_, ($S, $($R)?)>(($($arg,)*), ::core::marker::PhantomData));
            }
            $(assert!(is::<$R, f64>(), "the constants of a model for numbers are numbers");)?
            let f64 = is::<$S, f64>();
            $crate::if_vectors!({
                use $crate::simd::gate::{Fused, Level, level};

                struct Gate;
                // SAFETY: each scalar's code is entered through its door.
                unsafe impl $crate::simd::gate::Witness for Gate {}
                type Short = $crate::simd::gate::Short<Gate>;
                type Long = $crate::simd::gate::Long<Gate>;

                let fused = f64 && level() > Level::Baseline;
                $crate::kernel!(@call Fused, is::<$S, Fused>(), $S $($R)?, ($($arg: $type),*), numbers if fused);
                $crate::kernel!(@call Short, is::<$S, Short>(), $S $($R)?, ($($arg: $type),*));
                $crate::kernel!(@call Long, is::<$S, Long>(), $S $($R)?, ($($arg: $type),*));
            } else {});
            $crate::kernel!(@call f64, f64, $S $($R)?, ($($arg: $type),*));
        }
    };
    // the function compiled for one scalar, if it is the one; with a condition on which numbers are taken for it
    (@call $scalar:ident, $chosen:expr, $S:ident $($R:ident)?, ($($arg:ident: $type:ty),*) $(, numbers if $fused:expr)?) => {
        let chosen = $chosen;
        {
            type $S = $scalar;
            $(type $R = f64;)?
            #[inline(never)]
            fn compiled($($arg: $type),*) {
                $S::enter(Work::<_, ($S, $($R)?)>(($($arg,)*), ::core::marker::PhantomData));
            }
            if chosen {
                // SAFETY: R is f64, and S is this scalar.
                return unsafe { compiled($($crate::simd::gate::same($arg)),*) };
            }
            $crate::kernel!(@renamed ($($fused)?), $S $($R)?, ($($arg: $type),*));
        }
    };
    (@renamed (), $S:ident $($R:ident)?, ($($arg:ident: $type:ty),*)) => {};
    (@renamed ($fused:expr), $S:ident $($R:ident)?, ($($arg:ident: $type:ty),*)) => {
        let fused = $fused;
        {
            type $S = f64;
            $(type $R = f64;)?
            #[inline(always)]
            fn renamed($($arg: $type),*) {
                compiled($($crate::simd::gate::Rename::renamed($arg)),*);
            }
            if fused {
                // SAFETY: R and S are f64.
                return unsafe { renamed($($crate::simd::gate::same($arg)),*) };
            }
        }
    };
}

/// A function on `f64` whose body is generic over the vector registers `V` that it may use: the widest of the level,
/// compiled for them in the crate that owns it. It is for levels that have registers, above the baseline, and returns
/// nothing.
#[macro_export]
#[doc(hidden)]
macro_rules! register_kernel {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$V:ident>($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[allow(unsafe_code, clippy::too_many_arguments)]
        $vis fn $name($($arg: $type),*) {
            use $crate::simd::gate::Kernel;

            struct Work<T, V>(T, ::core::marker::PhantomData<V>);
            impl<$V: $crate::simd::pack::Block<Number = f64>> Kernel for Work<($($type,)*), $V> {
                #[inline(always)]
                fn run(self) {
                    let Work(($($arg,)*), _) = self;
                    $body
                }
            }

            let work = ($($arg,)*);
            $crate::if_vectors!({
                use $crate::simd::gate::{Level, level};

                struct Gate;
                // SAFETY: the registers' code is entered through their door.
                unsafe impl $crate::simd::gate::Witness for Gate {}
                type Short = $crate::simd::gate::Short<Gate>;
                type Long = $crate::simd::gate::Long<Gate>;

                if level() >= Level::Avx512 {
                    <Long as $crate::Scalar>::enter(Work::<_, Long>(work, ::core::marker::PhantomData));
                } else {
                    <Short as $crate::Scalar>::enter(Work::<_, Short>(work, ::core::marker::PhantomData));
                }
            } else {
                // as right, if anybody called it
                <f64 as $crate::Scalar>::enter(Work::<_, f64>(work, ::core::marker::PhantomData));
            });
        }
    };
}

/// A function that is compiled for each level in the crate that owns it: `item` is what it consists of, `long`, `short` and
/// `baseline` are the functions of its arguments for registers of eight, of four, and of those that every processor has.
#[macro_export]
#[doc(hidden)]
macro_rules! level_function {
    (
        $(#[$doc:meta])*
        $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)?
        { $item:item long: $long:expr, short: $short:expr, baseline: $baseline:expr $(,)? }
    ) => {
        $(#[$doc])*
        #[allow(unsafe_code, unused_unsafe, clippy::extra_unused_type_parameters)]
        #[inline]
        $vis fn $name($($arg: $type),*) $(-> $out)? {
            $item

            #[inline(never)]
            fn baseline($($arg: $type),*) $(-> $out)? {
                $baseline($($arg),*)
            }
            $crate::if_vectors!({
                use $crate::simd::gate::{Level, level};

                #[cfg(target_arch = "x86_64")]
                #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
                #[inline(never)]
                fn long($($arg: $type),*) $(-> $out)? {
                    $long($($arg),*)
                }
                #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
                #[inline(never)]
                fn short($($arg: $type),*) $(-> $out)? {
                    $short($($arg),*)
                }
                match level() {
                    // SAFETY: the processor has the level in use.
                    #[cfg(target_arch = "x86_64")]
                    Level::Avx512 => return unsafe { long($($arg),*) },
                    Level::Baseline => {}
                    // SAFETY: as above.
                    _ => return unsafe { short($($arg),*) },
                }
            } else {});
            baseline($($arg),*)
        }
    };
}
