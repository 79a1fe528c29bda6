//! Certificates: proofs that a program has no solution.

use super::cone::margin;
use super::scaled::Scaled;
use crate::cone_program::Status;
use condyle_linalg::{dot, max_abs};

/// Tolerance of a certificate: maximum size of the terms that should be zero, relative to the other terms.
/// `REDUCED_TOLERANCE` applies if the iterates stop improving.
const TOLERANCE: f64 = 1e-9;
pub(super) const REDUCED_TOLERANCE: f64 = 1e-5;
/// Minimum size of an iterate x that may prove an unbounded objective. In the units of the method, the unknowns of a
/// solution have size about one.
const FAR: f64 = 1e3;
/// Minimum decrease of the objective along a direction of size one that proves an unbounded objective.
const FALL: f64 = 1e-6;

/// Iterate, and the quantities from which its certificate is computed.
pub(super) struct Candidate<'a> {
    pub data: &'a Scaled,
    pub x: &'a [f64],
    pub Kx: &'a [f64],
    pub Px: &'a [f64],
    /// Linear part cᵀ x of the objective.
    pub linear: f64,
    /// Norm ‖Kᵀ z + Eᵀ y‖∞, with the multipliers z of the rows of K = [G; F] and y of the equalities E x = e.
    pub force: f64,
    /// Sum eᵀ y + lᵀ z₋ − uᵀ z₊ − hᵀ z of the right sides and bounds of all constraints, each times its multiplier.
    pub support: f64,
}

impl Candidate<'_> {
    /// Returns the distance of the iterate from a proof that no x satisfies the constraints. The rows of E are the
    /// equalities, the rows of K = [G; F] are the other constraints, and y and z are their multipliers. Every feasible
    /// x satisfies `support` ≤ (Kᵀ z + Eᵀ y)ᵀ x. So a positive `support` with a `force` ‖Kᵀ z + Eᵀ y‖ of zero is such a
    /// proof.
    pub(super) fn exclusion(&self) -> f64 {
        let size = max_abs(&self.x[..self.data.n]);
        if self.support > 0.0 { self.force * (1.0 + size) / self.support } else { f64::INFINITY }
    }

    /// Returns the status that the iterate proves, or `None` without a proof.
    pub(super) fn verdict(&self) -> Option<Status> {
        if self.exclusion() <= TOLERANCE {
            return Some(Status::Infeasible);
        }
        let size = max_abs(&self.x[..self.data.n]);
        (size > FAR && self.linear < -FALL * size && self.is_ray(size)).then_some(Status::Unbounded)
    }

    /// Returns whether the objective falls without bound along x: the quadratic cost P x is 0, the equalities E x are
    /// 0, and all multiples of x keep the rows G x within their bounds and F x within the cones.
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
