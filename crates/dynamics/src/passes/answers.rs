//! Macro that defines queries on bodies whose placements are already computed. Such a query returns a few numbers, the
//! answer.
//!
//! If the scalar is `f64`, the query runs in a kernel. Kernels use fused products both for `f64` and for lanes, so the
//! answer is bit-identical to the answer for a state in lanes. With other scalars, queries already run inside kernels,
//! so the answer is computed directly.

/// Answer of a query that returns one number.
pub(crate) type Number<S> = S;

/// Defines methods of [`Placements`](crate::Placements) and similar types. Each method is a query: it computes its
/// answer from `self` and its arguments only.
macro_rules! answers {
    ($(
        $(#[$doc:meta])*
        fn $name:ident($of:ident: $Of:ident $(, $arg:ident: $type:ty)*) -> $Answer:ident = $start:expr; $body:block
    )*) => {$(
        impl<S: condyle_spatial::Scalar, R: condyle_spatial::Constant<S>> $Of<'_, S, R> {
            $(#[$doc])*
            #[inline(always)]
            #[track_caller]
            pub fn $name(&self $(, $arg: $type)*) -> $Answer<S> {
                #[inline(always)]
                fn here<S: condyle_spatial::Scalar, R: condyle_spatial::Constant<S>>(
                    $of: $Of<'_, S, R>
                    $(, $arg: $type)*
                ) -> $Answer<S> $body

                condyle_spatial::kernel! {
                    fn computed<S, R>(of: $Of<'_, S, R>, $($arg: $type,)* answer: &mut $Answer<S>) {
                        *answer = here(of $(, $arg)*);
                    }
                }
                $($crate::passes::answers::answers!(@check self, $arg $arg);)*
                if !condyle_spatial::gate::is::<S, f64>() {
                    return here(*self $(, $arg)*);
                }
                let mut answer: $Answer<S> = $start;
                computed(*self, $($arg,)* &mut answer);
                answer
            }
        }
    )*};
    // These arms report an invalid index of a body or frame at the caller's line.
    (@check $of:ident, body $body:ident) => {
        $crate::passes::frames::check_body($of.robot(), $body)
    };
    (@check $of:ident, frame $frame:ident) => {
        $crate::passes::frames::check_frame($of.robot(), $frame)
    };
    (@check $of:ident, $other:ident $same:ident) => {};
}
pub(crate) use answers;
