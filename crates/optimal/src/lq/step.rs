//! Steps of the Riccati recursion.
#![allow(non_snake_case)] // the names of the literature: H, L, X, Vxx

use super::forms::{Controls, Curvature, Driven, Forms, InverseDynamics};
use super::knot::{Hessian, KnotFeedback, LqKnot};
use super::workspace::Workspace;

/// Reason why a sweep stopped before the first knot.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// Quu has a pivot that is not positive: the problem is not convex in the control at that knot. More regularisation
    /// helps.
    #[error("knot {knot}: Quu is not positive definite (pivot {row} is {pivot:e})")]
    NotPositive {
        /// Index of the knot.
        knot: usize,
        /// Row of the pivot.
        row: usize,
        /// Value of the pivot.
        pivot: f64,
    },
    /// The value function is infinite, NaN, or larger than 1e30.
    #[error("knot {knot}: the value function is not finite")]
    NotFinite {
        /// Index of the knot.
        knot: usize,
    },
}

/// Largest numbers of states and controls of some knots, and their requirements for inverse dynamics.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Number of states.
    pub(super) n: usize,
    /// Largest number of controls.
    pub(super) m: usize,
    /// Requirements as returned by [`InverseDynamics::room`].
    inverse_dynamics: [usize; 3],
}

impl Sizes {
    /// Returns the sizes of some knots.
    pub(super) fn of(knots: &[LqKnot]) -> Self {
        Self {
            n: knots.last().map_or(0, LqKnot::ndx),
            m: knots.iter().map(LqKnot::nu).max().unwrap_or(0),
            inverse_dynamics: InverseDynamics::room(knots),
        }
    }

    /// Returns the maximum number of controls of knots in inverse-dynamics form: 0 without such knots.
    pub(super) fn solved_controls(self) -> usize {
        if self.inverse_dynamics[0] > 0 { self.m } else { 0 }
    }
}

/// Step of the recursion, with its workspace.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(super) work: Workspace,
    /// Whether Vxx is written to the knots.
    pub(super) keep: bool,
    /// Whether gains are deferred, if a form supports it: see [`Gains`](super::gains::Gains).
    pub(super) puts_off: bool,
    forms: Forms,
    controls: Controls,
    /// Curvature of the dynamics, one entry for each number of controls that occurs at knots with curvature.
    hessians: Vec<Hessian>,
}

impl Step {
    /// Allocates the workspace for knots of the given sizes, with `below` additional rows in H. The dynamics may be
    /// curved at knots whose number of controls is in `curved`.
    pub(super) fn new(sizes: Sizes, below: usize, mut curved: Vec<usize>) -> Self {
        let Sizes { n, m, inverse_dynamics } = sizes;
        curved.sort_unstable();
        curved.dedup();
        Self {
            work: Workspace::new(n, m, below.max(Driven::rows_below(n, m))),
            keep: true,
            puts_off: false,
            forms: Forms::new(n, sizes.solved_controls(), inverse_dynamics),
            controls: Controls::new(m),
            hessians: curved.into_iter().map(|nu| Hessian::zeros(n, nu)).collect(),
        }
    }

    /// Sweeps the end of a horizon. The first knot is knot `first`, and the last knot is the terminal one.
    pub(crate) fn run(
        &mut self,
        first: usize,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        regularisation: f64,
        curvature: &mut dyn FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        let last = knots.len() - 1;
        self.work.start(&knots[last]);
        self.finish(first + last, &mut feedback[last], regularisation)?;
        self.back(first, &knots[..last], feedback, regularisation, curvature)
    }

    /// Makes the steps at `knots`, whose first is knot `first`, from P, p of the knot after them.
    pub(crate) fn back(
        &mut self,
        first: usize,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        regularisation: f64,
        curvature: &mut dyn FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        for i in (0..knots.len()).rev() {
            let (t, feedback) = (first + i, &mut feedback[i]);
            self.step(t, &knots[i], feedback, regularisation, curvature)?;
            self.finish(t, feedback, regularisation)?;
        }
        Ok(())
    }

    /// Makes one step: P, p of knot t + 1 become P, p of knot t, and the gains of knot t are written.
    fn step(
        &mut self,
        t: usize,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
        regularisation: f64,
        ask: &mut dyn FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        let Self { work, forms, controls, hessians, puts_off, .. } = self;
        let form = forms.of_step(knot, regularisation);
        work.move_by(knot.f.as_slice());
        form.write(work, knot, regularisation, &mut Curvature { knot: t, ask, hessians });
        let eliminated =
            form.eliminate(work, controls, knot, feedback).map_err(|(row, pivot)| match pivot.is_finite() {
                true => SweepError::NotPositive { knot: t, row, pivot },
                false => SweepError::NotFinite { knot: t },
            })?;
        work.take_value(work.stride(knot.nu()), eliminated, form.turn(knot.ndx()));
        feedback.is_put_off = *puts_off && knot.nu() > 0 && form.put_off_gains(work, knot, feedback);
        if !feedback.is_put_off {
            form.recover_gains(work, controls, knot, feedback);
        }
        Ok(())
    }

    /// Writes H of a knot, and below it the product of Θ and the map to δx⁺. Returns the workspace that contains it,
    /// and the rotation of the states there.
    pub(super) fn write_with_rows_below(
        &mut self,
        knot: &LqKnot,
        regularisation: f64,
        Theta: &[f64],
    ) -> (&mut Workspace, usize) {
        let Self { work, forms, .. } = self;
        let form = forms.of(knot);
        work.move_by(knot.f.as_slice());
        form.write(
            work,
            knot,
            regularisation,
            &mut Curvature { knot: 0, ask: &mut |_, _, _| false, hessians: &mut [] },
        );
        form.write_below(work, knot, Theta);
        (work, form.turn(knot.ndx()))
    }

    /// Adds ϱ 1 to Vxx, and writes Vx and Vxx to knot t.
    fn finish(&mut self, t: usize, feedback: &mut KnotFeedback, regularisation: f64) -> Result<(), SweepError> {
        match self.work.finish_value(feedback, regularisation, self.keep) {
            true => Ok(()),
            false => Err(SweepError::NotFinite { knot: t }),
        }
    }
}
