//! What the algorithms see of a tree of bodies.

use crate::joint::Joint;
use crate::model::{Body, Mimic, Model};
use condyle_spatial::{Act, Inertia, Mat3, Se3, Vec3};

/// A body as the algorithms see it: the axis of its joint turned to z, all that a pass needs side by side.
#[derive(Clone, Debug)]
pub struct Node<R> {
    pub joint: Joint,
    pub parent: usize,
    pub idx_q: usize,
    pub idx_v: usize,
    pub mimic: Option<Mimic>,
    /// The place of the joint's first column.
    pub column: usize,
    /// Where the columns from the root to this joint stand in `Model::support`, and how many they are.
    pub support: usize,
    pub depth: usize,
    /// How many bodies are between it and the world, itself included.
    pub level: usize,
    /// Where in `Model::finished` the bodies stand of whose subtrees this is the last.
    pub finished: (usize, usize),
    /// X_T, between turned frames.
    pub placement: Se3<R>,
    /// In the turned frame.
    pub inertia: Inertia<R>,
    /// bRz: the turned frame in the body's.
    pub reframing: Mat3<f64>,
}

/// A degree of freedom of a joint, and the coordinate that it follows.
#[derive(Clone, Debug)]
pub struct Column {
    pub coordinate: usize,
    pub ratio: f64,
    /// The column before it on the way to the root.
    pub parent: Option<usize>,
    /// One past the last column of its subtree.
    pub end: usize,
    /// How many columns are between it and the root.
    pub depth: usize,
}

/// The coordinates that the motion of one of them needs efforts of.
#[derive(Clone, Debug)]
pub struct Coupled {
    /// Those before and after it in the tree, itself included.
    pub rows: Vec<usize>,
    /// How many coordinates in a row, from this one on, have the same ones.
    pub alike: usize,
}

impl Model {
    /// Derives from the bodies what the algorithms see: turned frames, columns, and each body's ancestors.
    pub fn add_nodes(&mut self) {
        let mut last_column: Vec<Option<usize>> = Vec::new(); // of each body or, failing one, of its ancestors
        for (i, body) in self.bodies.iter().enumerate() {
            let reframing = body.joint.reframing();
            let bXz = Se3::new(reframing, Vec3::zero());
            let leads = |b: &&Body| b.mimic.is_none() && b.idx_v == body.idx_v;
            let (joint, offset) = match body.mimic {
                None => (body.joint, Se3::identity()),
                Some(mimic) => {
                    let leader = self.bodies[1..].iter().find(leads).expect("a mimic joint follows a joint");
                    let joint = body.joint.following(leader.joint, mimic).expect("the builder has checked it");
                    (joint, joint.offset(mimic))
                }
            };
            let pXz = if i == 0 { Se3::identity() } else { Se3::new(self.nodes[body.parent].reframing, Vec3::zero()) };
            let first = self.columns.len();
            let mut path = Vec::new();
            if i > 0 {
                let mut parent = last_column[body.parent];
                for k in 0..body.joint.nv() {
                    let depth = parent.map_or(0, |p| self.columns[p].depth + 1);
                    let ratio = body.mimic.map_or(1.0, |m| m.ratio);
                    self.columns.push(Column { coordinate: body.idx_v + k, ratio, parent, end: 0, depth });
                    parent = Some(first + k);
                }
                path.extend(std::iter::successors(parent, |&c| self.columns[c].parent));
                path.reverse();
                last_column.push(parent);
            } else {
                last_column.push(None);
            }
            self.nodes.push(Node {
                joint,
                parent: body.parent,
                idx_q: body.idx_q,
                idx_v: body.idx_v,
                mimic: body.mimic,
                column: first,
                support: self.support.len(),
                depth: path.len(),
                level: if i == 0 { 0 } else { self.nodes[body.parent].level + 1 },
                finished: (0, 0),
                placement: pXz.inverse() * body.placement * bXz * offset,
                inertia: bXz.act_inv(body.inertia),
                reframing,
            });
            self.support.extend(path);
        }
        // depth first: a body at whose end no child stands finishes itself, and all ancestors of which it is the last
        let mut unfinished = Vec::new();
        for i in 1..self.nodes.len() {
            unfinished.push(i);
            let next = self.nodes.get(i + 1).map_or(0, |next| next.level.saturating_sub(1));
            let first = self.finished.len();
            self.finished.extend(unfinished.drain(next..).rev());
            self.nodes[i].finished = (first, self.finished.len());
        }
        // depth first, so a subtree's columns end where its last descendant's do
        for c in (0..self.columns.len()).rev() {
            self.columns[c].end = self.columns[c].end.max(c + 1);
            if let Some(p) = self.columns[c].parent {
                self.columns[p].end = self.columns[p].end.max(self.columns[c].end);
            }
        }
        let coupled = |c: usize| {
            let mut rows: Vec<usize> = std::iter::successors(Some(c), |&c| self.columns[c].parent).collect();
            rows.reverse();
            rows.extend(c + 1..self.columns[c].end);
            rows
        };
        // Fowler, Noll, Vo (1991): FNV-1a
        let structure = self.columns.iter().flat_map(|c| [c.coordinate, c.parent.map_or(0, |p| p + 1)]);
        let structure = structure.chain(self.nodes.iter().flat_map(|n| [n.parent, n.column]));
        self.tree = structure.fold(0xcbf2_9ce4_8422_2325, |hash, x| (hash ^ x as u64).wrapping_mul(0x100_0000_01b3));
        let all = || (0..self.nv).collect(); // joints that follow tie branches together
        let rows = (0..self.nv).map(|c| if self.has_mimic() { all() } else { coupled(c) });
        self.coupled = Coupled::with(rows.collect());
    }
}

impl Coupled {
    /// Of each coordinate, with these rows.
    pub fn with(rows: Vec<Vec<usize>>) -> Vec<Self> {
        let alike = |c: usize| rows[c..].iter().take_while(|other| **other == rows[c]).count();
        (0..rows.len()).map(|c| Self { rows: rows[c].clone(), alike: alike(c) }).collect()
    }
}

impl AsRef<[usize]> for Coupled {
    fn as_ref(&self) -> &[usize] {
        &self.rows
    }
}
