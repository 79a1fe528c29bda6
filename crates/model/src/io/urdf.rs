//! Robots from URDF: kinematics, inertias, limits. Meshes are never looked at.
//!
//! roxmltree reads the file and knows the line of each element; urdf-rs then reads each link and joint on its own, with
//! `<visual>` and `<collision>` left out, so that whatever it refuses has a name and a line, and no mesh can be in the
//! way.

use super::{packages, xml};
use crate::body::FrameKind;
use crate::builder::{BodyId, JointOptions, ModelBuilder, WORLD};
use crate::error::Error;
use crate::joint::{Joint, Mimic};
use crate::model::Model;
use condyle_spatial::{Act, Inertia, Mat3, Se3, Sym3, Vec3};
use roxmltree::{Document, Node};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// How a URDF becomes a model.
#[derive(Clone, Debug, Default)]
pub struct UrdfOptions {
    /// The joint between the world and the root link, named `root_joint`; none fixes the root link to the world.
    pub root_joint: Option<Joint>,
    /// Whether joints with a `<mimic>` share the coordinate of the joint they follow, instead of having their own; see
    /// [`Mimic`].
    pub mimic: bool,
    /// Whether what is only odd ([`Model::warnings`]) is an error.
    pub strict: bool,
    /// Folders that have packages in them, or are packages, for `package://` addresses; before those that the
    /// environment names in `ROS_PACKAGE_PATH` and, with `/share` behind them, in `AMENT_PREFIX_PATH`.
    pub packages: Vec<PathBuf>,
}

impl Model {
    /// Reads a URDF file, given by its path or as `package://name/path/in/the/package`
    /// ([`UrdfOptions::packages`]).
    ///
    /// Shapes are not read, and the meshes that they name need not be there.
    /// Fixed joints are merged into the body that they sit on and stay as frames; siblings are numbered in the order of
    /// their joints' names (bytes), as Pinocchio does.
    ///
    /// # Errors
    /// [`Error::Package`], [`Error::File`], [`Error::Xml`], [`Error::Urdf`] (with file, line and element), and what
    /// [`ModelBuilder::build`] finds.
    pub fn from_urdf(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Self, Error> {
        let path = packages::locate(path.as_ref(), &options.packages)?;
        let file = path.display().to_string();
        Reader::new(&xml::read(&path)?, &file)?.model(options)
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
        Reader::new(text, "<string>")?.model(options)
    }
}

/// How deep elements may be nested (urdf-rs is recursive); a URDF needs six levels.
const MAX_DEPTH: usize = 32;

/// A link or joint, and the line on which it begins.
struct Element<T> {
    line: u32,
    content: T,
    /// Whether it is a joint with a `<limit>`: to urdf-rs, none is the same as zeros.
    limit: bool,
}

struct Reader<'a> {
    file: &'a str,
    name: String,
    links: HashMap<String, Element<urdf_rs::Link>>,
    joints: HashMap<String, Element<urdf_rs::Joint>>,
    /// The root link.
    root: String,
    /// The joints on each link, in the order of their names.
    children: HashMap<String, Vec<String>>,
}

impl<'a> Reader<'a> {
    /// Reads all elements, and finds the tree.
    fn new(text: &'a str, file: &'a str) -> Result<Self, Error> {
        let document = Document::parse(text).map_err(|e| Error::Xml {
            file: file.to_owned(),
            line: e.pos().row,
            what: e.to_string(),
        })?;
        let robot = document.root_element();
        let mut reader = Self {
            file,
            name: robot.attribute("name").unwrap_or_default().to_owned(),
            links: HashMap::new(),
            joints: HashMap::new(),
            root: String::new(),
            children: HashMap::new(),
        };
        if robot.tag_name().name() != "robot" {
            let what = "the root element of a URDF is <robot>".to_owned();
            let line = document.text_pos_at(robot.range().start).row;
            return Err(reader.wrong(line, format!("<{}>", robot.tag_name().name()), what));
        }
        let mut order = Vec::new();
        for node in robot.children().filter(|n| n.is_element()) {
            let tag = node.tag_name().name();
            if (tag != "link" && tag != "joint") || node.tag_name().namespace() != robot.tag_name().namespace() {
                continue;
            }
            let line = document.text_pos_at(node.range().start).row;
            let Some(name) = node.attribute("name").filter(|n| !n.is_empty()) else {
                return Err(reader.wrong(line, format!("<{tag}>"), "has no name".to_owned()));
            };
            let limit = node.children().any(|c| c.has_tag_name("limit"));
            let parsed = reader.parse(text, node, line, name)?;
            let other = if tag == "link" {
                let content = parsed.links.into_iter().next().expect("one element in, one out");
                order.push(name.to_owned());
                reader.links.insert(name.to_owned(), Element { line, content, limit }).map(|e| e.line)
            } else {
                let content = parsed.joints.into_iter().next().expect("one element in, one out");
                reader.joints.insert(name.to_owned(), Element { line, content, limit }).map(|e| e.line)
            };
            if let Some(other) = other {
                let what = format!("the name is taken by the {tag} on line {other}");
                return Err(reader.wrong(line, format!("{tag} `{name}`"), what));
            }
        }
        reader.find_tree(&order)?;
        Ok(reader)
    }

    fn wrong(&self, line: u32, element: String, what: String) -> Error {
        Error::Urdf { file: self.file.to_owned(), line, element, what }
    }

    fn wrong_joint(&self, joint: &Element<urdf_rs::Joint>, what: String) -> Error {
        self.wrong(joint.line, format!("joint `{}`", joint.content.name), what)
    }

    /// One link or joint, without its shapes, as urdf-rs reads it.
    fn parse(&self, text: &str, node: Node, line: u32, name: &str) -> Result<urdf_rs::Robot, Error> {
        let tag = node.tag_name().name();
        let wrong = |what: String| self.wrong(line, format!("{tag} `{name}`"), what);
        if node.descendants().any(|n| n.ancestors().nth(MAX_DEPTH).is_some()) {
            return Err(wrong(format!("is nested more than {MAX_DEPTH} levels deep")));
        }
        let mut element = String::from("<robot name=\"_\"");
        for prefix in node.namespaces().filter_map(|n| n.name()).filter(|&p| p != "xml") {
            element.push_str(&format!(" xmlns:{prefix}=\"_\""));
        }
        element.push('>');
        let mut from = node.range().start;
        for shape in node.children().filter(|c| c.has_tag_name("visual") || c.has_tag_name("collision")) {
            element.push_str(&text[from..shape.range().start]);
            from = shape.range().end;
        }
        element.push_str(&text[from..node.range().end]);
        element.push_str("</robot>");
        urdf_rs::read_from_string(&element).map_err(|e| wrong(e.to_string().replace("custom: ", "")))
    }

    /// Finds root and children: every link but one is the child of one joint, and all hang together.
    fn find_tree(&mut self, order: &[String]) -> Result<(), Error> {
        let mut parent: HashMap<&str, &Element<urdf_rs::Joint>> = HashMap::new();
        let mut joints: Vec<_> = self.joints.values().collect();
        joints.sort_by(|a, b| a.content.name.as_bytes().cmp(b.content.name.as_bytes()));
        let mut children: HashMap<String, Vec<String>> = HashMap::new();
        for &joint in &joints {
            for link in [&joint.content.parent.link, &joint.content.child.link] {
                if !self.links.contains_key(link) {
                    let near = crate::error::nearest(link, order.iter().map(String::as_str));
                    return Err(self.wrong_joint(joint, format!("no link is named `{link}`; nearest is `{near}`")));
                }
            }
            if let Some(other) = parent.insert(&joint.content.child.link, joint) {
                let (child, other) = (&joint.content.child.link, &other.content.name);
                return Err(self.wrong_joint(joint, format!("link `{child}` is already the child of joint `{other}`")));
            }
            children.entry(joint.content.parent.link.clone()).or_default().push(joint.content.name.clone());
        }
        let roots: Vec<&String> = order.iter().filter(|l| !parent.contains_key(l.as_str())).collect();
        let root = match roots[..] {
            [root] => root.clone(),
            [] if order.is_empty() => return Err(self.wrong(1, "<robot>".to_owned(), "has no links".to_owned())),
            [] => return Err(self.wrong_joint(joints[0], "is part of a cycle: every link has a parent".to_owned())),
            [first, second, ..] => {
                let what = format!("has no parent, and neither has link `{first}`: a robot has one root");
                return Err(self.wrong(self.links[second].line, format!("link `{second}`"), what));
            }
        };
        let mut reached = HashSet::new();
        let mut stack = vec![root.as_str()];
        while let Some(link) = stack.pop() {
            reached.insert(link);
            let below = children.get(link).into_iter().flatten();
            stack.extend(below.map(|j| self.joints[j].content.child.link.as_str()));
        }
        if let Some(joint) = joints.iter().find(|j| !reached.contains(j.content.child.link.as_str())) {
            return Err(self.wrong_joint(joint, "is part of a cycle that does not reach the root".to_owned()));
        }
        (self.root, self.children) = (root, children);
        Ok(())
    }

    fn model(&self, options: &UrdfOptions) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(&self.name);
        let inertia = self.inertia(&self.root)?;
        let root = match options.root_joint {
            None => {
                builder.merge(WORLD, Se3::identity(), inertia);
                WORLD
            }
            Some(joint) => {
                let names = (self.root.as_str(), "root_joint");
                let root = builder.body_with(names, WORLD, joint, Se3::identity(), inertia, JointOptions::default());
                builder.frame_of_kind("root_joint", FrameKind::Joint, root, Se3::identity());
                root
            }
        };
        builder.frame_of_kind(&self.root, FrameKind::Link, root, Se3::identity());
        // depth first: each joint waits with the body that it sits on, and its link's placement there
        let mut bodies = HashMap::new();
        let mut waiting: Vec<(&str, BodyId, Se3<f64>)> = Vec::new();
        let wait = |waiting: &mut Vec<_>, link: &str, body: BodyId, bXl: Se3<f64>| {
            let joints: &[String] = self.children.get(link).map_or(&[], |j| j);
            waiting.extend(joints.iter().rev().map(|j| (self.joints[j].content.name.as_str(), body, bXl)));
        };
        wait(&mut waiting, &self.root, root, Se3::identity());
        while let Some((name, parent, pXl)) = waiting.pop() {
            let joint = &self.joints[name];
            let link = joint.content.child.link.as_str();
            let pXj = pXl * pose(&joint.content.origin);
            let inertia = self.inertia(link)?;
            let (body, bXl) = match self.kind(joint)? {
                None => {
                    builder.merge(parent, pXj, inertia);
                    (parent, pXj)
                }
                Some(kind) => {
                    let body = builder.body_with((link, name), parent, kind, pXj, inertia, self.options(joint)?);
                    bodies.insert(name, body);
                    (body, Se3::identity())
                }
            };
            builder.frame_of_kind(name, FrameKind::Joint, body, bXl);
            builder.frame_of_kind(link, FrameKind::Link, body, bXl);
            wait(&mut waiting, link, body, bXl);
        }
        if options.mimic {
            self.add_mimics(&mut builder, &bodies)?;
        }
        let model = builder.build().map_err(|e| self.locate(e))?;
        match model.warnings().first() {
            Some(warning) if options.strict => {
                Err(Error::Strict { file: self.file.to_owned(), warning: warning.clone() })
            }
            _ => Ok(model),
        }
    }

    /// The error that the builder found, with the line of the link or joint.
    fn locate(&self, error: Error) -> Error {
        let own = || "the name belongs to the library".to_owned();
        match &error {
            Error::Body { body: name, what } if self.links.contains_key(name) => {
                self.wrong(self.links[name].line, format!("link `{name}`"), what.clone())
            }
            Error::Joint { joint: name, what } if self.joints.contains_key(name) => {
                self.wrong_joint(&self.joints[name], what.clone())
            }
            Error::Duplicate { kind: "body", name } if self.links.contains_key(name) => {
                self.wrong(self.links[name].line, format!("link `{name}`"), own())
            }
            Error::Duplicate { kind: "joint", name } if self.joints.contains_key(name) => {
                self.wrong_joint(&self.joints[name], own())
            }
            _ => error,
        }
    }
}

/// The kind of joint, its options, its inertia: one element at a time.
impl Reader<'_> {
    /// The joint, or none if it is fixed.
    fn kind(&self, joint: &Element<urdf_rs::Joint>) -> Result<Option<Joint>, Error> {
        let (axis, origin) = (Vec3::from(joint.content.axis.xyz.0), &joint.content.origin);
        if origin.xyz.0.iter().chain(&origin.rpy.0).any(|x| !x.is_finite()) {
            return Err(self.wrong_joint(joint, "its origin is not finite".to_owned()));
        }
        let kind = match joint.content.joint_type {
            urdf_rs::JointType::Fixed => return Ok(None),
            urdf_rs::JointType::Revolute => Joint::Revolute { axis },
            urdf_rs::JointType::Continuous => Joint::Continuous { axis },
            urdf_rs::JointType::Prismatic => Joint::Prismatic { axis },
            urdf_rs::JointType::Spherical => Joint::Spherical,
            urdf_rs::JointType::Planar => Joint::Planar,
            urdf_rs::JointType::Floating => Joint::FreeFlyer,
        };
        let direction = |_| format!("its axis ({} {} {}) is no direction", axis.x, axis.y, axis.z);
        kind.normalized().map(Some).map_err(|what| self.wrong_joint(joint, direction(what)))
    }

    fn options(&self, joint: &Element<urdf_rs::Joint>) -> Result<JointOptions, Error> {
        let (limit, dynamics) = (&joint.content.limit, joint.content.dynamics.clone().unwrap_or_default());
        let limited = matches!(joint.content.joint_type, urdf_rs::JointType::Revolute | urdf_rs::JointType::Prismatic);
        if limited && !joint.limit {
            return Err(self.wrong_joint(joint, "is revolute or prismatic and has no <limit>".to_owned()));
        }
        // a continuous joint may have limits of speed and effort; what a URDF says of joints without an axis has no unit
        let with_axis = limited || matches!(joint.content.joint_type, urdf_rs::JointType::Continuous);
        let bounded = with_axis && joint.limit;
        let numbers = [limit.lower, limit.upper, limit.effort, limit.velocity, dynamics.damping, dynamics.friction];
        if numbers.iter().any(|x| x.is_nan()) {
            return Err(self.wrong_joint(joint, "a limit, damping or friction is not a number".to_owned()));
        }
        if limited && limit.lower > limit.upper {
            let what = format!("lower limit {} is above upper limit {}", limit.lower, limit.upper);
            return Err(self.wrong_joint(joint, what));
        }
        Ok(JointOptions {
            position: limited.then_some((limit.lower, limit.upper)),
            velocity: bounded.then_some(limit.velocity),
            effort: bounded.then_some(limit.effort),
            damping: if with_axis { dynamics.damping } else { 0.0 },
            friction: if with_axis { dynamics.friction } else { 0.0 },
            armature: 0.0,
        })
    }

    /// The link's inertia in the link's frame.
    fn inertia(&self, link: &str) -> Result<Inertia<f64>, Error> {
        let element = &self.links[link];
        let inertial = &element.content.inertial;
        let (mass, I) = (inertial.mass.value, &inertial.inertia);
        let numbers = [I.ixx, I.ixy, I.ixz, I.iyy, I.iyz, I.izz, mass];
        let wrong = |what| Err(self.wrong(element.line, format!("link `{link}`"), what));
        let origin = inertial.origin.xyz.0.iter().chain(&inertial.origin.rpy.0);
        if numbers.iter().chain(origin).any(|x| !x.is_finite()) {
            return wrong("mass, inertia or its origin is not finite".to_owned());
        }
        if mass < 0.0 {
            return wrong(format!("mass is {mass} kg"));
        }
        let rotational = Sym3 { xx: I.ixx, xy: I.ixy, yy: I.iyy, xz: I.ixz, yz: I.iyz, zz: I.izz };
        Ok(pose(&inertial.origin).act(Inertia::from_com(mass, Vec3::zero(), rotational)))
    }

    /// Lets joints follow others.
    fn add_mimics(&self, builder: &mut ModelBuilder, bodies: &HashMap<&str, BodyId>) -> Result<(), Error> {
        for joint in self.joints.values() {
            let Some(mimic) = &joint.content.mimic else { continue };
            let Some(&follower) = bodies.get(joint.content.name.as_str()) else { continue };
            let Some(&leader) = bodies.get(mimic.joint.as_str()) else {
                let what = format!("mimics `{}`, which is no moving joint", mimic.joint);
                return Err(self.wrong_joint(joint, what));
            };
            let (ratio, offset) = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
            builder.mimic(follower, leader, Mimic { ratio, offset });
        }
        Ok(())
    }
}

/// xyz and rpy as a pose: R = Rz(yaw) Ry(pitch) Rx(roll).
fn pose(origin: &urdf_rs::Pose) -> Se3<f64> {
    let [(sr, cr), (sp, cp), (sy, cy)] = origin.rpy.0.map(f64::sin_cos);
    let rotation = Mat3 {
        x: Vec3::new(cy * cp, sy * cp, -sp),
        y: Vec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        z: Vec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    };
    Se3::new(rotation, origin.xyz.0.into())
}
