//! Reader of MJCF, the format of MuJoCo. It reads kinematics, inertias, limits, actuators, keyframes and constraints.

mod actuator;
mod assets;
mod attributes;
mod beside;
#[cfg(feature = "meshes")]
mod builtin;
mod collisions;
mod compiler;
mod equality;
mod expand;
mod geometry;
mod include;
mod joint;
mod keyframe;
mod keywords;
mod law;
mod mesh;
mod options;
mod principal;
mod reference;
mod sections;
mod spring;
mod tendon;
mod transmission;
mod tree;

use super::known::Known;
use super::xml::Element;
use crate::body::FrameKind;
use crate::builder::{ModelBuilder, WORLD};
use crate::error::Error;
use crate::model::Model;
use crate::warning::{Warning, WarningKind};
use assets::{Assets, Solids};
use attributes::{Attributes, Defaults};
use compiler::Compiler;
use condyle_spatial::{Se3, Vec3};
use include::Files;
use spring::Joints;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tree::Placed;

/// Known elements and attributes of MJCF, by parent, up to MuJoCo 4.0.
const ELEMENTS: &str = include_str!("mjcf/elements.txt");

/// Options for reading an MJCF.
#[derive(Clone, Debug, Default)]
pub struct MjcfOptions {
    /// Whether each warning ([`Model::warnings`]) becomes an error.
    pub strict: bool,
    /// Kinds of warnings that do not become errors, even if `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that contain packages, or are packages themselves, for `package://` addresses; see
    /// [`UrdfOptions`](crate::UrdfOptions).
    pub packages: Vec<PathBuf>,
    /// Whether joint1 follows joint2 ([`Mimic`](crate::Mimic)) in a `<joint>` of `<equality>` with a linear `polycoef`.
    /// If not, the element becomes a [constraint](Model::constraints).
    pub mimic: bool,
    /// Whether a mesh that cannot be read only causes a warning ([`Model::warnings`]) and has no mass. If not, such a
    /// mesh is an error.
    pub weightless_meshes: bool,
}

impl Model {
    /// Reads an MJCF file and the files that it includes.
    ///
    /// Joints keep MuJoCo's order, so q and v correspond to MuJoCo's `qpos` and `qvel`, with two differences.
    /// Quaternions are x, y, z, w. The velocity of a free joint is in the body's frame, whereas MuJoCo's linear
    /// velocity is in the world's frame. A hinge has one coordinate, with or without limits
    /// ([`Joint::Revolute`](crate::Joint::Revolute)). Several joints of one body become a chain, with intermediate
    /// bodies `name#1`, `name#2`, … without mass. A body without joints is merged into its parent and stays as a frame
    /// of kind [`FrameKind::User`], as sites do.
    ///
    /// The frame of a model's body is at the body's last joint. The frame of the MJCF body is a separate frame of kind
    /// [`FrameKind::Link`] with the body's name. The two frames differ by the joint's `pos`. The q of a free joint is
    /// the pose of the MJCF body in the world; with `align`, q is the pose of the frame of inertia, as in MuJoCo.
    /// `<frame>` elements with a name, and cameras of mode `fixed`, are frames of kind [`FrameKind::User`], too. If a
    /// site has the same name, such a frame is named `frame:name` or `camera:name`.
    ///
    /// The reader supports `<compiler>` (everything that affects a model), default classes, `<include>`, `<replicate>`,
    /// `<frame>`, `<inertial>`, masses of geoms, gravity and flags. It also supports `<attach>` of files with their own
    /// settings. An included file is searched in the main file's folder, and then in the folder of the including file.
    /// With the feature `meshes`, masses and inertias of meshes follow MuJoCo's rules (`inertia` of `<mesh>`).
    /// Primitives that are fitted to meshes follow these rules, too.
    ///
    /// Springs ([`springs`](Self::springs)), damping, friction and armature are equal to the values in the compiled
    /// MuJoCo model. `springdamper` and `dampratio` are evaluated with the inertia in the initial configuration of the
    /// file. Actuators add gear² times their armature and damping. If a `<fixed>` tendon moves with a single
    /// coordinate, its spring, damping, friction, armature and range are added to that coordinate. `gravcomp` becomes a
    /// [gravity compensation](Self::gravity_compensation). As in MuJoCo, negative values of `gravcomp` act only if
    /// another value is positive.
    ///
    /// The limits of effort of a joint are sums over its actuators, clipped to the joint's `actuatorfrcrange`. An
    /// actuator contributes its `forcerange` times gear. If the force of an actuator depends only on the control, the
    /// actuator also contributes the control range times gain and gear. A joint without actuators has its
    /// `actuatorfrcrange`, or no limit. Forces at sites do not limit joints. For several actuators of a ball joint, or
    /// a tendon over several joints, the limits are a box around the reachable efforts. [`actuators`](Self::actuators)
    /// lists the actuators of joints, fixed tendons and sites, except muscles, plugins and dampers.
    ///
    /// Active `connect`, `weld` and `joint` elements of `<equality>` become [`constraints`](Self::constraints). A
    /// constraint without a name is named by its kind and number: `weld1`. With [`MjcfOptions::mimic`], joints follow
    /// others in the tree instead. Ranges, damping, friction, springs and efforts of a follower then act on the
    /// coordinate of its leader. Keyframes without a name are named by their number: `key0`, `key1`, ….
    ///
    /// An unknown, misspelt or misplaced name is a [warning](Model::warnings). So is each effect that a model cannot
    /// represent: tendons over several coordinates, activations and delays of actuators, the range of a ball joint,
    /// forces of a medium, and bodies moved by a program (`mocap`). Sensors, visuals and contacts are ignored.
    /// `composite`, `flexcomp`, flexes and plugins of bodies are errors. A mesh with mass that cannot be read is an
    /// error, unless its body is fixed to the world or [`MjcfOptions::weightless_meshes`] is set. Contradictions,
    /// repeated names and invalid keywords are errors, as in MuJoCo. A URDF cannot be attached.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), [`Error::Strict`], or
    /// an error of [`ModelBuilder::build`]. The limits of files are listed in the [crate
    /// documentation](crate#limits-of-files).
    pub fn from_mjcf(path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.read(path.as_ref())?;
        model(&files, options)
    }

    /// Reads an MJCF from a string. The string must not include files; see [`from_mjcf`](Self::from_mjcf).
    ///
    /// ```
    /// use condyle_model::{MjcfOptions, Model};
    /// let mjcf = r#"<mujoco model="pendulum"><worldbody>
    ///   <body name="rod">
    ///     <joint name="pivot" axis="0 1 0"/>
    ///     <geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/>
    ///   </body>
    /// </worldbody></mujoco>"#;
    /// let pendulum = Model::from_mjcf_str(mjcf, &MjcfOptions::default())?;
    /// assert_eq!((pendulum.nq(), pendulum.total_mass()), (1, 2.0));
    /// let error = Model::from_mjcf_str(&mjcf.replace("0 1 0", "0 y 0"), &MjcfOptions::default()).unwrap_err();
    /// assert_eq!(error.to_string(), "<string>:3: joint `pivot`: axis: `y` is no finite number");
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`from_mjcf`](Self::from_mjcf).
    pub fn from_mjcf_str(text: &str, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.parse(text, "<string>", None)?;
        model(&files, options)
    }

    /// Reads a text that describes a compiled model of MuJoCo. Errors and warnings have no line number, because the
    /// user does not know the text.
    ///
    /// # Errors
    /// Returns the errors of [`from_mjcf`](Self::from_mjcf).
    #[doc(hidden)]
    pub fn from_compiled_mjcf(text: &str, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.parse_without_lines(text, "<MjModel>")?;
        model(&files, options)
    }

    /// Reads a text instead of the file at `path`. Errors name this path, and included files are searched in its
    /// folder.
    ///
    /// # Errors
    /// Returns the errors of [`from_mjcf`](Self::from_mjcf).
    #[doc(hidden)]
    pub fn from_mjcf_text(text: &str, path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.read_text(path.as_ref(), text)?;
        model(&files, options)
    }
}

/// Returns a function that computes the pose of a `<frame>` in its parent element, with the settings of its file.
///
/// # Errors
/// Returns the errors of [`Model::from_mjcf`].
pub(super) fn frame_poses(root: &Element) -> Result<impl Fn(&Element) -> Result<Se3<f64>, Error>, Error> {
    let compiler = Compiler::read(root)?;
    Ok(move |frame: &Element| compiler.pose(&Attributes::plain(frame)))
}

/// File with its own settings: the main file or an attached file.
struct Source<'a> {
    root: &'a Element,
    compiler: Compiler,
    defaults: Defaults<'a>,
    assets: Assets<'a>,
    /// Folder of the file; `None` for a string.
    #[cfg_attr(not(feature = "meshes"), allow(dead_code))]
    folder: Option<&'a Path>,
}

fn model(files: &Files, options: &MjcfOptions) -> Result<Model, Error> {
    with_reader(files, options, |reader, root| root.accepted(reader.model(root)?, options.strict, &options.allow))
}

/// Calls `read` with a reader of the files, and the root element of the main file.
fn with_reader<T>(
    files: &Files,
    options: &MjcfOptions,
    read: impl for<'a> FnOnce(Reader<'a>, &'a Element) -> Result<T, Error>,
) -> Result<T, Error> {
    let all: Vec<_> = files.files.iter().flatten().collect();
    let mut sources = Vec::new();
    for file in &all {
        let (defaults, compiler) = (Defaults::read(&file.root)?, Compiler::read(&file.root)?);
        let (assets, folder) = (Assets::read(&file.root)?, file.folder.as_deref());
        sources.push(Source { root: &file.root, compiler, defaults, assets, folder });
    }
    let root = &all[0].root;
    let mut warnings = files.warnings.clone();
    let gravity = options::gravity(root, &mut warnings)?;
    let reader = Reader {
        options,
        gravity,
        sources: &sources,
        bodies: 0,
        names: HashMap::new(),
        joints: Joints::default(),
        poses: vec![Se3::identity()],
        solids: Solids::default(),
        mass: 0.0,
        compensates: root.all("worldbody").map(tree::compensates).collect::<Result<Vec<_>, _>>()?.contains(&true),
        placed: Vec::new(),
        warnings,
    };
    read(reader, root)
}

struct Reader<'a> {
    options: &'a MjcfOptions,
    /// Gravity (m/s²).
    gravity: Vec3<f64>,
    /// Files with their own settings, the main one first.
    sources: &'a [Source<'a>],
    /// Number of bodies that have been read. This number is also MuJoCo's index of the last body.
    bodies: usize,
    /// Elements with a name, by kind and name.
    names: HashMap<(&'static str, String), &'a Element>,
    joints: Joints<'a>,
    /// Pose of each body of the builder in the world, in the initial configuration of the file.
    poses: Vec<Se3<f64>>,
    solids: Solids,
    /// Mass of all bodies that have been read (kg).
    mass: f64,
    /// Whether a positive `gravcomp` compensates the weight of at least one body.
    compensates: bool,
    /// Named frames and cameras that have been read.
    placed: Vec<Placed<'a>>,
    warnings: Vec<Warning>,
}

impl<'a> Reader<'a> {
    fn model(mut self, root: &'a Element) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(root.attribute("model").unwrap_or("MuJoCo Model"));
        builder.gravity(self.gravity);
        builder.frame_of_kind("world", FrameKind::Link, WORLD, Se3::identity());
        if let Some(flex) = root.all("deformable").flat_map(|section| section.all("flex")).next() {
            return Err(flex.wrong("is not supported"));
        }
        self.tree(&mut builder, root)?;
        self.place(&mut builder);
        if let Some(total) = self.sources[0].compiler.total_mass.filter(|_| self.mass > 0.0) {
            builder.scale_inertias(total / self.mass);
        }
        let mimic = self.options.mimic;
        let warnings = equality::add(&mut builder, root, self.sources, &self.joints, &self.poses, mimic)?;
        self.warnings.extend(warnings);
        let place = |kind, name: &String| self.names.get(&(kind, name.clone()));
        let (joints, warnings) = (&mut self.joints, &mut self.warnings);
        let mut complete = |model: &mut Model| {
            warnings.extend(beside::add(model, root, self.sources, joints, &self.poses)?);
            Ok(())
        };
        let mut model = builder.build_with(&mut complete).map_err(|e| match &e {
            Error::Body { body, what } => place("body", body).map_or(e.clone(), |at| at.wrong(what.clone())),
            Error::Joint { joint, what } => place("joint", joint).map_or(e.clone(), |at| at.wrong(what.clone())),
            _ => e,
        })?;
        model.warnings.append(&mut self.warnings);
        Ok(model)
    }

    /// Returns the settings of the file that contains an element.
    fn source(&self, element: &Element) -> &'a Source<'a> {
        &self.sources[element.source]
    }

    fn compiler(&self, element: &Element) -> &'a Compiler {
        &self.source(element).compiler
    }

    /// Returns the element with the defaults of its class. If the element names no class, the class of the surrounding
    /// element is used.
    fn of(&self, element: &'a Element, around: &'a str) -> Result<Attributes<'a>, Error> {
        self.source(element).defaults.of(element, around)
    }

    /// Returns the element's name. If the element has no name, returns a new name that is not used yet.
    fn name(&mut self, kind: &'static str, element: &'a Element, otherwise: &str) -> Result<String, Error> {
        let own = element.attribute("name").filter(|n| !n.is_empty());
        let mut name = own.unwrap_or(otherwise).to_owned();
        while own.is_none() && self.names.contains_key(&(kind, name.clone())) {
            name.push('_');
        }
        match self.names.insert((kind, name.clone()), element) {
            Some(other) => Err(taken(element, other)),
            None => Ok(name),
        }
    }
}

/// Returns the elements of one kind by name. Returns an error if two elements have the same name.
fn names<'e>(elements: impl Iterator<Item = &'e Element>) -> Result<HashMap<&'e str, &'e Element>, Error> {
    let mut names: HashMap<&str, &Element> = HashMap::new();
    for element in elements {
        if let Some(other) = element.attribute("name").and_then(|name| names.insert(name, element)) {
            return Err(taken(element, other));
        }
    }
    Ok(names)
}

/// Returns the error for an element whose name another element already has.
fn taken(element: &Element, other: &Element) -> Error {
    element.wrong(format!("the name is taken by the {} on line {}", other.tag, other.line))
}
