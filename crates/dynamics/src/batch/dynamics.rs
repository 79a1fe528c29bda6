//! Batch functions for the dynamics of many states, and for regressors.

use super::group::{M, MINV};
use super::results::Matrices;
use super::table::{NV, PARAMETERS, batched};
use crate::calls::forward_dynamics::{aba, forward_dynamics};
use crate::calls::inertia::{crba, minv};
use crate::calls::inverse_dynamics::{coriolis_matrix, gravity, nonlinear_effects, rnea, static_torque};
use crate::calls::regressor::{joint_torque_regressor, kinetic_energy_regressor, potential_energy_regressor};
use crate::passes::factored_dynamics::ForwardDynamicsMethod;
use crate::passes::passive::passive_torque;

batched! {
    /// Computes [`rnea`](crate::rnea()) for each state: τ, nv numbers.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state; f_ext: for each state, one force per body in the body's
    /// frame; empty for no forces.
    ///
    /// # Panics
    /// Panics if an argument has the wrong length, the number of states exceeds the capacity, or the batch was made for
    /// a model with another tree. All other functions of a batch panic in these cases, too.
    fn rnea(model, data; q, v, a, f_ext) -> &[T] [[NV]] { rnea(model, data, q, v, a, f_ext) }

    /// Computes [`nonlinear_effects`](crate::nonlinear_effects) for each state: h, nv numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn nonlinear_effects(model, data; q, v) -> &[T] [[NV]] { nonlinear_effects(model, data, q, v) }

    /// Computes [`gravity`](crate::gravity) for each state: g, nv numbers.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn gravity(model, data; q) -> &[T] [[NV]] { gravity(model, data, q) }

    /// Computes [`static_torque`](crate::static_torque()) for each state: τ, nv numbers.
    ///
    /// q: nq numbers per state; f_ext: for each state, one force per body in the body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn static_torque(model, data; q, f_ext) -> &[T] [[NV]] { static_torque(model, data, q, f_ext) }

    /// Computes [`coriolis_matrix`](crate::coriolis_matrix) for each state: C, nv × nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn coriolis_matrix(model, data; q, v) -> Matrices<'_, T> [[NV, NV]] { coriolis_matrix(model, data, q, v) }

    /// Computes [`aba`](crate::aba()) for each state: q̈, nv numbers.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if M is singular
    /// ([`Model::singular_joints`](crate::Model::singular_joints)).
    fn aba(model, data; q, v, tau, f_ext) -> &[T] [[NV]] { aba(model, data, q, v, tau, f_ext) }

    /// Computes [`forward_dynamics`](crate::forward_dynamics()) for each state by a given method: q̈, nv numbers.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`aba`](Self::aba).
    fn forward_dynamics(model, data; q, v, tau, f_ext; method: Option<ForwardDynamicsMethod>) -> &[T] [[NV]] {
        forward_dynamics(model, data, q, v, tau, f_ext, method)
    }

    /// Computes [`crba`](crate::crba()) for each state: M, nv × nv.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn crba(model, data => to; q) keeps [crba.M: M] -> Matrices<'_, T> [[NV, NV]] { crba(model, data, q); }

    /// Computes [`minv`](crate::minv()) for each state: M⁻¹, nv × nv.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`aba`](Self::aba).
    fn minv(model, data => to; q) keeps [minv.Minv: MINV] -> Matrices<'_, T> [[NV, NV]] { minv(model, data, q); }

    /// Computes [`passive_torque`](crate::passive_torque) for each state: τ, nv numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state; smoothing: ε > 0, the same for all states.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if `smoothing` is not positive.
    fn passive_torque(model, data; q, v; smoothing: f64) with wide -> &[T] [[NV]] {
        let tau = &mut wide[..v.len()];
        passive_torque(model, q, v, smoothing, tau);
        &*tau
    }

    /// Computes [`joint_torque_regressor`](crate::joint_torque_regressor) for each state: Y, nv × 10 (bodies − 1).
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn joint_torque_regressor(model, data; q, v, a) -> Matrices<'_, T> [[NV, PARAMETERS]] {
        joint_torque_regressor(model, data, q, v, a)
    }

    /// Computes [`kinetic_energy_regressor`](crate::kinetic_energy_regressor) for each state: y, 10 (bodies − 1)
    /// numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn kinetic_energy_regressor(model, data; q, v) -> &[T] [[PARAMETERS]] {
        kinetic_energy_regressor(model, data, q, v)
    }

    /// Computes [`potential_energy_regressor`](crate::potential_energy_regressor) for each state: y, 10 (bodies − 1)
    /// numbers.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn potential_energy_regressor(model, data; q) -> &[T] [[PARAMETERS]] { potential_energy_regressor(model, data, q) }
}
