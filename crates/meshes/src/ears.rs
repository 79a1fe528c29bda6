//! Cuts polygons into triangles in the same way as MuJoCo's reader of OBJ (tinyobjloader, without mapbox's earcut). If
//! the corners of a face are not in a plane, the volume of the mesh depends on the cuts.

use super::part::Triangle;

/// Maximum number of tests whether a corner is inside an ear, for all faces of a file together. These tests take about
/// a second.
const MAX_TESTS: usize = 1 << 26;

/// Maximum number of corners of a face that MuJoCo's reader cuts. Faces with more corners are left out.
const MAX_CORNERS: usize = 100;

/// Cutter for the faces of one file, which counts its tests.
#[derive(Default)]
pub(super) struct Ears {
    tests: usize,
    /// Number of faces from which triangles are left out.
    pub(super) lost: usize,
}

impl Ears {
    /// Returns the triangles of a face. A quadrilateral is cut along its shorter diagonal. From larger polygons, ears
    /// are cut off, in the plane of two axes. As in MuJoCo, a remaining polygon without an ear is left out, and so are
    /// faces with more than 100 corners.
    pub(super) fn cut(&mut self, points: &[[f64; 3]], mut face: Vec<u32>) -> Result<Vec<Triangle>, String> {
        let at = |corner: u32| points[corner as usize].map(|x| x as f32);
        if let [a, b, c, d] = face[..] {
            let across = squared(at(a), at(c)) >= squared(at(b), at(d));
            return Ok(if across { vec![[a, b, d], [b, c, d]] } else { vec![[a, b, c], [a, c, d]] });
        }
        if face.len() > MAX_CORNERS {
            self.lost += 1;
            return Ok(Vec::new());
        }
        let corners: Vec<_> = face.iter().map(|&corner| at(corner)).collect();
        let plane = plane(&corners);
        let flat = |corner: u32| plane.map(|axis| at(corner)[axis]);
        let (mut triangles, mut first, mut tries) = (Vec::new(), 0, face.len());
        while face.len() > 3 && tries > 0 {
            let n = face.len();
            tries -= 1;
            let ear = [0, 1, 2].map(|k| face[(first + k) % n]);
            let sides = ear.map(flat);
            let mut others = (3..n).map(|k| flat(face[(first + k) % n]));
            let is_free = is_outward(sides) && {
                let tested = others.position(|other| is_inside(sides, other));
                self.tests += tested.unwrap_or(n);
                tested.is_none()
            };
            if self.tests > MAX_TESTS {
                return Err(format!("to cut its faces takes more than {MAX_TESTS} tests: give it smaller faces"));
            }
            if is_free {
                triangles.push(ear);
                face.remove((first + 1) % n);
                if tries > 0 {
                    tries = n; // if the last possible corner gives an ear, the search ends
                }
            } else {
                first += 1;
            }
            first %= face.len();
        }
        match <[u32; 3]>::try_from(face) {
            Ok(last) => triangles.push(last),
            Err(rest) => self.lost += usize::from(rest.len() > 3),
        }
        Ok(triangles)
    }
}

/// Returns the squared distance between two points.
fn squared(p: [f32; 3], q: [f32; 3]) -> f32 {
    (0..3).map(|k| (q[k] - p[k]) * (q[k] - p[k])).sum()
}

/// Returns the two axes along which a polygon is projected. The third axis has the largest component of the normal at
/// the first corner whose sides are not parallel.
fn plane(corners: &[[f32; 3]]) -> [usize; 2] {
    let n = corners.len();
    for k in 0..n {
        let [p, q, r] = [k, k + 1, k + 2].map(|k| corners[k % n]);
        let ([a, b, c], [d, e, f]) = ([0, 1, 2].map(|i| q[i] - p[i]), [0, 1, 2].map(|i| r[i] - q[i]));
        let [x, y, z] = [b * f - c * e, c * d - a * f, a * e - b * d].map(f32::abs);
        if [x, y, z].iter().any(|&size| size > f32::EPSILON) {
            return match (x > y && x > z, z > x && z > y) {
                (true, _) => [1, 2],
                (_, true) => [0, 1],
                _ => [0, 2],
            };
        }
    }
    [1, 2]
}

/// Returns whether the corner of an ear is outward, by the test of MuJoCo's reader: the ear turns in the same direction
/// as the ear's first side, seen from the origin.
fn is_outward([a, b, c]: [[f32; 2]; 3]) -> bool {
    let turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
    let area = (a[0] * b[1] - a[1] * b[0]) * 0.5;
    let product = turn * area;
    product >= 0.0 || product.is_nan()
}

/// Returns whether a point is inside a triangle: a ray from the point crosses an odd number of sides.
fn is_inside(triangle: [[f32; 2]; 3], [x, y]: [f32; 2]) -> bool {
    let [a, b, c] = triangle;
    [(a, c), (b, a), (c, b)].into_iter().fold(false, |is_inside, (p, q)| {
        let crosses = (p[1] > y) != (q[1] > y) && x < (q[0] - p[0]) * (y - p[1]) / (q[1] - p[1]) + p[0];
        is_inside != crosses
    })
}

#[cfg(test)]
mod tests {
    use super::{Ears, MAX_TESTS};

    /// Corners of a face; each has coordinates along two axes and a height.
    type Corners = &'static [[f64; 3]];

    /// Faces, and the triangles that MuJoCo 4.0.0 has for them in `mesh_face`. In the input of MuJoCo, a cone closed
    /// each face to a solid. Corners are counted from 0.
    const FACES: &[(Corners, &[[u32; 3]])] = &[
        (
            &[[3.0, 1.0, 0.0], [5.0, 1.0, 0.5], [6.0, 3.0, 0.0], [4.0, 5.0, 1.0], [2.0, 3.0, -0.5]],
            &[[1, 2, 3], [1, 3, 4], [0, 1, 4]],
        ),
        (
            &[[1.0, 0.0, 3.0], [1.0, 0.5, 5.0], [3.0, 0.0, 6.0], [5.0, 1.0, 4.0], [3.0, -0.5, 2.0]],
            &[[1, 2, 3], [1, 3, 4], [0, 1, 4]],
        ),
        (
            &[[0.0, 3.0, 1.0], [0.5, 5.0, 1.0], [0.0, 6.0, 3.0], [1.0, 4.0, 5.0], [-0.5, 2.0, 3.0]],
            &[[1, 2, 3], [1, 3, 4], [0, 1, 4]],
        ),
        // a concave face
        (
            &[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.5], [2.0, 1.0, 0.0], [0.0, 0.0, 0.25], [-2.0, 1.0, -0.5]],
            &[[0, 1, 2], [0, 2, 3], [0, 3, 4]],
        ),
        (
            &[
                [-2.0, -2.0, 0.0],
                [2.0, -2.0, 1.0],
                [2.0, 2.0, 0.0],
                [0.0, -1.0, 0.0],
                [-2.0, 2.0, 0.5],
                [-1.0, 0.0, 1.0],
            ],
            &[[1, 2, 3], [1, 3, 4], [1, 4, 5], [0, 1, 5]],
        ),
        // a face without an ear
        (
            &[
                [3.0, 0.0, -0.5],
                [3.0, 3.0, -0.5],
                [-3.0, 1.0, 0.0],
                [-2.0, -1.0, -1.0],
                [2.0, 2.0, 0.5],
                [-3.0, 1.0, 0.0],
            ],
            &[],
        ),
    ];

    #[test]
    fn faces_are_cut_as_mujoco_cuts_them() {
        for (corners, triangles) in FACES {
            let mut ears = Ears::default();
            let found = ears.cut(corners, (0..corners.len() as u32).collect()).unwrap();
            assert_eq!(found, *triangles, "{corners:?}");
            assert_eq!(ears.lost, usize::from(triangles.is_empty()));
        }
    }

    fn circle(corners: u32) -> Vec<[f64; 3]> {
        let corner = |k: u32| (f64::from(k) * core::f64::consts::TAU / f64::from(corners)).sin_cos();
        (0..corners).map(corner).map(|(y, x)| [x, y, 0.0]).collect()
    }

    /// Checks that a face with 100 corners gives 98 triangles, and that a face with 101 corners gives none. MuJoCo
    /// 4.0.0 has the same number of triangles in `mesh_face`.
    #[test]
    fn faces_with_many_corners_are_left_out() {
        for (corners, triangles, lost) in [(100, 98, 0), (101, 0, 1)] {
            let mut ears = Ears::default();
            assert_eq!(ears.cut(&circle(corners), (0..corners).collect()).unwrap().len(), triangles);
            assert_eq!(ears.lost, lost);
        }
    }

    #[test]
    fn the_work_of_a_file_has_a_limit() {
        let (points, mut ears) = (circle(100), Ears::default());
        let found = (0..20_000).find_map(|_| ears.cut(&points, (0..100).collect()).err());
        assert!(found.unwrap().contains(&MAX_TESTS.to_string()));
    }
}
