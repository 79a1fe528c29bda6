//! Data of a knot: the outputs of its dynamics, the quantities that its residuals read, and workspaces for them.

use super::outputs::{Capabilities, Output};
use super::residuals::layout::ResidualData;
use super::residuals::rows::Row;
use condyle_spatial::block::{Block, Strided, scatter_matrix, scatter_rows};
use nalgebra::DMatrix;

/// Outputs of the dynamics of a knot, and the quantities that its residuals read.
#[derive(Clone, Debug)]
pub(crate) struct KnotData {
    /// q̈, or v⁺ − v at an impact. Shape: nv.
    pub a: Vec<f64>,
    /// τ of all joints. Shape: nv.
    pub tau: Vec<f64>,
    /// λ. Shape: rows.
    pub lambda: Vec<f64>,
    /// Derivatives of q̈ by q, v and what the controls drive: τ, or q̈ itself and λ. Shape: nv × nv, the last with a
    /// column of zeros more for each λ that is a control.
    pub da: [DMatrix<f64>; 3],
    /// Derivatives of λ, written only if a residual reads forces. Shape: rows × nv.
    pub dlambda: [DMatrix<f64>; 3],
    /// Derivatives of τ by q, v and q̈ where the controls drive q̈, else nothing. Shape: nv × nv.
    pub dtau: [DMatrix<f64>; 3],
    /// J q̈ + γ where the controls drive q̈, else nothing. Shape: rows.
    pub contact_acceleration: Vec<f64>,
    /// Derivatives of J q̈ + γ with respect to q, v and q̈; the last is J, and ∂τ/∂λ = −Jᵀ. Shape: rows × nv.
    pub dcontact_acceleration: [DMatrix<f64>; 3],
    /// Equations of motion differentiated, row by row: a [`Tableau`](super::dynamics::kkt_elimination::Tableau).
    pub equations: Vec<f64>,
    /// Number of eliminations that are done in it, up to the number that the robot has: of the limbs, and of the base.
    pub eliminations: usize,
    pub residuals: ResidualData,
}

impl KnotData {
    /// Zeros, with the derivatives of q̈ that are constants if it is the `given` output.
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
            equations: Vec::new(),
            eliminations: 0,
            residuals: ResidualData::default(),
        }
    }
}

/// Knot as its residuals see it.
#[derive(Clone, Copy)]
pub(crate) struct KnotState<'a> {
    pub x: &'a [f64],
    pub u: &'a [f64],
    pub data: &'a KnotData,
}

/// Derivatives of the outputs of a knot by x and u.
pub(crate) trait Sensitivities {
    /// g += c · ∂y_row/∂(u, v, q) for entry `row` of an output y.
    fn add_row(&self, output: Output, row: usize, c: f64, g: &mut Row<'_>);

    /// g += c · ∂u_k/∂(u, v, q) for a control, or for what stands in its place.
    fn add_control(&self, k: usize, c: f64, g: &mut Row<'_>);
}

/// Adds a row of a matrix: g += c X[row, :], for as many columns as g has numbers.
pub(crate) fn add_matrix_row(X: &DMatrix<f64>, row: usize, c: f64, g: &mut [f64]) {
    for (g, column) in g.iter_mut().zip(X.as_slice().chunks_exact(X.nrows())) {
        *g += c * column[row];
    }
}

/// Most knots that a vector has lanes for.
pub(crate) const WIDEST: usize = 8;

/// Returns the part of the data of each knot that is to be written.
pub(crate) fn parts(of: &mut [KnotData], part: impl Fn(&mut KnotData) -> &mut [f64]) -> [&mut [f64]; WIDEST] {
    let mut parts: [&mut [f64]; WIDEST] = Default::default();
    for (to, of) in parts.iter_mut().zip(of) {
        *to = part(of);
    }
    parts
}

/// Writes vectors, with a lane for each knot, to a part of the data of each knot.
pub(crate) fn unpack<S: Block<Number = f64>>(
    from: &[S],
    to: &mut [KnotData],
    part: impl Fn(&mut KnotData) -> &mut [f64],
) {
    let count = to.len();
    scatter_rows(from, &mut parts(to, part)[..count]);
}

/// Writes a matrix of vectors to rows of `stride` numbers in a part of the data of each knot.
pub(crate) fn unpack_matrix<S: Block<Number = f64>>(
    from: &Strided<'_, S>,
    to: &mut [KnotData],
    stride: usize,
    part: impl Fn(&mut KnotData) -> &mut [f64],
) {
    let count = to.len();
    scatter_matrix(from, &mut parts(to, part)[..count], stride);
}

/// Memory in which something computes, made when it is first needed, so that an action costs little to make and to
/// merge with others. A copy makes its own: what was computed in it is not part of what is copied.
#[derive(Debug)]
pub(crate) struct OnDemand<T>(Option<Box<T>>);

impl<T> OnDemand<T> {
    /// Returns the memory; `make` makes it where it is not there.
    pub(crate) fn get(&mut self, make: impl FnOnce() -> T) -> &mut T {
        self.0.get_or_insert_with(|| Box::new(make()))
    }

    /// Returns the memory, if it is there.
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
