//! Joints that turn about z, and the indices of their angles.

use super::Joint;
use alloc::vec::Vec;

/// Joints that turn about z. These joints are collected once, so that a pass finds them without a test of every joint.
#[derive(Clone, Debug, Default)]
pub struct RevoluteAngles {
    /// Runs of consecutive joints with consecutive angles in q. Each run has its first joint, the index of this joint's
    /// angle, and the number of joints.
    pub(super) runs: Vec<[usize; 3]>,
    /// Joints that follow other joints. Their angles are computed from the angles of these joints.
    pub(super) followers: Vec<usize>,
    /// Joints whose cosines and sines are stored in q.
    pub(super) circles: Vec<usize>,
}

impl RevoluteAngles {
    /// Collects the joints that turn about z. For each body, from body 1 on, `joints` yields its joint, the index of
    /// its position in q, and whether it follows another joint.
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
