//! Robots from URDF: kinematics, inertias, limits. Meshes are never looked at.

mod elements;
mod joints;
mod known;
mod origin;
mod reader;
mod transmission;

use super::files;
use super::xml::{Amount, Element};
use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::WarningKind;
use reader::Reader;
use std::path::{Path, PathBuf};

/// Options of reading a URDF.
#[derive(Clone, Debug, Default)]
pub struct UrdfOptions {
    /// The joint between the world and the root link, named `root_joint`; none fixes the root link to the world.
    pub root_joint: Option<Joint>,
    /// Whether joints with a `<mimic>` share the coordinate of the joint they follow, instead of having their own; see
    /// [`Mimic`].
    pub mimic: bool,
    /// Whether a warning ([`Model::warnings`]) is an error.
    pub strict: bool,
    /// Kinds of warnings that are no errors, though `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that have packages in them, or are packages, for `package://` addresses; before those that the
    /// environment names in `ROS_PACKAGE_PATH` and, with `/share` behind them, in `AMENT_PREFIX_PATH`.
    pub packages: Vec<PathBuf>,
}

impl Model {
    /// Reads a URDF file, given by its path or as `package://name/path/in/the/package`
    /// ([`UrdfOptions::packages`]).
    ///
    /// Shapes are not read, and the meshes that they name need not be there. Versions 1.0 to 1.2 are; where there is
    /// none, 1.0, in which an `<origin>` has no quaternion.
    /// Fixed joints are merged into the body that they sit on and stay as frames; siblings are numbered in the order of
    /// their joints' names (bytes), as Pinocchio does.
    ///
    /// # Errors
    /// [`Error::Package`], [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), and what
    /// [`ModelBuilder::build`] finds. What a file may have at most stands at the [beginning](crate#limits-of-files).
    pub fn from_urdf(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Self, Error> {
        let path = files::locate(path.as_ref(), &options.packages)?;
        let mut amount = Amount::default();
        let text = amount.read(&path)?;
        Reader::new(&Element::parse(&text, &path.display().to_string(), &mut amount)?)?.model(options)
    }

    /// Reads a URDF from a string; see [`from_urdf`](Self::from_urdf).
    ///
    /// ```
    /// use condyle_model::{Model, UrdfOptions};
    /// let urdf = r#"<robot name="pendulum">
    ///   <link name="base"/>
    ///   <link name="rod"><inertial><origin xyz="0 0 -1"/><mass value="2"/>
    ///     <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
    ///   <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
    /// </robot>"#;
    /// let pendulum = Model::from_urdf_str(urdf, &UrdfOptions::default())?;
    /// assert_eq!((pendulum.nq(), pendulum.nv()), (2, 1)); // (cos, sin) and one speed
    /// let error = Model::from_urdf_str(&urdf.replace("rod\"/>", "bar\"/>"), &UrdfOptions::default()).unwrap_err();
    /// assert_eq!(error.to_string(), "<string>:5: joint `pivot`: no link is named `bar`; nearest is `base`");
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`from_urdf`](Self::from_urdf).
    pub fn from_urdf_str(text: &str, options: &UrdfOptions) -> Result<Self, Error> {
        Reader::new(&Element::parse(text, "<string>", &mut Amount::default())?)?.model(options)
    }
}
