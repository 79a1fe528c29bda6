//! Dynamics of one knot of several problems, in one batch.

use super::{Parts, RobotDynamics};
use crate::robot::continuous::KnotInput;
use crate::robot::dynamics::batch::{DynamicsKind, KnotBatch};
use crate::robot::knot_data::{KnotState, WIDEST};
use condyle_dynamics::Target;
use condyle_spatial::block::Block;
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

    /// Returns whether both robots have the same dynamics, except for the targets of contacts, and knot t of both reads
    /// the same quantities: the knots may be computed in one batch.
    pub(crate) fn matches(&self, other: &Self, t: usize) -> bool {
        Arc::ptr_eq(&self.model, &other.model)
            && self.kind.is_alike(&other.kind)
            && (&self.actuation, &self.capabilities) == (&other.actuation, &other.capabilities)
            && self.terms.at(t, true).is_alike(other.terms.at(t, true))
    }
}

/// Runs a batch in which each contact has the target of the lane's robot. `own` are the dynamics of the robot that
/// computes the batch, and `each` the robots of the lanes; `None` stands for that robot.
pub(super) fn with_targets<S: Block<Number = f64>>(
    batch: &mut KnotBatch<S>,
    own: &DynamicsKind,
    each: &[Option<&RobotDynamics>],
    run: impl FnOnce(&mut KnotBatch<S>),
) {
    let target = |kind: &DynamicsKind, k: usize| kind.contacts()[k].constraint.target;
    let count = own.contacts().len();
    let differs = |other: &&RobotDynamics| (0..count).any(|k| target(&other.kind, k) != target(own, k));
    if !each.iter().flatten().any(differs) {
        return run(batch);
    }
    for k in 0..count {
        let mut targets = [Target::identity(); WIDEST];
        for (to, robot) in targets.iter_mut().zip(each) {
            *to = target(robot.map_or(own, |robot| &robot.kind), k);
        }
        batch.set_targets(k, &targets[..each.len()]);
    }
    run(batch);
    for (k, contact) in own.contacts().iter().enumerate() {
        batch.set_contact(k, &contact.constraint);
    }
}
