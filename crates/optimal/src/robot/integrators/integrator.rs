//! The rules by which a knot steps through its time.

use core::fmt;

/// Rule by which a knot steps through its time.
///
/// The stages of the Runge–Kutta methods add velocities of different points as if positions were a vector space, as
/// Crocoddyl's do; for a free-flyer they are therefore of first order in its rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Integrator {
    /// v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²): one evaluation; symplectic. Crocoddyl's `IntegratedActionModelEuler`.
    SemiImplicitEuler,
    /// Midpoint rule, 2 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_2"))]
    RungeKutta2,
    /// Heun's rule of third order, 3 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_3"))]
    RungeKutta3,
    /// Classical rule, 4 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_4"))]
    RungeKutta4,
}

impl Integrator {
    /// Returns the name, as files and Python have it: `"semi_implicit_euler"`, `"runge_kutta_4"` and so on.
    pub fn name(self) -> &'static str {
        match self {
            Self::SemiImplicitEuler => "semi_implicit_euler",
            Self::RungeKutta2 => "runge_kutta_2",
            Self::RungeKutta3 => "runge_kutta_3",
            Self::RungeKutta4 => "runge_kutta_4",
        }
    }
}

/// Writes the integrator by its usual name.
impl fmt::Display for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::SemiImplicitEuler => "semi-implicit Euler",
            Self::RungeKutta2 => "Runge–Kutta 2",
            Self::RungeKutta3 => "Runge–Kutta 3",
            Self::RungeKutta4 => "Runge–Kutta 4",
        })
    }
}
