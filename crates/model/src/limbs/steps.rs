//! The steps of a pass: its bodies, lane by lane, and where their numbers come from.

use super::LANES;
use super::schedule::Schedule;
use crate::joint::Joint;
use crate::tree::Tree;
use alloc::vec::Vec;
use condyle_spatial::moves::Move;
use condyle_spatial::{Inertia, Mat3, Se3, Sym3, Vec3};

/// Four bodies as a pass sees them; what is in lanes comes first, so that no vector crosses a line of the cache.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Step {
    /// X_T, between turned frames.
    pub placement: Se3<[f64; LANES]>,
    /// The inertia in the turned frame.
    pub inertia: Inertia<[f64; LANES]>,
    /// bRz: the turned frame in the body's.
    pub axis_rotation: Mat3<[f64; LANES]>,
    /// The kind of their joints.
    pub joint: Joint,
    /// The bodies, 0 in a lane without one.
    pub bodies: [usize; LANES],
    /// The place at which the positions of their joints begin among those in lanes.
    pub idx_q: usize,
    /// The place at which the velocities of their joints begin among those in lanes.
    pub idx_v: usize,
    /// The places of their parents.
    pub parents: Parents,
    /// The places in `ColumnMap::support`, from and to, of the columns from the root to their joints.
    pub support: (usize, usize),
    /// Whether nothing hangs on any of its bodies.
    pub tip: bool,
}

/// The places of the parents of a step's bodies.
#[derive(Clone, Debug)]
pub enum Parents {
    /// The parents are in one step, each in its child's lane.
    InPlace(usize),
    /// The parents are in several steps or in other lanes.
    Moved {
        /// The steps from which something comes, and how its lanes change.
        from: Vec<(usize, Move)>,
        /// The steps to which something goes, and how its lanes change.
        to: Vec<(usize, Move)>,
    },
}

/// The places from which the four numbers of a position or a velocity come: each is the robot's times `ratio`, plus `offset`.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// The places in the robot's q or v; one past its end in a lane without a joint.
    pub from: [usize; LANES],
    /// The ratios of joints that follow others; else 1.
    pub ratio: [f64; LANES],
    /// The offsets of joints that follow others; else 0.
    pub offset: [f64; LANES],
}

/// The places from which the numbers in lanes come, and to which they go.
#[derive(Clone, Debug)]
pub struct StateMap {
    /// The positions of all steps.
    pub positions: Vec<Source>,
    /// The degrees of freedom of all steps.
    pub coordinates: Vec<Source>,
    /// The place of each coordinate's number among those in lanes.
    pub leaders: Vec<usize>,
    /// The joints that follow others: coordinate, place of the number in lanes, ratio.
    pub followers: Vec<(usize, usize, f64)>,
}

/// The steps of a schedule; their columns are still to be mapped.
pub(super) fn new(tree: &Tree<f64>, schedule: &Schedule) -> (Vec<Step>, StateMap) {
    let mut state =
        StateMap { positions: Vec::new(), coordinates: Vec::new(), leaders: vec![0; tree.nv], followers: Vec::new() };
    let step = |s: usize| {
        let bodies = schedule.bodies[s];
        let some = bodies.into_iter().find(|&i| i > 0).unwrap_or(0);
        let joint = tree.nodes[some].joint;
        let (idx_q, idx_v) = (state.positions.len(), state.coordinates.len());
        if s > 0 {
            state.add(tree, schedule, s, joint);
        }
        // the first lane carries what a body in all lanes weighs
        let carried = |lane: usize| match bodies[lane] {
            0 => Inertia::zero(),
            _ if schedule.in_all_lanes(s) && lane > 0 => Inertia::zero(),
            i => tree.nodes[i].inertia,
        };
        let placement = bodies.map(|i| tree.nodes[i].placement);
        let hangs_here = |&i: &usize| i > 0 && schedule.place[tree.nodes[i].parent].0 == s;
        Step {
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
            parents: parents(tree, schedule, s),
            support: (0, 0),
            tip: !schedule.bodies.iter().flatten().any(hangs_here),
        }
    };
    ((0..schedule.bodies.len()).map(step).collect(), state)
}

impl StateMap {
    /// Adds all positions and degrees of freedom of step s.
    fn add(&mut self, tree: &Tree<f64>, schedule: &Schedule, s: usize, joint: Joint) {
        let bodies = schedule.bodies[s];
        let mut neutral = vec![0.0; joint.nq()];
        joint.neutral(&mut neutral); // where there is no joint
        let mimics = bodies.map(|i| tree.nodes[i].mimic);
        let ratio = mimics.map(|m| m.map_or(1.0, |m| m.ratio));
        for (k, neutral) in neutral.into_iter().enumerate() {
            let from = bodies.map(|i| if i > 0 { tree.nodes[i].idx_q + k } else { tree.nq });
            let mut offset = mimics.map(|m| m.map_or(0.0, |m| m.offset));
            (0..LANES).filter(|&lane| bodies[lane] == 0).for_each(|lane| offset[lane] = neutral);
            self.positions.push(Source { from, ratio, offset });
        }
        for k in 0..joint.nv() {
            let from = bodies.map(|i| if i > 0 { tree.nodes[i].idx_v + k } else { tree.nv });
            for lane in 0..if schedule.in_all_lanes(s) { 1 } else { LANES } {
                let (to, here) = (from[lane], LANES * self.coordinates.len() + lane);
                match mimics[lane] {
                    _ if bodies[lane] == 0 => {}
                    None => self.leaders[to] = here,
                    Some(mimic) => self.followers.push((to, here, mimic.ratio)),
                }
            }
            self.coordinates.push(Source { from, ratio, offset: [0.0; LANES] });
        }
    }
}

/// The places of the parents of step s.
fn parents(tree: &Tree<f64>, schedule: &Schedule, s: usize) -> Parents {
    // of each lane with a body: its parent's step and lane
    let at: Vec<(usize, (usize, usize))> = (0..LANES)
        .filter(|&lane| schedule.bodies[s][lane] > 0)
        .map(|lane| (lane, schedule.parent(&tree.nodes, s, lane)))
        .collect();
    let Some(&(_, (first, _))) = at.first() else { return Parents::InPlace(0) };
    if at.iter().all(|&(lane, parent)| parent == (first, lane)) {
        return Parents::InPlace(first);
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
    Parents::Moved { from, to }
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
