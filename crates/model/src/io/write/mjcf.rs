//! Editing of the numbers of a robot in the text of an MJCF.

use super::Format;
use super::changes::{Changes, JointChange};
use super::edits::{Edits, about_com, words};
use crate::error::Error;
use crate::io::mjcf::{MjcfOptions, frame_poses};
use crate::io::xml::Element;
use crate::model::Model;
use condyle_spatial::{Act, Inertia, Se3};
use std::collections::HashMap;
use std::path::Path;

/// MJCF format: the path of the file, relative to which other files are included, and the options of the reader.
pub(super) struct Mjcf<'a> {
    pub(super) path: &'a Path,
    pub(super) options: MjcfOptions,
}

/// Bodies and joints of a document, by the names that the reader gives these bodies and joints.
#[derive(Default)]
struct Elements<'a> {
    bodies: HashMap<String, Parts<'a>>,
    joints: HashMap<String, &'a Element>,
    /// Number of bodies that have been found.
    count: usize,
}

/// Elements of a body by kind, including the elements inside its `<frame>`s.
struct Parts<'a> {
    body: &'a Element,
    inertial: Option<&'a Element>,
    /// Frames around the `<inertial>`, outermost first.
    frames: Vec<&'a Element>,
    has_geom: bool,
    joints: Vec<&'a Element>,
    inside: Vec<&'a Element>,
}

impl<'a> Elements<'a> {
    fn new(root: &'a Element) -> Self {
        let mut elements = Self::default();
        let mut waiting: Vec<&Element> = root.all("worldbody").collect();
        waiting.reverse();
        while let Some(element) = waiting.pop() {
            let parts = Parts::new(element);
            waiting.extend(parts.inside.iter().rev());
            if element.tag == "body" {
                elements.add(parts);
            }
        }
        elements
    }

    fn add(&mut self, parts: Parts<'a>) {
        self.count += 1;
        let body = name(parts.body, || format!("body{}", self.count));
        for (k, &joint) in parts.joints.iter().enumerate() {
            let number = if parts.joints.len() == 1 { String::new() } else { format!("{}", k + 1) };
            self.joints.insert(name(joint, || format!("{body}_joint{number}")), joint);
        }
        self.bodies.insert(body, parts);
    }
}

impl<'a> Parts<'a> {
    /// Finds the elements of a body.
    fn new(body: &'a Element) -> Self {
        let [frames, joints, inside] = [const { Vec::new() }; 3];
        let mut parts = Self { body, inertial: None, frames, has_geom: false, joints, inside };
        parts.gather(body, &mut Vec::new());
        parts
    }

    /// Adds the elements inside the body, or inside a frame. `frames` are the frames around these elements.
    fn gather(&mut self, element: &'a Element, frames: &mut Vec<&'a Element>) {
        for child in &element.children {
            match &*child.tag {
                "joint" | "freejoint" => self.joints.push(child),
                "body" => self.inside.push(child),
                "geom" => self.has_geom = true,
                "inertial" => (self.inertial, self.frames) = (Some(child), frames.clone()),
                "frame" => {
                    frames.push(child);
                    self.gather(child, frames);
                    frames.pop();
                }
                _ => {}
            }
        }
    }
}

/// Returns the name of an element. If the element has no name, returns `otherwise()`.
fn name(element: &Element, otherwise: impl Fn() -> String) -> String {
    element.attribute("name").filter(|n| !n.is_empty()).map_or_else(otherwise, str::to_owned)
}

/// Returns the value of an attribute of `<compiler>`. If the attribute occurs several times, the last value counts.
fn compiler<'a>(root: &'a Element, name: &str) -> Option<&'a str> {
    let sections = root.children.iter().filter(|section| section.tag == "compiler");
    sections.rev().find_map(|section| section.attribute(name))
}

impl Format for Mjcf<'_> {
    fn read(&self, text: &str) -> Result<Model, Error> {
        Model::from_mjcf_text(text, self.path, &self.options)
    }

    fn masses(&self, root: &Element) -> HashMap<String, f64> {
        let mass = |parts: &Parts| match parts.inertial {
            Some(inertial) => inertial.attribute("mass")?.trim().parse().ok(),
            None => parts.has_geom.then_some(f64::MIN_POSITIVE), // any positive mass; an <inertial> replaces it
        };
        let bodies = Elements::new(root).bodies.into_iter();
        bodies.filter_map(|(name, parts)| Some((name, mass(&parts)?))).collect()
    }

    fn edit(&self, edits: &mut Edits, root: &Element, changes: &Changes) -> Result<(), String> {
        let elements = Elements::new(root);
        let elsewhere = "is in an included file, or made by `replicate` or `attach`: write a file that has it itself";
        if let (Some("true"), Some(change)) = (compiler(root, "inertiafromgeom"), changes.links.first()) {
            let what = "inertiafromgeom=\"true\" of the compiler replaces its inertia by that of its geoms";
            return Err(format!("body `{}`: {what}", change.link));
        }
        let body = |name: &str| elements.bodies.get(name).ok_or_else(|| format!("body `{name}` {elsewhere}"));
        let frame_poses = frame_poses(root).map_err(|e| e.to_string())?;
        let pose = |parts: &Parts| {
            let poses = parts.frames.iter().map(|frame| frame_poses(frame)).collect::<Result<Vec<_>, _>>();
            poses.map(|poses| poses.into_iter().fold(Se3::identity(), |X, Y| X * Y)).map_err(|e| e.to_string())
        };
        for change in &changes.links {
            let of_body = |what| format!("body `{}`: {what}", change.link);
            let parts = body(&change.link)?;
            inertial(edits, parts, pose(parts)?.act_inv(change.inertia())).map_err(of_body)?;
            for name in &change.emptied {
                inertial(edits, body(name)?, Inertia::zero())?;
            }
        }
        let degrees = compiler(root, "angle") != Some("radian");
        for change in &changes.joints {
            let name = &change.name;
            let joint = elements.joints.get(name).copied().ok_or_else(|| format!("joint `{name}` {elsewhere}"))?;
            edit_joint(edits, joint, change, degrees).map_err(|what| format!("joint `{name}`: {what}"))?;
        }
        Ok(())
    }
}

/// Sets the inertia of a body, in the frame that surrounds the body's `<inertial>`.
fn inertial(edits: &mut Edits, parts: &Parts, I: Inertia<f64>) -> Result<(), String> {
    let (mass, com, J) = about_com(I)?;
    // MuJoCo accepts a full inertia matrix only if it is positive definite.
    let (moments, numbers) = match [J.xy, J.xz, J.yz] {
        [0.0, 0.0, 0.0] => ("diaginertia", vec![J.xx, J.yy, J.zz]),
        [xy, xz, yz] => ("fullinertia", vec![J.xx, J.yy, J.zz, xy, xz, yz]),
    };
    let Some(inertial) = parts.inertial else {
        let (mass, com, numbers) = (words(&[mass]), words(&com), words(&numbers));
        edits.insert(parts.body, &format!("<inertial pos=\"{com}\" mass=\"{mass}\" {moments}=\"{numbers}\"/>"));
        return Ok(());
    };
    edits.set(inertial, "pos", &com);
    edits.set(inertial, "mass", &[mass]);
    edits.set(inertial, moments, &numbers);
    // The new inertia is written along the axes of the surrounding frame, so attributes that specify other axes are
    // removed.
    let others = ["diaginertia", "fullinertia", "quat", "axisangle", "xyaxes", "zaxis", "euler"];
    others.into_iter().filter(|name| *name != moments).for_each(|name| edits.remove(inertial, name));
    Ok(())
}

/// Sets the limits, damping, friction and armature of a joint.
fn edit_joint(edits: &mut Edits, joint: &Element, change: &JointChange, degrees: bool) -> Result<(), String> {
    if joint.tag == "freejoint" {
        return Err("a <freejoint> has neither limits, losses nor armature: write <joint type=\"free\">".to_owned());
    }
    let mut range = |name: &str, limited: &str, [lower, upper]: [f64; 2], unit: f64| {
        if lower == f64::NEG_INFINITY && upper == f64::INFINITY {
            edits.set_text(joint, limited, "false");
        } else if lower.is_finite() && upper.is_finite() {
            edits.set_text(joint, limited, "true");
            edits.set(joint, name, &[lower * unit, upper * unit]);
        } else {
            return Err(format!("{name} {lower} to {upper}: an MJCF has both limits or none"));
        }
        Ok(())
    };
    if let Some(position) = change.position() {
        let is_angle = degrees && !change.is_prismatic;
        range("range", "limited", position, if is_angle { 1f64.to_degrees() } else { 1.0 })?;
    }
    if let Some(effort) = change.effort() {
        range("actuatorfrcrange", "actuatorfrclimited", effort, 1.0)?;
    }
    if let Some(velocity) = change.velocity() {
        return Err(format!("its velocity limit {velocity} cannot be written: an MJCF has none"));
    }
    match change.damping() {
        Some([damping, 0.0, 0.0]) => edits.set(joint, "damping", &[damping]),
        Some(damping) => edits.set(joint, "damping", &damping),
        None => {}
    }
    for (name, value) in [("frictionloss", change.friction()), ("armature", change.armature())] {
        if let Some(value) = value {
            edits.set(joint, name, &[value]);
        }
    }
    Ok(())
}
