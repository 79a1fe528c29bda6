//! Shapes with their numbers prepared for distances, and the distance of any two of them.

use super::box_pair::{Cuboid, boxes};
use super::boxes::{PERPENDICULAR, segment};
use super::curved::{cylinder, ellipsoid};
use super::round::{Round, Witness, capsules, norm, root, spheres};
use condyle_model::Shape;
use condyle_spatial::{Act, Se3, Vec3};

/// Shape in the coordinates of a body, or in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Solid {
    /// Sphere, whose half vector is 0.
    Sphere(Round<f64>),
    /// Capsule.
    Capsule(Round<f64>),
    /// Box.
    Box(Cuboid),
    /// Cylinder about the axis z of a pose.
    Cylinder { pose: Se3<f64>, radius: f64, half_length: f64 },
    /// Ellipsoid with semi-axes along the axes of a pose.
    Ellipsoid { pose: Se3<f64>, radii: Vec3<f64> },
    /// Points with normal · x ≤ offset.
    HalfSpace { normal: Vec3<f64>, offset: f64 },
}

impl Solid {
    /// Returns a shape whose coordinates have a pose.
    pub(crate) fn new(shape: &Shape, pose: &Se3<f64>) -> Self {
        let local = match *shape {
            Shape::Sphere { center, radius } => Self::Sphere(Round { center, half: Vec3::zero(), radius }),
            Shape::Capsule { ends: [a, b], radius } => {
                let (center, half) = ((a + b).scale(0.5), (b - a).scale(0.5));
                Self::Capsule(Round { center, half, radius })
            }
            Shape::Box { half_sizes } => Self::Box(Cuboid { pose: Se3::identity(), half: half_sizes }),
            Shape::Cylinder { radius, half_length } => Self::Cylinder { pose: Se3::identity(), radius, half_length },
            Shape::Ellipsoid { radii } => Self::Ellipsoid { pose: Se3::identity(), radii },
            Shape::HalfSpace { normal, offset } => {
                let inverse = 1.0 / norm(normal);
                Self::HalfSpace { normal: normal.scale(inverse), offset: offset * inverse }
            }
            _ => unreachable!("each shape has a solid"),
        };
        local.moved(pose)
    }

    /// Returns the shape after a change of coordinates.
    #[inline(always)]
    pub(crate) fn moved(&self, X: &Se3<f64>) -> Self {
        match *self {
            Self::Sphere(r) => Self::Sphere(r.moved(X)),
            Self::Capsule(r) => Self::Capsule(r.moved(X)),
            Self::Box(b) => Self::Box(Cuboid { pose: *X * b.pose, ..b }),
            Self::Cylinder { pose, radius, half_length } => Self::Cylinder { pose: *X * pose, radius, half_length },
            Self::Ellipsoid { pose, radii } => Self::Ellipsoid { pose: *X * pose, radii },
            Self::HalfSpace { normal, offset } => {
                let normal = X.rotation * normal;
                Self::HalfSpace { normal, offset: offset + normal.dot(X.translation) }
            }
        }
    }

    /// Returns the point of the shape with the smallest n·x; the middle of these points if there are several.
    fn lowest(&self, n: Vec3<f64>) -> Vec3<f64> {
        let against = |x: f64, h: f64| if x.abs() < PERPENDICULAR { 0.0 } else { -h * x.signum() };
        match *self {
            Self::Sphere(r) => r.center - n.scale(r.radius),
            Self::Capsule(r) => {
                let (along, length) = (r.half.dot(n), norm(r.half));
                let t = against(along / if length > 0.0 { length } else { 1.0 }, 1.0);
                r.center + r.half.scale(t) - n.scale(r.radius)
            }
            Self::Box(Cuboid { pose, half }) => {
                let m = pose.rotation.transpose_mul(n);
                pose.act(Vec3::new(against(m.x, half.x), against(m.y, half.y), against(m.z, half.z)))
            }
            Self::Cylinder { pose, radius, half_length } => {
                let m = pose.rotation.transpose_mul(n);
                let rho = root(m.x * m.x + m.y * m.y);
                let rim = if rho < PERPENDICULAR { 0.0 } else { -radius / rho };
                pose.act(Vec3::new(rim * m.x, rim * m.y, against(m.z, half_length)))
            }
            Self::Ellipsoid { pose, radii } => {
                let m = pose.rotation.transpose_mul(n);
                let x = Vec3::new(radii.x * m.x, radii.y * m.y, radii.z * m.z);
                let inverse = -1.0 / norm(x);
                pose.act(Vec3::new(radii.x * x.x, radii.y * x.y, radii.z * x.z).scale(inverse))
            }
            Self::HalfSpace { .. } => unreachable!("a pair of half-spaces is refused"),
        }
    }
}

/// Returns whether the distance of two shapes is computed for these shapes. Otherwise, cylinders and ellipsoids are
/// replaced by capsules that contain them.
pub(crate) fn is_exact(first: &Shape, second: &Shape) -> bool {
    let curved = |shape: &Shape| matches!(shape, Shape::Cylinder { .. } | Shape::Ellipsoid { .. });
    let simple = |shape: &Shape| matches!(shape, Shape::Sphere { .. } | Shape::HalfSpace { .. });
    (!curved(first) || simple(second)) && (!curved(second) || simple(first))
}

/// Returns the signed distance of two shapes in the same coordinates, with witness points and normal.
pub(crate) fn distance(first: &Solid, second: &Solid) -> Witness<f64> {
    use Solid::{Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Sphere};
    match (first, second) {
        (Sphere(a), Sphere(b)) => spheres(a, b),
        (Sphere(a) | Capsule(a), Sphere(b) | Capsule(b)) => capsules(a, b),
        (_, &HalfSpace { normal, offset }) => {
            let p = first.lowest(normal);
            let distance = normal.dot(p) - offset;
            Witness { distance, points: [p, p - normal.scale(distance)], normal }
        }
        (Sphere(a) | Capsule(a), Box(b)) => {
            let [c, u] = [b.pose.act_inv(a.center), b.pose.rotation.transpose_mul(a.half)];
            out_of(&b.pose, segment(c, u, b.half)).enlarged(a.radius, 0.0)
        }
        (Box(a), Box(b)) => boxes(a, b),
        (Sphere(a), Cylinder { pose, radius, half_length }) => {
            out_of(pose, cylinder(pose.act_inv(a.center), *radius, *half_length)).enlarged(a.radius, 0.0)
        }
        (Sphere(a), Ellipsoid { pose, radii }) => {
            out_of(pose, ellipsoid(pose.act_inv(a.center), *radii)).enlarged(a.radius, 0.0)
        }
        (HalfSpace { .. } | Box(_) | Cylinder { .. } | Ellipsoid { .. }, Sphere(_) | Capsule(_) | Box(_))
        | (HalfSpace { .. }, Cylinder { .. } | Ellipsoid { .. }) => distance(second, first).swapped(),
        _ => unreachable!("cylinders and ellipsoids are replaced by capsules"),
    }
}

/// Returns a result in the coordinates in which the second shape has a pose.
fn out_of(pose: &Se3<f64>, w: Witness<f64>) -> Witness<f64> {
    Witness { points: w.points.map(|p| pose.act(p)), normal: pose.rotation * w.normal, ..w }
}
