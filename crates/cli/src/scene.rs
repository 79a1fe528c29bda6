//! What the page draws: the simple shapes of a URDF, or bones between the joints where it has none.

use crate::robot::{Format, Robot};
use crate::visuals::{self, Geometry};
use condyle::{Act, Data, Model, Quaternion, Se3, Vec3, forward_kinematics};
use serde::Serialize;
use std::collections::HashMap;

/// A body, with what is drawn of it in its frame.
#[derive(Serialize)]
pub(crate) struct Body {
    name: String,
    parent: isize,
    shapes: Vec<Shape>,
}

/// A box, cylinder, sphere, or a segment with round ends.
#[derive(Clone, Serialize)]
pub(crate) struct Shape {
    kind: &'static str,
    size: Vec<f64>,
    position: [f64; 3],
    quaternion: [f64; 4],
    color: Option<String>,
}

/// Position and quaternion (x, y, z, w).
pub(crate) fn pose(placement: Se3<f64>) -> [f64; 7] {
    let (p, q) = (placement.translation, Quaternion::from_rotation(placement.rotation));
    [p.x, p.y, p.z, q.vector.x, q.vector.y, q.vector.z, q.scalar]
}

/// All bodies, the world first.
pub(crate) fn bodies(model: &Model, robot: &Robot, ends: &[usize]) -> Vec<Body> {
    let mut shapes = if robot.format == Format::Urdf { primitives(model, &robot.text) } else { HashMap::new() };
    // bones, unless most moving bodies have shapes of their own
    let drawn = (1..model.bodies().len()).filter(|b| shapes.contains_key(b)).count();
    if 2 * drawn < model.bodies().len() - 1 {
        shapes = bones(model, ends);
    }
    let body = |(i, b): (usize, &condyle::Body)| Body {
        name: b.name.clone(),
        parent: if i == 0 { -1 } else { b.parent as isize },
        shapes: shapes.remove(&i).unwrap_or_default(),
    };
    model.bodies().iter().enumerate().map(body).collect()
}

/// Boxes, cylinders, spheres and capsules of the URDF's visuals, by body.
fn primitives(model: &Model, urdf: &str) -> HashMap<usize, Vec<Shape>> {
    let mut shapes: HashMap<usize, Vec<Shape>> = HashMap::new();
    for visual in visuals::read(urdf) {
        let Ok(frame) = model.frame(&visual.link) else { continue };
        let frame = &model.frames()[frame];
        let (kind, size) = match visual.geometry {
            Geometry::Box(size) => ("box", size.to_vec()),
            Geometry::Cylinder { radius, length } => ("cylinder", vec![radius, length]),
            Geometry::Capsule { radius, length } => ("capsule", vec![radius, length]),
            Geometry::Sphere(radius) => ("sphere", vec![radius]),
        };
        let color = visual.color.map(|rgba| {
            let [r, g, b, _] = rgba.map(|x| (255.0 * x.clamp(0.0, 1.0)).round() as u8);
            format!("#{r:02x}{g:02x}{b:02x}")
        });
        let pose = pose(frame.placement * visual.origin);
        shapes.entry(frame.body).or_default().push(Shape {
            kind,
            size,
            position: [pose[0], pose[1], pose[2]],
            quaternion: [pose[3], pose[4], pose[5], pose[6]],
            color,
        });
    }
    shapes
}

/// A segment from each body to the joints that it carries, a sphere at each joint, and a segment to each end.
fn bones(model: &Model, ends: &[usize]) -> HashMap<usize, Vec<Shape>> {
    let mut data = Data::new(model);
    let q = condyle::neutral(model);
    let placements = forward_kinematics(model, &mut data, &q);
    let mut reach: f64 = 0.0;
    for i in 0..model.bodies().len() {
        reach = reach.max(placements.body(i).translation.norm_squared().sqrt());
    }
    let r = 0.035 * reach.max(0.1);
    let shape =
        |kind, size: Vec<f64>| Shape { kind, size, position: [0.0; 3], quaternion: [0.0, 0.0, 0.0, 1.0], color: None };
    let segment = |to: Vec3<f64>, radius| shape("segment", vec![0.0, 0.0, 0.0, to.x, to.y, to.z, radius]);
    let mut shapes: HashMap<usize, Vec<Shape>> = HashMap::new();
    let mut is_leaf = vec![true; model.bodies().len()];
    for body in &model.bodies()[1..] {
        is_leaf[body.parent] = false;
        shapes.entry(body.parent).or_default().push(segment(body.placement.translation, 0.75 * r));
    }
    for (i, leaf) in is_leaf.iter().enumerate().skip(1) {
        shapes.entry(i).or_default().push(shape("sphere", vec![if *leaf { 0.7 * r } else { r }]));
    }
    for &end in ends {
        let tip = &model.frames()[end];
        shapes.entry(tip.body).or_default().push(segment(tip.placement.act(Vec3::zero()), 0.6 * r));
    }
    shapes
}
