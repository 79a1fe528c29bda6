//! Robots from URDF: kinematics, inertias, limits. Meshes are never looked at.

mod origin;

use super::files;
use super::xml::{self, Amount, Element};
use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::joint::{Joint, Mimic};
use crate::model::Model;
use crate::names::{near, nearest};
use crate::warning::WarningKind;
use condyle_spatial::{Act, Inertia, Se3, Sym3, Vec3};
use origin::Origins;
use std::collections::{HashMap, HashSet};
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

/// A joint, and the links that it connects.
struct Edge<'a> {
    element: &'a Element,
    parent: &'a str,
    child: &'a str,
}

struct Reader<'a> {
    robot: &'a Element,
    origins: Origins,
    links: HashMap<&'a str, &'a Element>,
    /// The names of the joints, in the order of the file.
    order: Vec<&'a str>,
    joints: HashMap<&'a str, Edge<'a>>,
    /// The root link.
    root: &'a str,
    /// The joints on each link, in the order of their names.
    children: HashMap<&'a str, Vec<&'a str>>,
}

impl<'a> Reader<'a> {
    /// Finds all links and joints, and their tree.
    fn new(robot: &'a Element) -> Result<Self, Error> {
        if robot.tag != "robot" {
            return Err(robot.wrong("the root element of a URDF is <robot>"));
        }
        let (links, joints, children) = (HashMap::new(), HashMap::new(), HashMap::new());
        let origins = Origins::of(robot)?;
        let mut reader = Self { robot, origins, links, order: Vec::new(), joints, root: "", children };
        for element in robot.children.iter().filter(|c| matches!(&*c.tag, "link" | "joint")) {
            let Some(name) = element.attribute("name").filter(|n| !n.is_empty()) else {
                return Err(element.wrong("has no name"));
            };
            let other = if element.tag == "link" {
                reader.links.insert(name, element)
            } else {
                let end = |tag: &str| text(element, needed(element, tag)?, "link");
                reader.order.push(name);
                let edge = Edge { element, parent: end("parent")?, child: end("child")? };
                reader.joints.insert(name, edge).map(|e| e.element)
            };
            if let Some(other) = other {
                return Err(element.wrong(format!("the name is taken by the {} on line {}", other.tag, other.line)));
            }
        }
        reader.find_tree()?;
        Ok(reader)
    }

    /// Finds root and children: every link but one is the child of one joint, and all hang together.
    fn find_tree(&mut self) -> Result<(), Error> {
        let links: Vec<&str> = self.robot.all("link").filter_map(|l| l.attribute("name")).collect();
        let mut parent: HashMap<&str, &str> = HashMap::new();
        let mut names = self.order.clone();
        names.sort_unstable();
        for &name in &names {
            let Edge { element, parent: on, child } = self.joints[name];
            for link in [on, child] {
                if !self.links.contains_key(link) {
                    let near = near(&nearest(link, links.iter().copied()));
                    return Err(element.wrong(format!("no link is named `{link}`{near}")));
                }
            }
            if let Some(other) = parent.insert(child, name) {
                return Err(element.wrong(format!("link `{child}` is already the child of joint `{other}`")));
            }
            self.children.entry(on).or_default().push(name);
        }
        let roots: Vec<&str> = links.iter().copied().filter(|l| !parent.contains_key(l)).collect();
        self.root = match roots[..] {
            [root] => root,
            [] if links.is_empty() => return Err(self.robot.wrong("has no links")),
            [] => return Err(self.joints[names[0]].element.wrong("is part of a cycle: every link has a parent")),
            [first, second, ..] => {
                let what = format!("has no parent, and neither has link `{first}`: a robot has one root");
                return Err(self.links[second].wrong(what));
            }
        };
        let mut reached = HashSet::new();
        let mut stack = vec![self.root];
        while let Some(link) = stack.pop() {
            reached.insert(link);
            stack.extend(self.children.get(link).into_iter().flatten().map(|j| self.joints[j].child));
        }
        match names.iter().map(|j| &self.joints[j]).find(|j| !reached.contains(j.child)) {
            Some(joint) => Err(joint.element.wrong("is part of a cycle that does not reach the root")),
            None => Ok(()),
        }
    }

    fn model(&self, options: &UrdfOptions) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(self.robot.attribute("name").unwrap_or_default());
        let own = self.inertia(self.links[self.root])?;
        let root = match options.root_joint {
            None => {
                builder.merge(WORLD, Se3::identity(), own);
                WORLD
            }
            Some(joint) => {
                let names = (self.root, "root_joint");
                let root = builder.body_with(names, WORLD, joint, Se3::identity(), own, JointOptions::default());
                builder.frame_of_kind("root_joint", FrameKind::Joint, root, Se3::identity());
                root
            }
        };
        builder.frame_of_kind(self.root, FrameKind::Link, root, Se3::identity());
        // depth first: each joint waits with the body that it sits on, and its link's placement there
        let mut bodies = HashMap::new();
        let mut waiting: Vec<(&str, BodyId, Se3<f64>)> = Vec::new();
        let wait = |waiting: &mut Vec<_>, link: &str, body: BodyId, bXl: Se3<f64>| {
            let joints: &[&str] = self.children.get(link).map_or(&[], |j| j);
            waiting.extend(joints.iter().rev().map(|&j| (j, body, bXl)));
        };
        wait(&mut waiting, self.root, root, Se3::identity());
        while let Some((name, parent, pXl)) = waiting.pop() {
            let Edge { element, child: link, .. } = self.joints[name];
            let pXj = pXl * self.origins.pose(element, element)?;
            let inertia = self.inertia(self.links[link])?;
            let (body, bXl) = match kind(element)? {
                None => {
                    builder.merge(parent, pXj, inertia);
                    (parent, pXj)
                }
                Some(kind) => {
                    let body = builder.body_with((link, name), parent, kind, pXj, inertia, joint_options(element)?);
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
        self.robot.accepted(model, options.strict, &options.allow)
    }

    /// Lets joints follow others.
    fn add_mimics(&self, builder: &mut ModelBuilder, bodies: &HashMap<&str, BodyId>) -> Result<(), Error> {
        for &name in &self.order {
            let joint = self.joints[name].element;
            let (Some(mimic), Some(&follower)) = (only(joint, "mimic")?, bodies.get(name)) else { continue };
            let leader = text(joint, mimic, "joint")?;
            let Some(&leader) = bodies.get(leader) else {
                return Err(joint.wrong(format!("mimics `{leader}`, which is no moving joint")));
            };
            let number = |name, otherwise| Ok(array(joint, mimic, name)?.map_or(otherwise, |[x]| x));
            let (ratio, offset) = (number("multiplier", 1.0)?, number("offset", 0.0)?);
            builder.mimic(follower, leader, Mimic { ratio, offset });
        }
        Ok(())
    }

    /// The link's inertia in the link's frame.
    fn inertia(&self, link: &Element) -> Result<Inertia<f64>, Error> {
        let Some(inertial) = only(link, "inertial")? else { return Ok(Inertia::zero()) };
        let number = |inside: &Element, name: &str| match array(link, inside, name)? {
            Some([x]) => Ok(x),
            None => Err(link.wrong_inside(inside, format!("{} has no {name}", inside.tag))),
        };
        let part = |tag: &str| {
            let found = only_inside(link, inertial, tag)?;
            found.ok_or_else(|| link.wrong_inside(inertial, format!("inertial has no <{tag}>")))
        };
        let (mass, I) = (number(part("mass")?, "value")?, part("inertia")?);
        if mass < 0.0 {
            return Err(link.wrong(format!("mass is {mass} kg")));
        }
        let rotational = Sym3 {
            xx: number(I, "ixx")?,
            xy: number(I, "ixy")?,
            yy: number(I, "iyy")?,
            xz: number(I, "ixz")?,
            yz: number(I, "iyz")?,
            zz: number(I, "izz")?,
        };
        Ok(self.origins.pose(link, inertial)?.act(Inertia::from_com(mass, Vec3::zero(), rotational)))
    }

    /// The error that the builder found, with the line of the link or joint.
    fn locate(&self, error: Error) -> Error {
        let own = "the name belongs to the library";
        let (link, joint) =
            (|name: &str| self.links.get(name).copied(), |name: &str| self.joints.get(name).map(|j| j.element));
        let (element, what) = match &error {
            Error::Body { body, what } => (link(body), &**what),
            Error::Joint { joint: name, what } => (joint(name), &**what),
            Error::Duplicate { kind: "body", name } => (link(name), own),
            Error::Duplicate { kind: "joint", name } => (joint(name), own),
            _ => (None, own),
        };
        element.map_or(error.clone(), |element| element.wrong(what))
    }
}

/// The joint, or none if it is fixed.
fn kind(joint: &Element) -> Result<Option<Joint>, Error> {
    let axis = match only(joint, "axis")? {
        Some(axis) => vector(joint, axis, "xyz")?.ok_or_else(|| joint.wrong_inside(axis, "axis has no xyz"))?,
        None => Vec3::new(1.0, 0.0, 0.0),
    };
    let kind = match text(joint, joint, "type")? {
        "fixed" => return Ok(None),
        "revolute" => Joint::Revolute { axis },
        "continuous" => Joint::Continuous { axis },
        "prismatic" => Joint::Prismatic { axis },
        "spherical" => Joint::Spherical,
        "planar" => Joint::Planar,
        "floating" => Joint::FreeFlyer,
        other => {
            let kinds = "revolute, continuous, prismatic, fixed, floating, planar, spherical";
            return Err(joint.wrong(format!("type `{other}` is none of {kinds}")));
        }
    };
    kind.normalized().map(Some).map_err(|what| joint.wrong(what))
}

/// The limits and losses of a joint that moves.
fn joint_options(joint: &Element) -> Result<JointOptions, Error> {
    let kind = joint.attribute("type").unwrap_or_default();
    let limited = matches!(kind, "revolute" | "prismatic");
    // a continuous joint may have limits of speed and effort; what a URDF says of joints without an axis has no unit
    let with_axis = limited || kind == "continuous";
    let (limit, dynamics) = (only(joint, "limit")?, only(joint, "dynamics")?);
    let mut options = JointOptions::default();
    if let Some(limit) = limit {
        let number = |name| read(joint, limit, name, xml::bound);
        let [lower, upper, effort, velocity] = ["lower", "upper", "effort", "velocity"].map(number);
        let (lower, upper, effort) = (lower?.unwrap_or(0.0), upper?.unwrap_or(0.0), effort?.unwrap_or(0.0));
        let velocity = velocity?.ok_or_else(|| joint.wrong_inside(limit, "limit has no velocity"))?;
        if limited && lower > upper {
            return Err(joint.wrong_inside(limit, format!("lower limit {lower} is above upper limit {upper}")));
        }
        options.position = limited.then_some((lower, upper));
        options.velocity = with_axis.then_some(velocity);
        options.effort = with_axis.then_some((-effort, effort));
    } else if limited {
        return Err(joint.wrong("is revolute or prismatic and has no <limit>"));
    }
    if let Some(dynamics) = dynamics {
        let number = |name| Ok(array(joint, dynamics, name)?.map_or(0.0, |[x]| x));
        let (damping, friction) = (number("damping")?, number("friction")?);
        (options.damping, options.friction) = if with_axis { (damping, friction) } else { (0.0, 0.0) };
    }
    Ok(options)
}

/// The child with a tag, of which there is at most one.
fn only<'a>(of: &'a Element, tag: &str) -> Result<Option<&'a Element>, Error> {
    only_inside(of, of, tag)
}

/// As [`only`], of something inside the link or joint that errors name.
fn only_inside<'a>(of: &Element, inside: &'a Element, tag: &str) -> Result<Option<&'a Element>, Error> {
    let mut found = inside.children.iter().filter(|c| c.tag == tag);
    match (found.next(), found.next()) {
        (_, Some(second)) => Err(of.wrong_inside(second, format!("has a second <{tag}>"))),
        (first, None) => Ok(first),
    }
}

fn needed<'a>(of: &'a Element, tag: &str) -> Result<&'a Element, Error> {
    only(of, tag)?.ok_or_else(|| of.wrong(format!("has no <{tag}>")))
}

/// The attribute, which has to be there. Errors name `of`.
fn text<'a>(of: &Element, inside: &'a Element, name: &str) -> Result<&'a str, Error> {
    inside.attribute(name).ok_or_else(|| of.wrong_inside(inside, format!("{} has no {name}", inside.tag)))
}

/// The attribute as a reader of text understands it, if it is there. Errors name `of`, the attribute and its value.
fn read<T>(
    of: &Element,
    inside: &Element,
    name: &str,
    f: impl Fn(&str) -> Result<T, String>,
) -> Result<Option<T>, Error> {
    let wrong = |what| of.wrong_inside(inside, format!("{} {name}: {what}", inside.tag));
    inside.attribute(name).map(f).transpose().map_err(wrong)
}

fn array<const N: usize>(of: &Element, inside: &Element, name: &str) -> Result<Option<[f64; N]>, Error> {
    read(of, inside, name, xml::array)
}

fn vector(of: &Element, inside: &Element, name: &str) -> Result<Option<Vec3<f64>>, Error> {
    Ok(array(of, inside, name)?.map(Vec3::from))
}
