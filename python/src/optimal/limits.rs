//! Limits: a constructor of `Limit` for each residual.

use super::costs::{FrictionCone, WrenchCone};
use super::{numbers, residuals};
use crate::model::Model;
use condyle::optimal::robot;
use pyo3::prelude::*;
use robot::Residual;

/// A residual r of a robot within bounds, lower ≤ r ≤ upper, which `AugmentedLagrangian` holds.
///
/// lower, upper: as many numbers as r has, infinite where there is no bound; a missing one is no bound. Without both
/// r = 0; entries where both are equal are equalities too. Limits hold at the beginning of a knot. To `Fddp` alone they
/// are costs for leaving the bounds.
///
/// >>> condyle.optimal.Limit.control("effort", [0.0] * 7, lower=[-30.0] * 7, upper=[30.0] * 7)
/// <condyle.optimal.Limit 'effort'>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Limit(pub(super) robot::Limit);

/// A bound given from Python.
type Bounds<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

impl Limit {
    fn make(name: &str, residual: Residual, lower: Bounds<'_, '_>, upper: Bounds<'_, '_>) -> PyResult<Self> {
        let read = |name, given: Bounds<'_, '_>| given.map(|given| numbers(name, given)).transpose();
        let (lower, upper) = match (read("lower", lower)?, read("upper", upper)?) {
            (Some(lower), Some(upper)) => (lower, upper),
            (Some(lower), None) => (lower.clone(), vec![f64::INFINITY; lower.len()]),
            (None, Some(upper)) => (vec![f64::NEG_INFINITY; upper.len()], upper),
            (None, None) => return Ok(Self(robot::Limit::equality(name, residual))),
        };
        Ok(Self(robot::Limit::new(name, residual, lower, upper)))
    }
}

#[pymethods]
impl Limit {
    /// r = x ⊖ reference, 2 nv numbers; reference = (q, v).
    #[staticmethod]
    #[pyo3(signature = (name, reference, lower=None, upper=None))]
    fn state(name: &str, reference: &Bound<'_, PyAny>, lower: Bounds<'_, '_>, upper: Bounds<'_, '_>) -> PyResult<Self> {
        Self::make(name, residuals::state(reference)?, lower, upper)
    }

    /// r = u − reference, nu numbers.
    #[staticmethod]
    #[pyo3(signature = (name, reference, lower=None, upper=None))]
    fn control(
        name: &str,
        reference: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::control(reference)?, lower, upper)
    }

    /// r = τ − g(q) + Jᵀλ, nv numbers: the efforts and forces beyond those that hold the robot still.
    #[staticmethod]
    #[pyo3(signature = (name, lower=None, upper=None))]
    fn control_gravity(name: &str, lower: Bounds<'_, '_>, upper: Bounds<'_, '_>) -> PyResult<Self> {
        Self::make(name, Residual::ControlGravity, lower, upper)
    }

    /// r = τ − reference, the efforts of all joints, nv numbers.
    #[staticmethod]
    #[pyo3(signature = (name, reference, lower=None, upper=None))]
    fn joint_effort(
        name: &str,
        reference: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::joint_effort(reference)?, lower, upper)
    }

    /// r = q̈ − reference, nv numbers.
    #[staticmethod]
    #[pyo3(signature = (name, reference, lower=None, upper=None))]
    fn joint_acceleration(
        name: &str,
        reference: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::joint_acceleration(reference)?, lower, upper)
    }

    /// r = c − target, 3 numbers in the world, of the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, target, lower=None, upper=None))]
    fn center_of_mass(
        name: &str,
        target: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::center_of_mass(target)?, lower, upper)
    }

    /// r = h − target, 6 numbers along the world's axes, linear first, of the momentum about the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, target=None, lower=None, upper=None))]
    fn centroidal_momentum(
        name: &str,
        target: Option<&Bound<'_, PyAny>>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::centroidal_momentum(target)?, lower, upper)
    }

    /// r = log(target⁻¹ oMf), 6 numbers, of a frame of the model; target is a homogeneous 4 × 4 matrix.
    #[staticmethod]
    #[pyo3(signature = (name, model, frame, target, lower=None, upper=None))]
    fn frame_placement(
        name: &str,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::frame_placement(model, frame, target)?, lower, upper)
    }

    /// r = p − target, 3 numbers in the world, of the origin of a frame of the model.
    #[staticmethod]
    #[pyo3(signature = (name, model, frame, target, lower=None, upper=None))]
    fn frame_translation(
        name: &str,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::frame_translation(model, frame, target)?, lower, upper)
    }

    /// r = log(targetᵀ R), 3 numbers, of the axes of a frame of the model; target is a 3 × 3 matrix.
    #[staticmethod]
    #[pyo3(signature = (name, model, frame, target, lower=None, upper=None))]
    fn frame_rotation(
        name: &str,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::frame_rotation(model, frame, target)?, lower, upper)
    }

    /// r = v − target, 6 numbers, linear first, of a frame of the model; reference: 'local', 'world' or
    /// 'local_world_aligned'.
    #[staticmethod]
    #[pyo3(signature = (name, model, frame, target=None, reference="local", lower=None, upper=None))]
    fn frame_velocity(
        name: &str,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        reference: &str,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::frame_velocity(model, frame, target, reference)?, lower, upper)
    }

    /// r = λ − target, the force or impulse of a contact along its rows' axes: 3 or 6 numbers; target has 6.
    #[staticmethod]
    #[pyo3(signature = (name, contact, target=None, lower=None, upper=None))]
    fn contact_force(
        name: &str,
        contact: String,
        target: Option<&Bound<'_, PyAny>>,
        lower: Bounds<'_, '_>,
        upper: Bounds<'_, '_>,
    ) -> PyResult<Self> {
        Self::make(name, residuals::contact_force(contact, target)?, lower, upper)
    }

    /// r = A f of a contact's force, within the cone's bounds.
    #[staticmethod]
    fn friction_cone(name: &str, contact: String, cone: &Bound<'_, FrictionCone>) -> Self {
        let cone = cone.get().0.clone();
        let (lower, upper) = cone.bounds();
        Self(robot::Limit::new(name, Residual::FrictionCone { contact, cone }, lower, upper))
    }

    /// r = A w of a rigid contact's wrench, within the cone's bounds.
    #[staticmethod]
    fn wrench_cone(name: &str, contact: String, cone: &Bound<'_, WrenchCone>) -> Self {
        let cone = cone.get().0.clone();
        let (lower, upper) = cone.bounds();
        Self(robot::Limit::new(name, Residual::WrenchCone { contact, cone }, lower, upper))
    }

    /// The centre of pressure of a rigid contact inside a rectangle: four numbers not above 0.
    ///
    /// size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes along the contact's,
    /// (3, 3).
    #[staticmethod]
    #[pyo3(signature = (name, contact, size, rotation=None))]
    fn center_of_pressure(
        name: &str,
        contact: String,
        size: [f64; 2],
        rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let residual = residuals::center_of_pressure(contact, size, rotation)?;
        Ok(Self(robot::Limit::new(name, residual, vec![f64::NEG_INFINITY; 4], vec![0.0; 4])))
    }

    /// r = J_c (v⁺ − v), 3 numbers: by how much an impact changes the velocity of the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, lower=None, upper=None))]
    fn impulse_center_of_mass(name: &str, lower: Bounds<'_, '_>, upper: Bounds<'_, '_>) -> PyResult<Self> {
        Self::make(name, Residual::ImpulseCenterOfMass, lower, upper)
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Limit '{}'>", self.0.name)
    }
}
