//! Errors in the description of a robot.

use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// Error in the description of a robot, or in a name that was searched in the description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be read, is not a regular file, or is too large.
    #[error("{file}: {what}")]
    File {
        /// Path as the caller gave it, or `<string>`.
        file: String,
        /// Message of the operating system, or the size of the file and the limit.
        what: String,
    },
    /// The file at a `package://` address was not found in any folder.
    #[error("{address}: no such file in a package `{package}`; {}", where_looked(looked))]
    Package {
        /// Address as it was given.
        address: String,
        /// Name of the package.
        package: String,
        /// Paths at which the file was searched.
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
        /// Path of the file that contains the element, which may be an included file, or `<string>`.
        file: String,
        /// Number of the line on which the element, or the invalid part of it, begins, counted from 1; 0 if the text is
        /// not from a file.
        line: u32,
        /// Element with its name, for example ``joint `elbow` ``.
        element: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// A model would be larger than allowed.
    #[error("{found} {what}, at most {limit} are allowed in a model")]
    Size {
        /// Name of the counted items, for example `degrees of freedom`.
        what: &'static str,
        /// Number that the model would have.
        found: usize,
        /// Maximum allowed number.
        limit: usize,
    },
    /// A body that was given to a builder is invalid.
    #[error("body `{body}`: {what}")]
    Body {
        /// Name of the body.
        body: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// A joint that was given to a builder is invalid.
    #[error("joint `{joint}`: {what}")]
    Joint {
        /// Name of the joint.
        joint: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// A frame is invalid.
    #[error("frame `{frame}`: {what}")]
    Frame {
        /// Name of the frame.
        frame: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// A component of gravity is infinite or not a number.
    #[error("gravity: ({}, {}, {}) m/s² is not finite", gravity[0], gravity[1], gravity[2])]
    Gravity {
        /// Acceleration as it was given (m/s²).
        gravity: [f64; 3],
    },
    /// A position is not a valid position of the robot.
    #[error("joint `{joint}`: {what}")]
    Position {
        /// Name of the joint.
        joint: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// A velocity is not a valid velocity of the robot.
    #[error("joint `{joint}`: {what}")]
    Velocity {
        /// Name of the joint.
        joint: String,
        /// Description of the fault, with the numbers.
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
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// The ground of a simulation is invalid.
    #[error("ground: {what}")]
    Ground {
        /// Description of the fault, with the names and the numbers.
        what: String,
    },
    /// A geometry, or a pair of geometries, is invalid.
    #[error("{geometry}: {what}")]
    Geometry {
        /// Position in the list of pairs, or name of the geometry.
        geometry: String,
        /// Description of the fault, with the field and the numbers.
        what: String,
    },
    /// A strict loader treats a warning as an error.
    #[error("{}{warning}", file_of(file, warning))]
    Strict {
        /// Path of the file, or `<string>`.
        file: String,
        /// Warning that a loader would report if it were not strict.
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
        /// Name as it was given.
        name: String,
        /// Most similar existing name; empty if no name is similar.
        nearest: String,
    },
    /// No joint has this name.
    #[error("unknown joint `{name}`{}", near_or(nearest, "; no joint has a similar name"))]
    UnknownJoint {
        /// Name as it was given.
        name: String,
        /// Most similar existing name; empty if no name is similar.
        nearest: String,
    },
}

/// Returns the beginning of the message of [`Error::Strict`]: the file name, or an empty text if the warning itself
/// names the file.
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

/// Returns a colon and a line number, or an empty text if the line number is 0.
fn colon(line: u32) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}

/// Returns the end of a message about an unknown name: the nearest known name, or `otherwise` if no known name is
/// similar.
pub(crate) fn near_or(nearest: &str, otherwise: &str) -> String {
    if nearest.is_empty() { otherwise.to_owned() } else { format!("; nearest is `{nearest}`") }
}

fn plural(kind: &str) -> String {
    kind.strip_suffix('y').map_or_else(|| format!("{kind}s"), |stem| format!("{stem}ies"))
}
