//! Additions to the tree of a model: springs, gravity compensation, actuators, keyframes and constraints. This module
//! adds such items to a builder, keeps them when a model is changed, and checks them.

use crate::actuator::{Actuator, Transmission};
use crate::body::FrameKind;
use crate::builder::{BodyId, ModelBuilder};
use crate::configuration::neutral;
use crate::constraint::{ModelConstraint, ModelConstraintKind};
use crate::error::Error;
use crate::joint::Joint;
use crate::keyframe::Keyframe;
use crate::model::Model;
use crate::passive::{GravityCompensation, Spring};
use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Act, Inertia, Scalar, Se3, Sym3, Vec3};

/// State of one joint in a keyframe: its body, position and velocity.
type JointState = (BodyId, Vec<f64>, Vec<f64>);

/// Additions of a builder. Bodies are identified by a [`BodyId`], frames by their index in the builder.
#[derive(Clone, Debug, Default)]
pub(crate) struct Additions {
    springs: Vec<(BodyId, [f64; 3], Vec<f64>)>,
    /// Fraction of each body's weight that is compensated, by the body's index in the builder.
    compensation: BTreeMap<usize, f64>,
    compensated_parts: Vec<CompensatedPart>,
    actuators: Vec<Actuator<BodyId>>,
    keyframes: Vec<(String, Vec<JointState>, Vec<f64>)>,
    constraints: Vec<(String, Draft)>,
    /// Warnings about the sources of appended models.
    warnings: Vec<Warning>,
}

/// Part of a body whose compensated fraction of weight differs from the rest of the body.
#[derive(Clone, Debug)]
struct CompensatedPart {
    body: BodyId,
    /// Fraction of the part's weight that is compensated. `None` if the body's inertia does not include the part; all
    /// of the part's weight is then compensated.
    ratio: Option<f64>,
    /// Mass (kg).
    mass: f64,
    /// Mass times centre of mass, in the body's frame (kg m).
    mass_com: Vec3<f64>,
}

/// Constraint that was added to a builder.
#[derive(Clone, Debug)]
enum Draft {
    Point([usize; 2]),
    Rigid([usize; 2]),
    Coupling(BodyId, Option<BodyId>, [f64; 5]),
}

impl ModelBuilder {
    /// Adds a spring to the joint of a body: see [`Spring`]. `rest` is the position at rest, with the same number of
    /// coordinates as the joint.
    pub fn spring(&mut self, body: BodyId, stiffness: [f64; 3], rest: &[f64]) {
        self.additions.springs.push((body, stiffness, rest.to_vec()));
    }

    /// Compensates the fraction `ratio` of a body's weight: see [`GravityCompensation`]. The weight includes everything
    /// that is merged into the body, except parts for which
    /// [`compensate_gravity_of_part`](Self::compensate_gravity_of_part) sets another fraction.
    pub fn compensate_gravity(&mut self, body: BodyId, ratio: f64) {
        self.additions.compensation.insert(body.0, ratio);
    }

    /// Compensates another fraction of the weight for one part of a body. `inertia` is the inertia of this part, in a
    /// frame at `placement` in the body's frame. The inertia of the body must include this inertia.
    pub fn compensate_gravity_of_part(&mut self, body: BodyId, placement: Se3<f64>, inertia: Inertia<f64>, ratio: f64) {
        self.add_compensated_part(body, placement, inertia, Some(ratio));
    }

    fn add_compensated_part(&mut self, body: BodyId, placement: Se3<f64>, inertia: Inertia<f64>, ratio: Option<f64>) {
        let Inertia { mass, mass_com, .. } = placement.act(Inertia { rotational: Sym3::zero(), ..inertia });
        self.additions.compensated_parts.push(CompensatedPart { body, ratio, mass, mass_com });
    }

    /// Adds an actuator. The actuator does not change limits, armature and damping, which belong to the joints
    /// ([`JointOptions`]).
    ///
    /// [`JointOptions`]: crate::JointOptions
    pub fn actuator(&mut self, actuator: Actuator<BodyId>) {
        self.additions.actuators.push(actuator);
    }

    /// Adds a named state: the positions and velocities of the joints of some bodies. The other joints are at their
    /// neutral position and at rest. `control` has one entry for each actuator, in the order in which the actuators are
    /// added. Missing entries are 0.
    pub fn keyframe(&mut self, name: &str, joints: Vec<(BodyId, Vec<f64>, Vec<f64>)>, control: Vec<f64>) {
        self.additions.keyframes.push((name.to_owned(), joints, control));
    }

    /// Adds a constraint that keeps a point of one body and a point of another body together. Each point is the origin
    /// of a frame, given by a body and a placement in the body's frame. The frames are named `name#1` and `name#2`.
    pub fn constraint_point(&mut self, name: &str, at: [(BodyId, Se3<f64>); 2]) {
        let frames = self.constraint_frames(name, at);
        self.additions.constraints.push((name.to_owned(), Draft::Point(frames)));
    }

    /// Adds a constraint that keeps a frame of one body and a frame of another body together. The frames are named
    /// `name#1` and `name#2`.
    pub fn constraint_rigid(&mut self, name: &str, at: [(BodyId, Se3<f64>); 2]) {
        let frames = self.constraint_frames(name, at);
        self.additions.constraints.push((name.to_owned(), Draft::Rigid(frames)));
    }

    /// Adds a constraint between the positions q_f of a follower and q_l of a leader: q_f = Σ cᵢ q_lⁱ, or q_f = c₀ if
    /// `leader` is `None`.
    pub fn constraint_coupling(
        &mut self,
        name: &str,
        follower: BodyId,
        leader: Option<BodyId>,
        coefficients: [f64; 5],
    ) {
        self.additions.constraints.push((name.to_owned(), Draft::Coupling(follower, leader, coefficients)));
    }

    fn constraint_frames(&mut self, name: &str, at: [(BodyId, Se3<f64>); 2]) -> [usize; 2] {
        let first = self.frames.len();
        for (k, (body, placement)) in at.into_iter().enumerate() {
            self.frame_of_kind(&format!("{name}#{}", k + 1), FrameKind::Constraint, body, placement);
        }
        [first, first + 1]
    }

    /// Adds the additions of a model to this builder. `place` maps each body of the model to a body of the builder and
    /// a placement in the frame of this body. The model's frames begin at index `first_frame`. If a body is locked at
    /// q, its additions are left out, or act on the body that carries it.
    pub(crate) fn append_additions(
        &mut self,
        model: &Model,
        prefix: &str,
        place: &[(BodyId, Se3<f64>)],
        first_frame: usize,
        locked: &[usize],
        q: &[f64],
    ) {
        let body = |i: &usize| (!locked.contains(i)).then(|| place[*i].0);
        self.additions.warnings.extend(model.warnings.iter().filter(|w| w.is_about_source()).cloned());
        for Spring { body: i, stiffness, rest } in &model.springs {
            if let Some(id) = body(i) {
                self.spring(id, *stiffness, rest);
            }
        }
        let mut ratios = vec![0.0; model.bodies.len()];
        for &GravityCompensation { body: i, ratio, added_mass: mass, added_mass_com: mass_com } in
            &model.gravity_compensation
        {
            let (on, pXb) = place[i];
            ratios[i] = ratio;
            self.add_compensated_part(on, pXb, Inertia { mass, mass_com, rotational: Sym3::zero() }, None);
        }
        for (i, ratio) in ratios.into_iter().enumerate() {
            let (on, pXb) = place[i];
            if i == 0 || locked.contains(&i) {
                self.compensate_gravity_of_part(on, pXb, model.bodies[i].inertia, ratio);
            } else if ratio != 0.0 {
                self.compensate_gravity(on, ratio);
            }
        }
        let (before, mut kept) = (self.additions.actuators.len(), Vec::new());
        for (k, old) in model.actuators.iter().enumerate() {
            if let Some(mut actuator) = old.renamed(body, |frame| first_frame + frame) {
                actuator.name.insert_str(0, prefix);
                if let Transmission::Tendon { joints, .. } = &old.transmission {
                    let held = joints.iter().filter(|(i, _)| locked.contains(i));
                    let length: f64 = held.map(|&(i, coefficient)| coefficient * model.joint_position(i, q)).sum();
                    // With the length l of the tendon, the part of the force −kp l that depends on the locked joint is
                    // now constant.
                    actuator.bias -= actuator.kp * actuator.gear[0] * length;
                }
                self.actuator(actuator);
                kept.push(k);
            }
        }
        for keyframe in &model.keyframes {
            let own = |&(i, b): &(usize, &crate::body::Body)| i > 0 && b.mimic.is_none() && !locked.contains(&i);
            let joints = model.bodies.iter().enumerate().filter(own).map(|(i, b)| {
                let (nq, nv) = (b.joint.nq(), b.joint.nv());
                (place[i].0, keyframe.q[b.idx_q..][..nq].to_vec(), keyframe.v[b.idx_v..][..nv].to_vec())
            });
            let control = kept.iter().map(|&k| keyframe.control[k]);
            let control = core::iter::repeat_n(0.0, before).chain(control).collect();
            self.keyframe(&format!("{prefix}{}", keyframe.name), joints.collect(), control);
        }
        for ModelConstraint { name, kind } in &model.constraints {
            let moved = |frames: &[usize; 2]| {
                let frames = frames.map(|frame| first_frame + frame);
                (self.frames[frames[0]].body != self.frames[frames[1]].body).then_some(frames)
            };
            let draft = match kind {
                ModelConstraintKind::Point { frames } => moved(frames).map(Draft::Point),
                ModelConstraintKind::Rigid { frames } => moved(frames).map(Draft::Rigid),
                ModelConstraintKind::Coupling { follower, leader, coefficients: c } => {
                    let held = |id, at| Some(Draft::Coupling(id, None, [at, 0.0, 0.0, 0.0, 0.0]));
                    match (body(follower), leader) {
                        (Some(id), Some(i)) if locked.contains(i) => {
                            let at = model.joint_position(*i, q);
                            held(id, c.iter().rev().fold(0.0, |sum, c| sum * at + c)) // Σ cᵢ qⁱ
                        }
                        (Some(id), leader) => Some(Draft::Coupling(id, leader.as_ref().and_then(body), *c)),
                        // a follower that is locked at q_f holds the leader at q_l = (q_f − c₀) / c₁
                        (None, Some(i)) if c[1] != 0.0 && c[2..] == [0.0; 3] => {
                            body(i).and_then(|id| held(id, (model.joint_position(*follower, q) - c[0]) / c[1]))
                        }
                        (None, Some(i)) if c[1..] != [0.0; 4] && !locked.contains(i) => {
                            let [follower, leader] = [*follower, *i].map(|i| &model.bodies[i].joint_name);
                            let why = format!("joint `{follower}` is locked, and its polynomial is not linear");
                            let what = format!("{why}: joint `{leader}`, which it follows, is left free");
                            let element = format!("constraint `{prefix}{name}`");
                            self.additions.warnings.push(Warning::LeftOut { place: None, element, what });
                            None
                        }
                        (None, _) => None,
                    }
                }
            };
            if let Some(draft) = draft {
                self.additions.constraints.push((format!("{prefix}{name}"), draft));
            }
        }
    }
}

impl Additions {
    /// Scales the masses of parts with their own compensated fraction of weight.
    #[cfg(feature = "loaders")]
    pub(crate) fn scale_masses(&mut self, by: f64) {
        for part in &mut self.compensated_parts {
            (part.mass, part.mass_com) = (part.mass * by, part.mass_com.scale(by));
        }
    }

    /// Moves the additions into the built model. `number` maps each body of the builder to its index in the model.
    pub(crate) fn add_to(self, model: &mut Model, number: &[usize]) -> Result<(), Error> {
        let Self { springs, compensation, compensated_parts, actuators, keyframes, constraints, warnings } = self;
        model.warnings.extend(warnings);
        let index = |id: BodyId| number[id.0];
        model.springs =
            springs.into_iter().map(|(b, stiffness, rest)| Spring { body: index(b), stiffness, rest }).collect();
        model.gravity_compensation = merged_compensation(&compensation, &compensated_parts, number);
        model.actuators =
            actuators.iter().filter_map(|actuator| actuator.renamed(|&b| Some(index(b)), |frame| frame)).collect();
        for (name, joints, mut control) in keyframes {
            if control.len() > model.actuators.len() {
                let (expected, found) = (model.actuators.len(), control.len());
                return Err(Error::Length { name: "keyframes.control", expected, found });
            }
            control.resize(model.actuators.len(), 0.0);
            let (mut q, mut v) = (neutral(model), vec![0.0; model.tree.nv]);
            for (b, joint_q, joint_v) in joints {
                let body = &model.bodies[index(b)];
                let (nq, nv) = (body.joint.nq(), body.joint.nv());
                if body.mimic.is_some() {
                    continue; // a follower uses the coordinate of its leader
                }
                if joint_q.len() != nq || joint_v.len() != nv {
                    let (q, v) = (joint_q.len(), joint_v.len());
                    let what = format!("keyframe `{name}` has {q} and {v} numbers, expected {nq} and {nv}");
                    return Err(Error::Joint { joint: body.joint_name.clone(), what });
                }
                q[body.idx_q..][..nq].copy_from_slice(&joint_q);
                v[body.idx_v..][..nv].copy_from_slice(&joint_v);
            }
            model.keyframes.push(Keyframe { name, q, v, control });
        }
        let constraint = |(name, draft)| {
            let kind = match draft {
                Draft::Point(frames) => ModelConstraintKind::Point { frames },
                Draft::Rigid(frames) => ModelConstraintKind::Rigid { frames },
                Draft::Coupling(follower, leader, coefficients) => {
                    ModelConstraintKind::Coupling { follower: index(follower), leader: leader.map(index), coefficients }
                }
            };
            ModelConstraint { name, kind }
        };
        model.constraints = constraints.into_iter().map(constraint).collect();
        Ok(())
    }
}

/// Returns the gravity compensation of each body of the built model. `number` maps each body of the builder to its
/// index in the model.
fn merged_compensation(
    ratios: &BTreeMap<usize, f64>,
    parts: &[CompensatedPart],
    number: &[usize],
) -> Vec<GravityCompensation> {
    let of_body = |b: usize| GravityCompensation {
        body: number[b],
        ratio: ratios.get(&b).copied().unwrap_or(0.0),
        added_mass: 0.0,
        added_mass_com: Vec3::zero(),
    };
    let mut merged: BTreeMap<usize, GravityCompensation> =
        ratios.keys().filter(|&&b| number[b] > 0).map(|&b| (number[b], of_body(b))).collect();
    for &CompensatedPart { body, ratio, mass, mass_com } in parts.iter().filter(|part| number[part.body.0] > 0) {
        let whole = merged.entry(number[body.0]).or_insert_with(|| of_body(body.0));
        let other = ratio.map_or(1.0, |ratio| ratio - whole.ratio);
        whole.added_mass += other * mass;
        whole.added_mass_com += mass_com.scale(other);
    }
    let acts = |c: &GravityCompensation| (c.ratio, c.added_mass, c.added_mass_com) != (0.0, 0.0, Vec3::zero());
    merged.into_values().filter(acts).collect()
}

impl Model {
    /// Returns the position of a joint with one degree of freedom (rad, m). The position of a continuous joint is its
    /// angle.
    fn joint_position(&self, body: usize, q: &[f64]) -> f64 {
        let body = &self.bodies[body];
        let q = &q[body.idx_q..];
        let own = match body.joint {
            Joint::Continuous { .. } => Scalar::atan2(q[1], q[0]),
            _ => q[0],
        };
        body.mimic.map_or(own, |mimic| mimic.ratio * own + mimic.offset)
    }

    /// Checks springs, gravity compensation, actuators, keyframes and constraints.
    pub(crate) fn check_additions(&self) -> Result<(), Error> {
        let there = |name: &'static str, body: usize| match self.bodies.get(body) {
            Some(found) if body > 0 => Ok(found),
            _ => Err(Error::Body { body: format!("{body}"), what: format!("{name} names a body that has no joint") }),
        };
        let joint_of_one = |name: &'static str, i: usize| {
            let body = there(name, i)?;
            let what = || format!("{name} is for joints of one degree of freedom");
            if body.joint.nv() == 1 {
                Ok(())
            } else {
                Err(Error::Joint { joint: body.joint_name.clone(), what: what() })
            }
        };
        let frame = |i: usize| match self.frames.get(i) {
            Some(frame) => Ok(frame.body),
            None => Err(Error::Frame { frame: format!("{i}"), what: "there is no such frame".to_owned() }),
        };
        for Spring { body, stiffness, rest } in &self.springs {
            let body = there("a spring", *body)?;
            let wrong = |what: String| Err(Error::Joint { joint: body.joint_name.clone(), what });
            if rest.len() != body.joint.nq() {
                return wrong(format!("its spring rests at {} numbers, expected {}", rest.len(), body.joint.nq()));
            }
            if let Some(x) = stiffness.iter().chain(rest).find(|x| !x.is_finite()) {
                return wrong(format!("its spring has the number {x}, expected finite ones"));
            }
        }
        for carried in &self.gravity_compensation {
            let body = there("a gravity compensation", carried.body)?;
            let GravityCompensation { ratio, added_mass, added_mass_com, .. } = carried;
            if !added_mass_com.to_array().into_iter().chain([*ratio, *added_mass]).all(f64::is_finite) {
                let what = "its gravity compensation is not finite".to_owned();
                return Err(Error::Body { body: body.name.clone(), what });
            }
        }
        for actuator in &self.actuators {
            match &actuator.transmission {
                Transmission::Joint { body } => drop(there("an actuator", *body)?),
                Transmission::Tendon { joints, .. } => {
                    joints.iter().try_for_each(|&(body, _)| joint_of_one("a tendon", body))?;
                }
                Transmission::Frame { frame: i } => drop(frame(*i)?),
            }
        }
        for Keyframe { q, v, control, .. } in &self.keyframes {
            for (name, found, expected) in [
                ("keyframes.q", q.len(), self.tree.nq),
                ("keyframes.v", v.len(), self.tree.nv),
                ("keyframes.control", control.len(), self.actuators.len()),
            ] {
                if found != expected {
                    return Err(Error::Length { name, expected, found });
                }
            }
            self.check_state(q, v)?;
        }
        for (k, ModelConstraint { name, kind }) in self.constraints.iter().enumerate() {
            let wrong = |what: String| Error::Constraint { constraint: k, what: format!("`{name}`: {what}") };
            match kind {
                ModelConstraintKind::Point { frames } | ModelConstraintKind::Rigid { frames } => {
                    if frame(frames[0])? == frame(frames[1])? {
                        return Err(wrong("both frames are fixed to one body".to_owned()));
                    }
                }
                ModelConstraintKind::Coupling { follower, leader, coefficients } => {
                    for i in [Some(*follower), *leader].into_iter().flatten() {
                        joint_of_one("a coupling", i)?;
                    }
                    if coefficients.iter().any(|c| !c.is_finite()) {
                        return Err(wrong("a coefficient is not finite".to_owned()));
                    }
                }
            }
        }
        Ok(())
    }
}
