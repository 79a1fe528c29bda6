//! One knot's dynamics and cost, asked for many knots at a time.

pub(crate) mod differences;
pub(crate) mod hold;

use super::multipliers::Visit;
use crate::error::assert_length;
use crate::lq::{Hessian, LqNode};
use std::any::Any;

/// The dynamics x⁺ = φₜ(x, u) and the cost ℓₜ(x, u) of the knots t that it serves.
///
/// Only the sizes and [`calc`](Self::calc) must be written; derivatives by hand are faster than the default ones. The
/// solver calls the methods for a **group**: consecutive knots of the horizon, or the trials of a line search at one knot.
/// Their defaults loop; an implementation that computes several states at a time in the lanes of a vector register
/// overrides them and says in [`lanes`](Self::lanes) how many states it likes to be given.
///
/// Each knot of a group comes with its index t in the horizon, so that one model can serve all knots that differ only
/// in a reference (a foot's path, a tracked posture) and these still make one group.
///
/// # The terminal knot
/// A terminal action has nu = 0 and only a cost. It is called like any other, but what it writes to `next` and `A` is
/// never read: it may leave them alone.
///
/// # Rules for implementations
/// - The result depends on the arguments only, not on what was called before.
/// - All of what a method returns is written, whatever was there; entries that are always zero too.
/// - Nothing panics on a state far away: let the result be infinite or NaN, and the solver tries a shorter step.
/// - Nothing is allocated, so that a solve allocates nothing either.
///
/// # Examples
/// The double integrator x⁺ = x + Δt (v, u) with the cost ½ Δt (‖x‖² + u²):
/// ```
/// use condyle_optimal::{ActionModel, LqNode};
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
///     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
///         node.A.copy_from_slice(&[1.0, 0.0, self.dt, 1.0]); // column after column
///         node.B.copy_from_slice(&[0.0, self.dt]);
///         node.Q.copy_from_slice(&[self.dt, 0.0, 0.0, self.dt]);
///         node.S.fill(0.0);
///         node.R[0] = self.dt;
///         node.q.copy_from_slice(&[self.dt * x[0], self.dt * x[1]]);
///         node.r[0] = self.dt * u[0];
///     }
/// }
///
/// let mut action = DoubleIntegrator { dt: 0.5 };
/// let (mut next, mut costs) = ([0.0; 4], [0.0; 2]);
/// action.calc_group(&[0, 1], &[1.0, 2.0, 3.0, 4.0], &[0.0, 1.0], &mut next, &mut costs);
/// assert_eq!(next, [2.0, 2.0, 5.0, 4.5]);
/// ```
pub trait ActionModel: Any + Send + Sync {
    /// The number of entries of a state x.
    fn nx(&self) -> usize;

    /// The number of entries of a change of state δx; nx unless the state lives on a manifold.
    fn ndx(&self) -> usize {
        self.nx()
    }

    /// The number of entries of a control u; zero at a terminal knot and at one that only jumps (an impact).
    fn nu(&self) -> usize;

    /// Whether there is no next state, so that the action may only serve the end of a horizon. Not by default: one may serve
    /// both.
    fn is_end(&self) -> bool {
        false
    }

    /// The number of states that a group call computes at the price of one; 1 unless it uses vector lanes.
    ///
    /// A line search tries so many step lengths side by side.
    fn lanes(&self) -> usize {
        1
    }

    /// The most dependent coordinates and the most rows of costs, for actions that can write their knots as equations of
    /// inverse dynamics.
    #[doc(hidden)]
    fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
        None
    }

    /// The least and the greatest controls of knot t, nu numbers each, infinite where there is none; `None` if no control
    /// is bounded. They must not change during a solve.
    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        let _ = t;
        None
    }

    /// The action that this one wraps, if it adds something to another one: typed access to a robot's costs and forces
    /// ([`Problem::cost_mut`](crate::Problem::cost_mut), [`Problem::motion`](crate::Problem::motion)) looks through. `None` by
    /// default.
    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        None
    }

    /// Shows the constraints of knot t, which have terms of an augmented Lagrangian in its cost, in their order.
    #[doc(hidden)]
    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        let _ = (t, visit);
    }

    /// Makes the memory in which the action computes, unless it is there: a problem asks for it when it is made.
    #[doc(hidden)]
    fn reserve(&mut self) {}

    /// Takes over the knots of another action that differs in costs, references and weights only, and says whether it did:
    /// then this action stands for the models of both, its own first, and the other is of no use. So the knots of a problem
    /// that has an action for each of them are computed in groups.
    #[doc(hidden)]
    fn merge(&mut self, other: &mut dyn ActionModel) -> bool {
        let _ = other;
        false
    }

    /// Chooses, of the models that this action stands for, the one that is to be changed.
    #[doc(hidden)]
    fn choose(&mut self, model: usize) {
        let _ = model;
    }

    /// Lets one of the models that this action stands for serve knot t of so many.
    #[doc(hidden)]
    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        let _ = (t, horizon, model);
    }

    /// x⁺ = φₜ(x, u) into `next` (nx); returns ℓₜ(x, u).
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64;

    /// The derivatives of both at (x, u), in the tangent space of the state: A = ∂x⁺/∂x, B = ∂x⁺/∂u, q = ∂ℓ/∂x,
    /// r = ∂ℓ/∂u, and the Hessian of ℓ or its Gauss–Newton approximation, Q, S, R. The gap f is the solver's.
    ///
    /// By default central differences of [`calc`](Self::calc), as [`NumDiff`](crate::NumDiff)'s: slow, allocating, and
    /// right to about 1e-9 (1e-7 the Hessian). [`AutoDiff`](crate::AutoDiff) has exact ones of what is written for any
    /// scalar.
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        differences::calc_diff(self, t, x, u, node);
    }

    /// The second derivatives of ψ(δx, δu) = λᵀ (φₜ(x ⊕ δx, u + δu) ⊖ φₜ(x, u)) at zero into `hessian`, for ndx numbers
    /// `lambda`; says whether it did. Where it did not, the dynamics count as linear around each iterate
    /// (Gauss–Newton), as they do everywhere unless [`second_order`](crate::Settings::second_order) is set.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let _ = (t, x, u, lambda, hessian);
        false
    }

    /// [`calc`](Self::calc) for a group: knot `knots[i]` at the i-th state of `xs` and the i-th control of `us`, which
    /// lie one after the other, as do the states written to `next`.
    ///
    /// # Panics
    /// If the lengths are not knots.len() times nx, nu, nx and 1.
    #[track_caller]
    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        let (nx, nu) = (self.nx(), self.nu());
        assert_length("xs", xs.len(), knots.len() * nx);
        assert_length("us", us.len(), knots.len() * nu);
        assert_length("next", next.len(), knots.len() * nx);
        assert_length("costs", costs.len(), knots.len());
        for (i, &t) in knots.iter().enumerate() {
            let (x, u) = (&xs[i * nx..][..nx], &us[i * nu..][..nu]);
            costs[i] = self.calc(t, x, u, &mut next[i * nx..][..nx]);
        }
    }

    /// The number of accelerations and forces that the inverse-dynamics form of a knot starts from, none without that form.
    #[doc(hidden)]
    fn motion_size(&self) -> usize {
        0
    }

    /// As [`calc_group`](Self::calc_group), and writes the accelerations and forces of each knot to the beginning of its part
    /// of `motions`, which are as many equal parts as knots.
    #[doc(hidden)]
    #[track_caller]
    fn calc_group_with_motion(
        &mut self,
        knots: &[usize],
        xs: &[f64],
        us: &[f64],
        next: &mut [f64],
        costs: &mut [f64],
        motions: &mut [f64],
    ) {
        let _ = motions;
        self.calc_group(knots, xs, us, next, costs);
    }

    /// [`calc_diff`](Self::calc_diff) for a group.
    ///
    /// # Panics
    /// If the lengths are not knots.len() times nx, nu and 1.
    #[track_caller]
    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], nodes: &mut [LqNode]) {
        let (nx, nu) = (self.nx(), self.nu());
        assert_length("xs", xs.len(), knots.len() * nx);
        assert_length("us", us.len(), knots.len() * nu);
        assert_length("nodes", nodes.len(), knots.len());
        for (i, &t) in knots.iter().enumerate() {
            self.calc_diff(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut nodes[i]);
        }
    }

    /// Shows by their names the vectors that the dynamics of knot t compute beside the next state. None by default; those of a
    /// robot are `acceleration`, `effort` of all joints, and `force/` with the name of each contact, in the axes of its rows,
    /// which at an impact is an impulse.
    fn outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        let _ = (t, x, u, show);
    }

    /// The controls that hold the state x of knot t, where it may stand still: φ(x, u) = x, as near as controls come to it.
    /// By default steps of Newton, u ← u − B⁺ (φ(x, u) ⊖ x), at most 100, as Crocoddyl's; a robot's come from statics.
    /// Allocates.
    fn hold(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        hold::newton(self, t, x)
    }

    /// The horizon has [moved on](crate::Problem::shift) by a knot: what was said of knot t now holds of knot t − 1.
    /// Nothing by default. May not allocate.
    fn shift(&mut self) {}

    /// A copy that computes the same, for another thread or another problem; `None`, unless an implementation gives one. An
    /// action without a copy is differentiated on one thread, whatever [`threads`](crate::Settings::threads) says, and its
    /// problem has no copy ([`Problem::try_clone`](crate::Problem::try_clone)).
    fn fork(&self) -> Option<Box<dyn ActionModel>> {
        None
    }

    /// Says what is wrong with a state that is none: for example the length of a quaternion. All are good by default. A
    /// problem asks of its initial state, a solver of the states that it is given.
    ///
    /// # Errors
    /// The fault, with the numbers.
    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        let _ = x;
        Ok(())
    }

    /// x ⊕ δx into `out` (nx); the sum in a vector space.
    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        for ((o, x), dx) in out.iter_mut().zip(x).zip(dx) {
            *o = x + dx;
        }
    }

    /// x₁ ⊖ x₀ into `out` (ndx), the δ with x₀ ⊕ δ = x₁; the difference in a vector space.
    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        for ((o, x0), x1) in out.iter_mut().zip(x0).zip(x1) {
            *o = x1 - x0;
        }
    }
}
