//! Inverse and forward dynamics with their derivatives for several states at a time, in SIMD lanes.

use super::function::Kind;
use condyle::{Batch, Model, batch::Matrices};
use nalgebra::DMatrix;

/// Maximum number of states of a call. These states fill a few SIMD registers, and their matrices fit in the cache.
const MOST: usize = 32;

/// Work space for several states.
pub(super) struct Lanes {
    batch: Batch,
    /// Whether the function is forward dynamics. Otherwise the function is inverse dynamics.
    forward: bool,
}

/// Writes a block of each state to the matrix of this state, beginning at `row` and `column`.
fn place(to: &mut [DMatrix<f64>], row: usize, column: usize, blocks: Matrices<'_, f64>) {
    for (to, block) in to.iter_mut().zip(blocks.iter()) {
        block.copy_to(&mut to.view_mut((row, column), block.shape()));
    }
}

/// Writes the transpose of a block of each state to the matrix of this state, beginning at `row` and `column`.
fn place_transposed(to: &mut [DMatrix<f64>], row: usize, column: usize, blocks: Matrices<'_, f64>) {
    for (to, block) in to.iter_mut().zip(blocks.iter()) {
        let block = block.transpose();
        block.copy_to(&mut to.view_mut((row, column), block.shape()));
    }
}

impl Lanes {
    /// Creates the work space of a function for this number of states. Returns `None` for a single state, and for
    /// functions other than inverse and forward dynamics.
    pub(super) fn new(model: &Model, kind: &Kind, states: usize) -> Option<Self> {
        let forward = matches!(kind, Kind::Aba);
        if states < 2 || !(forward || matches!(kind, Kind::Rnea)) {
            return None;
        }
        Some(Self { batch: Batch::new(model, states.min(MOST), 1), forward })
    }

    /// Returns the maximum number of states of a call.
    pub(super) fn most(&self) -> usize {
        self.batch.capacity()
    }

    /// Computes all results, state by state.
    pub(super) fn value(&mut self, model: &Model, x: &[Vec<f64>], y: &mut [f64]) {
        let (q, v, third) = (&x[0], &x[1], &x[2]);
        y.copy_from_slice(match self.forward {
            true => self.batch.aba(model, q, v, third, &[]),
            false => self.batch.rnea(model, q, v, third, &[]),
        });
    }

    /// Computes the first derivatives of the results of each state with respect to the tangent coordinates of this
    /// state.
    pub(super) fn jacobian(&mut self, model: &Model, x: &[Vec<f64>], J: &mut [DMatrix<f64>]) {
        let (q, v, third, n) = (&x[0], &x[1], &x[2], model.nv());
        let blocks = if self.forward {
            let d = self.batch.aba_derivatives(model, q, v, third, &[]);
            [d.da_dq, d.da_dv, d.da_dtau]
        } else {
            let d = self.batch.rnea_derivatives(model, q, v, third, &[]);
            [d.dtau_dq, d.dtau_dv, d.dtau_da]
        };
        blocks.into_iter().enumerate().for_each(|(k, block)| place(J, 0, k * n, block));
    }

    /// Computes the Hessian of λᵀf for each state, for results f and multipliers λ, and the first derivatives if J is
    /// given.
    pub(super) fn hessian(
        &mut self,
        model: &Model,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut [DMatrix<f64>]>,
        H: &mut [DMatrix<f64>],
    ) {
        if let Some(J) = J {
            self.jacobian(model, x, J);
        }
        let (q, v, third, n) = (&x[0], &x[1], &x[2], model.nv());
        let [dqdq, dvdq, dvdv, dudq] = if self.forward {
            let h = self.batch.aba_hessian(model, q, v, third, &[], lambda);
            [h.dqdq, h.dvdq, h.dvdv, h.dtaudq]
        } else {
            let h = self.batch.rnea_hessian(model, q, v, third, &[], lambda);
            [h.dqdq, h.dvdq, h.dvdv, h.dadq]
        };
        // all blocks that are not written below are zero
        place(H, 0, 0, dqdq);
        place(H, n, 0, dvdq);
        place_transposed(H, 0, n, dvdq);
        place(H, n, n, dvdv);
        place(H, 2 * n, 0, dudq);
        place_transposed(H, 0, 2 * n, dudq);
    }
}
