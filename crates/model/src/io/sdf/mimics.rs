//! Axes of an SDF that follow other axes.

use super::scopes::Scopes;
use super::values::number;
use crate::builder::{BodyId, ModelBuilder};
use crate::error::Error;
use crate::io::xml::{Element, bound};
use crate::joint::Mimic;
use crate::warning::Warning;
use std::collections::HashMap;

/// Bodies that move about or along axes, by joint and tag of the axis, and the followers among these bodies.
#[derive(Default)]
pub(super) struct Axes<'a> {
    bodies: HashMap<(usize, &'static str), BodyId>,
    /// For each follower, its joint, its `<mimic>` element, and its body.
    followers: Vec<(usize, &'a Element, BodyId)>,
}

/// Tag of Drake's element for a joint that follows another one.
const DRAKE: &str = "drake:mimic";

impl<'a> Axes<'a> {
    /// Adds the axis of a joint, and the body that moves about or along it.
    pub(super) fn add(&mut self, item: usize, joint: &'a Element, tag: &'static str, body: BodyId) {
        self.bodies.insert((item, tag), body);
        let mimic = joint.child(tag).and_then(|axis| axis.child("mimic")).or_else(|| joint.child(DRAKE));
        self.followers.extend(mimic.map(|mimic| (item, mimic, body)));
    }

    /// Returns the body that moves about or along an axis of a joint.
    pub(super) fn body(&self, item: usize, tag: &'static str) -> Option<BodyId> {
        self.bodies.get(&(item, tag)).copied()
    }

    /// Couples the followers to their leaders, or adds warnings that the followers move freely.
    pub(super) fn follow(
        &self,
        scopes: &Scopes,
        builder: &mut ModelBuilder,
        mimic: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), Error> {
        if !mimic {
            for &(item, mimic, _) in &self.followers {
                let leader = mimic.attribute("joint").unwrap_or_default();
                let what = match scopes.joint(item, leader) {
                    Some(_) => "a joint that follows another one is left free unless `mimic` is asked for".to_owned(),
                    None => format!("has a <mimic>, but {}: it is free", scopes.no_joint(item, leader)),
                };
                warnings.push(scopes.items[item].element.mimic(what));
            }
            return Ok(());
        }
        builder.check_size()?; // must precede the traversal of chains of followers
        let mut rules: HashMap<usize, (BodyId, Mimic)> = HashMap::new();
        for &(item, mimic, follower) in &self.followers {
            let joint = scopes.items[item].element;
            let (name, axis) = (mimic.attribute("joint").unwrap_or_default(), mimic.attribute("axis"));
            let tag = if axis == Some("axis2") { "axis2" } else { "axis" };
            let leader = scopes.joint(item, name).and_then(|leader| self.body(leader, tag));
            let Some(leader) = leader else {
                let why = match scopes.joint(item, name) {
                    Some(_) => format!("joint `{name}` has no <{tag}> that moves"),
                    None => scopes.no_joint(item, name),
                };
                return Err(joint.wrong(format!("mimic: {why}")));
            };
            let read = |tag, otherwise| match mimic.attribute(tag).filter(|_| mimic.tag == DRAKE) {
                Some(text) => bound(text).map_err(|what| joint.wrong_inside(mimic, format!("{tag}: {what}"))),
                None => number(joint, Some(mimic), tag, otherwise),
            };
            let (ratio, offset) = (read("multiplier", 1.0)?, read("offset", 0.0)?);
            // SDF defines: follower = multiplier · (leader − reference) + offset
            let offset = offset - ratio * read("reference", 0.0)?;
            rules.insert(follower.0, (leader, Mimic { ratio, offset }));
        }
        for &(item, _, follower) in &self.followers {
            let (mut leader, mut rule) = rules[&follower.0];
            let mut left = rules.len();
            while let Some(&(next, Mimic { ratio, offset })) = rules.get(&leader.0) {
                // composition: r (r₂ q + o₂) + o
                rule = Mimic { ratio: rule.ratio * ratio, offset: rule.ratio * offset + rule.offset };
                leader = next;
                left -= 1;
                if left == 0 {
                    return Err(scopes.items[item].element.wrong("mimic: follows itself, through others"));
                }
            }
            builder.mimic(follower, leader, rule);
        }
        Ok(())
    }
}
