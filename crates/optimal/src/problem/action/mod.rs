//! Action: dynamics and cost of one knot.

pub(crate) mod differences;
pub(crate) mod quasi_static;

use super::group::{GroupModel, KnotGroup};
use crate::lq::{Hessian, LqKnot};
use std::any::Any;

/// Dynamics x⁺ = φₜ(x, u) and cost ℓₜ(x, u) of the knots t that use this action.
///
/// An implementation must write the sizes and [`calc`](Self::calc). It may write [`calc_diff`](Self::calc_diff) as
/// well, which is faster than the default derivatives. Each method receives the index t of its knot in the horizon. One
/// model can therefore serve all knots that differ only in a reference (a foot's trajectory, a tracked posture). An
/// action that computes several knots in one call also implements [`GroupModel`].
///
/// # The terminal knot
/// A terminal action has nu = 0 and only a cost. It is called like any other action, but the solver never reads its
/// outputs `next` and `A`, so it need not write them.
///
/// # Rules for implementations
/// - The results depend only on the arguments, not on earlier calls.
/// - Each method writes all entries of its outputs, including entries that are always zero. The outputs may contain any
///   old values.
/// - No method panics on an extreme state. The result may be infinite or NaN; the solver then tries a shorter step.
/// - No method allocates, so that a solve does not allocate.
///
/// # Examples
/// The double integrator x⁺ = x + Δt (v, u) with the cost ½ Δt (‖x‖² + u²):
/// ```
/// use condyle_optimal::{ActionModel, LqKnot};
///
/// struct DoubleIntegrator { dt: f64 }
///
/// impl ActionModel for DoubleIntegrator {
///     fn nx(&self) -> usize { 2 }
///     fn nu(&self) -> usize { 1 }
///     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
///         next[0] = x[0] + self.dt * x[1];
///         next[1] = x[1] + self.dt * u[0];
///         0.5 * self.dt * (x[0] * x[0] + x[1] * x[1] + u[0] * u[0])
///     }
///     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
///         knot.A.copy_from_slice(&[1.0, 0.0, self.dt, 1.0]); // column after column
///         knot.B.copy_from_slice(&[0.0, self.dt]);
///         knot.Q.copy_from_slice(&[self.dt, 0.0, 0.0, self.dt]);
///         knot.S.fill(0.0);
///         knot.R[0] = self.dt;
///         knot.q.copy_from_slice(&[self.dt * x[0], self.dt * x[1]]);
///         knot.r[0] = self.dt * u[0];
///     }
/// }
///
/// let mut next = [0.0; 2];
/// DoubleIntegrator { dt: 0.5 }.calc(0, &[3.0, 4.0], &[1.0], &mut next);
/// assert_eq!(next, [5.0, 4.5]);
/// ```
pub trait ActionModel: Any + Send + Sync {
    /// Returns the number of entries of a state x.
    fn nx(&self) -> usize;

    /// Returns the number of entries of a change of state δx. The default is nx, for states in a vector space.
    fn ndx(&self) -> usize {
        self.nx()
    }

    /// Returns the number of entries of a control u. It is zero at a terminal knot and at an impact, where only the
    /// state jumps.
    fn nu(&self) -> usize;

    /// Returns whether the action has no next state. Such an action may serve only the terminal knot. The default is
    /// false: the action may serve any knot.
    fn is_terminal(&self) -> bool {
        false
    }

    /// Returns the lower and upper bounds of the controls of knot t, nu entries each, infinite for an unbounded
    /// control. Returns `None` if no control is bounded. The bounds must not change during a solve.
    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        let _ = t;
        None
    }

    /// Returns the wrapped action, if this action adds something to another one that it wraps. Typed access to a
    /// robot's costs and forces ([`Problem::cost_mut`](crate::Problem::cost_mut),
    /// [`Problem::motion`](crate::Problem::motion)) uses the wrapped action. The default is `None`.
    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        None
    }

    /// Computes the next state x⁺ = φₜ(x, u) into `next` (nx), and returns the cost ℓₜ(x, u).
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64;

    /// Computes the derivatives of dynamics and cost at (x, u), in the tangent space of the state. They are A = ∂x⁺/∂x,
    /// B = ∂x⁺/∂u, q = ∂ℓ/∂x, r = ∂ℓ/∂u, and the blocks Q, S, R of the Hessian of ℓ or of its Gauss–Newton
    /// approximation. The solver writes the gap f.
    ///
    /// The default takes central differences of [`calc`](Self::calc), as [`NumDiff`](crate::NumDiff) does. Differences
    /// are slow and allocate. Their first derivatives are accurate to about 1e-9, their Hessian to about 1e-7.
    /// [`AutoDiff`](crate::AutoDiff) computes exact derivatives of functions that are generic over the scalar type.
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        differences::calc_diff(self, t, x, u, knot);
    }

    /// Computes the second derivatives of ψ(δx, δu) = λᵀ (φₜ(x ⊕ δx, u + δu) ⊖ φₜ(x, u)) at zero into `hessian`, for
    /// `lambda` of length ndx. Returns whether they were computed. If not, the dynamics count as linear around each
    /// iterate (Gauss–Newton). Without [`second_order`](crate::Settings::second_order), this method is not called and
    /// the dynamics count as linear.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let _ = (t, x, u, lambda, hessian);
        false
    }

    /// Returns this action as a [`GroupModel`], if its type implements that trait; `None` by default.
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        None
    }

    /// Returns this action as a `KnotGroup`, a trait that only actions of this crate implement; `None` by default.
    #[doc(hidden)]
    fn knot_group(&self) -> Option<&dyn KnotGroup> {
        None
    }

    /// Returns the same group as [`knot_group`](Self::knot_group), as a mutable reference.
    #[doc(hidden)]
    fn knot_group_mut(&mut self) -> Option<&mut dyn KnotGroup> {
        None
    }

    /// Returns the controls that hold the state x of knot t still: φ(x, u) = x, as nearly as controls can achieve. The
    /// default makes at most 100 Newton steps, u ← u − B⁺ (φ(x, u) ⊖ x), as Crocoddyl does. A robot's action computes
    /// them by statics. Allocates.
    fn quasi_static(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        quasi_static::newton(self, t, x)
    }

    /// Notifies the action that the horizon has [moved](crate::Problem::shift) by one knot: the data of knot t now
    /// belong to knot t − 1. Does nothing by default. Must not allocate.
    fn shift(&mut self) {}

    /// Returns a copy that computes the same results, for another thread or another problem; `None` by default. Without
    /// a copy, the derivatives of the action are computed on one thread, whatever the setting
    /// [`threads`](crate::Settings::threads). Without a copy, a problem with this action cannot be copied either
    /// ([`Problem::try_clone`](crate::Problem::try_clone)).
    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        None
    }

    /// Checks a state, for example the length of a quaternion. All states are valid by default. A problem checks its
    /// initial state, and a solver checks the states of its warm start.
    ///
    /// # Errors
    /// A text that describes the fault of an invalid state and contains the invalid numbers.
    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        let _ = x;
        Ok(())
    }

    /// Computes x ⊕ δx into `out` (nx). The default is the sum x + δx, for states in a vector space.
    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        for ((o, x), dx) in out.iter_mut().zip(x).zip(dx) {
            *o = x + dx;
        }
    }

    /// Computes x₁ ⊖ x₀ into `out` (ndx): the δ with x₀ ⊕ δ = x₁. The default is x₁ − x₀, for states in a vector space.
    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        for ((o, x0), x1) in out.iter_mut().zip(x0).zip(x1) {
            *o = x1 - x0;
        }
    }
}
