//! Access of the solvers to the multipliers of all constraints of a problem.

use super::outcome::Violation;
use crate::error::Error;
use crate::problem::{PENALTY, Problem, Visit};

/// Measurements of all constraints at a trajectory.
#[derive(Debug, Default)]
pub(super) struct Measured {
    /// Largest violation; `None` if all constraints hold exactly.
    pub(super) worst: Option<Violation>,
    /// Largest violation of a constraint that no control can change, because it depends only on x₀ = x̂₀.
    pub(super) fixed: Option<Violation>,
    /// Largest violation of the constraints that controls can change.
    pub(super) rest: f64,
    /// Largest multiplier |z − Π z| / μ after the next update, among the constraints that controls can change.
    pub(super) multiplier: f64,
    /// Sum of the terms that the constraints add to the cost.
    pub(super) terms: f64,
}

impl Problem {
    /// Calls `visit` for the constraints of knot t, in their order.
    pub(crate) fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(group) = self.action_mut(t).knot_group_mut() {
            group.constraints(t, visit);
        }
    }

    /// Returns the number of constraints of knot t, without bounds on controls.
    pub(super) fn constraint_count(&mut self, t: usize) -> usize {
        let mut all = 0;
        self.constraints(t, &mut |bounded| all += bounded.count);
        all
    }

    /// Sets all multipliers to zero, the penalty to 1/μ, and the scale of each row from its bounds.
    ///
    /// # Errors
    /// [`Error`] if bounds have a wrong length or no value satisfies the bounds.
    pub(super) fn start_constraints(&mut self, mu: f64) -> Result<(), Error> {
        let horizon = self.horizon();
        for t in 0..=horizon {
            let mut result = Ok(());
            self.constraints(t, &mut |bounded| {
                result = result.clone().and(bounded.check(t));
                bounded.multipliers.start(t, horizon + 1, mu);
                if result.is_ok() {
                    bounded.multipliers.scale(t, bounded.lower, bounded.upper);
                }
            });
            result?;
        }
        self.share_multipliers();
        Ok(())
    }

    /// Sets the multipliers of each knot for which `y` has as many entries as the knot has constraints.
    pub(super) fn set_multipliers(&mut self, y: &[Vec<f64>]) {
        for (t, y) in y.iter().enumerate().take(self.horizon() + 1) {
            if self.constraint_count(t) != y.len() {
                continue;
            }
            let mut rest = &y[..];
            self.constraints(t, &mut |bounded| {
                let (own, others) = rest.split_at(bounded.count);
                bounded.multipliers.set(t, own);
                rest = others;
            });
        }
        self.share_multipliers();
    }

    /// Sets all multipliers to zero, the penalty to its default value, and the scale of all rows to 1.
    pub(super) fn forget_multipliers(&mut self) {
        let knots = self.horizon() + 1;
        for t in 0..knots {
            self.constraints(t, &mut |bounded| bounded.multipliers.start(t, knots, 1.0 / PENALTY));
        }
        self.share_multipliers();
    }

    /// Returns whether any knot has a constraint.
    pub(super) fn has_constraints(&mut self) -> bool {
        let mut any = false;
        (0..=self.horizon()).for_each(|t| self.constraints(t, &mut |bounded| any |= bounded.count > 0));
        any
    }

    /// Sets the penalty 1/μ.
    pub(super) fn set_penalty(&mut self, mu: f64) {
        for t in 0..=self.horizon() {
            self.constraints(t, &mut |bounded| bounded.multipliers.set_mu(mu));
        }
        self.share_multipliers();
    }

    /// Updates the multipliers, y ← (z − Π z) / μ, at the trajectory of the last derivatives.
    pub(super) fn update_multipliers(&mut self) {
        for t in 0..=self.horizon() {
            self.constraints(t, &mut |bounded| bounded.multipliers.update(t));
        }
        self.share_multipliers();
    }

    /// Measures the constraints at the trajectory of the last derivatives. `starts_at_x0` tells whether the first state
    /// x₀ of this trajectory is x̂₀. A constraint whose value is NaN has an infinite violation.
    pub(super) fn measure_constraints(&mut self, starts_at_x0: bool) -> Measured {
        let mut all = Measured::default();
        for t in 0..=self.horizon() {
            let without_controls = self.nu(t) == 0;
            let mut before = 0; // number of constraints of this knot in earlier visits
            self.constraints(t, &mut |bounded| {
                let (excess, next, term) = bounded.multipliers.measured(t, bounded.count);
                all.terms += term;
                for (i, (excess, y)) in excess.iter().zip(next).enumerate() {
                    let part = || bounded.part(i);
                    let fixed =
                        t == 0 && starts_at_x0 && (without_controls || part().is_some_and(|part| part.of_state));
                    if fixed && part().is_some_and(|part| part.soft.is_some()) {
                        continue;
                    }
                    if !fixed {
                        all.multiplier = all.multiplier.max(y.abs());
                    }
                    let amount = if excess.is_nan() { f64::INFINITY } else { excess.abs() };
                    if amount == 0.0 {
                        continue;
                    }
                    let worst = if fixed { &mut all.fixed } else { &mut all.worst };
                    if worst.as_ref().is_none_or(|worst| worst.amount < amount) {
                        let named = part().map(|part| (part, i - part.first));
                        *worst = Some(Violation::of_row(t, before + i, named, amount));
                    }
                }
                before += bounded.count;
            });
        }
        let amount = |violation: &Option<Violation>| violation.as_ref().map_or(0.0, |violation| violation.amount);
        all.rest = amount(&all.worst);
        if amount(&all.fixed) > all.rest {
            all.worst.clone_from(&all.fixed);
        }
        all
    }

    /// Copies the multipliers y of each knot. Allocates at the first call.
    pub(super) fn multipliers(&mut self, out: &mut Vec<Vec<f64>>) {
        out.resize(self.horizon() + 1, vec![]);
        for (t, out) in out.iter_mut().enumerate() {
            out.clear();
            self.constraints(t, &mut |bounded| {
                out.extend_from_slice(bounded.multipliers.of(t, bounded.count));
            });
        }
    }
}
