//! Limbs of one robot in parallel lanes; a limb is a branch of the robot's tree. This module selects the bodies that
//! share a step of a pass, and the lane of each body.
//!
//! Bodies of different legs, arms or fingers do not depend on each other. So one pass can process four such bodies at
//! once, each in a lane of a vector register. All four bodies must have the same kind of joint. The joint axes may
//! differ, because every joint frame is turned such that its axis is z. [`schedule`] selects the bodies of each step,
//! [`steps`] collects the data that a pass needs, and [`column_map`] contains the indices of matrix entries.
//!
//! If a robot has fewer than about two bodies per step, as a chain has, bodies are computed one after another instead.

pub mod column_map;
pub mod schedule;
pub mod steps;

use crate::joint::revolute_angles::RevoluteAngles;
use crate::tree::Tree;
use alloc::vec::Vec;
use column_map::ColumnMap;
use schedule::Schedule;
use steps::{StateMap, Step};

/// Number of bodies that are computed in parallel lanes.
pub const LANES: usize = 4;

/// Schedule of the steps of a pass, and the data that the steps need. Step 0 is the world.
#[derive(Clone, Debug)]
pub struct Plan {
    schedule: Schedule,
    /// Steps of a pass: the bodies of each step, with the data that the pass reads.
    pub steps: Vec<Step>,
    /// Indices of all steps except the world. The last step comes first.
    pub closed: Vec<usize>,
    /// Steps whose joints turn about z.
    pub revolute_angles: RevoluteAngles,
    /// Indices from which the numbers in lanes are read.
    pub state: StateMap,
    /// Indices of columns and of matrix entries.
    pub columns: ColumnMap,
}

impl Plan {
    /// Creates the plan for a robot. Returns `None` if the robot has too few limbs.
    pub(crate) fn new(tree: &Tree<f64>) -> Option<Self> {
        if tree.nodes.iter().any(|node| node.mimic.is_some() && !node.joint.follows_by_sums()) {
            return None;
        }
        let schedule = Schedule::new(&tree.nodes)?;
        let (mut steps, state) = steps::new(tree, &schedule);
        let columns = ColumnMap::new(tree, &schedule, &mut steps);
        let revolute_angles = RevoluteAngles::of(steps[1..].iter().map(|step| (step.joint, step.idx_q, false)));
        Some(Self { closed: (1..steps.len()).rev().collect(), schedule, steps, revolute_angles, state, columns })
    }

    /// Returns the step and lane of a body.
    #[inline(always)]
    pub fn place(&self, body: usize) -> (usize, usize) {
        self.schedule.place[body]
    }

    /// Returns whether a step has the same body in all lanes: the world, or the body that carries all other bodies.
    #[inline(always)]
    pub fn in_all_lanes(&self, step: usize) -> bool {
        self.schedule.in_all_lanes(step)
    }
}
