//! Distance of a point to a cylinder and to an ellipsoid, inside and outside.
//!
//! The nearest point x of an ellipsoid with semi-axes r_i to a point p satisfies p − x = t ∇F(x)/2 with F = Σ
//! (x_i/r_i)² − 1. So x_i = r_i² p_i/(t + r_i²), and t is the largest root of
//!
//! ```text
//! Σ_i (r_i p_i / (t + r_i²))² = 1
//! ```
//!
//! With τ = t + r_min², the left side is convex and decreasing for τ > 0. So Newton's method from a smaller τ converges
//! monotonically. Source: Eberly, "Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid" (Geometric
//! Tools, 2013), sections 3.4 and 4.

use super::boxes::unit;
use super::round::{Witness, norm, root};
use condyle_spatial::Vec3;

/// Maximum number of Newton steps; a step increases a τ that is much too small by half, and is quadratic near the root.
const STEPS: usize = 100;

/// Returns the signed distance of a point p to a cylinder about z, the nearest point of the boundary and the normal.
pub(super) fn cylinder(p: Vec3<f64>, radius: f64, half_length: f64) -> Witness<f64> {
    let rho = root(p.x * p.x + p.y * p.y);
    let outward = if rho > 0.0 { Vec3::new(p.x / rho, p.y / rho, 0.0) } else { unit(0, 1.0) };
    let end = unit(2, if p.z < 0.0 { -1.0 } else { 1.0 });
    let (across, along) = (rho - radius, p.z.abs() - half_length);
    let (distance, normal) = if across > 0.0 && along > 0.0 {
        let distance = root(across * across + along * along);
        (distance, outward.scale(across / distance) + end.scale(along / distance))
    } else if across > along {
        (across, outward)
    } else {
        (along, end)
    };
    Witness { distance, points: [p, p - normal.scale(distance)], normal }
}

/// Returns the signed distance of a point p to an ellipsoid, the nearest point of the surface and the normal there.
pub(super) fn ellipsoid(p: Vec3<f64>, radii: Vec3<f64>) -> Witness<f64> {
    let (r, signed) = (radii.to_array(), p.to_array());
    let y = signed.map(f64::abs);
    let least = (1..3).fold(0, |least, i| if r[i] < r[least] { i } else { least });
    let gap: [f64; 3] = core::array::from_fn(|i| (r[i] - r[least]) * (r[i] + r[least]));
    // every term alone is at most 1 at the root, so τ ≥ r_i y_i − gap_i
    let mut tau = (0..3).fold(0.0, |tau: f64, i| tau.max(r[i] * y[i] - gap[i]));
    let mut x: [f64; 3] = [0.0; 3];
    let inside_plane = tau == 0.0 && {
        let sum: f64 = (0..3).filter(|&i| gap[i] > 0.0).map(|i| square(r[i] * y[i] / gap[i])).sum();
        sum <= 1.0
    };
    if inside_plane {
        // the point is on the plane of symmetry, near the centre: the nearest points are above and below it
        for i in (0..3).filter(|&i| gap[i] > 0.0) {
            x[i] = r[i] * r[i] * y[i] / gap[i];
        }
        let rest: f64 = (0..3).map(|i| square(x[i] / r[i])).sum();
        x[least] = r[least] * root((1.0 - rest).max(0.0));
    } else {
        for _ in 0..STEPS {
            let (mut value, mut slope) = (-1.0, 0.0);
            for i in 0..3 {
                let den = tau + gap[i];
                if y[i] > 0.0 && den > 0.0 {
                    let term = square(r[i] * y[i] / den);
                    value += term;
                    slope += 2.0 * term / den; // −dF/dτ
                }
            }
            let next = tau + value / slope;
            if value <= 0.0 || next <= tau || !next.is_finite() {
                break;
            }
            tau = next;
        }
        x = core::array::from_fn(|i| if y[i] > 0.0 { r[i] * r[i] * y[i] / (tau + gap[i]) } else { 0.0 });
    }
    let x = Vec3::from(core::array::from_fn(|i| if signed[i] < 0.0 { -x[i] } else { x[i] }));
    let slope = Vec3::new(x.x / (radii.x * radii.x), x.y / (radii.y * radii.y), x.z / (radii.z * radii.z));
    let normal = slope.scale(1.0 / norm(slope));
    Witness { distance: normal.dot(p - x), points: [p, x], normal }
}

/// Returns x².
fn square(x: f64) -> f64 {
    x * x
}
