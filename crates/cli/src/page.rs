//! The page that `condyle plan` writes: plots and playback in one file that needs no network.

use crate::plan::Plan;
use crate::report::{self, Budget, Violation};
use crate::scene;
use condyle::{Data, Joint, Model, forward_kinematics};
use serde_json::{Value, json};
use std::path::Path;

/// The template's parts, in the order in which they go in: the data last, so that nothing in them is looked into.
const PARTS: [(&str, &str); 7] = [
    ("/*{{uplot.css}}*/", include_str!("../page/vendor/uPlot.min.css")),
    ("/*{{plan.css}}*/", include_str!("../page/plan.css")),
    ("/*{{three.js}}*/", include_str!("../page/vendor/three.bundle.js")),
    ("/*{{uplot.js}}*/", include_str!("../page/vendor/uPlot.iife.min.js")),
    ("/*{{scene.js}}*/", include_str!("../page/scene.js")),
    ("/*{{plots.js}}*/", include_str!("../page/plots.js")),
    ("/*{{plan.js}}*/", include_str!("../page/plan.js")),
];

/// Writes the page, and makes the folder for it.
pub(crate) fn write(path: &Path, plan: &Plan, budget: &Budget, violations: &[Violation]) -> std::io::Result<()> {
    let mut page = include_str!("../page/plan.html").to_owned();
    for (place, text) in PARTS {
        page = page.replacen(place, text, 1);
    }
    let data = rounded(data(plan, budget, violations)).to_string().replace('<', "\\u003c");
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, page.replacen("/*{{data}}*/", &data, 1))
}

/// The joints that the page shows: those with one degree of freedom.
fn shown(model: &Model) -> impl Iterator<Item = &condyle::Body> {
    model.bodies()[1..].iter().filter(|b| b.joint.nv() == 1)
}

/// All that the page shows; the head of `plan.js` says what each entry is.
fn data(plan: &Plan, budget: &Budget, violations: &[Violation]) -> Value {
    let Plan { model, solution, .. } = plan;
    let (nq, knots, limits) = (model.nq(), budget.knots, model.limits());
    let finite = |x: f64| x.is_finite().then_some(x);
    let joint = |b: &condyle::Body| {
        let range = |limit: &[f64]| if b.joint.nq() == 1 { finite(limit[b.idx_q]) } else { None };
        json!({
            "name": b.joint_name,
            "unit": if matches!(b.joint, Joint::Prismatic { .. }) { "m" } else { "rad" },
            "lower": range(&limits.lower),
            "upper": range(&limits.upper),
            "velocity": finite(limits.velocity[b.idx_v]).filter(|&v| v > 0.0),
            "effort": finite(limits.effort[b.idx_v]).filter(|&e| e > 0.0),
        })
    };
    let position = |t: usize, b: &condyle::Body| match b.joint {
        Joint::Continuous { .. } => solution.x(t)[b.idx_q + 1].atan2(solution.x(t)[b.idx_q]),
        _ => solution.x(t)[b.idx_q],
    };
    let series = |knots: usize, value: &dyn Fn(usize, &condyle::Body) -> f64| -> Vec<Vec<f64>> {
        (0..knots).map(|t| shown(model).map(|b| value(t, b)).collect()).collect()
    };
    let mut data = Data::new(model);
    let (mut poses, mut trail) = (Vec::new(), Vec::new());
    for t in 0..=knots {
        let placements = forward_kinematics(model, &mut data, &solution.x(t)[..nq]);
        poses.push((0..model.bodies().len()).map(|i| scene::pose(placements.body(i))).collect::<Vec<_>>());
        trail.push(placements.frame(plan.frame).translation.to_array());
    }
    json!({
        "robot": model.name(),
        "title": format!("{} reaches for a point", model.name()),
        "status": report::status(solution.status),
        "frame": model.frames()[plan.frame].name,
        "target": plan.target.to_array(),
        "miss": plan.miss,
        "tolerance": plan.tolerance,
        "dt": plan.dt,
        "times": (0..=knots).map(|t| t as f64 * plan.dt).collect::<Vec<_>>(),
        "joints": shown(model).map(joint).collect::<Vec<_>>(),
        "q": series(knots + 1, &position),
        "v": series(knots + 1, &|t, b| solution.x(t)[nq + b.idx_v]),
        "tau": series(knots, &|t, b| solution.u(t)[b.idx_v]),
        "iterations": solution.trace.iter().map(|i| json!({
            "iteration": i.iteration, "cost": i.cost, "gap": i.gap, "step": i.accepted.then_some(i.step),
            "regularisation": i.regularisation, "stop": i.stop,
        })).collect::<Vec<_>>(),
        "budget": budget,
        "scene": { "bodies": scene::bodies(model, &plan.urdf, plan.frame), "poses": poses, "trail": trail },
        "violations": violations,
        "version": env!("CARGO_PKG_VERSION"),
        "command": std::env::args().skip(1).fold("condyle".to_owned(), |line, word| line + " " + &word),
    })
}

/// Numbers to six digits: what a screen can show.
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
