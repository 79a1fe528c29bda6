//! Collision shapes of a robot's bodies, as sets of points with a radius.

use crate::robot::Robot;
use condyle::distances::{CollisionMesh, Shape};
use condyle::{Model, Se3, Vec3, spatial::Act};
use condyle_meshes::{Format as MeshFormat, Places, triangles};
use core::f64::consts::TAU;

/// Number of points on the rim of a cylinder.
const RIM: usize = 24;

/// Collision shape: the convex hull of points in the frame of a body, enlarged by a radius.
pub(crate) struct Solid {
    pub body: usize,
    /// Name of the link to which the shape belongs.
    pub link: String,
    pub points: Vec<Vec3<f64>>,
    /// Radius by which the hull is enlarged (m).
    pub radius: f64,
}

impl Solid {
    /// Returns the height of the lowest point of the shape, if the body has the pose `at` (m).
    pub(crate) fn lowest(&self, at: Se3<f64>) -> f64 {
        self.points.iter().map(|&point| at.act(point).z - self.radius).fold(f64::INFINITY, f64::min)
    }
}

/// Returns the collision shapes in a robot's file. Shapes that cannot be read are left out.
pub(crate) fn read(model: &Model, robot: &Robot) -> Vec<Solid> {
    let Ok(collisions) = robot.collisions() else { return Vec::new() };
    let shapes = collisions.geometries.iter().filter_map(|geometry| {
        let (points, radius) = hull(&geometry.shape)?;
        solid(model, &geometry.frame.as_ref()?.name, geometry.placement, points, radius)
    });
    let meshes = collisions.meshes().filter_map(|mesh| {
        let points = points(mesh, &robot.places)?;
        solid(model, &mesh.frame.name, mesh.placement, points, 0.0)
    });
    shapes.chain(meshes).collect()
}

/// Returns a shape whose points are given in a frame of a link.
fn solid(model: &Model, link: &str, pose: Se3<f64>, points: Vec<Vec3<f64>>, radius: f64) -> Option<Solid> {
    let frame = &model.frames()[model.frame(link).ok()?];
    let pose = frame.placement * pose;
    let points = points.into_iter().map(|point| pose.act(point)).collect();
    Some(Solid { body: frame.body, link: link.to_owned(), points, radius })
}

/// Returns points whose hull, enlarged by the radius, is the shape. A capsule that contains an ellipsoid takes its
/// place. A half-space has no such points.
fn hull(shape: &Shape) -> Option<(Vec<Vec3<f64>>, f64)> {
    Some(match *shape {
        Shape::Sphere { center, radius } => (vec![center], radius),
        Shape::Capsule { ends, radius } => (ends.to_vec(), radius),
        Shape::Box { half_sizes: h } => {
            let sign = |k: usize, bit: usize| if k & bit == 0 { -1.0 } else { 1.0 };
            ((0..8).map(|k| Vec3::new(h.x * sign(k, 1), h.y * sign(k, 2), h.z * sign(k, 4))).collect(), 0.0)
        }
        Shape::Cylinder { radius, half_length } => {
            let rim = |k: usize| {
                let (sin, cos) = (TAU * (k / 2) as f64 / RIM as f64).sin_cos();
                Vec3::new(radius * cos, radius * sin, if k.is_multiple_of(2) { half_length } else { -half_length })
            };
            ((0..2 * RIM).map(rim).collect(), 0.0)
        }
        Shape::Ellipsoid { .. } => return hull(&shape.containing_capsule()),
        _ => return None,
    })
}

/// Returns the points of a mesh in the frame of its shape; `None` if it cannot be read.
fn points(mesh: &CollisionMesh, places: &Places) -> Option<Vec<Vec3<f64>>> {
    let path = places.find(&mesh.file).ok()?;
    let (points, _) = triangles(MeshFormat::of(&path)?, &std::fs::read(path).ok()?).ok()?;
    let [x, y, z] = mesh.scale;
    Some(points.into_iter().map(|p| Vec3::new(p[0] * x, p[1] * y, p[2] * z)).collect())
}
