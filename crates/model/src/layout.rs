//! How one pass of an algorithm sees model and state.
//!
//! An algorithm is written once, over [`Layout`]. It reaches its parent, its children's sums and its coordinates only
//! through the verbs below, so that one source runs on
//!
//! - one state: the scalar is `f64` (or `f32`, or a dual number), the constants are `f64`;
//! - several knots of a horizon side by side: the scalar holds a number for each knot, the constants are broadcast;
//! - the limbs of one robot side by side: a body of the pass stands for a body of each limb, all of one joint kind.
//!
//! The first two are [`Single`]. A *column* is a degree of freedom of a joint, a *coordinate* an entry of v: several
//! joints may share a coordinate (mimic joints), v_joint = G v with one entry in each row of G. [`joint_velocity`](Layout::joint_velocity)
//! applies G, [`add_joint_effort`](Layout::add_joint_effort), [`set_row`](Columns::set_row) and their like apply Gᵀ and Gᵀ · G, and no algorithm knows
//! more.

use crate::joint::Joint;
use crate::model::Model;
use condyle_spatial::{Act, Constant, Force, Inertia, Scalar, Se3};
use core::marker::PhantomData;
use core::ops::{AddAssign, Range};

/// How one pass sees model and state.
pub trait Layout {
    /// The number that the pass computes with.
    type S: Scalar;

    /// The bodies in order, parents first; 0 is the world and not among them.
    fn bodies(&self) -> Range<usize>;
    /// The kind of joint that carries body i, its axis turned to z.
    fn joint(&self, i: usize) -> Joint;
    /// X_T: the joint's frame in the parent's.
    fn placement(&self, i: usize) -> Se3<Self::S>;
    /// The body's inertia in its frame.
    fn inertia(&self, i: usize) -> Inertia<Self::S>;
    /// The acceleration of the world that stands for gravity, −g.
    fn minus_gravity(&self) -> condyle_spatial::Vec3<Self::S>;
    /// The armature at degree of freedom k of joint i.
    fn armature(&self, i: usize, k: usize) -> Self::S;
    /// The external force on body i, given per body in the body's public frame (or none at all).
    fn force(&self, f_ext: &[Force<Self::S>], i: usize) -> Option<Force<Self::S>>;

    /// The parent's entry.
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T;
    /// Adds to the parent's entry.
    fn add_to_parent<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T);

    /// The place of body i among those on its way from the world, which has place 0: where a pass that goes down and up
    /// the branches, one after the other, keeps what it needs of a body while its subtree is not finished.
    fn stack_index(&self, i: usize) -> usize;
    /// The bodies whose subtrees are finished when the pass has gone down to body i: children before parents.
    fn closed_by(&self, i: usize) -> &[usize];
    /// The parent's entry in an array by levels.
    fn parent_on_stack<T: Copy>(&self, of: &[T], i: usize) -> T;
    /// Adds to the parent's entry in an array by levels.
    fn add_to_parent_on_stack<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T);

    /// What the copies of body i hold together: a body may stand in several lanes, each with a part of what it carries.
    fn sum_lanes<T: Copy>(&self, i: usize, x: T) -> T;
    /// The same in an array by bodies, in its place.
    #[inline(always)]
    fn sum_lanes_at<T: Copy>(&self, of: &mut [T], i: usize) {
        of[i] = self.sum_lanes(i, of[i]);
    }

    /// The k-th number of the position of joint i.
    fn position(&self, q: &[Self::S], i: usize, k: usize) -> Self::S;
    /// The k-th number of the velocity (or acceleration, or effort) of joint i.
    fn joint_velocity(&self, x: &[Self::S], i: usize, k: usize) -> Self::S;
    /// Adds to the coordinate of degree of freedom k of joint i: the transpose of `joint_velocity`.
    fn add_joint_effort(&self, x: &mut [Self::S], i: usize, k: usize, value: Self::S);

    /// The first of the places of joint i's columns, in an array with an entry for each column.
    fn column(&self, i: usize) -> usize;
    /// Armature times acceleration, added to the coordinates of an effort.
    fn add_armature_torque(&self, a: &[Self::S], tau: &mut [Self::S]);
}

/// How a pass sees the columns before a joint, and the entries of matrices in coordinates, stored by columns, that it has
/// with them.
pub trait Columns: Layout {
    /// Names a column, in the list of a body's ancestors.
    type Column: Copy;
    /// Names a column of a body's own joint.
    type OwnColumn: Copy;
    /// What the matrices are made of.
    type Number: Scalar;

    /// The columns of all joints from the root to joint i, its own last.
    fn support(&self, i: usize) -> &[Self::Column];
    /// Column k of joint i.
    fn own_column(&self, i: usize, k: usize) -> Self::OwnColumn;
    /// The entry of a column.
    fn at<T: Copy>(&self, of: &[T], column: Self::Column) -> T;
    /// Takes the entries of all columns to where `at` looks for them, if that is elsewhere.
    fn broadcast<T: Copy>(&self, of: &mut [T]);
    /// Makes a matrix ready for `set_row` and `set_column`. What no column of a joint puts there stays 0.
    fn clear(&self, matrix: &mut [Self::Number]);
    /// Sets the entry of such a matrix in the row of a joint's own column and in the column e of its support, or adds to it
    /// if several columns share it. Once for each pair of columns; that of the first body's last column with itself comes
    /// last of all.
    fn set_row(&self, matrix: &mut [Self::Number], own: Self::OwnColumn, e: Self::Column, value: Self::S);
    /// The same for the entry in the row of e and in the own column.
    fn set_column(&self, matrix: &mut [Self::Number], own: Self::OwnColumn, e: Self::Column, value: Self::S);
    /// The armature of all coordinates, added to the diagonal of such a matrix.
    fn add_armature(&self, matrix: &mut [Self::Number]);
}

/// How a pass sees any pair of columns.
pub trait Pairs: Columns<Number = <Self as Layout>::S> {
    /// Sets the entry (row, column) of a matrix in coordinates after `clear`, or adds to it if several columns share it.
    /// Once for each pair of columns.
    fn set_entry(&self, matrix: &mut [Self::S], row: Self::Column, column: Self::Column, value: Self::S);
    /// Adds to the entry (row, column) of a matrix in coordinates, stored by columns.
    fn add_entry(&self, matrix: &mut [Self::S], row: Self::Column, column: Self::Column, value: Self::S);
}

/// One body at a time: one state, or several knots of a horizon in the lanes of the scalar.
pub struct Single<'m, S, R> {
    model: &'m Model<R>,
    scalar: PhantomData<S>,
}

impl<'m, S: Scalar, R: Constant<S>> Single<'m, S, R> {
    pub fn new(model: &'m Model<R>) -> Self {
        Self { model, scalar: PhantomData }
    }
}

impl<S: Scalar, R: Constant<S>> Layout for Single<'_, S, R> {
    type S = S;

    #[inline(always)]
    fn bodies(&self) -> Range<usize> {
        1..self.model.tree.nodes.len()
    }
    #[inline(always)]
    fn joint(&self, i: usize) -> Joint {
        self.model.tree.nodes[i].joint
    }
    #[inline(always)]
    fn placement(&self, i: usize) -> Se3<S> {
        self.model.tree.nodes[i].placement.lift()
    }
    #[inline(always)]
    fn inertia(&self, i: usize) -> Inertia<S> {
        self.model.tree.nodes[i].inertia.lift()
    }
    #[inline(always)]
    fn minus_gravity(&self) -> condyle_spatial::Vec3<S> {
        -self.model.gravity.lift()
    }
    #[inline(always)]
    fn armature(&self, i: usize, k: usize) -> S {
        self.model.armature[self.model.tree.nodes[i].idx_v + k].lift()
    }
    #[inline(always)]
    fn force(&self, f_ext: &[Force<S>], i: usize) -> Option<Force<S>> {
        let axis_rotation = Se3::new(self.model.tree.nodes[i].axis_rotation, condyle_spatial::Vec3::zero());
        f_ext.get(i).map(|&f| axis_rotation.lift().act_inv(f))
    }

    #[inline(always)]
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T {
        of[self.model.tree.nodes[i].parent]
    }
    #[inline(always)]
    fn add_to_parent<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        onto[self.model.tree.nodes[i].parent] += x;
    }

    #[inline(always)]
    fn stack_index(&self, i: usize) -> usize {
        self.model.tree.nodes[i].level
    }
    #[inline(always)]
    fn closed_by(&self, i: usize) -> &[usize] {
        let (first, end) = self.model.tree.nodes[i].closed;
        &self.model.tree.closed[first..end]
    }
    #[inline(always)]
    fn parent_on_stack<T: Copy>(&self, of: &[T], i: usize) -> T {
        of[self.model.tree.nodes[i].level - 1]
    }
    #[inline(always)]
    fn add_to_parent_on_stack<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        onto[self.model.tree.nodes[i].level - 1] += x;
    }
    #[inline(always)]
    fn sum_lanes<T: Copy>(&self, _: usize, x: T) -> T {
        x
    }
    #[inline(always)]
    fn sum_lanes_at<T: Copy>(&self, _: &mut [T], _: usize) {}

    #[inline(always)]
    fn position(&self, q: &[S], i: usize, k: usize) -> S {
        let node = &self.model.tree.nodes[i];
        match node.mimic {
            None => q[node.idx_q + k],
            Some(mimic) => node.joint.mimic_position(mimic, &q[node.idx_q..], k),
        }
    }
    #[inline(always)]
    fn joint_velocity(&self, x: &[S], i: usize, k: usize) -> S {
        let node = &self.model.tree.nodes[i];
        match node.mimic {
            None => x[node.idx_v + k],
            Some(mimic) => x[node.idx_v + k] * S::splat(mimic.ratio),
        }
    }
    #[inline(always)]
    fn add_joint_effort(&self, x: &mut [S], i: usize, k: usize, value: S) {
        let node = &self.model.tree.nodes[i];
        match node.mimic {
            None => x[node.idx_v + k] += value,
            Some(mimic) => x[node.idx_v + k] += value * S::splat(mimic.ratio),
        }
    }

    #[inline(always)]
    fn column(&self, i: usize) -> usize {
        self.model.tree.nodes[i].column
    }
    #[inline(always)]
    fn add_armature_torque(&self, a: &[S], tau: &mut [S]) {
        for (k, &armature) in self.model.armature.iter().enumerate() {
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
        let node = &self.model.tree.nodes[i];
        self.model.tree.support(node)
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
        if self.model.has_mimic() {
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
        for (k, &armature) in self.model.armature.iter().enumerate() {
            matrix[k * (self.model.tree.nv + 1)] += armature.lift();
        }
    }
}

impl<S: Scalar, R: Constant<S>> Pairs for Single<'_, S, R> {
    #[inline(always)]
    fn set_entry(&self, matrix: &mut [S], row: usize, column: usize, value: S) {
        if self.model.has_mimic() {
            self.add_entry(matrix, row, column, value);
        } else {
            matrix[row + self.model.tree.nv * column] = value;
        }
    }
    #[inline(always)]
    fn add_entry(&self, matrix: &mut [S], row: usize, column: usize, value: S) {
        if self.model.has_mimic() {
            let (r, c) = (&self.model.tree.columns[row], &self.model.tree.columns[column]);
            matrix[r.coordinate + self.model.tree.nv * c.coordinate] += value * S::splat(r.ratio * c.ratio);
        } else {
            matrix[row + self.model.tree.nv * column] += value;
        }
    }
}
