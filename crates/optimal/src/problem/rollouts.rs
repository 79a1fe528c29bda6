//! Rollouts of many control sequences, as sampling methods need them: several at a time in SIMD lanes, on several
//! threads, with costs and gradients.

use super::group::{Evaluation, Results, evaluate};
use super::horizon::Problem;
use crate::error::Error;
use crate::lq::{DIVERGED, LqKnot};
use condyle_linalg::dot;
use condyle_linalg::threads::join;
use std::ops::Range;

/// Simulator of many control sequences on the dynamics of one problem, with the costs of the problem:
///
/// ```text
/// x₀ given,   xₜ₊₁ = φₜ(xₜ, uₜ),   J = ℓ_N(x_N) + Σₜ ℓₜ(xₜ, uₜ)
/// ```
///
/// As many sequences as a model has SIMD lanes are simulated together, and each thread simulates some of them. The
/// result of a sequence does not depend on the other sequences, to the bit. It differs from [`Problem::rollout`] by
/// rounding at most. Controls outside of their bounds are used without change.
///
/// The gradients follow from one recursion backwards, the adjoint of the dynamics:
///
/// ```text
/// λ_N = ∂ℓ_N/∂x,   λₜ = ∂ℓₜ/∂x + Aₜᵀ λₜ₊₁,   ∂J/∂uₜ = ∂ℓₜ/∂u + Bₜᵀ λₜ₊₁,   ∂J/∂x₀ = λ₀
/// ```
///
/// ```
/// use condyle_optimal::{LqKnot, Lqr, Problem, RolloutResults, Rollouts};
/// // x⁺ = x + u, ℓ = ½ (x² + u²)
/// let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
/// (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0, 1.0);
/// let problem = Problem::new(vec![1.0], vec![Box::new(Lqr::new(knot))], vec![0; 2], Box::new(Lqr::new(end)))?;
/// let us = [0.0, 0.0, -1.0, 0.0, -0.5, -0.5]; // three sequences of two controls
/// let (mut costs, mut du) = ([0.0; 3], [0.0; 6]);
/// let mut rollouts = Rollouts::new(&problem, 1)?;
/// rollouts.run(&[1.0], &us, RolloutResults { costs: &mut costs, du: &mut du, ..Default::default() })?;
/// assert_eq!(costs, [1.5, 1.0, 0.875]);
/// assert_eq!(du[..2], [2.0, 1.0]);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
///
/// Sources: Williams, Aldrich and Theodorou, *Model predictive path integral control* (2017), for a method that needs
/// these rollouts; Bryson and Ho, *Applied optimal control* (1975), for the adjoint.
#[derive(Debug)]
pub struct Rollouts {
    workers: Vec<Worker>,
}

/// Outputs of [`Rollouts::run`] for B sequences over N knots. Slices other than `costs` may be empty; their numbers are
/// then not computed or not stored.
#[derive(Debug, Default)]
pub struct RolloutResults<'a> {
    /// Costs J, B entries. The cost of a sequence that diverges is infinite: a number is not finite or exceeds 1e30.
    pub costs: &'a mut [f64],
    /// States, B × (N + 1) × nx; NaN from the first knot that a diverging sequence does not reach.
    pub xs: &'a mut [f64],
    /// Gradients ∂J/∂u, B × the length of a control sequence; NaN for a sequence that diverges.
    pub du: &'a mut [f64],
    /// Gradients ∂J/∂x₀ in the tangent space, B × ndx; NaN for a sequence that diverges.
    pub dx0: &'a mut [f64],
}

/// Control sequences, from `first` on, with their initial states: one for all sequences, or one for each.
#[derive(Clone, Copy)]
struct Sequences<'a> {
    x0: &'a [f64],
    us: &'a [f64],
    first: usize,
}

/// Copy of the problem for one thread, with the scratch of a group.
#[derive(Debug)]
struct Worker {
    problem: Problem,
    /// Number of sequences of a group.
    width: usize,
    /// States of the group, knot after knot and, within a knot, sequence after sequence.
    xs: Vec<f64>,
    /// Controls of the group at one knot.
    u: Vec<f64>,
    /// Index of the knot, repeated.
    knot: Vec<usize>,
    knot_costs: Vec<f64>,
    /// Whether each sequence has diverged, and the first knot that it does not reach, or N + 1.
    failed: Vec<bool>,
    ends: Vec<usize>,
    /// Derivatives of the group at one knot, for each number of controls that occurs in the horizon.
    lq_knots: Vec<Vec<LqKnot>>,
    /// Adjoints λₜ₊₁ and λₜ of the group.
    adjoints: [Vec<f64>; 2],
    /// Output buffer for the next states of the terminal action, which are never read.
    unread: Vec<f64>,
}

impl Rollouts {
    /// Creates a simulator with copies of the problem for `threads` threads. Later changes of the problem do not affect
    /// the copies. Allocates; all other methods allocate nothing.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub fn new(problem: &Problem, threads: usize) -> Result<Self, Error> {
        let workers = (0..threads.max(1)).map(|_| Worker::new(problem)).collect::<Result<_, _>>()?;
        Ok(Self { workers })
    }

    /// Simulates B control sequences. `us` has B times the length of a control sequence. `x0` is one initial state for
    /// all sequences (nx), or one for each (B × nx).
    ///
    /// # Errors
    /// [`Error`] if a length is wrong, or an initial state is invalid or not finite. The results are then unchanged.
    pub fn run(&mut self, x0: &[f64], us: &[f64], results: RolloutResults<'_>) -> Result<(), Error> {
        let problem = &self.workers[0].problem;
        let (nx, nu, horizon) = (problem.nx(), problem.shape().offsets[problem.horizon()], problem.horizon());
        let (count, ndx) = (results.costs.len(), problem.ndx());
        Error::check_length("us", us.len(), count * nu)?;
        let found = [
            ("xs", results.xs.len(), (horizon + 1) * nx),
            ("du", results.du.len(), nu),
            ("dx0", results.dx0.len(), ndx),
        ];
        for (name, found, size) in found.into_iter().filter(|(_, found, _)| *found > 0) {
            Error::check_length(name, found, count * size)?;
        }
        Error::check("x0", x0, if x0.len() == nx { nx } else { count * nx })?;
        x0.chunks_exact(nx).try_for_each(|x| problem.check_x0(x))?;
        spread(&mut self.workers, Sequences { x0, us, first: 0 }, results);
        Ok(())
    }
}

/// Divides the sequences among the workers, and simulates them.
fn spread(workers: &mut [Worker], given: Sequences<'_>, results: RolloutResults<'_>) {
    let count = results.costs.len();
    match workers {
        [worker] => worker.run(given, results),
        workers => {
            let half = workers.len() / 2;
            let share = count * half / workers.len();
            let ((one, other), (these, those)) = (workers.split_at_mut(half), results.split(share));
            let rest = Sequences { first: given.first + share, ..given };
            join(|| spread(one, given, these), || spread(other, rest, those));
        }
    }
}

impl<'a> Sequences<'a> {
    /// Returns the initial state of sequence i.
    fn x0(&self, i: usize, nx: usize) -> &'a [f64] {
        match self.x0.len() == nx {
            true => self.x0,
            false => &self.x0[(self.first + i) * nx..][..nx],
        }
    }

    /// Returns the controls `knot` of sequence i, where `length` is the length of a sequence.
    fn u(&self, i: usize, length: usize, knot: Range<usize>) -> &'a [f64] {
        &self.us[(self.first + i) * length..][knot]
    }
}

impl<'a> RolloutResults<'a> {
    /// Divides the outputs into the outputs of the first `count` sequences and of the others.
    fn split(self, count: usize) -> (Self, Self) {
        let all = self.costs.len().max(1);
        let part = |slice: &'a mut [f64]| {
            let size = slice.len() / all;
            slice.split_at_mut(size * count)
        };
        let ((costs, a), (xs, b), (du, c), (dx0, d)) = (part(self.costs), part(self.xs), part(self.du), part(self.dx0));
        (Self { costs, xs, du, dx0 }, Self { costs: a, xs: b, du: c, dx0: d })
    }
}

impl Worker {
    /// Allocates the scratch for a copy of a problem.
    fn new(problem: &Problem) -> Result<Self, Error> {
        let (shape, width, ndx) = (problem.shape(), problem.lanes(), problem.ndx());
        let (nx, horizon) = (shape.nx, shape.horizon());
        let mut sizes: Vec<usize> = (0..=horizon).map(|t| shape.nu(t)).collect();
        sizes.sort_unstable();
        sizes.dedup();
        Ok(Self {
            problem: problem.try_clone()?,
            width,
            xs: vec![0.0; (horizon + 1) * width * nx],
            u: vec![0.0; width * sizes.last().copied().unwrap_or(0)],
            knot: vec![0; width],
            knot_costs: vec![0.0; width],
            failed: vec![false; width],
            ends: vec![0; width],
            lq_knots: sizes.iter().map(|&nu| vec![LqKnot::zeros(ndx, nu); width]).collect(),
            adjoints: [vec![0.0; width * ndx], vec![0.0; width * ndx]],
            unread: vec![0.0; width * nx],
        })
    }

    /// Simulates all sequences, group after group.
    fn run(&mut self, given: Sequences<'_>, mut results: RolloutResults<'_>) {
        let mut given = given;
        while !results.costs.is_empty() {
            let count = self.width.min(results.costs.len());
            let (mut group, rest) = results.split(count);
            self.simulate(given, &mut group);
            if !group.du.is_empty() || !group.dx0.is_empty() {
                self.differentiate(given, &mut group);
            }
            given.first += count;
            results = rest;
        }
    }

    /// Writes the controls of the group at knot t. A sequence that has diverged gets zeros.
    fn read_controls(&mut self, t: usize, given: Sequences<'_>) {
        let shape = self.problem.shape();
        let (nu, length) = (shape.nu(t), shape.offsets[shape.horizon()]);
        for (i, &end) in self.ends.iter().enumerate() {
            let u = &mut self.u[i * nu..][..nu];
            match t < end {
                true => u.copy_from_slice(given.u(i, length, shape.u(t))),
                false => u.fill(0.0),
            }
        }
    }

    /// Computes the costs and the states of a group. After a sequence has diverged, its states in the scratch are x̂₀,
    /// so that evaluations remain valid. A group with fewer sequences than lanes is filled up with such sequences,
    /// because a single state of a robot in contact is computed by another algorithm.
    fn simulate(&mut self, given: Sequences<'_>, results: &mut RolloutResults<'_>) {
        let (count, nx, horizon) = (results.costs.len(), self.problem.nx(), self.problem.horizon());
        let width = self.width;
        results.costs.fill(0.0);
        for i in 0..width {
            (self.failed[i], self.ends[i]) = if i < count { (false, horizon + 1) } else { (true, 0) };
            let x0 = if i < count { given.x0(i, nx) } else { self.problem.x0() };
            self.xs[i * nx..][..nx].copy_from_slice(x0);
        }
        for t in 0..=horizon {
            self.read_controls(t, given);
            let Self { problem, xs, u, knot, knot_costs, failed, ends, unread, .. } = self;
            let (done, ahead) = xs.split_at_mut((t + 1) * width * nx);
            let next = if t < horizon { &mut ahead[..width * nx] } else { &mut unread[..] };
            let (x, u) = (&done[t * width * nx..], &u[..width * problem.shape().nu(t)]);
            knot.fill(t);
            let mut found = Results::values(next, knot_costs, &mut []);
            evaluate(problem.action_mut(t), knot, x, u, Evaluation::Values, &mut found);
            for (i, next) in next.chunks_exact_mut(nx).take(count).enumerate() {
                results.costs[i] += knot_costs[i];
                let is_bounded = |x: f64| x.abs() < DIVERGED; // false for NaN
                let is_finite = is_bounded(results.costs[i]) && (t == horizon || next.iter().all(|x| is_bounded(*x)));
                if !failed[i] && !is_finite {
                    (failed[i], ends[i]) = (true, t + 1);
                }
            }
            for (next, _) in next.chunks_exact_mut(nx).zip(&*failed).filter(|(_, failed)| **failed) {
                next.copy_from_slice(problem.x0());
            }
        }
        self.write(results);
    }

    /// Writes the states of a group in the order of its sequences, and marks sequences that have diverged.
    fn write(&self, results: &mut RolloutResults<'_>) {
        let (nx, horizon) = (self.problem.nx(), self.problem.horizon());
        for (cost, _) in results.costs.iter_mut().zip(&self.failed).filter(|(_, failed)| **failed) {
            *cost = f64::INFINITY;
        }
        for (i, to) in results.xs.chunks_exact_mut((horizon + 1) * nx).enumerate() {
            for (t, to) in to.chunks_exact_mut(nx).enumerate() {
                match t < self.ends[i] {
                    true => to.copy_from_slice(&self.xs[(t * self.width + i) * nx..][..nx]),
                    false => to.fill(f64::NAN),
                }
            }
        }
    }

    /// Computes the gradients of a group along the states in the scratch, from the last knot to the first.
    fn differentiate(&mut self, given: Sequences<'_>, results: &mut RolloutResults<'_>) {
        let (count, width) = (results.costs.len(), self.width);
        let (nx, horizon) = (self.problem.nx(), self.problem.horizon());
        let (ndx, length) = (self.problem.ndx(), self.problem.shape().offsets[horizon]);
        for t in (0..=horizon).rev() {
            self.read_controls(t, given);
            let Self { problem, xs, u, knot, lq_knots, adjoints: [next, adjoint], .. } = self;
            let (nu, range) = (problem.shape().nu(t), problem.shape().u(t));
            let lq_knots = lq_knots.iter_mut().find(|knots| knots[0].nu() == nu).expect("there are knots for each nu");
            knot.fill(t);
            let (x, u) = (&xs[t * width * nx..][..width * nx], &u[..width * nu]);
            evaluate(problem.action_mut(t), knot, x, u, Evaluation::Derivatives, &mut Results::derivatives(lq_knots));
            for (i, knot) in lq_knots[..count].iter().enumerate() {
                let (next, adjoint) = (&next[i * ndx..][..ndx], &mut adjoint[i * ndx..][..ndx]);
                adjoint.copy_from_slice(knot.q.as_slice());
                if t == horizon {
                    continue;
                }
                for (to, column) in adjoint.iter_mut().zip(knot.A.column_iter()) {
                    *to += dot(column.as_slice(), next); // λₜ = ∂ℓₜ/∂x + Aₜᵀ λₜ₊₁
                }
                let Some(du) = results.du.get_mut(i * length..(i + 1) * length) else { continue };
                for ((to, r), column) in du[range.clone()].iter_mut().zip(&knot.r).zip(knot.B.column_iter()) {
                    *to = r + dot(column.as_slice(), next); // ∂J/∂uₜ = ∂ℓₜ/∂u + Bₜᵀ λₜ₊₁
                }
            }
            self.adjoints.swap(0, 1);
        }
        for i in 0..count {
            if let Some(dx0) = results.dx0.get_mut(i * ndx..(i + 1) * ndx) {
                dx0.copy_from_slice(&self.adjoints[0][i * ndx..][..ndx]);
            }
        }
        for i in (0..count).filter(|i| self.failed[*i]) {
            results.du.get_mut(i * length..(i + 1) * length).into_iter().for_each(|du| du.fill(f64::NAN));
            results.dx0.get_mut(i * ndx..(i + 1) * ndx).into_iter().for_each(|dx0| dx0.fill(f64::NAN));
        }
    }
}
