//! Backward sweep that solves a linear-quadratic problem.
#![allow(non_snake_case)] // names follow the literature: A, B, Q, …, K, Vxx

use super::feedback::{Gains, KnotFeedback};
use super::forms::{CurvatureFn, Sizes};
use super::knot::{Hessian, LqKnot};
use super::row_terms::RowTerms;
use super::segments::Segments;
use super::step::{Step, SweepError, SweepOptions, SweepOutput};
use crate::error::assert_length;
use condyle_dynamics::level::level;
use nalgebra::DVector;

/// Backward Riccati sweep, with its workspace.
///
/// The step of one knot eliminates δu from a quadratic form, in which the constant 1 is a third coordinate after δu and
/// δx. Let F = [B A f], and let P, p be the value function of the next knot. Then
///
/// ```text
/// W = (P F)ᵀ,   last row += pᵀ                          P f + p is the gradient at the predicted state
///
///     ⎡ Quu  ·  ⎤   ⎡ R   · ⎤                 ⎡ L  ·         ⎤
/// H = ⎢ Qxu Qxx ⎥ = ⎢ S   Q ⎥ + W [B A]   →   ⎢ X  Vxx       ⎥    L Lᵀ = Quu,  X = Qxu L⁻ᵀ,  Vxx = Qxx − X Xᵀ
///     ⎣ Quᵀ Qxᵀ ⎦   ⎣ rᵀ qᵀ ⎦                 ⎣ yᵀ Vxᵀ       ⎦    y = L⁻¹ Qu,   Vx = Qx − X y
///
/// [K k]ᵀ = −[X; yᵀ] L⁻¹
/// ```
///
/// A regularisation ϱ ≥ 0 is added to the diagonals of Quu (before its factorisation) and of Vxx (before the step of
/// the previous knot uses Vxx), as in Crocoddyl.
///
/// A step takes half the operations if A and B have the structure of semi-implicit Euler
/// ([`DynamicsStructure`](crate::DynamicsStructure)). With N = (Δt EᵀP₁₁ + P₂₁) T, Π = Δt²EᵀP₁₁E + Δt (EᵀP₁₂ + P₂₁E) +
/// P₂₂, and A_v = [F_q F_v], B_v = G,
///
/// ```text
/// W = (Π [G F_v F_q] + [0 0 N])ᵀ,   H += W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T
/// ```
///
/// [`Fddp`](crate::Fddp) passes a robot's knots to the sweep as equations of inverse dynamics, without A and B.
/// Accelerations and contact forces are then eliminated instead of the controls, with the same results. See
/// [`Settings::inverse_dynamics_form`](crate::Settings::inverse_dynamics_form).
///
/// If δu is bounded, k solves the quadratic program of its knot by projected Newton steps (Tassa, Mansard, Todorov,
/// ICRA 2014). Only the controls that are not at a bound are eliminated. The Newton steps start from −k of the last
/// run, as in Crocoddyl. The start changes the result only if two sets of active bounds are equally good.
///
/// A dense knot takes about 2 n²(n + m) + n (n + m)² + m n (n + m) operations, with n = ndx and m = nu. Nothing is
/// allocated after [`new`](Self::new).
///
/// # Examples
/// ```
/// use condyle_optimal::{LqKnot, Sweep};
///
/// // Minimise ½ δu² + δx₁²  with  δx₁ = δx₀ + δu:   δu = −⅔ δx₀,   V₀ = ⅓ δx₀².
/// let mut knots = [LqKnot::zeros(1, 1), LqKnot::zeros(1, 0)];
/// (knots[0].A[0], knots[0].B[0], knots[0].R[0], knots[1].Q[0]) = (1.0, 1.0, 1.0, 2.0);
///
/// let mut sweep = Sweep::new(&knots);
/// sweep.run(&knots, 0.0)?;
/// assert!((sweep.feedback()[0].K[0] + 2.0 / 3.0).abs() < 1e-15);
/// assert!((sweep.feedback()[0].Vxx[0] - 2.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), condyle_optimal::SweepError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sweep {
    feedback: Vec<KnotFeedback>,
    step: Step,
    /// Requested number of segments; the next field contains the workspaces of the segments if this number is above
    /// one.
    at_once: usize,
    segments: Option<Segments>,
    /// Scratch for deferred gains, one element for each thread: see [`follow`](Self::follow).
    gains: Vec<Gains>,
    sizes: Sizes,
}

impl Sweep {
    /// Allocates a workspace for problems with the dimensions of `knots`, the last of which is the terminal knot.
    ///
    /// # Panics
    /// If `knots` is empty, the shapes of a knot do not fit each other, ndx differs between knots, or the terminal knot
    /// has controls.
    #[track_caller]
    pub fn new(knots: &[LqKnot]) -> Self {
        level(); // selects the SIMD level now, because reading CONDYLE_LEVEL allocates
        assert!(!knots.is_empty(), "`knots` is empty, expected at least the terminal knot");
        let terminal = &knots[knots.len() - 1];
        let n = terminal.ndx();
        assert_length("r of the terminal knot", terminal.nu(), 0);
        for knot in knots {
            knot.assert_shapes(n, knot.nu());
        }
        let feedback = knots.iter().map(|knot| KnotFeedback::zeros(n, knot.nu())).collect();
        let sizes = Sizes::of(knots);
        let step = Step::new(sizes, 0, knots.iter().map(LqKnot::nu).collect());
        Self { feedback, step, at_once: 1, segments: None, gains: Vec::new(), sizes }
    }

    /// Sets the number of segments of the horizon that [`run`](Self::run) processes at the same time. `run` uses the
    /// threads of the rayon pool from which it is called, or else of the global pool. The number of segments changes
    /// the result only by rounding errors; the number of threads does not change the result at all. With 1 segment, the
    /// default, `run` uses only the caller's thread.
    ///
    /// S segments on S cores take at least as long as 2½ N / (S + 1½) + 1.8 (S − 1) steps of a sweep; one segment takes
    /// N steps. For S above √N, more segments do not lower this time. The following upper limits of the speed-up follow
    /// from measured times of the steps (`benches/riccati.rs`), for N = 100 and (ndx, nu) = (76, 32) / (36, 12) / (14,
    /// 7). They are 1.4 / 1.4 / 1.4 with S = 2, 1.9 / 2.0 / 2.0 with S = 4 and 2.5 / 2.6 / 2.8 with S = 8. They exclude
    /// the time in which threads synchronise. On two cores, a solve for a humanoid (5.3 ms per sweep) was measured 1.25
    /// times as fast with S = 2 as with S = 1. A solve for a quadruped (0.9 ms) was equally fast, and a solve for an
    /// arm (0.14 ms) was slower. On one core, S segments take 1.3 to 3 times as long as one.
    ///
    /// A sweep with bounds on controls or with curvature of the dynamics always uses one segment. If segments lose too
    /// many digits, or the cost of a segment alone has no minimum, the sweep is repeated in one segment. A positive
    /// definite R avoids this repetition.
    ///
    /// Sources: Särkkä and García-Fernández, 2023; Jallet, Dantec, Arlaud, Mansard, Carpentier, RSS 2024. This method
    /// allocates if the number of segments has changed. `run` does not allocate, except by rayon itself.
    ///
    /// # Panics
    /// If `segments` is 0.
    #[track_caller]
    pub fn set_segments(&mut self, segments: usize) {
        assert!(segments > 0, "`segments` is 0, expected at least 1");
        if segments != self.at_once {
            self.segments = Segments::new(segments, self.feedback.len() - 1, self.sizes);
            self.at_once = segments;
        }
    }

    /// Sets the feed-forward k of all knots to zero. The Newton steps of the next run start from −k.
    pub(crate) fn forget(&mut self) {
        for feedback in &mut self.feedback {
            feedback.k.fill(0.0);
        }
    }

    /// Sets the feed-forward terms from which the Newton steps of the next run start, with the opposite sign.
    pub(crate) fn start_from(&mut self, k: &[DVector<f64>]) {
        for (feedback, k) in self.feedback.iter_mut().zip(k) {
            feedback.k.copy_from(k);
        }
    }

    /// Sets whether the next runs write Vxx to the feedback.
    pub(crate) fn keep_values(&mut self, keep: bool) {
        self.step.keep = keep;
    }

    /// Returns the feedback and value function of each knot, as computed by the last [`run`](Self::run). The terminal
    /// knot has no controls.
    pub fn feedback(&self) -> &[KnotFeedback] {
        &self.feedback
    }

    /// Sweeps from the terminal knot back to the first, with `regularisation` added to the diagonals of Quu and Vxx.
    ///
    /// # Errors
    /// [`SweepError`] if a Quu is not positive definite, the value function is not finite, or a knot has constraint
    /// rows. The results of the knots before the failing knot then keep their old values. With several segments, some
    /// of these results may be new.
    ///
    /// # Panics
    /// If the shapes of `knots` differ from the shapes given to [`new`](Self::new).
    #[track_caller]
    pub fn run(&mut self, knots: &[LqKnot], regularisation: f64) -> Result<(), SweepError> {
        self.check(knots);
        let Self { segments, feedback, step, .. } = self;
        match segments.as_mut().and_then(|segments| segments.run(knots, feedback, regularisation)) {
            Some(result) => result,
            None => step.run(0, knots, feedback, &mut SweepOptions::linear(regularisation)),
        }
    }

    /// Sweeps as [`run`](Self::run) does, for dynamics with curvature. At each knot `curvature(t, λ, hessian)` is
    /// called; it computes the second derivatives of λᵀ φₜ. The vector λ = Vx⁺ + Vxx⁺ f is the gradient of the value
    /// function at the predicted state. `curvature` returns whether it wrote the derivatives.
    ///
    /// # Errors
    /// The same errors as [`run`](Self::run).
    ///
    /// # Panics
    /// The same panics as [`run`](Self::run).
    #[track_caller]
    pub fn run_with(
        &mut self,
        knots: &[LqKnot],
        regularisation: f64,
        mut curvature: impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        self.check(knots);
        let mut options = SweepOptions { curvature: Some(&mut curvature), ..SweepOptions::linear(regularisation) };
        self.step.run(0, knots, &mut self.feedback, &mut options)
    }

    /// Sweeps as [`run`](Self::run) does, with the terms of constraint rows and, if given, the curvature of the
    /// dynamics. Writes the results that `output` selects.
    pub(crate) fn run_with_rows(
        &mut self,
        knots: &[LqKnot],
        regularisation: f64,
        rows: RowTerms<'_>,
        output: SweepOutput,
        curvature: Option<&mut CurvatureFn<'_>>,
    ) -> Result<(), SweepError> {
        let curvature = curvature.map(|ask| ask as &mut CurvatureFn<'_>);
        let rows = Some(rows);
        let mut options = SweepOptions { rows, output, curvature, ..SweepOptions::linear(regularisation) };
        self.step.run(0, knots, &mut self.feedback, &mut options)
    }

    /// Returns whether the sweep can process the last knots before the first ones are computed. A sweep in several
    /// segments cannot.
    pub(crate) fn is_sequential(&self) -> bool {
        self.segments.is_none()
    }

    /// Begins a sweep that receives groups of knots as soon as they are computed, and that defers the gains. Returns
    /// the sweep, the feedback that it writes, and scratch for `threads` threads that compute deferred gains.
    pub(crate) fn follow(&mut self, threads: usize) -> (FollowingSweep<'_>, &mut [KnotFeedback], &mut [Gains]) {
        let Self { feedback, step, gains, sizes, .. } = self;
        gains.resize_with(threads, || Gains::to_finish(sizes.n, sizes.deferred_controls()));
        (FollowingSweep { step, is_at_end: true }, feedback, gains)
    }

    #[track_caller]
    fn check(&self, knots: &[LqKnot]) {
        assert_length("knots", knots.len(), self.feedback.len());
        for (knot, feedback) in knots.iter().zip(&self.feedback) {
            knot.assert_shapes(self.sizes.n, feedback.k.len());
        }
    }
}

/// Sweep that receives the knots in groups, from the last to the first.
pub(crate) struct FollowingSweep<'a> {
    step: &'a mut Step,
    /// Whether the next group is the last group of the horizon, which ends with the terminal knot.
    is_at_end: bool,
}

impl FollowingSweep<'_> {
    /// Sweeps the next group of knots, which begins with knot `first`. The group of the first call ends with the
    /// terminal knot.
    ///
    /// # Errors
    /// The same errors as [`Sweep::run`]. After an error the sweep must not continue.
    pub(crate) fn run(
        &mut self,
        first: usize,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        regularisation: f64,
    ) -> Result<(), SweepError> {
        let options = &mut SweepOptions { defers_gains: true, ..SweepOptions::linear(regularisation) };
        match std::mem::replace(&mut self.is_at_end, false) {
            true => self.step.run(first, knots, feedback, options),
            false => self.step.back(first, knots, feedback, options),
        }
    }
}
