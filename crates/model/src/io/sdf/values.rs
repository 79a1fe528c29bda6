//! Values in the elements of an SDF: booleans, numbers, vectors and poses.

use crate::error::Error;
use crate::io::from_rpy;
use crate::io::xml::{self, Element};
use condyle_spatial::{Quaternion, Se3, Vec3};

/// Parses a boolean of the format: `true`, `false`, `1` or `0`, in upper or lower case.
pub(super) fn truth(text: &str) -> Result<bool, String> {
    match text.trim() {
        "1" => Ok(true),
        "0" => Ok(false),
        t if t.eq_ignore_ascii_case("true") => Ok(true),
        t if t.eq_ignore_ascii_case("false") => Ok(false),
        t => Err(format!("expected true or false, found `{t}`")),
    }
}

/// Returns the boolean in a child element, or `otherwise` if the child is missing or empty.
pub(super) fn flag(of: &Element, tag: &str, otherwise: bool) -> Result<bool, Error> {
    match of.child(tag).filter(|e| !e.text.trim().is_empty()) {
        Some(e) => truth(&e.text).map_err(|what| of.wrong_inside(e, format!("{tag}: {what}"))),
        None => Ok(otherwise),
    }
}

/// Returns the boolean of an attribute, or `false` if the attribute is missing.
pub(super) fn attribute(of: &Element, inside: &Element, name: &str) -> Result<bool, Error> {
    match inside.attribute(name) {
        Some(text) => truth(text).map_err(|what| of.wrong_inside(inside, format!("{}: {name}: {what}", inside.tag))),
        None => Ok(false),
    }
}

/// Returns the name in a child element; `None` if the child is missing or empty.
pub(super) fn text<'a>(of: &'a Element, tag: &str) -> Option<&'a str> {
    of.child(tag).map(|e| e.text.trim()).filter(|t| !t.is_empty())
}

/// Reads the `<pose>` in an element: x y z, then roll pitch yaw or a quaternion x y z w. Returns the identity if there
/// is no `<pose>`. Error messages name the element `of`.
pub(super) fn pose(of: &Element, inside: &Element) -> Result<Se3<f64>, Error> {
    let Some(pose) = inside.child("pose") else { return Ok(Se3::identity()) };
    let wrong = |what: String| of.wrong_inside(pose, format!("pose: {what}"));
    let degrees = attribute(of, pose, "degrees")?;
    let quaternion = match pose.attribute("rotation_format").unwrap_or_default() {
        "" | "euler_rpy" => false,
        "quat_xyzw" if degrees => return Err(wrong("a quaternion is not in degrees".to_owned())),
        "quat_xyzw" => true,
        other => {
            return Err(wrong(format!("rotation_format `{other}` is unknown; known are euler_rpy and quat_xyzw")));
        }
    };
    if pose.text.trim().is_empty() {
        return Ok(Se3::identity());
    }
    if quaternion {
        let [x, y, z, qx, qy, qz, qw] = xml::array(&pose.text).map_err(wrong)?;
        let norm = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
        if !(norm.is_finite() && norm > 1e-14) {
            return Err(wrong("the quaternion has no direction".to_owned()));
        }
        let R = Quaternion::new(qx / norm, qy / norm, qz / norm, qw / norm).to_rotation();
        return Ok(Se3::new(R, Vec3::new(x, y, z)));
    }
    let [x, y, z, roll, pitch, yaw] = xml::array(&pose.text).map_err(wrong)?;
    let rotation = from_rpy([roll, pitch, yaw].map(|a| if degrees { a.to_radians() } else { a }));
    Ok(Se3::new(rotation, Vec3::new(x, y, z)))
}

/// Returns the name of the frame to which the pose of an element is relative; `None` if the pose names no frame.
pub(super) fn relative_to(of: &Element) -> Option<&str> {
    of.child("pose")?.attribute("relative_to").map(str::trim).filter(|n| !n.is_empty())
}

/// Reads the three numbers in an element. Error messages name the element `of`.
pub(super) fn three(of: &Element, element: &Element) -> Result<Vec3<f64>, Error> {
    Ok(Vec3::from(
        xml::array::<3>(&element.text).map_err(|what| of.wrong_inside(element, format!("{}: {what}", element.tag)))?,
    ))
}

/// Returns the number in a child element, which may be infinite, or `otherwise` if the child is missing or empty. Error
/// messages name the element `of`.
pub(super) fn number(of: &Element, inside: Option<&Element>, tag: &str, otherwise: f64) -> Result<f64, Error> {
    let child = inside.and_then(|e| e.child(tag)).filter(|e| !e.text.trim().is_empty());
    let Some(e) = child else { return Ok(otherwise) };
    xml::bound(&e.text).map_err(|what| of.wrong_inside(e, format!("{tag}: {what}")))
}
