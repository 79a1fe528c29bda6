//! What can be asked of bodies that are placed, with answers of a few numbers.
//!
//! A single `f64` is computed where kernels are, with the products that are fused there, so that the bits are those of a
//! state in lanes. On other scalars the answer is computed in place: kernels ask on theirs.

/// A number.
pub(crate) type Number<S> = S;

/// Methods of [`Placements`](crate::Placements) and its like: each is a function of the value that the method is asked of.
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
    // a body or a frame that does not exist is reported where the question is asked
    (@check $of:ident, body $body:ident) => {
        $crate::passes::frames::check_body($of.robot(), $body)
    };
    (@check $of:ident, frame $frame:ident) => {
        $crate::passes::frames::check_frame($of.robot(), $frame)
    };
    (@check $of:ident, $other:ident $same:ident) => {};
}
pub(crate) use answers;
