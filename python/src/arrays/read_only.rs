//! Arrays that show a model's own numbers.

use super::{Give, class};
use pyo3::prelude::*;

/// An array that nobody can write to, since a model never changes; who tries is told the method by which to make another
/// model, if there is one.
pub(crate) fn read_only<'py, T: Give + ?Sized>(
    py: Python<'py>,
    numbers: &T,
    instead: &str,
) -> PyResult<Bound<'py, PyAny>> {
    class!(py, "ReadOnly")?.call_method1("of", (numbers.give(py, None)?, instead))
}
