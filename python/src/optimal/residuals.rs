//! Residuals, and the cones that some of them look at.

use super::numbers;
use crate::arrays::{matrix, output, pose, three, vector};
use crate::functions::{Argument, Reference};
use crate::model::{Model, frame_index};
use condyle::optimal::robot;
use condyle::{Force, Mat3, Motion};
use pyo3::prelude::*;

/// A vector r(x, u) of a robot that a `Cost` makes small and that a `Limit` bounds.
///
/// A frame is given by its name or number, a contact by the name that it has in `ContactDynamics` or `ImpulseDynamics`.
/// What a method does not ask for, a reference, a target or a rotation, is zero or the identity.
///
/// >>> from condyle.optimal import Residual
/// >>> Residual.center_of_mass([0.4, 0.2, 0.5])
/// <condyle.optimal.Residual {"center_of_mass":{"target":{"x":0.4,"y":0.2,"z":0.5}}}>
#[pyclass(frozen, eq, module = "condyle.optimal")]
#[derive(PartialEq)]
pub(crate) struct Residual(pub(super) robot::Residual);

#[pymethods]
impl Residual {
    /// r = x ⊖ reference, 2 nv numbers; reference = (q, v).
    #[staticmethod]
    fn state(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Residual::State { reference: numbers("reference", reference)? }))
    }

    /// r = u − reference, nu numbers.
    #[staticmethod]
    fn control(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Residual::Control { reference: numbers("reference", reference)? }))
    }

    /// r = τ − g(q) + Jᵀλ, nv numbers: the efforts and forces beyond those that hold the robot still.
    #[staticmethod]
    fn control_gravity() -> Self {
        Self(robot::Residual::ControlGravity)
    }

    /// r = τ − reference, the efforts of all joints, nv numbers.
    #[staticmethod]
    fn joint_effort(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Residual::JointEffort { reference: numbers("reference", reference)? }))
    }

    /// r = q̈ − reference, nv numbers.
    #[staticmethod]
    fn joint_acceleration(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Residual::JointAcceleration { reference: numbers("reference", reference)? }))
    }

    /// r = c − target, 3 numbers in the world, of the centre of mass (m).
    #[staticmethod]
    fn center_of_mass(target: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Residual::CenterOfMass { target: three("target", target)? }))
    }

    /// r = h − target, 6 numbers along the world's axes, linear first, of the momentum about the centre of mass.
    #[staticmethod]
    #[pyo3(signature = (target=None))]
    fn centroidal_momentum(target: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self(robot::Residual::CentroidalMomentum { target: Force::from(six("target", target)?) }))
    }

    /// r = log(target⁻¹ oMf), 6 numbers, of a frame of the model; target is a homogeneous 4 × 4 matrix.
    #[staticmethod]
    fn frame_placement(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_index(&model.get().inner, frame)?, pose("target", target)?);
        Ok(Self(robot::Residual::FramePlacement { frame, target }))
    }

    /// r = p − target, 3 numbers in the world, of the origin of a frame of the model (m).
    #[staticmethod]
    fn frame_translation(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_index(&model.get().inner, frame)?, three("target", target)?);
        Ok(Self(robot::Residual::FrameTranslation { frame, target }))
    }

    /// r = log(targetᵀ R), 3 numbers, of the axes of a frame of the model; target is a 3 × 3 matrix.
    #[staticmethod]
    fn frame_rotation(model: &Bound<'_, Model>, frame: &Bound<'_, PyAny>, target: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (frame, target) = (frame_index(&model.get().inner, frame)?, rotation("target", Some(target))?);
        Ok(Self(robot::Residual::FrameRotation { frame, target }))
    }

    /// r = v − target, 6 numbers, linear first, of a frame of the model; reference: 'local', 'world' or
    /// 'local_world_aligned'.
    #[staticmethod]
    #[pyo3(signature = (model, frame, target=None, reference="local"))]
    fn frame_velocity(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        reference: &str,
    ) -> PyResult<Self> {
        let model = &model.get().inner;
        let (frame, target) = (frame_index(model, frame)?, Motion::from(six("target", target)?));
        let reference = Reference::read("reference", reference, model)?;
        Ok(Self(robot::Residual::FrameVelocity { frame, target, reference }))
    }

    /// r = λ − target, the force or impulse of a contact along its rows' axes: 3 or 6 numbers; target has 6.
    #[staticmethod]
    #[pyo3(signature = (contact, target=None))]
    fn contact_force(contact: String, target: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self(robot::Residual::ContactForce { contact, target: Force::from(six("target", target)?) }))
    }

    /// r = A f of a contact's force f, within the bounds of the cone.
    #[staticmethod]
    fn friction_cone(contact: String, cone: &Bound<'_, FrictionCone>) -> Self {
        Self(robot::Residual::FrictionCone { contact, cone: cone.get().0.clone() })
    }

    /// r = A w of a rigid contact's wrench w, within the bounds of the cone.
    #[staticmethod]
    fn wrench_cone(contact: String, cone: &Bound<'_, WrenchCone>) -> Self {
        Self(robot::Residual::WrenchCone { contact, cone: cone.get().0.clone() })
    }

    /// Four numbers of a rigid contact that are not above 0 while the centre of pressure is inside a rectangle.
    ///
    /// size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes along the contact's,
    /// (3, 3).
    #[staticmethod]
    #[pyo3(signature = (contact, size, rotation=None))]
    fn center_of_pressure(contact: String, size: [f64; 2], rotation: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self(robot::Residual::CenterOfPressure { contact, rotation: self::rotation("rotation", rotation)?, size }))
    }

    /// r = J_c (v⁺ − v), 3 numbers: by how much an impact changes the velocity of the centre of mass (m/s).
    #[staticmethod]
    fn impulse_center_of_mass() -> Self {
        Self(robot::Residual::ImpulseCenterOfMass)
    }

    /// The residual as the JSON of a problem has it.
    fn __repr__(&self) -> String {
        let json = serde_json::to_string(&self.0).expect("is made of numbers and words");
        format!("<condyle.optimal.Residual {json}>")
    }
}

impl Residual {
    /// The bounds that the residual has by itself: those of a cone, or of a centre of pressure.
    pub(super) fn bounds(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        match &self.0 {
            robot::Residual::FrictionCone { cone, .. } => Some(cone.bounds()),
            robot::Residual::WrenchCone { cone, .. } => Some(cone.bounds()),
            robot::Residual::CenterOfPressure { .. } => Some((vec![f64::NEG_INFINITY; 4], vec![0.0; 4])),
            _ => None,
        }
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
pub(crate) struct FrictionCone(robot::FrictionCone);

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
        let rotation = self::rotation("rotation", rotation)?;
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
pub(crate) struct WrenchCone(robot::WrenchCone);

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

/// A rotation as a 3 × 3 matrix; the identity if there is none.
fn rotation(argument: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Mat3<f64>> {
    let Some(value) = value else { return Ok(Mat3::identity()) };
    let m = matrix(argument, value, [3, 3])?;
    let column = |c: usize| [m[c], m[3 + c], m[6 + c]].into();
    Ok(Mat3 { x: column(0), y: column(1), z: column(2) })
}

/// Six numbers, linear first; zeros if there are none.
fn six(argument: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 6]> {
    let Some(value) = value else { return Ok([0.0; 6]) };
    let x = vector(argument, value, 6)?;
    Ok(core::array::from_fn(|k| x[k]))
}
