//! Reader of URDF. It reads kinematics, inertias and limits, and never opens meshes.

mod collisions;
mod elements;
mod joints;
mod known;
mod origin;
mod reader;
mod transmission;
#[cfg(feature = "urdf-rs")]
mod urdf_rs;
mod xacro;

use super::files;
use super::xml::{Amount, Element};
use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::WarningKind;
use reader::Reader;
use std::path::{Path, PathBuf};

/// Options for reading a URDF.
#[derive(Clone, Debug, Default)]
pub struct UrdfOptions {
    /// Joint between the world and the root link. The joint is named `root_joint`. If the file already has a joint with
    /// that name, it is named `root_joint_2`, `root_joint_3`, and so on. `None` fixes the root link to the world.
    pub root_joint: Option<Joint>,
    /// Whether joints with a `<mimic>` share the coordinate of their leader; see [`Mimic`](crate::Mimic). If not, these
    /// joints have their own coordinates.
    pub mimic: bool,
    /// Whether each warning ([`Model::warnings`]) becomes an error.
    pub strict: bool,
    /// Kinds of warnings that do not become errors, even if `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that contain packages, or are packages themselves, for `package://` addresses. They are searched before
    /// the folders in the environment variable `ROS_PACKAGE_PATH`, and before `/share` in the folders of
    /// `AMENT_PREFIX_PATH`.
    pub packages: Vec<PathBuf>,
    /// Arguments for a file whose name ends in `.xacro`, by name and value (`name:=value`).
    pub arguments: Vec<(String, String)>,
}

impl Model {
    /// Reads a URDF file. `path` is a path, or an address `package://name/path/in/the/package`
    /// ([`UrdfOptions::packages`]).
    ///
    /// The child link of a fixed joint is merged into the body that carries the joint, and a frame remains at its pose.
    /// Siblings are numbered in the order of their joints' names (compared as bytes), as in Pinocchio. Versions 1.0 to
    /// 1.2 are supported. A file without a version number has version 1.0, in which an `<origin>` cannot have a
    /// quaternion.
    ///
    /// - A planar joint moves in the plane normal to its axis, as the format and Drake define it. A missing axis is x.
    ///   The z axis of the joint's frame is rotated to the axis by the shortest rotation. In Pinocchio, the plane is
    ///   always normal to z.
    /// - If the parent of a joint is `world` and no link has this name, the joint is attached to the world, as in
    ///   Drake. This causes a warning.
    /// - A revolute or prismatic joint needs a limit with effort and velocity. For a continuous joint, effort and
    ///   velocity are optional. A negative effort or velocity means no limit and causes a warning. So do position
    ///   limits in reverse order.
    /// - A `<transmission>` with the inertia J of a rotor (`rotorInertia`, `motorInertia`, `drake:rotor_inertia`) and a
    ///   reduction n (`mechanicalReduction`, `drake:gear_ratio`) gives the armature n² J. A reduction without an
    ///   inertia causes a warning.
    /// - `<frame>` elements of Drake become frames. The joints `ball`, `screw`, `planar` and `universal` of Drake are
    ///   supported. A universal joint becomes two revolute joints about x and y, with a body `child#1` between them;
    ///   the first joint is named `name#1`.
    /// - The damping and friction of a spherical, ball or universal joint act along each of its coordinates.
    ///
    /// An unknown, misspelt or misplaced name causes a warning, and so does each feature that a model cannot represent
    /// ([`Model::warnings`]). Some elements are ignored without a warning: shapes, materials, sensors, controllers,
    /// calibrations, soft limits of a `<safety_controller>`, and entries of `<gazebo>` about contact, appearance and
    /// numerics. Mesh files are not opened and may be missing.
    ///
    /// A file whose name ends in `.xacro` is expanded first, by the program `xacro` or, if `xacro` is not installed, by
    /// `xacrodoc`. One of these programs must be installed. The expansion may take a minute. The program receives
    /// [`UrdfOptions::arguments`] and the folders of packages (`ROS_PACKAGE_PATH`). xacro evaluates Python expressions,
    /// so expand only files that you trust. Line numbers in messages refer to the expanded text.
    ///
    /// # Errors
    /// Returns [`Error::Package`], [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element),
    /// or an error of [`ModelBuilder::build`](crate::ModelBuilder::build). The limits of files are listed in the [crate
    /// documentation](crate#limits-of-files).
    pub fn from_urdf(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Self, Error> {
        let path = files::locate(path.as_ref(), &options.packages)?;
        let name = path.display().to_string();
        if xacro::is_xacro(&path) {
            return Self::from_urdf_text(&Self::expand_xacro(&path, options)?, &format!("{name} (expanded)"), options);
        }
        check_arguments(&name, options)?;
        let mut amount = Amount::default();
        let text = amount.read(&path)?;
        Reader::new(&Element::parse(&text, &name, &mut amount)?)?.model(options)
    }

    /// Returns the URDF to which a xacro file expands.
    #[doc(hidden)]
    pub fn expand_xacro(path: &Path, options: &UrdfOptions) -> Result<String, Error> {
        Amount::default().read(path)?; // checks the size and kind of the file
        xacro::expand(path, &options.arguments, &options.packages)
    }

    /// Reads a URDF from a string. Errors and warnings use the value of `file` as its file name.
    #[doc(hidden)]
    pub fn from_urdf_text(text: &str, file: &str, options: &UrdfOptions) -> Result<Self, Error> {
        Reader::new(&Element::parse(text, file, &mut Amount::default())?)?.model(options)
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
    /// Returns the errors of [`from_urdf`](Self::from_urdf).
    pub fn from_urdf_str(text: &str, options: &UrdfOptions) -> Result<Self, Error> {
        check_arguments("<string>", options)?;
        Self::from_urdf_text(text, "<string>", options)
    }
}

/// Returns an error if there are arguments but the file is not a xacro file.
fn check_arguments(file: &str, options: &UrdfOptions) -> Result<(), Error> {
    let what = || "has arguments of xacro, but its name does not end in `.xacro`".to_owned();
    if options.arguments.is_empty() { Ok(()) } else { Err(Error::File { file: file.to_owned(), what: what() }) }
}
