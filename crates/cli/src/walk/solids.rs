//! Collision shapes of a robot's bodies, as sets of points with a radius.

use crate::robot::{Format, Robot};
use crate::visuals::{self, Geometry};
use condyle::{Model, Se3, Vec3, spatial::Act};
use condyle_meshes::{Format as MeshFormat, Places, mjcf, triangles};
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
    let solids = match robot.format {
        Format::Urdf => visuals::collisions(&robot.text).into_iter().filter_map(|shape| {
            let (points, radius) = hull(&shape.geometry, &robot.places)?;
            solid(model, &shape.link, shape.origin, points, radius)
        }),
        Format::Mjcf | Format::Sdf => return of_mjcf(model, robot),
    };
    solids.collect()
}

/// Returns the collision shapes of an MJCF. An SDF has none.
fn of_mjcf(model: &Model, robot: &Robot) -> Vec<Solid> {
    let shapes = if robot.format == Format::Mjcf { mjcf::collisions(&robot.text) } else { Vec::new() };
    let read = |shape: mjcf::Solid| {
        let geometry = match (&*shape.kind, shape.mesh) {
            ("mesh", Some((file, scale))) => Geometry::Mesh { file, scale },
            ("sphere", _) => Geometry::Sphere(shape.size[0]),
            ("capsule", _) => Geometry::Capsule { radius: shape.size[0], length: 2.0 * shape.size[1] },
            ("cylinder", _) => Geometry::Cylinder { radius: shape.size[0], length: 2.0 * shape.size[1] },
            ("box", _) => Geometry::Box(shape.size.map(|half| 2.0 * half)),
            _ => return None,
        };
        let (points, radius) = hull(&geometry, &robot.places)?;
        solid(model, &shape.body, Se3::from(shape.pose), points, radius)
    };
    shapes.into_iter().filter_map(read).collect()
}

/// Returns a shape whose points are given in a frame of a link.
fn solid(model: &Model, link: &str, pose: Se3<f64>, points: Vec<Vec3<f64>>, radius: f64) -> Option<Solid> {
    let frame = &model.frames()[model.frame(link).ok()?];
    let pose = frame.placement * pose;
    let points = points.into_iter().map(|point| pose.act(point)).collect();
    Some(Solid { body: frame.body, link: link.to_owned(), points, radius })
}

/// Returns points whose hull, enlarged by the radius, is the shape.
fn hull(geometry: &Geometry, places: &Places) -> Option<(Vec<Vec3<f64>>, f64)> {
    let on_axis = |z: f64| vec![Vec3::new(0.0, 0.0, -z), Vec3::new(0.0, 0.0, z)];
    Some(match *geometry {
        Geometry::Sphere(radius) => (vec![Vec3::zero()], radius),
        Geometry::Capsule { radius, length } => (on_axis(0.5 * length), radius),
        Geometry::Box([x, y, z]) => {
            let sign = |k: usize, bit: usize| if k & bit == 0 { -0.5 } else { 0.5 };
            ((0..8).map(|k| Vec3::new(x * sign(k, 1), y * sign(k, 2), z * sign(k, 4))).collect(), 0.0)
        }
        Geometry::Cylinder { radius, length } => {
            let rim = |k: usize| {
                let (sin, cos) = (TAU * (k / 2) as f64 / RIM as f64).sin_cos();
                let z = if k.is_multiple_of(2) { 0.5 * length } else { -0.5 * length };
                Vec3::new(radius * cos, radius * sin, z)
            };
            ((0..2 * RIM).map(rim).collect(), 0.0)
        }
        Geometry::Mesh { ref file, scale } => {
            let path = places.find(file).ok()?;
            let (points, _) = triangles(MeshFormat::of(&path)?, &std::fs::read(path).ok()?).ok()?;
            let scaled = |p: [f64; 3]| Vec3::new(p[0] * scale[0], p[1] * scale[1], p[2] * scale[2]);
            (points.into_iter().map(scaled).collect(), 0.0)
        }
    })
}
