//! Types of the number in one lane: `f64` and `f32`.

use super::Scalar;

/// Number that a lane can hold: `f64` or `f32`.
pub trait Number: Scalar<Mask = bool> {
    /// Largest |x| for which `near` is accurate.
    const LARGEST: f64;

    /// Computes (sin x, cos x) of N values with |x| up to `LARGEST`, in the precision of this type. The constants are
    /// loaded once for all N values.
    fn near<S: Scalar, const N: usize>(x: [S; N]) -> ([S; N], [S; N]);
    /// Computes (sin self, cos self) with the platform's functions, for any magnitude of x = self.
    fn far(self) -> (Self, Self);
}
