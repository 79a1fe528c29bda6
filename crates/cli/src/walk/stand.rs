//! Posture in which a robot stands before it walks: a keyframe, angles of joints, or bent legs.

use super::feet::FoundFoot;
use crate::error::{Error, nearest};
use condyle::{Data, Joint, Model, ReferenceFrame, Vec3, forward_kinematics, integrate};
use core::f64::consts::PI;
use nalgebra::{DMatrix, DVector};

/// Names of keyframes that are stands, in this order of preference.
const STANDS: [&str; 3] = ["home", "stand", "standing"];
/// Length of a leg in the stand, relative to its largest length: of two legs, and of more legs. Usual
/// stands have similar values (G1: 0.94, TALOS: 0.92, Go2: 0.70, ANYmal: 0.77).
const LENGTHS: [f64; 2] = [0.93, 0.75];
/// Distance between a joint's position and its limits, relative to the range of the joint.
const MARGIN: f64 = 0.02;
/// Number of knee angles from which the largest length of a leg is computed.
const ANGLES: usize = 144;
/// Bend below which a leg counts as straight: its length relative to its largest length.
const STRAIGHT: f64 = 0.97;
/// Horizontal distance of a foot from its place under the hip below which a posture is usable, relative to the length.
const BELOW: f64 = 0.2;
/// Maximum number of steps for a leg, and damping of a step (m).
const STEPS: usize = 200;
const DAMPING: f64 = 0.02;
/// Distance at which a foot counts as placed (m).
const PLACED: f64 = 1e-4;
/// Angle below which the report leaves a joint out (rad).
const WRITTEN: f64 = 5e-4;

/// Stand of a robot.
pub(crate) struct Stand {
    /// Position, nq numbers. The trunk is level, at the origin.
    pub q: Vec<f64>,
    /// Source of the posture, for the report.
    pub source: String,
    /// Whether the legs may still be bent.
    pub is_free: bool,
}

/// Returns the position before legs are bent: the keyframe or the joints that the user gives, or a keyframe of the
/// robot, or the neutral position within the limits of the joints.
pub(crate) fn begin(model: &Model, given: Option<&str>) -> Result<Stand, Error> {
    let keyframe = |name: &str| model.keyframes().iter().find(|keyframe| keyframe.name == name);
    let at = |name: &str| {
        let mut q = keyframe(name)?.q.clone();
        q[..7].copy_from_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        Some(Stand { q, source: format!("keyframe `{name}`"), is_free: false })
    };
    let Some(given) = given else {
        let known = STANDS.iter().find_map(|name| at(name));
        let source = "neutral position".to_owned();
        return Ok(known.unwrap_or_else(|| Stand {
            q: clamped(model, condyle::neutral(model)),
            source,
            is_free: true,
        }));
    };
    if !given.contains('=') {
        let names = model.keyframes().iter().map(|keyframe| &*keyframe.name);
        let what = || match model.keyframes().is_empty() {
            true => format!("no keyframe `{given}`, because the robot has none; expected joint=angle,…"),
            false => format!("no keyframe `{given}`{}", nearest(given, names)),
        };
        return at(given).ok_or_else(|| Error::Option { option: "posture", what: what() });
    }
    let mut q = clamped(model, condyle::neutral(model));
    for part in given.split(',') {
        let wrong = |what: String| Error::Option { option: "posture", what };
        let (name, angle) = part.split_once('=').ok_or_else(|| wrong(format!("`{part}`: expected joint=angle")))?;
        let angle: f64 = angle
            .trim()
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite())
            .ok_or_else(|| wrong(format!("`{}` is not a finite number", angle.trim())))?;
        let body = &model.bodies()[model.joint(name.trim())?];
        match (body.joint, body.mimic.is_some()) {
            (_, true) => return Err(wrong(format!("joint `{}` follows another joint", name.trim()))),
            (Joint::Continuous { .. }, _) => (q[body.idx_q], q[body.idx_q + 1]) = (angle.cos(), angle.sin()),
            (joint, _) if joint.nq() == 1 => q[body.idx_q] = angle,
            _ => return Err(wrong(format!("joint `{}` has more than one coordinate", name.trim()))),
        }
    }
    Ok(Stand { q, source: "given by --posture".to_owned(), is_free: false })
}

/// Returns the position q within the limits of the joints, at a small distance from each limit.
fn clamped(model: &Model, mut q: Vec<f64>) -> Vec<f64> {
    for ((q, lower), upper) in q.iter_mut().zip(&model.limits().lower).zip(&model.limits().upper) {
        let margin = if (upper - lower).is_finite() { MARGIN * (upper - lower) } else { 0.0 };
        if *q <= *lower {
            *q = lower + margin;
        } else if *q >= *upper {
            *q = upper - margin;
        }
    }
    q
}

/// Leg: the joints between the trunk and a foot.
struct Leg<'a> {
    model: &'a Model,
    frame: usize,
    is_sole: bool,
    /// Bodies of the leg, from the hip to the foot.
    bodies: Vec<usize>,
    /// Body of the joint whose angle changes the length of the leg most.
    knee: usize,
}

impl<'a> Leg<'a> {
    fn new(model: &'a Model, data: &mut Data<f64>, q: &[f64], foot: &FoundFoot) -> Option<Self> {
        let mut bodies = Vec::new();
        let mut body = model.frames()[foot.frame].body;
        while body > 1 {
            bodies.push(body);
            body = model.bodies()[body].parent;
        }
        bodies.reverse();
        let mut leg = Self { model, frame: foot.frame, is_sole: foot.sole().is_some(), bodies, knee: 0 };
        let is_hinge = |&&b: &&usize| model.bodies()[b].joint.nq() == 1 && model.bodies()[b].mimic.is_none();
        let range = |leg: &Self, data: &mut Data<f64>, body: usize| {
            let lengths = leg.lengths(data, q, body);
            let all = || lengths.iter().map(|(_, length)| *length);
            all().fold(0.0, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let ranges: Vec<_> = leg.bodies.iter().filter(is_hinge).map(|&b| (range(&leg, data, b), b)).collect();
        leg.knee = ranges.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?.1;
        Some(leg)
    }

    /// Returns the vector from the hip to the foot (m).
    fn along(&self, data: &mut Data<f64>, q: &[f64]) -> Vec3<f64> {
        let placements = forward_kinematics(self.model, data, q);
        placements.frame(self.frame).translation - placements.body(self.bodies[0]).translation
    }

    /// Returns angles of a joint, and the length of the leg at each angle (m).
    fn lengths(&self, data: &mut Data<f64>, q: &[f64], body: usize) -> Vec<(f64, f64)> {
        let mut q = q.to_vec();
        let mut length = |k: usize| {
            let angle = PI * (2.0 * k as f64 / ANGLES as f64 - 1.0);
            q[self.model.bodies()[body].idx_q] = angle;
            (angle, self.along(data, &q).norm())
        };
        (0..ANGLES).map(&mut length).collect()
    }

    /// Bends the leg in the position q to a part of its largest length. The foot stays where it is under the hip of the
    /// straight leg. Returns whether the posture was changed; `None` if the foot cannot get there.
    fn bend(&self, data: &mut Data<f64>, q: &mut Vec<f64>, share: f64, middle: f64, legs: usize) -> Option<bool> {
        let knee = &self.model.bodies()[self.knee];
        let lengths = self.lengths(data, q, self.knee);
        let (straight, longest) = lengths.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut straight_q = q.clone();
        straight_q[knee.idx_q] = straight;
        let (now, target) = (self.along(data, q), self.along(data, &straight_q));
        let far = (now.x - target.x).hypot(now.y - target.y);
        if now.norm() < STRAIGHT * longest && far < BELOW * longest && now.z < -0.3 * longest {
            return Some(false);
        }
        let target = Vec3 { z: share * target.z, ..target };
        let bend = 2.0 * share.acos();
        let (lower, upper) = (self.model.limits().lower[knee.idx_q], self.model.limits().upper[knee.idx_q]);
        let angle = |bend: f64| (straight + bend).clamp(lower, upper);
        let tries = [bend, -bend].into_iter().filter(|bend| (angle(*bend) - straight) / bend > 0.5);
        let placed: Vec<_> = tries
            .filter_map(|bend| {
                let mut q = q.clone();
                q[knee.idx_q] = angle(bend);
                self.place(data, &mut q, target).then(|| {
                    let x = forward_kinematics(self.model, data, &q).body(self.knee).translation.x;
                    (q, x)
                })
            })
            .collect();
        // The knees of two legs point forwards. Those of more legs point to the middle of the robot.
        let rank = |x: f64| if legs == 2 { -x } else { (x - middle).abs() };
        *q = placed.into_iter().min_by(|a, b| rank(a.1).total_cmp(&rank(b.1)))?.0;
        Some(true)
    }

    /// Moves the joints of the leg until the foot is at the target, relative to the hip. A sole stays level. Returns
    /// whether the foot got there. The method is the damped least squares of `posture::reaching`.
    fn place(&self, data: &mut Data<f64>, q: &mut Vec<f64>, target: Vec3<f64>) -> bool {
        let (rows, nv) = (if self.is_sole { 6 } else { 3 }, self.model.nv());
        let mut full = DMatrix::zeros(6, nv);
        for _ in 0..STEPS {
            let placements = forward_kinematics(self.model, data, q);
            let at = placements.frame(self.frame);
            let e = placements.body(self.bodies[0]).translation + target - at.translation;
            let [x, y, z] = at.rotation.columns();
            // Small angles between the axes of the sole and of the trunk.
            let turn = [z.y - y.z, x.z - z.x, y.x - x.y].map(|double| 0.5 * double);
            let error = DVector::from_iterator(rows, [e.x, e.y, e.z, turn[0], turn[1], turn[2]].into_iter().take(rows));
            if error.amax() < PLACED {
                return true;
            }
            placements.frame_jacobian(self.frame, ReferenceFrame::LocalWorldAligned, &mut full);
            let mut J = full.rows(0, rows).into_owned();
            for k in 0..nv {
                let is_own = self.bodies.iter().any(|&b| {
                    let body = &self.model.bodies()[b];
                    (body.idx_v..body.idx_v + body.joint.nv()).contains(&k)
                });
                if !is_own {
                    J.column_mut(k).fill(0.0);
                }
            }
            let damped = &J * J.transpose() + DMatrix::identity(rows, rows) * (DAMPING * DAMPING);
            let Some(x) = damped.cholesky().map(|factors| factors.solve(&error)) else { return false };
            let step = J.transpose() * x;
            let mut moved = q.clone();
            integrate(self.model, q, step.as_slice(), &mut moved);
            *q = clamped(self.model, moved);
        }
        false
    }
}

/// Bends the legs of a stand, unless their posture is usable or given. A straight leg cannot be used, because it cannot
/// push the trunk upwards.
pub(crate) fn bend(model: &Model, stand: &mut Stand, feet: &[FoundFoot]) -> Result<(), Error> {
    if !stand.is_free {
        return Ok(());
    }
    let share = LENGTHS[usize::from(feet.len() > 2)];
    let mut data = Data::new(model);
    let legs: Vec<_> = feet.iter().filter_map(|foot| Leg::new(model, &mut data, &stand.q, foot)).collect();
    let hips: Vec<f64> = {
        let placements = forward_kinematics(model, &mut data, &stand.q);
        legs.iter().map(|leg| placements.body(leg.bodies[0]).translation.x).collect()
    };
    let middle = hips.iter().sum::<f64>() / hips.len().max(1) as f64;
    let (mut q, mut bent) = (stand.q.clone(), 0);
    for leg in &legs {
        match leg.bend(&mut data, &mut q, share, middle, legs.len()) {
            Some(changed) => bent += usize::from(changed),
            None => {
                let foot = &model.frames()[leg.frame].name;
                let what = format!("the leg of `{foot}` could not be bent; give the joints of a stand: joint=angle,…");
                return Err(Error::Option { option: "posture", what });
            }
        }
    }
    if bent > 0 {
        stand.q = q;
        stand.source = format!("legs bent to {:.0} % of their length", 100.0 * share);
    }
    Ok(())
}

/// Moves the trunk of the position q, so that the lowest foot is on the ground z = 0.
pub(crate) fn put_down(model: &Model, q: &mut [f64], feet: &[FoundFoot]) {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let lowest = feet.iter().map(|foot| placements.frame(foot.frame).translation.z - foot.height());
    q[2] -= lowest.fold(f64::INFINITY, f64::min);
}

/// Returns the angles of joints that differ from the neutral position, as `--posture` accepts them.
pub(crate) fn text(model: &Model, q: &[f64]) -> String {
    let neutral = condyle::neutral(model);
    let is_hinge = |b: &condyle::tree::Body| b.joint.nq() == 1 && b.mimic.is_none();
    let differs = |b: &&condyle::tree::Body| is_hinge(b) && (q[b.idx_q] - neutral[b.idx_q]).abs() >= WRITTEN;
    let angle = |b: &condyle::tree::Body| format!("{}={:.3}", b.joint_name, q[b.idx_q]);
    model.bodies()[2..].iter().filter(differs).map(angle).collect::<Vec<_>>().join(",")
}
