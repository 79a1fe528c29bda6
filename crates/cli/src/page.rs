//! Writes the HTML page of `condyle plan`, `condyle ik` and `condyle walk`: plots and playback in one file that needs
//! no network.

use crate::apart::Apart;
use crate::budget::held;
use crate::limits::LimitCounts;
use crate::met::Met;
use crate::motion::Plan;
use crate::report::{self, Budget, Violation};
use crate::scene;
use condyle::{ConstraintSet, ContactConstraint, Data, Joint, Model, constrained_dynamics, forward_kinematics};
use serde_json::{Value, json};
use std::path::Path;

/// Placeholders of the template, and the texts that replace them, in this order. The data are inserted last. So text in
/// the data is never replaced, even if it looks like a placeholder.
const PARTS: [(&str, &str); 10] = [
    ("/*{{uplot.css}}*/", include_str!("../page/vendor/uPlot.min.css")),
    ("/*{{plan.css}}*/", include_str!("../page/plan.css")),
    ("/*{{three.js}}*/", include_str!("../page/vendor/three.bundle.js")),
    ("/*{{uplot.js}}*/", include_str!("../page/vendor/uPlot.iife.min.js")),
    ("/*{{meshes.js}}*/", include_str!("../page/meshes.js")),
    ("/*{{scene.js}}*/", include_str!("../page/scene.js")),
    ("/*{{plots.js}}*/", include_str!("../page/plots.js")),
    ("/*{{distance.js}}*/", include_str!("../page/distance.js")),
    ("/*{{walk.js}}*/", include_str!("../page/walk.js")),
    ("/*{{plan.js}}*/", include_str!("../page/plan.js")),
];

/// Writes the page, and creates its folder. If meshes are left out, returns one line of text about these meshes.
pub(crate) fn write(
    path: &Path,
    plan: &Plan,
    budget: &Budget,
    violations: &[Violation],
    met: &[Met],
) -> std::io::Result<Option<String>> {
    let (data, note) = data(plan, budget, violations, met);
    write_data(path, data)?;
    Ok(note)
}

/// Writes a page with the given data, and creates its folder. The comment at the top of `plan.js` describes the data.
pub(crate) fn write_data(path: &Path, data: Value) -> std::io::Result<()> {
    let mut page = include_str!("../page/plan.html").to_owned();
    for (place, text) in PARTS {
        page = page.replacen(place, text, 1);
    }
    let data = rounded(data).to_string().replace('<', "\\u003c");
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, page.replacen("/*{{data}}*/", &data, 1))
}

/// Returns the joints that the page shows: joints with one degree of freedom that do not mimic another joint.
pub(crate) fn shown(model: &Model) -> impl Iterator<Item = &condyle::tree::Body> {
    model.bodies()[1..].iter().filter(|b| b.joint.nv() == 1 && b.mimic.is_none())
}

/// Returns the indices of the knots that the page shows. An impact has no duration, so the state before the impact is
/// left out.
fn with_time(plan: &Plan) -> Vec<usize> {
    let times = &plan.times;
    (0..times.len()).filter(|&t| t + 1 == times.len() || times[t + 1] > times[t]).collect()
}

/// Returns the positions of the feet at the knots. For each interval, also returns whether the feet touch and the
/// contact forces.
fn contacts(plan: &Plan, knots: &[usize]) -> Result<Value, condyle::ModelError> {
    let (model, nq) = (&plan.model, plan.model.nq());
    let mut data = Data::new(model);
    let (mut trails, mut touches, mut forces) = (vec![Vec::new(); plan.feet.len()], Vec::new(), Vec::new());
    for (number, &t) in knots.iter().enumerate() {
        let (q, v) = plan.solution.x(t).split_at(nq);
        let placements = forward_kinematics(model, &mut data, q);
        for (trail, &foot) in trails.iter_mut().zip(&plan.feet) {
            trail.push(placements.frame(foot).translation.to_array());
        }
        if number + 1 == knots.len() {
            break;
        }
        let touching: Vec<usize> = (0..plan.feet.len()).filter(|&foot| plan.touches[t][foot]).collect();
        let held = |&foot: &usize| {
            held(if plan.soles {
                ContactConstraint::rigid(plan.feet[foot])
            } else {
                ContactConstraint::point(plan.feet[foot])
            })
        };
        let constraints: Vec<_> = touching.iter().map(held).collect();
        let mut set = ConstraintSet::new(model, &constraints)?;
        let solved = constrained_dynamics(model, &mut data, &mut set, q, v, &plan.effort(t), &[]);
        let rows = if plan.soles { 6 } else { 3 };
        let mut of_knot = vec![Value::Null; plan.feet.len()];
        for (k, &foot) in touching.iter().enumerate() {
            of_knot[foot] = json!(solved.lambda[rows * k..rows * k + 3]); // along the world's axes
        }
        forces.push(of_knot);
        touches.push(&plan.touches[t]);
    }
    let names: Vec<&str> = plan.feet.iter().map(|&foot| &*model.frames()[foot].name).collect();
    let weight = model.total_mass() * model.gravity().norm_squared().sqrt();
    Ok(json!({"feet": names, "trails": trails, "touches": touches, "forces": forces, "weight": weight}))
}

/// Returns the shown joints, with their limits.
pub(crate) fn joints(model: &Model) -> Vec<Value> {
    let (limits, (least, most)) = (model.limits(), crate::limits::efforts(model, model.nv()));
    let finite = |x: f64| x.is_finite().then_some(x);
    let joint = |b: &condyle::tree::Body| {
        let range = |limit: &[f64]| if b.joint.nq() == 1 { finite(limit[b.idx_q]) } else { None };
        json!({
            "name": b.joint_name,
            "unit": if matches!(b.joint, Joint::Prismatic { .. }) { "m" } else { "rad" },
            "lower": range(&limits.lower),
            "upper": range(&limits.upper),
            "velocity": finite(limits.velocity[b.idx_v]).filter(|&v| v > 0.0),
            "effort_lower": finite(least[b.idx_v]),
            "effort_upper": finite(most[b.idx_v]),
        })
    };
    shown(model).map(joint).collect()
}

/// Returns the position of a shown joint in the state x (rad or m).
pub(crate) fn position(x: &[f64], b: &condyle::tree::Body) -> f64 {
    match b.joint {
        Joint::Continuous { .. } => x[b.idx_q + 1].atan2(x[b.idx_q]),
        _ => x[b.idx_q],
    }
}

/// Returns the command line of the program.
pub(crate) fn command_line() -> String {
    std::env::args().skip(1).fold("condyle".to_owned(), |line, word| line + " " + &word)
}

/// Returns all data of the page, and a note about the meshes that are left out. The comment at the top of `plan.js`
/// describes each entry of the data.
fn data(plan: &Plan, budget: &Budget, violations: &[Violation], met: &[Met]) -> (Value, Option<String>) {
    let Plan { model, solution, .. } = plan;
    let nq = model.nq();
    let knots = with_time(plan);
    let series = |knots: &[usize], value: &dyn Fn(usize, &condyle::tree::Body) -> f64| -> Vec<Vec<f64>> {
        knots.iter().map(|&t| shown(model).map(|b| value(t, b)).collect()).collect()
    };
    let goal = plan.goal.as_ref();
    let mut data = Data::new(model);
    let (mut poses, mut trail, mut apart) = (Vec::new(), Vec::new(), Apart::new(&plan.robot));
    for &t in &knots {
        let placements = forward_kinematics(model, &mut data, &solution.x(t)[..nq]);
        poses.push((0..model.bodies().len()).map(|i| scene::pose(placements.body(i))).collect::<Vec<_>>());
        if let Some(apart) = &mut apart {
            apart.add(placements);
        }
        trail.extend(goal.map(|goal| placements.frame(goal.frame).translation.to_array()));
    }
    let driven = &knots[..knots.len() - 1];
    let efforts: Vec<Vec<f64>> = (0..plan.knots()).map(|t| plan.effort(t)).collect();
    // If the page does not show a knot, use the next knot that the page shows.
    let on_page = |t: usize| knots.partition_point(|&shown| shown < t);
    let violations: Vec<Value> = violations
        .iter()
        .map(|v| {
            let mut shown = json!(v);
            shown["at_knot"] = json!(on_page(v.at_knot));
            shown
        })
        .collect();
    let ends: Vec<usize> = goal.map(|goal| goal.frame).into_iter().chain(plan.feet.iter().copied()).collect();
    let (bodies, meshes) = scene::bodies(model, &plan.robot, &ends, plan.meshes);
    let note = meshes.note();
    let data = json!({
        "robot": model.name(),
        "title": plan.title,
        "status": report::status(plan),
        "frame": goal.map(|goal| &model.frames()[goal.frame].name),
        "target": goal.map(|goal| goal.target.to_array()),
        "miss": goal.map(|goal| goal.miss),
        "tolerance": goal.map(|goal| goal.tolerance),
        "dt": plan.dt,
        "times": knots.iter().map(|&t| plan.times[t]).collect::<Vec<_>>(),
        "joints": joints(model),
        "q": series(&knots, &|t, b| position(solution.x(t), b)),
        "v": series(&knots, &|t, b| solution.x(t)[nq + b.idx_v]),
        "tau": series(driven, &|t, b| efforts[t][b.idx_v]),
        "iterations": plan.trace.iter().map(|i| json!({
            "iteration": i.iteration, "cost": i.cost, "gap": i.gap, "step": i.accepted.then_some(i.step),
            "regularisation": i.regularisation, "stop": i.stop,
        })).collect::<Vec<_>>(),
        "budget": budget,
        "scene": {
            "bodies": bodies,
            "collisions": apart.as_ref().map(Apart::shapes),
            "meshes": meshes.written(),
            "poses": poses,
            "trail": (!trail.is_empty()).then_some(trail),
        },
        // Here, `contacts` cannot fail, because the solver has already used the same contacts.
        "contacts": if plan.feet.is_empty() { None } else { contacts(plan, &knots).ok() },
        "apart": apart.as_ref().and_then(Apart::distances),
        "limits": LimitCounts::new(&plan.robot),
        "violations": violations,
        "met": met.iter().map(|met| {
            let mut shown = json!(met);
            shown["at_knot"] = json!(on_page(met.at_knot));
            shown["knots"] = json!(met.knots.iter().map(|part| part.map(on_page)).collect::<Vec<_>>());
            shown
        }).collect::<Vec<_>>(),
        "multipliers": multipliers(plan, &knots, met),
        "worst": report::worst(plan).map(|worst| json!({
            "text": worst.to_string().replace('`', ""), "is_gap": worst.is_gap(),
        })),
        "version": env!("CARGO_PKG_VERSION"),
        "command": command_line(),
    });
    (data, note)
}

/// Returns the multipliers of the limits over time, for each quantity with a reached bound. A joint that reaches no
/// bound has no numbers.
fn multipliers(plan: &Plan, knots: &[usize], met: &[Met]) -> Option<Value> {
    let held = plan.held.as_ref()?;
    let of = |what: &str, knots: &[usize]| -> Option<Vec<Vec<Option<f64>>>> {
        let reached = |joint: &str| met.iter().any(|met| met.what == what && met.joint == joint);
        let rows = held.multipliers(what);
        let row = |&t: &usize| shown(&plan.model).map(|b| reached(&b.joint_name).then(|| rows[t][b.idx_v])).collect();
        met.iter().any(|met| met.what == what).then(|| knots.iter().map(row).collect())
    };
    let driven = &knots[..knots.len() - 1];
    Some(json!({"q": of("position", knots), "v": of("velocity", knots), "tau": of("torque", driven)}))
}

/// Rounds all numbers to six significant digits, which are enough for a screen.
fn rounded(value: Value) -> Value {
    match value {
        Value::Number(n) if n.is_f64() => {
            let x = n.as_f64().unwrap_or(0.0);
            format!("{x:.5e}").parse::<f64>().map_or(Value::Null, |x| json!(x))
        }
        Value::Array(values) => values.into_iter().map(rounded).collect(),
        Value::Object(map) => map.into_iter().map(|(k, v)| (k, rounded(v))).collect(),
        other => other,
    }
}
