//! Steps of the Riccati recursion.
#![allow(non_snake_case)] // names follow the literature: H, L, X, Vxx

use super::feedback::KnotFeedback;
use super::forms::{Curvature, CurvatureFn, Forms, Sizes};
use super::knot::{Hessian, LqKnot};
use super::row_terms::{RowTerms, ScaledRows};
use super::workspace::Workspace;
use condyle_linalg::View;

/// Reason why a sweep stopped before the first knot.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The matrix Quu has a pivot that is not positive: the problem is not convex in the control at that knot. A larger
    /// regularisation helps.
    #[error("knot {knot}: Quu is not positive definite (pivot {row} is {pivot:e})")]
    NotPositive {
        /// Index of the knot.
        knot: usize,
        /// Index of the pivot's row in Quu.
        row: usize,
        /// Value of the pivot.
        pivot: f64,
    },
    /// The value function has an entry that is infinite, NaN, or larger than 1e30.
    #[error("knot {knot}: the value function is not finite")]
    NotFinite {
        /// Index of the knot.
        knot: usize,
    },
    /// The knot has [constraint rows](crate::LqKnot::rows), which a sweep does not support.
    #[error("knot {knot}: the sweep does not treat constraint rows")]
    ConstraintRows {
        /// Index of the knot.
        knot: usize,
    },
}

/// Results of a step of the sweep, besides the value function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SweepOutput {
    /// Gains K and k.
    Gains,
    /// Factors for the forward pass.
    Factors,
    /// Gains and factors.
    Both,
}

/// Options of a sweep, the same for all knots.
pub(super) struct SweepOptions<'a> {
    /// Regularisation, which is added to the diagonals of Quu and Vxx.
    pub(super) regularisation: f64,
    /// Whether a form may defer the computation of gains: see [`Gains`](super::feedback::Gains).
    pub(super) defers_gains: bool,
    /// Function that computes the curvature of the dynamics; `None` if the dynamics count as linear.
    pub(super) curvature: Option<&'a mut CurvatureFn<'a>>,
    /// Terms of the constraint rows; without them, a knot with rows is an error.
    pub(super) rows: Option<RowTerms<'a>>,
    /// Results that are written for each step.
    pub(super) output: SweepOutput,
}

impl SweepOptions<'_> {
    /// Returns the options of a sweep without curvature of the dynamics and without deferred gains.
    pub(super) fn linear(regularisation: f64) -> Self {
        Self { regularisation, defers_gains: false, curvature: None, rows: None, output: SweepOutput::Gains }
    }
}

/// Step of the Riccati recursion, with its workspace.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(super) work: Workspace,
    /// Whether Vxx is written to the feedback.
    pub(super) keep: bool,
    forms: Forms,
    scaled_rows: ScaledRows,
    /// Storage for the curvature of the dynamics: one Hessian for each number of controls that occurs at knots with
    /// curvature.
    hessians: Vec<Hessian>,
}

impl Step {
    /// Allocates the workspace for knots of the given sizes, with `below` additional rows in H. `curved` lists the
    /// numbers of controls of the knots whose dynamics may have curvature.
    pub(super) fn new(sizes: Sizes, below: usize, mut curved: Vec<usize>) -> Self {
        curved.sort_unstable();
        curved.dedup();
        Self {
            work: Workspace::new(sizes.n, sizes.m, below.max(sizes.rows_below())),
            keep: true,
            forms: Forms::new(sizes),
            scaled_rows: ScaledRows::default(),
            hessians: curved.into_iter().map(|nu| Hessian::zeros(sizes.n, nu)).collect(),
        }
    }

    /// Sweeps `knots`, which begin with knot `first` and end with the terminal knot.
    pub(super) fn run(
        &mut self,
        first: usize,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        options: &mut SweepOptions<'_>,
    ) -> Result<(), SweepError> {
        let last = knots.len() - 1;
        self.work.start(&knots[last]);
        match &options.rows {
            Some(rows) => rows.add_to_value(first + last, &knots[last], &mut self.work),
            None => check_rows(first + last, &knots[last])?,
        }
        self.finish(first + last, &mut feedback[last], options.regularisation)?;
        self.back(first, &knots[..last], feedback, options)
    }

    /// Makes the steps at `knots`, which begin with knot `first`, starting from P and p of the knot that follows
    /// `knots`.
    pub(super) fn back(
        &mut self,
        first: usize,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        options: &mut SweepOptions<'_>,
    ) -> Result<(), SweepError> {
        for (i, (knot, feedback)) in knots.iter().zip(feedback).enumerate().rev() {
            if options.rows.is_none() {
                check_rows(first + i, knot)?;
            }
            self.step(first + i, knot, feedback, options)?;
            self.finish(first + i, feedback, options.regularisation)?;
        }
        Ok(())
    }

    /// Makes one step: replaces P, p of knot t + 1 by P, p of knot t, and writes the gains of knot t.
    fn step(
        &mut self,
        t: usize,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
        options: &mut SweepOptions<'_>,
    ) -> Result<(), SweepError> {
        let Self { work, forms, hessians, scaled_rows, .. } = self;
        let SweepOptions { regularisation, defers_gains, rows, output, .. } = *options;
        let form = forms.of_step(knot, regularisation);
        work.curve(knot.f.as_slice(), feedback.curved_gap.as_mut_slice());
        work.move_by(knot.f.as_slice());
        let ask = options.curvature.as_mut().map(|ask| &mut **ask as &mut CurvatureFn<'_>);
        form.write(work, knot, regularisation, &mut Curvature { knot: t, ask, hessians });
        if let Some(rows) = rows {
            rows.add_to_form(t, knot, form.turn(knot.ndx()), work, scaled_rows);
        }
        let eliminated = form.eliminate(work, knot, feedback).map_err(|(row, pivot)| match pivot.is_finite() {
            true => SweepError::NotPositive { knot: t, row, pivot },
            false => SweepError::NotFinite { knot: t },
        })?;
        work.take_value(work.stride(knot.nu()), eliminated, form.turn(knot.ndx()));
        feedback.gains_deferred = false;
        if output != SweepOutput::Gains {
            let (m, n, turn) = (knot.nu(), knot.ndx(), form.turn(knot.ndx()));
            feedback.factors.copy(View::new(&work.H, work.stride(m)), [m, n], turn);
        }
        if output != SweepOutput::Factors {
            form.write_gains(work, knot, feedback, defers_gains);
        }
        Ok(())
    }

    /// Writes H of a knot, and to the rows below H the product of Θ and the map to δx⁺. Returns the workspace that
    /// contains H, and the rotation of the states in H.
    pub(super) fn write_with_rows_below(
        &mut self,
        knot: &LqKnot,
        regularisation: f64,
        Theta: &[f64],
    ) -> (&mut Workspace, usize) {
        let Self { work, forms, .. } = self;
        let form = forms.of(knot);
        work.move_by(knot.f.as_slice());
        form.write(work, knot, regularisation, &mut Curvature { knot: 0, ask: None, hessians: &mut [] });
        form.write_below(work, knot, Theta);
        (work, form.turn(knot.ndx()))
    }

    /// Adds the regularisation ϱ 1 to Vxx, and writes Vx and Vxx to the feedback of knot t.
    fn finish(&mut self, t: usize, feedback: &mut KnotFeedback, regularisation: f64) -> Result<(), SweepError> {
        match self.work.finish_value(feedback, regularisation, self.keep || t == 0) {
            true => Ok(()),
            false => Err(SweepError::NotFinite { knot: t }),
        }
    }
}

/// Returns an error if knot t has constraint rows, which the recursion does not support.
fn check_rows(t: usize, knot: &LqKnot) -> Result<(), SweepError> {
    if knot.rows.is_empty() { Ok(()) } else { Err(SweepError::ConstraintRows { knot: t }) }
}
