//! The class `Joint`, and the words for the kinds of joints.

use crate::arrays::{Give, three};
use crate::exceptions::wrong_word;
use condyle::Vec3;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The kind of a joint, with its axis and pitch if the joint has these.
///
/// | | q | v |
/// | --- | --- | --- |
/// | `revolute`, `prismatic`, `helical` | 1 | 1: about, along the axis |
/// | `continuous` | 2: cos θ, sin θ | 1 |
/// | `spherical` | 4: quaternion x, y, z, w | 3: angular, in the body |
/// | `planar` | 4: x, y, cos θ, sin θ | 3: ẋ, ẏ in the body, θ̇ |
/// | `translation` | 3 | 3 |
/// | `free_flyer` | 7: position, quaternion | 6: linear, angular, in the body |
///
/// An axis is a vector in the body's frame, of any nonzero length.
///
/// >>> condyle.Joint.helical([0.0, 0.0, 1.0], pitch=0.1).nv
/// 1
#[pyclass(frozen, module = "condyle")]
pub(crate) struct Joint(pub(crate) condyle::Joint);

#[pymethods]
impl Joint {
    /// Returns a joint with one angle about an axis: q = [θ], v = [θ̇].
    #[staticmethod]
    fn revolute(axis: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(condyle::Joint::Revolute { axis: three("axis", axis)? }))
    }

    /// Returns a joint with one angle about an axis, without limits: q = [cos θ, sin θ], v = [θ̇].
    #[staticmethod]
    fn continuous(axis: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(condyle::Joint::Continuous { axis: three("axis", axis)? }))
    }

    /// Returns a joint with one length along an axis: q = [d], v = [ḋ].
    #[staticmethod]
    fn prismatic(axis: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(condyle::Joint::Prismatic { axis: three("axis", axis)? }))
    }

    /// Returns a screw joint: q = [θ], v = [θ̇], with a translation along the axis of `pitch` metres per radian.
    #[staticmethod]
    fn helical(axis: &Bound<'_, PyAny>, pitch: f64) -> PyResult<Self> {
        Ok(Self(condyle::Joint::Helical { axis: three("axis", axis)?, pitch }))
    }

    /// Returns a ball joint: q = quaternion (x, y, z, w), v = angular velocity in the body's frame.
    #[staticmethod]
    fn spherical() -> Self {
        Self(condyle::Joint::Spherical)
    }

    /// Returns a joint that moves in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇].
    #[staticmethod]
    fn planar() -> Self {
        Self(condyle::Joint::Planar)
    }

    /// Returns a joint with three lengths: q = [x, y, z], v = q̇.
    #[staticmethod]
    fn translation() -> Self {
        Self(condyle::Joint::Translation)
    }

    /// Returns a joint that does not restrict the motion of its body: q = [position, quaternion (x, y, z, w)], v =
    /// [linear, angular] in the body's frame.
    #[staticmethod]
    fn free_flyer() -> Self {
        Self(condyle::Joint::FreeFlyer)
    }

    /// The number of coordinates of the joint in q.
    #[getter]
    fn nq(&self) -> usize {
        self.0.nq()
    }

    /// The number of degrees of freedom of the joint, which is the number of its coordinates in v.
    #[getter]
    fn nv(&self) -> usize {
        self.0.nv()
    }

    /// The axis, 3 numbers in the body's frame; a unit vector in a model. None if the joint has no axis.
    #[getter]
    fn axis<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.0.axis().map(|axis| axis.give(py, None)).transpose()
    }

    /// The translation along the axis per rotation about the axis (m/rad); None unless the joint is helical.
    #[getter]
    fn pitch(&self) -> Option<f64> {
        if let condyle::Joint::Helical { pitch, .. } = self.0 { Some(pitch) } else { None }
    }

    /// Returns the kind and the axis as text.
    fn __repr__(&self) -> String {
        let axis = self.0.axis().map_or(String::new(), |a| format!(" about or along {:?}", a.to_array()));
        format!("<condyle.Joint {}{axis}>", kind(self.0))
    }

    /// Returns the method and the arguments from which `pickle` makes an equal joint.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, joint) = (slf.py(), slf.get().0);
        let axis = joint.axis().map(Vec3::to_array);
        let arguments = match (joint, axis) {
            (condyle::Joint::Helical { pitch, .. }, Some(axis)) => (axis, pitch).into_pyobject(py)?,
            (_, Some(axis)) => (axis,).into_pyobject(py)?,
            (_, None) => PyTuple::empty(py),
        };
        Ok((slf.get_type().getattr(kind(joint))?, arguments).into_pyobject(py)?.into_any())
    }
}

/// Returns the word for the kind of a joint.
pub(crate) fn kind(joint: condyle::Joint) -> &'static str {
    match joint {
        condyle::Joint::Revolute { .. } => "revolute",
        condyle::Joint::Continuous { .. } => "continuous",
        condyle::Joint::Prismatic { .. } => "prismatic",
        condyle::Joint::Helical { .. } => "helical",
        condyle::Joint::Spherical => "spherical",
        condyle::Joint::Planar => "planar",
        condyle::Joint::Translation => "translation",
        condyle::Joint::FreeFlyer => "free_flyer",
        _ => "other",
    }
}

/// Returns the joint between the world and the root link that the word `root_joint` names; `None` for a fixed root
/// link.
pub(crate) fn root(root_joint: Option<&str>) -> PyResult<Option<condyle::Joint>> {
    match root_joint {
        None => Ok(None),
        Some("free_flyer") => Ok(Some(condyle::Joint::FreeFlyer)),
        Some("planar") => Ok(Some(condyle::Joint::Planar)),
        Some("spherical") => Ok(Some(condyle::Joint::Spherical)),
        Some("translation") => Ok(Some(condyle::Joint::Translation)),
        Some(other) => {
            Err(wrong_word("root_joint", "None, 'free_flyer', 'planar', 'spherical' or 'translation'", other))
        }
    }
}
