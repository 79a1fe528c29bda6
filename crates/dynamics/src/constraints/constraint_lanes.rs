//! What constrained dynamics of a robot with limbs (`constrained.rs`) needs of the constraints of a set, and writes.

use crate::constraints::plan::Plan;
use alloc::boxed::Box;
use alloc::vec::Vec;
use condyle_model::Model;
use condyle_model::limbs::LANES;
use condyle_spatial::gate::is;

/// The number of rows of constraints that stand side by side: in one vector, or in two.
pub(crate) const WIDE: usize = 2 * LANES;

/// A body that feels the forces of a constraint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub body: usize,
    /// The columns of its joint: how many there are, and where the first stands among the places of the constraint.
    pub nv: usize,
    pub at: usize,
}

/// One constraint.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// The ways to the root, without it: from the body of the first frame, of the other, and from where both ways meet.
    pub ways: [Vec<Link>; 3],
    /// The number of numbers that each of its places has in Y, and the beginning of those of place 0.
    pub wide: usize,
    pub start: usize,
    /// The constraints before it and itself, and the runs of places beyond the root that both touch, as in its plan.
    pub beside: Vec<(usize, Vec<[usize; 3]>)>,
    /// The unit forces of its rows on the bodies of both frames, in the world's frame. Written by: `begin`.
    pub forces: [[[f64; WIDE]; 6]; 2],
    /// γ'. Written by: `begin`.
    pub gamma: [f64; WIDE],
}

/// All rows together: a number for each, then zeros, to whole vectors and a vector more.
#[derive(Clone, Debug)]
pub(crate) struct All {
    /// The body that carries all others, 0 if there is none, and how many columns its joint has.
    pub root: usize,
    pub nv: usize,
    pub stride: usize,
    /// The force on the root: all of the forces on the bodies that it carries, and what remains of them. Shape: 6 × stride.
    /// Written by: `carry`.
    pub whole: Vec<f64>,
    pub rest: Vec<f64>,
    /// J q̈ + γ for λ = 0, then λ. Shape: stride. Written by: `carry`, `carry_on`, `constrained.rs`.
    pub x: Vec<f64>,
    /// J, Y and Y D⁻¹ of the root's joint. Shape: nv × stride. Written by: `carry_on`.
    pub J: Vec<f64>,
    pub Y: Vec<f64>,
    pub YD: Vec<f64>,
}

/// The constraints of a set.
#[derive(Clone, Debug)]
pub(crate) struct ConstraintLanes {
    pub(crate) rows: Vec<Rows>,
    /// Y and Y D⁻¹. Shape: places of each constraint × its width. Written by: `carry`.
    pub(crate) Y: Vec<f64>,
    pub(crate) YD: Vec<f64>,
    pub(crate) all: All,
}

impl ConstraintLanes {
    /// The lanes for a robot with limbs on which no joint follows another, and constraints of points and frames.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>, plans: &[Plan]) -> Option<Box<Self>> {
        // rows come by threes
        let whole = plans.iter().all(|plan| plan.rows().is_multiple_of(3));
        if model.limbs().is_none() || model.has_mimic() || !is::<S, f64>() || !whole {
            return None;
        }
        let alone = model.nodes().iter().skip(1).filter(|node| node.parent == 0).count() == 1;
        let (root, nv) = if alone { (1, model.nodes()[1].joint.nv()) } else { (0, 0) };
        let (mut rows, mut start): (Vec<Rows>, usize) = (Vec::new(), 0);
        for plan in plans {
            let parent = |&i: &usize| Some(model.nodes()[i].parent);
            let way = |i| core::iter::successors(Some(i), parent).take_while(|&i| i > root).collect::<Vec<_>>();
            let link = |&body: &usize| {
                let node = &model.nodes()[body];
                let first = plan.touches.iter().find(|touch| touch.column == node.column);
                Link { body, nv: node.joint.nv(), at: first.expect("it is on the way").at }
            };
            let [one, other] = plan.bodies.map(way);
            let own = |a: &[usize], b: &[usize]| a.iter().filter(|i| !b.contains(i)).map(link).collect();
            let shared = one.iter().filter(|i| other.contains(i)).map(link).collect();
            // the root's places are the first ones
            let beyond = |&[here, there, n]: &[usize; 3]| {
                let root = if here < nv { nv } else { 0 };
                (n > root).then_some([here + root, there + root, n - root])
            };
            let beside = plan.common.iter().map(|runs| runs.iter().filter_map(beyond).collect::<Vec<_>>()).enumerate();
            let wide = plan.rows().next_multiple_of(LANES);
            rows.push(Rows {
                ways: [own(&one, &other), own(&other, &one), shared],
                wide,
                start,
                beside: beside.filter(|(_, runs)| !runs.is_empty()).collect(),
                forces: [[[0.0; WIDE]; 6]; 2],
                gamma: [0.0; WIDE],
            });
            start += wide * plan.places.len();
        }
        let stride = plans.iter().map(Plan::rows).sum::<usize>().next_multiple_of(WIDE) + WIDE;
        let zeros = |n: usize| vec![0.0; n * stride];
        let (x, [whole, rest], [J, Y, YD]) = (zeros(1), [zeros(6), zeros(6)], [zeros(nv), zeros(nv), zeros(nv)]);
        let all = All { root, nv, stride, whole, rest, x, J, Y, YD };
        Some(Box::new(Self { rows, Y: vec![0.0; start], YD: vec![0.0; start], all }))
    }
}
