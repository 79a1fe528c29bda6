//! Joints that turn about z, and where their angles stand.

use super::Joint;
use alloc::vec::Vec;

/// The joints that turn about z, found once, so that no pass looks at each.
#[derive(Clone, Debug, Default)]
pub struct Turns {
    /// Joints whose angles stand in q. Of some that follow each other, as their angles do: the first joint, the place of its
    /// angle, and how many.
    pub(super) runs: Vec<[usize; 3]>,
    /// Joints whose angles are computed from those of others.
    pub(super) followers: Vec<usize>,
    /// Joints whose cosines and sines stand in q.
    pub(super) circles: Vec<usize>,
}

impl Turns {
    /// Those among some joints, from that of body 1 on, each with the place of its position in q and whether it follows
    /// another one.
    pub(crate) fn of(joints: impl Iterator<Item = (Joint, usize, bool)>) -> Self {
        let mut turns = Self::default();
        for (k, (joint, idx_q, follows)) in joints.enumerate() {
            let i = k + 1;
            match joint {
                Joint::Revolute { .. } | Joint::Helical { .. } if follows => turns.followers.push(i),
                Joint::Revolute { .. } | Joint::Helical { .. } => match turns.runs.last_mut() {
                    Some([first, at, count]) if (*first + *count, *at + *count) == (i, idx_q) => *count += 1,
                    _ => turns.runs.push([i, idx_q, 1]),
                },
                Joint::Continuous { .. } | Joint::Planar => turns.circles.push(i),
                _ => {}
            }
        }
        turns
    }
}
