//! Optimality conditions of a step.
#![allow(dead_code, unreachable_pub)] // each test file uses its part

use condyle_wholebody::{KktResiduals, References, WholeBodyController};

/// Tolerance of the optimality conditions, as described at [`KktResiduals`].
pub const OPTIMALITY: f64 = 1e-7;
const GAP: f64 = 1e-6;

/// Checks the result of a controller's last step, for its program's first priority.
///
/// # Panics
/// If it is not the optimum; the message contains `place`.
pub fn check_optimality(
    controller: &mut WholeBodyController,
    q: &[f64],
    v: &[f64],
    references: &References,
    place: &str,
) {
    let errors = controller.kkt_residuals(q, v, references);
    let KktResiduals { stationarity, primal, dual, complementarity } = errors;
    let good = [stationarity, primal, dual].into_iter().all(|e| e < OPTIMALITY) && complementarity < GAP;
    assert!(good, "{place}: {errors:?}");
}
