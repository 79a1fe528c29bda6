//! Report of a walk, as text and as JSON.

use super::walked::Walked;
use crate::limits::Limited;
use crate::report::Violation;
use crate::terminal::{Style, Table, styled};
use serde_json::{Value, json};

/// Largest number of exceeded limits that the text lists.
const MOST_LINES: usize = 5;

/// Returns the recorded values of a limited quantity.
pub(crate) fn values(walked: &Walked, quantity: &Limited<'_>) -> Vec<f64> {
    let (walk, nq) = (&walked.walk, walked.model.nq());
    match quantity.what {
        "position" => walk.states.iter().map(|x| x[quantity.index]).collect(),
        "velocity" => walk.states.iter().map(|x| x[nq + quantity.index]).collect(),
        _ => walk.efforts.iter().map(|tau| tau[quantity.index]).collect(),
    }
}

/// Returns the report as text.
pub(crate) fn text(walked: &Walked, violations: &[Violation]) -> String {
    let (walk, model, settings) = (&walked.walk, &walked.model, &walked.settings);
    let mut text = format!("{}: {} kg, {} degrees of freedom\n", model.name(), short(model.total_mass()), model.nv());
    text += &format!("feet: {}\n", walked.feet_source);
    for foot in &walked.feet {
        text += &format!("  `{}`, {} ({})\n", foot.foot.frame, foot.shape(), foot.source);
    }
    let (source, angles) = &walked.posture;
    text += &format!("posture: {source}, trunk at {:.3} m\n", walk.states[0][2]);
    if !angles.is_empty() {
        text += &format!("  {angles}\n");
    }
    if !walked.regular.is_empty() {
        text += &format!("joints that move hardly any inertia got an armature: {}\n", walked.regular.join(", "));
    }
    let (knots, knot_ms) = (settings.knots(), 1e3 * settings.knot);
    text += &format!("gait: {}\n", walked.gait_text);
    text += &format!("control: {} Hz, {knots} knots of {} ms\n\n", short(walked.rate), short(knot_ms));
    text += &match &walk.fall {
        None => styled(Style::Good, &format!("no fall in {:.2} s", walk.duration())),
        Some((time, what)) => styled(Style::Bad, &format!("fell after {time:.2} s: {what}")),
    };
    let (mean, since) = walk.mean_velocity(walked.command);
    text += &format!("\n\nmean velocity since {since:.1} s\n");
    let mut table = Table::new(&["", "command", "mean"]);
    let names = ["forwards (m/s)", "to the left (m/s)", "turning (rad/s)"];
    for ((name, command), mean) in names.into_iter().zip(walked.command.to_array()).zip(mean) {
        table.row(vec![name.to_owned(), format!("{command:.3}"), format!("{mean:.3}")]);
    }
    text += &table.text();
    text += &format!("largest tilt of the trunk: {:.1}°\n", walk.tilt.to_degrees());
    let budget = walked.budget_ms();
    let (median, high, over) = walk.tick_times(budget);
    let count = walk.ticks.len();
    let share = 100.0 * over as f64 / count.max(1) as f64;
    text += &format!(
        "{count} ticks: median {} ms, 99 % within {} ms; {over} ({} %) take more than the budget of {} ms\n",
        short(median),
        short(high),
        short(share),
        short(budget)
    );
    for v in violations.iter().take(MOST_LINES) {
        let time = walk.times[v.at_knot];
        text += &format!(
            "the {} of `{}` is {:.3} beyond its limit {} at {time:.2} s\n",
            v.what, v.joint, v.amount, v.limit
        );
    }
    if violations.len() > MOST_LINES {
        text += &format!("and {} other limits are exceeded: see the page\n", violations.len() - MOST_LINES);
    }
    text
}

/// Formats a number with three significant digits.
fn short(x: f64) -> String {
    crate::terminal::short(format!("{x:.2e}").parse().unwrap_or(x))
}

/// Returns the report as JSON.
pub(crate) fn summary(walked: &Walked, violations: &[Violation]) -> Value {
    let (walk, budget_ms) = (&walked.walk, walked.budget_ms());
    let (mean, since) = walk.mean_velocity(walked.command);
    let (median_ms, p99_ms, over) = walk.tick_times(budget_ms);
    let feet = walked.feet.iter().map(|foot| {
        let radius = if foot.sole().is_none() { Some(foot.height()) } else { None };
        json!({"frame": foot.foot.frame, "radius": radius, "sole": foot.sole(), "source": foot.source})
    });
    json!({
        "robot": walked.model.name(), "feet": feet.collect::<Vec<_>>(), "feet_source": walked.feet_source,
        "posture": walked.posture.1, "posture_source": walked.posture.0, "height": walk.states[0][2],
        "gait": walked.gait_text, "knots": walked.settings.knots(), "rate_hz": walked.rate,
        "duration_s": walk.duration(), "command": walked.command.to_array(), "mean_velocity": mean,
        "mean_since_s": since, "largest_tilt_rad": walk.tilt,
        "ticks": {"count": walk.ticks.len(), "median_ms": median_ms, "p99_ms": p99_ms, "budget_ms": budget_ms, "over": over},
        "fall": walk.fall.as_ref().map(|(time, what)| json!({"time_s": time, "what": what})),
        "violations": violations, "armature_added": walked.regular,
    })
}
