//! What a controller is to do: tasks, given once.

use crate::error::Error;

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

/// The quantity that a task controls, and how many numbers it has.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TaskKind {
    /// The centre of mass, c̈: 3 numbers.
    Com,
    /// A frame's origin and rotation, (p̈, ω̇): 6 numbers, linear first.
    Pose(String),
    /// A frame's origin, p̈: 3 numbers.
    Position(String),
    /// A frame's rotation, ω̇: 3 numbers.
    Orientation(String),
    /// The velocity of a frame's origin and rotation, whatever its pose (only the gain d acts): 6 numbers, linear first.
    Velocity(String),
    /// The actuated joints, q̈.
    Posture,
    /// The rate of the angular momentum about the centre of mass (only the gain d acts): 3 numbers.
    AngularMomentum,
    /// The force of the contact of this frame: 6 numbers, force and moment at the contact's centre along its axes (t₁, t₂,
    /// n), of which a point has 3. No gain acts; nor does the task while the contact is off.
    ContactForce(String),
}

impl TaskKind {
    /// The name of the frame that it moves.
    pub(crate) fn frame(&self) -> Option<&str> {
        match self {
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Velocity(f) => Some(f),
            Self::Com | Self::Posture | Self::AngularMomentum | Self::ContactForce(_) => None,
        }
    }

    /// What errors call it.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Com => "com",
            Self::Posture => "posture",
            Self::AngularMomentum => "angular momentum",
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Velocity(f) | Self::ContactForce(f) => f,
        }
    }
}

/// Axes along which the numbers of a task are, from which its mask picks.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Axes {
    /// The world's.
    World,
    /// The frame's own; for tasks that move no frame, the world's.
    Local,
    /// Those of another frame, by its name: a foot along the trunk's axes, say.
    Frame(String),
}

/// A quantity to be controlled: ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖². What it aims at is in the
/// [`References`](crate::References).
///
/// Tasks of priority 0 come first; those of priority 1 decide only what they leave open, and so on (lexicographic). Within
/// a priority the weights decide, and only their ratios matter.
///
/// ```
/// use condyle_wholebody::{Axes, Gains, Task};
/// // Keep the trunk level, whatever its heading and place.
/// let level = Task { mask: [true, true, false, true, true, true], ..Task::orientation("trunk") };
/// // Move a hand along its own x axis, as far as balance allows.
/// let along = Task { axes: Axes::Local, priority: 1, gains: Gains::critical(50.0), ..Task::position("hand") };
/// # let _ = (level, along);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// The quantity.
    pub kind: TaskKind,
    /// w; at least 0, and 0 where the task has no say.
    pub weight: f64,
    /// From errors of position and velocity to acceleration.
    pub gains: Gains,
    /// Which of its numbers count; of tasks with 3 numbers the first 3 entries are read. For the posture, see `joints`.
    pub mask: [bool; 6],
    /// Along whose axes.
    pub axes: Axes,
    /// 0 for the first; at most 2.
    pub priority: usize,
    /// Factors of the posture's weight, one for each coordinate (nv numbers); empty for all 1.
    pub joints: Vec<f64>,
}

impl Task {
    fn new(kind: TaskKind, weight: f64) -> Self {
        let gains = Gains::critical(100.0);
        Self { kind, weight, gains, mask: [true; 6], axes: Axes::World, priority: 0, joints: Vec::new() }
    }

    /// The centre of mass: weight 10, critically damped at k = 100/s², as are all.
    pub fn com() -> Self {
        Self::new(TaskKind::Com, 10.0)
    }
    /// A frame's pose, weight 10.
    pub fn pose(frame: &str) -> Self {
        Self::new(TaskKind::Pose(frame.to_owned()), 10.0)
    }
    /// A frame's origin, weight 10.
    pub fn position(frame: &str) -> Self {
        Self::new(TaskKind::Position(frame.to_owned()), 10.0)
    }
    /// A frame's rotation, weight 10.
    pub fn orientation(frame: &str) -> Self {
        Self::new(TaskKind::Orientation(frame.to_owned()), 10.0)
    }
    /// A frame's velocity, weight 10.
    pub fn velocity(frame: &str) -> Self {
        Self::new(TaskKind::Velocity(frame.to_owned()), 10.0)
    }
    /// The joints, weight 0.1.
    pub fn posture() -> Self {
        Self::new(TaskKind::Posture, 0.1)
    }
    /// The angular momentum, weight 0.1 s²/kg² m⁴.
    pub fn angular_momentum() -> Self {
        Self::new(TaskKind::AngularMomentum, 0.1)
    }
    /// The force of a contact, by its frame, weight 1e-3/N².
    pub fn contact_force(frame: &str) -> Self {
        Self::new(TaskKind::ContactForce(frame.to_owned()), 1e-3)
    }

    pub(crate) fn check(&self, nv: usize) -> Result<(), Error> {
        let number = |name, value: f64| match value >= 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(Error::Task { task: self.kind.name().to_owned(), name, value, allowed: "at least 0" }),
        };
        number("weight", self.weight)?;
        number("gains.stiffness", self.gains.stiffness)?;
        number("gains.damping", self.gains.damping)?;
        self.joints.iter().try_for_each(|&w| number("joints", w))?;
        if self.priority > 2 {
            let (task, value) = (self.kind.name().to_owned(), self.priority as f64);
            return Err(Error::Task { task, name: "priority", value, allowed: "0, 1 or 2" });
        }
        if !self.joints.is_empty() && self.joints.len() != nv {
            return Err(Error::Length { name: "joints", expected: nv, found: self.joints.len() });
        }
        Ok(())
    }
}
