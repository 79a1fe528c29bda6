//! Numbers of a robot in the text of an MJCF.

use super::Format;
use super::changes::{Changes, JointChange};
use super::edits::{Edits, about_com, words};
use crate::error::Error;
use crate::io::mjcf::MjcfOptions;
use crate::io::xml::Element;
use crate::model::Model;
use condyle_spatial::Inertia;
use std::collections::HashMap;
use std::path::Path;

/// An MJCF: the path relative to which files are included, and options of the reader.
pub(super) struct Mjcf<'a> {
    pub(super) path: &'a Path,
    pub(super) options: MjcfOptions,
}

/// Bodies and joints of a document, by the names that the reader gives them.
#[derive(Default)]
struct Elements<'a> {
    bodies: HashMap<String, &'a Element>,
    joints: HashMap<String, &'a Element>,
    /// Number of bodies so far.
    count: usize,
}

impl<'a> Elements<'a> {
    fn new(root: &'a Element) -> Self {
        let mut elements = Self::default();
        let mut waiting: Vec<&Element> = root.all("worldbody").collect();
        waiting.reverse();
        while let Some(element) = waiting.pop() {
            let body = if element.tag == "body" { elements.add(element) } else { String::new() };
            let (mut joints, mut inside) = (Vec::new(), Vec::new());
            gather(element, &mut joints, &mut inside);
            for (k, &joint) in joints.iter().enumerate() {
                let number = if joints.len() == 1 { String::new() } else { format!("{}", k + 1) };
                elements.joints.insert(name(joint, || format!("{body}_joint{number}")), joint);
            }
            waiting.extend(inside.into_iter().rev());
        }
        elements
    }

    fn add(&mut self, body: &'a Element) -> String {
        self.count += 1;
        let name = name(body, || format!("body{}", self.count));
        self.bodies.insert(name.clone(), body);
        name
    }
}

/// Finds the joints and child bodies of a body, including those in its frames.
fn gather<'a>(element: &'a Element, joints: &mut Vec<&'a Element>, bodies: &mut Vec<&'a Element>) {
    for child in &element.children {
        match &*child.tag {
            "joint" | "freejoint" => joints.push(child),
            "body" => bodies.push(child),
            "frame" => gather(child, joints, bodies),
            _ => {}
        }
    }
}

/// Returns the name of an element, or another name if it has none.
fn name(element: &Element, otherwise: impl Fn() -> String) -> String {
    element.attribute("name").filter(|n| !n.is_empty()).map_or_else(otherwise, str::to_owned)
}

/// Returns the value of a compiler's attribute; the last one counts.
fn compiler<'a>(root: &'a Element, name: &str) -> Option<&'a str> {
    let sections = root.children.iter().filter(|section| section.tag == "compiler");
    sections.rev().find_map(|section| section.attribute(name))
}

impl Format for Mjcf<'_> {
    fn read(&self, text: &str) -> Result<Model, Error> {
        Model::from_mjcf_text(text, self.path, &self.options)
    }

    fn masses(&self, root: &Element) -> HashMap<String, f64> {
        let mass = |body: &Element| match (body.child("inertial"), body.child("geom")) {
            (Some(inertial), _) => inertial.attribute("mass")?.trim().parse().ok(),
            (None, geom) => geom.map(|_| f64::MIN_POSITIVE), // some mass, which an <inertial> replaces
        };
        let bodies = Elements::new(root).bodies.into_iter();
        bodies.filter_map(|(name, body)| Some((name, mass(body)?))).collect()
    }

    fn edit(&self, edits: &mut Edits, root: &Element, changes: &Changes) -> Result<(), String> {
        let elements = Elements::new(root);
        let elsewhere = "is in an included file, or made by `replicate` or `attach`: write a file that has it itself";
        if let (Some("true"), Some(change)) = (compiler(root, "inertiafromgeom"), changes.links.first()) {
            let what = "inertiafromgeom=\"true\" of the compiler replaces its inertia by that of its geoms";
            return Err(format!("body `{}`: {what}", change.link));
        }
        let body = |name: &str| elements.bodies.get(name).copied().ok_or_else(|| format!("body `{name}` {elsewhere}"));
        for change in &changes.links {
            let of_body = |what| format!("body `{}`: {what}", change.link);
            inertial(edits, body(&change.link)?, change.inertia()).map_err(of_body)?;
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

/// Sets the inertia of a body, in the body's frame.
fn inertial(edits: &mut Edits, body: &Element, I: Inertia<f64>) -> Result<(), String> {
    let (mass, com, J) = about_com(I)?;
    // MuJoCo accepts a full inertia only if it is positive definite
    let (moments, numbers) = match [J.xy, J.xz, J.yz] {
        [0.0, 0.0, 0.0] => ("diaginertia", vec![J.xx, J.yy, J.zz]),
        [xy, xz, yz] => ("fullinertia", vec![J.xx, J.yy, J.zz, xy, xz, yz]),
    };
    let Some(inertial) = body.child("inertial") else {
        let (mass, com, numbers) = (words(&[mass]), words(&com), words(&numbers));
        edits.insert(body, &format!("<inertial pos=\"{com}\" mass=\"{mass}\" {moments}=\"{numbers}\"/>"));
        return Ok(());
    };
    edits.set(inertial, "pos", &com);
    edits.set(inertial, "mass", &[mass]);
    edits.set(inertial, moments, &numbers);
    // the axes of the new inertia are the axes of the body
    let others = ["diaginertia", "fullinertia", "quat", "axisangle", "xyaxes", "zaxis", "euler"];
    others.into_iter().filter(|name| *name != moments).for_each(|name| edits.remove(inertial, name));
    Ok(())
}

/// Sets the limits, losses and armature of a joint.
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
