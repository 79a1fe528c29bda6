//! Times 100 distances of capsules, without and with gradients. The kinematics are not part of the time.
//! `cargo bench -p condyle-benches --bench distances`

use condyle::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
use condyle::{Data, Model, forward_kinematics, neutral, robots};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

/// Number of pairs.
const PAIRS: usize = 100;

/// Returns pairs of capsules on all bodies of a robot, and in the world.
fn pairs(model: &Model) -> Vec<GeometryPair> {
    let shape = Shape::capsule([0.0; 3], [0.0, 0.05, 0.2], 0.05);
    let frame = |body: usize| model.frames().iter().find(|frame| frame.body == body);
    let on_robot: Vec<_> =
        (1..model.bodies().len()).filter_map(frame).map(|frame| Geometry::on(frame, shape)).collect();
    let obstacle = |k: usize| {
        let x = 0.1 * k as f64;
        Geometry::in_world(Shape::capsule([1.0, x, 0.0], [1.0, 0.3, 2.0 * x], 0.05))
    };
    let obstacles: Vec<_> = (0..20).map(obstacle).collect();
    let others = |i: usize| on_robot[i + 1..].iter().chain(&obstacles);
    let all = (0..on_robot.len()).flat_map(|i| others(i).map(move |other| (i, other)));
    let all: Vec<_> = all.map(|(i, other)| GeometryPair::new(on_robot[i].clone(), other.clone())).collect();
    (0..PAIRS).map(|k| all[k * all.len() / PAIRS].clone()).collect()
}

fn distances(c: &mut Criterion) {
    for model in [robots::arm7(), robots::humanoid()] {
        let prepared = DistancePairs::new(&model, &pairs(&model)).expect("the frames exist");
        let (mut data, mut found) = (Data::new(&model), Distances::new(&prepared));
        let q = neutral(&model);
        let placements = forward_kinematics(&model, &mut data, &q);
        let mut group = c.benchmark_group(format!("{PAIRS} capsule pairs, {}", model.name()));
        group.throughput(Throughput::Elements(PAIRS as u64));
        group.bench_function(BenchmarkId::from_parameter("distances"), |b| {
            b.iter(|| prepared.values(placements, &mut found));
        });
        group.bench_function(BenchmarkId::from_parameter("distances and gradients"), |b| {
            b.iter(|| prepared.gradients(placements, &mut found));
        });
    }
}

criterion_group!(benches, distances);
criterion_main!(benches);
