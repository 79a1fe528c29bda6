//! Limits of a robot's state, control and forces: residuals that are held within bounds.

use super::common::Variants;
use super::integrated::ContinuousModel;
use super::residual::{Part, Residual};
use super::sight::seat;
use super::terms::{Plan, Room, View};
use super::watch::{Offer, Slopes};
use crate::Error;
use crate::lq::LqNode;
use crate::problem::{Bounded, Multipliers, Visit, leave_a_value};
use condyle_dynamics::Model;
use serde::{Deserialize, Serialize};

/// A residual within bounds: lower ≤ r(x, u) ≤ upper, an equality where both are equal; without any bounds r(x, u) = 0.
///
/// [`AugmentedLagrangian`](crate::AugmentedLagrangian) holds it; to [`Fddp`](crate::Fddp) alone it is a cost for leaving the
/// bounds. It shares dynamics and kinematics with the costs of its knot, and holds at the knot's beginning, whatever the
/// integrator and its Δt. One penalty serves all numbers, whatever their units.
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
/// let point = Residual::FrameTranslation { frame: arm.frame("tool")?, target: [0.5, 0.1, 0.6].into() };
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// How errors call it.
    pub name: String,
    /// r.
    pub residual: Residual,
    /// Least values; −∞ for none. Empty, as is `upper`, where r = 0.
    #[serde(with = "condyle_spatial::finite::lower")]
    pub lower: Vec<f64>,
    /// Greatest values; ∞ for none.
    #[serde(with = "condyle_spatial::finite::upper")]
    pub upper: Vec<f64>,
}

impl Limit {
    /// lower ≤ residual ≤ upper, called `name`.
    pub fn new(name: &str, residual: Residual, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self { name: name.to_owned(), residual, lower, upper }
    }

    /// residual = 0, called `name`.
    pub fn equality(name: &str, residual: Residual) -> Self {
        Self::new(name, residual, vec![], vec![])
    }

    /// As it is computed, with its bounds, or what does not fit.
    fn plan(&mut self, model: &Model, offer: &Offer) -> Result<Plan, String> {
        let plan = Plan::new(model, offer, &self.residual)?;
        if self.lower.is_empty() && self.upper.is_empty() {
            (self.lower, self.upper) = (vec![0.0; plan.n], vec![0.0; plan.n]);
        }
        for (which, bounds) in [("lower", &self.lower), ("upper", &self.upper)] {
            if bounds.len() != plan.n {
                return Err(format!("its {which} bound has {} numbers, expected {}", bounds.len(), plan.n));
            }
        }
        let bad = (0..plan.n).find(|&i| !leave_a_value(self.lower[i], self.upper[i]));
        let what = |i| format!("entry {i} must be at least {} and at most {}", self.lower[i], self.upper[i]);
        bad.map_or(Ok(plan), |i| Err(what(i)))
    }
}

/// The limits of a knot.
#[derive(Clone, Debug, Default)]
pub(super) struct Set {
    limits: Vec<Limit>,
    plans: Vec<Plan>,
    /// Those that look at kinematics.
    looks: Vec<usize>,
    room: Room,
    /// The bounds of all, one after the other.
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Set {
    /// Some limits for a robot whose dynamics offer some signals; of one knot of the horizon, or of all.
    fn new(model: &Model, offer: &Offer, limits: Vec<Limit>, knot: Option<usize>) -> Result<Self, Error> {
        let mut set = Self::default();
        for mut limit in limits {
            let name = limit.name.clone();
            let wrong = |what: String| Error::Limit { name, knot, what };
            if set.limits.iter().any(|other| other.name == limit.name) {
                return Err(wrong("another limit has this name".to_owned()));
            }
            let plan = limit.plan(model, offer).map_err(wrong)?;
            set.room = set.room + Room::of(model.nv(), &limit.residual, &plan);
            set.lower.extend(&limit.lower);
            set.upper.extend(&limit.upper);
            set.plans.push(plan);
            set.limits.push(limit);
        }
        set.looks = seat(model.nv(), set.limits.iter().map(|limit| &limit.residual).zip(&mut set.plans));
        Ok(set)
    }

    /// What its residuals take.
    pub(super) fn room(&self) -> Room {
        self.room
    }

    /// The limits that look at kinematics.
    pub(super) fn looks(&self) -> impl Iterator<Item = (&Limit, &Plan)> {
        self.looks.iter().map(|&k| (&self.limits[k], &self.plans[k]))
    }

    /// The limits, with the place of the first number of each.
    fn each(&self) -> impl Iterator<Item = (usize, &Limit, &Plan)> {
        let mut first = 0;
        self.limits.iter().zip(&self.plans).map(move |(limit, plan)| {
            first += plan.n;
            (first - plan.n, limit, plan)
        })
    }
}

/// The limits of all knots that an action serves, with their multipliers.
#[derive(Clone, Debug)]
pub struct Limits {
    sets: Variants<Set>,
    none: Set,
    multipliers: Multipliers,
    /// Whether they count: not at later stages of a step.
    pub(super) active: bool,
    /// The term of the augmented Lagrangian, which no Δt scales. Written by: `calc`.
    pub(super) term: f64,
}

impl Limits {
    pub(super) fn none() -> Self {
        let none = Set::default();
        Self { sets: Variants::new(none.clone()), none, multipliers: Multipliers::new(0), active: true, term: 0.0 }
    }

    /// Sets those of knot t, or of all knots without limits of their own. Forgets multipliers.
    pub(super) fn set(
        &mut self,
        model: &Model,
        offer: &Offer,
        t: Option<usize>,
        limits: Vec<Limit>,
    ) -> Result<(), Error> {
        self.sets.set(t, Set::new(model, offer, limits, t)?);
        let most = self.sets.all().iter().map(|set| set.lower.len()).max().unwrap_or(0);
        self.multipliers = Multipliers::new(most);
        Ok(())
    }

    /// Knot t becomes knot t − 1.
    pub(super) fn shift(&mut self) {
        self.sets.shift();
    }

    /// What they take at any knot.
    pub(super) fn most_room(&self) -> Room {
        self.sets.all().iter().fold(Room::default(), |most, set| most.or(set.room))
    }

    /// Those that count at knot t.
    pub(super) fn at(&self, t: usize) -> &Set {
        if self.active { self.sets.at(t) } else { &self.none }
    }

    pub(super) fn visit(&mut self, t: usize, visit: &mut Visit<'_>) {
        let Set { lower, upper, .. } = self.sets.at(t);
        visit(Bounded { count: lower.len(), lower, upper, multipliers: &mut self.multipliers });
    }

    /// The term at knot t.
    pub(super) fn calc(&mut self, t: usize, view: &mut View<'_>) {
        let Self { sets, multipliers, active: true, term, .. } = self else { return };
        *term = 0.0;
        for (first, limit, plan) in sets.at(t).each() {
            view.residual(&limit.residual, plan);
            *term += multipliers.value(t, first, &view.scratch.r[..plan.n], &limit.lower, &limit.upper);
        }
    }

    /// The rows of Jacobians, for the gradient and the Hessian of the term.
    pub(super) fn push_rows(&mut self, t: usize, view: &mut View<'_>, slopes: &dyn Slopes) {
        let Self { sets, multipliers, active: true, .. } = self else { return };
        multipliers.begin(t);
        for (first, limit, plan) in sets.at(t).each().filter(|(_, limit, _)| limit.residual.part() != Part::Diagonal) {
            worth(multipliers, t, first, limit, plan, view);
            view.push_rows(&limit.residual, plan, slopes);
        }
    }

    /// The parts of both that have no rows, to q, r, Q, R of the node.
    pub(super) fn add_diagonals(&mut self, t: usize, view: &mut View<'_>, node: &mut LqNode) {
        let Self { sets, multipliers, active: true, .. } = self else { return };
        for (first, limit, plan) in sets.at(t).each().filter(|(_, limit, _)| limit.residual.part() == Part::Diagonal) {
            worth(multipliers, t, first, limit, plan, view);
            view.add_diagonal(&limit.residual, node);
        }
    }
}

/// The term of a model's limits as of the last `calc`.
pub(super) fn limit_term<M: ContinuousModel>(model: &mut M) -> f64 {
    model.limits().map_or(0.0, |limits| limits.term)
}

/// Lets a model's limits count or not; says whether it has any.
pub(super) fn activate_limits<M: ContinuousModel>(model: &mut M, active: bool) -> bool {
    model.limits().map(|limits| limits.active = active).is_some()
}

/// The residual of a limit and the derivatives of its term, in the scratch.
fn worth(multipliers: &mut Multipliers, t: usize, first: usize, limit: &Limit, plan: &Plan, view: &mut View<'_>) {
    view.residual(&limit.residual, plan);
    let s = &mut *view.scratch;
    multipliers.slopes(t, first, &s.r[..plan.n], [&limit.lower, &limit.upper], &mut s.d, &mut s.dd);
}
