//! Robots as optimal control problems: states x = (q, v), costs, and the knots of robots in free motion, in contact, or
//! at an impact.
//!
//! - A [`Cost`] is a weighted [`Activation`] of a [`Residual`]. An action has a sum of costs, each with a name. A
//!   [`Limit`] keeps a residual within bounds, or at zero. [`Residual::Distances`] keeps spheres on the robot away from
//!   obstacles and from each other; a [`GeometryPair`] names two [`Geometry`] values, each with a [`Shape`].
//! - [`FreeDynamics`] and [`ContactDynamics`] are knots with a duration. [`ImpulseDynamics`] is an impact, a knot
//!   without duration. In [`FreeInverseDynamics`] the controls are the accelerations; in [`ContactInverseDynamics`]
//!   they are the accelerations and the contact forces. An [`Actuation`] maps controls to joint efforts, an
//!   [`Integrator`] integrates over the duration of a knot, and a [`ControlPolynomial`] describes how the controls
//!   change during a knot.
//! - A user-defined residual is a [`GenericResidual`] or a [`ResidualFunction`]. A [`GenericResidual`] is generic over
//!   the scalar type and is differentiated exactly ([`OwnResidual::autodiff`]); a [`ResidualFunction`] contains its own
//!   Jacobian. Costs and limits accept both.
//! - [`Problem::motion`](crate::Problem::motion) returns the accelerations, efforts and contact forces of a solution.
//!   [`Problem::cost_mut`](crate::Problem::cost_mut) returns the cost with a given name, whose [`Target`] or weight may
//!   be changed.
//! - A [`RobotProblem`] describes a problem as data, for example in a file.
//! - [`Integrated`] also turns a user-defined [`ContinuousModel`] into a knot.
//!
//! ```
//! use condyle_dynamics::robots;
//! use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
//! use condyle_optimal::{Fddp, Problem, Status};
//! use std::sync::Arc;
//!
//! // an arm reaches for a point in 20 knots of 50 ms
//! let arm = Arc::new(robots::arm7());
//! let reach = Residual::FrameTranslation { frame: "tool".into(), target: [0.4, 0.2, 0.5].into() };
//! let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
//! let rest = Residual::State { reference: x0.clone() };
//! let effort = Residual::Control { reference: vec![0.0; 7] };
//! let running = vec![
//!     Cost::new("rest", 1e-1, rest.clone(), Activation::Quadratic),
//!     Cost::new("effort", 1e-4, effort, Activation::Quadratic),
//! ];
//! let stop = Activation::Weighted([[0.0; 7], [1.0; 7]].concat());
//! let terminal = vec![
//!     Cost::new("reach", 1e3, reach, Activation::Quadratic),
//!     Cost::new("stop", 1e0, rest, stop),
//! ];
//!
//! let mut action = FreeDynamics::running(arm.clone(), 0.05, running)?;
//! let us = action.quasi_static(&x0).repeat(20);
//! let end = FreeDynamics::terminal(arm.clone(), terminal)?;
//! let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 20], Box::new(end))?;
//! let mut solver = Fddp::new(&problem);
//! let solution = solver.solve(&mut problem, &x0.repeat(21), &us)?;
//! assert_eq!(solution.status, Status::Converged);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![allow(non_snake_case)] // names follow the literature

mod activation;
mod actuation;
mod contact;
mod continuous;
mod cost_access;
mod costs;
mod dependent_contacts;
mod dynamics;
mod horizon;
mod integrators;
mod knot_data;
mod limits;
mod motion;
mod nudge;
mod obstacles;
mod outputs;
mod own_constraint;
mod problem;
mod references;
mod residuals;
mod robot_numbers;
mod state;

pub use crate::problem::Soft;
pub use activation::Activation;
pub use actuation::Actuation;
pub use condyle_dynamics::distances::{FrameName, Geometry, GeometryPair, Shape};
pub use contact::Contact;
pub use continuous::{ContinuousModel, Derivatives, KnotInput};
pub use cost_access::CostMut;
pub use costs::{Cost, Costs};
pub use dynamics::acceleration::{
    Controlled, ControlledInContact, Free, InContact, InImpact, RobotAcceleration, RobotKind,
};
pub use dynamics::contact::{ContactAcceleration, ContactDynamics};
pub use dynamics::free::{FreeAcceleration, FreeDynamics};
pub use dynamics::impulse::ImpulseDynamics;
pub use dynamics::inverse::{ControlledAcceleration, FreeInverseDynamics};
pub use dynamics::inverse_contact::{ContactInverseDynamics, ControlledContactAcceleration};
pub use integrators::{ControlPolynomial, Integrated, Integrator};
pub use limits::Limit;
pub use motion::{ContactForce, KnotMotion};
pub(crate) use nudge::Nudge;
pub use own_constraint::OwnConstraint;
pub use problem::{ControlBounds, ControlChange, Dynamics, Knot, RobotProblem};
pub use residuals::autodiff::{GenericResidual, RobotState};
pub use residuals::cones::{FrictionCone, WrenchCone};
pub use residuals::own::{Inputs, OwnResidual, ResidualFunction};
pub use residuals::residual::Residual;
pub use residuals::target::Target;
pub(crate) use robot_numbers::{RobotNumbers, parameter_names};
pub use state::groups;
