//! HTML page of a walk: the page of a plan, with speeds over time, and the computing time of each tick.

use super::record::Walk;
use super::walked::Walked;
use crate::apart::Apart;
use crate::limits::LimitCounts;
use crate::page::{self, position, shown};
use crate::report::Violation;
use crate::scene;
use condyle::{Data, forward_kinematics};
use serde_json::{Value, json};
use std::path::Path;

/// Smallest mean force with which a foot touches the ground, relative to the weight.
const TOUCH: f64 = 5e-3;

/// Writes the page, and creates its folder. If meshes are left out, returns one line of text about these meshes.
pub(crate) fn write(path: &Path, walked: &Walked, violations: &[Violation]) -> std::io::Result<Option<String>> {
    let Walked { model, walk, robot, .. } = walked;
    let (nq, count) = (model.nq(), walk.intervals());
    let joints = |value: &dyn Fn(&condyle::tree::Body) -> f64| -> Vec<f64> { shown(model).map(value).collect() };
    let mut data = Data::new(model);
    let (mut poses, mut trails) = (Vec::new(), vec![Vec::new(); walked.feet.len()]);
    let mut apart = Apart::new(robot);
    for x in &walk.states {
        let placements = forward_kinematics(model, &mut data, &x[..nq]);
        poses.push((0..model.bodies().len()).map(|i| scene::pose(placements.body(i))).collect::<Vec<_>>());
        if let Some(apart) = &mut apart {
            apart.add(placements);
        }
        for (trail, foot) in trails.iter_mut().zip(&walked.feet) {
            let mut point = placements.frame(foot.frame).translation;
            point.z -= foot.height();
            trail.push(point.to_array());
        }
    }
    let frames: Vec<usize> = walked.feet.iter().map(|foot| foot.frame).collect();
    let (bodies, meshes) = scene::bodies(model, robot, &frames, walked.meshes);
    let note = meshes.note();
    let data = json!({
        "robot": model.name(),
        "title": format!("{} walks", model.name()),
        "status": "walk",
        "dt": walked.settings.knot,
        "times": walk.times,
        "joints": page::joints(model),
        "q": walk.states.iter().map(|x| joints(&|b| position(x, b))).collect::<Vec<_>>(),
        "v": walk.states.iter().map(|x| joints(&|b| x[nq + b.idx_v])).collect::<Vec<_>>(),
        "tau": walk.efforts[..count].iter().map(|tau| joints(&|b| tau[b.idx_v])).collect::<Vec<_>>(),
        "iterations": [],
        "budget": budget(walked),
        "scene": {
            "bodies": bodies,
            "collisions": apart.as_ref().map(Apart::shapes),
            "meshes": meshes.written(),
            "poses": poses,
            "follow": 1,
        },
        "apart": apart.as_ref().and_then(Apart::distances),
        "contacts": contacts(walked, &trails),
        "limits": LimitCounts::new(robot),
        "violations": violations,
        "met": [],
        "walk": summary(walked),
        "version": env!("CARGO_PKG_VERSION"),
        "command": page::command_line(),
    });
    page::write_data(path, data)?;
    Ok(note)
}

/// Returns the feet, their paths on the ground, and the measured forces.
fn contacts(walked: &Walked, trails: &[Vec<[f64; 3]>]) -> Value {
    let Walked { model, walk, feet, .. } = walked;
    let weight = model.total_mass() * model.gravity().norm();
    let touches =
        |forces: &Vec<condyle::Vec3<f64>>| forces.iter().map(|force| force.z > TOUCH * weight).collect::<Vec<bool>>();
    let force = |force: &condyle::Vec3<f64>| (force.z > TOUCH * weight).then(|| force.to_array());
    let forces = |forces: &Vec<condyle::Vec3<f64>>| forces.iter().map(force).collect::<Vec<_>>();
    json!({
        "feet": feet.iter().map(|foot| &foot.foot.frame).collect::<Vec<_>>(),
        "trails": trails,
        "touches": walk.forces.iter().map(touches).collect::<Vec<_>>(),
        "forces": walk.forces.iter().map(forces).collect::<Vec<_>>(),
        "weight": weight,
    })
}

/// Returns the mean computing times of a tick, in the form of a solver's budget.
fn budget(walked: &Walked) -> Option<Value> {
    let Walked { walk, settings, .. } = walked;
    let knots = settings.knots();
    let mean = |part: fn(&super::record::Tick) -> f64| {
        walk.ticks.iter().map(part).sum::<f64>() / walk.ticks.len().max(1) as f64
    };
    let row = |name, ms: f64| json!({"name": name, "us_per_knot": 1e3 * ms / knots as f64, "ms_per_horizon": ms});
    let (references, solve, total) = (mean(|t| t.references_ms), mean(|t| t.solve_ms), mean(|t| t.total_ms));
    let rest = (total - references - solve).max(0.0);
    let rows = vec![row("References", references), row("Solver", solve), row("Other", rest)];
    let budget_ms = walked.budget_ms();
    (!walk.ticks.is_empty()).then(
        || json!({"budget_ms": budget_ms, "knots": knots, "per": "one tick, mean", "rows": rows, "total_ms": total}),
    )
}

/// Returns the entry `walk` of the page's data.
fn summary(walked: &Walked) -> Value {
    let walk: &Walk = &walked.walk;
    let (mean, since) = walk.mean_velocity(walked.command);
    json!({
        "gait": walked.gait_text,
        "seconds": walked.seconds,
        "command": walked.command.to_array(),
        "mean": mean,
        "since": since,
        "velocities": walk.velocities,
        "commands": walk.commands,
        "ticks": {
            "times": walk.ticks.iter().map(|tick| tick.time).collect::<Vec<_>>(),
            "ms": walk.ticks.iter().map(|tick| tick.total_ms).collect::<Vec<_>>(),
            "budget_ms": walked.budget_ms(),
            "over": walk.tick_times(walked.budget_ms()).2,
        },
        "tilt": walk.tilt,
        "fall": walk.fall.as_ref().map(|(time, what)| json!({"time": time, "what": what})),
    })
}
