//! Collision shapes of a robot, for `condyle inspect`: the shapes, the pairs that can collide, and the nearest pair.

use crate::robot::Robot;
use crate::terminal::{Table, heading};
use condyle::distances::{Collisions, DistancePairs, Distances};
use condyle::{Data, Model, ModelError, forward_kinematics, neutral};
use serde::Serialize;

/// Collision shapes of a robot.
#[derive(Serialize)]
pub(crate) struct Shapes {
    shapes: Vec<ShapeReport>,
    /// Number of pairs of shapes that can collide.
    pairs: usize,
    /// Nearest pair at the neutral position; `None` without pairs.
    nearest: Option<Nearest>,
    /// Messages about shapes that are left out.
    left_out: Vec<String>,
}

#[derive(Serialize)]
struct ShapeReport {
    name: String,
    link: String,
    kind: &'static str,
}

/// Pair with the smallest distance.
#[derive(Serialize)]
struct Nearest {
    first: String,
    second: String,
    /// Signed distance (m); negative if the shapes overlap.
    distance: f64,
}

impl Shapes {
    /// Reads the collision shapes of a robot. If they cannot be read, the reason is one of the messages.
    pub(crate) fn new(robot: &Robot) -> Self {
        let (shapes, left_out) = (Vec::new(), Vec::new());
        let empty = Self { shapes, pairs: 0, nearest: None, left_out };
        let found = robot.collisions().and_then(|collisions| Self::of(&robot.model, &collisions));
        found.unwrap_or_else(|error| Self { left_out: vec![error.to_string()], ..empty })
    }

    fn of(model: &Model, collisions: &Collisions) -> Result<Self, ModelError> {
        let link = |frame: &Option<condyle::distances::FrameName>| frame.as_ref().map_or("", |f| &*f.name).to_owned();
        let shapes = collisions.geometries.iter().map(|geometry| ShapeReport {
            name: geometry.name.clone(),
            link: link(&geometry.frame),
            kind: geometry.shape.kind(),
        });
        let pairs = collisions.pairs(model)?;
        let prepared = DistancePairs::new(model, &pairs)?;
        let (mut data, mut distances) = (Data::new(model), Distances::new(&prepared));
        prepared.values(forward_kinematics(model, &mut data, &neutral(model)), &mut distances);
        let nearest = distances.nearest().map(|(pair, distance)| Nearest {
            first: pairs[pair].first.name.clone(),
            second: pairs[pair].second.name.clone(),
            distance,
        });
        let left_out = collisions.warnings().map(ToString::to_string).collect();
        Ok(Self { shapes: shapes.collect(), pairs: pairs.len(), nearest, left_out })
    }

    /// Returns the shapes as text with a heading; an empty text if the robot has no collision shapes.
    pub(crate) fn text(&self) -> String {
        if self.shapes.is_empty() && self.left_out.is_empty() {
            return String::new();
        }
        let mut text = heading("Collision shapes");
        if !self.shapes.is_empty() {
            let mut table = Table::new(&["shape", "link", "kind"]);
            for shape in &self.shapes {
                table.row(vec![shape.name.clone(), shape.link.clone(), shape.kind.to_owned()]);
            }
            text += &table.text();
        }
        if let Some(Nearest { first, second, distance }) = &self.nearest {
            let s = if self.pairs == 1 { "" } else { "s" };
            text += &format!(
                "  {} pair{s} can collide; the nearest at the neutral position: {first} and {second}, {distance:.4} m\n",
                self.pairs
            );
        }
        for message in &self.left_out {
            text += &format!("  left out: {message}\n");
        }
        text
    }
}
