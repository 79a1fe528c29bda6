//! References of a tick: the targets of tasks and contacts.

use crate::error::{InvalidRotation, Status, finite};
use condyle_dynamics::{Model, PositionFault, ROTATION_ROUNDING};
use condyle_spatial::{Force, Motion, Se3, Vec3};

/// Target of the centre of mass, in the world's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComTarget {
    /// Position (m).
    pub position: Vec3<f64>,
    /// Velocity (m/s).
    pub velocity: Vec3<f64>,
    /// Acceleration (m/s²).
    pub acceleration: Vec3<f64>,
}

/// Target of a frame. Velocity and acceleration refer to the frame's origin and rotation, along the world's axes.
/// `linear` is the first or second time derivative of the position (a classical acceleration, not a spatial one).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTarget {
    /// Pose oXf.
    pub pose: Se3<f64>,
    /// Velocity ṗ of the origin (m/s) and angular velocity ω (rad/s).
    pub velocity: Motion<f64>,
    /// Acceleration p̈ of the origin (m/s²) and angular acceleration ω̇ (rad/s²).
    pub acceleration: Motion<f64>,
}

/// Target of the joints, as a state of the robot. The entries of a free-flyer have no effect.
#[derive(Clone, Debug, PartialEq)]
pub struct PostureTarget {
    /// Position, nq numbers.
    pub q: Vec<f64>,
    /// Velocity, nv numbers.
    pub v: Vec<f64>,
    /// Acceleration, nv numbers.
    pub a: Vec<f64>,
}

/// Target of the angular momentum about the centre of mass, along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumTarget {
    /// Angular momentum (kg m²/s).
    pub momentum: Vec3<f64>,
    /// Desired rate of the angular momentum (N m).
    pub rate: Vec3<f64>,
}

/// Target of a contact, in the world's frame: activation, pose at which the contact is held, and reference force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactTarget {
    /// Activation α, from 0 (no contact: no force, and the frame may move) to 1 (full contact). Between 0 and 1 the
    /// frame is held, and the normal force is at most α times the contact's `max_force`. The robot's weight replaces an
    /// infinite `max_force`. A ramp of α over several ticks loads or unloads the contact without a jump in the torques.
    /// Numbers below 0 or above 1 are clamped.
    pub activation: f64,
    /// Pose at which the frame is held. The pose has an effect only if
    /// [`Settings::contact_gains`](crate::Settings::contact_gains) have a stiffness. For a point contact, only the
    /// translation has an effect.
    pub pose: Se3<f64>,
    /// Reference force of the environment on the robot, about the frame's origin (N, N m): a planned force, or a share
    /// of the weight.
    pub force: Force<f64>,
}

/// References of all tasks during one tick. [`hold`](crate::WholeBodyController::hold) returns initial references.
///
/// [`step`](crate::WholeBodyController::step) checks the references. Numbers must be finite. Quaternions and pairs
/// (cos, sin) must have length 1 (up to 1e-3). Matrices of poses must be rotations (up to 1e-2, measured by
/// [`rotation_error`](condyle_spatial::Mat3::rotation_error)).
///
/// ```
/// use condyle_dynamics::{neutral, robots};
/// use condyle_wholebody::{FrictionContact, Settings, Task, WholeBodyController};
/// let robot = robots::quadruped();
/// let contacts = [FrictionContact::point("LF_foot", 0.7), FrictionContact::point("RH_foot", 0.7)];
/// let mut controller = WholeBodyController::new(&robot, &contacts, &[Task::com()], Settings::default())?;
/// let mut references = controller.hold(&neutral(&robot))?;
/// references.com.acceleration.x = 0.5; // lean forward
/// references.contacts[0].activation = 0.0; // without this foot
/// assert!((references.contacts[1].force.linear.z - 9.81 * robot.total_mass() / 2.0).abs() < 1e-9);
/// # Ok::<(), condyle_wholebody::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct References {
    /// Target of the centre of mass.
    pub com: ComTarget,
    /// Target of each task that moves a frame, in the order of the tasks.
    pub frames: Vec<FrameTarget>,
    /// Target of the joints.
    pub posture: PostureTarget,
    /// Target of the angular momentum.
    pub momentum: MomentumTarget,
    /// Target of each [`FrictionContact`](crate::FrictionContact), in the order of the contacts.
    pub contacts: Vec<ContactTarget>,
}

impl References {
    /// Returns `Err` for infinite and NaN numbers, and for invalid rotations.
    pub(crate) fn check(&self, model: &Model) -> Result<(), Status> {
        self.finite()?;
        valid_rotations("posture.q", model, &self.posture.q)?;
        self.frames.iter().enumerate().try_for_each(|(k, target)| rotates("frames", k, &target.pose))?;
        self.contacts.iter().enumerate().try_for_each(|(k, target)| rotates("contacts", k, &target.pose))
    }

    /// Returns `Err` for infinite and NaN numbers.
    fn finite(&self) -> Result<(), Status> {
        let ComTarget { position, velocity, acceleration } = self.com;
        finite("com", [position, velocity, acceleration].into_iter().flat_map(Vec3::to_array))?;
        let frame = |f: &FrameTarget| pose(f.pose).chain(f.velocity.to_array()).chain(f.acceleration.to_array());
        finite("frames", self.frames.iter().flat_map(frame))?;
        let PostureTarget { q, v, a } = &self.posture;
        finite("posture", q.iter().chain(v).chain(a).copied())?;
        finite("momentum", [self.momentum.momentum, self.momentum.rate].into_iter().flat_map(Vec3::to_array))?;
        let contact = |c: &ContactTarget| [c.activation].into_iter().chain(pose(c.pose)).chain(c.force.to_array());
        finite("contacts", self.contacts.iter().flat_map(contact))
    }
}

/// Yields the numbers of a pose: the translation, then the rotation matrix column by column.
fn pose(Se3 { rotation, translation }: Se3<f64>) -> impl Iterator<Item = f64> {
    [translation, rotation.x, rotation.y, rotation.z].into_iter().flat_map(Vec3::to_array)
}

/// Returns `Ok` if all quaternions and pairs (cos, sin) of q have length 1. The numbers must be finite.
pub(crate) fn valid_rotations(name: &'static str, model: &Model, q: &[f64]) -> Result<(), Status> {
    let Some(fault) = model.rotation_fault(q) else { return Ok(()) };
    let PositionFault { body, first, end, value: length } = fault;
    Err(Status::InvalidState(InvalidRotation::Joint { name, body, first, end, length }))
}

/// Returns `Ok` if the rotation of the target pose is valid. The numbers must be finite.
fn rotates(name: &'static str, index: usize, pose: &Se3<f64>) -> Result<(), Status> {
    let error = pose.rotation.rotation_error();
    if error <= ROTATION_ROUNDING {
        Ok(())
    } else {
        Err(Status::InvalidState(InvalidRotation::Pose { name, index, error }))
    }
}
