//! Search directions of several problems of one shape, swept in the lanes of SIMD registers.
#![allow(non_snake_case)] // names follow the literature: K, k

use super::iterate::Iterate;
use super::solution::Solution;
use super::solver_loop::{Progress, SolverLoop};
use crate::lq::{LaneResult, LaneSweep, LqKnot, MOST_LANES, lane_sweep};
use crate::problem::Problem;
use crate::time::Instant;
use core::ops::Range;
use std::time::Duration;

/// Derivatives and sweeps of several problems. The knots are processed in groups of as many knots as there are lanes,
/// from the end of the horizon to its beginning: first the derivatives of a group, problem by problem, with a knot in
/// each lane; then the sweep, with a problem in each lane. The storage of a group stays in the caches.
#[derive(Debug)]
pub(super) struct Directions {
    sweep: Box<dyn LaneSweep>,
    /// LQ knots of a group of each problem; the next field is the terminal knot of each problem.
    knots: Vec<Vec<LqKnot>>,
    terminals: Vec<LqKnot>,
}

/// Problem whose search direction is computed, with its solver.
pub(super) struct Member<'a> {
    pub(super) problem: &'a mut Problem,
    pub(super) solver: &'a mut SolverLoop,
    pub(super) now: &'a mut Progress,
}

impl Directions {
    /// Allocates storage for as many problems as `problem` has lanes. `knots` are the LQ knots of such a problem.
    /// Returns `None` if the directions of these problems are computed one by one.
    pub(super) fn new(problem: &Problem, knots: &[LqKnot]) -> Option<Self> {
        let (width, sweep) = (problem.lanes().min(MOST_LANES), lane_sweep(knots)?);
        let (terminal, running) = knots.split_last()?;
        let group: Vec<LqKnot> = (0..width).map(|_| running[0].clone()).collect();
        Some(Self { sweep, knots: vec![group; width], terminals: vec![terminal.clone(); width] })
    }

    /// Computes the derivatives and the sweeps of the problems. Writes the gains to the solutions, and the products Vxx
    /// f to the line searches. Returns the terms dg and dq of the expected decrease of each problem, without the terms
    /// of gaps if `counts_gaps` is false; `None` if the sweep failed.
    pub(super) fn run(
        &mut self,
        members: &mut [Member<'_>],
        counts_gaps: impl Fn(bool) -> bool,
    ) -> [Option<[f64; 2]>; MOST_LANES] {
        let Self { sweep, knots, terminals } = self;
        let (count, start, mut sweeping) = (members.len(), Instant::now(), Duration::ZERO);
        let (horizon, width) = (members[0].problem.horizon(), knots.len());
        for (member, knot) in members.iter_mut().zip(&mut *terminals) {
            member.derive(horizon..horizon + 1, core::slice::from_mut(knot));
        }
        let regularisation = lanes(members, |member| member.now.merit.regularisation);
        let ends: [&LqKnot; MOST_LANES] = core::array::from_fn(|lane| &terminals[lane.min(count - 1)]);
        sweep.begin(&ends[..count], &regularisation[..count]);

        let mut end = horizon;
        while end > 0 {
            let first = (end - 1) / width * width;
            for (member, knots) in members.iter_mut().zip(&mut *knots) {
                member.derive(first..end, &mut knots[..end - first]);
            }
            let clock = Instant::now();
            for t in (first..end).rev() {
                let each: [&LqKnot; MOST_LANES] = core::array::from_fn(|lane| &knots[lane.min(count - 1)][t - first]);
                let mut results: [LaneResult<'_>; MOST_LANES] = Default::default();
                for (result, member) in results.iter_mut().zip(&mut *members) {
                    *result = member.result(t);
                }
                sweep.step(&each[..count], &mut results[..count]);
            }
            sweeping += clock.elapsed();
            end = first;
        }

        let clock = Instant::now();
        let zeros = vec![0.0; members[0].problem.ndx()];
        let feasible = lanes(members, |member| member.now.merit.feasible);
        let mut curved: [&mut [f64]; MOST_LANES] = Default::default();
        let mut gaps = [&zeros[..]; MOST_LANES];
        for (((curved, gap), member), feasible) in curved.iter_mut().zip(&mut gaps).zip(&mut *members).zip(feasible) {
            let SolverLoop { iterate, line_search, .. } = &mut *member.solver;
            if !feasible {
                *gap = &iterate.gaps[..zeros.len()];
            }
            *curved = &mut line_search.curved_gaps_mut()[..zeros.len()];
        }
        let sums = sweep.end(&gaps[..count], &mut curved[..count]);
        sweeping += clock.elapsed();
        let deriving = (start.elapsed() - sweeping) / count as u32;
        for member in &mut *members {
            let timings = &mut member.solver.iterate.solution.timings;
            timings.calc_diff += deriving;
            timings.sweep += sweeping / count as u32;
            member.now.stores_gains();
        }
        core::array::from_fn(|lane| {
            let [square, slope, curvature] = sums[lane]?;
            Some(match counts_gaps(feasible[lane]) {
                true => [square - slope - curvature, curvature - square],
                false => [square, -square],
            })
        })
    }
}

impl Member<'_> {
    /// Computes the derivatives at a range of knots.
    fn derive(&mut self, range: Range<usize>, knots: &mut [LqKnot]) {
        self.solver.calc_diff_part(self.problem, self.now, range, knots);
    }

    /// Returns the storage of the results of the step at knot t.
    fn result(&mut self, t: usize) -> LaneResult<'_> {
        let range = self.problem.shape().dx(t + 1);
        let SolverLoop { iterate: Iterate { solution: Solution { K, k, .. }, .. }, line_search, .. } =
            &mut *self.solver;
        let curved_gap = &mut line_search.curved_gaps_mut()[range];
        LaneResult { k: k[t].as_mut_slice(), K: K[t].as_mut_slice(), curved_gap }
    }
}

/// Returns a value of each problem.
fn lanes<T: Copy + Default>(members: &[Member<'_>], of: impl Fn(&Member<'_>) -> T) -> [T; MOST_LANES] {
    core::array::from_fn(|lane| members.get(lane).map(&of).unwrap_or_default())
}
