//! Gate to vector instructions. It decides in which crate a kernel is compiled, for which scalars, and with which
//! instructions.
//!
//! [`kernel!`](crate::kernel) defines a function that runs a pass, a tile or a factorization. The body of the function
//! is generic and always inlined:
//!
//! - For the common scalars, `f64` and its lanes, the function is compiled once, in the crate that defines it, with the
//!   vector instructions of the scalar. Users of the library call this compiled code.
//! - A single `f64` uses fused products and sums if the processor has them: the number is converted to [`FusedF64`],
//!   which has the same 64 bits. Arguments, including workspaces, are reinterpreted as types over `FusedF64`
//!   ([`SameLayout`]).
//! - For a single `f32`, the function is also compiled in the crate that defines it, without vector instructions. So
//!   users' debug builds do not slow it down.
//! - For all other scalars (dual numbers, lanes of `f32`, a user's own type), the function is compiled in the crate
//!   that uses it.
//!
//! [`register_kernel!`](crate::register_kernel) does the same for functions on `f64` that use the vector registers of
//! the SIMD level for a single state. [`level_function!`](crate::level_function) is for small functions that are called
//! often, such as the tiles of dense kernels.
#![allow(unsafe_code)]

pub use crate::simd::fused_f64::FusedF64;
pub use crate::simd::kernel::Kernel;
pub use crate::simd::level::{Level, NARROW, assert_supported, level};
pub use crate::simd::pack::{Real, SimdToken};
pub use crate::simd::same_layout::{Rename, SameLayout, same};
use core::any::TypeId;

/// Vector of four numbers, for AVX2, NEON or SIMD128.
pub type Narrow<W> = <f64 as Real>::Narrow<W>;
/// Vector of eight numbers, for AVX-512; on other processors the same type as `Narrow`.
pub type Wide<W> = <f64 as Real>::Wide<W>;

/// Returns whether two types are the same.
#[inline(always)]
pub fn is<A: 'static, B: 'static>() -> bool {
    TypeId::of::<A>() == TypeId::of::<B>()
}

/// Expands to the first block on targets whose processors may have vectors ([`VECTORS`](crate::simd::level::VECTORS)),
/// otherwise to the second block. So no vector code is compiled for a microcontroller without vectors.
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
/// Expands to the second block, because this target has no vectors.
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

/// Defines a function that runs a pass, generic over the scalar `S`. If the pass uses a model, the function is also
/// generic over the type `R` of the model's constants. The function returns nothing: results are written to its
/// arguments. See [`gate`](crate::simd::gate).
#[macro_export]
#[doc(hidden)]
macro_rules! kernel {
    (
        $(#[$doc:meta])* $vis:vis fn $name:ident<$S:ident $(, $R:ident)?>($($arg:ident: $type:ty),* $(,)?) $body:block
    ) => {
        $(#[$doc])*
        #[inline]
        #[allow(unsafe_code, unused_unsafe, clippy::too_many_arguments)]
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

            $crate::kernel!(@call f32 [], is::<$S, f32>() $(&& is::<$R, f64>())?, $S $($R)?, ($($arg: $type),*));
            if !$S::COMPILED {
                return $S::enter(Work::<_, ($S, $($R)?)>(($($arg,)*), ::core::marker::PhantomData));
            }
            $(assert!(is::<$R, f64>(), "model constants for f64 and its lanes are f64");)?
            let f64 = is::<$S, f64>();
            $crate::if_vectors!({
                use $crate::simd::gate::{FusedF64, Level, NARROW, assert_supported, level};

                struct Gate;
                // SAFETY: the code for a scalar runs only after a check that the processor has the scalar's
                // instructions.
                unsafe impl $crate::simd::gate::SimdToken for Gate {}
                type Narrow = $crate::simd::gate::Narrow<Gate>;
                type Wide = $crate::simd::gate::Wide<Gate>;

                let fused = f64 && level() > Level::Baseline;
                $crate::kernel!(
                    @call FusedF64 ["avx2,fma" NARROW], is::<$S, FusedF64>(), $S $($R)?, ($($arg: $type),*),
                    numbers if fused
                );
                $crate::kernel!(
                    @call Narrow ["avx2,fma" NARROW], is::<$S, Narrow>(), $S $($R)?, ($($arg: $type),*)
                );
                $crate::kernel!(
                    @call Wide ["avx512f,avx512dq,avx512vl,avx512bw,avx2,fma" Level::Avx512],
                    is::<$S, Wide>(), $S $($R)?, ($($arg: $type),*)
                );
            } else {});
            $crate::kernel!(@call f64 [], f64, $S $($R)?, ($($arg: $type),*));
        }
    };
    // Compiles the function for the type `$scalar` with the instructions of a SIMD level, and calls the function if
    // `$chosen` holds. With `numbers if`, also calls the function for `f64` if the condition `$fused` holds.
    (
        @call $scalar:ident [$($instructions:literal $level:expr)?], $chosen:expr, $S:ident $($R:ident)?,
        ($($arg:ident: $type:ty),*) $(, numbers if $fused:expr)?
    ) => {
        let chosen = $chosen;
        {
            type $S = $scalar;
            $(type $R = f64;)?
            #[inline(never)]
            $(#[cfg_attr(target_arch = "x86_64", target_feature(enable = $instructions))])?
            fn compiled($($arg: $type),*) {
                Work::<_, ($S, $($R)?)>(($($arg,)*), ::core::marker::PhantomData).run();
            }
            if chosen {
                $(assert_supported($level);)?
                // SAFETY: R is f64, S is this scalar, and the processor has its instructions.
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
            if fused {
                // SAFETY: R and S are f64.
                $(let $arg: $type = unsafe { $crate::simd::gate::same($arg) };)*
                // SAFETY: the processor has vectors, because the level in use is above the baseline.
                return unsafe { compiled($($crate::simd::gate::Rename::renamed($arg)),*) };
            }
        }
    };
}

/// Defines a function on `f64` whose body is generic over the vector registers `V`. `V` becomes the widest registers of
/// the SIMD level. The body is compiled for these registers in the crate that defines it. The function may only be
/// called at levels above the baseline, and it returns nothing.
#[macro_export]
#[doc(hidden)]
macro_rules! register_kernel {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$V:ident>($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[allow(unsafe_code, unused_unsafe, clippy::too_many_arguments)]
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

            $crate::if_vectors!({
                use $crate::simd::gate::{Level, NARROW, assert_supported, level};

                struct Gate;
                // SAFETY: the code for these registers runs only after a check that the processor has their
                // instructions.
                unsafe impl $crate::simd::gate::SimdToken for Gate {}
                type Narrow = $crate::simd::gate::Narrow<Gate>;
                type Wide = $crate::simd::gate::Wide<Gate>;

                #[inline(never)]
                #[cfg_attr(
                    target_arch = "x86_64",
                    target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")
                )]
                fn wide($($arg: $type),*) {
                    Work::<_, Wide>(($($arg,)*), ::core::marker::PhantomData).run();
                }
                #[inline(never)]
                #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
                fn narrow($($arg: $type),*) {
                    Work::<_, Narrow>(($($arg,)*), ::core::marker::PhantomData).run();
                }
                if level() >= Level::Avx512 {
                    // SAFETY: `level` returns only levels that the processor supports.
                    unsafe { wide($($arg),*) }
                } else {
                    assert_supported(NARROW);
                    // SAFETY: the processor has these instructions.
                    unsafe { narrow($($arg),*) }
                }
            } else {
                // Targets without vectors never execute this code, but its result would be correct.
                Work::<_, f64>(($($arg,)*), ::core::marker::PhantomData).run();
            });
        }
    };
}

/// Defines a function that is compiled for each SIMD level in the crate that defines it. `item` is the implementation.
/// `wide`, `narrow` and `baseline` name the functions to call. `wide` is for registers of eight numbers, `narrow` for
/// registers of four numbers, and `baseline` for the registers that every processor has.
#[macro_export]
#[doc(hidden)]
macro_rules! level_function {
    (
        $(#[$doc:meta])*
        $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)?
        { $item:item wide: $wide:expr, narrow: $narrow:expr, baseline: $baseline:expr $(,)? }
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
                fn wide($($arg: $type),*) $(-> $out)? {
                    $wide($($arg),*)
                }
                #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
                #[inline(never)]
                fn narrow($($arg: $type),*) $(-> $out)? {
                    $narrow($($arg),*)
                }
                match level() {
                    // SAFETY: the processor has the SIMD level in use.
                    #[cfg(target_arch = "x86_64")]
                    Level::Avx512 => return unsafe { wide($($arg),*) },
                    Level::Baseline => {}
                    // SAFETY: the processor has the SIMD level in use.
                    _ => return unsafe { narrow($($arg),*) },
                }
            } else {});
            baseline($($arg),*)
        }
    };
}
