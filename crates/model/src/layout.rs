//! Layouts: the interface through which passes of algorithms read a model and a state.
//!
//! Each algorithm is written once, for a [`Layout`]. Only the methods of the traits in this module access the parent of
//! a body, sums over children, and coordinates. So the same source code runs on:
//!
//! - one state: the scalar is `f64` (or `f32`, or a dual number), and constants are `f64`;
//! - several knots of a horizon in parallel lanes: the scalar holds one number for each knot, and constants are
//!   broadcast;
//! - several limbs (branches of the tree) of one robot in parallel lanes: a body of the pass represents one body of
//!   each limb, all with the same kind of joint.
//!
//! The first two cases use [`Single`]. A *column* is a degree of freedom of a joint, and a *coordinate* is an entry of
//! v. Several joints may share a coordinate (mimic joints): v_joint = G v, with one nonzero entry in each row of G.
//! [`joint_velocity`](Layout::joint_velocity) applies G, [`add_joint_effort`](Layout::add_joint_effort) applies Gᵀ, and
//! methods like [`set_row`](Columns::set_row) apply Gᵀ · G. Algorithms contain no other code for shared coordinates.

use crate::joint::Joint;
use crate::joint::revolute_angles::RevoluteAngles;
use crate::model::Model;
use crate::tree::{Node, Tree};
use condyle_spatial::{Act, Constant, Force, Inertia, Scalar, Se3, Vec3};
use core::marker::PhantomData;
use core::ops::{AddAssign, Range};

/// Bodies, joints and coordinates of a pass.
pub trait Layout {
    /// Scalar type of the pass.
    type S: Scalar;

    /// Returns the hash of the tree and of the placements of its joints and frames.
    fn geometry_hash(&self) -> u64;
    /// Returns the bodies in order, parents first. Body 0, the world, is excluded.
    fn bodies(&self) -> Range<usize>;
    /// Returns the kind of the joint that carries body i, with its axis turned to z.
    fn joint(&self, i: usize) -> Joint;
    /// Returns the joints that turn about z.
    fn revolute_angles(&self) -> &RevoluteAngles;
    /// Returns X_T, the placement of joint i: the pose of its frame in the parent's frame.
    fn placement(&self, i: usize) -> Se3<Self::S>;
    /// Returns the inertia of body i in the body's frame.
    fn inertia(&self, i: usize) -> Inertia<Self::S>;
    /// Returns −g, the acceleration of the world that represents the gravity g.
    fn minus_gravity(&self) -> Vec3<Self::S>;
    /// Returns the armature of degree of freedom k of joint i.
    fn armature(&self, i: usize, k: usize) -> Self::S;
    /// Returns the external force on body i; `None` if no forces are given. `f_ext` contains the forces in the public
    /// frames of the bodies.
    fn force(&self, f_ext: &[Force<Self::S>], i: usize) -> Option<Force<Self::S>>;

    /// Returns the entry for the parent of body i, from an array indexed by body.
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T;
    /// Adds x to the entry for the parent of body i, in an array indexed by body.
    fn add_to_parent<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T);

    /// Returns the index of body i on the stack of a depth-first pass. The index is the number of bodies on the path
    /// from the world to the body; the world has index 0. The stack keeps the data of a body until its subtree is
    /// closed.
    fn stack_index(&self, i: usize) -> usize;
    /// Returns the bodies whose subtrees end with body i, each before its parent.
    fn subtrees_ending_at(&self, i: usize) -> &[usize];
    /// Returns the stack entry of the parent of body i.
    fn parent_on_stack<T: Copy>(&self, of: &[T], i: usize) -> T;
    /// Adds x to the stack entry of the parent of body i.
    fn add_to_parent_on_stack<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T);

    /// Replaces x by its sum over the lanes of body i. Each lane may contain a part of the sum over the body's
    /// children.
    fn sum_lanes<T>(&self, i: usize, x: &mut T);

    /// Returns coordinate k of the position of joint i.
    fn position(&self, q: &[Self::S], i: usize, k: usize) -> Self::S;
    /// Returns component k of the velocity (or acceleration) of joint i.
    fn joint_velocity(&self, v: &[Self::S], i: usize, k: usize) -> Self::S;
    /// Adds the effort along degree of freedom k of joint i to the coordinate of this joint. This function is the
    /// transpose of `joint_velocity`.
    fn add_joint_effort(&self, tau: &mut [Self::S], i: usize, k: usize, effort: Self::S);

    /// Returns the index of the first column of joint i, for arrays indexed by column.
    fn column(&self, i: usize) -> usize;
    /// Adds armature times acceleration to the efforts of all coordinates.
    fn add_armature_torque(&self, a: &[Self::S], tau: &mut [Self::S]);
}

/// Access to the columns from the root to a joint, and to the matrix entries of these columns with the joint's own
/// columns.
///
/// Matrices have a row and a column for each coordinate. They are stored column by column.
pub trait Columns: Layout {
    /// Identifier of a column in the support of a joint: the columns from the root to this joint.
    type Column: Copy;
    /// Identifier of a column of a joint itself.
    type OwnColumn: Copy;
    /// Scalar type of matrices.
    type Number: Scalar;

    /// Returns the columns of all joints from the root to joint i. The columns of joint i itself come last.
    fn support(&self, i: usize) -> &[Self::Column];
    /// Returns column k of joint i.
    fn own_column(&self, i: usize, k: usize) -> Self::OwnColumn;
    /// Returns the entry for a column, from an array indexed by column.
    fn at<T: Copy>(&self, of: &[T], column: Self::Column) -> T;
    /// Copies entries of an array indexed by column to the indices from which `at` reads. A layout in which the indices
    /// are equal copies nothing.
    fn broadcast<T: Copy>(&self, of: &mut [T]);
    /// Prepares a matrix for `set_row` and `set_column`. Entries that are never set are 0.
    fn clear(&self, matrix: &mut [Self::Number]);
    /// Sets the entry in the row of a joint's own column and in column e of its support. If several columns share the
    /// entry, adds the value to the entry. The function must be called once for each pair of columns. The last call
    /// must be for the last column of the first body, paired with itself.
    fn set_row(&self, matrix: &mut [Self::Number], own: Self::OwnColumn, e: Self::Column, value: Self::S);
    /// Sets the entry in row e and in the column of a joint's own column, as `set_row` does.
    fn set_column(&self, matrix: &mut [Self::Number], own: Self::OwnColumn, e: Self::Column, value: Self::S);
    /// Adds the armature of all coordinates to the diagonal of a matrix.
    fn add_armature(&self, matrix: &mut [Self::Number]);
}

/// Access to the matrix entry of any pair of columns.
pub trait Pairs: Columns<Number = <Self as Layout>::S> {
    /// Sets the entry (row, column) of a matrix after `clear`. If several columns share the entry, adds the value to
    /// the entry. The function must be called once for each pair of columns.
    fn set_entry(&self, matrix: &mut [Self::S], row: Self::Column, column: Self::Column, value: Self::S);
    /// Adds to the entry (row, column) of a matrix.
    fn add_entry(&self, matrix: &mut [Self::S], row: Self::Column, column: Self::Column, value: Self::S);
}

/// Layout that computes one body at a time, for one state or for several knots of a horizon in the lanes of the scalar.
pub struct Single<'m, S, R> {
    /// Data of each body that passes need in every step. The layout holds these references so that the compiler does
    /// not reload them from the model after every store.
    nodes: &'m [Node<R>],
    closed: &'m [usize],
    revolute_angles: &'m RevoluteAngles,
    support: &'m [usize],
    armature: &'m [R],
    tree: &'m Tree<R>,
    gravity: &'m Vec3<R>,
    nv: usize,
    has_mimic: bool,
    geometry: u64,
    scalar: PhantomData<S>,
}

impl<'m, S: Scalar, R: Constant<S>> Single<'m, S, R> {
    /// Creates the layout of a model.
    #[inline(always)]
    pub fn new(model: &'m Model<R>) -> Self {
        let Model { tree, armature, gravity, geometry, .. } = model;
        let Tree { nodes, closed, revolute_angles, support, nv, .. } = tree;
        let (nv, has_mimic, geometry) = (*nv, tree.has_mimic(), *geometry);
        Self {
            nodes,
            closed,
            revolute_angles,
            support,
            armature,
            tree,
            gravity,
            nv,
            has_mimic,
            geometry,
            scalar: PhantomData,
        }
    }
}

impl<S: Scalar, R: Constant<S>> Layout for Single<'_, S, R> {
    type S = S;

    #[inline(always)]
    fn geometry_hash(&self) -> u64 {
        self.geometry
    }
    #[inline(always)]
    fn bodies(&self) -> Range<usize> {
        1..self.nodes.len()
    }
    #[inline(always)]
    fn joint(&self, i: usize) -> Joint {
        self.nodes[i].joint
    }
    #[inline(always)]
    fn revolute_angles(&self) -> &RevoluteAngles {
        self.revolute_angles
    }
    #[inline(always)]
    fn placement(&self, i: usize) -> Se3<S> {
        self.nodes[i].placement.lift()
    }
    #[inline(always)]
    fn inertia(&self, i: usize) -> Inertia<S> {
        self.nodes[i].inertia.lift()
    }
    #[inline(always)]
    fn minus_gravity(&self) -> Vec3<S> {
        -self.gravity.lift()
    }
    #[inline(always)]
    fn armature(&self, i: usize, k: usize) -> S {
        self.armature[self.nodes[i].idx_v + k].lift()
    }
    #[inline(always)]
    fn force(&self, f_ext: &[Force<S>], i: usize) -> Option<Force<S>> {
        let &f = f_ext.get(i)?; // `map` would not be inlined
        Some(Se3::new(self.nodes[i].axis_rotation, Vec3::zero()).lift().act_inv(f))
    }

    #[inline(always)]
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T {
        of[self.nodes[i].parent]
    }
    #[inline(always)]
    fn add_to_parent<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        onto[self.nodes[i].parent] += x;
    }

    #[inline(always)]
    fn stack_index(&self, i: usize) -> usize {
        self.nodes[i].body_depth
    }
    #[inline(always)]
    fn subtrees_ending_at(&self, i: usize) -> &[usize] {
        let (first, end) = self.nodes[i].closed;
        &self.closed[first..end]
    }
    #[inline(always)]
    fn parent_on_stack<T: Copy>(&self, of: &[T], i: usize) -> T {
        of[self.nodes[i].body_depth - 1]
    }
    #[inline(always)]
    fn add_to_parent_on_stack<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        onto[self.nodes[i].body_depth - 1] += x;
    }
    #[inline(always)]
    fn sum_lanes<T>(&self, _: usize, _: &mut T) {}

    #[inline(always)]
    fn position(&self, q: &[S], i: usize, k: usize) -> S {
        let node = &self.nodes[i];
        match node.mimic {
            None => q[node.idx_q + k],
            Some(mimic) => node.joint.mimic_position(mimic, &q[node.idx_q..], k),
        }
    }
    #[inline(always)]
    fn joint_velocity(&self, x: &[S], i: usize, k: usize) -> S {
        let node = &self.nodes[i];
        match node.mimic {
            None => x[node.idx_v + k],
            Some(mimic) => x[node.idx_v + k] * S::splat(mimic.ratio),
        }
    }
    #[inline(always)]
    fn add_joint_effort(&self, x: &mut [S], i: usize, k: usize, value: S) {
        let node = &self.nodes[i];
        match node.mimic {
            None => x[node.idx_v + k] += value,
            Some(mimic) => x[node.idx_v + k] += value * S::splat(mimic.ratio),
        }
    }

    #[inline(always)]
    fn column(&self, i: usize) -> usize {
        self.nodes[i].column
    }
    #[inline(always)]
    fn add_armature_torque(&self, a: &[S], tau: &mut [S]) {
        for (k, &armature) in self.armature.iter().enumerate() {
            tau[k] += armature.lift() * a[k];
        }
    }
}

impl<S: Scalar, R: Constant<S>> Columns for Single<'_, S, R> {
    type Column = usize;
    type OwnColumn = usize;
    type Number = S;

    #[inline(always)]
    fn support(&self, i: usize) -> &[usize] {
        let node = &self.nodes[i];
        &self.support[node.support..node.support + node.depth]
    }
    #[inline(always)]
    fn own_column(&self, i: usize, k: usize) -> usize {
        self.column(i) + k
    }
    #[inline(always)]
    fn at<T: Copy>(&self, of: &[T], column: usize) -> T {
        of[column]
    }
    #[inline(always)]
    fn broadcast<T: Copy>(&self, _: &mut [T]) {}
    #[inline(always)]
    fn clear(&self, matrix: &mut [S]) {
        if self.has_mimic {
            matrix.fill(S::zero());
        }
    }
    #[inline(always)]
    fn set_row(&self, matrix: &mut [S], own: usize, e: usize, value: S) {
        self.set_entry(matrix, own, e, value);
    }
    #[inline(always)]
    fn set_column(&self, matrix: &mut [S], own: usize, e: usize, value: S) {
        self.set_entry(matrix, e, own, value);
    }
    #[inline(always)]
    fn add_armature(&self, matrix: &mut [S]) {
        for (k, &armature) in self.armature.iter().enumerate() {
            matrix[k * (self.nv + 1)] += armature.lift();
        }
    }
}

impl<S: Scalar, R: Constant<S>> Pairs for Single<'_, S, R> {
    #[inline(always)]
    fn set_entry(&self, matrix: &mut [S], row: usize, column: usize, value: S) {
        if self.has_mimic {
            self.add_entry(matrix, row, column, value);
        } else {
            matrix[row + self.nv * column] = value;
        }
    }
    #[inline(always)]
    fn add_entry(&self, matrix: &mut [S], row: usize, column: usize, value: S) {
        if self.has_mimic {
            let (r, c) = (&self.tree.columns[row], &self.tree.columns[column]);
            matrix[r.coordinate + self.nv * c.coordinate] += value * S::splat(r.ratio * c.ratio);
        } else {
            matrix[row + self.nv * column] += value;
        }
    }
}
