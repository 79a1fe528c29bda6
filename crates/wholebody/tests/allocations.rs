//! Tests that a step does not allocate memory, except with clarabel.

mod common;
#[path = "../../../tests/common/counting.rs"]
mod counting;

use common::*;
use condyle_dynamics::robots;
use condyle_wholebody::{Backend, Settings, Task, WholeBodyController};
use counting::allocated;

/// Checks that the assembly and Condyle's own solver do not allocate memory with any set of contacts. Clarabel
/// allocates once in a solve, and more often for a new set of contacts.
#[test]
fn assembly_allocates_nothing() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    for (priority, backend) in
        [(0, Backend::Clarabel), (1, Backend::Clarabel), (0, Backend::InteriorPoint), (1, Backend::InteriorPoint)]
    {
        let tasks = [humanoid_tasks(), vec![Task { priority, ..Task::pose("left_hand") }]].concat();
        let mut controller =
            WholeBodyController::new(&model, &soles(0.7), &tasks, Settings { backend, ..Settings::default() }).unwrap();
        let mut references = controller.hold(&q).unwrap();
        for round in 0..3 {
            for set in [3u32, 1, 3, 2, 0] {
                for k in 0..2 {
                    references.contacts[k].activation = f64::from(set >> k & 1);
                }
                let before = allocated();
                controller.step(&q, &v, &references).solved().unwrap();
                // Clarabel allocates once for each priority that is solved. A priority is not solved if earlier
                // priorities leave no freedom.
                let allowed = if backend == Backend::Clarabel { priority + 1 } else { 0 };
                if round > 0 || backend == Backend::InteriorPoint {
                    assert!(allocated() - before <= allowed, "set {set}: {}", allocated() - before);
                }
            }
        }
        // A step with a safe command must not allocate either.
        references.com.position.x = f64::NAN;
        for _ in 0..10 {
            let before = allocated();
            controller.step(&q, &v, &references).solved().unwrap_err();
            assert_eq!(allocated(), before);
        }
    }
}
