//! The linear-quadratic problem, all that a solver sees of a horizon, and the backward sweep that solves it.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use crate::box_qp::BoxQp;
use crate::dense::{SLACK, add_product_lower, add_scaled_product, eliminate, product_transposed, solve_right};
use crate::error::assert_length;
use nalgebra::{DMatrix, DVector};

/// Beyond this a value has diverged and the sweep or the trial is given up.
pub(crate) const DIVERGED: f64 = 1e30;

/// One knot of a linear-quadratic problem in the changes δx (ndx), δu (nu):
///
/// ```text
/// minimise   Σₜ ½ δxᵀQδx + δxᵀSδu + ½ δuᵀRδu + qᵀδx + rᵀδu    subject to   δx⁺ = A δx + B δu + f
/// ```
///
/// and to lower ≤ δu ≤ upper. Q and R are symmetric, with both triangles filled. At the terminal knot (nu = 0) only Q
/// and q are read.
#[derive(Debug, Clone, PartialEq)]
pub struct LqNode {
    /// ∂x⁺/∂x, ndx × ndx.
    pub A: DMatrix<f64>,
    /// ∂x⁺/∂u, ndx × nu.
    pub B: DMatrix<f64>,
    /// The gap: the predicted next state ⊖ the next state of the trajectory, ndx. Written by the solver.
    pub f: DVector<f64>,
    /// ∂²ℓ/∂x², ndx × ndx.
    pub Q: DMatrix<f64>,
    /// ∂²ℓ/∂x∂u, ndx × nu.
    pub S: DMatrix<f64>,
    /// ∂²ℓ/∂u², nu × nu.
    pub R: DMatrix<f64>,
    /// ∂ℓ/∂x, ndx.
    pub q: DVector<f64>,
    /// ∂ℓ/∂u, nu.
    pub r: DVector<f64>,
    /// Least δu, nu; −∞ for none. Written by the solver.
    pub lower: DVector<f64>,
    /// Greatest δu, nu; ∞ for none. Written by the solver.
    pub upper: DVector<f64>,
}

impl LqNode {
    /// A knot of zeros with ndx states and nu controls without bounds.
    pub fn zeros(ndx: usize, nu: usize) -> Self {
        Self {
            A: DMatrix::zeros(ndx, ndx),
            B: DMatrix::zeros(ndx, nu),
            f: DVector::zeros(ndx),
            Q: DMatrix::zeros(ndx, ndx),
            S: DMatrix::zeros(ndx, nu),
            R: DMatrix::zeros(nu, nu),
            q: DVector::zeros(ndx),
            r: DVector::zeros(nu),
            lower: DVector::from_element(nu, f64::NEG_INFINITY),
            upper: DVector::from_element(nu, f64::INFINITY),
        }
    }

    /// The number of states, ndx.
    pub fn ndx(&self) -> usize {
        self.q.len()
    }

    /// The number of controls, nu.
    pub fn nu(&self) -> usize {
        self.r.len()
    }

    /// Whether a control has a bound.
    fn is_bounded(&self) -> bool {
        self.lower.iter().chain(&self.upper).any(|bound| bound.is_finite())
    }

    /// Panics with the name of the first field whose shape does not fit q and r.
    #[track_caller]
    fn assert_shapes(&self, ndx: usize, nu: usize) {
        assert_length("q", self.q.len(), ndx);
        assert_length("r", self.r.len(), nu);
        assert_length("f", self.f.len(), ndx);
        assert_length("lower", self.lower.len(), nu);
        assert_length("upper", self.upper.len(), nu);
        for (name, matrix, shape) in [
            ("A", &self.A, (ndx, ndx)),
            ("B", &self.B, (ndx, nu)),
            ("Q", &self.Q, (ndx, ndx)),
            ("S", &self.S, (ndx, nu)),
            ("R", &self.R, (nu, nu)),
        ] {
            assert!(matrix.shape() == shape, "`{name}` has shape {:?}, expected {shape:?}", matrix.shape());
        }
    }
}

/// What the sweep finds at one knot: the feedback δu = k + K δx, and the value function
/// V(δx) = ½ δxᵀ Vxx δx + Vxᵀ δx + const of the rest of the horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct LqKnot {
    /// Feedback gain −Quu⁻¹ Qux, nu × ndx; zero for a control at its bound.
    pub K: DMatrix<f64>,
    /// Feed-forward −Quu⁻¹ Qu, nu; with bounds, the δu that is best at δx = 0.
    pub k: DVector<f64>,
    /// Gradient of the value function at δx = 0, ndx.
    pub Vx: DVector<f64>,
    /// Hessian of the value function, with the regularisation on its diagonal; ndx × ndx, symmetric.
    pub Vxx: DMatrix<f64>,
    /// r + Bᵀ(Vx⁺ + Vxx⁺ f), nu; zero for a control at its bound.
    pub Qu: DVector<f64>,
    /// R + BᵀVxx⁺B with the regularisation on its diagonal; nu × nu, symmetric.
    pub Quu: DMatrix<f64>,
}

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
/// Where δu is bounded, k solves the quadratic program of its knot by projected Newton steps (Tassa, Mansard, Todorov,
/// ICRA 2014), and the elimination is that of the controls that are not at a bound. The steps start from minus the k of
/// the last run, Crocoddyl's choice; it decides nothing but which of two equally good sets of bounds is found.
///
/// The cost of a knot is about 2 n²(n + m) + n (n + m)² + m n (n + m) operations
/// for n = ndx, m = nu. Allocates nothing after [`new`](Self::new).
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
    /// Vxx⁺, symmetric and full. Stride n + SLACK.
    P: Vec<f64>,
    /// Vx⁺, and then Vx⁺ + Vxx⁺ f.
    p: Vec<f64>,
    /// [P B, P A, P f + p]ᵀ. Stride: see `stride`.
    W: Vec<f64>,
    /// The quadratic form; stride as W.
    H: Vec<f64>,
    /// Lᵀ for the back substitution.
    upper: Vec<f64>,
    /// n zeros.
    zero: Vec<f64>,
    qp: BoxQp,
}

/// The stride of W and H with their m + n + 1 rows.
fn stride(n: usize, m: usize) -> usize {
    m + n + 1 + SLACK
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
            LqKnot {
                K: DMatrix::zeros(node.nu(), n),
                k: DVector::zeros(node.nu()),
                Vx: DVector::zeros(n),
                Vxx: DMatrix::zeros(n, n),
                Qu: DVector::zeros(node.nu()),
                Quu: DMatrix::zeros(node.nu(), node.nu()),
            }
        });
        Self {
            knots: knots.collect(),
            P: vec![0.0; (n + SLACK) * n],
            p: vec![0.0; n],
            W: vec![0.0; stride(n, m) * n],
            H: vec![0.0; stride(n, m) * (m + n)],
            upper: vec![0.0; (m + SLACK) * m],
            zero: vec![0.0; n],
            qp: BoxQp::new(m),
        }
    }

    /// Lets the next run start as if it were the first.
    pub(crate) fn forget(&mut self) {
        for knot in &mut self.knots {
            knot.k.fill(0.0);
        }
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
        assert_length("nodes", nodes.len(), self.knots.len());
        for (node, knot) in nodes.iter().zip(&self.knots) {
            node.assert_shapes(self.zero.len(), knot.k.len());
        }
        let terminal = nodes.len() - 1;
        self.start(&nodes[terminal]);
        self.finish_value(terminal, regularisation)?;
        for t in (0..terminal).rev() {
            self.step(t, &nodes[t], regularisation)?;
            self.finish_value(t, regularisation)?;
        }
        Ok(())
    }

    /// V = ½ δxᵀ Q δx + qᵀ δx at the terminal knot.
    fn start(&mut self, node: &LqNode) {
        let n = node.ndx();
        self.p.copy_from_slice(node.q.as_slice());
        for (column, q) in self.P.chunks_exact_mut(n + SLACK).zip(node.Q.as_slice().chunks_exact(n)) {
            column[..n].copy_from_slice(q);
        }
    }

    /// One Riccati step: P, p of knot t + 1 become those of knot t, and the gains of knot t are written.
    fn step(&mut self, t: usize, node: &LqNode, regularisation: f64) -> Result<(), SweepError> {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, rows, last) = (stride(n, m), m + n + 1, m + n);
        let (A, B) = (node.A.as_slice(), node.B.as_slice());
        let Self { knots, P, p, W, H, upper, zero, qp } = self;
        let knot = &mut knots[t];
        // Strides differ from knot to knot with nu; the slack rows must hold zeros, whatever the last knot left there.
        for k in 0..n {
            W[k * ld + last + 1..(k + 1) * ld].fill(0.0);
        }

        // W = [P B, P A, P f + p]ᵀ
        product_transposed(W, ld, 0, P, n + SLACK, B, m, zero);
        product_transposed(W, ld, m, P, n + SLACK, A, n, zero);
        for (column, f) in P.chunks_exact(n + SLACK).zip(&node.f).filter(|(_, f)| **f != 0.0) {
            add_scaled_product(p, *f, &column[..n], &[1.0]);
        }
        for (k, p) in p.iter().enumerate() {
            W[k * ld + last] = *p;
        }

        // H = [R ·; S Q; rᵀ qᵀ] + W [B A]
        for j in 0..m {
            let column = &mut H[j * ld..(j + 1) * ld];
            column[..m].copy_from_slice(&node.R.as_slice()[j * m..][..m]);
            column[m..last].copy_from_slice(&node.S.as_slice()[j * n..][..n]);
            column[last] = node.r[j];
            column[rows..].fill(0.0);
        }
        for j in 0..n {
            let column = &mut H[(m + j) * ld..(m + j + 1) * ld];
            column[m..last].copy_from_slice(&node.Q.as_slice()[j * n..][..n]);
            column[last] = node.q[j];
            column[rows..].fill(0.0);
        }
        add_product_lower(H, W, ld, rows, 0, B, m, zero);
        add_product_lower(H, W, ld, rows, m, A, n, zero);

        // Quu += ϱ I
        for j in 0..m {
            H[j * ld + j] += regularisation;
            knot.Qu[j] = H[j * ld + last];
            for i in j..m {
                (knot.Quu[(i, j)], knot.Quu[(j, i)]) = (H[j * ld + i], H[j * ld + i]);
            }
        }

        let failed = |row: usize, pivot: f64| match pivot.is_finite() {
            true => SweepError::NotPositive { knot: t, row, pivot },
            false => SweepError::NotFinite { knot: t },
        };
        // The controls that are eliminated: those not at a bound.
        let bounded = node.is_bounded();
        let free = if bounded {
            let (lower, upper) = (node.lower.as_slice(), node.upper.as_slice());
            let start = knot.k.iter().map(|k| -k);
            qp.solve(&knot.Quu, knot.Qu.as_slice(), lower, upper, start).map_err(|(row, pivot)| failed(row, pivot))?;
            keep_free(H, ld, rows, m, n, &qp.free);
            qp.free.len()
        } else {
            m
        };
        let control = |j: usize| if bounded { qp.free[j] } else { j };

        // L Lᵀ = Quu,   X = Qxu L⁻ᵀ,   Vxx = Qxx − X Xᵀ,   Vx = Qx − X y
        let rows = free + n + 1;
        eliminate(H, ld, rows, free + n, free).map_err(|(row, pivot)| failed(control(row), pivot))?;
        for j in 0..n {
            let column = &H[(free + j) * ld + free..];
            p[j] = column[n];
            for i in j..n {
                P[j * (n + SLACK) + i] = column[i];
                P[i * (n + SLACK) + j] = column[i];
            }
        }

        // [K k]ᵀ = −[X; yᵀ] L⁻¹
        solve_right(H, ld, free, rows, free, upper);
        if bounded {
            knot.K.fill(0.0);
            knot.k.copy_from_slice(&qp.x[..m]);
            for j in (0..m).filter(|j| qp.free.binary_search(j).is_err()) {
                knot.Qu[j] = 0.0;
            }
        }
        for j in 0..free {
            let column = &H[j * ld + free..][..n + 1];
            for i in 0..n {
                knot.K[(control(j), i)] = -column[i];
            }
            if !bounded {
                knot.k[j] = -column[n];
            }
        }
        Ok(())
    }

    /// Vxx += ϱ I, and out to the knot with both if they are finite.
    fn finish_value(&mut self, t: usize, regularisation: f64) -> Result<(), SweepError> {
        let n = self.p.len();
        let knot = &mut self.knots[t];
        knot.Vx.as_mut_slice().copy_from_slice(&self.p);
        for j in 0..n {
            let column = &mut self.P[j * (n + SLACK)..][..n];
            column[j] += regularisation;
            knot.Vxx.as_mut_slice()[j * n..][..n].copy_from_slice(column);
        }
        let finite = |x: &[f64]| x.iter().all(|x| x.abs() < DIVERGED); // false for NaN
        if finite(knot.Vx.as_slice()) && finite(knot.Vxx.as_slice()) {
            Ok(())
        } else {
            Err(SweepError::NotFinite { knot: t })
        }
    }
}

/// Moves the rows and columns of the `free` ones of m controls to the front of H, and what follows up behind them.
fn keep_free(H: &mut [f64], stride: usize, rows: usize, m: usize, n: usize, free: &[usize]) {
    let kept = free.len();
    for (to, from) in free.iter().copied().chain(m..m + n).enumerate() {
        for (row, &i) in free.iter().enumerate() {
            H[to * stride + row] = H[from * stride + i];
        }
        H.copy_within(from * stride + m..from * stride + rows, to * stride + kept);
        H[to * stride + kept + rows - m..(to + 1) * stride].fill(0.0);
    }
}
