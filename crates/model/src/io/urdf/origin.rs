//! Placements in a URDF: `<origin>`, which has had quaternions since version 1.1.

use super::elements::{array, only_inside, vector};
use crate::error::Error;
use crate::io::from_rpy;
use crate::io::xml::Element;
use condyle_spatial::{Mat3, Quaternion, Se3, Vec3};

/// The distance from 1 that the length of a quaternion may have: three digits are enough for 0.707 in place of √½.
const UNIT_ROUNDING: f64 = 1e-3;

/// The placements of a robot, by the version of its URDF.
#[derive(Clone, Copy)]
pub(super) struct Origins {
    /// Whether `quat_xyzw` has a meaning: in versions 1.1 and 1.2 it does, not so in 1.0.
    quaternions: bool,
}

impl Origins {
    /// The rules by the version that a robot names, or 1.0.
    pub(super) fn of(robot: &Element) -> Result<Self, Error> {
        match robot.attribute("version").unwrap_or("1.0") {
            "1.0" => Ok(Self { quaternions: false }),
            "1.1" | "1.2" => Ok(Self { quaternions: true }),
            other => Err(robot.wrong(format!("version `{other}` is none of 1.0, 1.1, 1.2"))),
        }
    }

    /// The `<origin>` inside something, or none. Errors name `of`.
    pub(super) fn pose(self, of: &Element, inside: &Element) -> Result<Se3<f64>, Error> {
        only_inside(of, inside, "origin")?.map_or(Ok(Se3::identity()), |origin| self.pose_of(of, origin))
    }

    /// Returns the placement that the attributes of an element name. Errors name `of`.
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

/// The rotation of a quaternion whose length is 1, up to rounding.
fn unit(xyzw: [f64; 4]) -> Result<Mat3<f64>, String> {
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() > UNIT_ROUNDING {
        return Err(format!("origin quat_xyzw: has the length {length}, expected 1"));
    }
    let [x, y, z, w] = xyzw.map(|x| x / length);
    Ok(Quaternion::new(x, y, z, w).to_rotation())
}
