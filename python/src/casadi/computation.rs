//! The computation that a slot performs: results, and their derivatives with respect to tangent vectors, for one or
//! several states at a time. This file does not depend on CasADi.

use super::chart::Chart;
use condyle::ModelError as Error;
use nalgebra::DMatrix;

/// Name and shape of a result; every result is a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Output {
    pub(super) name: &'static str,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// A function of vectors. The first argument may begin with a position, which `chart` describes. Derivatives are taken
/// with respect to the tangent vector at this position and to all other numbers, in the order of the arguments.
pub(super) trait Computation: Send + Sync {
    /// Returns the names and sizes of the arguments.
    fn arguments(&self) -> Vec<(&'static str, usize)>;

    /// Returns names and shapes of the results.
    fn outputs(&self) -> Vec<Output>;

    /// Returns the chart of the position in the first argument.
    fn chart(&self) -> Chart;

    /// Returns whether an entry of result k may differ from zero.
    fn present(&self, k: usize, i: usize, j: usize) -> bool {
        let _ = (k, i, j);
        true
    }

    /// Returns whether a first derivative may differ from zero: the derivative of the number with index `row` among the
    /// numbers of all results, with respect to tangent coordinate j.
    fn depends(&self, row: usize, j: usize) -> bool;

    /// Returns whether the second derivative of λᵀf with respect to tangent coordinates i and j may differ from zero,
    /// for results f and multipliers λ.
    fn curves(&self, i: usize, j: usize) -> bool;

    /// Returns a work space for calls with this number of states. Each of several simultaneous calls needs its own work
    /// space.
    fn calls(&self, states: usize) -> Result<Box<dyn Calls>, Error>;
}

/// Work space for calls of a function, each for one or several states. Arguments and results are stored state by state;
/// each state has its own matrix of derivatives.
pub(super) trait Calls: Send {
    /// Returns the maximum number of states of a call.
    fn most(&self) -> usize {
        1
    }

    /// Computes all results. Writes the results to `y` one after the other, each result column by column.
    fn value(&mut self, x: &[Vec<f64>], y: &mut [f64]);

    /// Computes the first derivatives of all results with respect to all tangent coordinates.
    fn jacobian(&mut self, x: &[Vec<f64>], J: &mut [DMatrix<f64>]);

    /// Computes the Hessian of λᵀf with respect to all tangent coordinates, for results f and multipliers λ. Also
    /// computes the first derivatives if J is given.
    fn hessian(
        &mut self,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut [DMatrix<f64>]>,
        H: &mut [DMatrix<f64>],
    ) -> Result<(), Error>;
}
