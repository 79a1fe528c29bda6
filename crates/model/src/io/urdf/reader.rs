//! Tree of links, joints and frames in a URDF, and the model that is built from this tree.

use super::UrdfOptions;
use super::elements::{array, needed, text};
use super::joints::{self, Moving};
use super::known;
use super::origin::Origins;
use super::transmission::armatures;
use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Mimic;
use crate::model::Model;
use crate::names::{near, nearest};
use crate::warning::Warning;
use condyle_spatial::{Act, Inertia, Se3, Sym3, Vec3};
use std::collections::{HashMap, HashSet};

/// Name of the link that a joint may name as its parent even if the file does not contain this link.
const WORLD_LINK: &str = "world";

/// Joint, and the two links that it connects.
struct Edge<'a> {
    element: &'a Element,
    parent: &'a str,
    child: &'a str,
}

/// Reader of one robot.
pub(super) struct Reader<'a> {
    robot: &'a Element,
    origins: Origins,
    links: HashMap<&'a str, &'a Element>,
    /// Names of the joints, in the order of the file.
    order: Vec<&'a str>,
    joints: HashMap<&'a str, Edge<'a>>,
    /// Name of the root link.
    root: &'a str,
    /// First joint whose parent is `world`, if the file contains no link with this name.
    on_world: Option<&'a Element>,
    /// Joints that each link carries, in the order of their names.
    children: HashMap<&'a str, Vec<&'a str>>,
}

impl<'a> Reader<'a> {
    /// Collects all links and joints, and finds their tree.
    pub(super) fn new(robot: &'a Element) -> Result<Self, Error> {
        if robot.tag != "robot" {
            return Err(robot.wrong("the root element of a URDF is <robot>"));
        }
        let (links, joints, children) = (HashMap::new(), HashMap::new(), HashMap::new());
        let origins = Origins::of(robot)?;
        let mut reader = Self { robot, origins, links, order: Vec::new(), joints, root: "", on_world: None, children };
        for element in robot.children.iter().filter(|c| matches!(&*c.tag, "link" | "joint" | "drake:joint")) {
            let Some(name) = element.attribute("name").filter(|n| !n.is_empty()) else {
                return Err(element.lacks("name"));
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

    /// Finds the root link and the children of each link. Every link except the root must be the child of exactly one
    /// joint, and all links must be connected.
    fn find_tree(&mut self) -> Result<(), Error> {
        let mut links: Vec<&str> = self.robot.all("link").filter_map(|l| l.attribute("name")).collect();
        let mut parent: HashMap<&str, &str> = HashMap::new();
        let mut names = self.order.clone();
        names.sort_unstable();
        for &name in &names {
            let Edge { element, parent: on, child } = self.joints[name];
            for link in [on, child] {
                if !self.links.contains_key(link) && (on, link) == (WORLD_LINK, WORLD_LINK) {
                    self.on_world = self.on_world.or(Some(element));
                } else if !self.links.contains_key(link) {
                    let near = near(&nearest(link, links.iter().copied()));
                    return Err(element.wrong(format!("no link is named `{link}`{near}")));
                }
            }
            if let Some(other) = parent.insert(child, name) {
                return Err(element.wrong(format!("link `{child}` is already the child of joint `{other}`")));
            }
            self.children.entry(on).or_default().push(name);
        }
        if self.on_world.is_some() {
            links.insert(0, WORLD_LINK);
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

    /// Builds the model.
    pub(super) fn model(&self, options: &UrdfOptions) -> Result<Model, Error> {
        let mut warnings = Vec::new();
        known::check(self.robot, &mut warnings);
        if let Some(joint) = self.on_world {
            warnings.push(joint.assumed("no link is named `world`: its parent is the world, as Drake reads it"));
        }
        let mut armatures = armatures(self.robot, &mut warnings);
        let mut builder = ModelBuilder::new(self.robot.attribute("name").unwrap_or_default());
        let own = self.inertia(self.root, &mut warnings)?;
        let root = match options.root_joint {
            None => {
                builder.merge(WORLD, Se3::identity(), own);
                WORLD
            }
            Some(joint) => {
                let name = self.root_joint();
                let root =
                    builder.body_with((self.root, &name), WORLD, joint, Se3::identity(), own, JointOptions::default());
                builder.frame_of_kind(&name, FrameKind::Joint, root, Se3::identity());
                root
            }
        };
        builder.frame_of_kind(self.root, FrameKind::Link, root, Se3::identity());
        // The joints are visited depth first. Each entry of the stack has a joint, the body that carries the joint, and
        // the placement of the joint's parent link in this body.
        let (mut bodies, mut links) = (HashMap::new(), HashMap::from([(self.root, (root, Se3::identity()))]));
        let mut waiting: Vec<(&str, BodyId, Se3<f64>)> = Vec::new();
        let wait = |waiting: &mut Vec<_>, link: &str, body: BodyId, bXl: Se3<f64>| {
            let joints: &[&str] = self.children.get(link).map_or(&[], |j| j);
            waiting.extend(joints.iter().rev().map(|&j| (j, body, bXl)));
        };
        wait(&mut waiting, self.root, root, Se3::identity());
        while let Some((name, parent, pXl)) = waiting.pop() {
            let Edge { element, child: link, .. } = self.joints[name];
            let pXl = pXl * self.origins.pose(element, element)?; // pose of the child link in the body
            let inertia = self.inertia(link, &mut warnings)?;
            let (body, bXl) = match joints::kind(element, &mut warnings)? {
                None => {
                    builder.merge(parent, pXl, inertia);
                    (parent, pXl)
                }
                Some(moving) => {
                    let mut options = joints::options(element, &moving, &mut warnings)?;
                    let Moving { first, joint, rotation } = moving;
                    if joint.nv() == 1 && first.is_none() {
                        options.armature = armatures.remove(name).map_or(0.0, |(armature, _)| armature);
                    }
                    let (parent, pXl) = match first {
                        None => (parent, pXl),
                        Some(first) => {
                            let between = (format!("{link}#1"), format!("{name}#1"));
                            let names = (&*between.0, &*between.1);
                            let on = builder.body_with(names, parent, first, pXl, Inertia::zero(), options.clone());
                            builder.between(on);
                            (on, Se3::identity())
                        }
                    };
                    let (pXb, bXl) = match rotation.map(|rotation| Se3::new(rotation, Vec3::zero())) {
                        None => (pXl, Se3::identity()),
                        Some(lXb) => (pXl * lXb, lXb.inverse()),
                    };
                    let inertia = if rotation.is_some() { bXl.act(inertia) } else { inertia };
                    let body = builder.body_with((link, name), parent, joint, pXb, inertia, options);
                    if first.is_none() {
                        bodies.insert(name, body);
                    }
                    (body, bXl)
                }
            };
            builder.frame_of_kind(name, FrameKind::Joint, body, bXl);
            builder.frame_of_kind(link, FrameKind::Link, body, bXl);
            links.insert(link, (body, bXl));
            wait(&mut waiting, link, body, bXl);
        }
        for (name, (_, transmission)) in armatures {
            let what = match self.joints.contains_key(name) {
                true => format!("its joint `{name}` has no single degree of freedom"),
                false => self.no_joint(name),
            };
            warnings.push(transmission.left_out(format!("{what}: M has no inertia of its rotor")));
        }
        self.add_frames(&mut builder, &links)?;
        self.add_mimics(&mut builder, &bodies, options.mimic, &mut warnings)?;
        let mut model = builder.build().map_err(|e| self.locate(e))?;
        model.warnings.append(&mut warnings);
        self.robot.accepted(model, options.strict, &options.allow)
    }

    /// Returns the name of the joint between the world and the root link. The name is `root_joint`. If the robot
    /// already has a joint with that name, the name is `root_joint_2`, `root_joint_3`, and so on.
    fn root_joint(&self) -> String {
        let mut name = String::from("root_joint");
        for k in 2.. {
            if !self.joints.contains_key(&*name) {
                break;
            }
            name = format!("root_joint_{k}");
        }
        name
    }

    /// Adds frames for the `<frame>` elements of Drake.
    fn add_frames(&self, builder: &mut ModelBuilder, links: &HashMap<&str, (BodyId, Se3<f64>)>) -> Result<(), Error> {
        for frame in self.robot.all("frame") {
            let (name, link) = (text(frame, frame, "name")?, text(frame, frame, "link")?);
            let (body, bXl) = match links.get(link) {
                Some(&link) => link,
                None if link == WORLD_LINK => (WORLD, Se3::identity()),
                None => {
                    let near = near(&nearest(link, links.keys().copied()));
                    return Err(frame.wrong(format!("no link is named `{link}`{near}")));
                }
            };
            builder.frame(name, body, bXl * self.origins.pose_of(frame, frame)?);
        }
        Ok(())
    }

    /// Returns the message that no joint has a given name.
    fn no_joint(&self, name: &str) -> String {
        format!("no joint is named `{name}`{}", near(&nearest(name, self.order.iter().copied())))
    }

    /// Couples followers to their leaders, or adds warnings that the followers move freely.
    fn add_mimics(
        &self,
        builder: &mut ModelBuilder,
        bodies: &HashMap<&str, BodyId>,
        mimic: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), Error> {
        for &name in &self.order {
            let joint = self.joints[name].element;
            let (Some(element), Some(&follower)) = (joint.child("mimic"), bodies.get(name)) else { continue };
            let leader = text(joint, element, "joint")?;
            let is_known = self.joints.contains_key(leader);
            if !mimic {
                let what = match is_known {
                    true => format!("has a <mimic> of joint `{leader}`: it is left free unless `mimic` is asked for"),
                    false => format!("has a <mimic>, but {}: it is free", self.no_joint(leader)),
                };
                warnings.push(joint.mimic(what));
                continue;
            }
            let Some(&leader) = bodies.get(leader) else {
                let why =
                    if is_known { "it has no single degree of freedom".to_owned() } else { self.no_joint(leader) };
                return Err(joint.wrong(format!("mimics `{leader}`: {why}")));
            };
            let number = |name, otherwise| Ok(array(joint, element, name)?.map_or(otherwise, |[x]| x));
            let (ratio, offset) = (number("multiplier", 1.0)?, number("offset", 0.0)?);
            builder.mimic(follower, leader, Mimic { ratio, offset });
        }
        Ok(())
    }

    /// Returns the link's inertia in the link's frame. Missing elements are 0, as in Drake, and cause a warning.
    fn inertia(&self, link: &str, warnings: &mut Vec<Warning>) -> Result<Inertia<f64>, Error> {
        let Some(&link) = self.links.get(link) else { return Ok(Inertia::zero()) };
        let Some(inertial) = link.child("inertial") else { return Ok(Inertia::zero()) };
        let mut missing = Vec::new();
        let (mass, inertia) = (inertial.child("mass"), inertial.child("inertia"));
        let mut number =
            |inside: Option<&Element>, name: &str| match inside.map_or(Ok(None), |e| array(link, e, name))? {
                Some([x]) => Ok(x),
                None => {
                    missing.push(if name == "value" { "mass" } else { name }.to_owned());
                    Ok(0.0)
                }
            };
        let mass = number(mass, "value")?;
        if mass < 0.0 {
            return Err(link.wrong(format!("mass is {mass} kg")));
        }
        let rotational = Sym3 {
            xx: number(inertia, "ixx")?,
            xy: number(inertia, "ixy")?,
            yy: number(inertia, "iyy")?,
            xz: number(inertia, "ixz")?,
            yz: number(inertia, "iyz")?,
            zz: number(inertia, "izz")?,
        };
        if !missing.is_empty() {
            warnings.push(link.assumed(format!("its <inertial> has no {}: 0", missing.join(", "))));
        }
        Ok(self.origins.pose(link, inertial)?.act(Inertia::from_com(mass, Vec3::zero(), rotational)))
    }

    /// Replaces an error of the builder by an error with the line number of the link or joint.
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
