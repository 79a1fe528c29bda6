//! Functions that are compiled for each level in this crate, and called from others.

/// Declares functions that are generic over the registers V and over the columns of a tile, COLUMNS, and makes of each a
/// function without parameters, which calls the one that was compiled for the level in use.
macro_rules! compiled {
    ($(
        $(#[$doc:meta])*
        $vis:vis fn $name:ident<$V:ident, $COLUMNS:ident>($($x:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block
    )*) => {$(
        $(#[$doc])*
        #[allow(unsafe_code, unused_unsafe, clippy::extra_unused_type_parameters)]
        #[inline]
        $vis fn $name($($x: $type),*) $(-> $out)? {
            use $crate::registers::{Pair, Short, Vector};
            use condyle_spatial::level::{Level, level};

            #[inline(always)]
            fn kernel<$V: Vector, const $COLUMNS: usize>($($x: $type),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
            #[inline(never)]
            fn long($($x: $type),*) $(-> $out)? {
                kernel::<$crate::registers::Long, 8>($($x),*)
            }
            #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
            #[inline(never)]
            fn short($($x: $type),*) $(-> $out)? {
                kernel::<Short, 4>($($x),*)
            }
            #[inline(never)]
            fn baseline($($x: $type),*) $(-> $out)? {
                kernel::<Pair, 4>($($x),*)
            }
            match level() {
                // SAFETY: the processor has the level in use.
                #[cfg(target_arch = "x86_64")]
                Level::Avx512 => unsafe { long($($x),*) },
                Level::Baseline => baseline($($x),*),
                // SAFETY: as above.
                _ => unsafe { short($($x),*) },
            }
        }
    )*};
}
pub(crate) use compiled;
