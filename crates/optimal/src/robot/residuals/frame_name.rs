//! Frames by their names, which mean the same frame of whatever robot a problem is of.

use condyle_dynamics::{Frame, FrameKind, Model};

/// Frame by its name. Its number is looked up in the robot for which an action is made, which refuses a name that is
/// unknown there.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::FrameName;
/// let arm = robots::arm7();
/// let tool = FrameName::from("tool");
/// assert_eq!(tool.number(&arm)?, arm.frame("tool")?);
/// assert!(tool.number(&robots::quadruped()).is_err());
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct FrameName {
    /// Name.
    pub name: String,
    /// Kind that goes first where several frames have that name; otherwise as in [`Model::frame`].
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
    /// Returns the number that the frame has in a robot.
    ///
    /// # Errors
    /// [`condyle_dynamics::Error::UnknownFrame`], with the nearest name.
    pub fn number(&self, model: &Model) -> Result<usize, condyle_dynamics::Error> {
        let is_it = |frame: &Frame| frame.name == self.name && Some(frame.kind) == self.kind;
        model.frames().iter().position(is_it).map_or_else(|| model.frame(&self.name), Ok)
    }
}
