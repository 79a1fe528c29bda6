//! Sections of a file other than the tree of bodies. These sections are read in the order of their dependencies.
//! Tendons and actuators add armature, so they come before springs, which may depend on inertia. Limits of effort come
//! last, as sums over actuators.

use super::Source;
use super::keyframe;
use super::reference::Reference;
use super::spring::{Joints, Line, Switches};
use super::tendon::Tendons;
use super::transmission::Drives;
use crate::error::Error;
use crate::io::xml::Element;
use crate::model::Model;
use crate::warning::Warning;
use condyle_spatial::Se3;

/// Adds all sections of a file except the tree to the model. Returns warnings about items that are left out. `poses`
/// contains the pose of each body in the world, in the initial configuration of the file.
pub(super) fn add<'a>(
    model: &mut Model,
    root: &'a Element,
    sources: &'a [Source<'a>],
    joints: &mut Joints,
    poses: &[Se3<f64>],
) -> Result<Vec<Warning>, Error> {
    let mut warnings = Vec::new();
    let on = Switches::read(root)?;
    let lines: Vec<Line> = joints.all.iter().map(|joint| Line::of(model, joint.body)).collect();
    let mut tendons = Tendons::read(root, sources, joints)?;
    let drives = Drives::read(root, sources, joints, &tendons, &on)?;
    drives.load(model, joints, &mut tendons, &lines, &on);
    // The armature of each column is the sum of the armatures of joints and tendons.
    let mut armature = vec![0.0; model.tree.columns.len()];
    for joint in &joints.all {
        armature[joint.columns(model)].fill(joint.armature);
    }
    for tendon in &tendons.all {
        tendon.add_to(model, joints, &lines, &on, &mut armature, &mut warnings);
    }
    let actuators = {
        let reference = match drives.has_ratios() || joints.all.iter().any(|joint| joint.has_spring_damper()) {
            true => Some(Reference::new(model, poses, &armature)),
            false => None,
        };
        let response = |k: usize| reference.as_ref().map_or(0.0, |reference| reference.response(&[(k, 1.0)]));
        joints.all.iter_mut().for_each(|joint| joint.find_spring(joint.columns(model), &response));
        drives.table(model, (joints, &tendons), &on, reference.as_ref(), &mut warnings)?
    };
    let driven: Vec<usize> = actuators.iter().map(|(index, _)| *index).collect();
    model.actuators = actuators.into_iter().map(|(_, actuator)| actuator).collect();
    for (joint, &line) in joints.all.iter().zip(&lines) {
        joint.add_to(model, line, &on, &mut warnings);
    }
    drives.limit(model, (joints, &tendons), &lines, &on);
    if !on.limit {
        model.limits.lower.fill(f64::NEG_INFINITY);
        model.limits.upper.fill(f64::INFINITY);
    }
    if !on.spring && !on.damper {
        model.gravity_compensation.clear(); // without springs and dampers, MuJoCo has no passive forces
    }
    keyframe::add(model, root, joints, (&drives.inputs()?, &driven), &mut warnings)?;
    Ok(warnings)
}
