//! Values that most knots of a horizon share and some have for themselves.

/// One value for all knots of a horizon, and others for some of them.
#[derive(Clone, Debug)]
pub(crate) struct PerKnot<T> {
    /// The value of all knots, then those of knots with one of their own.
    all: Vec<T>,
    /// The number of the value of each knot; beyond its end the first.
    of: Vec<usize>,
    /// The numbers of values whose knots have left the horizon.
    free: Vec<usize>,
}

impl<T> PerKnot<T> {
    /// A value for all knots.
    pub(crate) fn new(common: T) -> Self {
        Self { all: vec![common], of: Vec::new(), free: Vec::new() }
    }

    fn index(&self, t: Option<usize>) -> usize {
        t.and_then(|t| self.of.get(t)).copied().unwrap_or(0)
    }

    /// All values.
    pub(crate) fn all(&self) -> &[T] {
        &self.all
    }

    /// All values, to be changed.
    pub(crate) fn all_mut(&mut self) -> &mut [T] {
        &mut self.all
    }

    /// The value of knot t.
    pub(crate) fn at(&self, t: usize) -> &T {
        &self.all[self.index(Some(t))]
    }

    /// The value of knot t, or that of all knots without one of their own.
    pub(crate) fn at_mut(&mut self, t: Option<usize>) -> &mut T {
        let k = self.index(t);
        &mut self.all[k]
    }

    /// Sets the value of knot t, or that of all knots without one of their own.
    pub(crate) fn set(&mut self, t: Option<usize>, value: T) {
        let Some(t) = t else {
            self.all[0] = value;
            return;
        };
        if t >= self.of.len() {
            self.of.resize(t + 1, 0);
        }
        if self.of[t] == 0 {
            self.of[t] = self.free.pop().unwrap_or(self.all.len());
        }
        match self.all.get_mut(self.of[t]) {
            Some(old) => *old = value,
            None => {
                self.all.push(value);
                self.free.reserve(self.all.len()); // so that a shift need not
            }
        }
    }

    /// Moves the horizon on: knot t becomes knot t − 1.
    pub(crate) fn shift(&mut self) {
        if !self.of.is_empty() {
            let first = self.of.remove(0);
            self.free.extend((first > 0).then_some(first));
        }
    }
}
