//! Derivatives by hyper-dual numbers, for actions that are generic over the scalar type.

use super::action::ActionModel;
use super::action::differences::write_curvature;
use crate::error::assert_length;
use crate::lq::{Hessian, LqKnot};
use condyle_spatial::Scalar;
use num_dual::HyperDual64;
use std::any::Any;

/// Dynamics x⁺ = φₜ(x, u) and cost ℓₜ(x, u) of a knot, generic over the [`Scalar`] type. [`AutoDiff`] turns an
/// implementation into an action. The rules for implementations of [`ActionModel`] apply here too.
pub trait GenericAction: Any + Send + Sync {
    /// Returns the number of entries of a state x.
    fn nx(&self) -> usize;

    /// Returns the number of entries of a change of state δx. The default is nx, for states in a vector space.
    fn ndx(&self) -> usize {
        self.nx()
    }

    /// Returns the number of entries of a control u; zero at a terminal knot.
    fn nu(&self) -> usize;

    /// Returns the bounds, as [`ActionModel::bounds`] does.
    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        let _ = t;
        None
    }

    /// Returns a copy that computes the same results, as [`ActionModel::try_clone`] does; `None` by default.
    fn try_clone(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Computes the next state x⁺ = φₜ(x, u) into `next` (nx), and returns the cost ℓₜ(x, u).
    fn calc<S: Scalar>(&mut self, t: usize, x: &[S], u: &[S], next: &mut [S]) -> S;

    /// Computes x ⊕ δx into `out` (nx). The default is the sum x + δx, for states in a vector space.
    fn integrate<S: Scalar>(&self, x: &[S], dx: &[S], out: &mut [S]) {
        for ((out, &x), &dx) in out.iter_mut().zip(x).zip(dx) {
            *out = x + dx;
        }
    }

    /// Computes x₁ ⊖ x₀ into `out` (ndx). The default is x₁ − x₀, for states in a vector space.
    fn difference<S: Scalar>(&self, x0: &[S], x1: &[S], out: &mut [S]) {
        for ((out, &x0), &x1) in out.iter_mut().zip(x0).zip(x1) {
            *out = x1 - x0;
        }
    }
}

/// Action with exact first and second derivatives of a [`GenericAction`]. Its function [`calc`](GenericAction::calc) is
/// evaluated with num-dual's hyper-dual numbers,
///
/// ```text
/// f(z + ε₁eᵢ + ε₂eⱼ) = f + ε₁ ∂f/∂zᵢ + ε₂ ∂f/∂zⱼ + ε₁ε₂ ∂²f/∂zᵢ∂zⱼ
/// ```
///
/// where z = (δx, δu) is a change along ⊕. With n = ndx + nu, the derivatives take n (n + 1) / 2 calls of `calc`. Each
/// call is about ten times as slow as a call with `f64`. `AutoDiff` is meant for knots with few states and for first
/// versions of an action. The Hessian of ℓ is exact, not the Gauss–Newton approximation. The curvature of the dynamics
/// ([`second_order`](crate::Settings::second_order)) is exact too. Allocates only if `calc` does. Source: Fike and
/// Alonso, *The development of hyper-dual numbers for exact second-derivative calculations* (2011).
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, AutoDiff, GenericAction, LqKnot};
/// use condyle_spatial::Scalar;
///
/// struct Pendulum;
/// impl GenericAction for Pendulum {
///     fn nx(&self) -> usize { 2 }
///     fn nu(&self) -> usize { 1 }
///     fn calc<S: Scalar>(&mut self, _: usize, x: &[S], u: &[S], next: &mut [S]) -> S {
///         let (sin, cos) = x[0].sin_cos();
///         let dt = S::splat(0.1);
///         next[0] = x[0] + x[1] * dt;
///         next[1] = x[1] + (u[0] - sin) * dt;
///         S::one() - cos + u[0] * u[0] * S::splat(0.5)
///     }
/// }
///
/// let mut knot = LqKnot::zeros(2, 1);
/// AutoDiff::new(Pendulum).calc_diff(0, &[0.3, 0.0], &[0.0], &mut knot);
/// assert!((knot.A[(1, 0)] + 0.1 * 0.3_f64.cos()).abs() < 1e-15);
/// assert!((knot.Q[(0, 0)] - 0.3_f64.cos()).abs() < 1e-15);
/// ```
#[derive(Debug, Clone)]
pub struct AutoDiff<A> {
    action: A,
    /// State x; the next field is x ⊕ δx. Shape: nx.
    x: Vec<HyperDual64>,
    moved: Vec<HyperDual64>,
    /// Change δx of the state; the next field is u + δu. Shape: ndx; nu.
    dx: Vec<HyperDual64>,
    u: Vec<HyperDual64>,
    /// Next state φ(x, u); the next fields are φ(x ⊕ δx, u + δu) and their difference. Shape: nx; nx; ndx.
    centre: Vec<HyperDual64>,
    next: Vec<HyperDual64>,
    change: Vec<HyperDual64>,
}

impl<A: GenericAction> AutoDiff<A> {
    /// Creates an action that differentiates `action`.
    pub fn new(action: A) -> Self {
        let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
        let zeros = |n| vec![HyperDual64::from(0.0); n];
        Self {
            action,
            x: zeros(nx),
            moved: zeros(nx),
            dx: zeros(ndx),
            u: zeros(nu),
            centre: zeros(nx),
            next: zeros(nx),
            change: zeros(ndx),
        }
    }

    /// Returns the differentiated action as a mutable reference.
    pub fn action_mut(&mut self) -> &mut A {
        &mut self.action
    }

    /// Computes the next state φ(x, u), from which the changes of the next state are measured.
    #[track_caller]
    fn start(&mut self, t: usize, x: &[f64], u: &[f64]) {
        assert_length("x", x.len(), self.x.len());
        assert_length("u", u.len(), self.u.len());
        let lift = |to: &mut [HyperDual64], from: &[f64]| (0..to.len()).for_each(|k| to[k] = from[k].into());
        lift(&mut self.x, x);
        lift(&mut self.u, u);
        lift(&mut self.centre, x); // a terminal action does not write the next state
        lift(&mut self.next, x);
        self.dx.fill(0.0.into());
        self.action.calc(t, &self.x, &self.u, &mut self.centre);
    }

    /// Returns ℓ with the dual unit ε₁ on zᵢ and ε₂ on zⱼ, and writes φ(x ⊕ δx, u + δu) ⊖ φ(x, u) to `change`.
    fn along(&mut self, t: usize, i: usize, j: usize) -> HyperDual64 {
        let Self { action, x, moved, dx, u, centre, next, change } = self;
        let ndx = dx.len();
        fn number<'a>(
            k: usize,
            ndx: usize,
            dx: &'a mut [HyperDual64],
            u: &'a mut [HyperDual64],
        ) -> &'a mut HyperDual64 {
            if k < ndx { &mut dx[k] } else { &mut u[k - ndx] }
        }
        number(i, ndx, dx, u).eps1 = 1.0;
        number(j, ndx, dx, u).eps2 = 1.0;
        action.integrate(x, dx, moved);
        let cost = action.calc(t, moved, u, next);
        action.difference(centre, next, change);
        number(i, ndx, dx, u).eps1 = 0.0;
        number(j, ndx, dx, u).eps2 = 0.0;
        cost
    }
}

impl<A: GenericAction> ActionModel for AutoDiff<A> {
    fn nx(&self) -> usize {
        self.action.nx()
    }

    fn ndx(&self) -> usize {
        self.action.ndx()
    }

    fn nu(&self) -> usize {
        self.action.nu()
    }

    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.action.bounds(t)
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(Self::new(self.action.try_clone()?)))
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.action.calc(t, x, u, next)
    }

    #[track_caller]
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let (ndx, n) = (self.dx.len(), self.dx.len() + self.u.len());
        self.start(t, x, u);
        for i in 0..n {
            for j in 0..=i {
                let cost = self.along(t, i, j);
                write_curvature([&mut knot.Q, &mut knot.S, &mut knot.R], ndx, (i, j), cost.eps1eps2);
                if j == i {
                    let (gradient, slopes) = if i < ndx {
                        (&mut knot.q[i], knot.A.column_mut(i))
                    } else {
                        (&mut knot.r[i - ndx], knot.B.column_mut(i - ndx))
                    };
                    *gradient = cost.eps1;
                    slopes.into_iter().zip(&self.change).for_each(|(to, change)| *to = change.eps1);
                }
            }
        }
    }

    #[track_caller]
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (ndx, n) = (self.dx.len(), self.dx.len() + self.u.len());
        self.start(t, x, u);
        for i in 0..n {
            for j in 0..=i {
                self.along(t, i, j);
                let curvature = lambda.iter().zip(&self.change).map(|(l, change)| l * change.eps1eps2).sum();
                let Hessian { xx, xu, uu } = hessian;
                write_curvature([xx, xu, uu], ndx, (i, j), curvature);
            }
        }
        true
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.action.integrate(x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.action.difference(x0, x1, out);
    }
}
