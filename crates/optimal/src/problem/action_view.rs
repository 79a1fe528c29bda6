//! View of the actions of a horizon for one thread.

use super::action::ActionModel;

/// Actions of all knots, used by one thread. They are the actions of the problem, or copies of them.
pub(crate) struct ActionView<'a> {
    /// Initial state x̂₀.
    pub(super) x0: &'a [f64],
    /// Index of each knot's model; the next field contains, for each model, the index of its action and its index in
    /// that action.
    pub(super) knot_models: &'a [usize],
    pub(super) places: &'a [[usize; 2]],
    pub(super) actions: Actions<'a>,
}

/// Source of the actions of a view.
pub(super) enum Actions<'a> {
    /// Actions of the problem, followed by its terminal action.
    Own(&'a mut [Box<dyn ActionModel>], &'a mut dyn ActionModel),
    /// Copies of all actions except the terminal one; `None` where no copy exists.
    Copied(&'a mut [Option<Box<dyn ActionModel>>]),
}

/// Panic message for a terminal or missing action among the copies, which [`Problem::two`](super::Problem::two) rules
/// out.
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

    /// Returns the action of knot t, as a mutable reference for evaluations.
    pub(crate) fn action_mut(&mut self, t: usize) -> &mut dyn ActionModel {
        let place = self.knot_models.get(t).map(|model| self.places[*model][0]);
        match (&mut self.actions, place) {
            (Actions::Own(actions, _), Some(k)) => &mut *actions[k],
            (Actions::Own(_, terminal), None) => &mut **terminal,
            (Actions::Copied(copies), k) => k.and_then(|k| copies[k].as_deref_mut()).expect(COPIED),
        }
    }
}
