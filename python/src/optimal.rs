//! Optimal control in Python: the module `condyle.optimal`.

mod actions;
mod alone;
mod cones;
mod costs;
mod evaluation;
mod integrators;
mod inverse;
mod models;
mod outcomes;
mod own;
mod policy;
mod problem;
mod record;
mod recorder;
mod references;
mod residuals;
mod robot_action;
mod run;
mod schedule;
mod settings;
mod solver_class;
mod solvers;
mod sweep;

pub(crate) use actions::{ContactDynamics, FreeDynamics, ImpulseDynamics};
pub(crate) use alone::{Alone, alone};
pub(crate) use cones::{FrictionCone, WrenchCone};
pub(crate) use costs::{Activation, Cost, Limit};
pub(crate) use inverse::{ContactInverseDynamics, FreeInverseDynamics};
pub(crate) use own::{Action, ConstrainedAction, ControlRate, DifferentialAction, Lqr, Unicycle};
pub(crate) use policy::Policy;
pub(crate) use problem::{Problem, lock};
pub(crate) use record::Record;
pub(crate) use residuals::Residual;
pub(crate) use schedule::Schedule;
pub(crate) use solvers::{AugmentedLagrangian, Fddp, InteriorPoint};
pub(crate) use sweep::Sweep;
