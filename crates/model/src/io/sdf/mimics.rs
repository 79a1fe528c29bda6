//! The axes of an SDF that follow others.

use super::poses::optional;
use crate::builder::{BodyId, ModelBuilder};
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Mimic;
use crate::warning::Warning;
use std::collections::HashMap;

/// The bodies that move about or along each axis, by the joint's name and the axis's tag, and those that follow.
#[derive(Default)]
pub(super) struct Axes<'a> {
    bodies: HashMap<(&'a str, &'static str), BodyId>,
    /// The joint, its `<mimic>`, the body that follows.
    followers: Vec<(&'a Element, &'a Element, BodyId)>,
}

impl<'a> Axes<'a> {
    /// Remembers an axis of a joint.
    pub(super) fn add(&mut self, joint: &'a Element, tag: &'static str, body: BodyId) {
        self.bodies.insert((joint.attribute("name").unwrap_or_default(), tag), body);
        if let Some(mimic) = joint.child(tag).and_then(|axis| axis.child("mimic")) {
            self.followers.push((joint, mimic, body));
        }
    }

    /// Lets the followers follow, or says that they are free.
    pub(super) fn follow(&self, builder: &mut ModelBuilder, mimic: bool) -> Result<Vec<Warning>, Error> {
        if !mimic {
            let what = "a joint that follows another one is left free unless `mimic` is asked for";
            let free = |joint: &Element| joint.mimic(what);
            return Ok(self.followers.iter().map(|(joint, ..)| free(joint)).collect());
        }
        for &(joint, mimic, follower) in &self.followers {
            let (name, axis) = (mimic.attribute("joint").unwrap_or_default(), mimic.attribute("axis"));
            let tag = if axis == Some("axis2") { "axis2" } else { "axis" };
            let Some(&leader) = self.bodies.get(&(name, tag)) else {
                return Err(joint.wrong(format!("mimic: no joint with an <{tag}> that moves is named `{name}`")));
            };
            let number = |tag, otherwise| optional(joint, mimic, tag, otherwise);
            let (ratio, offset) = (number("multiplier", 1.0)?, number("offset", 0.0)?);
            // follower = multiplier (leader − reference) + offset
            let offset = offset - ratio * number("reference", 0.0)?;
            builder.mimic(follower, leader, Mimic { ratio, offset });
        }
        Ok(Vec::new())
    }
}
