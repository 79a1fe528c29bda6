//! Numbers of a model that differ from the numbers in its file.

use super::differences::{Difference, different_robot};
use crate::body::{Body, FrameKind};
use crate::inertial_parameters;
use crate::joint::Joint;
use crate::model::Model;
use condyle_spatial::{Act, Inertia, Se3};
use std::collections::HashMap;
use std::ops::Range;

/// Maximum relative difference that is treated as a rounding error. Such errors arise when inertias are transformed
/// between the frames of several links.
pub(super) const ROUNDING: f64 = 1e-9;
/// Maximum relative difference that is always a rounding error. A larger difference may be the contribution of another
/// element of the file.
pub(super) const NO_SHARE: f64 = 1e-14;
/// Maximum relative difference of numbers that are treated as equal and not written. MuJoCo's compiler and this crate's
/// reader may differ by such rounding errors.
const EQUAL: f64 = 1e-12;
/// Minimum fraction of a body's mass that a link may keep. The centre of mass of a lighter link would have few correct
/// digits.
const LEAST_SHARE: f64 = 1e-3;

/// Numbers that must change in a file.
pub(super) struct Changes {
    pub(super) links: Vec<LinkChange>,
    pub(super) joints: Vec<JointChange>,
}

/// New inertia of a body, distributed over the links of the body.
pub(super) struct LinkChange {
    body: usize,
    /// Name of the link whose inertia changes by the difference between the body's new and old inertia.
    pub(super) link: String,
    /// Pose of the changed link, in the body's frame.
    placement: Se3<f64>,
    /// New inertia of the changed link, in the body's frame.
    inertia: Inertia<f64>,
    /// Names of the body's other links that have an inertia.
    others: Vec<String>,
    /// Names of the links whose inertia becomes zero.
    pub(super) emptied: Vec<String>,
}

/// New numbers of a joint.
pub(super) struct JointChange {
    body: usize,
    pub(super) name: String,
    /// Whether the joint is prismatic, so that its positions are lengths.
    pub(super) is_prismatic: bool,
    /// Numbers of the joint, in the order of [`NUMBERS`].
    values: [f64; 10],
    /// For each number, whether it differs from the number in the file.
    differs: [bool; 10],
}

/// Names of the numbers that a file has for each joint. The first two are limits of coordinates in q. The others belong
/// to degrees of freedom in v.
pub(super) const NUMBERS: [&str; 10] = [
    "lower limit",
    "upper limit",
    "velocity limit",
    "lower effort limit",
    "upper effort limit",
    "damping",
    "damping with the speed",
    "damping with the square of the speed",
    "friction",
    "armature",
];
/// Index of the damping in [`NUMBERS`]. A number with this or a larger index may be a sum over several elements of a
/// file.
const LOSSES: usize = 5;

/// Returns the numbers of a model, in the order of [`NUMBERS`].
pub(super) fn numbers(model: &Model) -> [Vec<f64>; 10] {
    let limits = model.limits.clone();
    let polynomial = |k: usize| model.damping_polynomial.iter().map(|d| d[k]).collect();
    [
        limits.lower,
        limits.upper,
        limits.velocity,
        limits.effort_lower,
        limits.effort_upper,
        model.damping.clone(),
        polynomial(0),
        polynomial(1),
        model.friction.clone(),
        model.armature.clone(),
    ]
}

/// Returns the slots of a joint in the k-th list of [`numbers`].
pub(super) fn slots(body: &Body, k: usize) -> Range<usize> {
    if k < 2 { body.idx_q..body.idx_q + body.joint.nq() } else { body.idx_v..body.idx_v + body.joint.nv() }
}

impl JointChange {
    /// Returns N numbers of the joint, from index `first` on; `None` if all of them equal the numbers in the file.
    fn some<const N: usize>(&self, first: usize) -> Option<[f64; N]> {
        let differs = self.differs[first..first + N].contains(&true);
        differs.then(|| std::array::from_fn(|k| self.values[first + k]))
    }

    /// Returns the minimum and maximum position (rad, m).
    pub(super) fn position(&self) -> Option<[f64; 2]> {
        self.some(0)
    }

    /// Returns the maximum speed (rad/s, m/s).
    pub(super) fn velocity(&self) -> Option<f64> {
        self.some(2).map(|[x]| x)
    }

    /// Returns the minimum and maximum effort (N m, N).
    pub(super) fn effort(&self) -> Option<[f64; 2]> {
        self.some(3)
    }

    /// Returns the coefficients of damping: the constant, the coefficient of the speed, and the coefficient of the
    /// squared speed.
    pub(super) fn damping(&self) -> Option<[f64; 3]> {
        self.some(LOSSES)
    }

    /// Returns the Coulomb friction (N m, N).
    pub(super) fn friction(&self) -> Option<f64> {
        self.some(8).map(|[x]| x)
    }

    /// Returns the inertia of the rotor, reflected to the joint (kg m², kg).
    pub(super) fn armature(&self) -> Option<f64> {
        self.some(9).map(|[x]| x)
    }

    /// Returns the maximum speed, and the minimum and maximum effort, even if they do not differ from the file.
    pub(super) fn all_limits(&self) -> (f64, [f64; 2]) {
        (self.values[2], [self.values[3], self.values[4]])
    }
}

impl LinkChange {
    /// Returns the new inertia in the frame of the link.
    pub(super) fn inertia(&self) -> Inertia<f64> {
        self.placement.act_inv(self.inertia)
    }
}

impl Changes {
    /// Compares two models of the same robot. `masses` contains the masses of its links (kg), by name.
    pub(super) fn new(model: &Model, was: &Model, masses: &HashMap<String, f64>) -> Result<Self, Difference> {
        match different_robot(model, was) {
            Some(difference) => Err(difference),
            None => Ok(Self { links: links(model, was, masses)?, joints: joints(model, was)? }),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.links.is_empty() && self.joints.is_empty()
    }

    /// Subtracts the contributions of other elements from the numbers to write. `now` is the model that the edited text
    /// describes. Returns whether there are changes.
    pub(super) fn take_shares_off(&mut self, model: &Model, now: &Model) -> bool {
        for change in &mut self.links {
            let (wanted, found) = (model.bodies[change.body].inertia, now.bodies[change.body].inertia);
            let rest = wanted - (found - change.inertia);
            let possible = |I: Inertia<f64>| inertial_parameters::check(I).is_ok();
            if rest.mass > LEAST_SHARE * wanted.mass && (possible(rest) || !possible(wanted)) {
                change.inertia = rest;
            } else {
                change.emptied.clone_from(&change.others);
            }
        }
        let (wanted, found) = (numbers(model), numbers(now));
        for change in &mut self.joints {
            for k in LOSSES..NUMBERS.len() {
                let slot = slots(&model.bodies[change.body], k).start;
                change.values[k] += wanted[k][slot] - found[k][slot];
            }
        }
        !self.is_empty()
    }
}

/// Finds the bodies whose inertia differs, and the link of each such body that is changed.
fn links(model: &Model, was: &Model, masses: &HashMap<String, f64>) -> Result<Vec<LinkChange>, String> {
    let mut changes = Vec::new();
    for (i, (body, before)) in model.bodies.iter().zip(&was.bodies).enumerate() {
        if alike(body.inertia, before.inertia, EQUAL) {
            continue;
        }
        let links: Vec<_> = model.frames.iter().filter(|f| f.body == i && f.kind == FrameKind::Link).collect();
        let mass = |name: &str| masses.get(name).copied().unwrap_or(0.0);
        let heaviest = links.iter().copied().max_by(|a, b| mass(&a.name).total_cmp(&mass(&b.name)));
        let carried = links.iter().copied().find(|f| f.name == body.name || i == 0);
        let Some(link) =
            carried.filter(|f| mass(&f.name) > 0.0).or(heaviest.filter(|f| mass(&f.name) > 0.0)).or(carried)
        else {
            return Err(format!("body `{}` has no link of its own whose inertia could be written", body.name));
        };
        let others = links.iter().filter(|f| f.name != link.name && masses.contains_key(&f.name));
        changes.push(LinkChange {
            body: i,
            link: link.name.clone(),
            placement: link.placement,
            inertia: body.inertia,
            others: others.map(|f| f.name.clone()).collect(),
            emptied: Vec::new(),
        });
    }
    Ok(changes)
}

/// Finds the joints whose limits, damping, friction or armature differ.
fn joints(model: &Model, was: &Model) -> Result<Vec<JointChange>, String> {
    let (new, old, mut changes) = (numbers(model), numbers(was), Vec::new());
    for (i, body) in model.bodies.iter().enumerate().skip(1).filter(|(_, b)| b.mimic.is_none()) {
        let (mut values, mut differs) = ([0.0; 10], [false; 10]);
        for (k, name) in NUMBERS.iter().enumerate() {
            let slots = slots(body, k);
            let found = &new[k][slots.clone()];
            let same = found.iter().zip(&old[k][slots]).all(|(&a, &b)| close(a, b, EQUAL));
            (values[k], differs[k]) = (found[0], !same);
            if differs[k] && found.iter().any(|x| *x != found[0]) {
                return Err(format!("joint `{}`: {name} {found:?}: a file has one for a joint", body.joint_name));
            }
        }
        if differs.contains(&true) {
            let (name, is_prismatic) = (body.joint_name.clone(), matches!(body.joint, Joint::Prismatic { .. }));
            changes.push(JointChange { body: i, name, is_prismatic, values, differs });
        }
    }
    Ok(changes)
}

/// Returns whether two numbers are equal up to rounding. Numbers below 0.001, such as sums of small armatures, have the
/// same tolerance as 0.001.
pub(super) fn close(a: f64, b: f64, rounding: f64) -> bool {
    let tolerance = rounding * a.abs().max(b.abs()).max(1e-3);
    a == b || tolerance.is_finite() && (a - b).abs() <= tolerance
}

/// Returns whether two inertias are equal up to rounding. The tolerance for the mass times the centre of mass, m c, is
/// relative to its upper bound √(m tr Ī), where Ī is the rotational inertia.
pub(super) fn alike(a: Inertia<f64>, b: Inertia<f64>, rounding: f64) -> bool {
    let size = |I: Inertia<f64>| (I.rotational.xx.abs() + I.rotational.yy.abs() + I.rotational.zz.abs()).max(1e-300);
    let (mass, size) = (a.mass.abs().max(b.mass.abs()), size(a).max(size(b)));
    let largest = |numbers: &[f64]| numbers.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let Inertia { mass: m, mass_com: h, rotational: J } = a - b;
    m.abs() <= rounding * mass
        && largest(&h.to_array()) <= rounding * (mass * size).sqrt()
        && largest(&[J.xx, J.xy, J.yy, J.xz, J.yz, J.zz]) <= rounding * size
}
