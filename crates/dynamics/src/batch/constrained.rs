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
    /// Forward dynamics under constraints in many states: see [`Constrained`](crate::Constrained).
    BatchConstrained of Constrained {
        /// q̈, nv numbers for each state.
        a: &'b [T] = [NV];
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T] = [ROWS];
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T] = [];
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T] = [];
    }

    /// Forward dynamics under constraints and its derivatives in many states: see
    /// [`ConstrainedDerivatives`](crate::ConstrainedDerivatives).
    BatchConstrainedDerivatives of ConstrainedDerivatives {
        /// q̈, nv numbers for each state.
        a: &'b [T] = [NV];
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T] = [ROWS];
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T] = [];
        /// The number of rows of J of each state that depend on rows before them.
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
        /// Λ = (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T> = [ROWS, ROWS];
    }

    /// Forward dynamics under constraints and its equations, differentiated, in many states: see
    /// [`ConstrainedEquations`](crate::ConstrainedEquations).
    BatchConstrainedEquations of ConstrainedEquations {
        /// q̈, nv numbers for each state.
        a: &'b [T] = [NV];
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T] = [ROWS];
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T] = [];
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T] = [];
        /// M, nv × nv.
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

    /// Impacts in many states: see [`Impulse`](crate::Impulse).
    BatchImpulse of Impulse {
        /// v⁺, nv numbers for each state.
        v: &'b [T] = [NV];
        /// Λ, as many numbers for each state as there are rows.
        lambda: &'b [T] = [ROWS];
        /// The largest number in J (v⁺ + ε v) of each state.
        residual: &'b [T] = [];
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T] = [];
    }

    /// Impacts and their derivatives in many states: see [`ImpulseDerivatives`](crate::ImpulseDerivatives).
    BatchImpulseDerivatives of ImpulseDerivatives {
        /// v⁺, nv numbers for each state.
        v: &'b [T] = [NV];
        /// Λ, as many numbers for each state as there are rows.
        lambda: &'b [T] = [ROWS];
        /// The largest number in J (v⁺ + ε v) of each state.
        residual: &'b [T] = [];
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T] = [];
        /// ∂v⁺/∂q in the tangent space, nv × nv.
        dv_dq: Matrices<'b, T> = [NV, NV];
        /// ∂v⁺/∂v, nv × nv.
        dv_dv: Matrices<'b, T> = [NV, NV];
        /// ∂Λ/∂q in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T> = [ROWS, NV];
        /// ∂Λ/∂v, rows × nv.
        dlambda_dv: Matrices<'b, T> = [ROWS, NV];
        /// (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T> = [ROWS, ROWS];
    }
}

batched! {
    /// [`constrained_dynamics`](crate::constrained_dynamics()) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`aba`](Self::aba), or if `constraints` were made for another model or by a batch for another number of threads.
    fn constrained_dynamics(model, data, constraints: BatchConstraints; q, v, tau, f_ext) -> BatchConstrained<'_, T> {
        constrained_dynamics(model, data, constraints, q, v, tau, f_ext)
    }

    /// [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives()) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_derivatives(model, data, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedDerivatives<'_, T> {
        constrained_dynamics_derivatives(model, data, constraints, q, v, tau, f_ext)
    }

    /// [`constrained_dynamics_equations`](crate::constrained_dynamics_equations) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_equations(model, data, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedEquations<'_, T> {
        constrained_dynamics_equations(model, data, constraints, q, v, tau, f_ext)
    }

    /// [`impulse_dynamics`](crate::impulse_dynamics()) of each state.
    ///
    /// q: nq numbers a state; v: nv; restitution: ε.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics(model, data, constraints: BatchConstraints; q, v; restitution: f64) -> BatchImpulse<'_, T> {
        impulse_dynamics(model, data, constraints, q, v, S::splat(restitution))
    }

    /// [`impulse_dynamics_derivatives`](crate::impulse_dynamics_derivatives()) of each state.
    ///
    /// q: nq numbers a state; v: nv; restitution: ε.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics_derivatives(model, data, constraints: BatchConstraints; q, v; restitution: f64)
    -> BatchImpulseDerivatives<'_, T> {
        impulse_dynamics_derivatives(model, data, constraints, q, v, S::splat(restitution))
    }
}
