//! The plan of a constraint in a model: which coordinates move its frames, and where its rows stand among those of all.
//!
//! The coordinates that move a constraint's frames lie on the ways from the frames to the root of the tree of M's factor.
//! Sorted, they are what both ways share, then the rest of one way, then the rest of the other: three runs at most. Rows
//! of J are stored on these coordinates alone.

use crate::constraints::constraint::ConstraintKind;
use crate::passes::frames::ReferenceFrame;
use condyle_spatial::Se3;
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
    /// How many iterations; 0 counts as 1.
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
    /// Where its coordinate stands among the constraint's.
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
    /// How many places both ways share, and where the second way goes on.
    pub shared: usize,
    pub second: usize,
    pub touches: Vec<SupportColumn>,
    /// Where its rows begin in an array with an entry for each place of each row.
    pub start: usize,
    /// For each constraint up to this one, the runs of places that both touch: where here, where there, how many.
    pub common: Vec<Vec<[usize; 3]>>,
}

impl Plan {
    pub(crate) fn rows(&self) -> usize {
        self.kind.rows()
    }

    /// Where row r (counted from the constraint's first) stands in the array of all rows.
    #[inline(always)]
    pub(crate) fn range(&self, r: usize) -> Range<usize> {
        let n = self.places.len();
        self.start + r * n..self.start + (r + 1) * n
    }

    /// Whether the rows turn with the world's axes, not the frame's.
    #[inline(always)]
    pub(crate) fn aligned(&self) -> bool {
        self.reference == ReferenceFrame::LocalWorldAligned
    }
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
