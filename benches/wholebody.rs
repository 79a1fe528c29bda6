//! Times a tick (one step) of whole-body control, for robots that stand or move under pushes. The benchmark replays one
//! second of recorded states. Each tick starts from the controller's solution of the previous tick. `cargo bench -p
//! condyle-benches --bench wholebody`

#[path = "../crates/wholebody/tests/common/workload.rs"]
mod workload;

use condyle_wholebody::{Backend, Settings};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use workload::{Robot, Tick, record};

const TICKS: usize = 1000;

fn wholebody(c: &mut Criterion) {
    for name in ["quadruped", "humanoid"] {
        let robot = Robot::new(name, None).expect("an embedded robot");
        for moves in [false, true] {
            let ticks = record(&robot, moves, TICKS);
            let motion = if moves { robot.gait() } else { "stands" };
            let mut group = c.benchmark_group(format!("{TICKS} ticks, {name}, {motion}"));
            group.throughput(Throughput::Elements(TICKS as u64)).sample_size(10);
            let mut controller = robot.controller(Robot::settings());
            let each = ticks.iter();
            group.bench_function(BenchmarkId::from_parameter("assembly"), |b| {
                b.iter(|| each.clone().for_each(|Tick { q, v, references }| controller.assemble(q, v, references)));
            });
            for (solver, backend) in [("interior point", Backend::InteriorPoint), ("clarabel", Backend::Clarabel)] {
                let mut controller = robot.controller(Settings { backend, ..Robot::settings() });
                group.bench_function(BenchmarkId::from_parameter(solver), |b| {
                    b.iter(|| {
                        for Tick { q, v, references } in &ticks {
                            black_box(controller.step(q, v, references));
                        }
                    });
                });
            }
        }
    }
}

criterion_group!(benches, wholebody);
criterion_main!(benches);
