//! Robots from MJCF, the format of MuJoCo: kinematics, inertias, limits.

mod actuator;
mod assets;
mod attributes;
mod beside;
mod compiler;
mod equality;
mod expand;
mod geometry;
mod include;
mod joint;
mod keyframe;
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
use attributes::{Attributes, Defaults, MAIN};
use compiler::Compiler;
use condyle_spatial::{Se3, Vec3};
use include::Files;
use spring::Joints;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tree::Placed;

/// The known elements and attributes of MJCF, by parent, of MuJoCo 4.0 and before.
const ELEMENTS: &str = include_str!("mjcf/elements.txt");

/// Options of reading an MJCF.
#[derive(Clone, Debug, Default)]
pub struct MjcfOptions {
    /// Whether a warning ([`Model::warnings`]) is an error.
    pub strict: bool,
    /// Kinds of warnings that are no errors, though `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that contain packages, or are packages, for `package://` addresses; see [`UrdfOptions`](crate::UrdfOptions).
    pub packages: Vec<PathBuf>,
    /// Whether a `<joint>` of `<equality>` lets joint1 follow joint2 ([`Mimic`](crate::Mimic)), instead of being left
    /// out; its `polycoef` must be linear.
    pub mimic: bool,
    /// Whether the mass of a mesh, on a moving body without `<inertial>`, is left out and reported in
    /// [`Model::warnings`], instead of being an error.
    pub weightless_meshes: bool,
}

impl Model {
    /// Reads an MJCF file, and the files that it includes.
    ///
    /// Joints keep MuJoCo's order, so q and v read as its `qpos` and `qvel`, but that our quaternions are x, y, z, w
    /// and a free joint's velocity is in the body's frame (MuJoCo: linear velocity in the world's). A hinge has one
    /// number, limits or not ([`Joint::Revolute`]). Several joints on one body become a chain, with bodies without
    /// mass, `name#1`, `name#2`, …, between them. A body without joints is merged into its parent and stays as a
    /// frame, as do sites ([`FrameKind::User`]).
    ///
    /// A body of the model sits where its last joint is: the frame of the MJCF body, of kind [`FrameKind::Link`] and
    /// with the body's name, is apart from it by that joint's `pos`. A free joint's q is the pose of the MJCF body in
    /// the world; with `align` its frame is the frame of inertia, as in MuJoCo. Named `<frame>`s and cameras (of mode
    /// `fixed`) are frames of kind [`FrameKind::User`] too; one whose name a site has is named `frame:name` or
    /// `camera:name`.
    ///
    /// Read are `<compiler>` (all that has an effect on a model), default classes, `<include>`, `<replicate>`, `<attach>`
    /// with files that have settings of their own, gravity and flags, `<frame>`, `<inertial>`, masses of geoms, and of
    /// joints: pos, axis, ref, range, armature, damping, frictionloss, actuatorfrcrange. Included files are looked for in
    /// the main file's folder, then beside the file that includes them. Masses and inertias of meshes follow MuJoCo's
    /// rules (`inertia` of `<mesh>`), with the feature `meshes`; so do primitives that are fitted to meshes.
    ///
    /// An unknown, misspelt or misplaced name is a [warning](Model::warnings), and so is everything with an effect that a
    /// model cannot hold: equality constraints (but see [`MjcfOptions::mimic`]) and tendons, the range of a ball joint,
    /// forces of a medium, bodies that a program moves (`mocap`). Sensors, visuals and contacts have no part in a model.
    /// `composite`, `flexcomp`, flexes and plugins of bodies are errors, and so is a mesh with mass that cannot be read,
    /// unless it is on a body fixed to the world (but see [`MjcfOptions::weightless_meshes`]). Contradictions are errors,
    /// as in MuJoCo.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), [`Error::Strict`], and what
    /// [`ModelBuilder::build`] finds. What the files may have at most stands at the [beginning](crate#limits-of-files).
    pub fn from_mjcf(path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.read(path.as_ref())?;
        model(&files, options)
    }

    /// Reads an MJCF from a string, which may not include files; see [`from_mjcf`](Self::from_mjcf).
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
    /// As [`from_mjcf`](Self::from_mjcf).
    pub fn from_mjcf_str(text: &str, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.parse(text, "<string>", None)?;
        model(&files, options)
    }
}

/// A file with settings of its own.
struct Source<'a> {
    root: &'a Element,
    compiler: Compiler,
    defaults: Defaults<'a>,
    assets: Assets<'a>,
    /// The folder of the file; a string has none.
    folder: Option<&'a Path>,
}

fn model(files: &Files, options: &MjcfOptions) -> Result<Model, Error> {
    let all: Vec<_> = files.files.iter().flatten().collect();
    let mut sources = Vec::new();
    for file in &all {
        let (defaults, compiler) = (Defaults::read(&file.root)?, Compiler::read(&file.root)?);
        let (assets, folder) = (Assets::read(&file.root), file.folder.as_deref());
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
        placed: Vec::new(),
        warnings,
    };
    root.accepted(reader.model(root)?, options.strict, &options.allow)
}

struct Reader<'a> {
    options: &'a MjcfOptions,
    /// m/s².
    gravity: Vec3<f64>,
    /// The files with settings of their own, the main one first.
    sources: &'a [Source<'a>],
    /// The number of bodies so far: MuJoCo's number of the last one.
    bodies: usize,
    /// The elements that have names, by kind and name.
    names: HashMap<(&'static str, String), &'a Element>,
    joints: Joints<'a>,
    /// Pose in the world that the file has drawn, for each body of the builder.
    poses: Vec<Se3<f64>>,
    solids: Solids,
    /// The mass of all bodies so far (kg).
    mass: f64,
    /// Named frames and cameras so far.
    placed: Vec<Placed<'a>>,
    warnings: Vec<Warning>,
}

impl<'a> Reader<'a> {
    fn model(mut self, root: &'a Element) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(root.attribute("model").unwrap_or("MuJoCo Model"));
        builder.gravity(self.gravity);
        builder.frame_of_kind("world", FrameKind::Link, WORLD, Se3::identity());
        for flex in root.all("deformable").flat_map(|section| section.all("flex")) {
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

    /// The settings of the file that an element is from.
    fn source(&self, element: &Element) -> &'a Source<'a> {
        &self.sources[element.source]
    }

    fn compiler(&self, element: &Element) -> &'a Compiler {
        &self.source(element).compiler
    }

    /// The element with the defaults of its class or, failing one, of the class around it.
    fn of(&self, element: &'a Element, around: &'a str) -> Result<Attributes<'a>, Error> {
        self.source(element).defaults.of(element, around)
    }

    /// The element's own name, or one that nobody has.
    fn name(&mut self, kind: &'static str, element: &'a Element, otherwise: &str) -> Result<String, Error> {
        let own = element.attribute("name").filter(|n| !n.is_empty());
        let mut name = own.unwrap_or(otherwise).to_owned();
        while own.is_none() && self.names.contains_key(&(kind, name.clone())) {
            name.push('_');
        }
        match self.names.insert((kind, name.clone()), element) {
            Some(other) => Err(element.wrong(format!("the name is taken by the {kind} on line {}", other.line))),
            None => Ok(name),
        }
    }
}
