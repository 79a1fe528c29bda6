//! Files' form of a constraint: its gain of the position error is one number, or one number for each axis.

use crate::constraints::constraint::{ConstraintKind, ContactConstraint, Target};
use crate::passes::frames::ReferenceFrame;
use condyle_spatial::Mat3;
use core::fmt;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Constraint with the gains in the form of files.
#[derive(Serialize, Deserialize)]
#[serde(rename = "ContactConstraint", deny_unknown_fields)]
pub(crate) struct Written {
    frame: usize,
    other: Option<usize>,
    kind: ConstraintKind,
    #[serde(default = "Mat3::identity")]
    axes: Mat3<f64>,
    reference: ReferenceFrame,
    kp: Gains,
    kd: f64,
    target: Target<f64>,
}

/// Gain kp of all axes, and the gains of each axis if they differ. In JSON it is a number, or a list of three numbers
/// (linear) or six numbers (linear, then angular).
struct Gains(f64, Option<[f64; 6]>);

impl From<ContactConstraint> for Written {
    fn from(constraint: ContactConstraint) -> Self {
        let ContactConstraint { frame, other, kind, axes, reference, kp, kp_axes, kd, target } = constraint;
        Self { frame, other, kind, axes, reference, kp: Gains(kp, kp_axes), kd, target }
    }
}

impl From<Written> for ContactConstraint {
    fn from(written: Written) -> Self {
        let Written { frame, other, kind, axes, reference, kp: Gains(kp, kp_axes), kd, target } = written;
        Self { frame, other, kind, axes, reference, kp, kp_axes, kd, target }
    }
}

impl Serialize for Gains {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self(kp, axes) if !to.is_human_readable() => (kp, axes).serialize(to),
            Self(_, Some(axes)) => axes.serialize(to),
            Self(kp, None) => kp.serialize(to),
        }
    }
}

impl<'de> Deserialize<'de> for Gains {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        if from.is_human_readable() {
            return from.deserialize_any(NumberOrList);
        }
        <(f64, Option<[f64; 6]>)>::deserialize(from).map(|(kp, axes)| Self(kp, axes))
    }
}

struct NumberOrList;

impl<'de> Visitor<'de> for NumberOrList {
    type Value = Gains;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a list of 3 or 6 numbers")
    }

    fn visit_f64<E: Error>(self, kp: f64) -> Result<Gains, E> {
        Ok(Gains(kp, None))
    }

    fn visit_u64<E: Error>(self, kp: u64) -> Result<Gains, E> {
        Ok(Gains(kp as f64, None))
    }

    fn visit_i64<E: Error>(self, kp: i64) -> Result<Gains, E> {
        Ok(Gains(kp as f64, None))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Gains, A::Error> {
        let (mut axes, mut found) = ([0.0; 6], 0);
        while let Some(gain) = list.next_element::<f64>()? {
            if let Some(axis) = axes.get_mut(found) {
                *axis = gain;
            }
            found += 1;
        }
        match found {
            3 | 6 => Ok(Gains(0.0, Some(axes))),
            _ => Err(A::Error::invalid_length(found, &self)),
        }
    }
}
