//! Joints of a URDF: their kinds, axes, limits, damping and friction.

use super::elements::{array, lacks, read, text, vector};
use crate::body::JointOptions;
use crate::error::Error;
use crate::io::xml::{self, Element};
use crate::joint::Joint;
use crate::warning::Warning;
use condyle_spatial::{Mat3, Vec3};

/// Moving joint, and the rotation of the joint's frame in the frame of its link.
pub(super) struct Moving {
    /// First of the two joints that represent a universal joint; `None` for other joints.
    pub(super) first: Option<Joint>,
    pub(super) joint: Joint,
    /// Rotation R_lj of the frame of a planar joint, whose z axis is the axis of the joint. Other joints use the link's
    /// frame.
    pub(super) rotation: Option<Mat3<f64>>,
}

/// Returns the moving joint; `None` if the joint is fixed.
pub(super) fn kind(joint: &Element, warnings: &mut Vec<Warning>) -> Result<Option<Moving>, Error> {
    let axis = || match joint.child("axis") {
        Some(axis) => vector(joint, axis, "xyz")?.ok_or_else(|| lacks(joint, axis, "xyz")),
        None => Ok(Vec3::new(1.0, 0.0, 0.0)),
    };
    let is_drakes = joint.tag != "joint";
    let (mut first, mut rotation) = (None, None);
    let kind = match text(joint, joint, "type")? {
        "fixed" if !is_drakes => return Ok(None),
        "revolute" if !is_drakes => Joint::Revolute { axis: axis()? },
        "continuous" if !is_drakes => Joint::Continuous { axis: axis()? },
        "prismatic" if !is_drakes => Joint::Prismatic { axis: axis()? },
        "spherical" if !is_drakes => Joint::Spherical,
        "floating" if !is_drakes => Joint::FreeFlyer,
        "ball" if is_drakes => Joint::Spherical,
        "universal" if is_drakes => {
            if let Some(axis) = joint.child("axis") {
                warnings.push(joint.left_out_inside(axis, "it turns about x and y of its frame, as in Drake"));
            }
            first = Some(Joint::Revolute { axis: Vec3::new(1.0, 0.0, 0.0) });
            Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) }
        }
        "screw" if is_drakes => {
            let screw =
                joint.child("drake:screw_thread_pitch").ok_or_else(|| joint.lacks("drake:screw_thread_pitch"))?;
            let [turn] = array(joint, screw, "value")?.ok_or_else(|| lacks(joint, screw, "value"))?;
            Joint::Helical { axis: axis()?, pitch: turn / core::f64::consts::TAU } // m/turn to m/rad
        }
        "planar" => {
            let axis = Joint::Revolute { axis: axis()? }.normalized().map_err(|what| joint.wrong(what))?.axis();
            let axis = axis.unwrap_or(Vec3::new(0.0, 0.0, 1.0));
            let turned = from_z_to(axis);
            if turned != Mat3::identity() {
                rotation = Some(turned);
                let given = if joint.child("axis").is_some() { "its" } else { "no axis is given: its" };
                let Vec3 { x, y, z } = axis;
                let what = format!("{given} plane is normal to the axis ({x}, {y}, {z}); Pinocchio's is normal to z");
                warnings.push(joint.assumed(what));
            }
            Joint::Planar
        }
        other => {
            let kinds = match is_drakes {
                false => "revolute, continuous, prismatic, fixed, floating, planar, spherical",
                true => "ball, planar, screw, universal",
            };
            return Err(joint.wrong(format!("type `{other}` is none of {kinds}")));
        }
    };
    kind.normalized().map(|joint| Some(Moving { first, joint, rotation })).map_err(|what| joint.wrong(what))
}

/// Returns the shortest rotation that maps z to a unit vector u: I + \[v\]× + \[v\]×² / (1 + u_z), with v = z × u. The
/// result is exact if u is x, y or z. The rotation is the same as in Drake. If u is −z, the rotation is a half turn
/// about x.
fn from_z_to(u: Vec3<f64>) -> Mat3<f64> {
    let Vec3 { x, y, z } = u;
    let v2 = x * x + y * y; // |v|² = (1 + z)(1 − z)
    if v2 == 0.0 && z < 0.0 {
        return Mat3 { x: Vec3::new(1.0, 0.0, 0.0), y: Vec3::new(0.0, -1.0, 0.0), z: u };
    }
    let k = if z > 0.0 { 1.0 / (1.0 + z) } else { (1.0 - z) / v2 };
    let xy = -k * x * y;
    Mat3 { x: Vec3::new(1.0 - k * x * x, xy, -x), y: Vec3::new(xy, 1.0 - k * y * y, -y), z: u }
}

/// Returns the limits, damping and friction of a moving joint. For a universal joint, the values apply to each of its
/// two joints.
pub(super) fn options(
    joint: &Element,
    Moving { first, joint: kind, .. }: &Moving,
    warnings: &mut Vec<Warning>,
) -> Result<JointOptions, Error> {
    let (limit, dynamics) = (joint.child("limit"), joint.child("dynamics"));
    let mut options = JointOptions::default();
    let turns_only = first.is_some() || *kind == Joint::Spherical;
    if let Some(dynamics) = dynamics.filter(|_| turns_only || kind.nv() == 1) {
        let number = |name| Ok(array(joint, dynamics, name)?.map_or(0.0, |[x]| x));
        (options.damping, options.friction) = (number("damping")?, number("friction")?);
    }
    // If a joint has several degrees of freedom, its limits, damping and friction have no defined units. Damping and
    // friction of a joint that only turns are an exception.
    if first.is_some() || kind.nv() > 1 {
        let has = |inside: &Element| {
            inside.attributes.iter().any(|(_, x)| x.split_whitespace().any(|x| x.parse() != Ok(0.0)))
        };
        for inside in [limit, dynamics.filter(|_| !turns_only)].into_iter().flatten().filter(|inside| has(inside)) {
            let what = "its numbers have no unit for a joint with several degrees of freedom, and no effect";
            warnings.push(joint.left_out_inside(inside, what));
        }
        return Ok(options);
    }
    let is_limited = matches!(kind, Joint::Revolute { .. } | Joint::Prismatic { .. });
    if let Some(limit) = limit {
        let number = |name| read(joint, limit, name, xml::bound);
        let [lower, upper, effort, velocity] = ["lower", "upper", "effort", "velocity"].map(number);
        let (lower, upper, effort, velocity) = (lower?.unwrap_or(0.0), upper?.unwrap_or(0.0), effort?, velocity?);
        let mut bound = |name, found: Option<f64>| match found {
            None if is_limited => Err(lacks(joint, limit, name)),
            Some(x) if x < 0.0 => {
                warnings.push(joint.assumed(format!("limit {name} is {x}, below 0: it has no limit")));
                Ok(None)
            }
            _ => Ok(found),
        };
        let effort = bound("effort", effort)?;
        options.velocity = bound("velocity", velocity)?;
        options.effort = effort.map(|effort| (-effort, effort));
        if is_limited && lower > upper {
            let what = format!("lower limit {lower} is above upper limit {upper}: its position has no limits");
            warnings.push(joint.left_out_inside(limit, what));
        } else if is_limited {
            options.position = Some((lower, upper));
        }
        for name in ["acceleration", "deceleration", "jerk", "drake:acceleration"] {
            if number(name)?.is_some_and(f64::is_finite) {
                warnings.push(joint.left_out_inside(limit, format!("{name}: a model has no such limit")));
            }
        }
    } else if is_limited {
        return Err(joint.wrong("is revolute or prismatic and has no <limit>"));
    }
    Ok(options)
}
