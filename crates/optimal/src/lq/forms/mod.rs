//! Forms of a knot. A form decides how A and B of a knot enter the sweep, and which unknowns the sweep eliminates.
//!
//! Each knot is a quadratic form H in some unknowns and in the change of its state; the sweep eliminates the unknowns.
//! The forms differ in how A and B enter H, in whether the unknowns are the controls, and in the order of the states.
//! [`Forms::of`] selects the form of a knot.
#![allow(non_snake_case)] // names follow the literature

mod controls;
mod dense;
mod driven;
mod euler;
mod inverse_dynamics;

use super::feedback::KnotFeedback;
use super::knot::{Hessian, LqKnot};
use super::workspace::Workspace;
use dense::Dense;
pub(super) use driven::{Driven, MOST as DRIVEN_MOST};
use euler::Euler;
use inverse_dynamics::InverseDynamics;

/// Smallest ndx for which the form of Euler steps is faster than the dense form, measured with `benches/riccati.rs`.
const EULER_FROM: usize = 16;

/// Form of a knot. The matrices that a form reads and writes belong to the [`Workspace`].
pub(super) trait KnotForm {
    /// Returns the rotation of the n states in H: state i of H is state (i + turn) mod n of x.
    fn turn(&self, n: usize) -> usize;

    /// Writes H, including the regularisation ϱ, from the knot, from P, and from the gradient p at the predicted state.
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, curvature: &mut Curvature<'_>);

    /// Writes a product to the rows below H, after `write` has been called. The product is Θ times the map from the
    /// unknowns and δx to δx⁺. Θ has n rows (stride `padded(n)`).
    fn write_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]);

    /// Eliminates the unknowns from H, which becomes [L ·; X Hₓₓ − X Xᵀ; yᵀ ·]. Returns the number of eliminated
    /// unknowns.
    ///
    /// # Errors
    /// Index of the row and its pivot, if the pivot is not positive.
    fn eliminate(
        &mut self,
        work: &mut Workspace,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
    ) -> Result<usize, (usize, f64)>;

    /// Writes the gains of the knot, from the result of `eliminate` in H. If `defers`, a form may store factors
    /// instead; [`Gains::finish`](super::feedback::Gains::finish) computes the gains from these factors.
    fn write_gains(&mut self, work: &mut Workspace, knot: &LqKnot, feedback: &mut KnotFeedback, defers: bool);
}

/// Sizes from which a sweep allocates its workspace.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Number of states.
    pub(super) n: usize,
    /// Largest number of controls.
    pub(super) m: usize,
    /// Sizes of scratch, as returned by [`InverseDynamics::room`].
    room: [usize; 3],
}

impl Sizes {
    /// Returns the sizes for a sweep over `knots`.
    pub(super) fn of(knots: &[LqKnot]) -> Self {
        let (n, m) = (knots.last().map_or(0, LqKnot::ndx), knots.iter().map(LqKnot::nu).max().unwrap_or(0));
        Self { n, m, room: InverseDynamics::room(knots) }
    }

    /// Returns the maximum number of controls of a knot whose gains may be deferred; 0 if no knot defers gains.
    pub(super) fn deferred_controls(self) -> usize {
        if self.room[0] > 0 { self.m } else { 0 }
    }

    /// Returns the number of rows below H that the forms need.
    pub(super) fn rows_below(self) -> usize {
        Driven::rows_below(self.n, self.m)
    }
}

/// All forms, with their scratch.
#[derive(Debug, Clone)]
pub(super) struct Forms {
    dense: Dense,
    euler: Euler,
    inverse_dynamics: InverseDynamics,
    driven: Driven,
}

impl Forms {
    /// Allocates the forms.
    pub(super) fn new(sizes: Sizes) -> Self {
        let Sizes { n, m, room } = sizes;
        Self {
            dense: Dense::new(m),
            euler: Euler::new(n, m),
            inverse_dynamics: InverseDynamics::new(room, n, sizes.deferred_controls()),
            driven: Driven::new(n),
        }
    }

    /// Returns the form for a step at a knot. All forms are candidates.
    pub(super) fn of_step(&mut self, knot: &LqKnot, regularisation: f64) -> &mut dyn KnotForm {
        match knot.structure.is_inverse_dynamics() && Driven::takes(knot, regularisation) {
            true => &mut self.driven,
            false => self.of(knot),
        }
    }

    /// Returns the form of a knot, if rows below H are needed. Only the forms that support such rows are candidates.
    pub(super) fn of(&mut self, knot: &LqKnot) -> &mut dyn KnotForm {
        if knot.structure.is_inverse_dynamics() {
            &mut self.inverse_dynamics
        } else if knot.structure.euler().is_some() && knot.ndx() >= EULER_FROM {
            &mut self.euler
        } else {
            &mut self.dense
        }
    }
}

/// Function that writes the second derivatives of λᵀφ at a knot, and returns whether it wrote them.
pub(crate) type CurvatureFn<'a> = dyn FnMut(usize, &[f64], &mut Hessian) -> bool + 'a;

/// Arguments with which a form obtains the curvature of a knot's dynamics; see
/// [`Sweep::run_with`](crate::Sweep::run_with).
pub(super) struct Curvature<'a> {
    /// Index of the knot.
    pub(super) knot: usize,
    /// Function that computes the curvature; `None` if the dynamics count as linear.
    pub(super) ask: Option<&'a mut CurvatureFn<'a>>,
    /// Storage for the curvature: one Hessian for each number of controls that occurs.
    pub(super) hessians: &'a mut [Hessian],
}

impl Curvature<'_> {
    /// Returns the second derivatives of λᵀφ at a knot with nu controls; `None` if the dynamics count as linear.
    fn at(&mut self, lambda: &[f64], nu: usize) -> Option<&Hessian> {
        let ask = self.ask.as_mut()?;
        let hessian = self.hessians.iter_mut().find(|hessian| hessian.uu.nrows() == nu)?;
        ask(self.knot, lambda, hessian).then_some(&*hessian)
    }
}
