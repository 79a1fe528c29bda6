//! Many states at once: the knots of a horizon, the samples of a controller.
//!
//! As many states as a vector register holds go through a pass side by side, each in a lane: by the processor's level that
//! is eight or four in `f64`, sixteen or eight in `f32`, one at the baseline. Groups of them are spread over threads.
//! Arguments and vectors lie state after state; matrices stay as the passes leave them, entry after entry, each for a
//! whole group. A lane knows nothing of the others, and computes as a single call
//! does at that level, so a state's numbers are the same to the last bit wherever it stands, in however long a batch, on
//! however many threads.

mod pass;
use crate::workspace::Gate;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::Force;
use condyle_spatial::block::Real;
use condyle_spatial::level::{Level, level};
use nalgebra::{Dyn, MatrixView};
use pass::{
    Aba, AbaDerivatives, Arguments, Crba, DA, DTAU, Gravity, Group, M, MINV, Minv, NonlinearEffects, Pass, Rnea,
    RneaDerivatives,
};

/// Scratch and results for up to N states at once, on one or several threads.
///
/// Every function takes its arguments as the one of the same name for a single state does, with those of all states one
/// after the other: q has `states` · nq numbers, and how many states that is may change from call to call. Results stay
/// until the next call. `T` is `f64` or `f32`. Of a robot without coordinates, of which nothing says how many states are
/// meant, they are as many as there are forces for, or without forces as many as there is room for.
///
/// Memory is allocated by [`new`](Self::new) for scratch, once for each thread, and for a vector of nv numbers for each
/// state; by the first call of a function that gives matrices for those matrices, nv² numbers each; and by rayon for itself
/// on more than one thread. The level of vector instructions is the one in use when the batch is made. Made for one thread,
/// it never leaves the caller's; else it runs in the pool of rayon in which it is called, or else in the global one.
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
#[derive(Debug)]
pub struct Batch<T: Real = f64> {
    states: usize,
    lanes: InLanes<T>,
    /// Shape: states × nv. Written by: all that return vectors.
    vectors: Vec<T>,
}

/// Groups of as many states as the vectors of the level have lanes.
#[derive(Debug)]
enum InLanes<T: Real> {
    Single(Group<T>),
    Short(Group<T::Short<Gate>>),
    Long(Group<T::Long<Gate>>),
}

impl<T: Real> Batch<T> {
    /// The most threads: each has scratch of its own.
    pub const MOST_THREADS: usize = 1024;

    /// The most states, of which there may be less memory for.
    pub const MOST_STATES: usize = 1 << (usize::BITS / 2);

    /// Room for up to `states` states at once, on `threads` threads.
    ///
    /// # Panics
    /// If `threads` is 0 or above [`MOST_THREADS`](Self::MOST_THREADS), or `states` above
    /// [`MOST_STATES`](Self::MOST_STATES).
    pub fn new(model: &Model, states: usize, threads: usize) -> Self {
        let (most_threads, most_states) = (Self::MOST_THREADS, Self::MOST_STATES);
        assert!(threads > 0, "threads: expected at least 1, found 0");
        assert!(threads <= most_threads, "threads: expected at most {most_threads}, found {threads}");
        assert!(states <= most_states, "states: expected at most {most_states}, found {states}");
        Self {
            states,
            lanes: match level() {
                Level::Baseline => InLanes::Single(Group::new(model, states, threads)),
                Level::Simd128 | Level::Neon | Level::Avx2 => InLanes::Short(Group::new(model, states, threads)),
                Level::Avx512 => InLanes::Long(Group::new(model, states, threads)),
            },
            vectors: vec![T::zero(); states * model.nv()],
        }
    }

    /// The number of states for which it has room.
    pub fn capacity(&self) -> usize {
        self.states
    }

    /// Checks the arguments and runs a pass over all states, with a vector for each of them or none; how many they are.
    fn run(
        &mut self,
        pass: impl Pass<T>,
        model: &Model,
        names: [&str; 2],
        from: Arguments<'_, T>,
        has_vectors: bool,
    ) -> usize {
        match &self.lanes {
            InLanes::Single(g) => g.check(model),
            InLanes::Short(g) => g.check(model),
            InLanes::Long(g) => g.check(model),
        }
        let bodies = model.nodes().len();
        let states = match from.q.len().checked_div(model.nq()) {
            Some(states) => states,
            None if from.f_ext.is_empty() => self.states,
            None => from.f_ext.len() / bodies,
        };
        assert!(
            states * model.nq() == from.q.len() && states <= self.states,
            "q: expected {} numbers for each of at most {} states, found {}",
            model.nq(),
            self.states,
            from.q.len()
        );
        for (name, found) in names.into_iter().zip([from.v.len(), from.x.len()]).filter(|(name, _)| !name.is_empty()) {
            check(name, found, states * model.nv());
        }
        let (found, forces) = (from.f_ext.len(), states * bodies);
        assert!(
            found == 0 || found == forces,
            "f_ext: expected no force or {forces} (one for each body of each state), found {found}"
        );
        let vectors = &mut self.vectors[..if has_vectors { states * model.nv() } else { 0 }];
        if states > 0 {
            match &mut self.lanes {
                InLanes::Single(g) => g.run(pass, model, states, from, vectors),
                InLanes::Short(g) => g.run(pass, model, states, from, vectors),
                InLanes::Long(g) => g.run(pass, model, states, from, vectors),
            }
        }
        states
    }

    fn vectors(&self, model: &Model, states: usize) -> &[T] {
        &self.vectors[..states * model.nv()]
    }

    fn matrices(&self, kind: usize, states: usize) -> Matrices<'_, T> {
        Matrices { of: &self.lanes, kind, states }
    }

    /// [`rnea`](crate::rnea()): τ of each state, nv numbers.
    ///
    /// q: nq numbers a state; v, a: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// If an argument has the wrong length, there are more states than there is room for, or the batch was made for a
    /// model of another tree; so do all below.
    pub fn rnea(&mut self, model: &Model, q: &[T], v: &[T], a: &[T], f_ext: &[Force<T>]) -> &[T] {
        let n = self.run(Rnea, model, ["v", "a"], Arguments { q, v, x: a, f_ext }, true);
        self.vectors(model, n)
    }

    /// [`nonlinear_effects`](crate::nonlinear_effects): h of each state, nv numbers.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    pub fn nonlinear_effects(&mut self, model: &Model, q: &[T], v: &[T]) -> &[T] {
        let n = self.run(NonlinearEffects, model, ["v", ""], Arguments { q, v, x: &[], f_ext: &[] }, true);
        self.vectors(model, n)
    }

    /// [`gravity`](crate::gravity): g of each state, nv numbers.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    pub fn gravity(&mut self, model: &Model, q: &[T]) -> &[T] {
        let n = self.run(Gravity, model, ["", ""], Arguments { q, v: &[], x: &[], f_ext: &[] }, true);
        self.vectors(model, n)
    }

    /// [`aba`](crate::aba()): q̈ of each state, nv numbers.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea), or if M is singular ([`Model::singular_joints`]).
    pub fn aba(&mut self, model: &Model, q: &[T], v: &[T], tau: &[T], f_ext: &[Force<T>]) -> &[T] {
        let n = self.run(Aba, model, ["v", "tau"], Arguments { q, v, x: tau, f_ext }, true);
        self.vectors(model, n)
    }

    /// [`crba`](crate::crba()): M of each state, nv × nv.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    pub fn crba(&mut self, model: &Model, q: &[T]) -> Matrices<'_, T> {
        let n = self.run(Crba, model, ["", ""], Arguments { q, v: &[], x: &[], f_ext: &[] }, false);
        self.matrices(M, n)
    }

    /// [`minv`](crate::minv()): M⁻¹ of each state, nv × nv.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea), or if M is singular ([`Model::singular_joints`]).
    pub fn minv(&mut self, model: &Model, q: &[T]) -> Matrices<'_, T> {
        let n = self.run(Minv, model, ["", ""], Arguments { q, v: &[], x: &[], f_ext: &[] }, false);
        self.matrices(MINV, n)
    }

    /// [`rnea_derivatives`](crate::rnea_derivatives()) of each state, three matrices nv × nv.
    ///
    /// q: nq numbers a state; v, a: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    pub fn rnea_derivatives(
        &mut self,
        model: &Model,
        q: &[T],
        v: &[T],
        a: &[T],
        f_ext: &[Force<T>],
    ) -> BatchRneaDerivatives<'_, T> {
        let n = self.run(RneaDerivatives, model, ["v", "a"], Arguments { q, v, x: a, f_ext }, false);
        let [dtau_dq, dtau_dv, dtau_da] = DTAU.map(|kind| self.matrices(kind, n));
        BatchRneaDerivatives { dtau_dq, dtau_dv, dtau_da }
    }

    /// [`aba_derivatives`](crate::aba_derivatives()) of each state, nv numbers and three matrices nv × nv.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea), or if M is singular ([`Model::singular_joints`]).
    pub fn aba_derivatives(
        &mut self,
        model: &Model,
        q: &[T],
        v: &[T],
        tau: &[T],
        f_ext: &[Force<T>],
    ) -> BatchAbaDerivatives<'_, T> {
        let n = self.run(AbaDerivatives, model, ["v", "tau"], Arguments { q, v, x: tau, f_ext }, true);
        let [da_dq, da_dv, da_dtau] = [DA[0], DA[1], MINV].map(|kind| self.matrices(kind, n));
        BatchAbaDerivatives { a: self.vectors(model, n), da_dq, da_dv, da_dtau }
    }
}

/// A matrix of one state, whose entries do not lie next to each other.
pub type StateMatrix<'b, T> = MatrixView<'b, T, Dyn, Dyn, Dyn, Dyn>;

/// A matrix nv × nv for each state of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Matrices<'b, T: Real> {
    of: &'b InLanes<T>,
    kind: usize,
    states: usize,
}

impl<'b, T: Real> Matrices<'b, T> {
    /// The matrix of state k: a view, which [`copy_from`](nalgebra::Matrix::copy_from) copies to a matrix of one's own.
    ///
    /// # Panics
    /// If there are not so many states.
    pub fn at(&self, k: usize) -> StateMatrix<'b, T> {
        assert!(k < self.states, "k: expected a number below that of the states, {}, found {k}", self.states);
        match self.of {
            InLanes::Single(group) => group.matrix(self.kind, k),
            InLanes::Short(group) => group.matrix(self.kind, k),
            InLanes::Long(group) => group.matrix(self.kind, k),
        }
    }

    /// Writes those of all states one after the other, each by rows: nv² numbers a state.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, robots};
    /// let arm = robots::arm7();
    /// let (mut batch, q) = (Batch::new(&arm, 10, 1), vec![0.3; 70]);
    /// let mut rows = vec![0.0; 10 * 7 * 7];
    /// let M = batch.crba(&arm, &q);
    /// M.write_rows(&mut rows);
    /// assert_eq!(rows[9 * 49 + 7 + 2], M.at(9)[(1, 2)]);
    /// ```
    ///
    /// # Panics
    /// If `to` has not as many numbers.
    pub fn write_rows(&self, to: &mut [T]) {
        let n = if self.states == 0 { 0 } else { self.at(0).nrows() };
        check("to", to.len(), self.states * n * n);
        match self.of {
            InLanes::Single(group) => group.write_rows(self.kind, to),
            InLanes::Short(group) => group.write_rows(self.kind, to),
            InLanes::Long(group) => group.write_rows(self.kind, to),
        }
    }

    /// The matrices of all states.
    pub fn iter(&self) -> impl Iterator<Item = StateMatrix<'b, T>> {
        let this = *self;
        (0..self.states).map(move |k| this.at(k))
    }
}

/// The derivatives of τ = rnea(q, v, a) in many states: see [`RneaDerivatives`](crate::RneaDerivatives).
#[derive(Clone, Copy, Debug)]
pub struct BatchRneaDerivatives<'b, T: Real> {
    /// ∂τ/∂q in the tangent space.
    pub dtau_dq: Matrices<'b, T>,
    /// ∂τ/∂v.
    pub dtau_dv: Matrices<'b, T>,
    /// ∂τ/∂a = M(q), armature included.
    pub dtau_da: Matrices<'b, T>,
}

/// q̈ = aba(q, v, τ) and its derivatives in many states: see [`AbaDerivatives`](crate::AbaDerivatives).
#[derive(Clone, Copy, Debug)]
pub struct BatchAbaDerivatives<'b, T: Real> {
    /// q̈ itself, nv numbers for each state.
    pub a: &'b [T],
    /// ∂q̈/∂q in the tangent space.
    pub da_dq: Matrices<'b, T>,
    /// ∂q̈/∂v.
    pub da_dv: Matrices<'b, T>,
    /// ∂q̈/∂τ = M(q)⁻¹.
    pub da_dtau: Matrices<'b, T>,
}
