//! The references of a tick.

use crate::error::{InvalidRotation, Status, finite};
use condyle_dynamics::{Model, PositionFault, ROTATION_ROUNDING};
use condyle_spatial::{Force, Motion, Se3, Vec3};

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

/// Where the joints should be: a state of the robot. Entries of a free-flyer do not act.
#[derive(Clone, Debug, PartialEq)]
pub struct PostureTarget {
    /// nq numbers.
    pub q: Vec<f64>,
    /// nv numbers.
    pub v: Vec<f64>,
    /// nv numbers.
    pub a: Vec<f64>,
}

/// What the angular momentum about the centre of mass should be, along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumTarget {
    /// kg m²/s.
    pub momentum: Vec3<f64>,
    /// Its rate (N m).
    pub rate: Vec3<f64>,
}

/// Whether a contact touches, where it is held, and about which force its force is regularised; in the world's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactTarget {
    /// α, from 0 (it does not touch: no force, and the frame may move) to 1 (it touches). Between them the frame is held and
    /// the normal force is at most α times the contact's `max_force`, or the robot's weight if that is infinite: a ramp of α
    /// over some ticks loads or unloads the contact without a jump in the torques. Numbers outside of 0 to 1 are clamped.
    pub activation: f64,
    /// Where the frame is held; acts only if [`Settings::contact_gains`](crate::Settings::contact_gains) have a stiffness. Of
    /// a point, the translation alone.
    pub pose: Se3<f64>,
    /// What the environment should do to the robot, about the frame's origin (N, N m): a planned force, or a share of the
    /// weight.
    pub force: Force<f64>,
}

/// References of all tasks during one tick. [`hold`](crate::WholeBodyController::hold) makes one to start from.
///
/// [`step`](crate::WholeBodyController::step) checks them: numbers are finite, quaternions and pairs (cos, sin) have length 1
/// (up to 1e-3), and rotation matrices are rotations (up to 1e-2, in [`rotation_error`](condyle_spatial::Mat3::rotation_error)).
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
    /// The centre of mass.
    pub com: ComTarget,
    /// One for each task that names a frame to be moved, in the same order.
    pub frames: Vec<FrameTarget>,
    /// The joints.
    pub posture: PostureTarget,
    /// The angular momentum.
    pub momentum: MomentumTarget,
    /// One for each [`FrictionContact`](crate::FrictionContact), in the same order.
    pub contacts: Vec<ContactTarget>,
}

impl References {
    /// Refuses infinite and NaN numbers, and rotations that are none.
    pub(crate) fn check(&self, model: &Model) -> Result<(), Status> {
        self.finite()?;
        valid_rotations("posture.q", model, &self.posture.q)?;
        self.frames.iter().enumerate().try_for_each(|(k, target)| rotates("frames", k, &target.pose))?;
        self.contacts.iter().enumerate().try_for_each(|(k, target)| rotates("contacts", k, &target.pose))
    }

    /// Refuses infinite and NaN numbers.
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

/// Translation, then the rotation by columns.
fn pose(Se3 { rotation, translation }: Se3<f64>) -> impl Iterator<Item = f64> {
    [translation, rotation.x, rotation.y, rotation.z].into_iter().flat_map(Vec3::to_array)
}

/// `Ok` if all rotations of a position have length 1; the numbers are finite.
pub(crate) fn valid_rotations(name: &'static str, model: &Model, q: &[f64]) -> Result<(), Status> {
    let Some(fault) = model.rotation_fault(q) else { return Ok(()) };
    let PositionFault { body, first, end, value: length } = fault;
    Err(Status::InvalidState(InvalidRotation::Joint { name, body, first, end, length }))
}

/// `Ok` if the pose of a target rotates; its numbers are finite.
fn rotates(name: &'static str, index: usize, pose: &Se3<f64>) -> Result<(), Status> {
    let error = pose.rotation.rotation_error();
    if error <= ROTATION_ROUNDING {
        Ok(())
    } else {
        Err(Status::InvalidState(InvalidRotation::Pose { name, index, error }))
    }
}
