//! The plan of a constraint in a model: which coordinates move its frames, and where its rows stand among those of all.
//!
//! The coordinates that move a constraint's frames lie on the ways from the frames to the root of the tree of M's factor.
//! Sorted, they are what both ways share, then the rest of one way, then the rest of the other: three runs at most. Rows
//! of J are stored on these coordinates alone.

use crate::constraints::constraint::{ConstraintKind, ContactConstraint};
use crate::passes::frames::ReferenceFrame;
use alloc::collections::BTreeSet;
use alloc::vec::Vec;
use condyle_linalg::elimination_tree::{EliminationTree, NONE};
use condyle_linalg::sparsity::NonzeroRows;
use condyle_model::{Error, Model};
use condyle_spatial::{Mat3, Se3, Vec3};
use core::ops::Range;

/// How J M⁻¹ Jᵀ is regularised, so that redundant constraints share their forces.
///
/// With μ > 0 the forces solve (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ', first with λ' = 0, then again with the λ just found: each
/// iteration takes the error of the motion to μ/(σ + μ) of what it was (σ: the least singular value of J M⁻¹ Jᵀ that is
/// not 0), and redundant forces stay the smallest ones. With μ = 0 one iteration is exact, and rows that depend on
/// earlier ones get no force. The number of iterations is fixed, so that all lanes and dual numbers do the same. Source:
/// Carpentier, Budhiraja, Mansard, *Proximal and sparse resolution of constrained dynamic equations* (2021).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proximal {
    /// μ (1/kg): small beside J M⁻¹ Jᵀ, large beside its rounding errors, as 1e-8.
    pub mu: f64,
    /// The number of iterations; 0 counts as 1.
    pub iterations: usize,
}

impl Default for Proximal {
    /// μ = 0, one iteration.
    fn default() -> Self {
        Self { mu: 0.0, iterations: 1 }
    }
}

/// A degree of freedom that moves a frame of a constraint.
#[derive(Clone, Debug)]
pub(crate) struct SupportColumn {
    /// The joint's column.
    pub column: usize,
    /// The place of its coordinate among the constraint's.
    pub at: usize,
    pub coordinate: usize,
    pub ratio: f64,
    /// Whether it moves the constraint's frame.
    pub first: bool,
    /// Whether it moves the other frame.
    pub second: bool,
}

/// A constraint as the algorithms see it.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub kind: ConstraintKind,
    /// The axes of a line or a plane, along those of `reference`.
    pub axes: Mat3<f64>,
    pub reference: ReferenceFrame,
    pub kp: f64,
    pub kd: f64,
    pub bodies: [usize; 2],
    /// bXf in the bodies' public and in their turned frames.
    pub placements: [Se3<f64>; 2],
    pub turned: [Se3<f64>; 2],
    /// The first of its rows.
    pub row: usize,
    /// The places that it touches, the roots' first, and their coordinates.
    pub places: Vec<usize>,
    pub coordinates: Vec<usize>,
    /// The number of places that both ways share, and the place at which the second way goes on.
    pub shared: usize,
    pub second: usize,
    pub touches: Vec<SupportColumn>,
    /// The beginning of its rows in an array with an entry for each place of each row.
    pub start: usize,
    /// For each constraint up to this one, the runs of places that both touch: where here, where there, how many.
    pub common: Vec<Vec<[usize; 3]>>,
}

impl Plan {
    /// The plans of some constraints, one after the other.
    ///
    /// # Errors
    /// [`Error::Constraint`] for the first that the model does not allow.
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
                let mut way = BTreeSet::new(); // with all places before, to the root
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
                kp: constraint.kp,
                kd: constraint.kd,
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
            plan.common = plans.iter().chain([&plan]).map(|other| common(&plan.places, &other.places)).collect();
            (row, start) = (row + plan.rows(), plan.end());
            plans.push(plan);
        }
        Ok(plans)
    }

    pub(crate) fn rows(&self) -> usize {
        self.kind.rows()
    }

    /// The place where row r (counted from the constraint's first) stands in the array of all rows.
    #[inline(always)]
    pub(crate) fn range(&self, r: usize) -> Range<usize> {
        let n = self.places.len();
        self.start + r * n..self.start + (r + 1) * n
    }

    /// The place at which the array of all rows goes on behind it.
    pub(crate) fn end(&self) -> usize {
        self.start + self.rows() * self.places.len()
    }

    /// Whether the rows turn with the world's axes, not the frame's.
    #[inline(always)]
    pub(crate) fn aligned(&self) -> bool {
        self.reference == ReferenceFrame::LocalWorldAligned
    }
}

/// The rows of J in which coordinate k may differ from zero.
pub(crate) fn touching(plans: &[Plan], k: usize) -> Vec<usize> {
    let touched = plans.iter().filter(|plan| plan.coordinates.contains(&k));
    touched.flat_map(|plan| plan.row..plan.row + plan.rows()).collect()
}

/// For each coordinate, the rows in which ∂(M q̈ + h − Jᵀλ)/∂q may differ from zero.
pub(crate) fn nonzero_rows<R>(model: &Model<R>, plans: &[Plan]) -> Vec<NonzeroRows> {
    let rows = |k: usize| {
        // what carries a frame moves the force on the other one
        let touched = plans.iter().filter(|plan| plan.coordinates.contains(&k));
        let more = touched.filter(|plan| plan.bodies[1] > 0).flat_map(|plan| plan.coordinates.iter());
        model.nonzero_rows()[k].rows.iter().chain(more).copied().collect::<BTreeSet<_>>().into_iter().collect()
    };
    NonzeroRows::of_columns((0..model.nv()).map(rows).collect())
}

/// Places common to two sorted lists, as runs.
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
