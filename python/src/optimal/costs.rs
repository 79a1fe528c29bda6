//! Costs: activations, cones, and a constructor of `Cost` for each residual.

use super::{numbers, residuals};
use crate::arrays::output;
use crate::model::Model;
use condyle::optimal::robot;
use pyo3::prelude::*;
use robot::Residual;

/// Rows of inequalities, and their bounds.
fn rows<'py, const N: usize>(py: Python<'py>, rows: &[[f64; N]]) -> PyResult<Bound<'py, PyAny>> {
    output(py, None, &[rows.len(), N], |out| out.copy_from_slice(&rows.concat()))
}

fn pair<'py>(
    py: Python<'py>,
    (lower, upper): (Vec<f64>, Vec<f64>),
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let give = |x: &[f64]| output(py, None, &[x.len()], |out| out.copy_from_slice(x));
    Ok((give(&lower)?, give(&upper)?))
}

/// How much a residual r costs.
///
/// >>> condyle.optimal.Activation.weighted([1.0, 0.0])
/// Weighted([1.0, 0.0])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Activation(robot::Activation);

#[pymethods]
impl Activation {
    /// ½ Σ rᵢ².
    #[staticmethod]
    fn quadratic() -> Self {
        Self(robot::Activation::Quadratic)
    }

    /// ½ Σ wᵢ rᵢ².
    #[staticmethod]
    fn weighted(w: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Activation::Weighted(numbers("w", w)?)))
    }

    /// ½ Σ (excess of rᵢ over its bounds)²; infinite bounds are none.
    #[staticmethod]
    fn barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lower, upper) = (numbers("lower", lower)?, numbers("upper", upper)?);
        Ok(Self(robot::Activation::Barrier { lower, upper }))
    }

    /// ½ Σ wᵢ (excess of rᵢ over its bounds)²; Crocoddyl has the square of wᵢ in its value.
    #[staticmethod]
    fn weighted_barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>, w: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lower, upper, weights) = (numbers("lower", lower)?, numbers("upper", upper)?, numbers("w", w)?);
        Ok(Self(robot::Activation::WeightedBarrier { lower, upper, weights }))
    }

    /// Σ √(ε + rᵢ²): nearly Σ |rᵢ|.
    #[staticmethod]
    #[pyo3(signature = (epsilon=1.0))]
    fn smooth1(epsilon: f64) -> Self {
        Self(robot::Activation::Smooth1 { epsilon })
    }

    /// √(ε + ‖r‖²): nearly ‖r‖. Its Hessian is taken to be ε/a³ times the identity, the least eigenvalue of the
    /// exact one.
    #[staticmethod]
    #[pyo3(signature = (epsilon=1.0))]
    fn smooth2(epsilon: f64) -> Self {
        Self(robot::Activation::Smooth2 { epsilon })
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Coulomb's cone ‖f_t‖ ≤ μ f_n as a pyramid, and bounds on the normal force: lower ≤ A f ≤ upper.
///
/// mu: μ; facets: the pyramid's sides; inner: whether it lies inside of the cone; rotation: the surface's axes (its
/// normal is z) along the contact's, (3, 3); least, greatest: of the normal force (N).
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
        let rotation = residuals::rotation("rotation", rotation)?;
        Ok(Self(robot::FrictionCone { rotation, mu, facets, inner, least, greatest }))
    }

    /// A, (facets + 1, 3).
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, &self.0.rows())
    }

    /// The least and greatest values of A f.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        pair(py, self.0.bounds())
    }
}

/// Friction, the centre of pressure within a rectangle, and the yaw moment: lower ≤ A w ≤ upper.
///
/// friction: a `FrictionCone`; size: the rectangle's sides along the surface's x and y (m).
///
/// >>> from condyle.optimal import FrictionCone, WrenchCone
/// >>> WrenchCone(FrictionCone(0.7), [0.2, 0.1]).rows().shape
/// (17, 6)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct WrenchCone(pub(super) robot::WrenchCone);

#[pymethods]
impl WrenchCone {
    #[new]
    fn new(friction: &Bound<'_, FrictionCone>, size: [f64; 2]) -> Self {
        Self(robot::WrenchCone { friction: friction.get().0.clone(), size })
    }

    /// A, (facets + 13, 6).
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, &self.0.rows())
    }

    /// The least and greatest values of A w.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        pair(py, self.0.bounds())
    }
}

/// A term of a cost: weight times an activation of a residual. The activation is quadratic unless given.
///
/// >>> condyle.optimal.Cost.control("effort", 1e-3, [0.0] * 7)
/// <condyle.optimal.Cost 'effort', weight 0.001>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Cost(pub(super) robot::Cost);

impl Cost {
    fn make(name: &str, weight: f64, residual: Residual, activation: Option<&Bound<'_, Activation>>) -> Self {
        let activation = activation.map_or(robot::Activation::Quadratic, |a| a.get().0.clone());
        Self(robot::Cost::new(name, weight, residual, activation))
    }
}

#[pymethods]
impl Cost {
    /// r = x ⊖ reference, 2 nv numbers; reference = (q, v).
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn state(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::state(reference)?, activation))
    }

    /// r = u − reference, nu numbers.
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn control(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::control(reference)?, activation))
    }

    /// r = τ − g(q) + Jᵀλ, nv numbers: the efforts and forces beyond those that hold the robot still.
    #[staticmethod]
    #[pyo3(signature = (name, weight, activation=None))]
    fn control_gravity(name: &str, weight: f64, activation: Option<&Bound<'_, Activation>>) -> Self {
        Self::make(name, weight, Residual::ControlGravity, activation)
    }

    /// r = τ − reference, the efforts of all joints, nv numbers.
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn joint_effort(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::joint_effort(reference)?, activation))
    }

    /// r = q̈ − reference, nv numbers.
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn joint_acceleration(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::joint_acceleration(reference)?, activation))
    }

    /// r = c − target, 3 numbers in the world, of the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, weight, target, activation=None))]
    fn center_of_mass(
        name: &str,
        weight: f64,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::center_of_mass(target)?, activation))
    }

    /// r = h − target, 6 numbers along the world's axes, linear first, of the momentum about the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, weight, target=None, activation=None))]
    fn centroidal_momentum(
        name: &str,
        weight: f64,
        target: Option<&Bound<'_, PyAny>>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::centroidal_momentum(target)?, activation))
    }

    /// r = log(target⁻¹ oMf), 6 numbers, of a frame of the model; target is a homogeneous 4 × 4 matrix.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target, activation=None))]
    fn frame_placement(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::frame_placement(model, frame, target)?, activation))
    }

    /// r = p − target, 3 numbers in the world, of the origin of a frame of the model.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target, activation=None))]
    fn frame_translation(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::frame_translation(model, frame, target)?, activation))
    }

    /// r = log(targetᵀ R), 3 numbers, of the axes of a frame of the model; target is a 3 × 3 matrix.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target, activation=None))]
    fn frame_rotation(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::frame_rotation(model, frame, target)?, activation))
    }

    /// r = v − target, 6 numbers, linear first, of a frame of the model; reference: 'local', 'world' or
    /// 'local_world_aligned'.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target=None, reference="local", activation=None))]
    fn frame_velocity(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        reference: &str,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::frame_velocity(model, frame, target, reference)?, activation))
    }

    /// r = λ − target, the force or impulse of a contact along its rows' axes: 3 or 6 numbers; target has 6.
    #[staticmethod]
    #[pyo3(signature = (name, weight, contact, target=None, activation=None))]
    fn contact_force(
        name: &str,
        weight: f64,
        contact: String,
        target: Option<&Bound<'_, PyAny>>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        Ok(Self::make(name, weight, residuals::contact_force(contact, target)?, activation))
    }

    /// r = A f of a contact's force, and by default the barrier of the cone's bounds.
    #[staticmethod]
    #[pyo3(signature = (name, weight, contact, cone, activation=None))]
    fn friction_cone(
        name: &str,
        weight: f64,
        contact: String,
        cone: &Bound<'_, FrictionCone>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> Self {
        let cone = cone.get().0.clone();
        let (lower, upper) = cone.bounds();
        let activation = activation.map_or(robot::Activation::Barrier { lower, upper }, |a| a.get().0.clone());
        Self(robot::Cost::new(name, weight, Residual::FrictionCone { contact, cone }, activation))
    }

    /// r = A w of a rigid contact's wrench, and by default the barrier of the cone's bounds.
    #[staticmethod]
    #[pyo3(signature = (name, weight, contact, cone, activation=None))]
    fn wrench_cone(
        name: &str,
        weight: f64,
        contact: String,
        cone: &Bound<'_, WrenchCone>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> Self {
        let cone = cone.get().0.clone();
        let (lower, upper) = cone.bounds();
        let activation = activation.map_or(robot::Activation::Barrier { lower, upper }, |a| a.get().0.clone());
        Self(robot::Cost::new(name, weight, Residual::WrenchCone { contact, cone }, activation))
    }

    /// Four numbers of a rigid contact that are not above 0 while the centre of pressure is inside a rectangle, and
    /// by default the barrier above 0.
    ///
    /// size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes along the contact's,
    /// (3, 3).
    #[staticmethod]
    #[pyo3(signature = (name, weight, contact, size, rotation=None, activation=None))]
    fn center_of_pressure(
        name: &str,
        weight: f64,
        contact: String,
        size: [f64; 2],
        rotation: Option<&Bound<'_, PyAny>>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        let bounds = robot::Activation::Barrier { lower: vec![f64::NEG_INFINITY; 4], upper: vec![0.0; 4] };
        let activation = activation.map_or(bounds, |a| a.get().0.clone());
        Ok(Self(robot::Cost::new(name, weight, residuals::center_of_pressure(contact, size, rotation)?, activation)))
    }

    /// r = J_c (v⁺ − v), 3 numbers: by how much an impact changes the velocity of the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (name, weight, activation=None))]
    fn impulse_center_of_mass(name: &str, weight: f64, activation: Option<&Bound<'_, Activation>>) -> Self {
        Self::make(name, weight, Residual::ImpulseCenterOfMass, activation)
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Cost '{}', weight {}>", self.0.name, self.0.weight)
    }
}
