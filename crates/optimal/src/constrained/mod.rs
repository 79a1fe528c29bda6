//! Problems with general constraints, by an augmented Lagrangian.

mod action;
mod augmented;
mod constraint;
mod multipliers;
mod settings;

pub use action::Constrained;
pub use augmented::{AugmentedLagrangian, Outcome};
pub use constraint::Constraint;
pub use settings::ConstraintSettings;
