//! Models in formats of serde. A file contains the fields that a user may edit. When a file is read, all other fields
//! are computed from these fields, and the model is checked.

use crate::actuator::Actuator;
use crate::body::{Body, Frame, Limits};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::constraint::ModelConstraint;
use crate::error::Error;
use crate::keyframe::Keyframe;
use crate::model::Model;
use crate::passive::{GravityCompensation, Spring};
use crate::warning::Warning;
use alloc::collections::BTreeSet;
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Inertia, Se3, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Fields of a model that a file contains. Each field has the same meaning as in [`Model`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    name: String,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    limits: Limits,
    damping: Vec<f64>,
    friction: Vec<f64>,
    #[serde(default)]
    damping_polynomial: Vec<[f64; 2]>,
    #[serde(default)]
    springs: Vec<Spring>,
    #[serde(default)]
    gravity_compensation: Vec<GravityCompensation>,
    #[serde(default)]
    actuators: Vec<Actuator>,
    #[serde(default)]
    keyframes: Vec<Keyframe>,
    #[serde(default)]
    constraints: Vec<ModelConstraint>,
    armature: Vec<f64>,
    gravity: Vec3<f64>,
    warnings: Vec<Warning>,
}

impl Serialize for Model {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let description = Description {
            name: self.name.clone(),
            bodies: self.bodies.clone(),
            frames: self.frames.clone(),
            limits: self.limits.clone(),
            damping: self.damping.clone(),
            friction: self.friction.clone(),
            damping_polynomial: self.damping_polynomial.clone(),
            springs: self.springs.clone(),
            gravity_compensation: self.gravity_compensation.clone(),
            actuators: self.actuators.clone(),
            keyframes: self.keyframes.clone(),
            constraints: self.constraints.clone(),
            armature: self.armature.clone(),
            gravity: self.gravity,
            warnings: self.warnings.clone(),
        };
        description.serialize(to)
    }
}

impl<'de> Deserialize<'de> for Model {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Description::deserialize(from)?.model().map_err(serde::de::Error::custom)
    }
}

impl Description {
    /// Builds and checks the model that a file describes.
    fn model(mut self) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(&self.name);
        builder.gravity(self.gravity);
        let ids = self.add_bodies(&mut builder)?;
        for frame in &self.frames {
            let Some(&body) = ids.get(frame.body) else {
                let what = format!("there is no body {}", frame.body);
                return Err(Error::Frame { frame: frame.name.clone(), what });
            };
            builder.frame_of_kind(&frame.name, frame.kind, body, frame.placement);
        }
        let mut model = builder.build()?;
        for (built, body) in model.bodies.iter().zip(&self.bodies).skip(1) {
            let (expected, found) = ((built.idx_q, built.idx_v), (body.idx_q, body.idx_v));
            if expected != found {
                let ((q, v), (expected_q, expected_v)) = (found, expected);
                let what = format!("begins at {q} in q and {v} in v, expected {expected_q} and {expected_v}");
                return Err(Error::Body { body: body.name.clone(), what });
            }
        }
        if self.limits.effort_lower.is_empty() {
            // the file is of a version with limits that are the same in both directions
            self.limits.effort_lower = self.limits.effort_upper.iter().map(|upper| -upper).collect();
        }
        self.check_coordinates(model.tree.nq, model.tree.nv)?;
        let Self { bodies, limits, damping, friction, armature, warnings, .. } = self;
        (model.limits, model.damping, model.friction, model.armature) = (limits, damping, friction, armature);
        if !self.damping_polynomial.is_empty() {
            model.damping_polynomial = self.damping_polynomial;
        }
        (model.springs, model.gravity_compensation) = (self.springs, self.gravity_compensation);
        (model.actuators, model.keyframes, model.constraints) = (self.actuators, self.keyframes, self.constraints);
        for keyframe in model.keyframes.iter_mut().filter(|keyframe| keyframe.control.is_empty()) {
            keyframe.control = vec![0.0; model.actuators.len()]; // files of earlier versions have no controls
        }
        // Bodies `name#1`, … without mass connect the joints of a chain, unless the file has a warning about them.
        let warned: BTreeSet<&str> = warnings
            .iter()
            .filter_map(|w| if let Warning::Massless { body } = w { Some(&**body) } else { None })
            .collect();
        let massless = |b: &Body| b.inertia == Inertia::zero() && !warned.contains(&*b.name);
        model.between = bodies.iter().map(|b| b.name.contains('#') && massless(b)).collect();
        model.warnings = warnings;
        model.validate()?;
        Ok(model)
    }

    /// Adds the bodies, which must be listed in depth-first order.
    fn add_bodies(&self, builder: &mut ModelBuilder) -> Result<Vec<BodyId>, Error> {
        let Some(world) = self.bodies.first() else {
            return Err(Error::Length { name: "bodies", expected: 1, found: 0 });
        };
        builder.merge(WORLD, Se3::identity(), world.inertia);
        let (mut ids, mut path) = (vec![WORLD], vec![0]);
        for (i, body) in self.bodies.iter().enumerate().skip(1) {
            while path.last().is_some_and(|&last| last != body.parent) {
                path.pop();
            }
            if path.is_empty() {
                let what = format!("number {i} on body {}: bodies stand parents first, depth first", body.parent);
                return Err(Error::Body { body: body.name.clone(), what });
            }
            path.push(i);
            let (names, parent) = ((&*body.name, &*body.joint_name), ids[body.parent]);
            let options = Default::default();
            ids.push(builder.body_with(names, parent, body.joint, body.placement, body.inertia, options));
        }
        // Limits the number of bodies before the leaders are searched among them.
        builder.check_size()?;
        for (i, body) in self.bodies.iter().enumerate().skip(1) {
            let Some(mimic) = body.mimic else { continue };
            let leads = |b: &Body| b.mimic.is_none() && b.idx_v == body.idx_v;
            let Some(leader) = self.bodies[1..].iter().position(leads) else {
                let what = format!("mimics the joint whose velocity begins at {}: there is none", body.idx_v);
                return Err(Error::Joint { joint: body.joint_name.clone(), what });
            };
            builder.mimic(ids[i], ids[leader + 1], mimic);
        }
        Ok(ids)
    }

    /// Checks the lengths of the lists that have one entry for each coordinate.
    fn check_coordinates(&self, nq: usize, nv: usize) -> Result<(), Error> {
        let Limits { lower, upper, velocity, effort_lower, effort_upper } = &self.limits;
        for (name, numbers, expected) in [
            ("limits.lower", lower, nq),
            ("limits.upper", upper, nq),
            ("limits.velocity", velocity, nv),
            ("limits.effort_lower", effort_lower, nv),
            ("limits.effort_upper", effort_upper, nv),
            ("damping", &self.damping, nv),
            ("friction", &self.friction, nv),
            ("armature", &self.armature, nv),
        ] {
            if numbers.len() != expected {
                return Err(Error::Length { name, expected, found: numbers.len() });
            }
        }
        let (name, found) = ("damping_polynomial", self.damping_polynomial.len());
        if ![0, nv].contains(&found) {
            return Err(Error::Length { name, expected: nv, found });
        }
        Ok(())
    }
}
