//! Accelerations of a group of knots. They are computed in one batch for a robot, and knot by knot for user-defined
//! models.

use crate::lq::LqKnot;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput};
use crate::robot::dynamics::batch::Group;
use crate::robot::dynamics::robot::RobotDynamics;

/// Returns the robot of a model; `None` for a user-defined model.
pub(super) fn robot<M: ContinuousModel>(model: &M) -> Option<&RobotDynamics> {
    model.robot()?.downcast_ref()
}

/// Returns the robot of a model as a mutable reference; `None` for a user-defined model.
pub(super) fn robot_mut<M: ContinuousModel>(model: &mut M) -> Option<&mut RobotDynamics> {
    model.robot_mut()?.downcast_mut()
}

/// Panic message if a model that was checked to be a robot is not a robot.
pub(super) const ROBOT: &str = "the model is a robot";

/// Returns the Jacobians of the step at one knot of the last group in [`solve`], if [`solve`] computed them: see
/// [`KnotData::steps`](crate::robot::knot_data::KnotData::steps).
pub(super) fn steps<'m, M: ContinuousModel>(model: &'m M, lane: usize, group: &Group<'_>) -> Option<&'m [f64]> {
    robot(model).filter(|_| !group.durations.is_empty())?.steps(lane)
}

/// Computes the dynamics of a group of a robot's knots. Does nothing for user-defined models, whose dynamics are
/// computed knot by knot.
pub(super) fn solve<M: ContinuousModel>(model: &mut M, group: Group<'_>) {
    if let Some(robot) = robot_mut(model) {
        robot.solve(group);
    }
}

/// Returns the accelerations, the cost ℓ and the limit term at one knot of the last group in [`solve`].
pub(super) fn values<'m, M: ContinuousModel>(
    model: &'m mut M,
    lane: usize,
    input: KnotInput<'_>,
    limited: bool,
) -> (&'m [f64], f64, f64) {
    if robot(model).is_some() {
        return robot_mut(model).expect(ROBOT).values(lane, input, limited);
    }
    let (a, cost) = model.calc(input);
    (a, cost, 0.0)
}

/// Returns the derivatives at one knot of the last group in [`solve`].
pub(super) fn slopes<'m, M: ContinuousModel>(
    model: &'m mut M,
    lane: usize,
    input: KnotInput<'_>,
    scale: f64,
    group: Group<'_>,
    knot: &mut LqKnot,
) -> Derivatives<'m> {
    match robot(model).is_some() {
        true => robot_mut(model).expect(ROBOT).slopes(lane, input, scale, group, knot),
        false => model.calc_diff(input, scale, knot),
    }
}
