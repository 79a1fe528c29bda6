//! The limbs of one robot side by side: which bodies share a step of a pass, and in which lane each stands.
//!
//! Bodies of different legs, arms or fingers do not wait for each other, so one pass can treat four of them at once, each
//! in a lane of a vector register. All four must have joints of one kind, but whatever their axes: these are turned to z
//! already. [`schedule`] says which bodies go together, [`steps`] what a pass needs of them, [`column_map`] where the
//! entries of matrices stand.
//!
//! Robots with less than about two bodies a step, chains above all, are computed one body after the other.

pub mod column_map;
pub mod schedule;
pub mod steps;

use crate::joint::turns::Turns;
use crate::tree::Tree;
use alloc::vec::Vec;
use column_map::ColumnMap;
use schedule::Schedule;
use steps::{StateMap, Step};

/// The number of bodies side by side.
pub const LANES: usize = 4;

/// A schedule, and what a pass needs of it. Step 0 is the world.
#[derive(Clone, Debug)]
pub struct Plan {
    schedule: Schedule,
    /// The bodies as a pass sees them.
    pub steps: Vec<Step>,
    /// All steps but the world, the last first.
    pub closed: Vec<usize>,
    /// The steps that turn about z.
    pub turns: Turns,
    /// The places from which the numbers in lanes come.
    pub state: StateMap,
    /// The places of columns and of the entries of matrices.
    pub columns: ColumnMap,
}

impl Plan {
    /// The plan for a robot, if it has limbs enough.
    pub(crate) fn new(tree: &Tree<f64>) -> Option<Self> {
        if tree.nodes.iter().any(|node| node.mimic.is_some() && !node.joint.follows_by_sums()) {
            return None;
        }
        let schedule = Schedule::new(&tree.nodes)?;
        let (mut steps, state) = steps::new(tree, &schedule);
        let columns = ColumnMap::new(tree, &schedule, &mut steps);
        let turns = Turns::of(steps[1..].iter().map(|step| (step.joint, step.idx_q, false)));
        Some(Self { closed: (1..steps.len()).rev().collect(), schedule, steps, turns, state, columns })
    }

    /// The step and lane of a body.
    #[inline(always)]
    pub fn place(&self, body: usize) -> (usize, usize) {
        self.schedule.place[body]
    }

    /// Whether a step's body is the same in all lanes: the world, or the one on which all others hang.
    #[inline(always)]
    pub fn in_all_lanes(&self, step: usize) -> bool {
        self.schedule.in_all_lanes(step)
    }
}
