//! Joints of an MJCF with their springs, damping and friction, and lengths as linear functions of the model's
//! coordinates.

use super::attributes::Attributes;
use super::law::fill;
use crate::body::Body;
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::model::Model;
use crate::passive::Spring;
use crate::warning::Warning;
use condyle_spatial::{Quaternion, Se3};
use std::collections::HashMap;
use std::ops::Range;

/// Flags of `<option>`. MuJoCo does not compute a feature whose flag is `disable`.
pub(super) struct Switches {
    pub(super) spring: bool,
    pub(super) damper: bool,
    pub(super) friction: bool,
    pub(super) limit: bool,
    pub(super) equality: bool,
    pub(super) actuation: bool,
    pub(super) clamp: bool,
    /// Groups of actuators that are disabled.
    pub(super) groups: Vec<f64>,
}

impl Switches {
    pub(super) fn read(root: &Element) -> Result<Self, Error> {
        let flags = || root.all("option").flat_map(|o| o.all("flag"));
        for (flag, (name, value)) in flags().flat_map(|flag| flag.attributes.iter().map(move |a| (flag, a))) {
            if value != "enable" && value != "disable" {
                return Err(flag.wrong(format!("{name}: `{value}` is neither enable nor disable")));
            }
        }
        let option = |name: &str| flags().filter_map(|flag| flag.attribute(name)).last() != Some("disable");
        let mut groups = Vec::new();
        for element in root.all("option") {
            groups = Attributes::plain(element).list("actuatorgroupdisable")?.unwrap_or(groups);
        }
        let (constraint, passive) = (option("constraint"), option("passive"));
        Ok(Self {
            spring: option("spring") && passive,
            damper: option("damper") && passive,
            friction: option("frictionloss") && constraint,
            limit: option("limit") && constraint,
            equality: option("equality") && constraint,
            actuation: option("actuation"),
            clamp: option("clampctrl"),
            groups,
        })
    }
}

/// Joint of a file.
pub(super) struct FileJoint<'a> {
    pub(super) element: &'a Element,
    /// Index of the body that the joint carries.
    pub(super) body: usize,
    pub(super) joint: Joint,
    /// Position of a hinge or slide in the initial configuration of the file (rad, m).
    pub(super) reference: f64,
    /// Pose of the body of a free joint in the initial configuration.
    pub(super) pose: Se3<f64>,
    stiffness: [f64; 3],
    /// Position at which the spring of a hinge or slide is at rest.
    rest: f64,
    /// Time constant (s) and damping ratio, from which stiffness and damping are computed. A missing value is 0.
    spring_damper: [f64; 2],
    damping: [f64; 3],
    friction: f64,
    pub(super) armature: f64,
    /// Minimum and maximum effort of all actuators together.
    pub(super) effort: Option<[f64; 2]>,
    pub(super) range: [f64; 2],
    /// Whether the spring is plastic, so that its rest position changes.
    is_plastic: bool,
    /// Whether gravity compensation at this joint is provided by the joint's actuators (`actuatorgravcomp`).
    carries_weight: bool,
}

impl<'a> FileJoint<'a> {
    /// Reads the properties of a joint except its kinematics. `angle` is the file's unit of angle, in radians.
    pub(super) fn read(a: &Attributes<'a>, joint: Joint, angle: f64, autolimits: bool) -> Result<Self, Error> {
        let plain = Attributes::plain(a.element);
        let a = if a.element.tag == "freejoint" { &plain } else { a };
        let unit = if matches!(joint, Joint::Revolute { .. }) { angle } else { 1.0 };
        let number = |name: &str| a.number(name).map(|x| x.unwrap_or(0.0));
        let [mut stiffness, mut damping] = [[0.0; 3]; 2];
        fill(a, "stiffness", &mut stiffness)?;
        fill(a, "damping", &mut damping)?;
        let spring_damper: [f64; 2] = a.array("springdamper")?.unwrap_or_default();
        if spring_damper != [0.0; 2] && !spring_damper.iter().all(|x| *x > 0.0) {
            let [time, ratio] = spring_damper;
            return Err(a.element.wrong(format!("springdamper: {time} and {ratio} must both be positive")));
        }
        let effort = super::actuator::Range::default().read(a, "actuatorfrcrange", "actuatorfrclimited")?;
        let effort = match joint.nv() {
            1 => effort.bounds(a.element, "actuatorfrcrange", autolimits)?,
            _ => None,
        };
        Ok(Self {
            element: a.element,
            body: 0,
            joint,
            reference: number("ref")? * unit,
            pose: Se3::identity(),
            stiffness,
            rest: number("springref")? * unit,
            spring_damper,
            damping,
            friction: number("frictionloss")?,
            armature: number("armature")?,
            effort,
            range: a.array::<2>("range")?.unwrap_or_default().map(|x| x * unit),
            is_plastic: number("springyield")? > 0.0,
            carries_weight: a.flag("actuatorgravcomp", None)? == Some(true),
        })
    }

    /// Stores the index of the joint's body, and the pose of this body in the initial configuration of the file.
    /// Returns the joint.
    pub(super) fn on(self, body: usize, pose: Se3<f64>) -> Self {
        Self { body, pose, ..self }
    }

    /// Returns the joint's position in the initial configuration of the file.
    pub(super) fn drawn(&self) -> Vec<f64> {
        match self.joint {
            Joint::Spherical => vec![0.0, 0.0, 0.0, 1.0],
            Joint::FreeFlyer => {
                let Quaternion { vector, scalar } = Quaternion::from_rotation(self.pose.rotation);
                [self.pose.translation.to_array(), vector.to_array()].into_iter().flatten().chain([scalar]).collect()
            }
            _ => vec![self.reference],
        }
    }

    /// Returns the columns of the joint's degrees of freedom.
    pub(super) fn columns(&self, model: &Model) -> Range<usize> {
        let first = model.tree.nodes[self.body].column;
        first..first + self.joint.nv()
    }

    /// Computes stiffness and damping from a time constant and a damping ratio. `response(k)` is the acceleration of
    /// column k due to a unit effort.
    pub(super) fn find_spring(&mut self, columns: Range<usize>, response: &dyn Fn(usize) -> f64) {
        let [time, ratio] = self.spring_damper;
        if time > 0.0 {
            // Chooses stiffness and damping such that the mean inertia along the joint has the given time constant and
            // damping ratio.
            let nv = columns.len() as f64;
            let sum: f64 = columns.map(response).sum();
            let inertia = nv / sum.max(LEAST);
            self.stiffness[0] = inertia / (time * time * ratio * ratio).max(LEAST);
            self.damping[0] = 2.0 * inertia / time.max(LEAST);
        }
    }

    /// Adds damping, friction and the spring to the model.
    pub(super) fn add_to(&self, model: &mut Model, line: Line, on: &Switches, warnings: &mut Vec<Warning>) {
        let stiffness = self.stiffness;
        let damping = if on.damper { self.damping } else { [0.0; 3] };
        let friction = if on.friction { self.friction } else { 0.0 };
        for k in 0..self.joint.nv() {
            line.at(k).resist(model, damping, friction);
        }
        if on.spring && stiffness != [0.0; 3] {
            if self.is_plastic {
                warnings.push(self.element.left_out("springyield: the spring does not yield, however far it is moved"));
            }
            match self.joint.nv() {
                1 => line.spring(model, stiffness, self.rest),
                _ => model.springs.push(Spring { body: self.body, stiffness, rest: self.drawn() }),
            }
        }
        if self.carries_weight && !model.gravity_compensation.is_empty() {
            let what = "the compensation of gravity acts as a passive force, outside the limits of effort; MuJoCo adds it to \
                        the efforts of the actuators";
            warnings.push(self.element.left_out(format!("actuatorgravcomp: {what}")));
        }
    }

    /// Returns whether stiffness and damping are computed from the inertia.
    pub(super) fn has_spring_damper(&self) -> bool {
        self.spring_damper[0] > 0.0
    }

    /// Returns the position of a hinge or slide at which its spring is at rest.
    pub(super) fn rest(&self) -> f64 {
        self.rest
    }
}

/// Minimum divisor in MuJoCo: smaller divisors are replaced by this number.
const LEAST: f64 = 1e-15;

/// Joints of a file, in MuJoCo's order.
#[derive(Default)]
pub(super) struct Joints<'a> {
    pub(super) all: Vec<FileJoint<'a>>,
    named: HashMap<String, usize>,
}

impl<'a> Joints<'a> {
    pub(super) fn add(&mut self, name: String, joint: FileJoint<'a>) {
        self.named.insert(name, self.all.len());
        self.all.push(joint);
    }

    /// Returns the index of the joint that an attribute names.
    pub(super) fn named(&self, e: &Element, attribute: &str, name: &str) -> Result<usize, Error> {
        let found = self.named.get(name).copied();
        found.ok_or_else(|| e.wrong(format!("{attribute}: no joint is named `{name}`")))
    }

    /// Returns the index of the hinge or slide that an attribute names.
    pub(super) fn scalar(&self, e: &Element, attribute: &str, name: &str) -> Result<usize, Error> {
        let found = self.named(e, attribute, name)?;
        match self.all[found].joint.nv() {
            1 => Ok(found),
            _ => Err(e.wrong(format!("{attribute}: joint `{name}` is neither a hinge nor a slide"))),
        }
    }
}

/// Length that depends on a single coordinate q: l = slope · q + offset.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Index in v of the coordinate's degree of freedom.
    pub(super) dof: usize,
    /// Index of the body whose joint has this coordinate.
    leader: usize,
    pub(super) slope: f64,
    offset: f64,
}

impl Line {
    /// Returns the position of the joint that carries a body, as a function of the joint's coordinate. If the joint
    /// follows another joint, the coordinate is the coordinate of the leader.
    pub(super) fn of(model: &Model, body: usize) -> Self {
        let Body { idx_v: dof, mimic, .. } = model.bodies[body];
        match mimic {
            None => Self { dof, leader: body, slope: 1.0, offset: 0.0 },
            Some(mimic) => {
                let leads = |b: &Body| b.mimic.is_none() && b.idx_v == dof;
                let leader = 1 + model.bodies[1..].iter().position(leads).unwrap_or(0);
                Self { dof, leader, slope: mimic.ratio, offset: mimic.offset }
            }
        }
    }

    /// Returns the same linear function for degree of freedom k of the joint.
    pub(super) fn at(self, k: usize) -> Self {
        Self { dof: self.dof + k, ..self }
    }

    /// Returns the sum of lengths, each times a coefficient. Returns `None` if the lengths depend on different
    /// coordinates.
    pub(super) fn sum(lines: &[(Self, f64)]) -> Option<Self> {
        let &(first, _) = lines.first()?;
        let mut sum = Self { slope: 0.0, offset: 0.0, ..first };
        for (line, coefficient) in lines {
            sum.slope += coefficient * line.slope;
            sum.offset += coefficient * line.offset;
        }
        lines.iter().all(|(line, _)| line.dof == first.dof).then_some(sum)
    }

    /// Adds damping and Coulomb friction that act along this length l. The damping force is −d(l̇) l̇ with
    /// d(l̇) = d₀ + d₁|l̇| + d₂l̇². If l̇ = k q̇, the effort of the damping at the joint is −k d(k q̇) k q̇.
    pub(super) fn resist(self, model: &mut Model, [d0, d1, d2]: [f64; 3], friction: f64) {
        let k = self.slope.abs();
        model.damping[self.dof] += d0 * k * k;
        let [p1, p2] = &mut model.damping_polynomial[self.dof];
        *p1 += d1 * k * k * k;
        *p2 += d2 * k * k * k * k;
        model.friction[self.dof] += friction * k;
    }

    /// Adds an inertia that moves with this length, as armature of its coordinate.
    pub(super) fn inertia(self, model: &mut Model, armature: f64) {
        model.armature[self.dof] += self.slope * self.slope * armature;
    }

    /// Adds a spring with a rest length to this length l. The elongation of the spring is x = l − rest = k Δ, where Δ
    /// is a difference of joint positions. With the stiffness coefficients s, the effort at the joint is −k (s₀ + s₁ x
    /// + s₂ x²) x.
    pub(super) fn spring(self, model: &mut Model, [s0, s1, s2]: [f64; 3], rest: f64) {
        let k = self.slope;
        if k != 0.0 {
            let stiffness = [s0 * k * k, s1 * k * k * k, s2 * k * k * k * k];
            model.springs.push(Spring { body: self.leader, stiffness, rest: vec![(rest - self.offset) / k] });
        }
    }

    /// Limits this length. Limits that contradict the limits of the joint are ignored; in this case, returns `false`.
    pub(super) fn limit(self, model: &mut Model, [lower, upper]: [f64; 2]) -> bool {
        if self.slope == 0.0 {
            return true;
        }
        let at = model.bodies[self.leader].idx_q;
        let bounds = [lower, upper].map(|l| (l - self.offset) / self.slope);
        let limits = &mut model.limits;
        let lower = limits.lower[at].max(bounds[0].min(bounds[1]));
        let upper = limits.upper[at].min(bounds[0].max(bounds[1]));
        if lower <= upper {
            (limits.lower[at], limits.upper[at]) = (lower, upper);
        }
        lower <= upper
    }
}
