//! Access by name to the costs of the robots in a problem, which changes targets, weights and activations in place.

use super::activation::{Activation, wrong_weights};
use super::costs::{Cost, Costs, check_weight};
use super::dynamics::robot::robot_of;
use super::horizon::HorizonTerms;
use super::residuals::target::Target;
use crate::{ActionModel, Error, Problem};
use condyle_dynamics::Model;
#[cfg(feature = "serde")]
use std::sync::Arc;

/// Cost term of a robot's knots, which may be changed between solves. If a change does not fit the robot or the
/// residual, the call returns an error and has no effect.
#[derive(Debug)]
pub struct CostMut<'a> {
    cost: &'a mut Cost,
    model: &'a Model,
    nu: usize,
    /// Number of entries of the residual.
    n: usize,
}

impl CostMut<'_> {
    /// Returns the cost term.
    pub fn get(&self) -> &Cost {
        self.cost
    }

    /// Returns the robot.
    pub(super) fn model(&self) -> &Model {
        self.model
    }

    /// Returns the target of the residual; `None` if the residual has no target.
    pub fn target(&self) -> Option<Target<'_>> {
        self.cost.residual.target()
    }

    /// Sets the target of the residual: a position, a placement, or a reference of unchanged length. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Cost`] if the residual has no target or a target of another kind, or if the length of the reference
    /// changes. Also if a number is not finite, or a matrix is not a rotation.
    pub fn set_target<'t>(&mut self, target: impl Into<Target<'t>>) -> Result<(), Error> {
        let target = target.into();
        let wrong = |what| Error::Cost { name: self.cost.name.clone(), what };
        self.cost.residual.check_target(self.model, self.nu, target).map_err(wrong)?;
        self.cost.residual.write_target(target);
        Ok(())
    }

    /// Sets the weight of the cost term. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Cost`] if the weight is negative or not finite.
    pub fn set_weight(&mut self, weight: f64) -> Result<(), Error> {
        check_weight(&self.cost.name, weight)?;
        self.cost.weight = weight;
        Ok(())
    }

    /// Sets the weights wᵢ of the entries of the residual, in an activation that has weights. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Cost`] if the activation has no weights, if a weight is negative or not finite, or if the number of
    /// weights differs from the number of entries of the residual.
    pub fn set_entry_weights(&mut self, weights: &[f64]) -> Result<(), Error> {
        let Self { cost, n, .. } = self;
        let wrong = |name: &str, what| Err(Error::Cost { name: name.to_owned(), what });
        if let Some(what) = wrong_weights(weights, *n) {
            return wrong(&cost.name, what);
        }
        match cost.activation.weights_mut() {
            Some(own) => own.copy_from_slice(weights),
            None => return wrong(&cost.name, "its activation has no weights".to_owned()),
        }
        Ok(())
    }

    /// Sets the activation of the cost term.
    ///
    /// # Errors
    /// [`Error::Cost`] if the weights or bounds of the activation are invalid, or if their number differs from the
    /// number of entries of the residual.
    pub fn set_activation(&mut self, activation: Activation) -> Result<(), Error> {
        if let Some(what) = activation.wrong(self.n) {
            return Err(Error::Cost { name: self.cost.name.clone(), what });
        }
        self.cost.activation = activation;
        Ok(())
    }
}

impl Costs {
    /// Returns the term called `name`, whose target, weight or activation may be changed between solves. Returns `None`
    /// if no term has this name.
    pub fn cost_mut(&mut self, name: &str) -> Option<CostMut<'_>> {
        let k = self.terms().iter().position(|cost| cost.name == name)?;
        let Self { model, capabilities, terms } = self;
        let (cost, n) = terms.term_mut(k);
        Some(CostMut { cost, model, nu: capabilities.nu, n })
    }
}

/// Returns the costs and limits of an action's robot; `None` if the action has no robot.
pub(super) fn terms_of(action: &mut dyn ActionModel) -> Option<&mut HorizonTerms> {
    Some(&mut robot_of(action)?.terms)
}

/// Access to the costs of robots with any dynamics and any integrator, also for actions inside
/// [`Constrained`](crate::Constrained) actions.
impl Problem {
    /// Returns the cost called `name` of the model `index`. All knots of this model share the cost, except knots with
    /// separate costs. Returns `None` if the model or the cost does not exist, or the model has no robot.
    ///
    /// ```
    /// use condyle_dynamics::{Vec3, robots};
    /// use condyle_optimal::Problem;
    /// use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// use std::sync::Arc;
    /// let arm = Arc::new(robots::arm7());
    /// let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    /// let costs = vec![Cost::new("reach", 1.0, reach, Activation::Quadratic)];
    /// let knot = FreeDynamics::running(arm.clone(), 0.02, costs.clone())?;
    /// let end = FreeDynamics::terminal(arm, costs)?;
    /// let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
    /// problem.cost_mut(0, "reach").unwrap().set_target(Vec3::new(0.3, 0.2, 0.5))?;
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    pub fn cost_mut(&mut self, index: usize, name: &str) -> Option<CostMut<'_>> {
        terms_of(self.chosen(index)?)?.costs_mut(None).cost_mut(name)
    }

    /// Returns the cost called `name` of knot t, or of the terminal knot for t = N. If knot t has separate costs, the
    /// result is one of these costs. Otherwise the result is a cost of the knot's model, which other knots share.
    /// Returns `None` if the cost does not exist.
    ///
    /// # Panics
    /// If t > N.
    #[track_caller]
    pub fn cost_at_mut(&mut self, t: usize, name: &str) -> Option<CostMut<'_>> {
        self.assert_knot(t);
        let action = match self.knot_models().get(t) {
            Some(&index) => self.chosen(index)?,
            None => self.changing_terminal(),
        };
        terms_of(action)?.costs_mut(Some(t)).cost_mut(name)
    }

    /// Returns the terminal action, to be changed.
    fn changing_terminal(&mut self) -> &mut dyn ActionModel {
        self.mark_changed();
        self.action_mut(self.horizon())
    }

    /// Calls `change` for each cost called `name`: in the costs of all models, of knots with separate costs, and of the
    /// terminal knot. Returns whether such a cost exists.
    ///
    /// # Errors
    /// The first error that `change` returns. Costs that were changed before this error stay changed.
    pub fn change_costs(
        &mut self,
        name: &str,
        mut change: impl FnMut(&mut CostMut<'_>) -> Result<(), Error>,
    ) -> Result<bool, Error> {
        let mut found = false;
        for index in (0..self.model_count()).map(Some).chain([None]) {
            let action = match index {
                Some(index) => self.chosen(index),
                None => Some(self.changing_terminal()),
            };
            let Some(terms) = action.and_then(terms_of) else { continue };
            for mut cost in terms.all_costs_mut().filter_map(|costs| costs.cost_mut(name)) {
                change(&mut cost)?;
                found = true;
            }
        }
        Ok(found)
    }

    /// Sets separate costs for knot t, or the costs of the terminal knot for t = N. Returns whether the knot has a
    /// robot.
    ///
    /// # Errors
    /// [`Error::Size`] if t > N, [`Error::Cost`] for a cost term that does not fit the robot.
    #[cfg(feature = "serde")]
    pub(crate) fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<bool, Error> {
        Error::check_size("knot", t, self.horizon())?;
        let action = match self.knot_models().get(t) {
            Some(&index) => self.chosen(index),
            None => Some(self.changing_terminal()),
        };
        let Some(terms) = action.and_then(terms_of) else { return Ok(false) };
        terms.set_costs(t, costs).map(|()| true)
    }

    /// Returns the robot of the terminal knot, if it has one.
    #[cfg(feature = "serde")]
    pub(crate) fn robot(&mut self) -> Option<Arc<Model>> {
        Some(robot_of(self.action_mut(self.horizon()))?.model.clone())
    }
}
