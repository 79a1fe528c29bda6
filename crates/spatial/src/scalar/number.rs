//! Numbers that lanes are made of.

use super::Scalar;

/// A number that lanes are made of.
pub trait Number: Scalar<Mask = bool> {
    /// The largest angle that `near` takes.
    const LARGEST: f64;

    /// (sin x, cos x) of some x in this precision, for |x| up to `LARGEST`: their constants are loaded once.
    fn near<S: Scalar, const N: usize>(x: [S; N]) -> ([S; N], [S; N]);
    /// (sin self, cos self), however large, of the platform.
    fn far(self) -> (Self, Self);
}
