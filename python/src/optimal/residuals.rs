//! Residuals of costs and limits, from what Python gives of them.

use super::numbers;
use crate::arrays::{matrix, pose, three, vector};
use crate::functions::{Argument, Reference};
use crate::model::{Model, frame_index};
use condyle::optimal::robot::Residual;
use condyle::{Force, Mat3, Motion};
use pyo3::prelude::*;

/// A rotation as a 3 × 3 matrix; the identity if there is none.
pub(super) fn rotation(argument: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Mat3<f64>> {
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

pub(super) fn state(reference: &Bound<'_, PyAny>) -> PyResult<Residual> {
    Ok(Residual::State { reference: numbers("reference", reference)? })
}

pub(super) fn control(reference: &Bound<'_, PyAny>) -> PyResult<Residual> {
    Ok(Residual::Control { reference: numbers("reference", reference)? })
}

pub(super) fn joint_effort(reference: &Bound<'_, PyAny>) -> PyResult<Residual> {
    Ok(Residual::JointEffort { reference: numbers("reference", reference)? })
}

pub(super) fn joint_acceleration(reference: &Bound<'_, PyAny>) -> PyResult<Residual> {
    Ok(Residual::JointAcceleration { reference: numbers("reference", reference)? })
}

pub(super) fn center_of_mass(target: &Bound<'_, PyAny>) -> PyResult<Residual> {
    Ok(Residual::CenterOfMass { target: three("target", target)? })
}

pub(super) fn centroidal_momentum(target: Option<&Bound<'_, PyAny>>) -> PyResult<Residual> {
    Ok(Residual::CentroidalMomentum { target: Force::from(six("target", target)?) })
}

pub(super) fn frame_placement(
    model: &Bound<'_, Model>,
    frame: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
) -> PyResult<Residual> {
    let target = pose("target", target)?;
    Ok(Residual::FramePlacement { frame: frame_index(&model.get().inner, frame)?, target })
}

pub(super) fn frame_translation(
    model: &Bound<'_, Model>,
    frame: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
) -> PyResult<Residual> {
    let target = three("target", target)?;
    Ok(Residual::FrameTranslation { frame: frame_index(&model.get().inner, frame)?, target })
}

pub(super) fn frame_rotation(
    model: &Bound<'_, Model>,
    frame: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
) -> PyResult<Residual> {
    let target = rotation("target", Some(target))?;
    Ok(Residual::FrameRotation { frame: frame_index(&model.get().inner, frame)?, target })
}

pub(super) fn frame_velocity(
    model: &Bound<'_, Model>,
    frame: &Bound<'_, PyAny>,
    target: Option<&Bound<'_, PyAny>>,
    reference: &str,
) -> PyResult<Residual> {
    let target = Motion::from(six("target", target)?);
    let model = &model.get().inner;
    let (frame, reference) = (frame_index(model, frame)?, Reference::read("reference", reference, model)?);
    Ok(Residual::FrameVelocity { frame, target, reference })
}

pub(super) fn contact_force(contact: String, target: Option<&Bound<'_, PyAny>>) -> PyResult<Residual> {
    Ok(Residual::ContactForce { contact, target: Force::from(six("target", target)?) })
}

pub(super) fn center_of_pressure(
    contact: String,
    size: [f64; 2],
    rotation: Option<&Bound<'_, PyAny>>,
) -> PyResult<Residual> {
    Ok(Residual::CenterOfPressure { contact, rotation: self::rotation("rotation", rotation)?, size })
}
