//! Batches of states, such as the knots of a horizon or the samples of a controller.
//!
//! A pass (a recursion over the bodies) computes one state per lane of a vector register. The number of lanes depends
//! on the SIMD level: eight or four in `f64`, sixteen or eight in `f32`, and one at the baseline level. Groups of
//! states are distributed over threads. Arguments and results are stored state by state. The matrices of RNEA, CRBA,
//! ABA and M⁻¹ keep the layout of the passes: each entry is stored for all states of a group before the next entry.
//! Lanes are independent, and each lane computes like a call for a single state at the same SIMD level. So the results
//! of a state are bit-identical at any index, for any batch size and any number of threads.
//!
//! Each function is an entry of a table (`table.rs`). The entry calls the function for a single state, with a vector of
//! lanes as its scalar type.

/// Matches a value of `InLanes` or `Sets`, and evaluates the same expression for the content of any variant.
macro_rules! each {
    ($Of:ident, $of:expr, $some:ident => $body:expr) => {
        match $of {
            $Of::Single($some) => $body,
            $Of::Narrow($some) => $body,
            $Of::Wide($some) => $body,
        }
    };
}

pub(crate) mod centroidal;
pub(crate) mod constrained;
pub(crate) mod constraints;
pub(crate) mod derivatives;
mod dynamics;
pub(crate) mod group;
pub(crate) mod kinematics;
mod places;
pub(crate) mod results;
pub(crate) mod state_matrix;
mod state_matrix_operators;
mod table;

use crate::workspace::Gate;
use alloc::vec;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::block::Real;
use condyle_spatial::level::{Level, level};
use constraints::{BatchConstraints, Sets};
use group::{ARGUMENTS, Arguments, FORCES, Group, MINV, Pass, enter};
use places::{MOST_RESULTS, Places};
use results::{Last, Shape};
use table::{BODIES, COLUMNS, Given, NV, PARAMETERS, ROWS};

/// Scratch and results for computing up to a given number of states (the capacity) in one call, on one or several
/// threads.
///
/// Every function takes the arguments of the function of the same name for a single state, with the numbers of all
/// states one after the other: q has `states` · nq numbers. The number of states may change from call to call. Results
/// are valid until the next call. `T` is `f64`, or `f32` with the feature `f32`. If a robot has no coordinates, the
/// number of forces determines the number of states; without forces, the number of states is the capacity.
///
/// [`new`](Self::new) allocates the scratch of each thread, and a vector of nv numbers per state. A call allocates if
/// its results need more memory than the results of all earlier calls. With more than one thread, rayon allocates too.
/// A batch uses the SIMD level that is current when the batch is made. A batch for one thread runs in the caller's
/// thread. Other batches run in the rayon pool of the caller, or in the global pool.
///
/// ```
/// use condyle_dynamics::{Batch, Data, rnea, robots};
/// let arm = robots::arm7();
/// let mut batch = Batch::new(&arm, 100, 1);
/// let q: Vec<f64> = (0..700).map(|i| 0.01 * i as f64).collect();
/// let (v, a) = (vec![0.1; 700], vec![0.2; 700]);
/// let tau = batch.rnea(&arm, &q, &v, &a, &[]); // of 100 states
/// let mut data = Data::new(&arm);
/// assert_eq!(tau[63..70], *rnea(&arm, &mut data, &q[63..70], &v[63..70], &a[63..70], &[])); // the tenth
/// ```
#[derive(Clone, Debug)]
pub struct Batch<T: Real = f64> {
    states: usize,
    lanes: InLanes<T>,
    /// Results that do not stay in lanes, stored one state after the other. Shape: states × shape of the result.
    /// Written by: all functions.
    slots: [Vec<T>; MOST_RESULTS],
    last: Last,
}

/// Number type that batches support: `f64`, and `f32` with the feature `f32`.
pub trait BatchNumber: Real {}

impl BatchNumber for f64 {}

#[cfg(feature = "f32")]
impl BatchNumber for f32 {}

/// Groups of states. The variant gives the number of lanes, which depends on the SIMD level.
#[derive(Clone, Debug)]
enum InLanes<T: Real> {
    Single(Group<T>),
    Narrow(Group<T::Narrow<Gate>>),
    Wide(Group<T::Wide<Gate>>),
}

impl<T: Real> Batch<T> {
    /// Maximum number of threads of a batch; each thread has its own scratch.
    pub const MOST_THREADS: usize = 1024;

    /// Maximum number of states of a batch; the memory of the machine may suffice only for fewer states.
    pub const MOST_STATES: usize = 1 << (usize::BITS / 2);

    /// Allocates a batch for up to `states` states at once, on `threads` threads.
    ///
    /// # Panics
    /// Panics if `threads` is 0 or above [`MOST_THREADS`](Self::MOST_THREADS), or `states` above
    /// [`MOST_STATES`](Self::MOST_STATES).
    #[track_caller]
    pub fn new(model: &Model, states: usize, threads: usize) -> Self
    where
        T: BatchNumber,
    {
        let (most_threads, most_states) = (Self::MOST_THREADS, Self::MOST_STATES);
        assert!(threads > 0, "threads: expected at least 1, found 0");
        assert!(threads <= most_threads, "threads: expected at most {most_threads}, found {threads}");
        assert!(states <= most_states, "states: expected at most {most_states}, found {states}");
        Self {
            states,
            lanes: match level() {
                Level::Baseline => InLanes::Single(Group::new(model, states, threads)),
                Level::Simd128 | Level::Neon | Level::Avx2 => InLanes::Narrow(Group::new(model, states, threads)),
                Level::Avx512 => InLanes::Wide(Group::new(model, states, threads)),
            },
            slots: core::array::from_fn(|k| if k == 0 { vec![T::zero(); states * model.nv()] } else { Vec::new() }),
            last: Last::default(),
        }
    }

    /// Returns a writer. It has the same functions as the batch, but these functions write the results to the caller's
    /// memory.
    ///
    /// `to` has one slice for each result of the called function, in the order of the fields of the result struct. Each
    /// slice receives the numbers of all states one after the other, matrices by rows. The passes write directly to
    /// these slices, so results need no copy. If no argument determines the number of states, the length of the slices
    /// determines this number.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, robots};
    /// let arm = robots::arm7();
    /// let (mut batch, q) = (Batch::new(&arm, 10, 1), vec![0.3; 70]);
    /// let mut M = vec![0.0; 10 * 7 * 7];
    /// batch.writer(&mut [&mut M]).crba(&arm, &q);
    /// assert_eq!(M[9 * 49 + 7 + 2], batch.crba(&arm, &q).at(9)[(1, 2)]);
    /// ```
    pub fn writer<'b, 'a>(&'b mut self, to: &'b mut [&'a mut [T]]) -> BatchWriter<'b, 'a, T> {
        BatchWriter { batch: self, to }
    }

    /// Returns the maximum number of states.
    pub fn capacity(&self) -> usize {
        self.states
    }

    /// Returns the number of threads.
    pub fn threads(&self) -> usize {
        each!(InLanes, &self.lanes, group => group.threads())
    }

    /// Returns the number of states of the arguments. The first argument whose length per state is not 0 determines
    /// this number. Without such an argument, the forces determine it. Without forces, the number is `full`.
    #[track_caller]
    fn count(&self, model: &Model, given: &[Given<'_, T>], full: usize) -> usize {
        let length = |at: usize| [model.nq(), model.nv(), model.nv(), model.nv(), 6 * model.nodes().len()][at];
        let first = given.iter().find(|one| one.at != FORCES && length(one.at) > 0);
        let forces = given.iter().find(|one| one.at == FORCES && !one.numbers.is_empty());
        let states = first.or(forces).map_or(full, |one| one.numbers.len() / length(one.at));
        for (k, one) in given.iter().enumerate() {
            let (name, each, found) = (one.name, length(one.at), one.numbers.len());
            if one.at == FORCES {
                let forces = states * model.nodes().len();
                assert!(
                    found == 0 || found == 6 * forces,
                    "f_ext: expected no force or {forces} (one for each body of each state), found {}",
                    found / 6
                );
            } else if k == 0 {
                assert!(
                    found == states * each && states <= self.states,
                    "{name}: expected {each} numbers for each of at most {} states, found {found}",
                    self.states
                );
            } else {
                check(name, found, states * each);
            }
        }
        states
    }

    /// Checks the arguments and runs a pass over all states. The results have the given shapes. If `written` is `None`,
    /// the results stay in the batch; otherwise they go to the caller's memory `written`.
    #[track_caller]
    fn compute<P: Pass<T>>(
        &mut self,
        pass: P,
        model: &Model,
        given: &[Given<'_, T>],
        (shapes, columns): (&[&[usize]], usize),
        constraints: Option<&mut BatchConstraints<T>>,
        written: Option<&mut [&mut [T]]>,
    ) {
        each!(InLanes, &self.lanes, group => group.check(model));
        if let Some(constraints) = &constraints {
            constraints.check(model);
            assert!(constraints.fits(self), "constraints: made for another batch");
        }
        let inverse = P::KINDS.contains(&MINV) || given.iter().any(|one| one.name == "tau");
        if inverse || constraints.is_some() {
            model.check_regular(); // before the code of the SIMD level runs, so that the panic names the caller's line
        }
        let rows = constraints.as_ref().map_or(0, |constraints| constraints.rows());
        let size = |&size: &usize| match size {
            NV => model.nv(),
            BODIES => model.nodes().len(),
            PARAMETERS => 10 * (model.nodes().len() - 1),
            ROWS => rows,
            COLUMNS => columns,
            other => other,
        };
        let mut last = Last { results: shapes.len(), ..Last::default() };
        let kinds = if written.is_some() { &[] } else { P::KINDS };
        let first_kept = shapes.len() - kinds.len();
        for (k, shape) in shapes.iter().enumerate() {
            last.shapes[k] = Shape::new(shape.iter().map(size));
            last.kept[k] = k.checked_sub(first_kept).map(|kind| kinds[kind]);
        }
        let full = written.as_ref().map_or(self.states, |places| last.room(places).min(self.states));
        let states = self.count(model, given, full);
        last.states = states;
        self.last = last;
        let mut to: [&mut [T]; MOST_RESULTS] = Default::default();
        if states == 0 {
            return; // no results to write
        }
        if let Some(places) = written {
            self.last.check(places);
            for (to, place) in to.iter_mut().zip(places) {
                *to = place;
            }
        } else {
            for (k, (to, slot)) in to.iter_mut().zip(&mut self.slots).take(first_kept).enumerate() {
                let size = last.shapes[k].len();
                if slot.len() < self.states * size {
                    slot.resize(self.states * size, T::zero());
                }
                *to = &mut slot[..states * size];
            }
        }
        let mut from = Arguments([&[] as &[T]; ARGUMENTS]);
        for one in given {
            from.0[one.at] = one.numbers;
        }
        let places = (from, Places::new(to, first_kept, states), !kinds.is_empty());
        macro_rules! run {
            ($group:ident, $kind:ident) => {{
                $group.keep(kinds, model.nv());
                let sets = match constraints.map(|constraints| &mut constraints.sets) {
                    Some(Sets::$kind(sets)) => &mut sets[..],
                    _ => &mut [],
                };
                $group.run(&|of, to| enter(pass, of, to), model, states, sets, places);
            }};
        }
        match &mut self.lanes {
            InLanes::Single(group) => run!(group, Single),
            InLanes::Narrow(group) => run!(group, Narrow),
            InLanes::Wide(group) => run!(group, Wide),
        }
    }
}

/// Batch whose functions write their results to the caller's memory: see [`Batch::writer`].
#[derive(Debug)]
pub struct BatchWriter<'b, 'a, T: Real> {
    batch: &'b mut Batch<T>,
    to: &'b mut [&'a mut [T]],
}
