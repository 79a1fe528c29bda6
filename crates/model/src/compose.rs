//! Models made from other models: chains of joints, appended robots, locked joints, and joints that follow others.

use crate::body::{FrameKind, JointOptions};
use crate::builder::{BodyId, ModelBuilder, WORLD};
use crate::error::Error;
use crate::joint::{Joint, Mimic};
use crate::layout::Single;
use crate::model::Model;
use alloc::vec::Vec;
use condyle_linalg::{check, check_index};
use condyle_spatial::{Inertia, Se3, Vec3};

impl ModelBuilder {
    /// Adds a composite joint: several joints in series, which carry one body. Each joint is at a placement in the
    /// frame of the joint before it.
    ///
    /// The coordinates of the composite joint are the coordinates of the joints, in order. Bodies without mass connect
    /// the joints. Their names are the name of the last body followed by a number: `name#1`, `name#2`, …. Returns the
    /// last body, which carries `inertia`.
    ///
    /// - universal joint about unit vectors a and b: `[(Revolute { a }, placement), (Revolute { b }, identity)]`;
    /// - ball joint with roll-pitch-yaw angles (z, y, x): [`spherical_zyx`](Self::spherical_zyx).
    ///
    /// # Panics
    /// If `joints` is empty.
    #[track_caller]
    pub fn chain(&mut self, name: &str, parent: BodyId, joints: &[(Joint, Se3<f64>)], inertia: Inertia<f64>) -> BodyId {
        let ((last, placement), before) = joints.split_last().expect("joints: expected at least one");
        let mut at = parent;
        for (i, &(joint, placement)) in before.iter().enumerate() {
            at = self.body(&format!("{name}#{}", i + 1), at, joint, placement, Inertia::zero());
            self.between(at);
        }
        self.body(name, at, *last, *placement, inertia)
    }

    /// Adds a body on a ball joint with three angles. The body turns by q₀ about z, then by q₁ about the new y, then by
    /// q₂ about the new x. The velocity is v = q̇.
    ///
    /// The inertia matrix is singular at q₁ = ±π/2. [`Joint::Spherical`] has no singularity.
    ///
    /// ```
    /// use condyle_model::{Inertia, ModelBuilder, Se3, Sym3, Vec3, WORLD};
    /// let mut robot = ModelBuilder::new("ball");
    /// robot.spherical_zyx("ball", WORLD, Se3::identity(), Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1)));
    /// let ball = robot.build()?;
    /// assert_eq!(ball.nv(), 3);
    /// let axes: Vec<_> = ball.bodies()[1..].iter().filter_map(|body| body.joint.axis()).collect();
    /// assert_eq!(axes, [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 0.0, 0.0)]);
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    pub fn spherical_zyx(&mut self, name: &str, parent: BodyId, placement: Se3<f64>, inertia: Inertia<f64>) -> BodyId {
        let about = |x, y, z| Joint::Revolute { axis: Vec3::new(x, y, z) };
        let there = Se3::identity();
        let joints = [(about(0.0, 0.0, 1.0), placement), (about(0.0, 1.0, 0.0), there), (about(1.0, 0.0, 0.0), there)];
        self.chain(name, parent, &joints, inertia)
    }

    /// Adds a whole robot. The world of this robot is at `placement` in the frame of `parent`. `prefix` is put before
    /// all names of the robot.
    ///
    /// ```
    /// use condyle_model::{ModelBuilder, Se3, Vec3, WORLD, robots};
    /// let at = |y| Se3 { translation: Vec3::new(0.0, y, 0.5), ..Se3::identity() };
    /// let mut two = ModelBuilder::new("two arms");
    /// two.append(WORLD, at(0.4), &robots::arm7(), "left_");
    /// two.append(WORLD, at(-0.4), &robots::arm7(), "right_");
    /// let two = two.build()?;
    /// assert_eq!(two.nv(), 14);
    /// assert!(two.frame("right_tool").is_ok());
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    pub fn append(&mut self, parent: BodyId, placement: Se3<f64>, model: &Model, prefix: &str) {
        self.append_locked(parent, placement, model, prefix, &[], &[]);
    }

    /// Adds a whole robot, as [`append`](Self::append) does, but with some bodies fixed at their poses at q. Returns,
    /// for each body of the robot, the body of this builder to which it is fixed, and its placement in the frame of
    /// that body.
    fn append_locked(
        &mut self,
        parent: BodyId,
        placement: Se3<f64>,
        model: &Model,
        prefix: &str,
        locked: &[usize],
        q: &[f64],
    ) -> Vec<(BodyId, Se3<f64>)> {
        let mut place = vec![(parent, placement)];
        self.merge(parent, placement, model.bodies[0].inertia);
        // Returns bXz: the pose, in body i, of the frame whose z axis is the joint's axis.
        let turned = |i: usize| Se3::new(model.tree.nodes[i].axis_rotation, Vec3::zero());
        for (i, body) in model.bodies.iter().enumerate().skip(1) {
            let (on, pXp) = place[body.parent];
            if locked.contains(&i) {
                let l = Single::<f64, f64>::new(model);
                let pXb = pXp * turned(body.parent) * Joint::placement(&l, i, q) * turned(i).inverse();
                self.merge(on, pXb, body.inertia);
                place.push((on, pXb));
                continue;
            }
            let options = match body.mimic {
                None => model.joint_options(body.idx_q, body.idx_v),
                Some(_) => JointOptions::default(), // included in the options of the leader
            };
            let names = (format!("{prefix}{}", body.name), format!("{prefix}{}", body.joint_name));
            let id = self.body_with((&names.0, &names.1), on, body.joint, pXp * body.placement, body.inertia, options);
            if model.between[i] {
                self.between(id);
            }
            place.push((id, Se3::identity()));
        }
        for (i, body) in model.bodies.iter().enumerate().skip(1) {
            if let Some(mimic) = body.mimic
                && !locked.contains(&i)
            {
                let leads = |b: &crate::body::Body| b.mimic.is_none() && b.idx_v == body.idx_v;
                let leader = 1 + model.bodies[1..].iter().position(leads).expect("a mimic joint follows a joint");
                self.mimic(place[i].0, place[leader].0, mimic);
            }
        }
        let first_frame = self.frames.len();
        for frame in &model.frames {
            let (on, pXb) = place[frame.body];
            self.frame_of_kind(&format!("{prefix}{}", frame.name), frame.kind, on, pXb * frame.placement);
        }
        // Keeps a frame for each locked body, named after the body's joint. A reader does the same for a fixed joint.
        for &i in locked {
            let (name, (on, pXb)) = (format!("{prefix}{}", model.bodies[i].joint_name), place[i]);
            if !model.frames.iter().any(|f| f.kind == FrameKind::Joint && f.name == model.bodies[i].joint_name) {
                self.frame_of_kind(&name, FrameKind::Joint, on, pXb);
            }
        }
        self.append_additions(model, prefix, &place, first_frame, locked, q);
        place
    }
}

impl Model {
    /// Returns the same robot with some joints locked at q. `bodies` are the bodies that these joints carry.
    ///
    /// Each of these bodies is merged into the body that carries it, and a frame remains at its pose. A joint that
    /// follows a locked joint is locked, too. If a tendon moves with a locked joint, the joint's contribution to the
    /// tendon's length becomes a constant. A coupling between a locked joint and another joint fixes the position of
    /// the other joint. If this is not possible, the model has a warning. Warnings about the robot's file are kept.
    ///
    /// ```
    /// use condyle_model::robots;
    /// let arm = robots::arm7();
    /// let mut q = [0.0; 7];
    /// q[3] = 1.2;
    /// let stiff = arm.lock(&[arm.joint("joint4")?], &q)?;
    /// assert_eq!((stiff.nv(), stiff.total_mass()), (6, arm.total_mass()));
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`ModelBuilder::build`]. Returns [`Error::Position`] if a number of `q` is not finite, or
    /// if a rotation in `q` does not have length 1.
    ///
    /// # Panics
    /// If `q` does not have nq numbers, or a body does not exist or is the world.
    #[track_caller]
    pub fn lock(&self, bodies: &[usize], q: &[f64]) -> Result<Self, Error> {
        check("q", q.len(), self.tree.nq);
        for &i in bodies {
            self.check_joint("bodies", i);
        }
        self.check_position(q)?;
        let coordinates: Vec<usize> = bodies.iter().map(|&i| self.bodies[i].idx_v).collect();
        let locked: Vec<usize> =
            (1..self.bodies.len()).filter(|&i| coordinates.contains(&self.bodies[i].idx_v)).collect();
        let mut builder = ModelBuilder::new(&self.name);
        builder.gravity(self.gravity);
        builder.append_locked(WORLD, Se3::identity(), self, "", &locked, q);
        builder.build()
    }

    /// Returns this robot with another robot attached. The world of the other robot is at `placement` in the frame of a
    /// body of this robot (0 is the world). `prefix` is put before all names of the other robot. Gravity and name of
    /// this robot are kept, and so are the warnings about the files of both robots.
    ///
    /// The bodies of the other robot are numbered after all bodies that `body` already carries, as in Pinocchio's
    /// `appendModel`.
    ///
    /// ```
    /// use condyle_model::{Se3, robots};
    /// let (quadruped, arm) = (robots::quadruped(), robots::arm7());
    /// let knee = &quadruped.frames()[quadruped.frame("LF_shank")?];
    /// let both = quadruped.append(knee.body, knee.placement, &arm, "arm_")?;
    /// assert_eq!((both.nv(), both.joint("arm_joint1")?), (18 + 7, quadruped.joint("LF_KFE")? + 1));
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`ModelBuilder::build`], for example if two bodies, joints or frames have the same name.
    ///
    /// # Panics
    /// If `body` does not exist.
    #[track_caller]
    pub fn append(&self, body: usize, placement: Se3<f64>, other: &Self, prefix: &str) -> Result<Self, Error> {
        check_index("body", body, self.bodies.len(), "bodies");
        let (mut builder, place) = self.to_builder();
        builder.append(place[body].0, placement, other, prefix);
        builder.build()
    }

    /// Returns the same robot with one joint that follows another joint and has no coordinate of its own. Each joint is
    /// given by the index of its body. Limits, damping and friction of the follower act on the leader, as described at
    /// [`ModelBuilder::mimic`].
    ///
    /// ```
    /// use condyle_model::{Mimic, robots};
    /// let arm = robots::arm7();
    /// let coupled = arm.with_mimic(arm.joint("joint4")?, arm.joint("joint2")?, Mimic { ratio: -2.0, offset: 0.1 })?;
    /// assert_eq!((coupled.nv(), coupled.bodies().len()), (6, 8));
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`ModelBuilder::build`]. Returns [`Error::Joint`] if one of the joints has more than one
    /// degree of freedom, if the leader itself follows another joint, or if another joint follows the follower.
    ///
    /// # Panics
    /// If a body does not exist or is the world.
    #[track_caller]
    pub fn with_mimic(&self, follower: usize, leader: usize, mimic: Mimic) -> Result<Self, Error> {
        for (name, i) in [("follower", follower), ("leader", leader)] {
            self.check_joint(name, i);
        }
        let (mut builder, place) = self.to_builder();
        builder.mimic(place[follower].0, place[leader].0, mimic);
        builder.build()
    }

    /// Panics unless body i exists and has a joint.
    #[track_caller]
    fn check_joint(&self, name: &str, i: usize) {
        assert!(i > 0, "{name}: the world, body 0, has no joint");
        check_index(name, i, self.bodies.len(), "bodies");
    }

    /// Returns a builder of this robot. For each body of the robot, also returns the identifier of its body in the
    /// builder, and its placement in that body's frame.
    fn to_builder(&self) -> (ModelBuilder, Vec<(BodyId, Se3<f64>)>) {
        let mut builder = ModelBuilder::new(&self.name);
        builder.gravity(self.gravity);
        let place = builder.append_locked(WORLD, Se3::identity(), self, "", &[], &[]);
        (builder, place)
    }
}
