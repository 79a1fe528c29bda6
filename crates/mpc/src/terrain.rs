//! Ground under the robot, as a plane.

use condyle_dynamics::{Mat3, Vec3};

/// Weight of level ground in the fit of a plane, relative to one foot at a distance of 1 m.
const LEVEL: f64 = 2e-3;

/// Plane z = height + slope · (x, y) on which the robot walks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terrain {
    /// Height of the plane at the origin of the world (m).
    pub height: f64,
    /// Slopes dz/dx and dz/dy.
    pub slope: [f64; 2],
}

impl Terrain {
    /// Returns the plane with a normal vector through a point at the given height above the world's origin (m).
    /// Returns `None` for a normal that does not point upwards.
    pub fn new(normal: Vec3<f64>, height: f64) -> Option<Self> {
        let slope = [-normal.x / normal.z, -normal.y / normal.z];
        let is_valid = normal.z > 0.0 && slope.iter().all(|s| s.is_finite()) && height.is_finite();
        is_valid.then_some(Self { height, slope })
    }

    /// Returns the height of the plane at a position (m).
    pub fn at(&self, x: f64, y: f64) -> f64 {
        self.height + self.slope[0] * x + self.slope[1] * y
    }

    /// Returns the unit normal of the plane.
    pub fn normal(&self) -> Vec3<f64> {
        let [a, b] = self.slope;
        Vec3::new(-a, -b, 1.0).scale((1.0 + a * a + b * b).sqrt().recip())
    }

    /// Returns the rotation by the smallest angle that turns the vertical to a unit vector n, which points upwards:
    /// R = 1 + \[w\]× + \[w\]×² / (1 + n_z) with w = e_z × n.
    pub(crate) fn turn_to(n: Vec3<f64>) -> Mat3<f64> {
        let s = (1.0 + n.z).recip();
        Mat3 {
            x: Vec3::new(1.0 - s * n.x * n.x, -s * n.x * n.y, -n.x),
            y: Vec3::new(-s * n.x * n.y, 1.0 - s * n.y * n.y, -n.y),
            z: n,
        }
    }

    /// Fits a plane to points by least squares. A small weight keeps the plane level where the points do not determine
    /// it, for example across a line through two feet.
    pub(crate) fn fitted(points: impl Iterator<Item = Vec3<f64>> + Clone) -> Self {
        let count = points.clone().count().max(1) as f64;
        let middle = points.clone().fold(Vec3::zero(), |sum, point| sum + point).scale(1.0 / count);
        let (mut xx, mut xy, mut yy, mut xz, mut yz) = (LEVEL, 0.0, LEVEL, 0.0, 0.0);
        for point in points {
            let d = point - middle;
            xx += d.x * d.x;
            xy += d.x * d.y;
            yy += d.y * d.y;
            xz += d.x * d.z;
            yz += d.y * d.z;
        }
        let det = xx * yy - xy * xy; // positive, because of the weight
        let slope = [(yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det];
        Self { height: middle.z - slope[0] * middle.x - slope[1] * middle.y, slope }
    }
}
