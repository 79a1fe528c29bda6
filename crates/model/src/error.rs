//! Errors in a robot's description.

use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

/// An error in a robot's description, or in a name that was looked up in it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be read, or cannot be a robot's: it is no regular file, or too large.
    #[error("{file}: {what}")]
    File {
        /// Path as given, or `<string>`.
        file: String,
        /// The operating system's word, or the size with the limit.
        what: String,
    },
    /// No folder has the file that a `package://` address names.
    #[error("{address}: no such file in a package `{package}`; {}", where_looked(looked))]
    Package {
        /// As given.
        address: String,
        /// The package's name.
        package: String,
        /// The places at which it was looked for.
        looked: Vec<String>,
    },
    /// The text is not XML.
    #[error("{file}:{line}: not well-formed XML: {what}")]
    Xml {
        /// Path, or `<string>`.
        file: String,
        /// Counted from 1.
        line: u32,
        /// The parser's word.
        what: String,
    },
    /// An element of a URDF, MJCF or SDF is wrong.
    #[error("{file}:{line}: {element}: {what}")]
    Element {
        /// Path, or `<string>`; of the included file, where it is in one.
        file: String,
        /// The line on which the element begins, or the part of it that is wrong, counted from 1.
        line: u32,
        /// For example ``joint `elbow` ``.
        element: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A model would have more of something than a model can have.
    #[error("{found} {what}, at most {limit} are allowed in a model")]
    Size {
        /// The things that are counted, for example `degrees of freedom`.
        what: &'static str,
        /// The number that the model would have.
        found: usize,
        /// The greatest number that is allowed.
        limit: usize,
    },
    /// A body given to a builder is wrong.
    #[error("body `{body}`: {what}")]
    Body {
        /// The body's name.
        body: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A joint given to a builder is wrong.
    #[error("joint `{joint}`: {what}")]
    Joint {
        /// The joint's name.
        joint: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A frame is wrong.
    #[error("frame `{frame}`: {what}")]
    Frame {
        /// The frame's name.
        frame: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A gravity is infinite or not a number.
    #[error("gravity: ({}, {}, {}) m/s² is not finite", gravity[0], gravity[1], gravity[2])]
    Gravity {
        /// The acceleration as given (m/s²).
        gravity: [f64; 3],
    },
    /// A position is none of the robot's.
    #[error("joint `{joint}`: {what}")]
    Position {
        /// The joint's name.
        joint: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A velocity is none of the robot's.
    #[error("joint `{joint}`: {what}")]
    Velocity {
        /// The joint's name.
        joint: String,
        /// The fault, with the numbers.
        what: String,
    },
    /// A list in a model's file is too short or too long.
    #[error("{name}: expected {expected} entries, found {found}")]
    Length {
        /// The name of the list, for example `limits.lower`.
        name: &'static str,
        /// The number of entries that it must have.
        expected: usize,
        /// The number of entries that it has.
        found: usize,
    },
    /// A constraint cannot be.
    #[error("constraint {constraint}: {what}")]
    Constraint {
        /// The constraint's number, counted from 0.
        constraint: usize,
        /// The fault, with the numbers.
        what: String,
    },
    /// The ground of a simulation cannot be.
    #[error("ground: {what}")]
    Ground {
        /// The fault, with the names and the numbers.
        what: String,
    },
    /// A strict loader met what is only odd.
    #[error("{file}: {warning}")]
    Strict {
        /// Path, or `<string>`.
        file: String,
        /// The warning.
        warning: Warning,
    },
    /// Two bodies, joints or frames of one kind have the same name.
    #[error("two {} are named `{name}`", plural(kind))]
    Duplicate {
        /// `body`, `joint` or `frame`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// No frame has this name.
    #[error("unknown frame `{name}`{}", near_or(nearest, "; no frame has a similar name"))]
    UnknownFrame {
        /// As asked for.
        name: String,
        /// The most similar name there is; empty if none is similar.
        nearest: String,
    },
    /// No joint has this name.
    #[error("unknown joint `{name}`{}", near_or(nearest, "; no joint has a similar name"))]
    UnknownJoint {
        /// As asked for.
        name: String,
        /// The most similar name there is; empty if none is similar.
        nearest: String,
    },
}

/// The end of the message of [`Error::Package`].
fn where_looked(looked: &[String]) -> String {
    if looked.is_empty() {
        return "there are no folders to look in (`packages`, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH)".to_owned();
    }
    format!("looked for {}", looked.join(", "))
}

/// The end of a message about a name that is not there: the nearest one, or what is said if there is none.
pub(crate) fn near_or(nearest: &str, otherwise: &str) -> String {
    if nearest.is_empty() { otherwise.to_owned() } else { format!("; nearest is `{nearest}`") }
}

fn plural(kind: &str) -> String {
    kind.strip_suffix('y').map_or_else(|| format!("{kind}s"), |stem| format!("{stem}ies"))
}
