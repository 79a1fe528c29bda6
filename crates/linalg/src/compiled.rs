//! Functions that are compiled for each level in this crate, and called from others.

/// Functions that are generic over the registers V and over the columns of a tile, COLUMNS, each made a function without
/// parameters by the [gate](condyle_spatial::gate).
macro_rules! compiled {
    ($(
        $(#[$doc:meta])*
        $vis:vis fn $name:ident<$V:ident, $COLUMNS:ident>($($x:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block
    )*) => {$(
        condyle_spatial::level_function! {
            $(#[$doc])*
            $vis fn $name($($x: $type),*) $(-> $out)? {
                #[inline(always)]
                fn kernel<$V: $crate::registers::Vector, const $COLUMNS: usize>($($x: $type),*) $(-> $out)? $body

                long: kernel::<$crate::registers::Long, 8>,
                short: kernel::<$crate::registers::Short, 4>,
                baseline: kernel::<$crate::registers::Pair, 4>,
            }
        }
    )*};
}
pub(crate) use compiled;
