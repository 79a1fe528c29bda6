//! Methods that the knots of a robot of all kinds share: their model, their costs and their limits.

use super::contact::{ContactAcceleration, ContactDynamics};
use super::free::{FreeAcceleration, FreeDynamics};
use super::impulse::ImpulseDynamics;
use super::inverse::{ControlledAcceleration, FreeInverseDynamics};
use super::inverse_contact::{ContactInverseDynamics, ControlledContactAcceleration};
use super::robot::RobotDynamics;
use crate::ActionModel;
use crate::Error;
use crate::lq::{Hessian, LqKnot};
use crate::robot::contact::Contact;
use crate::robot::continuous::{ContinuousModel, Derivatives, Evaluation, KnotInput};
use crate::robot::costs::{Cost, Costs};
use crate::robot::integrators::Integrated;
use crate::robot::limits::{Limit, Limits};
use condyle_dynamics::{Model, difference, integrate};
use core::ops::Range;
use nalgebra::DMatrix;
use std::any::Any;
use std::sync::Arc;

/// A knot or a continuous model of a robot.
pub(crate) trait HasRobot {
    fn robot(&self) -> &RobotDynamics;
    fn robot_mut(&mut self) -> &mut RobotDynamics;

    /// The contacts of the knot, in the order of their forces.
    fn contacts(&self) -> &[Contact] {
        self.robot().contacts()
    }
}

/// The robot's knot that an action is, or that it wraps.
pub(crate) fn knot_of(action: &mut dyn ActionModel) -> Option<&mut dyn HasRobot> {
    macro_rules! find {
        ($($Knot:ty),*) => {$({
            let any: &dyn Any = action;
            if any.is::<$Knot>() {
                let any: &mut dyn Any = action;
                return any.downcast_mut::<$Knot>().map(|knot| knot as &mut dyn HasRobot);
            }
        })*};
    }
    find!(FreeDynamics, ContactDynamics, FreeInverseDynamics, ContactInverseDynamics, ImpulseDynamics);
    knot_of(action.inner_mut()?)
}

impl<M: ContinuousModel + HasRobot> HasRobot for Integrated<M> {
    fn robot(&self) -> &RobotDynamics {
        self.inner().robot()
    }

    fn robot_mut(&mut self) -> &mut RobotDynamics {
        self.inner_mut().robot_mut()
    }
}

impl HasRobot for ImpulseDynamics {
    fn robot(&self) -> &RobotDynamics {
        &self.robot
    }

    fn robot_mut(&mut self) -> &mut RobotDynamics {
        &mut self.robot
    }

    fn contacts(&self) -> &[Contact] {
        &self.contacts
    }
}

/// The methods of knots of a robot.
macro_rules! robot_knots {
    ($($knot:ty),*) => {$(
        impl $knot {
            /// The robot.
            pub fn model(&self) -> &Arc<Model> {
                &self.robot().model
            }

            /// The costs of all knots that have none of their own, to change weights and targets between solves.
            pub fn costs_mut(&mut self) -> &mut Costs {
                self.robot_mut().terms.costs_mut(None)
            }

            /// The costs of knot t.
            pub fn costs_at_mut(&mut self, t: usize) -> &mut Costs {
                self.robot_mut().terms.costs_mut(Some(t))
            }

            /// Changes the weights of the terms called `name` of all knots, between solves; says whether there is one.
            ///
            /// # Errors
            /// [`Error::Cost`] if the weight is negative or not finite; the old ones then stay.
            pub fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
                self.robot_mut().terms.set_weight(name, weight)
            }

            /// Gives knot t of the horizon costs of its own, so that one action serves knots that differ in their
            /// targets. They move with their knot when the horizon is [shifted](crate::Problem::shift). Allocates.
            ///
            /// # Errors
            /// [`Error::Cost`] for a term that does not fit; [`Error::Size`] for a knot beyond 2²⁰.
            pub fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<(), Error> {
                self.robot_mut().terms.set_costs(t, costs)
            }

            /// The same action with limits at all knots that have none of their own.
            ///
            /// # Errors
            /// [`Error::Limit`] for one that does not fit.
            pub fn with_limits(mut self, limits: Vec<Limit>) -> Result<Self, Error> {
                self.robot_mut().terms.set_limits(None, limits)?;
                Ok(self)
            }

            /// Gives knot t of the horizon limits of its own, between solves; they too move with their knot. Allocates.
            ///
            /// # Errors
            /// [`Error::Limit`] for one that does not fit; [`Error::Size`] for a knot beyond 2²⁰.
            pub fn set_limits(&mut self, t: usize, limits: Vec<Limit>) -> Result<(), Error> {
                self.robot_mut().terms.set_limits(Some(t), limits)
            }
        }
    )*};
}
robot_knots!(FreeDynamics, ContactDynamics, FreeInverseDynamics, ContactInverseDynamics, ImpulseDynamics);

/// Continuous models of a robot.
macro_rules! robot_models {
    ($($model:ident),*) => {$(
        impl HasRobot for $model {
            fn robot(&self) -> &RobotDynamics {
                &self.0
            }

            fn robot_mut(&mut self) -> &mut RobotDynamics {
                &mut self.0
            }
        }

        impl ContinuousModel for $model {
            fn nq(&self) -> usize {
                self.0.model.nq()
            }

            fn nv(&self) -> usize {
                self.0.model.nv()
            }

            fn nu(&self) -> usize {
                self.0.nu()
            }

            fn lanes(&self) -> usize {
                self.0.lanes()
            }

            fn prepare(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation) {
                self.0.prepare(knots, xs, us, what);
            }

            fn calc(&mut self, input: KnotInput<'_>) -> (&[f64], f64) {
                self.0.calc(input)
            }

            fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
                self.0.calc_diff(input, scale, knot)
            }

            fn hessian(&mut self, input: KnotInput<'_>, mu: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
                self.0.hessian(input, mu, hessian)
            }

            fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
                self.0.inverse_dynamics_form()
            }

            fn motion_size(&self) -> usize {
                self.0.motion_size()
            }

            fn motion(&self, lane: usize, to: &mut [f64]) {
                self.0.motion(lane, to);
            }

            fn set_motion(&mut self, lane: usize, from: &[f64]) {
                self.0.set_motion(lane, from);
            }

            fn shift(&mut self) {
                self.0.terms.shift();
            }

            fn limits(&mut self) -> Option<&mut Limits> {
                Some(&mut self.0.terms.limits)
            }

            fn outputs(&mut self, input: KnotInput<'_>, show: &mut dyn FnMut(&str, &[f64])) {
                self.0.outputs(input.lane, show);
            }

            fn quasi_static(&mut self, x: &[f64]) -> Option<Vec<f64>> {
                Some(self.0.quasi_static(x))
            }

            fn reserve(&mut self) {
                self.0.reserve();
            }

            fn merge(&mut self, other: &mut Self) -> bool {
                self.0.merge(&mut other.0)
            }

            fn choose(&mut self, model: usize) {
                self.0.terms.choose(model);
            }

            fn serve(&mut self, t: usize, horizon: usize, model: usize) {
                self.0.terms.serve(t, horizon, model);
            }

            fn try_clone(&self) -> Option<Self> {
                Some(self.clone())
            }

            fn groups(&self) -> &[Range<usize>] {
                &self.0.groups
            }

            fn check_position(&self, q: &[f64]) -> Result<(), String> {
                self.0.model.check_position(q).map_err(|error| error.to_string())
            }

            fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
                integrate(&self.0.model, q, dq, out);
            }

            fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
                difference(&self.0.model, q0, q1, out);
            }

            fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
                self.0.integrate_jacobians(dq, by_q, by_dq);
            }

            fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
                self.0.integrate_hessian(dq, lambda, hessian);
                true
            }
        }
    )*};
}
robot_models!(FreeAcceleration, ContactAcceleration, ControlledAcceleration, ControlledContactAcceleration);
