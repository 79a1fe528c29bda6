//! Arrays that show a model's own numbers.

use super::{Give, class};
use pyo3::prelude::*;

/// Returns a read-only array, since a model never changes. The error on a write names the method that makes a changed
/// model, if there is one.
pub(crate) fn read_only<'py, T: Give + ?Sized>(
    py: Python<'py>,
    numbers: &T,
    instead: &str,
) -> PyResult<Bound<'py, PyAny>> {
    class!(py, "ReadOnly")?.call_method1("of", (numbers.give(py, None)?, instead))
}
