//! Table of the batch functions. `batched!` turns an entry like
//!
//! ```text
//! /// [`coriolis_matrix`](crate::coriolis_matrix): C of each state, nv × nv.
//! fn coriolis_matrix(model, data; q, v) -> Matrices<'_, T> [[NV, NV]] { coriolis_matrix(model, data, q, v) }
//! ```
//!
//! into methods `coriolis_matrix` of `Batch` and `BatchWriter`. The methods take and check the arguments of all states,
//! and run the body on groups of states, one state per lane.
//!
//! - The result of the body is written to destinations that have the shapes in brackets. The macro `results!` defines
//!   the shapes of structs.
//! - With `data => to`, the body writes to the destinations itself.
//! - After the arguments of each state, an entry may list arguments that all states share, with types.
//! - `with` names the scratch that the pass needs besides `Data`.
//! - `columns` gives the value of `COLUMNS` in a shape.
//! - `keeps` names matrices of `Data` that stay in lanes and are not copied to destinations. The last shapes in
//!   brackets belong to these matrices. `BatchWriter` writes these matrices too.

use super::group::FORCES;
use crate::calls::parameter_derivatives::Input;
use crate::passes::factored_dynamics::ForwardDynamicsMethod;
use crate::passes::frames::{ReferenceFrame, check_body, check_frame};
use crate::passes::passive::check_smoothing;
use condyle_model::Model;

/// Placeholders in shapes for sizes that depend on the robot.
pub(super) const NV: usize = usize::MAX;
pub(super) const BODIES: usize = usize::MAX - 1;
/// Number of inertial parameters: ten per body, except the world.
pub(super) const PARAMETERS: usize = usize::MAX - 2;
/// Number of constraint rows.
pub(super) const ROWS: usize = usize::MAX - 3;
/// Number of columns that the entry of the function gives with `columns`.
pub(super) const COLUMNS: usize = usize::MAX - 4;

/// One argument of a call, with the numbers of all states.
#[derive(Clone, Copy)]
pub(super) struct Given<'a, T> {
    pub name: &'static str,
    /// Index of the argument's slot among the arguments of a pass.
    pub at: usize,
    pub numbers: &'a [T],
}

/// Expands to the type of an argument of the given name.
macro_rules! given {
    (f_ext, $T:ident) => { &[condyle_spatial::Force<$T>] };
    ($name:ident, $T:ident) => { &[$T] };
}
pub(super) use given;

/// Expands to the argument of the given name as a slice of numbers.
macro_rules! numbers {
    (f_ext, $x:expr) => {
        condyle_spatial::block::flat($x)
    };
    ($name:ident, $x:expr) => {
        $x
    };
}
pub(super) use numbers;

/// Returns the slot of an argument among the arguments of a pass, by its name.
pub(super) const fn place(name: &str) -> usize {
    match name.as_bytes() {
        b"q" => 0,
        b"v" => 1,
        b"a" | b"tau" => 2,
        b"lambda" => 3,
        _ => FORCES,
    }
}

/// Argument that all states share. It is checked before any lane is computed, so that the panic names the caller's
/// line.
pub(super) trait Shared: Sized {
    /// Panics if the argument of this name is invalid for the model.
    #[track_caller]
    fn check(self, _name: &str, _model: &Model) {}
}

impl Shared for ReferenceFrame {}
impl Shared for Option<ForwardDynamicsMethod> {}

/// Index of a body or a frame, as a shared argument.
impl Shared for usize {
    #[track_caller]
    fn check(self, name: &str, model: &Model) {
        match name {
            "frame" => check_frame(model, self),
            _ => check_body(model, self),
        }
    }
}

/// Restitution or smoothing, as a shared argument.
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

/// Writes the result of a pass to the next destinations, unless the pass has already written the result.
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

/// Expands to the shapes of results. The function's entry gives the shapes, or else the struct that the function
/// returns.
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
                #[allow(unused_variables)] // some passes do not use `Data` or the destinations
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

            /// Computes all states. If `written` is `None`, the results stay in the batch; otherwise they go to the
            /// caller's memory `written`.
            #[allow(clippy::too_many_arguments)] // the entry of the function determines the number of arguments
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
            #[doc = concat!("Writes the results of [`Batch::", stringify!($name), "`](crate::Batch::", stringify!($name), ").")]
            ///
            /// # Panics
            /// Panics in the same cases as the method of [`Batch`](crate::Batch), or if `to` does not have one slice
            /// per result, with the length of the result.
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
