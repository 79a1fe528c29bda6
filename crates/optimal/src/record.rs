//! Records of a controller: all calls that change its problem or its solver, and the result of each tick. A replay
//! makes the same calls on a new problem, and compares the results to the last bit.
#![allow(non_snake_case)] // names follow the literature: K

mod calls;
mod numbers;
mod solver;

pub use calls::{Call, ContactChange};
pub use numbers::Numbers;
pub use solver::{Recorded, RecordedSolver, SolverSettings};

use crate::error::Error;
use crate::problem::Problem;
use crate::robot::RobotProblem;
use crate::solvers::{Solution, Status};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Record of a controller from its first solve: the problem and the solver's settings at the beginning, and then all
/// calls with their arguments. A [`replay`](Self::replay) builds the problem again, makes the same calls, and compares
/// the results of all ticks bit by bit.
///
/// The calls are stored, rather than the state of the solver before each tick. The state contains slack variables,
/// multipliers and durations, which change between versions; the calls contain what the controller gave. Each tick also
/// stores its states, controls, status, and a checksum of its gains, so that a difference is found in the tick where
/// it arises.
///
/// A record has a version and can be stored in all formats of serde. Arrays are stored as text with all their bits, so
/// that JSON also preserves NaN. JSON needs the feature `float_roundtrip` of serde_json for the other numbers.
///
/// A replay gives the same bits on processors with the same vector extensions. Two things are not in a record: a solve
/// that its time budget or its observer ends early, and functions of user-defined residuals. Recording allocates.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::record::{Call, Record, SolverSettings};
/// use condyle_optimal::robot::{Activation, Cost, Dynamics, Integrator, Knot, Residual, RobotProblem};
/// use condyle_optimal::Settings;
/// let rest = Cost::new("rest", 1.0, Residual::State { reference: vec![0.0; 14] }, Activation::Quadratic);
/// let step = Dynamics::Free { actuation: None, integrator: Integrator::SemiImplicitEuler, dt: 0.05 };
/// let data = RobotProblem {
///     model: robots::arm7(),
///     x0: vec![0.1; 14],
///     knots: vec![Knot::new(step, vec![rest.clone()])],
///     knot_models: vec![0; 20],
///     terminal: Knot::new(Dynamics::Terminal, vec![rest]),
/// };
/// let settings = Settings { max_iterations: 2, ..Settings::default() };
/// let mut record = Record::new(data, SolverSettings::Fddp { settings });
/// let (mut problem, mut solver) = record.start()?;
/// let (xs, us) = (vec![0.1; 21 * 14].into(), vec![0.0; 20 * 7].into());
/// record.make(&mut problem, &mut solver, Call::Solve { xs, us })?;
/// for k in 0..3 {
///     record.make(&mut problem, &mut solver, Call::Shift { last: 0 })?;
///     record.make(&mut problem, &mut solver, Call::SetX0 { x0: vec![0.01 * f64::from(k); 14].into() })?;
///     record.make(&mut problem, &mut solver, Call::Resume)?;
/// }
/// let text = serde_json::to_string(&record)?;
/// let read: Record = serde_json::from_str(&text)?;
/// assert_eq!((read.ticks().len(), read.replay()?), (4, None));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    version: Version,
    problem: RobotProblem,
    solver: SolverSettings,
    ticks: Vec<Tick>,
    /// Calls since the last tick.
    #[serde(skip)]
    pending: Vec<Call>,
    /// Settings of the last tick.
    #[serde(skip)]
    settings: Option<SolverSettings>,
}

/// Version of the format. Reading refuses other versions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
struct Version;

/// Number of the version.
const VERSION: u32 = 1;

impl From<Version> for u32 {
    fn from(_: Version) -> Self {
        VERSION
    }
}

impl TryFrom<u32> for Version {
    type Error = String;

    fn try_from(version: u32) -> Result<Self, String> {
        match version {
            VERSION => Ok(Self),
            _ => Err(format!("version: expected {VERSION}, found {version}")),
        }
    }
}

/// One tick: the calls since the tick before it, and their result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Tick {
    /// Calls in their sequence. The last one is the call of the solver.
    pub calls: Vec<Call>,
    /// Status of the solution.
    pub status: Status,
    /// States of the solution, flat: (N + 1)·nx.
    pub xs: Numbers,
    /// Controls of the solution, flat.
    pub us: Numbers,
    /// Checksum of the bits of all gains K.
    pub gains: u64,
}

/// First difference between a record and its replay.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Difference {
    /// Index of the tick.
    pub tick: usize,
    /// Array that differs: `"status"`, `"xs"`, `"us"` or `"K"`, in this order.
    pub array: &'static str,
    /// Largest difference of two numbers; NaN for the status and for K, of which a record has only a checksum.
    pub largest: f64,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tick, array, largest } = self;
        match largest.is_nan() {
            true => write!(f, "tick {tick}: {array} differs"),
            false => write!(f, "tick {tick}: {array} differs by up to {largest:e}"),
        }
    }
}

impl Record {
    /// Creates an empty record of a controller that starts with this problem, and with a new solver with these
    /// settings.
    pub fn new(problem: RobotProblem, solver: SolverSettings) -> Self {
        Self { version: Version, problem, solver, ticks: Vec::new(), pending: Vec::new(), settings: None }
    }

    /// Returns the problem at the beginning.
    pub fn problem(&self) -> &RobotProblem {
        &self.problem
    }

    /// Returns the settings of the solver at the beginning.
    pub fn solver(&self) -> &SolverSettings {
        &self.solver
    }

    /// Returns the ticks. The first one is a solve.
    pub fn ticks(&self) -> &[Tick] {
        &self.ticks
    }

    /// Returns a new problem and a new solver, as they were at the beginning.
    ///
    /// # Errors
    /// The errors of [`RobotProblem::build`].
    pub fn start(&self) -> Result<(Problem, RecordedSolver), Error> {
        let problem = self.problem.build()?;
        let solver = self.solver.build(&problem);
        Ok((problem, solver))
    }

    /// Makes a call and records it.
    ///
    /// # Errors
    /// The errors of the call. It is then recorded as well, because it may have had effects.
    pub fn make(&mut self, problem: &mut Problem, solver: &mut RecordedSolver, call: Call) -> Result<(), Error> {
        let made = call.make(problem, solver);
        match made.is_ok() && call.solves() {
            true => self.push_tick(call, solver),
            false => self.push(call),
        }
        made
    }

    /// Records a call that was made.
    pub fn push(&mut self, call: Call) {
        self.pending.push(call);
    }

    /// Records a call of a solver that was made, and its result. If the settings have changed since the tick before,
    /// they are recorded, too.
    pub fn push_tick(&mut self, call: Call, solver: &impl Recorded) {
        let settings = solver.settings();
        if *self.settings.as_ref().unwrap_or(&self.solver) != settings {
            self.pending.push(Call::Configure { settings: Box::new(settings.clone()) });
            self.settings = Some(settings);
        }
        self.pending.push(call);
        let Solution { status, xs, us, .. } = solver.solution();
        let (xs, us) = (xs.clone().into(), us.clone().into());
        let gains = checksum(solver.solution());
        self.ticks.push(Tick { calls: std::mem::take(&mut self.pending), status: *status, xs, us, gains });
    }

    /// Makes all calls on a new problem, and compares the result of each tick with the record. Returns the first
    /// difference; `None` if all bits are the same. Allocates.
    ///
    /// # Errors
    /// The errors of [`start`](Self::start), and the error of a solver's call. If the first tick is not a solve, this
    /// is [`Error::NothingToResume`]. Errors of other calls are ignored, because they also occurred while recording.
    pub fn replay(&self) -> Result<Option<Difference>, Error> {
        let (mut problem, mut solver) = self.start()?;
        for (index, tick) in self.ticks.iter().enumerate() {
            let Some((last, calls)) = tick.calls.split_last() else { continue };
            for call in calls {
                call.make(&mut problem, &mut solver).ok();
            }
            last.make(&mut problem, &mut solver)?;
            if let Some(difference) = tick.compare(index, solver.solution()) {
                return Ok(Some(difference));
            }
        }
        Ok(None)
    }
}

impl Tick {
    /// Returns the first difference between this tick, with the given index, and a solution.
    pub fn compare(&self, tick: usize, solution: &Solution) -> Option<Difference> {
        let differs = |array, largest| Some(Difference { tick, array, largest });
        if self.status != solution.status {
            return differs("status", f64::NAN);
        }
        for (array, ours, theirs) in [("xs", &self.xs, &solution.xs), ("us", &self.us, &solution.us)] {
            if *ours != Numbers::from(theirs.clone()) {
                let distances = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs());
                return differs(array, distances.fold(0.0, f64::max));
            }
        }
        if self.gains != checksum(solution) {
            return differs("K", f64::NAN);
        }
        None
    }
}

/// Returns a checksum of the bits of all gains: FNV-1a, with 8 bytes in each step.
fn checksum(solution: &Solution) -> u64 {
    let bits = solution.K.iter().flat_map(|K| K.iter()).map(|x| x.to_bits());
    bits.fold(0xcbf2_9ce4_8422_2325, |hash, bits| (hash ^ bits).wrapping_mul(0x0100_0000_01b3))
}
