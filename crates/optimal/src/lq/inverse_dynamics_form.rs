//! Equations of a knot in which accelerations and contact forces replace the controls.

use condyle_linalg::{SLACK, SparseRows};

/// Rows of a knot over (w, δv, δq); see [`InverseDynamics`](super::forms::InverseDynamics). `r`, `q` and the block of
/// `Q` for δq are taken from the knot; its `A`, `B`, `S` and `R` are not used.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct InverseDynamicsForm {
    /// Distance between consecutive rows, the same for all rows.
    pub(crate) stride: usize,
    /// Runs of coordinates that are unknowns: the first coordinate, the first unknown, and the number of both.
    pub(crate) own: Vec<[usize; 3]>,
    /// Other coordinates, in ascending order.
    pub(crate) dependent: Vec<usize>,
    /// U: δu = U (w, δv, δq). Its masks are not written, because not every form reads them.
    pub(crate) efforts: SparseRows,
    /// D, one row for each dependent coordinate.
    pub(crate) steps: SparseRows,
    /// G: the gradients of residuals that depend on more than δq.
    pub(crate) costs: SparseRows,
    /// a′ and a″, first and second derivative of the cost with respect to each of these residuals.
    pub(crate) slopes: Vec<[f64; 2]>,
    /// Diagonals of Q for δv and of R, one after the other.
    pub(crate) diagonal: Vec<f64>,
}

impl InverseDynamicsForm {
    /// Allocates the form for a knot of nv coordinates and nu controls, with a maximum number of dependent coordinates
    /// and of rows of costs.
    pub(crate) fn reserve(&mut self, nv: usize, nu: usize, [dependent, costs]: [usize; 2]) {
        self.stride = nu + 2 * nv + SLACK;
        self.own.reserve(nv);
        self.dependent.reserve(dependent);
        self.slopes.reserve(costs);
        self.diagonal.resize(nv + nu, 0.0);
        for (rows, most) in [(&mut self.efforts, nu), (&mut self.steps, dependent), (&mut self.costs, costs)] {
            rows.resize(most, self.stride);
        }
    }

    /// Takes U and D out while G is being written.
    pub(crate) fn lend(&mut self) -> Self {
        let stride = self.stride;
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        core::mem::replace(self, Self { stride, costs, slopes, diagonal, ..Self::default() })
    }

    /// Puts back the parts that [`lend`](Self::lend) took out.
    pub(crate) fn take_back(&mut self, lent: Self) {
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        *self = Self { costs, slopes, diagonal, ..lent };
    }

    /// Copies G.
    pub(crate) fn set_costs(&mut self, rows: &[f64], slopes: &[[f64; 2]]) {
        self.costs.resize(slopes.len(), self.stride);
        for (to, from) in self.costs.numbers.chunks_exact_mut(self.stride).zip(rows.chunks_exact(self.stride)) {
            to[..self.stride - SLACK].copy_from_slice(&from[..self.stride - SLACK]);
        }
        self.slopes.clear();
        self.slopes.extend_from_slice(slopes);
        self.costs.mark(self.stride);
    }
}
