//! Steps of a pass: their bodies in lanes, and the indices from which the numbers of these bodies are read.

use super::LANES;
use super::schedule::Schedule;
use crate::joint::Joint;
use crate::tree::Tree;
use alloc::vec::Vec;
use condyle_spatial::moves::Move;
use condyle_spatial::{Inertia, Mat3, Se3, Sym3, Vec3};

/// Step of a pass: four bodies in lanes. The fields with lanes come first, so that no vector crosses a cache line.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Step {
    /// X_T: pose of the joint's frame in the parent's frame, where each frame is turned such that the axis of its joint
    /// is z.
    pub placement: Se3<[f64; LANES]>,
    /// Inertia in the turned frame.
    pub inertia: Inertia<[f64; LANES]>,
    /// bRz: rotation from the turned frame to the body's frame.
    pub axis_rotation: Mat3<[f64; LANES]>,
    /// Kind of joint that all bodies of the step have.
    pub joint: Joint,
    /// Indices of the bodies; 0 means an empty lane.
    pub bodies: [usize; LANES],
    /// Index, in arrays of lanes, at which the positions of the step's joints begin.
    pub idx_q: usize,
    /// Index, in arrays of lanes, at which the velocities of the step's joints begin.
    pub idx_v: usize,
    /// Steps and lanes of the parents of the bodies.
    pub parents: Parents,
    /// Range (first, end) in `ColumnMap::support` of the columns from the root to the joints of the step.
    pub support: (usize, usize),
    /// Whether none of the bodies has children.
    pub tip: bool,
}

/// Steps and lanes of the parents of a step's bodies.
#[derive(Clone, Debug)]
pub enum Parents {
    /// One step contains all parents, and each parent is in the lane of its child.
    InPlace(usize),
    /// Several steps contain the parents, or the parents are in other lanes.
    Moved {
        /// Steps from which data of the parents are read, with the moves between lanes.
        from: Vec<(usize, Move)>,
        /// Steps to which data for the parents are added, with the moves between lanes.
        to: Vec<(usize, Move)>,
    },
}

/// Indices from which the four lanes of a position or a velocity are read. The value of a lane is an entry of q or v
/// times `ratio`, plus `offset`.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Indices in the robot's q or v. In a lane without a joint, the index is the length of q or v.
    pub from: [usize; LANES],
    /// Ratios of joints that follow other joints; 1 for all other joints.
    pub ratio: [f64; LANES],
    /// Offsets of joints that follow other joints; 0 for all other joints.
    pub offset: [f64; LANES],
}

/// Indices from which positions and velocities are read into lanes, and to which results in lanes are written.
#[derive(Clone, Debug)]
pub struct StateMap {
    /// Sources of the positions of all steps.
    pub positions: Vec<Source>,
    /// Sources of the degrees of freedom of all steps.
    pub coordinates: Vec<Source>,
    /// Index of each coordinate in arrays of lanes.
    pub leaders: Vec<usize>,
    /// Joints that follow other joints, each with its coordinate, its index in arrays of lanes, and its ratio.
    pub followers: Vec<(usize, usize, f64)>,
}

/// Creates the steps of a schedule. The columns of these steps are mapped later.
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
        // If a body is in all lanes, only the first lane has the body's inertia.
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
    /// Adds the sources of all positions and degrees of freedom of step s.
    fn add(&mut self, tree: &Tree<f64>, schedule: &Schedule, s: usize, joint: Joint) {
        let bodies = schedule.bodies[s];
        let mut neutral = vec![0.0; joint.nq()];
        joint.neutral(&mut neutral); // lanes without a joint have this position
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

/// Returns the steps and lanes of the parents of step s.
fn parents(tree: &Tree<f64>, schedule: &Schedule, s: usize) -> Parents {
    // For each lane with a body, the step and lane of its parent.
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
        // In passes towards the root, one move must not add two lanes to the same lane. So such lanes are put into
        // separate moves.
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
