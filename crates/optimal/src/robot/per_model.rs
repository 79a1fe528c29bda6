//! Values of the models of a problem that differ in their costs and limits only, so that one action stands for all of them.

/// A value for each model that an action stands for, and which of them serves which knot.
#[derive(Clone, Debug)]
pub(crate) struct PerModel<T> {
    /// The value of each model.
    all: Vec<T>,
    /// The number of the model that serves each knot; the first one beyond its end.
    of: Vec<usize>,
    /// The model that is to be changed.
    chosen: usize,
}

impl<T> PerModel<T> {
    /// The value of a single model.
    pub(crate) fn new(only: T) -> Self {
        Self { all: vec![only], of: Vec::new(), chosen: 0 }
    }

    /// All values.
    pub(crate) fn all(&self) -> &[T] {
        &self.all
    }

    /// All values, to be changed.
    pub(crate) fn all_mut(&mut self) -> &mut [T] {
        &mut self.all
    }

    /// The value at knot t.
    pub(crate) fn at(&self, t: usize) -> &T {
        self.of.get(t).and_then(|&model| self.all.get(model)).unwrap_or(&self.all[0])
    }

    /// The value of the model that is to be changed.
    pub(crate) fn chosen_mut(&mut self) -> &mut T {
        &mut self.all[self.chosen]
    }

    /// Chooses the model that is to be changed.
    pub(crate) fn choose(&mut self, model: usize) {
        self.chosen = model.min(self.all.len() - 1);
    }

    /// Takes over the models of another action.
    pub(crate) fn append(&mut self, other: &mut Self) {
        self.all.append(&mut other.all);
    }

    /// Lets a model serve knot t of so many. Allocates at the first call only.
    pub(crate) fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        if self.all.len() > 1 {
            self.of.resize(horizon, 0);
            self.of[t] = model;
        }
    }
}
