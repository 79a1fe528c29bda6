//! Passes of a batch: groups of states, a lane for each, spread over threads.

use super::StateMatrix;
use crate::calls::derivatives::{aba_derivatives, rnea_derivatives};
use crate::calls::forward_dynamics::aba;
use crate::calls::inertia::{crba, minv};
use crate::calls::inverse_dynamics::{gravity, nonlinear_effects, rnea};
use crate::data::Data;
use crate::workspace::{filled, zero_matrix};
use alloc::vec::Vec;
use condyle_linalg::threads;
use condyle_model::Model;
use condyle_spatial::Force;
use condyle_spatial::block::{Block, MOST, Real, Strided, flat, flat_mut, gather, lanes, scatter, scatter_matrix};
use core::mem::swap;
use nalgebra::{DMatrix, DMatrixView};

#[derive(Debug)]
pub(super) struct Group<S: Block> {
    /// The workers, one for each thread.
    workers: Vec<Worker<S>>,
    /// The most groups of as many states as there are lanes.
    groups: usize,
    /// The matrices of each group, of those kinds that passes have been asked for; none before. Written by: `keep`.
    matrices: Vec<[DMatrix<S>; KINDS]>,
}

/// The matrices of a group of states, each nv × nv and each written by one pass alone, so that zeros stay zero.
pub(super) const M: usize = 0;

pub(super) const MINV: usize = 1;

pub(super) const DTAU: [usize; 3] = [2, 3, 4];

pub(super) const DA: [usize; 2] = [5, 6];

/// The kinds that are symmetric: the two numbers of a pair differ by rounding at most, and either may stand for both.
const SYMMETRIC: [usize; 3] = [M, MINV, DTAU[2]];

const KINDS: usize = 7;

/// The scratch of a thread.
#[derive(Debug)]
pub(super) struct Worker<S: Block> {
    data: Data<S>,
    /// The arguments, a state in each lane. Shape: nq, nv, nv, bodies or none. Written by: `one_by_one`.
    q: Vec<S>,
    v: Vec<S>,
    x: Vec<S>,
    f_ext: Vec<Force<S>>,
}

impl<S: Block> Worker<S> {
    fn new(model: &Model) -> Self {
        Self {
            data: Data::new(model),
            q: filled(S::zero, model.nq()),
            v: filled(S::zero, model.nv()),
            x: filled(S::zero, model.nv()),
            f_ext: Vec::with_capacity(model.nodes().len()),
        }
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

    /// Makes the matrices of a pass, for as many states as there is room for, if it is run for the first time.
    fn keep(&mut self, kinds: &[usize], nv: usize) {
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
}

/// The arguments of some states; empty where a function takes none.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a, T> {
    pub q: &'a [T],
    pub v: &'a [T],
    pub x: &'a [T],
    pub f_ext: &'a [Force<T>],
}

/// The places for the results of some states.
struct Results<'a, S: Block> {
    /// Both are empty where a function has none.
    vectors: &'a mut [S::Number],
    matrices: &'a mut [[DMatrix<S>; KINDS]],
}

/// The work on a group of states: with the arguments of a worker, to where its vectors and matrices go.
pub(super) trait Pass<T: Real>: Copy + Sync {
    /// The kinds of matrices that it gives.
    const KINDS: &'static [usize];

    fn run<S: Block<Number = T>>(
        self,
        model: &Model,
        worker: &mut Worker<S>,
        states: usize,
        vectors: &mut [T],
        matrices: Option<&mut [DMatrix<S>; KINDS]>,
    );
}

impl<'a, T> Arguments<'a, T> {
    /// The arguments of the first `n` of `states` states, and of the others.
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
    /// The places of the first `n` of `states` states, and of the others.
    fn split(self, n: usize, states: usize) -> (Self, Self) {
        let vectors = self.vectors.split_at_mut(self.vectors.len() / states * n);
        let matrices = self.matrices.split_at_mut(n.div_ceil(S::LANES).min(self.matrices.len()));
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
    threads::join(
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
        pass.run(model, w, n, place.vectors, place.matrices.first_mut());
        (states, from, to) = (states - n, others, places);
    }
}

/// Passes that give a vector.
macro_rules! vectors {
    ($($pass:ident: $function:ident($($argument:ident),*);)*) => {$(
        #[derive(Clone, Copy)]
        pub(super) struct $pass;
        impl<T: Real> Pass<T> for $pass {
            const KINDS: &'static [usize] = &[];

            fn run<S: Block<Number = T>>(
                self, model: &Model, w: &mut Worker<S>, n: usize, to: &mut [T], _: Option<&mut [DMatrix<S>; KINDS]>,
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
        pub(super) struct $pass;
        impl<T: Real> Pass<T> for $pass {
            const KINDS: &'static [usize] = &[$($kind),*];

            fn run<S: Block<Number = T>>(
                self,
                model: &Model,
                w: &mut Worker<S>,
                n: usize,
                to: &mut [T],
                matrices: Option<&mut [DMatrix<S>; KINDS]>,
            ) {
                let matrices = matrices.expect("a pass that gives matrices has them");
                $(swap(&mut w.data.$($place).*, &mut matrices[$kind]);)*
                $function(model, &mut w.data $(, &w.$argument)*);
                if !to.is_empty() {
                    scatter(&w.data.aba_derivatives.a, n, to);
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

impl<S: Block> Group<S> {
    /// Panics unless this was made for a model of the same tree.
    pub(super) fn check(&self, model: &Model) {
        self.workers[0].data.check(model);
    }

    pub(super) fn run<T: Real, P: Pass<T>>(
        &mut self,
        pass: P,
        model: &Model,
        states: usize,
        from: Arguments<'_, T>,
        vectors: &mut [T],
    ) where
        S: Block<Number = T>,
    {
        self.keep(P::KINDS, model.nv());
        let matrices = if P::KINDS.is_empty() { &mut [] } else { &mut self.matrices[..] };
        let to = Results { vectors, matrices };
        spread(pass, model, &mut self.workers, states, from, to);
    }

    /// A matrix of state k, in its lane.
    pub(super) fn matrix(&self, kind: usize, k: usize) -> StateMatrix<'_, S::Number> {
        let matrix = &self.matrices[k / S::LANES][kind];
        let n = matrix.nrows();
        let lane = lanes(matrix.as_slice()).get(k % S::LANES..).unwrap_or_default();
        DMatrixView::from_slice_with_strides(lane, n, n, S::LANES, S::LANES * n)
    }

    /// The matrices of the first states, as many as there is room for, each by rows.
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
                true => ([n * n, 1], [1, n * n]), // its columns are its rows
                false => ([1, n], [n, n]),
            };
            scatter_matrix(&Strided { vectors, strides, shape, negative: false }, &mut each[..states], n);
        }
    }
}
