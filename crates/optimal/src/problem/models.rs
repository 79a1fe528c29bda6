//! Models and actions of a problem. Models that differ only in costs, limits and durations are merged into one action,
//! so that the knots of these models are evaluated in groups.

use super::action::ActionModel;
use super::group::{innermost, lanes as group_lanes};
use super::shape::{MOST_ENTRIES, MOST_KNOTS};
use crate::error::Error;

/// Maximum number of entries in the matrices [A B] of all knots. A solver stores several arrays of this size; each
/// array takes up to 2 GiB.
const MOST_NUMBERS: usize = 1 << 28;

/// Maximum number of actions with which a new model is compared. The most recent actions are compared. The limit makes
/// the time to create a horizon linear in its length, even if all knots differ.
const COMPARED: usize = 64;

/// Position of each model: its action, and its index within that action.
#[derive(Clone, Default)]
struct Places {
    /// Index of the action that represents each model, and the model's index in that action.
    of: Vec<[usize; 2]>,
    /// Number of models that each action represents.
    counts: Vec<usize>,
    /// Unused model indices of each action, which new models may take.
    free: Vec<Vec<usize>>,
}

/// Actions of a problem, and the assignment of models to actions.
#[derive(Default)]
pub(crate) struct Models {
    pub(crate) actions: Vec<Box<dyn ActionModel>>,
    /// Number of states that each action computes in about the time of one state.
    pub(crate) lanes: Vec<usize>,
    places: Places,
    /// Number of models with which the problem was created.
    given: usize,
}

/// Moves a model into an action of the same kind, as model `place` of the action or as a new model. Returns whether
/// this succeeded.
fn merge(action: &mut dyn ActionModel, model: &mut dyn ActionModel, place: Option<usize>) -> bool {
    match action.knot_group_mut() {
        Some(group) => group.merge(model, place),
        None => action.group_model().is_some_and(|group| group.is_same(model)),
    }
}

/// Makes actions of one thread share scratch memory, if possible: all use the memory of `first`.
pub(super) fn share(first: &dyn ActionModel, action: &mut dyn ActionModel) {
    if let Some((own, first)) = innermost(action).zip(first.knot_group()) {
        own.share(first);
    }
}

/// Allocates the workspace of an action, and of the action that it wraps.
pub(super) fn reserve(action: &mut dyn ActionModel) {
    if let Some(group) = innermost(action) {
        group.reserve();
    }
}

impl Models {
    /// Merges models that differ only in costs, limits and durations, and allocates the workspaces of all actions.
    pub(crate) fn new(models: Vec<Box<dyn ActionModel>>) -> Self {
        let mut all = Self { given: models.len(), ..Self::default() };
        for model in models {
            let place = all.place_of(model);
            all.places.of.push(place);
        }
        all.share();
        all.actions.iter_mut().for_each(|action| reserve(&mut **action));
        all
    }

    /// Makes the actions share scratch memory.
    pub(super) fn share(&mut self) {
        if let [first, others @ ..] = &mut self.actions[..] {
            others.iter_mut().for_each(|action| share(&**first, &mut **action));
        }
    }

    /// Returns the position of a model. The model is merged into an action of the same kind, or else added as a new
    /// action.
    fn place_of(&mut self, mut model: Box<dyn ActionModel>) -> [usize; 2] {
        let Self { actions, lanes, places: Places { counts, free, .. }, .. } = self;
        let first = actions.len().saturating_sub(COMPARED);
        for (k, action) in actions.iter_mut().enumerate().skip(first).rev() {
            let place = free[k].last().copied();
            if merge(&mut **action, &mut *model, place) {
                free[k].pop();
                counts[k] += usize::from(place.is_none());
                return [k, place.unwrap_or(counts[k] - 1)];
            }
        }
        lanes.push(group_lanes(&mut *model));
        // the new action replaces an action that represents no model any more, if there is one
        match (0..actions.len()).find(|&k| free[k].len() == counts[k]) {
            Some(k) => {
                (actions[k], lanes[k], counts[k]) = (model, lanes.pop().expect("was just pushed"), 1);
                free[k].clear();
                [k, 0]
            }
            None => {
                actions.push(model);
                counts.push(1);
                free.push(Vec::new());
                [actions.len() - 1, 0]
            }
        }
    }

    /// Adds a model. The new model replaces model `unused`, if `unused` was added after the problem was created;
    /// otherwise it gets a new index. Returns the index of the added model. Allocates.
    pub(crate) fn add(&mut self, model: Box<dyn ActionModel>, unused: Option<usize>) -> usize {
        let index = unused.filter(|index| *index >= self.given).unwrap_or(self.len());
        if let Some(&[action, own]) = self.places.of.get(index) {
            self.places.free[action].push(own);
        }
        let place = self.place_of(model);
        match self.places.of.get_mut(index) {
            Some(old) => *old = place,
            None => self.places.of.push(place),
        }
        self.share();
        reserve(&mut *self.actions[place[0]]);
        index
    }

    /// Returns the indices of the models that were added after the problem was created.
    pub(crate) fn added(&self) -> core::ops::Range<usize> {
        self.given..self.len()
    }

    /// Returns the actions; also returns, for each model, the index of its action and its index in that action.
    pub(crate) fn parts(&mut self) -> (&mut [Box<dyn ActionModel>], &[[usize; 2]]) {
        (&mut self.actions, &self.places.of)
    }

    /// Returns the number of models.
    pub(crate) fn len(&self) -> usize {
        self.places.of.len()
    }

    /// Returns the index of the action that represents a model, and the model's index in that action.
    pub(crate) fn place(&self, model: usize) -> [usize; 2] {
        self.places.of[model]
    }

    /// Returns the action that represents a model.
    pub(crate) fn of(&self, model: usize) -> &dyn ActionModel {
        &*self.actions[self.places.of[model][0]]
    }

    /// Returns the action that represents a model, as a mutable reference for evaluations.
    pub(crate) fn of_mut(&mut self, model: usize) -> &mut dyn ActionModel {
        &mut *self.actions[self.places.of[model][0]]
    }

    /// Returns the action that represents a model, and selects this model: later changes of the action affect only this
    /// model.
    pub(crate) fn chosen(&mut self, model: usize) -> Option<&mut dyn ActionModel> {
        let [action, own] = *self.places.of.get(model)?;
        let action = &mut *self.actions[action];
        if let Some(group) = action.knot_group_mut() {
            group.choose(own);
        }
        Some(action)
    }

    /// Copies all actions; each copy represents the same models. The copies share scratch memory with `beside`, an
    /// action that the same thread uses, or else with each other.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub(crate) fn try_clone(&self, beside: Option<&dyn ActionModel>) -> Result<Self, Error> {
        let model = |k: usize| self.places.of.iter().position(|place| place[0] == k);
        let mut actions: Vec<Box<dyn ActionModel>> = Vec::with_capacity(self.actions.len());
        for (k, action) in self.actions.iter().enumerate() {
            let mut copy = action.try_clone().ok_or(Error::NoCopy { model: model(k) })?;
            if let Some(first) = beside.or(actions.first().map(|first| &**first)) {
                share(first, &mut *copy);
            }
            reserve(&mut *copy);
            actions.push(copy);
        }
        Ok(Self { actions, lanes: self.lanes.clone(), places: self.places.clone(), given: self.given })
    }
}

/// Checks that the dimensions of the models fit together in one problem.
pub(crate) fn check(
    models: &[Box<dyn ActionModel>],
    knot_models: &[usize],
    terminal: &dyn ActionModel,
) -> Result<(), Error> {
    if knot_models.is_empty() {
        return Err(Error::EmptyHorizon);
    }
    let (nx, ndx, horizon) = (terminal.nx(), terminal.ndx(), knot_models.len());
    Error::check_size("knots", horizon, MOST_KNOTS)?;
    for (name, found) in [("nx", nx), ("ndx", ndx)] {
        Error::check_size(name, found, MOST_ENTRIES)?;
    }
    let mut numbers = 0;
    for (knot, &index) in knot_models.iter().enumerate() {
        let model = models.get(index).ok_or(Error::UnknownModel { knot, index, models: models.len() })?;
        if model.is_terminal() {
            return Err(Error::NoNextState { knot, index });
        }
        for (name, expected, found) in [("nx", nx, model.nx()), ("ndx", ndx, model.ndx())] {
            if expected != found {
                return Err(Error::Dimension { knot, name, expected, found });
            }
        }
        Error::check_size("nu", model.nu(), MOST_ENTRIES)?;
        numbers += ndx * (ndx + model.nu());
        Error::check_size("numbers in the matrices of all knots", numbers, MOST_NUMBERS)?;
    }
    if ndx == 0 {
        return Err(Error::EmptyState);
    }
    match terminal.nu() {
        0 => Ok(()),
        nu => Err(Error::TerminalControls { nu }),
    }
}
