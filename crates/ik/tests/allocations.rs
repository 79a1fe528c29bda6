//! Tests that a step does not allocate memory.

#[path = "../../../tests/common/counting.rs"]
mod counting;

use condyle_dynamics::distances::{Geometry, GeometryPair, Shape};
use condyle_dynamics::{Vec3, neutral, robots};
use condyle_ik::{DifferentialIk, DistanceLimits, Settings, Task};
use counting::allocated;

#[test]
fn steps_allocate_nothing() {
    let model = robots::humanoid();
    let joint = model.bodies()[3].joint_name.clone();
    let tasks = [
        Task::pose("left_foot"),
        Task { priority: 1, ..Task::relative_pose("left_hand", "right_hand") },
        Task { priority: 1, damping: 0.1, ..Task::com() },
        Task { priority: 2, ..Task::posture() },
        Task { priority: 2, ..Task::manipulability("left_hand") },
        Task { priority: 2, ..Task::coupling(&[(&joint, 1.0)], 0.1) },
        Task { priority: 2, ..Task::rest() },
    ];
    let ball = |frame: &str| Geometry::on(frame, Shape::sphere(Vec3::zero(), 0.1));
    let pairs = vec![GeometryPair::new(ball("left_hand"), ball("right_hand"))];
    let distances = DistanceLimits { range: 10.0, ..DistanceLimits::new(pairs) };
    let settings = Settings { distances: Some(distances), ..Settings::default() };
    let mut ik = DifferentialIk::new(&model, &tasks, settings).unwrap();
    let mut q = neutral(&model);
    let mut targets = ik.hold(&q).unwrap();
    let v0 = vec![0.0; model.nv()];
    for _ in 0..20 {
        targets.frames[1].translation.x += 0.02;
        targets.com.z -= 0.01;
        let before = allocated();
        ik.step(&q, &v0, &targets).unwrap();
        ik.converge(&mut q, &targets, [1e-9; 2], 5).unwrap();
        assert_eq!(allocated(), before);
    }
    assert!(!ik.last().held.is_empty()); // limits were active
}
