//! How a function becomes one of a batch: `batched!` makes of an entry like
//!
//! ```text
//! /// [`coriolis_matrix`](crate::coriolis_matrix): C of each state, nv × nv.
//! fn coriolis_matrix(model, data, to; q, v) -> Matrices<'_, T> [[NV, NV]] {
//!     to.matrix(coriolis_matrix(model, data, q, v));
//! }
//! ```
//!
//! the methods of `Batch` and of `BatchWriter` of that name: they take the arguments of all states, check them, and run the
//! body on groups of states, a lane for each, where it puts each result to the places that have the shapes in brackets. After
//! the arguments of states may stand some that all share, with their types; `with` names more of what a pass has, `columns`
//! says what `COLUMNS` is in a shape, and `keeps` names the matrices of `Data` that stay in lanes instead, the last ones of
//! the shapes; a writer writes them too.

/// Sizes that depend on the robot, in shapes.
pub(super) const NV: usize = usize::MAX;
pub(super) const BODIES: usize = usize::MAX - 1;
/// Ten for each body but the world.
pub(super) const PARAMETERS: usize = usize::MAX - 2;
/// Of constraints.
pub(super) const ROWS: usize = usize::MAX - 3;
/// What an entry says.
pub(super) const COLUMNS: usize = usize::MAX - 4;

/// An argument of some states.
#[derive(Clone, Copy)]
pub(super) struct Given<'a, T> {
    pub name: &'static str,
    /// Its place among the arguments of a pass.
    pub at: usize,
    pub numbers: &'a [T],
}

/// The type of an argument.
macro_rules! given {
    (f_ext, $T:ident) => { &[condyle_spatial::Force<$T>] };
    ($name:ident, $T:ident) => { &[$T] };
}
pub(super) use given;

/// An argument with its name and its place.
macro_rules! placed {
    (q, $x:expr) => {
        $crate::batch::table::Given { name: "q", at: 0, numbers: $x }
    };
    (v, $x:expr) => {
        $crate::batch::table::Given { name: "v", at: 1, numbers: $x }
    };
    (a, $x:expr) => {
        $crate::batch::table::Given { name: "a", at: 2, numbers: $x }
    };
    (tau, $x:expr) => {
        $crate::batch::table::Given { name: "tau", at: 2, numbers: $x }
    };
    (lambda, $x:expr) => {
        $crate::batch::table::Given { name: "lambda", at: 3, numbers: $x }
    };
    (f_ext, $x:expr) => {
        $crate::batch::table::Given {
            name: "f_ext",
            at: $crate::batch::group::FORCES,
            numbers: condyle_spatial::block::flat($x),
        }
    };
}
pub(super) use placed;

/// An argument as a pass sees it, in lanes.
macro_rules! of_states {
    ($s:ident, a) => {
        $s.x
    };
    ($s:ident, tau) => {
        $s.x
    };
    ($s:ident, $name:ident) => {
        $s.$name
    };
}
pub(super) use of_states;

macro_rules! batched {
    ($(
        $(#[$doc:meta])*
        fn $name:ident($model:ident, $data:ident, $to:ident $(, $set:ident: BatchConstraints)?;
            $($given:ident),* $(; $($shared:ident: $Shared:ty),*)?) -> $Out:ty [$([$($size:expr),*]),*]
        $(with $($scratch:ident),+)? $(columns ($columns:expr))? $(keeps [$($($place:ident).+: $kind:expr),+])?
        $body:block
    )*) => {
        $(mod $name {
            use super::*;
            use $crate::batch::group::{Pass, States};
            use $crate::batch::places::Places;
            use $crate::batch::table::of_states;

            #[derive(Clone, Copy)]
            struct Work { $($($shared: $Shared),*)? }

            impl<T: condyle_spatial::block::Real> Pass<T> for Work {
                const KINDS: &'static [usize] = &[$($($kind),+)?];

                #[inline(always)]
                #[allow(unused_variables)] // by passes that need no `Data`, or leave what they give
                fn run<S: condyle_spatial::block::Block<Number = T>>(self, s: States<'_, S>, $to: &mut Places<'_, T>) {
                    let Self { $($($shared),*)? } = self;
                    let ($model, $data) = (s.model, s.data);
                    $(let $given = of_states!(s, $given);)*
                    $($(let $scratch = s.$scratch;)+)?
                    $(let $set = s.constraints.expect("a pass under constraints has them");)?
                    $(
                        let mut kept = s.kept;
                        if let Some(kept) = &mut kept {
                            $(core::mem::swap(&mut $data.$($place).+, &mut kept[$kind]);)+
                        }
                    )?
                    $body
                    $(match kept {
                        Some(kept) => { $(core::mem::swap(&mut $data.$($place).+, &mut kept[$kind]);)+ }
                        None => { $($to.kind($kind, &$data.$($place).+);)+ }
                    })?
                }
            }

            /// For all states, to where the results are `written` or to where they stay.
            #[allow(clippy::too_many_arguments)] // those of the function
            pub(super) fn compute<T: condyle_spatial::block::Real>(
                batch: &mut $crate::batch::Batch<T>,
                $model: &condyle_model::Model,
                $($set: &mut $crate::batch::constraints::BatchConstraints<T>,)?
                $($given: $crate::batch::table::given!($given, T),)*
                $($($shared: $Shared,)*)?
                written: Option<&mut [&mut [T]]>,
            ) {
                let (columns, constraints) = (0 $(+ $columns)?, None $(.or(Some($set)))?);
                let given: &[_] = &[$($crate::batch::table::placed!($given, $given)),*];
                let shapes: &[&[usize]] = &[$(&[$($size),*]),*];
                let work = Work { $($($shared),*)? };
                batch.compute(work, $model, given, (shapes, columns), constraints, written);
            }
        })*

        impl<T: condyle_spatial::block::Real> $crate::batch::Batch<T> {$(
            $(#[$doc])*
            pub fn $name(
                &mut self,
                $model: &condyle_model::Model,
                $($set: &mut $crate::batch::constraints::BatchConstraints<T>,)?
                $($given: $crate::batch::table::given!($given, T),)*
                $($($shared: $Shared,)*)?
            ) -> $Out {
                $name::compute(self, $model, $($set,)? $($given,)* $($($shared,)*)? None);
                $crate::batch::results::Take::take(&mut $crate::batch::results::Taken { batch: self, next: 0 })
            }
        )*}

        impl<T: condyle_spatial::block::Real> $crate::batch::BatchWriter<'_, '_, T> {$(
            #[doc = concat!("Writes what [`Batch::", stringify!($name), "`](crate::Batch::", stringify!($name), ") gives.")]
            ///
            /// # Panics
            /// As it does, or if there are not as many places as results, or a place has not the size of its result.
            pub fn $name(
                &mut self,
                $model: &condyle_model::Model,
                $($set: &mut $crate::batch::constraints::BatchConstraints<T>,)?
                $($given: $crate::batch::table::given!($given, T),)*
                $($($shared: $Shared,)*)?
            ) {
                $name::compute(self.batch, $model, $($set,)? $($given,)* $($($shared,)*)? Some(&mut *self.to));
            }
        )*}
    };
}
pub(super) use batched;
