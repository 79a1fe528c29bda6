//! Collects additions to the tree of a robot: actuators, springs, keyframes and constraints.

use crate::terminal::{Table, heading, short};
use condyle::Model;
use condyle::tree::{Actuator, ModelConstraintKind, Transmission};
use serde::Serialize;

/// Additions to the tree of a robot, for example actuators and constraints.
#[derive(Serialize)]
pub(crate) struct Additions {
    actuators: Vec<ActuatorReport>,
    springs: Vec<SpringReport>,
    /// Name of each body with gravity compensation, and the mass whose weight is compensated (kg).
    gravity_compensation: Vec<(String, f64)>,
    keyframes: Vec<KeyframeReport>,
    constraints: Vec<ConstraintReport>,
}

/// Actuator. `null` in a range means that no limit exists.
#[derive(Serialize)]
struct ActuatorReport {
    name: String,
    /// Joint, tendon or frame that the actuator drives.
    drives: String,
    gear: [f64; 6],
    kp: f64,
    kv: f64,
    control: [Option<f64>; 2],
    force: [Option<f64>; 2],
}

#[derive(Serialize)]
struct SpringReport {
    joint: String,
    stiffness: [f64; 3],
    rest: Vec<f64>,
}

#[derive(Serialize)]
struct KeyframeReport {
    name: String,
    q: Vec<f64>,
    /// Controls, one number per actuator.
    control: Vec<f64>,
}

#[derive(Serialize)]
struct ConstraintReport {
    name: String,
    /// Text that names the bodies or joints, and the constraint between them.
    what: String,
}

impl Additions {
    pub(crate) fn new(model: &Model) -> Self {
        let joint = |body: usize| model.bodies()[body].joint_name.clone();
        let constraint = |kind: &ModelConstraintKind| match kind {
            ModelConstraintKind::Point { frames } => bodies(model, *frames, "share a point"),
            ModelConstraintKind::Rigid { frames } => bodies(model, *frames, "share a frame"),
            ModelConstraintKind::Coupling { follower, leader, coefficients } => {
                let leader = leader.map_or("nothing".to_owned(), joint);
                format!("joint {} follows {leader}, polynomial {coefficients:?}", joint(*follower))
            }
            _ => String::new(),
        };
        Self {
            actuators: model.actuators().iter().map(|a| ActuatorReport::new(model, a)).collect(),
            springs: model
                .springs()
                .iter()
                .map(|s| SpringReport { joint: joint(s.body), stiffness: s.stiffness, rest: s.rest.clone() })
                .collect(),
            gravity_compensation: model
                .gravity_compensation()
                .iter()
                .map(|c| (c, &model.bodies()[c.body]))
                .map(|(compensation, body)| (body.name.clone(), compensation.carried(body.inertia).mass))
                .collect(),
            keyframes: model
                .keyframes()
                .iter()
                .map(|key| KeyframeReport { name: key.name.clone(), q: key.q.clone(), control: key.control.clone() })
                .collect(),
            constraints: model
                .constraints()
                .iter()
                .map(|c| ConstraintReport { name: c.name.clone(), what: constraint(&c.kind) })
                .collect(),
        }
    }

    /// Returns the additions as text, with a heading for each type of addition.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        if !self.actuators.is_empty() {
            let mut table = Table::new(&["actuator", "drives", "gear", "kp", "kv", "control", "force"]);
            for a in &self.actuators {
                let cells = [&a.name, &a.drives].map(String::clone).into_iter();
                let numbers = [a.gear[0], a.kp, a.kv].map(short);
                table.row(cells.chain(numbers).chain([range(a.control), range(a.force)]).collect());
            }
            text += &(heading("Actuators") + &table.text());
        }
        let spring =
            |s: &SpringReport| (s.joint.clone(), format!("{} at rest at {}", list(&s.stiffness), list(&s.rest)));
        let carried = |(body, mass): &(String, f64)| (body.clone(), format!("{} kg", short(*mass)));
        for (title, lines) in [
            ("Springs", self.springs.iter().map(spring).collect::<Vec<_>>()),
            ("Gravity compensation", self.gravity_compensation.iter().map(carried).collect()),
            ("Keyframes", self.keyframes.iter().map(|key| (key.name.clone(), list(&key.q))).collect()),
            ("Constraints", self.constraints.iter().map(|c| (c.name.clone(), c.what.clone())).collect()),
        ] {
            if !lines.is_empty() {
                text += &heading(title);
                text.extend(lines.into_iter().map(|(name, what)| format!("  {name}: {what}\n")));
            }
        }
        text
    }
}

impl ActuatorReport {
    fn new(model: &Model, a: &Actuator) -> Self {
        let drives = match &a.transmission {
            Transmission::Joint { body } => format!("joint {}", model.bodies()[*body].joint_name),
            Transmission::Tendon { name, .. } => format!("tendon {name}"),
            Transmission::Frame { frame } => format!("frame {}", model.frames()[*frame].name),
            _ => String::new(),
        };
        let finite = |(lower, upper): (f64, f64)| [lower, upper].map(|x| x.is_finite().then_some(x));
        let (control, force) = (finite(a.control), finite(a.force));
        Self { name: a.name.clone(), drives, gear: a.gear, kp: a.kp, kv: a.kv, control, force }
    }
}

/// Returns a phrase that names the bodies of two frames and the constraint between them.
fn bodies(model: &Model, frames: [usize; 2], what: &str) -> String {
    let [a, b] = frames.map(|frame| &*model.bodies()[model.frames()[frame].body].name);
    format!("{a} and {b} {what}")
}

/// Formats numbers in short form, separated by spaces.
fn list(numbers: &[f64]) -> String {
    numbers.iter().map(|&x| short(x)).collect::<Vec<_>>().join(" ")
}

/// Formats a range between two limits; returns an empty text if there are no limits.
fn range([lower, upper]: [Option<f64>; 2]) -> String {
    match (lower, upper) {
        (None, None) => String::new(),
        _ => format!("{} to {}", lower.map_or("−∞".to_owned(), short), upper.map_or("∞".to_owned(), short)),
    }
}
