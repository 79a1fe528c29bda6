//! The limbs of one robot side by side: which bodies share a step of a pass, and in which lane each stands.
//!
//! Bodies of different legs, arms or fingers do not wait for each other, so one pass can treat four of them at once, each
//! in a lane of a vector register. The plan is a list schedule: step after step takes up to four bodies whose parents are
//! done, those with the longest way to their tips first, and leaves each in its parent's lane, which it waits for if there
//! is time. The body on which all others hang stands in all lanes, each of which adds up what its own limbs exert on it.
//!
//! All four must have joints of one kind, but whatever their axes: these are turned to z already. Robots with less than about
//! two bodies a step, chains above all, are computed one body after the other.

pub mod column_map;
pub mod schedule;

use crate::joint::Joint;
use crate::tree::Node;
use crate::tree::Tree;
pub use column_map::Sizes;
use condyle_spatial::moves::Move;

/// How many bodies stand side by side.
pub const LANES: usize = 4;

/// From how many bodies a step on it pays, the world counted: two legs of six joints each, under one trunk, just do.
const WORTH: usize = 2;

/// A schedule, and what a pass needs of it. Step 0 is the world.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The bodies of each step, one in each lane, 0 where there is none.
    pub bodies: Vec<[usize; LANES]>,
    /// The step and lane of each body.
    pub place: Vec<(usize, usize)>,
    /// Whether the first step is one body in all lanes.
    pub shared: bool,
    /// The bodies as a pass sees them.
    pub steps: Vec<schedule::Step>,
    /// All steps but the world, the last first.
    pub finished: Vec<usize>,
    /// Of the positions and of the degrees of freedom of all steps.
    pub positions: Vec<schedule::Source>,
    pub coordinates: Vec<schedule::Source>,
    /// Where, among the numbers in lanes, that of each coordinate stands.
    pub leaders: Vec<usize>,
    /// The coordinate, the number, and the ratio, of joints that follow.
    pub followers: Vec<(usize, usize, f64)>,
    /// The columns from the root to each step's joints, step by step.
    pub links: Vec<column_map::Link>,
    pub pairs: Vec<column_map::Pair>,
    /// What stands behind the columns of all steps: copies of columns, of which steps, and how their lanes change.
    pub copies: Vec<Vec<(usize, Move)>>,
    /// Of each link, the one before it on the way out.
    pub before: Vec<column_map::Before>,
    pub sizes: Sizes,
    /// All columns, those after one another together.
    pub blocks: Vec<column_map::Block>,
}

impl Plan {
    /// The plan for a robot, if it has limbs enough.
    pub(crate) fn new(tree: &Tree<f64>) -> Option<Self> {
        let turns_with = |n: &Node<f64>| n.mimic.is_some() && matches!(n.joint, Joint::Continuous { .. });
        if tree.nodes.iter().any(turns_with) {
            return None; // its position is no multiple of its leader's
        }
        let mut plan = Self::schedule(&tree.nodes)?;
        plan.leaders = vec![0; tree.nv];
        plan.add_steps(tree);
        plan.add_links(tree);
        Some(plan)
    }

    fn schedule(nodes: &[Node<f64>]) -> Option<Self> {
        // Who has the longest way goes first: that tells how many steps there are. Then who has time to wait for a lane
        // waits.
        let hasty = Self::schedule_until(nodes, 0);
        let patient = Self::schedule_until(nodes, hasty.bodies.len() - 1);
        let plan = if patient.bodies.len() > hasty.bodies.len() { hasty } else { patient };
        (nodes.len() >= WORTH * (plan.bodies.len() - 1)).then_some(plan)
    }

    /// A schedule in which bodies that must not wait, if `last` is to be the last step, are served first.
    fn schedule_until(nodes: &[Node<f64>], last: usize) -> Self {
        let bodies = nodes.len();
        let mut children = vec![Vec::new(); bodies];
        let mut height = vec![0; bodies]; // bodies on the longest way to a tip
        for i in (1..bodies).rev() {
            children[nodes[i].parent].push(i);
            height[nodes[i].parent] = height[nodes[i].parent].max(height[i] + 1);
        }
        let shared = bodies > 1 && children[0].len() == 1;
        let mut plan = Self {
            bodies: vec![[0; LANES]],
            place: vec![(0, 0); bodies],
            shared,
            steps: Vec::new(),
            finished: Vec::new(),
            positions: Vec::new(),
            coordinates: Vec::new(),
            leaders: Vec::new(),
            followers: Vec::new(),
            links: Vec::new(),
            pairs: Vec::new(),
            copies: Vec::new(),
            before: Vec::new(),
            sizes: Sizes::default(),
            blocks: Vec::new(),
        };
        let mut ready = children[0].clone();
        if shared {
            let root = ready.remove(0);
            plan.bodies.push([root; LANES]);
            plan.place[root] = (1, 0);
            ready = children[root].clone();
        }
        while !ready.is_empty() {
            let now = plan.bodies.len();
            ready.sort_by_key(|&i| (core::cmp::Reverse(height[i]), i));
            let first = nodes[ready[0]].joint;
            let fits = |i: &usize| side_by_side(nodes[*i].joint, first);
            let urgent = |i: &usize| now + height[*i] >= last;
            let (hurry, wait): (Vec<_>, Vec<_>) = ready.iter().copied().filter(fits).partition(urgent);
            let hurry = &hurry[..hurry.len().min(LANES)];
            let wanted = |lane: usize| {
                let home = |&i: &usize| plan.place[nodes[i].parent];
                ready.iter().any(|i| !plan.in_all_lanes(home(i).0) && home(i).1 == lane)
            };
            let wanted = [0, 1, 2, 3].map(wanted);
            let mut step = [0; LANES];
            for (these, at_home) in [(hurry, true), (hurry, false), (&wait, true), (&wait, false)] {
                for &i in these {
                    let (parent_step, parent_lane) = plan.place[nodes[i].parent];
                    let home = (!plan.in_all_lanes(parent_step) && step[parent_lane] == 0).then_some(parent_lane);
                    let free = (0..LANES).filter(|&lane| step[lane] == 0).min_by_key(|&lane| wanted[lane]);
                    if let (false, Some(lane)) = (step.contains(&i), if at_home { home } else { free }) {
                        step[lane] = i;
                    }
                }
            }
            for (lane, &i) in step.iter().enumerate().filter(|(_, i)| **i > 0) {
                plan.place[i] = (now, lane);
            }
            plan.bodies.push(step);
            ready.retain(|i| !step.contains(i));
            ready.extend(step.iter().flat_map(|&i| if i > 0 { &children[i][..] } else { &[] }));
        }
        plan.finished = (1..plan.bodies.len()).rev().collect();
        plan
    }

    /// Whether a step's body is the same in all lanes: the world, or the one on which all hang.
    pub fn in_all_lanes(&self, step: usize) -> bool {
        step == 0 || (step == 1 && self.shared)
    }
}

/// Whether two joints are computed by the same operations.
fn side_by_side(a: Joint, b: Joint) -> bool {
    let pitch = |joint| if let Joint::Helical { pitch, .. } = joint { pitch } else { 0.0 };
    core::mem::discriminant(&a) == core::mem::discriminant(&b) && pitch(a) == pitch(b)
}
