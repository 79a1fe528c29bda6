//! Dense convex program with second-order cones, in memory of fixed size. This module does not depend on robots.
//!
//! ```text
//! minimise     ½ xᵀ P x + cᵀ x
//! subject to   A x = b
//!              l ≤ G x ≤ u            two-sided rows; ±∞ and l = u are allowed
//!              hₖ + Fₖ x ∈ Qₖ          second-order cones: ‖(s₂, s₃, …)‖ ≤ s₁
//! ```
//!
//! Multipliers are factors of the constraints' gradients: P x + c = Aᵀ y + Gᵀ z + Fᵀ w. Here z is positive at a lower
//! bound and negative at an upper bound, and wₖ ∈ Qₖ.

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
    /// Maximum of the residuals and of the duality gap. Each is relative to the terms from which it is computed.
    pub tolerance: f64,
    /// Maximum number of iterations of the cold and the warm start together.
    pub max_iterations: u32,
    /// Maximum time (s); may be infinite.
    pub time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 1e-9, max_iterations: 50, time_limit: f64::INFINITY }
    }
}

/// Point from which a solver starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Start from the data of the program alone.
    Cold,
    /// Start from the last solution, if that solution has the program's size and the solver supports a warm start.
    Warm,
}

/// Reason for which a solve found no minimiser.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Status {
    /// The constraints contradict each other.
    #[error("the constraints exclude each other")]
    Infeasible,
    /// The objective is unbounded below on the feasible set.
    #[error("the objective is unbounded below")]
    Unbounded,
    /// The solver needs more than [`Settings::max_iterations`] iterations.
    #[error("not solved within the allowed iterations")]
    IterationLimit,
    /// The solver needs more time than [`Settings::time_limit`].
    #[error("not solved within the allowed time")]
    TimeLimit,
    /// The steps became too short, or a factorisation failed.
    #[error("the solver stopped for numerical reasons")]
    NumericalError,
    /// A number of the program is NaN, or is infinite where it must be finite. Nothing was solved.
    #[error("`{name}[{index}]` is not finite")]
    NotFinite {
        /// Name of the invalid field of [`ConeProgram`].
        name: &'static str,
        /// Index of the invalid number in this field, counted column by column.
        index: usize,
    },
}

/// Result of a solve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Number of iterations of all attempts together.
    pub iterations: u32,
    /// Whether the solver reached the solution from a warm start.
    pub warm: bool,
    /// Whether the solution meets only the reduced tolerance.
    pub reduced: bool,
    /// Reason for which x is not the minimiser, if so. Then x is the last iterate and finite, or zero if nothing was
    /// solved.
    pub stopped: Option<Status>,
}

/// Multipliers of the last solve. Their signs are described in the [module](self).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Multipliers<'s> {
    /// Multipliers y of the equalities A x = b.
    pub equalities: &'s [f64],
    /// Multipliers z of the rows l ≤ G x ≤ u.
    pub rows: &'s [f64],
    /// Multipliers w of the cones.
    pub cones: &'s [f64],
}

/// Solver of programs up to a maximum size, the solver's capacity.
pub(crate) trait Solver {
    /// Sets the starting point of the next warm solve, for a program of this size. A solver that always starts cold
    /// does nothing.
    fn start_from(&mut self, _x: &[f64], _multipliers: Multipliers<'_>) {}

    /// Minimises the program's objective.
    ///
    /// # Panics
    /// If the program's capacity differs from the solver's capacity.
    fn solve(&mut self, program: &ConeProgram, start: Start) -> Outcome;

    /// Returns x of the last solve: `size.unknowns` numbers.
    fn x(&self) -> &[f64];

    /// Returns the multipliers of the last solve.
    fn multipliers(&self) -> Multipliers<'_>;
}
