//! The multipliers of all constraints of a problem.

use crate::error::Error;
use crate::problem::{PENALTY, Problem};

impl Problem {
    /// Multipliers of zero everywhere, and the penalty 1/μ.
    ///
    /// # Errors
    /// [`Error`] if bounds have a wrong length or leave no value.
    pub(crate) fn start_constraints(&mut self, mu: f64) -> Result<(), Error> {
        let horizon = self.horizon();
        for t in 0..=horizon {
            let mut result = Ok(());
            self.action_mut(t).constraints(t, &mut |bounded| {
                result = result.clone().and(bounded.check(t));
                bounded.multipliers.start(t, horizon + 1, mu);
            });
            result?;
        }
        self.share_multipliers();
        Ok(())
    }

    /// The multipliers of each knot, where it has as many constraints as are given.
    pub(crate) fn set_multipliers(&mut self, y: &[Vec<f64>]) {
        for (t, y) in y.iter().enumerate().take(self.horizon() + 1) {
            let mut all = 0;
            self.action_mut(t).constraints(t, &mut |bounded| all += bounded.count);
            if all != y.len() {
                continue;
            }
            let mut rest = &y[..];
            self.action_mut(t).constraints(t, &mut |bounded| {
                let (own, others) = rest.split_at(bounded.count);
                bounded.multipliers.set(t, own);
                rest = others;
            });
        }
        self.share_multipliers();
    }

    /// Multipliers of zero and the penalty of actions by themselves, everywhere.
    pub(crate) fn forget_multipliers(&mut self) {
        let knots = self.horizon() + 1;
        for t in 0..knots {
            self.action_mut(t).constraints(t, &mut |bounded| bounded.multipliers.start(t, knots, 1.0 / PENALTY));
        }
        self.share_multipliers();
    }

    /// The penalty 1/μ.
    pub(crate) fn set_penalty(&mut self, mu: f64) {
        for t in 0..=self.horizon() {
            self.action_mut(t).constraints(t, &mut |bounded| bounded.multipliers.set_mu(mu));
        }
        self.share_multipliers();
    }

    /// y ← (z − Π z) / μ at the trajectory at which derivatives were computed last.
    pub(crate) fn update_multipliers(&mut self) {
        for t in 0..=self.horizon() {
            self.action_mut(t).constraints(t, &mut |bounded| bounded.multipliers.update(t));
        }
        self.share_multipliers();
    }

    /// The largest distance of a constraint from its bounds, infinite if one is not a number, and the sum of the cost's
    /// terms, at the trajectory at which derivatives were computed last.
    pub(crate) fn measure_constraints(&mut self) -> (f64, f64) {
        let (mut worst, mut sum) = (0.0_f64, 0.0);
        for t in 0..=self.horizon() {
            self.action_mut(t).constraints(t, &mut |bounded| {
                let [violation, term] = bounded.multipliers.measured(t);
                worst = worst.max(if violation.is_nan() { f64::INFINITY } else { violation });
                sum += term;
            });
        }
        (worst, sum)
    }

    /// y of each knot. Allocates at the first call.
    pub(crate) fn multipliers(&mut self, out: &mut Vec<Vec<f64>>) {
        out.resize(self.horizon() + 1, vec![]);
        for (t, out) in out.iter_mut().enumerate() {
            out.clear();
            self.action_mut(t).constraints(t, &mut |bounded| {
                out.extend_from_slice(bounded.multipliers.of(t, bounded.count));
            });
        }
    }
}
