//! What a controller is told to do: contacts and tasks once, references at each tick.

use crate::error::{Error, Status, finite};
use condyle_spatial::{Motion, Se3, Vec3};

/// The gains of a task: the desired acceleration is a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// k (1/s²).
    pub stiffness: f64,
    /// d (1/s).
    pub damping: f64,
}

impl Gains {
    /// The gains of a critically damped error of this stiffness (1/s²): d = 2 √k.
    ///
    /// ```
    /// assert_eq!(condyle_wholebody::Gains::critical(100.0).damping, 20.0);
    /// ```
    pub fn critical(stiffness: f64) -> Self {
        Self { stiffness, damping: 2.0 * stiffness.sqrt() }
    }
}

/// A point that touches the environment and is held there: no acceleration, and a force in the cone ‖f_t‖ ≤ μ f_n.
///
/// ```
/// use condyle_wholebody::FrictionContact;
/// let icy = FrictionContact { friction: 0.05, ..FrictionContact::new("LF_foot", 0.7) };
/// assert_eq!(icy.normal.z, 1.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionContact {
    /// The name of a frame, whose origin is the point.
    pub frame: String,
    /// μ, Coulomb's coefficient; above 0.
    pub friction: f64,
    /// The direction in which the environment pushes, in the world's frame; of any length but 0.
    pub normal: Vec3<f64>,
    /// Least normal force (N); at least 0.
    pub min_force: f64,
    /// Greatest normal force (N); may be infinite.
    pub max_force: f64,
}

impl FrictionContact {
    /// A contact on level ground (normal z), its normal force not bounded.
    pub fn new(frame: &str, friction: f64) -> Self {
        let normal = Vec3::new(0.0, 0.0, 1.0);
        Self { frame: frame.to_owned(), friction, normal, min_force: 0.0, max_force: f64::INFINITY }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let length = self.normal.norm_squared().sqrt();
        for (name, value, good, allowed) in [
            ("friction", self.friction, self.friction > 0.0 && self.friction.is_finite(), "above 0"),
            ("normal (its length)", length, length > 0.0 && length.is_finite(), "above 0"),
            ("min_force", self.min_force, self.min_force >= 0.0 && self.min_force.is_finite(), "at least 0"),
            ("max_force", self.max_force, self.max_force >= self.min_force, "at least min_force"),
        ] {
            if !good {
                return Err(Error::Contact { frame: self.frame.clone(), name, value, allowed });
            }
        }
        Ok(())
    }

    /// Unit vectors (t₁, t₂, n) of the contact, right-handed.
    pub(crate) fn axes(&self) -> [Vec3<f64>; 3] {
        let n = self.normal.scale(1.0 / self.normal.norm_squared().sqrt());
        // across n and the axis of the world that lies farthest from it
        let (x, y) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
        let t = if n.x.abs() < n.y.abs() { n.cross(x) } else { y.cross(n) };
        let t1 = t.scale(1.0 / t.norm_squared().sqrt());
        [t1, n.cross(t1), n]
    }
}

/// Move the centre of mass: ½ Σ w_k (c̈ − c̈*)²_k, along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComTask {
    /// w; at least 0, and 0 where the task has no say.
    pub weight: Vec3<f64>,
    /// From position (m) and velocity (m/s) to acceleration.
    pub gains: Gains,
}

/// Move a frame: ½ Σ w_k (a − a*)²_k, of its origin and of its rotation, along the world's axes.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTask {
    /// The name of the frame.
    pub frame: String,
    /// w of the origin's (classical) acceleration; at least 0.
    pub linear: Vec3<f64>,
    /// w of the angular acceleration; at least 0.
    pub angular: Vec3<f64>,
    /// From position (m, rad) and velocity (m/s, rad/s) to acceleration.
    pub gains: Gains,
}

/// Hold the joints near a posture: ½ w Σ (q̈ − q̈*)²_j over all actuated coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureTask {
    /// w; at least 0.
    pub weight: f64,
    /// From position and velocity to acceleration.
    pub gains: Gains,
}

/// All tasks of a controller; only the ratios of their weights, and of the [`Settings`](crate::Settings)', matter.
///
/// ```
/// use condyle_dynamics::Vec3;
/// use condyle_wholebody::{FrameTask, Gains, Tasks};
/// // Keep the trunk level, wherever it is.
/// let (linear, angular) = (Vec3::zero(), Vec3::new(10.0, 10.0, 10.0));
/// let level = FrameTask { frame: "trunk".to_owned(), linear, angular, gains: Gains::critical(100.0) };
/// let tasks = Tasks { frames: vec![level], ..Tasks::default() };
/// # let _ = tasks;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Tasks {
    /// The centre of mass.
    pub com: ComTask,
    /// Any number of frames.
    pub frames: Vec<FrameTask>,
    /// The joints.
    pub posture: PostureTask,
}

impl Default for Tasks {
    /// The centre of mass with weight 10 along each axis, the posture with 0.1, both critically damped at k = 100/s².
    fn default() -> Self {
        let gains = Gains::critical(100.0);
        Self {
            com: ComTask { weight: Vec3::new(10.0, 10.0, 10.0), gains },
            frames: Vec::new(),
            posture: PostureTask { weight: 0.1, gains },
        }
    }
}

impl Tasks {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let good = |x: f64| x >= 0.0 && x.is_finite();
        let number = |task: &str, name, value| match good(value) {
            true => Ok(()),
            false => Err(Error::Task { task: task.to_owned(), name, value, allowed: "at least 0" }),
        };
        let weight = |task: &str, name, w: Vec3<f64>| w.to_array().into_iter().try_for_each(|w| number(task, name, w));
        let gains = |task: &str, gains: Gains| {
            number(task, "gains.stiffness", gains.stiffness)?;
            number(task, "gains.damping", gains.damping)
        };
        weight("com", "weight", self.com.weight)?;
        gains("com", self.com.gains)?;
        for task in &self.frames {
            weight(&task.frame, "linear", task.linear)?;
            weight(&task.frame, "angular", task.angular)?;
            gains(&task.frame, task.gains)?;
        }
        number("posture", "weight", self.posture.weight)?;
        gains("posture", self.posture.gains)
    }
}

/// Where the centre of mass should be, in the world's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComTarget {
    /// m.
    pub position: Vec3<f64>,
    /// m/s.
    pub velocity: Vec3<f64>,
    /// m/s².
    pub acceleration: Vec3<f64>,
}

/// Where a frame should be. Velocity and acceleration are those of its origin and of its rotation, along the world's
/// axes: `linear` is the first and second time derivative of the position (a classical acceleration, not a spatial one).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTarget {
    /// oXf.
    pub pose: Se3<f64>,
    /// (ṗ, ω): m/s, rad/s.
    pub velocity: Motion<f64>,
    /// (p̈, ω̇): m/s², rad/s².
    pub acceleration: Motion<f64>,
}

/// Where the joints should be; entries of a free-flyer are not read.
#[derive(Clone, Debug, PartialEq)]
pub struct PostureTarget {
    /// nq numbers.
    pub q: Vec<f64>,
    /// nv numbers.
    pub v: Vec<f64>,
    /// nv numbers.
    pub a: Vec<f64>,
}

/// Where a contact is held, and about which force the force is regularised; in the world's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactTarget {
    /// m; acts only if [`Settings::contact_gains`](crate::Settings::contact_gains) have a stiffness.
    pub position: Vec3<f64>,
    /// N, what the environment does to the robot: a planned force, or a share of the weight.
    pub force: Vec3<f64>,
}

/// What all tasks aim at during one tick. [`hold`](crate::WholeBodyController::hold) makes one to start from.
///
/// ```
/// use condyle_dynamics::{neutral, robots};
/// use condyle_wholebody::{FrictionContact, Settings, Tasks, WholeBodyController};
/// let robot = robots::quadruped();
/// let contacts = [FrictionContact::new("LF_foot", 0.7), FrictionContact::new("RH_foot", 0.7)];
/// let mut controller = WholeBodyController::new(&robot, &contacts, Tasks::default(), Settings::default())?;
/// let mut references = controller.hold(&neutral(&robot));
/// references.com.acceleration.x = 0.5; // and lean forward
/// assert!((references.contacts[1].force.z - 9.81 * robot.total_mass() / 2.0).abs() < 1e-9);
/// # Ok::<(), condyle_wholebody::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct References {
    /// The centre of mass.
    pub com: ComTarget,
    /// One for each [`FrameTask`], in the same order.
    pub frames: Vec<FrameTarget>,
    /// The joints.
    pub posture: PostureTarget,
    /// One for each [`FrictionContact`], in the same order.
    pub contacts: Vec<ContactTarget>,
}

impl References {
    /// Refuses infinite and NaN numbers.
    pub(crate) fn finite(&self) -> Result<(), Status> {
        let ComTarget { position, velocity, acceleration } = self.com;
        finite("com", [position, velocity, acceleration].into_iter().flat_map(Vec3::to_array))?;
        let frame = |f: &FrameTarget| {
            let Se3 { rotation, translation } = f.pose;
            let vectors = [translation, rotation.x, rotation.y, rotation.z].into_iter().flat_map(Vec3::to_array);
            vectors.chain(f.velocity.to_array()).chain(f.acceleration.to_array())
        };
        finite("frames", self.frames.iter().flat_map(frame))?;
        let PostureTarget { q, v, a } = &self.posture;
        finite("posture", q.iter().chain(v).chain(a).copied())?;
        let contact = |c: &ContactTarget| [c.position, c.force].into_iter().flat_map(Vec3::to_array);
        finite("contacts", self.contacts.iter().flat_map(contact))
    }
}
