//! Limits that hold a step or a posture back.

use crate::bounds::{Bounds, Cause};
use crate::separation::pair_names;
use condyle_dynamics::distances::DistancePairs;
use condyle_dynamics::{Body, Model};

/// Limit that holds a step or a posture back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Held {
    /// Lower bound of this coordinate of v: its limit of position, velocity or acceleration.
    Lower(usize),
    /// Upper bound of this coordinate of v.
    Upper(usize),
    /// Limit of the distance of this pair.
    Pair(usize),
}

impl Held {
    /// Returns the limit in words, with the name of the joint or of the geometries. `bounds` tells which limit of a
    /// joint holds a step; without it, the limit is a limit of position.
    pub(crate) fn describe(self, model: &Model, pairs: Option<&DistancePairs>, bounds: Option<&Bounds>) -> String {
        let (i, side) = match self {
            Self::Lower(i) => (i, 0),
            Self::Upper(i) => (i, 1),
            Self::Pair(i) => {
                let names = pairs.map_or(String::new(), |pairs| pair_names(pairs, i));
                return format!("distance of {names}");
            }
        };
        let (word, joint) = (["lower", "upper"][side], joint_name(model, i));
        match bounds.and_then(|bounds| bounds.cause(i, side)) {
            Some(cause) if cause != Cause::Position => {
                format!("{word} limit of the {} of joint `{joint}`", cause.quantity())
            }
            _ => format!("{word} limit of joint `{joint}`"),
        }
    }
}

/// Returns the name of the joint with this coordinate of v.
fn joint_name(model: &Model, coordinate: usize) -> &str {
    let holds = |b: &&Body| b.mimic.is_none() && (b.idx_v..b.idx_v + b.joint.nv()).contains(&coordinate);
    model.bodies().iter().skip(1).find(holds).map_or("", |b| &b.joint_name)
}
