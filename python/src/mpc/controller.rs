//! Macro that writes the class of a controller, with the methods that all controllers have.

/// Defines the methods of a controller class: its own methods, then the methods that all controllers have. `$root` is
/// the number of coordinates of v without motors, which come first.
macro_rules! controller {
    ($class:ident, $root:literal { $($own:tt)* }) => {
        #[pymethods]
        impl $class {
            $($own)*

            fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
                visit.call(&self.model)
            }

            /// The robot.
            #[getter]
            fn model(&self, py: Python<'_>) -> Py<Model> {
                self.model.clone_ref(py)
            }

            /// Returns a `JointPolicy` that follows the latest plan, also after later updates.
            fn policy(&self) -> PyResult<JointPolicy> {
                let inner = lock("controller", &self.inner)?;
                Ok(JointPolicy::new(inner.policy(), self.nx, inner.model().nv() - $root))
            }

            /// The `Report` of the last tick.
            #[getter]
            fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                give_report(py, lock("controller", &self.inner)?.report())
            }
        }
    };
}

pub(super) use controller;
