//! Functions that are compiled for each level in this crate, and called from others.

/// Functions that are generic over the registers V and over the columns of a tile, COLUMNS, each made a function without
/// parameters by the [gate](condyle_spatial::gate).
macro_rules! compiled {
    ($($functions:tt)*) => { $crate::compiled::functions! { [Long, 8] $($functions)* } };
}
pub(crate) use compiled;

/// The same with registers of four numbers at most: for work that mostly moves rows, of which many are shorter than eight
/// numbers, and for small matrices.
macro_rules! narrow {
    ($($functions:tt)*) => { $crate::compiled::functions! { [Short, 4] $($functions)* } };
}
pub(crate) use narrow;

/// The functions of [`compiled`] and [`narrow`], after the longest registers that they use and how many columns go with these.
macro_rules! functions {
    ([$long:ident, $columns:literal] $(
        $(#[$doc:meta])*
        $vis:vis fn $name:ident<$V:ident, $COLUMNS:ident>($($x:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block
    )*) => {$(
        condyle_spatial::level_function! {
            $(#[$doc])*
            $vis fn $name($($x: $type),*) $(-> $out)? {
                #[inline(always)]
                fn kernel<$V: $crate::registers::Vector, const $COLUMNS: usize>($($x: $type),*) $(-> $out)? $body

                long: kernel::<$crate::registers::$long, $columns>,
                short: kernel::<$crate::registers::Short, 4>,
                baseline: kernel::<$crate::registers::Pair, 4>,
            }
        }
    )*};
}
pub(crate) use functions;
