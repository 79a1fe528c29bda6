//! `condyle inspect`: prints the content of a robot's file, with warnings.

use crate::additions::Additions;
use crate::error::Error;
use crate::findings::{self, Finding};
use crate::limits::LimitCounts;
use crate::lines::{Kind, Lines};
use crate::robot::{self, Robot, RobotArguments};
use crate::shapes::Shapes;
use crate::terminal::{Style, Table, heading, say, say_json, short, styled};
use condyle::{Data, Model, forward_kinematics, neutral, tree::Body, tree::FrameKind};
use serde::Serialize;
use std::fmt::Write;

/// Show the content of a robot's file: tree, joints, limits, masses, and warnings about suspicious values
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle inspect robot.urdf
  condyle inspect anymal.urdf --root free
  condyle inspect scene.xml --json | jq '.warnings'
  condyle inspect humanoid --strict        # status 1 if there is a warning
  condyle inspect robot.urdf --strict --allow left_out,assumed")]
pub(crate) struct Arguments {
    #[command(flatten)]
    robot: RobotArguments,
    /// Write JSON instead of text
    #[arg(long)]
    json: bool,
    /// Exit with status 1 if there is a warning
    #[arg(long)]
    strict: bool,
    /// Kinds of warnings that --strict accepts
    #[arg(long, value_name = "KIND", value_delimiter = ',', value_parser = findings::KINDS, requires = "strict")]
    allow: Vec<String>,
}

/// Report of `condyle inspect` on a robot.
#[derive(Serialize)]
struct Report {
    name: String,
    source: String,
    format: &'static str,
    nq: usize,
    nv: usize,
    frames: usize,
    /// Mass of all moving bodies (kg).
    mass: f64,
    /// Mass fixed to the world (kg).
    fixed_mass: f64,
    /// Centre of mass of the moving bodies at the neutral position, in the world (m); `None` if nothing has mass.
    com: Option<[f64; 3]>,
    gravity: [f64; 3],
    limits: LimitCounts,
    bodies: Vec<BodyReport>,
    limbs: Limbs,
    mimics: Vec<Follower>,
    #[serde(flatten)]
    additions: Additions,
    collisions: Shapes,
    warnings: Vec<Finding>,
}

/// Body, and the joint that moves the body. Arrays of limits have one number per coordinate; `null` means that no limit
/// exists.
#[derive(Serialize)]
struct BodyReport {
    index: usize,
    name: String,
    joint: String,
    kind: &'static str,
    parent: usize,
    line: Option<u32>,
    axis: Option<[f64; 3]>,
    idx_q: usize,
    nq: usize,
    idx_v: usize,
    nv: usize,
    lower: Vec<Option<f64>>,
    upper: Vec<Option<f64>>,
    velocity: Vec<Option<f64>>,
    /// Maximum magnitude of the effort of each coordinate (N m, N).
    effort: Vec<Option<f64>>,
    effort_lower: Vec<Option<f64>>,
    effort_upper: Vec<Option<f64>>,
    damping: Vec<f64>,
    friction: Vec<f64>,
    armature: Vec<f64>,
    mass: f64,
    com: [f64; 3],
    /// Principal moments of inertia about the body's centre of mass (kg m²), smallest first.
    moments: [f64; 3],
    /// Names of links that fixed joints merge into this body.
    merged: Vec<String>,
}

/// Order in which a single call of an algorithm computes the bodies of a robot.
#[derive(Serialize)]
struct Limbs {
    /// Whether bodies of different limbs share the lanes of a vector register.
    side_by_side: bool,
    /// Number of consecutive steps from the root to the tips. Each step computes one body, or several bodies in SIMD
    /// lanes.
    steps: usize,
    /// Number of bodies that are computed in the consecutive steps from the root to the tips.
    bodies: usize,
}

/// Joint that follows another joint (mimic joint).
#[derive(Serialize)]
struct Follower {
    joint: String,
    leader: String,
    ratio: f64,
    offset: f64,
    line: Option<u32>,
    /// Whether the joint follows the other joint. Without `--mimic`, the joint has its own coordinate instead.
    follows: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    let robot = robot::load(&arguments.robot.robot, &arguments.robot.options)?;
    let report = Report::new(&robot, arguments);
    if arguments.json {
        say_json(&report);
    } else {
        say(&report.text(&robot.model));
    }
    match report.warnings.iter().filter(|finding| !arguments.allow.iter().any(|kind| kind == finding.kind)).count() {
        n if n > 0 && arguments.strict => {
            Err(Error::NegativeAnswer(format!("{} has {n} warning{}", robot.source, if n == 1 { "" } else { "s" })))
        }
        _ => Ok(()),
    }
}

impl Report {
    fn new(robot: &Robot, arguments: &Arguments) -> Self {
        let (model, lines) = (&robot.model, Lines::new(&robot.text));
        let fixed_mass = model.bodies()[0].inertia.mass;
        let mass: f64 = model.bodies()[1..].iter().map(|b| b.inertia.mass).sum();
        let com = forward_kinematics(model, &mut Data::new(model), &neutral(model)).com().to_array();
        let plan = model.limbs();
        Self {
            name: model.name().to_owned(),
            source: robot.source.clone(),
            format: robot.format.name(),
            nq: model.nq(),
            nv: model.nv(),
            frames: model.frames().len(),
            mass,
            fixed_mass,
            com: (mass > 0.0).then_some(com),
            gravity: model.gravity().to_array(),
            limits: LimitCounts::new(robot),
            bodies: (1..model.bodies().len()).map(|i| BodyReport::new(model, i, &lines)).collect(),
            limbs: Limbs {
                side_by_side: plan.is_some(),
                steps: plan.map_or(model.bodies().len(), |plan| plan.steps.len()) - 1,
                bodies: model.bodies().len() - 1,
            },
            mimics: followers(robot, arguments, &lines),
            additions: Additions::new(model),
            collisions: Shapes::new(robot),
            warnings: findings::of(model, &lines),
        }
    }

    fn text(&self, model: &Model) -> String {
        let mut text = String::new();
        let out = &mut text;
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{}  ({}, {})", styled(Style::Bold, &self.name), self.source, self.format);
        let _ = writeln!(
            out,
            "  {} moving bodies, nq = {}, nv = {}, {} frames",
            self.bodies.len(),
            self.nq,
            self.nv,
            self.frames
        );
        let fixed = if self.fixed_mass > 0.0 {
            format!(" and {} kg fixed to the world", short(self.fixed_mass))
        } else {
            String::new()
        };
        let _ = writeln!(out, "  moving mass {} kg{fixed}", short(self.mass));
        if let Some([x, y, z]) = self.com {
            let _ = writeln!(out, "  centre of mass ({x:.4}, {y:.4}, {z:.4}) m at the neutral position");
        }
        let _ = writeln!(out, "  {}", self.limits);
        let Limbs { steps, bodies, .. } = self.limbs;
        let _ = match self.limbs.side_by_side {
            true => writeln!(
                out,
                "  a single call computes {bodies} bodies in {steps} steps, up to four bodies per step in SIMD lanes"
            ),
            false => writeln!(out, "  a single call takes {steps} steps, one per body: too few limbs for SIMD lanes"),
        };
        *out += &heading("Tree");
        *out += &self.tree();
        *out += &heading("Joints");
        *out += &self.joints(model);
        *out += &heading("Bodies");
        *out += &self.masses();
        if !self.mimics.is_empty() {
            *out += &heading("Joints that follow");
            for f in &self.mimics {
                let now = if f.follows { "" } else { "   (has a coordinate of its own; --mimic lets it follow)" };
                let _ = writeln!(out, "  {} = {} · {} + {}{now}", f.joint, short(f.ratio), f.leader, short(f.offset));
            }
        }
        *out += &self.additions.text();
        *out += &self.collisions.text();
        *out += &heading("Warnings");
        if self.warnings.is_empty() {
            *out += &format!("  {}\n", styled(Style::Good, "none"));
        }
        text + &findings::text(&self.warnings, &self.source)
    }

    /// Draws the bodies and their joints as a tree.
    fn tree(&self) -> String {
        let mut children = vec![Vec::new(); self.bodies.len() + 1];
        self.bodies.iter().for_each(|b| children[b.parent].push(b.index));
        let mut text = "  world\n".to_owned();
        // Draw depth first. The stack `left` contains the bodies that are not yet drawn, with the prefix of their
        // lines.
        let mut left: Vec<(usize, String, bool)> = Vec::new();
        let push = |left: &mut Vec<(usize, String, bool)>, of: usize, before: &str| {
            let last = children[of].last().copied();
            left.extend(children[of].iter().rev().map(|&i| (i, before.to_owned(), Some(i) == last)));
        };
        push(&mut left, 0, "  ");
        while let Some((i, before, last)) = left.pop() {
            let b = &self.bodies[i - 1];
            let merged = match b.merged.len() {
                0 => String::new(),
                1..=3 => format!("  + {}", b.merged.join(", ")),
                n => format!("  + {} and {} more", b.merged[..2].join(", "), n - 2),
            };
            let branch = if last { "└─ " } else { "├─ " };
            let joint = styled(Style::Faint, &format!("{} ({})", b.joint, b.kind));
            text += &format!("{before}{branch}{} {}  {joint}{}\n", b.index, b.name, styled(Style::Faint, &merged));
            push(&mut left, i, &format!("{before}{}", if last { "   " } else { "│  " }));
        }
        text
    }

    fn joints(&self, model: &Model) -> String {
        let mut table =
            Table::new(&["#", "joint", "kind", "q", "v", "lower", "upper", "speed", "effort", "damping", "armature"]);
        for b in &self.bodies {
            let one = |values: &[Option<f64>]| match values {
                [value] => value.map_or("∞".to_owned(), short),
                _ => String::new(),
            };
            let lower = if b.lower == [None] { "−∞".to_owned() } else { one(&b.lower) };
            let least = |values: &[f64]| match values {
                [value] if *value != 0.0 => short(*value),
                _ => String::new(),
            };
            let follows = model.bodies()[b.index].mimic.is_some();
            table.row(vec![
                b.index.to_string(),
                b.joint.clone(),
                if follows { format!("{}, follows", b.kind) } else { b.kind.to_owned() },
                range(b.idx_q, b.nq),
                range(b.idx_v, b.nv),
                if b.nq == 1 { lower } else { String::new() },
                if b.nq == 1 { one(&b.upper) } else { String::new() },
                one(&b.velocity),
                match (&*b.effort_lower, &*b.effort_upper) {
                    ([Some(lower)], [Some(upper)]) if *lower != -upper => {
                        format!("{} to {}", short(*lower), short(*upper))
                    }
                    _ => one(&b.effort),
                },
                least(&b.damping),
                least(&b.armature),
            ]);
        }
        table.text()
    }

    fn masses(&self) -> String {
        let mut table = Table::new(&["#", "body", "mass kg", "share", "com x", "y", "z m", "moments kg m²", "", ""]);
        for b in &self.bodies {
            let share = if self.mass > 0.0 { format!("{:.1} %", 100.0 * b.mass / self.mass) } else { String::new() };
            let [x, y, z] = b.com.map(|x| format!("{x:.4}"));
            let [i, j, k] = b.moments.map(|x| format!("{x:.2e}"));
            table.row(vec![b.index.to_string(), b.name.clone(), short(b.mass), share, x, y, z, i, j, k]);
        }
        table.text()
    }
}

impl BodyReport {
    fn new(model: &Model, i: usize, lines: &Lines) -> Self {
        let (b, limits): (&Body, _) = (&model.bodies()[i], model.limits());
        let (q, v) = (b.idx_q..b.idx_q + b.joint.nq(), b.idx_v..b.idx_v + b.joint.nv());
        let finite = |values: &[f64]| values.iter().map(|&x| x.is_finite().then_some(x)).collect();
        let (com, moments) = findings::moments(b.inertia);
        let merged = |f: &&condyle::tree::Frame| f.body == i && f.kind == FrameKind::Link && f.name != b.name;
        Self {
            index: i,
            name: b.name.clone(),
            joint: b.joint_name.clone(),
            kind: b.joint.kind(),
            parent: b.parent,
            line: lines.of(Kind::Joint, &b.joint_name).or_else(|| lines.of(Kind::Body, &b.name)),
            axis: b.joint.axis().map(condyle::Vec3::to_array),
            idx_q: b.idx_q,
            nq: q.len(),
            idx_v: b.idx_v,
            nv: v.len(),
            lower: finite(&limits.lower[q.clone()]),
            upper: finite(&limits.upper[q]),
            velocity: finite(&limits.velocity[v.clone()]),
            effort: finite(&limits.effort()[v.clone()]),
            effort_lower: finite(&limits.effort_lower[v.clone()]),
            effort_upper: finite(&limits.effort_upper[v.clone()]),
            damping: model.damping()[v.clone()].to_vec(),
            friction: model.friction()[v.clone()].to_vec(),
            armature: model.armature()[v].to_vec(),
            mass: b.inertia.mass,
            com,
            moments,
            merged: model.frames().iter().filter(merged).map(|f| f.name.clone()).collect(),
        }
    }
}

/// Returns the joints that follow another joint, or would follow another joint with `--mimic`.
fn followers(robot: &Robot, arguments: &Arguments, lines: &Lines) -> Vec<Follower> {
    let follows = arguments.robot.options.mimic;
    let following = robot::ReadingOptions { mimic: true, ..arguments.robot.options.clone() };
    let again = if follows { None } else { robot::load(&robot.source, &following).ok() };
    let model = again.as_ref().map_or(&robot.model, |robot| &robot.model);
    let leader = |b: &Body| {
        model.bodies()[1..].iter().find(|l| l.mimic.is_none() && l.idx_v == b.idx_v).map(|l| l.joint_name.clone())
    };
    let follower = |b: &Body| {
        let mimic = b.mimic?;
        let line = lines.of(Kind::Joint, &b.joint_name);
        let (ratio, offset) = (mimic.ratio, mimic.offset);
        Some(Follower { joint: b.joint_name.clone(), leader: leader(b)?, ratio, offset, line, follows })
    };
    model.bodies()[1..].iter().filter_map(follower).collect()
}

/// Formats the indices of n numbers that begin with index `first`.
fn range(first: usize, n: usize) -> String {
    match n {
        0 => String::new(),
        1 => first.to_string(),
        _ => format!("{first}–{}", first + n - 1),
    }
}
