//! Check of the magnitudes of a model's numbers: products of the largest numbers must not overflow.

use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use alloc::borrow::ToOwned;
use alloc::string::String;
use condyle_spatial::{Inertia, Se3, Sym3, Vec3};

/// Largest mass, length, inertia, gravity, armature, pitch or ratio in a model or a shape, in SI units. With this
/// maximum, the inertia of the largest mass at the largest distance is 1e90, so its square does not overflow.
pub(crate) const LARGEST: f64 = 1e30;

impl Model {
    /// Checks that no number of a model is so large that the dynamics overflow.
    pub(crate) fn check_magnitudes(&self) -> Result<(), Error> {
        for body in &self.bodies {
            let Inertia { mass, mass_com, rotational: Sym3 { xx, xy, yy, xz, yz, zz } } = body.inertia;
            let pitch = if let Joint::Helical { pitch, .. } = body.joint { pitch } else { 0.0 };
            let [ratio, offset] = body.mimic.map_or([0.0; 2], |m| [m.ratio, m.offset]);
            let numbers = [mass, xx, xy, yy, xz, yz, zz, pitch, ratio, offset];
            let numbers = numbers.into_iter().chain(mass_com.to_array()).chain(translation(&body.placement));
            check(numbers).map_err(|what| Error::Body { body: body.name.clone(), what })?;
        }
        for frame in &self.frames {
            let wrong = |what| Error::Frame { frame: frame.name.clone(), what };
            check(translation(&frame.placement)).map_err(wrong)?;
        }
        for body in self.bodies.iter().skip(1).filter(|body| body.mimic.is_none()) {
            let armature = &self.armature[body.idx_v..body.idx_v + body.joint.nv()];
            let wrong = |what| Error::Joint { joint: body.joint_name.clone(), what };
            check(armature.iter().copied()).map_err(wrong)?;
        }
        check_gravity(self.gravity)
    }
}

/// Checks that an acceleration of gravity is finite and not too large.
pub(crate) fn check_gravity(gravity: Vec3<f64>) -> Result<(), Error> {
    let gravity = gravity.to_array();
    if gravity.iter().any(|g| !g.is_finite()) {
        return Err(Error::Gravity { gravity });
    }
    check(gravity).map_err(|what| Error::Body { body: "universe".to_owned(), what })
}

fn translation(X: &Se3<f64>) -> impl Iterator<Item = f64> + use<> {
    X.translation.to_array().into_iter()
}

fn check(numbers: impl IntoIterator<Item = f64>) -> Result<(), String> {
    match numbers.into_iter().find(|x| x.is_nan() || x.abs() > LARGEST) {
        Some(x) => {
            Err(format!("has a mass, inertia, length, ratio or acceleration of {x:e}, at most {LARGEST:e} is allowed"))
        }
        None => Ok(()),
    }
}
