//! Reads and checks task files in TOML. Every error message contains a line number.

use crate::error::{Error, nearest};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use toml::Spanned;

/// Built-in example tasks: name and text.
pub(crate) const EXAMPLES: [(&str, &str); 5] = [
    ("reach", include_str!("../tasks/reach.toml")),
    ("trot", include_str!("../tasks/trot.toml")),
    ("walk", include_str!("../tasks/walk.toml")),
    ("jump", include_str!("../tasks/jump.toml")),
    ("stand-up", include_str!("../tasks/stand-up.toml")),
];

/// Content of a task file, before its checks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    robot: Spanned<String>,
    root: Option<Spanned<String>>,
    #[serde(default)]
    mimic: bool,
    dt: Option<Spanned<f64>>,
    friction: Option<Spanned<f64>>,
    #[serde(default)]
    posture: BTreeMap<String, Spanned<f64>>,
    start: Option<BTreeMap<String, Spanned<f64>>>,
    reach: Option<Spanned<Reach>>,
    feet: Option<Spanned<Feet>>,
    #[serde(default)]
    phase: Vec<Spanned<PhaseFile>>,
}

/// Target point of a frame.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reach {
    pub frame: Option<Spanned<String>>,
    pub target: [f64; 3],
    pub knots: Option<Spanned<u32>>,
    pub tolerance: Option<Spanned<f64>>,
}

/// Feet, given by the frames that touch the ground.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Feet {
    #[serde(default)]
    pub points: Vec<Spanned<String>>,
    #[serde(default)]
    pub soles: Vec<Spanned<String>>,
    /// Side lengths of a sole along its x and y axes (m).
    pub size: Option<Spanned<[f64; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PhaseFile {
    kind: Spanned<String>,
    knots: Spanned<u32>,
    feet: Option<Vec<Spanned<String>>>,
    length: Option<f64>,
    side: Option<f64>,
    height: Option<f64>,
}

/// One phase of a gait.
#[derive(Clone)]
pub(crate) struct Phase {
    pub kind: PhaseKind,
    pub knots: usize,
    /// Distance (m) that the feet move ahead. (The next fields are the distance to the left and the height of the
    /// lift.)
    pub length: f64,
    pub side: f64,
    pub height: f64,
}

#[derive(Clone, PartialEq)]
pub(crate) enum PhaseKind {
    /// Phase with all feet on the ground.
    Stand,
    /// Phase in which the feet with these indices are in the air.
    Step(Vec<usize>),
    /// Phase with all feet in the air.
    Jump,
}

/// Valid task. The names of frames and joints are not yet checked, because the robot is not yet loaded.
pub(crate) struct Task {
    pub robot: String,
    pub root: Option<crate::robot::Root>,
    pub mimic: bool,
    pub dt: Option<f64>,
    pub friction: f64,
    pub posture: BTreeMap<String, f64>,
    pub start: Option<BTreeMap<String, f64>>,
    pub reach: Option<Reach>,
    pub feet: Vec<String>,
    /// Side lengths of the soles; `None` for point feet.
    pub sole: Option<[f64; 2]>,
    pub phases: Vec<Phase>,
    pub place: Place,
}

/// Line numbers of names in the task file. Errors that are found after reading the file use these line numbers.
pub(crate) struct Place {
    file: String,
    lines: BTreeMap<String, usize>,
}

impl Place {
    /// Returns an error for the line in which a name occurs.
    pub(crate) fn wrong(&self, name: &str, what: String) -> Error {
        Error::Task { file: self.file.clone(), line: self.lines.get(name).copied().unwrap_or(1), what }
    }
}

/// Maximum number of knots of a phase of a gait.
const MOST_KNOTS: u32 = 100_000;
/// Maximum size of a task file in bytes.
const LARGEST: u64 = 1 << 20;

/// Reads a task from a file.
pub(crate) fn read(path: &Path) -> Result<Task, Error> {
    let file = path.display().to_string();
    let wrong = |what: String| Error::File { file: file.clone(), what };
    let about = std::fs::metadata(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => crate::robot::no_such_file(&file, &["toml"]),
        _ => wrong(error.to_string()),
    })?;
    if !about.is_file() || about.len() > LARGEST {
        return Err(wrong(format!("is not a regular file of at most {LARGEST} bytes")));
    }
    let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    let mut task = parse(&text, &file)?;
    // The path of the robot's file is relative to the folder of the task file.
    let beside = path.parent().unwrap_or(Path::new("")).join(&task.robot);
    if !crate::robot::EMBEDDED.contains(&&*task.robot) && !task.robot.contains("://") {
        task.robot = beside.display().to_string();
    }
    Ok(task)
}

/// Parses the text of a task file.
pub(crate) fn parse(text: &str, file: &str) -> Result<Task, Error> {
    let line = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let wrong = |at: usize, what: String| Error::Task { file: file.to_owned(), line: line(at), what };
    let parsed: File = toml::from_str(text).map_err(|error| {
        let message = error.message().replace('\n', "; ");
        wrong(error.span().map_or(0, |span| span.start), message + &nearest_key(error.message()))
    })?;
    let mut lines = BTreeMap::new();
    let mut note = |name: &str, at: usize| {
        lines.entry(name.to_owned()).or_insert_with(|| line(at));
    };
    note("robot", parsed.robot.span().start);
    let positive = |name: &str, value: &Spanned<f64>| match *value.get_ref() {
        x if x > 0.0 && x.is_finite() => Ok(x),
        x => Err(wrong(value.span().start, format!("{name} must be above 0, not {x}"))),
    };
    let root = match &parsed.root {
        None => None,
        Some(root) => {
            let found = <crate::robot::Root as clap::ValueEnum>::from_str(root.get_ref(), false).ok();
            let near = nearest(root.get_ref(), ["fixed", "free", "planar", "spherical", "translation"]);
            Some(found.ok_or_else(|| {
                wrong(root.span().start, format!("no root joint is called `{}`{near}", root.get_ref()))
            })?)
        }
    };
    let mut numbers = |of: &BTreeMap<String, Spanned<f64>>| {
        of.iter()
            .map(|(joint, value)| {
                note(joint, value.span().start);
                match *value.get_ref() {
                    x if x.is_finite() => Ok((joint.clone(), x)),
                    x => Err(wrong(value.span().start, format!("joint `{joint}` is at {x}"))),
                }
            })
            .collect::<Result<BTreeMap<_, _>, _>>()
    };
    let posture = numbers(&parsed.posture)?;
    let start = parsed.start.as_ref().map(&mut numbers).transpose()?;
    let (mut feet, mut sole) = (Vec::new(), None);
    if let Some(spanned) = &parsed.feet {
        let given = spanned.get_ref();
        for foot in given.points.iter().chain(&given.soles) {
            note(foot.get_ref(), foot.span().start);
            feet.push(foot.get_ref().clone());
        }
        let at = spanned.span().start;
        match (given.points.is_empty(), given.soles.is_empty(), &given.size) {
            (true, true, _) => return Err(wrong(at, "[feet] names no points and no soles".to_owned())),
            (false, false, _) => {
                return Err(wrong(at, "[feet] has points and soles: all feet must be of one kind".to_owned()));
            }
            (true, false, None) => return Err(wrong(at, "soles need their `size`".to_owned())),
            (false, true, Some(size)) => return Err(wrong(size.span().start, "points have no `size`".to_owned())),
            (_, _, Some(size)) if size.get_ref().iter().any(|x| !(*x > 0.0 && x.is_finite())) => {
                return Err(wrong(size.span().start, "the sides of a sole must be above 0".to_owned()));
            }
            (_, _, size) => sole = size.as_ref().map(|size| *size.get_ref()),
        }
    }
    let mut phases = Vec::new();
    for spanned in &parsed.phase {
        phases.push(phase(spanned.get_ref(), &feet, &wrong)?);
    }
    if let Some(reach) = &parsed.reach {
        let at = reach.span().start;
        let Reach { frame, target, knots, tolerance } = reach.get_ref();
        if target.iter().any(|x| !x.is_finite()) {
            return Err(wrong(at, "the target must be finite".to_owned()));
        }
        if let Some(knots) = knots.as_ref().filter(|n| !(1..=MOST_KNOTS).contains(n.get_ref())) {
            return Err(wrong(knots.span().start, format!("knots must be from 1 to {MOST_KNOTS}")));
        }
        tolerance.as_ref().map(|x| positive("tolerance", x)).transpose()?;
        if let Some(frame) = frame {
            note(frame.get_ref(), frame.span().start);
        }
    }
    match (&parsed.reach, parsed.feet.is_some(), phases.is_empty()) {
        (Some(_), false, true) | (None, true, false) => {}
        (Some(reach), ..) => {
            return Err(wrong(reach.span().start, "a task has either [reach], or [feet] and phases".to_owned()));
        }
        (None, true, true) => return Err(wrong(text.len(), "there is no [[phase]]".to_owned())),
        (None, false, _) => return Err(wrong(text.len(), "there is neither [reach] nor [feet]".to_owned())),
    }
    let dt = parsed.dt.as_ref().map(|x| positive("dt", x)).transpose()?;
    let friction = parsed.friction.as_ref().map_or(Ok(0.7), |x| positive("friction", x))?;
    Ok(Task {
        robot: parsed.robot.into_inner(),
        root,
        mimic: parsed.mimic,
        dt,
        friction,
        posture,
        start,
        reach: parsed.reach.map(Spanned::into_inner),
        feet,
        sole,
        phases,
        place: Place { file: file.to_owned(), lines },
    })
}

/// Checks a phase of a gait from the file, and converts it.
fn phase(from: &PhaseFile, feet: &[String], wrong: &dyn Fn(usize, String) -> Error) -> Result<Phase, Error> {
    let PhaseFile { kind, knots, length, side, height, .. } = from;
    if !(1..=MOST_KNOTS).contains(knots.get_ref()) {
        return Err(wrong(
            knots.span().start,
            format!("knots must be from 1 to {MOST_KNOTS}, not {}", knots.get_ref()),
        ));
    }
    let at = kind.span().start;
    let mut swinging = Vec::new();
    for foot in from.feet.iter().flatten() {
        let name = foot.get_ref();
        match feet.iter().position(|f| f == name) {
            Some(number) if !swinging.contains(&number) => swinging.push(number),
            Some(_) => return Err(wrong(foot.span().start, format!("foot `{name}` is named twice"))),
            None => {
                let near = nearest(name, feet.iter().map(|f| &**f));
                return Err(wrong(foot.span().start, format!("[feet] has no `{name}`{near}")));
            }
        }
    }
    let kind = match &**kind.get_ref() {
        "stand" => PhaseKind::Stand,
        "jump" => PhaseKind::Jump,
        "step" if from.feet.is_none() => return Err(wrong(at, "a step needs the `feet` that swing".to_owned())),
        "step" if swinging.is_empty() => return Err(wrong(at, "a step needs a foot that swings".to_owned())),
        "step" if swinging.len() == feet.len() => {
            return Err(wrong(at, "a step leaves a foot on the ground; without any it is a `jump`".to_owned()));
        }
        "step" => PhaseKind::Step(swinging),
        other => {
            let near = nearest(other, ["stand", "step", "jump"]);
            return Err(wrong(at, format!("no phase is called `{other}`{near}")));
        }
    };
    let numbers = [*length, *side, *height];
    if numbers.iter().flatten().any(|x| !x.is_finite()) {
        return Err(wrong(at, "length, side and height must be finite".to_owned()));
    }
    if !matches!(kind, PhaseKind::Step(_)) && from.feet.is_some() {
        return Err(wrong(at, "only a `step` names feet".to_owned()));
    }
    if kind == PhaseKind::Stand && numbers.iter().any(Option::is_some) {
        return Err(wrong(at, "a `stand` has no length, side or height".to_owned()));
    }
    let [length, side, height] = numbers.map(|x| x.unwrap_or(0.0));
    Ok(Phase { kind, knots: *knots.get_ref() as usize, length, side, height })
}

/// Returns the valid key that is most similar to an unknown key. `message` is the parser's message, which lists the
/// valid keys.
fn nearest_key(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    match (message.starts_with("unknown field"), names.next()) {
        (true, Some(unknown)) => nearest(unknown, names),
        _ => String::new(),
    }
}
