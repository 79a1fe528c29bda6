//! User-defined residuals: arbitrary functions of the state and the controls.

use crate::lq::Hessian;
use condyle_dynamics::Model;
use core::fmt;
use core::ops::Deref;
use std::any::Any;
use std::sync::Arc;

/// Flags for the arguments on which a residual r(q, v, u) depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Whether r depends on the position q.
    pub positions: bool,
    /// Whether r depends on the velocity v.
    pub velocities: bool,
    /// Whether r depends on the controls u.
    pub controls: bool,
}

impl Inputs {
    /// Dependence on all of q, v and u.
    pub const ALL: Self = Self { positions: true, velocities: true, controls: true };
    /// Dependence on the state x = (q, v).
    pub const STATE: Self = Self { controls: false, ..Self::ALL };
    /// Dependence on only the position q.
    pub const POSITIONS: Self = Self { velocities: false, ..Self::STATE };
}

/// User-defined residual r(t, x, u) with its Jacobian. Several threads may call its methods at the same time.
///
/// A [`GenericResidual`](crate::robot::GenericResidual) needs no Jacobian, because dual numbers compute the Jacobian.
pub trait ResidualFunction: Any + Send + Sync {
    /// Returns the number of entries of r.
    fn size(&self) -> usize;

    /// Returns the arguments on which r depends; the default is all arguments. The result must not change. Columns of
    /// the Jacobian for other arguments are not read.
    fn inputs(&self) -> Inputs {
        Inputs::ALL
    }

    /// Returns an error if r cannot be used with this robot or this number of controls. The default returns no error.
    /// An action calls this method once, when the action receives the residual.
    ///
    /// # Errors
    /// A description of the fault, including the invalid numbers.
    fn check(&self, model: &Model, nu: usize) -> Result<(), String> {
        let _ = (model, nu);
        Ok(())
    }

    /// Computes the residual r(t, x, u) of knot t into `r`.
    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]);

    /// Computes ∂r/∂x in the tangent space of the state (size × ndx) and ∂r/∂u (size × nu), row after row. Both arrays
    /// contain zeros before the call.
    fn calc_diff(&self, t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]);

    /// Returns whether [`calc_hessian`](Self::calc_hessian) computes second derivatives. The default returns false: the
    /// Hessian of the cost is then the Gauss–Newton approximation (∂r)ᵀ a″ ∂r.
    fn has_hessian(&self) -> bool {
        false
    }

    /// Computes the outputs of [`calc_diff`](Self::calc_diff), and also Σ dᵢ ∂²rᵢ, where d is the gradient of the
    /// activation with respect to r. The caller adds this sum to the Gauss–Newton Hessian. For positions that are not a
    /// vector space, ∂²rᵢ is the Hessian of rᵢ(x ⊕ δ) at δ = 0. All outputs contain zeros before the call.
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

/// Residual that wraps a [`ResidualFunction`]. Two such residuals are equal if they share the same function object.
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
/// For a user-defined cost that is a scalar and not a residual, write a residual with one entry and use the activation
/// [`Sum`](crate::robot::Activation::Sum). If the cost has second derivatives, compute them in
/// [`calc_hessian`](ResidualFunction::calc_hessian).
#[derive(Clone)]
pub struct OwnResidual(Arc<dyn ResidualFunction>);

impl OwnResidual {
    /// Creates a residual from a function.
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
