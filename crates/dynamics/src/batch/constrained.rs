//! Dynamics under constraints and impacts of many states, with their derivatives.

use super::results::{Matrices, Take, Taken, results};
use super::table::{NV, ROWS, batched};
use crate::calls::constrained_dynamics::{
    constrained_dynamics, constrained_dynamics_derivatives, constrained_dynamics_equations,
};
use crate::calls::impulse_dynamics::{impulse_dynamics, impulse_dynamics_derivatives};
use condyle_spatial::block::Real;

results! {
    /// Forward dynamics under constraints in many states: see [`Constrained`](crate::Constrained).
    BatchConstrained {
        /// q̈, nv numbers for each state.
        a: &'b [T],
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T],
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T],
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T],
    }

    /// Forward dynamics under constraints and its derivatives in many states: see
    /// [`ConstrainedDerivatives`](crate::ConstrainedDerivatives).
    BatchConstrainedDerivatives {
        /// q̈, nv numbers for each state.
        a: &'b [T],
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T],
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T],
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T],
        /// ∂q̈/∂q in the tangent space, nv × nv.
        da_dq: Matrices<'b, T>,
        /// ∂q̈/∂v, nv × nv.
        da_dv: Matrices<'b, T>,
        /// ∂q̈/∂τ, nv × nv.
        da_dtau: Matrices<'b, T>,
        /// ∂λ/∂q in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T>,
        /// ∂λ/∂v, rows × nv.
        dlambda_dv: Matrices<'b, T>,
        /// ∂λ/∂τ, rows × nv.
        dlambda_dtau: Matrices<'b, T>,
        /// Λ = (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T>,
    }

    /// Forward dynamics under constraints and its equations, differentiated, in many states: see
    /// [`ConstrainedEquations`](crate::ConstrainedEquations).
    BatchConstrainedEquations {
        /// q̈, nv numbers for each state.
        a: &'b [T],
        /// λ, as many numbers for each state as there are rows.
        lambda: &'b [T],
        /// The largest number in J q̈ + γ of each state.
        residual: &'b [T],
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T],
        /// M, nv × nv.
        M: Matrices<'b, T>,
        /// ∂(M q̈ + h − Jᵀ λ)/∂q in the tangent space, nv × nv.
        dtau_dq: Matrices<'b, T>,
        /// ∂h/∂v, nv × nv.
        dtau_dv: Matrices<'b, T>,
        /// ∂(J q̈ + γ)/∂q in the tangent space, rows × nv.
        dgamma_dq: Matrices<'b, T>,
        /// ∂γ/∂v, rows × nv.
        dgamma_dv: Matrices<'b, T>,
    }

    /// Impacts in many states: see [`Impulse`](crate::Impulse).
    BatchImpulse {
        /// v⁺, nv numbers for each state.
        v: &'b [T],
        /// Λ, as many numbers for each state as there are rows.
        lambda: &'b [T],
        /// The largest number in J (v⁺ + ε v) of each state.
        residual: &'b [T],
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T],
    }

    /// Impacts and their derivatives in many states: see [`ImpulseDerivatives`](crate::ImpulseDerivatives).
    BatchImpulseDerivatives {
        /// v⁺, nv numbers for each state.
        v: &'b [T],
        /// Λ, as many numbers for each state as there are rows.
        lambda: &'b [T],
        /// The largest number in J (v⁺ + ε v) of each state.
        residual: &'b [T],
        /// The number of rows of J of each state that depend on rows before them.
        redundant: &'b [T],
        /// ∂v⁺/∂q in the tangent space, nv × nv.
        dv_dq: Matrices<'b, T>,
        /// ∂v⁺/∂v, nv × nv.
        dv_dv: Matrices<'b, T>,
        /// ∂Λ/∂q in the tangent space, rows × nv.
        dlambda_dq: Matrices<'b, T>,
        /// ∂Λ/∂v, rows × nv.
        dlambda_dv: Matrices<'b, T>,
        /// (J M⁻¹ Jᵀ)⁻¹, rows × rows.
        inertia: Matrices<'b, T>,
    }
}

batched! {
    /// [`constrained_dynamics`](crate::constrained_dynamics()) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`aba`](Self::aba), or if `constraints` were made for another model or by a batch for another number of threads.
    fn constrained_dynamics(model, data, to, constraints: BatchConstraints; q, v, tau, f_ext) -> BatchConstrained<'_, T>
    [[NV], [ROWS], [], []] {
        let d = constrained_dynamics(model, data, constraints, q, v, tau, f_ext);
        to.numbers(d.a);
        to.numbers(d.lambda);
        to.numbers(&[d.residual]);
        to.numbers(&[d.redundant]);
    }

    /// [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives()) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_derivatives(model, data, to, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedDerivatives<'_, T>
    [[NV], [ROWS], [], [], [NV, NV], [NV, NV], [NV, NV], [ROWS, NV], [ROWS, NV], [ROWS, NV], [ROWS, ROWS]] {
        let d = constrained_dynamics_derivatives(model, data, constraints, q, v, tau, f_ext);
        to.numbers(d.a);
        to.numbers(d.lambda);
        to.numbers(&[d.residual]);
        to.numbers(&[d.redundant]);
        to.matrix(d.da_dq);
        to.matrix(d.da_dv);
        to.matrix(d.da_dtau);
        to.matrix(d.dlambda_dq);
        to.matrix(d.dlambda_dv);
        to.matrix(d.dlambda_dtau);
        to.matrix(d.inertia);
    }

    /// [`constrained_dynamics_equations`](crate::constrained_dynamics_equations) of each state.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn constrained_dynamics_equations(model, data, to, constraints: BatchConstraints; q, v, tau, f_ext)
    -> BatchConstrainedEquations<'_, T>
    [[NV], [ROWS], [], [], [NV, NV], [NV, NV], [NV, NV], [ROWS, NV], [ROWS, NV]] {
        let d = constrained_dynamics_equations(model, data, constraints, q, v, tau, f_ext);
        to.numbers(d.a);
        to.numbers(d.lambda);
        to.numbers(&[d.residual]);
        to.numbers(&[d.redundant]);
        to.matrix(d.M);
        to.matrix(d.dtau_dq);
        to.matrix(d.dtau_dv);
        to.matrix(d.dgamma_dq);
        to.matrix(d.dgamma_dv);
    }

    /// [`impulse_dynamics`](crate::impulse_dynamics()) of each state.
    ///
    /// q: nq numbers a state; v: nv; restitution: ε.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics(model, data, to, constraints: BatchConstraints; q, v; restitution: f64) -> BatchImpulse<'_, T>
    [[NV], [ROWS], [], []] {
        let d = impulse_dynamics(model, data, constraints, q, v, S::splat(restitution));
        to.numbers(d.v);
        to.numbers(d.lambda);
        to.numbers(&[d.residual]);
        to.numbers(&[d.redundant]);
    }

    /// [`impulse_dynamics_derivatives`](crate::impulse_dynamics_derivatives()) of each state.
    ///
    /// q: nq numbers a state; v: nv; restitution: ε.
    ///
    /// # Panics
    /// As [`constrained_dynamics`](Self::constrained_dynamics).
    fn impulse_dynamics_derivatives(model, data, to, constraints: BatchConstraints; q, v; restitution: f64)
    -> BatchImpulseDerivatives<'_, T>
    [[NV], [ROWS], [], [], [NV, NV], [NV, NV], [ROWS, NV], [ROWS, NV], [ROWS, ROWS]] {
        let d = impulse_dynamics_derivatives(model, data, constraints, q, v, S::splat(restitution));
        to.numbers(d.v);
        to.numbers(d.lambda);
        to.numbers(&[d.residual]);
        to.numbers(&[d.redundant]);
        to.matrix(d.dv_dq);
        to.matrix(d.dv_dv);
        to.matrix(d.dlambda_dq);
        to.matrix(d.dlambda_dv);
        to.matrix(d.inertia);
    }
}
