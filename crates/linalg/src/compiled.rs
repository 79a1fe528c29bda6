//! Macros for functions that this crate compiles for each SIMD level, and that other crates call.

/// Defines functions that are generic over the register type V and over COLUMNS, the number of columns of a tile. The
/// [gate](condyle_spatial::gate) turns each such function into a function without generic parameters.
macro_rules! compiled {
    ($($functions:tt)*) => { $crate::compiled::functions! { [Wide, 8] $($functions)* } };
}
pub(crate) use compiled;

/// Defines functions as [`compiled`] does, with registers of at most four numbers. Short registers suit small matrices
/// and functions that mostly copy rows, because many rows are shorter than eight numbers.
macro_rules! narrow {
    ($($functions:tt)*) => { $crate::compiled::functions! { [Narrow, 4] $($functions)* } };
}
pub(crate) use narrow;

/// Defines the functions of [`compiled`] and [`narrow`], given the longest register type and the number of columns used
/// with it.
macro_rules! functions {
    ([$wide:ident, $columns:literal] $(
        $(#[$doc:meta])*
        $vis:vis fn $name:ident<$V:ident, $COLUMNS:ident>($($x:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block
    )*) => {$(
        condyle_spatial::level_function! {
            $(#[$doc])*
            $vis fn $name($($x: $type),*) $(-> $out)? {
                #[inline(always)]
                fn kernel<$V: $crate::registers::Vector, const $COLUMNS: usize>($($x: $type),*) $(-> $out)? $body

                wide: kernel::<$crate::registers::$wide, $columns>,
                narrow: kernel::<$crate::registers::Narrow, 4>,
                baseline: kernel::<$crate::registers::Pair, 4>,
            }
        }
    )*};
}
pub(crate) use functions;
