//! Sweeps of several problems of one shape at the same time, one in each lane.
#![allow(non_snake_case)] // names follow the literature: K, H, P, Q, X

use super::forms::{DRIVEN_MOST, Driven};
use super::knot::LqKnot;
use super::lane_step::{SUMS, StepSize, begin_sweep, end_sweep, step};
use condyle_dynamics::level::{Level, level};
use condyle_spatial::block::{Block, Real, SimdToken, gather_rows, scatter_rows};
use core::fmt::{self, Debug};

/// Token that allows this module to name SIMD vector types.
struct Gate;

// SAFETY: SIMD vectors are used only by kernels, and by the conversions that are called like kernels.
#[allow(unsafe_code)]
unsafe impl SimdToken for Gate {}

/// Maximum number of lanes.
pub(crate) const MOST_LANES: usize = 8;

/// Sweep of several problems. The knots of all problems are given from the last to the first. The result of a problem
/// does not depend on the other problems, to the bit. It differs from the result of a [`Sweep`](super::Sweep) by
/// rounding.
pub(crate) trait LaneSweep: Debug + Send {
    /// Begins a sweep from the terminal knots, with the regularisation of each problem.
    fn begin(&mut self, knots: &[&LqKnot], regularisation: &[f64]);

    /// Makes the step of the next knot of all problems. Writes the gains to `results`.
    fn step(&mut self, knots: &[&LqKnot], results: &mut [LaneResult<'_>]);

    /// Ends a sweep at the gaps before the first knot, and writes P f to `results`. Returns, for each problem, the sums
    /// over all knots of kᵀQuu k, Vxᵀf and fᵀVxx f; `None` if the problem has no result, because a block Quu was not
    /// positive definite, the value function diverged, or a knot has another form.
    fn end(&mut self, gaps: &[&[f64]], results: &mut [&mut [f64]]) -> [Option<[f64; 3]>; MOST_LANES];
}

/// Results of a step of one problem.
#[derive(Debug, Default)]
pub(crate) struct LaneResult<'a> {
    /// Feed-forward k, nu.
    pub(crate) k: &'a mut [f64],
    /// Gains K, nu × ndx, column after column.
    pub(crate) K: &'a mut [f64],
    /// Product Vxx⁺ f of the next knot's Hessian and the gap f, ndx.
    pub(crate) curved_gap: &'a mut [f64],
}

/// Returns the sweep of as many problems as a SIMD register has lanes, for problems with the dimensions of `knots`.
/// Returns `None` if such problems are swept one by one: if a register has fewer than eight lanes, or if the robot is
/// not a small arm in which every coordinate has a motor. With four lanes (AVX2), a sweep of one problem is as fast:
/// reaches of an arm took 4 % longer in lanes.
pub(crate) fn lane_sweep(knots: &[LqKnot]) -> Option<Box<dyn LaneSweep>> {
    let (terminal, running) = knots.split_last()?;
    let n = terminal.ndx();
    let fits = |knot: &LqKnot| 2 * knot.nu() == n && knot.inverse_dynamics.stride > 0; // the stride follows from nu
    if n == 0 || n > 2 * DRIVEN_MOST || running.is_empty() || !running.iter().all(fits) {
        return None;
    }
    let width = running[0].inverse_dynamics.stride;
    (level() == Level::Avx512).then(|| Box::new(Lanes::<<f64 as Real>::Wide<Gate>>::new(n / 2, width)) as _)
}

/// Sweep in the lanes of the scalar `S`, with its workspace.
struct Lanes<S> {
    /// Sizes of a step with as many rows of G as possible.
    size: StepSize,
    /// Numbers of the knot of a step, in the order of [`StepSize::parts`].
    knot: Vec<S>,
    /// Matrix H of the last step, which contains the value function, and matrix H of the step before it.
    H: [Vec<S>; 2],
    /// Gradient Vx of the value function.
    p: Vec<S>,
    /// Results of a step, in the order of [`StepSize::results`].
    results: Vec<S>,
    sums: Vec<S>,
    regularisation: [f64; MOST_LANES],
    /// Whether each problem has a knot of another form.
    unfit: [bool; MOST_LANES],
    /// Zeros, in place of rows of G that a problem does not have.
    zeros: Vec<f64>,
}

/// Formats the sizes, without the workspace.
impl<S> Debug for Lanes<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lanes").field("size", &self.size).finish_non_exhaustive()
    }
}

impl<S: Block<Number = f64>> Lanes<S> {
    /// Allocates the workspace for robots with nv coordinates, and for rows of U and G with the stride `width`.
    fn new(nv: usize, width: usize) -> Self {
        let size = StepSize { nv, costs: Driven::MOST_COSTS, width, gaps: true };
        let vectors = |n: usize| vec![S::zero(); n];
        let H = || vectors(size.stride() * size.all());
        Self {
            size,
            knot: vectors(size.parts().iter().sum()),
            H: [H(), H()],
            p: vectors(2 * nv),
            results: vectors(size.results().iter().sum()),
            sums: vectors(SUMS),
            regularisation: [0.0; MOST_LANES],
            unfit: [false; MOST_LANES],
            zeros: vec![0.0; width],
        }
    }

    /// Packs the knots into the lanes. Returns the sizes of the step.
    fn pack(&mut self, knots: &[&LqKnot]) -> StepSize {
        let Self { size, knot, regularisation, zeros, .. } = self;
        let (count, costs) = (knots.len(), |knot: &LqKnot| knot.inverse_dynamics.slopes.len());
        let costs_of_all = knots.iter().map(|knot| costs(knot)).max().unwrap_or(0);
        let gaps = knots.iter().any(|knot| knot.f.iter().any(|f| *f != 0.0));
        let size = StepSize { costs: costs_of_all, gaps, ..*size };
        let StepSize { nv, width, .. } = size;
        let [times, gradients, diagonals, f, blocks, slopes, rows] = size.parts();
        let mut rest = &mut knot[..];
        let mut part = |length: usize| {
            let (part, others) = core::mem::take(&mut rest).split_at_mut(length);
            rest = others;
            part
        };
        let numbers: [_; MOST_LANES] = core::array::from_fn(|lane| {
            let dt = knots[lane.min(count - 1)].structure.euler().map_or(0.0, |(dt, _)| dt);
            [dt, regularisation[lane.min(count - 1)]]
        });
        gather(count, |lane| &numbers[lane], part(times));
        let (by_x, by_u) = part(gradients).split_at_mut(2 * nv);
        gather(count, |lane| knots[lane].q.as_slice(), by_x);
        gather(count, |lane| knots[lane].r.as_slice(), by_u);
        gather(count, |lane| &knots[lane].inverse_dynamics.diagonal, part(diagonals));
        let f = part(f);
        if gaps {
            gather(count, |lane| knots[lane].f.as_slice(), f);
        }
        gather(count, |lane| knots[lane].Q.as_slice(), part(blocks));
        let mut each = [[[0.0, 1.0]; Driven::MOST_COSTS]; MOST_LANES]; // a missing row has the weight 1
        for (to, knot) in each.iter_mut().zip(knots) {
            let from = &knot.inverse_dynamics.slopes;
            to[..from.len()].copy_from_slice(from);
        }
        gather(count, |lane| each[lane].as_flattened(), part(slopes));
        let form = |lane: usize| &knots[lane].inverse_dynamics;
        let (U, G) = part(rows).split_at_mut(nv * width);
        gather(count, |lane| &form(lane).efforts.numbers, U);
        if knots.iter().all(|knot| costs(knot) == size.costs) {
            gather(count, |lane| &form(lane).costs.numbers, G);
            return size;
        }
        for (r, row) in G.chunks_exact_mut(width).enumerate() {
            let of = |lane: usize| match r < form(lane).slopes.len() {
                true => &form(lane).costs.numbers[r * width..],
                false => &zeros[..],
            };
            gather(count, of, row);
        }
        size
    }
}

impl<S: Block<Number = f64>> LaneSweep for Lanes<S> {
    fn begin(&mut self, knots: &[&LqKnot], regularisation: &[f64]) {
        let Self { size, knot, H, p, sums, unfit, .. } = self;
        let (n, count) = (2 * size.nv, knots.len());
        assert!(count <= S::LANES && regularisation.len() == count, "a lane for each problem");
        self.regularisation[..count].copy_from_slice(regularisation);
        unfit.fill(false);
        sums.fill(S::zero());
        let (Q, rest) = knot.split_at_mut(n * n);
        let (q, rest) = rest.split_at_mut(n);
        gather(count, |lane| knots[lane].Q.as_slice(), Q);
        gather(count, |lane| knots[lane].q.as_slice(), q);
        gather(count, |lane| &self.regularisation[lane..=lane], &mut rest[..1]);
        begin_sweep(*size, Q, q, &rest[0], &mut H[0], p, sums);
    }

    fn step(&mut self, knots: &[&LqKnot], results: &mut [LaneResult<'_>]) {
        let (count, mut fitting) = (knots.len(), None);
        for (lane, knot) in knots.iter().enumerate() {
            let fits = knot.structure.is_inverse_dynamics() && Driven::takes(knot, self.regularisation[lane]);
            self.unfit[lane] |= !fits || !knot.rows.is_empty();
            if !self.unfit[lane] {
                fitting = Some(*knot);
            }
        }
        let Some(fitting) = fitting else { return };
        let mut all = [fitting; MOST_LANES]; // the numbers of a knot of another form have no meaning
        for (lane, knot) in knots.iter().enumerate().filter(|(lane, _)| !self.unfit[*lane]) {
            all[lane] = knot;
        }
        let size = self.pack(&all[..count]);
        let Self { knot, H: [next, H], p, results: numbers, sums, .. } = self;
        let knot = &mut knot[..size.parts().iter().sum()];
        step(size, knot, next, p, H, numbers, sums);
        let ((k, rest), length) = (numbers.split_at(size.nv), size.results()[1]);
        let (K, curved) = rest.split_at(length);
        scatter(k, results, |result| &mut *result.k);
        scatter(K, results, |result| &mut *result.K);
        scatter(curved, results, |result| &mut *result.curved_gap);
        self.H.swap(0, 1);
    }

    fn end(&mut self, gaps: &[&[f64]], results: &mut [&mut [f64]]) -> [Option<[f64; 3]>; MOST_LANES] {
        let Self { size, knot, H: [next, _], p, results: numbers, sums, unfit, .. } = self;
        let (f, Pf) = (&mut knot[..2 * size.nv], &mut numbers[..2 * size.nv]);
        gather(gaps.len(), |lane| gaps[lane], f);
        end_sweep(*size, f, next, p, Pf, sums);
        scatter(Pf, results, |result| &mut **result);
        let mut each = [[0.0; SUMS]; MOST_LANES];
        scatter(sums, &mut each[..gaps.len()], |sums| &mut sums[..]);
        core::array::from_fn(|lane| {
            let [square, slope, curvature, failed] = each[lane];
            (lane < gaps.len() && failed == 0.0 && !unfit[lane]).then_some([square, slope, curvature])
        })
    }
}

/// Copies the first numbers of a slice of each problem into the lanes of `to`.
fn gather<'a, S: Block<Number = f64>>(count: usize, of: impl Fn(usize) -> &'a [f64], to: &mut [S]) {
    let rows: [&[f64]; MOST_LANES] = core::array::from_fn(|lane| of(lane.min(count - 1)));
    gather_rows(&rows[..count], to);
}

/// Writes each lane of `from` to the slice that `part` selects in one of `to`; an empty slice receives nothing.
fn scatter<S: Block<Number = f64>, T>(from: &[S], to: &mut [T], part: impl Fn(&mut T) -> &mut [f64]) {
    let (mut rows, count): ([&mut [f64]; MOST_LANES], _) = (Default::default(), to.len());
    for (row, to) in rows.iter_mut().zip(to) {
        *row = part(to);
    }
    scatter_rows(from, &mut rows[..count]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lq::Sweep;
    use crate::problem::{Evaluation, Problem};
    use crate::robot::{Activation, Cost, FreeDynamics, Residual};
    use condyle_dynamics::robots;
    use std::sync::Arc;

    const HORIZON: usize = 6;

    /// Returns the LQ knots of an arm with gaps. `i` selects the state and the number of residual rows.
    fn knots(i: usize) -> Vec<LqKnot> {
        let model = Arc::new(robots::arm7());
        let wave = |k: usize| ((7 * i + 3 * k + 1) as f64).sin();
        let x0: Vec<f64> = (0..14).map(wave).collect();
        let rest = Residual::State { reference: vec![0.1; 14] };
        let rest = Cost::new("rest", 0.1, rest, Activation::Quadratic);
        let effort = match i % 2 {
            0 => Activation::Quadratic,
            _ => Activation::Barrier { lower: vec![-1.0; 7], upper: vec![1.0; 7] },
        };
        let effort = Cost::new("effort", 0.01, Residual::ControlGravity, effort);
        let knot = FreeDynamics::running(model.clone(), 0.02, vec![rest.clone(), effort]).unwrap();
        let end = FreeDynamics::terminal(model, vec![rest]).unwrap();
        let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end)).unwrap();
        let (xs, us) = (x0.repeat(HORIZON + 1), (0..7 * HORIZON).map(|k| 5.0 * wave(k)).collect::<Vec<_>>());
        let mut knots = problem.lq_knots();
        problem.reserve_inverse_dynamics(&mut knots);
        problem.calc_diff_as(Evaluation::Equations { motions: &[], rows: false }, &xs, &us, &mut knots);
        for (t, knot) in knots[..HORIZON].iter_mut().enumerate() {
            knot.f.iter_mut().enumerate().for_each(|(k, f)| *f = 0.1 * wave(t * 14 + k));
        }
        knots
    }

    type Found = (Vec<Vec<f64>>, Option<[f64; 3]>);

    /// Returns k, K and P f of each knot of each problem, and the sums.
    fn sweep(problems: &[Vec<LqKnot>]) -> Option<Vec<Found>> {
        let (count, mut sweep) = (problems.len(), lane_sweep(&problems[0])?);
        let at = |t: usize| problems.iter().map(|knots| &knots[t]).collect::<Vec<_>>();
        let regularisation: Vec<f64> = (0..count).map(|i| 1e-9 * (1 + i) as f64).collect();
        sweep.begin(&at(HORIZON), &regularisation);
        let mut all = vec![(Vec::new(), None); count];
        for t in (0..HORIZON).rev() {
            let mut numbers = vec![[vec![0.0; 7], vec![0.0; 98], vec![0.0; 14]]; count];
            let results = numbers.iter_mut().map(|[k, K, curved_gap]| LaneResult { k, K, curved_gap });
            let mut results: Vec<_> = results.collect();
            sweep.step(&at(t), &mut results);
            all.iter_mut().zip(numbers).for_each(|(all, numbers)| all.0.push(numbers.concat()));
        }
        let mut ends = vec![vec![0.0; 14]; count];
        let gaps = vec![&[0.1; 14][..]; count];
        let sums = sweep.end(&gaps, &mut ends.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
        all.iter_mut().zip(ends).for_each(|(all, end)| all.0.push(end));
        all.iter_mut().zip(sums).for_each(|(all, sums)| all.1 = sums);
        Some(all)
    }

    /// Returns whether two numbers differ by rounding.
    fn near(a: f64, b: f64, scale: f64) -> bool {
        (a - b).abs() <= 1e-12 * (1.0 + scale)
    }

    #[test]
    fn equals_the_sweep_of_one_problem() {
        let problems: Vec<_> = (0..4).map(knots).collect();
        assert!(problems[0][0].inverse_dynamics.slopes.len() > problems[1][0].inverse_dynamics.slopes.len());
        let Some(found) = sweep(&problems) else { return }; // fewer than eight lanes
        for (i, (knots, (numbers, sums))) in problems.iter().zip(found).enumerate() {
            let mut alone = Sweep::new(knots);
            alone.run(knots, 1e-9 * (1 + i) as f64).unwrap();
            let feedback = alone.feedback();
            let mut expected = [0.0; 3];
            for (t, numbers) in (0..HORIZON).zip(numbers[..HORIZON].iter().rev()) {
                let own = &feedback[t];
                let all = own.k.iter().chain(&own.K).chain(&own.curved_gap);
                let scale = all.clone().fold(0.0, |most: f64, x| most.max(x.abs()));
                assert!(all.zip(numbers).all(|(a, b)| near(*a, *b, scale)), "problem {i}, knot {t}");
                let f = &knots[t].f;
                expected[0] += own.expected[1];
                expected[1] += feedback[t + 1].Vx.dot(f);
                expected[2] += own.curved_gap.dot(f);
            }
            let f = nalgebra::DVector::from_element(14, 0.1);
            let curved = &feedback[0].Vxx * &f;
            expected[1] += feedback[0].Vx.dot(&f);
            expected[2] += curved.dot(&f);
            assert!(curved.iter().zip(&numbers[HORIZON]).all(|(a, b)| near(*a, *b, curved.amax())));
            let sums = sums.expect("the problem is convex");
            assert!((0..3).all(|k| near(expected[k], sums[k], expected[k].abs())), "{expected:?}, {sums:?}");
        }
    }

    #[test]
    fn does_not_depend_on_other_problems() {
        let mut problems: Vec<_> = (0..4).map(knots).collect();
        let Some(before) = sweep(&problems) else { return }; // fewer than eight lanes
        problems[1][3].q[2] = f64::NAN;
        problems[2][2].structure.set_dense();
        let after = sweep(&problems).unwrap();
        assert!(after[1].1.is_none() && after[2].1.is_none());
        assert!((0..4).all(|i| i % 3 != 0 || before[i] == after[i]));
        let alone = sweep(&problems[..1]).unwrap();
        assert_eq!(alone[0], before[0]);
    }
}
