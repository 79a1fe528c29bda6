//! HTML page of a posture: the page of a plan, with a motion from the first posture to the answer.

use super::Answer;
use crate::apart::Apart;
use crate::limits::LimitCounts;
use crate::page::{self, position, shown};
use crate::scene;
use condyle::{Data, difference, forward_kinematics, integrate, rnea};
use serde_json::json;
use std::path::Path;

/// Number of intervals of the motion.
const KNOTS: usize = 100;

/// Minimum duration of the motion (s).
const LEAST: f64 = 1.0;

/// Largest speed of the motion, relative to the limits of the joints.
const SPEED: f64 = 0.5;

/// Largest derivative of s(r), at r = ½.
const STEEPEST: f64 = 1.875;

/// Writes the page, and creates its folder. If meshes are left out, returns one line of text about these meshes.
///
/// The motion is a straight path in the joints with minimum jerk, q₀ ⊕ s(r) d with s = 10 r³ − 15 r⁴ + 6 r⁵.
pub(super) fn write(path: &Path, answer: &Answer) -> std::io::Result<Option<String>> {
    let model = &answer.robot.model;
    let (mut data, mut q, mut way) = (Data::new(model), answer.start.clone(), vec![0.0; model.nv()]);
    difference(model, &answer.start, &answer.posture.q, &mut way);
    let along = |s: f64| way.iter().map(|d| d * s).collect::<Vec<f64>>();
    let (mut positions, mut velocities, mut efforts) = (Vec::new(), Vec::new(), Vec::new());
    let (mut poses, mut trail, mut apart) = (Vec::new(), Vec::new(), Apart::new(&answer.robot));
    let slowest = |(d, limit): (&f64, &f64)| if *limit > 0.0 { STEEPEST * d.abs() / (SPEED * limit) } else { 0.0 };
    let duration = way.iter().zip(&model.limits().velocity).map(slowest).fold(LEAST, f64::max);
    let dt = duration / KNOTS as f64;
    for t in 0..=KNOTS {
        let r = t as f64 / KNOTS as f64;
        let v = along(30.0 * r * r * (1.0 - r) * (1.0 - r) / duration);
        let a = along(60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / (duration * duration));
        integrate(model, &answer.start, &along(r * r * r * (10.0 + r * (6.0 * r - 15.0))), &mut q);
        if t < KNOTS {
            let tau = rnea(model, &mut data, &q, &v, &a, &[]);
            efforts.push(shown(model).map(|b| tau[b.idx_v]).collect::<Vec<f64>>());
        }
        positions.push(shown(model).map(|b| position(&q, b)).collect::<Vec<f64>>());
        velocities.push(shown(model).map(|b| v[b.idx_v]).collect::<Vec<f64>>());
        let placements = forward_kinematics(model, &mut data, &q);
        poses.push((0..model.bodies().len()).map(|i| scene::pose(placements.body(i))).collect::<Vec<_>>());
        if let Some(apart) = &mut apart {
            apart.add(placements);
        }
        trail.push(placements.frame(answer.frame).translation.to_array());
    }
    let (bodies, meshes) = scene::bodies(model, &answer.robot, &[answer.frame], answer.meshes);
    let note = meshes.note();
    let frame = &model.frames()[answer.frame].name;
    let data = json!({
        "robot": model.name(),
        "title": format!("A posture of {}", model.name()),
        "status": "posture",
        "frame": frame,
        "target": answer.target.translation.to_array(),
        "miss": answer.posture.error[0],
        "tolerance": answer.tolerance[0],
        "dt": dt,
        "times": (0..=KNOTS).map(|t| t as f64 * dt).collect::<Vec<_>>(),
        "joints": page::joints(model),
        "q": positions,
        "v": velocities,
        "tau": efforts,
        "iterations": [],
        "budget": null,
        "scene": {
            "bodies": bodies,
            "collisions": apart.as_ref().map(Apart::shapes),
            "meshes": meshes.written(),
            "poses": poses,
            "trail": trail,
        },
        "apart": apart.as_ref().and_then(Apart::distances),
        "contacts": null,
        "limits": LimitCounts::new(&answer.robot),
        "violations": [],
        "met": [],
        "posture": {
            "reached": answer.posture.reached(),
            "rotation": answer.turned.then_some(answer.posture.error[1]),
            "starts": answer.posture.starts,
            "held": answer.held,
        },
        "version": env!("CARGO_PKG_VERSION"),
        "command": page::command_line(),
    });
    page::write_data(path, data)?;
    Ok(note)
}
