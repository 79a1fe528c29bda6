//! Limits that a planned motion meets: which bounds are reached, at which knots, and with which multipliers.

use crate::limits::{EFFORTS, Limited, STATES, limited};
use crate::motion::Plan;
use condyle::optimal::{Outcome, Violation, ViolationKind};
use serde::Serialize;

/// Maximum violation of a limit that still counts as held (rad, rad/s, m, m/s, N m, N), and maximum gap of the
/// dynamics. It is half of `report::ROUNDING`.
pub(crate) const HELD: f64 = 5e-6;

/// Largest distance from a bound at which the bound counts as reached, relative to the range of the quantity. With one
/// bound, the range is the absolute value of the bound, and at least 1.
const REACHED: f64 = 1e-3;

/// Result of a solve with the limits as constraints.
pub(crate) struct Held {
    pub outcome: Outcome,
    /// Multipliers of each knot, one for each degree of freedom: positions, velocities, and efforts. A multiplier is 0
    /// where a quantity has no limit. Unit: cost per unit of the quantity.
    multipliers: [Vec<Vec<f64>>; 3],
}

impl Held {
    /// Reads the multipliers of an outcome, for a robot with `nv` degrees of freedom. The last degrees of freedom have
    /// motors.
    pub(crate) fn new(outcome: Outcome, nv: usize) -> Self {
        let of = |name: &str| outcome.multipliers_of(name).unwrap_or_default();
        let part = |rows: &[&[f64]], first: usize, count: usize| -> Vec<Vec<f64>> {
            let at = |t: usize| rows.get(t).and_then(|y| y.get(first..first + count)).unwrap_or_default();
            let padded = |y: &[f64]| [&vec![0.0; nv - y.len()], y].concat();
            (0..outcome.multipliers.len()).map(|t| padded(at(t))).collect()
        };
        let (states, efforts) = (of(STATES), of(EFFORTS));
        let motors = efforts.iter().map(|y| y.len()).max().unwrap_or(0);
        let multipliers = [part(&states, 0, nv), part(&states, nv, nv), part(&efforts, 0, motors)];
        Self { outcome, multipliers }
    }

    /// Returns the multipliers of `position`, `velocity` or `torque`: one list for each knot, with an entry for each
    /// degree of freedom.
    pub(crate) fn multipliers(&self, what: &str) -> &[Vec<f64>] {
        &self.multipliers[match what {
            "position" => 0,
            "velocity" => 1,
            _ => 2,
        }]
    }
}

/// Bound of one quantity that the motion reaches.
#[derive(Serialize)]
pub(crate) struct Met {
    /// Quantity: `position`, `velocity` or `torque`.
    pub what: &'static str,
    pub joint: String,
    /// Bound: `lower` or `upper`.
    pub bound: &'static str,
    pub limit: f64,
    /// First and last knot of each part of the motion at the bound.
    pub knots: Vec<[usize; 2]>,
    /// Times of these knots (s).
    pub times: Vec<[f64; 2]>,
    /// Multiplier with the largest absolute value at these knots, and its knot. `None` if the solver did not need the
    /// limits as constraints.
    pub multiplier: Option<f64>,
    pub at_knot: usize,
}

/// Returns all bounds that the motion reaches or exceeds, in the order of the robot's joints.
pub(crate) fn met(plan: &Plan) -> Vec<Met> {
    let mut all = Vec::new();
    for quantity in limited(&plan.model) {
        let values = plan.values(&quantity);
        let Limited { what, joint, index_v, lower, upper, .. } = quantity;
        for (bound, limit) in [("lower", lower), ("upper", upper)] {
            let range = if (upper - lower).is_finite() { upper - lower } else { limit.abs().max(1.0) };
            let is_at = |t: usize| match bound {
                "lower" => values[t] - lower <= REACHED * range,
                _ => upper - values[t] <= REACHED * range,
            };
            let knots = intervals(values.len(), is_at);
            if knots.is_empty() {
                continue;
            }
            let multiplier = |t: usize| plan.held.as_ref().map(|held| held.multipliers(what)[t][index_v]);
            let size = |t: &usize| multiplier(*t).unwrap_or(0.0).abs();
            let within = knots.iter().flat_map(|[first, last]| *first..=*last);
            let at_knot = within.rev().max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
            let times = knots.iter().map(|knots| knots.map(|t| plan.times[t])).collect();
            let (joint, multiplier) = (joint.to_owned(), multiplier(at_knot));
            all.push(Met { what, joint, bound, limit, knots, times, multiplier, at_knot });
        }
    }
    all
}

/// Returns the first and the last index of each run of consecutive indices below `count` that are chosen.
fn intervals(count: usize, is_chosen: impl Fn(usize) -> bool) -> Vec<[usize; 2]> {
    let mut found: Vec<[usize; 2]> = Vec::new();
    for t in (0..count).filter(|&t| is_chosen(t)) {
        match found.last_mut() {
            Some([_, last]) if *last + 1 == t => *last = t,
            _ => found.push([t, t]),
        }
    }
    found
}

/// Row of a limit, or of the dynamics, that a solve with limits left violated.
#[derive(Serialize)]
pub(crate) struct Worst {
    pub knot: usize,
    pub time: f64,
    /// Quantity: `position`, `velocity`, `torque`, or `gap` for the dynamics.
    pub what: &'static str,
    /// Name of the joint.
    pub joint: String,
    /// Distance from the bound, or size of the gap.
    pub amount: f64,
}

impl Worst {
    /// Returns the row with the largest violation, if the violation exceeds `least`.
    pub(crate) fn new(plan: &Plan, least: f64) -> Option<Self> {
        let violation = plan.held.as_ref()?.outcome.worst.as_ref().filter(|worst| worst.amount > least)?;
        let Violation { kind, knot, entry, amount, .. } = *violation;
        let (nv, name) = (plan.model.nv(), violation.name.as_deref());
        let (what, index) = match (kind, name) {
            (ViolationKind::Gap, _) => ("gap", entry % nv),
            (_, Some(EFFORTS)) => ("torque", entry + nv - plan.solution.u(knot).len()),
            _ if entry < nv => ("position", entry),
            _ => ("velocity", entry - nv),
        };
        let bodies = plan.model.bodies()[1..].iter().filter(|body| body.mimic.is_none());
        let joint = bodies.rev().find(|body| body.idx_v <= index).map_or_else(String::new, |b| b.joint_name.clone());
        Some(Self { knot, time: plan.times[knot], what, joint, amount })
    }

    /// Returns whether the row belongs to the dynamics.
    pub(crate) fn is_gap(&self) -> bool {
        self.what == "gap"
    }
}

impl core::fmt::Display for Worst {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { knot, time, what, joint, amount } = self;
        match *what {
            "gap" => write!(f, "at knot {knot} ({time:.3} s), the dynamics of `{joint}` have a gap of {amount:.2e}"),
            _ => write!(f, "at knot {knot} ({time:.3} s), the {what} of `{joint}` is {amount:.2e} beyond its bound"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::intervals;

    #[test]
    fn consecutive_knots_are_one_interval() {
        let chosen = [true, true, false, true, false, false, true];
        assert_eq!(intervals(7, |t| chosen[t]), [[0, 1], [3, 3], [6, 6]]);
        assert!(intervals(7, |_| false).is_empty() && intervals(0, |_| true).is_empty());
    }
}
