//! Scene on the page. The scene contains the shapes and meshes of the robot's file. For a robot without shapes, it
//! contains bones, which are segments between joints.

use crate::robot::{Format, Robot};
use crate::visuals::{self, Geometry};
use condyle::{
    Data, Model, Se3, Vec3, forward_kinematics,
    spatial::{Act, Quaternion},
};
use condyle_meshes::{Drawn, Meshes, mjcf};
use serde::Serialize;
use std::collections::HashMap;

/// Body, with the shapes that are drawn in the body's frame.
#[derive(Serialize)]
pub(crate) struct Body {
    name: String,
    parent: isize,
    shapes: Vec<Shape>,
}

/// Box, cylinder, sphere, capsule, segment with round ends, or part of a mesh. For a mesh, `size` is the scale of the
/// mesh.
#[derive(Clone, Serialize)]
pub(crate) struct Shape {
    kind: &'static str,
    size: Vec<f64>,
    position: [f64; 3],
    quaternion: [f64; 4],
    color: Option<String>,
    /// Index, in the list of meshes, of the mesh part that this shape draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<usize>,
}

/// Returns the numbers of a pose: position, then quaternion (x, y, z, w).
pub(crate) fn pose(placement: Se3<f64>) -> [f64; 7] {
    let (p, q) = (placement.translation, Quaternion::from_rotation(placement.rotation));
    [p.x, p.y, p.z, q.vector.x, q.vector.y, q.vector.z, q.scalar]
}

/// Returns all bodies, the world first. If `wanted` is true, also returns the meshes of the bodies.
pub(crate) fn bodies(model: &Model, robot: &Robot, ends: &[usize], wanted: bool) -> (Vec<Body>, Meshes) {
    let mut meshes = Meshes::new(robot.places.clone());
    let mut shapes = match robot.format {
        Format::Urdf => shapes_of_urdf(model, &robot.text, wanted.then_some(&mut meshes)),
        Format::Mjcf if wanted => shapes_of_mjcf(model, &robot.text, &mut meshes),
        Format::Mjcf | Format::Sdf => HashMap::new(),
    };
    // Draw bones for bodies whose meshes are left out. If fewer than half of the moving bodies have shapes, also draw
    // bones in place of all shapes except meshes.
    let drawn = |b: &usize| shapes.get(b).is_some_and(|shapes| !shapes.is_empty());
    let few = 2 * (1..model.bodies().len()).filter(drawn).count() < model.bodies().len() - 1;
    for (body, bones) in bones(model, ends) {
        match shapes.get(&body) {
            Some(own) if own.iter().any(|shape| shape.part.is_some()) => {}
            Some(own) if !few && !own.is_empty() => {}
            None if !few => {}
            _ => _ = shapes.insert(body, bones),
        }
    }
    let body = |(i, b): (usize, &condyle::tree::Body)| Body {
        name: b.name.clone(),
        parent: if i == 0 { -1 } else { b.parent as isize },
        shapes: shapes.remove(&i).unwrap_or_default(),
    };
    (model.bodies().iter().enumerate().map(body).collect(), meshes)
}

/// Returns a colour in CSS notation.
fn hex(color: &[f64]) -> String {
    let byte = |x: &f64| format!("{:02x}", (255.0 * x.clamp(0.0, 1.0)).round() as u8);
    "#".to_owned() + &color.iter().take(3).map(byte).collect::<String>()
}

/// Returns the shapes of each body, from the URDF's visuals: boxes, cylinders, spheres, capsules and meshes. The list
/// of a body is empty if all its meshes are left out and the body has no other shapes.
fn shapes_of_urdf(model: &Model, urdf: &str, mut meshes: Option<&mut Meshes>) -> HashMap<usize, Vec<Shape>> {
    let mut shapes: HashMap<usize, Vec<Shape>> = HashMap::new();
    for visual in visuals::read(urdf) {
        let Ok(frame) = model.frame(&visual.link) else { continue };
        let frame = &model.frames()[frame];
        let color = visual.color.map(|rgba| hex(&rgba));
        let pose = pose(frame.placement * visual.origin);
        let place = shapes.entry(frame.body);
        let (kind, size) = match visual.geometry {
            Geometry::Box(size) => ("box", size.to_vec()),
            Geometry::Cylinder { radius, length } => ("cylinder", vec![radius, length]),
            Geometry::Capsule { radius, length } => ("capsule", vec![radius, length]),
            Geometry::Sphere(radius) => ("sphere", vec![radius]),
            Geometry::Mesh { file, scale } => {
                if let Some(meshes) = meshes.as_deref_mut() {
                    place.or_default().extend(parts(meshes, &file, &scale, pose, color.as_deref()));
                }
                continue;
            }
        };
        place.or_default().push(Shape { kind, size, color, ..at(pose) });
    }
    shapes
}

/// Returns the meshes of each body of an MJCF.
fn shapes_of_mjcf(model: &Model, text: &str, meshes: &mut Meshes) -> HashMap<usize, Vec<Shape>> {
    let mut shapes: HashMap<usize, Vec<Shape>> = HashMap::new();
    for visual in mjcf::visuals(text) {
        let (body, placement) = match visual.body.as_deref().map(|name| model.frame(name)) {
            None => (0, Se3::identity()),
            Some(Ok(frame)) => (model.frames()[frame].body, model.frames()[frame].placement),
            Some(Err(_)) => continue,
        };
        let pose = pose(placement * Se3::from(visual.pose));
        let color = visual.color.map(|color| hex(&color));
        let found = parts(meshes, &visual.file, &visual.scale, pose, color.as_deref());
        shapes.entry(body).or_default().extend(found);
    }
    shapes
}

/// Returns the parts of a mesh as shapes. Colours in the mesh file take precedence over `color`, as in RViz.
fn parts(meshes: &mut Meshes, file: &str, scale: &[f64], pose: [f64; 7], color: Option<&str>) -> Vec<Shape> {
    let shape = |drawn: Drawn| Shape {
        kind: "mesh",
        size: scale.to_vec(),
        color: drawn.color.map(|own| hex(&own)).or(color.map(str::to_owned)),
        part: Some(drawn.part),
        ..at(pose)
    };
    meshes.get(file).into_iter().map(shape).collect()
}

/// Returns a shape with a pose. The caller adds the geometry.
fn at(pose: [f64; 7]) -> Shape {
    let [x, y, z, quaternion @ ..] = pose;
    Shape { kind: "", size: vec![], position: [x, y, z], quaternion, color: None, part: None }
}

/// Returns the bones of each body: a segment to each child joint, a sphere at the body's joint, and a segment to each
/// end frame.
fn bones(model: &Model, ends: &[usize]) -> HashMap<usize, Vec<Shape>> {
    let mut data = Data::new(model);
    let q = condyle::neutral(model);
    let placements = forward_kinematics(model, &mut data, &q);
    let mut reach: f64 = 0.0;
    for i in 0..model.bodies().len() {
        reach = reach.max(placements.body(i).translation.norm_squared().sqrt());
    }
    let r = 0.035 * reach.max(0.1);
    let shape = |kind, size: Vec<f64>| Shape { kind, size, ..at([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]) };
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
