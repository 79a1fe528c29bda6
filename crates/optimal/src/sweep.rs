//! The backward sweep that solves a linear-quadratic problem.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use crate::error::assert_length;
use crate::lq::{Hessian, LqKnot, LqNode};
use crate::riccati::Work;
use crate::vector::{Dense, Vector, at_level};

/// Why a sweep stopped before the first knot.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// Quu has a pivot that is not positive: the problem is not convex in the control there. More regularisation helps.
    #[error("knot {knot}: Quu is not positive definite (pivot {row} is {pivot:e})")]
    NotPositive {
        /// The knot.
        knot: usize,
        /// The row of the pivot.
        row: usize,
        /// Its value.
        pivot: f64,
    },
    /// The value function is infinite, NaN, or beyond 1e30.
    #[error("knot {knot}: the value function is not finite")]
    NotFinite {
        /// The knot.
        knot: usize,
    },
}

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
    /// What one step reads and writes beside its knot.
    work: Work,
    /// Whether the knots shall have their Vxx.
    keep: bool,
}

impl Sweep {
    /// A workspace for problems with the dimensions of `nodes`, of which the last is the terminal one.
    ///
    /// # Panics
    /// If `nodes` is empty, the shapes of a node do not fit each other, ndx differs from node to node, or the terminal
    /// node has controls.
    pub fn new(nodes: &[LqNode]) -> Self {
        let terminal = nodes.last().expect("`nodes` is empty");
        let n = terminal.ndx();
        assert_length("r of the terminal node", terminal.nu(), 0);
        let m = nodes.iter().map(LqNode::nu).max().unwrap_or(0);
        let knots = nodes.iter().map(|node| {
            node.assert_shapes(n, node.nu());
            LqKnot::zeros(n, node.nu())
        });
        Self { work: Work::new(nodes, n, m), knots: knots.collect(), keep: true }
    }

    /// Lets the next run start as if it were the first.
    pub(crate) fn forget(&mut self) {
        for knot in &mut self.knots {
            knot.k.fill(0.0);
        }
    }

    /// Whether the next runs shall write Vxx to the knots, for those that look at it.
    pub(crate) fn keep_values(&mut self, keep: bool) {
        self.keep = keep;
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
    /// then keep their old values.
    ///
    /// # Panics
    /// If the shapes of `nodes` are not those given to [`new`](Self::new).
    pub fn run(&mut self, nodes: &[LqNode], regularisation: f64) -> Result<(), SweepError> {
        self.run_with(nodes, regularisation, |_, _, _| false)
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
    pub fn run_with(
        &mut self,
        nodes: &[LqNode],
        regularisation: f64,
        curvature: impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        assert_length("nodes", nodes.len(), self.knots.len());
        for (node, knot) in nodes.iter().zip(&self.knots) {
            node.assert_shapes(self.work.p.len(), knot.k.len());
        }
        let mut result = Ok(());
        at_level(Run { sweep: self, nodes, regularisation, curvature, result: &mut result });
        result
    }
}

/// A run, to be compiled for the processor.
struct Run<'a, F> {
    sweep: &'a mut Sweep,
    nodes: &'a [LqNode],
    regularisation: f64,
    curvature: F,
    result: &'a mut Result<(), SweepError>,
}

impl<F: FnMut(usize, &[f64], &mut Hessian) -> bool> Dense for Run<'_, F> {
    #[inline(always)]
    fn run<V: Vector, const NR: usize>(self) {
        let Self { sweep: Sweep { knots, work, keep }, nodes, regularisation, mut curvature, result } = self;
        let mut t = nodes.len() - 1;
        work.start(&nodes[t]);
        *result = work.finish_value::<V>(t, &mut knots[t], regularisation, *keep);
        while result.is_ok() && t > 0 {
            t -= 1;
            *result = work.step::<V, NR>(t, &nodes[t], &mut knots[t], regularisation, &mut curvature);
            if result.is_ok() {
                *result = work.finish_value::<V>(t, &mut knots[t], regularisation, *keep);
            }
        }
    }
}
