//! Distance of a box to points, segments and boxes, penetration included.
//!
//! Boxes are in their own coordinates, with half side lengths h, so that the box consists of the points with |x_i| ≤
//! h_i. The squared distance of a point c + t u of a segment is
//!
//! ```text
//! f(t) = Σ_i max(|c_i + t u_i| − h_i, 0)²
//! ```
//!
//! It is convex, and its derivative is linear between at most six values of t, at which a coordinate reaches ±h_i. So
//! the zero of the derivative is found exactly. If f = 0 at the minimum, the segment intersects the box. Then the
//! penetration is the distance of the origin from the boundary of the difference of both shapes. This difference is a
//! polytope. The normals of its faces are the normals of the box's faces, and the products of the segment's direction
//! and the box's edges.
//!
//! Sources: Ericson, *Real-Time Collision Detection* (2005), sections 4.4.1 (separating axes) and 5.1.3 (point and
//! box); Gottschalk, Lin, Manocha, "OBBTree" (SIGGRAPH 1996), section 5.

use super::round::{Witness, norm, root};
use condyle_spatial::Vec3;

/// Ratio of distance and size below which shapes touch.
const TOUCHING: f64 = 1e-13;
/// Square of the sine of an angle below which two directions count as parallel: their product is not used as an axis.
const PARALLEL: f64 = 1e-24;
/// Cosine of an angle below which a direction counts as perpendicular to an edge, so that the whole edge is extreme.
pub(super) const PERPENDICULAR: f64 = 1e-9;
/// Difference of overlaps below which the normal of a face is preferred to a product of edges, relative to the size.
pub(super) const PREFERENCE: f64 = 1e-12;

/// Returns the vector with entry k equal to x, and other entries 0.
#[inline(always)]
pub(super) fn unit(k: usize, x: f64) -> Vec3<f64> {
    let mut e = [0.0; 3];
    e[k] = x;
    Vec3::from(e)
}

/// Returns the signed distance of a point p to a box, the nearest point of the boundary, and the normal there.
pub(super) fn point(p: Vec3<f64>, half: Vec3<f64>) -> Witness<f64> {
    let (x, h) = (p.to_array(), half.to_array());
    let nearest: [f64; 3] = core::array::from_fn(|i| x[i].clamp(-h[i], h[i]));
    let excess = p - Vec3::from(nearest);
    let square = excess.norm_squared();
    if square > 0.0 {
        let distance = root(square);
        return Witness { distance, points: [p, Vec3::from(nearest)], normal: excess.scale(1.0 / distance) };
    }
    let depth = |i: usize| h[i] - x[i].abs();
    let i = (1..3).fold(0, |least, i| if depth(i) < depth(least) { i } else { least });
    let sign = if x[i] < 0.0 { -1.0 } else { 1.0 };
    let mut nearest = x;
    nearest[i] = sign * h[i];
    Witness { distance: -depth(i), points: [p, Vec3::from(nearest)], normal: unit(i, sign) }
}

/// Returns the parameter t in [−1, 1] of the point of a segment c + t u that is nearest to a box. If several points
/// are nearest, returns the middle.
fn nearest_parameter(c: [f64; 3], u: [f64; 3], h: [f64; 3]) -> f64 {
    let (mut at, mut n) = ([-1.0; 8], 1);
    for i in 0..3 {
        for bound in [-h[i], h[i]] {
            let t = (bound - c[i]) / u[i];
            if t > -1.0 && t < 1.0 {
                at[n] = t;
                n += 1;
            }
        }
    }
    at[n] = 1.0;
    let at = &mut at[..=n];
    at.sort_unstable_by(f64::total_cmp);
    // ½ df/dt = Σ_i u_i · excess_i
    let slope = |t: f64| {
        (0..3).fold(0.0, |sum, i| {
            let x = c[i] + t * u[i];
            sum + u[i] * (x - x.clamp(-h[i], h[i]))
        })
    };
    let (mut first, mut last) = (1.0, -1.0); // the first t with slope ≥ 0, and the last with slope ≤ 0
    let (mut before, mut has_first) = ((-1.0, slope(-1.0)), false);
    for &t in at.iter() {
        let now = (t, slope(t));
        if !has_first && now.1 >= 0.0 {
            first = if before.1 < 0.0 { before.0 - before.1 * (now.0 - before.0) / (now.1 - before.1) } else { t };
            has_first = true;
        }
        if now.1 <= 0.0 {
            last = t;
        } else if before.1 <= 0.0 && before.0 < t {
            last = if before.1 == 0.0 { before.0 } else { first };
        }
        before = now;
    }
    (0.5 * (first + last)).clamp(-1.0, 1.0)
}

/// Returns the signed distance of a segment c + t u, −1 ≤ t ≤ 1, to a box. The segment is the first shape.
pub(super) fn segment(center: Vec3<f64>, along: Vec3<f64>, half: Vec3<f64>) -> Witness<f64> {
    if along.norm_squared() == 0.0 {
        return point(center, half);
    }
    separated_segment(center, along, half).unwrap_or_else(|| intersecting_segment(center, along, half))
}

/// Returns the distance of a segment to a box, or `None` if they intersect.
pub(super) fn separated_segment(center: Vec3<f64>, along: Vec3<f64>, half: Vec3<f64>) -> Option<Witness<f64>> {
    let (c, u, h) = (center.to_array(), along.to_array(), half.to_array());
    let p = center + along.scale(nearest_parameter(c, u, h));
    let nearest: [f64; 3] = core::array::from_fn(|i| p.to_array()[i].clamp(-h[i], h[i]));
    let excess = p - Vec3::from(nearest);
    let distance = norm(excess);
    let size = norm(center) + norm(along);
    let apart = distance > TOUCHING * size;
    let normal = excess.scale(1.0 / distance);
    apart.then_some(Witness { distance, points: [p, Vec3::from(nearest)], normal })
}

/// Returns the penetration of a segment that intersects a box, from the axis with the smallest overlap.
fn intersecting_segment(center: Vec3<f64>, along: Vec3<f64>, half: Vec3<f64>) -> Witness<f64> {
    let (c, u, h) = (center.to_array(), along.to_array(), half.to_array());
    let length = norm(along);
    let slack = PREFERENCE * (length + norm(half));
    let overlap = |n: Vec3<f64>| {
        let n = n.to_array();
        let reach: f64 = (0..3).map(|i| h[i] * n[i].abs()).sum();
        reach + along.dot(Vec3::from(n)).abs() - center.dot(Vec3::from(n))
    };
    let outward = |n: Vec3<f64>| if center.dot(n) < 0.0 { -n } else { n };
    let (mut axis, mut normal, mut depth) = (0, unit(0, 1.0), f64::INFINITY);
    for k in 0..6 {
        let n = if k < 3 { unit(k, 1.0) } else { along.cross(unit(k - 3, 1.0)) };
        let square = n.norm_squared();
        if square < PARALLEL * length * length {
            continue;
        }
        let n = outward(n.scale(1.0 / root(square)));
        let found = overlap(n);
        if found < depth - if k < 3 { 0.0 } else { slack } {
            (axis, normal, depth) = (k, n, found);
        }
    }
    let n = normal.to_array();
    if axis < 3 {
        // the end that is deepest below the face, or the middle of the part above which the face is
        let down = along.dot(normal);
        let t = if down.abs() > PERPENDICULAR * length {
            if down > 0.0 { -1.0 } else { 1.0 }
        } else {
            middle_within(c, u, h, axis)
        };
        let p = center + along.scale(t);
        return Witness { distance: -depth, points: [p, p + normal.scale(depth)], normal };
    }
    // the edge of the box, through the corner that is extreme along the normal
    let i = axis - 3;
    let corner = Vec3::from(core::array::from_fn(|j| if j == i || n[j] == 0.0 { 0.0 } else { h[j] * n[j].signum() }));
    let m = normal.cross(unit(i, 1.0));
    let t = ((corner - center).dot(m) / along.dot(m)).clamp(-1.0, 1.0);
    let p = center + along.scale(t);
    Witness { distance: -depth, points: [p, p + normal.scale(depth)], normal }
}

/// Returns the middle of the parameters t for which c + t u is within the box in all coordinates except `axis`.
fn middle_within(c: [f64; 3], u: [f64; 3], h: [f64; 3], axis: usize) -> f64 {
    let (mut low, mut high) = (-1.0_f64, 1.0_f64);
    for i in (0..3).filter(|&i| i != axis && u[i] != 0.0) {
        let (a, b) = ((-h[i] - c[i]) / u[i], (h[i] - c[i]) / u[i]);
        low = low.max(a.min(b));
        high = high.min(a.max(b));
    }
    (0.5 * (low + high)).clamp(-1.0, 1.0)
}
