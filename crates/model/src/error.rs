//! What can be wrong with a robot model.

/// What is wrong with a robot's description, or with a name that was looked up in it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be read.
    #[error("{file}: {what}")]
    File {
        /// Path as given.
        file: String,
        /// The operating system's word.
        what: String,
    },
    /// No folder has the file that a `package://` address names.
    #[error("{address}: no such file in a package `{package}`; {}", crate::io::packages::said(looked))]
    Package {
        /// As given.
        address: String,
        /// The package's name.
        package: String,
        /// Where the file would have been.
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
    /// An element of a URDF is wrong.
    #[error("{file}:{line}: {element}: {what}")]
    Urdf {
        /// Path, or `<string>`.
        file: String,
        /// Where the element begins, counted from 1.
        line: u32,
        /// For example ``joint `elbow` ``.
        element: String,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// An element of an MJCF or SDF is wrong.
    #[error("{file}:{line}: {element}: {what}")]
    Element {
        /// Path, or `<string>`; of the included file, where it is in one.
        file: String,
        /// Where the element begins, counted from 1.
        line: u32,
        /// For example ``joint `elbow` ``.
        element: String,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// A body given to a builder is wrong.
    #[error("body `{body}`: {what}")]
    Body {
        /// The body's name.
        body: String,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// A joint given to a builder is wrong.
    #[error("joint `{joint}`: {what}")]
    Joint {
        /// The joint's name.
        joint: String,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// A frame is wrong.
    #[error("frame `{frame}`: {what}")]
    Frame {
        /// The frame's name.
        frame: String,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// A list in a model's file is too short or too long.
    #[error("{name}: expected {expected} entries, found {found}")]
    Length {
        /// Of the list, for example `limits.lower`.
        name: &'static str,
        /// How many there must be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A constraint cannot be.
    #[error("constraint {constraint}: {what}")]
    Constraint {
        /// Its number, counted from 0.
        constraint: usize,
        /// What is wrong, with the numbers.
        what: String,
    },
    /// A strict loader met what is only odd.
    #[error("{file}: {warning}")]
    Strict {
        /// Path, or `<string>`.
        file: String,
        /// What is odd.
        warning: crate::validate::Warning,
    },
    /// Two bodies, joints or frames of one kind have the same name.
    #[error("two {kind}s are named `{name}`")]
    Duplicate {
        /// `body`, `joint` or `frame`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// No frame has this name.
    #[error("unknown frame `{name}`; nearest is `{nearest}`")]
    UnknownFrame {
        /// As asked for.
        name: String,
        /// The most similar name there is.
        nearest: String,
    },
    /// No joint has this name.
    #[error("unknown joint `{name}`; nearest is `{nearest}`")]
    UnknownJoint {
        /// As asked for.
        name: String,
        /// The most similar name there is.
        nearest: String,
    },
}
