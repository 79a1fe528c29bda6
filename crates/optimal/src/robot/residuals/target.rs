//! Targets of residuals: reference values, which can be read and changed in place.

use super::residual::Residual;
use condyle_dynamics::{Force, Mat3, Model, Motion, Se3, Vec3};

/// Target of a [`Residual`]: the value with which the residual compares the value of the robot.
///
/// ```
/// use condyle_dynamics::Vec3;
/// use condyle_optimal::robot::{Residual, Target};
/// let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
/// assert_eq!(reach.target(), Some(Target::Position(Vec3::new(0.4, 0.2, 0.5))));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Target<'a> {
    /// Reference of a state (nq + nv entries), of controls (nu), or of efforts or accelerations of joints (nv).
    Numbers(&'a [f64]),
    /// Position of a frame's origin or of the centre of mass in the world (m), or the desired vertical of a tilt.
    Position(Vec3<f64>),
    /// Rotation of a frame in the world.
    Rotation(Mat3<f64>),
    /// Pose of a frame in the world.
    Placement(Se3<f64>),
    /// Velocity of a frame, in the reference frame or the heading frame of its residual (m/s, rad/s).
    Velocity(Motion<f64>),
    /// Force of a contact along the axes of its rows (N, N m; of an impact N s, N m s), or a centroidal momentum (kg
    /// m/s, kg m²/s).
    Force(Force<f64>),
}

/// Defines conversions of values into targets.
macro_rules! targets {
    ($($Type:ty => $variant:ident),*) => {$(
        impl From<$Type> for Target<'_> {
            fn from(target: $Type) -> Self {
                Self::$variant(target)
            }
        }
    )*};
}
targets!(
    Vec3<f64> => Position, Mat3<f64> => Rotation, Se3<f64> => Placement, Motion<f64> => Velocity, Force<f64> => Force
);

impl<'a> From<&'a [f64]> for Target<'a> {
    fn from(numbers: &'a [f64]) -> Self {
        Self::Numbers(numbers)
    }
}

impl<'a> From<&'a Vec<f64>> for Target<'a> {
    fn from(numbers: &'a Vec<f64>) -> Self {
        Self::Numbers(numbers)
    }
}

impl<'a, const N: usize> From<&'a [f64; N]> for Target<'a> {
    fn from(numbers: &'a [f64; N]) -> Self {
        Self::Numbers(numbers)
    }
}

impl Target<'_> {
    /// Returns a description of the kind of target, for error messages.
    fn kind(&self) -> String {
        match self {
            Self::Numbers(numbers) => format!("{} numbers", numbers.len()),
            Self::Position(_) => "a position".to_owned(),
            Self::Rotation(_) => "a rotation".to_owned(),
            Self::Placement(_) => "a placement".to_owned(),
            Self::Velocity(_) => "a velocity".to_owned(),
            Self::Force(_) => "a force".to_owned(),
        }
    }
}

/// Returns an error if an entry of `numbers` is not finite; the error contains `name`.
pub(super) fn check_finite(name: &str, numbers: &[f64]) -> Result<(), String> {
    match numbers.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) if numbers[k].is_nan() => Err(format!("its {name} holds a NaN")),
        Some(_) => Err(format!("its {name} holds an infinite number")),
    }
}

/// Maximum deviation of the square of a unit vector's length from 1; larger deviations are faults, not rounding errors.
const UNIT: f64 = 1e-6;

/// Returns an error if a vector does not have the length 1; the error contains `name`.
fn check_unit(name: &str, x: Vec3<f64>) -> Result<(), String> {
    check_finite(name, &x.to_array())?;
    let length = x.norm_squared().sqrt();
    match (x.norm_squared() - 1.0).abs() <= UNIT {
        true => Ok(()),
        false => Err(format!("its {name} has the length {length}, expected 1")),
    }
}

/// Returns an error if the matrix R is not a rotation; the error contains `name`.
pub(super) fn check_rotation(name: &str, R: &Mat3<f64>) -> Result<(), String> {
    match R.is_rotation() {
        true => Ok(()),
        false => Err(format!("its {name} is no rotation: expected three unit vectors at right angles")),
    }
}

impl Residual {
    /// Returns whether the two residuals differ only in the numbers of their targets.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        match (self.target(), other.target()) {
            (Some(Target::Numbers(own)), Some(Target::Numbers(others))) => {
                own.len() == others.len() && core::mem::discriminant(self) == core::mem::discriminant(other)
            }
            (Some(_), Some(_)) => {
                self.differs_in_target(other) && self.frame() == other.frame() && self.contact() == other.contact()
            }
            _ => self == other,
        }
    }

    /// Returns the target; `None` for a residual without a target and for a user-defined function.
    pub fn target(&self) -> Option<Target<'_>> {
        Some(match self {
            Self::State { reference }
            | Self::Control { reference }
            | Self::JointEffort { reference }
            | Self::JointAcceleration { reference } => Target::Numbers(reference),
            Self::CenterOfMass { target } | Self::FrameTranslation { target, .. } => Target::Position(*target),
            Self::FrameRotation { target, .. } => Target::Rotation(*target),
            Self::FramePlacement { target, .. } => Target::Placement(*target),
            Self::Tilt { up, .. } => Target::Position(*up),
            Self::FrameVelocity { target, .. } | Self::HeadingVelocity { target, .. } => Target::Velocity(*target),
            Self::CentroidalMomentum { target } | Self::ContactForce { target, .. } => Target::Force(*target),
            _ => return None,
        })
    }

    /// Returns an error if the target does not fit this residual or a robot with nu controls.
    pub(crate) fn check_target(&self, model: &Model, nu: usize, target: Target<'_>) -> Result<(), String> {
        let (nq, nv) = (model.nq(), model.nv());
        match (self, target) {
            (Self::State { .. }, Target::Numbers(numbers)) => {
                check_reference(numbers, nq + nv)?;
                model.check_position(&numbers[..nq]).map_err(|error| format!("its reference: {error}"))
            }
            (Self::Control { .. }, Target::Numbers(numbers)) => check_reference(numbers, nu),
            (Self::JointEffort { .. } | Self::JointAcceleration { .. }, Target::Numbers(numbers)) => {
                check_reference(numbers, nv)
            }
            (Self::CenterOfMass { .. } | Self::FrameTranslation { .. }, Target::Position(p)) => {
                check_finite("target", &p.to_array())
            }
            (Self::FrameRotation { .. }, Target::Rotation(R)) => {
                check_finite("target", R.columns().map(Vec3::to_array).as_flattened())?;
                check_rotation("target", &R)
            }
            (Self::FramePlacement { .. }, Target::Placement(X)) => {
                check_finite("target", &X.translation.to_array())?;
                check_finite("target", X.rotation.columns().map(Vec3::to_array).as_flattened())?;
                check_rotation("target", &X.rotation)
            }
            (Self::Tilt { .. }, Target::Position(up)) => check_unit("desired vertical", up),
            (Self::FrameVelocity { .. } | Self::HeadingVelocity { .. }, Target::Velocity(v)) => {
                check_finite("target", &v.to_array())
            }
            (Self::CentroidalMomentum { .. } | Self::ContactForce { .. }, Target::Force(f)) => {
                check_finite("target", &f.to_array())
            }
            _ => Err(match self.target() {
                Some(own) => format!("its target is {}, found {}", own.kind(), target.kind()),
                None => "its residual has no target".to_owned(),
            }),
        }
    }

    /// Replaces the target of this residual by a target that has been checked.
    pub(crate) fn write_target(&mut self, to: Target<'_>) {
        match (self, to) {
            (
                Self::State { reference }
                | Self::Control { reference }
                | Self::JointEffort { reference }
                | Self::JointAcceleration { reference },
                Target::Numbers(numbers),
            ) => reference.copy_from_slice(numbers),
            (Self::CenterOfMass { target } | Self::FrameTranslation { target, .. }, Target::Position(p)) => *target = p,
            (Self::FrameRotation { target, .. }, Target::Rotation(R)) => *target = R,
            (Self::FramePlacement { target, .. }, Target::Placement(X)) => *target = X,
            (Self::Tilt { up, .. }, Target::Position(p)) => *up = p,
            (Self::FrameVelocity { target, .. } | Self::HeadingVelocity { target, .. }, Target::Velocity(v)) => {
                *target = v
            }
            (Self::CentroidalMomentum { target } | Self::ContactForce { target, .. }, Target::Force(f)) => *target = f,
            _ => unreachable!("the target was checked"),
        }
    }
}

/// Returns an error if a reference has a wrong length or a number that is not finite.
fn check_reference(numbers: &[f64], expected: usize) -> Result<(), String> {
    match numbers.len() == expected {
        true => check_finite("reference", numbers),
        false => Err(format!("its reference has {} numbers, expected {expected}", numbers.len())),
    }
}
