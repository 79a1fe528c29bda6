//! Exceptions of the package.

use condyle::ModelError as Cause;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

create_exception!(condyle, Error, PyException, "An error of this package: the base of all others.");
create_exception!(
    condyle,
    ParseError,
    Error,
    "An error of a file that cannot be read, is no XML, or describes no robot."
);
create_exception!(condyle, ProblemError, Error, "An error in an optimal control problem, a warm start or a setting.");
create_exception!(
    condyle,
    ControllerError,
    Error,
    "An error in the description of a whole-body controller or of a plan, or a step that was not solved."
);
create_exception!(
    condyle,
    ModelError,
    Error,
    "An error in a model that is to be built, or a frame or joint that a model does not have."
);
create_exception!(condyle, NotPhysicalError, Error, "An inertia that no body of positive density has.");

/// Converts an error of the library to one of the package's exceptions.
pub(crate) fn exception(error: Cause) -> PyErr {
    match error {
        Cause::File { .. }
        | Cause::Package { .. }
        | Cause::Xml { .. }
        | Cause::Element { .. }
        | Cause::Strict { .. } => ParseError::new_err(error.to_string()),
        _ => ModelError::new_err(error.to_string()),
    }
}

/// Converts an error of `condyle::optimal` to a `ProblemError`.
pub(crate) fn problem_error(error: condyle::optimal::Error) -> PyErr {
    ProblemError::new_err(error.to_string())
}

/// Converts an error of `condyle::wholebody` to a `ModelError` or a `ControllerError`.
pub(crate) fn controller_error(error: condyle::wholebody::Error) -> PyErr {
    match error {
        condyle::wholebody::Error::Model(error) => exception(error),
        other => ControllerError::new_err(other.to_string()),
    }
}

/// Converts an error of `condyle::ik` to a `ModelError`, or to a `ValueError` for an argument.
pub(crate) fn ik_error(error: condyle::ik::Error) -> PyErr {
    match error {
        condyle::ik::Error::Model(error) => exception(error),
        other => PyValueError::new_err(other.to_string()),
    }
}

/// Converts an error of `condyle::mpc` to a `ProblemError` or a `ControllerError`.
pub(crate) fn mpc_error(error: condyle::mpc::Error) -> PyErr {
    match error {
        condyle::mpc::Error::Optimal(error) => problem_error(error),
        other => ControllerError::new_err(other.to_string()),
    }
}

/// Returns the error for a word that is not among the words expected for an argument.
pub(crate) fn wrong_word(name: &str, expected: &str, found: &str) -> PyErr {
    PyValueError::new_err(format!("{name}: expected {expected}, found '{found}'"))
}

/// Returns an integer argument if its value is between `least` and `most`; otherwise an error.
pub(crate) fn within(name: &str, found: usize, least: usize, most: usize) -> PyResult<usize> {
    if found < least {
        return Err(PyValueError::new_err(format!("{name}: expected at least {least}, found {found}")));
    }
    if found > most {
        return Err(PyValueError::new_err(format!("{name}: expected at most {most}, found {found}")));
    }
    Ok(found)
}
