//! Equality constraints: of two joints, one may follow the other; the others have no part in a tree.

use super::attributes::Attributes;
use crate::builder::{BodyId, ModelBuilder};
use crate::error::Error;
use crate::io::xml::{Element, words};
use crate::joint::Mimic;
use crate::warning::Warning;
use std::collections::{HashMap, HashSet};

/// The body that a joint carries, and the joint's position in the file's pose (`ref`).
pub(super) type Joints = HashMap<String, (BodyId, f64)>;

/// Lets joints follow others, if asked to, and says what is left out.
pub(super) fn add(
    builder: &mut ModelBuilder,
    root: &Element,
    joints: &Joints,
    mimic: bool,
) -> Result<Vec<Warning>, Error> {
    let (mut warnings, mut followers) = (Vec::new(), HashSet::new());
    for section in root.children.iter().filter(|c| matches!(&*c.tag, "equality" | "tendon" | "deformable")) {
        for element in &section.children {
            let a = Attributes::plain(element);
            let mut warn = |what: String| warnings.push(element.left_out(what));
            if section.tag != "equality" || element.tag != "joint" {
                warn(format!("<{}> has no part in a tree of bodies", section.tag));
                continue;
            }
            if a.flag("active", None)? == Some(false) {
                continue;
            }
            let joint = |name: &str| match a.get(name) {
                None => Ok(None),
                Some(joint) => match joints.get(joint) {
                    Some(&found) => Ok(Some((joint, found))),
                    None => Err(element.wrong(format!("{name}: no joint is named `{joint}`"))),
                },
            };
            let (follower, leader) = (joint("joint1")?, joint("joint2")?);
            let Some((name, (follower, y0))) = follower else { return Err(element.wrong("has no joint1")) };
            let mut coefficients = a.list("polycoef")?.unwrap_or_else(|| vec![0.0, 1.0]);
            coefficients.resize(5, 0.0);
            match (leader, &coefficients[..]) {
                _ if !mimic => warnings
                    .push(element.mimic("a joint that follows another one is left free unless `mimic` is asked for")),
                (Some((_, (leader, x0))), &[a0, a1, 0.0, 0.0, 0.0]) if followers.insert(name) => {
                    // y − y₀ = a₀ + a₁ (x − x₀)
                    builder.mimic(follower, leader, Mimic { ratio: a1, offset: y0 + a0 - a1 * x0 });
                }
                (Some(_), &[_, _, 0.0, 0.0, 0.0]) => warn(format!("`{name}` follows another joint already")),
                (Some(_), _) => warn(format!("polycoef {} is not linear", words(&coefficients))),
                (None, _) => warn(format!("holds `{name}` where it is: <equality> has no part in a tree of bodies")),
            }
        }
    }
    Ok(warnings)
}
