//! Residuals of one's own: any function of the state and the control.

use crate::lq::Hessian;
use condyle_dynamics::Model;
use core::fmt;
use core::ops::Deref;
use std::any::Any;
use std::sync::Arc;

/// Arguments of which a residual r(q, v, u) is a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Position q.
    pub positions: bool,
    /// Velocity v.
    pub velocities: bool,
    /// Controls u.
    pub controls: bool,
}

impl Inputs {
    /// All of q, v and u.
    pub const ALL: Self = Self { positions: true, velocities: true, controls: true };
    /// State x = (q, v).
    pub const STATE: Self = Self { controls: false, ..Self::ALL };
    /// Position q alone.
    pub const POSITIONS: Self = Self { velocities: false, ..Self::STATE };
}

/// Residual that is written by a user, r(t, x, u), with its Jacobian. Several threads may call it at a time.
///
/// [`GenericResidual`](crate::robot::GenericResidual) needs no Jacobian: dual numbers compute it.
pub trait ResidualFunction: Any + Send + Sync {
    /// Returns the number of entries of r.
    fn size(&self) -> usize;

    /// Returns the arguments on which r depends, which must not change: all by default. Of the others, the columns of
    /// the Jacobian are not read.
    fn inputs(&self) -> Inputs {
        Inputs::ALL
    }

    /// Refuses a robot, or a number of controls, for which r is not made. By default none is refused. An action calls
    /// this when it is given the residual.
    ///
    /// # Errors
    /// The fault, with the numbers.
    fn check(&self, model: &Model, nu: usize) -> Result<(), String> {
        let _ = (model, nu);
        Ok(())
    }

    /// r(t, x, u) of knot t.
    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]);

    /// ∂r/∂x in the tangent space of the state, size × ndx, and ∂r/∂u, size × nu, row after row. Both hold zeros
    /// before.
    fn calc_diff(&self, t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]);

    /// Returns whether [`calc_hessian`](Self::calc_hessian) gives second derivatives. Not by default: the Hessian of
    /// the cost is then Gauss–Newton's, (∂r)ᵀ a″ ∂r.
    fn has_hessian(&self) -> bool {
        false
    }

    /// As [`calc_diff`](Self::calc_diff), with Σ dᵢ ∂²rᵢ too, for size numbers d, the slopes of what r is worth: they
    /// come to the Gauss–Newton Hessian. Of positions on groups it is the Hessian of r(x ⊕ δ) at δ = 0. All hold zeros
    /// before.
    fn calc_hessian(
        &self,
        t: usize,
        x: &[f64],
        u: &[f64],
        d: &[f64],
        [by_x, by_u]: [&mut [f64]; 2],
        hessian: &mut Hessian,
    ) {
        let _ = (d, hessian);
        self.calc_diff(t, x, u, by_x, by_u);
    }
}

/// A [`ResidualFunction`] as a residual. Two are equal if they are one object.
///
/// ```
/// use condyle_optimal::robot::{OwnResidual, Residual, ResidualFunction};
///
/// /// The power of the first joint, τ₁ v₁, of a robot with `nv` joints.
/// struct Power { nv: usize }
///
/// impl ResidualFunction for Power {
///     fn size(&self) -> usize { 1 }
///     fn calc(&self, _t: usize, x: &[f64], u: &[f64], r: &mut [f64]) {
///         r[0] = x[self.nv] * u[0];
///     }
///     fn calc_diff(&self, _t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]) {
///         (by_x[self.nv], by_u[0]) = (u[0], x[self.nv]);
///     }
/// }
///
/// let power = Residual::Own(OwnResidual::new(Power { nv: 7 }));
/// # assert_eq!(power, power.clone());
/// ```
///
/// A cost of one's own that is a number and no residual has one entry, the activation
/// [`Sum`](crate::robot::Activation::Sum), and second derivatives, if it has any, in
/// [`calc_hessian`](ResidualFunction::calc_hessian).
#[derive(Clone)]
pub struct OwnResidual(Arc<dyn ResidualFunction>);

impl OwnResidual {
    /// Returns a residual of a function.
    pub fn new(function: impl ResidualFunction) -> Self {
        Self(Arc::new(function))
    }
}

impl Deref for OwnResidual {
    type Target = dyn ResidualFunction;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl fmt::Debug for OwnResidual {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OwnResidual({} numbers)", self.size())
    }
}

impl PartialEq for OwnResidual {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
