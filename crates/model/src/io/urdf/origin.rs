//! Placements in a URDF: `<origin>`, which may have a quaternion since version 1.1.

use super::elements::{array, vector};
use crate::error::Error;
use crate::io::from_rpy;
use crate::io::xml::Element;
use condyle_spatial::{Mat3, Quaternion, Se3, Vec3};

/// Allowed difference between the length of a quaternion and 1. With this tolerance, three digits, such as 0.707 for
/// √½, are enough.
const UNIT_ROUNDING: f64 = 1e-3;

/// Rules for the placements of a robot, which depend on the version of the URDF.
#[derive(Clone, Copy)]
pub(super) struct Origins {
    /// Whether `quat_xyzw` is allowed: only in versions 1.1 and 1.2, not in version 1.0.
    quaternions: bool,
}

impl Origins {
    /// Returns the rules for the version of a robot. A robot without a version has version 1.0.
    pub(super) fn of(robot: &Element) -> Result<Self, Error> {
        match robot.attribute("version").unwrap_or("1.0") {
            "1.0" => Ok(Self { quaternions: false }),
            "1.1" | "1.2" => Ok(Self { quaternions: true }),
            other => Err(robot.wrong(format!("version `{other}` is none of 1.0, 1.1, 1.2"))),
        }
    }

    /// Returns the pose of the `<origin>` in an element, or the identity if the `<origin>` is missing. Error messages
    /// name the element `of`.
    pub(super) fn pose(self, of: &Element, inside: &Element) -> Result<Se3<f64>, Error> {
        inside.child("origin").map_or(Ok(Se3::identity()), |origin| self.pose_of(of, origin))
    }

    /// Returns the placement that the attributes of an element specify. Error messages name the element `of`.
    pub(super) fn pose_of(self, of: &Element, origin: &Element) -> Result<Se3<f64>, Error> {
        let rotation = match (array(of, origin, "rpy")?, array(of, origin, "quat_xyzw")?) {
            (Some(_), Some(_)) => return Err(of.wrong_inside(origin, "origin has both rpy and quat_xyzw")),
            (_, Some(_)) if !self.quaternions => {
                let what = "origin has quat_xyzw, which version 1.0 does not know: expected <robot version=\"1.1\">";
                return Err(of.wrong_inside(origin, what));
            }
            (_, Some(xyzw)) => unit(xyzw).map_err(|what| of.wrong_inside(origin, what))?,
            (rpy, None) => from_rpy(rpy.unwrap_or_default()),
        };
        Ok(Se3::new(rotation, vector(of, origin, "xyz")?.unwrap_or(Vec3::zero())))
    }
}

/// Returns the rotation of a quaternion. The length of the quaternion must be 1, up to rounding.
fn unit(xyzw: [f64; 4]) -> Result<Mat3<f64>, String> {
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() > UNIT_ROUNDING {
        return Err(format!("origin quat_xyzw: has the length {length}, expected 1"));
    }
    let [x, y, z, w] = xyzw.map(|x| x / length);
    Ok(Quaternion::new(x, y, z, w).to_rotation())
}
