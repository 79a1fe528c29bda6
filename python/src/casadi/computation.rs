//! What a slot computes: results of arguments, and their derivatives by tangent vectors, for a state or for several at a time.
//! Knows nothing of CasADi.

use super::chart::Chart;
use condyle::ModelError as Error;
use nalgebra::DMatrix;

/// A result: a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Output {
    pub(super) name: &'static str,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// A function of vectors. The leading numbers of the first argument may be a position, as the chart says; derivatives are
/// taken by the tangent vector there and by all other numbers, in the order of the arguments.
pub(super) trait Computation: Send + Sync {
    /// The names and sizes of the arguments.
    fn arguments(&self) -> Vec<(&'static str, usize)>;

    /// The results.
    fn outputs(&self) -> Vec<Output>;

    /// The position in the first argument.
    fn chart(&self) -> Chart;

    /// Whether an entry of result k may differ from zero.
    fn present(&self, k: usize, i: usize, j: usize) -> bool {
        let _ = (k, i, j);
        true
    }

    /// Whether a first derivative may differ from zero: of number `row` of all results by tangent coordinate j.
    fn depends(&self, row: usize, j: usize) -> bool;

    /// Whether a second derivative of λᵀf by two tangent coordinates may differ from zero.
    fn curves(&self, i: usize, j: usize) -> bool;

    /// What a call for so many states computes in; there are as many as calls at the same time.
    fn calls(&self, states: usize) -> Result<Box<dyn Calls>, Error>;
}

/// Calls of a function, one after the other, each for a state or for several of them: their arguments and results stand state
/// after state, and there is a matrix for each.
pub(super) trait Calls: Send {
    /// The most states of a call.
    fn most(&self) -> usize {
        1
    }

    /// All results, one after the other, each by columns.
    fn value(&mut self, x: &[Vec<f64>], y: &mut [f64]);

    /// The first derivatives of all results by all tangent coordinates.
    fn jacobian(&mut self, x: &[Vec<f64>], J: &mut [DMatrix<f64>]);

    /// The Hessian of λᵀf by all tangent coordinates, and the first derivatives if they are wanted.
    fn hessian(
        &mut self,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut [DMatrix<f64>]>,
        H: &mut [DMatrix<f64>],
    ) -> Result<(), Error>;
}
