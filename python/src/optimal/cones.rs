//! Friction cones and wrench cones, to which residuals refer.

use crate::arrays::{self, Give};
use crate::exceptions::{ProblemError, problem_error, within};
use condyle::optimal::robot;
use condyle::spatial::Mat3;
use pyo3::prelude::*;

/// Coulomb's friction cone ‖f_t‖ ≤ μ f_n of a force f with tangential part f_t and normal component f_n, as a pyramid.
/// The pyramid and the bounds on the normal force are the rows lower ≤ A f ≤ upper.
///
/// mu: μ; facets: the number of the pyramid's sides, even, 4 to 1000; inner: whether the pyramid lies inside the cone;
/// rotation: the surface's axes in the contact's axes, (3, 3), with the surface's normal as z axis; least, greatest:
/// bounds on the normal force (N), by default 0 and infinite.
///
/// Raises `ProblemError` if μ is negative or not finite, facets is odd or not from 4 to 1000, or rotation is not a
/// rotation matrix.
///
/// >>> condyle.optimal.FrictionCone(0.5).rows()[0]
/// array([ 1. ,  0. , -0.5])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct FrictionCone(pub(super) robot::FrictionCone);

#[pymethods]
impl FrictionCone {
    #[new]
    #[pyo3(signature = (mu, facets=4, inner=false, rotation=None, least=0.0, greatest=f64::INFINITY))]
    fn new(
        mu: f64,
        facets: usize,
        inner: bool,
        rotation: Option<&Bound<'_, PyAny>>,
        least: f64,
        greatest: f64,
    ) -> PyResult<Self> {
        within("facets", facets, 0, robot::FrictionCone::MOST_FACETS)?;
        let rotation = surface(rotation)?;
        let cone = robot::FrictionCone { rotation, mu, facets, inner, least, greatest };
        cone.check().map_err(problem_error)?;
        Ok(Self(cone))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = serde_json::to_string(&slf.get().0).expect("is made of numbers and words");
        Ok((slf.get_type().getattr("_from_json")?, (text,)))
    }

    #[staticmethod]
    fn _from_json(text: &str) -> PyResult<Self> {
        let wrong = |error| ProblemError::new_err(format!("no cone: {error}"));
        let cone: robot::FrictionCone = serde_json::from_str(text).map_err(wrong)?;
        cone.check().map_err(problem_error)?;
        Ok(Self(cone))
    }

    /// Returns the matrix A, (facets + 1, 3).
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.rows().give(py, None)
    }

    /// Returns the lower and upper bounds of A f.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        pair(py, self.0.bounds())
    }
}

/// The wrench cone of a rectangular sole, lower ≤ A w ≤ upper for a wrench w. The rows bound friction, the centre of
/// pressure (within the rectangle) and the yaw moment.
///
/// friction: a `FrictionCone`; size: the rectangle's sides along the surface's x and y (m).
///
/// Raises `ProblemError` if a side is negative or not finite.
///
/// >>> from condyle.optimal import FrictionCone, WrenchCone
/// >>> WrenchCone(FrictionCone(0.7), [0.2, 0.1]).rows().shape
/// (17, 6)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct WrenchCone(pub(super) robot::WrenchCone);

#[pymethods]
impl WrenchCone {
    #[new]
    fn new(friction: &Bound<'_, FrictionCone>, size: [f64; 2]) -> PyResult<Self> {
        let cone = robot::WrenchCone { friction: friction.get().0.clone(), size };
        cone.check().map_err(problem_error)?;
        Ok(Self(cone))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = serde_json::to_string(&slf.get().0).expect("is made of numbers and words");
        Ok((slf.get_type().getattr("_from_json")?, (text,)))
    }

    #[staticmethod]
    fn _from_json(text: &str) -> PyResult<Self> {
        let wrong = |error| ProblemError::new_err(format!("no cone: {error}"));
        let cone: robot::WrenchCone = serde_json::from_str(text).map_err(wrong)?;
        cone.check().map_err(problem_error)?;
        Ok(Self(cone))
    }

    /// Returns the matrix A, (facets + 13, 6).
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.rows().give(py, None)
    }

    /// Returns the lower and upper bounds of A w.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        pair(py, self.0.bounds())
    }
}

/// Converts lower and upper bounds to arrays.
fn pair<'py>(
    py: Python<'py>,
    (lower, upper): (Vec<f64>, Vec<f64>),
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    Ok((lower.give(py, None)?, upper.give(py, None)?))
}

/// Reads the axes of a surface in a contact's axes; returns the identity if no axes are given.
pub(super) fn surface(rotation: Option<&Bound<'_, PyAny>>) -> PyResult<Mat3<f64>> {
    rotation.map_or_else(|| Ok(Mat3::identity()), |given| arrays::rotation("rotation", given))
}
