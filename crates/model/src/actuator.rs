//! Actuators: motors and servos, and the joints, tendons or frames that they drive.

use alloc::string::String;
use alloc::vec::Vec;

/// Actuator of a robot, as its file describes it. The [`Limits`](crate::Limits) of a model already include the ranges
/// of its actuators. The joints of a model already include the armature and damping of its actuators.
///
/// Let u be the control. Let the length l be the gear times the position of the driven joint, tendon or frame. The
/// actuator acts with the force
///
/// ```text
/// f = gain u + bias − kp l − kv l̇
/// ```
///
/// A motor has the gain 1, and its bias, kp and kv are 0. The gain of a position servo is kp, and the gain of a
/// velocity servo is kv. The effort at the joint is gear · f.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Actuator<B = usize> {
    /// Name, or an empty string.
    pub name: String,
    /// Joint, tendon or frame that the actuator drives.
    pub transmission: Transmission<B>,
    /// Gear: the effort at the joint for each unit of force (1, m). Hinges, slides and tendons use only the first
    /// entry. A ball joint uses three entries: an axis in the frame of its body. A frame uses six entries, linear
    /// first, along the frame's axes. A free joint also uses six entries: a force along the axes of the world, and a
    /// torque along the axes of the body.
    pub gear: [f64; 6],
    /// Gain: force for each unit of control.
    pub gain: f64,
    /// Bias: force if the control u, the length l and its rate l̇ are 0 (N, N m).
    pub bias: f64,
    /// Gain of position kp (N/m, N m/rad); 0 for a motor.
    pub kp: f64,
    /// Gain of velocity kv (N s/m, N m s/rad); 0 for a motor.
    pub kv: f64,
    /// Minimum and maximum control; infinite if there is no limit.
    #[cfg_attr(feature = "serde", serde(with = "range"))]
    pub control: (f64, f64),
    /// Minimum and maximum force before the gear is applied (N, N m); infinite if there is no limit.
    #[cfg_attr(feature = "serde", serde(with = "range"))]
    pub force: (f64, f64),
}

/// Joint, tendon or frame that an [`Actuator`] drives. `B` is the type that identifies a body: its index in a model, or
/// a [`BodyId`](crate::BodyId) in a builder.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Transmission<B = usize> {
    /// Joint of a body.
    Joint {
        /// Body that the joint carries.
        body: B,
    },
    /// Tendon whose length is a sum of joint positions, each times a coefficient.
    Tendon {
        /// Name of the tendon.
        name: String,
        /// Bodies whose joints determine the tendon's length, each with the coefficient of its joint (1, m/rad).
        joints: Vec<(B, f64)>,
    },
    /// Frame on which the force acts as a wrench, along the frame's axes at its origin.
    Frame {
        /// Index of the frame.
        frame: usize,
    },
}

impl<B: Clone> Actuator<B> {
    /// Maps bodies and frames to their new identifiers. Returns `None` if no driven body exists any more.
    pub(crate) fn renamed<C>(
        &self,
        body: impl Fn(&B) -> Option<C>,
        frame: impl Fn(usize) -> usize,
    ) -> Option<Actuator<C>> {
        let transmission = match &self.transmission {
            Transmission::Joint { body: b } => Transmission::Joint { body: body(b)? },
            Transmission::Tendon { name, joints } => {
                let joints: Vec<_> = joints.iter().filter_map(|(b, k)| Some((body(b)?, *k))).collect();
                if joints.is_empty() {
                    return None;
                }
                Transmission::Tendon { name: name.clone(), joints }
            }
            Transmission::Frame { frame: f } => Transmission::Frame { frame: frame(*f) },
        };
        let Self { name, gear, gain, bias, kp, kv, control, force, .. } = self.clone();
        Some(Actuator { name, transmission, gear, gain, bias, kp, kv, control, force })
    }
}

/// Serialization of ranges; `null` stands for an infinite bound.
#[cfg(feature = "serde")]
mod range {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(range: &(f64, f64), to: S) -> Result<S::Ok, S::Error> {
        let finite = |x: f64| x.is_finite().then_some(x);
        (finite(range.0), finite(range.1)).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<(f64, f64), D::Error> {
        let (lower, upper) = <(Option<f64>, Option<f64>)>::deserialize(from)?;
        Ok((lower.unwrap_or(f64::NEG_INFINITY), upper.unwrap_or(f64::INFINITY)))
    }
}
