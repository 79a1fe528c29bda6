//! Calls that change a problem or its solver.

use super::numbers::Numbers;
use super::solver::{RecordedSolver, SolverSettings};
use crate::error::Error;
use crate::problem::Problem;
use crate::robot::{Cost, Knot};
use condyle_dynamics::{ContactConstraint, Mat3, Motion, Se3, Vec3};
use serde::{Deserialize, Serialize};

/// Call that changes a problem or its solver, with all arguments. Each call is named after its function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Call {
    /// Call of [`Problem::set_x0`].
    SetX0 {
        /// Initial state.
        x0: Numbers,
    },
    /// Call of [`Problem::set_references`].
    SetReferences {
        /// Name of the cost.
        name: String,
        /// Targets of all knots.
        values: Numbers,
    },
    /// Call of [`Problem::set_placements`].
    SetPlacements {
        /// Name of the geometry.
        name: String,
        /// Placements of all knots: for each the homogeneous matrix, row by row.
        values: Numbers,
    },
    /// Change of the weight of a cost at all knots, by [`Problem::change_costs`].
    SetWeight {
        /// Name of the cost.
        name: String,
        /// Weight.
        weight: f64,
    },
    /// Call of [`Problem::set_weights`].
    SetWeights {
        /// Name of the cost.
        name: String,
        /// Weight of each knot.
        weights: Numbers,
    },
    /// Call of [`Problem::set_entry_weights`].
    SetEntryWeights {
        /// Name of the cost.
        name: String,
        /// Weights of the entries at all knots.
        weights: Numbers,
    },
    /// Call of [`Problem::set_parameter`].
    SetParameter {
        /// Name of the parameter.
        name: String,
        /// Value of the parameter.
        values: Numbers,
    },
    /// Change of a contact, by [`Problem::change_contacts`].
    SetContact {
        /// Name of the contact.
        contact: String,
        /// Changes of the contact.
        change: Box<ContactChange>,
    },
    /// Replacement of the costs of one knot.
    SetCosts {
        /// Index of the knot; N for the terminal one.
        knot: usize,
        /// Costs of the knot.
        costs: Vec<Cost>,
    },
    /// Call of [`Problem::set_knot`].
    SetKnot {
        /// Index of the knot.
        knot: usize,
        /// Description of the new model, for the robot of the problem.
        model: Box<Knot>,
    },
    /// Call of [`Problem::set_duration`].
    SetDuration {
        /// Index of the knot.
        knot: usize,
        /// Duration (s).
        dt: f64,
    },
    /// Call of [`Problem::set_knots`].
    SetKnots {
        /// Index of the model of each knot.
        knot_models: Vec<usize>,
        /// Duration of each knot (s).
        durations: Numbers,
    },
    /// Call of the solver's `retime`.
    Retime {
        /// Time by which the horizon moves (s).
        elapsed: f64,
        /// Index of the model of each knot.
        knot_models: Vec<usize>,
        /// Duration of each knot (s).
        durations: Numbers,
    },
    /// Call of the solver's `reset`.
    Reset {
        /// State with which the solver starts anew.
        x0: Numbers,
    },
    /// Call of the solver's `prepare`.
    Prepare {
        /// Maximum number of steps; [`Fddp`](crate::Fddp) makes one.
        sweeps: usize,
    },
    /// Call of the solver's `feedback`.
    Feedback {
        /// Measured state.
        x0: Numbers,
        /// Maximum number of iterations; [`InteriorPoint`](crate::InteriorPoint) makes one.
        most: usize,
    },
    /// Call of [`Problem::shift`], and then of the solver's `shift`.
    Shift {
        /// Index of the new last knot's model.
        last: usize,
    },
    /// Change of the solver's settings.
    Configure {
        /// All settings.
        settings: Box<SolverSettings>,
    },
    /// Call of the solver's `set_multipliers`.
    SetMultipliers {
        /// Name of the limit.
        name: String,
        /// Multipliers of each knot.
        values: Vec<Numbers>,
    },
    /// Call of the solver's `solve`.
    Solve {
        /// States of the warm start.
        xs: Numbers,
        /// Controls of the warm start.
        us: Numbers,
    },
    /// Call of the solver's `resume`.
    Resume,
    /// Call of [`Fddp::resume_to_full_step`](crate::Fddp::resume_to_full_step).
    ResumeToFullStep {
        /// Maximum number of iterations.
        most: usize,
    },
    /// Call of [`InteriorPoint::tick`](crate::InteriorPoint::tick).
    Tick {
        /// Maximum number of steps.
        sweeps: usize,
    },
}

/// Changes of a contact's target and gains; `None` keeps the old value.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactChange {
    /// Pose of the target.
    pub placement: Option<Se3<f64>>,
    /// Velocity of the target.
    pub velocity: Option<Motion<f64>>,
    /// Acceleration of the target.
    pub acceleration: Option<Motion<f64>>,
    /// Position gain for all axes, and for each axis.
    pub kp: Option<(f64, Option<[f64; 6]>)>,
    /// Velocity gain.
    pub kd: Option<f64>,
}

impl ContactChange {
    /// Changes a contact.
    pub fn apply(&self, to: &mut ContactConstraint) {
        let target = &mut to.target;
        target.placement = self.placement.unwrap_or(target.placement);
        target.velocity = self.velocity.unwrap_or(target.velocity);
        target.acceleration = self.acceleration.unwrap_or(target.acceleration);
        (to.kp, to.kp_axes) = self.kp.unwrap_or((to.kp, to.kp_axes));
        to.kd = self.kd.unwrap_or(to.kd);
    }
}

impl AsRef<[f64]> for Numbers {
    fn as_ref(&self) -> &[f64] {
        self
    }
}

impl Call {
    /// Returns whether the call runs the solver, and so ends a tick.
    pub fn solves(&self) -> bool {
        let solves = matches!(self, Self::Solve { .. } | Self::Resume | Self::ResumeToFullStep { .. });
        solves || matches!(self, Self::Tick { .. } | Self::Feedback { .. })
    }

    /// Makes the call.
    ///
    /// # Errors
    /// The errors of the function that is called.
    pub fn make(&self, problem: &mut Problem, solver: &mut RecordedSolver) -> Result<(), Error> {
        match self {
            Self::SetX0 { x0 } => problem.set_x0(x0),
            Self::SetReferences { name, values } => problem.set_references(name, values).map(drop),
            Self::SetPlacements { name, values } => {
                let placements: Vec<_> = values.chunks(16).map(placement).collect();
                problem.set_placements(name, &placements).map(drop)
            }
            Self::SetWeight { name, weight } => problem.change_costs(name, |cost| cost.set_weight(*weight)).map(drop),
            Self::SetWeights { name, weights } => problem.set_weights(name, weights).map(drop),
            Self::SetEntryWeights { name, weights } => problem.set_entry_weights(name, weights).map(drop),
            Self::SetParameter { name, values } => problem.set_parameter(&name.parse()?, values),
            Self::SetContact { contact, change } => {
                problem.change_contacts(contact, |contact| change.apply(contact)).map(drop)
            }
            Self::SetCosts { knot, costs } => problem.set_costs(*knot, costs.clone()).map(drop),
            Self::SetKnot { knot, model } => {
                Error::check_size("knot", *knot, problem.horizon() - 1)?;
                match problem.robot() {
                    Some(robot) => problem.set_knot(*knot, model.build(&robot)?),
                    None => Ok(()),
                }
            }
            Self::SetDuration { knot, dt } => {
                Error::check_size("knot", *knot, problem.horizon() - 1)?;
                problem.set_duration(*knot, *dt)
            }
            Self::SetKnots { knot_models, durations } => problem.set_knots(knot_models, durations),
            Self::Retime { elapsed, knot_models, durations } => {
                solver.retime(problem, *elapsed, knot_models, durations)
            }
            Self::Reset { x0 } => solver.reset(problem, x0),
            Self::Prepare { sweeps } => solver.prepare(problem, *sweeps),
            Self::Shift { last } => {
                problem.shift(*last)?;
                solver.shift(problem)
            }
            Self::Configure { settings } => {
                solver.configure(settings);
                Ok(())
            }
            Self::SetMultipliers { name, values } => solver.set_multipliers(problem, name, values),
            Self::Solve { .. }
            | Self::Resume
            | Self::ResumeToFullStep { .. }
            | Self::Tick { .. }
            | Self::Feedback { .. } => solver.run(problem, self),
        }
    }
}

/// Returns the placement with the given homogeneous matrix, row by row. Missing numbers are NaN, which are refused
/// later.
fn placement(m: &[f64]) -> Se3<f64> {
    let at = |i: usize| m.get(i).copied().unwrap_or(f64::NAN);
    let column = |j: usize| Vec3::new(at(j), at(4 + j), at(8 + j));
    Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3))
}
