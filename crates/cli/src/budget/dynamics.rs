//! Times of the algorithms per knot: in single calls, in SIMD lanes, and on several threads.

use super::clock::{Effort, Times, measure};
use crate::states::States;
use condyle::{Batch, Data, Model, aba, aba_derivatives, crba, minv, rnea, rnea_derivatives};
use rayon::ThreadPool;
use serde::Serialize;
use std::hint::black_box;

/// Times of an algorithm for all knots of a horizon, measured in three variants.
#[derive(Serialize)]
pub(crate) struct Row {
    pub name: &'static str,
    pub knots: usize,
    /// Times with one call per knot.
    pub single: Times,
    /// Times of a batch on one thread. A batch computes several knots at once in SIMD lanes.
    pub lanes: Times,
    /// Times of a batch on all threads; `None` if there is only one thread.
    pub threads: Option<Times>,
}

/// Algorithm or algorithms to be measured.
#[derive(Clone, Copy)]
enum Work {
    Rnea,
    Aba,
    Crba,
    Minv,
    RneaDerivatives,
    AbaDerivatives,
    /// ABA, the derivatives of ABA, and RNEA, one after the other.
    Horizon,
}

impl Work {
    const ALGORITHMS: [Self; 6] =
        [Self::Rnea, Self::Aba, Self::Crba, Self::Minv, Self::RneaDerivatives, Self::AbaDerivatives];

    fn name(self) -> &'static str {
        match self {
            Self::Rnea => "rnea",
            Self::Aba => "aba",
            Self::Crba => "crba",
            Self::Minv => "minv",
            Self::RneaDerivatives => "rnea_derivatives",
            Self::AbaDerivatives => "aba_derivatives",
            Self::Horizon => "aba, aba_derivatives, rnea",
        }
    }

    /// Computes one state in a single call.
    fn single(self, model: &Model, data: &mut Data<f64>, [q, v, a, tau]: [&[f64]; 4]) {
        match self {
            Self::Rnea => {
                black_box(rnea(model, data, q, v, a, &[]));
            }
            Self::Aba => {
                black_box(aba(model, data, q, v, tau, &[]));
            }
            Self::Crba => {
                black_box(crba(model, data, q));
            }
            Self::Minv => {
                black_box(minv(model, data, q));
            }
            Self::RneaDerivatives => {
                black_box(rnea_derivatives(model, data, q, v, a, &[]));
            }
            Self::AbaDerivatives => {
                black_box(aba_derivatives(model, data, q, v, tau, &[]));
            }
            Self::Horizon => {
                for part in [Self::Aba, Self::AbaDerivatives, Self::Rnea] {
                    part.single(model, data, [q, v, a, tau]);
                }
            }
        }
    }

    /// Computes all states as a batch.
    fn batch(self, model: &Model, batch: &mut Batch, [q, v, a, tau]: [&[f64]; 4]) {
        match self {
            Self::Rnea => {
                black_box(batch.rnea(model, q, v, a, &[]));
            }
            Self::Aba => {
                black_box(batch.aba(model, q, v, tau, &[]));
            }
            Self::Crba => {
                black_box(batch.crba(model, q));
            }
            Self::Minv => {
                black_box(batch.minv(model, q));
            }
            Self::RneaDerivatives => {
                black_box(batch.rnea_derivatives(model, q, v, a, &[]));
            }
            Self::AbaDerivatives => {
                black_box(batch.aba_derivatives(model, q, v, tau, &[]));
            }
            Self::Horizon => {
                for part in [Self::Aba, Self::AbaDerivatives, Self::Rnea] {
                    part.batch(model, batch, [q, v, a, tau]);
                }
            }
        }
    }
}

/// Robot with random states, and memory for the computations.
pub(crate) struct Bench<'a> {
    model: &'a Model,
    states: States,
    data: Data<f64>,
    lanes: Batch,
    threads: Option<(Batch, &'a ThreadPool)>,
    effort: Effort,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(model: &'a Model, most_knots: usize, pool: &'a ThreadPool, effort: Effort) -> Self {
        let cores = pool.current_num_threads();
        Self {
            model,
            states: States::new(model, most_knots, 0),
            data: Data::new(model),
            lanes: Batch::new(model, most_knots, 1),
            threads: (cores > 1).then(|| (Batch::new(model, most_knots, cores), pool)),
            effort,
        }
    }

    /// Measures ABA, the derivatives of ABA, and RNEA together, at each knot.
    pub(crate) fn horizon(&mut self, knots: usize) -> Row {
        self.row(Work::Horizon, knots)
    }

    /// Measures each algorithm alone.
    pub(crate) fn algorithms(&mut self, knots: usize) -> Vec<Row> {
        Work::ALGORITHMS.into_iter().map(|work| self.row(work, knots)).collect()
    }

    fn row(&mut self, work: Work, knots: usize) -> Row {
        let Self { model, states, data, lanes, threads, effort } = self;
        let (nq, nv) = (knots * model.nq(), knots * model.nv());
        let all = [&states.q[..nq], &states.v[..nv], &states.a[..nv], &states.tau[..nv]];
        let single = measure(*effort, || {
            for k in 0..knots {
                work.single(model, data, states.at(model, k));
            }
        });
        Row {
            name: work.name(),
            knots,
            single,
            lanes: measure(*effort, || work.batch(model, lanes, all)),
            threads: threads
                .as_mut()
                .map(|(batch, pool)| pool.install(|| measure(*effort, || work.batch(model, batch, all)))),
        }
    }
}
