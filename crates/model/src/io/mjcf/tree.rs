//! Bodies of an MJCF: their joints, inertias and frames.

use super::Reader;
use super::attributes::{Attributes, MAIN};
use super::compiler::{FromGeoms, from_to};
use super::geometry::{self, Weight};
use super::mesh::Solid;
use super::spring::FileJoint;
use crate::body::FrameKind;
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::io::xml::Element;
use crate::joint::Joint;
use condyle_spatial::{Act, Inertia, Se3};

/// Elements of a body by kind, including the elements inside its `<frame>`s. Each element has the pose of the `<frame>`
/// around it.
#[derive(Default)]
pub(super) struct Parts<'a> {
    pub(super) inertial: Option<(&'a Element, Se3<f64>)>,
    pub(super) joints: Vec<(Attributes<'a>, Se3<f64>)>,
    pub(super) geoms: Vec<(Attributes<'a>, Se3<f64>)>,
    pub(super) sites: Vec<(Attributes<'a>, Se3<f64>)>,
    pub(super) cameras: Vec<(Attributes<'a>, Se3<f64>)>,
    /// `<frame>`s with a name, each with its own pose.
    pub(super) frames: Vec<(&'a Element, Se3<f64>)>,
    /// Child bodies, each with its own pose and the default class of its parent element.
    pub(super) bodies: Vec<(&'a Element, Se3<f64>, &'a str)>,
}

/// Body that has not been added yet.
struct Waiting<'a> {
    element: &'a Element,
    class: &'a str,
    /// Body of the model to which the parent element belongs.
    on: BodyId,
    /// Pose of the parent element in the body `on`.
    placement: Se3<f64>,
    /// Whether the parent element is the world itself.
    top: bool,
}

/// Named frame or camera. It is added to the model after all sites, because sites have priority for names.
pub(super) struct Placed<'a> {
    element: &'a Element,
    body: BodyId,
    placement: Se3<f64>,
}

impl<'a> Reader<'a> {
    /// Adds all bodies, each after its parent.
    pub(super) fn tree(&mut self, builder: &mut ModelBuilder, root: &'a Element) -> Result<(), Error> {
        for world in root.all("worldbody") {
            let mut parts = Parts::default();
            self.gather(world, Se3::identity(), MAIN, &mut parts)?;
            let joint = parts.joints.first().map(|(a, _)| a.element);
            if let Some(joint) = joint.or(parts.inertial.map(|(e, _)| e)) {
                return Err(joint.wrong("the world has neither joints nor inertia"));
            }
            self.frames(builder, &parts, WORLD, Se3::identity())?;
            let mut waiting = Vec::new();
            wait(&mut waiting, &parts, WORLD, Se3::identity(), true);
            while let Some(next) = waiting.pop() {
                let (parts, body, bXl) = self.body(builder, &next)?;
                wait(&mut waiting, &parts, body, bXl, false);
            }
        }
        Ok(())
    }

    /// Sorts the content of an element by kind. `X` is the pose of the surrounding `<frame>`.
    pub(super) fn gather(
        &self,
        inside: &'a Element,
        X: Se3<f64>,
        class: &'a str,
        parts: &mut Parts<'a>,
    ) -> Result<(), Error> {
        let defaults = |e: &Element| &self.source(e).defaults;
        let own = inside.attribute("childclass").map_or(Ok(class), |c| defaults(inside).known(inside, c))?;
        for e in &inside.children {
            let around = if e.source == inside.source { own } else { MAIN }; // each file has its own default classes
            let pose = || Ok::<_, Error>(X * self.compiler(e).pose(&Attributes::plain(e))?);
            match e.tag.as_str() {
                "joint" => parts.joints.push((self.of(e, around)?, X)),
                "freejoint" => parts.joints.push((Attributes::plain(e), X)),
                "inertial" if parts.inertial.is_some() => return Err(e.wrong("the body has another one")),
                "inertial" => parts.inertial = Some((e, X)),
                "geom" => parts.geoms.push((self.of(e, around)?, X)),
                "site" => parts.sites.push((self.of(e, around)?, X)),
                "camera" => parts.cameras.push((self.of(e, around)?, X)),
                "body" => parts.bodies.push((e, pose()?, around)),
                "frame" => {
                    let pose = pose()?;
                    if e.attribute("name").is_some_and(|name| !name.is_empty()) {
                        parts.frames.push((e, pose));
                    }
                    self.gather(e, pose, around, parts)?;
                }
                "composite" | "flexcomp" | "plugin" => return Err(e.wrong("is not supported")),
                _ => {} // lights are ignored
            }
        }
        Ok(())
    }

    /// Returns the name of the next body of the file.
    pub(super) fn next_body(&mut self, element: &'a Element) -> Result<String, Error> {
        self.bodies += 1;
        self.name("body", element, &format!("body{}", self.bodies))
    }

    /// Returns the pose of an MJCF body in the frame with the body's name. The two frames differ only for a free joint
    /// with `align`, whose frame has the principal axes of inertia.
    pub(super) fn link_in_frame(&mut self, element: &'a Element, parts: &Parts<'a>) -> Result<Se3<f64>, Error> {
        let [(a, _)] = &parts.joints[..] else { return Ok(Se3::identity()) };
        if !is_free(a) || !self.is_aligned(a, element, parts)? {
            return Ok(Se3::identity());
        }
        Ok(self.inertia(element, parts, true)?.1.inverse())
    }

    /// Returns whether the frame of a free joint has the principal axes of its body.
    fn is_aligned(&self, a: &Attributes, body: &Element, parts: &Parts) -> Result<bool, Error> {
        let align = match a.get("align") {
            None => None,
            Some(_) => a.flag("align", Some("auto"))?,
        };
        Ok(align.unwrap_or(self.compiler(body).align_free) && parts.bodies.is_empty())
    }

    /// Adds a body of the file. Returns its elements, the body of the model that contains it, and its pose in that
    /// body's frame.
    fn body(&mut self, builder: &mut ModelBuilder, w: &Waiting<'a>) -> Result<(Parts<'a>, BodyId, Se3<f64>), Error> {
        let mut parts = Parts::default();
        self.gather(w.element, Se3::identity(), w.class, &mut parts)?;
        let name = self.next_body(w.element)?;
        let (mut body, mut bXl) = (w.on, w.placement);
        let moves = body != WORLD || !parts.joints.is_empty();
        let count = parts.joints.len();
        if Attributes::plain(w.element).flag("mocap", None)? == Some(true) {
            if !w.top || count > 0 {
                return Err(w.element.wrong("mocap: the body is no fixed child of the world"));
            }
            let what = "mocap: the body is fixed to the world; MuJoCo lets a program move it";
            self.warnings.push(w.element.left_out(what));
        }
        let (inertia, axes) = self.inertia(w.element, &parts, moves)?;
        self.mass += inertia.mass;
        for (k, (a, X)) in parts.joints.iter().enumerate() {
            let number = if count == 1 { String::new() } else { format!("{}", k + 1) };
            let joint_name = self.name("joint", a.element, &format!("{name}_joint{number}"))?;
            let (joint, lXj, mut jXl, options) = self.joint(a, *X)?;
            let placement = if joint == Joint::FreeFlyer {
                if !w.top || count > 1 {
                    return Err(a.element.wrong("a free joint is the only joint of a body on the world"));
                }
                if self.is_aligned(a, w.element, &parts)? {
                    jXl = axes.inverse(); // the principal axes become the body's frame
                }
                Se3::identity() // q is the pose of the MJCF body
            } else {
                bXl * lXj
            };
            let last = k + 1 == count;
            let between = format!("{name}#{}", k + 1);
            let (called, inertia) = if last { (&name, jXl.act(inertia)) } else { (&between, Inertia::zero()) };
            body = builder.body_with((called, &joint_name), body, joint, placement, inertia, options);
            let drawn = self.poses[w.on.0] * w.placement * jXl.inverse();
            self.poses.push(drawn);
            let compiler = self.compiler(a.element);
            let found = FileJoint::read(a, joint, compiler.angle, compiler.autolimits)?;
            self.joints.add(joint_name.clone(), found.on(body.0, drawn));
            if !last {
                builder.between(body);
            }
            builder.frame_of_kind(&joint_name, FrameKind::Joint, body, Se3::identity());
            bXl = jXl;
            if joint == Joint::FreeFlyer {
                builder.frame_of_kind(&name, FrameKind::Link, body, Se3::identity());
            }
        }
        if count == 0 {
            builder.merge(body, bXl, inertia);
        }
        let compensated = Attributes::plain(w.element).number("gravcomp")?.unwrap_or(0.0);
        if compensated < 0.0 && !self.compensates {
            let what = "gravcomp: below 0, it acts in MuJoCo only if that of another body is above 0";
            self.warnings.push(w.element.left_out(what));
        } else {
            match count {
                0 => builder.compensate_gravity_of_part(body, bXl, inertia, compensated),
                _ => builder.compensate_gravity(body, compensated),
            }
        }
        if !parts.joints.iter().any(|(a, _)| is_free(a)) {
            builder.frame_of_kind(&name, FrameKind::Link, body, bXl);
        }
        self.frames(builder, &parts, body, bXl)?;
        Ok((parts, body, bXl))
    }

    /// Adds the named sites of a body, and stores its named frames and cameras, which are added later. Also checks the
    /// names of its geoms.
    fn frames(
        &mut self,
        builder: &mut ModelBuilder,
        parts: &Parts<'a>,
        body: BodyId,
        bXl: Se3<f64>,
    ) -> Result<(), Error> {
        let has_name = |a: &Attributes| a.element.attribute("name").is_some_and(|name| !name.is_empty());
        for (a, _) in parts.geoms.iter().filter(|(a, _)| has_name(a)) {
            self.name("geom", a.element, "")?;
        }
        for (a, X) in parts.sites.iter().filter(|(a, _)| has_name(a)) {
            let name = self.name("site", a.element, "")?;
            let own = match from_to(a, a.get("type").unwrap_or("sphere"))? {
                Some((pose, _)) => pose,
                None => self.compiler(a.element).pose(a)?,
            };
            builder.frame_of_kind(&name, FrameKind::User, body, bXl * *X * own);
        }
        for &(element, X) in &parts.frames {
            self.name("frame", element, "")?;
            self.placed.push(Placed { element, body, placement: bXl * X });
        }
        // Cameras of other modes follow a target, so they are not fixed to a body.
        let is_fixed = |a: &Attributes| a.get("mode").is_none_or(|mode| mode == "fixed");
        for (a, X) in parts.cameras.iter().filter(|(a, _)| has_name(a) && is_fixed(a)) {
            self.name("camera", a.element, "")?;
            let placement = bXl * *X * self.compiler(a.element).pose(a)?;
            self.placed.push(Placed { element: a.element, body, placement });
        }
        Ok(())
    }

    /// Adds the stored frames and then the stored cameras. If a name is already used, the frame is named `frame:name`
    /// or `camera:name`.
    pub(super) fn place(&mut self, builder: &mut ModelBuilder) {
        let mut placed = std::mem::take(&mut self.placed);
        placed.sort_by_key(|p| p.element.tag != "frame");
        for Placed { element, body, placement } in placed {
            let mut name = element.attribute("name").unwrap_or_default().to_owned();
            while self.names.contains_key(&("site", name.clone())) {
                name = format!("{}:{name}", element.tag);
            }
            self.names.insert(("site", name.clone()), element);
            builder.frame_of_kind(&name, FrameKind::User, body, placement);
        }
    }

    /// Returns the body's inertia and the pose of its principal axes, both in the body's frame.
    fn inertia(
        &mut self,
        element: &'a Element,
        parts: &Parts<'a>,
        moves: bool,
    ) -> Result<(Inertia<f64>, Se3<f64>), Error> {
        let compiler = self.compiler(element);
        let from_geoms = match compiler.from_geoms {
            FromGeoms::Never => false,
            FromGeoms::WithoutInertial => parts.inertial.is_none(),
            FromGeoms::Always => true,
        };
        let mut weights = Vec::new();
        for (a, X) in parts.geoms.iter().filter(|_| from_geoms) {
            weights.extend(self.weight(element, a, moves)?.map(|w| w.seen_from(*X)));
        }
        let (sum, axes) = match (Weight::sum(&weights), parts.inertial) {
            (Some(sum), _) => sum,
            (None, Some((e, X))) => {
                let a = Attributes::plain(e);
                let (inertia, axes) = geometry::inertial(self.compiler(e), &a)?;
                if a.get("diaginertia").or(a.get("fullinertia")).is_none() {
                    let what =
                        "has neither diaginertia nor fullinertia: 0 kg m², which MuJoCo refuses in a moving body";
                    self.warnings.push(e.assumed(what));
                }
                (X.act(inertia), X * axes)
            }
            (None, None) => (Inertia::zero(), Se3::identity()),
        };
        Ok((geometry::corrected(compiler, element, sum)?, axes))
    }

    /// Returns the inertia of a geom, in the frame of the body or of the surrounding `<frame>`. Returns `None` if the
    /// geom has no mass.
    fn weight(&mut self, body: &Element, a: &Attributes<'a>, moves: bool) -> Result<Option<Weight>, Error> {
        let source = self.source(a.element);
        if moves && a.get("type") == Some("plane") {
            return Err(a.element.wrong("a plane is on a body that moves"));
        }
        if !geometry::is_heavy(&source.compiler, a)? {
            return Ok(None);
        }
        let field = source.assets.field(a)?;
        let kind = a.get("type").unwrap_or("sphere");
        let mesh = source.assets.mesh(a);
        let mesh = if self.options.weightless_meshes { mesh.ok().flatten() } else { mesh? };
        let is_mesh = a.get("mesh").is_some();
        if !is_mesh {
            return geometry::geom(&source.compiler, a, None, field);
        }
        let solid: Result<Solid, String> = match mesh {
            Some(mesh) => self.solids.get(source, mesh, &self.options.packages),
            None => Err("there is no such mesh".to_owned()),
        };
        match solid {
            Ok(solid) => {
                let most = mesh.map_or(Ok(None), |e| source.defaults.of(e, MAIN)?.number("maxhullvert"))?;
                if let (Some(most), Some(found)) = (most.filter(|&most| most >= 0.0), solid.corners)
                    && (found as f64) > most
                {
                    let name = a.get("mesh").unwrap_or_default();
                    let what =
                        format!("maxhullvert of mesh `{name}`: its hull has all its {found} corners, not {most}");
                    self.warnings.push(a.element.left_out(what));
                }
                if solid.lost > 0 && solid.corners.is_none() {
                    let (name, lost) = (a.get("mesh").unwrap_or_default(), solid.lost);
                    let what = format!(
                        "mesh `{name}`: {lost} of its faces are not cut into triangles, or in part, as in MuJoCo"
                    );
                    self.warnings.push(a.element.left_out(format!("{what}: its surface has holes")));
                }
                geometry::geom(&source.compiler, a, Some(&solid), field)
            }
            Err(why) => {
                let name = a.get("mesh").unwrap_or_default();
                if self.options.weightless_meshes || !moves {
                    let of = body.label();
                    let what = format!("the mass of a mesh on {of} is left out: mesh `{name}`: {why}");
                    self.warnings.push(a.element.left_out(what));
                    return Ok(None);
                }
                let what =
                    format!("has the mass of mesh `{name}`: {why} (or give the body an <inertial>, or {kind} mass 0)");
                Err(a.element.wrong(what))
            }
        }
    }
}

/// Returns whether a positive `gravcomp` compensates the weight of at least one body in an element.
pub(super) fn compensates(element: &Element) -> Result<bool, Error> {
    for child in element.children.iter().filter(|child| matches!(&*child.tag, "body" | "frame")) {
        if Attributes::plain(child).number("gravcomp")?.is_some_and(|x| x > 0.0) || compensates(child)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Returns whether a joint is a free joint.
fn is_free(a: &Attributes) -> bool {
    a.element.tag == "freejoint" || a.get("type") == Some("free")
}

/// Adds the children of a body to the stack, with the first child on top.
fn wait<'a>(waiting: &mut Vec<Waiting<'a>>, parts: &Parts<'a>, on: BodyId, bXl: Se3<f64>, top: bool) {
    let next = parts.bodies.iter().rev();
    waiting.extend(next.map(|&(element, X, class)| Waiting { element, class, on, placement: bXl * X, top }));
}
