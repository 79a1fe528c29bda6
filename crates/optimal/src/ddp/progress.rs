//! State of a solve between its iterations.

/// State that one iteration passes to the next.
pub(super) struct Progress {
    pub(super) regularisation: f64,
    pub(super) feasible: bool,
    /// Whether the iterate before the last accepted step was feasible.
    pub(super) was_feasible: bool,
    pub(super) tolerance: f64,
    /// Whether all controls of the iterate are within their bounds; controls of trials always are, controls of a warm
    /// start need not be.
    pub(super) bounded: bool,
    /// Number of accepted steps.
    pub(super) steps: usize,
    /// Whether this solve has computed gains.
    pub(super) swept: bool,
    /// Whether these gains belong to the best iterate, from which the last step started.
    pub(super) swept_best: bool,
}

/// Merit of an iterate, and the data from which its feedback was computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value {
    /// Largest gap.
    pub(super) gap: f64,
    pub(super) cost: f64,
    pub(super) feasible: bool,
    /// Whether its controls are within their bounds; only a warm start that was not projected can be outside.
    pub(super) bounded: bool,
    /// Number of accepted steps that led to the iterate.
    pub(super) steps: usize,
    /// Regularisation of the sweep at the iterate.
    pub(super) regularisation: f64,
}

impl Progress {
    /// Returns the value of the current iterate, with the given gap and cost.
    pub(super) fn value(&self, gap: f64, cost: f64) -> Value {
        let Self { feasible, bounded, steps, regularisation, .. } = *self;
        Value { gap, cost, feasible, bounded, steps, regularisation }
    }
}
