//! The controller: fixes the program once, fills in its numbers at each tick, reads the answer.

use crate::equations::Equations;
use crate::error::{Error, Status, finite};
use crate::program::ConeProgram;
use crate::settings::Settings;
use crate::task::{FrictionContact, References, Tasks};
use clarabel::solver::DefaultSettings;
use condyle_dynamics::{Model, neutral};
use condyle_spatial::Vec3;
use std::fmt;

/// What the robot should do now.
///
/// Constraints hold to the solver's tolerance: with the default, a force may leave its cone by some 1e-7 N.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// τ, the efforts of the motors: nv numbers (N m, N), 0 at a free-flyer.
    pub tau: Vec<f64>,
    /// q̈, the acceleration that follows if the contacts hold: nv numbers (rad/s², m/s²).
    pub a: Vec<f64>,
    /// f, what the environment then does to the robot at each contact, in the world's frame (N).
    pub forces: Vec<Vec3<f64>>,
    /// c̈ = J q̈ + J̇ v of the centre of mass, in the world's frame (m/s²).
    pub com_acceleration: Vec3<f64>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// Whether the solver fell short of [`Settings::tolerance`] and met only its reduced one (feasibility 1e-4).
    pub reduced_accuracy: bool,
}

/// A whole-body controller: one cone program for each tick, stated in the [crate's documentation](crate).
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_wholebody::{FrictionContact, Settings, Tasks, WholeBodyController};
/// let robot = robots::quadruped();
/// let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|foot| FrictionContact::new(foot, 0.7));
/// let mut controller = WholeBodyController::new(&robot, &feet, Tasks::default(), Settings::default())?;
/// // Knees inwards, feet on the ground.
/// let mut q = vec![0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0];
/// q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);
/// let references = controller.hold(&q);
/// let command = controller.step(&q, &[0.0; 18], &references)?;
/// let lift: f64 = command.forces.iter().map(|f| f.z).sum();
/// assert!((lift - 9.81 * robot.total_mass()).abs() < 0.1); // the feet carry the weight
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct WholeBodyController {
    equations: Equations,
    program: ConeProgram,
    command: Command,
}

impl WholeBodyController {
    /// Checks everything, fixes sparsity and memory.
    ///
    /// # Errors
    /// [`Error`] for an unknown frame, an empty list of contacts or one that names a frame twice, and for any number
    /// outside of its range.
    pub fn new(model: &Model, contacts: &[FrictionContact], tasks: Tasks, settings: Settings) -> Result<Self, Error> {
        if contacts.is_empty() {
            return Err(Error::NoContacts);
        }
        contacts.iter().try_for_each(FrictionContact::check)?;
        tasks.check()?;
        settings.check(model)?;
        let names = contacts.iter().map(|c| &c.frame).chain(tasks.frames.iter().map(|t| &t.frame));
        let frames = names.map(|name| model.frame(name)).collect::<Result<Vec<_>, _>>()?;
        let (touching, _) = frames.split_at(contacts.len());
        if let Some(k) = (1..touching.len()).find(|&k| touching[..k].contains(&touching[k])) {
            return Err(Error::DuplicateContact { frame: contacts[k].frame.clone() });
        }

        let solver = DefaultSettings {
            tol_feas: settings.tolerance,
            tol_gap_abs: settings.tolerance,
            tol_gap_rel: settings.tolerance,
            max_iter: settings.max_iterations,
            time_limit: settings.time_limit,
            // Refined as far as asked for: clarabel's own 1e-13 costs a sixth of the time.
            iterative_refinement_reltol: settings.tolerance,
            iterative_refinement_abstol: settings.tolerance,
            ..DefaultSettings::default()
        };
        let mut equations = Equations::new(model, contacts, tasks, settings, &frames);
        let bodies: Vec<usize> = touching.iter().map(|&f| model.frames()[f].body).collect();
        let (nv, in_A) = (model.nv(), equations.rows.pattern(model, &bodies));
        let in_P = |i: usize, j: usize| i == j || (i < nv && j < nv);
        // The solver takes the scales of rows and columns from here and keeps them.
        let q = neutral(model);
        let references = equations.hold(&q);
        equations.update(&q, &references.posture.v, &references);
        let cones = equations.rows.cones();
        let program = ConeProgram::new(&equations.numbers, in_P, |i, j| in_A[i][j], &cones, solver);
        let command = Command {
            tau: vec![0.0; nv],
            a: vec![0.0; nv],
            forces: vec![Vec3::zero(); contacts.len()],
            com_acceleration: Vec3::zero(),
            iterations: 0,
            reduced_accuracy: false,
        };
        Ok(Self { equations, program, command })
    }

    /// The references that keep the position q at rest: all tasks where they are, each contact held where it is, the
    /// weight shared by the contacts in equal parts.
    ///
    /// q: nq numbers.
    ///
    /// # Panics
    /// If `q` has not nq numbers.
    pub fn hold(&mut self, q: &[f64]) -> References {
        check("q", q.len(), self.equations.model().nq());
        self.equations.hold(q)
    }

    /// Efforts, acceleration and contact forces at the state (q, v), by one solve.
    ///
    /// q: nq numbers; v: nv. The command stays readable as [`command`](Self::command). Allocates once, inside clarabel.
    ///
    /// # Errors
    /// [`Status`] if q, v or the references are not finite, or the program was not solved.
    ///
    /// # Panics
    /// If `q`, `v` or a list of the references has the wrong length.
    pub fn step(&mut self, q: &[f64], v: &[f64], references: &References) -> Result<&Command, Status> {
        let Self { equations, program, command } = self;
        let (nq, nv) = (equations.model().nq(), equations.model().nv());
        check("q", q.len(), nq);
        check("v", v.len(), nv);
        check("references.posture.q", references.posture.q.len(), nq);
        check("references.posture.v", references.posture.v.len(), nv);
        check("references.posture.a", references.posture.a.len(), nv);
        check("references.contacts", references.contacts.len(), equations.rows.axes.len());
        check("references.frames", references.frames.len(), equations.tasked_frames());
        finite("q", q.iter().copied())?;
        finite("v", v.iter().copied())?;
        references.finite()?;

        equations.update(q, v, references);
        let outcome = program.solve(&equations.numbers);
        match outcome.stopped {
            None | Some(Status::IterationLimit | Status::TimeLimit) => {
                command.iterations = outcome.iterations;
                command.reduced_accuracy = outcome.reduced;
                equations.read(outcome.x, command);
            }
            Some(_) => {}
        }
        outcome.stopped.map_or(Ok(&self.command), Err)
    }

    /// The last command; after [`Status::IterationLimit`] and [`Status::TimeLimit`] the last iterate, which may violate
    /// every constraint; zeros before the first step.
    pub fn command(&self) -> &Command {
        &self.command
    }
}

impl fmt::Debug for WholeBodyController {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WholeBodyController").field("command", &self.command).finish_non_exhaustive()
    }
}

/// Panics unless an argument has as many entries as it must have.
#[track_caller]
fn check(argument: &str, found: usize, expected: usize) {
    assert!(found == expected, "{argument}: expected {expected} entries, found {found}");
}
