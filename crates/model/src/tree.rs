//! Tree of bodies for the passes of algorithms. Each joint's frame is turned such that the joint's axis is z. The tree
//! also lists columns and ancestors.
//!
//! A *column* is a degree of freedom of a joint; a *coordinate* is an entry of v. A joint that mimics another joint
//! uses the coordinate of that joint, so several columns may have the same coordinate.

use crate::body::Body;
use crate::joint::revolute_angles::RevoluteAngles;
use crate::joint::{Joint, Mimic};
use alloc::vec::Vec;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_spatial::{Act, Inertia, Mat3, Se3, Vec3};
use core::iter::successors;
use core::ops::Range;

/// Body for the passes of algorithms: the axis of its joint is turned to z, and all data that a pass needs are stored
/// together.
#[derive(Clone, Debug)]
pub struct Node<R> {
    /// Kind of joint with which the body is computed.
    pub joint: Joint,
    /// Index of the parent.
    pub parent: usize,
    /// Index in q of the joint's first coordinate.
    pub idx_q: usize,
    /// Index in v of the joint's first degree of freedom.
    pub idx_v: usize,
    /// Relation to the leading joint, if the joint follows another joint.
    pub mimic: Option<Mimic>,
    /// Index of the joint's first column.
    pub column: usize,
    /// Index in `Tree::support` of the first column on the path from the root to this joint.
    pub support: usize,
    /// Number of columns on the path from the root to this joint, including the columns of this joint.
    pub depth: usize,
    /// Depth of the body: the number of bodies on the path from the world to this body, including this body.
    pub body_depth: usize,
    /// Range (first, end) in `Tree::closed` of the bodies whose subtrees end with this body.
    pub closed: (usize, usize),
    /// X_T: pose of the joint's frame in the parent's frame, where each frame is turned such that the axis of its joint
    /// is z.
    pub placement: Se3<R>,
    /// Inertia in the turned frame.
    pub inertia: Inertia<R>,
    /// bRz: rotation from the turned frame to the body's frame.
    pub axis_rotation: Mat3<f64>,
}

/// Degree of freedom of a joint, and the coordinate to which it belongs.
#[derive(Clone, Debug)]
pub struct Column {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// Ratio of the velocity of the joint to the velocity of the coordinate.
    pub ratio: f64,
    /// Next column on the path to the root.
    pub parent: Option<usize>,
    /// Index after the last column of this column's subtree.
    pub end: usize,
    /// Number of columns on the path from the root to this column, without this column.
    pub depth: usize,
}

condyle_spatial::same_layout!(Column);

/// Range of coordinates of one joint, or of several consecutive joints whose positions are vectors.
#[derive(Clone, Debug)]
pub(crate) struct Space {
    /// Joint of these coordinates; for several joints, one of them.
    pub joint: Joint,
    pub q: Range<usize>,
    pub v: Range<usize>,
}

/// Bodies and joints of a robot, with turned joint frames, for the passes of algorithms.
#[derive(Clone, Debug)]
pub(crate) struct Tree<R> {
    pub nq: usize,
    pub nv: usize,
    /// Bodies, including the world.
    pub nodes: Vec<Node<R>>,
    pub columns: Vec<Column>,
    /// Columns on the path from the root to the joint of each body, one body after the other.
    pub support: Vec<usize>,
    /// Bodies, children before parents.
    pub closed: Vec<usize>,
    /// Joints that turn about z.
    pub revolute_angles: RevoluteAngles,
    /// Nonzero rows of each column of the inertia matrix: the coordinate itself, its ancestors and its descendants in
    /// the tree. Length: nv.
    pub nonzero_rows: Vec<NonzeroRows>,
    /// Ranges of the coordinates of all joints, in order. The ranges of consecutive joints whose positions are vectors
    /// are merged.
    pub spaces: Vec<Space>,
    /// Hash of the parents, joints and coordinates. Different trees have different hashes.
    pub hash: u64,
}

/// Returns a hash of numbers. The method is FNV-1a (Fowler, Noll, Vo 1991), applied to 64-bit words instead of bytes.
pub(crate) fn hash(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        let hash = (hash ^ word).wrapping_mul(0x100_0000_01b3);
        hash ^ (hash >> 29) // lets the high bits change the low bits of the hash
    })
}

impl Tree<f64> {
    /// Creates the tree of bodies, which are in depth-first order and whose coordinates are already numbered.
    pub(crate) fn new(bodies: &[Body], nq: usize, nv: usize) -> Self {
        let mut tree = Self {
            nq,
            nv,
            nodes: Vec::with_capacity(bodies.len()),
            columns: Vec::new(),
            support: Vec::new(),
            closed: Vec::new(),
            revolute_angles: RevoluteAngles::default(),
            nonzero_rows: Vec::new(),
            spaces: Vec::new(),
            hash: 0,
        };
        tree.add_nodes(bodies);
        tree.close_subtrees();
        tree.revolute_angles =
            RevoluteAngles::of(tree.nodes[1..].iter().map(|n| (n.joint, n.idx_q, n.mimic.is_some())));
        tree.add_nonzero_rows();
        tree.add_spaces();
        let structure = tree.columns.iter().flat_map(|c| [c.coordinate, c.parent.map_or(0, |p| p + 1)]);
        let structure = structure.chain(tree.nodes.iter().flat_map(|n| [n.parent, n.column]));
        let kinds = tree.nodes.iter().flat_map(|n| n.joint.kind().bytes().map(u64::from));
        tree.hash = hash(structure.map(|x| x as u64).chain(kinds));
        tree
    }

    fn add_nodes(&mut self, bodies: &[Body]) {
        // The last column of each body. A body without columns has the last column of its parent.
        let mut last_column: Vec<Option<usize>> = Vec::new();
        for (i, body) in bodies.iter().enumerate() {
            let axis_rotation = body.joint.axis_rotation();
            let bXz = Se3::new(axis_rotation, Vec3::zero());
            let leads = |b: &&Body| b.mimic.is_none() && b.idx_v == body.idx_v;
            let (joint, offset) = match body.mimic {
                None => (body.joint, Se3::identity()),
                Some(mimic) => {
                    let leader = bodies[1..].iter().find(leads).expect("a mimic joint follows a joint");
                    let joint = body.joint.as_follower(leader.joint, mimic).expect("the builder has checked it");
                    (joint, joint.mimic_offset(mimic))
                }
            };
            let (mut pXz, mut body_depth) = (Se3::identity(), 0);
            let first = self.columns.len();
            let mut parent = None;
            if i > 0 {
                pXz = Se3::new(self.nodes[body.parent].axis_rotation, Vec3::zero());
                body_depth = self.nodes[body.parent].body_depth + 1;
                parent = last_column[body.parent];
                for k in 0..body.joint.nv() {
                    let depth = parent.map_or(0, |p| self.columns[p].depth + 1);
                    let ratio = body.mimic.map_or(1.0, |m| m.ratio);
                    self.columns.push(Column { coordinate: body.idx_v + k, ratio, parent, end: 0, depth });
                    parent = Some(first + k);
                }
            }
            last_column.push(parent);
            let mut path: Vec<usize> = successors(parent, |&c| self.columns[c].parent).collect();
            path.reverse();
            self.nodes.push(Node {
                joint,
                parent: body.parent,
                idx_q: body.idx_q,
                idx_v: body.idx_v,
                mimic: body.mimic,
                column: first,
                support: self.support.len(),
                depth: path.len(),
                body_depth,
                closed: (0, 0),
                placement: pXz.inverse() * body.placement * bXz * offset,
                inertia: bXz.act_inv(body.inertia),
                axis_rotation,
            });
            self.support.extend(path);
        }
        // In depth-first order, the last columns of a subtree belong to its last descendant.
        for c in (0..self.columns.len()).rev() {
            self.columns[c].end = self.columns[c].end.max(c + 1);
            if let Some(p) = self.columns[c].parent {
                self.columns[p].end = self.columns[p].end.max(self.columns[c].end);
            }
        }
    }

    /// Finds the bodies whose subtrees end with each body. In depth-first order, a body without children closes its own
    /// subtree. Such a body also closes the subtrees of all ancestors whose last descendant it is.
    fn close_subtrees(&mut self) {
        let mut open = Vec::new();
        for i in 1..self.nodes.len() {
            open.push(i);
            let next = self.nodes.get(i + 1).map_or(0, |next| next.body_depth.saturating_sub(1));
            let first = self.closed.len();
            self.closed.extend(open.drain(next..).rev());
            self.nodes[i].closed = (first, self.closed.len());
        }
    }

    fn add_nonzero_rows(&mut self) {
        let related = |c: usize| {
            let mut rows: Vec<usize> = successors(Some(c), |&c| self.columns[c].parent).collect();
            rows.reverse();
            rows.extend(c + 1..self.columns[c].end);
            rows
        };
        let all = || (0..self.nv).collect(); // followers couple the branches, so M is full
        let rows = (0..self.nv).map(|c| if self.has_mimic() { all() } else { related(c) });
        self.nonzero_rows = NonzeroRows::of_columns(rows.collect());
    }

    fn add_spaces(&mut self) {
        let is_vector = |joint: Joint| joint.nq() == joint.nv();
        let mut spaces: Vec<Space> = Vec::new();
        for (joint, q, v) in self.coordinates() {
            match spaces.last_mut() {
                Some(last)
                    if is_vector(last.joint) && is_vector(joint) && (last.q.end, last.v.end) == (q.start, v.start) =>
                {
                    (last.q.end, last.v.end) = (q.end, v.end);
                }
                _ => spaces.push(Space { joint, q, v }),
            }
        }
        self.spaces = spaces;
    }
}

impl<R> Tree<R> {
    /// Returns the first coordinate of each free joint.
    pub(crate) fn free_joints(&self) -> impl Iterator<Item = usize> {
        self.nodes[1..].iter().filter(|node| node.joint == Joint::FreeFlyer).map(|node| node.idx_v)
    }

    /// Returns whether some joints share a coordinate.
    #[inline(always)]
    pub(crate) fn has_mimic(&self) -> bool {
        self.columns.len() != self.nv
    }

    /// Returns the columns on the path from the root to the joint of a body. The columns of this joint come last.
    #[inline(always)]
    pub(crate) fn support(&self, node: &Node<R>) -> &[usize] {
        &self.support[node.support..node.support + node.depth]
    }

    /// Returns the joints that have their own coordinates, with their ranges in q and in v.
    pub(crate) fn coordinates(&self) -> impl Iterator<Item = (Joint, Range<usize>, Range<usize>)> + '_ {
        let own = self.nodes.iter().skip(1).filter(|n| n.mimic.is_none());
        own.map(|n| (n.joint, n.idx_q..n.idx_q + n.joint.nq(), n.idx_v..n.idx_v + n.joint.nv()))
    }

    /// Returns the same tree with constants of another type. One function converts placements, and another function
    /// returns the inertia of a body.
    pub(crate) fn map<T>(
        &self,
        lift: impl Fn(Se3<R>) -> Se3<T>,
        mut inertia: impl FnMut(usize) -> Inertia<T>,
    ) -> Tree<T>
    where
        R: Copy,
    {
        let node = |(i, n): (usize, &Node<R>)| Node {
            joint: n.joint,
            parent: n.parent,
            idx_q: n.idx_q,
            idx_v: n.idx_v,
            mimic: n.mimic,
            column: n.column,
            support: n.support,
            depth: n.depth,
            body_depth: n.body_depth,
            closed: n.closed,
            placement: lift(n.placement),
            inertia: inertia(i),
            axis_rotation: n.axis_rotation,
        };
        Tree {
            nq: self.nq,
            nv: self.nv,
            nodes: self.nodes.iter().enumerate().map(node).collect(),
            columns: self.columns.clone(),
            support: self.support.clone(),
            closed: self.closed.clone(),
            revolute_angles: self.revolute_angles.clone(),
            nonzero_rows: self.nonzero_rows.clone(),
            spaces: self.spaces.clone(),
            hash: self.hash,
        }
    }
}
