//! What all dynamics of a robot have: its model, its drives, and the costs of its knots.

use super::actuation::Actuation;
use super::costs::{Cost, Costs};
use super::elimination::Elimination;
use super::integrated::Wanted;
use super::lanes::{Outcome, SideBySide};
use super::limits::{Limit, Limits};
use super::sight::{Known, Stack};
use super::state::{GroupHessian, groups};
use super::terms::Room;
use super::watch::{Offer, Scene, Slopes, Watch};
use crate::Error;
use crate::lq::{Hessian, LqNode};
use condyle_dynamics::{IntegrateArgument, Model, integrate_jacobian};
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub(super) struct Robot {
    pub model: Arc<Model>,
    pub actuation: Actuation,
    pub groups: Vec<Range<usize>>,
    group_hessian: GroupHessian,
    /// The efforts of all joints.
    pub tau: Vec<f64>,
    pub schedule: Schedule,
}

impl Robot {
    pub(super) fn new(model: Arc<Model>, actuation: Actuation, offer: Offer, costs: Vec<Cost>) -> Result<Self, Error> {
        if actuation.nv() != model.nv() {
            let what = format!("it drives {} coordinates, the robot has {}", actuation.nv(), model.nv());
            return Err(Error::Actuation { what });
        }
        let groups = groups(&model);
        Ok(Self {
            schedule: Schedule::new(model.clone(), offer, costs)?,
            group_hessian: GroupHessian::new(model.nv(), &groups),
            groups,
            tau: vec![0.0; model.nv()],
            actuation,
            model,
        })
    }

    /// Refuses a robot of which forward dynamics has no solution.
    pub(super) fn check_regular(&self) -> Result<(), Error> {
        match self.model.singular_joints() {
            [] => Ok(()),
            joints => {
                let what =
                    format!("nothing with a mass moves with the joints {joints:?}: their accelerations are undefined");
                Err(Error::Actuation { what })
            }
        }
    }

    /// Computes the dynamics of some states side by side.
    pub(super) fn prepare(&self, lanes: &mut SideBySide, knots: &[usize], xs: &[f64], us: &[f64], wanted: Wanted) {
        let nu = self.actuation.nu();
        (0..knots.len()).for_each(|k| self.actuation.effort(&us[k * nu..(k + 1) * nu], lanes.tau_mut(k)));
        lanes.run(&self.model, knots, xs, &self.schedule, wanted);
    }

    /// Writes a knot of Δt = `scale` seconds in implicit form, from the equations of a state that was prepared; says
    /// whether there is one.
    pub(super) fn write_implicit(
        &mut self,
        elimination: &mut Elimination,
        outcome: &mut Outcome,
        t: usize,
        x: &[f64],
        u: &[f64],
        scale: f64,
        node: &mut LqNode,
    ) -> bool {
        if !elimination.run(&mut outcome.equations, scale, &mut node.inverse_dynamics) {
            return false;
        }
        self.actuation.effort(u, &mut self.tau);
        let scene = Scene { x, u, a: &outcome.a, tau: &self.tau, lambda: &outcome.lambda };
        node.inverse_dynamics.active = true;
        let form = node.inverse_dynamics.lend();
        self.schedule.calc_diff(t, &scene, outcome.known(), &elimination.slopes(&form, scale), scale, node);
        node.inverse_dynamics.take_back(form);
        true
    }

    /// How to write implicit knots, with contacts whose rows are moved by some coordinates each; none if the drives mix
    /// coordinates.
    pub(super) fn elimination(&self, moved_by: &[Vec<usize>]) -> Option<Elimination> {
        Some(Elimination::new(self.model.nv(), self.actuation.passive()?, moved_by))
    }

    /// ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq.
    pub(super) fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        integrate_jacobian(&self.model, dq, IntegrateArgument::Position, by_q);
        integrate_jacobian(&self.model, dq, IntegrateArgument::Velocity, by_dq);
    }

    /// The second derivatives of λᵀ(q ⊕ δq) by q and δq.
    pub(super) fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) {
        self.group_hessian.run(&self.model, &self.groups, dq, lambda, hessian);
    }
}

/// One for all knots of the horizon, and others for some of them.
#[derive(Clone, Debug)]
pub(super) struct Variants<T> {
    /// That of all knots, then those of knots with one of their own.
    all: Vec<T>,
    /// Which of them serves a knot; beyond its end the first.
    of: Vec<usize>,
    /// Those whose knots have left the horizon.
    free: Vec<usize>,
}

impl<T> Variants<T> {
    pub(super) fn new(common: T) -> Self {
        Self { all: vec![common], of: Vec::new(), free: Vec::new() }
    }

    fn index(&self, t: usize) -> usize {
        self.of.get(t).copied().unwrap_or(0)
    }

    pub(super) fn all(&self) -> &[T] {
        &self.all
    }

    /// That of knot t.
    pub(super) fn at(&self, t: usize) -> &T {
        &self.all[self.index(t)]
    }

    /// That of knot t, or that of all knots without one of their own.
    fn at_mut(&mut self, t: Option<usize>) -> &mut T {
        let k = t.map_or(0, |t| self.index(t));
        &mut self.all[k]
    }

    /// Sets that of knot t, or that of all knots without one of their own.
    pub(super) fn set(&mut self, t: Option<usize>, variant: T) {
        let Some(t) = t else {
            self.all[0] = variant;
            return;
        };
        if t >= self.of.len() {
            self.of.resize(t + 1, 0);
        }
        if self.of[t] == 0 {
            self.of[t] = self.free.pop().unwrap_or(self.all.len());
        }
        match self.all.get_mut(self.of[t]) {
            Some(old) => *old = variant,
            None => {
                self.all.push(variant);
                self.free.reserve(self.all.len()); // so that a shift need not
            }
        }
    }

    /// Knot t becomes knot t − 1.
    pub(super) fn shift(&mut self) {
        if !self.of.is_empty() {
            let first = self.of.remove(0);
            self.free.extend((first > 0).then_some(first));
        }
    }
}

/// Which costs and limits serve which knot.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    model: Arc<Model>,
    offer: Offer,
    costs: Variants<Costs>,
    pub limits: Limits,
    /// What they take at any knot.
    room: Room,
    watch: Watch,
}

impl Schedule {
    fn new(model: Arc<Model>, offer: Offer, costs: Vec<Cost>) -> Result<Self, Error> {
        let costs = Costs::new(model.clone(), offer.clone(), costs)?;
        let room = costs.room();
        let watch = Watch::new(&model, offer.nu, room);
        Ok(Self { costs: Variants::new(costs), limits: Limits::none(), room, watch, offer, model })
    }

    /// The costs of knot t, or those of all knots without costs of their own.
    pub(super) fn costs_mut(&mut self, t: Option<usize>) -> &mut Costs {
        self.costs.at_mut(t)
    }

    /// Changes the weights of the terms called `name`, of all knots; says whether there is one.
    pub(super) fn set_weight(&mut self, name: &str, weight: f64) -> bool {
        let mut found = false;
        for costs in &mut self.costs.all {
            found |= costs.set_weight(name, weight);
        }
        found
    }

    /// Gives knot t costs of its own.
    pub(super) fn set_costs(&mut self, t: usize, costs: Vec<Cost>) -> Result<(), Error> {
        self.costs.set(Some(t), Costs::new(self.model.clone(), self.offer.clone(), costs)?);
        self.make_room();
        Ok(())
    }

    /// Gives knot t limits of its own, or all knots that have none of their own.
    pub(super) fn set_limits(&mut self, t: Option<usize>, limits: Vec<Limit>) -> Result<(), Error> {
        self.limits.set(&self.model, &self.offer, t, limits)?;
        self.make_room();
        Ok(())
    }

    /// Knot t becomes knot t − 1.
    pub(super) fn shift(&mut self) {
        self.costs.shift();
        self.limits.shift();
    }

    fn make_room(&mut self) {
        let costs = self.costs.all.iter().fold(Room::default(), |most, costs| most.or(costs.room()));
        self.room = costs + self.limits.most_room();
        self.watch.resize(self.offer.nu, self.room);
    }

    /// What costs and limits take at any knot.
    pub(super) fn room(&self) -> Room {
        self.room
    }

    /// The costs of knot t, and the limits that count there.
    pub(super) fn stack(&self, t: usize) -> Stack<'_> {
        Stack { costs: self.costs.at(t), limits: self.limits.at(t) }
    }

    /// ℓ at knot t; writes the limits' term.
    pub(super) fn calc(&mut self, t: usize, scene: &Scene<'_>, known: Known<'_>) -> f64 {
        let Self { model, costs, limits, watch, .. } = self;
        let costs = costs.at(t);
        let mut view = watch.look(model, Stack { costs, limits: limits.at(t) }, scene, false, known);
        let cost = costs.calc(&mut view);
        view.sight = view.sight.after(costs.room().seen);
        limits.calc(t, &mut view);
        cost
    }

    /// The derivatives of `scale` · ℓ and the limits' term at knot t.
    pub(super) fn calc_diff(
        &mut self,
        t: usize,
        scene: &Scene<'_>,
        known: Known<'_>,
        slopes: &dyn Slopes,
        scale: f64,
        node: &mut LqNode,
    ) {
        let Self { model, costs, limits, watch, .. } = self;
        let costs = costs.at(t);
        let mut view = watch.look(model, Stack { costs, limits: limits.at(t) }, scene, true, known);
        view.scratch.rows.clear();
        costs.push_rows(&mut view, slopes, scale);
        let (own, others) = (view.sight, view.sight.after(costs.room().seen));
        view.sight = others;
        limits.push_rows(t, &mut view, slopes);
        view.scratch.rows.write(node);
        view.sight = own;
        costs.add_diagonals(&mut view, scale, node);
        view.sight = others;
        limits.add_diagonals(t, &mut view, node);
    }
}

/// The methods that a robot's knots share: their model, their costs and their limits.
macro_rules! robot_knot {
    ($knot:ty $(, $inner:ident)?) => {
        impl $knot {
            /// The robot.
            pub fn model(&self) -> &std::sync::Arc<condyle_dynamics::Model> {
                &self$(.$inner)?.robot.model
            }

            /// The costs of all knots that have none of their own, to change weights and targets between solves.
            pub fn costs_mut(&mut self) -> &mut super::Costs {
                self$(.$inner)?.robot.schedule.costs_mut(None)
            }

            /// The costs of knot t.
            pub fn costs_at_mut(&mut self, t: usize) -> &mut super::Costs {
                self$(.$inner)?.robot.schedule.costs_mut(Some(t))
            }

            /// Changes the weights of the terms called `name` of all knots, between solves; says whether there is one.
            pub fn set_weight(&mut self, name: &str, weight: f64) -> bool {
                self$(.$inner)?.robot.schedule.set_weight(name, weight)
            }

            /// Gives knot t of the horizon costs of its own, so that one action serves knots that differ in their
            /// targets. They move with their knot when the horizon is [shifted](crate::Problem::shift). Allocates.
            ///
            /// # Errors
            /// [`Error::Cost`](crate::Error::Cost) for a term that does not fit.
            pub fn set_costs(&mut self, t: usize, costs: Vec<super::Cost>) -> Result<(), crate::Error> {
                self$(.$inner)?.robot.schedule.set_costs(t, costs)
            }

            /// The same with limits at all knots that have none of their own.
            ///
            /// # Errors
            /// [`Error::Limit`](crate::Error::Limit) for one that does not fit.
            pub fn with_limits(mut self, limits: Vec<super::Limit>) -> Result<Self, crate::Error> {
                self$(.$inner)?.robot.schedule.set_limits(None, limits)?;
                Ok(self)
            }

            /// Gives knot t of the horizon limits of its own, between solves; they too move with their knot. Allocates.
            ///
            /// # Errors
            /// [`Error::Limit`](crate::Error::Limit) for one that does not fit.
            pub fn set_limits(&mut self, t: usize, limits: Vec<super::Limit>) -> Result<(), crate::Error> {
                self$(.$inner)?.robot.schedule.set_limits(Some(t), limits)
            }
        }
    };
}
pub(super) use robot_knot;

/// The methods of a [`ContinuousModel`](super::ContinuousModel) that a robot's positions and limits answer.
macro_rules! robot_positions {
    () => {
        fn groups(&self) -> &[core::ops::Range<usize>] {
            &self.robot.groups
        }

        fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
            condyle_dynamics::integrate(&self.robot.model, q, dq, out);
        }

        fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
            condyle_dynamics::difference(&self.robot.model, q0, q1, out);
        }

        fn integrate_jacobians(
            &self,
            dq: &[f64],
            by_q: &mut nalgebra::DMatrix<f64>,
            by_dq: &mut nalgebra::DMatrix<f64>,
        ) {
            self.robot.integrate_jacobians(dq, by_q, by_dq);
        }

        fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut crate::Hessian) -> bool {
            self.robot.integrate_hessian(dq, lambda, hessian);
            true
        }

        fn shift(&mut self) {
            self.robot.schedule.shift();
        }

        fn limits(&mut self) -> Option<&mut super::limits::Limits> {
            Some(&mut self.robot.schedule.limits)
        }
    };
}
pub(super) use robot_positions;

/// The methods of a [`ContinuousModel`](super::ContinuousModel) that knots in lanes answer.
macro_rules! robot_lanes {
    () => {
        fn lanes(&self) -> usize {
            self.lanes.as_ref().map_or(1, SideBySide::lanes)
        }

        fn prepare(&mut self, knots: &[usize], xs: &[f64], us: &[f64], wanted: super::Wanted) {
            if let Some(lanes) = &mut self.lanes {
                self.robot.prepare(lanes, knots, xs, us, wanted);
            }
        }

        fn implicit(&self) -> Option<[usize; 2]> {
            let elimination = self.elimination.as_ref().filter(|_| self.lanes.is_some())?;
            Some([elimination.most_dependent(), self.robot.schedule.room().rows[0]])
        }

        fn equations_prepared(
            &mut self,
            i: usize,
            t: usize,
            x: &[f64],
            u: &[f64],
            scale: f64,
            node: &mut LqNode,
        ) -> Option<&[f64]> {
            let Self { robot, lanes: Some(lanes), elimination: Some(elimination), .. } = self else { return None };
            let outcome = &mut lanes.outcomes[i];
            robot.write_implicit(elimination, outcome, t, x, u, scale, node).then_some(&outcome.a)
        }
    };
}
pub(super) use robot_lanes;
