//! The scratch memory of the algorithms, and how a call borrows it.

use crate::batch;
use crate::exceptions::within;
use crate::hyper_dual::Hyper;
use crate::made_for::MadeFor;
use crate::model::Model;
use pyo3::PyClass;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::False;
use std::sync::Arc;

/// Scratch memory of the algorithms for one model: made once, and used by one thread at a time.
///
/// A `Data` can be used with all models that have the same bodies and joints. Gravity, armature and inertias may
/// differ. No algorithm reads results of an earlier call, so the order of calls does not matter. Use from two threads
/// at once is a `RuntimeError`; use with another robot's model is a `ValueError`.
///
/// model: the robot; threads: the number of threads for calls with many states (q of shape (N, nq)), at most 1024. Such
/// calls also compute several states at once in SIMD lanes, and release the interpreter's lock.
///
/// >>> arm = condyle.robots.arm7()
/// >>> condyle.Data(arm)
/// <condyle.Data of 'arm7'>
#[pyclass(module = "condyle")]
pub(crate) struct Data {
    inner: condyle::Data<f64>,
    made_for: MadeFor,
    /// The model for which this `Data` was made.
    robot: Arc<condyle::Model>,
    threads: usize,
    /// The scratch memory for hyper-dual numbers, made on first use.
    dual: Option<Box<condyle::Data<Hyper>>>,
    /// The scratch memory for many states, large enough for all calls so far.
    batch: Option<Box<condyle::Batch>>,
}

#[pymethods]
impl Data {
    #[new]
    #[pyo3(signature = (model, threads = 1))]
    pub(crate) fn new(model: &Bound<'_, Model>, threads: usize) -> PyResult<Self> {
        within("threads", threads, 1, condyle::Batch::<f64>::MOST_THREADS)?;
        let model = model.get();
        let (inner, made_for) = (condyle::Data::new(&model.inner), MadeFor::new(model));
        Ok(Self { inner, made_for, robot: model.inner.clone(), threads, dual: None, batch: None })
    }

    /// Returns the class and the arguments from which `pickle` makes an equivalent `Data` for the same model.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.borrow();
        let model = Model::from((*this.robot).clone());
        Ok((slf.get_type(), (model, this.threads)).into_pyobject(slf.py())?.into_any())
    }

    /// Returns the robot's name.
    fn __repr__(&self) -> String {
        format!("<condyle.Data of '{}'>", self.made_for.name)
    }
}

impl Data {
    /// Returns a batch for `states` states, or for the largest number of states that is computed at once.
    pub(crate) fn batch(&mut self, model: &condyle::Model, states: usize) -> &mut condyle::Batch {
        let states = states.min(batch::MOST_STATES * self.threads);
        let enough = self.batch.take().filter(|batch| batch.capacity() >= states);
        let threads = self.threads;
        self.batch.insert(enough.unwrap_or_else(|| Box::new(condyle::Batch::new(model, states, threads))))
    }
}

impl Scratch for Data {
    const ARGUMENT: &'static str = "data";
    fn made_for(&self) -> &MadeFor {
        &self.made_for
    }
}

impl Holds<f64> for Data {
    type Held = condyle::Data<f64>;
    fn held(&mut self, _: &condyle::Model) -> PyResult<&mut condyle::Data<f64>> {
        Ok(&mut self.inner)
    }
}

impl Holds<Hyper> for Data {
    type Held = condyle::Data<Hyper>;
    fn held(&mut self, model: &condyle::Model) -> PyResult<&mut condyle::Data<Hyper>> {
        Ok(self.dual.get_or_insert_with(|| Box::new(condyle::Data::new(model))))
    }
}

/// An argument that is scratch memory, made for one model and used by one call at a time.
pub(crate) trait Scratch: PyClass<Frozen = False> {
    /// Name of the argument, for error messages.
    const ARGUMENT: &'static str;
    /// Returns the models with which this object may be used.
    fn made_for(&self) -> &MadeFor;
}

/// Scratch memory for one type of number.
pub(crate) trait Holds<S>: Scratch {
    /// The library's type for this scratch memory.
    type Held;
    /// Returns the library's scratch memory for this type of number. Creates the memory if it does not exist yet.
    fn held(&mut self, model: &condyle::Model) -> PyResult<&mut Self::Held>;
}

/// Borrows scratch memory for a call. Raises an error if another call uses the memory, or if the memory belongs to
/// another robot.
pub(crate) fn take<'py, T: Scratch>(model: &Model, scratch: &Bound<'py, T>) -> PyResult<PyRefMut<'py, T>> {
    let scratch = scratch.try_borrow_mut().map_err(|_| {
        let (argument, class) = (T::ARGUMENT, T::NAME);
        PyRuntimeError::new_err(format!("{argument}: in use by another call; give each thread a {class} of its own"))
    })?;
    scratch.made_for().check(T::ARGUMENT, model)?;
    Ok(scratch)
}
