//! Limits: bounds on residuals of a robot's state, controls and forces.

use super::horizon::{PerKnot, PerModel};
use super::knot_data::Sensitivities;
use super::outputs::Capabilities;
use super::residuals::cones::FrictionCone;
use super::residuals::layout::{KnotLayout, Plan};
use super::residuals::residual::Residual;
use super::residuals::terms::{KinematicTerms, Objective, Term, Terms};
use super::residuals::view::ResidualView;
use crate::Error;
use crate::lq::LqKnot;
use crate::problem::{Bounded, Multipliers, Part, Soft, Visit, leave_a_value};
use condyle_dynamics::{Mat3, Model};
use std::sync::Arc;

/// Residual within bounds: lower ≤ r(x, u) ≤ upper. Equal bounds make an equality. If both lists of bounds are empty,
/// the limit is r(x, u) = 0.
///
/// [`InteriorPoint`](crate::InteriorPoint) and [`AugmentedLagrangian`](crate::AugmentedLagrangian) enforce the limit.
/// For [`Fddp`](crate::Fddp) alone the limit is a cost for values outside the bounds. The limit uses the dynamics and
/// kinematics that the costs of its knot compute. The limit applies at the beginning of the knot, with any integrator
/// and any Δt. In an augmented Lagrangian all entries of r have the same penalty, whatever their units.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Limit, Residual};
/// use condyle_optimal::{AugmentedLagrangian, Problem, Status};
/// use std::sync::Arc;
/// # let (arm, x0) = (Arc::new(robots::arm7()), [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat());
/// // an arm reaches a point exactly, with no effort above 30 N m
/// let effort = Residual::Control { reference: vec![0.0; 7] };
/// let limit = Limit::new("effort", effort.clone(), vec![-30.0; 7], vec![30.0; 7]);
/// let point = Residual::FrameTranslation { frame: "tool".into(), target: [0.5, 0.1, 0.6].into() };
/// let costs = vec![
///     Cost::new("effort", 1e-3, effort, Activation::Quadratic),
///     Cost::new("rest", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic),
/// ];
/// let mut knot = FreeDynamics::running(arm.clone(), 0.05, costs)?.with_limits(vec![limit])?;
/// let us = knot.quasi_static(&x0).repeat(10);
/// let end = FreeDynamics::terminal(arm.clone(), vec![])?.with_limits(vec![Limit::equality("reach", point)])?;
/// let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 10], Box::new(end))?;
/// let mut solver = AugmentedLagrangian::new(&problem);
/// let solution = solver.solve(&mut problem, &x0.repeat(11), &us)?;
/// assert_eq!(solution.status, Status::Converged);
/// assert!(solution.us.iter().all(|u| u.abs() < 30.0 + 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Soft limits
/// A [softened](Self::softened) limit gives way where it costs less than to hold it: each value outside its bounds has
/// the cost of [`Soft`]. An equality gives way to both sides. A soft limit never makes a problem infeasible, and it has
/// no part in the violation that the solvers report. [`Outcome::gave_way`](crate::Outcome::gave_way) lists the rows
/// that gave way, and [`Outcome::soft_cost`](crate::Outcome::soft_cost) is the sum of their costs. For
/// [`Fddp`](crate::Fddp) alone, the cost is rounded near the bounds, where a penalty of 10 per squared unit costs less.
///
/// ```
/// # use condyle_dynamics::robots;
/// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Limit, Residual};
/// # use condyle_optimal::{InteriorPoint, Problem, Status};
/// # use std::sync::Arc;
/// # let (arm, x0) = (Arc::new(robots::arm7()), [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat());
/// // 10 N m cannot hold this arm, so the efforts exceed them, but no more than necessary
/// let effort = Residual::Control { reference: vec![0.0; 7] };
/// let limit = Limit::new("effort", effort.clone(), vec![-10.0; 7], vec![10.0; 7]).softened(0.1, 0.0);
/// let rest = Residual::State { reference: x0.clone() };
/// let rest = Limit::new("rest", rest, vec![-0.1; 14], vec![0.1; 14]);
/// let costs = vec![Cost::new("effort", 1e-3, effort, Activation::Quadratic)];
/// let mut knot = FreeDynamics::running(arm.clone(), 0.05, costs)?.with_limits(vec![limit, rest])?;
/// let us = knot.quasi_static(&x0).repeat(10);
/// let end = FreeDynamics::terminal(arm.clone(), vec![])?;
/// let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 10], Box::new(end))?;
/// let mut solver = InteriorPoint::new(&problem);
/// assert_eq!(solver.solve(&mut problem, &x0.repeat(11), &us)?.status, Status::Converged);
/// let outcome = solver.outcome();
/// assert!(outcome.primal < 1e-6); // the hard limit holds
/// let total: f64 = outcome.gave_way.iter().map(|row| row.amount).sum();
/// assert!(outcome.gave_way.iter().all(|row| row.name.as_deref() == Some("effort")));
/// assert!(total > 1.0 && (outcome.soft_cost - 0.1 * total).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Limit {
    /// Name of the limit in error messages.
    pub name: String,
    /// Residual r.
    pub residual: Residual,
    /// Lower bounds; −∞ for an entry without a lower bound. If both `lower` and `upper` are empty, r = 0.
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
    pub lower: Vec<f64>,
    /// Upper bounds; ∞ for an entry without an upper bound.
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub upper: Vec<f64>,
    /// Cost of values outside the bounds, if the limit may give way; `None` for a hard limit.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub soft: Option<Soft>,
}

impl Limit {
    /// Returns the hard limit lower ≤ residual ≤ upper, with the name `name`.
    pub fn new(name: &str, residual: Residual, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self { name: name.to_owned(), residual, lower, upper, soft: None }
    }

    /// Returns the hard limit residual = 0, with the name `name`.
    pub fn equality(name: &str, residual: Residual) -> Self {
        Self::new(name, residual, vec![], vec![])
    }

    /// Returns the limit as a soft limit: each value that is outside its bounds by e costs
    /// linear · e + ½ quadratic · e².
    pub fn softened(self, linear: f64, quadratic: f64) -> Self {
        Self { soft: Some(Soft { linear, quadratic }), ..self }
    }

    /// Returns the plan of the limit's residual, or a text that describes why the limit does not fit the robot. Sets
    /// both bounds to 0 if both are empty.
    fn plan(&mut self, model: &Model, capabilities: &Capabilities) -> Result<Plan, String> {
        let plan = Plan::new(model, capabilities, &self.residual)?;
        if self.lower.is_empty() && self.upper.is_empty() {
            (self.lower, self.upper) = (vec![0.0; plan.n], vec![0.0; plan.n]);
        }
        for (which, bounds) in [("lower", &self.lower), ("upper", &self.upper)] {
            if bounds.len() != plan.n {
                return Err(format!("its {which} bound has {} numbers, expected {}", bounds.len(), plan.n));
            }
        }
        let beyond = |lower: &f64| plan.range.is_finite() && *lower >= plan.range;
        if let Some(i) = self.lower.iter().position(beyond) {
            return Err(format!("entry {i} must be at least {}, but its range is {}", self.lower[i], plan.range));
        }
        if let Some(Soft { linear, quadratic }) = self.soft.filter(|soft| !soft.is_valid()) {
            return Err(format!(
                "its soft weights must be finite, at least 0, and not both 0; found {linear} and {quadratic}"
            ));
        }
        let bad = (0..plan.n).find(|&i| !leave_a_value(self.lower[i], self.upper[i]));
        let what = |i| format!("entry {i} must be at least {} and at most {}", self.lower[i], self.upper[i]);
        bad.map_or(Ok(plan), |i| Err(what(i)))
    }
}

impl Term for Limit {
    fn residual(&self) -> &Residual {
        &self.residual
    }

    fn residual_mut(&mut self) -> &mut Residual {
        &mut self.residual
    }
}

/// Limits of one knot.
#[derive(Clone, Debug, Default)]
pub(super) struct LimitSet {
    pub(super) terms: Terms<Limit>,
    /// Lower bounds of all limits, one after the other.
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Name and rows of each limit.
    parts: Vec<Part>,
}

impl LimitSet {
    /// Creates the set of `limits` for knot `knot`, or for all knots if `knot` is `None`. `capabilities` describes the
    /// outputs of the robot's dynamics.
    fn new(model: &Model, capabilities: &Capabilities, limits: Vec<Limit>, knot: Option<usize>) -> Result<Self, Error> {
        let mut set = Self::default();
        for mut limit in limits {
            let name = limit.name.clone();
            let wrong = |what: String| Error::Limit { name, knot, what };
            if set.terms.all().iter().any(|other| other.name == limit.name) {
                return Err(wrong("another limit has this name".to_owned()));
            }
            let plan = limit.plan(model, capabilities).map_err(wrong)?;
            let of_state = matches!(limit.residual, Residual::State { .. }) || limit.residual.is_kinematic();
            let (name, first, soft) = (limit.name.as_str().into(), set.lower.len(), limit.soft);
            let rows = match &limit.residual {
                Residual::Distances { pairs, .. } => pairs.iter().map(|pair| pair.to_string().into()).collect(),
                _ => Arc::default(),
            };
            set.parts.push(Part { name, first, of_state, soft, rows });
            set.lower.extend(&limit.lower);
            set.upper.extend(&limit.upper);
            set.terms.push(limit, plan);
        }
        Ok(set)
    }
}

/// Limits of all knots of an action, with their multipliers.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    sets: PerModel<PerKnot<LimitSet>>,
    /// Limits that the dynamics require at every knot. They precede the user's limits.
    own: Vec<Limit>,
    /// Empty list of limits, for evaluations without limits.
    none: Terms<Limit>,
    multipliers: Multipliers,
    /// Whether limits add their terms of the augmented Lagrangian to the cost. Each evaluation of a group sets it.
    pub(super) in_cost: bool,
}

impl Limits {
    /// Returns an empty set of limits.
    pub(super) fn none() -> Self {
        let (sets, none) = (PerModel::new(PerKnot::new(LimitSet::default())), Terms::default());
        Self { sets, own: Vec::new(), none, multipliers: Multipliers::new(0), in_cost: true }
    }

    /// Returns a set of limits without the user's limits. It contains the limits `own`, which the dynamics require at
    /// every knot.
    pub(super) fn asked_for(own: Vec<Limit>) -> Self {
        Self { own, ..Self::none() }
    }

    /// Sets the limits of knot t, or the common limits of all knots without separate limits. Deletes the multipliers.
    pub(super) fn set(
        &mut self,
        model: &Model,
        capabilities: &Capabilities,
        t: Option<usize>,
        limits: Vec<Limit>,
    ) -> Result<(), Error> {
        let all = self.own.iter().cloned().chain(limits).collect();
        self.sets.chosen_mut().set(t, LimitSet::new(model, capabilities, all, t)?);
        self.multipliers = Multipliers::new(self.most());
        Ok(())
    }

    /// Turns the friction cone of the limit called `name` to the rotation R, at all knots of all models. Returns
    /// whether there is such a limit. Allocates nothing.
    pub(super) fn turn_cone(&mut self, name: &str, R: Mat3<f64>) -> Result<bool, Error> {
        let mut found = false;
        for set in self.sets.all_mut().iter_mut().flat_map(PerKnot::all_mut) {
            for (limit, plan) in set.terms.with_plans_mut().filter(|(limit, _)| limit.name == name) {
                if !limit.residual.turn_cone(R, plan.rows.len(), &mut plan.W) {
                    let what = "it is no friction cone of a force".to_owned();
                    return Err(Error::Limit { name: name.to_owned(), knot: None, what });
                }
                found = true;
            }
        }
        Ok(found)
    }

    /// Calls `change` with the friction cone of each limit called `name`, at all knots of all models. Returns whether
    /// there is such a limit.
    pub(super) fn change_friction(&mut self, name: &str, change: &mut dyn FnMut(&mut FrictionCone)) -> bool {
        let mut found = false;
        for set in self.sets.all_mut().iter_mut().flat_map(PerKnot::all_mut) {
            for (limit, plan) in set.terms.with_plans_mut().filter(|(limit, _)| limit.name == name) {
                found |= limit.residual.change_friction(plan.rows.len(), &mut plan.W, change);
            }
        }
        found
    }

    /// Calls `visit` with the name and the residual of each limit.
    pub(super) fn visit_terms(&self, visit: &mut dyn FnMut(&str, &Residual)) {
        for limit in self.all().flat_map(|set| set.terms.all()) {
            visit(&limit.name, &limit.residual);
        }
    }

    /// Returns the limit sets of the knots of the chosen model.
    pub(super) fn chosen_sets_mut(&mut self) -> &mut PerKnot<LimitSet> {
        self.sets.chosen_mut()
    }

    /// Returns the limit sets of all knots and all models.
    fn all(&self) -> impl Iterator<Item = &LimitSet> {
        self.sets.all().iter().flat_map(PerKnot::all)
    }

    /// Returns the largest number of constraint rows of a knot.
    fn most(&self) -> usize {
        self.all().map(|set| set.terms.len()).max().unwrap_or(0)
    }

    /// Moves the limits of another action's model to this action, as model `place` or as a new model. Deletes the
    /// multipliers.
    pub(super) fn append(&mut self, other: &mut Self, place: Option<usize>) {
        let most = self.multipliers.size().max(other.multipliers.size());
        self.sets.append(&mut other.sets, place);
        self.multipliers = Multipliers::new(most);
    }

    /// Chooses the model whose limits later changes affect.
    pub(super) fn choose(&mut self, model: usize) {
        self.sets.choose(model);
    }

    /// Assigns a model to knot t of a horizon with `horizon` knots.
    pub(super) fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.sets.serve(t, horizon, model);
    }

    /// Removes the separate limits of knot t of the chosen model.
    pub(super) fn release(&mut self, t: usize) {
        self.sets.chosen_mut().release(t);
    }

    /// Moves the horizon by one knot: knot t becomes knot t − 1.
    pub(super) fn shift(&mut self) {
        self.sets.all_mut().iter_mut().for_each(PerKnot::shift);
    }

    /// Returns the memory layout of limits, large enough for every knot.
    pub(super) fn layout(&self) -> KnotLayout {
        self.all().fold(KnotLayout::default(), |most, set| most.or(set.terms.layout()))
    }

    /// Returns the limits of knot t if `limited`, else an empty list. Only the first stage of an integration step has
    /// limits.
    pub(super) fn at(&self, t: usize, limited: bool) -> &Terms<Limit> {
        if limited { &self.sets.at(t).at(t).terms } else { &self.none }
    }

    /// Returns the limits that add to the cost at knot t, and their term in the augmented Lagrangian.
    pub(super) fn objective(&mut self, t: usize, limited: bool) -> (&Terms<Limit>, LimitObjective<'_>) {
        let Self { sets, none, multipliers, in_cost, .. } = self;
        let terms = if limited && *in_cost { &sets.at(t).at(t).terms } else { none };
        (terms, LimitObjective { multipliers, t })
    }

    /// Writes the residuals of the limits of the knot that `view` shows.
    pub(super) fn write_values(&self, view: &mut ResidualView<'_>, to: &mut [f64]) {
        for (limit, plan) in self.at(view.t, true).with_plans() {
            view.compute(&limit.residual, plan);
            to[plan.first..][..plan.n].copy_from_slice(&view.scratch.r[..plan.n]);
        }
    }

    /// Appends the limits of the knot that `view` shows to the rows of an LQ knot.
    pub(super) fn write_rows(&self, view: &mut ResidualView<'_>, sensitivities: &dyn Sensitivities, knot: &mut LqKnot) {
        for (limit, plan) in self.at(view.t, true).with_plans() {
            view.compute(&limit.residual, plan);
            view.push_constraint_rows(&limit.residual, plan, sensitivities, [&limit.lower, &limit.upper], knot);
        }
    }

    /// Calls `visit` with the bounds, names and multipliers of the limits of knot t.
    pub(super) fn visit(&mut self, t: usize, visit: &mut Visit<'_>) {
        let LimitSet { terms, lower, upper, parts } = self.sets.at(t).at(t);
        visit(Bounded { count: terms.len(), lower, upper, parts, multipliers: &mut self.multipliers });
    }
}

/// Term of the limits at knot t in the augmented Lagrangian.
pub(super) struct LimitObjective<'a> {
    pub multipliers: &'a mut Multipliers,
    t: usize,
}

impl Objective<Limit> for LimitObjective<'_> {
    fn value(&self, limit: &Limit, plan: &Plan, r: &[f64]) -> f64 {
        self.multipliers.value(self.t, plan.first, r, [&limit.lower, &limit.upper], limit.soft)
    }

    fn slopes(&mut self, limit: &Limit, plan: &Plan, r: &[f64], d: &mut [f64], dd: &mut [f64]) {
        self.multipliers.slopes(self.t, plan.first, r, [&limit.lower, &limit.upper], limit.soft, [d, dd]);
    }
}
