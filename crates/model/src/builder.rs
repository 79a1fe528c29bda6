//! Builder that creates a model body by body.

use crate::additions::Additions;
use crate::body::{Body, Frame, FrameKind, JointOptions, Limits};
use crate::error::Error;
use crate::joint::{Joint, Mimic};
use crate::limbs::Plan;
use crate::model::Model;
use crate::tree::Tree;
use crate::validate::{check_body, check_frame};
use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::collections::BTreeSet;
use alloc::string::String;
use alloc::vec::Vec;
use condyle_linalg::check_index;
use condyle_spatial::{Act, Inertia, Se3, Vec3};

/// Identifier of a body in a builder. [`WORLD`] always exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyId(pub(crate) usize);

/// World: the body that carries the first joint, or first joints, of a robot.
pub const WORLD: BodyId = BodyId(0);

/// Maximum number of degrees of freedom of a model. The number limits the memory of the algorithms' square matrices.
const MAX_DEGREES: usize = 4096;
/// Maximum number of coordinates of a model in which joints follow others. The number is small because the inertia
/// matrix of such a model is factorized as a dense matrix.
const MAX_SHARED: usize = 1024;

#[derive(Clone, Debug)]
struct Draft {
    body: Body,
    options: JointOptions,
    /// Whether the body connects two joints of a chain, and therefore has no mass on purpose.
    between: bool,
    /// Index of the body with the leading joint, and the relation between the two joints.
    mimic: Option<(usize, Mimic)>,
}

/// Builder of a [`Model`]. Bodies are added one by one, each after its parent.
///
/// ```
/// use condyle_model::{Inertia, Joint, ModelBuilder, Se3, Sym3, Vec3, WORLD};
/// let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3::diagonal(0.08));
/// let y = Vec3::new(0.0, 1.0, 0.0);
/// let mut robot = ModelBuilder::new("double pendulum");
/// let upper = robot.body("upper", WORLD, Joint::Revolute { axis: y }, Se3::identity(), rod);
/// let elbow = Se3 { translation: Vec3::new(0.0, 0.0, -1.0), ..Se3::identity() };
/// let lower = robot.body("lower", upper, Joint::Revolute { axis: y }, elbow, rod);
/// robot.frame("tip", lower, elbow);
/// let model = robot.build()?;
/// assert_eq!(model.nv(), 2);
/// # Ok::<(), condyle_model::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ModelBuilder {
    name: String,
    drafts: Vec<Draft>,
    pub(crate) frames: Vec<Frame>,
    gravity: Vec3<f64>,
    pub(crate) additions: Additions,
}

impl ModelBuilder {
    /// Creates a robot without bodies. Its gravity is (0, 0, −9.81) m/s².
    pub fn new(name: &str) -> Self {
        let world = Body {
            joint_name: "universe".to_owned(),
            name: "universe".to_owned(),
            parent: 0,
            joint: Joint::Translation,
            placement: Se3::identity(),
            inertia: Inertia::zero(),
            idx_q: 0,
            idx_v: 0,
            mimic: None,
        };
        Self {
            name: name.to_owned(),
            drafts: vec![Draft { body: world, options: JointOptions::default(), between: false, mimic: None }],
            frames: Vec::new(),
            gravity: Vec3::new(0.0, 0.0, -9.81),
            additions: Additions::default(),
        }
    }

    /// Adds a body and its joint, without limits. The body and the joint have the name `name`. The joint is at
    /// `placement` in the parent's frame. `inertia` is in the body's frame, which is the joint's frame at position
    /// zero.
    pub fn body(
        &mut self,
        name: &str,
        parent: BodyId,
        joint: Joint,
        placement: Se3<f64>,
        inertia: Inertia<f64>,
    ) -> BodyId {
        self.body_with((name, name), parent, joint, placement, inertia, JointOptions::default())
    }

    /// Adds a body and its joint, with separate names (body, joint) and with options for the joint.
    pub fn body_with(
        &mut self,
        (name, joint_name): (&str, &str),
        parent: BodyId,
        joint: Joint,
        placement: Se3<f64>,
        inertia: Inertia<f64>,
        options: JointOptions,
    ) -> BodyId {
        let body = Body {
            joint_name: joint_name.to_owned(),
            name: name.to_owned(),
            parent: parent.0,
            joint,
            placement,
            inertia,
            idx_q: 0,
            idx_v: 0,
            mimic: None,
        };
        self.drafts.push(Draft { body, options, between: false, mimic: None });
        BodyId(self.drafts.len() - 1)
    }

    /// Adds inertia to a body. `inertia` is in a frame that is at `placement` in the body's frame.
    ///
    /// # Panics
    /// If the body does not belong to this builder.
    #[track_caller]
    pub fn merge(&mut self, body: BodyId, placement: Se3<f64>, inertia: Inertia<f64>) {
        check_index("body", body.0, self.drafts.len(), "bodies");
        self.drafts[body.0].body.inertia += placement.act(inertia);
    }

    /// Adds a frame at `placement` in the body's frame.
    pub fn frame(&mut self, name: &str, body: BodyId, placement: Se3<f64>) {
        self.frame_of_kind(name, FrameKind::User, body, placement);
    }

    /// Adds a frame that comes from a link, a joint, or the user. Two frames of different kinds may have the same name.
    pub fn frame_of_kind(&mut self, name: &str, kind: FrameKind, body: BodyId, placement: Se3<f64>) {
        self.frames.push(Frame { name: name.to_owned(), kind, body: body.0, placement });
    }

    /// Scales all masses and inertias.
    #[cfg(feature = "loaders")]
    pub(crate) fn scale_inertias(&mut self, by: f64) {
        for draft in &mut self.drafts {
            draft.body.inertia = draft.body.inertia.scale(by);
        }
        self.additions.scale_masses(by);
    }

    /// Marks a body that connects two joints of a chain and has no mass on purpose.
    pub(crate) fn between(&mut self, body: BodyId) {
        self.drafts[body.0].between = true;
    }

    /// Lets a joint follow another joint; see [`Mimic`]. The follower then has no coordinate of its own. If the leader
    /// follows a third joint, ratios and offsets are composed. Limits of position and velocity, damping, friction and
    /// armature of the follower act on the leader's coordinate. Limits of effort of the follower have no effect. Limits
    /// that leave no range for the leader are ignored, with a warning.
    ///
    /// # Panics
    /// If the follower does not belong to this builder.
    #[track_caller]
    pub fn mimic(&mut self, follower: BodyId, leader: BodyId, mimic: Mimic) {
        check_index("follower", follower.0, self.drafts.len(), "bodies");
        self.drafts[follower.0].mimic = Some((leader.0, mimic));
    }

    /// Sets the acceleration of gravity (m/s²), in the world's frame.
    pub fn gravity(&mut self, gravity: Vec3<f64>) {
        self.gravity = gravity;
    }

    /// Checks the robot, numbers its bodies depth first, and returns the model. Siblings keep the order in which they
    /// were added.
    ///
    /// # Errors
    /// Returns [`Error::Duplicate`], [`Error::Body`], [`Error::Joint`], [`Error::Frame`] or [`Error::Gravity`] in these
    /// cases:
    /// - Two names are equal, or an axis is invalid.
    /// - A mass, damping, friction, armature, speed limit or effort limit is negative.
    /// - Two limits exclude each other, or a placement is invalid.
    /// - A number is not finite, or is so large (above 1e30) that products may not be finite.
    /// - The leader of a mimic joint is invalid.
    ///
    /// Every other function that returns a model makes the same checks. Returns [`Error::Size`] if the model has more
    /// than 4096 degrees of freedom, or more than 1024 coordinates if joints follow others.
    pub fn build(self) -> Result<Model, Error> {
        self.build_with(&mut |_| Ok(()))
    }

    /// Builds the model. `complete` may change the model before the model is checked.
    pub(crate) fn build_with(
        mut self,
        complete: &mut dyn FnMut(&mut Model) -> Result<(), Error>,
    ) -> Result<Model, Error> {
        self.check_size()?;
        self.check()?;
        let order = self.depth_first();
        let mut number = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            number[old] = new;
        }
        for frame in &mut self.frames {
            frame.body = number[frame.body];
        }
        // Coordinates are first assigned to the joints without a leader, in order. Then each follower gets the
        // coordinate of its leader.
        let mut coordinates = Coordinates::default();
        let mut bodies: Vec<Body> = Vec::with_capacity(order.len());
        let mut warnings = Vec::new();
        for (i, &old) in order.iter().enumerate() {
            let Draft { body, options, mimic, .. } = &self.drafts[old];
            let mut body = body.clone();
            body.parent = number[body.parent];
            (body.idx_q, body.idx_v) = (coordinates.nq, coordinates.nv);
            if i > 0 && mimic.is_none() {
                coordinates.add(body.joint, options);
            }
            bodies.push(body);
        }
        for (i, &old) in order.iter().enumerate() {
            if let Draft { mimic: Some((leader, mimic)), options, .. } = &self.drafts[old] {
                let (leader, mimic) = (&bodies[number[*leader]], *mimic);
                let (idx_q, idx_v) = (leader.idx_q, leader.idx_v);
                let ignored = coordinates.follow(leader, bodies[i].joint, options, mimic);
                let joint = &bodies[i].joint_name;
                warnings.extend(ignored.into_iter().map(|what| Warning::Limit { joint: joint.clone(), what }));
                (bodies[i].idx_q, bodies[i].idx_v, bodies[i].mimic) = (idx_q, idx_v, Some(mimic));
            }
        }
        let between = order.iter().map(|&old| self.drafts[old].between).collect();
        let Coordinates { nq, nv, limits, damping, damping_polynomial, friction, armature } = coordinates;
        let tree = Tree::new(&bodies, nq, nv);
        let mut model = Model {
            name: self.name,
            bodies,
            frames: self.frames,
            limits,
            damping,
            friction,
            damping_polynomial,
            springs: Vec::new(),
            gravity_compensation: Vec::new(),
            actuators: Vec::new(),
            keyframes: Vec::new(),
            constraints: Vec::new(),
            armature,
            free_armature: Vec::new(),
            gravity: self.gravity,
            limbs: Plan::new(&tree),
            tree,
            geometry: 0,
            between,
            warnings,
            singular: Vec::new(),
        };
        self.additions.add_to(&mut model, &number)?;
        complete(&mut model)?;
        model.validate()?;
        model.geometry = model.hash_geometry();
        Ok(model)
    }

    /// Returns the bodies in depth-first order. Siblings keep the order in which they were added.
    fn depth_first(&self) -> Vec<usize> {
        let mut children = vec![Vec::new(); self.drafts.len()];
        for (i, draft) in self.drafts.iter().enumerate().skip(1) {
            children[draft.body.parent].push(i);
        }
        let (mut order, mut stack) = (Vec::with_capacity(self.drafts.len()), vec![0]);
        while let Some(i) = stack.pop() {
            order.push(i);
            stack.extend(children[i].iter().rev());
        }
        order
    }

    /// Checks that a model does not have too many degrees of freedom.
    pub(crate) fn check_size(&self) -> Result<(), Error> {
        let degrees = |draft: &Draft| draft.body.joint.nv();
        let joints = || self.drafts.iter().skip(1);
        let found = joints().map(degrees).sum();
        if found > MAX_DEGREES {
            return Err(Error::Size { what: "degrees of freedom", found, limit: MAX_DEGREES });
        }
        let own = joints().filter(|draft| draft.mimic.is_none()).map(degrees).sum();
        if own < found && own > MAX_SHARED {
            let what = "coordinates, with joints that follow others";
            return Err(Error::Size { what, found: own, limit: MAX_SHARED });
        }
        Ok(())
    }

    /// Names the world `universe`. If a body or joint already has this name, the name is `universe_2`, `universe_3`,
    /// and so on.
    fn name_world(&mut self) {
        let taken = |name: &str, drafts: &[Draft]| {
            drafts.iter().skip(1).any(|d| d.body.name == name || d.body.joint_name == name)
        };
        for k in 1.. {
            let name = match k {
                1 => "universe".to_owned(),
                _ => format!("universe_{k}"),
            };
            if !taken(&name, &self.drafts) {
                let world = &mut self.drafts[0].body;
                (world.name, world.joint_name) = (name.clone(), name);
                break;
            }
        }
    }

    /// Replaces each leader that is a follower itself by the leader of that follower: q_f = r₁ (r₂ q + o₂) + o₁, with
    /// the ratios r and offsets o of both relations.
    fn compose_mimics(&mut self) -> Result<(), Error> {
        for i in 1..self.drafts.len() {
            // `way` lists the followers on the path from joint i to its final leader, whose relations are not yet
            // composed.
            let mut way = Vec::new();
            let mut at = i;
            while let Some((leader, _)) = self.drafts[at].mimic {
                if self.drafts[leader].mimic.is_none() {
                    break;
                }
                way.push(at);
                if way.len() >= self.drafts.len() {
                    let joint = self.drafts[i].body.joint_name.clone();
                    return Err(Error::Joint { joint, what: "mimics itself, alone or by way of others".to_owned() });
                }
                at = leader;
            }
            for at in way.into_iter().rev() {
                if let Some((leader, own)) = self.drafts[at].mimic
                    && let Some((first, next)) = self.drafts[leader].mimic
                {
                    let mimic = Mimic { ratio: own.ratio * next.ratio, offset: own.ratio * next.offset + own.offset };
                    self.drafts[at].mimic = Some((first, mimic));
                }
            }
        }
        Ok(())
    }

    /// Checks names, bodies, joints and frames, and normalizes axes.
    fn check(&mut self) -> Result<(), Error> {
        self.name_world();
        self.compose_mimics()?;
        let (mut bodies, mut joints, mut frames) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        let kinds: Vec<Joint> = self.drafts.iter().map(|d| d.body.joint).collect();
        for Draft { body, options, mimic, .. } in &mut self.drafts {
            if !bodies.insert(body.name.clone()) {
                return Err(Error::Duplicate { kind: "body", name: body.name.clone() });
            }
            if !joints.insert(body.joint_name.clone()) {
                return Err(Error::Duplicate { kind: "joint", name: body.joint_name.clone() });
            }
            let wrong = |what: String| Error::Body { body: body.name.clone(), what };
            body.joint = body.joint.normalized().map_err(wrong)?;
            check_body(body)?;
            options.check(&body.joint_name)?;
            if let Some((leader, mimic)) = *mimic {
                let wrong = |what: String| Error::Joint { joint: body.joint_name.clone(), what };
                if !(mimic.ratio.is_finite() && mimic.offset.is_finite()) {
                    return Err(wrong(format!("mimic ratio {} or offset {} is not finite", mimic.ratio, mimic.offset)));
                }
                if leader == 0 {
                    return Err(wrong("mimics a joint without a coordinate of its own".to_owned()));
                }
                body.joint.as_follower(kinds[leader], mimic).map_err(wrong)?;
            }
        }
        for frame in &self.frames {
            check_frame(frame)?;
            if !frames.insert((frame.name.clone(), frame.kind as u8)) {
                return Err(Error::Duplicate { kind: "frame", name: frame.name.clone() });
            }
        }
        Ok(())
    }
}

/// Relative rounding error of the position limits of followers. If these limits leave the leader a range below this
/// error, the leader counts as unable to move.
const MIMIC_ROUNDING: f64 = 1e-9;

/// Lists of a model with one entry for each coordinate or degree of freedom.
#[derive(Default)]
struct Coordinates {
    nq: usize,
    nv: usize,
    limits: Limits,
    damping: Vec<f64>,
    damping_polynomial: Vec<[f64; 2]>,
    friction: Vec<f64>,
    armature: Vec<f64>,
}

impl Coordinates {
    /// Adds the coordinates of a joint, with their limits, damping and friction.
    fn add(&mut self, joint: Joint, options: &JointOptions) {
        let (lower, upper) = match options.position {
            Some(limits) if joint.nq() == 1 => limits,
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        self.nq += joint.nq();
        self.nv += joint.nv();
        self.limits.lower.resize(self.nq, lower);
        self.limits.upper.resize(self.nq, upper);
        self.limits.velocity.resize(self.nv, options.velocity.unwrap_or(f64::INFINITY));
        let (least, greatest) = options.effort.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        self.limits.effort_lower.resize(self.nv, least);
        self.limits.effort_upper.resize(self.nv, greatest);
        self.damping.resize(self.nv, options.damping);
        self.damping_polynomial.resize(self.nv, options.damping_polynomial);
        self.friction.resize(self.nv, options.friction);
        self.armature.resize(self.nv, options.armature);
    }

    /// Adds the limits, damping and friction of a joint that follows a leader. With x = ratio q + offset, the
    /// follower's limits of position and velocity also limit the leader. The follower's limits of effort have no
    /// effect. Limits that leave no range for the leader are ignored. Returns messages about the ignored limits.
    fn follow(
        &mut self,
        leader: &Body,
        joint: Joint,
        options: &JointOptions,
        Mimic { ratio, offset }: Mimic,
    ) -> Vec<String> {
        let (q, v, k) = (leader.idx_q, leader.idx_v, ratio.abs());
        self.armature[v] += k * k * options.armature;
        self.damping[v] += k * k * options.damping;
        let [d1, d2] = options.damping_polynomial;
        self.damping_polynomial[v][0] += k * k * k * d1;
        self.damping_polynomial[v][1] += k * k * k * k * d2;
        self.friction[v] += k * options.friction;
        let mut ignored = Vec::new();
        if k == 0.0 {
            return ignored;
        }
        match options.velocity {
            Some(0.0) if self.limits.velocity[v] > 0.0 => {
                let name = &leader.joint_name;
                ignored
                    .push(format!("its limit of velocity, 0, leaves its leader `{name}` no motion: it has no effect"));
            }
            Some(limit) => self.limits.velocity[v] = self.limits.velocity[v].min(limit / k),
            None => {}
        }
        if let Some((lower, upper)) = options.position.filter(|_| leader.joint.nq() == 1 && joint.nq() == 1) {
            let mut ends = [lower, upper].map(|x| (x - offset) / ratio);
            ends.sort_by(f64::total_cmp);
            let (lower, upper) = (self.limits.lower[q].max(ends[0]), self.limits.upper[q].min(ends[1]));
            if upper - lower > MIMIC_ROUNDING * (1.0 + upper.abs()) {
                (self.limits.lower[q], self.limits.upper[q]) = (lower, upper);
            } else if self.limits.lower[q] < self.limits.upper[q] {
                let ([lower, upper], name) = (ends, &leader.joint_name);
                let limits = format!("its limits of position, {lower} to {upper} for its leader `{name}`");
                ignored.push(format!("{limits}, leave the leader no motion: they have no effect"));
            }
        }
        ignored
    }
}
