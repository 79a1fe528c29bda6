//! Iterations and ticks in two parts, `prepare` and `feedback`: they equal undivided ones.

use super::budgets::Unstable;
use condyle_dynamics::{ContactConstraint, Model, ReferenceFrame, neutral, robots};
use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FreeDynamics, FrictionCone, Limit, Residual};
use condyle_optimal::{ActionModel, Error, Fallback, Fddp, InteriorPoint, Problem, Solution, Status};
use std::sync::Arc;
use std::sync::atomic::Ordering;

const HORIZON: usize = 12;
const DT: f64 = 0.02;

/// Kind of bounds of a problem.
#[derive(Clone, Copy, PartialEq)]
enum Bounds {
    None,
    /// Bounds on controls.
    Controls,
    /// Limits of efforts and friction cones.
    Limits,
}

/// Returns the problems of an arm, a standing quadruped and a standing biped.
fn problems(bounds: Bounds) -> Vec<Problem> {
    let quadruped = robots::quadruped();
    let mut q = neutral(&quadruped);
    q[2] = 0.535;
    q[7..].copy_from_slice(&[0.0, 0.7, -1.4, 0.0, -0.7, 1.4].repeat(2));
    let humanoid = robots::humanoid();
    let upright = neutral(&humanoid);
    vec![
        problem(robots::arm7(), vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], &[], false, bounds),
        problem(quadruped, q, &["LF_foot", "LH_foot", "RF_foot", "RH_foot"], false, bounds),
        problem(humanoid, upright, &["left_foot", "right_foot"], true, bounds),
    ]
}

/// Creates the problem of a robot that stands on its feet, or of a fixed arm, and returns to its posture.
fn problem(model: Model, q: Vec<f64>, feet: &[&str], rigid: bool, bounds: Bounds) -> Problem {
    let rest = [q, vec![0.0; model.nv()]].concat();
    let model = Arc::new(model);
    let contact = |foot: &&str| {
        let frame = model.frame(foot).unwrap();
        let held = if rigid { ContactConstraint::rigid(frame) } else { ContactConstraint::point(frame) };
        Contact::new(foot, ContactConstraint { kd: 1.0 / DT, reference: ReferenceFrame::LocalWorldAligned, ..held })
    };
    let contacts: Vec<_> = feet.iter().map(contact).collect();
    let state = |weight| Cost::new("state", weight, Residual::State { reference: rest.clone() }, Activation::Quadratic);
    let still = match feet {
        [] => FreeDynamics::running(model.clone(), DT, vec![]).unwrap().quasi_static(&rest),
        _ => ContactDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap().quasi_static(&rest),
    };
    let effort = Residual::Control { reference: still.clone() };
    let costs = vec![state(1.0), Cost::new("effort", 1e-3, effort.clone(), Activation::Quadratic)];
    let width = if rigid { 30.0 } else { 4.0 + feet.len() as f64 }; // N m, beside the controls of the stand
    let (low, high): (Vec<_>, Vec<_>) = still.iter().map(|u| (u - width, u + width)).unzip();
    let mut limits = vec![];
    if bounds == Bounds::Limits {
        let most = vec![width; still.len()];
        limits.push(Limit::new("effort", effort, most.iter().map(|x| -x).collect(), most));
        if !rigid {
            limits.extend(feet.iter().map(|foot| {
                let cone = FrictionCone { least: 5.0, ..FrictionCone::new(0.5) };
                let (lower, upper) = cone.bounds();
                Limit::new(foot, Residual::FrictionCone { contact: (*foot).to_owned(), cone }, lower, upper)
            }));
        }
    }
    macro_rules! boxed {
        ($knot:expr) => {{
            let knot = $knot.with_limits(limits).unwrap();
            let knot = if bounds == Bounds::Controls { knot.with_bounds(low, high) } else { knot };
            Box::new(knot) as Box<dyn ActionModel>
        }};
    }
    let knot = match feet {
        [] => boxed!(FreeDynamics::running(model.clone(), DT, costs).unwrap()),
        _ => boxed!(ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap()),
    };
    let end = FreeDynamics::terminal(model, vec![state(10.0)]).unwrap();
    Problem::new(rest, vec![knot], vec![0; HORIZON], Box::new(end)).unwrap()
}

/// Returns the state x, with velocities that are larger by `push`.
fn pushed(problem: &Problem, x: &[f64], push: f64) -> Vec<f64> {
    let (mut to, first) = (x.to_vec(), problem.nx() - problem.ndx() / 2);
    to[first..first + 3].iter_mut().for_each(|v| *v += push);
    to
}

/// Checks that two solutions are equal to the bit, except for their timings.
fn assert_same(ours: &Solution, expected: &Solution, what: &str) {
    let mut ours = ours.clone();
    ours.timings = expected.timings;
    assert_eq!(ours.xs, expected.xs, "{what}");
    assert!(&ours == expected, "{what}: {} {}", ours.status, expected.status);
}

/// Moves the horizon by a knot.
macro_rules! shift {
    ($problem:expr, $solver:expr) => {
        $problem.shift(0).unwrap();
        $solver.shift(&mut $problem).unwrap();
    };
}

#[test]
fn an_iteration_in_two_halves_equals_a_whole_one() {
    for bounds in [Bounds::None, Bounds::Controls] {
        for (k, mut problem) in problems(bounds).into_iter().enumerate() {
            let mut solver = Fddp::new(&problem);
            let xs = problem.x0().repeat(HORIZON + 1);
            let us = problem.quasi_static(&xs).unwrap();
            let start = pushed(&problem, problem.x0(), 0.2);
            problem.set_x0(&start).unwrap();
            solver.solve(&mut problem, &xs, &us).unwrap();
            for (tick, push) in [0.0, 0.3, -0.8, 0.0].into_iter().enumerate() {
                shift!(problem, solver);
                let predicted = solver.solution().x(0).to_vec();
                let measured = if push == 0.0 { predicted.clone() } else { pushed(&problem, &predicted, push) };
                for most in [1, 3] {
                    let (mut whole, mut halves) = (solver.clone(), solver.clone());
                    problem.set_x0(&measured).unwrap();
                    let expected = whole.resume_to_full_step(&mut problem, most).unwrap();
                    for threads in [1, 3] {
                        let mut halves = halves.clone();
                        halves.settings.threads = threads;
                        halves.prepare(&mut problem).unwrap();
                        assert_eq!(problem.x0(), predicted);
                        let ours = halves.feedback(&mut problem, &measured, most).unwrap();
                        assert_same(ours, expected, &format!("robot {k}, tick {tick}, {threads} threads"));
                        assert!(
                            ours.is_executable() && ours.fallback.is_none(),
                            "robot {k}, tick {tick}: {:?} {}",
                            ours.fallback,
                            ours.cost
                        );
                        assert_eq!(problem.x0(), measured);
                    }
                    halves.prepare(&mut problem).unwrap();
                    solver = if most == 3 { whole } else { solver };
                }
            }
        }
    }
}

#[test]
fn a_tick_in_two_parts_equals_a_whole_one_where_the_prediction_holds() {
    for bounds in [Bounds::None, Bounds::Controls, Bounds::Limits] {
        for (k, mut problem) in problems(bounds).into_iter().enumerate() {
            let mut solver = InteriorPoint::new(&problem);
            solver.settings.tolerance = 1e-4;
            let xs = problem.x0().repeat(HORIZON + 1);
            let us = problem.quasi_static(&xs).unwrap();
            let start = pushed(&problem, problem.x0(), 0.2);
            problem.set_x0(&start).unwrap();
            assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap().status, Status::Converged);
            for (tick, sweeps) in [2, 1, 3, 2, 20].into_iter().enumerate() {
                shift!(problem, solver);
                let predicted = solver.solution().x(0).to_vec();
                let mut whole = solver.clone();
                problem.set_x0(&predicted).unwrap();
                let expected = whole.tick(&mut problem, sweeps).unwrap().clone();
                for threads in [1, 3] {
                    let mut parts = solver.clone();
                    parts.settings.threads = threads;
                    parts.prepare(&mut problem, sweeps).unwrap();
                    let ours = parts.feedback(&mut problem, &predicted).unwrap();
                    assert_same(ours, &expected, &format!("robot {k}, tick {tick}, {threads} threads"));
                    assert_eq!(parts.outcome(), whole.outcome());
                }
                solver = whole;
                // disturbances between the ticks
                let measured = pushed(&problem, &predicted, 0.1);
                shift!(problem, solver);
                problem.set_x0(&measured).unwrap();
                solver.tick(&mut problem, 2).unwrap();
            }
        }
    }
}

/// Checks ticks whose state is not the predicted one: their plans are about as good as the plans of whole ticks. A
/// large disturbance raises μ.
#[test]
fn a_tick_in_two_parts_is_as_good_as_a_whole_one_elsewhere() {
    for (k, mut problem) in problems(Bounds::Limits).into_iter().enumerate() {
        let mut solver = InteriorPoint::new(&problem);
        solver.settings.tolerance = 1e-4;
        let xs = problem.x0().repeat(HORIZON + 1);
        let us = problem.quasi_static(&xs).unwrap();
        solver.solve(&mut problem, &xs, &us).unwrap();
        shift!(problem, solver);
        let predicted = solver.solution().x(0).to_vec();
        let mut barriers = vec![];
        for push in [1e-3, 0.05, 0.3] {
            let measured = pushed(&problem, &predicted, push);
            let [mut whole, mut parts] = [solver.clone(), solver.clone()];
            problem.set_x0(&measured).unwrap();
            whole.tick(&mut problem, 2).unwrap();
            parts.prepare(&mut problem, 2).unwrap();
            let ours = parts.feedback(&mut problem, &measured).unwrap();
            assert_eq!(ours.x(0), measured);
            assert!(ours.is_executable());
            let size = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            let mut best = solver.clone();
            assert_eq!(best.resume(&mut problem).unwrap().status, Status::Converged);
            let error = |solver: &InteriorPoint| size(best.solution().u(0), solver.solution().u(0));
            let [before, of_whole, of_parts] = [&solver, &whole, &parts].map(error);
            assert!(
                of_parts <= (NEAR * before).max(NEAR_WHOLE * of_whole),
                "robot {k}, push {push}: {before}, {of_whole}, {of_parts}"
            );
            barriers.push(parts.outcome().barrier);
        }
        assert!(barriers[2] > 10.0 * barriers[0], "{barriers:?}");
    }
}

/// Largest error of the first controls of a tick in two parts, compared with the optimum, relative to the error before
/// the tick, or to the error of a whole tick. The linearisation of knot 0 is at another state, and after a large
/// disturbance there is one sweep instead of two.
const NEAR: f64 = 0.1;
const NEAR_WHOLE: f64 = 1.5;

#[test]
fn each_feedback_needs_its_own_preparation() {
    let mut problem = problems(Bounds::Limits).remove(0);
    let xs = problem.x0().repeat(HORIZON + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let rest = problem.x0().to_vec();
    let (mut fddp, mut interior) = (Fddp::new(&problem), InteriorPoint::new(&problem));
    assert_eq!(fddp.prepare(&mut problem), Err(Error::NothingToResume));
    assert_eq!(interior.prepare(&mut problem, 2), Err(Error::NothingToResume));
    assert_eq!(fddp.feedback(&mut problem, &rest, 1).unwrap_err(), Error::NothingPrepared);
    macro_rules! check {
        ($solver:ident, $prepare:expr, $feedback:expr) => {
            let (prepare, feedback) = ($prepare, $feedback);
            $solver.solve(&mut problem, &xs, &us).unwrap();
            assert_eq!(feedback(&mut $solver, &mut problem, &rest).unwrap_err(), Error::NothingPrepared);
            prepare(&mut $solver, &mut problem);
            // a state that is not finite keeps the preparation
            let broken = vec![f64::NAN; rest.len()];
            assert!(matches!(feedback(&mut $solver, &mut problem, &broken), Err(Error::NotFinite { .. })));
            assert!(feedback(&mut $solver, &mut problem, &rest).is_ok());
            assert_eq!(feedback(&mut $solver, &mut problem, &rest).unwrap_err(), Error::NothingPrepared);
            for stale in 0..3 {
                prepare(&mut $solver, &mut problem);
                match stale {
                    0 => {
                        shift!(problem, $solver);
                    }
                    1 => drop($solver.resume(&mut problem).unwrap().clone()),
                    _ => $solver.reset(&mut problem, &rest).unwrap(),
                }
                assert_eq!(feedback(&mut $solver, &mut problem, &rest).unwrap_err(), Error::NothingPrepared);
            }
        };
    }
    type State<'a> = &'a [f64];
    check!(
        fddp,
        |s: &mut Fddp, p: &mut Problem| s.prepare(p).unwrap(),
        |s: &mut Fddp, p: &mut Problem, x: State<'_>| { s.feedback(p, x, 1).cloned() }
    );
    check!(
        interior,
        |s: &mut InteriorPoint, p: &mut Problem| s.prepare(p, 2).unwrap(),
        |s: &mut InteriorPoint, p: &mut Problem, x: State<'_>| s.feedback(p, x).cloned()
    );
}

/// Checks budgets that are always too short: a feedback still makes one iteration, or one step.
#[test]
fn a_feedback_without_time_makes_one_iteration() {
    let mut problem = problems(Bounds::Limits).remove(1);
    let xs = problem.x0().repeat(HORIZON + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let (mut fddp, mut interior) = (Fddp::new(&problem), InteriorPoint::new(&problem));
    fddp.solve(&mut problem, &xs, &us).unwrap();
    interior.solve(&mut problem, &xs, &us).unwrap();
    let budget = Some(std::time::Duration::from_nanos(1));
    (fddp.settings.time_budget, interior.settings.time_budget) = (budget, budget);
    for push in [0.0, 0.05, 0.2] {
        let x = pushed(&problem, &xs[..problem.nx()], push);
        fddp.prepare(&mut problem).unwrap();
        assert_eq!(fddp.feedback(&mut problem, &x, 3).unwrap().trace.len(), 1);
        assert!(fddp.solution().timings.overrun > std::time::Duration::ZERO);
        interior.prepare(&mut problem, 2).unwrap();
        let plan = interior.feedback(&mut problem, &x).unwrap();
        assert!(plan.x(0) == x && plan.is_executable() && plan.fallback.is_none());
    }
}

/// Creates an unstable pendulum, whose derivatives can be broken, and an interior point that has solved it.
fn pendulum() -> (Unstable, Problem, InteriorPoint) {
    let plant = Unstable { nu: 1, delay: Arc::default(), broken: Arc::default() };
    let end = Unstable { nu: 0, ..plant.clone() };
    let mut problem =
        Problem::new(vec![0.8, 0.0], vec![Box::new(plant.clone())], vec![0; HORIZON], Box::new(end)).unwrap();
    let mut solver = InteriorPoint::new(&problem);
    solver.solve(&mut problem, &[0.8, 0.0].repeat(HORIZON + 1), &[0.0; HORIZON]).unwrap();
    (plant, problem, solver)
}

/// Checks that a tick whose sweep fails returns a rollout of the shifted plan with the old gains, and says so. The next
/// tick is normal.
#[test]
fn a_failed_sweep_falls_back_to_the_last_plan() {
    for divided in [false, true] {
        let (mut plant, mut problem, mut solver) = pendulum();
        shift!(problem, solver);
        let last = solver.solution().clone();
        let measured = [last.x(0)[0] + 0.05, last.x(0)[1]];
        plant.broken.store(1, Ordering::SeqCst);
        let tick = |solver: &mut InteriorPoint, problem: &mut Problem| match divided {
            true => {
                solver.prepare(problem, 2).unwrap();
                solver.feedback(problem, &measured).unwrap().clone()
            }
            false => {
                problem.set_x0(&measured).unwrap();
                solver.tick(problem, 2).unwrap().clone()
            }
        };
        let plan = tick(&mut solver, &mut problem);
        assert_eq!((plan.status, plan.fallback), (Status::RegularisationLimit, Some(Fallback::RolledOut)));
        assert!(plan.is_executable() && plan.K == last.K && plan.x(0) == measured && plan.gap == 0.0);
        for t in 0..HORIZON {
            let dx = [plan.x(t)[0] - last.x(t)[0], plan.x(t)[1] - last.x(t)[1]];
            let u = last.u(t)[0] + last.K[t][(0, 0)] * dx[0] + last.K[t][(0, 1)] * dx[1];
            let mut next = [0.0; 2];
            plant.calc(t, plan.x(t), plan.u(t), &mut next);
            assert!((u - plan.u(t)[0]).abs() < 1e-12 && next == plan.x(t + 1));
        }
        plant.broken.store(0, Ordering::SeqCst);
        let plan = tick(&mut solver, &mut problem);
        assert!(plan.fallback.is_none() && plan.is_executable() && plan.status != Status::RegularisationLimit);
    }
}

/// Checks that a solver can start anew from a state, whatever it did before, and then reaches the same solution as a
/// new solver.
#[test]
fn a_reset_forgets_the_trajectory() {
    for (k, mut problem) in [Bounds::None, Bounds::Limits].into_iter().flat_map(problems).enumerate() {
        let rest = problem.x0().to_vec();
        let away = pushed(&problem, &rest, 0.1);
        let xs = rest.repeat(HORIZON + 1);
        let us = problem.quasi_static(&xs).unwrap();
        let (mut fddp, mut interior) = (Fddp::new(&problem), InteriorPoint::new(&problem));
        // a trajectory without any meaning
        let wild: Vec<f64> = us.iter().map(|u| u + 30.0).collect();
        (fddp.settings.max_iterations, interior.settings.max_iterations) = (1, 1);
        fddp.solve(&mut problem, &xs, &wild).unwrap();
        interior.solve(&mut problem, &xs, &wild).unwrap();
        (fddp.settings.max_iterations, interior.settings.max_iterations) = (100, 300);
        problem.set_x0(&away).unwrap();
        let still = problem.quasi_static(&away.repeat(HORIZON + 1)).unwrap();
        macro_rules! check {
            ($solver:ident, $kind:ident) => {
                $solver.reset(&mut problem, &away).unwrap();
                let begun = $solver.solution();
                assert!(begun.xs == away.repeat(HORIZON + 1) && begun.us == still && begun.is_executable());
                assert!(begun.K.iter().all(|gains| gains.iter().all(|x| *x == 0.0)));
                let mut fresh = $kind::new(&problem);
                fresh.settings = $solver.settings.clone();
                let expected = fresh.solve(&mut problem, &away.repeat(HORIZON + 1), &still).unwrap();
                let found = $solver.resume(&mut problem).unwrap();
                assert_eq!(found.status, Status::Converged, "robot {k}");
                assert_same(found, expected, &format!("robot {k}"));
            };
        }
        if k < 3 {
            check!(fddp, Fddp);
        }
        check!(interior, InteriorPoint);
        let broken = vec![f64::NAN; rest.len()];
        assert!(fddp.reset(&mut problem, &broken).is_err() && interior.reset(&mut problem, &broken).is_err());
    }
}
