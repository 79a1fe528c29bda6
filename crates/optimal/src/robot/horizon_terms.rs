//! Terms of a horizon: which costs and limits serve which knot.

use super::capabilities::Capabilities;
use super::costs::{Cost, Costs, WeightedActivations, check_weight};
use super::knot::{KnotState, Sensitivities};
use super::limits::{Limit, Limits};
use super::per_knot::PerKnot;
use super::per_model::PerModel;
use super::residuals::layout::KnotLayout;
use super::residuals::terms::{KinematicTerms, KnotTerms};
use super::residuals::view::{ResidualView, Scratch};
use crate::Error;
use crate::lq::LqKnot;
use crate::problem::MOST_KNOTS;
use condyle_dynamics::Model;
use std::sync::Arc;

/// The costs and limits of all knots that an action serves.
#[derive(Clone, Debug)]
pub(crate) struct HorizonTerms {
    model: Arc<Model>,
    capabilities: Arc<Capabilities>,
    costs: PerModel<PerKnot<Costs>>,
    pub limits: Limits,
    /// The memory that costs of any knot take, and that limits do.
    layouts: [KnotLayout; 2],
    /// Made when it is first needed, and forgotten when the layouts grow.
    scratch: Option<Box<Scratch>>,
}

impl HorizonTerms {
    /// Terms of a horizon with the same costs at all knots, and no limits.
    pub(crate) fn new(model: Arc<Model>, capabilities: Capabilities, costs: Vec<Cost>) -> Result<Self, Error> {
        let capabilities = Arc::new(capabilities);
        let costs = Costs::new(model.clone(), capabilities.clone(), costs)?;
        let layouts = [costs.terms.layout(), KnotLayout::default()];
        let costs = PerModel::new(PerKnot::new(costs));
        Ok(Self { costs, limits: Limits::none(), layouts, scratch: None, capabilities, model })
    }

    /// Adds limits that hold at every knot, beside those that are given.
    pub(crate) fn require(&mut self, limits: Vec<Limit>) -> Result<(), Error> {
        self.limits = Limits::asked_for(limits);
        self.set_limits(None, Vec::new())
    }

    /// The costs of knot t, or those of all knots without costs of their own.
    pub(crate) fn costs_mut(&mut self, t: Option<usize>) -> &mut Costs {
        self.costs.chosen_mut().at_mut(t)
    }

    /// The costs of all knots: those that knots share, and those of single knots.
    pub(crate) fn all_costs_mut(&mut self) -> impl Iterator<Item = &mut Costs> {
        self.costs.chosen_mut().all_mut().iter_mut()
    }

    /// Changes the weights of the terms called `name`, of all knots; says whether there is one.
    pub(crate) fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
        check_weight(name, weight)?;
        let mut found = false;
        for costs in self.costs.chosen_mut().all_mut() {
            found |= costs.set_weight(name, weight)?;
        }
        Ok(found)
    }

    /// Gives knot t costs of its own.
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

    /// Gives knot t limits of its own, or all knots that have none of their own.
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

    /// Sets the layouts; the scratch is renewed where there was one.
    fn set_layouts(&mut self, layouts: [KnotLayout; 2]) {
        if self.layouts != layouts {
            self.layouts = layouts;
            if self.scratch.take().is_some() {
                self.reserve();
            }
        }
    }

    /// Makes the scratch, unless it is there.
    pub(crate) fn reserve(&mut self) {
        let Self { model, capabilities, layouts, scratch, .. } = self;
        scratch.get_or_insert_with(|| Box::new(Scratch::new(model, capabilities.nu, layouts[0] + layouts[1])));
    }

    /// Takes over the costs and limits of the models that another action with the same dynamics stands for.
    pub(crate) fn append(&mut self, other: &mut Self) {
        self.costs.append(&mut other.costs);
        self.limits.append(&mut other.limits);
        self.set_layouts([0, 1].map(|k| self.layouts[k].or(other.layouts[k])));
    }

    /// Chooses, of the models that this action stands for, the one that is to be changed.
    pub(crate) fn choose(&mut self, model: usize) {
        self.costs.choose(model);
        self.limits.choose(model);
    }

    /// Lets one of the models that this action stands for serve knot t of so many.
    pub(crate) fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.costs.serve(t, horizon, model);
        self.limits.serve(t, horizon, model);
    }

    /// Moves the horizon on: knot t becomes knot t − 1.
    pub(crate) fn shift(&mut self) {
        self.costs.all_mut().iter_mut().for_each(PerKnot::shift);
        self.limits.shift();
    }

    /// The memory that costs of any knot take, and that limits do.
    pub(crate) fn layouts(&self) -> [KnotLayout; 2] {
        self.layouts
    }

    /// The memory that costs and limits of any knot take together.
    pub(crate) fn layout(&self) -> KnotLayout {
        self.layouts[0] + self.layouts[1]
    }

    /// The costs of knot t, and the limits that count there.
    pub(crate) fn at(&self, t: usize) -> KnotTerms<'_> {
        KnotTerms([&self.costs.at(t).at(t).terms, self.limits.at(t)])
    }

    /// ℓ at knot t; writes the limits' term.
    pub(crate) fn calc(&mut self, t: usize, state: KnotState<'_>) -> f64 {
        self.reserve();
        let Self { model, costs, limits, scratch: Some(scratch), .. } = self else { unreachable!("was just made") };
        let [kinematics, others] = &state.data.residuals.kinematic;
        let mut view = ResidualView { model, t, state, kinematics, scratch };
        let cost = costs.at(t).at(t).terms.value(&mut view, &WeightedActivations(1.0));
        view.kinematics = others;
        if limits.active {
            let (terms, objective) = limits.objective(t);
            limits.term = terms.value(&mut view, &objective);
        }
        cost
    }

    /// The derivatives of `scale` · ℓ and of the limits' term at knot t.
    pub(crate) fn calc_diff(
        &mut self,
        t: usize,
        state: KnotState<'_>,
        sensitivities: &dyn Sensitivities,
        scale: f64,
        knot: &mut LqKnot,
    ) {
        self.reserve();
        let Self { model, costs, limits, scratch: Some(scratch), .. } = self else { unreachable!("was just made") };
        let [first, second] = &state.data.residuals.kinematic;
        let active = limits.active;
        let (limits, mut objective) = limits.objective(t);
        if active {
            objective.multipliers.begin(t);
        }
        scratch.clear();
        let mut view = ResidualView { model, t, state, kinematics: first, scratch };
        for diagonal in [false, true] {
            view.kinematics = first;
            let costs = &costs.at(t).at(t).terms;
            costs.differentiate(&mut view, sensitivities, &mut WeightedActivations(scale), diagonal, knot);
            view.kinematics = second;
            limits.differentiate(&mut view, sensitivities, &mut objective, diagonal, knot);
            if !diagonal {
                view.scratch.write(knot);
            }
        }
    }
}
