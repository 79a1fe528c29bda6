//! Terms of a knot: the residuals of its costs or of its limits, and their contributions to the objective.

use super::layout::{KnotLayout, Plan, state_size};
use super::residual::{Part, Residual};
use super::view::ResidualView;
use crate::lq::LqKnot;
use crate::robot::knot_data::Sensitivities;

/// Cost or limit: a residual that contributes to the objective.
pub(crate) trait Term {
    fn residual(&self) -> &Residual;

    /// Returns the residual, to change its numbers in place.
    fn residual_mut(&mut self) -> &mut Residual;

    /// Returns the weight. A term with the weight 0 is not computed.
    fn weight(&self) -> f64 {
        1.0
    }
}

/// Objective: a scalar function of a term's residual, for a cost or for the augmented Lagrangian.
pub(crate) trait Objective<T> {
    /// Returns the value of the objective for a term with the residual r.
    fn value(&self, term: &T, plan: &Plan, r: &[f64]) -> f64;

    /// Computes the gradient and the diagonal of the Hessian of the objective with respect to r, into `d` and `dd`.
    fn slopes(&mut self, term: &T, plan: &Plan, r: &[f64], d: &mut [f64], dd: &mut [f64]);
}

/// Terms of a knot, either costs or limits, with the plans of their residuals.
#[derive(Clone, Debug)]
pub(crate) struct Terms<T> {
    all: Vec<T>,
    plans: Vec<Plan>,
    /// Indices of the terms that read only kinematics; the next field contains the indices of the residuals of the
    /// state.
    kinematic: Vec<usize>,
    states: Vec<usize>,
    layout: KnotLayout,
}

impl<T> Default for Terms<T> {
    fn default() -> Self {
        let (kinematic, states) = (Vec::new(), Vec::new());
        Self { all: Vec::new(), plans: Vec::new(), kinematic, states, layout: KnotLayout::default() }
    }
}

impl<T: Term> Terms<T> {
    /// Adds a term with the plan of its residual.
    pub(crate) fn push(&mut self, term: T, mut plan: Plan) {
        (plan.first, plan.slot) = (self.len(), self.layout.slots);
        if term.residual().is_kinematic() {
            self.kinematic.push(self.all.len());
        }
        if let Residual::State { .. } = term.residual() {
            plan.slot = self.layout.states * state_size(plan.n / 2);
            self.states.push(self.all.len());
        }
        self.layout = self.layout + KnotLayout::of(term.residual(), &plan);
        self.all.push(term);
        self.plans.push(plan);
    }

    /// Replaces term k by a term with the plan of its residual. Returns whether the new term needs the same memory as
    /// the old one.
    pub(crate) fn replace(&mut self, k: usize, term: T, plan: Plan) -> bool {
        let (old, before) = (&mut self.all[k], &mut self.plans[k]);
        let same = KnotLayout::of(term.residual(), &plan) == KnotLayout::of(old.residual(), before);
        if same {
            (*old, *before) = (term, Plan { first: before.first, slot: before.slot, ..plan });
        }
        same
    }

    /// Returns all terms.
    pub(crate) fn all(&self) -> &[T] {
        &self.all
    }

    /// Returns term k as a mutable reference, and the number of entries of its residual.
    pub(crate) fn term_mut(&mut self, k: usize) -> (&mut T, usize) {
        (&mut self.all[k], self.plans[k].n)
    }

    /// Returns all terms as a mutable slice, to change their weights.
    pub(crate) fn all_mut(&mut self) -> &mut [T] {
        &mut self.all
    }

    /// Returns the number of entries of all residuals.
    pub(crate) fn len(&self) -> usize {
        self.plans.last().map_or(0, |plan| plan.first + plan.n)
    }

    /// Returns all terms with the plans of their residuals.
    pub(crate) fn with_plans(&self) -> impl Iterator<Item = (&T, &Plan)> {
        self.all.iter().zip(&self.plans)
    }

    /// Returns all terms with the plans of their residuals, to change both.
    pub(crate) fn with_plans_mut(&mut self) -> impl Iterator<Item = (&mut T, &mut Plan)> {
        self.all.iter_mut().zip(&mut self.plans)
    }

    /// Returns the terms whose weight is not 0.
    fn weighty(&self) -> impl Iterator<Item = (&T, &Plan)> {
        self.with_plans().filter(|(term, _)| term.weight() != 0.0)
    }

    /// Returns the sum of the objective over all terms.
    pub(crate) fn value(&self, view: &mut ResidualView<'_>, objective: &impl Objective<T>) -> f64 {
        let mut sum = 0.0;
        for (term, plan) in self.weighty() {
            view.compute(term.residual(), plan);
            sum += objective.value(term, plan, &view.scratch.r[..plan.n]);
        }
        sum
    }

    /// Adds the derivatives of all terms. Without `diagonal`, adds the rows of Jacobians to the rows in the scratch.
    /// With `diagonal`, adds the terms without rows to q, r, Q and R of the knot.
    pub(crate) fn differentiate(
        &self,
        view: &mut ResidualView<'_>,
        sensitivities: &dyn Sensitivities,
        objective: &mut impl Objective<T>,
        diagonal: bool,
        knot: &mut LqKnot,
    ) {
        for (term, plan) in self.weighty() {
            let residual = term.residual();
            if (residual.part() == Part::Diagonal) != diagonal {
                continue;
            }
            view.compute(residual, plan);
            let s = &mut *view.scratch;
            objective.slopes(term, plan, &s.r[..plan.n], &mut s.d[..plan.n], &mut s.dd[..plan.n]);
            match diagonal {
                false => view.push_rows(residual, plan, sensitivities),
                true => view.add_diagonal(residual, plan, knot),
            }
        }
    }
}

/// View of terms (costs or limits) for the computation of kinematics.
pub(crate) trait KinematicTerms {
    /// Returns the memory sizes for the terms, and the flags for the quantities that they read.
    fn layout(&self) -> KnotLayout;

    /// Returns the kinematic residual with index i, with its weight and its plan.
    fn kinematic(&self, i: usize) -> Option<(&Residual, f64, &Plan)>;

    /// Returns the residual of the state with index i.
    fn state(&self, i: usize) -> StateTerm<'_>;
}

impl<T: Term> KinematicTerms for Terms<T> {
    fn layout(&self) -> KnotLayout {
        self.layout
    }

    fn kinematic(&self, i: usize) -> Option<(&Residual, f64, &Plan)> {
        let k = *self.kinematic.get(i)?;
        Some((self.all[k].residual(), self.all[k].weight(), &self.plans[k]))
    }

    fn state(&self, i: usize) -> StateTerm<'_> {
        let k = self.states[i];
        let Residual::State { reference } = self.all[k].residual() else { unreachable!("only states are listed") };
        StateTerm { reference, weight: self.all[k].weight(), slot: self.plans[k].slot }
    }
}

/// Residual of the state: its reference, its weight, and the offset of its data.
pub(crate) struct StateTerm<'a> {
    pub reference: &'a [f64],
    pub weight: f64,
    pub slot: usize,
}

/// Terms of a knot: its costs and its limits.
#[derive(Clone, Copy)]
pub(crate) struct KnotTerms<'a>(pub [&'a dyn KinematicTerms; 2]);

impl KnotTerms<'_> {
    /// Returns the layout of all terms.
    pub(crate) fn layout(&self) -> KnotLayout {
        self.0[0].layout() + self.0[1].layout()
    }

    /// Returns whether the terms of another knot read the same quantities and differ only in their targets.
    pub(crate) fn is_alike(self, other: Self) -> bool {
        let same = |k: usize| core::ptr::addr_eq(self.0[k], other.0[k]);
        let alike = |a: &dyn KinematicTerms, b: &dyn KinematicTerms| {
            a.layout().kinematic == b.layout().kinematic
                && a.layout().states == b.layout().states
                && (0..a.layout().kinematic).all(|i| match (a.kinematic(i), b.kinematic(i)) {
                    (Some((a, _, own)), Some((b, _, its))) => own.reads_the_bodies_of(its) && a.differs_in_target(b),
                    _ => false,
                })
        };
        let all_alike = || (0..2).all(|k| alike(self.0[k], other.0[k]));
        (same(0) && same(1)) || (self.layout().requirements == other.layout().requirements && all_alike())
    }
}
