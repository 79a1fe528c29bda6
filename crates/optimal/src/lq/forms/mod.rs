//! Forms in which the sweep receives a knot, and in which its unknowns are eliminated.
//!
//! Each knot is a quadratic form H in some unknowns and in the change of its state; the unknowns are eliminated. The
//! forms differ in how A and B enter H, whether the unknowns are the controls, and the order of the states. Only
//! [`Forms::of`] selects the form of a knot.
#![allow(non_snake_case)] // the names of the literature

mod controls;
mod dense;
mod driven;
mod euler;
mod inverse_dynamics;

use super::knot::{Hessian, KnotFeedback, LqKnot};
use super::workspace::Workspace;
pub(super) use controls::Controls;
use dense::Dense;
pub(super) use driven::Driven;
use euler::Euler;
pub(super) use inverse_dynamics::InverseDynamics;

/// Smallest ndx for which the form of Euler steps is faster than the dense form, as measured by `benches/riccati.rs`.
const EULER_FROM: usize = 16;

/// Form of a knot. The matrices that it reads and writes belong to the [`Workspace`].
pub(super) trait KnotForm {
    /// Returns the rotation of the n states in H: state i of H is state (i + turn) mod n of x.
    fn turn(&self, n: usize) -> usize;

    /// Writes H, including ϱ, from the knot, from P, and from p at the predicted state.
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, curvature: &mut Curvature<'_>);

    /// After `write`: writes the product of Θ and the map from the unknowns and δx to δx⁺ below H. Θ has n rows (stride
    /// n + SLACK).
    fn write_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]);

    /// Eliminates the unknowns: H becomes [L ·; X Hₓₓ − X Xᵀ; yᵀ ·]. Returns the number of eliminated unknowns. By
    /// default, they are the controls that are not at a bound.
    ///
    /// # Errors
    /// The row and its pivot, if the pivot is not positive.
    fn eliminate(
        &self,
        work: &mut Workspace,
        controls: &mut Controls,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
    ) -> Result<usize, (usize, f64)> {
        controls.eliminate(work, knot, feedback)
    }

    /// Writes the gains of the knot, from the result of `eliminate` in H.
    fn recover_gains(
        &mut self,
        work: &mut Workspace,
        controls: &mut Controls,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
    ) {
        let turn = self.turn(knot.ndx());
        controls.recover_gains(work, knot, feedback, turn);
    }

    /// Stores in the knot the data from which [`Gains::finish`](super::gains::Gains::finish) computes its gains;
    /// returns whether it did so.
    fn put_off_gains(&self, _: &Workspace, _: &LqKnot, _: &mut KnotFeedback) -> bool {
        false
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
    /// Allocates the forms for n states, and for inverse dynamics with at most m controls and the requirements `room`
    /// of [`InverseDynamics::room`].
    pub(super) fn new(n: usize, m: usize, room: [usize; 3]) -> Self {
        let (euler, inverse_dynamics) = (Euler::new(n), InverseDynamics::new(room, n, m));
        Self { dense: Dense, euler, inverse_dynamics, driven: Driven::new(n) }
    }

    /// Returns the form for a step at a knot.
    pub(super) fn of_step(&mut self, knot: &LqKnot, regularisation: f64) -> &mut dyn KnotForm {
        match knot.structure.is_inverse_dynamics() && Driven::takes(knot, regularisation) {
            true => &mut self.driven,
            false => self.of(knot),
        }
    }

    /// Returns the form of a knot, among the forms that support rows below H.
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

/// Request for the curvature of a knot's dynamics; see [`Sweep::run_with`](crate::Sweep::run_with).
pub(super) struct Curvature<'a> {
    /// Index of the knot.
    pub(super) knot: usize,
    /// Function that writes the second derivatives of λᵀφ at a knot, and returns whether it did so.
    pub(super) ask: &'a mut dyn FnMut(usize, &[f64], &mut Hessian) -> bool,
    /// Storage for these derivatives, one entry for each number of controls.
    pub(super) hessians: &'a mut [Hessian],
}

impl Curvature<'_> {
    /// Returns the second derivatives of λᵀφ at a knot with nu controls; `None` if the dynamics count as linear.
    fn at(&mut self, lambda: &[f64], nu: usize) -> Option<&Hessian> {
        let hessian = self.hessians.iter_mut().find(|hessian| hessian.uu.nrows() == nu)?;
        (self.ask)(self.knot, lambda, hessian).then_some(&*hessian)
    }
}
