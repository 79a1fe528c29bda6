//! Errors of a problem, a warm start or the settings, which are found before a solve begins.

/// Error of a problem, a warm start or the settings.
///
/// The outcome of a solve is not an error: see [`Status`](crate::Status).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The horizon has no knot before the terminal one.
    #[error("the horizon is empty: a problem needs at least one knot before the terminal one")]
    EmptyHorizon,

    /// The states have no entries, so nothing can be controlled. An example is a robot with only fixed joints.
    #[error("the states have no numbers: a problem needs at least one")]
    EmptyState,

    /// A knot has the index of an action model that the problem does not contain.
    #[error("knot {knot}: there is no action model {index}, the problem holds {models}")]
    UnknownModel {
        /// Knot that uses the model.
        knot: usize,
        /// Index of the model.
        index: usize,
        /// Number of models in the problem.
        models: usize,
    },

    /// A model that may serve only the terminal knot is used at an earlier knot.
    #[error(
        "knot {knot}: models[{index}] has no next state, as an action of the end; a running one has a duration or an impact"
    )]
    NoNextState {
        /// Index of the knot.
        knot: usize,
        /// Index of the model.
        index: usize,
    },

    /// The terminal model has controls, which only earlier knots may have.
    #[error("terminal: expected an action without controls (a robot's has no duration), found one of nu = {nu}")]
    TerminalControls {
        /// Number of controls of the terminal model.
        nu: usize,
    },

    /// A problem cannot be copied, because one of its actions cannot be copied.
    #[error("{}: cannot be copied, as its `try_clone` returns `None`", model_name(*.model))]
    NoCopy {
        /// Index of the model; `None` for the terminal one.
        model: Option<usize>,
    },

    /// A solver cannot resume, because it has no solution yet.
    #[error("resume: there is no solution to go on from; call solve first")]
    NothingToResume,

    /// A call of `feedback` has no prepared iteration: `prepare` was not called, or another call has used its result.
    #[error("feedback: nothing is prepared; call prepare first, for each feedback")]
    NothingPrepared,

    /// A dimension of one knot's action model differs from the dimension that the problem or the solver expects.
    #[error("knot {knot}: expected {name} = {expected}, found {found}")]
    Dimension {
        /// Index of the knot; N for the terminal one.
        knot: usize,
        /// Name of the dimension: `nx`, `ndx`, `nu`, or the name of the bounds with a wrong length.
        name: &'static str,
        /// Dimension that the problem or the solver expects.
        expected: usize,
        /// Dimension of the action model.
        found: usize,
    },

    /// A vector or a horizon has a wrong length.
    #[error("`{name}`: expected length {expected}, found {found}")]
    Length {
        /// Name of the argument with the fault.
        name: &'static str,
        /// Expected length.
        expected: usize,
        /// Length of the given argument.
        found: usize,
    },

    /// An entry of the initial state or of the warm start is infinite or NaN.
    #[error("`{name}[{index}]` is {value}, which is not finite")]
    NotFinite {
        /// Name of the argument with the fault.
        name: &'static str,
        /// Index of the entry in the flat list of all states or controls.
        index: usize,
        /// Value of the entry.
        value: f64,
    },

    /// A state is invalid for the robot.
    #[error("`{name}`, knot {knot}: {what}")]
    State {
        /// Name of the argument with the fault.
        name: &'static str,
        /// Index of the knot.
        knot: usize,
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// A size exceeds its limit. The limits bound the memory use.
    #[error("{name}: {found} is more than the limit of {most}")]
    Size {
        /// Name of the limited size.
        name: &'static str,
        /// Size that was found.
        found: usize,
        /// Largest allowed size.
        most: usize,
    },

    /// No control satisfies the bounds of a knot.
    #[error("knot {knot}: control {control} must be at least {lower} and at most {upper}")]
    Bounds {
        /// Index of the knot.
        knot: usize,
        /// Index of the control's entry.
        control: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },

    /// No value satisfies the bounds of a constraint.
    #[error("knot {knot}: constraint {row} must be at least {lower} and at most {upper}")]
    Constraint {
        /// Index of the knot.
        knot: usize,
        /// Index of the constraint's row.
        row: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },

    /// A placement of a geometry is not a rotation with a finite translation.
    #[error("geometry `{name}`, knot {knot}: its placement is not a rotation with a finite translation")]
    Placement {
        /// Name of the geometry.
        name: String,
        /// Index of the knot.
        knot: usize,
    },
    /// A cost term does not fit the robot.
    #[error("cost `{name}`: {what}")]
    Cost {
        /// Name of the cost term.
        name: String,
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// A value of a parameter does not fit the problem.
    #[error("parameter `{name}`: {what}")]
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Description of the fault.
        what: String,
    },

    /// A limit does not fit the robot.
    #[error("limit `{name}`{}: {what}", at(*.knot))]
    Limit {
        /// Name of the limit.
        name: String,
        /// Index of the knot, if the limit belongs to a single knot.
        knot: Option<usize>,
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// Multipliers do not fit the limit whose name is given.
    #[error("multipliers of `{limit}`: {what}")]
    Multipliers {
        /// Given name of the limit.
        limit: String,
        /// Description of the fault: the names of all limits, or the invalid numbers.
        what: String,
    },

    /// A friction cone or a wrench cone is invalid.
    #[error("cone: {what}")]
    Cone {
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// A contact does not fit the robot, or conflicts with a contact before it.
    #[error("contact `{name}`: {what}")]
    Contact {
        /// Name of the contact.
        name: String,
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// The actuation does not fit the robot or the knot, or the robot's forward dynamics have no solution.
    #[error("actuation: {what}")]
    Actuation {
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// The duration of a knot is not positive.
    #[error("a knot of {dt} s: its duration must be above 0")]
    TimeStep {
        /// Duration (s).
        dt: f64,
    },

    /// A horizon would begin before the old one.
    #[error("a horizon that begins {elapsed} s after the old one: the time must be at least 0")]
    Elapsed {
        /// Time (s) from the beginning of the old horizon to the beginning of the new one.
        elapsed: f64,
    },

    /// The duration of a knot cannot be set, because the knot is an impact or an action without integration over time.
    #[error("knot {knot}: its action has no duration")]
    NoDuration {
        /// Index of the knot.
        knot: usize,
    },

    /// The derivatives of a solution cannot be computed, or a parameter does not exist.
    #[error("sensitivity: {what}")]
    Sensitivity {
        /// Description of the fault, including the invalid numbers.
        what: String,
    },

    /// A setting is outside its valid range.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// Name of the field of [`Settings`](crate::Settings), or `damping` or `restitution` of contacts.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// Valid range.
        allowed: &'static str,
    },
}

/// Returns the text that names the knot in an error message; empty without a knot.
fn at(knot: Option<usize>) -> String {
    knot.map_or_else(String::new, |t| format!(" of knot {t}"))
}

/// Returns the name of the faulty model, as an expression of the arguments of [`Problem::new`](crate::Problem::new).
fn model_name(model: Option<usize>) -> String {
    model.map_or_else(|| "terminal".to_owned(), |index| format!("models[{index}]"))
}

impl Error {
    /// Returns `Ok` if `found` has `expected` entries, all of them finite.
    pub(crate) fn check(name: &'static str, found: &[f64], expected: usize) -> Result<(), Self> {
        Self::check_length(name, found.len(), expected)?;
        Self::check_finite(name, found)
    }

    /// Returns `Ok` if the length of an argument is the expected one.
    pub(crate) fn check_length(name: &'static str, found: usize, expected: usize) -> Result<(), Self> {
        if found == expected { Ok(()) } else { Err(Self::Length { name, expected, found }) }
    }

    /// Returns `Ok` if `found` is at most `most`.
    pub(crate) fn check_size(name: &'static str, found: usize, most: usize) -> Result<(), Self> {
        if found > most { Err(Self::Size { name, found, most }) } else { Ok(()) }
    }

    /// Returns `Ok` if all entries are finite.
    pub(crate) fn check_finite(name: &'static str, found: &[f64]) -> Result<(), Self> {
        match found.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(Self::NotFinite { name, index, value: found[index] }),
            None => Ok(()),
        }
    }
}

/// Panics with the argument's name if its length is wrong, in debug and release builds. A wrong length is a fault of
/// the calling program.
#[track_caller]
pub(crate) fn assert_length(name: &str, found: usize, expected: usize) {
    assert!(found == expected, "`{name}` has length {found}, expected {expected}");
}
