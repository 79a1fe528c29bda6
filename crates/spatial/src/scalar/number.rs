//! Numbers that lanes are made of.

use super::Scalar;

/// A number that lanes are made of.
pub trait Number: Scalar<Mask = bool> {
    /// The largest angle that `near` takes.
    const LARGEST: f64;

    /// (sin x, cos x) in this precision, for |x| up to `LARGEST`.
    fn near<S: Scalar>(x: S) -> (S, S);
    /// (sin self, cos self), however large, of the platform.
    fn far(self) -> (Self, Self);
}
