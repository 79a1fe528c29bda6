//! Convex hulls by quickhull: Barber, Dobkin, Huhdanpaa (1996). Points are rounded to a grid with 2⁴⁰ steps along the
//! longest side of their box. On the grid, every test compares integers exactly. So flat, duplicate and nearly flat
//! points need no tolerance.

use super::part::Triangle;

/// Number of steps of the grid along the longest side of the box. With this number of steps, the determinants of the
/// method fit in an `i128`.
const STEPS: f64 = (1u64 << 40) as f64;

/// Coordinates of a point on the grid.
type Point = [i64; 3];

/// Triangle of a hull that is not yet finished.
struct Face {
    corners: Triangle,
    /// Neighbouring faces: entry k is the face on the other side of the edge that begins at corner k.
    across: [u32; 3],
    /// Normal (b − a) × (c − a) of a face with corners a, b, c; it points outwards.
    normal: [i128; 3],
    /// Points strictly outside of this face; each point is listed by one face only.
    outside: Vec<u32>,
    is_part: bool,
}

/// Returns the triangles of the convex hull of points, with corners counter-clockwise if seen from outside. Returns
/// `None` if all points lie in one plane.
///
/// ```
/// let corner = |i: u32| [0, 1, 2].map(|k| f64::from(i >> k & 1));
/// let mut points: Vec<_> = (0..8).map(corner).collect();
/// points.push([0.5, 0.5, 0.5]);
/// assert_eq!(condyle_meshes::hull(&points).unwrap().len(), 12); // two triangles for each side of the cube
/// assert_eq!(condyle_meshes::hull(&points[..4]), None);
/// ```
#[must_use]
pub fn hull(points: &[[f64; 3]]) -> Option<Vec<Triangle>> {
    let mut hull = start(grid(points)?)?;
    let mut waiting: Vec<u32> = (0..hull.faces.len() as u32).collect();
    while let Some(f) = waiting.pop() {
        let face = &hull.faces[f as usize];
        if !face.is_part || face.outside.is_empty() {
            continue;
        }
        let furthest = face.outside.iter().copied().max_by_key(|&p| hull.above(face, p));
        let first = hull.faces.len() as u32;
        hull.add(furthest?, f);
        waiting.extend(first..hull.faces.len() as u32);
    }
    Some(hull.faces.into_iter().filter(|face| face.is_part).map(|face| face.corners).collect())
}

/// Rounds points to the grid of their bounding box. Returns `None` if all points coincide or if one of them is not
/// finite.
fn grid(points: &[[f64; 3]]) -> Option<Vec<Point>> {
    let bound = |f: fn(f64, f64) -> f64, k: usize| points.iter().map(|p| p[k]).reduce(f).unwrap_or(0.0);
    let low = [0, 1, 2].map(|k| bound(f64::min, k));
    let side = [0, 1, 2].map(|k| bound(f64::max, k) - low[k]).into_iter().fold(0.0, f64::max);
    let finite = points.iter().flatten().all(|x| x.is_finite()) && side.is_finite() && side > 0.0;
    let step = |p: &[f64; 3]| [0, 1, 2].map(|k| ((p[k] - low[k]) / side * STEPS).round() as i64);
    finite.then(|| points.iter().map(step).collect())
}

fn minus(a: Point, b: Point) -> [i128; 3] {
    [0, 1, 2].map(|k| i128::from(a[k] - b[k]))
}

fn cross(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns a tetrahedron whose corners are points far from each other. The other points are distributed among its
/// faces.
fn start(grid: Vec<Point>) -> Option<Hull> {
    let all = || 0..grid.len() as u32;
    let at = |p: u32| grid[p as usize];
    let a = all().min_by_key(|&p| at(p))?;
    let length = |v: [i128; 3]| v.iter().map(|&x| (x as f64) * (x as f64)).sum::<f64>();
    let furthest = |measure: &dyn Fn(u32) -> f64| all().max_by(|&p, &q| measure(p).total_cmp(&measure(q)));
    let b = furthest(&|p| length(minus(at(p), at(a))))?;
    let edge = minus(at(b), at(a));
    let c = furthest(&|p| length(cross(edge, minus(at(p), at(a)))))?;
    let normal = cross(edge, minus(at(c), at(a)));
    let height = |p: u32| dot(normal, minus(at(p), at(a)));
    let d = all().max_by_key(|&p| height(p).abs()).filter(|&p| height(p) != 0)?;
    // The point d must lie below the face with corners a, b and c.
    let [b, c] = if height(d) < 0 { [b, c] } else { [c, b] };
    let face = |corners, across| Face { corners, across, normal: [0; 3], outside: Vec::new(), is_part: true };
    let mut faces = vec![
        face([a, b, c], [1, 2, 3]),
        face([b, a, d], [0, 3, 2]),
        face([c, b, d], [0, 1, 3]),
        face([a, c, d], [0, 2, 1]),
    ];
    for face in &mut faces {
        face.normal = normal_of(&grid, face.corners);
    }
    let everything = all().collect();
    let mut hull = Hull { faces, grid };
    hull.share_out(everything, 0);
    Some(hull)
}

fn normal_of(grid: &[Point], corners: Triangle) -> [i128; 3] {
    let [a, b, c] = corners.map(|p| grid[p as usize]);
    cross(minus(b, a), minus(c, a))
}

struct Hull {
    faces: Vec<Face>,
    grid: Vec<Point>,
}

impl Hull {
    /// Returns n · (p − a), with the normal n and a corner a of a face. The result is positive if the point p is
    /// outside of the face.
    fn above(&self, face: &Face, p: u32) -> i128 {
        dot(face.normal, minus(self.grid[p as usize], self.grid[face.corners[0] as usize]))
    }

    /// Distributes points among the faces from index `first` on: each point is listed by the first face for which the
    /// point is outside. Points inside all faces are dropped.
    fn share_out(&mut self, points: Vec<u32>, first: usize) {
        for p in points {
            if let Some(f) = (first..self.faces.len()).find(|&f| self.above(&self.faces[f], p) > 0) {
                self.faces[f].outside.push(p);
            }
        }
    }

    /// Adds a point outside of a face. All faces with the point on their outer side are replaced by a cone. The cone
    /// goes from the point to the rim of the replaced faces.
    fn add(&mut self, p: u32, seen_by: u32) {
        let (mut visible, mut rim) = (vec![seen_by], Vec::new());
        self.faces[seen_by as usize].is_part = false;
        let mut k = 0;
        while let Some(&f) = visible.get(k) {
            k += 1;
            for e in 0..3 {
                let next = self.faces[f as usize].across[e];
                let face = &self.faces[next as usize];
                if !face.is_part {
                    continue; // the point is on the outer side of this face, too
                }
                if self.above(face, p) > 0 {
                    self.faces[next as usize].is_part = false;
                    visible.push(next);
                } else {
                    let corners = self.faces[f as usize].corners;
                    rim.push((corners[e], corners[(e + 1) % 3], next));
                }
            }
        }
        // The rim is a closed loop. Its edges are sorted by their first corner, so that the successor of an edge is
        // found quickly.
        let first = self.faces.len();
        rim.sort_unstable();
        let begins = |rim: &[(u32, u32, u32)], corner: u32| first + rim.partition_point(|edge| edge.0 < corner);
        let mut ends: Vec<(u32, u32)> = rim.iter().enumerate().map(|(i, edge)| (edge.1, (first + i) as u32)).collect();
        ends.sort_unstable();
        for (i, &(a, b, outer)) in rim.iter().enumerate() {
            let before = ends[ends.partition_point(|end| end.0 < a)].1;
            let corners = [a, b, p];
            let across = [outer, begins(&rim, b) as u32, before];
            let normal = normal_of(&self.grid, corners);
            self.faces.push(Face { corners, across, normal, outside: Vec::new(), is_part: true });
            let outer = &mut self.faces[outer as usize];
            if let Some(e) = (0..3).find(|&e| outer.corners[e] == b) {
                outer.across[e] = (first + i) as u32;
            }
        }
        for f in visible {
            let points = std::mem::take(&mut self.faces[f as usize].outside);
            self.share_out(points, first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::hull;

    /// Returns six times the volume that triangles enclose.
    fn volume(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> f64 {
        let determinant = |[a, b, c]: [[f64; 3]; 3]| {
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        triangles.iter().map(|t| determinant(t.map(|p| points[p as usize]))).sum()
    }

    /// Yields pseudo-random numbers from 0 to 1; they are the same in each run.
    fn numbers() -> impl Iterator<Item = f64> {
        let mut x = 1u64;
        std::iter::from_fn(move || {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            Some((x >> 11) as f64 / (1u64 << 53) as f64)
        })
    }

    #[test]
    fn no_point_is_outside_and_each_edge_has_two_triangles() {
        let mut random = numbers();
        for case in 0..60 {
            let count = 4 + case * 5;
            // In every third case, the points are on a coarse lattice. Then many points are collinear, coplanar or
            // equal.
            let mut number = || {
                let x = random.next().unwrap();
                if case % 3 == 0 { (4.0 * x).round() } else { x }
            };
            let points: Vec<[f64; 3]> = (0..count).map(|_| [number(), number(), number()]).collect();
            let Some(found) = hull(&points) else { continue };
            let mut edges: Vec<_> = found.iter().flat_map(|t| [0, 1, 2].map(|e| (t[e], t[(e + 1) % 3]))).collect();
            edges.sort_unstable();
            let unique = edges.windows(2).all(|w| w[0] != w[1]);
            assert!(unique && edges.iter().all(|&(a, b)| edges.binary_search(&(b, a)).is_ok()), "case {case}");
            for t in &found {
                for p in 0..count as u32 {
                    let four =
                        [t[0], t[1], t[2]].map(|k| [0, 1, 2].map(|i| points[k as usize][i] - points[p as usize][i]));
                    assert!(volume(&four, &[[0, 1, 2]]) > -1e-9, "case {case}: point {p} is outside of {t:?}");
                }
            }
        }
    }

    #[test]
    fn volume_of_a_lattice_and_of_a_ball() {
        let lattice: Vec<_> = (0..216).map(|i| [i % 6, i / 6 % 6, i / 36].map(f64::from)).collect();
        assert_eq!(volume(&lattice, &hull(&lattice).unwrap()), 6.0 * 125.0);
        let mut random = numbers();
        let mut ball = Vec::new();
        while ball.len() < 5000 {
            let p = [0; 3].map(|_| 2.0 * random.next().unwrap() - 1.0);
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.1 && length < 1.0 {
                ball.push(p.map(|x| x / length));
            }
        }
        let triangles = hull(&ball).unwrap();
        assert_eq!(triangles.len(), 2 * 5000 - 4); // Euler's formula: every point is a corner
        let sphere = 8.0 * std::f64::consts::PI; // 6 times the volume 4/3 π
        assert!((volume(&ball, &triangles) / sphere - 1.0).abs() < 5e-3);
    }

    #[test]
    fn flat_and_invalid_points_have_no_hull() {
        let flat = |i: u32| [f64::from(i % 7), f64::from(i / 7), 3.0];
        assert_eq!(hull(&(0..40).map(flat).collect::<Vec<_>>()), None);
        assert_eq!(hull(&[]), None);
        assert_eq!(hull(&[[1.0; 3]; 9]), None);
        assert_eq!(hull(&[[f64::NAN, 0.0, 0.0], [1.0; 3], [2.0, 0.0, 0.0], [0.0, 5.0, 1.0]]), None);
    }
}
