//! Joints of an SDF: their kinds, and the limits, damping, friction and springs of their axes.

use super::scopes::Scopes;
use super::tree::Edge;
use super::values::number;
use crate::body::JointOptions;
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::warning::Warning;
use condyle_spatial::Vec3;

/// Motion of a joint with one degree of freedom, or of a ball joint with three degrees of freedom.
pub(super) struct Motion {
    pub(super) joint: Joint,
    /// Tag of the element that describes the motion.
    pub(super) tag: &'static str,
}

/// Returns the motions of a joint, in order from the parent link to the child link.
pub(super) fn motions(scopes: &Scopes, edge: &Edge, warnings: &mut Vec<Warning>) -> Result<Vec<Motion>, Error> {
    let axis = |tag: &'static str| scopes.axis(edge.item, tag);
    let first =
        |joint: fn(Vec3<f64>) -> Joint| Ok::<_, Error>(vec![Motion { joint: joint(axis("axis")?), tag: "axis" }]);
    let turn = |axis| Joint::Revolute { axis };
    Ok(match &*edge.kind {
        "fixed" => Vec::new(),
        "revolute" => first(turn)?,
        "continuous" => first(|axis| Joint::Continuous { axis })?,
        "prismatic" => first(|axis| Joint::Prismatic { axis })?,
        "screw" => {
            let pitch = pitch(edge.element, warnings)?;
            vec![Motion { joint: Joint::Helical { axis: axis("axis")?, pitch }, tag: "axis" }]
        }
        "ball" => vec![Motion { joint: Joint::Spherical, tag: "axis" }],
        _ => ["axis", "axis2"]
            .into_iter()
            .map(|tag| Ok(Motion { joint: turn(axis(tag)?), tag }))
            .collect::<Result<_, Error>>()?,
    })
}

/// Returns the joint that moves the parent link relative to the child link. Its position q is the same as for the given
/// joint, except for a ball joint.
pub(super) fn reversed(joint: Joint) -> Joint {
    match joint {
        Joint::Revolute { axis } => Joint::Revolute { axis: -axis },
        Joint::Continuous { axis } => Joint::Continuous { axis: -axis },
        Joint::Prismatic { axis } => Joint::Prismatic { axis: -axis },
        Joint::Helical { axis, pitch } => Joint::Helical { axis: -axis, pitch },
        other => other,
    }
}

/// Returns the pitch of a screw (m/rad), positive for a right-handed thread.
fn pitch(joint: &Element, warnings: &mut Vec<Warning>) -> Result<f64, Error> {
    let read = |tag| number(joint, Some(joint), tag, f64::NAN);
    let (each_turn, radians) = (read("screw_thread_pitch")?, read("thread_pitch")?);
    if each_turn.is_nan() && radians.is_nan() {
        warnings.push(joint.assumed("has no screw_thread_pitch: 1 m for each turn, as SDF has it"));
        return Ok(1.0 / core::f64::consts::TAU);
    }
    // `thread_pitch` is in radians per metre, and positive for a left-handed thread
    let pitch = if each_turn.is_nan() { -1.0 / radians } else { each_turn / core::f64::consts::TAU };
    if pitch.is_finite() { Ok(pitch) } else { Err(joint.wrong("has no finite screw_thread_pitch")) }
}

/// Limits, damping, friction and spring of an axis.
pub(super) struct Axis {
    pub(super) options: JointOptions,
    /// Stiffness (N m/rad, N/m), and rest position (rad, m).
    pub(super) spring: (f64, f64),
}

impl Axis {
    /// Reads the properties of an axis except its direction. In SDF, a limit with a magnitude of 1e16 or more means no
    /// limit. A negative effort or velocity also means no limit.
    pub(super) fn new(element: &Element, tag: &str, kind: Joint, warnings: &mut Vec<Warning>) -> Result<Self, Error> {
        let axis = element.child(tag);
        let (limit, dynamics) = (axis.and_then(|a| a.child("limit")), axis.and_then(|a| a.child("dynamics")));
        let read = |inside, tag: &str, otherwise| number(element, inside, tag, otherwise);
        let wide = |x: f64| if x.abs() >= 1e16 { x * f64::INFINITY } else { x };
        let lower = wide(read(limit, "lower", f64::NEG_INFINITY)?);
        let upper = wide(read(limit, "upper", f64::INFINITY)?);
        if lower > upper {
            return Err(element.wrong(format!("lower limit {lower} is above upper limit {upper}")));
        }
        if kind.nq() != 1 && (lower.is_finite() || upper.is_finite()) {
            let what = format!("limits {lower} and {upper} are left out: a {} joint has none", kind.kind());
            warnings.push(element.left_out(what));
        }
        let bound = |x: f64| (0.0..f64::INFINITY).contains(&x).then_some(x);
        let effort = bound(read(limit, "effort", -1.0)?);
        let spring = (read(dynamics, "spring_stiffness", 0.0)?, read(dynamics, "spring_reference", 0.0)?);
        if spring.0 < 0.0 {
            return Err(element.wrong(format!("spring_stiffness {} is below 0", spring.0)));
        }
        let options = JointOptions {
            position: (kind.nq() == 1).then_some((lower, upper)),
            velocity: bound(read(limit, "velocity", -1.0)?),
            effort: effort.map(|effort| (-effort, effort)),
            damping: read(dynamics, "damping", 0.0)?,
            damping_polynomial: [0.0; 2],
            friction: read(dynamics, "friction", 0.0)?,
            armature: rotor(element, effort, kind)?,
        };
        Ok(Self { options, spring })
    }

    /// Returns the names of the properties of this axis that are lost if its joint closes a loop.
    pub(super) fn extras(&self) -> Vec<&'static str> {
        let (lower, upper) = self.options.position.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let has = [
            (lower.is_finite() || upper.is_finite(), "limits"),
            (self.options.damping != 0.0, "damping"),
            (self.options.friction != 0.0, "friction"),
            (self.options.armature != 0.0, "rotor inertia"),
            (self.spring.0 != 0.0, "spring"),
        ];
        has.into_iter().filter(|(is, _)| *is).map(|(_, name)| name).collect()
    }
}

/// Returns the inertia of the rotor, reflected to its joint: the gear ratio squared times the inertia of the rotor.
/// Only Drake defines the elements for this inertia, and it reads them only for joints with a motor.
fn rotor(joint: &Element, effort: Option<f64>, kind: Joint) -> Result<f64, Error> {
    if kind.nv() != 1 || effort == Some(0.0) {
        return Ok(0.0);
    }
    let read = |tag, otherwise| number(joint, Some(joint), tag, otherwise);
    let ratio = read("drake:gear_ratio", 1.0)?;
    Ok(ratio * ratio * read("drake:rotor_inertia", 0.0)?)
}

/// Adds warnings about physics parameters of a joint that a model cannot represent.
pub(super) fn motor(joint: &Element, warnings: &mut Vec<Warning>) -> Result<(), Error> {
    let ode = joint.child("physics").and_then(|p| p.child("ode"));
    for tag in ["max_force", "velocity"] {
        let x = number(joint, ode, tag, 0.0)?;
        if x != 0.0 {
            warnings.push(joint.left_out(format!("the {tag} {x} of its motor in ODE is left out: it moves freely")));
        }
    }
    Ok(())
}
