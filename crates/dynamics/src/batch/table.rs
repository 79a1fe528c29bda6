//! How a function becomes one of a batch: `batched!` makes of an entry like
//!
//! ```text
//! /// [`coriolis_matrix`](crate::coriolis_matrix): C of each state, nv × nv.
//! fn coriolis_matrix(model, data; q, v) -> Matrices<'_, T> [[NV, NV]] { coriolis_matrix(model, data, q, v) }
//! ```
//!
//! the methods of `Batch` and of `BatchWriter` of that name: they take the arguments of all states, check them, and run the
//! body on groups of states, a lane for each. What it gives is put to the places that have the shapes in brackets; results in
//! a struct have theirs there (`results!`). With `data => to` the body writes to places itself. After the arguments of states
//! may stand some that all share, with their types; `with` names more of what a pass has, `columns` says what `COLUMNS` is in a
//! shape, and `keeps` names the matrices of `Data` that stay in lanes instead, the last ones of the shapes; a writer writes
//! them too.

use super::group::FORCES;
use crate::calls::parameter_derivatives::Input;
use crate::passes::factored_dynamics::ForwardDynamicsMethod;
use crate::passes::frames::{ReferenceFrame, check_body, check_frame};
use crate::passes::passive::check_smoothing;
use condyle_model::Model;

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

/// The numbers of an argument.
macro_rules! numbers {
    (f_ext, $x:expr) => {
        condyle_spatial::block::flat($x)
    };
    ($name:ident, $x:expr) => {
        $x
    };
}
pub(super) use numbers;

/// The place of an argument among those of a pass, by its name.
pub(super) const fn place(name: &str) -> usize {
    match name.as_bytes() {
        b"q" => 0,
        b"v" => 1,
        b"a" | b"tau" => 2,
        b"lambda" => 3,
        _ => FORCES,
    }
}

/// An argument that all states share. It is checked before the lanes are entered, so that the panic names the caller's line.
pub(super) trait Shared: Sized {
    /// Panics if the argument of this name is wrong for the model.
    #[track_caller]
    fn check(self, _name: &str, _model: &Model) {}
}

impl Shared for ReferenceFrame {}
impl Shared for Option<ForwardDynamicsMethod> {}

/// A body or a frame.
impl Shared for usize {
    #[track_caller]
    fn check(self, name: &str, model: &Model) {
        match name {
            "frame" => check_frame(model, self),
            _ => check_body(model, self),
        }
    }
}

/// A restitution or a smoothing.
impl Shared for f64 {
    #[track_caller]
    fn check(self, name: &str, _: &Model) {
        if name == "smoothing" {
            check_smoothing(self);
        }
    }
}

impl Shared for Input {
    #[track_caller]
    fn check(self, _: &str, model: &Model) {
        Input::check(self, model, "input", (model.nv(), self.len(model)));
    }
}

/// Puts what a pass gives to the next places, if it has not written to places itself.
macro_rules! put {
    ($places:ident, $body:block) => {
        $crate::batch::places::Put::<S>::put($body, $places)
    };
    ($places:ident => $to:ident, $body:block) => {{
        let $to = &mut *$places;
        $body
    }};
}
pub(super) use put;

/// The shapes of results: as a function says, or as the struct that it gives does.
macro_rules! shapes {
    ($Out:ty, [$([$($size:expr),*]),*]) => { &[$(&[$($size),*]),*] };
    ($Out:ty,) => { <$Out as $crate::batch::results::Take<T>>::SHAPES };
}
pub(super) use shapes;

macro_rules! batched {
    ($(
        $(#[$doc:meta])*
        fn $name:ident($model:ident, $data:ident $(, $set:ident: BatchConstraints)? $(=> $to:ident)?;
            $($given:ident),* $(; $($shared:ident: $Shared:ty),*)?)
        $(with $scratch:ident)? $(columns ($columns:expr))? $(keeps [$($($place:ident).+: $kind:expr),+])?
        -> $Out:ty $([$($shape:tt),*])? $body:block
    )*) => {
        $(mod $name {
            use super::*;
            use $crate::batch::group::{Pass, States};
            use $crate::batch::places::Places;

            #[derive(Clone, Copy)]
            struct Work { $($($shared: $Shared),*)? }

            impl<T: condyle_spatial::block::Real> Pass<T> for Work {
                const KINDS: &'static [usize] = &[$($($kind),+)?];

                #[inline(always)]
                #[allow(unused_variables)] // by passes that need no `Data`, or leave what they give
                fn run<S: condyle_spatial::block::Block<Number = T>>(self, s: States<'_, S>, to: &mut Places<'_, T>) {
                    let Self { $($($shared),*)? } = self;
                    let ($model, $data) = (s.model, s.data);
                    $(let $given = s.$given;)*
                    $(let $scratch = s.$scratch;)?
                    $(let $set = s.constraints.expect("a pass under constraints has them");)?
                    $(
                        let mut kept = s.kept;
                        if let Some(kept) = &mut kept {
                            $(core::mem::swap(&mut $data.$($place).+, &mut kept[$kind]);)+
                        }
                    )?
                    $crate::batch::table::put!(to $(=> $to)?, $body);
                    $(match kept {
                        Some(kept) => { $(core::mem::swap(&mut $data.$($place).+, &mut kept[$kind]);)+ }
                        None => { $(to.kind($kind, &$data.$($place).+);)+ }
                    })?
                }
            }

            /// For all states, to where the results are `written` or to where they stay.
            #[allow(clippy::too_many_arguments)] // those of the function
            #[track_caller]
            pub(super) fn compute<T: condyle_spatial::block::Real>(
                batch: &mut $crate::batch::Batch<T>,
                $model: &condyle_model::Model,
                $($set: &mut $crate::batch::constraints::BatchConstraints<T>,)?
                $($given: $crate::batch::table::given!($given, T),)*
                $($($shared: $Shared,)*)?
                written: Option<&mut [&mut [T]]>,
            ) {
                $($($crate::batch::table::Shared::check($shared, stringify!($shared), $model);)*)?
                let (columns, constraints) = (0 $(+ $columns)?, None $(.or(Some($set)))?);
                let given: &[_] = &[$($crate::batch::table::Given {
                    name: stringify!($given),
                    at: const { $crate::batch::table::place(stringify!($given)) },
                    numbers: $crate::batch::table::numbers!($given, $given),
                }),*];
                let shapes: &[&[usize]] = $crate::batch::table::shapes!($Out, $([$($shape),*])?);
                let work = Work { $($($shared),*)? };
                batch.compute(work, $model, given, (shapes, columns), constraints, written);
            }
        })*

        impl<T: condyle_spatial::block::Real> $crate::batch::Batch<T> {$(
            $(#[$doc])*
            #[track_caller]
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
            /// As it does, or if there are not as many places as results, or a place does not have the size of its result.
            #[track_caller]
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
