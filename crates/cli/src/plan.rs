//! `condyle plan`: plans motions with FDDP, and with an interior point where limits are exceeded. An arm reaches for a
//! point; a robot with feet stands, steps and jumps.

use crate::error::{Error, positive};
use crate::gait::Gait;
use crate::limits::{LimitCounts, check_start, last_frame, start};
use crate::met::{HELD, Held, Worst};
use crate::motion::{Goal, Plan};
use crate::robot::{self, ReadingOptions};
use crate::task::{self, Task};
use crate::terminal::say;
use crate::watch::{self, Watch};
use crate::{met, page, posture, reach, record, report};
use condyle::optimal::{Fddp, InteriorPoint, Problem, Status};
use condyle::{Data, Model, Vec3, forward_kinematics};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Plan a motion and write it as an HTML page: an arm reaches for a point, or a robot follows the gait of a task file
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle plan
  condyle plan --robot panda.urdf --frame panda_hand_tcp --target 0.45,-0.2,0.4
  condyle plan --example trot > trot.toml
  condyle plan trot.toml --out trot.html --record trot.csv

A task file is TOML; --example writes one with comments on its entries. Limits of positions, speeds and efforts in the
robot's file are enforced. The report counts them, and lists the bounds that the motion reaches. The exit status is 1 if a
limit is exceeded or the target is missed. A motion is `settled`, with exit status 0, if the limits hold and the expected
decrease of the cost is below 1e-9 of the cost, but the solver did not reach its tolerance for the gradient of the
Lagrangian. Ctrl-C stops the solver; the page and the record then contain the best motion so far.")]
pub(crate) struct Arguments {
    /// Task file, which replaces the options for robot, frame and target
    #[arg(value_name = "TASK.toml", conflicts_with_all = ["robot", "frame", "target", "q0", "knots", "tolerance"])]
    task: Option<PathBuf>,
    /// Write an example task file to standard output: reach, trot, walk, jump, stand-up
    #[arg(long, value_name = "NAME", exclusive = true)]
    example: Option<String>,
    /// Robot: a URDF, MJCF or SDF file, or a built-in robot (arm7, quadruped, humanoid); meshes are optional. Default:
    /// arm7
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    #[command(flatten)]
    options: ReadingOptions,
    /// Frame that moves to the target: a link or joint of the URDF. Default: the last frame of the outermost body
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Target in the world frame (m); required with --robot. Default: a point that the default robot reaches
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers, allow_hyphen_values = true)]
    target: Option<Numbers>,
    /// Initial position, nq numbers (rad, m). Default: neutral, but mid-range for coordinates whose limits exclude
    /// neutral
    #[arg(long, value_name = "Q,…", value_parser = numbers, allow_hyphen_values = true)]
    q0: Option<Numbers>,
    /// Number of knots of the horizon
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    knots: u32,
    /// Time between knots (s). Default: the `dt` of the task, else 0.01
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    dt: Option<f64>,
    /// Time budget per solver iteration (ms); overruns are reported but are not errors
    #[arg(long, default_value_t = 10.0, value_name = "MS", allow_negative_numbers = true)]
    budget_ms: f64,
    /// Distance to the target that counts as reached (m)
    #[arg(long, default_value_t = 0.01, value_name = "METRES", allow_negative_numbers = true)]
    tolerance: f64,
    /// Maximum number of iterations of each solve: without limits, and then with limits if any is exceeded
    #[arg(long, default_value_t = 200)]
    max_iterations: usize,
    /// File for the HTML page
    #[arg(long, default_value = "out/plan.html", value_name = "FILE")]
    out: PathBuf,
    /// Meshes (STL, DAE, OBJ) in the page: auto (all that are found, at most 60 000 triangles in total) or never
    #[arg(long, default_value = "auto", value_name = "WHEN", value_enum)]
    meshes: Show,
    /// Also write the trajectory to this file, which must end in .csv, .npz or .json
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write a summary as JSON instead of text
    #[arg(long)]
    json: bool,
}

/// Whether the page shows meshes.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub(crate) enum Show {
    Auto,
    Never,
}

/// Numbers of one command-line argument, separated by commas.
#[derive(Clone)]
pub(crate) struct Numbers(pub Vec<f64>);

pub(crate) fn numbers(text: &str) -> Result<Numbers, String> {
    let number = |x: &str| match x.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{}` is not a finite number", x.trim())),
    };
    text.split(',').map(number).collect::<Result<_, _>>().map(Numbers)
}

/// Default target of the default robot's last frame (m).
const DEFAULT_TARGET: [f64; 3] = [0.45, -0.25, 0.35];
const DEFAULT_ROBOT: &str = "arm7";
const DEFAULT_FRAME: &str = "tool";
const DEFAULT_DT: f64 = 0.01;
/// Tolerance of the solver for gaits. The cost of a gait is several hundred, so the tolerance is less than a millionth
/// of the cost.
const GAIT_TOLERANCE: f64 = 1e-4;

/// Runs `condyle plan`.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    if let Some(name) = &arguments.example {
        let names = || task::EXAMPLES.iter().map(|example| example.0);
        let Some((_, text)) = task::EXAMPLES.iter().find(|example| example.0 == name) else {
            let what = format!("no example is called `{name}`{}", crate::error::nearest(name, names()));
            return Err(Error::Option { option: "example", what });
        };
        say(text);
        return Ok(());
    }
    for (name, value) in [("budget-ms", arguments.budget_ms), ("tolerance", arguments.tolerance)] {
        positive(name, value)?;
    }
    arguments.dt.map_or(Ok(()), |dt| positive("dt", dt))?;
    let record = arguments.record.as_deref().map(|path| Ok::<_, Error>((path, record::format(path)?))).transpose()?;
    for (option, path) in [("out", Some(&*arguments.out)), ("record", arguments.record.as_deref())] {
        if let Some(path) = path.filter(|path| path.is_dir()) {
            return Err(Error::Option { option, what: format!("`{}` is a folder", path.display()) });
        }
    }
    watch::catch_interrupts();
    let task = arguments.task.as_deref().map(task::read).transpose()?;
    let plan = match &task {
        Some(task) if task.reach.is_none() => gait(arguments, task)?,
        _ => point(arguments, task.as_ref())?,
    };
    finish(arguments, &plan, record)
}

/// Writes the page, the record and the report. Returns an error if the result does not meet the request.
fn finish(arguments: &Arguments, plan: &Plan, record: Option<(&Path, record::Format)>) -> Result<(), Error> {
    let budget = report::measure(plan);
    let (violations, met) = (report::violations(plan), met::met(plan));
    let unwritten = |path: &Path| {
        let file = path.display().to_string();
        move |source| Error::Write { file, source }
    };
    let note = page::write(&arguments.out, plan, &budget, &violations, &met).map_err(unwritten(&arguments.out))?;
    if let Some((path, format)) = record {
        record::write(path, format, plan).map_err(unwritten(path))?;
    }
    if let Some(note) = note {
        eprintln!("note: {note}");
    }
    if arguments.json {
        crate::terminal::say_json(&report::summary(plan, &budget, &violations, &met));
    } else {
        say(&report::text(plan, &budget, &violations, &met));
        let files: Vec<String> = std::iter::once(&*arguments.out)
            .chain(record.map(|r| r.0))
            .map(|path| path.display().to_string())
            .collect();
        say(&format!("\nwrote {}\n", files.join(" and ")));
    }
    if watch::interrupted() {
        return Err(Error::Interrupted);
    }
    if let Some(Goal { frame, miss, tolerance, nearest, .. }) = &plan.goal
        && (miss > tolerance || miss.is_nan())
    {
        let hint = match plan.solution.status {
            _ if nearest > tolerance && LimitCounts::new(&plan.robot).positions == 0 => {
                "no posture was found that reaches it"
            }
            _ if nearest > tolerance => "no posture within the joints' limits was found that reaches it",
            Status::Converged => "it may be too far away for the available time; more --knots may help",
            _ => "the solver did not converge; more --knots, more --max-iterations or another --q0 may help",
        };
        let frame = &plan.model.frames()[*frame].name;
        let what = format!("`{frame}` ends {miss:.4} m from the target, more than --tolerance {tolerance} m: {hint}");
        return Err(Error::NegativeAnswer(what));
    }
    match violations.first() {
        Some(v) => Err(Error::NegativeAnswer(format!(
            "the {} of `{}` is {:.2e} beyond its limit {} at knot {}: more knots, or more time, may help",
            v.what, v.joint, v.amount, v.limit, v.at_knot
        ))),
        None if plan.goal.is_none() && !plan.is_solved() => {
            let worst = report::worst(plan).map_or_else(String::new, |worst| format!("; {worst}"));
            Err(Error::NegativeAnswer(format!("the solver stopped: {}{worst}", report::status(plan))))
        }
        None => match report::worst(plan).filter(Worst::is_gap) {
            Some(gap) => Err(Error::NegativeAnswer(gap.to_string())),
            None => Ok(()),
        },
    }
}

/// Plans a motion of a frame to a target point.
fn point(arguments: &Arguments, task: Option<&Task>) -> Result<Plan, Error> {
    let option = |option, what: String| Error::Option { option, what };
    let own = task.is_none() && arguments.robot.is_none();
    let name = task.map(|task| &*task.robot).or(arguments.robot.as_deref()).unwrap_or(DEFAULT_ROBOT);
    let options = options(arguments, task);
    let robot = robot::load(name, &options)?;
    let model = Arc::new(robot.model.clone());
    if model.nv() == 0 {
        return Err(Error::Rigid);
    }
    let reach = task.and_then(|task| task.reach.as_ref());
    let frame = match (reach.and_then(|reach| reach.frame.as_ref()), &arguments.frame) {
        (Some(frame), _) => {
            let name = frame.get_ref();
            model
                .frame(name)
                .map_err(|error| task.map_or(error.clone().into(), |t| t.place.wrong(name, error.to_string())))?
        }
        (None, Some(name)) => model.frame(name)?,
        (None, None) if own => model.frame(DEFAULT_FRAME)?,
        (None, None) => last_frame(&model),
    };
    let target: Vec3<f64> = match (reach, &arguments.target) {
        (Some(reach), _) => reach.target.into(),
        (None, Some(Numbers(x))) if x.len() == 3 => Vec3::new(x[0], x[1], x[2]),
        (None, Some(Numbers(x))) => return Err(option("target", format!("expected 3 numbers, found {}", x.len()))),
        (None, None) if own => DEFAULT_TARGET.into(),
        (None, None) => {
            return Err(option("target", "missing; only the default robot has a default target".to_owned()));
        }
    };
    let q0 = match (&arguments.q0, task) {
        (Some(Numbers(q)), _) if q.len() == model.nq() => {
            check_start(&model, q)?;
            q.clone()
        }
        (Some(Numbers(q)), _) => {
            return Err(option("q0", format!("expected {} numbers, found {}", model.nq(), q.len())));
        }
        (None, Some(task)) => crate::gait::posture(&model, task.start.as_ref().unwrap_or(&task.posture), task)?,
        (None, None) => start(&model),
    };
    let knots = reach.and_then(|reach| reach.knots.as_ref()).map_or(arguments.knots, |n| *n.get_ref()) as usize;
    let tolerance = reach.and_then(|reach| reach.tolerance.as_ref()).map_or(arguments.tolerance, |x| *x.get_ref());
    let dt = arguments.dt.or(task.and_then(|task| task.dt)).unwrap_or(DEFAULT_DT);
    let end = &model.frames()[frame].name;
    introduce(
        arguments,
        &model,
        &format!("`{end}` goes to ({}, {}, {}) m in {knots} knots of {} ms", target.x, target.y, target.z, 1e3 * dt),
    );
    let (q_end, nearest) = posture::reaching(&model, frame, target, &q0);
    let mut watch = Watch::new(arguments.max_iterations);
    let (mut problem, xs, us) = reach::problem(&model, frame, target, (&q0, &q_end), (knots, dt), false)?;
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = arguments.max_iterations;
    heading(arguments);
    let solution = solver.solve_with(&mut problem, &xs, &us, watch.quiet(arguments.json))?.clone();
    let mut plan = Plan {
        title: format!("{} reaches for a point", model.name()),
        goal: Some(Goal { frame, target, miss: f64::INFINITY, tolerance, nearest }),
        feet: vec![],
        soles: false,
        touches: vec![],
        times: (0..=knots).map(|t| t as f64 * dt).collect(),
        dt,
        budget_ms: arguments.budget_ms,
        robot,
        meshes: arguments.meshes == Show::Auto,
        model,
        solution,
        held: None,
        settled: None,
        trace: vec![],
    };
    if must_hold(arguments, &plan) {
        let (problem, ..) = reach::problem(&plan.model, frame, target, (&q0, &q_end), (knots, dt), true)?;
        hold(arguments, &mut plan, problem, &mut watch)?;
    }
    plan.trace = watch.end();
    let mut data = Data::new(&plan.model);
    let q = &plan.solution.x(knots)[..plan.model.nq()];
    let end = forward_kinematics(&plan.model, &mut data, q).frame(frame).translation;
    if let Some(goal) = &mut plan.goal {
        goal.miss = (end - target).norm_squared().sqrt();
    }
    Ok(plan)
}

/// Plans the gait of a task.
fn gait(arguments: &Arguments, task: &Task) -> Result<Plan, Error> {
    let robot = robot::load(&task.robot, &options(arguments, Some(task)))?;
    let model = Arc::new(robot.model.clone());
    let dt = arguments.dt.or(task.dt).unwrap_or(DEFAULT_DT);
    let posed = |held: bool| -> Result<_, Error> {
        let mut gait = Gait::new(model.clone(), task, dt, held)?;
        for (k, phase) in task.phases.iter().enumerate() {
            gait.add(phase, task.phases.get(k + 1))?;
        }
        gait.pose()
    };
    let mut free = posed(false)?;
    let what = format!(
        "{} phases on {} feet, {} knots of {} ms",
        task.phases.len(),
        free.feet.len(),
        free.times.len() - 1,
        1e3 * dt
    );
    introduce(arguments, &model, &what);
    let mut watch = Watch::new(arguments.max_iterations);
    let mut solver = Fddp::new(&free.problem);
    solver.settings.max_iterations = arguments.max_iterations;
    solver.settings.tolerance = GAIT_TOLERANCE;
    heading(arguments);
    let solution = solver.solve_with(&mut free.problem, &free.xs, &free.us, watch.quiet(arguments.json))?.clone();
    let stem = arguments.task.as_deref().and_then(Path::file_stem).and_then(|name| name.to_str()).unwrap_or("gait");
    let mut plan = Plan {
        title: format!("{}: {stem}", model.name()),
        goal: None,
        feet: free.feet,
        soles: task.sole.is_some(),
        touches: free.touches,
        times: free.times,
        dt,
        budget_ms: arguments.budget_ms,
        robot,
        meshes: arguments.meshes == Show::Auto,
        model: model.clone(),
        solution,
        held: None,
        settled: None,
        trace: vec![],
    };
    if must_hold(arguments, &plan) {
        hold(arguments, &mut plan, posed(true)?.problem, &mut watch)?;
    }
    plan.trace = watch.end();
    Ok(plan)
}

/// Returns whether the solution exceeds limits. If it does, the problem must be solved again with the limits as
/// constraints.
fn must_hold(arguments: &Arguments, plan: &Plan) -> bool {
    let violations = report::violations(plan);
    if violations.is_empty() || watch::interrupted() {
        return false;
    }
    if !arguments.json {
        let limits = LimitCounts::new(&plan.robot);
        let are = if violations.len() == 1 { "is" } else { "are" };
        let exceeded = format!("{} of these {} {are} exceeded", violations.len(), limits.total());
        say(&format!("{limits}; {exceeded}: solving again, with the limits as constraints\n"));
    }
    true
}

/// Solves a problem with limits as constraints, starting from the solution of a plan that exceeds the limits. Replaces
/// the solution.
fn hold(arguments: &Arguments, plan: &mut Plan, mut problem: Problem, watch: &mut Watch) -> Result<(), Error> {
    let mut solver = InteriorPoint::new(&problem);
    solver.settings.max_iterations = arguments.max_iterations;
    let (xs, us) = (&plan.solution.xs, &plan.solution.us);
    let first = watch.trace.len();
    plan.solution = solver.solve_with(&mut problem, xs, us, watch.settling(arguments.json))?.clone();
    let outcome = solver.outcome().clone();
    let stopped = plan.solution.status == Status::Interrupted && !watch::interrupted();
    plan.settled = watch::settled(&watch.trace[first..]).filter(|_| stopped && outcome.primal <= HELD);
    if stopped {
        plan.solution.status = Status::RegularisationLimit; // as where the interior point finds no further decrease
    }
    plan.held = Some(Held::new(outcome, plan.model.nv()));
    Ok(())
}

/// Prints the name of the robot and the task.
fn introduce(arguments: &Arguments, model: &Model, task: &str) {
    if !arguments.json {
        say(&format!("{model}{task}\n\n"));
    }
}

fn heading(arguments: &Arguments) {
    if !arguments.json {
        say(report::ITERATION_HEADER);
    }
}

/// Returns the options for reading the robot's file. An option on the command line takes precedence over the same
/// option in the task file.
fn options(arguments: &Arguments, task: Option<&Task>) -> ReadingOptions {
    let flags = &arguments.options;
    ReadingOptions {
        root: flags.root.or(task.and_then(|task| task.root)),
        mimic: flags.mimic || task.is_some_and(|task| task.mimic),
        ..flags.clone()
    }
}
