//! Costs and limits of each knot of a horizon, for all models that one action represents.

use super::costs::{Cost, Costs, WeightedActivations, check_weight};
use super::knot_data::{KnotState, Sensitivities};
use super::limits::{Limit, Limits};
use super::outputs::Capabilities;
use super::residuals::cones::FrictionCone;
use super::residuals::layout::KnotLayout;
use super::residuals::residual::Residual;
use super::residuals::terms::{KinematicTerms, KnotTerms};
use super::residuals::view::{ResidualView, Scratch};
use crate::Error;
use crate::lq::LqKnot;
use crate::problem::MOST_KNOTS;
use condyle_dynamics::Model;
use std::sync::Arc;

/// List with one value for each model that an action represents, and with the index of each knot's model.
#[derive(Clone, Debug)]
pub(crate) struct PerModel<T> {
    /// Value of each model.
    all: Vec<T>,
    /// Index of each knot's model; knots beyond the end of this list have model 0.
    of: Vec<usize>,
    /// Index of the model that later changes affect.
    chosen: usize,
}

impl<T> PerModel<T> {
    /// Creates the list for a single model, with the value `only`.
    pub(crate) fn new(only: T) -> Self {
        Self { all: vec![only], of: Vec::new(), chosen: 0 }
    }

    /// Returns all values.
    pub(crate) fn all(&self) -> &[T] {
        &self.all
    }

    /// Returns all values as a mutable slice.
    pub(crate) fn all_mut(&mut self) -> &mut [T] {
        &mut self.all
    }

    /// Returns the value at knot t.
    pub(crate) fn at(&self, t: usize) -> &T {
        self.of.get(t).and_then(|&model| self.all.get(model)).unwrap_or(&self.all[0])
    }

    /// Returns the value of the chosen model, which later changes affect.
    pub(crate) fn chosen_mut(&mut self) -> &mut T {
        &mut self.all[self.chosen]
    }

    /// Chooses the model that later changes affect.
    pub(crate) fn choose(&mut self, model: usize) {
        self.chosen = model.min(self.all.len() - 1);
    }

    /// Moves the value of another action's model into this list, as model `place` or as a new model.
    pub(crate) fn append(&mut self, other: &mut Self, place: Option<usize>) {
        match (place, other.all.pop()) {
            (Some(place), Some(value)) => self.all[place] = value,
            (_, value) => self.all.extend(value),
        }
    }

    /// Assigns a model to knot t of a horizon with `horizon` knots. Allocates only at the first call.
    pub(crate) fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        if self.all.len() > 1 {
            self.of.resize(horizon, 0);
            self.of[t] = model;
        }
    }
}

/// List of the values of a horizon's knots: a common value, and separate values for single knots.
#[derive(Clone, Debug)]
pub(crate) struct PerKnot<T> {
    /// Common value, followed by the separate values of single knots.
    all: Vec<T>,
    /// Index in `all` of each knot's value; knots beyond the end of this list have index 0, the common value.
    of: Vec<usize>,
    /// Free slots of `all`, whose knots have left the horizon; new values overwrite them.
    free: Vec<usize>,
}

impl<T> PerKnot<T> {
    /// Creates the list with a common value for all knots.
    pub(crate) fn new(common: T) -> Self {
        Self { all: vec![common], of: Vec::new(), free: Vec::new() }
    }

    fn index(&self, t: Option<usize>) -> usize {
        t.and_then(|t| self.of.get(t)).copied().unwrap_or(0)
    }

    /// Returns all values.
    pub(crate) fn all(&self) -> &[T] {
        &self.all
    }

    /// Returns all values as a mutable slice.
    pub(crate) fn all_mut(&mut self) -> &mut [T] {
        &mut self.all
    }

    /// Returns the value of knot t.
    pub(crate) fn at(&self, t: usize) -> &T {
        &self.all[self.index(Some(t))]
    }

    /// Returns the value of knot t; for `None`, the common value.
    pub(crate) fn at_mut(&mut self, t: Option<usize>) -> &mut T {
        let k = self.index(t);
        &mut self.all[k]
    }

    /// Sets the value of knot t; for `None`, the common value.
    pub(crate) fn set(&mut self, t: Option<usize>, value: T) {
        let Some(t) = t else {
            self.all[0] = value;
            return;
        };
        if t >= self.of.len() {
            self.of.resize(t + 1, 0);
        }
        if self.of[t] == 0 {
            self.of[t] = self.free.pop().unwrap_or(self.all.len());
        }
        match self.all.get_mut(self.of[t]) {
            Some(old) => *old = value,
            None => {
                self.all.push(value);
                self.free.reserve(self.all.len()); // `shift` needs this capacity and must not allocate
            }
        }
    }

    /// Returns the separate value of knot t. If knot t has no separate value yet, it gets a copy of the common value. A
    /// slot of a knot that has left the horizon is overwritten by `assign`, which need not allocate.
    pub(crate) fn separate(&mut self, t: usize, assign: impl FnOnce(&mut T, &T)) -> &mut T
    where
        T: Clone,
    {
        if self.index(Some(t)) == 0 {
            match self.free.pop() {
                Some(slot) => {
                    if t >= self.of.len() {
                        self.of.resize(t + 1, 0);
                    }
                    self.of[t] = slot;
                    let (common, others) = self.all.split_at_mut(1);
                    assign(&mut others[slot - 1], &common[0]);
                }
                None => self.set(Some(t), self.all[0].clone()),
            }
        }
        self.at_mut(Some(t))
    }

    /// Returns the knots that have separate values.
    pub(crate) fn separated(&self) -> impl Iterator<Item = (usize, &T)> {
        self.of.iter().enumerate().filter(|(_, k)| **k > 0).map(|(t, &k)| (t, &self.all[k]))
    }

    /// Removes the separate value of knot t, which then has the common value. Allocates nothing.
    pub(crate) fn release(&mut self, t: usize) {
        if let Some(slot) = self.of.get_mut(t) {
            let slot = core::mem::take(slot);
            self.free.extend((slot > 0).then_some(slot));
        }
    }

    /// Allocates memory for separate values of all knots of a horizon with `horizon` knots.
    pub(crate) fn reserve(&mut self, horizon: usize) {
        self.of.reserve(horizon.saturating_sub(self.of.len()));
        self.all.reserve((horizon + 1).saturating_sub(self.all.len()));
        self.free.reserve((horizon + 1).saturating_sub(self.free.len()));
    }

    /// Moves the horizon by one knot: knot t becomes knot t − 1.
    pub(crate) fn shift(&mut self) {
        if !self.of.is_empty() {
            let first = self.of.remove(0);
            self.free.extend((first > 0).then_some(first));
        }
    }
}

/// Costs and limits of all knots of an action.
#[derive(Clone, Debug)]
pub(crate) struct HorizonTerms {
    model: Arc<Model>,
    capabilities: Arc<Capabilities>,
    costs: PerModel<PerKnot<Costs>>,
    pub limits: Limits,
    /// Memory layouts of costs and of limits, each large enough for every knot.
    layouts: [KnotLayout; 2],
    /// Workspace of residuals. It is created at its first use and replaced when the layouts change.
    scratch: Option<Box<Scratch>>,
}

impl HorizonTerms {
    /// Creates the terms of a horizon with the same costs at all knots, and no limits.
    pub(crate) fn new(model: Arc<Model>, capabilities: Capabilities, costs: Vec<Cost>) -> Result<Self, Error> {
        let capabilities = Arc::new(capabilities);
        let costs = Costs::new(model.clone(), capabilities.clone(), costs)?;
        let layouts = [costs.terms.layout(), KnotLayout::default()];
        let costs = PerModel::new(PerKnot::new(costs));
        Ok(Self { costs, limits: Limits::none(), layouts, scratch: None, capabilities, model })
    }

    /// Sets the limits that the dynamics require at every knot, in addition to the user's limits.
    pub(crate) fn require(&mut self, limits: Vec<Limit>) -> Result<(), Error> {
        self.limits = Limits::asked_for(limits);
        self.set_limits(None, Vec::new())
    }

    /// Replaces the robot by one that differs only in its numbers.
    pub(crate) fn set_model(&mut self, model: &Arc<Model>) {
        self.model = model.clone();
        self.every_cost().for_each(|costs| costs.model = model.clone());
        self.scratch = None;
    }

    /// Returns the costs of all knots and all models.
    fn every_cost(&mut self) -> impl Iterator<Item = &mut Costs> {
        self.costs.all_mut().iter_mut().flat_map(PerKnot::all_mut)
    }

    /// Calls `change` with the friction cone of each limit and each cost called `name`. Returns whether one exists.
    pub(super) fn change_friction(&mut self, name: &str, change: &mut dyn FnMut(&mut FrictionCone)) -> bool {
        let mut found = self.limits.change_friction(name, change);
        for (cost, plan) in self.every_cost().flat_map(|costs| costs.terms.with_plans_mut()) {
            if cost.name == name {
                found |= cost.residual.change_friction(plan.rows.len(), &mut plan.W, change);
            }
        }
        found
    }

    /// Calls `visit` with the residual of each cost and each limit, with its name, and the cost if it is one.
    pub(crate) fn visit_terms(&mut self, visit: &mut dyn FnMut(&str, &Residual, Option<&Cost>)) {
        for cost in self.costs.all().iter().flat_map(PerKnot::all).flat_map(Costs::terms) {
            visit(&cost.name, &cost.residual, Some(cost));
        }
        self.limits.visit_terms(&mut |name, residual| visit(name, residual, None));
    }

    /// Returns the costs of knot t; for `None`, the common costs of all knots without separate costs.
    pub(crate) fn costs_mut(&mut self, t: Option<usize>) -> &mut Costs {
        self.costs.chosen_mut().at_mut(t)
    }

    /// Returns the separate costs of knot t. If knot t has none, it gets a copy of the common costs. Allocates nothing
    /// if a knot with a copy of the same costs has left the horizon.
    pub(crate) fn separate_costs_mut(&mut self, t: usize) -> &mut Costs {
        self.costs.chosen_mut().separate(t, Costs::assign)
    }

    /// Returns the costs of the knots that have separate costs.
    pub(crate) fn separate_costs(&mut self) -> impl Iterator<Item = (usize, &Costs)> {
        self.costs.chosen_mut().separated()
    }

    /// Returns the common costs, then the separate costs of single knots.
    pub(crate) fn all_costs_mut(&mut self) -> impl Iterator<Item = &mut Costs> {
        self.costs.chosen_mut().all_mut().iter_mut()
    }

    /// Changes the weight of the term called `name` in the costs of all knots. Returns whether any knot has this term.
    pub(crate) fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
        check_weight(name, weight)?;
        let mut found = false;
        for costs in self.costs.chosen_mut().all_mut() {
            found |= costs.set_weight(name, weight)?;
        }
        Ok(found)
    }

    /// Sets separate costs for knot t, which replace the common costs at this knot.
    pub(crate) fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<(), Error> {
        Error::check_size("knot", t, MOST_KNOTS)?;
        let costs = Costs::new(self.model.clone(), self.capabilities.clone(), costs).map_err(|error| match error {
            Error::Cost { name, what } => Error::Cost { name, what: format!("{what} (knot {t})") },
            other => other,
        })?;
        self.costs.chosen_mut().set(Some(t), costs);
        self.update_layouts();
        Ok(())
    }

    /// Sets the limits of knot t; for `None`, the common limits of all knots without separate limits.
    pub(crate) fn set_limits(&mut self, t: Option<usize>, limits: Vec<Limit>) -> Result<(), Error> {
        Error::check_size("knot", t.unwrap_or(0), MOST_KNOTS)?;
        self.limits.set(&self.model, &self.capabilities, t, limits)?;
        self.update_layouts();
        Ok(())
    }

    fn update_layouts(&mut self) {
        let all = self.costs.all().iter().flat_map(PerKnot::all);
        let costs = all.fold(KnotLayout::default(), |most, costs| most.or(costs.terms.layout()));
        self.set_layouts([costs, self.limits.layout()]);
    }

    /// Sets the layouts. If they differ from the old layouts, an existing scratch is replaced.
    fn set_layouts(&mut self, layouts: [KnotLayout; 2]) {
        if self.layouts != layouts {
            self.layouts = layouts;
            if self.scratch.take().is_some() {
                self.reserve();
            }
        }
    }

    /// Allocates the scratch, unless it already exists.
    pub(crate) fn reserve(&mut self) {
        let Self { model, capabilities, layouts, scratch, .. } = self;
        scratch.get_or_insert_with(|| Box::new(Scratch::new(model, capabilities.nu, layouts[0] + layouts[1])));
    }

    /// Moves the costs and limits of another action with the same dynamics to this action, as model `place` or as a new
    /// model.
    pub(crate) fn append(&mut self, other: &mut Self, place: Option<usize>) {
        self.costs.append(&mut other.costs, place);
        self.limits.append(&mut other.limits, place);
        self.set_layouts([0, 1].map(|k| self.layouts[k].or(other.layouts[k])));
    }

    /// Selects the model that later changes affect.
    pub(crate) fn choose(&mut self, model: usize) {
        self.costs.choose(model);
        self.limits.choose(model);
    }

    /// Assigns one of the models of this action to knot t of a horizon with `horizon` knots.
    pub(crate) fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.costs.serve(t, horizon, model);
        self.limits.serve(t, horizon, model);
    }

    /// Removes the separate costs and limits of knot t of the chosen model.
    pub(crate) fn release(&mut self, t: usize) {
        self.costs.chosen_mut().release(t);
        self.limits.release(t);
    }

    /// Moves the horizon by one knot: knot t becomes knot t − 1.
    pub(crate) fn shift(&mut self) {
        self.costs.all_mut().iter_mut().for_each(PerKnot::shift);
        self.limits.shift();
    }

    /// Returns the memory layouts of costs and of limits, each large enough for every knot.
    pub(crate) fn layouts(&self) -> [KnotLayout; 2] {
        self.layouts
    }

    /// Returns the memory layout of costs and limits together, large enough for every knot.
    pub(crate) fn layout(&self) -> KnotLayout {
        self.layouts[0] + self.layouts[1]
    }

    /// Returns the costs of knot t and, if `limited`, the limits of knot t.
    pub(crate) fn at(&self, t: usize, limited: bool) -> KnotTerms<'_> {
        KnotTerms([&self.costs.at(t).at(t).terms, self.limits.at(t, limited)])
    }

    /// Computes the cost ℓ of knot t and, if `limited`, the limit term of the knot in the augmented Lagrangian.
    pub(crate) fn calc(&mut self, t: usize, state: KnotState<'_>, limited: bool) -> (f64, f64) {
        self.reserve();
        let Self { model, costs, limits, scratch: Some(scratch), .. } = self else { unreachable!("was just made") };
        let [kinematics, others] = &state.data.residuals.kinematic;
        let mut view = ResidualView { model, t, state, kinematics, scratch };
        let cost = costs.at(t).at(t).terms.value(&mut view, &WeightedActivations(1.0));
        view.kinematics = others;
        let mut term = 0.0;
        if limited {
            let (terms, objective) = limits.objective(t, limited);
            term = terms.value(&mut view, &objective);
        }
        (cost, term)
    }

    /// Writes the residuals of the limits of knot t.
    pub(crate) fn write_limits(&mut self, t: usize, state: KnotState<'_>, to: &mut [f64]) {
        self.reserve();
        let Self { model, limits, scratch: Some(scratch), .. } = self else { unreachable!("was just made") };
        let kinematics = &state.data.residuals.kinematic[1];
        let mut view = ResidualView { model, t, state, kinematics, scratch };
        limits.write_values(&mut view, to);
    }

    /// Computes the derivatives of `scale` · ℓ at knot t, where ℓ is the cost. If `limited`, also adds the derivatives
    /// of the knot's limit term in the augmented Lagrangian, or appends the limits to the rows of the knot.
    pub(crate) fn calc_diff(
        &mut self,
        t: usize,
        state: KnotState<'_>,
        sensitivities: &dyn Sensitivities,
        scale: f64,
        limited: bool,
        knot: &mut LqKnot,
    ) {
        self.reserve();
        let Self { model, costs, limits, scratch: Some(scratch), .. } = self else { unreachable!("was just made") };
        let [first, second] = &state.data.residuals.kinematic;
        let (in_cost, mut objective) = limits.objective(t, limited);
        if limited {
            objective.multipliers.begin(t);
        }
        scratch.clear();
        let mut view = ResidualView { model, t, state, kinematics: first, scratch };
        for diagonal in [false, true] {
            view.kinematics = first;
            let costs = &costs.at(t).at(t).terms;
            costs.differentiate(&mut view, sensitivities, &mut WeightedActivations(scale), diagonal, knot);
            view.kinematics = second;
            in_cost.differentiate(&mut view, sensitivities, &mut objective, diagonal, knot);
            if !diagonal {
                view.scratch.write(knot);
            }
        }
        if limited && !limits.in_cost {
            limits.write_rows(&mut view, sensitivities, knot);
        }
    }
}
