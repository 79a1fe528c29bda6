//! Conversion of older SDF files to the newest version, by the rules of the format's own library. All later steps of
//! the reader handle only the newest version.

use super::values::flag;
use crate::error::Error;
use crate::io::xml::Element;

/// Versions of the format, without the prefix `1.`. Version 1.1 does not exist.
const VERSIONS: [u32; 12] = [0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];
/// Newest version.
pub(super) const NEWEST: u32 = VERSIONS[VERSIONS.len() - 1];
/// Tag of the root element. Versions 1.0 to 1.2 may use `gazebo`.
const ROOT: &str = "sdf";
/// Name with which the elements of a model refer to the frame of the model.
pub(super) const MODEL: &str = "__model__";

/// Attributes that became elements in version 1.2, by the tag of the element that had the attributes.
const ATTRIBUTES: &[(&str, &[&str])] = &[
    ("model", &["static"]),
    ("link", &["gravity", "self_collide", "kinematic"]),
    ("inertial", &["mass", "density"]),
    ("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]),
    ("axis", &["xyz"]),
    ("axis2", &["xyz"]),
    ("dynamics", &["damping", "friction"]),
    ("limit", &["lower", "upper", "effort", "velocity"]),
];

/// Elements with a single attribute, and their new tags. In version 1.2, the attribute became the text of the element.
const TEXTS: &[(&str, &str, &str)] = &[
    ("origin", "pose", "pose"),
    ("parent", "link", "parent"),
    ("child", "link", "child"),
    ("gravity", "xyz", "gravity"),
];

/// Converts the root element of a file to the newest version.
pub(super) fn convert(root: &mut Element) -> Result<(), Error> {
    let version = version(root)?;
    ROOT.clone_into(&mut root.tag);
    if version == 0 {
        attributes_to_elements(root);
    }
    if version <= 4 {
        for model in models(root) {
            axes(model, &mut |axis| {
                if axis.child(FLAG).is_none() {
                    let flag = axis.with(FLAG, "true");
                    axis.children.push(flag);
                }
            });
        }
    }
    if version <= 5 {
        for world in root.children.iter_mut().filter(|c| c.tag == "world") {
            gravity_of_physics(world);
        }
    }
    if version <= 6 {
        frames(root)?;
    }
    Ok(())
}

/// Returns the version of a file, without the prefix `1.`.
fn version(root: &Element) -> Result<u32, Error> {
    if root.tag != ROOT && root.tag != "gazebo" {
        return Err(root.wrong("the root element of an SDF is <sdf>"));
    }
    let known = || {
        let names: Vec<String> = VERSIONS.iter().map(|minor| format!("1.{minor}")).collect();
        names.join(", ")
    };
    let Some(text) = root.attribute("version") else {
        return Err(root.wrong(format!("has no version; known are {}", known())));
    };
    let found = VERSIONS.iter().copied().find(|minor| text.trim() == format!("1.{minor}"));
    let found = found.filter(|&minor| root.tag == ROOT || minor <= 2);
    found.ok_or_else(|| root.wrong(format!("version `{text}` is unknown; known are {}", known())))
}

/// Tag of the element that specifies, up to version 1.6, whether an axis is in the frame of the model.
const FLAG: &str = "use_parent_model_frame";

/// Returns the models of a root element and of its worlds.
fn models(root: &mut Element) -> impl Iterator<Item = &mut Element> {
    let inside = root.children.iter_mut().flat_map(|child| match &*child.tag {
        "world" => child.children.iter_mut().collect(),
        _ => vec![child],
    });
    inside.filter(|child| child.tag == "model")
}

/// Applies a change to each axis in the joints of a model.
fn axes(model: &mut Element, change: &mut dyn FnMut(&mut Element)) {
    for joint in model.children.iter_mut().filter(|c| c.tag == "joint") {
        joint.children.iter_mut().filter(|c| matches!(&*c.tag, "axis" | "axis2")).for_each(&mut *change);
    }
}

/// Converts attributes of version 1.0 into elements.
fn attributes_to_elements(element: &mut Element) {
    if let Some((_, names)) = ATTRIBUTES.iter().find(|(tag, _)| *tag == element.tag) {
        for name in *names {
            if let Some(at) = element.attributes.iter().position(|(found, _)| found == name) {
                let (_, value) = element.attributes.remove(at);
                let child = element.with(name, &value);
                element.children.push(child);
            }
        }
    }
    let is_link = element.tag == "link";
    for child in &mut element.children {
        if matches!(&*child.tag, "plugin" | "visual" | "sensor" | "collision") {
            continue;
        }
        if let Some((_, attribute, tag)) = TEXTS.iter().find(|(tag, ..)| *tag == child.tag)
            && let Some(at) = child.attributes.iter().position(|(found, _)| found == attribute)
        {
            (_, child.text) = child.attributes.remove(at);
            (*tag).clone_into(&mut child.tag);
        }
        if is_link && child.tag == "damping" {
            "velocity_decay".clone_into(&mut child.tag);
        }
        attributes_to_elements(child);
    }
}

/// Moves the gravity of version 1.5 from the `<physics>` of a world to the world itself.
fn gravity_of_physics(world: &mut Element) {
    let physics = world.children.iter_mut().find(|c| c.tag == "physics");
    let gravity = physics.and_then(|p| {
        let at = p.children.iter().position(|c| c.tag == "gravity")?;
        Some(p.children.remove(at))
    });
    world.children.extend(gravity);
}

/// Converts frames of version 1.6: renames the attribute `frame` of poses, and converts the flag of axes into
/// `expressed_in`.
fn frames(element: &mut Element) -> Result<(), Error> {
    if element.tag == "plugin" || element.tag.contains(':') {
        return Ok(());
    }
    for child in &mut element.children {
        if child.tag == "pose" && child.attribute("frame").is_some() {
            child.attributes.retain(|(name, _)| name != "relative_to");
            for (name, _) in child.attributes.iter_mut().filter(|(name, _)| name == "frame") {
                "relative_to".clone_into(name);
            }
        }
        frames(child)?;
    }
    if element.tag != "joint" {
        return Ok(());
    }
    for axis in element.children.iter_mut().filter(|c| matches!(&*c.tag, "axis" | "axis2")) {
        let in_model = flag(axis, FLAG, false)?;
        axis.children.retain(|c| c.tag != FLAG);
        if in_model {
            if axis.child("xyz").is_none() {
                let xyz = axis.with("xyz", "0 0 1");
                axis.children.push(xyz);
            }
            for xyz in axis.children.iter_mut().filter(|c| c.tag == "xyz") {
                xyz.attributes.retain(|(name, _)| name != "expressed_in");
                xyz.attributes.push(("expressed_in".to_owned(), MODEL.to_owned()));
            }
        }
    }
    Ok(())
}

impl Element {
    /// Returns a new element with a text. The new element has the line number of this element.
    pub(super) fn with(&self, tag: &str, text: &str) -> Self {
        Self {
            tag: tag.to_owned(),
            attributes: Vec::new(),
            text: text.to_owned(),
            children: Vec::new(),
            file: self.file.clone(),
            line: self.line,
            at: self.at,
            source: self.source,
            stray: None,
        }
    }
}
