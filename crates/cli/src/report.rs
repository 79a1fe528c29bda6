//! Prints the result of `condyle plan`: iterations, computing times, and exceeded limits.

use crate::limits::{LimitCounts, Limited, limited};
use crate::met::{HELD, Met, Worst};
use crate::motion::Plan;
use crate::terminal::{Style, styled};
use condyle::optimal::{Iteration, Status};
use condyle::{Data, Model, aba, aba_derivatives, rnea};
use serde::Serialize;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Relative tolerance for limits. An excess is not reported if it is below this fraction of the range, or below this
/// number if the range is less than 1.
const ROUNDING: f64 = 1e-5;
/// Largest number of reached bounds, and of times for each of them, that the text lists.
const MOST_LINES: usize = 12;
const MOST_SPANS: usize = 4;
/// Number of timed repetitions of a function. The median of these times is reported.
const REPETITIONS: usize = 11;

pub(crate) const ITERATION_HEADER: &str = "iteration           cost        gap    step  regularisation\n";

pub(crate) fn iteration(i: &Iteration) -> String {
    let step = if i.accepted { format!("{:.4}", i.step) } else { "none".to_owned() };
    format!("{:9}  {:13.6}  {:9.2e}  {step:>6}  {:14.0e}\n", i.iteration, i.cost, i.gap, i.regularisation)
}

/// One row in the table of times.
#[derive(Serialize)]
pub(crate) struct Row {
    pub name: &'static str,
    pub us_per_knot: f64,
    pub ms_per_horizon: f64,
}

/// Computing times of a solve.
#[derive(Serialize)]
pub(crate) struct Budget {
    pub budget_ms: f64,
    pub knots: usize,
    pub per: &'static str,
    /// Time of each part of a solver iteration.
    pub rows: Vec<Row>,
    /// Sum of the times in all rows.
    pub total_ms: f64,
    /// Times of single dynamics functions that a solver iteration calls. They do not count in `total_ms`.
    pub alone: Vec<Row>,
    #[serde(skip)]
    pub solve_ms: f64,
}

/// Returns the median time of a pass over all knots.
fn median(knots: usize, mut f: impl FnMut(usize)) -> Duration {
    let mut times = [Duration::ZERO; REPETITIONS];
    for time in &mut times {
        let start = Instant::now();
        (0..knots).for_each(&mut f);
        *time = start.elapsed();
    }
    times.sort();
    times[REPETITIONS / 2]
}

/// Measures the dynamics on the planned motion. For backward sweep and rollout, takes the times that the solver
/// measured.
pub(crate) fn measure(plan: &Plan) -> Budget {
    let (model, solution) = (&plan.model, &plan.solution);
    let (nq, nv) = (model.nq(), model.nv());
    let knots = plan.knots();
    let efforts: Vec<Vec<f64>> = (0..knots).map(|t| plan.effort(t)).collect();
    let mut data = Data::new(model);
    let no_acceleration = vec![0.0; nv];
    let state = |t: usize| solution.x(t).split_at(nq);
    let aba_time = median(knots, |t| {
        let (q, v) = state(t);
        aba(model, &mut data, q, v, &efforts[t], &[]);
    });
    let derivatives_time = median(knots, |t| {
        let (q, v) = state(t);
        aba_derivatives(model, &mut data, q, v, &efforts[t], &[]);
    });
    let rnea_time = median(knots, |t| {
        let (q, v) = state(t);
        rnea(model, &mut data, q, v, &no_acceleration, &[]);
    });
    let iterations = u32::try_from(solution.trace.len().max(1)).unwrap_or(u32::MAX);
    let timings = &solution.timings;
    let row = |name, time: Duration| Row {
        name,
        us_per_knot: 1e6 * time.as_secs_f64() / knots as f64,
        ms_per_horizon: 1e3 * time.as_secs_f64(),
    };
    let rows = vec![
        row("Derivatives and costs", timings.calc_diff / iterations),
        row("Riccati sweep", timings.sweep / iterations),
        row("Rollout", timings.rollout / iterations),
    ];
    Budget {
        budget_ms: plan.budget_ms,
        knots,
        per: "one solver iteration",
        total_ms: rows.iter().map(|row| row.ms_per_horizon).sum(),
        rows,
        alone: vec![row("ABA", aba_time), row("ABA derivatives", derivatives_time), row("RNEA", rnea_time)],
        solve_ms: 1e3 * timings.total.as_secs_f64(),
    }
}

/// Exceeded limit of one quantity, at the knot where the excess is largest.
#[derive(Serialize)]
pub(crate) struct Violation {
    /// Quantity: `position`, `velocity` or `torque`.
    pub what: &'static str,
    pub joint: String,
    pub at_knot: usize,
    /// Largest excess over the limit.
    pub amount: f64,
    pub limit: f64,
}

/// Returns all quantities of a plan that exceed their limits.
pub(crate) fn violations(plan: &Plan) -> Vec<Violation> {
    exceeded(&plan.model, |quantity| plan.values(quantity))
}

/// Returns all quantities that exceed their limits. `values` returns the values of a quantity at all knots.
pub(crate) fn exceeded(model: &Model, values: impl Fn(&Limited<'_>) -> Vec<f64>) -> Vec<Violation> {
    let mut found = Vec::new();
    for quantity in limited(model) {
        let values = values(&quantity);
        let Limited { what, joint, lower, upper, .. } = quantity;
        let beyond = |x: f64| if x > upper { (x - upper, upper) } else { (lower - x, lower) };
        let worst = values.into_iter().map(beyond).enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let range = if (upper - lower).is_finite() { upper - lower } else { 1.0 };
        if let Some((at_knot, (amount, limit))) = worst
            && (amount > ROUNDING * range.max(1.0) || amount.is_nan())
        {
            found.push(Violation { what, joint: joint.to_owned(), at_knot, amount, limit });
        }
    }
    found
}

/// Returns a short text for the status with which the solver stopped.
pub(crate) fn status(plan: &Plan) -> &'static str {
    match plan.solution.status {
        _ if plan.settled.is_some() => "settled",
        Status::Converged => "converged",
        Status::MaxIterations => "iteration limit",
        Status::RegularisationLimit if plan.held.is_some() => "no step accepted",
        Status::RegularisationLimit => "no descent found",
        Status::TimeLimit => "out of time",
        Status::Interrupted => "interrupted",
        Status::ConstraintsViolated => "the limits could not be restored",
        Status::Infeasible => "infeasible: no small change reduces the violation of the limits",
        _ => "not finite",
    }
}

/// Returns the part of the report that is printed after the list of iterations.
pub(crate) fn text(plan: &Plan, budget: &Budget, violations: &[Violation], met: &[Met]) -> String {
    let (model, iterations) = (&plan.model, plan.trace.len());
    let ended = styled(if plan.is_solved() { Style::Good } else { Style::Bad }, status(plan));
    let mut text = format!("\n{ended} after {iterations} iterations, {:.1} ms\n", budget.solve_ms);
    if let Some(left) = plan.settled {
        let why = "rounding keeps the gradient of the Lagrangian above its tolerance";
        text += &format!(
            "settled: the constraints hold, and the expected decrease of the cost is {left:.0e} of the cost; {why}\n"
        );
    }
    let worst = worst(plan);
    if let Some(worst) = &worst {
        text += &format!("{worst}\n");
    }
    if let Some(goal) = &plan.goal {
        text += &format!("`{}` ends {:.2} mm from the target\n", model.frames()[goal.frame].name, 1e3 * goal.miss);
    }
    if !plan.feet.is_empty() {
        let (first, last) = (plan.solution.x(0), plan.solution.x(plan.knots()));
        let [x, y] = [0, 1].map(|k| last[k] - first[k]);
        let time = plan.times.last().copied().unwrap_or(0.0);
        text += &format!("the base goes {x:.3} m ahead and {y:.3} m to the left in {time:.2} s\n");
    }
    text += &format!("\n{:<22}  µs per knot  ms per horizon of {}\n", "", budget.knots);
    let mut line = |name: &str, row: &Row| {
        text += &format!("{name:<22}  {:11.2}  {:14.3}\n", row.us_per_knot, row.ms_per_horizon);
    };
    for row in &budget.alone {
        line(&format!("{}, alone", row.name), row);
    }
    for row in &budget.rows {
        line(row.name, row);
    }
    let us_per_knot = 1e3 * budget.total_ms / budget.knots as f64;
    line("One iteration", &Row { name: "", us_per_knot, ms_per_horizon: budget.total_ms });
    let verdict = if budget.total_ms <= budget.budget_ms { "within" } else { "OVER" };
    text += &format!("one iteration is {verdict} the budget of {} ms\n", budget.budget_ms);
    let limits = LimitCounts::new(&plan.robot);
    let but = match &worst {
        Some(worst) if worst.is_gap() => ", but the motion does not follow the dynamics",
        Some(_) => " up to rounding",
        None => "",
    };
    text += &match (limits.total(), violations.len()) {
        (0, _) => format!("\n{limits}: nothing to check\n"),
        (1, 0) => format!("\n{limits}: the limit holds at all knots{but}\n"),
        (total, 0) => format!("\n{limits}: all {total} hold at all knots{but}\n"),
        (total, beyond) => {
            let are = if beyond == 1 { "is" } else { "are" };
            format!("\n{limits}\n{}\n", styled(Style::Bad, &format!("{beyond} of these {total} {are} exceeded:")))
        }
    };
    for v in violations {
        text +=
            &format!("  {} of `{}` by {:.3e} (limit {}) at knot {}\n", v.what, v.joint, v.amount, v.limit, v.at_knot);
    }
    if !met.is_empty() {
        let bounds = if met.len() == 1 { "bound is" } else { "bounds are" };
        text += &format!("{} {bounds} reached:\n", met.len());
    }
    met.iter().take(MOST_LINES).for_each(|met| text += &line_of(met));
    if met.len() > MOST_LINES {
        text += &format!("  and {} more: see the page\n", met.len() - MOST_LINES);
    }
    text
}

/// Returns the line about a bound that the motion reaches.
fn line_of(met: &Met) -> String {
    let Met { what, joint, bound, limit, times, multiplier, .. } = met;
    let span = |&[first, last]: &[f64; 2]| match last > first {
        true => format!("{first:.3} to {last:.3} s"),
        false => format!("{first:.3} s"),
    };
    let mut spans: Vec<String> = times.iter().take(MOST_SPANS).map(span).collect();
    if times.len() > MOST_SPANS {
        spans.push("…".to_owned());
    }
    let multiplier = multiplier.map_or_else(String::new, |y| format!(", multiplier {y:.2e}"));
    format!("  {what} of `{joint}` at its {bound} limit {limit}: {}{multiplier}\n", spans.join(", "))
}

/// Returns the largest violation that a solve with limits left, unless the limits and the dynamics hold.
pub(crate) fn worst(plan: &Plan) -> Option<Worst> {
    Worst::new(plan, HELD)
}

/// Returns the report as JSON.
pub(crate) fn summary(plan: &Plan, budget: &Budget, violations: &[Violation], met: &[Met]) -> Value {
    let goal = plan.goal.as_ref().map(|goal| {
        let frame = &plan.model.frames()[goal.frame].name;
        json!({"frame": frame, "target": goal.target.to_array(), "miss": goal.miss, "tolerance": goal.tolerance})
    });
    json!({
        "robot": plan.model.name(), "title": plan.title, "status": plan.solution.status, "settled": plan.settled, "cost": plan.solution.cost,
        "iterations": plan.trace.len(), "knots": plan.knots(), "duration_s": plan.times.last(), "goal": goal,
        "solve_ms": budget.solve_ms, "budget": budget, "limits": LimitCounts::new(&plan.robot), "violations": violations,
        "limits_met": met, "worst": worst(plan),
    })
}
