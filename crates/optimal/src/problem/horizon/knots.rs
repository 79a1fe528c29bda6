//! Changes of the models and durations of all knots, in place.

use super::Problem;
use crate::error::Error;
use crate::problem::group::innermost;

impl Problem {
    /// Sets the model and the duration (s) of each knot. The duration of an impact is 0. Allocates only at the first
    /// call, or if the number of a knot's controls changes.
    ///
    /// A knot whose model stays the same keeps the costs and limits that belong to this single knot. A knot whose model
    /// changes has the costs and limits that its new model has for all knots.
    ///
    /// The solver's trajectory must have the same knots: a loop calls [`Fddp::retime`](crate::Fddp::retime), which
    /// calls this method.
    ///
    /// ```
    /// # use condyle_dynamics::robots;
    /// # use condyle_optimal::Problem;
    /// # use condyle_optimal::robot::FreeDynamics;
    /// # let arm = std::sync::Arc::new(robots::arm7());
    /// # let knot = FreeDynamics::running(arm.clone(), 0.02, vec![])?;
    /// # let (x0, end) = (vec![0.1; 14], Box::new(FreeDynamics::terminal(arm, vec![])?));
    /// let mut problem = Problem::new(x0, vec![Box::new(knot)], vec![0; 4], end)?; // knots of 20 ms
    /// problem.set_knots(&[0; 4], &[0.005, 0.02, 0.02, 0.04])?;
    /// assert_eq!(problem.duration(3), Some(0.04));
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Length`] if there are not N indices and N durations, [`Error::UnknownModel`] and
    /// [`Error::NoNextState`] as for [`new`](Self::new), [`Error::TimeStep`] for a duration that is not above 0, or not
    /// 0 at an impact, and [`Error::NoDuration`] for a user-defined action. The problem is then unchanged.
    pub fn set_knots(&mut self, knot_models: &[usize], durations: &[f64]) -> Result<(), Error> {
        self.check_knots(knot_models, durations)?;
        self.move_knots(0, knot_models, durations);
        Ok(())
    }

    /// Checks the arguments of [`set_knots`](Self::set_knots).
    pub(crate) fn check_knots(&self, knot_models: &[usize], durations: &[f64]) -> Result<(), Error> {
        let horizon = self.horizon();
        Error::check_length("knot_models", knot_models.len(), horizon)?;
        Error::check_length("durations", durations.len(), horizon)?;
        for (knot, (&index, &dt)) in knot_models.iter().zip(durations).enumerate() {
            if index >= self.models.len() {
                return Err(Error::UnknownModel { knot, index, models: self.models.len() });
            }
            let action = self.models.of(index);
            if action.is_terminal() {
                return Err(Error::NoNextState { knot, index });
            }
            let old = action.knot_group().and_then(|group| group.duration(knot)).ok_or(Error::NoDuration { knot })?;
            let is_valid = if old == 0.0 { dt == 0.0 } else { dt > 0.0 && dt.is_finite() };
            if !is_valid {
                return Err(Error::TimeStep { dt });
            }
        }
        Ok(())
    }

    /// Moves the horizon by `passed` knots, and sets the models and durations of its knots, which were checked.
    pub(crate) fn move_knots(&mut self, passed: usize, knot_models: &[usize], durations: &[f64]) {
        for _ in 0..passed {
            self.models.actions.iter_mut().for_each(|action| action.shift());
            self.copies.shift();
        }
        let horizon = self.horizon();
        for (t, &index) in knot_models.iter().enumerate() {
            if let Some(&before) = self.knot_models.get(t + passed).filter(|before| **before != index) {
                self.each_group_of(before, &mut |group| group.release(t));
            }
        }
        self.knot_models.copy_from_slice(knot_models);
        self.arrange();
        for index in 0..self.models.len() {
            self.each_group_of(index, &mut |group| group.reserve_durations(horizon));
        }
        for (t, &dt) in durations.iter().enumerate() {
            if self.duration(t) != Some(dt) {
                self.each_group_of(knot_models[t], &mut |group| _ = group.set_duration(t, dt));
            }
        }
    }

    /// Calls `visit` for the innermost group that represents a model, and for its copies that other threads use. The
    /// model is chosen in these groups.
    fn each_group_of(&mut self, index: usize, visit: &mut dyn FnMut(&mut dyn crate::problem::KnotGroup)) {
        let [action, own] = self.models.place(index);
        if let Some(group) = self.models.chosen(index).and_then(innermost) {
            visit(group);
        }
        let done: Result<(), core::convert::Infallible> = self.copies.each_of(action, own, &mut |copy| {
            if let Some(group) = innermost(copy) {
                visit(group);
            }
            Ok(())
        });
        let Ok(()) = done;
    }
}
