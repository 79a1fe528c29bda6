//! Optimal control problem: actions, horizons of actions, and derivatives of actions that do not compute derivatives.

mod action;
mod action_view;
mod autodiff;
mod constrained;
mod control_rate;
mod group;
mod horizon;
mod lqr;
mod models;
mod multipliers;
mod numdiff;
mod path_constraint;
mod rollouts;
mod schedule;
mod shape;
mod soft;
mod threads;
mod unicycle;

pub use action::ActionModel;
pub(crate) use action::quasi_static;
pub(crate) use action_view::ActionView;
pub use autodiff::{AutoDiff, GenericAction};
pub use constrained::Constrained;
pub use control_rate::ControlRate;
pub use group::GroupModel;
pub(crate) use group::{Evaluation, KnotGroup, Results, evaluate, evaluate_across, innermost};
pub use horizon::Problem;
pub use lqr::Lqr;
pub(crate) use multipliers::{Bounded, Multipliers, PENALTY, Part, Visit, leave_a_value, outside};
pub use numdiff::NumDiff;
pub use path_constraint::{AutoDiffConstraint, GenericConstraint, PathConstraint};
pub use rollouts::{RolloutResults, Rollouts};
pub use schedule::Schedule;
pub(crate) use shape::{MOST_KNOTS, Shape};
pub use soft::Soft;
pub use unicycle::Unicycle;
