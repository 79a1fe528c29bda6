//! Backward sweep that solves a linear-quadratic problem.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use super::feedback::{Gains, KnotFeedback};
use super::forms::Sizes;
use super::knot::{Hessian, LqKnot};
use super::segments::Segments;
use super::step::{Step, SweepError, SweepOptions};
use crate::error::assert_length;
use condyle_dynamics::level::level;

/// Backward Riccati sweep, with its workspace.
///
/// With the gap as a constant third coordinate, the step of one knot eliminates δu from a quadratic form. Let F = [B A
/// f], and let P, p be the value function of the next knot. Then
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
/// A regularisation ϱ ≥ 0 is added to the diagonals of Quu (before it is factorised) and of Vxx (before the previous
/// knot uses it), as in Crocoddyl.
///
/// A knot whose A and B have the structure of semi-implicit Euler ([`DynamicsStructure`](crate::DynamicsStructure))
/// takes half the operations. With N = (Δt EᵀP₁₁ + P₂₁) T, Π = Δt²EᵀP₁₁E + Δt (EᵀP₁₂ + P₂₁E) + P₂₂, and A_v = [F_q
/// F_v], B_v = G,
///
/// ```text
/// W = (Π [G F_v F_q] + [0 0 N])ᵀ,   H += W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T
/// ```
///
/// When [`Fddp`](crate::Fddp) sweeps a robot's knots, they are given without A and B, as equations of inverse dynamics.
/// Accelerations and contact forces are then eliminated instead of the controls, with the same results. See
/// [`Settings::inverse_dynamics_form`](crate::Settings::inverse_dynamics_form).
///
/// If δu is bounded, k solves the quadratic program of its knot by projected Newton steps (Tassa, Mansard, Todorov,
/// ICRA 2014), and only the controls that are not at a bound are eliminated. The steps start from minus the k of the
/// last run, as in Crocoddyl; the start only matters if two sets of active bounds are equally good.
///
/// The cost of a dense knot is about 2 n²(n + m) + n (n + m)² + m n (n + m)
/// operations for n = ndx, m = nu. Allocates nothing after [`new`](Self::new).
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
    /// Requested number of segments, and the workspaces of the segments if the number is above one.
    at_once: usize,
    segments: Option<Segments>,
    /// Scratch for deferred gains, one for each thread: see [`follow`](Self::follow).
    gains: Vec<Gains>,
    sizes: Sizes,
}

impl Sweep {
    /// Allocates a workspace for problems with the dimensions of `knots`, whose last is the terminal one.
    ///
    /// # Panics
    /// If `knots` is empty, the shapes of a knot do not fit each other, ndx differs from knot to knot, or the terminal
    /// knot has controls.
    #[track_caller]
    pub fn new(knots: &[LqKnot]) -> Self {
        level(); // selected now, because reading CONDYLE_LEVEL allocates
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
    /// threads of the rayon pool in which it is called, or else of the global pool. The number of segments changes the
    /// result only by rounding; the number of threads does not change it at all. With 1 segment, the default, `run`
    /// stays on the caller's thread.
    ///
    /// S segments on S cores take at least as long as 2½ N / (S + 1½) + 1.8 (S − 1) steps of a sweep; one segment takes
    /// N steps. Beyond S = √N this time no longer falls. The following upper limits of the speed-up come from measured
    /// times of the steps (`benches/riccati.rs`), for N = 100 and (ndx, nu) = (76, 32) / (36, 12) / (14, 7). They are
    /// 1.4 / 1.4 / 1.4 with S = 2, 1.9 / 2.0 / 2.0 with S = 4 and 2.5 / 2.6 / 2.8 with S = 8. They exclude the time in
    /// which threads synchronise. Measured on two cores, a solve with S = 2 was 1.25 times as fast as with S = 1 for a
    /// humanoid (5.3 ms per sweep). It was as fast for a quadruped (0.9 ms), and slower for an arm (0.14 ms). On one
    /// core, S segments take 1.3 to 3 times as long as one.
    ///
    /// A sweep with bounds on controls or with curvature of the dynamics nevertheless uses one segment. If segments
    /// lose too many digits, or a segment by itself has no minimum, the sweep is repeated in one segment. To avoid this
    /// repetition, R must be positive definite by itself.
    ///
    /// Sources: Särkkä and García-Fernández, 2023; Jallet, Dantec, Arlaud, Mansard, Carpentier, RSS 2024. Allocates if
    /// the number of segments has changed. `run` does not allocate, except by rayon itself.
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

    /// Resets the sweep, so that the next run starts as if it were the first.
    pub(crate) fn forget(&mut self) {
        for feedback in &mut self.feedback {
            feedback.k.fill(0.0);
        }
    }

    /// Sets whether the next runs write Vxx to the knots.
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
    /// rows. The knots before the failing one then keep their old values; with several segments, some of them may have
    /// new values.
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
    /// called for the second derivatives of λᵀ φₜ, where λ = Vx⁺ + Vxx⁺ f is the gradient of the value function at the
    /// predicted state. `curvature` returns whether it wrote the derivatives.
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

    /// Returns whether the sweep can process knots before all knots are computed; a sweep in several segments cannot.
    pub(crate) fn is_sequential(&self) -> bool {
        self.segments.is_none()
    }

    /// Begins a sweep that receives the knots while they are computed, and defers their gains. Returns the sweep, the
    /// feedback that it writes, and scratch for `threads` threads that compute deferred gains.
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
    /// Whether the next group ends with the terminal knot.
    is_at_end: bool,
}

impl FollowingSweep<'_> {
    /// Sweeps the next group of knots, whose first is knot `first`. The first group ends with the terminal knot.
    ///
    /// # Errors
    /// The same errors as [`Sweep::run`]. The sweep is then over.
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
