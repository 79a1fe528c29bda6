//! Scratch of constrained dynamics for a robot with limbs (`lanes/limbs/constrained.rs`): arrays for the constraints of
//! one set.

use crate::constraints::plan::Plan;
use alloc::boxed::Box;
use alloc::vec::Vec;
use condyle_model::Model;
use condyle_model::limbs::LANES;
use condyle_spatial::gate::is;

/// Maximum number of constraint rows in parallel lanes: one or two vectors.
pub(crate) const WIDE: usize = 2 * LANES;

/// Body on the path from a constraint's frame to the root.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub body: usize,
    /// Number of columns of the body's joint (`nv`), and index of the first column's slot among the slots of the
    /// constraint (`at`).
    pub nv: usize,
    pub at: usize,
}

/// Paths, slots and forces of the rows of one constraint.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// Three paths towards the root, which exclude the root: from the first frame's body to the junction of both paths,
    /// from the other frame's body to this junction, and from the junction to the root.
    pub ways: [Vec<Link>; 3],
    /// Number of values per slot in `Y` (`wide`), and index in `Y` of the first value of slot 0 (`start`).
    pub wide: usize,
    pub start: usize,
    /// Constraints that share slots with this constraint, apart from the slots of the root: earlier constraints and
    /// this constraint itself. Each entry has the index of a constraint and the runs of shared slots, as in `Plan`.
    pub beside: Vec<(usize, Vec<[usize; 3]>)>,
    /// Unit forces of the constraint's rows on the bodies of both frames, in the world's frame. Written by: `begin`.
    pub forces: [[[f64; WIDE]; 6]; 2],
    /// Terms γ' of the constraint accelerations γ: all terms except the terms of the bodies' accelerations. Written by:
    /// `begin`.
    pub gamma: [f64; WIDE],
}

/// Quantities of the rows of all constraints. Each array has one number per row and is padded with zeros to a whole
/// number of vectors. One more vector of zeros follows.
#[derive(Clone, Debug)]
pub(crate) struct All {
    /// Body that carries all other bodies, or 0 if such a body does not exist (`root`), and number of columns of this
    /// body's joint (`nv`).
    pub root: usize,
    pub nv: usize,
    pub stride: usize,
    /// Forces on the root: the sum of the unit forces on all bodies that the root carries (`whole`), and the portion of
    /// this sum that the joints of these bodies transmit to the root (`rest`). Shape: 6 × stride. Written by: `carry`.
    pub whole: Vec<f64>,
    pub rest: Vec<f64>,
    /// Constraint accelerations J q̈ + γ for λ = 0, which the constraint forces λ overwrite. Shape: stride. Written by:
    /// `carry`, `carry_on`, `constrained.rs`.
    pub x: Vec<f64>,
    /// Columns of the root's joint in three matrices (see `lanes/limbs/constrained.rs`): the constraint Jacobian J, the
    /// joint efforts Y of the rows' unit forces, and Y D⁻¹. Shape: nv × stride. Written by: `carry_on`.
    pub J: Vec<f64>,
    pub Y: Vec<f64>,
    pub YD: Vec<f64>,
}

/// Scratch for all constraints of a set.
#[derive(Clone, Debug)]
pub(crate) struct ConstraintLanes {
    pub(crate) rows: Vec<Rows>,
    /// Joint efforts Y of the rows' unit forces, and Y D⁻¹ (see `lanes/limbs/constrained.rs`), in the slots of all
    /// constraints. Shape: for each constraint, its number of slots × `wide`. Written by: `carry`.
    pub(crate) Y: Vec<f64>,
    pub(crate) YD: Vec<f64>,
    pub(crate) all: All,
}

impl ConstraintLanes {
    /// Returns the scratch for a robot with limbs but without mimic joints, if all constraints are of the kind point or
    /// rigid.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>, plans: &[Plan]) -> Option<Box<Self>> {
        // The passes over lanes need a multiple of three rows per constraint.
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
            // The slots of the root have the lowest indices. They are excluded from each run of shared slots.
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
