//! `condyle plan`: a reaching motion for an arm, by FDDP on forward dynamics and its derivatives.

use crate::{page, posture, report};
use condyle::optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle::optimal::{Fddp, Problem, Solution, Status};
use condyle::{
    Data, Model, UrdfOptions, Vec3, difference, forward_kinematics, gravity, integrate, neutral, rnea, robots,
};
use std::path::PathBuf;
use std::sync::Arc;

/// Plan a motion that brings a frame of the robot to a point, and write it as a page to look at.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// URDF of the robot, its root link fixed to the world; meshes are not needed. Default: the arm that comes along
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// The frame that moves to the target: a link or joint of the URDF. Default: the last one that moves
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Where it goes, in the world's frame (m). Default: a point that the robot's own arm reaches
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers, allow_hyphen_values = true)]
    target: Option<Numbers>,
    /// Where it starts, nq numbers (rad, m). Default: neutral, or mid-range where neutral is outside of the limits
    #[arg(long, value_name = "Q,…", value_parser = numbers, allow_hyphen_values = true)]
    q0: Option<Numbers>,
    /// Knots of the horizon
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    knots: u32,
    /// Seconds from knot to knot
    #[arg(long, default_value_t = 0.01, value_name = "SECONDS", allow_negative_numbers = true)]
    dt: f64,
    /// The time that one solver iteration may take (ms); going over is said, and no error
    #[arg(long, default_value_t = 10.0, value_name = "MS", allow_negative_numbers = true)]
    budget_ms: f64,
    /// How far from the target is still there (m)
    #[arg(long, default_value_t = 0.01, value_name = "METRES", allow_negative_numbers = true)]
    tolerance: f64,
    /// Iterations after which the solver stops
    #[arg(long, default_value_t = 200)]
    max_iterations: usize,
    /// Where the page goes
    #[arg(long, default_value = "out/plan.html", value_name = "FILE")]
    out: PathBuf,
}

/// Numbers on the command line, with commas between them.
#[derive(Clone)]
struct Numbers(Vec<f64>);

fn numbers(text: &str) -> Result<Numbers, String> {
    let number = |x: &str| match x.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{}` is not a finite number", x.trim())),
    };
    text.split(',').map(number).collect::<Result<_, _>>().map(Numbers)
}

/// Why there is no plan, or not the one asked for.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error(transparent)]
    Model(#[from] condyle::Error),
    #[error(transparent)]
    Problem(#[from] condyle::optimal::Error),
    #[error("--{option}: {what}")]
    Option { option: &'static str, what: String },
    #[error("the robot has no joint that moves")]
    Rigid,
    #[error("`{frame}` ends {miss:.4} m from the target, more than --tolerance {tolerance} m: {hint}")]
    Missed { frame: String, miss: f64, tolerance: f64, hint: &'static str },
    #[error("{file}: {source}")]
    Write { file: String, source: std::io::Error },
}

/// What was asked for, and what came out.
pub(crate) struct Plan {
    pub model: Arc<Model>,
    /// The robot's URDF, of which the page draws the simple shapes.
    pub urdf: String,
    pub frame: usize,
    pub target: Vec3<f64>,
    /// How far the frame ends from the target (m).
    pub miss: f64,
    pub tolerance: f64,
    pub dt: f64,
    pub budget_ms: f64,
    pub solution: Solution,
}

/// Where the frame of the arm that comes along goes, unless told otherwise.
const DEFAULT_TARGET: [f64; 3] = [0.45, -0.25, 0.35];
const DEFAULT_FRAME: &str = "tool";
/// What an effort without a limit is weighed with, as if its limit were 100 N m or N.
const WITHOUT_LIMIT: f64 = 1e-4;

/// The whole of `condyle plan`.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    let option = |option, what: String| Err(Error::Option { option, what });
    for (name, value) in [("dt", arguments.dt), ("budget-ms", arguments.budget_ms), ("tolerance", arguments.tolerance)]
    {
        if !(value > 0.0 && value.is_finite()) {
            return option(name, format!("must be above 0, not {value}"));
        }
    }
    let (model, urdf) = match &arguments.robot {
        None => (robots::arm7(), robots::ARM7.to_owned()),
        Some(path) => {
            let model = Model::from_urdf(path, &UrdfOptions::default())?;
            let urdf = std::fs::read_to_string(path)
                .map_err(|source| Error::Write { file: path.display().to_string(), source })?;
            (model, urdf)
        }
    };
    let model = Arc::new(model);
    if model.nv() == 0 {
        return Err(Error::Rigid);
    }
    let frame = match (&arguments.frame, &arguments.robot) {
        (Some(name), _) => model.frame(name)?,
        (None, None) => model.frame(DEFAULT_FRAME)?,
        (None, Some(_)) => last_frame(&model),
    };
    let target = match (&arguments.target, &arguments.robot) {
        (Some(Numbers(x)), _) if x.len() == 3 => Vec3::new(x[0], x[1], x[2]),
        (Some(Numbers(x)), _) => return option("target", format!("expected 3 numbers, found {}", x.len())),
        (None, None) => DEFAULT_TARGET.into(),
        (None, Some(_)) => return option("target", "say where to go: a robot of yours has no default".to_owned()),
    };
    let q0 = match &arguments.q0 {
        None => start(&model),
        Some(Numbers(q)) if q.len() == model.nq() => q.clone(),
        Some(Numbers(q)) => return option("q0", format!("expected {} numbers, found {}", model.nq(), q.len())),
    };

    print!("{model}");
    let name = &model.frames()[frame].name;
    println!(
        "`{name}` goes to ({}, {}, {}) m in {} knots of {} ms\n",
        target.x,
        target.y,
        target.z,
        arguments.knots,
        1e3 * arguments.dt
    );
    let knots = arguments.knots as usize;
    let (q_end, nearest) = posture::reaching(&model, frame, target, &q0);
    let (mut problem, xs, us) = reach(&model, frame, target, (&q0, &q_end), knots, arguments.dt)?;
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = arguments.max_iterations;
    report::iteration_header();
    let solution = solver.solve_with(&mut problem, &xs, &us, report::iteration)?.clone();
    let mut data = Data::new(&model);
    let end = forward_kinematics(&model, &mut data, &solution.x(knots)[..model.nq()]).frame(frame).translation;
    let plan = Plan {
        miss: (end - target).norm_squared().sqrt(),
        tolerance: arguments.tolerance,
        dt: arguments.dt,
        budget_ms: arguments.budget_ms,
        model,
        urdf,
        frame,
        target,
        solution,
    };
    let budget = report::measure(&plan);
    let violations = report::violations(&plan);
    report::print(&plan, &budget, &violations);
    page::write(&arguments.out, &plan, &budget, &violations)
        .map_err(|source| Error::Write { file: arguments.out.display().to_string(), source })?;
    println!("\nwrote {}", arguments.out.display());
    if plan.miss > plan.tolerance || plan.miss.is_nan() {
        let hint = match plan.solution.status {
            _ if nearest > plan.tolerance => "no posture within the joints' limits was found that reaches it",
            Status::Converged => "it may be too far for the time that there is; more --knots may help",
            _ => "the solver did not converge; more --knots, more --max-iterations or another --q0 may help",
        };
        let frame = plan.model.frames()[frame].name.clone();
        return Err(Error::Missed { frame, miss: plan.miss, tolerance: plan.tolerance, hint });
    }
    Ok(())
}

/// The last frame on the body that is farthest from the root: the tip of an arm.
fn last_frame(model: &Model) -> usize {
    let depth = |mut body: usize| {
        let mut depth = 0;
        while body > 0 {
            body = model.bodies()[body].parent;
            depth += 1;
        }
        depth
    };
    (0..model.frames().len()).max_by_key(|&f| depth(model.frames()[f].body)).unwrap_or(0)
}

/// Neutral, but mid-range for the coordinates whose limits exclude it.
fn start(model: &Model) -> Vec<f64> {
    let limits = model.limits();
    let inside = |(k, q): (usize, f64)| {
        let (lower, upper) = (limits.lower[k], limits.upper[k]);
        if (lower..=upper).contains(&q) { q } else { 0.5 * (lower + upper) }
    };
    neutral(model).into_iter().enumerate().map(inside).collect()
}

/// A problem, and where the solver begins: states and efforts.
type Posed = (Problem, Vec<f64>, Vec<f64>);

/// The optimal control problem, and a warm start: on the straight way to a posture that reaches the target, with the
/// efforts that inverse dynamics gives for it.
///
/// It weighs speed, the efforts beyond those that hold the start (each against its limit), and, as barriers, what lies
/// outside of the limits of position, speed and effort; at the end, the distance to the target and the speed.
fn reach(
    model: &Arc<Model>,
    frame: usize,
    target: Vec3<f64>,
    (q0, q_end): (&[f64], &[f64]),
    knots: usize,
    dt: f64,
) -> Result<Posed, Error> {
    let nv = model.nv();
    let limits = model.limits();
    let rest = |q: &[f64]| [q, &vec![0.0; nv]].concat();
    let x0 = rest(q0);
    let state = || Residual::State { reference: rest(&neutral(model)) };
    let moving = |speed: f64| Activation::Weighted([vec![0.0; nv], vec![speed; nv]].concat());
    // limits of joints with one coordinate, as bounds on the tangent vector from neutral
    let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; 2 * nv], vec![f64::INFINITY; 2 * nv]);
    for body in model.bodies()[1..].iter().filter(|b| b.joint.nq() == 1) {
        (lower[body.idx_v], upper[body.idx_v]) = (limits.lower[body.idx_q], limits.upper[body.idx_q]);
    }
    for (k, &speed) in limits.velocity.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        (lower[nv + k], upper[nv + k]) = (-speed, speed);
    }
    let within = || Activation::Barrier { lower: lower.clone(), upper: upper.clone() };
    let bounds: Vec<f64> = limits.effort.iter().map(|&e| if e > 0.0 { e } else { f64::INFINITY }).collect();
    let share = bounds.iter().map(|e| if e.is_finite() { e.powi(-2) } else { WITHOUT_LIMIT }).collect();
    let efforts = Activation::Barrier { lower: bounds.iter().map(|e| -e).collect(), upper: bounds };
    let hold = gravity(model, &mut Data::new(model), q0).to_vec();
    let position = Residual::FrameTranslation { frame: (&model.frames()[frame]).into(), target };
    let running = vec![
        Cost::new("speed", 1e-1, state(), moving(1.0)),
        Cost::new("effort", 1e0, Residual::Control { reference: hold }, Activation::Weighted(share)),
        Cost::new("limits", 1e2, state(), within()),
        Cost::new("effort limits", 1e1, Residual::Control { reference: vec![0.0; nv] }, efforts),
    ];
    let terminal = vec![
        Cost::new("target", 1e4, position, Activation::Quadratic),
        Cost::new("stop", 1e0, state(), moving(1.0)),
        Cost::new("limits", 1e2, state(), within()),
    ];
    // the straight way with the least jerk: q0 ⊕ s(t) way, s = 10 r³ − 15 r⁴ + 6 r⁵, r = t/T
    let (mut data, mut q, mut way) = (Data::new(model), q0.to_vec(), vec![0.0; nv]);
    difference(model, q0, q_end, &mut way);
    let along = |s: f64| way.iter().map(|d| d * s).collect::<Vec<f64>>();
    let duration = knots as f64 * dt;
    let (mut xs, mut us) = (Vec::new(), Vec::new());
    for t in 0..=knots {
        let r = t as f64 / knots as f64;
        let v = along(30.0 * r * r * (1.0 - r) * (1.0 - r) / duration);
        let a = along(60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / (duration * duration));
        integrate(model, q0, &along(r * r * r * (10.0 + r * (6.0 * r - 15.0))), &mut q);
        if t < knots {
            us.extend(rnea(model, &mut data, &q, &v, &a, &[]));
        }
        xs.extend(q.iter().chain(&v));
    }
    let action = FreeDynamics::running(model.clone(), dt, running)?;
    let end = FreeDynamics::terminal(model.clone(), terminal)?;
    Ok((Problem::new(x0, vec![Box::new(action)], vec![0; knots], Box::new(end))?, xs, us))
}
