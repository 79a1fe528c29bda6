//! Keyframes: named states, in MuJoCo's coordinates.

use super::attributes::Attributes;
use super::spring::Joints;
use crate::configuration::neutral;
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::keyframe::Keyframe;
use crate::model::Model;
use condyle_spatial::{Quaternion, Vec3};
use std::collections::HashSet;

/// Most numbers that all keyframes may have together.
const MAX_NUMBERS: usize = 1 << 22;

/// Adds the keyframes of a file.
pub(super) fn add(model: &mut Model, root: &Element, joints: &Joints) -> Result<(), Error> {
    let [nq, nv] = [Joint::nq, Joint::nv].map(|count| joints.all.iter().map(|j| count(j.joint)).sum::<usize>());
    let keys: Vec<_> = root.all("keyframe").flat_map(|section| section.all("key")).collect();
    if keys.len() * (nq + nv) > MAX_NUMBERS {
        let what = format!("{} keyframes of {} numbers: at most {MAX_NUMBERS} are allowed", keys.len(), nq + nv);
        return Err(root.wrong(what));
    }
    let mut names: HashSet<String> = keys.iter().filter_map(|e| own(e)).map(str::to_owned).collect();
    if names.len() < keys.iter().filter_map(|e| own(e)).count() {
        return Err(root.wrong("two keyframes have the same name"));
    }
    let drawn: Vec<f64> = joints.all.iter().flat_map(|joint| joint.drawn()).collect();
    for (index, e) in keys.into_iter().enumerate() {
        let mut name = own(e).map_or_else(|| format!("key{index}"), str::to_owned);
        while own(e).is_none() && !names.insert(name.clone()) {
            name.push('_');
        }
        let numbers = |attribute: &str, count: usize| match Attributes::plain(e).list(attribute)? {
            Some(found) if found.len() != count => {
                Err(e.wrong(format!("{attribute}: expected {count} numbers, found {}", found.len())))
            }
            found => Ok(found),
        };
        let (given, velocity) = (numbers("qpos", nq)?, numbers("qvel", nv)?.unwrap_or_else(|| vec![0.0; nv]));
        let mut positions = &given.clone().unwrap_or_else(|| drawn.clone())[..];
        let mut velocities = &velocity[..];
        let (mut q, mut v) = (neutral(model), vec![0.0; nv]);
        v.truncate(model.tree.nv);
        for joint in &joints.all {
            let (mut position, mut velocity);
            (position, positions) = (positions[..joint.joint.nq()].to_vec(), &positions[joint.joint.nq()..]);
            (velocity, velocities) = (velocities[..joint.joint.nv()].to_vec(), &velocities[joint.joint.nv()..]);
            if let (Joint::Spherical | Joint::FreeFlyer, true) = (joint.joint, given.is_some()) {
                let at = position.len() - 4;
                let unit = unit(&position[at..]);
                position[at..].copy_from_slice(&unit);
            }
            if let (Joint::FreeFlyer, &[.., x, y, z, w]) = (joint.joint, &position[..]) {
                // v is along the body's axes, qvel along the world's: v = Rᵀ qvel
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
        model.keyframes.push(Keyframe { name, q, v });
    }
    Ok(())
}

/// Returns the name that a keyframe has in its file.
fn own(e: &Element) -> Option<&str> {
    e.attribute("name").filter(|name| !name.is_empty())
}

/// Returns x, y, z, w of a quaternion w, x, y, z, with length 1. One of length 0 is no rotation, as in MuJoCo.
fn unit(quaternion: &[f64]) -> [f64; 4] {
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| quaternion[k]);
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    if norm < 1e-15 {
        return [0.0, 0.0, 0.0, 1.0];
    }
    [x, y, z, w].map(|part| part / norm)
}
