//! Conversion of the links and joints of an SDF to bodies. Each link belongs to a body and has a placement in the frame
//! of this body.

use super::SdfOptions;
use super::inertia::{flags, inertia};
use super::joints::{Axis, Motion, motions, motor, reversed};
use super::mimics::Axes;
use super::scopes::{Place, Scopes};
use super::tree::{Edge, GEARBOX, Tree};
use super::values::flag;
use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use crate::model::Model;
use crate::warning::Warning;
use condyle_spatial::{Act, Inertia, Se3, Vec3};
use std::collections::HashSet;

/// Name of the joint that carries a root link.
const ROOT_JOINT: &str = "root_joint";

/// Reader of the models of a file.
pub(super) struct Reader<'a> {
    pub(super) scopes: Scopes<'a>,
    /// Joints in the order of the file. Gearboxes, and joints between links that are fixed to the world, are left out.
    pub(super) edges: Vec<Edge<'a>>,
    pub(super) gearboxes: Vec<Edge<'a>>,
    pub(super) axes: Axes<'a>,
    pub(super) warnings: Vec<Warning>,
    /// Body and placement of each item. The entries are valid for links that have been placed.
    placed: Vec<(BodyId, Se3<f64>)>,
}

impl<'a> Reader<'a> {
    /// Reads the names, poses and joints of models and of the world around these models.
    pub(super) fn new(world: &'a Element, models: &[&'a Element], warnings: Vec<Warning>) -> Result<Self, Error> {
        let mut scopes = Scopes::new(world, models)?;
        let placed = vec![(WORLD, Se3::identity()); scopes.items.len()];
        let joints: Vec<usize> = scopes.all("joint").collect();
        let (mut edges, mut gearboxes) = (Vec::new(), Vec::new());
        let mut reader_warnings = warnings;
        for item in joints {
            let edge = Edge::new(&mut scopes, item)?;
            let ends = [edge.parent, Some(edge.child)];
            if edge.kind == GEARBOX {
                gearboxes.push(edge);
            } else if ends.iter().all(|end| end.is_none_or(|link| scopes.is_static(link))) {
                if edge.kind != "fixed" {
                    let what = "does not move: its model is static, and all links of it are fixed to the world";
                    reader_warnings.push(edge.element.left_out(what));
                }
            } else {
                edges.push(edge);
            }
        }
        Ok(Self { scopes, edges, gearboxes, axes: Axes::default(), warnings: reader_warnings, placed })
    }

    /// Returns the body to which a link or the world belongs, and the placement in the frame of this body.
    pub(super) fn place(&self, link: Place) -> (BodyId, Se3<f64>) {
        link.map_or((WORLD, Se3::identity()), |item| self.placed[item])
    }

    /// Builds the model.
    pub(super) fn build(
        &mut self,
        name: &str,
        gravity: Option<Vec3<f64>>,
        options: &SdfOptions,
    ) -> Result<Model, Error> {
        let mut builder = ModelBuilder::new(name);
        if let Some(gravity) = gravity {
            builder.gravity(gravity);
        }
        let links: Vec<usize> = self.scopes.all("link").collect();
        for item in self.scopes.all("model").chain(links.iter().copied()) {
            flags(self.scopes.items[item].element, &mut self.warnings)?;
        }
        let fixed: Vec<usize> = links.iter().copied().filter(|&link| self.scopes.is_static(link)).collect();
        let tree = Tree::new(&self.edges, &links, &fixed);
        for &link in &fixed {
            self.fix(&mut builder, link)?;
        }
        let on_world: Vec<Place> = [None].into_iter().chain(fixed.into_iter().map(Some)).collect();
        self.walk(&mut builder, &tree, &on_world)?;
        self.roots(&mut builder, &tree, options.root_joint)?;
        for &i in &tree.loops {
            let edge = self.edges[i].clone();
            self.close(&mut builder, &edge)?;
        }
        self.gearboxes(&mut builder)?;
        self.frames(&mut builder)?;
        self.axes.follow(&self.scopes, &mut builder, options.mimic, &mut self.warnings)?;
        builder.build().map_err(|e| self.at_element(e))
    }

    /// Attaches root links to their root joints or to the world, and adds the trees of these root links.
    fn roots(&mut self, builder: &mut ModelBuilder, tree: &Tree, root_joint: Option<Joint>) -> Result<(), Error> {
        let is_one = tree.roots.len() == 1 && !self.edges.iter().any(|e| e.parent.is_none());
        let taken: HashSet<String> = self.scopes.all("joint").map(|item| self.scopes.name(item).to_owned()).collect();
        let mut number = 0;
        for &root in &tree.roots {
            let Some(joint) = root_joint else {
                if !is_one {
                    let element = self.scopes.items[root].element;
                    let what = "no joint carries it: it is fixed to the world, unless a root joint is asked for";
                    self.warnings.push(element.assumed(what));
                }
                self.fix(builder, root)?;
                self.walk(builder, tree, &[Some(root)])?;
                continue;
            };
            let name = loop {
                number += 1;
                let name = if number == 1 { ROOT_JOINT.to_owned() } else { format!("{ROOT_JOINT}#{number}") };
                if !taken.contains(&name) {
                    break name;
                }
            };
            let link = self.scopes.name(root).to_owned();
            let inertia = inertia(&self.scopes, root, &mut self.warnings)?;
            let names = (&*link, &*name);
            let body = builder.body_with(names, WORLD, joint, Se3::identity(), inertia, JointOptions::default());
            builder.frame_of_kind(&name, FrameKind::Joint, body, Se3::identity());
            self.put(builder, root, (body, Se3::identity()), None)?;
            self.walk(builder, tree, &[Some(root)])?;
        }
        Ok(())
    }

    /// Fixes a link to the world at its pose. The inertia of such a link has no effect, so faults of the inertia cause
    /// no warnings.
    fn fix(&mut self, builder: &mut ModelBuilder, link: usize) -> Result<(), Error> {
        let mut unsaid = Vec::new();
        let warnings = if self.scopes.is_static(link) { &mut unsaid } else { &mut self.warnings };
        let inertia = inertia(&self.scopes, link, warnings)?;
        let oXl = self.scopes.in_world(link);
        builder.merge(WORLD, oXl, inertia);
        self.put(builder, link, (WORLD, oXl), Some(inertia))
    }

    /// Stores the body and placement of a link, and adds the link's frame. If the link is merged into the body,
    /// `merged` is the link's inertia, in the link's frame.
    fn put(
        &mut self,
        builder: &mut ModelBuilder,
        link: usize,
        at: (BodyId, Se3<f64>),
        merged: Option<Inertia<f64>>,
    ) -> Result<(), Error> {
        self.placed[link] = at;
        builder.frame_of_kind(self.scopes.name(link), FrameKind::Link, at.0, at.1);
        let ratio = if flag(self.scopes.items[link].element, "gravity", true)? { 0.0 } else { 1.0 };
        match merged {
            Some(inertia) => builder.compensate_gravity_of_part(at.0, at.1, inertia, ratio),
            None => builder.compensate_gravity(at.0, ratio),
        }
        Ok(())
    }

    /// Adds the joints and links that the links in `from` carry, directly or indirectly, in depth-first order.
    fn walk(&mut self, builder: &mut ModelBuilder, tree: &Tree, from: &[Place]) -> Result<(), Error> {
        let on = |at: Place| tree.on.get(&at).into_iter().flatten().rev().copied();
        let mut waiting: Vec<(usize, bool)> = from.iter().rev().flat_map(|&at| on(at)).collect();
        while let Some((i, is_reversed)) = waiting.pop() {
            let edge = self.edges[i].clone();
            let (scope, child) = (self.scopes.items[edge.item].scope, edge.child);
            let (mXc, cXj) = (self.scopes.in_scope(Some(child), scope), self.scopes.joint_in_child(edge.item, child)?);
            let mXp = self.scopes.in_scope(edge.parent, scope);
            let next = match edge.parent {
                Some(parent) if is_reversed => {
                    let (body, bXc) = self.place(Some(child));
                    let jXp = (mXc * cXj).inverse() * mXp;
                    self.joint(builder, &edge, parent, (body, bXc * cXj), jXp, true)?;
                    parent
                }
                _ => {
                    let (body, bXp) = self.place(edge.parent);
                    let bXj = bXp * mXp.inverse() * mXc * cXj;
                    self.joint(builder, &edge, child, (body, bXj), cXj.inverse(), false)?;
                    child
                }
            };
            waiting.extend(on(Some(next)));
        }
        Ok(())
    }

    /// Adds a joint to a body, at the placement bXj, and the link that the joint carries.
    fn joint(
        &mut self,
        builder: &mut ModelBuilder,
        edge: &Edge<'a>,
        link: usize,
        (parent, bXj): (BodyId, Se3<f64>),
        jXl: Se3<f64>,
        is_reversed: bool,
    ) -> Result<(), Error> {
        let Edge { element, item, .. } = *edge;
        let in_link = inertia(&self.scopes, link, &mut self.warnings)?;
        let inertia = jXl.act(in_link);
        let (name, child) = (self.scopes.name(item).to_owned(), self.scopes.name(link).to_owned());
        motor(element, &mut self.warnings)?;
        let mut motions = motions(&self.scopes, edge, &mut self.warnings)?;
        if is_reversed {
            motions.reverse();
            if edge.kind == "ball" {
                let what = "its child carries its parent: its position is that of the parent, seen from the child";
                self.warnings.push(element.assumed(what));
            }
        }
        let (mut body, mut at) = (parent, bXj);
        let count = motions.len();
        if count == 1 && element.child("axis2").is_some() {
            self.warnings.push(element.left_out(format!("axis2 is left out: a {} joint has none", edge.kind)));
        }
        for (k, Motion { joint, tag }) in motions.into_iter().enumerate() {
            let joint = joint.normalized().map_err(|_| element.wrong(format!("{tag}: xyz is no direction")))?;
            let joint = if is_reversed { reversed(joint) } else { joint };
            let Axis { options, spring } = Axis::new(element, tag, joint, &mut self.warnings)?;
            let last = k + 1 == count;
            let (link, called, inertia) = if last {
                (child.clone(), name.clone(), inertia)
            } else {
                (format!("{child}#{}", k + 1), format!("{name}#{}", k + 1), Inertia::zero())
            };
            body = builder.body_with((&link, &called), body, joint, at, inertia, options);
            self.axes.add(item, element, tag, body);
            match (joint, spring) {
                (_, (0.0, _)) => {}
                (Joint::Spherical, _) => self.warnings.push(element.left_out("the spring of a ball is left out")),
                (Joint::Continuous { .. }, (k, at)) => builder.spring(body, [k, 0.0, 0.0], &[at.cos(), at.sin()]),
                (_, (k, at)) => builder.spring(body, [k, 0.0, 0.0], &[at]),
            }
            if !last {
                builder.between(body);
            }
            at = Se3::identity();
        }
        if count == 0 {
            builder.merge(body, at, inertia);
        }
        builder.frame_of_kind(&name, FrameKind::Joint, body, at);
        self.put(builder, link, (body, at * jXl), (count == 0).then_some(in_link))
    }

    /// Adds frames for the `<frame>` elements and nested models of the file.
    fn frames(&mut self, builder: &mut ModelBuilder) -> Result<(), Error> {
        for item in 0..self.scopes.items.len() {
            let element = self.scopes.items[item].element;
            if !matches!(&*element.tag, "frame" | "model") {
                continue;
            }
            let link = self.scopes.attached(Some(item), element)?;
            if self.scopes.is_hidden(item) {
                continue;
            }
            let scope = self.scopes.items[item].scope;
            let (body, bXl) = self.place(link);
            let mXl = self.scopes.in_scope(link, scope);
            let placement = bXl * mXl.inverse() * self.scopes.items[item].pose;
            builder.frame_of_kind(self.scopes.name(item), FrameKind::User, body, placement);
        }
        Ok(())
    }

    /// Replaces an error of the builder by an error that names the element in the file.
    fn at_element(&self, error: Error) -> Error {
        let (tag, name, what) = match &error {
            Error::Body { body, what } => ("link", body, what),
            Error::Joint { joint, what } => ("joint", joint, what),
            _ => return error,
        };
        let name = name.trim_end_matches("#1");
        let found = self.scopes.all(tag).find(|&item| self.scopes.name(item) == name);
        found.map_or(error.clone(), |item| self.scopes.items[item].element.wrong(what.clone()))
    }
}
