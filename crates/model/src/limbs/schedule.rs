//! Schedule of a pass: it assigns bodies to steps and lanes.
//!
//! The method is list scheduling. Each step takes up to four bodies whose parents are in earlier steps. Bodies with the
//! longest path to a tip come first. A body is assigned to the lane of its parent. If the lane is occupied, the body
//! waits for it, unless waiting would add steps. If one body carries all other bodies, this body is in all lanes. Each
//! lane then sums the forces of its own limbs on this body.

use super::LANES;
use crate::tree::Node;
use alloc::vec::Vec;

/// Minimum number of bodies per step, including the world, for which parallel lanes are faster. A trunk with two legs
/// of six joints each has just this number.
const WORTH: usize = 2;

/// Bodies of each step, and the step of each body.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    /// Bodies of each step, one in each lane; 0 means an empty lane.
    pub bodies: Vec<[usize; LANES]>,
    /// Step and lane of each body.
    pub place: Vec<(usize, usize)>,
    /// Whether the first step has the same body in all lanes.
    pub shared: bool,
}

impl Schedule {
    /// Creates the schedule for a robot. Returns `None` if the robot has too few limbs, or if no step has two bodies: a
    /// single body, for example a quadrotor, has the world as its second body of a step.
    pub(super) fn new(nodes: &[Node<f64>]) -> Option<Self> {
        // The first schedule treats all bodies as urgent, which determines the number of steps. In the second schedule,
        // bodies may wait for the lane of their parent if the number of steps stays the same.
        let hasty = Self::until(nodes, 0);
        let patient = Self::until(nodes, hasty.bodies.len() - 1);
        let schedule = if patient.bodies.len() > hasty.bodies.len() { hasty } else { patient };
        let steps = schedule.bodies.len() - 1;
        (nodes.len() >= WORTH * steps && nodes.len() - 1 > steps).then_some(schedule)
    }

    /// Creates a schedule. If waiting would delay a body's subtree beyond step `last`, the body is urgent. Urgent
    /// bodies are assigned first.
    fn until(nodes: &[Node<f64>], last: usize) -> Self {
        let n = nodes.len();
        let mut children = vec![Vec::new(); n];
        let mut height = vec![0; n]; // number of bodies on the longest path to a tip
        for i in (1..n).rev() {
            children[nodes[i].parent].push(i);
            height[nodes[i].parent] = height[nodes[i].parent].max(height[i] + 1);
        }
        let shared = n > 1 && children[0].len() == 1;
        let mut schedule = Self { bodies: vec![[0; LANES]], place: vec![(0, 0); n], shared };
        let mut ready = children[0].clone();
        if shared {
            let root = ready.remove(0);
            schedule.bodies.push([root; LANES]);
            schedule.place[root] = (1, 0);
            ready = children[root].clone();
        }
        while !ready.is_empty() {
            let now = schedule.bodies.len();
            ready.sort_by_key(|&i| (core::cmp::Reverse(height[i]), i));
            let first = nodes[ready[0]].joint;
            let fits = |i: &usize| nodes[*i].joint.is_computed_as(first);
            let urgent = |i: &usize| now + height[*i] >= last;
            let (hurry, wait): (Vec<_>, Vec<_>) = ready.iter().copied().filter(fits).partition(urgent);
            let hurry = &hurry[..hurry.len().min(LANES)];
            let wanted = |lane: usize| {
                let home = |&i: &usize| schedule.place[nodes[i].parent];
                ready.iter().any(|i| !schedule.in_all_lanes(home(i).0) && home(i).1 == lane)
            };
            let wanted = [0, 1, 2, 3].map(wanted);
            let mut step = [0; LANES];
            for (these, at_home) in [(hurry, true), (hurry, false), (&wait, true), (&wait, false)] {
                for &i in these {
                    let (parent_step, parent_lane) = schedule.place[nodes[i].parent];
                    let home = (!schedule.in_all_lanes(parent_step) && step[parent_lane] == 0).then_some(parent_lane);
                    let free = (0..LANES).filter(|&lane| step[lane] == 0).min_by_key(|&lane| wanted[lane]);
                    if let (false, Some(lane)) = (step.contains(&i), if at_home { home } else { free }) {
                        step[lane] = i;
                    }
                }
            }
            for (lane, &i) in step.iter().enumerate().filter(|(_, i)| **i > 0) {
                schedule.place[i] = (now, lane);
            }
            schedule.bodies.push(step);
            ready.retain(|i| !step.contains(i));
            ready.extend(step.iter().flat_map(|&i| if i > 0 { &children[i][..] } else { &[] }));
        }
        schedule
    }

    /// Returns whether a step has the same body in all lanes: the world, or the body that carries all other bodies.
    #[inline(always)]
    pub(super) fn in_all_lanes(&self, step: usize) -> bool {
        step == 0 || (step == 1 && self.shared)
    }

    /// Returns the step of the parent of the body in a lane, and the lane from which the body reads its parent's data.
    pub(super) fn parent(&self, nodes: &[Node<f64>], step: usize, lane: usize) -> (usize, usize) {
        let (parent, its) = self.place[nodes[self.bodies[step][lane]].parent];
        (parent, if self.in_all_lanes(parent) { lane } else { its })
    }
}
