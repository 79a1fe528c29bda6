//! Read-only arrays, for attributes of a model.

use super::{Give, class};
use pyo3::prelude::*;

/// Returns a read-only array of a model's numbers, since a model never changes. The error on a write names the method
/// `instead` that returns a changed model, if such a method exists.
pub(crate) fn read_only<'py, T: Give + ?Sized>(
    py: Python<'py>,
    numbers: &T,
    instead: &str,
) -> PyResult<Bound<'py, PyAny>> {
    class!(py, "ReadOnly")?.call_method1("of", (numbers.give(py, None)?, instead))
}
