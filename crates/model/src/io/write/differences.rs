//! Differences between a model and the model in a file, as texts for errors.

use super::changes::{NUMBERS, ROUNDING, alike, close, numbers, slots};
use crate::actuator::{Actuator, Transmission};
use crate::body::Body;
use crate::constraint::ModelConstraintKind;
use crate::inertial_parameters;
use crate::io::xml::Element;
use crate::joint::{Joint, Mimic};
use crate::model::Model;
use condyle_spatial::{Inertia, Se3, Vec3};

/// First difference between a model and the model in a file.
pub(super) struct Difference {
    /// Name of the differing quantity, with both values.
    what: String,
    /// Attributes that may cause the difference, because with them a number depends on other numbers of the file.
    causes: &'static [&'static str],
}

/// Attributes with which a number depends on other numbers of a file, each with an explanation.
const CAUSES: [(&str, &str); 5] = [
    ("springdamper", "`springdamper` makes stiffness and damping depend on the inertia"),
    ("dampratio", "`dampratio` makes kv depend on the inertia"),
    ("align", "`align` turns the frame of a free body to the principal axes of its inertia"),
    ("alignfree", "`alignfree` turns the frame of a free body to the principal axes of its inertia"),
    ("settotalmass", "`settotalmass` scales all masses"),
];

impl From<String> for Difference {
    fn from(what: String) -> Self {
        Self { what, causes: &[] }
    }
}

impl Difference {
    /// Returns the difference as text. If the file contains one of the attributes in `causes`, adds an explanation.
    pub(super) fn text(self, root: &Element) -> String {
        let cause = CAUSES.iter().find(|(name, _)| self.causes.contains(name) && mentions(root, name));
        match cause {
            Some((_, why)) => format!("{} ({why})", self.what),
            None => self.what,
        }
    }
}

/// Returns whether an element or one of its descendants has a given attribute.
fn mentions(element: &Element, name: &str) -> bool {
    element.attribute(name).is_some() || element.children.iter().any(|child| mentions(child, name))
}

/// Returns the first property in which two models differ. Numbers that can be written to a file are not compared.
pub(super) fn different_robot(model: &Model, file: &Model) -> Option<Difference> {
    let names = |b: &Body| (b.name.clone(), b.joint_name.clone());
    for (a, b) in model.bodies.iter().zip(&file.bodies) {
        if names(a) != names(b) {
            let (file, model) = (&b.joint_name, &a.joint_name);
            return Some(format!("joint `{file}` of the file is another one in the model, `{model}`").into());
        }
        if let Some(what) = different_joint(a, b) {
            return Some(format!("joint `{}`: {what}", a.joint_name).into());
        }
    }
    let counts = (model.bodies.len(), file.bodies.len());
    if counts.0 != counts.1 {
        return Some(format!("the model has {} bodies and the file {}", counts.0 - 1, counts.1 - 1).into());
    }
    for (a, b) in model.frames.iter().zip(&file.frames) {
        if (&a.name, a.kind) != (&b.name, b.kind) {
            return Some(format!("frame `{}` of the file is another one in the model, `{}`", b.name, a.name).into());
        }
        let what = match a.body == b.body {
            true => different_numbers("its pose in its body", &pose(a.placement), &pose(b.placement)),
            false => Some(format!("it is on body {} in the model and on body {} in the file", a.body, b.body)),
        };
        if let Some(what) = what {
            return Some(Difference { what: format!("frame `{}`: {what}", a.name), causes: &["align", "alignfree"] });
        }
    }
    if model.frames.len() != file.frames.len() {
        return Some(format!("the model has {} frames and the file {}", model.frames.len(), file.frames.len()).into());
    }
    if let Some(what) = different_numbers("gravity (m/s²)", &model.gravity.to_array(), &file.gravity.to_array()) {
        return Some(what.into());
    }
    if model.name != file.name {
        return Some(format!("the model's name is `{}`, and the file's is `{}`", model.name, file.name).into());
    }
    different_springs(model, file)
        .or_else(|| different_compensation(model, file))
        .or_else(|| different_actuators(model, file))
        .or_else(|| different_keyframes(model, file))
        .or_else(|| different_constraints(model, file))
}

/// Returns the first property in which two joints differ.
fn different_joint(a: &Body, b: &Body) -> Option<String> {
    if (a.parent, a.joint.kind()) != (b.parent, b.joint.kind()) {
        let place = |body: &Body| format!("{} on body {}", body.joint.kind(), body.parent);
        return Some(format!("it is {} in the model and {} in the file", place(a), place(b)));
    }
    let motion = |body: &Body| {
        let pitch = if let Joint::Helical { pitch, .. } = body.joint { pitch } else { 0.0 };
        let axis = body.joint.axis().unwrap_or(Vec3::zero()).to_array();
        axis.into_iter().chain([pitch]).collect::<Vec<_>>()
    };
    let mimic = |body: &Body| body.mimic.map_or(vec![], |Mimic { ratio, offset }| vec![ratio, offset]);
    different_numbers("its pose in its parent", &pose(a.placement), &pose(b.placement))
        .or_else(|| different_numbers("its axis and pitch", &motion(a), &motion(b)))
        .or_else(|| different_numbers("ratio and offset by which it follows", &mimic(a), &mimic(b)))
}

/// Returns the first difference between springs.
fn different_springs(model: &Model, file: &Model) -> Option<Difference> {
    let joints = |m: &Model| m.springs.iter().map(|s| m.bodies[s.body].joint_name.clone()).collect::<Vec<_>>();
    if let Some(what) = different_names("springs", &joints(model), &joints(file)) {
        return Some(what.into());
    }
    model.springs.iter().zip(&file.springs).find_map(|(a, b)| {
        let what = different_numbers("the stiffness of its spring", &a.stiffness, &b.stiffness)
            .or_else(|| different_numbers("the rest of its spring", &a.rest, &b.rest))?;
        let joint = &model.bodies[a.body].joint_name;
        Some(Difference { what: format!("joint `{joint}`: {what}"), causes: &["springdamper"] })
    })
}

/// Returns the first difference between the compensated fractions of weight.
fn different_compensation(model: &Model, file: &Model) -> Option<Difference> {
    let of = |m: &Model| m.gravity_compensation.clone();
    let bodies = |m: &Model| of(m).iter().map(|c| m.bodies[c.body].name.clone()).collect::<Vec<_>>();
    if let Some(what) = different_names("gravity compensation", &bodies(model), &bodies(file)) {
        return Some(what.into());
    }
    of(model).iter().zip(of(file)).find_map(|(a, b)| {
        let what = different_numbers("the ratio of its compensated weight", &[a.ratio], &[b.ratio])?;
        Some(format!("body `{}`: {what}", model.bodies[a.body].name).into())
    })
}

/// Returns the first difference between actuators.
fn different_actuators(model: &Model, file: &Model) -> Option<Difference> {
    let names = |m: &Model| m.actuators.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
    if let Some(what) = different_names("actuators", &names(model), &names(file)) {
        return Some(what.into());
    }
    for (k, (a, b)) in model.actuators.iter().zip(&file.actuators).enumerate() {
        let subject = if a.name.is_empty() { format!("actuator {k}") } else { format!("actuator `{}`", a.name) };
        let (driven, coefficients) = drives(model, a);
        let (other, others) = drives(file, b);
        if driven != other {
            return Some(format!("{subject} drives {driven} in the model and {other} in the file").into());
        }
        let all = [
            ("the coefficients of its tendon", &*coefficients, &*others),
            ("gear", &a.gear, &b.gear),
            ("gain", &[a.gain], &[b.gain]),
            ("bias", &[a.bias], &[b.bias]),
            ("kp", &[a.kp], &[b.kp]),
            ("kv", &[a.kv], &[b.kv]),
            ("control range", &[a.control.0, a.control.1], &[b.control.0, b.control.1]),
            ("force range", &[a.force.0, a.force.1], &[b.force.0, b.force.1]),
        ];
        if let Some(what) = all.into_iter().find_map(|(name, a, b)| different_numbers(name, a, b)) {
            return Some(Difference { what: format!("{subject}: {what}"), causes: &["dampratio"] });
        }
    }
    None
}

/// Returns the name of the joint, tendon or frame that an actuator drives, and the coefficients of the joints for a
/// tendon.
fn drives(model: &Model, actuator: &Actuator) -> (String, Vec<f64>) {
    let joint = |body: usize| format!("joint `{}`", model.bodies[body].joint_name);
    match &actuator.transmission {
        Transmission::Joint { body } => (joint(*body), Vec::new()),
        Transmission::Tendon { joints, .. } => {
            let (joints, coefficients): (Vec<_>, _) = joints.iter().map(|&(body, c)| (joint(body), c)).unzip();
            (format!("a tendon over {}", joints.join(", ")), coefficients)
        }
        Transmission::Frame { frame } => (format!("frame `{}`", model.frames[*frame].name), Vec::new()),
    }
}

/// Returns the first difference between keyframes.
fn different_keyframes(model: &Model, file: &Model) -> Option<Difference> {
    let names = |m: &Model| m.keyframes.iter().map(|key| key.name.clone()).collect::<Vec<_>>();
    if let Some(what) = different_names("keyframes", &names(model), &names(file)) {
        return Some(what.into());
    }
    model.keyframes.iter().zip(&file.keyframes).find_map(|(a, b)| {
        let what = different_numbers("q", &a.q, &b.q).or_else(|| different_numbers("v", &a.v, &b.v))?;
        Some(format!("keyframe `{}`: {what}", a.name).into())
    })
}

/// Returns the first difference between constraints. The poses of their frames are not compared here, because all
/// frames are compared separately.
fn different_constraints(model: &Model, file: &Model) -> Option<Difference> {
    let names = |m: &Model| m.constraints.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    if let Some(what) = different_names("constraints", &names(model), &names(file)) {
        return Some(what.into());
    }
    let parts = |kind: &ModelConstraintKind| match *kind {
        ModelConstraintKind::Point { frames } => ("point", frames.map(Some), vec![]),
        ModelConstraintKind::Rigid { frames } => ("rigid", frames.map(Some), vec![]),
        ModelConstraintKind::Coupling { follower, leader, coefficients } => {
            ("coupling", [Some(follower), leader], coefficients.to_vec())
        }
    };
    model.constraints.iter().zip(&file.constraints).find_map(|(a, b)| {
        let (kind, ends, coefficients) = parts(&a.kind);
        let (other_kind, other_ends, others) = parts(&b.kind);
        let what = match (kind, ends) == (other_kind, other_ends) {
            true => different_numbers("its coefficients", &coefficients, &others)?,
            false => "it holds other things in the model and in the file".to_owned(),
        };
        Some(format!("constraint `{}`: {what}", a.name).into())
    })
}

/// Returns the difference between two lists of names, in the model and in the file. `parts` describes the named items,
/// for example `joints`.
fn different_names(parts: &str, model: &[String], file: &[String]) -> Option<String> {
    let list = |names: &[String]| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let said = |names: &[String]| if names.is_empty() { "none".to_owned() } else { list(names) };
    (model != file).then(|| format!("{parts}: {} in the model and {} in the file", said(model), said(file)))
}

/// Returns the difference between two lists of numbers, in the model and in the file.
fn different_numbers(name: &str, model: &[f64], file: &[f64]) -> Option<String> {
    let same = model.len() == file.len() && model.iter().zip(file).all(|(&a, &b)| close(a, b, ROUNDING));
    let said = |numbers: &[f64]| match numbers {
        [] => "missing".to_owned(),
        [one] => format!("{one}"),
        all => format!("{all:?}"),
    };
    (!same).then(|| format!("{name} is {} in the model and {} in the file", said(model), said(file)))
}

/// Returns the numbers of a pose: the translation and the columns of the rotation.
fn pose(X: Se3<f64>) -> Vec<f64> {
    [X.translation].into_iter().chain(X.rotation.columns()).flat_map(Vec3::to_array).collect()
}

/// Returns the first difference between a model and the model in a file. Differences up to the relative error
/// `rounding` are ignored.
pub(super) fn difference(model: &Model, file: &Model, rounding: f64) -> Option<Difference> {
    if let Some(difference) = different_robot(model, file) {
        return Some(difference);
    }
    for (a, b) in model.bodies.iter().zip(&file.bodies) {
        if !alike(a.inertia, b.inertia, rounding) {
            let pi = |b: &Body| inertial_parameters::from_inertia(b.inertia);
            let what = "cannot be written: the file gives";
            let what = format!("body `{}`: its inertial parameters {:?} {what} {:?}", a.name, pi(a), pi(b));
            return Some(Difference { what, causes: &["settotalmass"] });
        }
    }
    for (a, b) in model.gravity_compensation.iter().zip(&file.gravity_compensation) {
        let (body, other) = (&model.bodies[a.body], &file.bodies[b.body]);
        let (carried, given) = (a.carried(body.inertia), b.carried(other.inertia));
        let numbers = |I: Inertia<f64>| [vec![I.mass], I.mass_com.to_array().to_vec()].concat();
        let apart = |(&a, &b): (&f64, &f64)| !close(a, b, rounding);
        if numbers(carried).iter().zip(&numbers(given)).any(apart) {
            let what = "cannot be written, for its links have different ratios: the file gives";
            let (wanted, found) = (carried.mass, given.mass);
            return Some(format!("body `{}`: its compensated mass {wanted} kg {what} {found} kg", body.name).into());
        }
    }
    for (k, (a, b)) in numbers(model).into_iter().zip(numbers(file)).enumerate() {
        if let Some(slot) = (0..a.len()).find(|&slot| !close(a[slot], b[slot], rounding)) {
            let (a, b, what) = (a[slot], b[slot], NUMBERS[k]);
            let owner = model.bodies.iter().skip(1).find(|body| slots(body, k).contains(&slot));
            let joint = owner.map_or("", |body| &body.joint_name);
            let what = format!("joint `{joint}`: its {what} {a} cannot be written: the file gives {b}");
            return Some(Difference { what, causes: &["springdamper"] });
        }
    }
    None
}
