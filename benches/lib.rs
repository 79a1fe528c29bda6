//! Robot models and motions that several benchmarks use.

pub mod motions;

use condyle::spatial::Mat3;
use condyle::tree::BodyId;
use condyle::{Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Builds a quadrotor: one free body.
pub fn quadrotor() -> Model {
    let frame = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.02));
    let mut builder = ModelBuilder::new("quadrotor");
    let frame = builder.body("frame", WORLD, Joint::FreeFlyer, Se3::identity(), frame);
    builder.frame("base", frame, Se3::identity());
    builder.build().expect("a body in the air is well-formed")
}

/// Builds a cart on a rail with a pole.
pub fn cart_pole() -> Model {
    let (mut builder, along, across) =
        (ModelBuilder::new("cart_pole"), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
    let cart = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1));
    let cart = builder.body("cart", WORLD, Joint::Prismatic { axis: along }, Se3::identity(), cart);
    let pole = Inertia::from_com(0.1, Vec3::new(0.0, 0.0, 0.5), Sym3::diagonal(0.01));
    builder.body("pole", cart, Joint::Revolute { axis: across }, Se3::identity(), pole);
    builder.frame("cart", cart, Se3::identity());
    builder.build().expect("a cart with a pole is well-formed")
}

/// Builds a tree of n hinges whose axes change from joint to joint. `parent` gives the parent of each body from 1 to n;
/// 0 is the world.
pub fn tree(n: usize, parent: impl Fn(usize) -> usize) -> Model {
    let mut rng = StdRng::seed_from_u64(7);
    let mut builder = ModelBuilder::new("tree");
    let mut ids: Vec<BodyId> = vec![WORLD];
    for i in 1..=n {
        let mut r = || 0.2 * rng.random::<f64>() - 0.1;
        let inertia = Inertia::from_com(1.0, Vec3::new(r(), r(), r()), Sym3::diagonal(0.01));
        let placement = Se3::new(Mat3::identity(), Vec3::new(r(), r(), 0.2));
        let axis = Vec3::from(core::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
        ids.push(builder.body(&format!("b{i}"), ids[parent(i)], Joint::Revolute { axis }, placement, inertia));
    }
    builder.build().expect("a tree is well-formed")
}
