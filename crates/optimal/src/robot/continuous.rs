//! Dynamics in continuous time. An integrator turns them into knots.

use crate::lq::{Hessian, LqKnot};
use core::any::Any;
use core::ops::Range;
use nalgebra::DMatrix;

/// Dynamics in continuous time: acceleration q̈ = a(q, v, u) and cost ℓ(x, u) per second, with x = (q, v).
///
/// [`Integrated`](super::Integrated) turns such dynamics into a knot. The models of a robot are
/// [`FreeAcceleration`](super::FreeAcceleration), [`ContactAcceleration`](super::ContactAcceleration),
/// [`ControlledAcceleration`](super::ControlledAcceleration) and
/// [`ControlledContactAcceleration`](super::ControlledContactAcceleration). Implement this trait for any other system
/// whose dynamics are accelerations.
///
/// ```
/// use condyle_optimal::robot::{ContinuousModel, Derivatives, Integrated, Integrator, KnotInput};
/// use condyle_optimal::{ActionModel, LqKnot};
/// use nalgebra::DMatrix;
///
/// /// A mass on a spring, q̈ = u − q, with the cost ½ (q² + u²) per second.
/// struct Spring { da_dq: DMatrix<f64>, da_dv: DMatrix<f64>, a: [f64; 1] }
///
/// impl ContinuousModel for Spring {
///     fn nq(&self) -> usize { 1 }
///     fn nv(&self) -> usize { 1 }
///     fn nu(&self) -> usize { 1 }
///     fn calc(&mut self, KnotInput { x, u, .. }: KnotInput<'_>) -> (&[f64], f64) {
///         self.a = [u[0] - x[0]];
///         (&self.a, 0.5 * (x[0] * x[0] + u[0] * u[0]))
///     }
///     fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
///         let KnotInput { x, u, .. } = input;
///         self.a = [u[0] - x[0]];
///         knot.Q.copy_from_slice(&[scale, 0.0, 0.0, 0.0]);
///         (knot.q[0], knot.q[1], knot.r[0], knot.R[0]) = (scale * x[0], 0.0, scale * u[0], scale);
///         knot.S.fill(0.0);
///         Derivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_du: &[1.0] }
///     }
/// }
///
/// let (da_dq, da_dv) = (DMatrix::from_element(1, 1, -1.0), DMatrix::zeros(1, 1));
/// let mut knot = Integrated::new(Spring { da_dq, da_dv, a: [0.0] }, Integrator::RungeKutta4, 0.1)?;
/// let mut next = [0.0; 2];
/// knot.calc(0, &[1.0, 0.0], &[0.0], &mut next);
/// assert!((next[0] - 0.1_f64.cos()).abs() < 1e-7);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub trait ContinuousModel: Send + Sync + 'static {
    /// Returns the number of entries of a position q.
    fn nq(&self) -> usize;

    /// Returns the number of entries of a velocity v.
    fn nv(&self) -> usize;

    /// Returns the number of controls.
    fn nu(&self) -> usize;

    /// Returns the acceleration a(x, u), nv entries, and the cost ℓ(x, u) per second.
    fn calc(&mut self, input: KnotInput<'_>) -> (&[f64], f64);

    /// Returns the derivatives of the acceleration a. Overwrites q, r, Q, S and R of the knot with the derivatives of
    /// `scale` · ℓ, where ℓ is the cost per second.
    fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_>;

    /// Computes the second derivatives of ψ = μᵀ a(q ⊕ δq, v + δv, u + δu) into `hessian`, where μ is `mu` (nv
    /// entries). Returns the first derivatives of the acceleration a. The default returns `None`: solvers then treat a
    /// as linear, even if [`second_order`](crate::Settings::second_order) is set.
    fn hessian(&mut self, input: KnotInput<'_>, mu: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
        let _ = (input, mu, hessian);
        None
    }

    /// Notifies the model that the horizon has moved by one knot, see
    /// [`ActionModel::shift`](crate::ActionModel::shift). Does nothing by default.
    fn shift(&mut self) {}

    /// Calls `show` for each vector that the dynamics compute, with its name and its entries. The default shows only
    /// `acceleration`.
    fn outputs(&mut self, input: KnotInput<'_>, show: &mut dyn FnMut(&str, &[f64])) {
        show("acceleration", self.calc(input).0);
    }

    /// Returns the controls that hold the state x still, computed from statics. The default returns `None`: the solver
    /// then computes them by Newton steps.
    fn quasi_static(&mut self, x: &[f64]) -> Option<Vec<f64>> {
        let _ = x;
        None
    }

    /// Returns a copy that computes the same results: see [`ActionModel::try_clone`](crate::ActionModel::try_clone).
    /// The default returns `None`.
    fn try_clone(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Returns the coordinates of each group of positions that is not a vector space, at most six in each group. For
    /// all other coordinates, q ⊕ δ is the sum q + δ. The default is empty.
    fn groups(&self) -> &[Range<usize>] {
        &[]
    }

    /// Checks a position, for example the length of a quaternion. All positions are valid by default.
    ///
    /// # Errors
    /// A description of the fault, including the invalid numbers.
    fn check_position(&self, q: &[f64]) -> Result<(), String> {
        let _ = q;
        Ok(())
    }

    /// Computes q ⊕ δq into `out` (nq entries).
    fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q[k] + dq[k]);
    }

    /// Computes q₁ ⊖ q₀ into `out` (nv entries).
    fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q1[k] - q0[k]);
    }

    /// Computes ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq, nv × nv each. Only the blocks of the [`groups`](Self::groups) are read.
    fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        let _ = (dq, by_q, by_dq);
    }

    /// Computes the second derivatives of θ(δ, ε) = λᵀ((q ⊕ δ) ⊕ (δq + ε) ⊖ (q ⊕ δq)) at zero into `hessian`. In the
    /// Hessian, δ has the blocks of the state and ε the blocks of the control, nv entries each. Only the blocks of the
    /// [`groups`](Self::groups) are read. Returns whether the derivatives were computed; the default returns false.
    /// With groups and without these derivatives, solvers treat a step as linear, even if
    /// [`second_order`](crate::Settings::second_order) is set.
    fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let _ = (dq, lambda, hessian);
        false
    }

    /// Returns the dynamics as a robot, if they belong to one. The knots of a robot are computed in groups.
    #[doc(hidden)]
    fn robot(&self) -> Option<&dyn Any> {
        None
    }

    /// Returns the same dynamics as [`robot`](Self::robot), as a mutable reference.
    #[doc(hidden)]
    fn robot_mut(&mut self) -> Option<&mut dyn Any> {
        None
    }
}

/// Index t of a knot in the horizon, with the knot's state x = (q, v) and controls u.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KnotInput<'a> {
    /// Index t of the knot.
    pub t: usize,
    /// State x.
    pub x: &'a [f64],
    /// Controls u.
    pub u: &'a [f64],
}

/// Result of [`ContinuousModel::calc_diff`]. If a knot is written in inverse-dynamics form, only `a` is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives<'d> {
    /// Acceleration a, nv entries.
    pub a: &'d [f64],
    /// Derivative ∂a/∂q in the tangent space, nv × nv.
    pub da_dq: &'d DMatrix<f64>,
    /// Derivative ∂a/∂v, nv × nv.
    pub da_dv: &'d DMatrix<f64>,
    /// Derivative ∂a/∂u, nv × nu, column after column.
    pub da_du: &'d [f64],
}
