//! Costs of a robot's state and control: weighted sums of activations of residuals.

use super::activation::Activation;
use super::outputs::Capabilities;
use super::residuals::layout::Plan;
use super::residuals::residual::Residual;
use super::residuals::terms::{Objective, Term, Terms};
use crate::Error;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Term w · a(r(x, u)) of a robot's cost.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Cost {
    /// Name of the term.
    pub name: String,
    /// Weight w, finite and at least 0. A term with the weight 0 is not computed.
    pub weight: f64,
    /// Residual r of the term.
    pub residual: Residual,
    /// Activation a of the term.
    pub activation: Activation,
}

impl Cost {
    /// Returns the cost term `weight` · activation(residual), with the name `name`.
    pub fn new(name: &str, weight: f64, residual: Residual, activation: Activation) -> Self {
        Self { name: name.to_owned(), weight, residual, activation }
    }
}

/// Sum of cost terms, each with a name.
///
/// First derivatives are exact. Second derivatives are the Gauss–Newton approximation w (∂r)ᵀ a″ ∂r, with weight w,
/// residual r and activation a. Kinematics that several terms need are computed once for each knot. Known zeros of
/// Jacobians are skipped.
#[derive(Clone, Debug)]
pub struct Costs {
    pub(super) model: Arc<Model>,
    pub(super) capabilities: Arc<Capabilities>,
    pub(super) terms: Terms<Cost>,
}

impl Term for Cost {
    fn residual(&self) -> &Residual {
        &self.residual
    }

    fn residual_mut(&mut self) -> &mut Residual {
        &mut self.residual
    }

    fn weight(&self) -> f64 {
        self.weight
    }
}

impl Cost {
    /// Returns whether the two terms differ only in target, weight and activation.
    fn is_like(&self, other: &Self) -> bool {
        self.name == other.name && self.residual.is_like(&other.residual)
    }

    /// Copies target, weight and activation of a term that [is like](Self::is_like) this one.
    fn assign(&mut self, from: &Self) {
        self.weight = from.weight;
        self.activation.assign(&from.activation);
        match from.residual.target() {
            Some(target) => self.residual.write_target(target),
            None => debug_assert!(self.residual == from.residual),
        }
    }

    /// Returns the plan of the term's residual, or an error if the term does not fit the robot.
    fn plan(&self, model: &Model, capabilities: &Capabilities) -> Result<Plan, Error> {
        let wrong = |what: String| Error::Cost { name: self.name.clone(), what };
        let plan = Plan::new(model, capabilities, &self.residual).map_err(wrong)?;
        check_weight(&self.name, self.weight)?;
        self.activation.wrong(plan.n).map_or(Ok(plan), |what| Err(wrong(what)))
    }
}

/// Returns an error if the weight of the term called `name` is negative or not finite. No weight may be negative,
/// because solvers assume that Hessians of costs are positive semidefinite.
pub(super) fn check_weight(name: &str, weight: f64) -> Result<(), Error> {
    if weight >= 0.0 && weight.is_finite() {
        return Ok(());
    }
    let what = format!("its weight is {weight}, expected a finite number of at least 0");
    Err(Error::Cost { name: name.to_owned(), what })
}

/// Objective of costs: weighted activations w a(r), times a common factor.
pub(super) struct WeightedActivations(pub f64);

impl Objective<Cost> for WeightedActivations {
    fn value(&self, cost: &Cost, _: &Plan, r: &[f64]) -> f64 {
        self.0 * cost.weight * cost.activation.value(r)
    }

    fn slopes(&mut self, cost: &Cost, _: &Plan, r: &[f64], d: &mut [f64], dd: &mut [f64]) {
        cost.activation.derivatives(r, d, dd);
        d.iter_mut().chain(dd).for_each(|d| *d *= self.0 * cost.weight);
    }
}

impl Costs {
    /// Creates the sum of the cost terms `costs`. `capabilities` describes the outputs of the robot's dynamics.
    pub(super) fn new(model: Arc<Model>, capabilities: Arc<Capabilities>, costs: Vec<Cost>) -> Result<Self, Error> {
        for (k, cost) in costs.iter().enumerate() {
            if costs[..k].iter().any(|other| other.name == cost.name) {
                let what = "another term has this name".to_owned();
                return Err(Error::Cost { name: cost.name.clone(), what });
            }
        }
        let mut terms = Terms::default();
        for cost in costs {
            let plan = cost.plan(&model, &capabilities)?;
            terms.push(cost, plan);
        }
        Ok(Self { model, capabilities, terms })
    }

    /// Copies the terms of other costs of the same robot. Allocates nothing if both have the same terms, apart from
    /// targets and weights.
    pub(super) fn assign(&mut self, from: &Self) {
        let (own, others) = (self.terms(), from.terms());
        if own.len() == others.len() && own.iter().zip(others).all(|(own, other)| own.is_like(other)) {
            for (k, other) in others.iter().enumerate() {
                self.terms.term_mut(k).0.assign(other);
            }
        } else {
            self.clone_from(from);
        }
    }

    /// Returns all cost terms.
    pub fn terms(&self) -> &[Cost] {
        self.terms.all()
    }

    /// Returns all terms with the plans of their residuals.
    pub(super) fn all_mut(&mut self) -> &mut Terms<Cost> {
        &mut self.terms
    }

    /// Changes the weight of the term called `name`, between solves. Returns whether such a term exists.
    ///
    /// # Errors
    /// [`Error::Cost`] if the weight is negative or not finite; the old weight then stays.
    pub fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
        check_weight(name, weight)?;
        let cost = self.terms.all_mut().iter_mut().find(|cost| cost.name == name);
        Ok(cost.map(|cost| cost.weight = weight).is_some())
    }

    /// Replaces the residual of the term called `name` between solves, for example to change its target. Allocates.
    ///
    /// # Errors
    /// [`Error::Cost`] if the term does not exist, the residual does not fit the robot, or the number of the residual's
    /// entries differs from the old number.
    pub fn set_residual(&mut self, name: &str, residual: Residual) -> Result<(), Error> {
        let wrong = |what: &str| Error::Cost { name: name.to_owned(), what: what.to_owned() };
        let there = self.terms().iter().position(|cost| cost.name == name);
        let k = there.ok_or_else(|| wrong("there is no such term"))?;
        let cost = Cost { residual, ..self.terms()[k].clone() };
        let plan = cost.plan(&self.model, &self.capabilities)?;
        let same = self.terms.replace(k, cost, plan);
        if same { Ok(()) } else { Err(wrong("its residual is of another kind than before")) }
    }
}
