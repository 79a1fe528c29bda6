//! The poses of links, joints and frames of an SDF, and the frames in which axes are given.

use super::WORLD_LINK;
use crate::error::Error;
use crate::io::from_rpy;
use crate::io::xml::{self, Element};
use crate::names::{near, nearest};
use condyle_spatial::{Quaternion, Se3, Vec3};
use std::collections::HashMap;

/// The frame of the model itself.
const MODEL: &str = "__model__";

/// The poses of everything that has a name.
pub(super) struct Poses<'a> {
    elements: HashMap<&'a str, &'a Element>,
    mXe: HashMap<&'a str, Se3<f64>>,
    /// The links to which frames and joints are attached, as far as they have been asked for; none is the model itself.
    attached: HashMap<&'a str, Option<&'a str>>,
}

impl<'a> Poses<'a> {
    pub(super) fn new(model: &'a Element) -> Result<Self, Error> {
        let mut poses = Self { elements: HashMap::new(), mXe: HashMap::new(), attached: HashMap::new() };
        let named = |e: &&Element| matches!(&*e.tag, "link" | "joint" | "frame");
        for element in model.children.iter().filter(named) {
            let name =
                element.attribute("name").filter(|n| !n.is_empty()).ok_or_else(|| element.wrong("has no name"))?;
            if [WORLD_LINK, MODEL].contains(&name) {
                return Err(element.wrong("the name belongs to SDF"));
            }
            if let Some(other) = poses.elements.insert(name, element) {
                // SDF 1.6 and before let a link and a joint share a name; then only the link can be referred to
                if other.tag == element.tag {
                    let what = format!("the name is taken by the {} on line {}", other.tag, other.line);
                    return Err(element.wrong(what));
                }
                let link = if other.tag == "link" { other } else { element };
                poses.elements.insert(name, link);
            }
        }
        for element in model.children.iter().filter(named) {
            poses.resolve(element)?;
        }
        Ok(poses)
    }

    /// Finds the pose of an element and of all that it hangs on.
    fn resolve(&mut self, element: &'a Element) -> Result<(), Error> {
        let mut path: Vec<(&'a str, &'a Element)> = Vec::new();
        let mut name = element.attribute("name").unwrap_or_default();
        let mut mXe = loop {
            if name == MODEL || name == WORLD_LINK {
                break Se3::identity();
            }
            if let Some(&known) = self.mXe.get(name) {
                break known;
            }
            let e = *self.elements.get(name).ok_or_else(|| {
                let at = path.last().map_or(element, |p| p.1);
                at.wrong(format!("no link, joint or frame is named `{name}`{}", self.near(name, "")))
            })?;
            if path.len() == self.elements.len() {
                return Err(e.wrong("its pose depends on itself"));
            }
            path.push((name, e));
            name = reference(e);
        };
        for (name, e) in path.into_iter().rev() {
            mXe = mXe * pose(e, e)?;
            self.mXe.insert(name, mXe);
        }
        Ok(())
    }

    fn near(&self, name: &str, tag: &str) -> String {
        let mut names: Vec<&str> =
            self.elements.iter().filter(|(_, e)| tag.is_empty() || e.tag == tag).map(|(n, _)| *n).collect();
        names.sort_unstable();
        near(&nearest(name, names.into_iter()))
    }

    /// The pose in the model's frame.
    pub(super) fn of(&self, name: &str) -> Result<Se3<f64>, Error> {
        Ok(self.mXe.get(name).copied().unwrap_or(Se3::identity()))
    }

    /// The pose of the model in the world.
    pub(super) fn of_model(&self, model: &Element) -> Result<Se3<f64>, Error> {
        match model.child("pose").and_then(relative_to) {
            Some(name) if name != WORLD_LINK => {
                Err(model.wrong(format!("a pose relative to `{name}` is not supported")))
            }
            _ => pose(model, model),
        }
    }

    /// cXj: the pose of a joint in its child link, exactly what the file says where it says that.
    pub(super) fn joint_in_child(&self, joint: &Element, child: &str) -> Result<Se3<f64>, Error> {
        let X = pose(joint, joint)?;
        match reference(joint) {
            name if name == child => Ok(X),
            name => Ok(self.of(child)?.inverse() * self.of(name)? * X),
        }
    }

    /// The link that a joint's parent or child names, perhaps through frames.
    pub(super) fn link(&mut self, joint: &Element, name: &'a str) -> Result<&'a str, Error> {
        let link = match self.elements.get(name) {
            Some(e) if e.tag == "link" => Some(name),
            Some(e) if e.tag == "frame" => self.attached(e, name)?,
            _ => None,
        };
        link.ok_or_else(|| joint.wrong(format!("no link is named `{name}`{}", self.near(name, "link"))))
    }

    /// The link that a frame is attached to; none is the model itself.
    pub(super) fn attached(&mut self, frame: &Element, name: &'a str) -> Result<Option<&'a str>, Error> {
        let (mut at, mut path) = (name, Vec::new());
        let link = loop {
            let e = match (self.attached.get(at), self.elements.get(at)) {
                _ if at == MODEL || at == WORLD_LINK => break None,
                (Some(&known), _) => break known,
                (None, Some(e)) => *e,
                (None, None) => {
                    let near = self.near(at, "");
                    return Err(frame.wrong(format!("attached to `{at}`, which is not there{near}")));
                }
            };
            if path.len() == self.elements.len() {
                return Err(frame.wrong("is attached to itself"));
            }
            path.push(at);
            at = match &*e.tag {
                "link" => break Some(at),
                "joint" => e.child("child").map_or("", |c| c.text.trim()),
                _ => e.attribute("attached_to").filter(|a| !a.is_empty()).unwrap_or(MODEL),
            };
        };
        self.attached.extend(path.into_iter().map(|name| (name, link)));
        Ok(link)
    }

    /// A joint's axis, in the joint's frame.
    pub(super) fn axis(&self, joint: &Element, tag: &str) -> Result<Vec3<f64>, Error> {
        let axis = joint.child(tag).ok_or_else(|| joint.wrong(format!("has no <{tag}>")))?;
        let Some(xyz) = axis.child("xyz") else { return Ok(Vec3::new(0.0, 0.0, 1.0)) };
        let v = three(joint, xyz)?;
        let model = axis.child("use_parent_model_frame").is_some_and(|u| matches!(u.text.trim(), "1" | "true"));
        let frame = xyz.attribute("expressed_in").filter(|f| !f.is_empty()).or(model.then_some(MODEL));
        let Some(frame) = frame else { return Ok(v) };
        if !self.elements.contains_key(frame) && ![MODEL, WORLD_LINK].contains(&frame) {
            let near = self.near(frame, "");
            return Err(joint.wrong(format!("{tag}: expressed in `{frame}`, which is not there{near}")));
        }
        let mXj = self.of(reference(joint))?.rotation * pose(joint, joint)?.rotation;
        Ok(mXj.transpose_mul(self.of(frame)?.rotation * v))
    }
}

/// The frame to which a pose says that it is relative; SDF 1.6 wrote it `frame`.
fn relative_to(pose: &Element) -> Option<&str> {
    pose.attribute("relative_to").or_else(|| pose.attribute("frame")).filter(|n| !n.is_empty())
}

/// The name of what an element's pose is relative to.
fn reference(e: &Element) -> &str {
    let otherwise = match &*e.tag {
        "joint" => e.child("child").map_or(MODEL, |c| c.text.trim()),
        "frame" => e.attribute("attached_to").filter(|a| !a.is_empty()).unwrap_or(MODEL),
        _ => MODEL,
    };
    e.child("pose").and_then(relative_to).unwrap_or(otherwise)
}

/// The `<pose>` inside something, or none: x y z, then roll pitch yaw or a quaternion x y z w. Errors name `of`.
pub(super) fn pose(of: &Element, inside: &Element) -> Result<Se3<f64>, Error> {
    let Some(pose) = inside.child("pose").filter(|p| !p.text.trim().is_empty()) else { return Ok(Se3::identity()) };
    let wrong = |what: String| of.wrong_inside(pose, format!("pose: {what}"));
    if pose.attribute("rotation_format") == Some("quat_xyzw") {
        let [x, y, z, qx, qy, qz, qw] = xml::array(&pose.text).map_err(wrong)?;
        let norm = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
        if !(norm.is_finite() && norm > 1e-14) {
            return Err(wrong("the quaternion has no direction".to_owned()));
        }
        let R = Quaternion::new(qx / norm, qy / norm, qz / norm, qw / norm).to_rotation();
        return Ok(Se3::new(R, Vec3::new(x, y, z)));
    }
    let [x, y, z, roll, pitch, yaw] = xml::array(&pose.text).map_err(wrong)?;
    let degrees = pose.attribute("degrees").is_some_and(|d| matches!(d, "true" | "1"));
    let rotation = from_rpy([roll, pitch, yaw].map(|a| if degrees { a.to_radians() } else { a }));
    Ok(Se3::new(rotation, Vec3::new(x, y, z)))
}

/// The three numbers in an element. Errors name `of`.
pub(super) fn three(of: &Element, element: &Element) -> Result<Vec3<f64>, Error> {
    Ok(Vec3::from(
        xml::array::<3>(&element.text).map_err(|what| of.wrong_inside(element, format!("{}: {what}", element.tag)))?,
    ))
}

/// The number in a child, which may be infinite; `otherwise` if there is no child. Errors name `of`.
pub(super) fn optional(of: &Element, inside: &Element, tag: &str, otherwise: f64) -> Result<f64, Error> {
    let Some(e) = inside.child(tag) else { return Ok(otherwise) };
    xml::bound(&e.text).map_err(|what| of.wrong_inside(e, format!("{tag}: {what}")))
}
