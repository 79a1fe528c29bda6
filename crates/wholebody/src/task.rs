//! Tasks of a controller. They stay the same for all ticks.

use crate::error::Error;

/// Gains of a task: the desired acceleration is a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v), with the position x and the
/// velocity v of the task, and their references.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Gain k of the position error (1/s²).
    pub stiffness: f64,
    /// Gain d of the velocity error (1/s).
    pub damping: f64,
}

impl Gains {
    /// Returns the gains k and d for critical damping, from a stiffness k (1/s²): d = 2 √k.
    ///
    /// ```
    /// assert_eq!(condyle_wholebody::Gains::critical(100.0).damping, 20.0);
    /// ```
    pub fn critical(stiffness: f64) -> Self {
        Self { stiffness, damping: 2.0 * stiffness.sqrt() }
    }
}

/// Quantity controlled by a task, and its number of components.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TaskKind {
    /// Centre of mass: 3 numbers, its acceleration.
    Com,
    /// Origin and rotation of a frame: 6 numbers, the acceleration of the origin, then the angular acceleration.
    Pose(String),
    /// Origin of a frame: 3 numbers, the acceleration of the origin.
    Position(String),
    /// Rotation of a frame: 3 numbers, the angular acceleration.
    Orientation(String),
    /// Velocity of a frame's origin and rotation, whatever its pose (only the gain d acts): 6 numbers, linear first.
    Velocity(String),
    /// Actuated joints: their accelerations.
    Posture,
    /// Rate of the angular momentum about the centre of mass (only the gain d acts): 3 numbers.
    AngularMomentum,
    /// Force of the contact of this frame: 6 numbers, force and moment at the contact's centre, along the contact's
    /// axes (t₁, t₂, n). A point contact has only the first 3 numbers. Gains have no effect, and the task is off while
    /// the contact is off.
    ContactForce(String),
}

impl TaskKind {
    /// Returns the name of the frame that the task moves.
    pub(crate) fn frame(&self) -> Option<&str> {
        match self {
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Velocity(f) => Some(f),
            Self::Com | Self::Posture | Self::AngularMomentum | Self::ContactForce(_) => None,
        }
    }

    /// Returns the name of the task in error messages.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Com => "com",
            Self::Posture => "posture",
            Self::AngularMomentum => "angular momentum",
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Velocity(f) | Self::ContactForce(f) => f,
        }
    }
}

/// Axes along which the components of a task are measured. The task's mask selects among these components.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Axes {
    /// The world's axes.
    World,
    /// The axes of the frame that the task moves; for tasks that move no frame, the world's axes.
    Local,
    /// The axes of another frame, by name: for example, a foot along the trunk's axes.
    Frame(String),
}

/// Task: a quantity to be controlled, with the cost ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖². Here w is the weight, J the
/// Jacobian of the quantity, and a* its desired acceleration. The [`References`](crate::References) contain its target.
///
/// Tasks of priority 0 come first. Tasks of priority 1 determine only the motion that priority 0 leaves open, and so on
/// (lexicographic). Within a priority only the ratios of the weights matter.
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
    /// The controlled quantity.
    pub kind: TaskKind,
    /// w, the weight; at least 0. A task with weight 0 has no effect.
    pub weight: f64,
    /// Gains k and d, by which the errors of position and velocity are multiplied.
    pub gains: Gains,
    /// Selection of the task's components that enter the cost. Tasks with 3 components use the first 3 entries; the
    /// posture uses `joints` instead.
    pub mask: [bool; 6],
    /// Axes of the task's components.
    pub axes: Axes,
    /// Priority: 0 is the highest, at most 2.
    pub priority: usize,
    /// Factors of the posture's weight, one for each coordinate (nv numbers); empty for all 1.
    pub joints: Vec<f64>,
}

impl Task {
    fn new(kind: TaskKind, weight: f64) -> Self {
        let gains = Gains::critical(100.0);
        Self { kind, weight, gains, mask: [true; 6], axes: Axes::World, priority: 0, joints: Vec::new() }
    }

    /// Creates a task for the centre of mass, with weight 10. The task is critically damped with k = 100/s², like the
    /// tasks of all constructors of this type.
    pub fn com() -> Self {
        Self::new(TaskKind::Com, 10.0)
    }
    /// Creates a task for a frame's pose, weight 10.
    pub fn pose(frame: &str) -> Self {
        Self::new(TaskKind::Pose(frame.to_owned()), 10.0)
    }
    /// Creates a task for a frame's origin, weight 10.
    pub fn position(frame: &str) -> Self {
        Self::new(TaskKind::Position(frame.to_owned()), 10.0)
    }
    /// Creates a task for a frame's rotation, weight 10.
    pub fn orientation(frame: &str) -> Self {
        Self::new(TaskKind::Orientation(frame.to_owned()), 10.0)
    }
    /// Creates a task for a frame's velocity, weight 10.
    pub fn velocity(frame: &str) -> Self {
        Self::new(TaskKind::Velocity(frame.to_owned()), 10.0)
    }
    /// Creates a task for the joints, weight 0.1.
    pub fn posture() -> Self {
        Self::new(TaskKind::Posture, 0.1)
    }
    /// Creates a task for the angular momentum, weight 0.1 s²/kg² m⁴.
    pub fn angular_momentum() -> Self {
        Self::new(TaskKind::AngularMomentum, 0.1)
    }
    /// Creates a task for the force of a contact, given by its frame, weight 1e-3/N².
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
