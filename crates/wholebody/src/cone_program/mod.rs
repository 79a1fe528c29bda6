//! A convex program with second-order cones, dense, its memory fixed when it is made; it knows no robot.
//!
//! ```text
//! minimise     ½ xᵀ P x + cᵀ x
//! subject to   A x = b
//!              l ≤ G x ≤ u            two-sided rows; ±∞ and l = u are allowed
//!              hₖ + Fₖ x ∈ Qₖ          second-order cones: ‖(s₂, s₃, …)‖ ≤ s₁
//! ```
//!
//! Multipliers stand with the constraints' gradients: P x + c = Aᵀ y + Gᵀ z + Fᵀ w, where z is positive at a lower bound and
//! negative at an upper one, and wₖ ∈ Qₖ.

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

/// When a solver stops.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Bound of the residuals and of the duality gap, relative to the terms that they are the difference of.
    pub tolerance: f64,
    /// Iterations, of cold and warm start together.
    pub max_iterations: u32,
    /// Seconds; may be infinite.
    pub time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: 1e-9, max_iterations: 50, time_limit: f64::INFINITY }
    }
}

/// Where a solver begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// From the data alone.
    Cold,
    /// From the last solution, if there is one of this size, and the solver can.
    Warm,
}

/// Why there is no minimiser.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Status {
    /// A combination of the constraints has no solution.
    #[error("the constraints exclude each other")]
    Infeasible,
    /// The objective has no lower bound on what the constraints allow.
    #[error("the objective is unbounded below")]
    Unbounded,
    /// [`Settings::max_iterations`] were not enough.
    #[error("not solved within the allowed iterations")]
    IterationLimit,
    /// [`Settings::time_limit`] was not enough.
    #[error("not solved within the allowed time")]
    TimeLimit,
    /// The steps became too short, or a factor does not exist.
    #[error("the solver stopped for numerical reasons")]
    NumericalError,
    /// A number of the program is NaN, or infinite where it may not be. Nothing was solved.
    #[error("`{name}[{index}]` is not finite")]
    NotFinite {
        /// The field of [`ConeProgram`].
        name: &'static str,
        /// Its position in that field, column by column.
        index: usize,
    },
}

/// What a solve found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Iterations, of all attempts together.
    pub iterations: u32,
    /// Whether the solution was reached from the last one.
    pub warm: bool,
    /// Whether only reduced tolerances are met.
    pub reduced: bool,
    /// Why x is not the minimiser; it is the last iterate then, and finite, or zero where nothing was solved.
    pub stopped: Option<Status>,
}

/// The multipliers of the last solve, with the signs of the [module](self).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Multipliers<'s> {
    /// y, of A x = b.
    pub equalities: &'s [f64],
    /// z, of l ≤ G x ≤ u.
    pub rows: &'s [f64],
    /// w, of the cones.
    pub cones: &'s [f64],
}

/// A solver of programs whose sizes fit a capacity.
pub(crate) trait Solver {
    /// Sets where the next warm start begins, for a program of this size. A solver that always starts cold ignores it.
    fn start_from(&mut self, _x: &[f64], _multipliers: Multipliers<'_>) {}

    /// Minimises.
    ///
    /// # Panics
    /// If the program's capacity is not the solver's.
    fn solve(&mut self, program: &ConeProgram, start: Start) -> Outcome;

    /// x of the last solve: `size.unknowns` numbers.
    fn x(&self) -> &[f64];

    /// The multipliers of the last solve.
    fn multipliers(&self) -> Multipliers<'_>;
}
