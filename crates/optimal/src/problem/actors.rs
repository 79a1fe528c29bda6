//! The actions of a horizon, in the hands of one thread.

use super::action::ActionModel;

/// The actions of all knots: a problem's own, or copies of them.
pub(crate) struct Actors<'a> {
    /// The initial state x̂₀.
    pub(super) x0: &'a [f64],
    /// The model of each knot, and the action that stands for each model.
    pub(super) stages: &'a [usize],
    pub(super) places: &'a [[usize; 2]],
    pub(super) actions: Actions<'a>,
}

/// Whose actions they are.
pub(super) enum Actions<'a> {
    /// The problem's, with the terminal one.
    Own(&'a mut [Box<dyn ActionModel>], &'a mut dyn ActionModel),
    /// Copies, one of each action; there is none of the terminal one.
    Copied(&'a mut [Option<Box<dyn ActionModel>>]),
}

/// What [`Problem::two`](super::Problem::two) sees to, and those that work with copies.
const COPIED: &str = "copies serve the knots before the terminal one";

impl Actors<'_> {
    /// The initial state x̂₀.
    pub(crate) fn x0(&self) -> &[f64] {
        self.x0
    }

    /// The action of knot t.
    pub(crate) fn action(&self, t: usize) -> &dyn ActionModel {
        let place = self.stages.get(t).map(|stage| self.places[*stage][0]);
        match (&self.actions, place) {
            (Actions::Own(actions, _), Some(k)) => &*actions[k],
            (Actions::Own(_, terminal), None) => &**terminal,
            (Actions::Copied(copies), k) => k.and_then(|k| copies[k].as_deref()).expect(COPIED),
        }
    }

    /// As [`action`](Self::action), to compute with.
    pub(crate) fn action_mut(&mut self, t: usize) -> &mut dyn ActionModel {
        let place = self.stages.get(t).map(|stage| self.places[*stage][0]);
        match (&mut self.actions, place) {
            (Actions::Own(actions, _), Some(k)) => &mut *actions[k],
            (Actions::Own(_, terminal), None) => &mut **terminal,
            (Actions::Copied(copies), k) => k.and_then(|k| copies[k].as_deref_mut()).expect(COPIED),
        }
    }
}
