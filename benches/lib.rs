//! Robot models that several benchmarks use.

use condyle::spatial::Mat3;
use condyle::tree::BodyId;
use condyle::{Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

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
