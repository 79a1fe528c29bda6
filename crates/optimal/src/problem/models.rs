//! Actions of a problem. Models that differ only in costs, references and weights are represented by one action, so
//! that their knots are computed in groups.

use super::action::ActionModel;
use super::shape::{MOST_ENTRIES, MOST_KNOTS};
use crate::error::Error;

/// Maximum number of entries in the matrices [A B] of all knots: a solver stores several objects of that size, 2 GiB
/// each.
const MOST_NUMBERS: usize = 1 << 28;

/// Number of most recent actions with which a model is compared. It is limited so that a horizon whose knots all differ
/// is created in linear time.
const COMPARED: usize = 64;

/// Actions of a problem, and the action that represents each model.
#[derive(Default)]
pub(crate) struct Models {
    pub(crate) actions: Vec<Box<dyn ActionModel>>,
    /// Action that represents each model, and the model's index in that action.
    places: Vec<[usize; 2]>,
}

impl Models {
    /// Merges the models that differ only in costs, references and weights, and allocates the memory of all.
    pub(crate) fn new(models: Vec<Box<dyn ActionModel>>) -> Self {
        let mut all = Self::default();
        let mut counts: Vec<usize> = Vec::new();
        for mut model in models {
            let last = all.actions.len().saturating_sub(COMPARED);
            let mut alike = all.actions.iter_mut().enumerate().skip(last).rev();
            let place = match alike.find_map(|(k, action)| action.merge(&mut *model).then_some(k)) {
                Some(k) => {
                    counts[k] += 1;
                    [k, counts[k] - 1]
                }
                None => {
                    all.actions.push(model);
                    counts.push(1);
                    [counts.len() - 1, 0]
                }
            };
            all.places.push(place);
        }
        all.actions.iter_mut().for_each(|action| action.reserve());
        all
    }

    /// Returns the actions, and the action that represents each model.
    pub(crate) fn parts(&mut self) -> (&mut [Box<dyn ActionModel>], &[[usize; 2]]) {
        (&mut self.actions, &self.places)
    }

    /// Returns the number of models.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Returns the action that represents a model, and the model's index in that action.
    pub(crate) fn place(&self, model: usize) -> [usize; 2] {
        self.places[model]
    }

    /// Returns the action that represents a model.
    pub(crate) fn of(&self, model: usize) -> &dyn ActionModel {
        &*self.actions[self.places[model][0]]
    }

    /// Returns the action that represents a model, for computing.
    pub(crate) fn of_mut(&mut self, model: usize) -> &mut dyn ActionModel {
        &mut *self.actions[self.places[model][0]]
    }

    /// Returns the action that represents a model; changes made through it only change that model.
    pub(crate) fn chosen(&mut self, model: usize) -> Option<&mut dyn ActionModel> {
        let [action, own] = *self.places.get(model)?;
        let action = &mut *self.actions[action];
        action.choose(own);
        Some(action)
    }

    /// Copies all actions, for the same models.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub(crate) fn try_clone(&self) -> Result<Self, Error> {
        let model = |k: usize| self.places.iter().position(|place| place[0] == k);
        let mut actions = Vec::with_capacity(self.actions.len());
        for (k, action) in self.actions.iter().enumerate() {
            let mut copy = action.try_clone().ok_or(Error::NoCopy { model: model(k) })?;
            copy.reserve();
            actions.push(copy);
        }
        Ok(Self { actions, places: self.places.clone() })
    }
}

/// Checks that the models fit together in one problem.
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
