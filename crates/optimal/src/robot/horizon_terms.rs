//! Terms of a horizon: which costs and limits serve which knot.

use super::capabilities::Capabilities;
use super::costs::{Cost, Costs, WeightedActivations, check_weight};
use super::knot::{KnotState, Sensitivities};
use super::limits::{Limit, Limits};
use super::per_knot::PerKnot;
use super::residuals::layout::KnotLayout;
use super::residuals::terms::{KinematicTerms, KnotTerms};
use super::residuals::view::{ResidualView, Scratch};
use crate::Error;
use crate::lq::LqNode;
use crate::problem::MOST_KNOTS;
use condyle_dynamics::Model;
use std::sync::Arc;

/// The costs and limits of all knots that an action serves.
#[derive(Clone, Debug)]
pub(crate) struct HorizonTerms {
    model: Arc<Model>,
    capabilities: Capabilities,
    costs: PerKnot<Costs>,
    pub limits: Limits,
    /// The memory that costs of any knot take, and that limits do.
    layouts: [KnotLayout; 2],
    scratch: Scratch,
}

impl HorizonTerms {
    /// Terms of a horizon with the same costs at all knots, and no limits.
    pub(crate) fn new(model: Arc<Model>, capabilities: Capabilities, costs: Vec<Cost>) -> Result<Self, Error> {
        let costs = Costs::new(model.clone(), capabilities.clone(), costs)?;
        let layouts = [costs.terms.layout(), KnotLayout::default()];
        let scratch = Scratch::new(&model, capabilities.nu, layouts[0]);
        Ok(Self { costs: PerKnot::new(costs), limits: Limits::none(), layouts, scratch, capabilities, model })
    }

    /// The costs of knot t, or those of all knots without costs of their own.
    pub(crate) fn costs_mut(&mut self, t: Option<usize>) -> &mut Costs {
        self.costs.at_mut(t)
    }

    /// Changes the weights of the terms called `name`, of all knots; says whether there is one.
    pub(crate) fn set_weight(&mut self, name: &str, weight: f64) -> Result<bool, Error> {
        check_weight(name, weight)?;
        let mut found = false;
        for costs in self.costs.all_mut() {
            found |= costs.set_weight(name, weight)?;
        }
        Ok(found)
    }

    /// Gives knot t costs of its own.
    pub(crate) fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<(), Error> {
        Error::check_size("knot", t, MOST_KNOTS)?;
        self.costs.set(Some(t), Costs::new(self.model.clone(), self.capabilities.clone(), costs)?);
        self.reserve();
        Ok(())
    }

    /// Gives knot t limits of its own, or all knots that have none of their own.
    pub(crate) fn set_limits(&mut self, t: Option<usize>, limits: Vec<Limit>) -> Result<(), Error> {
        Error::check_size("knot", t.unwrap_or(0), MOST_KNOTS)?;
        self.limits.set(&self.model, &self.capabilities, t, limits)?;
        self.reserve();
        Ok(())
    }

    fn reserve(&mut self) {
        let costs = self.costs.all().iter().fold(KnotLayout::default(), |most, costs| most.or(costs.terms.layout()));
        self.layouts = [costs, self.limits.layout()];
        self.scratch = Scratch::new(&self.model, self.capabilities.nu, self.layout());
    }

    /// Moves the horizon on: knot t becomes knot t − 1.
    pub(crate) fn shift(&mut self) {
        self.costs.shift();
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
        KnotTerms([&self.costs.at(t).terms, self.limits.at(t)])
    }

    /// ℓ at knot t; writes the limits' term.
    pub(crate) fn calc(&mut self, t: usize, state: KnotState<'_>) -> f64 {
        let Self { model, costs, limits, scratch, .. } = self;
        let [kinematics, others] = &state.data.residuals.kinematic;
        let mut view = ResidualView { model, state, kinematics, scratch };
        let cost = costs.at(t).terms.value(&mut view, &WeightedActivations(1.0));
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
        node: &mut LqNode,
    ) {
        let Self { model, costs, limits, scratch, .. } = self;
        let [first, second] = &state.data.residuals.kinematic;
        let active = limits.active;
        let (limits, mut objective) = limits.objective(t);
        if active {
            objective.multipliers.begin(t);
        }
        scratch.rows.clear();
        let mut view = ResidualView { model, state, kinematics: first, scratch };
        for diagonal in [false, true] {
            view.kinematics = first;
            let costs = &costs.at(t).terms;
            costs.differentiate(&mut view, sensitivities, &mut WeightedActivations(scale), diagonal, node);
            view.kinematics = second;
            limits.differentiate(&mut view, sensitivities, &mut objective, diagonal, node);
            if !diagonal {
                view.scratch.rows.write(node);
            }
        }
    }
}
