//! Motion of a robot at a knot: accelerations, efforts of joints, and forces of contacts.

use super::contact::Contact;
use super::dynamics::robot::robot_of;
use crate::{Problem, Solution};
use condyle_dynamics::{Data, Force, Mat3, Model, ReferenceFrame, Vec3, forward_kinematics};

/// Accelerations, efforts and contact forces at the beginning of a knot.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct KnotMotion {
    /// Accelerations q̈. Shape: nv; empty at an impact.
    pub acceleration: Vec<f64>,
    /// Efforts τ = S u of all joints (N, N m). If accelerations are controls, the efforts follow from inverse dynamics.
    /// The efforts of a base without motors are then 0, except for the tolerance of the constraints. Shape: nv; empty
    /// at an impact, and for actions without a robot.
    pub effort: Vec<f64>,
    /// Jump of the velocities at an impact, v⁺ − v. Shape: nv; empty at other knots.
    pub velocity_change: Vec<f64>,
    /// Forces of the knot's contacts, in the order of the action's contacts.
    pub contacts: Vec<ContactForce>,
}

/// Force that the world exerts on the body of a contact (N, N m); at an impact, the impulse (N s, N m s). For a closed
/// loop, it is the force on the body of the constraint's first frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContactForce {
    /// Name of the contact.
    pub name: String,
    /// Index of the contact's frame in the robot's list of frames.
    pub frame: usize,
    /// Force along the world's axes, with the moment about the origin of the contact's frame. The moment of a point
    /// contact is 0.
    pub force: Force<f64>,
    /// Same force and moment, along the axes of the contact's frame.
    pub local: Force<f64>,
}

impl KnotMotion {
    /// Returns the force of the contact with the name `name`; `None` if the knot has no such contact.
    pub fn contact(&self, name: &str) -> Option<&ContactForce> {
        self.contacts.iter().find(|contact| contact.name == name)
    }

    /// Returns whether the knot is an impact, whose forces are impulses.
    pub fn is_impact(&self) -> bool {
        !self.velocity_change.is_empty()
    }
}

impl ContactForce {
    /// Returns the force of a contact from the contact's rows of λ. R is the rotation of the contact's frame in the
    /// world.
    fn new(Contact { name, constraint }: &Contact, rows: &[f64], R: Mat3<f64>) -> Self {
        let axes = constraint.axes;
        let along = match *rows {
            [n] => Force::new(axes * Vec3::new(0.0, 0.0, n), Vec3::zero()),
            [t, n] => Force::new(axes * Vec3::new(t, 0.0, n), Vec3::zero()),
            [x, y, z] => Force::new(Vec3::new(x, y, z), Vec3::zero()),
            [x, y, z, l, m, n] => Force::new(Vec3::new(x, y, z), Vec3::new(l, m, n)),
            _ => unreachable!("a contact has 1, 2, 3 or 6 rows, found {}", rows.len()),
        };
        let turned = |R: Mat3<f64>| Force::new(R * along.linear, R * along.angular);
        let (force, local) = match constraint.reference {
            ReferenceFrame::Local => (turned(R), along),
            _ => (along, turned(R.transpose())),
        };
        Self { name: name.clone(), frame: constraint.frame, force, local }
    }
}

/// Returns the force of each contact at the position q. `rows` contains λ: the rows of all contacts, one after the
/// other.
fn forces(model: &Model, contacts: &[Contact], rows: &[f64], q: &[f64]) -> Vec<ContactForce> {
    if contacts.is_empty() {
        return Vec::new();
    }
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let mut rest = rows;
    let force = |contact: &Contact| {
        let (rows, others) = rest.split_at(contact.constraint.kind.rows());
        rest = others;
        ContactForce::new(contact, rows, placements.frame(contact.constraint.frame).rotation)
    };
    contacts.iter().map(force).collect()
}

/// Access to the accelerations, efforts and contact forces of robots with any dynamics and any integrator, also for
/// actions inside [`Constrained`](crate::Constrained) actions.
impl Problem {
    /// Computes the accelerations, efforts and contact forces of a solution at knot t, from 0 to N. Returns `None` for
    /// a terminal knot without impact, and for actions that have no robot and compute no accelerations. Allocates.
    ///
    /// The solution must belong to the current knots of this problem. After [`shift`](Self::shift), earlier solutions
    /// no longer belong to them.
    ///
    /// ```
    /// use condyle_dynamics::robots;
    /// use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// use condyle_optimal::{Fddp, Problem};
    /// use std::sync::Arc;
    /// let arm = Arc::new(robots::arm7());
    /// let rest = Cost::new("rest", 1.0, Residual::State { reference: vec![0.1; 14] }, Activation::Quadratic);
    /// let knot = FreeDynamics::running(arm.clone(), 0.02, vec![rest])?;
    /// let end = FreeDynamics::terminal(arm, vec![])?;
    /// let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 5], Box::new(end))?;
    /// let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 6 * 14], &[0.0; 5 * 7])?.clone();
    /// let motion = problem.motion(&solution, 0).unwrap();
    /// assert_eq!((motion.acceleration.len(), &motion.effort[..]), (7, solution.u(0)));
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Panics
    /// If t > N, or if the horizon of the solution or its dimensions at knot t differ from the problem's.
    #[track_caller]
    pub fn motion(&mut self, solution: &Solution, t: usize) -> Option<KnotMotion> {
        self.assert_knot(t);
        let (found, expected) = (solution.xs.len(), (self.horizon() + 1) * self.nx());
        assert!(found == expected, "`solution.xs` has length {found}, expected {expected}");
        let u = if t < self.horizon() { solution.u(t) } else { &[] };
        self.motion_at(t, solution.x(t), u)
    }

    /// Computes the same quantities as [`motion`](Self::motion) at knot t, from a given state x and given controls u.
    /// At t = N, u is empty.
    ///
    /// # Panics
    /// If t > N, or x or u has a wrong length.
    #[track_caller]
    pub fn motion_at(&mut self, t: usize, x: &[f64], u: &[f64]) -> Option<KnotMotion> {
        let (mut motion, mut rows) = (KnotMotion::default(), Vec::new());
        self.outputs(t, x, u, &mut |name, numbers| match name {
            "acceleration" => motion.acceleration = numbers.to_vec(),
            "effort" => motion.effort = numbers.to_vec(),
            name if name.starts_with("force/") => rows.extend_from_slice(numbers), // contacts are shown in their order
            _ => {}
        });
        let action = self.action_mut(t);
        if let Some(robot) = robot_of(action) {
            let (model, is_impact) = (robot.model.clone(), robot.is_impact());
            motion.contacts = forces(&model, robot.contacts(), &rows, &x[..model.nq()]);
            if is_impact {
                let mut next = x.to_vec();
                action.calc(t, x, u, &mut next);
                let end = model.nq() + model.nv();
                motion.velocity_change = (model.nq()..end).map(|k| next[k] - x[k]).collect();
            }
        }
        let nothing = motion.acceleration.is_empty() && !motion.is_impact();
        (!nothing).then_some(motion)
    }
}
