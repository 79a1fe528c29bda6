//! Settings of sensitivities, and the report on the solution at which they are computed.

use crate::error::Error;
use crate::solvers::ViolationKind;

/// Second derivatives ∇²Lₜ that enter the linearised optimality conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Curvature {
    /// Exact second derivatives, by central differences of the exact first derivatives of costs, dynamics and
    /// constraints, for dynamics of all kinds. They take 2 (ndx + nu) evaluations of the derivatives, and are accurate
    /// to about nine digits.
    #[default]
    Exact,
    /// Second derivatives of the costs from [`calc_diff`](crate::ActionModel::calc_diff), plus the second derivatives
    /// of the dynamics from [`dynamics_hessian`](crate::ActionModel::dynamics_hessian). They are exact for costs that
    /// are quadratic in x and u, without constraints that are curved.
    Dynamics,
    /// Second derivatives of the costs from [`calc_diff`](crate::ActionModel::calc_diff) alone. A robot's are
    /// Gauss–Newton approximations. Dynamics and constraints count as linear. The sensitivities are then approximate.
    GaussNewton,
}

impl Curvature {
    /// Returns the name in Python: `"exact"`, `"dynamics"` or `"gauss_newton"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Dynamics => "dynamics",
            Self::GaussNewton => "gauss_newton",
        }
    }
}

/// Settings of a [`Sensitivity`](crate::Sensitivity).
#[derive(Debug, Clone, PartialEq)]
pub struct SensitivitySettings {
    /// Second derivatives that enter the linearised optimality conditions.
    pub curvature: Curvature,
    /// Largest accepted residual of the optimality conditions, relative to the terms of each condition. A larger one
    /// means that the solution has not converged, or that the problem has changed since. The error of a sensitivity is
    /// proportional to the error of the solution.
    pub tolerance: f64,
    /// Smallest value of [`SensitivityReport::margin`] with strict complementarity.
    pub strictness: f64,
}

impl Default for SensitivitySettings {
    fn default() -> Self {
        Self { curvature: Curvature::Exact, tolerance: 1e-3, strictness: 1e-4 }
    }
}

impl SensitivitySettings {
    /// Returns `Ok` if the numbers are valid.
    pub(super) fn check(&self) -> Result<(), Error> {
        for (name, value) in [("tolerance", self.tolerance), ("strictness", self.strictness)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Setting { name, value, allowed: "finite and at least 0" });
            }
        }
        Ok(())
    }
}

/// Report on the solution at which sensitivities are computed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SensitivityReport {
    /// Second derivatives that were used.
    pub curvature: Curvature,
    /// Largest gradient of the Lagrangian with respect to a free control, relative to its terms.
    pub stationarity: f64,
    /// Largest gap of the dynamics, or distance of an active constraint from its bound.
    pub primal: f64,
    /// Number of controls at a bound, over all knots.
    pub active_controls: usize,
    /// Number of active rows of constraints, over all knots. Equalities are always active.
    pub active_rows: usize,
    /// Whether each inequality is clearly active or clearly inactive: `margin` is at least
    /// [`strictness`](SensitivitySettings::strictness). If not, the solution has a kink nearby, and the derivative on
    /// the other side of the kink differs.
    pub strict_complementarity: bool,
    /// Smallest value, over all inequalities, of the larger one of multiplier and distance from the bound, each in its
    /// own unit; infinite without inequalities.
    pub margin: f64,
    /// Inequality with that value.
    pub weakest: Option<WeakestBound>,
}

/// Inequality whose multiplier and distance from its bound are both small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WeakestBound {
    /// Kind: bound of a control, or row of a constraint.
    pub kind: ViolationKind,
    /// Index of the knot, 0 … N.
    pub knot: usize,
    /// Index of the control, or of the row in the knot's [`Outcome::multipliers`](crate::Outcome::multipliers).
    pub row: usize,
}

impl SensitivityReport {
    /// Creates the report before the solution is examined.
    pub(super) fn new(curvature: Curvature) -> Self {
        Self {
            curvature,
            stationarity: 0.0,
            primal: 0.0,
            active_controls: 0,
            active_rows: 0,
            strict_complementarity: true,
            margin: f64::INFINITY,
            weakest: None,
        }
    }

    /// Adds an inequality with its multiplier and its distance from the bound.
    pub(super) fn add(&mut self, at: WeakestBound, multiplier: f64, distance: f64) {
        let larger = multiplier.max(distance);
        if larger < self.margin {
            (self.margin, self.weakest) = (larger, Some(at));
        }
    }
}
