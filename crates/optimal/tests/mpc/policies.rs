//! Policies: the plan at a time, and its feedback in another thread.

use condyle_dynamics::{ContactConstraint, neutral, robots};
use condyle_optimal::robot::{
    Activation, Contact, ContactDynamics, ControlBounds, Cost, Dynamics, FreeDynamics, ImpulseDynamics, Integrator,
    Knot, Residual,
};
use condyle_optimal::{ActionModel, Error, Fddp, PolicyPublisher, Problem, Solution};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Tolerance of two results that are rounded differently.
const ROUNDING: f64 = 1e-12;
/// Number of threads that read plans, and number of changes of the plan that each of them must see.
const READERS: usize = 3;
const CHANGES: usize = 20;
/// Time after which a reader that has not seen these changes is a fault. They take some milliseconds on free cores.
const PATIENCE: Duration = Duration::from_secs(60);

/// Returns a problem of an arm with knots of 0.02 s and 0.05 s, and a solution of the problem.
fn arm(effort: f64) -> (Problem, Solution) {
    let model = Arc::new(robots::arm7());
    let costs = vec![
        Cost::new("effort", effort, Residual::Control { reference: vec![1.0; 7] }, Activation::Quadratic),
        Cost::new("rest", 1.0, Residual::State { reference: vec![0.2; 14] }, Activation::Quadratic),
    ];
    let mut problem = bounded(&model, costs);
    problem.set_duration(1, 0.05).unwrap();
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 5;
    let us = problem.quasi_static(&[0.1; 7 * 14]).unwrap();
    let solution = solver.solve(&mut problem, &[0.1; 7 * 14], &us).unwrap().clone();
    (problem, solution)
}

fn bounded(model: &Arc<condyle_dynamics::Model>, costs: Vec<Cost>) -> Problem {
    let dynamics = Dynamics::Free { actuation: None, integrator: Integrator::SemiImplicitEuler, dt: 0.02 };
    let bounds = Some(ControlBounds { lower: vec![-20.0; 7], upper: vec![20.0; 7] });
    let knot = Knot { bounds, ..Knot::new(dynamics, costs) }.build(model).unwrap();
    let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
    Problem::new(vec![0.1; 14], vec![knot], vec![0; 6], Box::new(end)).unwrap()
}

#[test]
fn a_plan_is_interpolated_between_its_knots() {
    let (problem, solution) = arm(1e-2);
    // knots begin at 0, 0.02, 0.07, 0.09, … s
    for (t, knot, s) in [(-1.0, 0, 0.0), (0.0, 0, 0.0), (0.015, 0, 0.75), (0.03, 1, 0.2), (0.08, 2, 0.5), (9.0, 5, 1.0)]
    {
        let point = solution.at(&problem, t).unwrap();
        assert_eq!(point.knot, knot, "{t}");
        for i in 0..14 {
            let expected = (1.0 - s) * solution.x(knot)[i] + s * solution.x(knot + 1)[i];
            assert!((point.x[i] - expected).abs() < ROUNDING, "{t}: {} {expected}", point.x[i]);
        }
        assert_eq!((&point.u[..], &point.K), (solution.u(knot), &solution.K[knot]));
    }
}

/// Checks the state between two placements of a base on a screw: the translation along the axis and the angle about it
/// grow linearly.
#[test]
fn a_base_is_interpolated_along_a_screw() {
    let model = Arc::new(robots::quadruped());
    let q = neutral(&model);
    let at = |s: f64| {
        let (sin, cos) = (0.6 * s).sin_cos();
        [vec![0.1, 0.2, 0.3 + 0.4 * s, 0.0, 0.0, sin, cos], q[7..].to_vec(), vec![2.0 * s; 18]].concat()
    };
    let knot = FreeDynamics::running(model.clone(), 0.5, vec![]).unwrap();
    let end = FreeDynamics::terminal(model, vec![]).unwrap();
    let mut problem = Problem::new(at(0.0), vec![Box::new(knot)], vec![0; 1], Box::new(end)).unwrap();
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 0;
    let solution = solver.solve(&mut problem, &[at(0.0), at(1.0)].concat(), &[0.0; 12]).unwrap();
    for s in [0.0, 0.3, 0.5, 1.0] {
        let point = solution.at(&problem, 0.5 * s).unwrap();
        for (x, expected) in point.x.iter().zip(at(s)) {
            assert!((x - expected).abs() < ROUNDING, "{s}: {:?}", point.x);
        }
    }
}

#[test]
fn a_policy_is_the_feedback_of_the_last_solution() {
    let (problem, solution) = arm(1e-2);
    let mut publisher = PolicyPublisher::new(&problem).unwrap();
    let mut policy = publisher.policy();
    let (x, mut u) = (vec![0.15; 14], vec![7.0; 7]);
    assert!(policy.control(0.0, &x, &mut u).is_none() && policy.nu(0.0).is_none());
    assert_eq!(u, [7.0; 7]);
    publisher.publish(&problem, &solution, 3.0).unwrap();
    for t in [2.0, 3.0, 3.03, 3.08, 3.1, 5.0] {
        let point = solution.at(&problem, t - 3.0).unwrap();
        let found = policy.control(t, &x, &mut u).unwrap();
        assert_eq!((found.knot, found.is_late, found.has_feedback), (point.knot, t >= 3.15, true));
        let dx = nalgebra::DVector::from_iterator(14, x.iter().zip(&point.x).map(|(x, plan)| x - plan));
        let expected = nalgebra::DVector::from_vec(point.u) + point.K * dx;
        for (u, expected) in u.iter().zip(&expected) {
            assert!((u - expected.clamp(-20.0, 20.0)).abs() < 1e-9, "{t}: {u} {expected}");
        }
    }
    assert!(solution.us.iter().any(|u| u.abs() > 1.0));
    // far states lead to the bounds, and states that are not finite to the plan without feedback
    policy.control(3.0, &[30.0; 14], &mut u).unwrap();
    assert!(u.iter().any(|u| u.abs() == 20.0) && u.iter().all(|u| u.abs() <= 20.0));
    let mut lost = x.clone();
    lost[3] = f64::NAN;
    assert!(!policy.control(3.0, &lost, &mut u).unwrap().has_feedback);
    assert_eq!(u, solution.u(0));
    // other times than the problem's
    let times: Vec<f64> = (0..7).map(f64::from).collect();
    publisher.publish_at(&problem, &solution, &times).unwrap();
    assert_eq!(policy.control(4.5, &x, &mut u).unwrap().knot, 4);
    let wrong = publisher.publish_at(&problem, &solution, &times[1..]).unwrap_err();
    assert_eq!(wrong, Error::Length { name: "times", expected: 7, found: 6 });
}

/// Checks that an impact takes no time: the plan before it leads to the state before the impact.
#[test]
fn an_impact_takes_no_time() {
    let model = Arc::new(robots::quadruped());
    let x0 = [neutral(&model), vec![0.0; 18]].concat();
    let contacts = [Contact::new("LF_foot", ContactConstraint::point(model.frame("LF_foot").unwrap()))];
    let stance = ContactDynamics::running(model.clone(), &contacts, 0.1, vec![]).unwrap();
    let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 0.0, vec![]).unwrap();
    let end = FreeDynamics::terminal(model, vec![]).unwrap();
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(stance), Box::new(impact)];
    let mut problem = Problem::new(x0.clone(), models, vec![0, 1, 0, 1], Box::new(end)).unwrap();
    let durations: Vec<_> = (0..4).map(|t| problem.duration(t)).collect();
    assert_eq!(durations, [Some(0.1), Some(0.0), Some(0.1), Some(0.0)]);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 0;
    let xs: Vec<f64> = (0..5).flat_map(|t| [x0[..19].to_vec(), vec![f64::from(t); 18]].concat()).collect();
    let solution = solver.solve(&mut problem, &xs, &[1.0; 24]).unwrap();
    for (t, knot, speed) in [(0.05, 0, 0.5), (0.1, 2, 2.0), (0.15, 2, 2.5), (0.2, 2, 3.0), (0.3, 2, 3.0)] {
        let point = solution.at(&problem, t).unwrap();
        assert_eq!((point.knot, point.u.len()), (knot, 12));
        assert!((point.x[19] - speed).abs() < ROUNDING, "{t}: {}", point.x[19]);
    }
}

#[test]
fn knots_without_duration_need_times() {
    let unicycle = condyle_optimal::Unicycle::default();
    let end = Box::new(unicycle.clone().terminal());
    let mut problem = Problem::new(vec![1.0; 3], vec![Box::new(unicycle)], vec![0; 2], end).unwrap();
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &[1.0; 9], &[0.0; 4]).unwrap();
    assert_eq!(solution.at(&problem, 0.0).unwrap_err(), Error::NoDuration { knot: 0 });
    let mut publisher = PolicyPublisher::new(&problem).unwrap();
    assert_eq!(publisher.publish(&problem, solution, 0.0).unwrap_err(), Error::NoDuration { knot: 0 });
    publisher.publish_at(&problem, solution, &[0.0, 1.0, 2.0]).unwrap();
    let mut u = [0.0; 2];
    assert_eq!(publisher.policy().control(1.5, solution.x(1), &mut u).unwrap().knot, 1);
}

/// Checks that readers always find one whole plan while new plans are published, and that every plan arrives.
#[test]
fn readers_find_whole_plans_while_others_are_published() {
    let plans = [arm(1e-2), arm(1e-1)];
    let problem = &plans[0].0;
    let mut publisher = PolicyPublisher::new(problem).unwrap();
    let times = [0.0, 0.03, 0.08];
    let x = vec![0.15; 14];
    let expected: Vec<Vec<Vec<f64>>> = plans
        .iter()
        .map(|(_, solution)| {
            publisher.publish(problem, solution, 0.0).unwrap();
            let mut policy = publisher.policy();
            let control = |t: &f64| {
                let mut u = vec![0.0; 7];
                policy.control(*t, &x, &mut u).unwrap();
                u
            };
            times.iter().map(control).collect()
        })
        .collect();
    assert_ne!(expected[0], expected[1]);
    let ended = AtomicBool::new(false);
    // readers that have found both plans many times; the scheduler decides how long that takes
    let content = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..READERS {
            let (mut policy, ended, content, expected, x) = (publisher.policy(), &ended, &content, &expected, &x);
            scope.spawn(move || {
                let (mut changes, mut before, mut is_content, mut u) = (0, 0, false, vec![0.0; 7]);
                while !ended.load(Ordering::Relaxed) {
                    for (k, t) in times.iter().enumerate() {
                        policy.control(*t, x, &mut u).unwrap();
                        let which = (0..2).find(|&plan| expected[plan][k] == u).expect("is one of the two plans");
                        changes += usize::from(which != before);
                        before = which;
                    }
                    if changes >= CHANGES && !is_content {
                        is_content = true;
                        content.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
        let begin = Instant::now();
        let mut k = 0;
        while (content.load(Ordering::Relaxed) < READERS && begin.elapsed() < PATIENCE) || k % 2 == 1 {
            publisher.publish(problem, &plans[k % 2].1, 0.0).unwrap();
            k += 1;
        }
        ended.store(true, Ordering::Relaxed);
    });
    assert_eq!(content.load(Ordering::Relaxed), READERS, "a reader keeps an old plan");
    let (mut policy, mut u) = (publisher.policy(), vec![0.0; 7]);
    policy.control(times[0], &x, &mut u).unwrap();
    assert_eq!(u, expected[1][0]); // the last plan
}
