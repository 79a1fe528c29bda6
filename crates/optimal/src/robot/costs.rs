//! Costs of a robot's state and control: weighted sums of activations of residuals.

use super::activation::Activation;
use super::residual::{Part, Residual};
use super::sight::seat;
use super::terms::{Plan, Room, View};
use super::watch::{Offer, Slopes};
use crate::Error;
use crate::lq::LqNode;
use condyle_dynamics::Model;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A term w · a(r(x, u)) of a cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// How it is called.
    pub name: String,
    /// w; a term whose weight is 0 is not computed.
    pub weight: f64,
    /// r.
    pub residual: Residual,
    /// a.
    pub activation: Activation,
}

impl Cost {
    /// The term `weight` · activation(residual), called `name`.
    pub fn new(name: &str, weight: f64, residual: Residual, activation: Activation) -> Self {
        Self { name: name.to_owned(), weight, residual, activation }
    }
}

/// A sum of terms, called by their names.
///
/// Derivatives are exact; second derivatives are Gauss–Newton's, w (∂r)ᵀ a″ ∂r. Kinematics that several terms look at
/// are computed once for a knot, and only where a Jacobian is not zero is anything added.
#[derive(Clone, Debug)]
pub struct Costs {
    model: Arc<Model>,
    offer: Offer,
    terms: Vec<Cost>,
    plans: Vec<Plan>,
    /// The terms that look at kinematics.
    looks: Vec<usize>,
    room: Room,
}

/// A term as it is computed.
fn plan(model: &Model, offer: &Offer, term: &Cost) -> Result<Plan, Error> {
    let wrong = |what: String| Error::Cost { name: term.name.clone(), what };
    let plan = Plan::new(model, offer, &term.residual).map_err(wrong)?;
    if !term.weight.is_finite() {
        return Err(wrong(format!("its weight is {}", term.weight)));
    }
    term.activation.wrong(plan.n).map_or(Ok(plan), |what| Err(wrong(what)))
}

impl Costs {
    /// The sum of some terms for a robot whose dynamics offer some signals.
    pub(super) fn new(model: Arc<Model>, offer: Offer, terms: Vec<Cost>) -> Result<Self, Error> {
        for (k, term) in terms.iter().enumerate() {
            if terms[..k].iter().any(|t| t.name == term.name) {
                let what = "another term has this name".to_owned();
                return Err(Error::Cost { name: term.name.clone(), what });
            }
        }
        let mut plans = terms.iter().map(|term| plan(&model, &offer, term)).collect::<Result<Vec<_>, _>>()?;
        let nv = model.nv();
        let looks = seat(nv, terms.iter().map(|term| &term.residual).zip(&mut plans));
        let room = terms.iter().zip(&plans).map(|(term, plan)| Room::of(nv, &term.residual, plan)).sum();
        Ok(Self { model, offer, terms, plans, looks, room })
    }

    /// The terms.
    pub fn terms(&self) -> &[Cost] {
        &self.terms
    }

    /// Changes the weight of the term called `name`, between solves; says whether there is one.
    pub fn set_weight(&mut self, name: &str, weight: f64) -> bool {
        let term = self.terms.iter_mut().find(|t| t.name == name);
        term.map(|t| t.weight = weight).is_some()
    }

    /// Changes what the term called `name` looks at, between solves: its target, for example. Allocates.
    ///
    /// # Errors
    /// [`Error::Cost`] if there is no such term, the residual does not fit the robot, or it has another number of
    /// entries than the one before.
    pub fn set_residual(&mut self, name: &str, residual: Residual) -> Result<(), Error> {
        let wrong = |what: &str| Error::Cost { name: name.to_owned(), what: what.to_owned() };
        let k = self.terms.iter().position(|t| t.name == name).ok_or_else(|| wrong("there is no such term"))?;
        let term = Cost { residual, ..self.terms[k].clone() };
        let (mut plan, nv) = (plan(&self.model, &self.offer, &term)?, self.model.nv());
        if Room::of(nv, &term.residual, &plan) != Room::of(nv, &self.terms[k].residual, &self.plans[k]) {
            return Err(wrong("its residual is of another kind than before"));
        }
        plan.seat = self.plans[k].seat;
        (self.terms[k], self.plans[k]) = (term, plan);
        Ok(())
    }

    /// What its residuals take, whatever their weights.
    pub(super) fn room(&self) -> Room {
        self.room
    }

    /// The terms that look at kinematics, whatever their weights.
    pub(super) fn looks(&self) -> impl Iterator<Item = (&Cost, &Plan)> {
        self.looks.iter().map(|&k| (&self.terms[k], &self.plans[k]))
    }

    /// The terms that have a weight.
    fn weighty(&self) -> impl Iterator<Item = (&Cost, &Plan)> {
        self.terms.iter().zip(&self.plans).filter(|(term, _)| term.weight != 0.0)
    }

    /// Σ w a(r(x, u)).
    pub(super) fn calc(&self, view: &mut View<'_>) -> f64 {
        let mut sum = 0.0;
        for (term, plan) in self.weighty() {
            view.residual(&term.residual, plan);
            sum += term.weight * term.activation.value(&view.scratch.r[..plan.n]);
        }
        sum
    }

    /// The rows of Jacobians, for the gradient and the Hessian of `scale` · Σ w a(r(x, u)).
    pub(super) fn push_rows(&self, view: &mut View<'_>, slopes: &dyn Slopes, scale: f64) {
        for (term, plan) in self.weighty().filter(|(term, _)| term.residual.part() != Part::Diagonal) {
            worth(term, plan, view, scale);
            view.push_rows(&term.residual, plan, slopes);
        }
    }

    /// The parts of both that have no rows, to q, r, Q, R of the node.
    pub(super) fn add_diagonals(&self, view: &mut View<'_>, scale: f64, node: &mut LqNode) {
        for (term, plan) in self.weighty().filter(|(term, _)| term.residual.part() == Part::Diagonal) {
            worth(term, plan, view, scale);
            view.add_diagonal(&term.residual, node);
        }
    }
}

/// The residual of a term and `scale` · w times the derivatives of its activation, in the scratch.
fn worth(term: &Cost, plan: &Plan, view: &mut View<'_>, scale: f64) {
    view.residual(&term.residual, plan);
    let (s, weight) = (&mut *view.scratch, scale * term.weight);
    term.activation.derivatives(&s.r[..plan.n], &mut s.d, &mut s.dd);
    s.d[..plan.n].iter_mut().chain(&mut s.dd[..plan.n]).for_each(|d| *d *= weight);
}
