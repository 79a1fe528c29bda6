//! Accelerations of a robot, and the methods that a robot's knots have for all kinds of dynamics.

use super::batch::Group;
use super::robot::RobotDynamics;
use crate::Error;
use crate::lq::{Hessian, LqKnot};
use crate::problem::Evaluation;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput};
use crate::robot::costs::{Cost, Costs};
use crate::robot::horizon::HorizonTerms;
use crate::robot::integrators::Integrated;
use crate::robot::limits::Limit;
use condyle_dynamics::{Model, difference, integrate};
use core::any::Any;
use core::fmt::Debug;
use core::marker::PhantomData;
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Accelerations and costs of a robot. `K` is the kind of the robot's dynamics: see
/// [`FreeAcceleration`](crate::robot::FreeAcceleration), [`ContactAcceleration`](crate::robot::ContactAcceleration),
/// [`ControlledAcceleration`](crate::robot::ControlledAcceleration) and
/// [`ControlledContactAcceleration`](crate::robot::ControlledContactAcceleration).
#[derive(Clone, Debug)]
pub struct RobotAcceleration<K> {
    robot: RobotDynamics,
    kind: PhantomData<K>,
}

/// Kind of a robot's dynamics.
pub trait RobotKind: Clone + Debug + Send + Sync + 'static {}

/// Defines the types of the kinds of a robot's dynamics.
macro_rules! kinds {
    ($($(#[$doc:meta])+ $kind:ident;)+) => {$(
        $(#[$doc])+
        #[derive(Clone, Copy, Debug)]
        pub struct $kind;

        impl RobotKind for $kind {}
    )+};
}
kinds! {
    /// Kind of a robot that moves freely.
    Free;
    /// Kind of a robot in contact.
    InContact;
    /// Kind of a robot whose controls are its accelerations.
    Controlled;
    /// Kind of a robot in contact whose controls are its accelerations and contact forces.
    ControlledInContact;
    /// Kind of a robot at an impact.
    InImpact;
}

impl<K> RobotAcceleration<K> {
    /// Wraps the dynamics of a robot. Their kind must be `K`.
    pub(super) fn of(robot: RobotDynamics) -> Self {
        Self { robot, kind: PhantomData }
    }
}

impl<K: RobotKind> Integrated<RobotAcceleration<K>> {
    /// Returns the costs and limits of all knots.
    pub(crate) fn terms_mut(&mut self) -> &mut HorizonTerms {
        &mut self.inner_mut().robot.terms
    }

    /// Returns the robot.
    pub fn model(&self) -> &Arc<Model> {
        &self.inner().robot.model
    }

    /// Returns the common costs of all knots without separate costs. Their weights and targets may be changed between
    /// solves.
    pub fn costs_mut(&mut self) -> &mut Costs {
        self.terms_mut().costs_mut(None)
    }

    /// Returns the costs of knot t.
    pub fn costs_at_mut(&mut self, t: usize) -> &mut Costs {
        self.terms_mut().costs_mut(Some(t))
    }

    /// Returns the costs of each knot that has separate costs.
    pub fn separate_costs(&mut self) -> impl Iterator<Item = (usize, &Costs)> {
        self.terms_mut().separate_costs()
    }

    /// Changes the weight of the term called `name` at all knots, between solves. Returns whether such a term exists.
    ///
    /// # Errors
    /// [`Error::Cost`] if the weight is negative or not finite; the old weights are then kept.
    pub fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
        self.terms_mut().set_weight(name, weight)
    }

    /// Sets separate costs for knot t of the horizon. One action can thus have a different target at each knot. When
    /// the horizon is [shifted](crate::Problem::shift), the costs move with their knot. Allocates.
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot; [`Error::Size`] for a knot beyond 2²⁰.
    pub fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<(), Error> {
        self.terms_mut().set_costs(t, costs)
    }

    /// Returns the same action with common limits for all knots that have no separate limits.
    ///
    /// # Errors
    /// [`Error::Limit`] for a limit that does not fit the robot.
    pub fn with_limits(mut self, limits: Vec<Limit>) -> Result<Self, Error> {
        self.terms_mut().set_limits(None, limits)?;
        Ok(self)
    }

    /// Sets separate limits for knot t of the horizon, between solves. When the horizon is shifted, the limits move
    /// with their knot. Allocates.
    ///
    /// # Errors
    /// [`Error::Limit`] for a limit that does not fit the robot; [`Error::Size`] for a knot beyond 2²⁰.
    pub fn set_limits(&mut self, t: usize, limits: Vec<Limit>) -> Result<(), Error> {
        self.terms_mut().set_limits(Some(t), limits)
    }

    /// Returns the controls u of smallest norm that hold the robot still at the state `x`, as nearly as possible. With
    /// contacts, u and the contact forces λ are computed together: (u, λ) = [S Jᵀ]⁺ g(q). If accelerations are
    /// controls, they are zero; if contact forces are also controls, the result is these zeros, then λ. Allocates.
    ///
    /// # Panics
    /// If `x` does not have nq + nv entries.
    #[track_caller]
    pub fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        self.inner_mut().robot.quasi_static(x)
    }
}

impl<K: RobotKind> ContinuousModel for RobotAcceleration<K> {
    fn nq(&self) -> usize {
        self.robot.model.nq()
    }

    fn nv(&self) -> usize {
        self.robot.model.nv()
    }

    fn nu(&self) -> usize {
        self.robot.nu()
    }

    fn calc(&mut self, input: KnotInput<'_>) -> (&[f64], f64) {
        self.robot.solve(Group::one(&input, Evaluation::Values, true));
        let (a, cost, _) = self.robot.values(0, input, true);
        (a, cost)
    }

    fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
        let group = Group::one(&input, Evaluation::Derivatives, true);
        self.robot.solve(group);
        self.robot.slopes(0, input, scale, group, knot)
    }

    fn hessian(&mut self, input: KnotInput<'_>, mu: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
        self.robot.hessian(input, mu, hessian)
    }

    fn shift(&mut self) {
        self.robot.terms.shift();
    }

    fn outputs(&mut self, input: KnotInput<'_>, show: &mut dyn FnMut(&str, &[f64])) {
        self.robot.solve(Group::one(&input, Evaluation::Values, true));
        self.robot.outputs(show);
    }

    fn quasi_static(&mut self, x: &[f64]) -> Option<Vec<f64>> {
        Some(self.robot.quasi_static(x))
    }

    fn try_clone(&self) -> Option<Self> {
        Some(self.clone())
    }

    fn groups(&self) -> &[Range<usize>] {
        &self.robot.groups
    }

    fn check_position(&self, q: &[f64]) -> Result<(), String> {
        self.robot.model.check_position(q).map_err(|error| error.to_string())
    }

    fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
        integrate(&self.robot.model, q, dq, out);
    }

    fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
        difference(&self.robot.model, q0, q1, out);
    }

    fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        self.robot.integrate_jacobians(dq, by_q, by_dq);
    }

    fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        self.robot.integrate_hessian(dq, lambda, hessian);
        true
    }

    fn robot(&self) -> Option<&dyn Any> {
        Some(&self.robot)
    }

    fn robot_mut(&mut self) -> Option<&mut dyn Any> {
        Some(&mut self.robot)
    }
}
