//! State of a solve between its iterations.

/// State that one iteration leaves to the next.
pub(super) struct Progress {
    pub(super) regularisation: f64,
    pub(super) feasible: bool,
    /// Whether the iterate before the last accepted step was feasible.
    pub(super) was_feasible: bool,
    pub(super) tolerance: f64,
    /// Whether all controls of the iterate are within their bounds: those of a trial are, a warm start need not be.
    pub(super) bounded: bool,
    /// The number of accepted steps.
    pub(super) steps: usize,
    /// Whether there are gains of this solve.
    pub(super) swept: bool,
    /// Whether they are those of the best iterate, which the last step left.
    pub(super) swept_best: bool,
}

/// Merit of an iterate, and how its feedback was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value {
    /// Largest gap.
    pub(super) gap: f64,
    pub(super) cost: f64,
    pub(super) feasible: bool,
    /// Whether its controls are within their bounds; only a warm start that was not projected can be outside.
    pub(super) bounded: bool,
    /// The number of accepted steps that led to it.
    pub(super) steps: usize,
    /// The regularisation of the sweep at it.
    pub(super) regularisation: f64,
}

impl Progress {
    /// Returns the value of an iterate with this gap and cost.
    pub(super) fn value(&self, gap: f64, cost: f64) -> Value {
        let Self { feasible, bounded, steps, regularisation, .. } = *self;
        Value { gap, cost, feasible, bounded, steps, regularisation }
    }
}
