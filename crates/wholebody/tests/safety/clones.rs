//! Tests that clones of a controller continue like the original.

use crate::common::*;
use condyle_dynamics::robots;
use condyle_wholebody::{Backend, Command, Formulation, Settings, Task, WholeBodyController};

/// Makes step k near the stance. From step to step, contacts appear and disappear, and some states and references are
/// invalid. Tasks have two priorities.
fn tick(controller: &mut WholeBodyController, k: u64) -> Command {
    let model = robots::quadruped();
    let (q, v) = state(&model, k / 4, 0.05, 0.2);
    let mut references = controller.clone().hold(&stance()).unwrap();
    references.contacts[(k / 8) as usize % 4].activation = [1.0, 0.3, 0.0, 1.0][k as usize % 4];
    references.com.position.y += 0.01 * k as f64;
    if k % 7 == 3 {
        references.frames[0].pose.rotation.x.x = f64::NAN;
    }
    let q = if k % 11 == 5 { q.iter().map(|x| 2.0 * x).collect() } else { q };
    controller.step(&q, &v, &references).clone()
}

fn described(settings: Settings) -> WholeBodyController {
    let tasks = [tasks(), vec![Task { priority: 1, ..Task::position("LF_foot") }]].concat();
    WholeBodyController::new(&robots::quadruped(), &feet(0.7), &tasks, settings).unwrap()
}

/// Checks Condyle's own solver: from any tick, clones continue with the same bits, with and without warm starts.
#[test]
fn a_clone_has_the_same_bits() {
    for (warm_start, formulation) in
        [(true, Formulation::Condensed), (false, Formulation::Condensed), (true, Formulation::Full)]
    {
        let mut controller = described(Settings { warm_start, formulation, ..Settings::default() });
        for k in 0..24 {
            let mut clone = controller.clone();
            assert_eq!(format!("{:?}", clone.command()), format!("{:?}", controller.command()));
            for later in k..k + 3 {
                let ours = tick(&mut controller.clone(), later);
                let theirs = tick(&mut clone, later);
                if later == k {
                    assert_eq!(format!("{ours:?}"), format!("{theirs:?}"), "tick {k}");
                }
            }
            tick(&mut controller, k);
        }
        // Earlier clones have not changed the controller: a controller that was never cloned gives the same command.
        let mut alone = described(Settings { warm_start, formulation, ..Settings::default() });
        let last = (0..24).map(|k| tick(&mut alone, k)).last().unwrap();
        assert_eq!(format!("{last:?}"), format!("{:?}", controller.command()));
    }
}

/// Checks that commands of clones agree up to clarabel's tolerance if clarabel is the solver. A clone builds clarabel's
/// solvers again.
#[test]
fn a_clone_with_clarabel_has_the_same_solution() {
    // With these weights and this tolerance, forces and efforts are accurate enough to be compared.
    let (backend, tolerance) = (Backend::Clarabel, 1e-11);
    let settings = Settings { backend, tolerance, force_weight: 1e-5, ..Settings::default() };
    let mut controller = WholeBodyController::new(&robots::quadruped(), &feet(0.7), &tasks(), settings).unwrap();
    for k in 0..12 {
        let theirs = tick(&mut controller.clone(), k);
        let ours = tick(&mut controller, k);
        assert_eq!((format!("{}", ours.status), ours.source), (format!("{}", theirs.status), theirs.source));
        let apart = max_abs(ours.tau.iter().zip(&theirs.tau).map(|(a, b)| a - b));
        assert!(apart < 1e-3, "tick {k}: {apart:.1e} N m apart");
    }
}

/// Checks that `restore` rejects numbers of another controller, too few or too many numbers, and invalid numbers.
#[test]
fn numbers_of_another_controller_are_refused() {
    let mut controller = described(Settings::default());
    (0..5).for_each(|k| drop(tick(&mut controller, k)));
    let numbers = controller.carried();
    let restored = |numbers: &[f64]| described(Settings::default()).restore(numbers);
    assert!(restored(&numbers));
    assert!(!restored(&numbers[1..]) && !restored(&numbers[..numbers.len() - 1]) && !restored(&[]));
    assert!(!restored(&[numbers.clone(), vec![0.0]].concat()));
    let other = WholeBodyController::new(&robots::quadruped(), &feet(0.7)[..2], &tasks(), Settings::default()).unwrap();
    assert!(!restored(&other.carried()));
    for value in [f64::NAN, -1.0, 0.5, 1e300] {
        let mut broken = numbers.clone();
        broken[0] = value; // the first number tells whether a contact touches
        assert!(!restored(&broken), "{value}");
    }
}
