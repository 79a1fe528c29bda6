//! Integration rules, which compute the next state of a knot from its accelerations.

use core::fmt;

/// Integration rule, which computes the next state of a knot from its accelerations.
///
/// As in Crocoddyl, the Runge–Kutta methods add velocities at different configurations as if the configurations were a
/// vector space. For the rotation of a free-flyer, these methods are therefore only of first order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Integrator {
    /// Semi-implicit Euler rule, v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²): 1 evaluation; symplectic. Crocoddyl's
    /// `IntegratedActionModelEuler`.
    SemiImplicitEuler,
    /// Midpoint rule, 2 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_2"))]
    RungeKutta2,
    /// Heun's rule of third order, 3 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_3"))]
    RungeKutta3,
    /// Classical Runge–Kutta rule of fourth order, 4 evaluations.
    #[cfg_attr(feature = "serde", serde(rename = "runge_kutta_4"))]
    RungeKutta4,
}

impl Integrator {
    /// Returns the name that files and Python use, for example `"semi_implicit_euler"` or `"runge_kutta_4"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::SemiImplicitEuler => "semi_implicit_euler",
            Self::RungeKutta2 => "runge_kutta_2",
            Self::RungeKutta3 => "runge_kutta_3",
            Self::RungeKutta4 => "runge_kutta_4",
        }
    }
}

/// Writes the integrator's usual name.
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
