//! Constraints of an SDF: joints that close loops, and gearboxes.

use super::joints::{Axis, Motion};
use super::reader::Reader;
use super::scopes::Place;
use super::tree::Edge;
use super::values::{number, text};
use crate::builder::{BodyId, ModelBuilder};
use crate::error::Error;
use condyle_spatial::{Se3, Vec3};
use std::collections::HashMap;

impl Reader<'_> {
    /// Adds the constraints of a joint that closes a loop. Adds warnings about motions that these constraints do not
    /// prevent.
    ///
    /// A fixed joint constrains two frames, and a ball joint constrains two points. A revolute joint makes two
    /// constraints, for two points 1 m apart on its axis. One of the six rows of these two constraints is redundant,
    /// because the distance between the two points is constant.
    pub(super) fn close(&mut self, builder: &mut ModelBuilder, edge: &Edge) -> Result<(), Error> {
        let Edge { element, item, parent, child, .. } = *edge;
        let scope = self.scopes.items[item].scope;
        let mXj = self.scopes.items[item].pose;
        let in_body = |at: (BodyId, Se3<f64>), mXl: Se3<f64>| (at.0, at.1 * mXl.inverse() * mXj);
        let ends = [parent, Some(child)].map(|link| in_body(self.place(link), self.scopes.in_scope(link, scope)));
        let name = self.scopes.name(item).to_owned();
        let motions = super::joints::motions(&self.scopes, edge, &mut self.warnings)?;
        let lost = if ends[0].0 == ends[1].0 {
            match motions.is_empty() {
                true => None,
                false => Some("joins two links that are fixed to each other: it does not move"),
            }
        } else {
            match &*edge.kind {
                "fixed" => {
                    builder.constraint_rigid(&name, ends);
                    None
                }
                "prismatic" | "screw" => {
                    Some("closes a loop that no constraint holds: it is left out, and the loop is open")
                }
                _ => {
                    builder.constraint_point(&name, ends);
                    None
                }
            }
        };
        if let Some(what) = lost {
            self.warnings.push(element.left_out(what));
            return Ok(());
        }
        let mut extras = Vec::new();
        for Motion { joint, tag } in &motions {
            let joint = joint.normalized().map_err(|_| element.wrong(format!("{tag}: xyz is no direction")))?;
            extras.extend(Axis::new(element, tag, joint, &mut self.warnings)?.extras());
            if let (1, Some(axis)) = (motions.len(), joint.axis()) {
                let along = Se3 { translation: axis, ..Se3::identity() };
                builder.constraint_point(&format!("{name}#2"), ends.map(|(body, bXj)| (body, bXj * along)));
            }
        }
        if motions.len() > 1 {
            self.warnings
                .push(element.left_out("closes a loop: only its point is held, and it may turn about all axes"));
        }
        if !extras.is_empty() {
            let what = format!("closes a loop: its {} left out, the constraint has none", are(&extras));
            self.warnings.push(element.left_out(what));
        }
        Ok(())
    }

    /// Adds the couplings that gearboxes describe.
    pub(super) fn gearboxes(&mut self, builder: &mut ModelBuilder) -> Result<(), Error> {
        let gearboxes = std::mem::take(&mut self.gearboxes);
        let mut turns: HashMap<[Place; 2], Vec<usize>> = HashMap::new();
        let is_turn = |(_, e): &(usize, &Edge)| matches!(&*e.kind, "revolute" | "continuous");
        for (i, edge) in self.edges.iter().enumerate().filter(is_turn) {
            turns.entry([edge.parent, Some(edge.child)]).or_default().push(i);
        }
        gearboxes.iter().try_for_each(|edge| self.gearbox(builder, edge, &turns))
    }

    /// Adds the coupling θ₂ = −ratio θ₁ of a gearbox, or a warning that the gearbox is left out.
    ///
    /// The angles are relative to the reference body: θ₁ is the angle of the parent about `<axis>`, and θ₂ is the angle
    /// of the child about `<axis2>`. Each angle is the position of a joint between the link and the reference body.
    fn gearbox(
        &mut self,
        builder: &mut ModelBuilder,
        edge: &Edge,
        turns: &HashMap<[Place; 2], Vec<usize>>,
    ) -> Result<(), Error> {
        let Edge { element, item, parent, child, .. } = *edge;
        let ratio = number(element, Some(element), "gearbox_ratio", 1.0)?;
        let found = match text(element, "gearbox_reference_body") {
            None => None,
            Some(name) => {
                let at = self.scopes.find(item, name);
                let at =
                    at.ok_or_else(|| element.wrong(format!("gearbox_reference_body: no link is named `{name}`")))?;
                let reference = self.scopes.attached(at, element)?;
                let axes = [(parent, "axis"), (Some(child), "axis2")];
                let between = |link: Place| {
                    let joints = |ends| turns.get(&ends).into_iter().flatten().copied();
                    let there = joints([reference, link]).map(|i| (i, 1.0));
                    there.chain(joints([link, reference]).map(|i| (i, -1.0))).collect::<Vec<_>>()
                };
                let [first, second] = axes.map(|(link, tag)| self.turn(edge, tag, &between(link)));
                first?.zip(second?)
            }
        };
        match found {
            Some(((leader, s1), (follower, s2))) if leader != follower => {
                let name = self.scopes.name(item);
                builder.constraint_coupling(name, follower, Some(leader), [0.0, -ratio * s1 * s2, 0.0, 0.0, 0.0]);
            }
            _ => {
                let what =
                    "the gearbox is left out: no revolute joints about its axes join its links to its reference body";
                self.warnings.push(element.left_out(what));
            }
        }
        Ok(())
    }

    /// Returns the body of the first joint whose axis is parallel to an axis of a gearbox. Also returns the sign of the
    /// joint's rotation about the axis of the gearbox.
    fn turn(&self, gearbox: &Edge, tag: &'static str, joints: &[(usize, f64)]) -> Result<Option<(BodyId, f64)>, Error> {
        for &(i, sign) in joints {
            let edge = &self.edges[i];
            let Some(body) = self.axes.body(edge.item, "axis") else { continue };
            let in_world = |edge: &Edge, tag: &str| -> Result<Vec3<f64>, Error> {
                let axis = self.scopes.axis(edge.item, tag)?;
                Ok(self.scopes.in_world(edge.item).rotation * axis.scale(1.0 / axis.norm_squared().sqrt()))
            };
            let along = in_world(edge, "axis")?.dot(in_world(gearbox, tag)?);
            if along.abs() > 1.0 - PARALLEL {
                return Ok(Some((body, sign * along.signum())));
            }
        }
        Ok(None)
    }
}

/// Tolerance for parallel axes: maximum of 1 minus the cosine of the angle between them. Files often have only six
/// digits.
const PARALLEL: f64 = 1e-6;

/// Returns a list of names followed by `is` or `are`, for example `limits, damping are`.
fn are(names: &[&str]) -> String {
    let verb = if names == ["limits"] || names.len() > 1 { "are" } else { "is" };
    format!("{} {verb}", names.join(", "))
}
