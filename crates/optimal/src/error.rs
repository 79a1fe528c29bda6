//! What can be wrong with a problem, a warm start or the settings, found before a solve begins.

/// A fault of a problem, a warm start or the settings.
///
/// How a solve *ends* is no error: see [`Status`](crate::Status).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A horizon needs at least one knot before the terminal one.
    #[error("the horizon is empty: a problem needs at least one knot before the terminal one")]
    EmptyHorizon,

    /// The actions have states without a number, as robots of fixed joints only have: there is nothing to control.
    #[error("the states have no numbers: a problem needs at least one")]
    EmptyState,

    /// A knot names an action model that the problem does not hold.
    #[error("knot {knot}: there is no action model {index}, the problem holds {models}")]
    UnknownModel {
        /// The knot that names the model.
        knot: usize,
        /// The index it names.
        index: usize,
        /// The number of models in the problem.
        models: usize,
    },

    /// A model that is made for the end of a horizon serves a knot before it.
    #[error(
        "knot {knot}: models[{index}] has no next state, as an action of the end; a running one has a duration or an impact"
    )]
    NoNextState {
        /// The knot.
        knot: usize,
        /// The index of the model.
        index: usize,
    },

    /// The terminal model has controls, as only knots before the end have.
    #[error("terminal: expected an action without controls (a robot's has no duration), found one of nu = {nu}")]
    TerminalControls {
        /// The number of its controls.
        nu: usize,
    },

    /// A problem with an action that has no copy is to be copied.
    #[error("{}: cannot be copied, as its `fork` returns `None`", model_name(*.model))]
    NoCopy {
        /// The index of the model; none for the terminal one.
        model: Option<usize>,
    },

    /// A solver is to go on from a solution that it has not.
    #[error("resume: there is no solution to go on from; call solve first")]
    NothingToResume,

    /// A dimension of one knot's action model differs from what the problem or the solver needs.
    #[error("node {node}: expected {name} = {expected}, found {found}")]
    Dimension {
        /// The knot; the horizon itself for the terminal one.
        node: usize,
        /// `nx`, `ndx`, `nu`, or which bounds.
        name: &'static str,
        /// What the problem or the solver needs.
        expected: usize,
        /// What the action model says.
        found: usize,
    },

    /// A vector or a horizon has another length than the problem needs.
    #[error("`{name}`: expected length {expected}, found {found}")]
    Length {
        /// The argument.
        name: &'static str,
        /// The length that the problem needs.
        expected: usize,
        /// The length given.
        found: usize,
    },

    /// An entry of the initial state or of the warm start is infinite or not a number.
    #[error("`{name}[{index}]` is {value}, which is not finite")]
    NotFinite {
        /// The argument.
        name: &'static str,
        /// The position in the flattened argument.
        index: usize,
        /// The entry.
        value: f64,
    },

    /// A state is none of the robot's.
    #[error("`{name}`, knot {knot}: {what}")]
    State {
        /// The argument.
        name: &'static str,
        /// The knot.
        knot: usize,
        /// The fault, with the numbers.
        what: String,
    },

    /// A number of things is beyond what memory is asked for.
    #[error("{name}: {found} is more than the limit of {most}")]
    Size {
        /// The thing that is counted.
        name: &'static str,
        /// The number.
        found: usize,
        /// The limit.
        most: usize,
    },

    /// No control satisfies the bounds of a knot.
    #[error("knot {knot}: control {control} must be at least {lower} and at most {upper}")]
    Bounds {
        /// The knot.
        knot: usize,
        /// The entry of its control.
        control: usize,
        /// Its least value.
        lower: f64,
        /// Its greatest value.
        upper: f64,
    },

    /// No value satisfies the bounds of a constraint.
    #[error("knot {knot}: constraint {row} must be at least {lower} and at most {upper}")]
    Constraint {
        /// The knot.
        knot: usize,
        /// The entry of the constraint.
        row: usize,
        /// Its least value.
        lower: f64,
        /// Its greatest value.
        upper: f64,
    },

    /// A term of a robot's cost does not fit the robot.
    #[error("cost `{name}`: {what}")]
    Cost {
        /// The term's name.
        name: String,
        /// What does not fit, with the numbers.
        what: String,
    },

    /// A limit does not fit the robot.
    #[error("limit `{name}`{}: {what}", at(*.knot))]
    Limit {
        /// The limit's name.
        name: String,
        /// The knot, if it is a limit of one.
        knot: Option<usize>,
        /// What does not fit, with the numbers.
        what: String,
    },

    /// A friction or wrench cone makes no sense.
    #[error("cone: {what}")]
    Cone {
        /// The fault, with the numbers.
        what: String,
    },

    /// A contact does not fit the robot, or the contacts before it.
    #[error("contact `{name}`: {what}")]
    Contact {
        /// The contact's name, or that of a number that all contacts share.
        name: String,
        /// What does not fit, with the numbers.
        what: String,
    },

    /// A robot's drives do not fit it, or it cannot be driven.
    #[error("actuation: {what}")]
    Actuation {
        /// What does not fit, with the numbers.
        what: String,
    },

    /// A knot's duration must be above zero.
    #[error("a knot of {dt} s: its duration must be above 0")]
    TimeStep {
        /// The duration (s).
        dt: f64,
    },

    /// A setting lies outside of the range in which it makes sense.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// The field of [`Settings`](crate::Settings).
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        allowed: &'static str,
    },
}

/// Which knot an error is about.
fn at(knot: Option<usize>) -> String {
    knot.map_or_else(String::new, |t| format!(" of knot {t}"))
}

/// The argument of [`Problem::new`](crate::Problem::new) that an error is about.
fn model_name(model: Option<usize>) -> String {
    model.map_or_else(|| "terminal".to_owned(), |index| format!("models[{index}]"))
}

impl Error {
    /// `Ok` if `found` has `expected` entries, all of them finite.
    pub(crate) fn check(name: &'static str, found: &[f64], expected: usize) -> Result<(), Self> {
        if found.len() != expected {
            return Err(Self::Length { name, expected, found: found.len() });
        }
        Self::check_finite(name, found)
    }

    /// `Ok` if there are at most so many.
    pub(crate) fn check_size(name: &'static str, found: usize, most: usize) -> Result<(), Self> {
        if found > most { Err(Self::Size { name, found, most }) } else { Ok(()) }
    }

    /// `Ok` if all entries are finite.
    pub(crate) fn check_finite(name: &'static str, found: &[f64]) -> Result<(), Self> {
        match found.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(Self::NotFinite { name, index, value: found[index] }),
            None => Ok(()),
        }
    }
}

/// Panics with the argument's name if its length is wrong: for callers inside a program, in release builds too.
#[track_caller]
pub(crate) fn assert_length(name: &str, found: usize, expected: usize) {
    assert!(found == expected, "`{name}` has length {found}, expected {expected}");
}
