//! Keyframes of MJCF: named states, in MuJoCo's coordinates.

use super::attributes::Attributes;
use super::spring::Joints;
use super::transmission::Inputs;
use crate::configuration::neutral;
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::keyframe::Keyframe;
use crate::model::Model;
use crate::warning::Warning;
use condyle_spatial::{Quaternion, Vec3};
use std::collections::HashSet;

/// Maximum number of coordinates of all keyframes together.
const MAX_NUMBERS: usize = 1 << 22;

/// Adds the keyframes of a file. As in MuJoCo, missing positions are taken from the initial configuration of the file,
/// and missing velocities and controls are 0. `driven` contains the index in the file of each actuator of the model.
pub(super) fn add(
    model: &mut Model,
    root: &Element,
    joints: &Joints,
    (inputs, driven): (&[Inputs], &[usize]),
    warnings: &mut Vec<Warning>,
) -> Result<(), Error> {
    let [nq, nv] = [Joint::nq, Joint::nv].map(|count| joints.all.iter().map(|j| count(j.joint)).sum::<usize>());
    let keys: Vec<_> = root.all("keyframe").flat_map(|section| section.all("key")).collect();
    let numbers = nq + nv + inputs.len();
    if keys.len() * numbers > MAX_NUMBERS {
        let what = format!("{} keyframes of {numbers} numbers: at most {MAX_NUMBERS} are allowed", keys.len());
        return Err(root.wrong(what));
    }
    let mut names: HashSet<String> = super::names(keys.iter().copied())?.into_keys().map(str::to_owned).collect();
    let drawn: Vec<f64> = joints.all.iter().flat_map(|joint| joint.drawn()).collect();
    for (index, e) in keys.into_iter().enumerate() {
        let mut name = own(e).map_or_else(|| format!("key{index}"), str::to_owned);
        while own(e).is_none() && !names.insert(name.clone()) {
            name.push('_');
        }
        let mut numbers = |attribute: &str, count: usize, size: fn(Joint) -> usize| {
            let Some(found) = Attributes::plain(e).list(attribute)? else { return Ok(Vec::new()) };
            let mut end = 0;
            let is_whole = joints.all.iter().any(|joint| {
                end += size(joint.joint);
                end == found.len()
            });
            if !is_whole && !found.is_empty() {
                return Err(e.wrong(format!("{attribute}: expected {count} numbers, found {}", found.len())));
            }
            if found.len() < count {
                let what =
                    format!("{attribute}: has {} of {count} numbers; the other joints are as drawn", found.len());
                warnings.push(e.assumed(what));
            }
            Ok(found)
        };
        let given = numbers("qpos", nq, Joint::nq)?;
        let mut velocity = numbers("qvel", nv, Joint::nv)?;
        velocity.resize(nv, 0.0);
        let control = control(e, inputs, driven, warnings)?;
        let at_home = &drawn[given.len()..];
        let (mut positions, mut velocities) = (&[&given[..], at_home].concat()[..], &velocity[..]);
        let mut left = given.len();
        let (mut q, mut v) = (neutral(model), vec![0.0; nv]);
        v.truncate(model.tree.nv);
        for joint in &joints.all {
            let (mut position, mut velocity);
            (position, positions) = (positions[..joint.joint.nq()].to_vec(), &positions[joint.joint.nq()..]);
            (velocity, velocities) = (velocities[..joint.joint.nv()].to_vec(), &velocities[joint.joint.nv()..]);
            let is_given = left > 0;
            left = left.saturating_sub(joint.joint.nq());
            if let (Joint::Spherical | Joint::FreeFlyer, true) = (joint.joint, is_given) {
                let at = position.len() - 4;
                let unit = unit(&position[at..]);
                position[at..].copy_from_slice(&unit);
            }
            if let (Joint::FreeFlyer, &[.., x, y, z, w]) = (joint.joint, &position[..]) {
                // v is along the axes of the body and qvel along the axes of the world, so v = Rᵀ qvel.
                let R = Quaternion::new(x, y, z, w).to_rotation();
                let turned = R.transpose_mul(Vec3::new(velocity[0], velocity[1], velocity[2]));
                velocity[..3].copy_from_slice(&turned.to_array());
            }
            let body = &model.bodies[joint.body];
            if body.mimic.is_none() {
                q[body.idx_q..][..position.len()].copy_from_slice(&position);
                v[body.idx_v..][..velocity.len()].copy_from_slice(&velocity);
            }
        }
        model.keyframes.push(Keyframe { name, q, v, control });
    }
    Ok(())
}

/// Returns the control of each actuator of the model. If an actuator integrates its control, the control in the model
/// is the activation in the file.
fn control(e: &Element, inputs: &[Inputs], driven: &[usize], warnings: &mut Vec<Warning>) -> Result<Vec<f64>, Error> {
    let list = |attribute: &str, expected: Option<usize>| {
        let found = Attributes::plain(e).list(attribute)?.unwrap_or_default();
        match expected.filter(|&expected| found.len() > expected) {
            Some(expected) => {
                Err(e.wrong(format!("{attribute}: expected at most {expected} numbers, found {}", found.len())))
            }
            None => Ok(found),
        }
    };
    let counts = inputs.iter().map(|input| input.activations);
    let controls = list("ctrl", Some(inputs.iter().map(|input| input.controls).sum()))?;
    let activations = list("act", counts.sum::<Option<usize>>())?;
    let (mut first, mut state, mut starts) = (0, Some(0), Vec::new());
    for input in inputs {
        starts.push((first + input.own, state));
        (first, state) = (first + input.controls, state.zip(input.activations).map(|(start, count)| start + count));
    }
    let mut is_lost = false;
    let number = |&k: &usize| match (inputs[k].is_integrator, starts[k].1) {
        (false, _) => controls.get(starts[k].0).copied(),
        (true, Some(state)) => activations.get(state).copied(),
        (true, None) => {
            is_lost |= !activations.is_empty();
            None
        }
    };
    let found = driven.iter().map(number).map(Option::unwrap_or_default).collect();
    if is_lost {
        let what =
            "act: controls of integrators are left out, for the activations of an actuator before are not counted";
        warnings.push(e.left_out(what));
    }
    Ok(found)
}

/// Returns the name of a keyframe in the file.
fn own(e: &Element) -> Option<&str> {
    e.attribute("name").filter(|name| !name.is_empty())
}

/// Normalizes a quaternion w, x, y, z, and returns it as x, y, z, w. A quaternion of length 0 becomes the identity, as
/// in MuJoCo.
fn unit(quaternion: &[f64]) -> [f64; 4] {
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| quaternion[k]);
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    if norm < 1e-15 {
        return [0.0, 0.0, 0.0, 1.0];
    }
    [x, y, z, w].map(|part| part / norm)
}
