//! Memory of the dynamics algorithms, which all actions of a problem share.

use super::batch::{Long, Short};
use condyle_dynamics::{Data, Model};
use condyle_spatial::Scalar;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Memory of the algorithms for one scalar. Each call of a [`KnotBatch`](super::batch::KnotBatch) locks it; only one
/// thread uses it, so it never waits.
#[derive(Debug)]
pub(crate) struct Lent<S>(Arc<Mutex<Data<S>>>);

impl<S> Lent<S> {
    /// Returns the memory. Its content from earlier calls has no meaning.
    pub(super) fn get(&self) -> MutexGuard<'_, Data<S>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Memory of the algorithms for all scalars, which is allocated at its first use. It takes more time and memory than
/// everything else that a model needs, so the models of a problem share it. Copies of an action are for other threads
/// or problems, so a clone has its own memory.
#[derive(Debug, Default)]
pub(crate) struct SharedData(Arc<Datas>);

#[derive(Debug, Default)]
struct Datas {
    single: OnceLock<Arc<Mutex<Data<f64>>>>,
    short: OnceLock<Arc<Mutex<Data<Short>>>>,
    long: OnceLock<Arc<Mutex<Data<Long>>>>,
}

impl Clone for SharedData {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl SharedData {
    /// Uses the memory of `other`.
    pub(super) fn share(&mut self, other: &Self) {
        self.0 = other.0.clone();
    }

    /// Returns the memory for one knot.
    pub(super) fn single(&self, model: &Model) -> Lent<f64> {
        lent(&self.0.single, model)
    }

    /// Returns the memory for a few knots.
    pub(super) fn short(&self, model: &Model) -> Lent<Short> {
        lent(&self.0.short, model)
    }

    /// Returns the memory for as many knots as the widest registers have lanes.
    pub(super) fn long(&self, model: &Model) -> Lent<Long> {
        lent(&self.0.long, model)
    }
}

fn lent<S: Scalar>(data: &OnceLock<Arc<Mutex<Data<S>>>>, model: &Model) -> Lent<S> {
    Lent(data.get_or_init(|| Arc::new(Mutex::new(Data::new(model)))).clone())
}
