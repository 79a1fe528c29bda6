//! `condyle ik`: finds a posture in which a frame of a robot reaches a target.

mod page;

use crate::error::{Error, positive};
use crate::limits::{check_start, last_frame, start};
use crate::plan::{Numbers, Show, numbers};
use crate::robot::{self, ReadingOptions, Robot};
use crate::terminal::{Table, heading, say, say_json, short};
use condyle::distances::GeometryPair;
use condyle::ik::{GlobalIk, Outcome, Posture, Rank, SearchSettings};
use condyle::spatial::{Mat3, lie};
use condyle::{Data, Model, Se3, Vec3, forward_kinematics};
use serde_json::json;
use std::path::PathBuf;

/// Find a posture in which a frame reaches a target, and write it as an HTML page
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle ik arm7 --frame tool --target 0.45,-0.25,0.35
  condyle ik panda.urdf --frame panda_hand_tcp --target 0.45,-0.2,0.4,3.1416,0,0 --nearest
  condyle ik panda.urdf --target 0.45,-0.2,0.4 --clearance 0.02 --json

Roll, pitch and yaw turn about the fixed axes x, y and z, as in a URDF. Without them, only the position counts. Limits of
positions always hold. With --clearance, the shapes in the robot's file are kept apart; meshes do not count. The exit
status is 1 if no posture was found that reaches the target; the answer is then the nearest posture, and one line tells
what holds it back.")]
pub(crate) struct Arguments {
    /// Robot: a URDF, MJCF or SDF file, or a built-in robot: arm7, quadruped, humanoid
    #[arg(value_name = "ROBOT")]
    robot: String,
    #[command(flatten)]
    options: ReadingOptions,
    /// Frame that moves to the target. Default: the last frame of the outermost body
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Target in the world frame: position (m), and optionally roll, pitch and yaw (rad)
    #[arg(long, value_name = "X,Y,Z[,R,P,Y]", value_parser = numbers, allow_hyphen_values = true, required = true)]
    target: Numbers,
    /// First posture of the search, nq numbers (rad, m), and start of the motion on the page. Default: neutral, but
    /// mid-range for coordinates whose limits exclude neutral
    #[arg(long, value_name = "Q,…", value_parser = numbers, allow_hyphen_values = true)]
    q0: Option<Numbers>,
    /// Choose the posture nearest to the first posture, among ten that reach the target
    #[arg(long)]
    nearest: bool,
    /// Distance to keep between shapes of the robot's file (m). Default: distances do not count
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    clearance: Option<f64>,
    /// Position error that counts as reached (m)
    #[arg(long, default_value_t = 1e-4, value_name = "METRES", allow_negative_numbers = true)]
    tolerance: f64,
    /// Maximum number of starts
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    starts: u32,
    /// File for the HTML page
    #[arg(long, default_value = "out/ik.html", value_name = "FILE")]
    out: PathBuf,
    /// Meshes (STL, DAE, OBJ) in the page: auto (all that are found, at most 60 000 triangles in total) or never
    #[arg(long, default_value = "auto", value_name = "WHEN", value_enum)]
    meshes: Show,
    /// Write the answer as JSON instead of text
    #[arg(long)]
    json: bool,
}

/// Rotation error that counts as reached (rad).
const ROTATION: f64 = 1e-3;

/// Number of postures from which the nearest one is chosen.
const CHOICE: usize = 10;

/// Answer, and what was asked.
pub(super) struct Answer {
    pub robot: Robot,
    pub frame: usize,
    pub target: Se3<f64>,
    /// Whether the rotation counts.
    pub turned: bool,
    pub tolerance: [f64; 2],
    pub start: Vec<f64>,
    pub posture: Posture,
    /// Limits and pairs that hold the posture back, in words.
    pub held: Vec<String>,
    pub meshes: bool,
}

/// Runs `condyle ik`.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    let option = |option, what: String| Error::Option { option, what };
    positive("tolerance", arguments.tolerance)?;
    if arguments.out.is_dir() {
        return Err(option("out", format!("`{}` is a folder", arguments.out.display())));
    }
    let robot = robot::load(&arguments.robot, &arguments.options)?;
    let model = &robot.model;
    if model.nv() == 0 {
        return Err(Error::Rigid);
    }
    let frame = arguments.frame.as_ref().map_or_else(|| Ok(last_frame(model)), |name| model.frame(name))?;
    let (target, turned) = pose(&arguments.target.0)?;
    let start = match &arguments.q0 {
        Some(Numbers(q)) if q.len() == model.nq() => {
            check_start(model, q)?;
            q.clone()
        }
        Some(Numbers(q)) => return Err(option("q0", format!("expected {} numbers, found {}", model.nq(), q.len()))),
        None => start(model),
    };
    let pairs = arguments.clearance.map_or_else(|| Ok(Vec::new()), |_| pairs(&robot))?;
    let settings = SearchSettings {
        tolerance: [arguments.tolerance, ROTATION],
        orientation_weight: if turned { SearchSettings::default().orientation_weight } else { 0.0 },
        starts: arguments.starts as usize,
        solutions: if arguments.nearest { CHOICE } else { 1 },
        rank: if arguments.nearest { Rank::Nearest } else { Rank::First },
        pairs,
        minimum_distance: arguments.clearance.unwrap_or(0.0),
        ..SearchSettings::default()
    };
    let tolerance = settings.tolerance;
    let ik = GlobalIk::new(model, &[&model.frames()[frame].name], settings)?;
    let posture = ik.solve(&[target], &start)?;
    let held = match &posture.outcome {
        Outcome::Unreached { held } => held.iter().map(|&held| ik.describe(held)).collect(),
        _ => Vec::new(),
    };
    let meshes = arguments.meshes == Show::Auto;
    let answer = Answer { frame, target, turned, tolerance, start, posture, held, meshes, robot };
    let file = || arguments.out.display().to_string();
    let note = page::write(&arguments.out, &answer).map_err(|source| Error::Write { file: file(), source })?;
    if let Some(note) = note {
        eprintln!("note: {note}");
    }
    if arguments.json {
        say_json(&summary(&answer));
    } else {
        say(&text(&answer));
        say(&format!("\nwrote {}\n", file()));
    }
    match answer.posture.reached() {
        true => Ok(()),
        false => Err(Error::NegativeAnswer(missed(&answer))),
    }
}

/// Returns the pose of a target of three or six numbers, and whether its rotation counts.
fn pose(numbers: &[f64]) -> Result<(Se3<f64>, bool), Error> {
    let about = |axis: Vec3<f64>, angle: f64| lie::exp3(axis.scale(angle)).to_rotation();
    match *numbers {
        [x, y, z] => Ok((Se3::new(Mat3::identity(), Vec3::new(x, y, z)), false)),
        [x, y, z, roll, pitch, yaw] => {
            let [ex, ey, ez] = Mat3::identity().columns();
            let R = about(ez, yaw) * about(ey, pitch) * about(ex, roll); // R = Rz Ry Rx
            Ok((Se3::new(R, Vec3::new(x, y, z)), true))
        }
        _ => {
            let what = format!("expected 3 or 6 numbers, found {}", numbers.len());
            Err(Error::Option { option: "target", what })
        }
    }
}

/// Returns the pairs of shapes in the robot's file that can collide.
fn pairs(robot: &Robot) -> Result<Vec<GeometryPair>, Error> {
    let pairs = robot.collisions()?.pairs(&robot.model)?;
    if pairs.is_empty() {
        let what = format!("`{}` has no shapes that can collide; meshes do not count", robot.source);
        return Err(Error::Option { option: "clearance", what });
    }
    Ok(pairs)
}

/// Returns the sentence about a missed target.
fn missed(answer: &Answer) -> String {
    let [linear, angular] = answer.posture.error;
    let turned = if answer.turned { format!(" and {} rad", short(angular)) } else { String::new() };
    let why = match answer.held.is_empty() {
        true => "no posture within the limits was found that reaches it".to_owned(),
        false => format!("held back by {}", answer.held.join(", ")),
    };
    let frame = &answer.robot.model.frames()[answer.frame].name;
    format!("`{frame}` ends {} m{turned} from the target: {why}", short(linear))
}

/// Returns the answer as text.
fn text(answer: &Answer) -> String {
    let model = &answer.robot.model;
    let [x, y, z] = answer.target.translation.to_array();
    let frame = &model.frames()[answer.frame].name;
    let mut text = heading(&format!("{}: `{frame}` at ({x}, {y}, {z}) m", model.name()));
    let [linear, angular] = answer.posture.error;
    let turned = if answer.turned { format!(", {} rad", short(angular)) } else { String::new() };
    let starts = if answer.posture.starts == 1 { "start" } else { "starts" };
    let outcome = if answer.posture.reached() { "reached" } else { "not reached" };
    text += &format!("{outcome}: {} m{turned} off, after {} {starts}\n\n", short(linear), answer.posture.starts);
    let mut table = Table::new(&["joint", "position", "lower", "upper"]);
    for body in model.bodies().iter().skip(1).filter(|body| body.mimic.is_none()) {
        for k in body.idx_q..body.idx_q + body.joint.nq() {
            let limits = [model.limits().lower[k], model.limits().upper[k]];
            let limit = |x: f64| if x.is_finite() { short(x) } else { "–".to_owned() };
            let [lower, upper] = limits.map(limit);
            table.row(vec![body.joint_name.clone(), short(answer.posture.q[k]), lower, upper]);
        }
    }
    text + &table.text()
}

/// Returns the answer for JSON.
fn summary(answer: &Answer) -> serde_json::Value {
    let model = &answer.robot.model;
    let tip = reached_pose(model, answer);
    json!({
        "robot": model.name(),
        "frame": model.frames()[answer.frame].name,
        "reached": answer.posture.reached(),
        "q": answer.posture.q,
        "position": tip.translation.to_array(),
        "position_error": answer.posture.error[0],
        "rotation_error": answer.turned.then_some(answer.posture.error[1]),
        "starts": answer.posture.starts,
        "held": answer.held,
    })
}

/// Returns the pose of the frame at the answer.
fn reached_pose(model: &Model, answer: &Answer) -> Se3<f64> {
    forward_kinematics(model, &mut Data::new(model), &answer.posture.q).frame(answer.frame)
}
