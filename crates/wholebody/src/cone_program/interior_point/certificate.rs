//! Proofs that there is no solution.

use super::cone::margin;
use super::scaled::Scaled;
use crate::cone_program::Status;
use condyle_linalg::{dot, max_abs};

/// What should be zero in a certificate, relative to what should not; and what it may be where iterates get no better.
const TOLERANCE: f64 = 1e-9;
pub(super) const REDUCED_TOLERANCE: f64 = 1e-5;
/// An x shorter than this is not taken for a direction without end; unknowns are in units in which they are of size one.
const FAR: f64 = 1e3;
/// The fall of the objective along a direction of length one is at least this.
const FALL: f64 = 1e-6;

/// An iterate, and what it gives rise to.
pub(super) struct Candidate<'a> {
    pub data: &'a Scaled,
    pub x: &'a [f64],
    pub Kx: &'a [f64],
    pub Px: &'a [f64],
    /// cᵀ x.
    pub linear: f64,
    /// ‖Kᵀ z + E y‖∞.
    pub force: f64,
    /// eᵀ y + lᵀ z₋ − uᵀ z₊ − hᵀ z.
    pub support: f64,
}

impl Candidate<'_> {
    /// How far the iterate is from proving that no x satisfies the constraints: each that does has
    /// (Kᵀ z + E y)ᵀ x ≥ `support`, so a `force` of zero and a positive support exclude it.
    pub(super) fn exclusion(&self) -> f64 {
        let size = max_abs(&self.x[..self.data.n]);
        if self.support > 0.0 { self.force * (1.0 + size) / self.support } else { f64::INFINITY }
    }

    /// What the iterate proves.
    pub(super) fn verdict(&self) -> Option<Status> {
        if self.exclusion() <= TOLERANCE {
            return Some(Status::Infeasible);
        }
        let size = max_abs(&self.x[..self.data.n]);
        (size > FAR && self.linear < -FALL * size && self.is_ray(size)).then_some(Status::Unbounded)
    }

    /// Whether x is a direction along which the objective falls without end: P x = 0, E x = 0, and G x and F x in what
    /// bounds and cones allow without end.
    fn is_ray(&self, size: f64) -> bool {
        let Self { data, x, Kx, Px, linear, .. } = *self;
        let (n, m) = (data.n, data.rows());
        let small = TOLERANCE * size.max(-linear);
        max_abs(&Px[..n]) <= small
            && (0..m).all(|i| data.has_lower[i] == 0.0 || Kx[i] >= -small)
            && (0..m).all(|i| data.has_upper[i] == 0.0 || Kx[i] <= small)
            && (0..data.equalities()).all(|j| dot(&data.E[j * data.ld..][..n], &x[..n]).abs() <= small)
            && data.cones.iter().all(|cone| margin(&Kx[m + cone.at..][..cone.dim]) >= -small)
    }
}
