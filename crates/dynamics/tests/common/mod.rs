//! Random robots and states, and functions that compare numbers.
#![allow(dead_code)] // each test file uses only some of the functions

pub(crate) mod contacts;
pub(crate) mod panics;
pub(crate) mod table;

use condyle_dynamics::{
    Force, Inertia, Joint, JointOptions, Mat3, Mimic, Model, ModelBuilder, Quaternion, Scalar, Se3, Sym3, Vec3, WORLD,
    integrate, lie, random_configuration, robots,
};
use num_dual::Dual64;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};

/// Returns a random generator that gives the same numbers in every run.
pub(crate) fn rng(seed: u64) -> StdRng {
    StdRng::seed_from_u64(seed)
}

/// Returns n numbers from the standard normal distribution.
pub(crate) fn normal(rng: &mut StdRng, n: usize) -> Vec<f64> {
    let mut one = || {
        let (u, angle) = (1.0 - rng.random::<f64>(), core::f64::consts::TAU * rng.random::<f64>());
        (-2.0 * u.ln()).sqrt() * angle.cos()
    };
    (0..n).map(|_| one()).collect()
}

pub(crate) fn normal3(rng: &mut StdRng) -> Vec3<f64> {
    let x = normal(rng, 3);
    Vec3::new(x[0], x[1], x[2])
}

pub(crate) fn random_rotation(rng: &mut StdRng) -> Mat3<f64> {
    let q = normal(rng, 4);
    Quaternion::new(q[0], q[1], q[2], q[3]).normalize().to_rotation()
}

pub(crate) fn random_pose(rng: &mut StdRng) -> Se3<f64> {
    Se3::new(random_rotation(rng), normal3(rng).scale(0.5))
}

/// Returns the inertia of four random mass points.
pub(crate) fn random_inertia(rng: &mut StdRng) -> Inertia<f64> {
    (0..4).fold(Inertia::zero(), |I, _| {
        let mass = 0.2 + rng.random::<f64>();
        I + Inertia::from_com(mass, normal3(rng).scale(0.5), Sym3::zero())
    })
}

/// Returns the three embedded robots, with a rotor on each joint except the free-flyer.
pub(crate) fn embedded() -> [Model; 3] {
    [robots::arm7(), robots::quadruped(), robots::humanoid()].map(|model| {
        let first = if model.bodies()[1].joint == Joint::FreeFlyer { 6 } else { 0 };
        let armature: Vec<f64> =
            (0..model.nv()).map(|k| if k < first { 0.0 } else { 0.01 + 1e-3 * k as f64 }).collect();
        model.with_armature(&armature).unwrap()
    })
}

/// Body of a random tree, and the joint that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Index of the parent body; 0 is the world.
    pub(crate) parent: usize,
    pub(crate) joint: Joint,
    pub(crate) placement: Se3<f64>,
    pub(crate) inertia: Inertia<f64>,
    pub(crate) armature: f64,
    /// Index of the part whose joint this joint follows, and the relation between the two positions. `None` if the
    /// joint follows no other joint.
    pub(crate) mimic: Option<(usize, Mimic)>,
    /// Placement of a frame on the body.
    pub(crate) frame: Se3<f64>,
}

/// Robot that can be described in more than one format. Part i (counted from 1) is named `b{i}`, and the frame on this
/// part `f{i}`.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    pub(crate) parts: Vec<Part>,
    pub(crate) gravity: Vec3<f64>,
    /// Whether the passive efforts are smooth functions of the state. Smooth efforts contain neither |v| nor |Δ|.
    pub(crate) smooth: bool,
}

impl Tree {
    /// Creates a robot with every type of joint in random order on random parents. Revolute and prismatic joints have
    /// axes parallel to coordinate axes, and also oblique axes.
    pub(crate) fn random(rng: &mut StdRng) -> Self {
        let e = |k: usize, s: f64| Vec3::from(core::array::from_fn(|i| if i == k { s } else { 0.0 }));
        let mut kinds = vec![
            Joint::Revolute { axis: e(rng.random_range(0..3), 1.0) },
            Joint::Revolute { axis: e(2, -1.0) },
            Joint::Revolute { axis: normal3(rng) },
            Joint::Continuous { axis: e(rng.random_range(0..2), 1.0) },
            Joint::Continuous { axis: normal3(rng) },
            Joint::Prismatic { axis: e(rng.random_range(0..3), -1.0) },
            Joint::Prismatic { axis: normal3(rng) },
            Joint::Helical { axis: e(rng.random_range(0..3), 1.0), pitch: 0.4 },
            Joint::Helical { axis: normal3(rng), pitch: -0.2 },
            Joint::Spherical,
            Joint::Planar,
            Joint::Translation,
            Joint::FreeFlyer,
        ];
        kinds.shuffle(rng);
        let mut tree = Self { parts: Vec::new(), gravity: normal3(rng).scale(5.0), smooth: false };
        for joint in kinds {
            // Half of the bodies have the previous body as parent, which makes some branches long.
            let n = tree.parts.len();
            let parent = if rng.random::<bool>() { n } else { rng.random_range(0..=n) };
            tree.add(rng, parent, joint);
        }
        tree
    }

    /// Creates a random robot like `random` does, with additional joints that follow other joints. Followers
    /// are in the leader's branch and in other branches, a leader may have several followers, and ratios may be
    /// negative.
    pub(crate) fn random_with_mimics(rng: &mut StdRng) -> Self {
        let mut tree = Self::random(rng);
        let n = tree.parts.len();
        let single = |tree: &Self, i: usize| tree.parts[i - 1].joint.nq() == 1;
        let earlier = (1..=n).find(|&i| single(&tree, i)).expect("there are revolute joints");
        let mut axis = || normal3(rng);
        let [a, b, c, d, e] = [(); 5].map(|()| axis());
        let leader = tree.add(rng, n, Joint::Revolute { axis: a });
        let below = tree.add(rng, leader, Joint::Revolute { axis: b });
        let between = tree.add(rng, below, Joint::Prismatic { axis: c });
        let far_below = tree.add(rng, between, Joint::Revolute { axis: d });
        let across = tree.add(rng, 0, Joint::Prismatic { axis: b });
        tree.follow(below, leader, -0.7, 0.3);
        tree.follow(far_below, leader, 1.0, 0.0);
        tree.follow(across, leader, 0.4, -0.2);
        tree.follow(earlier, between, 1.5, 0.1); // the follower has a lower index than the leader
        // Continuous joints can also be leaders and followers.
        let endless = tree.add(rng, below, Joint::Continuous { axis: e });
        let backwards = tree.add(rng, endless, Joint::Revolute { axis: a });
        let faster = tree.add(rng, 0, Joint::Continuous { axis: d });
        let wheel = tree.add(rng, across, Joint::Continuous { axis: b });
        tree.follow(backwards, endless, -1.0, 0.5);
        tree.follow(faster, endless, 3.0, -0.4);
        tree.follow(wheel, leader, 1.7, 0.2);
        tree
    }

    pub(crate) fn add(&mut self, rng: &mut StdRng, parent: usize, joint: Joint) -> usize {
        let armature = if rng.random::<bool>() { 0.1 + rng.random::<f64>() } else { 0.0 };
        self.parts.push(Part {
            parent,
            joint,
            placement: random_pose(rng),
            inertia: random_inertia(rng),
            armature,
            mimic: None,
            frame: random_pose(rng),
        });
        self.parts.len()
    }

    pub(crate) fn follow(&mut self, follower: usize, leader: usize, ratio: f64, offset: f64) {
        self.parts[follower - 1].mimic = Some((leader, Mimic { ratio, offset }));
    }

    pub(crate) fn without_mimics(&self) -> Self {
        let mut free = self.clone();
        free.parts.iter_mut().for_each(|part| part.mimic = None);
        free
    }

    pub(crate) fn build(&self) -> Model {
        let mut builder = ModelBuilder::new("tree");
        let mut ids = vec![WORLD];
        for (i, part) in self.parts.iter().enumerate() {
            let name = format!("b{}", i + 1);
            let options = JointOptions { armature: part.armature, ..losses(i, self.smooth) };
            let id =
                builder.body_with((&name, &name), ids[part.parent], part.joint, part.placement, part.inertia, options);
            if i % 2 == 1 {
                let stiffness = [
                    2.0,
                    if i % 4 == 1 && !self.smooth { 0.5 } else { 0.0 },
                    if i.is_multiple_of(3) { 0.3 } else { 0.0 },
                ];
                builder.spring(id, stiffness, rest(part.joint));
            }
            if i % 3 == 2 {
                builder.compensate_gravity(id, 0.4);
                builder.compensate_gravity_of_part(id, part.frame, part.inertia.scale(0.5), 0.7);
            }
            builder.frame(&format!("f{}", i + 1), id, part.frame);
            ids.push(id);
        }
        for (i, part) in self.parts.iter().enumerate() {
            if let Some((leader, mimic)) = part.mimic {
                builder.mimic(ids[i + 1], ids[leader], mimic);
            }
        }
        builder.gravity(self.gravity);
        builder.build().expect("a random tree is well-formed")
    }
}

/// Returns the damping (with or without a polynomial) and the friction of joint i.
fn losses(i: usize, smooth: bool) -> JointOptions {
    let damping_polynomial = if i.is_multiple_of(2) { [if smooth { 0.0 } else { 0.02 }, 0.03] } else { [0.0; 2] };
    let friction = if i.is_multiple_of(3) { 0.2 } else { 0.0 };
    JointOptions { damping: 0.1 + 0.05 * (i % 3) as f64, damping_polynomial, friction, ..JointOptions::default() }
}

/// Returns a position of a joint at which the joint's spring is at rest.
fn rest(joint: Joint) -> &'static [f64] {
    match joint {
        Joint::Continuous { .. } => &[0.6, 0.8],
        Joint::Spherical => &[0.1, -0.5, 0.5, 0.7],
        Joint::Planar => &[0.4, -0.3, 0.8, -0.6],
        Joint::Translation => &[0.1, -0.2, 0.3],
        Joint::FreeFlyer => &[-0.5, 0.2, 0.4, 0.1, -0.5, 0.5, 0.7],
        _ => &[0.3],
    }
}

/// Returns the efforts caused by an armature a: a q̈, or a (v̇ + ω × v) for the linear coordinates of a free joint.
#[allow(dead_code)] // only some of the tests use this function
pub(crate) fn armature_torque(model: &Model, v: &[f64], a: &[f64]) -> Vec<f64> {
    let mut tau: Vec<f64> = model.armature().iter().zip(a).map(|(armature, a)| armature * a).collect();
    for body in model.bodies()[1..].iter().filter(|body| body.joint == Joint::FreeFlyer) {
        let k = body.idx_v;
        let (linear, angular) = (Vec3::new(v[k], v[k + 1], v[k + 2]), Vec3::new(v[k + 3], v[k + 4], v[k + 5]));
        for (axis, x) in angular.cross(linear).to_array().into_iter().enumerate() {
            tau[k + axis] += model.armature()[k + axis] * x;
        }
    }
    tau
}

/// Creates a robot without moving bodies: two bodies fixed to the world, and a frame.
#[allow(dead_code)] // only some of the tests use this function
pub(crate) fn fixed() -> Model {
    let rng = &mut rng(0);
    let mut builder = ModelBuilder::new("fixed");
    builder.merge(WORLD, random_pose(rng), random_inertia(rng));
    builder.merge(WORLD, random_pose(rng), random_inertia(rng));
    builder.frame("tool", WORLD, random_pose(rng));
    builder.build().expect("a robot need not move")
}

/// Returns the embedded robots, a copy of the quadruped with armature in all coordinates, and random trees with and
/// without mimic joints.
pub(crate) fn all_models(trees: u64) -> Vec<Model> {
    let mut models = embedded().to_vec();
    models.push(robots::quadruped().with_armature(&[0.7; 18]).expect("three equal numbers"));
    for seed in 0..trees {
        models.push(Tree::random(&mut rng(seed)).build());
        models.push(Tree::random_with_mimics(&mut rng(100 + seed)).build());
    }
    models
}

/// Creates a tree of n joints. Every fourth joint is prismatic, and the others are revolute. `parent` gives the index
/// of a body's parent. If `floating` is true, the first joint is a free-flyer.
pub(crate) fn tree(n: usize, floating: bool, parent: impl Fn(usize) -> usize) -> Model {
    let rng = &mut rng(n as u64);
    let mut builder = ModelBuilder::new("tree");
    let mut ids = vec![WORLD];
    for i in 1..=n {
        let axis = Vec3::from(core::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
        let joint = match i {
            1 if floating => Joint::FreeFlyer,
            _ if i % 4 == 0 => Joint::Prismatic { axis },
            _ => Joint::Revolute { axis },
        };
        let id = builder.body(&format!("b{i}"), ids[parent(i)], joint, random_pose(rng), random_inertia(rng));
        builder.frame(&format!("f{i}"), id, Se3::identity());
        ids.push(id);
    }
    builder.build().expect("a tree is well-formed")
}

/// Returns three long trees: a chain on the world, a chain on a floating base, and a tree whose branches divide again.
pub(crate) fn long_branches() -> [Model; 3] {
    [
        tree(53, false, |i| i - 1),
        tree(50, true, |i| i - 1),
        tree(90, true, |i| match i {
            31 | 61 => 30,
            71 => 50,
            76 => 0,
            _ => i - 1,
        }),
    ]
}

/// State of a robot, and the efforts and forces that act on it.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) a: Vec<f64>,
    pub(crate) tau: Vec<f64>,
    /// External force on each body, including the world. The force on the world must have no effect.
    pub(crate) f_ext: Vec<Force<f64>>,
}

impl State {
    pub(crate) fn random(model: &Model, rng: &mut StdRng) -> Self {
        let q = random_configuration(model, rng);
        let mut vector = || normal(rng, model.nv());
        let (v, a, tau) = (vector(), vector(), vector());
        let f_ext = (0..model.bodies().len()).map(|_| Force::new(normal3(rng), normal3(rng))).collect();
        Self { q, v, a, tau, f_ext }
    }
}

pub(crate) fn lift<S: Scalar>(x: &[f64]) -> Vec<S> {
    x.iter().map(|&x| S::splat(x)).collect()
}

pub(crate) fn lift_forces<S: Scalar>(f: &[Force<f64>]) -> Vec<Force<S>> {
    f.iter().map(|f| f.lift()).collect()
}

/// Returns the dual numbers x + ε d.
pub(crate) fn dual(x: &[f64], d: &[f64]) -> Vec<Dual64> {
    x.iter().zip(d).map(|(&x, &d)| Dual64::new(x, d)).collect()
}

pub(crate) fn real(x: &[Dual64]) -> Vec<f64> {
    x.iter().map(|x| x.re).collect()
}

pub(crate) fn eps(x: &[Dual64]) -> Vec<f64> {
    x.iter().map(|x| x.eps).collect()
}

pub(crate) fn unit(n: usize, k: usize) -> Vec<f64> {
    (0..n).map(|i| if i == k { 1.0 } else { 0.0 }).collect()
}

/// Returns q ⊕ d.
pub(crate) fn moved<S: Scalar>(model: &Model, q: &[S], d: &[S]) -> Vec<S> {
    let mut out = q.to_vec();
    integrate(model, q, d, &mut out);
    out
}

/// Computes the placement of a body in its parent by Rodrigues' formula about the joint's axis, as in textbooks.
pub(crate) fn joint_placement(joint: Joint, q: &[f64]) -> Se3<f64> {
    let turn = |w: Vec3<f64>| lie::exp3(w).to_rotation();
    let z = Vec3::new(0.0, 0.0, 1.0);
    let (rotation, translation) = match joint {
        Joint::Revolute { axis } => (turn(axis.scale(q[0])), Vec3::zero()),
        Joint::Continuous { axis } => (turn(axis.scale(q[1].atan2(q[0]))), Vec3::zero()),
        Joint::Prismatic { axis } => (Mat3::identity(), axis.scale(q[0])),
        Joint::Helical { axis, pitch } => (turn(axis.scale(q[0])), axis.scale(pitch * q[0])),
        Joint::Spherical => (Quaternion::new(q[0], q[1], q[2], q[3]).to_rotation(), Vec3::zero()),
        Joint::Planar => (turn(z.scale(q[3].atan2(q[2]))), Vec3::new(q[0], q[1], 0.0)),
        Joint::Translation => (Mat3::identity(), Vec3::new(q[0], q[1], q[2])),
        Joint::FreeFlyer => (Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation(), Vec3::new(q[0], q[1], q[2])),
        _ => unreachable!("there are no other joints"),
    };
    Se3::new(rotation, translation)
}

/// Computes the position of joint i in the coordinates of its own type. For a follower it is ratio · q + offset, where
/// q is the leader's position as an angle.
pub(crate) fn own_position(model: &Model, i: usize, q: &[f64]) -> Vec<f64> {
    let body = &model.bodies()[i];
    let Some(Mimic { ratio, offset }) = body.mimic else { return q[body.idx_q..body.idx_q + body.joint.nq()].to_vec() };
    let leads = |b: &&condyle_dynamics::Body| b.mimic.is_none() && b.idx_v == body.idx_v;
    let leader = model.bodies()[1..].iter().find(leads).expect("it has a leader").joint;
    let q = &q[body.idx_q..];
    let x = ratio * if leader.nq() == 2 { q[1].atan2(q[0]) } else { q[0] } + offset;
    if body.joint.nq() == 2 { vec![x.cos(), x.sin()] } else { vec![x] }
}

/// Returns the twelve numbers of the placement X.
pub(crate) fn flat<S: Scalar>(X: Se3<S>) -> Vec<S> {
    X.rotation.columns().into_iter().chain([X.translation]).flat_map(Vec3::to_array).collect()
}

/// Returns max |a − b| / (1 + max |b|), or infinity if any number is NaN.
pub(crate) fn relative(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = |x: f64, y: f64| if y.is_nan() { f64::INFINITY } else { x.max(y) };
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, largest);
    difference / (1.0 + b.iter().map(|b| b.abs()).fold(0.0, largest))
}

/// Largest error found in a test, and the tolerance of this error.
pub(crate) struct Worst {
    name: &'static str,
    tolerance: f64,
    error: f64,
}

impl Worst {
    pub(crate) fn new(name: &'static str, tolerance: f64) -> Self {
        Self { name, tolerance, error: 0.0 }
    }

    /// Compares two results. Fails if their relative error exceeds the tolerance.
    #[track_caller]
    pub(crate) fn see(&mut self, model: &Model, found: &[f64], expected: &[f64]) {
        let error = relative(found, expected);
        assert!(error <= self.tolerance, "{}: error {error:.1e} on\n{model}", self.name);
        self.error = self.error.max(error);
    }
}

impl Drop for Worst {
    fn drop(&mut self) {
        println!("{}: {:.1e} (allowed {:.0e})", self.name, self.error, self.tolerance);
    }
}
