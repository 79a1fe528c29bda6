//! Plan of a constraint in a model: the coordinates that move the constraint's frames, and the index of the
//! constraint's first row.
//!
//! In the elimination tree of the sparse factor of M, the coordinates that move a constraint's frames are on the paths
//! from the two frames to the root. A slot is the index of a coordinate in the order of this factor. The sorted slots
//! of a constraint form at most three runs: the slots that both paths share, then the other slots of one path, then the
//! other slots of the second path. Rows of J are stored for the coordinates of these slots only.

use crate::constraints::constraint::{ConstraintKind, ContactConstraint};
use crate::passes::frames::ReferenceFrame;
use alloc::collections::BTreeSet;
use alloc::vec::Vec;
use condyle_linalg::elimination_tree::{EliminationTree, NONE};
use condyle_linalg::sparsity::NonzeroRows;
use condyle_model::{Error, Model};
use condyle_spatial::{Mat3, Se3, Vec3};
use core::ops::Range;

/// Regularisation of the Delassus matrix J M⁻¹ Jᵀ. The regularisation distributes the force over redundant constraints.
///
/// The constraint forces λ solve J M⁻¹ Jᵀ λ = b. With μ > 0, each iteration solves (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ', where
/// λ' is the solution of the previous iteration, or 0 in the first iteration. Each iteration multiplies the error of
/// the motion by μ/(σ + μ), where σ is the smallest nonzero singular value of J M⁻¹ Jᵀ. If several vectors λ give the
/// same motion, the iterations converge to the λ with the smallest norm. With μ = 0 one iteration is exact, and rows
/// that depend on earlier rows get no force. The number of iterations is fixed, so that all lanes and dual numbers run
/// the same operations. Source: Carpentier, Budhiraja, Mansard, *Proximal and sparse resolution of constrained dynamic
/// equations* (2021).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProximalSettings {
    /// Regularisation μ (1/kg). It should be small compared with the entries of the Delassus matrix, but large compared
    /// with the rounding errors of these entries, for example 1e-8.
    pub mu: f64,
    /// Number of proximal iterations; 0 has the same effect as 1.
    pub iterations: usize,
}

impl Default for ProximalSettings {
    /// Returns the settings without regularisation: μ = 0 and one iteration.
    fn default() -> Self {
        Self { mu: 0.0, iterations: 1 }
    }
}

/// Degree of freedom that moves at least one frame of a constraint.
#[derive(Clone, Debug)]
pub(crate) struct SupportColumn {
    /// Index of the joint column among all columns of the model.
    pub column: usize,
    /// Index of the slot of the column's coordinate among the slots of the constraint.
    pub at: usize,
    pub coordinate: usize,
    pub ratio: f64,
    /// Whether this degree of freedom moves the constraint's first frame.
    pub first: bool,
    /// Whether this degree of freedom moves the other frame.
    pub second: bool,
}

/// Plan of a constraint: the constraint's settings, with the indices of its bodies, rows, slots and coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub kind: ConstraintKind,
    /// Axes of a line or a plane, expressed in the axes of `reference`.
    pub axes: Mat3<f64>,
    pub reference: ReferenceFrame,
    /// Gain of the position error along all axes; 0 if the gains differ.
    pub kp: f64,
    /// Gains of the position error along each axis of `reference`, if the gains differ.
    pub kp_axes: Option<[f64; 6]>,
    pub kd: f64,
    pub bodies: [usize; 2],
    /// Placements bXf of both frames: in the public frames of the bodies (`placements`), and in the internal frames,
    /// which are rotated to the joint axes (`turned`).
    pub placements: [Se3<f64>; 2],
    pub turned: [Se3<f64>; 2],
    /// Index of the constraint's first row in the constraint Jacobian J.
    pub row: usize,
    /// Slots of the coordinates that move the constraint's frames, sorted from the root outwards (`places`), and the
    /// coordinate of each slot (`coordinates`).
    pub places: Vec<usize>,
    pub coordinates: Vec<usize>,
    /// Number of slots that both paths share (`shared`), and index of the first slot of the last run (`second`).
    pub shared: usize,
    pub second: usize,
    pub touches: Vec<SupportColumn>,
    /// Offset of the constraint's first entry in the array that stores all rows of J. A row has one entry per slot.
    pub start: usize,
    /// Runs of slots that this constraint shares with each earlier constraint and, last, with itself. A run consists of
    /// the first index in this constraint, the first index in the other constraint, and the length.
    pub common: Vec<Vec<[usize; 3]>>,
}

impl Plan {
    /// Makes a plan for each constraint, in order.
    ///
    /// # Errors
    /// Returns [`Error::Constraint`] for the first constraint that is invalid for the model.
    pub(crate) fn of_constraints<R>(model: &Model<R>, constraints: &[ContactConstraint]) -> Result<Vec<Self>, Error> {
        let tree = EliminationTree::new(model, 1);
        let mut place = vec![0; model.nv()];
        for (k, &coordinate) in tree.order.iter().enumerate() {
            place[coordinate] = k;
        }
        let support = |body: usize| model.support(&model.nodes()[body]);
        let mut plans: Vec<Plan> = Vec::new();
        let (mut row, mut start) = (0, 0);
        for (i, constraint) in constraints.iter().enumerate() {
            let bodies = constraint.bodies(model, &constraints[..i])?;
            let ways = bodies.map(|body| {
                let mut way = BTreeSet::new(); // with all ancestors of each slot in the elimination tree
                for &c in support(body) {
                    let mut k = place[model.columns()[c].coordinate];
                    while k != NONE && way.insert(k) {
                        k = tree.parent[k];
                    }
                }
                way
            });
            let places: Vec<usize> = ways[0].union(&ways[1]).copied().collect();
            let shared = ways[0].intersection(&ways[1]).count();
            let branch = |k: &usize| ways[0].contains(k) && !ways[1].contains(k);
            let second = (shared + 1..places.len()).find(|&j| branch(&places[j]) != branch(&places[j - 1]));
            let columns: BTreeSet<usize> = bodies.iter().flat_map(|&body| support(body)).copied().collect();
            let touch = |column: usize| {
                let c = &model.columns()[column];
                SupportColumn {
                    column,
                    at: places.binary_search(&place[c.coordinate]).expect("its place is on the way"),
                    coordinate: c.coordinate,
                    ratio: c.ratio,
                    first: support(bodies[0]).contains(&column),
                    second: support(bodies[1]).contains(&column),
                }
            };
            let placement = |frame: usize| model.frames()[frame].placement;
            let placements = [placement(constraint.frame), constraint.other.map_or(Se3::identity(), placement)];
            let turn =
                |k: usize| Se3::new(model.nodes()[bodies[k]].axis_rotation.transpose(), Vec3::zero()) * placements[k];
            let mut plan = Plan {
                kind: constraint.kind,
                axes: constraint.axes,
                reference: constraint.reference,
                kp: 0.0,
                kp_axes: None,
                kd: 0.0,
                bodies,
                placements,
                turned: [turn(0), turn(1)],
                row,
                coordinates: places.iter().map(|&k| tree.order[k]).collect(),
                shared,
                second: second.unwrap_or(places.len()),
                touches: columns.into_iter().map(touch).collect(),
                places,
                start,
                common: Vec::new(),
            };
            plan.set_gains(constraint.kp, constraint.kp_axes, constraint.kd);
            plan.common = plans.iter().chain([&plan]).map(|other| common(&plan.places, &other.places)).collect();
            (row, start) = (row + plan.rows(), plan.end());
            plans.push(plan);
        }
        Ok(plans)
    }

    /// Sets the gains, which must be valid.
    pub(crate) fn set_gains(&mut self, kp: f64, kp_axes: Option<[f64; 6]>, kd: f64) {
        self.kp = if kp_axes.is_some() { 0.0 } else { kp };
        (self.kp_axes, self.kd) = (kp_axes, kd);
    }

    pub(crate) fn rows(&self) -> usize {
        self.kind.rows()
    }

    /// Returns the range of row r of the constraint in the array that stores all rows of J. Row 0 is the constraint's
    /// first row.
    #[inline(always)]
    pub(crate) fn range(&self, r: usize) -> Range<usize> {
        let n = self.places.len();
        self.start + r * n..self.start + (r + 1) * n
    }

    /// Returns the offset of the next constraint's first entry in the array that stores all rows of J.
    pub(crate) fn end(&self) -> usize {
        self.start + self.rows() * self.places.len()
    }

    /// Returns whether the rows are expressed in the world's axes (true) or in the frame's axes (false).
    #[inline(always)]
    pub(crate) fn aligned(&self) -> bool {
        self.reference == ReferenceFrame::LocalWorldAligned
    }
}

/// Returns the indices of the rows of J that may be nonzero in column k.
pub(crate) fn touching(plans: &[Plan], k: usize) -> Vec<usize> {
    let touched = plans.iter().filter(|plan| plan.coordinates.contains(&k));
    touched.flat_map(|plan| plan.row..plan.row + plan.rows()).collect()
}

/// Returns the rows in which each column of ∂(M q̈ + h − Jᵀλ)/∂q may be nonzero.
pub(crate) fn nonzero_rows<R>(model: &Model<R>, plans: &[Plan]) -> Vec<NonzeroRows> {
    let rows = |k: usize| {
        // The force on the other frame moves with frame 1. So its derivative involves all joints that carry one of the
        // frames.
        let touched = plans.iter().filter(|plan| plan.coordinates.contains(&k));
        let more = touched.filter(|plan| plan.bodies[1] > 0).flat_map(|plan| plan.coordinates.iter());
        model.nonzero_rows()[k].rows.iter().chain(more).copied().collect::<BTreeSet<_>>().into_iter().collect()
    };
    NonzeroRows::of_columns((0..model.nv()).map(rows).collect())
}

/// Returns the runs of slots that two sorted lists have in common.
pub(crate) fn common(a: &[usize], b: &[usize]) -> Vec<[usize; 3]> {
    let mut runs: Vec<[usize; 3]> = Vec::new();
    for (i, place) in a.iter().enumerate() {
        if let Ok(j) = b.binary_search(place) {
            match runs.last_mut() {
                Some([x, y, n]) if *x + *n == i && *y + *n == j => *n += 1,
                _ => runs.push([i, j, 1]),
            }
        }
    }
    runs
}
