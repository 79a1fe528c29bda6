//! Many states at once: the knots of a horizon, the samples of a controller.
//!
//! As many states as a vector register holds go through a pass side by side, each in a lane: by the processor's level that
//! is eight or four in `f64`, sixteen or eight in `f32`, one at the baseline. Groups of them are spread over threads.
//! Arguments and vectors lie state after state; matrices stay as the passes leave them, entry after entry, each for a
//! whole group. A lane knows nothing of the others, and computes as a single call
//! does at that level, so a state's numbers are the same to the last bit wherever it stands, in however long a batch, on
//! however many threads.

use crate::aba::aba;
use crate::aba_derivatives::aba_derivatives;
use crate::crba::crba;
use crate::data::{Data, check};
use crate::minv::minv;
use crate::model::Model;
use crate::rnea::{gravity, nonlinear_effects, rnea};
use crate::rnea_derivatives::rnea_derivatives;
use condyle_spatial::Force;
use condyle_spatial::block::{Block, Real, flat, flat_mut, gather, lanes, scatter};
use condyle_spatial::level::{Level, level};
use core::mem::swap;
use nalgebra::{DMatrix, DMatrixView, Dyn, MatrixView};

/// Scratch and results for up to N states at once, on one or several threads.
///
/// Every function takes its arguments as the one of the same name for a single state does, with those of all states one
/// after the other: q has `states` · nq numbers, and how many states that is may change from call to call. Results stay
/// until the next call. `T` is `f64` or `f32`.
///
/// All memory is allocated by [`new`](Self::new), but for what rayon allocates by itself on more than one thread. The
/// level of vector instructions is the one in use when the batch is made. Made for one thread, it never leaves the
/// caller's; else it runs in the pool of rayon in which it is called.
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
    /// Shape: states × nv. Written by: all that return vectors.
    vectors: Vec<T>,
}

/// Of the vectors that the level has.
#[derive(Clone, Debug)]
enum InLanes<T: Real> {
    Single(Group<T>),
    Short(Group<T::Short>),
    Long(Group<T::Long>),
}

#[derive(Clone, Debug)]
struct Group<S: Block> {
    /// One for each thread.
    workers: Vec<Worker<S>>,
    /// One for as many states as there are lanes.
    matrices: Vec<[DMatrix<S>; KINDS]>,
}

/// The matrices of a group of states, each nv × nv and each written by one pass alone, so that zeros stay zero.
const M: usize = 0;
const MINV: usize = 1;
const DTAU: [usize; 3] = [2, 3, 4];
const DA: [usize; 2] = [5, 6];
const KINDS: usize = 7;

/// One thread's scratch.
#[derive(Clone, Debug)]
struct Worker<S: Block> {
    data: Data<S>,
    /// The arguments, a state in each lane. Shape: nq, nv, nv, bodies or none. Written by: `group`.
    q: Vec<S>,
    v: Vec<S>,
    x: Vec<S>,
    f_ext: Vec<Force<S>>,
}

impl<S: Block> Worker<S> {
    fn new(model: &Model) -> Self {
        Self {
            data: Data::new(model),
            q: vec![S::zero(); model.nq],
            v: vec![S::zero(); model.nv],
            x: vec![S::zero(); model.nv],
            f_ext: Vec::with_capacity(model.nodes.len()),
        }
    }
}

impl<S: Block> Group<S> {
    fn new(model: &Model, states: usize, threads: usize) -> Self {
        let square = || DMatrix::from_element(model.nv, model.nv, S::zero());
        let matrices = |_| core::array::from_fn(|_| square());
        Self {
            workers: vec![Worker::new(model); threads],
            matrices: (0..states.div_ceil(S::LANES)).map(matrices).collect(),
        }
    }
}

/// The arguments of some states; empty where a function takes none.
#[derive(Clone, Copy)]
struct Arguments<'a, T> {
    q: &'a [T],
    v: &'a [T],
    x: &'a [T],
    f_ext: &'a [Force<T>],
}

/// Where the results of some states go.
struct Results<'a, S: Block> {
    /// Empty where a function has none.
    vectors: &'a mut [S::Number],
    matrices: &'a mut [[DMatrix<S>; KINDS]],
}

/// What is done with a group of states: with the arguments of a worker, to where its vectors and matrices go.
trait Pass<T: Real>: Copy + Sync {
    fn run<S: Block<Number = T>>(
        self,
        model: &Model,
        worker: &mut Worker<S>,
        states: usize,
        vectors: &mut [T],
        matrices: &mut [DMatrix<S>; KINDS],
    );
}

impl<'a, T> Arguments<'a, T> {
    /// Those of the first `n` of `states` states, and of the others.
    fn split(self, n: usize, states: usize) -> (Self, Self) {
        let Self { q, v, x, f_ext } = self;
        let (q, v, x, f_ext) = (part(q, n, states), part(v, n, states), part(x, n, states), part(f_ext, n, states));
        (Self { q: q.0, v: v.0, x: x.0, f_ext: f_ext.0 }, Self { q: q.1, v: v.1, x: x.1, f_ext: f_ext.1 })
    }
}

fn part<T>(of: &[T], n: usize, states: usize) -> (&[T], &[T]) {
    of.split_at(of.len() / states * n)
}

impl<S: Block> Results<'_, S> {
    /// As for the arguments.
    fn split(self, n: usize, states: usize) -> (Self, Self) {
        let vectors = self.vectors.split_at_mut(self.vectors.len() / states * n);
        let matrices = self.matrices.split_at_mut(n.div_ceil(S::LANES));
        (Self { vectors: vectors.0, matrices: matrices.0 }, Self { vectors: vectors.1, matrices: matrices.1 })
    }
}

/// All states, by all threads.
fn spread<T: Real, S: Block<Number = T>>(
    pass: impl Pass<T>,
    model: &Model,
    workers: &mut [Worker<S>],
    states: usize,
    from: Arguments<'_, T>,
    to: Results<'_, S>,
) {
    let groups = states.div_ceil(S::LANES);
    if workers.len() == 1 || groups < 2 {
        return one_by_one(pass, model, &mut workers[0], states, from, to);
    }
    let (some, others) = workers.split_at_mut(workers.len() / 2);
    let n = (groups * some.len() / (some.len() + others.len())).max(1) * S::LANES;
    let (first, second) = (from.split(n, states), to.split(n, states));
    rayon::join(
        || spread(pass, model, some, n, first.0, second.0),
        || spread(pass, model, others, states - n, first.1, second.1),
    );
}

/// All groups, by one thread.
fn one_by_one<T: Real, S: Block<Number = T>>(
    pass: impl Pass<T>,
    model: &Model,
    w: &mut Worker<S>,
    mut states: usize,
    mut from: Arguments<'_, T>,
    mut to: Results<'_, S>,
) {
    while states > 0 {
        let n = states.min(S::LANES);
        let (here, others) = from.split(n, states);
        let (place, places) = to.split(n, states);
        for (given, to) in [(here.q, &mut w.q), (here.v, &mut w.v), (here.x, &mut w.x)] {
            if !given.is_empty() {
                gather(given, n, to);
            }
        }
        w.f_ext.resize(here.f_ext.len() / n, Force::zero());
        gather(flat(here.f_ext), n, flat_mut(&mut w.f_ext));
        pass.run(model, w, n, place.vectors, &mut place.matrices[0]);
        (states, from, to) = (states - n, others, places);
    }
}

/// Passes that give a vector.
macro_rules! vectors {
    ($($pass:ident: $function:ident($($argument:ident),*);)*) => {$(
        #[derive(Clone, Copy)]
        struct $pass;
        impl<T: Real> Pass<T> for $pass {
            fn run<S: Block<Number = T>>(
                self, model: &Model, w: &mut Worker<S>, n: usize, to: &mut [T], _: &mut [DMatrix<S>; KINDS],
            ) {
                scatter($function(model, &mut w.data $(, &w.$argument)*), n, to);
            }
        }
    )*};
}
vectors! {
    Rnea: rnea(q, v, x, f_ext);
    NonlinearEffects: nonlinear_effects(q, v);
    Gravity: gravity(q);
    Aba: aba(q, v, x, f_ext);
}

/// Passes that give matrices. A pass writes to those of the worker's `Data`, so for its time these are exchanged.
macro_rules! matrices {
    ($($pass:ident: $function:expr, ($($argument:ident),*), $($($place:ident).*: $kind:expr),*;)*) => {$(
        #[derive(Clone, Copy)]
        struct $pass;
        impl<T: Real> Pass<T> for $pass {
            fn run<S: Block<Number = T>>(
                self, model: &Model, w: &mut Worker<S>, n: usize, to: &mut [T], matrices: &mut [DMatrix<S>; KINDS],
            ) {
                $(swap(&mut w.data.$($place).*, &mut matrices[$kind]);)*
                $function(model, &mut w.data $(, &w.$argument)*);
                if !to.is_empty() {
                    scatter(w.data.aba_derivatives.a(), n, to);
                }
                $(swap(&mut w.data.$($place).*, &mut matrices[$kind]);)*
            }
        }
    )*};
}
matrices! {
    Crba: crba, (q), crba.M: M;
    Minv: minv, (q), minv.Minv: MINV;
    RneaDerivatives: rnea_derivatives, (q, v, x, f_ext),
        rnea_derivatives.dtau_dq: DTAU[0], rnea_derivatives.dtau_dv: DTAU[1], rnea_derivatives.dtau_da: DTAU[2];
    AbaDerivatives: aba_derivatives, (q, v, x, f_ext),
        aba_derivatives.da_dq: DA[0], aba_derivatives.da_dv: DA[1], minv.Minv: MINV;
}

impl<T: Real> Batch<T> {
    /// Room for up to `states` states at once, on `threads` threads.
    ///
    /// # Panics
    /// If `threads` is 0.
    pub fn new(model: &Model, states: usize, threads: usize) -> Self {
        assert!(threads > 0, "threads: expected at least 1, found 0");
        Self {
            states,
            lanes: match level() {
                Level::Baseline => InLanes::Single(Group::new(model, states, threads)),
                Level::Avx2 => InLanes::Short(Group::new(model, states, threads)),
                Level::Avx512 => InLanes::Long(Group::new(model, states, threads)),
            },
            vectors: vec![T::zero(); states * model.nv],
        }
    }

    /// How many states it has room for.
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
        let states = from.q.len() / model.nq.max(1);
        assert!(
            states * model.nq == from.q.len() && states <= self.states,
            "q: expected {} numbers for each of at most {} states, found {}",
            model.nq,
            self.states,
            from.q.len()
        );
        for (name, found) in names.into_iter().zip([from.v.len(), from.x.len()]).filter(|(name, _)| !name.is_empty()) {
            check(name, found, states * model.nv);
        }
        let (found, forces) = (from.f_ext.len(), states * model.nodes.len());
        assert!(
            found == 0 || found == forces,
            "f_ext: expected no force or {forces} (one for each body of each state), found {found}"
        );
        let vectors = &mut self.vectors[..if has_vectors { states * model.nv } else { 0 }];
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
        &self.vectors[..states * model.nv]
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

impl<S: Block> Group<S> {
    fn run<T: Real>(
        &mut self,
        pass: impl Pass<T>,
        model: &Model,
        states: usize,
        from: Arguments<'_, T>,
        vectors: &mut [T],
    ) where
        S: Block<Number = T>,
    {
        let to = Results { vectors, matrices: &mut self.matrices };
        spread(pass, model, &mut self.workers, states, from, to);
    }

    /// A matrix of state k, in its lane.
    fn matrix(&self, kind: usize, k: usize) -> StateMatrix<'_, S::Number> {
        let matrix = &self.matrices[k / S::LANES][kind];
        let n = matrix.nrows();
        let lane = lanes(matrix.as_slice()).get(k % S::LANES..).unwrap_or_default();
        DMatrixView::from_slice_with_strides(lane, n, n, S::LANES, S::LANES * n)
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
    /// That of state k: a view, which [`copy_from`](nalgebra::Matrix::copy_from) copies to a matrix of one's own.
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

    /// Those of all states.
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
