//! Solvers. All of them share one loop of derivatives, sweeps and line searches.

mod augmented_lagrangian;
mod batch;
mod best;
mod directions;
mod fddp;
mod interior_point;
mod iterate;
mod limit_rows;
mod many;
mod multipliers;
mod one_by_one;
mod outcome;
mod policy;
mod predict;
mod prepared;
mod retime;
mod rollout;
mod search;
mod settings;
mod soft_limits;
mod solution;
mod solver_loop;
mod start;
mod watch;

pub use augmented_lagrangian::AugmentedLagrangian;
pub use batch::BatchFddp;
pub use fddp::Fddp;
pub use interior_point::{InteriorPoint, InteriorPointSettings};
pub use limit_rows::LimitRows;
pub use many::ManyProblems;
pub use one_by_one::{OneByOne, SingleSolver};
pub use outcome::{Outcome, Violation, ViolationKind};
pub use policy::{PlanPoint, Policy, PolicyPoint, PolicyPublisher, StateSpace};
pub use settings::{ConstraintSettings, DdpMethod, Settings};
pub use solution::{Fallback, Iteration, Solution, Status, Timings};
pub use watch::{Observer, Verdict};
