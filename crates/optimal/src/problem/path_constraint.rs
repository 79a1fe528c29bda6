//! General constraints on states and controls. Their Jacobians are hand-written, or computed by dual numbers or by
//! differences.

use super::action::ActionModel;
use super::action::differences::FIRST;
use condyle_spatial::Scalar;
use nalgebra::DMatrix;
use num_dual::Dual64;
use std::any::Any;

/// Functions of state and control that must stay within bounds: lower ≤ gₜ(x, u) ≤ upper. A function whose bounds are
/// equal is an equality.
///
/// At a terminal knot u is empty. The rules for implementations of [`ActionModel`] apply here too. An
/// [`AutoDiffConstraint`](crate::AutoDiffConstraint) computes the Jacobian by itself.
///
/// # Examples
/// The second entry of the state may not exceed 1:
/// ```
/// use condyle_optimal::PathConstraint;
/// use nalgebra::DMatrix;
///
/// struct Slow;
/// impl PathConstraint for Slow {
///     fn size(&self) -> usize { 1 }
///     fn bounds(&self, _: usize) -> (&[f64], &[f64]) { (&[f64::NEG_INFINITY], &[1.0]) }
///     fn calc(&mut self, _: usize, x: &[f64], _: &[f64], g: &mut [f64]) { g[0] = x[1]; }
///     fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
///         gx.copy_from_slice(&[0.0, 1.0]);
///         gu.fill(0.0);
///         true
///     }
/// }
/// ```
pub trait PathConstraint: Any + Send + Sync {
    /// Returns the number of functions in g.
    fn size(&self) -> usize;

    /// Returns the lower and upper bounds of g at knot t, infinite for an unbounded function. The bounds must not
    /// change during a solve.
    fn bounds(&self, t: usize) -> (&[f64], &[f64]);

    /// Computes the values gₜ(x, u) into `g`.
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]);

    /// Computes ∂g/∂x into `gx` (size × ndx), in the tangent space of the state, and ∂g/∂u into `gu` (size × nu).
    /// Returns whether the derivatives were computed. The default returns false; the solver then takes central
    /// differences of [`calc`](Self::calc), which are slow, allocate, and are accurate to about 1e-9.
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        let _ = (t, x, u, gx, gu);
        false
    }

    /// Returns a copy that computes the same results, as [`ActionModel::try_clone`] does; `None` by default.
    fn try_clone(&self) -> Option<Box<dyn PathConstraint>> {
        None
    }
}

/// Computes the Jacobians ∂g/∂x and ∂g/∂u of an action's constraint by central differences.
pub(super) fn calc_diff(
    action: &dyn ActionModel,
    constraint: &mut dyn PathConstraint,
    t: usize,
    x: &[f64],
    u: &[f64],
    [gx, gu]: [&mut DMatrix<f64>; 2],
) {
    let (ndx, size) = (action.ndx(), constraint.size());
    let (mut moved, mut dx, mut du) = (x.to_vec(), vec![0.0; ndx], u.to_vec());
    let mut sides = [vec![0.0; size], vec![0.0; size]];
    for j in 0..ndx + u.len() {
        for (g, step) in sides.iter_mut().zip([FIRST, -FIRST]) {
            if j < ndx {
                dx[j] = step;
                action.integrate(x, &dx, &mut moved);
                constraint.calc(t, &moved, u, g);
                dx[j] = 0.0;
            } else {
                du[j - ndx] = u[j - ndx] + step;
                constraint.calc(t, x, &du, g);
                du[j - ndx] = u[j - ndx];
            }
        }
        for i in 0..size {
            let slope = (sides[0][i] - sides[1][i]) / (2.0 * FIRST);
            if j < ndx { gx[(i, j)] = slope } else { gu[(i, j - ndx)] = slope }
        }
    }
}

/// Functions of state and control that must stay within bounds, generic over the [`Scalar`] type.
/// [`AutoDiffConstraint`] turns them into a [`PathConstraint`]. For a robot, see
/// [`OwnConstraint`](crate::robot::OwnConstraint): its residuals share the kinematics that the robot has already
/// computed.
pub trait GenericConstraint: Any + Clone + Send + Sync {
    /// Returns the number of functions in g.
    fn size(&self) -> usize;

    /// Returns the bounds, as [`PathConstraint::bounds`] does.
    fn bounds(&self, t: usize) -> (&[f64], &[f64]);

    /// Computes the values gₜ(x, u) into `g`.
    fn calc<S: Scalar>(&self, t: usize, x: &[S], u: &[S], g: &mut [S]);

    /// Computes x ⊕ δx into `out` (nx). The default is the sum x + δx, for states in a vector space. The result must
    /// equal the action's ⊕.
    fn integrate<S: Scalar>(&self, x: &[S], dx: &[S], out: &mut [S]) {
        for ((out, &x), &dx) in out.iter_mut().zip(x).zip(dx) {
            *out = x + dx;
        }
    }
}

/// Path constraint with an exact Jacobian, by dual numbers. One Jacobian takes ndx + nu calls of
/// [`GenericConstraint::calc`].
///
/// ```
/// use condyle_optimal::{AutoDiffConstraint, GenericConstraint, PathConstraint};
/// use condyle_spatial::Scalar;
/// use nalgebra::DMatrix;
///
/// /// A vehicle at x = (x, y, θ) stays 1 m from the origin.
/// #[derive(Clone)]
/// struct Distance;
/// impl GenericConstraint for Distance {
///     fn size(&self) -> usize { 1 }
///     fn bounds(&self, _: usize) -> (&[f64], &[f64]) { (&[1.0], &[f64::INFINITY]) }
///     fn calc<S: Scalar>(&self, _: usize, x: &[S], _: &[S], g: &mut [S]) {
///         g[0] = (x[0] * x[0] + x[1] * x[1]).sqrt();
///     }
/// }
///
/// let (mut gx, mut gu) = (DMatrix::zeros(1, 3), DMatrix::zeros(1, 2));
/// AutoDiffConstraint::new(Distance).calc_diff(0, &[0.0, 4.0, 0.0], &[0.0; 2], &mut gx, &mut gu);
/// assert_eq!(gx, DMatrix::from_row_slice(1, 3, &[0.0, 1.0, 0.0]));
/// ```
#[derive(Clone, Debug)]
pub struct AutoDiffConstraint<C> {
    constraint: C,
    /// State x; the next field is x ⊕ δx. Shape: nx. Written by: `calc_diff`.
    x: Vec<Dual64>,
    moved: Vec<Dual64>,
    /// Change δx of the state; the next fields are u + δu and g. Shape: ndx; nu; size. Written by: `calc_diff`.
    dx: Vec<Dual64>,
    u: Vec<Dual64>,
    g: Vec<Dual64>,
}

impl<C: GenericConstraint> AutoDiffConstraint<C> {
    /// Creates a path constraint that differentiates `constraint`. The first call of `calc_diff` allocates its
    /// workspace.
    pub fn new(constraint: C) -> Self {
        let [x, moved, dx, u, g] = [(); 5].map(|()| Vec::new());
        Self { constraint, x, moved, dx, u, g }
    }

    /// Returns the differentiated constraint as a mutable reference.
    pub fn constraint_mut(&mut self) -> &mut C {
        &mut self.constraint
    }
}

impl<C: GenericConstraint> PathConstraint for AutoDiffConstraint<C> {
    fn size(&self) -> usize {
        self.constraint.size()
    }

    fn bounds(&self, t: usize) -> (&[f64], &[f64]) {
        self.constraint.bounds(t)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        self.constraint.calc(t, x, u, g);
    }

    fn calc_diff(&mut self, t: usize, at: &[f64], by: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        let Self { constraint, x, moved, dx, u, g } = self;
        let zero = Dual64::from(0.0);
        for (numbers, n) in [(&mut *moved, at.len()), (&mut *dx, gx.ncols()), (&mut *g, gx.nrows())] {
            numbers.resize(n, zero);
        }
        for (numbers, from) in [(&mut *x, at), (&mut *u, by)] {
            numbers.clear();
            numbers.extend(from.iter().map(|&x| Dual64::from(x)));
        }
        for k in 0..gx.ncols() {
            dx[k].eps = 1.0;
            constraint.integrate(x, dx, moved);
            constraint.calc(t, moved, u, g);
            dx[k].eps = 0.0;
            gx.column_mut(k).iter_mut().zip(&*g).for_each(|(to, g)| *to = g.eps);
        }
        for k in 0..gu.ncols() {
            u[k].eps = 1.0;
            constraint.calc(t, x, u, g);
            u[k].eps = 0.0;
            gu.column_mut(k).iter_mut().zip(&*g).for_each(|(to, g)| *to = g.eps);
        }
        true
    }

    fn try_clone(&self) -> Option<Box<dyn PathConstraint>> {
        Some(Box::new(self.clone()))
    }
}
