//! Transmissions of MJCF's actuators. Transmissions determine the actuators of a model, and the effort limits, armature
//! and damping of its joints.

use super::Source;
use super::actuator::{ALL, Classes, Mechanics, clipped, scaled};
use super::attributes::Attributes;
use super::law::{KINDS, Law};
use super::reference::Reference;
use super::spring::{Joints, Line, Switches};
use super::tendon::Tendons;
use crate::actuator::{Actuator, Transmission};
use crate::body::FrameKind;
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::Warning;
use condyle_spatial::Vec3;
use std::collections::HashMap;

/// Maximum number of joints in the tendons of all actuators together.
const MAX_DRIVEN: usize = 1 << 20;

/// Joint, tendon or site that an actuator drives.
enum Target<'a> {
    Joint(usize),
    Tendon(usize),
    /// Name of a site.
    Site(&'a str),
    /// Reason why a model cannot represent the item that the actuator drives.
    Else(&'static str),
}

/// Actuator of a file.
struct Drive<'a> {
    element: &'a Element,
    mechanics: Mechanics,
    law: Law<'a>,
    target: Target<'a>,
    /// Whether the axes of a ball or free joint are fixed in the joint's parent.
    in_parent: bool,
    control: [f64; 2],
    force: [f64; 2],
    activation: [f64; 2],
}

/// Actuators of a file.
pub(super) struct Drives<'a> {
    all: Vec<Drive<'a>>,
}

/// Maximum number of actuators whose velocity gain is given by a damping ratio. The number is limited because each such
/// actuator needs a computation over the whole robot.
const MAX_RATIOS: usize = 4096;

impl<'a> Drives<'a> {
    /// Reads the actuators of a file.
    pub(super) fn read(
        root: &'a Element,
        sources: &[Source<'a>],
        joints: &Joints,
        tendons: &Tendons,
        on: &Switches,
    ) -> Result<Self, Error> {
        let mut all = Vec::new();
        let elements = || root.all("actuator").flat_map(|section| &section.children);
        if elements().next().is_none() {
            return Ok(Self { all });
        }
        let classes = sources.iter().map(|source| Classes::read(source.root)).collect::<Result<Vec<_>, _>>()?;
        let mut driven = 0;
        super::names(elements().filter(|e| KINDS.contains(&&*e.tag)))?;
        for e in elements().filter(|e| KINDS.contains(&&*e.tag)) {
            let (mechanics, law) = classes[e.source].of(e)?;
            mechanics.check(e)?;
            let autolimits = sources[e.source].compiler.autolimits;
            let target = target(e, joints, tendons)?;
            if let Target::Tendon(t) = target {
                driven += tendons.all[t].joints.len();
                if driven > MAX_DRIVEN {
                    let what = "joints of tendons that actuators drive so far";
                    return Err(e.wrong(format!("{driven} {what}: at most {MAX_DRIVEN} are allowed")));
                }
            }
            let bounds = |range: super::actuator::Range, name: &str| range.bounds(e, name, autolimits);
            let mut control = bounds(mechanics.control, "ctrlrange")?;
            let mut activation = bounds(mechanics.activation, "actrange")?;
            let force = bounds(mechanics.force, "forcerange")?.unwrap_or(ALL);
            if law.inherit > 0.0 && matches!(law.affine(), Ok([gain, _, kp, _]) if gain == kp) {
                let inherited = inherited(e, &law, &target, joints, tendons)?;
                *(if law.dynamics == "integrator" { &mut activation } else { &mut control }) = Some(inherited);
            }
            let control = control.filter(|_| on.clamp).unwrap_or(ALL);
            let activation = activation.unwrap_or(ALL);
            let in_parent = e.attribute("jointinparent").is_some();
            all.push(Drive { element: e, mechanics, law, target, in_parent, control, force, activation });
        }
        Ok(Self { all })
    }

    /// Returns the numbers of controls and activations that each actuator has in a keyframe.
    pub(super) fn inputs(&self) -> Result<Vec<Inputs>, Error> {
        self.all.iter().map(|drive| drive.law.inputs(drive.element)).collect()
    }

    /// Adds the armature and damping of actuators, times gear², to the joints and tendons that they drive.
    pub(super) fn load(
        &self,
        model: &mut Model,
        joints: &mut Joints,
        tendons: &mut Tendons,
        lines: &[Line],
        on: &Switches,
    ) {
        for Drive { mechanics, target, .. } in &self.all {
            let [armature, damping @ ..] = mechanics.at_joint();
            match *target {
                Target::Joint(j) => {
                    let joint = &mut joints.all[j];
                    joint.armature += armature;
                    for k in 0..joint.joint.nv() {
                        lines[j].at(k).inertia(model, armature);
                        lines[j].at(k).resist(model, if on.damper { damping } else { [0.0; 3] }, 0.0);
                    }
                }
                Target::Tendon(t) => {
                    let tendon = &mut tendons.all[t];
                    tendon.armature += armature;
                    tendon.damping.iter_mut().zip(damping).for_each(|(sum, d)| *sum += d);
                }
                _ => {}
            }
        }
    }

    /// Returns whether the velocity gain of at least one actuator is given by a damping ratio.
    pub(super) fn has_ratios(&self) -> bool {
        self.all.iter().any(|drive| drive.law.has_ratio())
    }

    /// Returns the number of enabled actuators of each tendon.
    fn on_tendons(&self, tendons: &Tendons, on: &Switches) -> Vec<usize> {
        let mut counts = vec![0; tendons.all.len()];
        for drive in self.all.iter().filter(|drive| drive.acts(on)) {
            if let Target::Tendon(t) = drive.target {
                counts[t] += 1;
            }
        }
        counts
    }

    /// Returns the model's actuators, each with its index in the file. Adds warnings about actuators and effects that
    /// are left out.
    pub(super) fn table(
        &self,
        model: &Model,
        (joints, tendons): (&Joints, &Tendons),
        on: &Switches,
        reference: Option<&Reference>,
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<(usize, Actuator)>, Error> {
        let user = model.frames.iter().enumerate().filter(|(_, frame)| frame.kind == FrameKind::User);
        let sites: HashMap<&str, usize> = user.map(|(i, frame)| (&*frame.name, i)).collect();
        let (mut table, mut ratios, counts) = (Vec::new(), 0, self.on_tendons(tendons, on));
        for (tendon, _) in tendons.all.iter().zip(&counts).filter(|(t, count)| t.effort.is_some() && **count > 1) {
            let what =
                "actuatorfrcrange: it limits neither actuators nor efforts, for several actuators share the tendon";
            warnings.push(tendon.element.left_out(what));
        }
        for (index, drive) in self.all.iter().enumerate() {
            let Drive { element: e, mechanics: Mechanics { gear, delay, .. }, law, .. } = drive;
            let mut warn = |what: String| warnings.push(e.left_out(what));
            let transmission = match drive.target {
                Target::Joint(j) if drive.in_parent && joints.all[j].joint.nv() > 1 => {
                    Err("its axis is fixed in the parent of a ball or free joint")
                }
                Target::Joint(j) => Ok(Transmission::Joint { body: joints.all[j].body }),
                Target::Tendon(t) => {
                    let tendon = &tendons.all[t];
                    let over = tendon.joints.iter().map(|&(j, coefficient)| (joints.all[j].body, coefficient));
                    Ok(Transmission::Tendon { name: tendon.name.clone(), joints: over.collect() })
                }
                Target::Site(name) => match sites.get(name) {
                    Some(&frame) => Ok(Transmission::Frame { frame }),
                    None => return Err(e.wrong(format!("site: no site is named `{name}`"))),
                },
                Target::Else(why) => Err(why),
            };
            let ([gain, bias, kp, mut kv], transmission) = match (law.affine(), transmission) {
                (Ok(numbers), Ok(transmission)) if drive.acts(on) => (numbers, transmission),
                (Err(why), _) | (_, Err(why)) => {
                    warn(format!("it is left out of the table of actuators: {why}"));
                    continue;
                }
                _ => {
                    warn("it is disabled by <option>: it is no actuator, and no limit of effort".to_owned());
                    continue;
                }
            };
            for what in [law.left_out(), if *delay > 0.0 { "delay: the control acts at once" } else { "" }] {
                if !what.is_empty() {
                    warn(what.to_owned());
                }
            }
            if law.has_ratio() {
                ratios += 1;
                if ratios > MAX_RATIOS {
                    return Err(
                        e.wrong(format!("{ratios} actuators with dampratio so far: at most {MAX_RATIOS} are allowed"))
                    );
                }
                let inverse = reference.map_or(0.0, |reference| match (&drive.target, &transmission) {
                    (Target::Joint(j), _) if joints.all[*j].joint == Joint::FreeFlyer => {
                        let free = &joints.all[*j];
                        let R = free.pose.rotation;
                        let linear = R.transpose_mul(Vec3::new(gear[0], gear[1], gear[2])).to_array();
                        let along = linear.into_iter().chain(gear[3..].iter().copied());
                        reference.response(&free.columns(model).zip(along).collect::<Vec<_>>())
                    }
                    (_, Transmission::Frame { frame }) => {
                        reference.response(&reference.along(&model.frames[*frame], *gear))
                    }
                    _ => reference.response(&drive.moments(model, joints, tendons)),
                });
                // The gain is kv = 2 ratio √(kp m), where the effective mass m is given by 1/m = J M⁻¹ Jᵀ, with the
                // inertia matrix M and the Jacobian J of the length.
                kv = if inverse > 0.0 { -kv * 2.0 * (kp / inverse).max(0.0).sqrt() } else { 0.0 };
            }
            if let Some(x) = [gain, bias, kp, kv].iter().chain(gear).find(|x| !x.is_finite()) {
                return Err(e.wrong(format!("its gain, bias or gear is {x}, which is not finite")));
            }
            let actuator = Actuator {
                name: e.attribute("name").unwrap_or_default().to_owned(),
                transmission,
                gear: *gear,
                gain,
                bias,
                kp,
                kv,
                control: law.activation(drive.control, drive.activation).into(),
                force: clipped(drive.share(tendons, &counts), drive.force).into(),
            };
            table.push((index, actuator));
        }
        Ok(table)
    }

    /// Sets the limits of effort of all coordinates. For each joint, the efforts of its actuators are summed and
    /// clipped to its `actuatorfrcrange`. If several joints depend on the same coordinate, the limits of these joints
    /// are summed.
    pub(super) fn limit(
        &self,
        model: &mut Model,
        (joints, tendons): (&Joints, &Tendons),
        lines: &[Line],
        on: &Switches,
    ) {
        let alone = self.on_tendons(tendons, on);
        let mut efforts = vec![None; model.tree.columns.len()];
        for drive in self.all.iter().filter(|drive| drive.acts(on)) {
            let force = drive.law.force(drive.law.activation(drive.control, drive.activation));
            let force = clipped(clipped(force, drive.share(tendons, &alone)), drive.force);
            for (k, moment) in drive.moments(model, joints, tendons) {
                add(&mut efforts[k], scaled(force, moment));
            }
        }
        let mut sums = vec![None; model.tree.nv];
        for (joint, line) in joints.all.iter().zip(lines) {
            for (k, column) in joint.columns(model).enumerate() {
                let effort = match (efforts[column], joint.effort) {
                    (Some(effort), Some(limits)) => Some(clipped(effort, limits)),
                    (effort, limits) => effort.or(limits),
                };
                if let Some(effort) = effort {
                    add(&mut sums[line.at(k).dof], scaled(effort, line.slope));
                }
            }
        }
        for (i, sum) in sums.into_iter().enumerate() {
            [model.limits.effort_lower[i], model.limits.effort_upper[i]] = sum.unwrap_or(ALL);
        }
    }
}

impl Drive<'_> {
    /// Returns whether the actuator is enabled.
    fn acts(&self, on: &Switches) -> bool {
        on.actuation && !on.groups.contains(&self.mechanics.group)
    }

    /// Returns the force range of this actuator that its tendon's `actuatorfrcrange` allows. `counts` is the number of
    /// actuators of each tendon. If a tendon has several actuators, its range limits only the sum of their forces, so a
    /// single actuator has no limit.
    fn share(&self, tendons: &Tendons, counts: &[usize]) -> [f64; 2] {
        match self.target {
            Target::Tendon(t) if counts[t] == 1 => tendons.all[t].effort.unwrap_or(ALL),
            _ => ALL,
        }
    }

    /// Returns the columns on which a unit force of the actuator acts, and the effort at each column. Efforts that
    /// depend on positions are left out.
    fn moments(&self, model: &Model, joints: &Joints, tendons: &Tendons) -> Vec<(usize, f64)> {
        let gear = self.mechanics.gear;
        let first = |j: usize| joints.all[j].columns(model).start;
        match self.target {
            Target::Joint(j) => match joints.all[j].joint {
                Joint::Spherical | Joint::FreeFlyer if self.in_parent => Vec::new(),
                Joint::Spherical => (0..3).map(|k| (first(j) + k, gear[k])).filter(|x| x.1 != 0.0).collect(),
                // Only the torque gives constant efforts. The force is along the axes of the world, but v is along the
                // axes of the body.
                Joint::FreeFlyer => (3..6).map(|k| (first(j) + k, gear[k])).filter(|x| x.1 != 0.0).collect(),
                _ => vec![(first(j), gear[0])],
            },
            Target::Tendon(t) => {
                let over = tendons.all[t].joints.iter();
                over.map(|&(j, coefficient)| (first(j), coefficient * gear[0])).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// Numbers of controls and activations that an actuator has in a keyframe.
pub(super) struct Inputs {
    /// Number of controls.
    pub(super) controls: usize,
    /// Index of the control that the model has, among the controls in the keyframe.
    pub(super) own: usize,
    /// Number of activations, if it is known.
    pub(super) activations: Option<usize>,
    /// Whether the actuator integrates its control. The control in the model is then the activation in the keyframe.
    pub(super) is_integrator: bool,
}

impl Law<'_> {
    /// Returns the numbers of controls and activations that an actuator with this force law has in a keyframe.
    fn inputs(&self, e: &Element) -> Result<Inputs, Error> {
        let (default, own) = if self.gain == "pid" { ("pos vel", "pos") } else { ("voltage", "voltage") };
        let several = matches!(self.gain, "pid" | "dcmotor");
        let words: Vec<&str> = self.input.filter(|_| several).unwrap_or(default).split_whitespace().collect();
        let dimension = Attributes::plain(e).number("actdim")?.filter(|n| *n >= 0.0).map(|n| n.min(1e6) as usize);
        Ok(Inputs {
            controls: if self.gain == "so3" { 3 } else { words.len() },
            own: words.iter().position(|word| *word == own).unwrap_or(0),
            activations: match (self.gain, self.dynamics) {
                ("plugin", _) => dimension,
                ("dcmotor", _) if !self.extra.is_empty() => None,
                (_, "none") => Some(0),
                (_, "pid") => Some(usize::from(self.gainprm[0] != 0.0) + usize::from(self.dynprm[1] != 0.0)),
                _ => Some(dimension.unwrap_or(1)),
            },
            is_integrator: self.dynamics == "integrator",
        })
    }

    /// Returns whether the velocity gain of a servo is given by a damping ratio.
    fn has_ratio(&self) -> bool {
        matches!(self.affine(), Ok([gain, _, kp, kv]) if gain == kp && kv < 0.0)
    }

    /// Returns the effect of this force law that a model cannot represent. A model has no activations, and only one
    /// control for each actuator.
    fn left_out(&self) -> &'static str {
        let inputs = self.input.unwrap_or(if self.gain == "pid" { "pos vel" } else { "voltage" });
        match self.dynamics {
            "filter" | "filterexact" => "its activation is not filtered: it follows the control at once",
            "integrator" => "its control is not integrated: the control is the activation itself",
            "muscle" | "user" => "its activation follows the control at once",
            "pid" => "its integral and the limit of its setpoint's rate are left out",
            _ if self.gain == "pid" && inputs != "pos" => "its setpoint of velocity and its feedforward are left out",
            _ if self.gain == "dcmotor" && inputs != "voltage" => {
                "its controller is left out: the control is a voltage"
            }
            _ => self.extra,
        }
    }
}

/// Returns the joint, tendon or site that an element drives.
fn target<'a>(e: &'a Element, joints: &Joints, tendons: &Tendons) -> Result<Target<'a>, Error> {
    let named = ["joint", "jointinparent", "tendon", "site", "cranksite", "body"];
    let mut found = named.into_iter().filter_map(|kind| Some((kind, e.attribute(kind)?)));
    let (kind, name) = found.next().ok_or_else(|| e.wrong("has no joint, tendon or site that it drives"))?;
    if let Some((second, _)) = found.next() {
        return Err(e.wrong(format!("has both {kind} and {second}: expected one of them")));
    }
    Ok(match kind {
        "joint" | "jointinparent" => Target::Joint(joints.named(e, kind, name)?),
        "tendon" => match tendons.named.get(name) {
            Some(&t) if tendons.all[t].joints.is_empty() => Target::Else("it drives a spatial tendon"),
            Some(&t) => Target::Tendon(t),
            None => return Err(e.wrong(format!("tendon: no tendon is named `{name}`"))),
        },
        "site" if e.attribute("refsite").is_some() => Target::Else("it drives a site against another one"),
        "site" => Target::Site(name),
        "cranksite" => Target::Else("it drives a slider and a crank"),
        _ => Target::Else("it acts on contacts of a body"),
    })
}

/// Returns the control range that an actuator inherits from the range of its joint or tendon.
fn inherited(e: &Element, law: &Law, target: &Target, joints: &Joints, tendons: &Tendons) -> Result<[f64; 2], Error> {
    let [lower, upper] = match *target {
        Target::Joint(j) if joints.all[j].joint.nv() == 1 => joints.all[j].range,
        Target::Tendon(t) => tendons.all[t].range,
        _ => [0.0; 2],
    };
    if lower == upper {
        return Err(e.wrong("inheritrange: what it drives has no range"));
    }
    let (mean, radius) = ((lower + upper) / 2.0, (upper - lower) / 2.0 * law.inherit);
    Ok([mean - radius, mean + radius])
}

/// Adds an interval to a sum.
fn add(sum: &mut Option<[f64; 2]>, [lower, upper]: [f64; 2]) {
    let [a, b] = sum.unwrap_or_default();
    *sum = Some([a + lower, b + upper]);
}
