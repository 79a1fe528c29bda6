//! Residuals of one's own: any function of the state and the control.

use core::fmt;
use core::ops::Deref;
use std::any::Any;
use std::sync::Arc;

/// A residual that is written by a user, r(t, x, u), with its Jacobian. Several threads may call it at a time.
pub trait ResidualFunction: Any + Send + Sync {
    /// The number of entries of r.
    fn size(&self) -> usize;

    /// r(t, x, u) of knot t.
    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]);

    /// ∂r/∂x in the tangent space of the state, size × ndx, and ∂r/∂u, size × nu, row after row. Both hold zeros before.
    fn calc_diff(&self, t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]);
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
#[derive(Clone)]
pub struct OwnResidual(Arc<dyn ResidualFunction>);

impl OwnResidual {
    /// A residual of a function.
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
