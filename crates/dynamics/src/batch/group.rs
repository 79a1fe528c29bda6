//! Distribution of a batch over threads. Threads compute groups of states, with one state per SIMD lane.

use super::places::Places;
use super::state_matrix::StateMatrix;
use crate::constraints::constraint_set::ConstraintSet;
use crate::data::Data;
use crate::workspace::{filled, zero_matrix};
use alloc::vec::Vec;
use condyle_linalg::threads;
use condyle_model::Model;
use condyle_spatial::block::{Block, MOST, Real, Strided, flat_mut, gather, lanes, scatter_matrix};
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Array, Force, Matrix};

/// Groups of states and the workers that compute the groups. A group has one state per lane of the scalar `S`.
#[derive(Clone, Debug)]
pub(super) struct Group<S: Block> {
    /// Workers, one per thread.
    workers: Vec<Worker<S>>,
    /// Maximum number of groups.
    groups: usize,
    /// Matrices of each group, one per matrix kind (`M`, `MINV`, …). A matrix is empty until a pass requests its kind.
    /// Written by: `keep`.
    matrices: Vec<[Matrix<S>; KINDS]>,
}

/// Indices of the matrix kinds that a group of states keeps in lanes. Each matrix is nv × nv. Only one pass writes each
/// kind, so entries that are zero for every state stay zero.
pub(super) const M: usize = 0;

pub(super) const MINV: usize = 1;

pub(super) const DTAU: [usize; 3] = [2, 3, 4];

pub(super) const DA: [usize; 2] = [5, 6];

/// Kinds of the symmetric matrices. Entries (i, j) and (j, i) differ at most by rounding, so one of the two may replace
/// the other.
pub(super) const SYMMETRIC: [usize; 3] = [M, MINV, DTAU[2]];

pub(super) const KINDS: usize = 7;

/// Number of arguments of a pass for one state. The argument slots are, in order: q; v; an acceleration or an effort;
/// the factor λ of a contraction; external forces.
pub(super) const ARGUMENTS: usize = 5;

pub(super) const FORCES: usize = ARGUMENTS - 1;

/// Scratch of one thread.
#[derive(Debug)]
struct Worker<S: Block> {
    data: Data<S>,
    /// Arguments except external forces, one state per lane. Shape: nq, nv, nv, nv. Written by: `run_serially`.
    numbers: [Array<S>; FORCES],
    /// External forces, one state per lane. Shape: number of bodies, or empty without forces. Written by:
    /// `run_serially`.
    f_ext: Vec<Force<S>>,
    /// Two scratch matrices for passes. Shape: 6 × nv each.
    six: [Matrix<S>; 2],
    /// Scratch vector for passes. Shape: nv × max(nv, 10).
    wide: Array<S>,
}

impl<S: Block> Worker<S> {
    fn new(model: &Model) -> Self {
        let (nq, nv) = (model.nq(), model.nv());
        Self {
            data: Data::new(model),
            numbers: [nq, nv, nv, nv].map(|n| filled(S::zero, n)),
            f_ext: Vec::with_capacity(model.nodes().len()),
            six: [zero_matrix(6, nv), zero_matrix(6, nv)],
            wide: filled(S::zero, nv * nv.max(10)),
        }
    }
}

impl<S: Block> Clone for Worker<S> {
    /// Returns a copy with the same capacity for forces, so that later calls on the copy do not allocate.
    fn clone(&self) -> Self {
        let Self { data, numbers, f_ext, six, wide } = self;
        let mut forces = Vec::with_capacity(f_ext.capacity());
        forces.extend_from_slice(f_ext);
        Self { data: data.clone(), numbers: numbers.clone(), f_ext: forces, six: six.clone(), wide: wide.clone() }
    }
}

/// Arguments and scratch that a pass receives for one group of states.
pub(super) struct States<'w, S: Block> {
    pub model: &'w Model,
    pub data: &'w mut Data<S>,
    pub q: &'w [S],
    pub v: &'w [S],
    pub a: &'w [S],
    /// Efforts τ. This is the same slice as `a`, because a pass takes either accelerations or efforts.
    pub tau: &'w [S],
    pub lambda: &'w [S],
    pub f_ext: &'w [Force<S>],
    pub constraints: Option<&'w mut ConstraintSet<S>>,
    /// Two scratch matrices. Shape: 6 × nv each.
    pub six: &'w mut [Matrix<S>; 2],
    /// Scratch vector. Shape: nv × max(nv, 10).
    pub wide: &'w mut [S],
    /// Matrices that stay in lanes; `None` if the pass has no such matrices.
    pub kept: Option<&'w mut [Matrix<S>; KINDS]>,
}

/// Computation on a group of states. A pass calls a function of this crate and writes the results to destinations.
pub(super) trait Pass<T: Real>: Copy + Sync {
    /// Kinds of the matrices that the pass keeps in lanes.
    const KINDS: &'static [usize];

    /// Runs the pass. Implementations must be inlined into the code of the SIMD level.
    fn run<S: Block<Number = T>>(self, states: States<'_, S>, to: &mut Places<'_, T>);
}

struct Entered<'a, 'b, 'c, T, S: Block<Number = T>, P>(P, States<'a, S>, &'b mut Places<'c, T>);

impl<T: Real, S: Block<Number = T>, P: Pass<T>> Kernel for Entered<'_, '_, '_, T, S, P> {
    #[inline(always)]
    fn run(self) {
        self.0.run(self.1, self.2);
    }
}

/// Runs a pass with the instructions of the SIMD level to which the lanes belong.
pub(super) fn enter<T: Real, S: Block<Number = T>>(pass: impl Pass<T>, of: States<'_, S>, to: &mut Places<'_, T>) {
    S::enter(Entered(pass, of, to));
}

/// Function that runs a pass on one type of lanes. As the function is called through a pointer, the code that
/// distributes states is compiled once for all passes.
pub(super) type Work<'f, T, S> = dyn Fn(States<'_, S>, &mut Places<'_, T>) + Sync + 'f;

/// Arguments for several states; arguments that a function does not take are empty slices.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a, T>(pub [&'a [T]; ARGUMENTS]);

impl<T> Arguments<'_, T> {
    /// Splits the arguments for `states` states into arguments for the first `n` states and arguments for the others.
    fn split(self, n: usize, states: usize) -> (Self, Self) {
        let parts = self.0.map(|of| of.split_at(of.len() / states * n));
        (Self(parts.map(|part| part.0)), Self(parts.map(|part| part.1)))
    }
}

/// Destinations for the results of several states: vectors and matrices of each state, and matrices that stay in lanes.
struct Results<'a, S: Block> {
    numbers: Places<'a, S::Number>,
    matrices: &'a mut [[Matrix<S>; KINDS]],
}

impl<S: Block> Results<'_, S> {
    /// Splits the destinations for `states` states into destinations for the first `n` states and destinations for the
    /// others.
    fn split(self, n: usize, states: usize) -> (Self, Self) {
        let numbers = self.numbers.split(n, states);
        let matrices = self.matrices.split_at_mut(n.div_ceil(S::LANES).min(self.matrices.len()));
        (Self { numbers: numbers.0, matrices: matrices.0 }, Self { numbers: numbers.1, matrices: matrices.1 })
    }
}

/// Workers that share a computation, and one constraint set per worker if the pass has constraints.
struct Team<'a, S: Block> {
    workers: &'a mut [Worker<S>],
    sets: &'a mut [ConstraintSet<S>],
}

/// Runs `work` on all states, distributed over all threads.
fn spread<T: Real, S: Block<Number = T>>(
    work: &Work<'_, T, S>,
    model: &Model,
    team: Team<'_, S>,
    states: usize,
    from: Arguments<'_, T>,
    to: Results<'_, S>,
) {
    let (groups, count) = (states.div_ceil(S::LANES), team.workers.len());
    if count == 1 || groups < 2 {
        return run_serially(work, model, team, states, from, to);
    }
    let (some, others) = team.workers.split_at_mut(count / 2);
    let sets = team.sets.split_at_mut(some.len().min(team.sets.len()));
    let (some, others) = (Team { workers: some, sets: sets.0 }, Team { workers: others, sets: sets.1 });
    let n = (groups * (count / 2) / count).max(1) * S::LANES;
    let (first, second) = (from.split(n, states), to.split(n, states));
    threads::join(
        || spread(work, model, some, n, first.0, second.0),
        || spread(work, model, others, states - n, first.1, second.1),
    );
}

/// Runs `work` on all groups of states, on one thread.
fn run_serially<T: Real, S: Block<Number = T>>(
    work: &Work<'_, T, S>,
    model: &Model,
    Team { workers, sets }: Team<'_, S>,
    states: usize,
    from: Arguments<'_, T>,
    to: Results<'_, S>,
) {
    let Worker { data, numbers, f_ext, six, wide } = &mut workers[0];
    let Results { numbers: mut places, matrices } = to;
    let (mut constraints, mut matrices) = (sets.first_mut(), matrices.iter_mut());
    let sizes = from.0.map(|of| of.len() / states.max(1));
    f_ext.resize(sizes[FORCES] / 6, Force::zero());
    for first in (0..states).step_by(S::LANES) {
        let n = (states - first).min(S::LANES);
        let of = |k: usize| &from.0[k][first * sizes[k]..][..n * sizes[k]];
        for (k, to) in numbers.iter_mut().enumerate().filter(|&(k, _)| sizes[k] > 0) {
            gather(of(k), n, to);
        }
        if !f_ext.is_empty() {
            gather(of(FORCES), n, flat_mut(f_ext));
        }
        places.go_to(first, n);
        let [q, v, a, lambda] = &*numbers;
        let (kept, constraints) = (matrices.next(), constraints.as_deref_mut());
        work(States { model, data, q, v, a, tau: a, lambda, f_ext, constraints, six, wide, kept }, &mut places);
    }
}

impl<S: Block> Group<S> {
    pub(super) fn new(model: &Model, states: usize, threads: usize) -> Self {
        Self {
            workers: (0..threads).map(|_| Worker::new(model)).collect(),
            groups: states.div_ceil(S::LANES),
            matrices: Vec::new(),
        }
    }

    /// Returns the number of threads.
    pub(super) fn threads(&self) -> usize {
        self.workers.len()
    }

    /// Panics unless this group was made for a model with the same tree.
    #[track_caller]
    pub(super) fn check(&self, model: &Model) {
        self.workers[0].data.check(model);
    }

    /// Allocates the matrices of a pass for the capacity of the batch, when the pass runs for the first time.
    pub(super) fn keep(&mut self, kinds: &[usize], nv: usize) {
        if kinds.is_empty() {
            return;
        }
        self.matrices.resize_with(self.groups, || core::array::from_fn(|_| zero_matrix(0, 0)));
        for matrices in &mut self.matrices {
            for &kind in kinds {
                if matrices[kind].nrows() != nv {
                    matrices[kind] = zero_matrix(nv, nv);
                }
            }
        }
    }

    /// Runs a pass over all states. `has_matrices`: whether the pass keeps matrices in lanes.
    pub(super) fn run<T: Real>(
        &mut self,
        work: &Work<'_, T, S>,
        model: &Model,
        states: usize,
        sets: &mut [ConstraintSet<S>],
        (from, numbers, has_matrices): (Arguments<'_, T>, Places<'_, T>, bool),
    ) where
        S: Block<Number = T>,
    {
        let matrices = if has_matrices { &mut self.matrices[..] } else { &mut [] };
        let team = Team { workers: &mut self.workers, sets };
        spread(work, model, team, states, from, Results { numbers, matrices });
    }

    /// Returns the matrix of state k of the given kind. The matrix is a view of the state's lane.
    pub(super) fn matrix(&self, kind: usize, k: usize) -> StateMatrix<'_, S::Number> {
        let matrix = &self.matrices[k / S::LANES][kind];
        let n = matrix.nrows();
        let lane = lanes(matrix.as_slice()).get(k % S::LANES..).unwrap_or_default();
        StateMatrix::new(lane, [n, n], [S::LANES, S::LANES * n])
    }

    /// Writes matrices by rows, starting with the first state, until `to` is full.
    pub(super) fn write_rows(&self, kind: usize, to: &mut [S::Number]) {
        let n = self.matrices.first().map_or(0, |matrices| matrices[kind].nrows());
        if n == 0 {
            return;
        }
        for (matrices, to) in self.matrices.iter().zip(to.chunks_mut(S::LANES * n * n)) {
            let (vectors, mut each) = (matrices[kind].as_slice(), <[&mut [S::Number]; MOST]>::default());
            let mut states = 0;
            for to in to.chunks_exact_mut(n * n) {
                each[states] = to;
                states += 1;
            }
            let (strides, shape) = match SYMMETRIC.contains(&kind) {
                true => ([n * n, 1], [1, n * n]), // for a symmetric matrix, the columns equal the rows
                false => ([1, n], [n, n]),
            };
            scatter_matrix(&Strided { vectors, strides, shape, negative: false }, &mut each[..states], n);
        }
    }
}
