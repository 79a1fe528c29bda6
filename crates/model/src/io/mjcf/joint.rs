//! Joints of MJCF: their kinds, poses and limits.

use super::Reader;
use super::attributes::Attributes;
use super::compiler::turn;
use crate::body::JointOptions;
use crate::error::Error;
use crate::joint::Joint;
use condyle_spatial::{Mat3, Se3, Vec3};

impl Reader<'_> {
    /// Returns the joint, its options, and two constant poses: lXj before the joint, which includes `−ref`, and jXl
    /// after the joint. At the position q, the joint moves the link by lXj X_J(q) jXl, where X_J(q) is the pose of the
    /// joint. `X` is the pose of the surrounding `<frame>`.
    pub(super) fn joint(
        &mut self,
        a: &Attributes,
        X: Se3<f64>,
    ) -> Result<(Joint, Se3<f64>, Se3<f64>, JointOptions), Error> {
        let wrong = |what: String| a.element.wrong(what);
        let angle = self.compiler(a.element).angle;
        let kind = if a.element.tag == "freejoint" { "free" } else { a.get("type").unwrap_or("hinge") };
        let number = |name| a.number(name).map(|x| x.unwrap_or(0.0));
        let axis = X.rotation * a.vector("axis")?.unwrap_or(Vec3::new(0.0, 0.0, 1.0));
        let (joint, unit) = match kind {
            "free" => (Joint::FreeFlyer, 1.0),
            "hinge" => (Joint::Revolute { axis }, angle),
            "slide" => (Joint::Prismatic { axis }, 1.0),
            "ball" => (Joint::Spherical, angle),
            _ => return Err(wrong(format!("type: `{kind}` is none of hinge, slide, ball and free"))),
        };
        let joint = joint.normalized().map_err(wrong)?;
        // Limits of effort, damping and friction are added later, by the module `beside`.
        let mut options = JointOptions { armature: number("armature")?, ..JointOptions::default() };
        if joint == Joint::FreeFlyer {
            return Ok((joint, Se3::identity(), Se3::identity(), options));
        }
        let pos = a.vector("pos")?.unwrap_or(Vec3::zero());
        let anchor = if kind == "slide" { Vec3::zero() } else { X.rotation * pos + X.translation };
        let at_zero = number("ref")? * unit;
        let lXj = match joint {
            Joint::Revolute { axis } => Se3::new(turn(axis, -at_zero), anchor),
            Joint::Prismatic { axis } => Se3::new(Mat3::identity(), axis.scale(-at_zero)),
            _ => Se3::new(Mat3::identity(), anchor),
        };
        let jXl = Se3::new(Mat3::identity(), -anchor);
        let range = self.limits(a, "range", "limited", kind == "ball")?;
        if let (Some([_, upper]), "ball") = (range, kind) {
            let what = format!("range: the limit of {} rad on the angle of a ball joint is left out", upper * unit);
            self.warnings.push(a.element.left_out(what));
        } else {
            options.position = range.map(|[lower, upper]| (lower * unit, upper * unit));
        }
        Ok((joint, lXj, jXl, options))
    }

    /// Returns the range of a joint if it is a limit. Without a flag, a range is a limit if its bounds are in ascending
    /// order.
    fn limits(&self, a: &Attributes, range: &str, limited: &str, is_ball: bool) -> Result<Option<[f64; 2]>, Error> {
        let bounds = a.array::<2>(range)?.unwrap_or_default();
        let [lower, upper] = bounds;
        let is_limited = match a.flag(limited, Some("auto"))? {
            Some(is_limited) => is_limited,
            None if bounds != [0.0; 2] && !self.compiler(a.element).autolimits => {
                let what = format!("{range}: without autolimits, {limited} must say whether it limits");
                return Err(a.element.wrong(what));
            }
            None => lower < upper,
        };
        if is_limited && is_ball && lower != 0.0 {
            return Err(a.element.wrong(format!("{range}: the lower limit {lower} of a ball joint is not 0")));
        }
        if is_limited && !is_ball && lower >= upper {
            let what =
                format!("{range}: lower limit {lower} is not below upper limit {upper}, though {limited} is true");
            return Err(a.element.wrong(what));
        }
        Ok(is_limited.then_some(bounds))
    }
}
