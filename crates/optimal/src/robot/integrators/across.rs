//! Values at one knot of several problems, with the dynamics of all problems in one batch.

use super::accelerations::{ROBOT, robot, robot_mut};
use super::{Integrated, Method, Work, euler};
use crate::problem::{Evaluation, KnotGroup, Results};
use crate::robot::continuous::{ContinuousModel, KnotInput};
use crate::robot::dynamics::batch::Group;
use crate::robot::dynamics::robot::RobotDynamics;
use crate::robot::knot_data::WIDEST;
use crate::{ActionModel, GroupModel};
use std::any::Any;

impl<M: ContinuousModel> Integrated<M> {
    /// Computes values as [`KnotGroup::evaluate_across`] does: the dynamics of all lanes in the batch of this action,
    /// and then the costs and the step of each lane by the action of this lane.
    #[track_caller]
    pub(super) fn values_across(
        &mut self,
        others: &mut [&mut dyn ActionModel],
        of: &[usize],
        t: usize,
        [xs, us]: [&[f64]; 2],
        results: &mut Results<'_>,
    ) -> bool {
        let (nx, nu, count) = (self.nx(), self.nu(), of.len());
        if GroupModel::lanes(self) < count {
            return false;
        }
        self.set_limits_in_cost(true);
        let mut each: [Option<&RobotDynamics>; WIDEST] = [None; WIDEST];
        for other in &mut *others {
            let other = Self::of_action(&mut **other);
            other.set_limits_in_cost(true);
            other.parts();
        }
        for (each, &k) in each.iter_mut().zip(of).filter(|(_, k)| **k > 0) {
            let other: &dyn Any = &*others[k - 1];
            *each = other.downcast_ref::<Self>().and_then(|other| robot(&other.inner));
        }
        let group =
            Group { knots: &[t; WIDEST][..count], xs, us, what: Evaluation::Values, limited: true, durations: &[] };
        robot_mut(&mut self.inner).expect(ROBOT).solve_across(group, &each[..count]);
        let motion = KnotGroup::inverse_dynamics(self).map_or(0, |(size, _)| size);
        let room = results.motions.len() / count;
        for (lane, &k) in of.iter().enumerate() {
            let input = KnotInput { t, x: &xs[lane * nx..][..nx], u: &us[lane * nu..][..nu] };
            if motion.min(room) > 0 {
                let robot = robot_mut(&mut self.inner).expect(ROBOT);
                robot.copy_motion(lane, &mut results.motions[lane * room..][..motion]);
            }
            let (next, cost) = (&mut results.next[lane * nx..][..nx], &mut results.costs[lane]);
            if k == 0 {
                *cost = self.step(lane, input, self.duration_of(t), next);
                continue;
            }
            let other = Self::of_action(&mut *others[k - 1]);
            if self.method == Method::Euler {
                let dt = other.duration_of(t);
                let owner = robot_mut(&mut other.inner).expect(ROBOT);
                let (inner, Work { retraction, .. }) = self.parts();
                *cost = euler::calc(inner, input, dt, retraction, next, |inner| {
                    robot_mut(inner).expect(ROBOT).values_of(lane, input, owner)
                });
                continue;
            }
            let mut exchange = |other: &mut Self| {
                let (own, other) = (robot_mut(&mut self.inner), robot_mut(&mut other.inner));
                own.expect(ROBOT).exchange(lane, other.expect(ROBOT));
            };
            exchange(other);
            *cost = other.step(0, input, other.duration_of(t), next);
            exchange(other);
        }
        true
    }

    /// Returns an action that [matches](KnotGroup::matches) this one, with its type.
    fn of_action(action: &mut dyn ActionModel) -> &mut Self {
        let action: &mut dyn Any = action;
        action.downcast_mut().expect("actions that match have the same type")
    }
}
