//! Principal axes of inertias, in MuJoCo's order and with MuJoCo's signs. The order and the signs matter, because
//! frames of inertia and fitted geoms depend on them.

use condyle_spatial::{Mat3, Quaternion, Sym3};

/// Threshold for off-diagonal entries, relative to the largest moment. Entries below the threshold are rounding errors.
/// For meshes, MuJoCo uses the threshold 1e-7.
const ROUNDING: f64 = 1e-15;
/// Relative difference of two moments below which the moments count as equal and keep their order.
const EQUAL: f64 = 1e-12;
/// Maximum number of rotations, as in MuJoCo. The method converges quadratically once the off-diagonal entries are
/// small.
const MAX_ROTATIONS: usize = 500;

/// Returns the principal moments, the largest first, and the rotation R with I = R diag(moments) Rᵀ. The method is
/// Jacobi's: each rotation makes the largest off-diagonal entry zero.
pub(super) fn principal(I: Sym3<f64>) -> ([f64; 3], Mat3<f64>) {
    let full = I.full();
    let mut quaternion = Quaternion::identity();
    let (mut moments, mut R) = ([0.0; 3], Mat3::identity());
    for _ in 0..MAX_ROTATIONS {
        R = quaternion.to_rotation();
        let D = R.transpose() * full * R;
        let entry = |row: usize, column: usize| D.columns()[column].to_array()[row];
        moments = [entry(0, 0), entry(1, 1), entry(2, 2)];
        let [xy, xz, yz] = [entry(0, 1), entry(0, 2), entry(1, 2)];
        let (row, column, axis) = if xy.abs() > xz.abs() && xy.abs() > yz.abs() {
            (0, 1, 2)
        } else if xz.abs() > yz.abs() {
            (0, 2, 1)
        } else {
            (1, 2, 0)
        };
        let off = entry(row, column);
        let greatest = moments.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        if off.abs() <= ROUNDING * greatest || !off.is_finite() {
            break;
        }
        let tau = (moments[column] - moments[row]) / (2.0 * off);
        let t =
            if tau >= 0.0 { 1.0 / (tau + (1.0 + tau * tau).sqrt()) } else { -1.0 / (-tau + (1.0 + tau * tau).sqrt()) };
        let cos = 1.0 / (1.0 + t * t).sqrt();
        // The half angle follows from sin ½θ = ½ sin θ / cos ½θ.
        let half = 0.5 * t * cos / (0.5 + 0.5 * cos).sqrt();
        let sin = if axis == 1 { half } else { -half };
        let mut vector = [0.0; 3];
        vector[axis] = sin;
        let [x, y, z] = vector;
        quaternion = (quaternion * Quaternion::new(x, y, z, (1.0 - sin * sin).sqrt())).normalize();
    }
    // Sorts the moments, the largest first. Two axes are exchanged by a quarter turn about the third axis.
    for first in [0, 1, 0] {
        if moments[first] < moments[first + 1] * (1.0 - EQUAL) {
            moments.swap(first, first + 1);
            let mut vector = [0.0; 3];
            vector[(first + 2) % 3] = core::f64::consts::FRAC_1_SQRT_2;
            let [x, y, z] = vector;
            quaternion = (quaternion * Quaternion::new(x, y, z, core::f64::consts::FRAC_1_SQRT_2)).normalize();
            R = quaternion.to_rotation();
        }
    }
    (moments, R)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_diagonalise() {
        for (I, greatest) in [
            (Sym3 { xx: 1.0, xy: 0.0, yy: 2.0, xz: 0.0, yz: 0.0, zz: 3.0 }, 3.0),
            (Sym3 { xx: 2.0, xy: 0.3, yy: 2.5, xz: -0.2, yz: 0.1, zz: 3.0 }, 3.0),
            (Sym3 { xx: 2.0, xy: 0.0, yy: 2.0, xz: 0.0, yz: 0.0, zz: 2.0 }, 2.0),
        ] {
            let (moments, R) = principal(I);
            assert!(moments[0] >= moments[1] && moments[1] >= moments[2] && moments[0] >= greatest);
            let columns = R.columns().map(|c| c.to_array());
            for (row, expected) in [[I.xx, I.xy, I.xz], [I.xy, I.yy, I.yz], [I.xz, I.yz, I.zz]].iter().enumerate() {
                for (column, expected) in expected.iter().enumerate() {
                    let found: f64 = (0..3).map(|k| moments[k] * columns[k][row] * columns[k][column]).sum();
                    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
                }
            }
            assert!(R.is_rotation());
        }
    }
}
