//! Warnings about a robot. The description of the robot is valid, but an item is unusual, left out, or replaced by a
//! default value.

use crate::error::near_or;
use crate::names::nearest;
use alloc::format;
use alloc::string::String;
use core::fmt;
use core::str::FromStr;

/// Warning about a model or its file. Loaders collect warnings. Strict loaders refuse a model with warnings.
///
/// ```
/// use condyle_model::{Model, SdfOptions, WarningKind};
/// let sdf = r#"<sdf version="1.7"><model name="m"><link name="a"/></model></sdf>"#;
/// let model = Model::from_sdf_str(sdf, &SdfOptions::default())?;
/// let warning = &model.warnings()[0];
/// assert_eq!(warning.kind(), WarningKind::Assumed);
/// assert_eq!(warning.to_string(), "<string>:1: link `a`: has no <inertial>: 1 kg and 1 kg m², as SDF has it");
/// let options = SdfOptions { strict: true, allow: vec!["assumed".parse()?], ..SdfOptions::default() };
/// assert!(Model::from_sdf_str(sdf, &options).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Warning {
    /// A moving body has neither mass nor inertia.
    Massless {
        /// Name of the body.
        body: String,
    },
    /// A body's rotational inertia about its centre of mass has a negative principal moment.
    Negative {
        /// Name of the body.
        body: String,
        /// Smallest moment (kg m²).
        moment: f64,
    },
    /// One principal moment is larger than the sum of the other two. No mass distribution has such an inertia.
    Triangle {
        /// Name of the body.
        body: String,
        /// Principal moments (kg m²), smallest first.
        moments: [f64; 3],
    },
    /// No body that a joint moves has inertia along the joint. So the inertia matrix is singular, and forward dynamics
    /// has no solution.
    Singular {
        /// Name of the joint.
        joint: String,
    },
    /// A body's inertia is possible but implausible.
    Unlikely {
        /// Name of the body.
        body: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// The limits of a joint are possible, but the joint cannot work with them.
    Limit {
        /// Name of the joint.
        joint: String,
        /// Description of the fault, with the numbers.
        what: String,
    },
    /// An element or attribute of a file is unknown, misspelt or misplaced, and has no effect.
    Unknown {
        /// Position in the file; `None` if there is no file.
        place: Option<Place>,
        /// Element with its name, for example ``joint `elbow` ``.
        element: String,
        /// Unknown name, and the nearest known name.
        what: String,
    },
    /// A model cannot represent a feature of the file.
    LeftOut {
        /// Position in the file; `None` if there is no file.
        place: Option<Place>,
        /// Element with its name, for example ``joint `loop` ``.
        element: String,
        /// Feature that is left out, and the consequence of the omission.
        what: String,
    },
    /// A value is missing in the file, and a default is used.
    Assumed {
        /// Position in the file; `None` if there is no file.
        place: Option<Place>,
        /// Element with its name, for example ``link `base` ``.
        element: String,
        /// Name of the missing value, and its default.
        what: String,
    },
    /// A joint that could follow another joint moves freely.
    Mimic {
        /// Position in the file; `None` if there is no file.
        place: Option<Place>,
        /// Element with its name, for example ``joint `finger` ``.
        element: String,
        /// Message that names the joint that could be followed.
        what: String,
    },
}

/// Position in a robot's files.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Place {
    /// Path of the file that contains the element, which may be an included file, or `<string>`.
    pub file: String,
    /// Line, counted from 1.
    pub line: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// Kind of a [`Warning`]. A strict reader can allow some kinds. Names of kinds can be parsed: `"left_out".parse()`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum WarningKind {
    Massless,
    Negative,
    Triangle,
    Singular,
    Unlikely,
    Limit,
    Unknown,
    LeftOut,
    Assumed,
    Mimic,
}

impl WarningKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::Massless,
        Self::Negative,
        Self::Triangle,
        Self::Singular,
        Self::Unlikely,
        Self::Limit,
        Self::Unknown,
        Self::LeftOut,
        Self::Assumed,
        Self::Mimic,
    ];

    /// Returns the kind's name: `massless`, `negative`, `triangle`, `singular`, `unlikely`, `limit`, `unknown`,
    /// `left_out`, `assumed` or `mimic`.
    pub fn name(self) -> &'static str {
        let names = [
            "massless", "negative", "triangle", "singular", "unlikely", "limit", "unknown", "left_out", "assumed",
            "mimic",
        ];
        names[self as usize]
    }
}

impl fmt::Display for WarningKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for WarningKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            let near = near_or(&nearest(name, names.into_iter()), "");
            format!("`{name}` is no kind of warning{near}; expected one of {}", names.join(", "))
        })
    }
}

impl Warning {
    /// Returns the warning with a further reason.
    #[cfg(feature = "meshes")]
    pub(crate) fn because(mut self, why: &str) -> Self {
        if let Self::LeftOut { what, .. } = &mut self {
            let known = what.len();
            what.truncate(what.rfind(" (").unwrap_or(known));
            *what += &format!(" ({why})");
        }
        self
    }

    /// Returns the kind of the warning.
    pub fn kind(&self) -> WarningKind {
        match self {
            Self::Massless { .. } => WarningKind::Massless,
            Self::Negative { .. } => WarningKind::Negative,
            Self::Triangle { .. } => WarningKind::Triangle,
            Self::Singular { .. } => WarningKind::Singular,
            Self::Unlikely { .. } => WarningKind::Unlikely,
            Self::Limit { .. } => WarningKind::Limit,
            Self::Unknown { .. } => WarningKind::Unknown,
            Self::LeftOut { .. } => WarningKind::LeftOut,
            Self::Assumed { .. } => WarningKind::Assumed,
            Self::Mimic { .. } => WarningKind::Mimic,
        }
    }

    /// Returns the position in the file, if the warning is about a file.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Unknown { place, .. }
            | Self::LeftOut { place, .. }
            | Self::Assumed { place, .. }
            | Self::Mimic { place, .. } => place.as_ref(),
            _ => None,
        }
    }

    /// Returns whether the warning is about the source of a model. All other warnings are computed from the model
    /// itself.
    pub(crate) fn is_about_source(&self) -> bool {
        matches!(self.kind(), WarningKind::Unknown | WarningKind::LeftOut | WarningKind::Assumed | WarningKind::Mimic)
    }

    /// Returns the name of the body or joint, or the element, to which the warning refers.
    pub fn subject(&self) -> &str {
        match self {
            Self::Massless { body }
            | Self::Negative { body, .. }
            | Self::Triangle { body, .. }
            | Self::Unlikely { body, .. } => body,
            Self::Singular { joint } | Self::Limit { joint, .. } => joint,
            Self::Unknown { element, .. }
            | Self::LeftOut { element, .. }
            | Self::Assumed { element, .. }
            | Self::Mimic { element, .. } => element,
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Massless { body } => write!(f, "body `{body}` moves and has no mass"),
            Self::Negative { body, moment } => {
                write!(f, "body `{body}`: a principal moment of inertia is {moment:e} kg m²")
            }
            Self::Triangle { body, moments } => {
                let [a, b, c] = moments.map(rounded);
                let sum = "kg m² break the triangle inequality";
                write!(f, "body `{body}`: principal moments {c} > {a} + {b} {sum}")
            }
            Self::Singular { joint } => {
                let what = "moves nothing that has inertia along it: the inertia matrix is singular";
                write!(f, "joint `{joint}` {what}")
            }
            Self::Unlikely { body, what } => write!(f, "body `{body}`: {what}"),
            Self::Limit { joint, what } => write!(f, "joint `{joint}`: {what}"),
            Self::Unknown { place, element, what }
            | Self::LeftOut { place, element, what }
            | Self::Assumed { place, element, what }
            | Self::Mimic { place, element, what } => {
                place.iter().try_for_each(|place| write!(f, "{place}: "))?;
                write!(f, "{element}: {what}")
            }
        }
    }
}

/// Returns a number rounded to 9 significant digits. Numbers in files have fewer digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.8e}").parse().unwrap_or(x)
}

impl core::error::Error for Warning {}
