//! Contacts between a robot and its environment.

use crate::arrays::{Give, array, matrix, three};
use crate::exceptions::wrong_word;
use condyle::Vec3;
use condyle::wholebody as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rust::{Normal, Shape, SurfaceForces};

/// A contact with friction: the frame that touches the environment is held, and each contact force lies in the cone
/// ‖f_t‖ ≤ μ f_n, with the tangential part f_t and the normal component f_n of the force.
///
/// `ContactTarget.activation` defines at each tick whether the contact touches, and which fraction of the full load the
/// contact carries. The constructor of `WholeBodyController` checks the numbers.
///
/// Common arguments: frame: the name of a frame of the robot. friction: μ, the Coulomb coefficient, above 0. min_force,
/// max_force: bounds on the normal force of the whole contact (N).
///
/// >>> from condyle.wholebody import FrictionContact
/// >>> FrictionContact.sole("left_sole", 0.7, [0.2, 0.1]).corners.shape
/// (4, 3)
#[pyclass(frozen, eq, module = "condyle.wholebody")]
#[derive(Clone, PartialEq)]
pub(crate) struct FrictionContact(pub(super) rust::FrictionContact);

/// Reads the representation of the force on a surface.
fn forces(given: &str) -> PyResult<SurfaceForces> {
    match given {
        "wrench" => Ok(SurfaceForces::Wrench),
        "corners" => Ok(SurfaceForces::Corners),
        other => Err(wrong_word("forces", "'wrench' or 'corners'", other)),
    }
}

fn upwards(normal: Option<&Bound<'_, PyAny>>) -> PyResult<Vec3<f64>> {
    normal.map_or_else(|| Ok(Vec3::new(0.0, 0.0, 1.0)), |normal| three("normal", normal))
}

#[pymethods]
impl FrictionContact {
    /// Returns a point contact: the frame's origin is held, and the frame may turn about its origin.
    ///
    /// normal: the direction in which the environment pushes, 3 numbers of any nonzero length; None is the z axis, for
    /// level ground. axes: the axes of the normal: 'world' for a constant normal, or 'frame' for a normal that turns
    /// with the frame.
    #[staticmethod]
    #[pyo3(signature = (frame, friction, normal=None, axes="world", min_force=0.0, max_force=f64::INFINITY))]
    fn point(
        frame: String,
        friction: f64,
        normal: Option<&Bound<'_, PyAny>>,
        axes: &str,
        min_force: f64,
        max_force: f64,
    ) -> PyResult<Self> {
        let normal = upwards(normal)?;
        let normal = match axes {
            "world" => Normal::World(normal),
            "frame" => Normal::Frame(normal),
            other => return Err(wrong_word("axes", "'world' or 'frame'", other)),
        };
        let shape = Shape::Point;
        Ok(Self(rust::FrictionContact { frame, shape, normal, friction, yaw_friction: None, min_force, max_force }))
    }

    /// Returns an edge contact (two corners: the frame may turn about the edge) or a convex polygon (three or more
    /// corners: the frame is held).
    ///
    /// corners: positions in the frame (m), (n, 3), in order around the polygon, in one plane perpendicular to the
    ///     normal.
    /// forces: 'wrench', one force with one friction cone, a centre of pressure within the polygon and a bounded moment
    ///     about the normal; or 'corners', a force with a friction cone at each corner.
    /// normal: the direction in which the environment pushes, in the frame's axes, 3 numbers of any nonzero length;
    ///     None is the z axis.
    /// yaw_friction: γ (m): the moment of a wrench about the normal is at most γ f_n, with the normal force f_n. For a
    ///     polygon, None means ⅔ μ r, where r is the radius of the largest circle in the polygon about the mean of the
    ///     corners. For an edge of length 2 l, None means ½ μ l.
    #[staticmethod]
    #[pyo3(signature = (
        frame, friction, corners, forces="wrench", normal=None, yaw_friction=None, min_force=0.0, max_force=f64::INFINITY
    ))]
    fn surface(
        frame: String,
        friction: f64,
        corners: &Bound<'_, PyAny>,
        forces: &str,
        normal: Option<&Bound<'_, PyAny>>,
        yaw_friction: Option<f64>,
        min_force: f64,
        max_force: f64,
    ) -> PyResult<Self> {
        let count = corners.len().map_err(|_| PyValueError::new_err("corners: expected a list of points"))?;
        let numbers = matrix("corners", corners, [count, 3])?;
        let corners = numbers.as_chunks::<3>().0.iter().map(|&corner| corner.into()).collect();
        let shape = Shape::Surface { corners, forces: self::forces(forces)? };
        let normal = Normal::Frame(upwards(normal)?);
        Ok(Self(rust::FrictionContact { frame, shape, normal, friction, yaw_friction, min_force, max_force }))
    }

    /// Returns a contact of a rectangular sole about the frame's origin, whose normal is the frame's z axis.
    ///
    /// size: the sides of the sole along the frame's x and y (m); forces, yaw_friction: as for `surface`.
    #[staticmethod]
    #[pyo3(signature = (
        frame, friction, size, forces="wrench", yaw_friction=None, min_force=0.0, max_force=f64::INFINITY
    ))]
    fn sole(
        frame: &str,
        friction: f64,
        size: &Bound<'_, PyAny>,
        forces: &str,
        yaw_friction: Option<f64>,
        min_force: f64,
        max_force: f64,
    ) -> PyResult<Self> {
        let sole = rust::FrictionContact::sole(frame, friction, array("size", size)?);
        let sole = if self::forces(forces)? == SurfaceForces::Corners { sole.by_corners() } else { sole };
        Ok(Self(rust::FrictionContact { yaw_friction, min_force, max_force, ..sole }))
    }

    /// The name of the contact's frame.
    #[getter]
    fn frame(&self) -> &str {
        &self.0.frame
    }

    /// The corners of a surface in the frame (m), (n, 3); None for a point.
    #[getter]
    fn corners<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Shape::Surface { corners, .. } = &self.0.shape else { return Ok(None) };
        corners.iter().map(|corner| corner.to_array()).collect::<Vec<_>>().give(py, None).map(Some)
    }

    /// The representation of the force on a surface: 'wrench' or 'corners'; None for a point.
    #[getter]
    fn forces(&self) -> Option<&'static str> {
        match self.0.shape {
            Shape::Surface { forces: SurfaceForces::Wrench, .. } => Some("wrench"),
            Shape::Surface { forces: SurfaceForces::Corners, .. } => Some("corners"),
            _ => None,
        }
    }

    /// The direction in which the environment pushes, 3 numbers.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.normal.direction().give(py, None)
    }

    /// The axes along which the normal is given: 'world' or 'frame'.
    #[getter]
    fn axes(&self) -> &'static str {
        if matches!(self.0.normal, Normal::World(_)) { "world" } else { "frame" }
    }

    /// The friction coefficient μ.
    #[getter]
    fn friction(&self) -> f64 {
        self.0.friction
    }

    /// The bound γ of the yaw moment (m); None for the default.
    #[getter]
    fn yaw_friction(&self) -> Option<f64> {
        self.0.yaw_friction
    }

    /// The minimum normal force (N).
    #[getter]
    fn min_force(&self) -> f64 {
        self.0.min_force
    }

    /// The maximum normal force (N).
    #[getter]
    fn max_force(&self) -> f64 {
        self.0.max_force
    }

    /// Returns the constructor and the arguments from which `pickle` makes an equal contact.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let rust::FrictionContact { frame, friction, yaw_friction, min_force, max_force, .. } = &this.0;
        let normal = this.normal(py)?;
        let (name, arguments) = match this.corners(py)? {
            None => {
                ("point", (frame, friction, normal, this.axes(), min_force, max_force).into_pyobject(py)?.into_any())
            }
            Some(corners) => {
                let forces = this.forces();
                let all = (frame, friction, corners, forces, normal, yaw_friction, min_force, max_force);
                ("surface", all.into_pyobject(py)?.into_any())
            }
        };
        Ok((slf.get_type().getattr(name)?, arguments))
    }

    fn __repr__(&self) -> String {
        let kind = match &self.0.shape {
            Shape::Surface { corners, .. } => format!("{} corners", corners.len()),
            _ => "point".to_owned(),
        };
        format!("<condyle.wholebody.FrictionContact '{}', {kind}, friction {}>", self.0.frame, self.0.friction)
    }
}
