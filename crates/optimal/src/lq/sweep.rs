//! The backward sweep that solves a linear-quadratic problem.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use super::gains::Gains;
use super::node::{Hessian, LqKnot, LqNode};
use super::segments::Segments;
use super::step::{Sizes, Step, SweepError};
use crate::error::assert_length;
use condyle_dynamics::level::level;

/// The backward Riccati sweep, with its workspace.
///
/// With the gap as a constant third coordinate, one knot is the elimination of δu from a quadratic form. Let
/// F = [B A f] and P, p the value function of the next knot. Then
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
/// A regularisation ϱ ≥ 0 is added to the diagonals of Quu (before it is factorised) and of Vxx (before it is used by
/// the knot before), as in Crocoddyl.
///
/// A knot whose A and B are those of semi-implicit Euler ([`Structure`](crate::Structure)) takes half the operations: with
/// N = (Δt EᵀP₁₁ + P₂₁) T and Π = Δt²EᵀP₁₁E + Δt (EᵀP₁₂ + P₂₁E) + P₂₂, and A_v = [F_q F_v], B_v = G,
///
/// ```text
/// W = (Π [G F_v F_q] + [0 0 N])ᵀ,   H += W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T
/// ```
///
/// The knots of robots that [`Fddp`](crate::Fddp) sweeps come without A and B, as the equations of inverse dynamics, in
/// which accelerations and contact forces are eliminated in place of the controls; the results are the same. See
/// [`Settings::inverse_dynamics_form`](crate::Settings::inverse_dynamics_form).
///
/// Where δu is bounded, k solves the quadratic program of its knot by projected Newton steps (Tassa, Mansard, Todorov,
/// ICRA 2014), and the elimination is that of the controls that are not at a bound. The steps start from minus the k of
/// the last run, Crocoddyl's choice; it decides nothing but which of two equally good sets of bounds is found.
///
/// The cost of a dense knot is about 2 n²(n + m) + n (n + m)² + m n (n + m)
/// operations for n = ndx, m = nu. Allocates nothing after [`new`](Self::new).
///
/// # Examples
/// ```
/// use condyle_optimal::{LqNode, Sweep};
///
/// // Minimise ½ δu² + δx₁²  with  δx₁ = δx₀ + δu:   δu = −⅔ δx₀,   V₀ = ⅓ δx₀².
/// let mut nodes = [LqNode::zeros(1, 1), LqNode::zeros(1, 0)];
/// (nodes[0].A[0], nodes[0].B[0], nodes[0].R[0], nodes[1].Q[0]) = (1.0, 1.0, 1.0, 2.0);
///
/// let mut sweep = Sweep::new(&nodes);
/// sweep.run(&nodes, 0.0)?;
/// assert!((sweep.knots()[0].K[0] + 2.0 / 3.0).abs() < 1e-15);
/// assert!((sweep.knots()[0].Vxx[0] - 2.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), condyle_optimal::SweepError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sweep {
    knots: Vec<LqKnot>,
    step: Step,
    /// The number of segments that were asked for, and their workspaces, unless it is one.
    at_once: usize,
    segments: Option<Segments>,
    /// See [`parts`](Self::parts).
    gains: Vec<Gains>,
    sizes: Sizes,
}

impl Sweep {
    /// A workspace for problems with the dimensions of `nodes`, of which the last is the terminal one.
    ///
    /// # Panics
    /// If `nodes` is empty, the shapes of a node do not fit each other, ndx differs from node to node, or the terminal
    /// node has controls.
    #[track_caller]
    pub fn new(nodes: &[LqNode]) -> Self {
        level(); // chosen now, as reading CONDYLE_LEVEL allocates
        assert!(!nodes.is_empty(), "`nodes` is empty, expected at least the terminal node");
        let terminal = &nodes[nodes.len() - 1];
        let n = terminal.ndx();
        assert_length("r of the terminal node", terminal.nu(), 0);
        for node in nodes {
            node.assert_shapes(n, node.nu());
        }
        let knots = nodes.iter().map(|node| LqKnot::zeros(n, node.nu())).collect();
        let sizes = Sizes::of(nodes);
        let step = Step::new(sizes, 0, nodes.iter().map(LqNode::nu).collect());
        Self { knots, step, at_once: 1, segments: None, gains: Vec::new(), sizes }
    }

    /// Lets [`run`](Self::run) work on so many segments of the horizon at the same time, in the threads of rayon's pool in
    /// which it is called, else of the global one. What it finds is the same but for rounding, and to the last bit for any
    /// number of threads. With 1, as it is made, it never leaves the caller's thread.
    ///
    /// S segments on as many cores take at least the time of 2½ N / (S + 1½) + 1.8 (S − 1) of the N steps of a sweep as one;
    /// that no longer falls beyond S = √N. From the measured parts (`benches/riccati.rs`), for N = 100 and (ndx, nu) =
    /// (76, 32) / (36, 12) / (14, 7), they could be faster by 1.4 / 1.4 / 1.4 with S = 2, by 1.9 / 2.0 / 2.0 with 4 and by
    /// 2.5 / 2.6 / 2.8 with 8. That leaves out the time in which threads meet: in solves on two cores, S = 2 was faster
    /// by 1.25 for a humanoid (5.3 ms a sweep), as fast for a quadruped (0.9 ms), and slower for an arm (0.14 ms). On one
    /// core S segments are slower than one, by 1.3 to 3 times.
    ///
    /// A sweep with bounds on controls or with curvature of the dynamics is done as one nevertheless. So is one whose
    /// segments lose too many digits or have no minimum of their own, after it was tried in vain: that wants an R that is
    /// positive definite by itself.
    ///
    /// Särkkä and García-Fernández, 2023; Jallet, Dantec, Arlaud, Mansard, Carpentier, RSS 2024. Allocates, if the number is
    /// a new one; `run` does not, but for what rayon does by itself.
    ///
    /// # Panics
    /// If `segments` is 0.
    #[track_caller]
    pub fn set_segments(&mut self, segments: usize) {
        assert!(segments > 0, "`segments` is 0, expected at least 1");
        if segments != self.at_once {
            self.segments = Segments::new(segments, self.knots.len() - 1, self.sizes);
            self.at_once = segments;
        }
    }

    /// Lets the next run start as if it were the first.
    pub(crate) fn forget(&mut self) {
        for knot in &mut self.knots {
            knot.k.fill(0.0);
        }
    }

    /// Sets whether the next runs write Vxx to the knots.
    pub(crate) fn keep_values(&mut self, keep: bool) {
        self.step.keep = keep;
    }

    /// The feedback and value function of each knot, as the last [`run`](Self::run) left them; the terminal one has no
    /// controls.
    pub fn knots(&self) -> &[LqKnot] {
        &self.knots
    }

    /// Sweeps from the terminal node back to the first, with `regularisation` added to the diagonals of Quu and Vxx.
    ///
    /// # Errors
    /// [`SweepError`] if a Quu is not positive definite or the value function not finite; the knots before that one
    /// then keep their old values, but in segments some may have new ones.
    ///
    /// # Panics
    /// If the shapes of `nodes` are not those given to [`new`](Self::new).
    #[track_caller]
    pub fn run(&mut self, nodes: &[LqNode], regularisation: f64) -> Result<(), SweepError> {
        self.check(nodes);
        let Self { segments, knots, .. } = self;
        match segments.as_mut().and_then(|segments| segments.run(nodes, knots, regularisation)) {
            Some(result) => result,
            None => self.run_with(nodes, regularisation, |_, _, _| false),
        }
    }

    /// As [`run`](Self::run), for dynamics that curve: `curvature(t, λ, hessian)` is asked at each knot for the second
    /// derivatives of λᵀ φₜ, where λ = Vx⁺ + Vxx⁺ f is the gradient of the value function at the predicted state, and says
    /// whether it wrote them.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    ///
    /// # Panics
    /// As [`run`](Self::run).
    #[track_caller]
    pub fn run_with(
        &mut self,
        nodes: &[LqNode],
        regularisation: f64,
        mut curvature: impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        self.check(nodes);
        self.step.puts_off = false;
        self.step.run(0, nodes, &mut self.knots, regularisation, &mut curvature)
    }

    /// Whether a sweep can go from knot to knot as they are made: one that is not cut into segments.
    pub(crate) fn is_sequential(&self) -> bool {
        self.segments.is_none()
    }

    /// What a sweep as a sequence consists of: its steps, of which the first is [`Step::run`] at the terminal node and the
    /// others [`Step::back`], what it finds, and scratch in which `threads` threads write the gains that the steps put off.
    pub(crate) fn parts(&mut self, threads: usize) -> (&mut Step, &mut [LqKnot], &mut [Gains]) {
        let Self { knots, step, gains, sizes, .. } = self;
        gains.resize_with(threads, || Gains::to_finish(sizes.n, sizes.solved_controls()));
        step.puts_off = true;
        (step, knots, gains)
    }

    #[track_caller]
    fn check(&self, nodes: &[LqNode]) {
        assert_length("nodes", nodes.len(), self.knots.len());
        for (node, knot) in nodes.iter().zip(&self.knots) {
            node.assert_shapes(self.sizes.n, knot.k.len());
        }
    }
}
