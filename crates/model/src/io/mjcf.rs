//! Robots from MJCF, the format of MuJoCo: kinematics, inertias, limits. Meshes are never looked at.

mod attributes;
mod equality;
mod geometry;
mod include;

use super::xml::Element;
use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::{Warning, WarningKind};
use attributes::{Attributes, Compiler, Defaults, FromGeoms, MAIN, turn};
use condyle_spatial::{Act, Inertia, Mat3, Se3, Vec3};
use equality::Joints;
use include::Includes;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

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
    /// the world.
    ///
    /// Read are `<compiler>` (angle, eulerseq, autolimits, inertiafromgeom, inertiagrouprange, boundmass, boundinertia,
    /// balanceinertia, settotalmass), default classes, `<include>`, gravity, `<frame>`, `<inertial>`, masses of
    /// primitive geoms, and of joints: pos, axis, ref, range, armature, damping, frictionloss, actuatorfrcrange.
    /// Equality constraints (but see [`MjcfOptions::mimic`]) and tendons are left out and reported in
    /// [`warnings`](Model::warnings). Actuators, sensors, contacts, keyframes, springs and `gravcomp` have no part in a
    /// model. Mass of a mesh (but see [`MjcfOptions::weightless_meshes`]), `replicate`, `composite`, `flexcomp`,
    /// `attach`, and what else would change the tree or its masses is an error.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), [`Error::Strict`], and what
    /// [`ModelBuilder::build`] finds. What the files may have at most stands at the [beginning](crate#limits-of-files).
    pub fn from_mjcf(path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        model(&Includes::read(path.as_ref())?, options)
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
        model(&Includes::parse(text)?, options)
    }

    /// Reads a text that stands in the place of a file: the path names it in errors, and includes are found beside it.
    ///
    /// # Errors
    /// As [`from_mjcf`](Self::from_mjcf).
    #[doc(hidden)]
    pub fn from_mjcf_text(text: &str, path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        model(&Includes::read_text(path.as_ref(), text)?, options)
    }
}

fn model(root: &Element, options: &MjcfOptions) -> Result<Model, Error> {
    if root.tag != "mujoco" {
        return Err(root.wrong("the root element of an MJCF is <mujoco>"));
    }
    let defaults = Defaults::read(root)?;
    let compiler = Compiler::read(root)?;
    let (names, joints) = (HashMap::new(), HashMap::new());
    let (defaults, warnings) = (&defaults, Vec::new());
    let reader = Reader { options, compiler, defaults, bodies: 0, names, joints, mass: 0.0, warnings };
    let model = reader.model(root)?;
    root.accepted(model, options.strict, &options.allow)
}

/// The parts of a body, with those inside its `<frame>`s.
#[derive(Default)]
struct Parts<'a> {
    inertial: Option<&'a Element>,
    joints: Vec<Attributes<'a>>,
    /// The geoms, each with the pose of the `<frame>` around it.
    geoms: Vec<(Attributes<'a>, Se3<f64>)>,
    sites: Vec<(Attributes<'a>, Se3<f64>)>,
    /// The bodies in it, each with its own pose, and the class for what is in it.
    bodies: Vec<(&'a Element, Se3<f64>, &'a str)>,
}

/// A body that waits for its turn.
struct Waiting<'a> {
    element: &'a Element,
    class: &'a str,
    /// The body of the model of which the parent is a part.
    on: BodyId,
    /// The pose in that body.
    placement: Se3<f64>,
    /// Whether the parent is the world itself.
    top: bool,
}

struct Reader<'a> {
    options: &'a MjcfOptions,
    compiler: Compiler,
    defaults: &'a Defaults<'a>,
    /// The number of bodies so far: MuJoCo's number of the last one.
    bodies: usize,
    /// The elements that have names, by kind and name.
    names: HashMap<(&'static str, String), &'a Element>,
    joints: Joints,
    /// The mass of all bodies so far (kg).
    mass: f64,
    warnings: Vec<Warning>,
}

impl<'a> Reader<'a> {
    fn model(mut self, root: &'a Element) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(root.attribute("model").unwrap_or("MuJoCo Model"));
        builder.gravity(gravity(root)?);
        builder.frame_of_kind("world", FrameKind::Link, WORLD, Se3::identity());
        for world in root.all("worldbody") {
            let mut parts = Parts::default();
            self.gather(world, Se3::identity(), MAIN, &mut parts)?;
            if let Some(joint) = parts.joints.first().map(|j| j.element).or(parts.inertial) {
                return Err(joint.wrong("the world has neither joints nor inertia"));
            }
            self.sites(&mut builder, &parts, WORLD, Se3::identity())?;
            let mut waiting = Vec::new();
            wait(&mut waiting, &parts, WORLD, Se3::identity(), true);
            while let Some(next) = waiting.pop() {
                let (parts, body, bXl) = self.body(&mut builder, &next)?;
                wait(&mut waiting, &parts, body, bXl, false);
            }
        }
        if let Some(total) = self.compiler.total_mass.filter(|_| self.mass > 0.0) {
            builder.scale_inertias(total / self.mass);
        }
        let warnings = equality::add(&mut builder, root, &self.joints, self.options.mimic)?;
        let place = |kind, name: &String| self.names.get(&(kind, name.clone()));
        let mut model = builder.build().map_err(|e| match &e {
            Error::Body { body, what } => place("body", body).map_or(e.clone(), |at| at.wrong(what.clone())),
            Error::Joint { joint, what } => place("joint", joint).map_or(e.clone(), |at| at.wrong(what.clone())),
            _ => e,
        })?;
        model.warnings.extend(self.warnings.into_iter().chain(warnings));
        Ok(model)
    }

    /// Sorts what is in a body; `X` is the pose of the `<frame>` that it is in.
    fn gather(&self, inside: &'a Element, X: Se3<f64>, class: &'a str, parts: &mut Parts<'a>) -> Result<(), Error> {
        let around = inside.attribute("childclass").map_or(Ok(class), |c| self.defaults.known(inside, c))?;
        for e in &inside.children {
            match e.tag.as_str() {
                "joint" | "freejoint" | "inertial" if inside.tag == "frame" => {
                    return Err(e.wrong("cannot be in a <frame>"));
                }
                "joint" => parts.joints.push(self.defaults.of(e, around)?),
                "freejoint" => parts.joints.push(Attributes::plain(e)),
                "inertial" if parts.inertial.is_some() => return Err(e.wrong("the body has another one")),
                "inertial" => parts.inertial = Some(e),
                "geom" => parts.geoms.push((self.defaults.of(e, around)?, X)),
                "site" => parts.sites.push((self.defaults.of(e, around)?, X)),
                "body" => parts.bodies.push((e, X * self.compiler.pose(&Attributes::plain(e))?, around)),
                "frame" => self.gather(e, X * self.compiler.pose(&Attributes::plain(e))?, around, parts)?,
                "replicate" | "composite" | "flexcomp" | "attach" => return Err(e.wrong("is not supported")),
                _ => {} // cameras, lights, plugins
            }
        }
        Ok(())
    }

    /// Adds a body: its parts, the body of the model that it is part of, and its pose there.
    fn body(&mut self, builder: &mut ModelBuilder, w: &Waiting<'a>) -> Result<(Parts<'a>, BodyId, Se3<f64>), Error> {
        let mut parts = Parts::default();
        self.gather(w.element, Se3::identity(), w.class, &mut parts)?;
        self.bodies += 1;
        let name = self.name("body", w.element, &format!("body{}", self.bodies))?;
        let (mut body, mut bXl) = (w.on, w.placement);
        let moves = body != WORLD || !parts.joints.is_empty();
        // what cannot move counts where all masses are scaled
        let counts = moves || self.compiler.total_mass.is_some();
        let inertia = if counts { self.inertia(w.element, &parts)? } else { Inertia::zero() };
        self.mass += inertia.mass;
        let inertia = if moves { inertia } else { Inertia::zero() };
        let count = parts.joints.len();
        for (k, a) in parts.joints.iter().enumerate() {
            let number = if count == 1 { String::new() } else { format!("{}", k + 1) };
            let joint_name = self.name("joint", a.element, &format!("{name}_joint{number}"))?;
            let (joint, lXj, jXl, options) = self.joint(a)?;
            let placement = if joint == Joint::FreeFlyer {
                if !w.top || count > 1 {
                    return Err(a.element.wrong("a free joint is the only joint of a body on the world"));
                }
                Se3::identity() // its q is the body's pose in the world
            } else {
                bXl * lXj
            };
            let last = k + 1 == count;
            let between = format!("{name}#{}", k + 1);
            let (called, inertia) = if last { (&name, jXl.act(inertia)) } else { (&between, Inertia::zero()) };
            body = builder.body_with((called, &joint_name), body, joint, placement, inertia, options);
            let unit = if matches!(joint, Joint::Revolute { .. }) { self.compiler.angle } else { 1.0 };
            let at_zero = a.number("ref")?.unwrap_or(0.0) * unit;
            self.joints.insert(joint_name.clone(), (body, at_zero));
            if !last {
                builder.between(body);
            }
            builder.frame_of_kind(&joint_name, FrameKind::Joint, body, Se3::identity());
            bXl = jXl;
        }
        if count == 0 {
            builder.merge(body, bXl, inertia);
        }
        builder.frame_of_kind(&name, FrameKind::Link, body, bXl);
        self.sites(builder, &parts, body, bXl)?;
        Ok((parts, body, bXl))
    }

    fn sites(
        &mut self,
        builder: &mut ModelBuilder,
        parts: &Parts<'a>,
        body: BodyId,
        bXl: Se3<f64>,
    ) -> Result<(), Error> {
        for (a, X) in parts.sites.iter().filter(|(a, _)| a.element.attribute("name").is_some()) {
            let name = self.name("site", a.element, "")?;
            builder.frame_of_kind(&name, FrameKind::User, body, bXl * *X * self.compiler.pose(a)?);
        }
        Ok(())
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

    /// The body's inertia in its own frame.
    fn inertia(&mut self, element: &Element, parts: &Parts) -> Result<Inertia<f64>, Error> {
        let from_geoms = match self.compiler.from_geoms {
            FromGeoms::Never => false,
            FromGeoms::WithoutInertial => parts.inertial.is_none(),
            FromGeoms::Always => true,
        };
        if from_geoms {
            let mut sum = Inertia::zero();
            for (geom, X) in &parts.geoms {
                if self.options.weightless_meshes && geometry::is_heavy_mesh(&self.compiler, geom)? {
                    let what = format!("the mass of a mesh on {} is left out", element.label());
                    self.warnings.push(geom.element.left_out(what));
                    continue;
                }
                sum += X.act(geometry::geom(&self.compiler, geom)?);
            }
            return geometry::corrected(&self.compiler, element, sum);
        }
        let given =
            parts.inertial.map_or(Ok(Inertia::zero()), |e| geometry::inertial(&self.compiler, &Attributes::plain(e)));
        geometry::corrected(&self.compiler, element, given?)
    }

    /// The joint, the poses before it (`ref` undone) and after it, and what else it has: lXl(q) = lXj X_J(q) jXl.
    fn joint(&self, a: &Attributes) -> Result<(Joint, Se3<f64>, Se3<f64>, JointOptions), Error> {
        let wrong = |what: String| a.element.wrong(what);
        let kind = if a.element.tag == "freejoint" { "free" } else { a.get("type").unwrap_or("hinge") };
        if kind == "free" {
            if a.flag("align", Some("auto"))? == Some(true) {
                return Err(wrong("align is not supported".to_owned()));
            }
            let number = |name| a.number(name).map(|x| x.unwrap_or(0.0));
            let (armature, damping) = (number("armature")?, number("damping")?);
            let options = JointOptions { armature, damping, ..JointOptions::default() };
            return Ok((Joint::FreeFlyer, Se3::identity(), Se3::identity(), options));
        }
        let axis = a.vector("axis")?.unwrap_or(Vec3::new(0.0, 0.0, 1.0));
        let (joint, unit) = match kind {
            "hinge" => (Joint::Revolute { axis }, self.compiler.angle),
            "slide" => (Joint::Prismatic { axis }, 1.0),
            "ball" => (Joint::Spherical, self.compiler.angle),
            _ => return Err(wrong(format!("type: `{kind}` is none of hinge, slide, ball and free"))),
        };
        let joint = joint.normalized().map_err(wrong)?;
        let anchor = a.vector("pos")?.filter(|_| kind != "slide").unwrap_or(Vec3::zero());
        let at_zero = a.number("ref")?.unwrap_or(0.0) * unit;
        let lXj = match joint {
            Joint::Revolute { axis } => Se3::new(turn(axis, -at_zero), anchor),
            Joint::Prismatic { axis } => Se3::new(Mat3::identity(), axis.scale(-at_zero)),
            _ => Se3::new(Mat3::identity(), anchor),
        };
        let jXl = Se3::new(Mat3::identity(), -anchor);
        let range = self.limits(a, "range", "limited")?.map(|[lower, upper]| (lower * unit, upper * unit));
        if let Some((lower, upper)) = range.filter(|r| r.0 > r.1) {
            return Err(wrong(format!("range: lower limit {lower} is above upper limit {upper}")));
        }
        let effort = self.limits(a, "actuatorfrcrange", "actuatorfrclimited")?;
        let options = JointOptions {
            position: range.filter(|_| joint != Joint::Spherical),
            velocity: None,
            effort: effort.map(|[lower, upper]| (lower, upper)),
            damping: a.number("damping")?.unwrap_or(0.0),
            damping_polynomial: [0.0; 2],
            friction: a.number("frictionloss")?.unwrap_or(0.0),
            armature: a.number("armature")?.unwrap_or(0.0),
        };
        Ok((joint, lXj, jXl, options))
    }

    /// A range, if it limits.
    fn limits(&self, a: &Attributes, range: &str, limited: &str) -> Result<Option<[f64; 2]>, Error> {
        let bounds = a.array::<2>(range)?;
        match a.flag(limited, Some("auto"))? {
            Some(false) => Ok(None),
            Some(true) if bounds.is_none() => Err(a.element.wrong(format!("{limited}: there is no {range}"))),
            None if bounds.is_some() && !self.compiler.autolimits => {
                Err(a.element.wrong(format!("{range}: without autolimits, {limited} must say whether it limits")))
            }
            _ => Ok(bounds),
        }
    }
}

/// Puts the bodies on a body in line, the first of them on top.
fn wait<'a>(waiting: &mut Vec<Waiting<'a>>, parts: &Parts<'a>, on: BodyId, bXl: Se3<f64>, top: bool) {
    let next = parts.bodies.iter().rev();
    waiting.extend(next.map(|&(element, X, class)| Waiting { element, class, on, placement: bXl * X, top }));
}

fn gravity(root: &Element) -> Result<Vec3<f64>, Error> {
    let mut gravity = Vec3::new(0.0, 0.0, -9.81);
    for option in root.all("option") {
        gravity = Attributes::plain(option).vector("gravity")?.unwrap_or(gravity);
    }
    let mut flags = root.all("option").flat_map(|o| o.all("flag"));
    Ok(if flags.any(|f| f.attribute("gravity") == Some("disable")) { Vec3::zero() } else { gravity })
}
