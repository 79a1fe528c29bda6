//! The place where a problem keeps its record, and through which its calls are recorded.

use condyle::optimal as rust;
use rust::record::{Call, Numbers, Recorded};
use std::sync::{Arc, Mutex, PoisonError};

pub(super) type Shared = Arc<Mutex<rust::record::Record>>;

/// The record of a problem's calls, if there is one, and the address of the recorded solver.
#[derive(Default)]
pub(super) struct Recorder(Mutex<Option<(usize, Shared)>>);

/// Returns the address by which a solver is recognised.
pub(super) fn address<S>(solver: &Mutex<S>) -> usize {
    std::ptr::from_ref(solver) as usize
}

impl Recorder {
    /// Begins a record of a solver's calls.
    pub(super) fn begin(&self, solver: usize, record: &Shared) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((solver, record.clone()));
    }

    /// Ends this record, unless another one has begun.
    pub(super) fn end(&self, record: &Shared) {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.as_ref().is_some_and(|(_, own)| Arc::ptr_eq(own, record)) {
            *slot = None;
        }
    }

    fn with(&self, solver: Option<usize>, f: impl FnOnce(&mut rust::record::Record)) {
        let slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((recorded, record)) = &*slot
            && solver.is_none_or(|solver| solver == *recorded)
        {
            f(&mut record.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// Records a call on the problem.
    pub(super) fn note(&self, call: impl FnOnce() -> Call) {
        self.with(None, |record| record.push(call()));
    }

    /// Records a call on a solver that does not solve.
    pub(super) fn note_of(&self, solver: usize, call: impl FnOnce() -> Call) {
        self.with(Some(solver), |record| record.push(call()));
    }

    /// Records a call that solves, and its result. Without a result, the call has failed.
    pub(super) fn note_tick(&self, solver: usize, result: Option<&impl Recorded>, call: impl FnOnce() -> Call) {
        self.with(Some(solver), |record| match result {
            Some(result) => record.push_tick(call(), result),
            None => record.push(call()),
        });
    }
}

/// Copies numbers for a record.
pub(super) fn kept(numbers: &[f64]) -> Numbers {
    numbers.to_vec().into()
}
