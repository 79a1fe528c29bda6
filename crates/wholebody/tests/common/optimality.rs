//! The conditions of optimality of a step.
#![allow(dead_code, unreachable_pub)] // each test file uses its part

use condyle_wholebody::{Optimality, References, WholeBodyController};

/// Of the conditions of optimality, as [`Optimality`] says.
pub const OPTIMALITY: f64 = 1e-7;
const GAP: f64 = 1e-6;

/// Looks at what the last step of a controller found: its program's first priority.
///
/// # Panics
/// If it is not the optimum, with a text that says where.
pub fn check_optimality(
    controller: &mut WholeBodyController,
    q: &[f64],
    v: &[f64],
    references: &References,
    place: &str,
) {
    let errors = controller.optimality(q, v, references);
    let Optimality { stationarity, primal, dual, complementarity } = errors;
    let good = [stationarity, primal, dual].into_iter().all(|e| e < OPTIMALITY) && complementarity < GAP;
    assert!(good, "{place}: {errors:?}");
}
