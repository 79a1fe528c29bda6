//! Shapes that contain all points of a mesh.

use crate::geometry::Shape;
use condyle_spatial::Vec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Shape that is fitted to a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Smallest capsule, up to 1 % of the radius, whose axis has the direction of the largest variance of the points.
    Capsule,
    /// Smallest sphere, up to 1 % of the radius.
    Sphere,
}

/// Number of steps towards the farthest point. The radius then exceeds the smallest radius by less than 1 %.
const STEPS: usize = 1000;

impl Fit {
    /// Returns the shape that contains all points.
    ///
    /// The centre of the smallest ball, or circle across the capsule's axis, moves to the farthest point in smaller and
    /// smaller steps. Source: Bădoiu, Clarkson, "Smaller core-sets for balls" (SODA 2003), section 3. On the axis, the
    /// ends are as near to each other as the points allow.
    ///
    /// ```
    /// use condyle_model::{Fit, Shape, Vec3};
    /// let points: Vec<_> = (0..40).map(|k| Vec3::new(0.1 * f64::from(k), 0.2 * f64::from(k % 2), 0.0)).collect();
    /// let Shape::Capsule { ends: [a, b], radius } = Fit::Capsule.shape(&points) else { unreachable!() };
    /// assert!(radius < 0.11 && (b - a).norm_squared().sqrt() < 3.9);
    /// ```
    ///
    /// # Panics
    /// Panics if there are no points.
    #[track_caller]
    pub fn shape(self, points: &[Vec3<f64>]) -> Shape {
        assert!(!points.is_empty(), "points: expected at least one point");
        let points: Vec<Vector3<f64>> = points.iter().map(|&p| p.into()).collect();
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let flat = |x: Vector3<f64>| Vec3::new(x.x, x.y, x.z);
        if self == Self::Sphere {
            let (center, radius) = ball(&points, mean);
            return Shape::sphere(flat(center), radius);
        }
        let covariance: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let eigen = SymmetricEigen::new(covariance);
        let axis: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        let across: Vec<_> = points.iter().map(|p| p - axis * axis.dot(p)).collect();
        let (center, radius) = ball(&across, mean - axis * axis.dot(&mean));
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, q) in points.iter().zip(&across) {
            let rest = (radius * radius - (q - center).norm_squared()).max(0.0).sqrt();
            low = low.min(axis.dot(p) + rest); // the ball at the lower end reaches the point
            high = high.max(axis.dot(p) - rest);
        }
        let [low, high] = if low <= high { [low, high] } else { [0.5 * (low + high); 2] };
        Shape::capsule(flat(center + axis * low), flat(center + axis * high), radius)
    }
}

/// Returns the centre and the radius of a small ball that contains all points.
fn ball(points: &[Vector3<f64>], mut center: Vector3<f64>) -> (Vector3<f64>, f64) {
    let farthest = |center: &Vector3<f64>| {
        let square = |p: &Vector3<f64>| (p - center).norm_squared();
        let far = |best: (usize, f64), (k, p)| if square(p) > best.1 { (k, square(p)) } else { best };
        points.iter().enumerate().fold((0, -1.0), far)
    };
    let mut best = (center, farthest(&center).1);
    for k in 1..=STEPS {
        center += (points[farthest(&center).0] - center) / (k + 1) as f64;
        let square = farthest(&center).1;
        if square < best.1 {
            best = (center, square);
        }
    }
    (best.0, best.1.sqrt())
}
