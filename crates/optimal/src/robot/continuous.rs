//! Dynamics in continuous time: what an integrator makes a knot of.

use super::limits::Limits;
use crate::lq::{Hessian, LqKnot};
use core::ops::Range;
use nalgebra::DMatrix;

/// Dynamics in continuous time: q̈ = a(q, v, u), ℓ̇ = ℓ(x, u), with x = (q, v).
///
/// [`Integrated`](super::Integrated) makes a knot of it. A robot's are [`FreeAcceleration`](super::FreeAcceleration),
/// [`ContactAcceleration`](super::ContactAcceleration) and [`ControlledAcceleration`](super::ControlledAcceleration);
/// write your own for anything that moves with accelerations.
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
    /// The number of entries of a position q.
    fn nq(&self) -> usize;

    /// The number of entries of a velocity v.
    fn nv(&self) -> usize;

    /// The number of controls.
    fn nu(&self) -> usize;

    /// The number of states that [`prepare`](Self::prepare) takes at the price of few; 1 unless it uses vector lanes.
    fn lanes(&self) -> usize {
        1
    }

    /// Computes the dynamics of a group of states at these knots, at least one and at most [`lanes`](Self::lanes), so that
    /// [`calc`](Self::calc) or [`calc_diff`](Self::calc_diff), which an integrator then calls for each of them, need not.
    /// Nothing by default.
    fn prepare(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation) {
        let _ = (knots, xs, us, what);
    }

    /// a(x, u) (nv numbers) and ℓ(x, u), for a state of the group that was [prepared](Self::prepare).
    fn calc(&mut self, input: KnotInput<'_>) -> (&[f64], f64);

    /// The derivatives of a, and those of `scale` · ℓ into q, r, Q, S, R of the knot, which are overwritten; for a state of
    /// the group that was [prepared](Self::prepare).
    fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_>;

    /// The second derivatives of ψ = μᵀ a(q ⊕ δq, v + δv, u + δu) into `hessian`, for nv numbers `mu`; returns the first
    /// ones of a. `None` by default: a then counts as linear, whatever
    /// [`second_order`](crate::Settings::second_order) says.
    fn hessian(&mut self, input: KnotInput<'_>, mu: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
        let _ = (input, mu, hessian);
        None
    }

    /// The most coordinates and the most rows of costs that the inverse-dynamics form of a knot takes, for dynamics that
    /// can be written so.
    #[doc(hidden)]
    fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
        None
    }

    /// The number of accelerations and forces that [`Evaluation::Equations`] starts from.
    #[doc(hidden)]
    fn motion_size(&self) -> usize {
        0
    }

    /// Writes them, of a state of the group that was [prepared](Self::prepare).
    #[doc(hidden)]
    fn motion(&self, lane: usize, to: &mut [f64]) {
        let _ = (lane, to);
    }

    /// Sets them, of a state of the group that is to be prepared for [`Evaluation::Equations`].
    #[doc(hidden)]
    fn set_motion(&mut self, lane: usize, from: &[f64]) {
        let _ = (lane, from);
    }

    /// Moves the horizon on by a knot, see [`ActionModel::shift`](crate::ActionModel::shift). Nothing by default.
    fn shift(&mut self) {}

    /// The limits of a robot.
    #[doc(hidden)]
    fn limits(&mut self) -> Option<&mut Limits> {
        None
    }

    /// Shows, by their names, the vectors that the dynamics compute beside accelerations, for a state of the group that was
    /// [prepared](Self::prepare): see [`ActionModel::outputs`](crate::ActionModel::outputs). By default accelerations alone.
    fn outputs(&mut self, input: KnotInput<'_>, show: &mut dyn FnMut(&str, &[f64])) {
        show("acceleration", self.calc(input).0);
    }

    /// The controls that hold a state still, from statics. `None` by default: then they are found by steps of Newton.
    fn quasi_static(&mut self, x: &[f64]) -> Option<Vec<f64>> {
        let _ = x;
        None
    }

    /// As [`ActionModel::reserve`](crate::ActionModel::reserve).
    #[doc(hidden)]
    fn reserve(&mut self) {}

    /// As [`ActionModel::merge`](crate::ActionModel::merge), for models of one type.
    #[doc(hidden)]
    fn merge(&mut self, other: &mut Self) -> bool
    where
        Self: Sized,
    {
        let _ = other;
        false
    }

    /// As [`ActionModel::choose`](crate::ActionModel::choose).
    #[doc(hidden)]
    fn choose(&mut self, model: usize) {
        let _ = model;
    }

    /// As [`ActionModel::serve`](crate::ActionModel::serve).
    #[doc(hidden)]
    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        let _ = (t, horizon, model);
    }

    /// A copy that computes the same, for another thread: see [`ActionModel::try_clone`](crate::ActionModel::try_clone). `None` by
    /// default.
    fn try_clone(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// The coordinates of each group of positions that is no vector space, at most six a group: elsewhere q ⊕ δ is a sum.
    /// None by default.
    fn groups(&self) -> &[Range<usize>] {
        &[]
    }

    /// Says what is wrong with a position that is none: for example the length of a quaternion. All are good by default.
    ///
    /// # Errors
    /// The fault, with the numbers.
    fn check_position(&self, q: &[f64]) -> Result<(), String> {
        let _ = q;
        Ok(())
    }

    /// Writes q ⊕ δq to `out` (nq).
    fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q[k] + dq[k]);
    }

    /// Writes q₁ ⊖ q₀ to `out` (nv).
    fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q1[k] - q0[k]);
    }

    /// ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq, nv × nv each: the blocks of the [`groups`](Self::groups) are all that is read.
    fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        let _ = (dq, by_q, by_dq);
    }

    /// The second derivatives of θ(δ, ε) = λᵀ((q ⊕ δ) ⊕ (δq + ε) ⊖ (q ⊕ δq)) at zero into `hessian`, by δ (its state) and ε
    /// (its control), nv numbers each: the blocks of the [`groups`](Self::groups) are all that is read. Says whether it
    /// did. It does not by default: where there are groups, a step then counts as linear, whatever
    /// [`second_order`](crate::Settings::second_order) says.
    fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let _ = (dq, lambda, hessian);
        false
    }
}

/// A knot t of the horizon with its state x = (q, v) and its controls u, one of a group that an integrator has prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KnotInput<'a> {
    /// The place of the state in the group that was [prepared](ContinuousModel::prepare).
    pub lane: usize,
    /// t.
    pub t: usize,
    /// x.
    pub x: &'a [f64],
    /// u.
    pub u: &'a [f64],
}

/// What [`ContinuousModel::prepare`] computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Evaluation {
    /// Accelerations.
    Motion,
    /// Accelerations and their derivatives.
    Derivatives,
    /// The equations of motion, differentiated at accelerations and forces that are known: those of the
    /// [motion](Self::Motion) of the same group, or others that were set. For knots in inverse-dynamics form.
    #[doc(hidden)]
    Equations,
}

/// What [`ContinuousModel::calc_diff`] gives. Of a knot in inverse-dynamics form only `a` is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives<'d> {
    /// a itself, nv numbers.
    pub a: &'d [f64],
    /// ∂a/∂q in the tangent space, nv × nv.
    pub da_dq: &'d DMatrix<f64>,
    /// ∂a/∂v, nv × nv.
    pub da_dv: &'d DMatrix<f64>,
    /// ∂a/∂u, nv × nu, column after column.
    pub da_du: &'d [f64],
}

/// The term of a model's limits as of the last `calc`.
pub(crate) fn limit_term<M: ContinuousModel>(model: &mut M) -> f64 {
    model.limits().map_or(0.0, |limits| limits.term)
}

/// Lets a model's limits count or not; says whether it has any.
pub(crate) fn activate_limits<M: ContinuousModel>(model: &mut M, active: bool) -> bool {
    model.limits().map(|limits| limits.active = active).is_some()
}
