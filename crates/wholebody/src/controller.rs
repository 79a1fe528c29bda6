//! Controller. Its constructor allocates all memory. Each tick computes the constraints and tasks, solves the program,
//! and checks the command.

use crate::command::{Command, CommandSource};
use crate::cone_program::Status as Stopped;
use crate::contact::FrictionContact;
use crate::contact_rows::ContactRows;
use crate::equations::Equations;
use crate::error::{Error, Status, finite};
use crate::kinematics::Kinematics;
use crate::objective::{Objective, ResolvedTask};
use crate::plan::{Plan, PlannedState};
use crate::references::{
    ComTarget, ContactTarget, FrameTarget, MomentumTarget, PostureTarget, References, valid_rotations,
};
use crate::safety::Safety;
use crate::settings::Settings;
use crate::task::{Task, TaskKind};
use crate::task_hierarchy::TaskHierarchy;
use condyle_dynamics::distances::DistancePairs;
use condyle_dynamics::{Force, Model, Motion, Vec3, neutral};
use condyle_linalg::check;
use std::fmt;

/// Maximum violation of a constraint by a solution, relative to 1 + the robot's weight (N, N m, m/s²). A larger
/// violation is an error.
const FEASIBLE: f64 = 1e-6;

/// Weight of the tasks that lead joints back to their limits. If the limits contradict other constraints, these tasks
/// replace them.
const PULL: f64 = 1e3;

/// A whole-body controller. It solves one cone program for each tick and priority; the [crate's documentation](crate)
/// states the program.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_wholebody::{FrictionContact, Settings, Task, WholeBodyController};
/// let robot = robots::quadruped();
/// let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|foot| FrictionContact::point(foot, 0.7));
/// let tasks = [Task::com(), Task::orientation("trunk"), Task::posture()];
/// let mut controller = WholeBodyController::new(&robot, &feet, &tasks, Settings::default())?;
/// // Knees inwards, feet on the ground.
/// let mut q = vec![0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0];
/// q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);
/// let references = controller.hold(&q)?;
/// let command = controller.step(&q, &[0.0; 18], &references).solved()?;
/// let lift: f64 = command.forces.iter().map(|f| f.linear.z).sum();
/// assert!((lift - 9.81 * robot.total_mass()).abs() < 0.1); // the feet carry the weight
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct WholeBodyController {
    pub(crate) settings: Settings,
    pub(crate) equations: Equations,
    pub(crate) objective: Objective,
    pub(crate) hierarchy: TaskHierarchy,
    pub(crate) safety: Safety,
    pub(crate) command: Command,
    /// Scratch: the state of a plan at one time.
    planned: PlannedState,
}

impl WholeBodyController {
    /// Checks all arguments and allocates memory. The list of contacts may be empty: the robot is then in free fall.
    ///
    /// # Errors
    /// [`Error`] for an unknown frame, for a frame that two contacts name, and for any number outside of its range.
    pub fn new(model: &Model, contacts: &[FrictionContact], tasks: &[Task], settings: Settings) -> Result<Self, Error> {
        tasks.iter().try_for_each(|task| task.check(model.nv()))?;
        settings.check(model)?;
        settings.check_effort(model)?;
        // List each frame of contacts, of tasks, and of tasks' axes once.
        let mut frames: Vec<usize> = Vec::new();
        let mut place = |name: &str| -> Result<usize, Error> {
            let frame = model.frame(name)?;
            Ok(frames.iter().position(|&f| f == frame).unwrap_or_else(|| {
                frames.push(frame);
                frames.len() - 1
            }))
        };
        let mut touching: Vec<ContactRows> = Vec::new();
        for contact in contacts {
            let frame = place(&contact.frame)?;
            if touching.iter().any(|c| c.frame == frame) {
                return Err(Error::DuplicateContact { frame: contact.frame.clone() });
            }
            touching.push(ContactRows::new(contact, contact.check()?, frame, model.nv()));
        }
        let mut resolved: Vec<ResolvedTask> = Vec::new();
        for task in tasks {
            let frame = task.kind.frame().map(&mut place).transpose()?;
            let axes = ResolvedTask::axes_name(task).map(&mut place).transpose()?;
            let contact = match &task.kind {
                TaskKind::ContactForce(name) => {
                    let frame = place(name)?;
                    let missing = || Error::NoSuchContact { frame: name.clone() };
                    Some(touching.iter().position(|c| c.frame == frame).ok_or_else(missing)?)
                }
                _ => None,
            };
            let target = resolved.iter().filter(|task| task.frame.is_some()).count();
            resolved.push(ResolvedTask { task: task.clone(), frame, target, axes, contact });
        }

        let kinematics = Kinematics::new(model, &frames);
        let unknowns = model.nv() + touching.iter().map(|c| c.geometry.unknowns()).sum::<usize>();
        let pairs = settings.distances.as_ref().map_or(0, |limits| limits.pairs.len());
        let objective = Objective::new(resolved, model.nv(), unknowns, pairs);
        let rows: Vec<usize> = objective.priorities.iter().map(|priority| priority.b.len()).collect();
        let held = match rows.len() {
            1 => 0,
            priorities => rows.iter().sum::<usize>() + (priorities - 1) * model.nv(),
        };
        let command = Command {
            status: Status::NotStarted,
            source: CommandSource::GravityCompensation,
            tau: vec![0.0; model.nv()],
            a: vec![0.0; model.nv()],
            forces: vec![Force::zero(); contacts.len()],
            com_acceleration: Vec3::zero(),
            violation: 0.0,
            iterations: 0,
            reduced_accuracy: false,
            limits_relaxed: false,
        };
        let Settings { damping, hold_ticks, .. } = settings;
        let safety = Safety::new(&kinematics, &neutral(model), settings.effort(model), damping, hold_ticks);
        let equations = Equations::new(kinematics, touching, &settings, held)?;
        let hierarchy = TaskHierarchy::new(equations.program.capacity(), equations.dense_rows(), &rows, &settings);
        let planned = PlannedState { q: neutral(model), v: vec![0.0; model.nv()], a: vec![0.0; model.nv()] };
        Ok(Self { settings, equations, objective, hierarchy, safety, command, planned })
    }

    /// Returns references that keep the robot at rest at position q. All tasks keep their present values. Each contact
    /// touches, is held at its present pose, and carries an equal share of the weight.
    ///
    /// q: nq numbers.
    ///
    /// # Errors
    /// [`Error::Model`] for numbers that are not finite, and for quaternions and pairs (cos, sin) that do not have
    /// length 1.
    ///
    /// # Panics
    /// If `q` does not have nq numbers.
    #[track_caller]
    pub fn hold(&mut self, q: &[f64]) -> Result<References, Error> {
        let k = &mut self.equations.kinematics;
        k.model.check_position(q)?;
        let rest = vec![0.0; k.model.nv()];
        k.update(q, &rest);
        let share = k.model.gravity().scale(-k.mass / self.equations.contacts.len() as f64);
        let (zero, still) = (Vec3::zero(), Motion::zero());
        let moved = self.objective.tasks.iter().filter_map(|task| task.frame);
        let target = |frame: usize| FrameTarget { pose: k.frames[frame].pose, velocity: still, acceleration: still };
        let contact = |c: &ContactRows| {
            let force = Force::new(share, c.centre_arm(&k.frames[c.frame]).cross(share));
            ContactTarget { activation: 1.0, pose: k.frames[c.frame].pose, force }
        };
        Ok(References {
            com: ComTarget { position: k.com, velocity: zero, acceleration: zero },
            frames: moved.map(target).collect(),
            posture: PostureTarget { q: q.to_vec(), v: rest.clone(), a: rest },
            momentum: MomentumTarget { momentum: zero, rate: zero },
            contacts: self.equations.contacts.iter().map(contact).collect(),
        })
    }

    /// Writes the references of a plan at time t. The joints follow the plan. The references of centre of mass,
    /// momentum and frames follow from the joints. Each contact gets the plan's activation and pose. The force that the
    /// plan's acceleration of the centre of mass requires is divided among the contacts.
    ///
    /// # Panics
    /// If the references were made for another controller, or the plan for a robot with other bodies and joints.
    #[track_caller]
    pub fn track(&mut self, plan: &Plan, t: f64, references: &mut References) {
        let Self { equations: Equations { kinematics: k, contacts, .. }, objective, planned, .. } = self;
        check("references.contacts", references.contacts.len(), contacts.len());
        check("references.posture.q", references.posture.q.len(), k.model.nq());
        check("references.posture.v", references.posture.v.len(), k.model.nv());
        check("references.posture.a", references.posture.a.len(), k.model.nv());
        plan.check(&k.model, contacts.len());
        plan.read(t, planned, &mut objective.error);
        let PlannedState { q, v, a } = planned;
        k.update(q, v);
        references.posture.q.copy_from_slice(q);
        references.posture.v.copy_from_slice(v);
        references.posture.a.copy_from_slice(a);
        let mut rate = k.momentum_drift.to_array();
        for (A, &a) in k.Ag.as_slice().chunks_exact(6).zip(a.iter()) {
            (0..6).for_each(|i| rate[i] += A[i] * a);
        }
        let [x, y, z, l, m, n] = rate;
        let acceleration = Vec3::new(x, y, z).scale(1.0 / k.mass);
        references.com = ComTarget { position: k.com, velocity: k.com_velocity, acceleration };
        references.momentum = MomentumTarget { momentum: k.momentum.angular, rate: Vec3::new(l, m, n) };
        let moved = objective.tasks.iter().filter_map(|task| task.frame);
        for (target, frame) in references.frames.iter_mut().zip(moved) {
            let frame = &k.frames[frame];
            let mut acceleration = frame.drift.to_array();
            for &j in &frame.support {
                (0..6).for_each(|i| acceleration[i] += frame.J[(i, j)] * a[j]);
            }
            let [x, y, z, l, m, n] = acceleration;
            let acceleration = Motion::new(Vec3::new(x, y, z), Vec3::new(l, m, n));
            *target = FrameTarget { pose: frame.pose, velocity: frame.velocity, acceleration };
        }
        for (i, target) in references.contacts.iter_mut().enumerate() {
            target.activation = plan.activation(i, t);
        }
        let sum: f64 = references.contacts.iter().map(|c| c.activation).sum();
        let force = (acceleration - *k.model.gravity()).scale(k.mass / sum.max(1e-3));
        for (target, contact) in references.contacts.iter_mut().zip(contacts) {
            let (frame, share) = (&k.frames[contact.frame], force.scale(target.activation));
            target.pose = frame.pose;
            target.force = Force::new(share, contact.centre_arm(frame).cross(share));
        }
    }

    /// Computes efforts, acceleration and contact forces at the state (q, v). It always returns a command. If the
    /// program has no solution, the result is a safe command, and its status tells the cause. A number that is not
    /// finite gives [`Status::NotFinite`]. A quaternion or a pair (cos, sin) without length 1, or an invalid rotation
    /// in a reference, gives [`Status::InvalidState`]. In both cases the safe command is computed from the last valid
    /// state.
    ///
    /// q: nq numbers; v: nv. Later calls of [`command`](Self::command) return the same command. A step allocates
    /// nothing with [`Backend::InteriorPoint`](crate::Backend). With clarabel, each step allocates once, and a new set
    /// of contacts causes more allocations.
    ///
    /// # Panics
    /// If `q`, `v` or a list of the references has the wrong length.
    #[track_caller]
    pub fn step(&mut self, q: &[f64], v: &[f64], references: &References) -> &Command {
        self.check_lengths(q, v, references);
        let state = finite("q", q.iter().copied())
            .and_then(|()| finite("v", v.iter().copied()))
            .and_then(|()| valid_rotations("q", self.equations.model(), q));
        self.safety.see(state.is_ok().then_some((q, v)));
        let status = match state.and_then(|()| references.check(self.equations.model())) {
            Ok(()) => self.solve(q, v, references),
            Err(status) => {
                self.command.iterations = 0;
                Err(status)
            }
        };
        match status {
            Ok(status) => {
                self.command.status = status;
                self.command.source = CommandSource::Solution;
                self.safety.keep(&self.command.tau);
            }
            Err(status) => {
                self.command.status = status;
                let Equations { kinematics, contacts, free, .. } = &mut self.equations;
                let last = self.safety.command(kinematics, contacts, free, &mut self.command.tau);
                self.command.source =
                    if last { CommandSource::LastSolution } else { CommandSource::GravityCompensation };
            }
        }
        &self.command
    }

    /// Panics unless all arguments of a step have the lengths of this controller.
    #[track_caller]
    pub(crate) fn check_lengths(&self, q: &[f64], v: &[f64], references: &References) {
        let (nq, nv) = (self.equations.model().nq(), self.equations.model().nv());
        let moved = self.objective.tasks.iter().filter(|task| task.frame.is_some()).count();
        check("q", q.len(), nq);
        check("v", v.len(), nv);
        check("references.posture.q", references.posture.q.len(), nq);
        check("references.posture.v", references.posture.v.len(), nv);
        check("references.posture.a", references.posture.a.len(), nv);
        check("references.contacts", references.contacts.len(), self.equations.contacts.len());
        check("references.frames", references.frames.len(), moved);
    }

    /// Computes constraints and tasks.
    pub(crate) fn update(&mut self, q: &[f64], v: &[f64], references: &References) {
        let Self { settings, equations, objective, .. } = self;
        equations.update(q, v, references, settings);
        let n = equations.program.size.unknowns;
        let Equations { kinematics, contacts, actuated, .. } = &*equations;
        objective.update(q, v, kinematics, contacts, references, settings, actuated, n);
    }

    /// Computes the command; returns `Err` if no iterate satisfies all constraints.
    fn solve(&mut self, q: &[f64], v: &[f64], references: &References) -> Result<Status, Status> {
        self.update(q, v, references);
        let Self { equations, objective, hierarchy, safety, command, .. } = self;
        let n = equations.program.size.unknowns;

        let (mut outcome, mut done) = {
            let (program, kinds) = equations.program();
            hierarchy.solve(program, kinds, &objective.priorities)
        };
        let failed = matches!(outcome.stopped, Some(Stopped::Infeasible | Stopped::NumericalError)) && done == 0;
        command.limits_relaxed = failed && equations.can_relax();
        if command.limits_relaxed {
            equations.relax(&mut objective.priorities[0], PULL);
            let iterations = outcome.iterations;
            let (program, kinds) = equations.program();
            (outcome, done) = hierarchy.solve(program, kinds, &objective.priorities);
            outcome.iterations += iterations;
        }
        command.iterations = outcome.iterations;
        command.reduced_accuracy = outcome.reduced;
        let status = outcome.stopped.map_or(Status::Solved, Status::from);
        // If the solver stopped early, use an iterate that satisfies all constraints, or the result of an earlier
        // priority.
        let may_serve = done > 0 || matches!(status, Status::IterationLimit | Status::TimeLimit);
        let x = &hierarchy.x[..n];
        let violation = equations.violation(x);
        let holds = violation <= FEASIBLE * (1.0 + equations.weight) && x.iter().all(|x| x.is_finite());
        if !(may_serve && holds) {
            return Err(if status == Status::Solved { Status::NumericalError } else { status });
        }
        command.violation = violation;
        command.a.copy_from_slice(&x[..v.len()]);
        for (force, contact) in command.forces.iter_mut().zip(&equations.contacts) {
            *force = contact.read(x);
        }
        equations.effort(x, &mut command.tau); // τ = M q̈ + h − Jᵀ f
        safety.clip(&mut command.tau);
        let (k, mut rate) = (&equations.kinematics, [0.0; 3]);
        for (A, a) in k.Ag.as_slice().chunks_exact(6).zip(x) {
            (0..3).for_each(|i| rate[i] += A[i] * a);
        }
        command.com_acceleration = Vec3::from(rate).scale(1.0 / k.mass) + k.com_drift; // c̈ = J q̈ + J̇ v
        Ok(status)
    }

    /// Returns the pairs of the limits of distances; `None` without such limits. [`DistancePairs::place`] and
    /// [`DistancePairs::set_velocity`] move an obstacle.
    pub fn pairs_mut(&mut self) -> Option<&mut DistancePairs> {
        self.equations.pairs_mut()
    }

    /// Returns the last command; it is zero before the first step.
    pub fn command(&self) -> &Command {
        &self.command
    }
}

impl fmt::Debug for WholeBodyController {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WholeBodyController").field("command", &self.command).finish_non_exhaustive()
    }
}
