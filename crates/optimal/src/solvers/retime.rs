//! Warm start at other times: moves a plan to a horizon whose knots begin at other times and have other models.
#![allow(non_snake_case)] // names follow the literature: K

use super::iterate::Iterate;
use super::limit_rows::LimitRows;
use super::policy::knot_times;
use super::settings::Settings;
use super::solution::Solution;
use super::solver_loop::SolverLoop;
use crate::error::Error;
use crate::lq::{LqKnot, Sweep};
use crate::problem::{Problem, Shape};
use core::ops::Range;
use nalgebra::{DMatrix, DVector};

/// Times (s) that differ by less are equal.
const SAME_TIME: f64 = 1e-9;

/// Old plan, and the knot of the old plan from which each new knot takes its numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct Retiming {
    /// Times at which the old knots begin on the clock of the new plan, and the end of the old horizon: N + 1 numbers.
    times: Vec<f64>,
    /// Times at which the new knots begin, and the end of the new horizon: N + 1 numbers.
    new_times: Vec<f64>,
    knot_models: Vec<usize>,
    /// Sources of the new knots, N entries.
    pub(super) sources: Vec<Source>,
    /// Rows of the limits of the old horizon, knot by knot.
    pub(super) limits: Vec<LimitRows>,
    shape: Shape,
    xs: Vec<f64>,
    us: Vec<f64>,
    K: Vec<DMatrix<f64>>,
    k: Vec<DVector<f64>>,
    /// Scratch for a change of state.
    dx: Vec<f64>,
}

/// Old knot from which a new knot takes its numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source {
    /// Index of the old knot.
    pub(super) knot: usize,
    /// Whether the controls of both knots have the same meaning. If not, the new controls hold the state still.
    pub(super) has_controls: bool,
    /// Ratio of the durations of the new and the old knot. Multipliers contain the duration.
    pub(super) scale: f64,
}

impl Retiming {
    /// Returns the old knot at the time `t` of the new clock. The last knot includes all later times.
    fn knot_at(&self, t: f64) -> usize {
        self.times[1..self.times.len() - 1].partition_point(|begin| *begin <= t)
    }

    /// Records the old horizon, and finds the source of each new knot. The new knots begin `elapsed` seconds after the
    /// old ones. Returns the number of old knots that have passed.
    fn record(
        &mut self,
        problem: &mut Problem,
        elapsed: f64,
        models: &[usize],
        durations: &[f64],
    ) -> Result<usize, Error> {
        knot_times(problem, &mut self.times)?;
        self.times.iter_mut().for_each(|time| *time -= elapsed);
        self.knot_models.clear();
        self.knot_models.extend_from_slice(problem.knot_models());
        problem.write_limit_rows(&mut self.limits);
        self.new_times.clear();
        self.sources.clear();
        let mut begin = 0.0;
        for (&model, &dt) in models.iter().zip(durations) {
            let knot = self.knot_at(begin + 0.5 * dt);
            let has_controls = problem.has_same_controls(self.knot_models[knot], model);
            let old_dt = self.times[knot + 1] - self.times[knot];
            let scale = if old_dt > 0.0 && dt > 0.0 { dt / old_dt } else { 1.0 };
            self.sources.push(Source { knot, has_controls, scale });
            self.new_times.push(begin);
            begin += dt;
        }
        self.new_times.push(begin);
        Ok(self.knot_at(0.5 * durations[0]))
    }

    /// Computes the state of the old plan at the beginning of the new knot t into `x`. Returns whether the old plan has
    /// a state at this time. A horizon that begins after the old one begins at the last state.
    fn state(&mut self, problem: &Problem, t: usize, x: &mut [f64]) -> bool {
        let Self { times, new_times, shape, xs, dx, .. } = self;
        let (time, last) = (new_times[t], times.len() - 1);
        let is_after_impact = t > 0 && new_times[t - 1] == time;
        let is_same = |old: &f64| (old - time).abs() <= SAME_TIME;
        let same = match is_after_impact {
            true => times.iter().rposition(is_same),
            false => times.iter().position(is_same),
        };
        let is_beyond = time > times[last];
        if let Some(knot) = same.or((is_beyond && t == 0).then_some(last)) {
            x.copy_from_slice(&xs[shape.x(knot)]);
        } else if is_beyond {
            return false;
        } else {
            let knot = times[1..last].partition_point(|begin| *begin <= time);
            let fraction = (time - times[knot]) / (times[knot + 1] - times[knot]);
            let space = problem.action(problem.horizon());
            space.difference(&xs[shape.x(knot)], &xs[shape.x(knot + 1)], dx);
            dx.iter_mut().for_each(|dx| *dx *= fraction);
            space.integrate(&xs[shape.x(knot)], dx, x);
        }
        true
    }
}

impl SolverLoop {
    /// Moves problem and trajectory to other knots: see [`Fddp::retime`](crate::Fddp::retime).
    pub(super) fn retime(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        elapsed: f64,
        knot_models: &[usize],
        durations: &[f64],
    ) -> Result<usize, Error> {
        if !self.started {
            return Err(Error::NothingToResume);
        }
        self.iterate.solution.shape().check(problem.shape())?;
        if !(elapsed >= -SAME_TIME && elapsed.is_finite()) {
            return Err(Error::Elapsed { elapsed });
        }
        problem.check_knots(knot_models, durations)?;
        let passed = self.retiming.record(problem, elapsed, knot_models, durations)?;
        problem.move_knots(passed, knot_models, durations);
        self.prepared = None;
        self.fit(problem);
        self.resample(problem, settings);
        Ok(passed)
    }

    /// Moves the trajectory and its gains to the old plan, and adapts the workspace to the numbers of controls of a
    /// problem. Allocates at the first call, and if a number of controls changes.
    fn fit(&mut self, problem: &Problem) {
        let (solution, old, shape) = (&mut self.iterate.solution, &mut self.retiming, problem.shape());
        old.shape.clone_from(solution.shape());
        old.dx.resize(shape.ndx, 0.0);
        old.xs.clone_from(&solution.xs);
        old.us.clone_from(&solution.us);
        old.K.resize_with(shape.horizon(), || DMatrix::zeros(0, 0));
        old.k.resize_with(shape.horizon(), || DVector::zeros(0));
        old.K.swap_with_slice(&mut solution.K);
        old.k.swap_with_slice(&mut solution.k);
        for (t, (K, k)) in solution.K.iter_mut().zip(&mut solution.k).enumerate() {
            let nu = shape.nu(t);
            if K.shape() != (nu, shape.ndx) {
                (*K, *k) = (DMatrix::zeros(nu, shape.ndx), DVector::zeros(nu));
            }
        }
        if solution.shape() != shape {
            solution.reshape(shape);
            for (t, knot) in self.knots.iter_mut().enumerate().filter(|(t, knot)| knot.nu() != shape.nu(*t)) {
                *knot = LqKnot::zeros(shape.ndx, shape.nu(t));
            }
            problem.reserve_inverse_dynamics(&mut self.knots);
            self.sweep = Sweep::new(&self.knots);
        }
        // models with many rows move to other knots
        let (running, _) = self.knots.split_at_mut(shape.horizon());
        let most = running.iter().map(|knot| knot.rows.capacities());
        let most = most.reduce(|a, b| core::array::from_fn(|k| a[k].max(b[k]))).unwrap_or_default();
        running.iter_mut().for_each(|knot| knot.rows.reserve(most));
        self.line_search.reshape(problem);
        self.best.reshape(problem);
    }

    /// Computes the trajectory and its gains at the new knots from the old plan.
    fn resample(&mut self, problem: &mut Problem, settings: &Settings) {
        let Self { iterate: Iterate { solution, next, .. }, retiming, renewed, .. } = self;
        let (horizon, nx) = (problem.horizon(), problem.nx());
        let mut is_extended = false;
        for t in 0..=horizon {
            let x = t * nx..(t + 1) * nx;
            if !retiming.state(problem, t, &mut solution.xs[x.clone()]) {
                is_extended = true;
                solution.xs.copy_within(x.start - nx..x.start, x.start);
                if *renewed {
                    // xₜ = φ(xₜ₋₁, uₜ₋₁), if this state is finite
                    let (u, next) = (problem.shape().u(t - 1), &mut next[..nx]);
                    let (before, x) = solution.xs.split_at_mut(x.start);
                    problem.action_mut(t - 1).calc(t - 1, &before[before.len() - nx..], &solution.us[u], next);
                    if next.iter().all(|x| x.is_finite()) {
                        x[..nx].copy_from_slice(next);
                    }
                }
            }
            let Some(source) = retiming.sources.get(t) else { break };
            retiming.write_controls(t, *source, solution, problem);
            if settings.project_warm_start {
                solution.project(problem, t..t + 1);
            }
        }
        *renewed &= !is_extended;
    }
}

impl Retiming {
    /// Writes the controls and gains of the new knot t. Gains after the end of the old plan are zero.
    fn write_controls(
        &self,
        t: usize,
        Source { knot, has_controls, .. }: Source,
        solution: &mut Solution,
        problem: &mut Problem,
    ) {
        let is_beyond = self.new_times[t] + SAME_TIME >= self.times[self.times.len() - 1];
        if has_controls && !is_beyond {
            solution.K[t].copy_from(&self.K[knot]);
            solution.k[t].copy_from(&self.k[knot]);
        } else {
            solution.K[t].fill(0.0);
            solution.k[t].fill(0.0);
        }
        let u = problem.shape().u(t);
        if has_controls {
            solution.us[u].copy_from_slice(&self.us[self.shape.u(knot)]);
        } else {
            solution.us[u].fill(0.0);
            solution.hold_still(problem, t);
        }
    }

    /// Calls `copy` with the constraint rows of the new knot t that take their numbers from the old horizon: with the
    /// new rows, the index of the old knot, its rows, and the factor of the multipliers. Rows are counted from the
    /// first constraint of their knot. If the models differ, these are the rows of limits that both models have by
    /// name.
    pub(super) fn each_rows(
        &self,
        problem: &mut Problem,
        t: usize,
        copy: &mut dyn FnMut(Range<usize>, usize, Range<usize>, f64),
    ) {
        let Some(&Source { knot, scale, .. }) = self.sources.get(t) else {
            let count = problem.constraint_count(t);
            return copy(0..count, t, 0..count, 1.0); // the terminal knot
        };
        if self.knot_models[knot] == problem.knot_models()[t] {
            let count = problem.constraint_count(t);
            return copy(0..count, knot, 0..count, scale);
        }
        let first = self.limits.partition_point(|limit| limit.knot < knot);
        let last = self.limits.partition_point(|limit| limit.knot <= knot);
        let mut before = 0; // number of rows of this knot in earlier visits
        problem.constraints(t, &mut |bounded| {
            for (part, rows) in bounded.named_rows() {
                let old = self.limits[first..last].iter().find(|limit| limit.name == part.name);
                if let Some(old) = old.filter(|old| old.rows.len() == rows.len()) {
                    copy(before + rows.start..before + rows.end, knot, old.rows.clone(), scale);
                }
            }
            before += bounded.count;
        });
    }
}
