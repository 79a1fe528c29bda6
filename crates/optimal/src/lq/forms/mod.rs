//! The forms in which a knot can be given to the sweep, and in which its unknowns are eliminated.
//!
//! Each knot is a quadratic form H in some unknowns and in the change of its state, of which the unknowns are eliminated.
//! What differs is how A and B come into H, whether the unknowns are the controls, and the order of the states. Which form
//! a node has is asked in one place, [`Forms::of`].
#![allow(non_snake_case)] // the names of the literature

mod controls;
mod dense;
mod driven;
mod euler;
mod inverse_dynamics;

use super::node::{Hessian, LqKnot, LqNode};
use super::workspace::Workspace;
pub(super) use controls::Controls;
use dense::Dense;
pub(super) use driven::Driven;
use euler::Euler;
pub(super) use inverse_dynamics::InverseDynamics;

/// The least ndx for which the form of Euler steps is worth its bookkeeping, as `benches/riccati.rs` measured.
const EULER_FROM: usize = 16;

/// A form of a knot. The matrices that it reads and writes are those of the [`Workspace`].
pub(super) trait Form {
    /// The turn of the n states in H: state i there is state i + turn of x, counted around.
    fn turn(&self, n: usize) -> usize;

    /// Writes H, with ϱ in it, from the node, from P and from p at the predicted state.
    fn write(&mut self, work: &mut Workspace, node: &LqNode, regularisation: f64, curvature: &mut Curvature<'_>);

    /// After `write`: writes Θ times the map from the unknowns and δx to δx⁺ below H, for a Θ of n rows (stride n + SLACK).
    fn write_below(&mut self, work: &mut Workspace, node: &LqNode, Theta: &[f64]);

    /// Eliminates the unknowns: H becomes [L ·; X Hₓₓ − X Xᵀ; yᵀ ·]. Returns how many were eliminated. Unless a form has
    /// others, they are the controls that are not at a bound.
    ///
    /// # Errors
    /// The row and the pivot that is not positive.
    fn eliminate(
        &self,
        work: &mut Workspace,
        controls: &mut Controls,
        node: &LqNode,
        knot: &mut LqKnot,
    ) -> Result<usize, (usize, f64)> {
        controls.eliminate(work, node, knot)
    }

    /// Writes the gains of the knot, from what `eliminate` left in H.
    fn recover_gains(&mut self, work: &mut Workspace, controls: &mut Controls, node: &LqNode, knot: &mut LqKnot) {
        let turn = self.turn(node.ndx());
        controls.recover_gains(work, node, knot, turn);
    }

    /// Keeps in the knot what its gains follow from, for [`Gains::finish`](super::gains::Gains::finish); says whether it did.
    fn put_off_gains(&self, _: &Workspace, _: &LqNode, _: &mut LqKnot) -> bool {
        false
    }
}

/// The forms, with their scratch.
#[derive(Debug, Clone)]
pub(super) struct Forms {
    dense: Dense,
    euler: Euler,
    inverse_dynamics: InverseDynamics,
    driven: Driven,
}

impl Forms {
    /// Room for n states, and for inverse dynamics with at most m controls as of [`InverseDynamics::room`].
    pub(super) fn new(n: usize, m: usize, room: [usize; 3]) -> Self {
        let (euler, inverse_dynamics) = (Euler::new(n), InverseDynamics::new(room, n, m));
        Self { dense: Dense, euler, inverse_dynamics, driven: Driven::new(n) }
    }

    /// The form for a step at a node.
    pub(super) fn of_step(&mut self, node: &LqNode, regularisation: f64) -> &mut dyn Form {
        match node.inverse_dynamics.active && Driven::takes(node, regularisation) {
            true => &mut self.driven,
            false => self.of(node),
        }
    }

    /// The form of a node, of those that can have rows below.
    pub(super) fn of(&mut self, node: &LqNode) -> &mut dyn Form {
        if node.inverse_dynamics.active {
            &mut self.inverse_dynamics
        } else if node.structure.euler().is_some() && node.ndx() >= EULER_FROM {
            &mut self.euler
        } else {
            &mut self.dense
        }
    }
}

/// The question for the curvature of a knot's dynamics; see [`Sweep::run_with`](crate::Sweep::run_with).
pub(super) struct Curvature<'a> {
    /// The knot.
    pub(super) knot: usize,
    /// Writes the second derivatives of λᵀφ at a knot, and says whether it did.
    pub(super) ask: &'a mut dyn FnMut(usize, &[f64], &mut Hessian) -> bool,
    /// The places for these derivatives, one for each number of controls.
    pub(super) hessians: &'a mut [Hessian],
}

impl Curvature<'_> {
    /// The second derivatives of λᵀφ at a knot with nu controls, unless there are none.
    fn at(&mut self, lambda: &[f64], nu: usize) -> Option<&Hessian> {
        let hessian = self.hessians.iter_mut().find(|hessian| hessian.uu.nrows() == nu)?;
        (self.ask)(self.knot, lambda, hessian).then_some(&*hessian)
    }
}
