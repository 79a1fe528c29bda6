//! Check of the optimality conditions after a step.
#![allow(dead_code, unreachable_pub)] // each test file uses only some of the functions

use condyle_wholebody::{KktResiduals, References, WholeBodyController};

/// Tolerance of the first three errors in [`KktResiduals`]. The documentation of this type gives the reason for
/// 1e-7.
pub const OPTIMALITY: f64 = 1e-7;
const GAP: f64 = 1e-6;

/// Checks that a controller's last step found the optimum of the first priority's program.
///
/// # Panics
/// If the step did not find the optimum; the message contains `place`.
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
