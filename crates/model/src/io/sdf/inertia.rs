//! Inertias of the links of an SDF, given explicitly or computed from the shapes of a link.

use super::scopes::Scopes;
use super::values::{attribute, flag, number, pose, relative_to, three};
use crate::error::Error;
use crate::io::xml::Element;
use crate::warning::Warning;
use condyle_spatial::{Act, Inertia, Se3, Sym3, Vec3};
use core::f64::consts::PI;

/// Density of a shape for which no density is given (kg/m³).
const WATER: f64 = 1000.0;

/// Returns the inertia of a link, in the link's frame.
pub(super) fn inertia(scopes: &Scopes, item: usize, warnings: &mut Vec<Warning>) -> Result<Inertia<f64>, Error> {
    let link = scopes.items[item].element;
    let Some(inertial) = link.child("inertial") else {
        warnings.push(link.assumed("has no <inertial>: 1 kg and 1 kg m², as SDF has it"));
        return Ok(Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0)));
    };
    let is_auto = attribute(link, inertial, "auto")?;
    let mass = number(link, Some(inertial), "mass", f64::NAN)?;
    if !(mass.is_nan() || mass >= 0.0 && mass.is_finite()) {
        return Err(link.wrong(format!("mass is {mass} kg")));
    }
    if is_auto {
        return of_shapes(scopes, item, inertial, mass, warnings);
    }
    let mut assumed = |what: &str| warnings.push(link.assumed(format!("inertial: {what}, as SDF has it")));
    if mass.is_nan() {
        assumed("has no mass: 1 kg");
    }
    if inertial.child("density").is_some() {
        warnings.push(link.left_out("inertial: density is left out: it counts only with auto=\"true\""));
    }
    if let Some(frame) = relative_to(inertial) {
        warnings.push(link.left_out(format!("inertial: the pose is in the link's frame, not relative to `{frame}`")));
    }
    let moments = inertial.child("inertia");
    let read = |tag: &str, otherwise| number(link, moments, tag, otherwise);
    let missing = ["ixx", "iyy", "izz"].into_iter().filter(|tag| moments.is_none_or(|m| m.child(tag).is_none()));
    let missing: Vec<&str> = missing.collect();
    if !missing.is_empty() {
        warnings.push(link.assumed(format!("inertial: has no {}: 1 kg m², as SDF has it", missing.join(", "))));
    }
    let rotational = Sym3 {
        xx: read("ixx", 1.0)?,
        xy: read("ixy", 0.0)?,
        yy: read("iyy", 1.0)?,
        xz: read("ixz", 0.0)?,
        yz: read("iyz", 0.0)?,
        zz: read("izz", 1.0)?,
    };
    let mass = if mass.is_nan() { 1.0 } else { mass };
    Ok(pose(link, inertial)?.act(Inertia::from_com(mass, Vec3::zero(), rotational)))
}

/// Returns the sum of the inertias of a link's collision shapes. The sum is scaled to the mass `mass`, unless `mass` is
/// NaN.
fn of_shapes(
    scopes: &Scopes,
    item: usize,
    inertial: &Element,
    mass: f64,
    warnings: &mut Vec<Warning>,
) -> Result<Inertia<f64>, Error> {
    let (link, scope) = (scopes.items[item].element, scopes.items[item].scope);
    for tag in ["pose", "inertia"].into_iter().filter(|tag| inertial.child(tag).is_some()) {
        warnings.push(link.left_out(format!("inertial: {tag} is left out: auto=\"true\" computes it")));
    }
    let otherwise = number(link, Some(inertial), "density", WATER)?;
    let mut sum = Inertia::zero();
    for collision in link.all("collision") {
        let density = number(collision, Some(collision), "density", otherwise)?;
        if !(density > 0.0 && density.is_finite()) {
            return Err(collision.wrong(format!("density is {density} kg/m³")));
        }
        if mass.is_nan() && collision.child("density").is_none() && inertial.child("density").is_none() {
            warnings.push(collision.assumed(format!("has no density: {WATER} kg/m³, as SDF has it")));
        }
        let lXr = match relative_to(collision) {
            None => Se3::identity(),
            Some(name) => {
                let at = scopes.find(item, name);
                let at = at.ok_or_else(|| collision.wrong(format!("no link, joint or frame is named `{name}`")))?;
                scopes.in_scope(Some(item), scope).inverse() * scopes.in_scope(at, scope)
            }
        };
        sum += (lXr * pose(collision, collision)?).act(shape(collision)?.scale(density));
    }
    if link.child("collision").is_none() {
        return Err(link.wrong("inertial: auto=\"true\" needs a collision, and there is none"));
    }
    Ok(if mass.is_nan() { sum } else { sum.scale(mass / sum.mass) })
}

/// Returns the inertia of the shape of a collision, for a density of 1, in the shape's frame.
fn shape(collision: &Element) -> Result<Inertia<f64>, Error> {
    let found = collision.child("geometry").and_then(|g| g.children.first());
    let found = found.ok_or_else(|| collision.wrong("has no geometry"))?;
    let length = |tag: &str| {
        let x = number(collision, Some(found), tag, f64::NAN)?;
        let valid = x > 0.0 && x.is_finite();
        if valid { Ok(x) } else { Err(collision.wrong(format!("{}: expected a {tag} above 0", found.tag))) }
    };
    let lengths = |tag: &str| {
        let e = found.child(tag).ok_or_else(|| collision.wrong(format!("{}: has no {tag}", found.tag)))?;
        let v = three(collision, e)?;
        let valid = v.to_array().iter().all(|x| *x > 0.0);
        if valid { Ok(v) } else { Err(collision.wrong_inside(e, format!("{}: expected a {tag} above 0", found.tag))) }
    };
    let solid = |m: f64, z: f64, xx: f64, yy: f64, zz: f64| {
        let moments = Sym3 { xx: m * xx, yy: m * yy, zz: m * zz, ..Sym3::zero() };
        Inertia::from_com(m, Vec3::new(0.0, 0.0, z), moments)
    };
    Ok(match &*found.tag {
        "box" => {
            let s = lengths("size")?;
            let (x, y, z) = (s.x * s.x / 12.0, s.y * s.y / 12.0, s.z * s.z / 12.0);
            solid(s.x * s.y * s.z, 0.0, y + z, x + z, x + y)
        }
        "sphere" => {
            let r = length("radius")?;
            let moment = 0.4 * r * r;
            solid(4.0 / 3.0 * PI * r * r * r, 0.0, moment, moment, moment)
        }
        "ellipsoid" => {
            let r = lengths("radii")?;
            let (x, y, z) = (0.2 * r.x * r.x, 0.2 * r.y * r.y, 0.2 * r.z * r.z);
            solid(4.0 / 3.0 * PI * r.x * r.y * r.z, 0.0, y + z, x + z, x + y)
        }
        "cylinder" => {
            let (r, l) = (length("radius")?, length("length")?);
            let across = r * r / 4.0 + l * l / 12.0;
            solid(PI * r * r * l, 0.0, across, across, r * r / 2.0)
        }
        "cone" => {
            // The base is at −l/2, and the centre of mass is a quarter of the height above the base.
            let (r, l) = (length("radius")?, length("length")?);
            let across = 3.0 / 80.0 * (4.0 * r * r + l * l);
            solid(PI * r * r * l / 3.0, -l / 4.0, across, across, 0.3 * r * r)
        }
        "capsule" => {
            let (r, l) = (length("radius")?, length("length")?);
            let (rod, ball) = (PI * r * r * l, 4.0 / 3.0 * PI * r * r * r);
            // The centres of mass of the half balls are 3 r/8 beyond the ends of the rod.
            let across = rod * (r * r / 4.0 + l * l / 12.0) + ball * (0.4 * r * r + l * l / 4.0 + 0.375 * l * r);
            let along = rod * r * r / 2.0 + ball * 0.4 * r * r;
            let m = rod + ball;
            solid(m, 0.0, across / m, across / m, along / m)
        }
        other => {
            let what = format!("inertial: auto=\"true\" is not supported for the shape <{other}>");
            return Err(collision.wrong(what));
        }
    })
}

/// Checks the flags of a model or link. Adds warnings about flags that change how the model or link moves.
pub(super) fn flags(element: &Element, warnings: &mut Vec<Warning>) -> Result<(), Error> {
    for tag in ["static", "self_collide", "allow_auto_disable", "gravity", "must_be_base_link"] {
        flag(element, tag, false)?;
    }
    if flag(element, "enable_wind", false)? {
        warnings.push(element.left_out("enable_wind is left out: no wind acts on it"));
    }
    if flag(element, "kinematic", false)? {
        warnings.push(element.left_out("kinematic is left out: forces move it as they move any other link"));
    }
    let decay = element.child("velocity_decay");
    for tag in ["linear", "angular"] {
        let text = decay.and_then(|decay| decay.child(tag)).map_or("", |e| e.text.trim());
        if !text.is_empty() && text.parse() != Ok(0.0) {
            let what = format!("velocity_decay: {tag} {text} is left out: its velocity does not decay");
            warnings.push(element.left_out(what));
        }
    }
    Ok(())
}
