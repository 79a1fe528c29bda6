//! Numbers of a robot in the text of a URDF.

use super::Format;
use super::changes::{Changes, JointChange};
use super::edits::{Edits, about_com, child, words};
use crate::error::Error;
use crate::io::urdf::UrdfOptions;
use crate::model::Model;
use condyle_spatial::Inertia;
use roxmltree::{Document, Node};
use std::collections::{HashMap, HashSet};

/// A URDF, and how it is read.
pub(super) struct Urdf {
    pub(super) options: UrdfOptions,
}

/// Returns the name of the link that is the child of no joint.
pub(super) fn root(text: &str) -> Option<String> {
    let document = Document::parse(text).ok()?;
    let children: HashSet<&str> =
        named(&document, "joint").into_values().filter_map(|j| child(j, "child")?.attribute("link")).collect();
    named(&document, "link").into_keys().find(|link| !children.contains(link)).map(str::to_owned)
}

/// The links or joints of a robot by name.
fn named<'a>(document: &'a Document, tag: &str) -> HashMap<&'a str, Node<'a, 'a>> {
    let robot = document.root_element();
    let elements = robot.children().filter(|n| n.is_element() && n.tag_name().name() == tag);
    elements.filter_map(|n| Some((n.attribute("name")?, n))).collect()
}

impl Format for Urdf {
    fn read(&self, text: &str) -> Result<Model, Error> {
        Model::from_urdf_str(text, &self.options)
    }

    fn masses(&self, text: &str) -> Result<HashMap<String, f64>, String> {
        let document = Document::parse(text).map_err(|e| e.to_string())?;
        let mass = |link: Node| {
            let mass = child(child(link, "inertial")?, "mass")?;
            mass.attribute("value")?.trim().parse().ok()
        };
        let links = named(&document, "link").into_iter();
        Ok(links.filter_map(|(name, link)| Some((name.to_owned(), mass(link)?))).collect())
    }

    fn edit(&self, text: &str, changes: &Changes) -> Result<String, String> {
        let document = Document::parse(text).map_err(|e| e.to_string())?;
        let (links, joints) = (named(&document, "link"), named(&document, "joint"));
        let mut edits = Edits::new(text);
        let link = |name: &str| links.get(name).copied().ok_or_else(|| format!("has no link `{name}`"));
        for change in &changes.links {
            inertial(&mut edits, link(&change.link)?, change.inertia()).map_err(|what| {
                format!("link `{}`: {what}", change.link) //
            })?;
            for name in &change.emptied {
                inertial(&mut edits, link(name)?, Inertia::zero())?;
            }
        }
        for change in &changes.joints {
            let name = &change.name;
            let joint = joints.get(&**name).ok_or_else(|| {
                format!("has no joint `{name}`: limits and losses of a root joint cannot be written") //
            })?;
            edit_joint(&mut edits, *joint, change).map_err(|what| format!("joint `{name}`: {what}"))?;
        }
        Ok(edits.apply())
    }
}

/// Gives a link an inertia, in the link's frame.
fn inertial(edits: &mut Edits, link: Node, I: Inertia<f64>) -> Result<(), String> {
    let (mass, com, J) = about_com(I)?;
    let moments = [("ixx", J.xx), ("ixy", J.xy), ("ixz", J.xz), ("iyy", J.yy), ("iyz", J.yz), ("izz", J.zz)];
    let Some(inertial) = child(link, "inertial") else {
        let moments: String = moments.map(|(name, x)| format!(" {name}=\"{}\"", words(&[x]))).concat();
        let (mass, com) = (words(&[mass]), words(&com));
        let inside = format!("<origin xyz=\"{com}\"/><mass value=\"{mass}\"/><inertia{moments}/>");
        edits.insert(link, &format!("<inertial>{inside}</inertial>"));
        return Ok(());
    };
    match child(inertial, "origin") {
        Some(origin) => {
            edits.set(origin, "xyz", &com);
            // the new inertia is along the axes of the link
            let turned = |name: &&str| {
                let numbers = origin.attribute(*name).unwrap_or_default().split_whitespace();
                numbers.map(str::parse::<f64>).any(|x| x != Ok(0.0))
            };
            ["rpy", "quat_xyzw"].into_iter().filter(turned).for_each(|name| edits.remove(origin, name));
        }
        None if com == [0.0; 3] => {}
        None => edits.insert(inertial, &format!("<origin xyz=\"{}\"/>", words(&com))),
    }
    let part = |tag: &str| child(inertial, tag).ok_or_else(|| format!("its <inertial> has no <{tag}>"));
    edits.set(part("mass")?, "value", &[mass]);
    let inertia = part("inertia")?;
    moments.into_iter().for_each(|(name, x)| edits.set(inertia, name, &[x]));
    Ok(())
}

/// Gives a joint its limits and losses.
fn edit_joint(edits: &mut Edits, joint: Node, change: &JointChange) -> Result<(), String> {
    let finite = |name: &'static str, x: f64| match x.is_finite() {
        true => Ok((name, x)),
        false => Err(format!("{name} {x}: a URDF has no infinite limits")),
    };
    let mut limits = Vec::new();
    if let Some([lower, upper]) = change.position() {
        limits.extend([finite("lower", lower)?, finite("upper", upper)?]);
    }
    let one = |[lower, upper]: [f64; 2]| match lower == -upper {
        true => finite("effort", upper),
        false => Err(format!("effort from {lower} to {upper}: a URDF has one limit for both directions")),
    };
    let (velocity, effort) = change.all_limits();
    let limit = child(joint, "limit");
    if let Some(velocity) = change.velocity() {
        limits.push(finite("velocity", velocity)?);
    }
    if let Some(effort) = change.effort() {
        limits.push(one(effort)?);
    }
    if limits.is_empty() {
    } else if let Some(limit) = limit {
        limits.into_iter().for_each(|(name, x)| edits.set(limit, name, &[x]));
    } else {
        // a new element has both
        let (velocity, effort) = (finite("velocity", velocity)?, one(effort)?);
        let position = limits.into_iter().filter(|(name, _)| matches!(*name, "lower" | "upper"));
        edits.insert(joint, &element("limit", &position.chain([effort, velocity]).collect::<Vec<_>>()));
    }
    let mut dynamics = Vec::new();
    match change.damping() {
        Some([damping, 0.0, 0.0]) => dynamics.push(("damping", damping)),
        Some(found) => return Err(format!("damping {found:?}: a URDF has none that grows with the speed")),
        None => {}
    }
    dynamics.extend(change.friction().map(|friction| ("friction", friction)));
    match child(joint, "dynamics") {
        _ if dynamics.is_empty() => {}
        Some(old) => dynamics.into_iter().for_each(|(name, x)| edits.set(old, name, &[x])),
        None => edits.insert(joint, &element("dynamics", &dynamics)),
    }
    match change.armature() {
        Some(armature) => Err(format!("its armature {armature} cannot be written: a URDF has none")),
        None => Ok(()),
    }
}

/// An element with numbers for attributes.
fn element(tag: &str, attributes: &[(&str, f64)]) -> String {
    let attributes = attributes.iter().map(|&(name, x)| format!(" {name}=\"{}\"", words(&[x])));
    format!("<{tag}{}/>", attributes.collect::<String>())
}
