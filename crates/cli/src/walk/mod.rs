//! `condyle walk`: lets a robot walk in a simulation under model predictive control.

mod feet;
mod page;
mod record;
mod report;
mod solids;
mod stand;
mod walked;

use crate::error::{Error, positive};
use crate::report::exceeded;
use crate::robot::{self, Format, Robot, RobotArguments, Root};
use crate::terminal::{say, say_json};
use crate::watch;
use condyle::mpc::{Command, Gait, Pattern, Settings};
use condyle::{Data, Joint, Model};
use feet::{FoundFoot, Given};
use record::{Push, Request, STEP};
use std::path::PathBuf;
use std::sync::Arc;
use walked::Walked;

/// Armature of joints that move no inertia (kg m², kg).
const ARMATURE: f64 = 1e-3;
/// Inertia below which a joint gets the armature too, because its efforts would move it without bounds (kg m², kg). The
/// lightest joints of real robots move 1e-5. The neck of an iCub moves 1e-16, because its links have no mass.
const LIGHT: f64 = 1e-6;
/// Largest accelerations of the command for a robot with two feet, and with more feet (m/s², m/s², rad/s²).
const ACCELERATIONS: [[f64; 3]; 2] = [[0.3, 0.3, 1.0], [1.0, 1.0, 2.0]];
/// Excess over a limit that is not reported (rad, rad/s, N m). The controller's limits of positions and speeds give
/// way.
const EXCESS: f64 = 1e-3;
/// Duration of a swing for a trunk at a height of 1 m (s). The factor gives 0.23 s for a Go2, and 0.42 s for a TALOS.
const SWING: f64 = 0.42;
/// The same for two feet that are balls. Only steps balance such a robot, so its steps are shorter.
const SWING_ON_BALLS: f64 = 0.31;
/// Time between two swings relative to a swing: of four feet or more, of two soles, and of two balls, on which the
/// robot tips over.
const SHARES: [f64; 3] = [0.17, 0.25, 0.1];
/// Weight of the velocity to the left for a robot with two feet, which sways from foot to foot.
const SWAY: f64 = 30.0;

/// Let a robot walk in a simulation under model predictive control, and write the walk as an HTML page
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle walk quadruped --command 0.5,0,0
  condyle walk go2.urdf --command 0.5,0,0.3 --gait pace --push 12,90,5
  condyle walk g1.urdf --command 0.2,0,0 --sole 0.17,0.055 --feet left_ankle_roll_link,right_ankle_roll_link
  condyle walk scene.xml --posture home --rate 200 --json

A URDF or SDF gets a free-flyer at its root. The controller renews its plan at a fixed rate, and a policy follows the
plan at 1 kHz on level ground. The report says which feet and which posture were chosen, and why. The exit status is 1
if the robot falls. Ctrl-C ends the walk early; the page then contains the walk so far.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    robot: RobotArguments,
    /// Velocity of the trunk along its heading: forwards, to the left (m/s), turning to the left (rad/s)
    #[arg(long, value_name = "VX,VY,WZ", default_value = "0.3,0,0", value_parser = three, allow_hyphen_values = true)]
    command: [f64; 3],
    /// Duration of the walk (s)
    #[arg(long, default_value_t = 20.0, value_name = "SECONDS", allow_negative_numbers = true)]
    seconds: f64,
    /// Gait. Default: trot with four feet, otherwise step: one foot after the other
    #[arg(long, value_name = "GAIT", value_enum)]
    gait: Option<GaitName>,
    /// Duration of a swing (s). Default: from the height of the trunk
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    swing: Option<f64>,
    /// Time between two swings, in which all feet are on the ground (s). Default: a part of the swing's duration
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    double: Option<f64>,
    /// Frames of the feet. Default: the ends of those limbs that are lowest in the posture
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    feet: Vec<String>,
    /// Radius of all feet, which are balls around their frames (m). Default: from the collision shapes
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    radius: Option<f64>,
    /// Side lengths of all feet, which are soles (m). Default: from the collision shapes
    #[arg(long, value_name = "X,Y", value_parser = two, conflicts_with = "radius")]
    sole: Option<[f64; 2]>,
    /// Coefficient of friction that the controller assumes
    #[arg(long, default_value_t = 0.5, value_name = "MU", allow_negative_numbers = true)]
    friction: f64,
    /// Coefficient of friction of the ground
    #[arg(long, default_value_t = 0.7, value_name = "MU", allow_negative_numbers = true)]
    ground_friction: f64,
    /// Posture of the stand: a keyframe, or joint=angle,… (rad); other joints are neutral. Default: the keyframe
    /// `home`, `stand` or `standing`, or else bent legs
    #[arg(long, value_name = "POSTURE", allow_hyphen_values = true)]
    posture: Option<String>,
    /// Number of plans per second (Hz); the time budget of a plan is the inverse
    #[arg(long, default_value_t = 100.0, value_name = "HZ", allow_negative_numbers = true)]
    rate: f64,
    /// Duration of the horizon (s). Default: 0.5, or two steps of a robot with two feet
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    horizon: Option<f64>,
    /// Push of the trunk for 0.1 s: impulse (N s), direction in the world (degrees; 0 is along x), and time (s)
    #[arg(long, value_name = "IMPULSE,ANGLE,TIME", value_parser = three, allow_hyphen_values = true)]
    push: Option<[f64; 3]>,
    /// File for the HTML page
    #[arg(long, default_value = "out/walk.html", value_name = "FILE")]
    out: PathBuf,
    /// Leave meshes out of the page
    #[arg(long)]
    no_meshes: bool,
    /// Write a summary as JSON instead of text
    #[arg(long)]
    json: bool,
}

/// Name of a gait.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum GaitName {
    /// Diagonal pairs of four feet
    Trot,
    /// Single feet of four, in turn
    Walk,
    /// Pairs of four feet on one side
    Pace,
    /// Front and rear pairs of four feet
    Bound,
    /// Single feet from left to right
    Step,
    /// All feet stay on the ground
    Stand,
}

impl GaitName {
    fn name(self) -> &'static str {
        match self {
            Self::Trot => "trot",
            Self::Walk => "walk",
            Self::Pace => "pace",
            Self::Bound => "bound",
            Self::Step => "step",
            Self::Stand => "stand",
        }
    }

    /// Returns the groups of feet that swing together; `None` for the stand.
    fn pattern(self) -> Option<Pattern> {
        match self {
            Self::Trot => Some(Pattern::Trot),
            Self::Walk => Some(Pattern::Walk),
            Self::Pace => Some(Pattern::Pace),
            Self::Bound => Some(Pattern::Bound),
            Self::Step => Some(Pattern::Step),
            Self::Stand => None,
        }
    }
}

/// Parses N finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let number = |x: &str| match x.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{}` is not a finite number", x.trim())),
    };
    let found = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
    let count = found.len();
    found.try_into().map_err(|_| format!("expected {N} numbers, found {count}"))
}

fn three(text: &str) -> Result<[f64; 3], String> {
    numbers(text)
}

fn two(text: &str) -> Result<[f64; 2], String> {
    numbers(text)
}

/// Runs `condyle walk`.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    check(arguments)?;
    watch::catch_interrupts();
    let walked = walk(arguments)?;
    let mut violations = exceeded(&walked.model, |quantity| report::values(&walked, quantity));
    violations.retain(|violation| violation.amount > EXCESS);
    let file = || arguments.out.display().to_string();
    let note =
        page::write(&arguments.out, &walked, &violations).map_err(|source| Error::Write { file: file(), source })?;
    if let Some(note) = note {
        eprintln!("note: {note}");
    }
    if arguments.json {
        say_json(&report::summary(&walked, &violations));
    } else {
        say(&report::text(&walked, &violations));
        say(&format!("\nwrote {}\n", file()));
    }
    if watch::interrupted() {
        return Err(Error::Interrupted);
    }
    match &walked.walk.fall {
        Some((time, what)) => Err(Error::NegativeAnswer(format!("the robot fell after {time:.2} s: {what}"))),
        None => Ok(()),
    }
}

/// Checks the numbers of the options.
fn check(arguments: &Arguments) -> Result<(), Error> {
    let numbers = [
        ("seconds", Some(arguments.seconds)),
        ("swing", arguments.swing),
        ("friction", Some(arguments.friction)),
        ("rate", Some(arguments.rate)),
        ("horizon", arguments.horizon),
    ];
    for (name, number) in numbers {
        number.map_or(Ok(()), |number| positive(name, number))?;
    }
    let wrong = |option, what: String| Err(Error::Option { option, what });
    for (name, number) in [("double", arguments.double), ("radius", arguments.radius)] {
        if let Some(number) = number.filter(|x| !(*x >= 0.0 && x.is_finite())) {
            return wrong(name, format!("must be at least 0, not {number}"));
        }
    }
    if arguments.rate > 1.0 / STEP {
        return wrong("rate", format!("must be at most {:.0} Hz, the rate of the policy", 1.0 / STEP));
    }
    if arguments.out.is_dir() {
        return wrong("out", format!("`{}` is a folder", arguments.out.display()));
    }
    Ok(())
}

/// Loads the robot. A URDF or SDF gets a free-flyer, unless the user gives another root joint.
fn load(arguments: &Arguments) -> Result<Robot, Error> {
    let RobotArguments { robot: name, options } = &arguments.robot;
    let robot = robot::load(name, options)?;
    let floats = |model: &Model| model.bodies().get(1).is_some_and(|body| body.joint == Joint::FreeFlyer);
    if floats(&robot.model) {
        return Ok(robot);
    }
    let what = match (robot.format, options.root) {
        (Format::Mjcf, _) => "needs a <freejoint/> in the trunk",
        (_, Some(_)) => "needs a free-flyer at its root: --root free",
        (_, None) => {
            let mut options = options.clone();
            options.root = Some(Root::Free);
            return robot::load(name, &options);
        }
    };
    Err(Error::File { file: robot.source, what: format!("a robot that walks {what}") })
}

/// Chooses feet, posture and gait, and simulates the walk.
fn walk(arguments: &Arguments) -> Result<Walked, Error> {
    let robot = load(arguments)?;
    let (model, regular) = regular(robot.model.clone())?;
    let solids = solids::read(&model, &robot);
    let mut stand = stand::begin(&model, arguments.posture.as_deref())?;
    let given = match (arguments.radius, arguments.sole) {
        (Some(radius), _) => Given::Radius(radius),
        (_, Some(sole)) => Given::Sole(sole),
        _ => Given::Nothing,
    };
    let (friction, names) = (arguments.friction, &arguments.feet);
    let (model, feet) = match names.is_empty() {
        true => feet::find(&model, &solids, &stand.q, given, friction)?,
        false => feet::named(&model, &solids, &stand.q, names, given, friction)?,
    };
    let feet_source = if names.is_empty() { "the lowest ends of limbs" } else { "given by --feet" }.to_owned();
    stand::bend(&model, &mut stand, &feet)?;
    stand::put_down(&model, &mut stand.q, &feet);
    let (gait, gait_text) = gait(arguments, &feet, stand.q[2]);
    let settings = settings(arguments, &gait, feet.len());
    let [vx, vy, wz] = arguments.command;
    let (model, command) = (Arc::new(model), Command { vx, vy, wz });
    let push = arguments.push.map(|[impulse, angle, at]| Push { impulse, angle, at });
    let request = Request {
        model: &model,
        feet: &feet,
        q: &stand.q,
        gait,
        settings: settings.clone(),
        command,
        seconds: arguments.seconds,
        rate: arguments.rate,
        ground_friction: arguments.ground_friction,
        push,
    };
    let walk = record::simulate(&request)?;
    let posture = (stand.source, stand::text(&model, &stand.q));
    Ok(Walked {
        robot,
        meshes: !arguments.no_meshes,
        feet,
        feet_source,
        posture,
        gait_text,
        settings,
        command,
        seconds: arguments.seconds,
        rate: arguments.rate,
        regular,
        walk,
        model,
    })
}

/// Adds an armature to joints that move no inertia, or nearly none. Returns their names.
fn regular(model: Model) -> Result<(Model, Vec<String>), Error> {
    let (model, mut names) = robot::regular(model, ARMATURE)?;
    let mut data = Data::new(&model);
    let inverse = condyle::minv(&model, &mut data, &condyle::neutral(&model));
    let mut armature = model.armature().to_vec();
    for body in &model.bodies()[2..] {
        // 1/(M⁻¹)ᵢᵢ is the inertia that the effort of coordinate i moves
        for k in body.idx_v..body.idx_v + body.joint.nv() {
            let inertia = 1.0 / inverse[(k, k)];
            if inertia < LIGHT || inertia.is_nan() {
                armature[k] += ARMATURE;
                names.push(body.joint_name.clone());
            }
        }
    }
    names.dedup();
    Ok((model.with_armature(&armature)?, names))
}

/// Returns the gait and its description. `height` is the height of the trunk in the stand (m).
fn gait(arguments: &Arguments, feet: &[FoundFoot], height: f64) -> (Gait, String) {
    let name = arguments.gait.unwrap_or(if feet.len() == 4 { GaitName::Trot } else { GaitName::Step });
    let Some(pattern) = name.pattern() else { return (Gait::Stand, "stand".to_owned()) };
    let (factor, share) = match (feet.len(), feet.iter().any(|foot| foot.sole().is_none())) {
        (2, true) => (SWING_ON_BALLS, SHARES[2]),
        (2, false) => (SWING, SHARES[1]),
        _ => (SWING, SHARES[0]),
    };
    // A leg swings as a pendulum does: the duration of a swing grows with the root of the height.
    let swing = arguments.swing.unwrap_or((factor * height.max(0.05).sqrt() * 100.0).round() / 100.0);
    let double = arguments.double.unwrap_or((share * swing * 100.0).round() / 100.0);
    let text = format!("{}, {swing} s in the air, {double} s between swings", name.name());
    (Gait::in_turn(pattern, swing, double), text)
}

/// Returns the settings of the controller. A robot with two feet needs a horizon of two steps.
fn settings(arguments: &Arguments, gait: &Gait, feet: usize) -> Settings {
    let default = Settings::default();
    let mut weights = default.weights;
    let mut horizon = default.horizon;
    if feet == 2 {
        weights.sideways = SWAY;
        if let Gait::InTurn { swing, double, .. } = gait {
            horizon = (2.0 * (swing + double) / default.knot).ceil() * default.knot;
        }
    }
    let accelerations = ACCELERATIONS[usize::from(feet > 2)];
    Settings { horizon: arguments.horizon.unwrap_or(horizon), weights, accelerations, ..default }
}
