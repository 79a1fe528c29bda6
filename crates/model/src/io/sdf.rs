//! Reader of SDF, the format of Gazebo. It reads kinematics, inertias, limits, springs and loops.

mod collisions;
mod convert;
mod include;
mod inertia;
mod joints;
mod loops;
mod mimics;
mod poses;
mod reader;
mod schema;
mod scopes;
mod tidy;
mod tree;
mod values;

use super::xml::Element;
use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::WarningKind;
use include::Includes;
use reader::Reader;
use std::path::{Path, PathBuf};

/// Options for reading an SDF.
#[derive(Clone, Debug, Default)]
pub struct SdfOptions {
    /// Joint between the world and each root link. Root links are the links that no joint carries. The first root joint
    /// is named `root_joint`, the second `root_joint#2`, and so on. `None` fixes root links to the world.
    pub root_joint: Option<Joint>,
    /// Whether each warning ([`Model::warnings`]) becomes an error.
    pub strict: bool,
    /// Kinds of warnings that do not become errors, even if `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that contain packages or models, or that are a package or model themselves, for `package://` and
    /// `model://` addresses; see [`UrdfOptions`](crate::UrdfOptions).
    pub packages: Vec<PathBuf>,
    /// Whether an axis with a `<mimic>` follows another axis ([`Mimic`](crate::Mimic)). If not, the axis moves freely.
    pub mimic: bool,
    /// Name of the model that is read. `None` reads all models of the file into one robot.
    pub model: Option<String>,
}

impl Model {
    /// Reads an SDF file. Its version may be 1.0, or 1.2 to 1.12.
    ///
    /// An older version is converted by the rules of the format's own library. Up to version 1.4, an axis is given in
    /// the model's frame. In versions 1.5 and 1.6, it is given in the joint's frame, unless `use_parent_model_frame` is
    /// true. In later versions, it is given in the frame that `expressed_in` names.
    ///
    /// **Models.** All models of a file, or of its first world, become one robot; [`SdfOptions::model`] selects one
    /// model instead. If there are several models, all names begin with the name of the model: `robot::arm`. Names in
    /// nested models also begin with the names of the models around them. An `<include>` is replaced by the included
    /// model. The address of this model may be a path relative to the file, or begin with `model://`, `package://` or
    /// `file://`. Models are searched in:
    /// - [`SdfOptions::packages`];
    /// - the folder of the file, its parent folder, and the folder `models` in each of these two folders;
    /// - the folders listed in GZ_SIM_RESOURCE_PATH, IGN_GAZEBO_RESOURCE_PATH, SDF_PATH, GAZEBO_MODEL_PATH and the
    ///   environment variables of ROS.
    ///
    /// If an included model of a world is not found, it is left out with a warning. If an included model inside a model
    /// is not found, this is an error.
    ///
    /// **Tree.** Joints are visited breadth first, in the order of the file: from the world, then from each root link.
    /// If the parent link of a joint cannot be reached in another way, the joint is visited from its child link. The
    /// coordinates of a joint visited in this direction stay the same, except for a ball joint. Links that are joined
    /// to the world, links of static models, and root links without a root joint stay at their poses in the file. With
    /// a root joint, q is the pose of the root link in the world.
    ///
    /// **Loops.** A joint whose child link already has a parent closes a loop. The joint becomes a constraint with the
    /// joint's name in [`constraints`](Self::constraints). A fixed joint constrains two frames, and a ball joint
    /// constrains two points. A revolute joint makes two constraints, for two points 1 m apart on its axis; the second
    /// constraint is named `name#2`. One of the six rows of these two constraints is redundant, so their equations must
    /// be solved with damping. A universal joint constrains only its point. Prismatic and screw joints are left out. A
    /// gearbox becomes a coupling of two joints. Motions that are not constrained are reported in
    /// [`warnings`](Self::warnings).
    ///
    /// **Joints.** `revolute` has one coordinate, with or without limits ([`Joint::Revolute`]). `continuous` has q =
    /// [cos, sin], as in a URDF. `ball` is [`Joint::Spherical`]. `universal` and `revolute2` become two revolute
    /// joints, with a body `child#1` between them; the first joint is named `name#1`. `screw` is [`Joint::Helical`],
    /// with the pitch of `screw_thread_pitch` or the older `thread_pitch`. The frame of the model's body is the frame
    /// of the joint. The child link is a separate frame ([`FrameKind::Link`](crate::FrameKind::Link)); the two frames
    /// differ by the joint's `<pose>`. Siblings are numbered in the order of the file. Damping, friction and springs
    /// are stored. Drake's `drake:rotor_inertia` and `drake:gear_ratio` determine the armature.
    ///
    /// **Poses** may be `relative_to` links, joints, frames and models. `<frame>` elements and nested models become
    /// frames of kind [`FrameKind::User`](crate::FrameKind::User).
    ///
    /// **Inertias.** A link without `<inertial>` has SDF's default values, 1 kg and 1 kg m², and causes a warning. With
    /// `auto="true"`, the inertia is computed from the collision shapes: boxes, spheres, ellipsoids, cylinders, cones
    /// and capsules. If `<gravity>` of a link is false, its weight is compensated:
    /// [`gravity_compensation`](Self::gravity_compensation).
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), [`Error::Strict`], or
    /// an error of [`ModelBuilder::build`](crate::ModelBuilder::build). The limits of files are listed in the [crate
    /// documentation](crate#limits-of-files).
    pub fn from_sdf(path: impl AsRef<Path>, options: &SdfOptions) -> Result<Self, Error> {
        let mut includes = Includes::new(&options.packages);
        let root = includes.file(path.as_ref(), 1)?;
        model(&root, includes, options)
    }

    /// Reads an SDF from a string. The string cannot include files by relative paths; see [`from_sdf`](Self::from_sdf).
    ///
    /// ```
    /// use condyle_model::{Model, SdfOptions};
    /// let sdf = r#"<sdf version="1.7"><model name="pendulum">
    ///   <link name="base"/>
    ///   <link name="rod"><inertial><pose>0 0 -1 0 0 0</pose><mass>2</mass></inertial></link>
    ///   <joint name="foot" type="fixed"><parent>world</parent><child>base</child></joint>
    ///   <joint name="pivot" type="revolute"><parent>base</parent><child>rod</child>
    ///     <axis><xyz>0 1 0</xyz></axis></joint>
    /// </model></sdf>"#;
    /// let pendulum = Model::from_sdf_str(sdf, &SdfOptions::default())?;
    /// assert_eq!((pendulum.nq(), pendulum.nv()), (1, 1));
    /// let error = Model::from_sdf_str(&sdf.replace(">rod<", ">bar<"), &SdfOptions::default()).unwrap_err();
    /// let expected = "<string>:5: joint `pivot`: no link, joint or frame is named `bar`; nearest is `base`";
    /// assert_eq!(error.to_string(), expected);
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`from_sdf`](Self::from_sdf).
    pub fn from_sdf_str(text: &str, options: &SdfOptions) -> Result<Self, Error> {
        let mut includes = Includes::new(&options.packages);
        let root = includes.string(text)?;
        model(&root, includes, options)
    }
}

/// Builds the robot of a file in which all includes have been replaced.
fn model(root: &Element, includes: Includes, options: &SdfOptions) -> Result<Model, Error> {
    let Includes { mut warnings, missing, .. } = includes;
    let (world, others) = (root.child("world"), root.all("world").skip(1));
    warnings.extend(others.map(|other| other.left_out("is not the first world of the file, and is left out")));
    let mut models: Vec<&Element> = root.all("model").chain(world.into_iter().flat_map(|w| w.all("model"))).collect();
    if models.is_empty() {
        return Err(missing.unwrap_or_else(|| root.wrong("has no model")));
    }
    let mut around = world.unwrap_or(root);
    let name = |model: &Element| model.attribute("name").unwrap_or_default().to_owned();
    if let Some(wanted) = &options.model {
        let names: Vec<String> = models.iter().map(|model| format!("`{}`", name(model))).collect();
        models.retain(|model| model.attribute("name") == Some(wanted));
        if models.is_empty() {
            return Err(root.wrong(format!("no model is named `{wanted}`; there are {}", names.join(", "))));
        }
        let joints = around.all("joint");
        warnings.extend(joints.map(|joint| joint.left_out("is left out: it is the world's, and one model is read")));
        around = root;
    }
    let called = match (&*models, world) {
        ([_, _, ..], Some(world)) => name(world),
        (all, _) => name(all[0]),
    };
    let mut reader = Reader::new(around, &models, warnings)?;
    let gravity = world.and_then(|w| w.child("gravity")).filter(|g| !g.text.trim().is_empty());
    let gravity = gravity.map(|g| values::three(g, g)).transpose()?;
    let mut model = reader.build(&called, gravity, options)?;
    model.warnings.append(&mut reader.warnings);
    root.accepted(model, options.strict, &options.allow)
}
