//! Iterate of a solver: a trajectory with its dynamics, cost and gaps.

use super::solution::Solution;
use crate::problem::{Evaluation, Problem};
use crate::time::Instant;
use condyle_linalg::max_abs;

/// Sum that is rounded only once, at the end (Neumaier, 1974). The solver compares costs that differ only in their last
/// digits near an optimum.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sum {
    sum: f64,
    /// Sum of the rounding errors of all additions.
    lost: f64,
}

impl Sum {
    pub(super) fn add(&mut self, x: f64) {
        let sum = self.sum + x;
        let (large, small) = if self.sum.abs() >= x.abs() { (self.sum, x) } else { (x, self.sum) };
        self.lost += (large - sum) + small;
        self.sum = sum;
    }

    pub(super) fn value(self) -> f64 {
        self.sum + self.lost
    }
}

/// Iterate, and the storage in which its cost and gaps are computed.
#[derive(Debug, Clone)]
pub(super) struct Iterate {
    /// Solution, with the trajectory and the cost of the iterate.
    pub(super) solution: Solution,
    /// Next states φₜ(xₜ, uₜ), N·nx.
    pub(super) next: Vec<f64>,
    /// Accelerations and forces at knots in inverse-dynamics form, in N parts of equal length.
    pub(super) motions: Vec<f64>,
    /// Whether `motions` was computed at the current trajectory.
    pub(super) knows_motions: bool,
    costs: Vec<f64>,
    /// Gaps f₀ = x̂₀ ⊖ x₀, fₜ₊₁ = φₜ ⊖ xₜ₊₁, (N + 1)·ndx.
    pub(super) gaps: Vec<f64>,
}

impl Iterate {
    /// Allocates an iterate of zeros for `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        let (shape, horizon) = (problem.shape(), problem.horizon());
        Self {
            solution: Solution::new(problem),
            next: vec![0.0; horizon * shape.nx],
            motions: vec![0.0; horizon * problem.motion_size()],
            knows_motions: false,
            costs: vec![0.0; horizon + 1],
            gaps: vec![0.0; (horizon + 1) * shape.ndx],
        }
    }

    /// Returns the derivatives that an iteration needs: equations of inverse dynamics, with the motions if they are
    /// known, or derivatives of the next states.
    pub(super) fn derivatives(&self, inverse_dynamics: bool) -> Evaluation<'_> {
        match inverse_dynamics {
            true => {
                Evaluation::Equations { motions: if self.knows_motions { &self.motions } else { &[] }, rows: false }
            }
            false => Evaluation::Derivatives,
        }
    }

    /// Computes dynamics, cost and gaps of the trajectory; returns the largest gap ‖f‖∞.
    pub(super) fn evaluate(&mut self, problem: &mut Problem) -> f64 {
        let clock = Instant::now();
        let Self { solution: Solution { xs, us, .. }, next, costs, motions, .. } = self;
        problem.calc_with(xs, us, next, costs, [motions, &mut []]);
        self.knows_motions = true;
        let mut sum = Sum::default();
        self.costs.iter().for_each(|cost| sum.add(*cost));
        self.solution.cost = sum.value();
        self.solution.timings.calc += clock.elapsed();
        self.update_gaps(problem)
    }

    /// Computes the gaps f₀ = x̂₀ ⊖ x₀,  fₜ₊₁ = φₜ(xₜ, uₜ) ⊖ xₜ₊₁; returns the largest gap ‖f‖∞.
    pub(super) fn update_gaps(&mut self, problem: &Problem) -> f64 {
        Self::write_gaps(problem, &self.solution.xs, &self.next, &mut self.gaps);
        max_abs(&self.gaps)
    }

    /// Computes the gap f₀ = x̂₀ ⊖ x₀ alone; returns the largest gap ‖f‖∞ of all knots.
    pub(super) fn update_first_gap(&mut self, problem: &Problem) -> f64 {
        let (x, gap) = (&self.solution.xs[..problem.nx()], &mut self.gaps[..problem.ndx()]);
        match x == problem.x0() {
            true => gap.fill(0.0),
            false => problem.action(0).difference(x, problem.x0(), gap),
        }
        max_abs(&self.gaps)
    }

    /// Computes the gaps of a trajectory with the states `xs` and the next states `next`.
    pub(super) fn write_gaps(problem: &Problem, xs: &[f64], next: &[f64], gaps: &mut [f64]) {
        let shape = problem.shape();
        for t in 0..=shape.horizon() {
            let predicted = if t == 0 { problem.x0() } else { &next[shape.x(t - 1)] };
            let (x, gap) = (&xs[shape.x(t)], &mut gaps[shape.dx(t)]);
            if x == predicted {
                gap.fill(0.0);
            } else {
                problem.action(t).difference(x, predicted, gap);
            }
        }
    }

    /// Returns the largest gap: the index of its knot, the index of its entry in the tangent space, and its size.
    pub(super) fn largest_gap(&self) -> Option<(usize, usize, f64)> {
        let ndx = self.solution.shape().ndx;
        let sizes = self.gaps.iter().map(|gap| if gap.is_nan() { f64::INFINITY } else { gap.abs() });
        let (i, size) = sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (size > 0.0).then_some((i / ndx, i % ndx, size))
    }
}
