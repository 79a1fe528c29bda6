//! A dense convex program with second-order cones and fixed memory, independent of robots.
//!
//! ```text
//! minimise     ½ xᵀ P x + cᵀ x
//! subject to   A x = b
//!              l ≤ G x ≤ u            two-sided rows; ±∞ and l = u are allowed
//!              hₖ + Fₖ x ∈ Qₖ          second-order cones: ‖(s₂, s₃, …)‖ ≤ s₁
//! ```
//!
//! Multipliers multiply the constraints' gradients: P x + c = Aᵀ y + Gᵀ z + Fᵀ w. Here z is positive at a lower bound
//! and negative at an upper bound, and wₖ ∈ Qₖ.

#[cfg(feature = "clarabel")]
mod clarabel;
mod interior_point;
mod program;
#[cfg(all(test, feature = "clarabel"))]
mod tests;

#[cfg(feature = "clarabel")]
pub(crate) use self::clarabel::Clarabel;
pub(crate) use interior_point::InteriorPoint;
pub(crate) use program::{ConeProgram, Size};

/// Conditions under which a solver stops.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Maximum residuals and duality gap, relative to the terms that they are differences of.
    pub tolerance: f64,
    /// Maximum number of iterations, cold and warm start together.
    pub max_iterations: u32,
    /// Maximum time (s); may be infinite.
    pub time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 1e-9, max_iterations: 50, time_limit: f64::INFINITY }
    }
}

/// Start of a solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// From the data alone.
    Cold,
    /// From the last solution, if it has this size and the solver supports it.
    Warm,
}

/// Cause of a missing minimiser.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Status {
    /// The constraints contradict each other.
    #[error("the constraints exclude each other")]
    Infeasible,
    /// The objective is unbounded below on the feasible set.
    #[error("the objective is unbounded below")]
    Unbounded,
    /// [`Settings::max_iterations`] were not enough.
    #[error("not solved within the allowed iterations")]
    IterationLimit,
    /// [`Settings::time_limit`] was not enough.
    #[error("not solved within the allowed time")]
    TimeLimit,
    /// The steps became too short, or a factorisation failed.
    #[error("the solver stopped for numerical reasons")]
    NumericalError,
    /// A number of the program is NaN, or infinite where it may not be. Nothing was solved.
    #[error("`{name}[{index}]` is not finite")]
    NotFinite {
        /// The field of [`ConeProgram`].
        name: &'static str,
        /// Index in that field, column by column.
        index: usize,
    },
}

/// Result of a solve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Number of iterations, all attempts together.
    pub iterations: u32,
    /// Whether the solution was reached from the last solution.
    pub warm: bool,
    /// Whether only reduced tolerances are met.
    pub reduced: bool,
    /// Cause, if x is not the minimiser. x is then the last iterate and finite, or zero if nothing was solved.
    pub stopped: Option<Status>,
}

/// Multipliers of the last solve, with the signs of the [module](self).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Multipliers<'s> {
    /// y, of A x = b.
    pub equalities: &'s [f64],
    /// z, of l ≤ G x ≤ u.
    pub rows: &'s [f64],
    /// w, of the cones.
    pub cones: &'s [f64],
}

/// A solver of programs with sizes up to a capacity.
pub(crate) trait Solver {
    /// Sets the start of the next warm solve, for a program of this size. A solver that always starts cold ignores it.
    fn start_from(&mut self, _x: &[f64], _multipliers: Multipliers<'_>) {}

    /// Minimises the program's objective.
    ///
    /// # Panics
    /// If the program's capacity is not the solver's.
    fn solve(&mut self, program: &ConeProgram, start: Start) -> Outcome;

    /// Returns x of the last solve: `size.unknowns` numbers.
    fn x(&self) -> &[f64];

    /// Returns the multipliers of the last solve.
    fn multipliers(&self) -> Multipliers<'_>;
}
