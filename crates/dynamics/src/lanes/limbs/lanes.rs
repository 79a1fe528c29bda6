//! Layout with which passes over bodies run over steps. A step has one body per lane, and each scalar is a vector of
//! lanes.
#![allow(unsafe_code)]

use super::{LANES, Plan};
use crate::workspace::{Gate, Narrow};
use alloc::vec::Vec;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::joint::revolute_angles::RevoluteAngles;
use condyle_model::layout::{Columns, Layout};
use condyle_model::limbs::column_map::{ColumnMap, LaneColumn, Pair, Predecessor};
use condyle_model::limbs::steps::{Parents, Source, Step};
use condyle_spatial::moves::{Move, sum};
use condyle_spatial::simd::FusedF64;
use condyle_spatial::{Act, Force, Inertia, Scalar, Se3, Vec3};
use core::ops::{AddAssign, Range};

pub(crate) type Four = Narrow;
const _: () = assert!(<Four as Scalar>::LANES == LANES);

/// Layout of a robot with limbs, for passes over steps. A step has one body per lane.
pub(crate) struct Limbs<'a> {
    pub(crate) steps: &'a [Step],
    pub(crate) support: &'a [LaneColumn],
    pairs: &'a [Pair],
    copies: &'a [Vec<(usize, Move)>],
    predecessors: &'a [Predecessor],
    closed: &'a [usize],
    revolute_angles: &'a RevoluteAngles,
    coordinates: &'a [Source],
    pub armature: &'a [f64],
    pub gravity: Vec3<f64>,
    geometry: u64,
}

/// Returns a value as a slice of the vectors of which it consists.
///
/// # Safety
/// `T` must consist of vectors only: a struct of spatial algebra or of kinematics with `repr(C)`.
#[inline(always)]
unsafe fn vectors<T>(x: &mut T) -> &mut [Four] {
    const { assert!(size_of::<T>().is_multiple_of(size_of::<Four>()) && align_of::<T>() == align_of::<Four>()) };
    // SAFETY: the caller guarantees that `T` consists of vectors.
    unsafe { core::slice::from_raw_parts_mut(core::ptr::from_mut(x).cast(), size_of::<T>() / size_of::<Four>()) }
}

/// Returns the numbers of an array of structs; the numbers of each vector are adjacent.
///
/// # Safety
/// `T` must consist of vectors only: a struct of spatial algebra or of kinematics with `repr(C)`.
#[inline(always)]
pub(crate) unsafe fn numbers<T>(of: &[T]) -> &[f64] {
    const { assert!(size_of::<T>().is_multiple_of(size_of::<Four>()) && align_of::<T>() == align_of::<Four>()) };
    // SAFETY: the caller guarantees that `T` consists of vectors; a vector consists of numbers.
    unsafe { core::slice::from_raw_parts(of.as_ptr().cast(), size_of_val(of) / size_of::<f64>()) }
}

/// Returns the numbers of an array of structs as a mutable slice.
///
/// # Safety
/// `T` must consist of vectors only: a struct of spatial algebra or of kinematics with `repr(C)`.
#[inline(always)]
pub(crate) unsafe fn numbers_mut<T>(of: &mut [T]) -> &mut [f64] {
    const { assert!(size_of::<T>().is_multiple_of(size_of::<Four>()) && align_of::<T>() == align_of::<Four>()) };
    // SAFETY: the caller guarantees that `T` consists of vectors; a vector consists of numbers.
    unsafe { core::slice::from_raw_parts_mut(of.as_mut_ptr().cast(), size_of_val(of) / size_of::<f64>()) }
}

#[inline(always)]
fn moved<T: Copy>(mut x: T, by: &Move) -> T {
    // SAFETY: `T` consists of vectors, as passes only store structs of vectors.
    let numbers = unsafe { vectors(&mut x) };
    for k in 0..numbers.len() {
        numbers[k] = by.apply::<Gate>(numbers[k]);
    }
    x
}

/// Returns the sum of values of several steps or slots. Before the sum, each value is moved to its new lanes.
#[inline(always)]
fn gathered<T: Copy>(of: &[T], from: &[(usize, Move)]) -> T {
    let mut x = moved(of[from[0].0], &from[0].1);
    for (at, by) in &from[1..] {
        let mut y = moved(of[*at], by);
        // SAFETY: `T` consists of vectors, as passes only store structs of vectors.
        let (x, y) = unsafe { (vectors(&mut x), vectors(&mut y)) };
        for k in 0..x.len() {
            x[k] += y[k];
        }
    }
    x
}

impl Layout for Limbs<'_> {
    type S = Four;

    #[inline(always)]
    fn geometry_hash(&self) -> u64 {
        self.geometry
    }
    #[inline(always)]
    fn bodies(&self) -> Range<usize> {
        1..self.steps.len()
    }
    #[inline(always)]
    fn joint(&self, i: usize) -> Joint {
        self.steps[i].joint
    }
    #[inline(always)]
    fn revolute_angles(&self) -> &RevoluteAngles {
        self.revolute_angles
    }
    #[inline(always)]
    fn placement(&self, i: usize) -> Se3<Four> {
        self.steps[i].placement.lift()
    }
    #[inline(always)]
    fn inertia(&self, i: usize) -> Inertia<Four> {
        self.steps[i].inertia.lift()
    }
    #[inline(always)]
    fn minus_gravity(&self) -> Vec3<Four> {
        -self.gravity.lift()
    }
    #[inline(always)]
    fn armature(&self, i: usize, k: usize) -> Four {
        let mut armature = [1.0; LANES]; // 1 in lanes without a joint, to avoid a division by 0
        let from = self.coordinates[self.steps[i].idx_v + k].from;
        for lane in 0..LANES {
            if from[lane] < self.armature.len() {
                armature[lane] = self.armature[from[lane]];
            }
        }
        Four::from_array(armature)
    }
    #[inline(always)]
    fn force(&self, f_ext: &[Force<Four>], i: usize) -> Option<Force<Four>> {
        let &f = f_ext.get(i)?; // not by `map`, which would not be inlined
        Some(Se3::new(self.steps[i].axis_rotation.lift(), Vec3::zero()).act_inv(f))
    }

    #[inline(always)]
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T {
        match &self.steps[i].parents {
            Parents::InPlace(step) => of[*step],
            Parents::Moved { from, .. } => gathered(of, from),
        }
    }
    #[inline(always)]
    fn add_to_parent<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        match &self.steps[i].parents {
            Parents::InPlace(step) => onto[*step] += x,
            Parents::Moved { to, .. } => {
                for (step, by) in to {
                    onto[*step] += moved(x, by);
                }
            }
        }
    }
    #[inline(always)]
    fn stack_index(&self, i: usize) -> usize {
        i
    }
    /// Returns the list `closed` of all bodies if `i` is the last step, otherwise an empty list.
    #[inline(always)]
    fn subtrees_ending_at(&self, i: usize) -> &[usize] {
        if i + 1 == self.steps.len() { self.closed } else { &[] }
    }
    #[inline(always)]
    fn parent_on_stack<T: Copy>(&self, of: &[T], i: usize) -> T {
        self.parent(of, i)
    }
    #[inline(always)]
    fn add_to_parent_on_stack<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        self.add_to_parent(onto, i, x);
    }
    #[inline(always)]
    fn sum_lanes<T>(&self, i: usize, x: &mut T) {
        let [first, others @ ..] = &self.steps[i].bodies;
        if others.iter().all(|other| other == first) {
            // SAFETY: `T` consists of vectors, as passes only store structs of vectors.
            let numbers = unsafe { vectors(x) };
            for k in 0..numbers.len() {
                numbers[k] = sum::<Gate>(numbers[k]);
            }
        }
    }

    #[inline(always)]
    fn position(&self, q: &[Four], i: usize, k: usize) -> Four {
        q[self.steps[i].idx_q + k]
    }
    #[inline(always)]
    fn joint_velocity(&self, x: &[Four], i: usize, k: usize) -> Four {
        x[self.steps[i].idx_v + k]
    }
    #[inline(always)]
    fn add_joint_effort(&self, x: &mut [Four], i: usize, k: usize, value: Four) {
        x[self.steps[i].idx_v + k] += value;
    }
    #[inline(always)]
    fn column(&self, i: usize) -> usize {
        self.steps[i].idx_v
    }
    /// Does nothing: armature torque is added later, when the efforts of all lanes are combined.
    #[inline(always)]
    fn add_armature_torque(&self, _: &[Four], _: &mut [Four]) {}
}

impl<'a> Limbs<'a> {
    #[inline(always)]
    pub(crate) fn new(plan: &'a Plan, model: &'a Model) -> Self {
        let Plan { steps, closed, revolute_angles, state, columns, .. } = plan;
        let ColumnMap { support, pairs, copies, predecessors, .. } = columns;
        let (armature, gravity, geometry) = (model.armature(), *model.gravity(), model.geometry_hash());
        let coordinates = &state.coordinates;
        Self {
            steps,
            support,
            pairs,
            copies,
            predecessors,
            closed,
            revolute_angles,
            coordinates,
            armature,
            gravity,
            geometry,
        }
    }

    /// Returns the value of the predecessor of an entry in a step's support (the columns on the paths from the root to
    /// the step's joints). The predecessor is the entry for the same column in the parent's step.
    #[inline(always)]
    pub(crate) fn predecessor<T: Copy>(&self, of: &[T], entry: usize) -> T {
        match &self.predecessors[entry] {
            Predecessor::InPlace(before) => of[*before],
            Predecessor::Moved(from) => gathered(of, from),
        }
    }

    /// Returns the indices of the matrix entries for a pair of columns: column e of the step's support, and column k of
    /// the step's joint.
    #[inline(always)]
    pub(crate) fn pair(&self, e: LaneColumn, k: usize) -> &Pair {
        debug_assert!(e.pair + k < self.pairs.len());
        // SAFETY: the plan has a pair for each entry of a step's support and each column k of its joints.
        unsafe { self.pairs.get_unchecked(e.pair + k) }
    }

    /// Sets the matrix entries of a pair of columns, one per lane. If several lanes have the same index, the value of
    /// the first of these lanes remains, because it is written last.
    #[inline(always)]
    fn put(matrix: &mut [FusedF64], at: &[u32; LANES], value: Four) {
        let value = value.to_fused();
        for lane in (0..LANES).rev() {
            debug_assert!((at[lane] as usize) < matrix.len());
            // SAFETY: the pairs of a plan contain indices of entries in nv × nv matrices. `clear` checks that `matrix`
            // has this size.
            unsafe { *matrix.get_unchecked_mut(at[lane] as usize) = value[lane] };
        }
    }
}

impl Columns for Limbs<'_> {
    type Column = LaneColumn;
    /// Index of the column within its joint.
    type OwnColumn = usize;
    type Number = FusedF64;

    #[inline(always)]
    fn support(&self, i: usize) -> &[LaneColumn] {
        let (first, end) = self.steps[i].support;
        &self.support[first..end]
    }
    #[inline(always)]
    fn own_column(&self, _: usize, k: usize) -> usize {
        k
    }
    #[inline(always)]
    fn at<T: Copy>(&self, of: &[T], column: LaneColumn) -> T {
        of[column.column]
    }
    #[inline(always)]
    fn broadcast<T: Copy>(&self, of: &mut [T]) {
        for (k, from) in self.copies.iter().enumerate() {
            of[self.coordinates.len() + k] = gathered(of, from);
        }
    }
    #[inline(always)]
    fn clear(&self, matrix: &mut [FusedF64]) {
        assert!(matrix.len() == self.armature.len() * self.armature.len());
    }
    #[inline(always)]
    fn set_row(&self, matrix: &mut [FusedF64], k: usize, e: LaneColumn, value: Four) {
        Self::put(matrix, &self.pair(e, k).in_row, value);
    }
    #[inline(always)]
    fn set_column(&self, matrix: &mut [FusedF64], k: usize, e: LaneColumn, value: Four) {
        Self::put(matrix, &self.pair(e, k).in_column, value);
    }
    #[inline(always)]
    fn add_armature(&self, matrix: &mut [FusedF64]) {
        for (k, &armature) in self.armature.iter().enumerate() {
            matrix[k * (self.armature.len() + 1)] += FusedF64(armature);
        }
    }
}
