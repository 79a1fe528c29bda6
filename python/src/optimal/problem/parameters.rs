//! Parameters of a problem: vectors with names.

use super::{Described, Problem, lock};
use crate::arrays::{Give, numbers};
use crate::exceptions::problem_error;
use crate::optimal::recorder::kept;
use condyle::optimal as rust;
use condyle::{Se3, Vec3, spatial::Mat3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rust::Parameter;
use rust::record::Call;
use rust::robot::{ControlBounds, Limit, Residual};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Reads the name of a parameter.
fn named(name: &str) -> PyResult<Parameter> {
    name.parse().map_err(problem_error)
}

#[pymethods]
impl Problem {
    /// Returns the names of all parameters, with the numbers of entries of their values: a dict.
    ///
    /// "x0" is the initial state and "duration" the duration of all knots. A cost NAME has the parameters
    /// "target/NAME", "weight/NAME" and "entry_weights/NAME". "contact/NAME" is the placement of a contact.
    /// "bounds/lower" and "bounds/upper" are the bounds on controls. "friction/NAME" is the coefficient of friction of
    /// the cones that are a limit or a cost NAME. The robot has the parameters "inertia/LINK", the ten
    /// `inertial_parameters` of a link, "gravity" and "armature".
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = lock("problem", &self.inner)?.parameters().map_err(problem_error)?;
        let sizes = PyDict::new(py);
        all.into_iter().try_for_each(|(parameter, size)| sizes.set_item(parameter.to_string(), size))?;
        Ok(sizes)
    }

    /// Returns the value of a parameter, a vector. A matrix is stored row by row: 9 numbers for a rotation, and 16 for
    /// a placement.
    ///
    /// parameter: the name of the parameter, see `parameters`.
    ///
    /// Raises `ProblemError` if the parameter does not exist, or if its value differs from knot to knot.
    fn parameter<'py>(&self, py: Python<'py>, parameter: &str) -> PyResult<Bound<'py, PyAny>> {
        let parameter = named(parameter)?;
        lock("problem", &self.inner)?.parameter(&parameter).map_err(problem_error)?.give(py, None)
    }

    /// Sets a parameter at all knots that have it, without building the problem again. Solvers continue with it.
    ///
    /// parameter: the name of the parameter, see `parameters`.
    /// values: the vector, as `parameter` returns it.
    ///
    /// Numbers of a robot replace the robot of this problem alone. They take longer to set than other parameters,
    /// because workspaces are allocated again.
    ///
    /// Raises `ProblemError` if the parameter does not exist, for a wrong size or invalid numbers, for an inertia that
    /// no body has, and if the inertia matrix becomes singular.
    fn set_parameter(&self, parameter: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let (kind, values) = (named(parameter)?, numbers("values", values)?);
        let mut problem = lock("problem", &self.inner)?;
        self.recorder.note(|| Call::SetParameter { name: parameter.to_owned(), values: kept(&values) });
        problem.set_parameter(&kind, &values).map_err(problem_error)?;
        self.is_outdated.store(true, Ordering::Relaxed);
        describe(&kind, &values, &mut lock("problem", &self.described)?)
    }

    /// Returns the values of parameters: a dict of vectors by name, which `set_parameters` sets.
    ///
    /// parameters: the names; None for all parameters whose value is the same at all knots.
    ///
    /// Raises `ProblemError` as `parameter` does, if names are given.
    #[pyo3(signature = (parameters=None))]
    fn parameter_values<'py>(&self, py: Python<'py>, parameters: Option<Vec<String>>) -> PyResult<Bound<'py, PyDict>> {
        let mut problem = lock("problem", &self.inner)?;
        let all = PyDict::new(py);
        match parameters {
            Some(names) => {
                for name in names {
                    let value = problem.parameter(&named(&name)?).map_err(problem_error)?;
                    all.set_item(name, value.give(py, None)?)?;
                }
            }
            None => {
                for (parameter, _) in problem.parameters().map_err(problem_error)? {
                    if let Ok(value) = problem.parameter(&parameter) {
                        all.set_item(parameter.to_string(), value.give(py, None)?)?;
                    }
                }
            }
        }
        Ok(all)
    }

    /// Sets several parameters, as `set_parameter` does, in the order of the dict.
    ///
    /// values: a dict of vectors by name.
    ///
    /// Raises `ProblemError` as `set_parameter` does. Parameters before the one in the message have their new values.
    fn set_parameters(&self, values: &Bound<'_, PyDict>) -> PyResult<()> {
        values.iter().try_for_each(|(name, values)| self.set_parameter(&name.extract::<String>()?, &values))
    }
}

/// Changes a parameter in the descriptions of the models. Costs are described later, from the problem.
fn describe(parameter: &Parameter, numbers: &[f64], described: &mut [Option<Arc<Described>>]) -> PyResult<()> {
    let mut robots: BTreeMap<*const condyle::Model, Arc<condyle::Model>> = BTreeMap::new();
    for described in described.iter_mut().flatten() {
        let old = &described.robot;
        if let Some(new) = parameter.changed_robot(old, numbers).map_err(problem_error)? {
            // descriptions that share a robot share the new one
            let new = robots.entry(Arc::as_ptr(old)).or_insert_with(|| Arc::new(new)).clone();
            Arc::make_mut(described).robot = new;
            continue;
        }
        let knot = &mut Arc::make_mut(described).knot;
        match parameter {
            Parameter::LowerBounds | Parameter::UpperBounds => {
                if let Some(ControlBounds { lower, upper }) = &mut knot.bounds {
                    let bound = if *parameter == Parameter::LowerBounds { lower } else { upper };
                    bound.copy_from_slice(numbers);
                }
            }
            Parameter::Friction(name) => {
                let all = knot.limits.iter_mut().chain(knot.limits_at.values_mut().flatten());
                all.filter(|limit| limit.name == *name).for_each(|limit| set_friction(limit, numbers[0]));
            }
            Parameter::Contact(name) => {
                if let Some(contact) = knot.contact_mut(name) {
                    contact.constraint.target.placement = pose(numbers);
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Sets the coefficient of friction of a limit that is a cone.
fn set_friction(limit: &mut Limit, mu: f64) {
    match &mut limit.residual {
        Residual::FrictionCone { cone, .. } => cone.mu = mu,
        Residual::WrenchCone { cone, .. } => cone.friction.mu = mu,
        _ => {}
    }
}

/// Returns the placement with the given homogeneous matrix, row by row.
fn pose(m: &[f64]) -> Se3<f64> {
    let column = |j: usize| Vec3::new(m[j], m[4 + j], m[8 + j]);
    Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3))
}
