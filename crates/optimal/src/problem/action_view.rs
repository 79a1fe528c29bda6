//! Actions of a horizon, used by one thread.

use super::action::ActionModel;

/// Actions of all knots, used by one thread: the actions of the problem, or copies of them.
pub(crate) struct ActionView<'a> {
    /// Initial state x̂₀.
    pub(super) x0: &'a [f64],
    /// Model of each knot, and the action that represents each model.
    pub(super) knot_models: &'a [usize],
    pub(super) places: &'a [[usize; 2]],
    pub(super) actions: Actions<'a>,
}

/// Source of the actions.
pub(super) enum Actions<'a> {
    /// Actions of the problem, and its terminal action.
    Own(&'a mut [Box<dyn ActionModel>], &'a mut dyn ActionModel),
    /// Copies, one of each action except the terminal one.
    Copied(&'a mut [Option<Box<dyn ActionModel>>]),
}

/// Message for a violated guarantee of [`Problem::two`](super::Problem::two) and of the users of copies.
const COPIED: &str = "copies serve the knots before the terminal one";

impl ActionView<'_> {
    /// Returns the initial state x̂₀.
    pub(crate) fn x0(&self) -> &[f64] {
        self.x0
    }

    /// Returns the action of knot t.
    pub(crate) fn action(&self, t: usize) -> &dyn ActionModel {
        let place = self.knot_models.get(t).map(|model| self.places[*model][0]);
        match (&self.actions, place) {
            (Actions::Own(actions, _), Some(k)) => &*actions[k],
            (Actions::Own(_, terminal), None) => &**terminal,
            (Actions::Copied(copies), k) => k.and_then(|k| copies[k].as_deref()).expect(COPIED),
        }
    }

    /// Returns the action of knot t, mutable for computing.
    pub(crate) fn action_mut(&mut self, t: usize) -> &mut dyn ActionModel {
        let place = self.knot_models.get(t).map(|model| self.places[*model][0]);
        match (&mut self.actions, place) {
            (Actions::Own(actions, _), Some(k)) => &mut *actions[k],
            (Actions::Own(_, terminal), None) => &mut **terminal,
            (Actions::Copied(copies), k) => k.and_then(|k| copies[k].as_deref_mut()).expect(COPIED),
        }
    }
}
