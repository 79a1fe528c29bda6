//! Dynamics under constraints and impacts of many states, with their derivatives.

use super::places::{Places, Put};
use super::results::{Matrices, Take, Taken, results};
use super::table::{NV, ROWS, batched};
use crate::calls::constrained_dynamics::{
    Constrained, ConstrainedDerivatives, ConstrainedEquations, constrained_dynamics, constrained_dynamics_derivatives,
    constrained_dynamics_equations,
};
use crate::calls::impulse_dynamics::{Impulse, ImpulseDerivatives, impulse_dynamics, impulse_dynamics_derivatives};
use condyle_spatial::block::Real;

results! {
    /// Forward dynamics under constraints of many states: see [`Constrained`](crate::Constrained).
    BatchConstrained of Constrained {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Constraint forces λ, one number per row of J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value in J q̈ + γ.
        residual: &'b [T] = [];
        /// Number of rows of J that depend on earlier rows, for each state.
        redundant: &'b [T] = [];
    }

    /// Forward dynamics of many states under constraints, with derivatives: see
    /// [`ConstrainedDerivatives`](crate::ConstrainedDerivatives).
    BatchConstrainedDerivatives of ConstrainedDerivatives {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Constraint forces λ, one number per row of J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value in J q̈ + γ.
        residual: &'b [T] = [];
        /// Number of rows of J that depend on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// ∂q̈/∂q in the tangent space, nv × nv.
        da_dq: Matrices<'b, T> = [NV, NV];
        /// ∂q̈/∂v, nv × nv.
        da_dv: Matrices<'b, T> = [NV, NV];
        /// ∂q̈/∂τ, nv × nv.
        da_dtau: Matrices<'b, T> = [NV, NV];
        /// ∂λ/∂q in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T> = [ROWS, NV];
        /// ∂λ/∂v, rows × nv.
        dlambda_dv: Matrices<'b, T> = [ROWS, NV];
        /// ∂λ/∂τ, rows × nv.
        dlambda_dtau: Matrices<'b, T> = [ROWS, NV];
        /// Inertia of the constraints, Λ = (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T> = [ROWS, ROWS];
    }

    /// Forward dynamics of many states under constraints, with the linearised equations: see
    /// [`ConstrainedEquations`](crate::ConstrainedEquations).
    BatchConstrainedEquations of ConstrainedEquations {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Constraint forces λ, one number per row of J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value in J q̈ + γ.
        residual: &'b [T] = [];
        /// Number of rows of J that depend on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// Inertia matrix M, nv × nv.
        M: Matrices<'b, T> = [NV, NV];
        /// ∂(M q̈ + h − Jᵀ λ)/∂q in the tangent space, nv × nv.
        dtau_dq: Matrices<'b, T> = [NV, NV];
        /// ∂h/∂v, nv × nv.
        dtau_dv: Matrices<'b, T> = [NV, NV];
        /// ∂(J q̈ + γ)/∂q in the tangent space, rows × nv.
        dgamma_dq: Matrices<'b, T> = [ROWS, NV];
        /// ∂γ/∂v, rows × nv.
        dgamma_dv: Matrices<'b, T> = [ROWS, NV];
    }

    /// Impacts of many states: see [`Impulse`](crate::Impulse).
    BatchImpulse of Impulse {
        /// Velocities v⁺ after the impact, nv numbers per state.
        v: &'b [T] = [NV];
        /// Impulses Λ, one number per row of J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value in J (v⁺ + ε v).
        residual: &'b [T] = [];
        /// Number of rows of J that depend on earlier rows, for each state.
        redundant: &'b [T] = [];
    }

    /// Impacts of many states and their derivatives: see [`ImpulseDerivatives`](crate::ImpulseDerivatives).
    BatchImpulseDerivatives of ImpulseDerivatives {
        /// Velocities v⁺ after the impact, nv numbers per state.
        v: &'b [T] = [NV];
        /// Impulses Λ, one number per row of J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value in J (v⁺ + ε v).
        residual: &'b [T] = [];
        /// Number of rows of J that depend on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// ∂v⁺/∂q in the tangent space, nv × nv.
        dv_dq: Matrices<'b, T> = [NV, NV];
        /// ∂v⁺/∂v, nv × nv.
        dv_dv: Matrices<'b, T> = [NV, NV];
        /// ∂Λ/∂q in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T> = [ROWS, NV];
        /// ∂Λ/∂v, rows × nv.
        dlambda_dv: Matrices<'b, T> = [ROWS, NV];
        /// Inertia of the constraints, (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T> = [ROWS, ROWS];
    }
}

batched! {
    /// Computes [`constrained_dynamics`](crate::constrained_dynamics()) for each state.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// In the same cases as [`aba`](Self::aba), or if `constraints` were made for another model, or by a batch with
    /// another number of threads.
    fn constrained_dynamics(model, data, constraints: BatchConstraints; q, v, tau, f_ext) -> BatchConstrained<'_, T> {
        constrained_dynamics(model, data, constraints, q, v, tau, f_ext)
    }

    /// Computes [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives()) for each state.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// In the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_derivatives(model, data, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedDerivatives<'_, T> {
        constrained_dynamics_derivatives(model, data, constraints, q, v, tau, f_ext)
    }

    /// Computes [`constrained_dynamics_equations`](crate::constrained_dynamics_equations) for each state.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// In the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_equations(model, data, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedEquations<'_, T> {
        constrained_dynamics_equations(model, data, constraints, q, v, tau, f_ext)
    }

    /// Computes [`impulse_dynamics`](crate::impulse_dynamics()) for each state.
    ///
    /// q: nq numbers per state; v: nv numbers per state; restitution: ε, the same for all states.
    ///
    /// # Panics
    /// In the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics(model, data, constraints: BatchConstraints; q, v; restitution: f64) -> BatchImpulse<'_, T> {
        impulse_dynamics(model, data, constraints, q, v, S::splat(restitution))
    }

    /// Computes [`impulse_dynamics_derivatives`](crate::impulse_dynamics_derivatives()) for each state.
    ///
    /// q: nq numbers per state; v: nv numbers per state; restitution: ε, the same for all states.
    ///
    /// # Panics
    /// In the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics_derivatives(model, data, constraints: BatchConstraints; q, v; restitution: f64)
    -> BatchImpulseDerivatives<'_, T> {
        impulse_dynamics_derivatives(model, data, constraints, q, v, S::splat(restitution))
    }
}
