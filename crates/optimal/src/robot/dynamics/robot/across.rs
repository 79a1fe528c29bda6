//! Dynamics of one knot of several problems, in one batch.

use super::{Parts, RobotDynamics};
use crate::robot::continuous::KnotInput;
use crate::robot::knot_data::KnotState;
use std::sync::Arc;

impl RobotDynamics {
    /// Exchanges the results at one knot of the last group with the results at the first knot of another robot.
    pub(crate) fn exchange(&mut self, lane: usize, other: &mut Self) {
        core::mem::swap(&mut self.parts().work.data[lane], &mut other.parts().work.data[0]);
    }

    /// Returns the accelerations at one knot of the last group, and the cost ℓ and the limit term there of `owner`, the
    /// robot to which the knot belongs.
    pub(crate) fn values_of(&mut self, lane: usize, input: KnotInput<'_>, owner: &mut Self) -> (&[f64], f64, f64) {
        let (KnotInput { t, x, u }, Parts { work, .. }) = (input, self.parts());
        let data = &work.data[lane];
        let (cost, term) = owner.terms.calc(t, KnotState { x, u, data }, true);
        (&data.a, cost, term)
    }

    /// Returns whether both robots have the same dynamics, and knot t of both reads the same quantities: the knots may
    /// be computed in one batch.
    pub(crate) fn matches(&self, other: &Self, t: usize) -> bool {
        Arc::ptr_eq(&self.model, &other.model)
            && (&self.kind, &self.actuation, &self.capabilities) == (&other.kind, &other.actuation, &other.capabilities)
            && self.terms.at(t, true).is_alike(other.terms.at(t, true))
    }
}
