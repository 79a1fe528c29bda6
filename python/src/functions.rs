//! Calls of the library's functions from Python: kinds of arguments, and the code that all calls have in common.
//!
//! `functions!` makes a Python function from a declaration such as
//!
//! ```text
//! /// The docstring.
//! fn rnea(model, data; q: Position, v: Tangent, a: Tangent, f_ext: Forces = None; out) {
//!     condyle::rnea(model, data, &q, &v, &a, &f_ext)
//! }
//! ```
//!
//! Each argument has a kind, which is a type below; the type defines how the argument is read. The last expression is
//! the result for Python: an array or a tuple of arrays, or `out` if it is given. Scratch memory other than `data` is
//! declared after `data`, with its type. The call borrows its scratch memory before it inspects any other argument, so
//! that nested use of the same memory is an error. The call reads all inputs before it writes to `out`, so `out` may be
//! one of the inputs. Positions, tangent vectors and forces may be given for many states, with an additional first
//! axis. The results then have this axis, too; see `batch.rs`. An example of a line `batch` is
//!
//! ```text
//! batch b: any(q: Position, v: Tangent, a: Tangent, f_ext: Forces) -> One { b.rnea(model, q, v, a, f_ext) }
//! ```
//!
//! This line defines the computation for many states. Its parts are a check of the robot (`any`), the arguments, the
//! kind of result (`One`), and the call of the library's `Batch`. Arguments that all states share follow after a
//! semicolon. `batch b, constraints` instead of `batch b` adds a set of constraints. A function without `Data` is
//! called state by state. The line of such a function begins with `each` instead of `batch`, and gives the shape of the
//! result.
//!
//! Each part of a declaration has its own macro: `function!` for the signature, `many!` for a line `batch`, `each!` for
//! a line `each`, and `one!` for the body. The code that does not depend on the declaration is in functions.

use crate::arrays::{self, Number};
use crate::batch::{self, Look};
use crate::exceptions::{ModelError, exception, wrong_word};
use crate::hyper_dual;
use crate::model::{body_index, frame_index};
use crate::signals::{SHORT, Signals};
use condyle::{Force, Model, ReferenceFrame, factors::ForwardDynamicsMethod};
use nalgebra::DMatrix;
use numpy::{Ix1, Ix2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyInt, PyString};
use std::ops::Range;

/// A kind of argument, which defines how an argument is read from Python.
pub(crate) trait Argument<'a, 'py> {
    /// Type of the value that Python passes.
    type Given;
    /// Type of the value that the library takes for one state.
    type Read<S: Number>;
    /// Type of the value that the library takes for many states.
    type All;
    /// Reads the argument without running Python code, if the argument has the simplest form for a single state: a
    /// float64 array in C order, or a word. Returns `None` if the argument has another form or is invalid.
    fn at_once(_given: &Self::Given, _model: &Model) -> Option<Self::Read<f64>> {
        None
    }
    /// Reads the argument `name` of a function of this model.
    fn read(name: &str, given: Self::Given, model: &Model) -> PyResult<Self::Read<f64>> {
        Self::read_at(name, &given, model, None)
    }
    /// Reads the argument as numbers of any type: for a single state, or for state `state` if the argument is given for
    /// many states.
    fn read_at<S: Number>(
        name: &str,
        given: &Self::Given,
        model: &Model,
        state: Option<usize>,
    ) -> PyResult<Self::Read<S>>;
    /// Finds the number of states of an argument, and whether the argument contains hyper-dual numbers. The call does
    /// this before it reads any argument.
    fn look(_name: &str, _given: &Self::Given, _model: &Model) -> PyResult<Look> {
        Ok(Look::default())
    }
    /// Reads the argument for all states. Copies the argument if results are written to its memory before all states
    /// are computed.
    fn read_all(
        name: &str,
        given: &Self::Given,
        model: &Model,
        states: usize,
        written: &[Range<usize>],
    ) -> PyResult<Self::All>;
}

/// An argument of a call, and its numbers if `Argument::at_once` could read the argument.
pub(crate) struct Given<'a, 'py: 'a, K: Argument<'a, 'py>> {
    pub(crate) given: K::Given,
    read: Option<K::Read<f64>>,
}

impl<'a, 'py: 'a, K: Argument<'a, 'py>> Given<'a, 'py, K> {
    #[inline(always)]
    pub(crate) fn new(given: K::Given, model: &Model) -> Self {
        let read = K::at_once(&given, model);
        Self { given, read }
    }

    /// Returns whether `at_once` has read the argument.
    #[inline(always)]
    pub(crate) fn is_read(&self) -> bool {
        self.read.is_some()
    }

    /// Returns the argument's f64 numbers for one of many states, or for the single state. `at_once`: whether
    /// `Argument::at_once` has read all arguments of the call. If true, returns the numbers that it read; otherwise
    /// reads the argument again.
    #[inline(always)]
    #[allow(clippy::extra_unused_type_parameters)] // `duals` has the same type parameter
    pub(crate) fn numbers<S>(
        &mut self,
        name: &str,
        model: &Model,
        state: Option<usize>,
        at_once: bool,
    ) -> PyResult<K::Read<f64>> {
        match self.read.take() {
            Some(read) if at_once => Ok(read),
            _ => K::read_at(name, &self.given, model, state),
        }
    }

    /// Returns the argument's numbers as hyper-dual numbers.
    pub(crate) fn duals<S: Number>(
        &mut self,
        name: &str,
        model: &Model,
        state: Option<usize>,
        _at_once: bool,
    ) -> PyResult<K::Read<S>> {
        K::read_at(name, &self.given, model, state)
    }
}

/// Defines kinds of argument that are one vector for each state, with the length of this vector.
macro_rules! vectors {
    ($($(#[$doc:meta])* $kind:ident: $length:ident),*) => {$(
        $(#[$doc])*
        pub(crate) enum $kind {}

        impl<'a, 'py: 'a> Argument<'a, 'py> for $kind {
            type Given = &'a Bound<'py, PyAny>;
            type Read<S: Number> = S::Input<'py, Ix1>;
            type All = batch::Rows<'py>;
            #[inline(always)]
            fn at_once(given: &Self::Given, model: &Model) -> Option<Self::Read<f64>> {
                arrays::at_once(given, &[model.$length()])
            }
            fn read_at<S: Number>(
                name: &str,
                given: &Self::Given,
                model: &Model,
                state: Option<usize>,
            ) -> PyResult<Self::Read<S>> {
                match state {
                    None => S::read(name, given, &[model.$length()]),
                    state => S::read(name, &batch::at(given, 1, state)?, &[model.$length()]),
                }
            }
            fn look(name: &str, given: &Self::Given, model: &Model) -> PyResult<Look> {
                batch::look(name, given, &[model.$length()])
            }
            fn read_all(
                name: &str,
                given: &Self::Given,
                model: &Model,
                states: usize,
                written: &[Range<usize>],
            ) -> PyResult<Self::All> {
                let rows = batch::all(name, given, 1, states, model.$length())?;
                let addresses = rows.as_ptr_range();
                let [start, end] = [addresses.start, addresses.end].map(<*const f64>::addr);
                let copy = written.iter().any(|place| place.start < end && start < place.end);
                Ok(if copy { batch::Rows::Copy(rows.to_vec()) } else { batch::Rows::Array(rows) })
            }
        }
    )*};
}
vectors! {
    /// A position: nq numbers.
    Position: nq,
    /// A velocity, an acceleration, efforts or a tangent vector: nv numbers.
    Tangent: nv
}

/// A position whose quaternions and pairs (cos, sin) can be scaled to length 1.
pub(crate) enum Scalable {}

impl<'a, 'py: 'a> Argument<'a, 'py> for Scalable {
    type Given = &'a Bound<'py, PyAny>;
    type Read<S: Number> = S::Input<'py, Ix1>;
    type All = batch::Rows<'py>;
    fn read_at<S: Number>(
        name: &str,
        given: &Self::Given,
        model: &Model,
        state: Option<usize>,
    ) -> PyResult<Self::Read<S>> {
        let q = Position::read_at::<S>(name, given, model, state)?;
        let numbers: Vec<f64> = q.iter().map(|x| x.real()).collect();
        model.check_normalizable(&numbers).map_err(exception)?;
        Ok(q)
    }
    fn look(name: &str, given: &Self::Given, model: &Model) -> PyResult<Look> {
        Position::look(name, given, model)
    }
    fn read_all(
        name: &str,
        given: &Self::Given,
        model: &Model,
        states: usize,
        written: &[Range<usize>],
    ) -> PyResult<Self::All> {
        let all = Position::read_all(name, given, model, states, written)?;
        all.chunks_exact(model.nq().max(1)).try_for_each(|q| model.check_normalizable(q)).map_err(exception)?;
        Ok(all)
    }
}

/// A force on each body, (nbodies, 6), or None.
pub(crate) enum Forces {}

impl<'a, 'py: 'a> Argument<'a, 'py> for Forces {
    type Given = Option<&'a Bound<'py, PyAny>>;
    type Read<S: Number> = Vec<Force<S>>;
    type All = Vec<Force<f64>>;
    #[inline(always)]
    fn at_once(given: &Self::Given, model: &Model) -> Option<Self::Read<f64>> {
        let Some(given) = given else { return Some(Vec::new()) };
        Some(batch::forces(&arrays::at_once::<Ix2>(given, &[model.bodies().len(), 6])?))
    }
    fn read_at<S: Number>(
        name: &str,
        given: &Self::Given,
        model: &Model,
        state: Option<usize>,
    ) -> PyResult<Self::Read<S>> {
        let Some(given) = given else { return Ok(Vec::new()) };
        let numbers = S::read::<Ix2>(name, &batch::at(given, 2, state)?, &[model.bodies().len(), 6])?;
        Ok(batch::forces(&numbers))
    }
    fn look(name: &str, given: &Self::Given, model: &Model) -> PyResult<Look> {
        given.map_or(Ok(Look::default()), |given| batch::look(name, given, &[model.bodies().len(), 6]))
    }
    fn read_all(
        name: &str,
        given: &Self::Given,
        model: &Model,
        states: usize,
        _: &[Range<usize>],
    ) -> PyResult<Self::All> {
        let Some(given) = given else { return Ok(Vec::new()) };
        Ok(batch::forces(&batch::all(name, given, 2, states, 6 * model.bodies().len())?))
    }
}

/// Defines kinds of argument that all states share, with the function that reads an argument of this kind.
macro_rules! shared {
    ($(
        $(#[$doc:meta])*
        $kind:ident<$S:ident>: $given:ty => $read:ty {
            |$name:pat_param, $from:pat_param, $model:pat_param| $body:expr
            $(, dual if $is_dual:expr)? $(, at once if $is_simple:expr)?
        }
    )*) => {$(
        $(#[$doc])*
        pub(crate) enum $kind {}

        impl<'a, 'py: 'a> Argument<'a, 'py> for $kind {
            type Given = $given;
            type Read<$S: Number> = $read;
            type All = ();
            $(
                #[inline(always)]
                fn at_once(given: &Self::Given, model: &Model) -> Option<Self::Read<f64>> {
                    if $is_simple(given) { Self::read_at::<f64>("", given, model, None).ok() } else { None }
                }
            )?
            fn read_at<$S: Number>(
                $name: &str,
                $from: &Self::Given,
                $model: &Model,
                _: Option<usize>,
            ) -> PyResult<Self::Read<$S>> {
                $body
            }
            $(fn look(_: &str, given: &Self::Given, _: &Model) -> PyResult<Look> {
                Ok(Look { dual: $is_dual(given), states: None })
            })?
            fn read_all(_: &str, _: &Self::Given, _: &Model, _: usize, _: &[Range<usize>]) -> PyResult<Self::All> {
                unreachable!("{}: all states share it", stringify!($kind))
            }
        }
    )*};
}
shared! {
    /// Tangent vectors as columns: a matrix of nv rows.
    Tangents<S>: &'a Bound<'py, PyAny> => DMatrix<S> { |name, given, model| rows(name, given, model.nv()),
        dual if |given: &&Bound<'_, PyAny>| hyper_dual::within(given) }

    /// The name or index of a frame.
    FrameOf<S>: &'a Bound<'py, PyAny> => usize { |_, given, model| frame_index(model, given), at once if is_plain }

    /// The name of a joint or the index of a body.
    BodyOf<S>: &'a Bound<'py, PyAny> => usize { |_, given, model| {
        body_index("body: expected a joint's name", model, given, 0)
    }, at once if is_plain }

    /// The reference frame (axes and point) of a motion: a word.
    Reference<S>: &'a str => ReferenceFrame { |name, given, _| match *given {
        "local" => Ok(ReferenceFrame::Local),
        "world" => Ok(ReferenceFrame::World),
        "local_world_aligned" => Ok(ReferenceFrame::LocalWorldAligned),
        other => Err(wrong_word(name, "'local', 'world' or 'local_world_aligned'", other)),
    }, at once if |_| true }

    /// The method of forward dynamics: a word, or None.
    MethodOf<S>: Option<&'a str> => Option<ForwardDynamicsMethod> { |name, given, _| match *given {
        None => Ok(None),
        Some("aba") => Ok(Some(ForwardDynamicsMethod::ArticulatedBody)),
        Some("dense") => Ok(Some(ForwardDynamicsMethod::Dense)),
        Some("sparse") => Ok(Some(ForwardDynamicsMethod::Sparse)),
        Some(other) => Err(wrong_word(name, "None, 'aba', 'dense' or 'sparse'", other)),
    }, at once if |_| true }

    /// An input of the dynamics other than q, v, a and τ: a word, or a tuple of a word and a body or number.
    InputOf<S>: &'a Bound<'py, PyAny> => condyle::derivatives::Input { |name, given, model| {
        use condyle::derivatives::Input;
        if let Ok((word, of)) = given.extract::<(String, Bound<'py, PyAny>)>() {
            let body = || body_index("wrt: expected a joint's name", model, &of, 0);
            return match word.as_str() {
                "force" => Ok(Input::Force(body()?)),
                "inertia" => match body()? {
                    0 => Err(PyValueError::new_err(format!("{name}: the world has no inertia"))),
                    body => Ok(Input::Inertia(body)),
                },
                "friction" => Ok(Input::Friction { smoothing: positive_speed("smoothing", of.extract()?)? }),
                other => Err(wrong_word(name, "('force', body), ('inertia', body) or ('friction', smoothing)", other)),
            };
        }
        match given.extract::<String>()?.as_str() {
            "gravity" => Ok(Input::Gravity),
            "armature" => Ok(Input::Armature),
            "damping" => Ok(Input::Damping),
            other => Err(wrong_word(name, "'gravity', 'armature', 'damping' or a pair", other)),
        }
    } }

    /// A real or hyper-dual number, the same for all states.
    Real<S>: &'a Bound<'py, PyAny> => S { |name, given, _| S::read_one(name, given),
        dual if |given: &&Bound<'_, PyAny>| hyper_dual::within(given) }

    /// A point: three numbers, the same for all states.
    Point<S>: &'a Bound<'py, PyAny> => condyle::Vec3<f64> { |name, given, _| crate::arrays::three(name, given) }

    /// A real number, the same for all states.
    Coefficient<S>: f64 => f64 { |_, given, _| Ok(*given), at once if |_| true }

    /// A positive speed.
    Speed<S>: f64 => f64 { |name, given, _| positive_speed(name, *given) }

    /// A word (`str`) whose meaning the function itself checks.
    Word<S>: &'a str => &'a str { |_, given, _| Ok(*given), at once if |_| true }
}

/// Returns whether a name or an index is exactly a `str` or an `int`, so that reading it runs no Python code.
fn is_plain(given: &&Bound<'_, PyAny>) -> bool {
    given.is_exact_instance_of::<PyString>() || given.is_exact_instance_of::<PyInt>()
}

/// Checks that a number is a positive speed, and returns it.
pub(crate) fn positive_speed(name: &str, found: f64) -> PyResult<f64> {
    if found > 0.0 {
        return Ok(found);
    }
    Err(PyValueError::new_err(format!("{name}: expected a positive speed, found {found}")))
}

/// Reads a matrix with this number of rows and any number of columns.
pub(crate) fn rows<S: Number>(name: &str, given: &Bound<'_, PyAny>, rows: usize) -> PyResult<DMatrix<S>> {
    let shape = given.py().import("numpy")?.call_method1("shape", (given,));
    let columns = shape.and_then(|shape| shape.get_item(1)?.extract()).unwrap_or(1); // `read` reports the error
    Ok(DMatrix::from_row_slice(rows, columns, &S::read::<Ix2>(name, given, &[rows, columns])?))
}

/// Accepts every model: the check of a function that works for all robots.
pub(crate) fn any(_: &Model) -> PyResult<()> {
    Ok(())
}

/// Checks that the inertia matrix is invertible, for functions that need its inverse.
pub(crate) fn regular(model: &Model) -> PyResult<()> {
    match model.warnings().iter().find(|w| matches!(w, condyle::tree::Warning::Singular { .. })) {
        None => Ok(()),
        Some(singular) => Err(ModelError::new_err(singular.to_string())),
    }
}

/// Returns whether any argument contains hyper-dual numbers, and the number of states if arguments are given for many
/// states.
pub(crate) fn inspect(looks: &[(&str, Look)]) -> PyResult<(bool, Option<usize>)> {
    Ok((looks.iter().any(|(_, look)| look.dual), batch::agreed(looks)?))
}

/// Calls a function for the only state, or for each of many states in turn; stacks the results of many states.
pub(crate) fn call_serially<'py>(
    py: Python<'py>,
    states: Option<usize>,
    out: Option<&Bound<'py, PyAny>>,
    mut call: impl FnMut(Option<usize>, Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(states) = states else { return call(None, out) };
    let mut signals = Signals::new(SHORT);
    let one = |k| {
        signals.look(py)?;
        call(Some(k), None)
    };
    let results = (0..states).map(one).collect::<PyResult<Vec<_>>>()?;
    batch::stack(py, results, out)
}

/// Declares functions, with the syntax in the documentation of this module. The macro splits each declaration into its
/// parts and passes them to `function!`.
macro_rules! functions {
    ($(
        $(#[$doc:meta])*
        fn $name:ident $signature:tt $body:block
        $(batch $batch:ident $(, $scratch:ident)?: $check:ident $all:tt -> $result:ident $(($class:literal))?
            $in_lanes:block)?
        $(each $of:tt -> $shape:tt |$place:ident| $one:block)?
    )*) => {$(
        $crate::functions::function! {
            $(#[$doc])* $name $signature $body
            { $(batch [$batch $($scratch)?] $check $all [$result $(($class))?] $in_lanes)? }
            { $(each $of $shape $place $one)? }
        }
    )*};
}

/// Declares one function. The first arguments are a model, a `Data` if the declaration contains `data`, and other
/// scratch memory. The function borrows the scratch memory, inspects the other arguments, and computes the results by
/// one of the macros below.
macro_rules! function {
    (
        $(#[$doc:meta])* $name:ident
        ($model:ident $(, $data:ident $(, $scratch:ident: $Scratch:ident)?)?;
            $($arg:ident: $kind:ident $(= $default:tt)?),* $(; $out:ident)?)
        $body:block {$($many:tt)*} {$($each:tt)*}
    ) => {
        $(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = ($model, $($data, $($scratch,)?)? $($arg $(= $default)?,)* $($out = None)?))]
        pub(crate) fn $name<'a, 'py: 'a>(
            $model: &'a Bound<'py, $crate::model::Model>,
            $($data: &'a Bound<'py, $crate::data::Data>, $($scratch: &'a Bound<'py, $Scratch>,)?)?
            $($arg: <$crate::functions::$kind as $crate::functions::Argument<'a, 'py>>::Given,)*
            $($out: Option<&'a Bound<'py, PyAny>>,)?
        ) -> PyResult<Bound<'py, PyAny>> {
            #[allow(unused_imports)] // unused in functions without a `Data` or without arguments
            use $crate::{arrays::Give as _, batch, data::Holds, functions as kinds, functions::Argument};
            let (py, robot) = ($model.py(), $model.get());
            $(
                let mut $data = $crate::data::take(robot, $data)?;
                $(let mut $scratch = $crate::data::take(robot, $scratch)?;)?
            )?
            let $model = &robot.inner;
            let out: Option<&Bound<'py, PyAny>> = None;
            $(let out = out.or($out);)?
            // Fast path: most calls have one state in float64 arrays, and these arrays are read by the lines below. If
            // one argument has another form, all arguments are inspected first.
            $(let mut $arg = kinds::Given::<kinds::$kind>::new($arg, $model);)*
            let at_once = true $(&& $arg.is_read())*;
            let (dual, states) = if at_once { (false, None) } else {
                kinds::inspect(&[$((
                    stringify!($arg),
                    <kinds::$kind as Argument<'_, '_>>::look(stringify!($arg), &$arg.given, $model)?,
                )),*])?
            };
            $crate::functions::many! { (py, $model, states, dual, out) [$($data)?] $($many)* }
            $crate::functions::each! { (py, $model, states, dual, out) $($each)* }
            #[allow(unused_variables)] // unused in functions without a `Data` or without arguments
            let call = |state: Option<usize>, out: Option<&Bound<'py, PyAny>>| match dual {
                false => $crate::functions::one! {
                    f64, numbers, (py, $model, state, out, at_once) [$($data $(, $scratch)?)?] ($($arg),*) $body
                },
                true => $crate::functions::one! {
                    $crate::hyper_dual::Hyper, duals, (py, $model, state, out, at_once)
                    [$($data $(, $scratch)?)?] ($($arg),*) $body
                },
            };
            kinds::call_serially(py, states, out, call)
        }
    };
}

/// Reads the arguments that are given for many states, and the arguments that all states share.
macro_rules! read_all {
    (
        ($model:ident, $states:ident, $out:ident)
        ($($all:ident: $kind:ident),* $(; $($shared:ident: $shared_kind:ident),*)?)
    ) => {
        let written = &$crate::arrays::destinations($out);
        $(let $all = <kinds::$kind as Argument>::read_all(stringify!($all), &$all.given, $model, $states, written)?;)*
        $(let $all = &$all[..];)*
        $($(let $shared = <kinds::$shared_kind as Argument>::read(stringify!($shared), $shared.given, $model)?;)*)?
    };
}

/// Returns the results of many states, computed in SIMD lanes, if the function's declaration has a line `batch`.
macro_rules! many {
    ($call:tt $data:tt) => {};
    (
        ($py:ident, $model:ident, $states:ident, $dual:ident, $out:ident) [$data:ident]
        batch [$batch:ident $($scratch:ident)?] $check:ident
        ($($all:ident: $kind:ident),* $(; $($shared:ident: $shared_kind:ident),*)?)
        [$result:ident $(($class:literal))?] $in_lanes:block
    ) => {
        if let (Some($states), false) = ($states, $dual) {
            $check($model)?;
            $crate::functions::read_all! {
                ($model, $states, $out) ($($all: $kind),* $(; $($shared: $shared_kind),*)?)
            }
            let lanes = $data.batch($model, $states);
            $(let $scratch = $scratch.side_by_side(lanes, $model)?;)?
            return batch::run($py, lanes, batch::Kind::$result $(($class))?, $states, $out, |$batch, some| {
                $(let $all = batch::part($all, &some, $states);)*
                $in_lanes;
            });
        }
    };
}

/// Returns the results of many states, computed one after the other, if the function's declaration has a line `each`.
macro_rules! each {
    ($call:tt) => {};
    (
        ($py:ident, $model:ident, $states:ident, $dual:ident, $out:ident)
        each ($($of:ident: $kind:ident),* $(; $($shared:ident: $shared_kind:ident),*)?)
        [$($size:ident),*] $place:ident $one:block
    ) => {
        if let (Some($states), false) = ($states, $dual) {
            $crate::functions::read_all! {
                ($model, $states, $out) ($($of: $kind),* $(; $($shared: $shared_kind),*)?)
            }
            return batch::each($py, $states, &[$($model.$size()),*], $out, |k, $place| {
                $(let $of = batch::part($of, &(k..k + 1), $states);)*
                $one
            });
        }
    };
}

/// Computes one state with numbers of type `$S`: f64 or hyper-dual numbers. `$read` reads the arguments as numbers of
/// this type.
macro_rules! one {
    (
        $S:ty, $read:ident, ($py:ident, $model:ident, $state:ident, $out:ident, $at_once:ident)
        [$($data:ident $(, $scratch:ident)?)?] ($($arg:ident),*) $body:block
    ) => {{
        $(
            let $data = Holds::<$S>::held(&mut *$data, $model)?;
            $(let $scratch = Holds::<$S>::held(&mut *$scratch, $model)?;)?
        )?
        $(let $arg = $arg.$read::<$S>(stringify!($arg), $model, $state, $at_once)?;)*
        let result = $body;
        result.give($py, $out)
    }};
}
pub(crate) use {each, function, functions, many, one, read_all};
