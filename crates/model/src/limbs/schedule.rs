//! The schedule: which bodies go together.
//!
//! A list schedule: step after step takes up to four bodies whose parents are done, those with the longest way to their tips
//! first, and leaves each in its parent's lane, which it waits for if there is time. The body on which all others hang stands
//! in all lanes, each of which adds up what its own limbs exert on it.

use super::LANES;
use crate::tree::Node;
use alloc::vec::Vec;

/// The number of bodies a step, the world counted, from which limbs side by side pay: two legs of six joints each, under one
/// trunk, just do.
const WORTH: usize = 2;

/// The bodies of each step, and the step of each body.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    /// The bodies of each step, one in each lane, 0 where there is none.
    pub bodies: Vec<[usize; LANES]>,
    /// The step and lane of each body.
    pub place: Vec<(usize, usize)>,
    /// Whether the first step is one body in all lanes.
    pub shared: bool,
}

impl Schedule {
    /// The schedule for a robot, if it has limbs enough.
    pub(super) fn new(nodes: &[Node<f64>]) -> Option<Self> {
        // Who has the longest way goes first: that tells how many steps there are. Then who has time to wait for a lane
        // waits.
        let hasty = Self::until(nodes, 0);
        let patient = Self::until(nodes, hasty.bodies.len() - 1);
        let schedule = if patient.bodies.len() > hasty.bodies.len() { hasty } else { patient };
        (nodes.len() >= WORTH * (schedule.bodies.len() - 1)).then_some(schedule)
    }

    /// A schedule in which bodies that must not wait, if `last` is to be the last step, are served first.
    fn until(nodes: &[Node<f64>], last: usize) -> Self {
        let n = nodes.len();
        let mut children = vec![Vec::new(); n];
        let mut height = vec![0; n]; // bodies on the longest way to a tip
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

    /// Whether a step's body is the same in all lanes: the world, or the one on which all others hang.
    #[inline(always)]
    pub(super) fn in_all_lanes(&self, step: usize) -> bool {
        step == 0 || (step == 1 && self.shared)
    }

    /// The step of the parent of the body in a lane, and the lane in which it stands for that body.
    pub(super) fn parent(&self, nodes: &[Node<f64>], step: usize, lane: usize) -> (usize, usize) {
        let (parent, its) = self.place[nodes[self.bodies[step][lane]].parent];
        (parent, if self.in_all_lanes(parent) { lane } else { its })
    }
}
