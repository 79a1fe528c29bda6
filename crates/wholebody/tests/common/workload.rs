//! Recorded ticks of robots that stand, walk and trot while they are pushed. Programs use the recordings to time and to
//! compare the back ends.
//!
//! Condyle's own constrained dynamics close the loop. If a foot touches according to the references, the ground holds
//! the foot, even if it must pull. The controller receives velocities with noise, and does not know the pushes. On
//! processors with the same vector instructions, the same arguments give the same recording.
#![allow(dead_code, unreachable_pub)] // each program uses only some of the functions

use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, Force, Joint, Model, ReferenceFrame, UrdfOptions, Vec3,
    constrained_dynamics, forward_velocities, impulse_dynamics, integrate, neutral, robots,
};
use condyle_wholebody::{FrictionContact, Gains, References, Settings, Task, WholeBodyController};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::f64::consts::PI;

/// Time step (s).
const DT: f64 = 1e-3;
/// Coefficient of friction.
const FRICTION: f64 = 0.6;
/// Length and width of a sole (m).
const SOLE: [f64; 2] = [0.2, 0.1];
/// Maximum noise of the velocities that the controller receives (m/s, rad/s).
const NOISE: f64 = 5e-3;
/// Rate at which the velocity of a held foot decays (1/s).
const HOLD: f64 = 50.0;
/// Interval from the beginning of one push to the next, and duration of a push (s).
const PUSHES: [f64; 2] = [0.5, 0.1];

/// Durations (s) of the phases of a biped's step. First the weight moves to one foot; then the other foot is unloaded,
/// swings and is loaded.
const SHIFT: f64 = 1.2;
const FADE: f64 = 0.1;
const SWING: f64 = 0.5;
/// Length and height of a biped's step (m).
const STEP: [f64; 2] = [0.1, 0.05];
/// Durations (s), height (m) and speed (m/s) of a trot. Half a period consists of a fade, a swing and another fade.
const TROT_FADE: f64 = 0.03;
const TROT_SWING: f64 = 0.2;
const TROT_HEIGHT: f64 = 0.05;
const TROT_SPEED: f64 = 0.25;
/// Additional reach of a swinging foot (m) per unwanted speed of the trunk (m/s). The value is about √(h / g), with the
/// height h = 0.5 m of the trunk.
const CAPTURE: f64 = 0.2;

/// Robot that stands on its feet.
pub struct Robot {
    pub name: String,
    pub model: Model,
    /// Initial position, on level ground at height 0.
    pub q: Vec<f64>,
    pub contacts: Vec<FrictionContact>,
    pub tasks: Vec<Task>,
    /// Force of a push, divided by the robot's weight.
    push: f64,
}

/// Constants of a robot. Joints and frames are identified by name.
struct Description {
    name: &'static str,
    trunk: &'static str,
    feet: &'static [&'static str],
    /// Pairs of a text and an angle: a joint whose name contains the text has this angle.
    bent: &'static [(&'static str, f64)],
}

const ROBOTS: [Description; 4] = [
    Description {
        name: "humanoid",
        trunk: "pelvis",
        feet: &["left_sole", "right_sole"],
        bent: &[("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4)],
    },
    Description {
        name: "talos",
        trunk: "base_link",
        feet: &["left_sole_link", "right_sole_link"],
        bent: &[
            ("leg_left_3", -0.45),
            ("leg_left_4", 0.9),
            ("leg_left_5", -0.45),
            ("leg_right_3", -0.45),
            ("leg_right_4", 0.9),
            ("leg_right_5", -0.45),
            ("arm_left_2", 0.2),
            ("arm_right_2", -0.2),
            ("arm_left_4", -0.5),
            ("arm_right_4", -0.5),
        ],
    },
    Description {
        name: "quadruped",
        trunk: "trunk",
        feet: &["LF_foot", "RF_foot", "LH_foot", "RH_foot"],
        bent: &[("F_HFE", 0.7), ("F_KFE", -1.4), ("H_HFE", -0.7), ("H_KFE", 1.4)],
    },
    Description {
        name: "anymal",
        trunk: "base",
        feet: &["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"],
        bent: &[("F_HFE", 0.7), ("F_KFE", -1.4), ("H_HFE", -0.7), ("H_KFE", 1.4)],
    },
];

impl Robot {
    /// Loads a built-in robot, or a robot from the list above with its URDF file.
    pub fn new(name: &str, urdf: Option<&str>) -> Result<Self, Box<dyn std::error::Error>> {
        let known = ROBOTS.iter().find(|robot| robot.name == name).ok_or_else(|| format!("no robot `{name}`"))?;
        let options = UrdfOptions { root_joint: Some(Joint::FreeFlyer), ..UrdfOptions::default() };
        let model = match (name, urdf) {
            (_, Some(path)) => Model::from_urdf(path, &options)?,
            ("humanoid", None) => robots::humanoid(),
            ("quadruped", None) => robots::quadruped(),
            _ => return Err(format!("`{name}` needs its URDF").into()),
        };
        let mut q = neutral(&model);
        for body in model.bodies() {
            if let Some((_, angle)) = known.bent.iter().find(|(part, _)| body.joint_name.contains(part)) {
                q[body.idx_q] = *angle;
            }
        }
        let biped = known.feet.len() == 2;
        let contact = |foot: &&str| match biped {
            true => FrictionContact::sole(foot, FRICTION, SOLE),
            false => FrictionContact::point(foot, FRICTION),
        };
        let trunk = Task { gains: Gains::critical(60.0), ..Task::orientation(known.trunk) };
        let mut tasks = vec![Task { gains: Gains::critical(40.0), ..Task::com() }, trunk, Task::posture()];
        let gains = Gains::critical(900.0);
        tasks.extend(known.feet.iter().map(|foot| match biped {
            true => Task { weight: 100.0, gains, ..Task::pose(foot) },
            false => Task { weight: 100.0, gains, ..Task::position(foot) },
        }));
        if biped {
            tasks.push(Task { weight: 0.01, ..Task::angular_momentum() });
        }
        let contacts: Vec<_> = known.feet.iter().map(contact).collect();
        let mut robot = Self { name: name.to_owned(), model, q, contacts, tasks, push: if biped { 0.05 } else { 0.1 } };
        let ground = robot.controller(Settings::default()).hold(&robot.q).unwrap().contacts[0].pose.translation.z;
        robot.q[2] -= ground;
        Ok(robot)
    }

    /// Returns the settings of the controller that makes the recording.
    pub fn settings() -> Settings {
        let contact_gains = Gains { stiffness: 0.0, damping: 40.0 };
        // Without this weight, rounding errors would determine how the load is distributed among the feet.
        Settings { contact_gains, force_weight: 1e-5, ..Settings::default() }
    }

    pub fn controller(&self, settings: Settings) -> WholeBodyController {
        WholeBodyController::new(&self.model, &self.contacts, &self.tasks, settings).expect("a known robot")
    }

    pub fn is_biped(&self) -> bool {
        self.contacts.len() == 2
    }

    /// Returns the name of the robot's gait.
    pub fn gait(&self) -> &'static str {
        if self.is_biped() { "walk" } else { "trot" }
    }
}

/// Arguments of a controller's step at a tick.
#[derive(Clone)]
pub struct Tick {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub references: References,
}

/// Computes a function that rises smoothly from 0 at s = 0 to 1 at s = 1. Returns its value, slope and curvature at s.
fn smooth(s: f64) -> [f64; 3] {
    let s = s.clamp(0.0, 1.0);
    let rest = s * (1.0 - s);
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * rest * rest, 60.0 * rest * (1.0 - 2.0 * s)]
}

/// Simulation of a robot on the ground.
struct World<'m> {
    model: &'m Model,
    data: Data<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    feet: Vec<ContactConstraint>,
    touching: Vec<bool>,
}

impl World<'_> {
    fn set(&self) -> ConstraintSet<f64> {
        let held: Vec<_> = self.feet.iter().zip(&self.touching).filter(|(_, on)| **on).map(|(foot, _)| *foot).collect();
        ConstraintSet::new(self.model, &held).expect("feet differ")
    }

    fn step(&mut self, tau: &[f64], f_ext: &[Force<f64>], touching: &[bool]) {
        let lands = self.touching.iter().zip(touching).any(|(before, now)| *now && !before);
        self.touching.copy_from_slice(touching);
        let mut set = self.set();
        if lands {
            self.v = impulse_dynamics(self.model, &mut self.data, &mut set, &self.q, &self.v, 0.0).v.to_vec();
        }
        let a = constrained_dynamics(self.model, &mut self.data, &mut set, &self.q, &self.v, tau, f_ext).a.to_vec();
        self.v.iter_mut().zip(&a).for_each(|(v, a)| *v += DT * a); // v⁺ = v + Δt q̈
        let moved: Vec<f64> = self.v.iter().map(|v| DT * v).collect();
        let mut next = self.q.clone();
        integrate(self.model, &self.q, &moved, &mut next); // q⁺ = q ⊕ Δt v⁺
        self.q = next;
    }
}

/// Generator of the references of a gait.
struct Gait<'r> {
    robot: &'r Robot,
    start: References,
    /// Position of each foot while it is held, or at the start of its swing.
    feet: Vec<Vec3<f64>>,
    /// Position of the centre of mass at the beginning of a step.
    from: Vec3<f64>,
    step: usize,
}

impl Gait<'_> {
    /// Index of the first foot among the frames of the references.
    const FEET: usize = 1;

    /// Writes the references at time t, for the given position and velocity of the centre of mass.
    fn write(&mut self, t: f64, com: [Vec3<f64>; 2], references: &mut References) {
        if self.robot.is_biped() { self.walk(t, references) } else { self.trot(t, com, references) }
    }

    fn swing(&self, foot: usize, s: f64, [duration, height]: [f64; 2], target: Vec3<f64>, references: &mut References) {
        let [along, rate, curvature] = smooth(s);
        let (sin, cos) = (PI * s.clamp(0.0, 1.0)).sin_cos();
        let way = target - self.feet[foot];
        let frame = &mut references.frames[Self::FEET + foot];
        frame.pose.translation = self.feet[foot] + way.scale(along);
        frame.pose.translation.z += height * sin * sin;
        frame.velocity.linear = way.scale(rate / duration);
        frame.velocity.linear.z += height * 2.0 * PI / duration * sin * cos;
        frame.acceleration.linear = way.scale(curvature / (duration * duration));
        frame.acceleration.linear.z += height * 2.0 * (PI / duration).powi(2) * (cos * cos - sin * sin);
    }

    /// Writes references of quasi-static steps. The left foot carries the weight first.
    fn walk(&mut self, t: f64, references: &mut References) {
        let duration = SHIFT + FADE + SWING + FADE;
        let step = (t / duration) as usize;
        let t = t - duration * step as f64;
        let (carries, swings) = (step % 2, 1 - step % 2);
        if step > self.step {
            self.step = step;
            self.feet[carries] = references.frames[Self::FEET + carries].pose.translation;
            self.from = references.com.position;
        }
        let mut over = self.feet[carries];
        over.z = self.start.com.position.z;
        let [along, rate, curvature] = smooth(t / SHIFT);
        let way = over - self.from;
        references.com.position = self.from + way.scale(along);
        references.com.velocity = way.scale(rate / SHIFT);
        references.com.acceleration = way.scale(curvature / (SHIFT * SHIFT));
        let mut target = self.feet[swings];
        target.x = self.feet[carries].x + STEP[0];
        self.swing(swings, (t - SHIFT - FADE) / SWING, [SWING, STEP[1]], target, references);
        references.contacts[swings].activation = activation(t - SHIFT, FADE, SWING);
    }

    /// Writes references of a trot, in which diagonal pairs of feet swing alternately.
    fn trot(&mut self, t: f64, [com, velocity]: [Vec3<f64>; 2], references: &mut References) {
        let duration = 2.0 * TROT_FADE + TROT_SWING;
        let step = (t / duration) as usize;
        let speed = Vec3::new(TROT_SPEED, 0.0, 0.0);
        references.com.position = self.start.com.position + speed.scale(t);
        references.com.velocity = speed;
        let t = t - duration * step as f64;
        let pair = if step.is_multiple_of(2) { [0, 3] } else { [1, 2] };
        if step > self.step {
            self.step = step;
            for foot in 0..4 {
                if !pair.contains(&foot) {
                    self.feet[foot] = references.frames[Self::FEET + foot].pose.translation;
                }
            }
        }
        for foot in pair {
            let offset = self.start.frames[Self::FEET + foot].pose.translation - self.start.com.position;
            let mut target = com + offset + speed.scale(duration) + (velocity - speed).scale(CAPTURE);
            target.z = 0.0;
            self.swing(foot, (t - TROT_FADE) / TROT_SWING, [TROT_SWING, TROT_HEIGHT], target, references);
            references.contacts[foot].activation = activation(t, TROT_FADE, TROT_SWING);
        }
    }
}

/// Returns the activation of a contact at time t. It falls from 1 to 0 within `fade`, is 0 during the swing, and rises
/// to 1 within `fade`.
fn activation(t: f64, fade: f64, swing: f64) -> f64 {
    let (down, up) = (1.0 - t / fade, (t - fade - swing) / fade);
    down.max(up).clamp(0.0, 1.0)
}

/// Records ticks of a robot that is pushed while it stands or moves.
///
/// # Panics
/// If the robot falls.
pub fn record(robot: &Robot, moves: bool, ticks: usize) -> Vec<Tick> {
    let (model, nv) = (&robot.model, robot.model.nv());
    let mut controller = robot.controller(Robot::settings());
    let start = controller.hold(&robot.q).unwrap();
    let mut rng = StdRng::seed_from_u64(7);
    let foot = |contact: &FrictionContact| {
        let frame = model.frame(&contact.frame).expect("a foot");
        let kind = if robot.is_biped() { ContactConstraint::rigid(frame) } else { ContactConstraint::point(frame) };
        ContactConstraint { kd: HOLD, reference: ReferenceFrame::LocalWorldAligned, ..kind }
    };
    let mut world = World {
        model,
        data: Data::new(model),
        q: robot.q.clone(),
        v: vec![0.0; nv],
        feet: robot.contacts.iter().map(foot).collect(),
        touching: vec![true; robot.contacts.len()],
    };
    let feet = start.contacts.iter().map(|contact| contact.pose.translation).collect();
    let mut gait = Gait { robot, from: start.com.position, feet, step: 0, start: start.clone() };
    let weight = -model.total_mass() * model.gravity().z;
    let mut f_ext = vec![Force::zero(); model.bodies().len()];
    let mut push = Vec3::zero();
    let mut references = start.clone();
    let mut recorded = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        let t = DT * tick as f64;
        let velocities = forward_velocities(model, &mut world.data, &world.q, &world.v);
        let velocity = velocities.com_velocity();
        if moves {
            let com = controller.hold(&world.q).unwrap().com.position;
            gait.write(t, [com, velocity], &mut references);
        }
        let (each, lasts) = ((PUSHES[0] / DT) as usize, (PUSHES[1] / DT) as usize);
        if tick % each == each / 2 {
            let (sin, cos) = (2.0 * PI * rng.random::<f64>()).sin_cos();
            push = Vec3::new(cos, sin, 0.3 * (2.0 * rng.random::<f64>() - 1.0)).scale(robot.push * weight);
        } else if tick % each == each / 2 + lasts {
            push = Vec3::zero();
        }
        f_ext[1].linear = push; // along the axes of the trunk, which hardly rotates
        let v: Vec<f64> = world.v.iter().map(|v| v + NOISE * (2.0 * rng.random::<f64>() - 1.0)).collect();
        let command = controller.step(&world.q, &v, &references);
        let (tau, height) = (command.tau.clone(), world.q[2] / robot.q[2]);
        assert!((0.8..1.2).contains(&height), "{} falls at tick {tick}", robot.name);
        recorded.push(Tick { q: world.q.clone(), v, references: references.clone() });
        let touching: Vec<bool> = references.contacts.iter().map(|contact| contact.activation > 0.0).collect();
        world.step(&tau, &f_ext, &touching);
    }
    recorded
}
