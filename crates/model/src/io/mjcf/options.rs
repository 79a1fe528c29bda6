//! Settings of `<option>` that affect all bodies: gravity, and the medium around the bodies.

use super::attributes::Attributes;
use crate::error::Error;
use crate::io::xml::Element;
use crate::warning::Warning;
use condyle_spatial::Vec3;

/// Returns gravity (m/s²). A later `<option>` overrides an earlier one, and a gravity flag with the value `disable`
/// sets gravity to 0. Adds a warning if the file specifies a medium.
pub(super) fn gravity(root: &Element, warnings: &mut Vec<Warning>) -> Result<Vec3<f64>, Error> {
    let mut gravity = Vec3::new(0.0, 0.0, -9.81);
    let mut medium: [(&str, Option<(f64, &Element)>); 2] = [("density", None), ("viscosity", None)];
    let mut is_on = true;
    for option in root.all("option") {
        let a = Attributes::plain(option);
        gravity = a.vector("gravity")?.unwrap_or(gravity);
        for (name, value) in &mut medium {
            *value = a.number(name)?.map(|x| (x, option)).or(*value);
        }
        for flag in option.all("flag").filter_map(|flag| flag.attribute("gravity")) {
            is_on = flag != "disable";
        }
    }
    for (name, value) in medium {
        if let Some((value, option)) = value.filter(|(value, _)| *value != 0.0) {
            warnings.push(option.left_out(format!("{name} {value}: forces of the medium on bodies are left out")));
        }
    }
    Ok(if is_on { gravity } else { Vec3::zero() })
}
