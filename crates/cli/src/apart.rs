//! Collision shapes on the page, and the smallest distance between them over time.

use crate::robot::Robot;
use crate::scene;
use condyle::distances::{Collisions, DistancePairs, Distances, Shape};
use condyle::{Model, Placements, Se3, Vec3, spatial::Mat3};
use serde_json::{Value, json};

/// Collision shapes of a robot, and the distances of the pairs that can collide.
pub(crate) struct Apart {
    /// Shapes in the frames of their bodies, as the page draws them.
    shapes: Vec<Value>,
    pairs: DistancePairs,
    results: Distances,
    /// Names of both shapes of each pair.
    names: Vec<[String; 2]>,
    /// Smallest distance (m) at each knot, and the index of its pair.
    distances: Vec<f64>,
    nearest: Vec<usize>,
}

impl Apart {
    /// Reads the collision shapes from the robot's file. Returns `None` if the file has none that can be read.
    pub(crate) fn new(robot: &Robot) -> Option<Self> {
        let (model, collisions) = (&robot.model, robot.collisions().ok()?);
        let list = collisions.pairs(model).ok()?;
        let pairs = DistancePairs::new(model, &list).ok()?;
        let shapes = shapes(model, &collisions);
        let names = list.iter().map(|pair| [&pair.first, &pair.second].map(|geometry| geometry.name.clone())).collect();
        let results = Distances::new(&pairs);
        let is_empty = shapes.is_empty() && pairs.is_empty();
        (!is_empty).then(|| Self { shapes, pairs, results, names, distances: Vec::new(), nearest: Vec::new() })
    }

    /// Computes the smallest distance at the next knot.
    pub(crate) fn add(&mut self, placements: Placements<'_, f64>) {
        self.pairs.values(placements, &mut self.results);
        if let Some((pair, distance)) = self.results.nearest() {
            self.distances.push(distance);
            self.nearest.push(pair);
        }
    }

    /// Returns the entry `scene.collisions` of the page's data.
    pub(crate) fn shapes(&self) -> &[Value] {
        &self.shapes
    }

    /// Returns the entry `apart` of the page's data; `None` without pairs.
    pub(crate) fn distances(&self) -> Option<Value> {
        let Self { distances, nearest, names, .. } = self;
        // only pairs that are the nearest at some knot are on the page
        let mut shown: Vec<usize> = nearest.clone();
        shown.sort_unstable();
        shown.dedup();
        let index = |pair: &usize| shown.binary_search(pair).unwrap_or(0);
        let nearest: Vec<_> = nearest.iter().map(index).collect();
        let pairs: Vec<_> = shown.iter().map(|&pair| &names[pair]).collect();
        (!distances.is_empty()).then(|| json!({"distances": distances, "nearest": nearest, "pairs": pairs}))
    }
}

/// Returns the shapes as the page draws them, in the frames of their bodies. Half-spaces have no extent and are left
/// out.
fn shapes(model: &Model, collisions: &Collisions) -> Vec<Value> {
    let drawn = |geometry: &condyle::distances::Geometry| {
        let (body, pose) = geometry.resolve(model).ok()?;
        let (kind, size, own) = drawn(&geometry.shape)?;
        let [x, y, z, quaternion @ ..] = scene::pose(pose * own);
        Some(json!({"body": body, "kind": kind, "size": size, "position": [x, y, z], "quaternion": quaternion}))
    };
    collisions.geometries.iter().filter_map(drawn).collect()
}

/// Returns kind and size of a shape on the page, and its pose in the coordinates of the shape.
fn drawn(shape: &Shape) -> Option<(&'static str, Vec<f64>, Se3<f64>)> {
    let at = |translation| Se3::new(Mat3::identity(), translation);
    Some(match *shape {
        Shape::Sphere { center, radius } => ("sphere", vec![radius], at(center)),
        Shape::Capsule { ends: [a, b], radius } => {
            let (middle, along) = ((a + b).scale(0.5), b - a);
            let length = along.norm_squared().sqrt();
            let pose = Se3::new(along_z(along, length), middle);
            ("capsule", vec![radius, length], pose)
        }
        Shape::Box { half_sizes } => ("box", half_sizes.scale(2.0).to_array().to_vec(), Se3::identity()),
        Shape::Cylinder { radius, half_length } => ("cylinder", vec![radius, 2.0 * half_length], Se3::identity()),
        Shape::Ellipsoid { radii } => ("ellipsoid", radii.to_array().to_vec(), Se3::identity()),
        _ => return None,
    })
}

/// Returns a rotation that turns the axis z to a direction of the given length; the identity for the length 0.
fn along_z(direction: Vec3<f64>, length: f64) -> Mat3<f64> {
    if length == 0.0 {
        return Mat3::identity();
    }
    let z = direction.scale(1.0 / length);
    // the axis on which z has its smallest entry is not parallel to z
    let entries = z.to_array().map(f64::abs);
    let least = (1..3).fold(0, |k, i| if entries[i] < entries[k] { i } else { k });
    let mut e = [0.0; 3];
    e[least] = 1.0;
    let across = Vec3::from(e).cross(z);
    let x = across.scale(1.0 / across.norm_squared().sqrt());
    Mat3 { x, y: z.cross(x), z }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capsule_lies_along_its_segment() {
        for (a, b) in [([0.1, 0.2, 0.3], [0.4, -0.5, 0.9]), ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]), ([1.0; 3], [1.0; 3])] {
            let (kind, size, pose) = drawn(&Shape::capsule(a, b, 0.05)).unwrap();
            assert_eq!((kind, size[0]), ("capsule", 0.05));
            assert!(pose.rotation.is_rotation());
            let end = pose.translation + pose.rotation.z.scale(0.5 * size[1]);
            let error = end - Vec3::from(b);
            assert!(error.norm_squared() < 1e-30, "{error:?}");
        }
    }

    #[test]
    fn half_spaces_are_not_drawn() {
        assert!(drawn(&Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 }).is_none());
    }
}
