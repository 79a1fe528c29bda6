//! Errors in the description of a robot.

use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// Error in the description of a robot, or in a name that was looked up in it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be read, or it cannot be a robot's file: it is not a regular file, or it is too large.
    #[error("{file}: {what}")]
    File {
        /// Path as given, or `<string>`.
        file: String,
        /// Message of the operating system, or the size with the limit.
        what: String,
    },
    /// The file of a `package://` address was found in no folder.
    #[error("{address}: no such file in a package `{package}`; {}", where_looked(looked))]
    Package {
        /// Address as given.
        address: String,
        /// Name of the package.
        package: String,
        /// Paths at which the file was looked for.
        looked: Vec<String>,
    },
    /// The text is not XML.
    #[error("{file}:{line}: not well-formed XML: {what}")]
    Xml {
        /// Path of the file, or `<string>`.
        file: String,
        /// Line number, from 1.
        line: u32,
        /// Message of the parser.
        what: String,
    },
    /// An element of a URDF, MJCF or SDF is invalid.
    #[error("{file}{}: {element}: {what}", colon(*.line))]
    Element {
        /// Path of the file, or `<string>`; the included file if the element is in one.
        file: String,
        /// Line on which the element, or its invalid part, begins; from 1, or 0 if the text is no file.
        line: u32,
        /// Element, for example ``joint `elbow` ``.
        element: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A model would be larger than allowed.
    #[error("{found} {what}, at most {limit} are allowed in a model")]
    Size {
        /// Counted things, for example `degrees of freedom`.
        what: &'static str,
        /// Number that the model would have.
        found: usize,
        /// Maximum allowed number.
        limit: usize,
    },
    /// A body given to a builder is invalid.
    #[error("body `{body}`: {what}")]
    Body {
        /// Name of the body.
        body: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A joint given to a builder is invalid.
    #[error("joint `{joint}`: {what}")]
    Joint {
        /// Name of the joint.
        joint: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A frame is invalid.
    #[error("frame `{frame}`: {what}")]
    Frame {
        /// Name of the frame.
        frame: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A gravity is infinite or not a number.
    #[error("gravity: ({}, {}, {}) m/s² is not finite", gravity[0], gravity[1], gravity[2])]
    Gravity {
        /// Acceleration as given (m/s²).
        gravity: [f64; 3],
    },
    /// A position is not a valid position of the robot.
    #[error("joint `{joint}`: {what}")]
    Position {
        /// Name of the joint.
        joint: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A velocity is not a valid velocity of the robot.
    #[error("joint `{joint}`: {what}")]
    Velocity {
        /// Name of the joint.
        joint: String,
        /// Fault, with the numbers.
        what: String,
    },
    /// A list in a model's file is too short or too long.
    #[error("{name}: expected {expected} entries, found {found}")]
    Length {
        /// Name of the list, for example `limits.lower`.
        name: &'static str,
        /// Required number of entries.
        expected: usize,
        /// Actual number of entries.
        found: usize,
    },
    /// A constraint is invalid.
    #[error("constraint {constraint}: {what}")]
    Constraint {
        /// Index of the constraint, from 0.
        constraint: usize,
        /// Fault, with the numbers.
        what: String,
    },
    /// The ground of a simulation is invalid.
    #[error("ground: {what}")]
    Ground {
        /// Fault, with the names and the numbers.
        what: String,
    },
    /// A strict loader found something that is a warning otherwise.
    #[error("{}{warning}", file_of(file, warning))]
    Strict {
        /// Path of the file, or `<string>`.
        file: String,
        /// Warning that a loader reports if it is not strict.
        warning: Warning,
    },
    /// Two bodies, joints or frames of one kind have the same name.
    #[error("two {} are named `{name}`", plural(kind))]
    Duplicate {
        /// Kind: `body`, `joint` or `frame`.
        kind: &'static str,
        /// Name that occurs twice.
        name: String,
    },
    /// No frame has this name.
    #[error("unknown frame `{name}`{}", near_or(nearest, "; no frame has a similar name"))]
    UnknownFrame {
        /// Name as given.
        name: String,
        /// Most similar existing name; empty if no name is similar.
        nearest: String,
    },
    /// No joint has this name.
    #[error("unknown joint `{name}`{}", near_or(nearest, "; no joint has a similar name"))]
    UnknownJoint {
        /// Name as given.
        name: String,
        /// Most similar existing name; empty if no name is similar.
        nearest: String,
    },
}

/// Returns the begin of the message of [`Error::Strict`]: the file, unless the warning names it.
fn file_of(file: &str, warning: &Warning) -> String {
    if warning.place().is_some() { String::new() } else { format!("{file}: ") }
}

/// Returns the end of the message of [`Error::Package`].
fn where_looked(looked: &[String]) -> String {
    if looked.is_empty() {
        return "there are no folders to look in (`packages`, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH)".to_owned();
    }
    format!("looked for {}", looked.join(", "))
}

/// Returns a line number after a colon, or nothing for 0.
fn colon(line: u32) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}

/// Returns the end of a message about an unknown name: the nearest name, or `otherwise` if no name is near.
pub(crate) fn near_or(nearest: &str, otherwise: &str) -> String {
    if nearest.is_empty() { otherwise.to_owned() } else { format!("; nearest is `{nearest}`") }
}

fn plural(kind: &str) -> String {
    kind.strip_suffix('y').map_or_else(|| format!("{kind}s"), |stem| format!("{stem}ies"))
}
