//! Simplification of meshes. Points that coincide are merged. Then edges are collapsed. The edge whose collapse changes
//! the surface least comes first (Garland and Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH
//! 1997).

use super::part::Part;
use nalgebra::Vector3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

/// Number of grid cells along the longest side of a part.
const CELLS: f64 = 32768.0;
/// Maximum number of triangles before edges collapse. If the grid leaves more triangles, its cells become coarser.
const MOST: usize = 200_000;
/// Weight of the planes through border edges of an open surface, relative to the planes of triangles.
const BORDER: f64 = 10.0;
/// Minimum cosine of the angle between a triangle's normals before and after one of its corners moves.
const TURN: f64 = 0.2;

/// Returns a simplified part with at most `target` triangles. `target` must be at least 12.
pub(super) fn simplify(part: &Part, target: usize) -> Part {
    let mut cells = CELLS;
    let mut welded = weld(part, cells);
    while welded.triangles.len() > MOST.max(target) && cells > 2.0 {
        cells /= 2.0;
        welded = weld(part, cells);
    }
    if welded.triangles.len() > target {
        welded = Surface::new(&welded).collapse(target);
    }
    // Triangles without common points have no edges that can collapse. Coarser cells merge such triangles.
    cells = cells.min(256.0);
    while welded.triangles.len() > target && cells > 1.0 {
        cells /= 2.0;
        welded = weld(part, cells);
    }
    welded
}

/// Merges the points in each cell of a grid into their mean. Drops triangles that become degenerate or duplicates.
fn weld(part: &Part, cells: f64) -> Part {
    let (low, high) = bounds(&part.points);
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let side = if longest > 0.0 { longest / cells } else { 1.0 };
    let (mut numbers, mut sums) = (HashMap::new(), Vec::<(Vector3<f64>, f64)>::new());
    let number: Vec<u32> = part
        .points
        .iter()
        .map(|p| {
            let cell = [0, 1, 2].map(|k| ((p[k] - low[k]) / side).round() as u32);
            let number = *numbers.entry(cell).or_insert_with(|| {
                sums.push((Vector3::zeros(), 0.0));
                sums.len() - 1
            });
            sums[number].0 += Vector3::from(*p);
            sums[number].1 += 1.0;
            number as u32
        })
        .collect();
    let mut seen = HashSet::new();
    let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    let mut new = |t: &[u32; 3]| {
        let mut sorted = *t;
        sorted.sort_unstable();
        seen.insert(sorted)
    };
    let triangles = part.triangles.iter().map(|t| t.map(|c| number[c as usize]));
    let triangles = triangles.filter(|t| whole(t) && new(t)).collect();
    let points: Vec<[f64; 3]> = sums.iter().map(|(sum, count)| (sum / *count).into()).collect();
    Part::of(&points, triangles, part.color)
}

/// Returns the lower corner and the upper corner of the box around points.
pub(super) fn bounds(points: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let limits = |f: fn(f64, f64) -> f64, from| [0, 1, 2].map(|k| points.iter().map(|p| p[k]).fold(from, f));
    if points.is_empty() {
        return Default::default();
    }
    (limits(f64::min, f64::INFINITY), limits(f64::max, f64::NEG_INFINITY))
}

/// Sum of squared distances from planes, (x, 1)ᵀ Q (x, 1), as a function of a point x. The numbers are the upper half
/// of the symmetric Q, row by row.
#[derive(Clone)]
struct Quadric([f64; 10]);

impl Quadric {
    const ZERO: Self = Self([0.0; 10]);

    /// Adds the squared distance from a plane, given a point of the plane and its unit normal.
    fn add_plane(&mut self, normal: Vector3<f64>, point: Vector3<f64>, weight: f64) {
        let [x, y, z, w] = [normal.x, normal.y, normal.z, -normal.dot(&point)];
        let products = [x * x, x * y, x * z, x * w, y * y, y * z, y * w, z * z, z * w, w * w];
        *self = self.plus(&Self(products.map(|product| weight * product)));
    }

    fn plus(&self, other: &Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] + other.0[k]))
    }

    fn at(&self, x: Vector3<f64>) -> f64 {
        let [xx, xy, xz, xw, yy, yz, yw, zz, zw, ww] = self.0;
        let [x, y, z] = x.into();
        let slopes = [xx * x + 2.0 * (xy * y + xz * z + xw), yy * y + 2.0 * (yz * z + yw), zz * z + 2.0 * zw];
        (slopes[0] * x + slopes[1] * y + slopes[2] * z + ww).max(0.0)
    }

    /// Returns the point with the smallest sum of squared distances, computed by cofactors. If this point is not
    /// unique, the result is far away or not finite.
    fn least(&self) -> Vector3<f64> {
        let [xx, xy, xz, xw, yy, yz, yw, zz, zw, _] = self.0;
        let [a, b, c] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
        let [d, e, f] = [xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy];
        let scale = -1.0 / (xx * a + xy * b + xz * c);
        Vector3::new(a * xw + b * yw + c * zw, b * xw + d * yw + e * zw, c * xw + e * yw + f * zw) * scale
    }
}

/// Edge in the queue: the bits of its cost, its two end points, and the change count of each end point when the cost
/// was computed.
type Edge = (u64, [u32; 2], [u32; 2]);

/// Surface whose edges are collapsed, scaled to a box with longest side 1.
struct Surface {
    low: Vector3<f64>,
    side: f64,
    color: Option<[f64; 3]>,
    points: Vec<Vector3<f64>>,
    quadrics: Vec<Quadric>,
    /// Number of changes of each point. If an end point of an edge has changed since the edge's cost was computed, the
    /// cost is outdated.
    changes: Vec<u32>,
    triangles: Vec<Option<[u32; 3]>>,
    /// Triangles at each point, including deleted ones.
    around: Vec<Vec<u32>>,
    left: usize,
    edges: BinaryHeap<Reverse<Edge>>,
}

impl Surface {
    fn new(part: &Part) -> Self {
        let (low, high) = bounds(&part.points);
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        let side = (high - low).max().max(f64::MIN_POSITIVE);
        let points: Vec<_> = part.points.iter().map(|p| (Vector3::from(*p) - low) / side).collect();
        let count = points.len();
        let mut surface = Self {
            low,
            side,
            color: part.color,
            quadrics: vec![Quadric::ZERO; count],
            changes: vec![0; count],
            triangles: part.triangles.iter().copied().map(Some).collect(),
            around: vec![Vec::new(); count],
            left: part.triangles.len(),
            edges: BinaryHeap::new(),
            points,
        };
        let mut faces = HashMap::<[u32; 2], (u32, Vector3<f64>)>::new();
        for (number, t) in part.triangles.iter().enumerate() {
            let [a, b, c] = t.map(|c| surface.points[c as usize]);
            let normal = (b - a).cross(&(c - a));
            let area = normal.norm();
            let unit = if area > 0.0 { normal / area } else { Vector3::zeros() };
            for k in 0..3 {
                surface.around[t[k] as usize].push(number as u32);
                surface.quadrics[t[k] as usize].add_plane(unit, a, area);
                faces.entry(edge(t[k], t[(k + 1) % 3])).or_insert((0, unit)).0 += 1;
            }
        }
        for (&[a, b], &(count, unit)) in &faces {
            if count == 1 {
                // Adds a plane for a border edge. The plane contains the edge and is perpendicular to the edge's only
                // triangle.
                let (from, to) = (surface.points[a as usize], surface.points[b as usize]);
                let along = to - from;
                let normal = along.cross(&unit);
                let weight = BORDER * along.norm_squared();
                if normal.norm() > 0.0 {
                    for end in [a, b] {
                        surface.quadrics[end as usize].add_plane(normal.normalize(), from, weight);
                    }
                }
            }
        }
        let mut all: Vec<[u32; 2]> = faces.into_keys().collect();
        all.sort_unstable();
        for [a, b] in all {
            surface.push(a, b);
        }
        surface
    }

    /// Returns the cost of collapsing an edge, and the point to which its two ends move.
    fn best(&self, a: u32, b: u32) -> (f64, Vector3<f64>) {
        let quadric = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let (p, q) = (self.points[a as usize], self.points[b as usize]);
        let middle = 0.5 * (p + q);
        // If the surface is flat at this edge, the optimal point may not exist or may be far away.
        let near = Some(quadric.least()).filter(|x| (x - middle).norm() <= (p - q).norm());
        let cost = |x: Vector3<f64>| (quadric.at(x), x);
        let ends = [middle, p, q]
            .into_iter()
            .map(cost)
            .fold((f64::INFINITY, middle), |best, this| if this.0 < best.0 { this } else { best });
        near.map(cost).filter(|this| this.0 < ends.0).unwrap_or(ends)
    }

    fn push(&mut self, a: u32, b: u32) {
        // Among edges without cost, the shortest edge comes first.
        let length = (self.points[a as usize] - self.points[b as usize]).norm_squared();
        let cost = self.best(a, b).0 + 1e-9 * length;
        self.edges.push(Reverse((cost.to_bits(), [a, b], [a, b].map(|end| self.changes[end as usize]))));
    }

    /// Returns whether the triangles around one end of an edge keep their orientation when this end moves. Triangles
    /// that contain the edge are not checked, because they vanish.
    fn keeps(&self, moved: u32, other: u32, to: Vector3<f64>) -> bool {
        self.around[moved as usize].iter().filter_map(|&t| self.triangles[t as usize]).all(|t| {
            if t.contains(&other) {
                return true;
            }
            let normal = |at: &dyn Fn(u32) -> Vector3<f64>| {
                let [a, b, c] = t.map(at);
                (b - a).cross(&(c - a))
            };
            let before = normal(&|c| self.points[c as usize]);
            let after = normal(&|c| if c == moved { to } else { self.points[c as usize] });
            before.dot(&after) >= TURN * before.norm() * after.norm()
        })
    }

    /// Collapses edges until `target` triangles are left or no more edges can collapse.
    fn collapse(mut self, target: usize) -> Part {
        while self.left > target {
            let Some(Reverse((_, [a, b], changes))) = self.edges.pop() else { break };
            if changes != [a, b].map(|end| self.changes[end as usize]) {
                continue;
            }
            let to = self.best(a, b).1;
            if !self.keeps(a, b, to) || !self.keeps(b, a, to) {
                continue;
            }
            self.points[a as usize] = to;
            self.quadrics[a as usize] = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
            self.changes[a as usize] += 1;
            self.changes[b as usize] += 1;
            let mut own = std::mem::take(&mut self.around[a as usize]);
            let moved = std::mem::take(&mut self.around[b as usize]);
            own.retain(|&t| self.triangles[t as usize].is_some());
            for t in moved {
                let Some(corners) = &mut self.triangles[t as usize] else { continue };
                if corners.contains(&a) {
                    self.triangles[t as usize] = None;
                    self.left -= 1;
                } else {
                    corners.iter_mut().filter(|c| **c == b).for_each(|c| *c = a);
                    own.push(t);
                }
            }
            own.retain(|&t| self.triangles[t as usize].is_some());
            let corners = own.iter().filter_map(|&t| self.triangles[t as usize]).flatten();
            let mut others: Vec<u32> = corners.filter(|&c| c != a).collect();
            others.sort_unstable();
            others.dedup();
            self.around[a as usize] = own;
            for other in others {
                let [from, to] = edge(a, other);
                self.push(from, to);
            }
        }
        let points: Vec<[f64; 3]> = self.points.iter().map(|p| (self.low + self.side * p).into()).collect();
        Part::of(&points, self.triangles.into_iter().flatten().collect(), self.color)
    }
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    if a < b { [a, b] } else { [b, a] }
}

#[cfg(test)]
mod tests {
    use super::{bounds, simplify};
    use crate::part::Part;

    /// Returns a sphere of radius 1 whose triangles have no common points.
    fn sphere(n: usize) -> Part {
        let at = |i: usize, j: usize| {
            let (a, b) =
                (core::f64::consts::PI * i as f64 / n as f64, core::f64::consts::TAU * (j % n) as f64 / n as f64);
            [a.sin() * b.cos(), a.sin() * b.sin(), a.cos()]
        };
        let mut part = Part::default();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            for corners in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]] {
                let first = part.points.len() as u32;
                part.points.extend(corners);
                part.triangles.push([first, first + 1, first + 2]);
            }
        }
        part
    }

    /// Returns the volume that a closed surface encloses.
    fn volume(part: &Part) -> f64 {
        let corner = |c: u32| nalgebra::Vector3::from(part.points[c as usize]);
        part.triangles.iter().map(|t| corner(t[0]).dot(&corner(t[1]).cross(&corner(t[2]))) / 6.0).sum()
    }

    #[test]
    fn a_sphere_stays_one() {
        let whole = sphere(60);
        let less = simplify(&whole, 400);
        assert!((300..=400).contains(&less.triangles.len()), "{}", less.triangles.len());
        assert!((volume(&less) / volume(&whole) - 1.0).abs() < 0.02, "{}", volume(&less) / volume(&whole));
        let far = less.points.iter().map(|p| (nalgebra::Vector3::from(*p).norm() - 1.0).abs()).fold(0.0, f64::max);
        assert!(far < 0.02, "a point is {far} off the sphere");
    }

    #[test]
    fn a_flat_square_needs_few_triangles_and_keeps_its_corners() {
        let (mut part, n) = (Part::default(), 40u32);
        for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
            part.points.push([f64::from(i), f64::from(j), 0.0]);
            if i < n && j < n {
                let k = i * (n + 1) + j;
                part.triangles.extend([[k, k + n + 1, k + n + 2], [k, k + n + 2, k + 1]]);
            }
        }
        let less = simplify(&part, 12);
        assert!(less.triangles.len() <= 12);
        let (low, high) = bounds(&less.points);
        for k in 0..2 {
            assert!(low[k].abs() < 1e-6 && (high[k] - 40.0).abs() < 1e-6, "{low:?} {high:?}");
        }
    }

    #[test]
    fn degenerate_parts_are_simplified() {
        assert!(simplify(&Part::default(), 12).triangles.is_empty());
        let point = Part { points: vec![[1.0; 3]; 3], triangles: vec![[0, 1, 2]], color: None };
        assert!(simplify(&point, 12).triangles.is_empty());
        // These triangles have no common points, so only coarser cells can reduce their number.
        let mut pieces = Part::default();
        for k in 0..5000u32 {
            let x = f64::from(k % 70);
            let y = f64::from(k / 70);
            pieces.points.extend([[x, y, 0.0], [x + 0.1, y, 0.0], [x, y + 0.1, 0.0]]);
            pieces.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        assert!(simplify(&pieces, 100).triangles.len() <= 100);
        let huge = Part { points: vec![[1e300, 0.0, 0.0], [-1e300, 0.0, 0.0], [0.0, 1e300, 0.0]], ..point };
        assert!(simplify(&huge, 12).triangles.len() <= 1);
    }
}
