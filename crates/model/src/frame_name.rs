//! Names of frames, which do not depend on a particular robot.

use crate::body::{Frame, FrameKind};
use crate::error::Error;
use crate::model::Model;
use alloc::borrow::ToOwned;
use alloc::string::String;

/// Name of a frame. When an action is created, it looks up the index of the frame in its robot. An unknown name is an
/// error.
///
/// ```
/// use condyle_model::{FrameName, robots};
/// let arm = robots::arm7();
/// let tool = FrameName::from("tool");
/// assert_eq!(tool.number(&arm)?, arm.frame("tool")?);
/// assert!(tool.number(&robots::quadruped()).is_err());
/// # Ok::<(), condyle_model::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct FrameName {
    /// Name of the frame.
    pub name: String,
    /// Kind of the frame, needed if several frames have the same name. Without a kind, or if no frame has this kind,
    /// [`Model::frame`] chooses the frame.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub kind: Option<FrameKind>,
}

impl From<&str> for FrameName {
    fn from(name: &str) -> Self {
        Self { name: name.to_owned(), kind: None }
    }
}

impl From<&Frame> for FrameName {
    fn from(frame: &Frame) -> Self {
        Self { name: frame.name.clone(), kind: Some(frame.kind) }
    }
}

impl FrameName {
    /// Returns the index of the frame in a robot.
    ///
    /// # Errors
    /// [`Error::UnknownFrame`], whose message contains the most similar name.
    pub fn number(&self, model: &Model) -> Result<usize, Error> {
        let is_it = |frame: &Frame| frame.name == self.name && Some(frame.kind) == self.kind;
        model.frames().iter().position(is_it).map_or_else(|| model.frame(&self.name), Ok)
    }
}
