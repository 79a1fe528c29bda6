//! Editing of the numbers of a robot in the text of a URDF.

use super::Format;
use super::changes::{Changes, JointChange};
use super::edits::{Edits, about_com, words};
use crate::error::Error;
use crate::io::urdf::UrdfOptions;
use crate::io::xml::Element;
use crate::model::Model;
use condyle_spatial::Inertia;
use std::collections::{HashMap, HashSet};

/// URDF format, with the options of the reader.
pub(super) struct Urdf {
    pub(super) options: UrdfOptions,
}

/// Returns the name of the link that is not the child of any joint.
pub(super) fn root(robot: &Element) -> Option<&str> {
    let children: HashSet<&str> =
        named(robot, "joint").into_values().filter_map(|j| j.child("child")?.attribute("link")).collect();
    named(robot, "link").into_keys().find(|link| !children.contains(link))
}

/// Returns the links or joints of a robot, by name.
fn named<'a>(robot: &'a Element, tag: &'a str) -> HashMap<&'a str, &'a Element> {
    robot.all(tag).filter_map(|element| Some((element.attribute("name")?, element))).collect()
}

impl Format for Urdf {
    fn read(&self, text: &str) -> Result<Model, Error> {
        Model::from_urdf_str(text, &self.options)
    }

    fn masses(&self, robot: &Element) -> HashMap<String, f64> {
        let mass = |link: &Element| link.child("inertial")?.child("mass")?.attribute("value")?.trim().parse().ok();
        named(robot, "link").into_iter().filter_map(|(name, link)| Some((name.to_owned(), mass(link)?))).collect()
    }

    fn edit(&self, edits: &mut Edits, robot: &Element, changes: &Changes) -> Result<(), String> {
        let (links, joints) = (named(robot, "link"), named(robot, "joint"));
        let link = |name: &str| links.get(name).copied().ok_or_else(|| format!("there is no link `{name}`"));
        for change in &changes.links {
            let of_link = |what| format!("link `{}`: {what}", change.link);
            inertial(edits, link(&change.link)?, change.inertia()).map_err(of_link)?;
            for name in &change.emptied {
                inertial(edits, link(name)?, Inertia::zero())?;
            }
        }
        for change in &changes.joints {
            let name = &change.name;
            let none =
                || format!("there is no joint `{name}`: a root joint has no limits, losses and armature in a URDF");
            let joint = joints.get(&**name).copied().ok_or_else(none)?;
            edit_joint(edits, joint, change).map_err(|what| format!("joint `{name}`: {what}"))?;
            if let Some(armature) = change.armature() {
                transmission(edits, robot, name, armature);
            }
        }
        Ok(())
    }
}

/// Sets the inertia of a link, in the link's frame.
fn inertial(edits: &mut Edits, link: &Element, I: Inertia<f64>) -> Result<(), String> {
    let (mass, com, J) = about_com(I)?;
    let moments = [("ixx", J.xx), ("ixy", J.xy), ("ixz", J.xz), ("iyy", J.yy), ("iyz", J.yz), ("izz", J.zz)];
    let Some(inertial) = link.child("inertial") else {
        let moments: String = moments.map(|(name, x)| format!(" {name}=\"{}\"", words(&[x]))).concat();
        let (mass, com) = (words(&[mass]), words(&com));
        let inside = format!("<origin xyz=\"{com}\"/><mass value=\"{mass}\"/><inertia{moments}/>");
        edits.insert(link, &format!("<inertial>{inside}</inertial>"));
        return Ok(());
    };
    match inertial.child("origin") {
        Some(origin) => {
            edits.set(origin, "xyz", &com);
            // The new inertia is written along the axes of the link, so attributes that specify other axes are removed.
            let turned = |name: &&str| {
                let numbers = origin.attribute(name).unwrap_or_default().split_whitespace();
                numbers.map(str::parse::<f64>).any(|x| x != Ok(0.0))
            };
            ["rpy", "quat_xyzw"].into_iter().filter(turned).for_each(|name| edits.remove(origin, name));
        }
        None if com == [0.0; 3] => {}
        None => edits.insert(inertial, &format!("<origin xyz=\"{}\"/>", words(&com))),
    }
    let part = |tag: &str| inertial.child(tag).ok_or_else(|| format!("its <inertial> has no <{tag}>"));
    edits.set(part("mass")?, "value", &[mass]);
    let inertia = part("inertia")?;
    moments.into_iter().for_each(|(name, x)| edits.set(inertia, name, &[x]));
    Ok(())
}

/// Sets the limits, damping and friction of a joint.
fn edit_joint(edits: &mut Edits, joint: &Element, change: &JointChange) -> Result<(), String> {
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
    let limit = joint.child("limit");
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
        // A new `<limit>` needs both velocity and effort.
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
    match joint.child("dynamics") {
        _ if dynamics.is_empty() => {}
        Some(old) => dynamics.into_iter().for_each(|(name, x)| edits.set(old, name, &[x])),
        None => edits.insert(joint, &element("dynamics", &dynamics)),
    }
    Ok(())
}

/// Tag of the rotor inertia in a transmission. Drake and the reader of this crate read it.
const ROTOR: &str = "drake:rotor_inertia";
/// Tag of the number of turns of the rotor per turn of its joint. The number is 1 if the element is missing.
const RATIO: &str = "drake:gear_ratio";

/// Sets the armature of a joint. The armature n² J is written as the rotor inertia J of the joint's transmission with
/// the gear ratio n.
fn transmission(edits: &mut Edits, robot: &Element, joint: &str, armature: f64) {
    let drives = |t: &&Element| t.all("joint").map(|j| j.attribute("name")).eq([Some(joint)]);
    let own = robot.all("transmission").filter(drives).find(|t| t.all("actuator").count() == 1);
    let actuator = own.and_then(|t| t.child("actuator"));
    let value = |of: &Element| of.attribute("value")?.trim().parse().ok().filter(|n: &f64| *n != 0.0);
    let ratio = actuator.and_then(|a| value(a.child(RATIO)?)).unwrap_or(1.0);
    let inertia = armature / (ratio * ratio);
    let rotor = format!("<{ROTOR} xmlns:drake=\"http://drake.mit.edu\" value=\"{}\"/>", words(&[inertia]));
    match (actuator, actuator.and_then(|a| a.child(ROTOR))) {
        (_, Some(old)) => edits.set(old, "value", &[inertia]),
        (Some(actuator), None) => edits.insert(actuator, &rotor),
        (None, None) => {
            let kind = "<type>transmission_interface/SimpleTransmission</type>"; // Drake requires this element
            let inside = format!("{kind}<joint name=\"{joint}\"/><actuator name=\"{joint}\">{rotor}</actuator>");
            edits.insert(robot, &format!("<transmission name=\"{joint}\">{inside}</transmission>"));
        }
    }
}

/// Returns an element whose attributes are numbers.
fn element(tag: &str, attributes: &[(&str, f64)]) -> String {
    let attributes = attributes.iter().map(|&(name, x)| format!(" {name}=\"{}\"", words(&[x])));
    format!("<{tag}{}/>", attributes.collect::<String>())
}
