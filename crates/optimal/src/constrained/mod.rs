//! Problems with general constraints, solved by an augmented Lagrangian.

mod action;
mod augmented;
mod autodiff;
mod multipliers;
mod path_constraint;
mod restart;
mod settings;
mod violation;

pub use action::Constrained;
pub use augmented::{AugmentedLagrangian, Outcome};
pub use autodiff::{AutoDiffConstraint, GenericConstraint};
pub use path_constraint::PathConstraint;
pub use settings::ConstraintSettings;
pub use violation::{Violation, ViolationKind};
