//! Optimal control as Python sees it: the module `condyle.optimal`.

mod actions;
mod costs;
mod evaluation;
mod models;
mod own;
mod problem;
mod residuals;
mod robot_action;
mod solvers;
mod sweep;

pub(crate) use actions::{ContactDynamics, FreeDynamics, ImpulseDynamics, InverseDynamics};
pub(crate) use costs::{Activation, Cost, Limit};
pub(crate) use models::{Alone, alone};
pub(crate) use own::{Action, ConstrainedAction, DifferentialAction, Lqr, Unicycle};
pub(crate) use problem::{Problem, lock};
pub(crate) use residuals::{FrictionCone, Residual, WrenchCone};
pub(crate) use solvers::{AugmentedLagrangian, Fddp};
pub(crate) use sweep::Sweep;
