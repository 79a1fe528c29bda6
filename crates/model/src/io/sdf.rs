//! Robots from SDF, the format of Gazebo: kinematics, inertias, limits. Meshes are never looked at.

mod mimics;
mod poses;

use super::xml::{Amount, Element};
use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::{Warning, WarningKind};
use condyle_spatial::{Act, Inertia, Se3, Sym3, Vec3};
use mimics::Axes;
use poses::{Poses, optional, three};
use std::collections::{HashMap, HashSet, VecDeque};
use std::path::{Path, PathBuf};

/// Options of reading an SDF.
#[derive(Clone, Debug, Default)]
pub struct SdfOptions {
    /// The joint between the world and a root link, named `root_joint`; none fixes the root link to the world.
    pub root_joint: Option<Joint>,
    /// Whether a warning ([`Model::warnings`]) is an error.
    pub strict: bool,
    /// Kinds of warnings that are no errors, though `strict` is set.
    pub allow: Vec<WarningKind>,
    /// Folders that contain packages, or are packages, for `package://` and `model://` addresses; see
    /// [`UrdfOptions`](crate::UrdfOptions).
    pub packages: Vec<PathBuf>,
    /// Whether an axis with a `<mimic>` follows another one ([`Mimic`](crate::Mimic)), instead of being free.
    pub mimic: bool,
}

impl Model {
    /// Reads an SDF file with one model in it.
    ///
    /// **Tree.** Joints are walked breadth first from the root, in the order of the file. A joint that would give a
    /// link a second parent closes a loop: it is left out and reported in [`warnings`](Self::warnings). Links that are
    /// joined to the world, and a root link without a root joint, stand where the file puts them; with a root joint, q
    /// is the pose of the root link in the world. There is one root.
    ///
    /// **Joints.** `revolute` has one number, limits or not ([`Joint::Revolute`]); `continuous` has q = [cos, sin], as
    /// in a URDF; `ball` is [`Joint::Spherical`]; `universal` and `revolute2` become two revolute joints, the first
    /// called `name#1`, with a body `child#1` between them. `screw` is [`Joint::Helical`], by its `screw_thread_pitch`
    /// or the older `thread_pitch`. `prismatic` and `fixed` are what they say; others (`gearbox`) are never part of the
    /// tree, and errors where they close no loop. The body of the model
    /// sits at the joint's frame: the child link is a frame ([`FrameKind::Link`]) apart from it by the joint's
    /// `<pose>`. Siblings are numbered in the order of the file.
    ///
    /// **Poses** may be `relative_to` links, joints and frames; `<frame>`s become [`FrameKind::User`]. An axis is
    /// `expressed_in` the joint's frame unless it says otherwise; `use_parent_model_frame` of SDF 1.6 means the
    /// model's frame. A link without `<inertial>` has SDF's 1 kg and 1 kg m², and a warning. Friction and damping are
    /// stored; springs and what is drawn or sensed have no part in a model. Nested models, `<include>` and
    /// inertia from shapes (`auto="true"`) are errors.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Xml`], [`Error::Element`] (with file, line and element), [`Error::Strict`], and what
    /// [`ModelBuilder::build`] finds. What a file may have at most stands at the [beginning](crate#limits-of-files).
    pub fn from_sdf(path: impl AsRef<Path>, options: &SdfOptions) -> Result<Self, Error> {
        let (path, mut amount) = (path.as_ref(), Amount::default());
        let text = amount.read(path)?;
        model(&Element::parse(&text, &path.display().to_string(), &mut amount)?, options)
    }

    /// Reads an SDF from a string; see [`from_sdf`](Self::from_sdf).
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
    /// As [`from_sdf`](Self::from_sdf).
    pub fn from_sdf_str(text: &str, options: &SdfOptions) -> Result<Self, Error> {
        model(&Element::parse(text, "<string>", &mut Amount::default())?, options)
    }
}

fn model(root: &Element, options: &SdfOptions) -> Result<Model, Error> {
    if root.tag != "sdf" {
        return Err(root.wrong("the root element of an SDF is <sdf>"));
    }
    let world = root.child("world");
    let mut models = root.all("model").chain(world.into_iter().flat_map(|w| w.all("model")));
    let model = models.next().ok_or_else(|| root.wrong("has no model"))?;
    if let Some(second) = models.next() {
        return Err(second.wrong(format!("is the second model: there is {} already", model.label())));
    }
    if let Some(nested) = model.children.iter().find(|c| matches!(&*c.tag, "model" | "include")) {
        return Err(nested.wrong("models in models are not supported"));
    }
    let mut reader = Reader::new(model)?;
    let gravity = world.and_then(|w| w.child("gravity")).map(|g| three(g, g)).transpose()?;
    let mut model = reader.build(gravity, options)?;
    model.warnings.append(&mut reader.warnings);
    root.accepted(model, options.strict, &options.allow)
}

/// The name under which joints know the world.
const WORLD_LINK: &str = "world";

/// The types of joints that a tree can have.
const KINDS: [&str; 8] = ["fixed", "revolute", "continuous", "prismatic", "screw", "ball", "universal", "revolute2"];

/// A joint, and the links that it connects.
struct Edge<'a> {
    element: &'a Element,
    parent: &'a str,
    child: &'a str,
}

struct Reader<'a> {
    model: &'a Element,
    links: HashMap<&'a str, &'a Element>,
    /// The edges in the order of the file.
    edges: Vec<Edge<'a>>,
    poses: Poses<'a>,
    axes: Axes<'a>,
    warnings: Vec<Warning>,
}

impl<'a> Reader<'a> {
    fn new(model: &'a Element) -> Result<Self, Error> {
        let links: HashMap<_, _> = model.all("link").filter_map(|l| Some((l.attribute("name")?, l))).collect();
        let mut poses = Poses::new(model)?;
        let mut edges = Vec::new();
        for element in model.all("joint") {
            let mut end = |tag: &str| {
                let name = element.child(tag).map(|e| e.text.trim()).filter(|n| !n.is_empty());
                let name = name.ok_or_else(|| element.wrong(format!("has no {tag}")))?;
                if tag == "parent" && name == WORLD_LINK { Ok(WORLD_LINK) } else { poses.link(element, name) }
            };
            edges.push(Edge { element, parent: end("parent")?, child: end("child")? });
        }
        if links.is_empty() {
            return Err(model.wrong("has no links"));
        }
        Ok(Self { model, links, edges, poses, axes: Axes::default(), warnings: Vec::new() })
    }

    fn warn(&mut self, element: &Element, what: String) {
        self.warnings.push(element.left_out(what));
    }

    /// The link on which the tree stands: the world, or the one link that is nobody's child.
    fn root(&self) -> Result<&'a str, Error> {
        let children: HashSet<&str> = self.edges.iter().map(|e| e.child).collect();
        let anchored = self.edges.iter().any(|e| e.parent == WORLD_LINK);
        let mut roots = self.model.all("link").filter(|l| l.attribute("name").is_some_and(|n| !children.contains(n)));
        match (anchored, roots.next(), roots.next()) {
            (true, None, _) => Ok(WORLD_LINK),
            (true, Some(other), _) => Err(other.wrong("is the child of no joint, while other links are on the world")),
            (false, Some(root), None) => Ok(root.attribute("name").unwrap_or_default()),
            (false, Some(first), Some(second)) => {
                let what = format!("has no parent, and neither has {}: a robot has one root", first.label());
                Err(second.wrong(what))
            }
            (false, None, _) => Err(self.model.wrong("every link has a parent: no link is the root")),
        }
    }

    /// The joints of a tree from the root, breadth first in the order of the file; the others are reported.
    fn tree(&mut self, root: &'a str) -> Result<HashMap<&'a str, Vec<usize>>, Error> {
        let mut joints_on: HashMap<&str, Vec<usize>> = HashMap::new();
        for (i, edge) in self.edges.iter().enumerate() {
            joints_on.entry(edge.parent).or_default().push(i);
        }
        let (mut tree, mut reached, mut line) = (HashMap::new(), HashMap::from([(root, None)]), VecDeque::from([root]));
        let mut loops = Vec::new();
        while let Some(link) = line.pop_front() {
            for &i in joints_on.get(link).into_iter().flatten() {
                let Edge { element, child, .. } = self.edges[i];
                let kind = element.attribute("type").unwrap_or_default();
                if reached.contains_key(child) || !KINDS.contains(&kind) {
                    loops.push(i);
                    continue;
                }
                reached.insert(child, Some(i));
                line.push_back(child);
                tree.entry(link).or_insert_with(Vec::new).push(i);
            }
        }
        for i in loops {
            let (joint, child) = (self.edges[i].element, self.edges[i].child);
            let Some(first) = reached.get(child) else {
                let kind = joint.attribute("type").unwrap_or_default();
                return Err(joint.wrong(format!("joints of type `{kind}` are not supported")));
            };
            let first = first.map_or(String::new(), |j: usize| format!(" beside {}", self.edges[j].element.label()));
            self.warn(joint, format!("would give link `{child}` a second parent{first}: it closes a loop, left out"));
        }
        match self.model.all("link").find(|l| l.attribute("name").is_some_and(|n| !reached.contains_key(n))) {
            Some(link) => Err(link.wrong(format!("is part of a cycle that does not reach the root `{root}`"))),
            None => Ok(tree),
        }
    }

    fn build(&mut self, gravity: Option<Vec3<f64>>, options: &SdfOptions) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(self.model.attribute("name").unwrap_or_default());
        if let Some(gravity) = gravity {
            builder.gravity(gravity);
        }
        let root = self.root()?;
        let tree = self.tree(root)?;
        let oXm = self.poses.of_model(self.model)?;
        // where each link is: on which body, and at which placement there
        let mut place: HashMap<&str, (BodyId, Se3<f64>)> = HashMap::new();
        if root == WORLD_LINK {
            place.insert(root, (WORLD, Se3::identity()));
        } else {
            let inertia = self.inertia(root)?;
            let at = match options.root_joint {
                None => (WORLD, oXm * self.poses.of(root)?),
                Some(joint) => {
                    let (names, none) = ((root, "root_joint"), JointOptions::default());
                    let body = builder.body_with(names, WORLD, joint, Se3::identity(), inertia, none);
                    builder.frame_of_kind("root_joint", FrameKind::Joint, body, Se3::identity());
                    (body, Se3::identity())
                }
            };
            if at.0 == WORLD {
                builder.merge(WORLD, at.1, inertia);
            }
            builder.frame_of_kind(root, FrameKind::Link, at.0, at.1);
            place.insert(root, at);
        }
        let on = |link: &str| tree.get(link).into_iter().flatten().rev().copied();
        let mut waiting: Vec<usize> = on(root).collect();
        while let Some(i) = waiting.pop() {
            let Edge { element, parent, child } = self.edges[i];
            let (body, bXp) = place[parent];
            let mXp = if parent == WORLD_LINK { oXm.inverse() } else { self.poses.of(parent)? };
            let (mXc, cXj) = (self.poses.of(child)?, self.poses.joint_in_child(element, child)?);
            let bXj = bXp * mXp.inverse() * mXc * cXj;
            let at = self.joint(&mut builder, element, child, (body, bXj), cXj.inverse())?;
            builder.frame_of_kind(child, FrameKind::Link, at.0, at.1);
            place.insert(child, at);
            waiting.extend(on(child));
        }
        for frame in self.model.all("frame") {
            let Some(name) = frame.attribute("name") else { continue };
            let (link, mXf) = (self.poses.attached(frame, name)?, self.poses.of(name)?);
            let (body, bXl) = link.map_or((WORLD, oXm), |l| place[l]);
            let mXl = link.map_or(Ok(Se3::identity()), |l| self.poses.of(l))?;
            builder.frame_of_kind(name, FrameKind::User, body, bXl * mXl.inverse() * mXf);
        }
        self.warnings.append(&mut self.axes.follow(&mut builder, options.mimic)?);
        let joint = |name: &str| {
            let name = name.trim_end_matches("#1");
            self.edges.iter().map(|e| e.element).find(|e| e.attribute("name") == Some(name))
        };
        builder.build().map_err(|e| match &e {
            Error::Body { body, what } => self.links.get(body.as_str()).map_or(e.clone(), |at| at.wrong(what.clone())),
            Error::Joint { joint: name, what } => joint(name).map_or(e.clone(), |at| at.wrong(what.clone())),
            _ => e,
        })
    }

    /// Adds a joint and its child link; returns on which body the link is, and where.
    fn joint(
        &mut self,
        builder: &mut ModelBuilder,
        element: &'a Element,
        child: &'a str,
        (parent, bXj): (BodyId, Se3<f64>),
        jXc: Se3<f64>,
    ) -> Result<(BodyId, Se3<f64>), Error> {
        let inertia = jXc.act(self.inertia(child)?);
        let name = element.attribute("name").unwrap_or_default();
        let axis = |tag: &str| self.poses.axis(element, tag);
        let joints = match element.attribute("type").unwrap_or_default() {
            "fixed" => vec![],
            "revolute" => vec![(Joint::Revolute { axis: axis("axis")? }, "axis")],
            "continuous" => vec![(Joint::Continuous { axis: axis("axis")? }, "axis")],
            "prismatic" => vec![(Joint::Prismatic { axis: axis("axis")? }, "axis")],
            "screw" => vec![(Joint::Helical { axis: axis("axis")?, pitch: pitch(element)? }, "axis")],
            "ball" => vec![(Joint::Spherical, "")],
            _ => vec![
                (Joint::Revolute { axis: axis("axis")? }, "axis"),
                (Joint::Revolute { axis: axis("axis2")? }, "axis2"),
            ],
        };
        let (mut body, mut at) = (parent, bXj);
        let count = joints.len();
        for (k, (joint, axis)) in joints.into_iter().enumerate() {
            let joint = joint.normalized().map_err(|_| element.wrong(format!("{axis}: xyz is no direction")))?;
            let options = element.child(axis).map_or(Ok(JointOptions::default()), |a| limits(element, a, joint))?;
            let last = k + 1 == count;
            let (link, called, inertia) = if last {
                (child.to_owned(), name.to_owned(), inertia)
            } else {
                (format!("{child}#{}", k + 1), format!("{name}#{}", k + 1), Inertia::zero())
            };
            body = builder.body_with((&link, &called), body, joint, at, inertia, options);
            self.axes.add(element, axis, body);
            if !last {
                builder.between(body);
            }
            at = Se3::identity();
        }
        if count == 0 {
            builder.merge(body, at, inertia);
        }
        builder.frame_of_kind(name, FrameKind::Joint, body, at);
        Ok((body, at * jXc))
    }

    /// The link's inertia in the link's frame.
    fn inertia(&mut self, link: &str) -> Result<Inertia<f64>, Error> {
        let link = self.links[link];
        if link.child("gravity").is_some_and(|g| matches!(g.text.trim(), "false" | "0")) {
            self.warn(link, "<gravity> left out: all links feel it".to_owned());
        }
        let Some(inertial) = link.child("inertial") else {
            self.warnings.push(link.assumed("has no <inertial>: 1 kg and 1 kg m², as SDF has it"));
            return Ok(Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0)));
        };
        if inertial.attribute("auto").is_some_and(|a| matches!(a, "true" | "1")) {
            return Err(link.wrong("inertial: auto is not supported"));
        }
        let number =
            |e: Option<&Element>, tag: &str, otherwise| e.map_or(Ok(otherwise), |e| optional(link, e, tag, otherwise));
        let mass = number(Some(inertial), "mass", 1.0)?;
        if !(mass >= 0.0 && mass.is_finite()) {
            return Err(link.wrong(format!("mass is {mass} kg")));
        }
        let I = inertial.child("inertia");
        let rotational = Sym3 {
            xx: number(I, "ixx", 1.0)?,
            xy: number(I, "ixy", 0.0)?,
            yy: number(I, "iyy", 1.0)?,
            xz: number(I, "ixz", 0.0)?,
            yz: number(I, "iyz", 0.0)?,
            zz: number(I, "izz", 1.0)?,
        };
        Ok(poses::pose(link, inertial)?.act(Inertia::from_com(mass, Vec3::zero(), rotational)))
    }
}

/// The metres of a screw for each radian, positive where the thread is right-handed.
fn pitch(joint: &Element) -> Result<f64, Error> {
    let number = |tag| optional(joint, joint, tag, f64::NAN);
    let (each_turn, radians) = (number("screw_thread_pitch")?, number("thread_pitch")?);
    // thread_pitch: radians for each metre, positive where the thread is left-handed
    let pitch = if each_turn.is_nan() { -1.0 / radians } else { each_turn / core::f64::consts::TAU };
    if pitch.is_finite() { Ok(pitch) } else { Err(joint.wrong("has no finite screw_thread_pitch")) }
}

/// The options that an `<axis>` gives beside its direction. 1e16 and more is SDF's way to say that there is no limit, and so
/// is a negative effort or velocity.
fn limits(joint: &Element, axis: &Element, kind: Joint) -> Result<JointOptions, Error> {
    let number =
        |e: Option<&Element>, tag: &str, otherwise| e.map_or(Ok(otherwise), |e| optional(joint, e, tag, otherwise));
    let (limit, dynamics) = (axis.child("limit"), axis.child("dynamics"));
    let wide = |x: f64| if x.abs() >= 1e16 { x * f64::INFINITY } else { x };
    let lower = wide(number(limit, "lower", f64::NEG_INFINITY)?);
    let upper = wide(number(limit, "upper", f64::INFINITY)?);
    if lower > upper {
        return Err(joint.wrong(format!("lower limit {lower} is above upper limit {upper}")));
    }
    let bound = |x: f64| (0.0..f64::INFINITY).contains(&x).then_some(x);
    Ok(JointOptions {
        position: (kind.nq() == 1).then_some((lower, upper)),
        velocity: bound(number(limit, "velocity", -1.0)?),
        effort: bound(number(limit, "effort", -1.0)?).map(|effort| (-effort, effort)),
        damping: number(dynamics, "damping", 0.0)?,
        damping_polynomial: [0.0; 2],
        friction: number(dynamics, "friction", 0.0)?,
        armature: 0.0,
    })
}
