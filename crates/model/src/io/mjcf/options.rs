//! The settings of `<option>`: gravity, and effects that are switched off.

use super::attributes::Attributes;
use crate::error::Error;
use crate::io::xml::{Element, words};
use crate::warning::Warning;
use condyle_spatial::Vec3;

/// The settings of all `<option>` elements; later ones go before earlier ones.
pub(super) struct Options {
    /// m/s².
    pub(super) gravity: Vec3<f64>,
    /// Whether dampers, friction of joints and limits act.
    pub(super) damper: bool,
    pub(super) friction: bool,
    pub(super) limit: bool,
}

/// Flags with an effect on what a model has.
const FLAGS: [&str; 8] =
    ["constraint", "frictionloss", "limit", "passive", "damper", "gravity", "clampctrl", "actuation"];

impl Options {
    pub(super) fn read(root: &Element, warnings: &mut Vec<Warning>) -> Result<Self, Error> {
        let mut gravity = Vec3::new(0.0, 0.0, -9.81);
        let mut medium: [(&str, Option<(f64, &Element)>); 2] = [("density", None), ("viscosity", None)];
        let mut flags = [(true, root); FLAGS.len()];
        let mut groups = None;
        for option in root.all("option") {
            let a = Attributes::plain(option);
            gravity = a.vector("gravity")?.unwrap_or(gravity);
            for (name, value) in &mut medium {
                *value = a.number(name)?.map(|x| (x, option)).or(*value);
            }
            groups = a.list("actuatorgroupdisable")?.filter(|g| !g.is_empty()).map(|g| (g, option)).or(groups);
            for element in option.all("flag") {
                for (name, flag) in FLAGS.iter().zip(&mut flags) {
                    *flag = match element.attribute(name) {
                        None => *flag,
                        Some("enable") => (true, element),
                        Some("disable") => (false, element),
                        Some(other) => {
                            return Err(element.wrong(format!("{name}: `{other}` is neither enable nor disable")));
                        }
                    };
                }
            }
        }
        for (name, value) in medium {
            if let Some((value, option)) = value.filter(|(value, _)| *value != 0.0) {
                let what = format!("{name} {value}: forces of the medium on bodies are left out");
                warnings.push(option.left_out(what));
            }
        }
        if let Some((groups, option)) = groups {
            let what = format!("actuatorgroupdisable: actuators of the groups {} act nevertheless", words(&groups));
            warnings.push(option.left_out(what));
        }
        let [constraint, friction, limit, passive, damper, weight, clamp, actuation] = flags;
        for (flag, what) in [
            (clamp, "clampctrl: limits of controls are kept, though MuJoCo does not clamp controls here"),
            (actuation, "actuation: actuators keep their limits, though MuJoCo switches them off here"),
        ] {
            if !flag.0 {
                warnings.push(flag.1.left_out(what));
            }
        }
        Ok(Self {
            gravity: if weight.0 { gravity } else { Vec3::zero() },
            damper: damper.0 && passive.0,
            friction: friction.0 && constraint.0,
            limit: limit.0 && constraint.0,
        })
    }
}
