//! Batch functions for dynamics under constraints and for impacts, with their derivatives.

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
        /// Constraint forces λ, one number per row of the constraint Jacobian J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value of the constraint accelerations J q̈ +
        /// γ.
        residual: &'b [T] = [];
        /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, for each state.
        redundant: &'b [T] = [];
    }

    /// Forward dynamics of many states under constraints, with derivatives: see
    /// [`ConstrainedDerivatives`](crate::ConstrainedDerivatives).
    BatchConstrainedDerivatives of ConstrainedDerivatives {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Constraint forces λ, one number per row of the constraint Jacobian J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value of the constraint accelerations J q̈ +
        /// γ.
        residual: &'b [T] = [];
        /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// Derivative ∂q̈/∂q of the joint accelerations in the tangent space, nv × nv.
        da_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂q̈/∂v of the joint accelerations, nv × nv.
        da_dv: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂q̈/∂τ of the joint accelerations, nv × nv.
        da_dtau: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂λ/∂q of the constraint forces in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T> = [ROWS, NV];
        /// Derivative ∂λ/∂v of the constraint forces, rows × nv.
        dlambda_dv: Matrices<'b, T> = [ROWS, NV];
        /// Derivative ∂λ/∂τ of the constraint forces, rows × nv.
        dlambda_dtau: Matrices<'b, T> = [ROWS, NV];
        /// Inertia of the constraints, Λ = (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T> = [ROWS, ROWS];
    }

    /// Forward dynamics of many states under constraints, with the linearised equations: see
    /// [`ConstrainedEquations`](crate::ConstrainedEquations).
    BatchConstrainedEquations of ConstrainedEquations {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Constraint forces λ, one number per row of the constraint Jacobian J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value of the constraint accelerations J q̈ +
        /// γ.
        residual: &'b [T] = [];
        /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// Inertia matrix M, nv × nv.
        M: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂(M q̈ + h − Jᵀ λ)/∂q of the equations of motion in the tangent space, nv × nv.
        dtau_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂h/∂v of the nonlinear effects, nv × nv.
        dtau_dv: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂(J q̈ + γ)/∂q of the constraint accelerations in the tangent space, rows × nv.
        dgamma_dq: Matrices<'b, T> = [ROWS, NV];
        /// Derivative ∂γ/∂v of the constraint accelerations, rows × nv.
        dgamma_dv: Matrices<'b, T> = [ROWS, NV];
    }

    /// Impacts of many states: see [`Impulse`](crate::Impulse).
    BatchImpulse of Impulse {
        /// Velocities v⁺ after the impact, nv numbers per state.
        v: &'b [T] = [NV];
        /// Constraint impulses Λ, one number per row of the constraint Jacobian J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value of J (v⁺ + ε v), for the velocities v
        /// before and v⁺ after the impact and the restitution ε.
        residual: &'b [T] = [];
        /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, for each state.
        redundant: &'b [T] = [];
    }

    /// Impacts of many states and their derivatives: see [`ImpulseDerivatives`](crate::ImpulseDerivatives).
    BatchImpulseDerivatives of ImpulseDerivatives {
        /// Velocities v⁺ after the impact, nv numbers per state.
        v: &'b [T] = [NV];
        /// Constraint impulses Λ, one number per row of the constraint Jacobian J, for each state.
        lambda: &'b [T] = [ROWS];
        /// Error of the constraints, for each state: the largest absolute value of J (v⁺ + ε v), for the velocities v
        /// before and v⁺ after the impact and the restitution ε.
        residual: &'b [T] = [];
        /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, for each state.
        redundant: &'b [T] = [];
        /// Derivative ∂v⁺/∂q of the velocity after the impact in the tangent space, nv × nv.
        dv_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂v⁺/∂v of the velocity after the impact, nv × nv.
        dv_dv: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂Λ/∂q of the impulses in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T> = [ROWS, NV];
        /// Derivative ∂Λ/∂v of the impulses, rows × nv.
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
    /// Panics in the same cases as [`aba`](Self::aba), or if `constraints` were made for another model, or by a batch
    /// with another number of threads.
    fn constrained_dynamics(model, data, constraints: BatchConstraints; q, v, tau, f_ext) -> BatchConstrained<'_, T> {
        constrained_dynamics(model, data, constraints, q, v, tau, f_ext)
    }

    /// Computes [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives()) for each state.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
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
    /// Panics in the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_equations(model, data, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedEquations<'_, T> {
        constrained_dynamics_equations(model, data, constraints, q, v, tau, f_ext)
    }

    /// Computes [`impulse_dynamics`](crate::impulse_dynamics()) for each state.
    ///
    /// q: nq numbers per state; v: nv numbers per state; restitution: ε, the same for all states.
    ///
    /// # Panics
    /// Panics in the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics(model, data, constraints: BatchConstraints; q, v; restitution: f64) -> BatchImpulse<'_, T> {
        impulse_dynamics(model, data, constraints, q, v, S::splat(restitution))
    }

    /// Computes [`impulse_dynamics_derivatives`](crate::impulse_dynamics_derivatives()) for each state.
    ///
    /// q: nq numbers per state; v: nv numbers per state; restitution: ε, the same for all states.
    ///
    /// # Panics
    /// Panics in the same cases as [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics_derivatives(model, data, constraints: BatchConstraints; q, v; restitution: f64)
    -> BatchImpulseDerivatives<'_, T> {
        impulse_dynamics_derivatives(model, data, constraints, q, v, S::splat(restitution))
    }
}
