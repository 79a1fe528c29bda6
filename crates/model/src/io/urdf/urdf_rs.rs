//! Conversion of robots that urdf-rs has read. Such a robot is converted to XML elements, and the URDF reader of this
//! crate reads these elements.

use super::UrdfOptions;
use super::reader::Reader;
use crate::error::Error;
use crate::io::xml::Element;
use crate::model::Model;
use ::urdf_rs::{Inertial, Joint, JointType, Link, Pose, Robot};
use std::rc::Rc;

impl Model {
    /// Converts a robot that urdf-rs has read. The result is the same model as [`from_urdf`](Self::from_urdf) reads
    /// from the same file, except for information that `urdf_rs::Robot` lacks:
    ///
    /// - In `urdf_rs::Robot`, a missing limit is stored as zeros. For a continuous joint, zeros are treated as no
    ///   limit. For a revolute or prismatic joint, zeros are kept as limits and cause a warning.
    /// - A planar joint without an axis has the axis 1 0 0, without a warning about this default.
    /// - `urdf_rs::Robot` lacks versions and quaternions (`quat_xyzw`), limits of acceleration and jerk, transmissions,
    ///   frames and joints of Drake, and unknown or unsupported names. So these features have no effect and cause no
    ///   warning.
    ///
    /// Needs the feature `urdf-rs`.
    ///
    /// ```
    /// # use condyle_model::{Model, UrdfOptions, robots};
    /// let robot = urdf_rs::read_from_string(robots::ARM7)?;
    /// assert_eq!(Model::from_urdf_robot(&robot, &UrdfOptions::default())?, robots::arm7());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`from_urdf`](Self::from_urdf). In a message, the file is `<urdf-rs>`, and the line number
    /// is the index of the link or joint, counted from 1.
    pub fn from_urdf_robot(robot: &Robot, options: &UrdfOptions) -> Result<Self, Error> {
        let file: Rc<str> = "<urdf-rs>".into();
        let links = robot.links.iter().map(link);
        let joints = robot.joints.iter().map(joint);
        let mut root = element("robot", &[("name", &robot.name)], Vec::new());
        root.children = numbered(links).chain(numbered(joints)).collect();
        set_file(&mut root, &file);
        Reader::new(&root)?.model(options)
    }
}

/// Sets the line number of each element to the element's index, counted from 1.
fn numbered(elements: impl Iterator<Item = Element>) -> impl Iterator<Item = Element> {
    (1..).zip(elements).map(|(line, element)| with_line(element, line))
}

fn with_line(mut element: Element, line: u32) -> Element {
    element.line = line;
    element.children = element.children.into_iter().map(|child| with_line(child, line)).collect();
    element
}

fn set_file(element: &mut Element, file: &Rc<str>) {
    element.file = file.clone();
    element.children.iter_mut().for_each(|child| set_file(child, file));
}

fn element(tag: &str, attributes: &[(&str, &str)], children: Vec<Element>) -> Element {
    let attributes = attributes.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    Element {
        tag: tag.to_owned(),
        attributes,
        text: String::new(),
        children,
        file: "".into(),
        line: 1,
        at: 0,
        source: 0,
        stray: None,
    }
}

/// Returns an element whose attributes are lists of numbers. Each number is written with enough digits to read the same
/// number again.
fn numbers(tag: &str, attributes: &[(&str, &[f64])]) -> Element {
    let mut element = element(tag, &[], Vec::new());
    let words = |x: &[f64]| x.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    element.attributes = attributes.iter().map(|(name, x)| ((*name).to_owned(), words(x))).collect();
    element
}

fn origin(pose: &Pose) -> Element {
    numbers("origin", &[("xyz", &pose.xyz[..]), ("rpy", &pose.rpy[..])])
}

fn link(link: &Link) -> Element {
    let Inertial { origin: pose, mass, inertia: i } = &link.inertial;
    let inertia = [("ixx", i.ixx), ("ixy", i.ixy), ("ixz", i.ixz), ("iyy", i.iyy), ("iyz", i.iyz), ("izz", i.izz)];
    let inertia = element_of_numbers("inertia", &inertia);
    let inertial =
        element("inertial", &[], vec![origin(pose), element_of_numbers("mass", &[("value", mass.value)]), inertia]);
    element("link", &[("name", &link.name)], vec![inertial])
}

/// Returns an element whose attributes each contain one number; see [`numbers`].
fn element_of_numbers(tag: &str, attributes: &[(&str, f64)]) -> Element {
    let attributes: Vec<(&str, &[f64])> = attributes.iter().map(|(name, x)| (*name, std::slice::from_ref(x))).collect();
    numbers(tag, &attributes)
}

fn joint(joint: &Joint) -> Element {
    let kind = match joint.joint_type {
        JointType::Revolute => "revolute",
        JointType::Continuous => "continuous",
        JointType::Prismatic => "prismatic",
        JointType::Fixed => "fixed",
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    };
    let mut children = vec![
        origin(&joint.origin),
        element("parent", &[("link", &joint.parent.link)], Vec::new()),
        element("child", &[("link", &joint.child.link)], Vec::new()),
        numbers("axis", &[("xyz", &joint.axis.xyz[..])]),
    ];
    let limit = &joint.limit;
    let mut limits =
        vec![("lower", limit.lower), ("upper", limit.upper), ("effort", limit.effort), ("velocity", limit.velocity)];
    if joint.joint_type == JointType::Continuous {
        limits.retain(|(_, x)| *x != 0.0);
    }
    children.push(element_of_numbers("limit", &limits));
    if let Some(dynamics) = &joint.dynamics {
        let dynamics = [("damping", dynamics.damping), ("friction", dynamics.friction)];
        children.push(element_of_numbers("dynamics", &dynamics));
    }
    if let Some(mimic) = &joint.mimic {
        let numbers = [("multiplier", mimic.multiplier), ("offset", mimic.offset)];
        let numbers: Vec<_> = numbers.into_iter().filter_map(|(name, x)| Some((name, x?))).collect();
        let mut element = element_of_numbers("mimic", &numbers);
        element.attributes.push(("joint".to_owned(), mimic.joint.clone()));
        children.push(element);
    }
    element("joint", &[("name", &joint.name), ("type", kind)], children)
}
