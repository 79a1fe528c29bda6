//! Structure of a knot's dynamics that makes a sweep faster: blocks of A and B, or equations that replace A and B.
#![allow(non_snake_case)] // names follow the literature: A, B, T, E

use condyle_linalg::{SparseRows, padded};
use nalgebra::DMatrix;
use std::ops::Range;

/// Maximum number of rows of a block: six, as for a free joint.
pub(crate) const LARGEST_BLOCK: usize = 6;

/// Structure of the matrices A and B of an [`LqKnot`](crate::LqKnot).
///
/// The structure is unknown unless the action sets it, each time that the action computes derivatives. Let x = (q, v);
/// a change of q and a change of v have nv entries each. The next state follows from an acceleration a(x, u) by a
/// semi-implicit Euler step:
///
/// ```text
/// v⁺ = v + a Δt,   q⁺ = q ⊕ v⁺ Δt:      A = ⎡ T 0 ⎤ + ⎡ Δt E ⎤ A_v,   B = ⎡ Δt E ⎤ B_v
///                                           ⎣ 0 0 ⎦   ⎣   1  ⎦           ⎣   1  ⎦
/// ```
///
/// where A_v, B_v are the last nv rows of A and B. The matrices T = ∂(q ⊕ δ)/∂q and E = ∂(q ⊕ δ)/∂δ are taken at δ = v⁺
/// Δt. They are the identity, except for one block per joint whose configurations are not a vector space. If the
/// structure is known, a sweep multiplies only by A_v and B_v, with half the operations.
///
/// The action must still write all entries of A and B. A sweep does not check whether A and B have the structure that
/// the action has set.
///
/// # Examples
/// ```
/// use condyle_optimal::LqKnot;
///
/// // One joint: v⁺ = v + 0.1 (u − q), q⁺ = q + 0.1 v⁺.
/// let mut knot = LqKnot::zeros(2, 1);
/// knot.A.copy_from_slice(&[0.99, -0.1, 0.1, 1.0]); // column after column
/// knot.B.copy_from_slice(&[0.01, 0.1]);
/// knot.structure.set_euler(0.1, &[]);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DynamicsStructure {
    /// Time step Δt (s), if the structure is known.
    dt: Option<f64>,
    blocks: Vec<EulerBlock>,
    /// Whether the knot is given as equations of inverse dynamics instead of A and B.
    inverse_dynamics: bool,
}

/// Blocks of T and E for one joint; see [`DynamicsStructure`].
#[derive(Debug, Clone, PartialEq)]
pub struct EulerBlock {
    /// Index of the first row and column of the block.
    pub(crate) start: usize,
    /// Block of T = ∂(q ⊕ δ)/∂q.
    pub T: DMatrix<f64>,
    /// Block of E = ∂(q ⊕ δ)/∂δ.
    pub E: DMatrix<f64>,
}

impl DynamicsStructure {
    /// Sets the structure to unknown. The memory of the blocks is kept.
    pub fn set_dense(&mut self) {
        (self.dt, self.inverse_dynamics) = (None, false);
    }

    /// Marks the knot as given by equations of inverse dynamics, until [`set_dense`](Self::set_dense) is called.
    pub(crate) fn set_inverse_dynamics(&mut self) {
        self.inverse_dynamics = true;
    }

    /// Returns whether the knot is given by equations of inverse dynamics.
    pub(crate) fn is_inverse_dynamics(&self) -> bool {
        self.inverse_dynamics
    }

    /// Sets the structure of semi-implicit Euler steps of `dt` seconds. T and E are the identity, except for blocks:
    /// each of `ranges` gives the rows and columns of one block, at most six. Returns the blocks; the caller must write
    /// them. Allocates the blocks at the first call.
    pub fn set_euler(&mut self, dt: f64, ranges: &[Range<usize>]) -> &mut [EulerBlock] {
        self.dt = Some(dt);
        let fits = |(block, range): (&EulerBlock, &Range<usize>)| block.range() == *range;
        if self.blocks.len() != ranges.len() || !self.blocks.iter().zip(ranges).all(fits) {
            let block = |range: &Range<usize>| {
                let identity = DMatrix::identity(range.len(), range.len());
                EulerBlock { start: range.start, T: identity.clone(), E: identity }
            };
            self.blocks = ranges.iter().map(block).collect();
        }
        &mut self.blocks
    }

    /// Returns Δt and the blocks; `None` if the structure is not semi-implicit Euler.
    pub(crate) fn euler(&self) -> Option<(f64, &[EulerBlock])> {
        Some((self.dt?, &self.blocks))
    }
}

impl EulerBlock {
    /// Returns the range of the rows and columns of the block.
    pub(crate) fn range(&self) -> Range<usize> {
        self.start..self.start + self.T.nrows()
    }
}

/// Equations of inverse dynamics at a knot. Their rows have columns for (w, δv, δq); see
/// [`InverseDynamics`](super::forms::InverseDynamics). The form also reads `r`, `q` and the block of `Q` for δq from
/// the knot; it does not read the knot's `A`, `B`, `S` and `R`.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct InverseDynamicsForm {
    /// Stride: distance between consecutive rows in the buffers of all matrices.
    pub(crate) stride: usize,
    /// Runs of consecutive coordinates whose accelerations are unknowns: [first coordinate, first unknown, number of
    /// coordinates].
    pub(crate) own: Vec<[usize; 3]>,
    /// Coordinates whose accelerations are not unknowns, in ascending order.
    pub(crate) dependent: Vec<usize>,
    /// Matrix U of δu = U (w, δv, δq).
    pub(crate) efforts: SparseRows,
    /// Whether the masks of U are written. The form of small arms does not read them.
    pub(crate) has_masks: bool,
    /// Matrix D of the equations for dependent coordinates, one row for each.
    pub(crate) steps: SparseRows,
    /// Matrix G: its rows are the gradients of residuals that depend on more than δq.
    pub(crate) costs: SparseRows,
    /// First and second derivative of the cost, a′ and a″, with respect to each residual of `costs`.
    pub(crate) slopes: Vec<[f64; 2]>,
    /// Diagonal of Q for δv, followed by the diagonal of R.
    pub(crate) diagonal: Vec<f64>,
}

impl InverseDynamicsForm {
    /// Allocates the form for a knot of nv coordinates and nu controls. `dependent` and `costs` are the maximum numbers
    /// of dependent coordinates and of residual rows.
    pub(crate) fn reserve(&mut self, nv: usize, nu: usize, [dependent, costs]: [usize; 2]) {
        self.stride = padded(nu + 2 * nv);
        self.own.reserve(nv);
        self.dependent.reserve(dependent);
        self.slopes.reserve(costs);
        self.diagonal.resize(nv + nu, 0.0);
        for (rows, most) in [(&mut self.efforts, nu), (&mut self.steps, dependent), (&mut self.costs, costs)] {
            rows.resize(most, self.stride);
        }
    }

    /// Moves U and D to the returned value, so that they can be read while G is written.
    pub(crate) fn lend(&mut self) -> Self {
        let stride = self.stride;
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        core::mem::replace(self, Self { stride, costs, slopes, diagonal, ..Self::default() })
    }

    /// Puts back U and D, which [`lend`](Self::lend) moved out.
    pub(crate) fn take_back(&mut self, lent: Self) {
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        *self = Self { costs, slopes, diagonal, ..lent };
    }

    /// Copies G, whose rows are padded with zeros up to the stride, and the derivatives of the cost with respect to its
    /// residuals.
    pub(crate) fn set_costs(&mut self, rows: &[f64], slopes: &[[f64; 2]]) {
        self.costs.resize(slopes.len(), self.stride);
        self.costs.numbers.copy_from_slice(rows);
        self.slopes.clear();
        self.slopes.extend_from_slice(slopes);
        self.costs.mark(self.stride);
    }
}
