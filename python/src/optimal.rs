//! Optimal control as Python sees it: the module `condyle.optimal`.

mod actions;
mod costs;
mod own;
mod problem;
mod residuals;
mod solvers;

pub(crate) use actions::{ContactDynamics, FreeDynamics, ImpulseDynamics, InverseDynamics};
pub(crate) use costs::{Activation, Cost, Limit};
pub(crate) use own::{Action, ConstrainedAction, Lqr};
pub(crate) use problem::{Problem, lock};
pub(crate) use residuals::{FrictionCone, Residual, WrenchCone};
pub(crate) use solvers::{AugmentedLagrangian, Fddp};
