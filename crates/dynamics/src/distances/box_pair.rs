//! Distance of two boxes, penetration included.
//!
//! If the boxes are apart, the nearest points are on an edge of one box and on the other box: the smallest distance of
//! the 24 edges to the other box is exact. If they overlap, the difference of both boxes is a polytope that contains
//! the origin. The normals of its faces are the six normals of faces and the nine products of edges. The penetration
//! is the smallest overlap along these 15 axes.
//!
//! Sources: Gottschalk, Lin, Manocha, "OBBTree" (SIGGRAPH 1996), section 5; Ericson, *Real-Time Collision Detection*
//! (2005), section 4.4.1.

use super::boxes::{PERPENDICULAR, PREFERENCE, separated_segment, unit};
use super::round::{Witness, root};
use condyle_spatial::{Act, Se3, Vec3};

/// Square of the sine of an angle below which two edges count as parallel: their product is not used as an axis.
const PARALLEL: f64 = 1e-16;

/// Box in the world: the pose of its coordinates and its half side lengths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cuboid {
    pub pose: Se3<f64>,
    pub half: Vec3<f64>,
}

impl Cuboid {
    /// Returns the largest x·n of the points x of the box, relative to its centre.
    fn reach(&self, n: Vec3<f64>) -> f64 {
        let (n, h) = (self.pose.rotation.transpose_mul(n).to_array(), self.half.to_array());
        (0..3).map(|i| h[i] * n[i].abs()).sum()
    }

    /// Returns the middle and the half vector of edge k in 0..12, in the world.
    fn edge(&self, k: usize) -> [Vec3<f64>; 2] {
        let (i, h) = (k / 4, self.half.to_array());
        let mut x = [0.0; 3];
        x[(i + 1) % 3] = if k & 1 == 0 { h[(i + 1) % 3] } else { -h[(i + 1) % 3] };
        x[(i + 2) % 3] = if k & 2 == 0 { h[(i + 2) % 3] } else { -h[(i + 2) % 3] };
        [self.pose.act(Vec3::from(x)), self.pose.rotation * unit(i, h[i])]
    }

    /// Returns the corners, in order around it, of the vertex, edge or face with the largest x·n.
    fn extreme(&self, n: Vec3<f64>) -> Polygon {
        let (n, h) = (self.pose.rotation.transpose_mul(n).to_array(), self.half.to_array());
        let flat: [bool; 3] = core::array::from_fn(|i| n[i].abs() < PERPENDICULAR);
        let base: [f64; 3] = core::array::from_fn(|i| if n[i] < 0.0 { -h[i] } else { h[i] });
        let mut polygon = Polygon::default();
        // the signs of the free coordinates, in order around a face
        let free: [usize; 2] = match flat {
            [false, false, false] => [3, 3],
            [true, true, _] => [0, 1],
            [true, _, true] => [0, 2],
            [_, true, true] => [1, 2],
            _ => [flat.iter().position(|&free| free).unwrap_or(3), 3],
        };
        for signs in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
            if free[1] == 3 && signs[1] < 0.0 || free[0] == 3 && signs[0] < 0.0 {
                continue;
            }
            let mut x = base;
            for (&k, sign) in free.iter().zip(signs) {
                if k < 3 {
                    x[k] = sign * h[k];
                }
            }
            polygon.push(self.pose.act(Vec3::from(x)));
        }
        polygon
    }

    /// Returns the middle of a polygon's part that is above a face of this box with the normal along its axis k.
    fn middle_above(&self, polygon: Polygon, k: usize) -> Vec3<f64> {
        let mut part = polygon;
        for i in [(k + 1) % 3, (k + 2) % 3] {
            let (axis, h) = (self.pose.rotation.columns()[i], self.half.to_array()[i]);
            for n in [axis, -axis] {
                part = part.below(n, n.dot(self.pose.translation) + h);
            }
        }
        if part.count == 0 { polygon.middle() } else { part.middle() }
    }
}

/// Corners of a convex polygon.
#[derive(Clone, Copy, Debug, Default)]
struct Polygon {
    corners: [[f64; 3]; 9],
    count: usize,
}

impl Polygon {
    fn push(&mut self, p: Vec3<f64>) {
        if self.count < self.corners.len() {
            self.corners[self.count] = p.to_array();
            self.count += 1;
        }
    }

    fn middle(&self) -> Vec3<f64> {
        let sum = self.corners[..self.count].iter().fold(Vec3::zero(), |sum, &p| sum + Vec3::from(p));
        sum.scale(1.0 / self.count as f64)
    }

    /// Returns the part of the polygon with n·x ≤ offset. Source: Sutherland, Hodgman, "Reentrant polygon clipping"
    /// (Communications of the ACM, 1974).
    fn below(&self, n: Vec3<f64>, offset: f64) -> Self {
        let mut part = Self::default();
        for k in 0..self.count {
            let (a, b) = (Vec3::from(self.corners[k]), Vec3::from(self.corners[(k + 1) % self.count]));
            let (x, y) = (n.dot(a) - offset, n.dot(b) - offset);
            if x <= 0.0 {
                part.push(a);
            }
            if (x < 0.0 && y > 0.0) || (x > 0.0 && y < 0.0) {
                part.push(a + (b - a).scale(x / (x - y)));
            }
        }
        part
    }
}

/// Returns the signed distance of two boxes.
pub(crate) fn boxes(first: &Cuboid, second: &Cuboid) -> Witness<f64> {
    let [mine, others] = [first, second].map(|cuboid| cuboid.pose.rotation.columns());
    let between = first.pose.translation - second.pose.translation;
    let size = root(first.half.norm_squared() + second.half.norm_squared());
    let (mut least, mut normal, mut depth) = (0, mine[0], f64::INFINITY);
    for k in 0..15 {
        let n = match k {
            0..3 => mine[k],
            3..6 => others[k - 3],
            _ => mine[(k - 6) / 3].cross(others[(k - 6) % 3]),
        };
        let square = n.norm_squared();
        if square < PARALLEL {
            continue;
        }
        let n = n.scale(1.0 / root(square));
        let n = if n.dot(between) < 0.0 { -n } else { n };
        let overlap = first.reach(n) + second.reach(n) - n.dot(between);
        if overlap < 0.0
            && let Some(witness) = separated(first, second)
        {
            return witness;
        }
        if overlap < depth - if k < 6 { 0.0 } else { PREFERENCE * size } {
            (least, normal, depth) = (k, n, overlap);
        }
    }
    let on_first = match least {
        0..3 => first.middle_above(second.extreme(normal), least) - normal.scale(depth),
        3..6 => second.middle_above(first.extreme(-normal), least - 3),
        _ => {
            // the edges through the extreme corners, along whose product both boxes overlap least
            let [u, v] = [mine[(least - 6) / 3], others[(least - 6) % 3]];
            let [p, q] = [first.extreme(-normal).middle(), second.extreme(normal).middle()];
            let m = normal.cross(v);
            let (t, h) = ((q - p).dot(m) / u.dot(m), 2.0 * first.half.to_array()[(least - 6) / 3]);
            p + u.scale(t.clamp(-h, h))
        }
    };
    Witness { distance: -depth, points: [on_first, on_first + normal.scale(depth)], normal }
}

/// Returns the distance of two boxes that are apart, or `None` if an edge of one touches the other.
fn separated(first: &Cuboid, second: &Cuboid) -> Option<Witness<f64>> {
    let mut nearest: Option<Witness<f64>> = None;
    for (edges, other, swap) in [(first, second, false), (second, first, true)] {
        for k in 0..12 {
            let [center, along] = edges.edge(k);
            let [c, u] = [other.pose.act_inv(center), other.pose.rotation.transpose_mul(along)];
            let found = separated_segment(c, u, other.half)?;
            if nearest.is_none_or(|nearest| found.distance < nearest.distance) {
                let world = Witness {
                    points: found.points.map(|p| other.pose.act(p)),
                    normal: other.pose.rotation * found.normal,
                    ..found
                };
                nearest = Some(if swap { world.swapped() } else { world });
            }
        }
    }
    nearest
}
