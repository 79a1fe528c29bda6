//! Writes a page that plays a motion. The page uses the template and the scripts of `condyle plan`.

use condyle::optimal::Solution;
use condyle::{Data, Model, Se3, forward_kinematics, spatial::Quaternion};
use serde_json::{Value, json};
use std::path::Path;

/// Placeholders of the template, and the texts that replace them, in this order.
const PARTS: [(&str, &str); 7] = [
    ("/*{{uplot.css}}*/", include_str!("../../crates/cli/page/vendor/uPlot.min.css")),
    ("/*{{plan.css}}*/", include_str!("../../crates/cli/page/plan.css")),
    ("/*{{three.js}}*/", include_str!("../../crates/cli/page/vendor/three.bundle.js")),
    ("/*{{uplot.js}}*/", include_str!("../../crates/cli/page/vendor/uPlot.iife.min.js")),
    ("/*{{scene.js}}*/", include_str!("../../crates/cli/page/scene.js")),
    ("/*{{plots.js}}*/", include_str!("../../crates/cli/page/plots.js")),
    ("/*{{plan.js}}*/", include_str!("../../crates/cli/page/plan.js")),
];

fn pose(placement: Se3<f64>) -> [f64; 7] {
    let (p, q) = (placement.translation, Quaternion::from_rotation(placement.rotation));
    [p.x, p.y, p.z, q.vector.x, q.vector.y, q.vector.z, q.scalar]
}

/// Returns the shapes that the page draws for each body: line segments to the joints and to the feet that the body
/// carries.
fn bodies(model: &Model, feet: &[&str]) -> Vec<Value> {
    let mut shapes = vec![Vec::new(); model.bodies().len()];
    let mut bone = |body: usize, to: [f64; 3], radius: f64| {
        let size = [0.0, 0.0, 0.0, to[0], to[1], to[2], radius];
        let none = Value::Null;
        shapes[body]
            .push(json!({"kind": "segment", "size": size, "position": none, "quaternion": none, "color": none}));
    };
    for body in model.bodies().iter().skip(1).filter(|body| body.parent > 0) {
        bone(body.parent, body.placement.translation.to_array(), 0.02);
    }
    for foot in model.frames().iter().filter(|frame| feet.contains(&frame.name.as_str())) {
        bone(foot.body, foot.placement.translation.to_array(), 0.015);
    }
    let body = |(k, body): (usize, &condyle::tree::Body)| {
        let parent = if k == 0 { -1 } else { body.parent as isize };
        json!({"name": body.name, "parent": parent, "shapes": core::mem::take(&mut shapes[k])})
    };
    model.bodies().iter().enumerate().map(body).collect()
}

/// Returns, for each joint and each quantity that violates its limits, the knot with the largest violation.
fn violations(
    joints: &[&condyle::tree::Body],
    name: &str,
    values: &[Vec<f64>],
    limits: &dyn Fn(&condyle::tree::Body) -> [f64; 2],
) -> Vec<Value> {
    let mut found = Vec::new();
    for (k, body) in joints.iter().enumerate() {
        let [lower, upper] = limits(body);
        let beyond = |x: f64| if x > upper { (x - upper, upper) } else { (lower - x, lower) };
        let worst = values.iter().map(|row| beyond(row[k])).enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        if let Some((at_knot, (amount, limit))) = worst.filter(|(_, (amount, _))| *amount > 0.0) {
            found.push(
                json!({"what": name, "joint": body.joint_name, "at_knot": at_knot, "amount": amount, "limit": limit}),
            );
        }
    }
    found
}

/// Writes a page that plays a motion, and draws the path of the first foot.
///
/// An impact is a knot without duration and controls. The page omits the state before the impact.
pub(crate) fn write(
    path: &Path,
    title: &str,
    model: &Model,
    feet: &[&str],
    solution: &Solution,
    times: &[f64],
) -> std::io::Result<()> {
    let last = times.len() - 1;
    let knots: Vec<usize> = (0..=last).filter(|&t| t == last || times[t + 1] > times[t]).collect();
    let joints: Vec<_> = model.bodies()[1..].iter().filter(|body| body.joint.nv() == 1).collect();
    let limits = model.limits();
    let finite = |x: f64| x.is_finite().then_some(x);
    let joint = |body: &&condyle::tree::Body| {
        json!({
            "name": body.joint_name,
            "unit": if matches!(body.joint, condyle::Joint::Prismatic { .. }) { "m" } else { "rad" },
            "lower": finite(limits.lower[body.idx_q]), "upper": finite(limits.upper[body.idx_q]),
            "velocity": finite(limits.velocity[body.idx_v]), "effort": finite(limits.effort()[body.idx_v]),
        })
    };
    let passive = model.nv() - joints.len();
    let series = |knots: &[usize], value: &dyn Fn(usize, &condyle::tree::Body) -> f64| -> Vec<Vec<f64>> {
        knots.iter().map(|&t| joints.iter().map(|body| value(t, body)).collect()).collect()
    };
    let mut data = Data::new(model);
    let (mut poses, mut trail) = (Vec::new(), Vec::new());
    for &t in &knots {
        let placements = forward_kinematics(model, &mut data, &solution.x(t)[..model.nq()]);
        poses.push((0..model.bodies().len()).map(|k| pose(placements.body(k))).collect::<Vec<_>>());
        trail.push(placements.frame(model.frame(feet[0]).expect("the robot has this foot")).translation.to_array());
    }
    let iteration = |i: &condyle::optimal::Iteration| {
        json!({
            "iteration": i.iteration, "cost": i.cost, "gap": i.gap, "step": i.accepted.then_some(i.step),
            "regularisation": i.regularisation, "stop": i.stop,
        })
    };
    let q = series(&knots, &|t, body| solution.x(t)[body.idx_q]);
    let v = series(&knots, &|t, body| solution.x(t)[model.nq() + body.idx_v]);
    let tau = series(&knots[..knots.len() - 1], &|t, body| solution.u(t)[body.idx_v - passive]);
    let beyond = [
        violations(&joints, "position", &q, &|b| [limits.lower[b.idx_q], limits.upper[b.idx_q]]),
        violations(&joints, "velocity", &v, &|b| [-limits.velocity[b.idx_v], limits.velocity[b.idx_v]]),
        violations(&joints, "torque", &tau, &|b| [limits.effort_lower[b.idx_v], limits.effort_upper[b.idx_v]]),
    ]
    .concat();
    let data = json!({
        "robot": model.name(), "title": title, "status": format!("{:?}", solution.status).to_lowercase(),
        "frame": feet[0], "target": null, "miss": null, "tolerance": null,
        "dt": times[1] - times[0], "times": knots.iter().map(|&t| times[t]).collect::<Vec<_>>(),
        "joints": joints.iter().map(joint).collect::<Vec<_>>(),
        "q": q, "v": v, "tau": tau,
        "iterations": solution.trace.iter().map(iteration).collect::<Vec<_>>(),
        "budget": null,
        "scene": { "bodies": bodies(model, feet), "poses": poses, "trail": trail },
        "violations": beyond, "version": env!("CARGO_PKG_VERSION"), "command": null,
    });
    let mut page = include_str!("../../crates/cli/page/plan.html").to_owned();
    for (place, text) in PARTS {
        page = page.replacen(place, text, 1);
    }
    let data = data.to_string().replace('<', "\\u003c");
    std::fs::write(path, page.replacen("/*{{data}}*/", &data, 1))
}
