//! What a pass needs of the bodies of a step, lane by lane.

use super::{LANES, Plan};
use crate::joint::Joint;
use crate::tree::Tree;
use condyle_spatial::moves::Move;
use condyle_spatial::{Inertia, Mat3, Se3, Sym3, Vec3};

/// Four bodies as a pass sees them.
#[derive(Clone, Debug)]
pub struct Step {
    /// The kind of their joints.
    pub joint: Joint,
    pub bodies: [usize; LANES],
    pub placement: Se3<[f64; LANES]>,
    pub inertia: Inertia<[f64; LANES]>,
    pub axis_rotation: Mat3<[f64; LANES]>,
    /// Where the positions and the velocities of their joints begin among those in lanes.
    pub idx_q: usize,
    pub idx_v: usize,
    pub parents: Parents,
    /// Where its links stand in `Plan::links`.
    pub links: (usize, usize),
    /// Nothing hangs on any of its bodies.
    pub tip: bool,
}

/// Where the parents of a step's bodies stand.
#[derive(Clone, Debug)]
pub enum Parents {
    /// In one step, each in its child's lane.
    Below(usize),
    /// Elsewhere: what comes from which step, and what goes there.
    Apart { from: Vec<(usize, Move)>, to: Vec<(usize, Move)> },
}

/// Where the four numbers of a position or a velocity come from: the one of the robot times `ratio`, plus `offset`.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// One past the robot's last in a lane without a joint.
    pub from: [usize; LANES],
    pub ratio: [f64; LANES],
    pub offset: [f64; LANES],
}

impl Plan {
    /// Fills in the constants of all steps.
    pub(super) fn add_steps(&mut self, tree: &Tree<f64>) {
        for s in 0..self.bodies.len() {
            let bodies = self.bodies[s];
            let some = bodies.into_iter().find(|&i| i > 0).unwrap_or(0);
            let joint = tree.nodes[some].joint;
            let (idx_q, idx_v) = (self.positions.len(), self.coordinates.len());
            if s > 0 {
                self.add_sources(tree, s, joint);
            }
            // what a body in all lanes weighs, the first lane carries
            let carried = |lane: usize| match bodies[lane] {
                0 => Inertia::zero(),
                _ if self.in_all_lanes(s) && lane > 0 => Inertia::zero(),
                i => tree.nodes[i].inertia,
            };
            let placement = bodies.map(|i| tree.nodes[i].placement);
            self.steps.push(Step {
                joint,
                bodies,
                placement: Se3 {
                    rotation: rotation(placement.map(|X| X.rotation)),
                    translation: vector(placement.map(|X| X.translation)),
                },
                inertia: inertia([0, 1, 2, 3].map(carried)),
                axis_rotation: rotation(bodies.map(|i| tree.nodes[i].axis_rotation)),
                idx_q,
                idx_v,
                parents: self.parents(tree, s),
                links: (0, 0),
                tip: false,
            });
        }
    }

    /// Of all positions and degrees of freedom of step s.
    fn add_sources(&mut self, tree: &Tree<f64>, s: usize, joint: Joint) {
        let bodies = self.bodies[s];
        let mut neutral = vec![0.0; joint.nq()];
        joint.neutral(&mut neutral); // where there is no joint
        let follows = bodies.map(|i| tree.nodes[i].mimic);
        let ratio = follows.map(|m| m.map_or(1.0, |m| m.ratio));
        for (k, neutral) in neutral.into_iter().enumerate() {
            let from = bodies.map(|i| if i > 0 { tree.nodes[i].idx_q + k } else { tree.nq });
            let mut offset = follows.map(|m| m.map_or(0.0, |m| m.offset));
            (0..LANES).filter(|&lane| bodies[lane] == 0).for_each(|lane| offset[lane] = neutral);
            self.positions.push(Source { from, ratio, offset });
        }
        for k in 0..joint.nv() {
            let from = bodies.map(|i| if i > 0 { tree.nodes[i].idx_v + k } else { tree.nv });
            for lane in 0..if self.in_all_lanes(s) { 1 } else { LANES } {
                let (to, here) = (from[lane], LANES * self.coordinates.len() + lane);
                match follows[lane] {
                    _ if bodies[lane] == 0 => {}
                    None => self.leaders[to] = here,
                    Some(mimic) => self.followers.push((to, here, mimic.ratio)),
                }
            }
            self.coordinates.push(Source { from, ratio, offset: [0.0; LANES] });
        }
    }

    /// Where the parents of step s stand.
    fn parents(&self, tree: &Tree<f64>, s: usize) -> Parents {
        // of each lane with a body: its parent's step and lane
        let at: Vec<(usize, (usize, usize))> = (0..LANES)
            .filter(|&lane| self.bodies[s][lane] > 0)
            .map(|lane| {
                let (step, its) = self.place[tree.nodes[self.bodies[s][lane]].parent];
                (lane, (step, if self.in_all_lanes(step) { lane } else { its }))
            })
            .collect();
        let Some(&(_, (first, _))) = at.first() else { return Parents::Below(0) };
        if at.iter().all(|&(lane, parent)| parent == (first, lane)) {
            return Parents::Below(first);
        }
        let (mut from, mut to) = (Vec::new(), Vec::new());
        let mut sources: Vec<usize> = at.iter().map(|(_, (step, _))| *step).collect();
        sources.sort_unstable();
        sources.dedup();
        for source in sources {
            let mut pairs: Vec<_> =
                at.iter().filter(|(_, (s, _))| *s == source).map(|(lane, (_, its))| (*its, *lane)).collect();
            from.push((source, Move::new(&pairs)));
            // upwards, no two into one lane at once
            while !pairs.is_empty() {
                let (mut now, mut later) = (Vec::<(usize, usize)>::new(), Vec::new());
                for (its, lane) in pairs {
                    if now.iter().any(|&(_, target)| target == its) {
                        later.push((its, lane))
                    } else {
                        now.push((lane, its))
                    }
                }
                to.push((source, Move::new(&now)));
                pairs = later;
            }
        }
        Parents::Apart { from, to }
    }
}

fn vector(x: [Vec3<f64>; LANES]) -> Vec3<[f64; LANES]> {
    Vec3 { x: x.map(|v| v.x), y: x.map(|v| v.y), z: x.map(|v| v.z) }
}

fn rotation(R: [Mat3<f64>; LANES]) -> Mat3<[f64; LANES]> {
    Mat3 { x: vector(R.map(|R| R.x)), y: vector(R.map(|R| R.y)), z: vector(R.map(|R| R.z)) }
}

fn inertia(I: [Inertia<f64>; LANES]) -> Inertia<[f64; LANES]> {
    let r = I.map(|I| I.rotational);
    let rotational = Sym3 {
        xx: r.map(|r| r.xx),
        xy: r.map(|r| r.xy),
        yy: r.map(|r| r.yy),
        xz: r.map(|r| r.xz),
        yz: r.map(|r| r.yz),
        zz: r.map(|r| r.zz),
    };
    Inertia { mass: I.map(|I| I.mass), mass_com: vector(I.map(|I| I.mass_com)), rotational }
}
