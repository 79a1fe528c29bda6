//! Data of a knot: the outputs of its dynamics, the quantities that its residuals read, and workspaces.

use super::outputs::{Capabilities, Output};
use super::residuals::layout::ResidualData;
use super::residuals::rows::Row;
use condyle_linalg::Aligned;
use condyle_spatial::block::{Block, Strided, lanes, scatter_matrix, scatter_rows};
use nalgebra::DMatrix;

/// Outputs of the dynamics of a knot, and the quantities that its residuals read.
#[derive(Clone, Debug)]
pub(crate) struct KnotData {
    /// Accelerations q̈, or the jump v⁺ − v of the velocities at an impact. Shape: nv.
    pub a: Vec<f64>,
    /// Efforts τ of all joints. Shape: nv.
    pub tau: Vec<f64>,
    /// Forces λ of all contacts, or impulses at an impact. Shape: rows.
    pub lambda: Vec<f64>,
    /// Derivatives of q̈ with respect to q, v and the quantity that the controls drive: τ, or q̈ and λ. Shape: nv × nv.
    /// The last matrix has an additional column of zeros for each entry of λ that is a control.
    pub da: [DMatrix<f64>; 3],
    /// Derivatives of λ with respect to the same quantities as in `da`. Written only if a residual reads forces. Shape:
    /// rows × nv.
    pub dlambda: [DMatrix<f64>; 3],
    /// Derivatives of τ with respect to q, v and q̈, if accelerations are controls; empty otherwise. Shape: nv × nv.
    pub dtau: [DMatrix<f64>; 3],
    /// Contact accelerations J q̈ + γ, if accelerations are controls; empty otherwise. Shape: rows.
    pub contact_acceleration: Vec<f64>,
    /// Derivatives of J q̈ + γ with respect to q, v and q̈. The last matrix is J, which also gives ∂τ/∂λ = −Jᵀ. Shape:
    /// rows × nv.
    pub dcontact_acceleration: [DMatrix<f64>; 3],
    /// Derivatives of the equations of motion, row after row, in the layout of a
    /// [`Tableau`](super::dynamics::kkt_elimination::Tableau).
    pub equations: Aligned,
    /// Number of eliminations that are already done in `equations`. The eliminations are, in order, of the limbs and of
    /// the base.
    pub eliminations: usize,
    /// Blocks of T = ∂(q ⊕ δ)/∂q and of E = ∂(q ⊕ δ)/∂δ at the step δ of semi-implicit Euler, column after column, 36
    /// entries for each block. There are two blocks for each joint whose positions are not a vector space.
    pub steps: Vec<f64>,
    pub residuals: ResidualData,
}

impl KnotData {
    /// Creates data of zeros. If `given` is the acceleration, also sets the derivatives of q̈, which are constant.
    pub(crate) fn new(nv: usize, capabilities: &Capabilities, given: Output) -> Self {
        let rows = capabilities.rows();
        let square = || DMatrix::zeros(nv, nv);
        let wide = || DMatrix::zeros(rows, nv);
        let (last, n, controlled) = match given {
            Output::Acceleration => (DMatrix::identity(nv, nv + rows), nv, rows),
            _ => (square(), 0, 0),
        };
        Self {
            a: vec![0.0; nv],
            tau: vec![0.0; nv],
            lambda: vec![0.0; rows],
            da: [square(), square(), last],
            dlambda: [wide(), wide(), wide()],
            dtau: [(); 3].map(|()| DMatrix::zeros(n, n)),
            contact_acceleration: vec![0.0; controlled],
            dcontact_acceleration: [(); 3].map(|()| DMatrix::zeros(controlled, nv)),
            equations: Aligned::default(),
            eliminations: 0,
            steps: Vec::new(),
            residuals: ResidualData::default(),
        }
    }
}

/// State, controls and data of a knot, which its residuals read.
#[derive(Clone, Copy)]
pub(crate) struct KnotState<'a> {
    pub x: &'a [f64],
    pub u: &'a [f64],
    pub data: &'a KnotData,
}

/// Derivatives of the outputs of a knot with respect to x and u.
pub(crate) trait Sensitivities {
    /// Computes g += c · ∂y_row/∂(u, v, q) for entry `row` of an output y.
    fn add_row(&self, output: Output, row: usize, c: f64, g: &mut Row<'_>);

    /// Computes g += c · ∂u_k/∂(u, v, q) for control k, also if another unknown replaces the control.
    fn add_control(&self, k: usize, c: f64, g: &mut Row<'_>);
}

/// Computes g += c X[row, :], for as many columns of X as g has entries.
pub(crate) fn add_matrix_row(X: &DMatrix<f64>, row: usize, c: f64, g: &mut [f64]) {
    for (g, column) in g.iter_mut().zip(X.as_slice().chunks_exact(X.nrows())) {
        *g += c * column[row];
    }
}

/// Maximum number of knots in a batch, which is the maximum number of lanes of a SIMD register.
pub(crate) const WIDEST: usize = 8;

/// Returns a mutable slice for each knot: the part of the knot's data that `part` selects.
pub(crate) fn parts(of: &mut [KnotData], part: impl Fn(&mut KnotData) -> &mut [f64]) -> [&mut [f64]; WIDEST] {
    let mut parts: [&mut [f64]; WIDEST] = Default::default();
    for (to, of) in parts.iter_mut().zip(of) {
        *to = part(of);
    }
    parts
}

/// Writes each lane of `from` to the data of one knot, to the slice that `part` selects.
pub(crate) fn unpack<S: Block<Number = f64>>(
    from: &[S],
    to: &mut [KnotData],
    part: impl Fn(&mut KnotData) -> &mut [f64],
) {
    if S::LANES == 1 {
        part(&mut to[0])[..from.len()].copy_from_slice(lanes(from));
        return;
    }
    let count = to.len();
    scatter_rows(from, &mut parts(to, part)[..count]);
}

/// Writes each lane of the matrix `from` to the data of one knot, to the slice that `part` selects. The rows of this
/// slice have `stride` entries.
pub(crate) fn unpack_matrix<S: Block<Number = f64>>(
    from: &Strided<'_, S>,
    to: &mut [KnotData],
    stride: usize,
    part: impl Fn(&mut KnotData) -> &mut [f64],
) {
    let count = to.len();
    scatter_matrix(from, &mut parts(to, part)[..count], stride);
}

/// Workspace that is allocated at its first use, so that creating and merging actions takes little time. A copy starts
/// without a workspace.
#[derive(Debug)]
pub(crate) struct OnDemand<T>(Option<Box<T>>);

impl<T> OnDemand<T> {
    /// Returns the workspace, which `make` creates at the first call.
    pub(crate) fn get(&mut self, make: impl FnOnce() -> T) -> &mut T {
        self.0.get_or_insert_with(|| Box::new(make()))
    }

    /// Returns the workspace as a mutable reference, if it has been created.
    pub(crate) fn made_mut(&mut self) -> Option<&mut T> {
        self.0.as_deref_mut()
    }

    /// Returns the workspace, if it has been created.
    pub(crate) fn made(&self) -> Option<&T> {
        self.0.as_deref()
    }
}

impl<T> Default for OnDemand<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T> Clone for OnDemand<T> {
    fn clone(&self) -> Self {
        Self::default()
    }
}
