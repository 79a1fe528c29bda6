//! Horizons whose knots begin at any time: schedules, knots that change in place, and warm starts at other times.
#![allow(non_snake_case)] // names follow the literature: K

use super::trot::{FEET, stances};
use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{
    Activation, Actuation, ContactDynamics, ContactInverseDynamics, Cost, FreeAcceleration, FreeDynamics, FrictionCone,
    Integrated, Integrator, Limit, Residual,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, Error, Fddp, InteriorPoint, Problem, Schedule, Solution, Status, Unicycle,
};
use rand::RngExt;
use std::sync::Arc;

const SPACING: f64 = 0.02;
const HORIZON: usize = 20;

/// Returns the times at which knots begin, and the end of the horizon.
fn times(t: f64, durations: &[f64]) -> Vec<f64> {
    let mut times = vec![t];
    durations.iter().for_each(|dt| times.push(times[times.len() - 1] + dt));
    times
}

fn knots(schedule: &Schedule, t: f64, horizon: usize) -> (Vec<usize>, Vec<f64>) {
    let (mut models, mut durations) = (vec![0; horizon], vec![0.0; horizon]);
    schedule.write_knots(t, &mut models, &mut durations);
    (models, durations)
}

/// Checks random schedules: knots end at every switch, have the model of their time, and do not depend on the beginning
/// of the horizon, except for the first knot.
#[test]
fn knots_of_a_schedule_remain_when_the_horizon_moves() {
    let mut random = super::common::random();
    for _ in 0..50 {
        let mut schedule = Schedule::new(SPACING, 0).unwrap();
        let mut switches = vec![];
        let mut time = random.random_range(-0.1..0.1);
        for model in 1..6 {
            switches.push(time);
            schedule.switch(time, model).unwrap();
            time += random.random_range(0.005..0.2);
        }
        let start = random.random_range(-0.2..0.1);
        let mut before: Option<Vec<f64>> = None;
        for tick in 0..30 {
            let t = start + 0.0077 * f64::from(tick);
            if tick == 20 {
                schedule.forget(t);
            }
            let (models, durations) = knots(&schedule, t, HORIZON);
            let all = times(t, &durations);
            assert!(durations.iter().all(|dt| *dt > 0.0 && *dt < 1.76 * SPACING), "{durations:?}");
            assert!(durations[0] > 0.49 * SPACING || models[1] != models[0] || durations[1] < 0.9 * SPACING);
            for (model, pair) in models.iter().zip(all.windows(2)) {
                assert_eq!(*model, schedule.model(0.5 * (pair[0] + pair[1])));
            }
            let end = all[HORIZON];
            for switch in switches.iter().filter(|switch| **switch > t + 3e-4 && **switch < end) {
                assert!(all.iter().any(|time| (time - switch).abs() < 1e-9), "no knot begins at {switch}: {all:?}");
            }
            if let Some(before) = before.replace(all.clone()) {
                let kept = before[1..].iter().filter(|time| **time > t + 0.51 * SPACING && **time < end - 1e-9);
                assert!(kept.clone().count() > HORIZON - 4);
                for time in kept {
                    assert!(all.iter().any(|other| (other - time).abs() < 1e-9), "{time} is lost: {all:?}");
                }
            }
        }
    }
}

#[test]
fn a_schedule_refuses_wrong_numbers() {
    assert_eq!(Schedule::new(0.0, 0), Err(Error::TimeStep { dt: 0.0 }));
    let mut schedule = Schedule::new(SPACING, 3).unwrap();
    assert!(matches!(schedule.switch(f64::NAN, 1), Err(Error::NotFinite { name: "t", .. })));
    for (t, model) in [(0.1, 1), (0.2, 2), (0.15, 0)] {
        schedule.switch(t, model).unwrap();
    }
    assert_eq!(schedule.switches(), [(0.1, 1), (0.15, 0)]); // the switch at 0.2 s came after the last one
    assert_eq!([0.0, 0.1, 0.14, 0.3].map(|t| schedule.model(t)), [3, 1, 1, 0]);
}

/// Returns the times of a trot: a diagonal pair swings for 0.23 s, then all feet are on the ground for 0.045 s.
fn trot() -> Schedule {
    let mut schedule = Schedule::new(SPACING, 0).unwrap();
    for step in 0..8 {
        let begin = 0.1 + 0.275 * f64::from(step);
        schedule.switch(begin, 1 + step as usize % 2).unwrap();
        schedule.switch(begin + 0.23, 0).unwrap();
    }
    schedule
}

/// Creates the problem of a trot with friction cones as limits, at the time t of a schedule.
fn problem(schedule: &Schedule, t: f64) -> Problem {
    let (model, (x0, stances)) = (Arc::new(robots::quadruped()), stances());
    let mut reference = x0.clone();
    reference[19] = 0.3;
    let joints = [10.0, 2.0, 2.0].repeat(4);
    let position = [vec![0.0, 0.0, 2000.0, 400.0, 400.0, 100.0], joints].concat();
    let velocity = [vec![100.0, 100.0, 50.0, 3.0, 3.0, 10.0], vec![0.02; 12]].concat();
    let state = |scale: f64| {
        let weights = position.iter().chain(&velocity).map(|w| scale * w).collect();
        Cost::new("state", 1.0, Residual::State { reference: reference.clone() }, Activation::Weighted(weights))
    };
    let cone = FrictionCone { least: 5.0, ..FrictionCone::new(0.5) };
    let (lower, upper) = cone.bounds();
    let models = stances.iter().map(|contacts| {
        let effort = Cost::new("effort", 2e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic);
        let mut costs = vec![state(1.0), effort];
        for foot in FEET.iter().filter(|foot| contacts.iter().all(|contact| contact.name != **foot)) {
            let target = Vec3::new(0.0, 0.0, 0.05);
            let height = Residual::FrameTranslation { frame: (*foot).into(), target };
            costs.push(Cost::new(foot, 1.0, height, Activation::Weighted(vec![0.0, 0.0, 1e3])));
        }
        let limits = contacts.iter().map(|contact| {
            let residual = Residual::FrictionCone { contact: contact.name.as_str().into(), cone: cone.clone() };
            Limit::new(&contact.name, residual, lower.clone(), upper.clone())
        });
        let knot = ContactDynamics::running(model.clone(), contacts, SPACING, costs).unwrap();
        Box::new(knot.with_limits(limits.collect()).unwrap()) as Box<dyn ActionModel>
    });
    let models = models.collect();
    let end = FreeDynamics::terminal(model, vec![state(0.1)]).unwrap();
    let mut problem = Problem::new(x0, models, vec![0; HORIZON], Box::new(end)).unwrap();
    let (models, durations) = knots(schedule, t, HORIZON);
    problem.set_knots(&models, &durations).unwrap();
    problem
}

fn guess(problem: &mut Problem) -> [Vec<f64>; 2] {
    let xs = problem.x0().repeat(problem.horizon() + 1);
    let us = problem.quasi_static(&xs).unwrap();
    [xs, us]
}

/// Compares a problem whose knots have changed in place with a problem that was made with these knots.
#[test]
fn knots_that_change_in_place_are_those_of_a_new_problem() {
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.1; 7]].concat();
    let durations = [0.005, 0.02, 0.013, 0.04];
    for integrator in [Integrator::SemiImplicitEuler, Integrator::RungeKutta4] {
        let model = |k: usize, dt: f64| {
            let rest = Residual::State { reference: vec![0.1 * k as f64; 14] };
            let costs = vec![
                Cost::new("rest", 1.0, rest, Activation::Quadratic),
                Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
            ];
            let inner = FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), costs).unwrap();
            Box::new(Integrated::new(inner, integrator, dt).unwrap()) as Box<dyn ActionModel>
        };
        let end = || Box::new(FreeDynamics::terminal(arm.clone(), vec![]).unwrap());
        let mut changed = Problem::new(x0.clone(), vec![model(0, 0.02), model(1, 0.02)], vec![0; 4], end()).unwrap();
        changed.set_knots(&[1, 0, 0, 1], &durations).unwrap();
        let own = [1, 0, 0, 1].into_iter().zip(durations).map(|(k, dt)| model(k, dt)).collect();
        let mut made = Problem::new(x0.clone(), own, vec![0, 1, 2, 3], end()).unwrap();
        let [xs, us] = guess(&mut made);
        let mut solvers = [Fddp::new(&changed), Fddp::new(&made)];
        let a = solvers[0].solve(&mut changed, &xs, &us).unwrap().clone();
        let b = solvers[1].solve(&mut made, &xs, &us).unwrap();
        assert_eq!((&a.xs, &a.us, a.cost), (&b.xs, &b.us, b.cost));
        assert_eq!((&a.K, a.status), (&b.K, Status::Converged));
        // the duration of a knot goes back to its model's
        changed.set_knots(&[0; 4], &[0.02; 4]).unwrap();
        assert!((0..4).all(|t| changed.duration(t) == Some(0.02)));
    }
}

#[test]
fn wrong_knots_are_refused() {
    let schedule = trot();
    let mut problem = problem(&schedule, 0.0);
    let before = (problem.knot_models().to_vec(), problem.duration(0));
    let (models, durations) = (vec![0; HORIZON], vec![SPACING; HORIZON]);
    let mut solver = Fddp::new(&problem);
    let early = solver.retime(&mut problem, 0.0, &models, &durations);
    assert_eq!(early, Err(Error::NothingToResume));
    let [xs, us] = guess(&mut problem);
    solver.settings.max_iterations = 1;
    solver.solve(&mut problem, &xs, &us).unwrap();
    let solution = solver.solution().clone();
    let mut refused = |elapsed: f64, models: &[usize], durations: &[f64]| {
        solver.retime(&mut problem, elapsed, models, durations).unwrap_err()
    };
    assert_eq!(refused(-0.01, &models, &durations), Error::Elapsed { elapsed: -0.01 });
    assert!(matches!(refused(f64::NAN, &models, &durations), Error::Elapsed { .. }));
    let wrong = |k: usize, dt: f64| {
        let mut changed = durations.clone();
        changed[k] = dt;
        changed
    };
    assert_eq!(refused(0.0, &models, &wrong(3, 0.0)), Error::TimeStep { dt: 0.0 });
    assert!(matches!(refused(0.0, &models, &wrong(3, f64::NAN)), Error::TimeStep { .. }));
    assert!(matches!(refused(0.0, &models[1..], &durations), Error::Length { name: "knot_models", .. }));
    assert!(matches!(refused(0.0, &models, &durations[1..]), Error::Length { name: "durations", .. }));
    assert!(matches!(refused(0.0, &[7; HORIZON], &durations), Error::UnknownModel { knot: 0, index: 7, models: 3 }));
    assert_eq!(solver.solution(), &solution);
    assert_eq!((problem.knot_models().to_vec(), problem.duration(0)), before);
    let mut own = Problem::new(
        vec![0.0; 3],
        vec![Box::new(Unicycle::new(0.1, [1.0, 1.0]))],
        vec![0; 2],
        Box::new(Unicycle::new(0.1, [1.0, 1.0]).terminal()),
    )
    .unwrap();
    assert_eq!(own.set_knots(&[0; 2], &[0.1; 2]), Err(Error::NoDuration { knot: 0 }));
}

/// Checks that a retiming by one knot is a shift, for the iterates of all solvers.
#[test]
fn a_retiming_by_one_knot_is_a_shift() {
    macro_rules! check {
        ($($kind:ident)*) => {$({
            let steady = Schedule::new(SPACING, 0).unwrap();
            let mut problems = [problem(&steady, 0.0), problem(&steady, 0.0)];
            problems.iter_mut().for_each(|problem| problem.set_knots(&[0; HORIZON], &[SPACING; HORIZON]).unwrap());
            let mut solvers = problems.each_ref().map($kind::new);
            for (problem, solver) in problems.iter_mut().zip(&mut solvers) {
                let [xs, us] = guess(problem);
                solver.solve(problem, &xs, &us).unwrap();
            }
            for (tick, last) in [0, 1, 1, 0, 2].into_iter().enumerate() {
                let models = [&problems[0].knot_models()[1..], &[last]].concat();
                problems[0].shift(last).unwrap();
                solvers[0].shift(&mut problems[0]).unwrap();
                let [_, problem] = &mut problems;
                assert_eq!(solvers[1].retime(problem, SPACING, &models, &[SPACING; HORIZON]), Ok(1));
                let [a, b] = solvers.each_ref().map(|solver| solver.solution());
                let numbers = |s: &Solution| {
                    let gains = s.K.iter().flat_map(|K| K.iter().copied().collect::<Vec<_>>());
                    [s.xs.clone(), s.us.clone(), gains.collect()].concat()
                };
                let same = |(a, b): (f64, f64)| (a - b).abs() <= if tick == 0 { 0.0 } else { 1e-3 * (1.0 + b.abs()) };
                assert!(numbers(a).into_iter().zip(numbers(b)).all(same), "{} {tick}", stringify!($kind));
                if tick == 3 {
                    continue; // a tick without a solve
                }
                for (problem, solver) in problems.iter_mut().zip(&mut solvers) {
                    let x: Vec<f64> = solver.solution().x(0).to_vec();
                    problem.set_x0(&x).unwrap();
                    solver.resume(problem).unwrap();
                }
                let [a, b] = solvers.each_ref().map(|solver| solver.solution());
                // where models change, a shift forgets the multipliers of the last knot
                assert!((a.cost - b.cost).abs() < 1e-5 * b.cost, "{} {tick}: {} {}", stringify!($kind), a.cost, b.cost);
            }
        })*};
    }
    check!(Fddp InteriorPoint AugmentedLagrangian);
}

/// Returns the cost of a plan, and its largest gap after knot 1. The measured state replaces the first state.
fn cost(problem: &mut Problem, solution: &Solution) -> [f64; 2] {
    let (horizon, nx) = (problem.horizon(), problem.nx());
    let (mut next, mut costs) = (vec![0.0; horizon * nx], vec![0.0; horizon + 1]);
    problem.calc(&solution.xs, &solution.us, &mut next, &mut costs);
    let mut gap = vec![0.0; problem.ndx()];
    let mut largest: f64 = 0.0;
    for t in 1..horizon {
        problem.difference(solution.x(t + 1), &next[t * nx..][..nx], &mut gap);
        largest = gap.iter().fold(largest, |most, gap| most.max(gap.abs()));
    }
    [costs.iter().sum(), largest]
}

/// Checks that the plan at other times costs little more than the optimum, at several rates. The times of the contacts
/// are not multiples of the spacing.
#[test]
fn a_plan_at_other_times_costs_little_more_than_the_optimum() {
    let schedule = trot();
    for rate in [50.0, 100.0, 130.0, 200.0] {
        let mut problem = problem(&schedule, 0.0);
        let mut solver = InteriorPoint::new(&problem);
        let [xs, us] = guess(&mut problem);
        assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap().status, Status::Converged);
        let (mut begin, mut excess, mut gaps) = (0.0, 0.0_f64, 0.0_f64);
        for tick in 1..=(0.2 * rate) as usize {
            let now = tick as f64 / rate;
            let (models, durations) = knots(&schedule, now, HORIZON);
            solver.retime(&mut problem, now - begin, &models, &durations).unwrap();
            begin = now;
            let start = solver.solution().clone();
            problem.set_x0(start.x(0)).unwrap();
            let [warm, gap] = cost(&mut problem, &start);
            let best = solver.resume(&mut problem).unwrap();
            assert_eq!(best.status, Status::Converged);
            excess = excess.max(warm - best.cost);
            gaps = gaps.max(gap);
        }
        // the optimum costs 0.1 to 0.9; the excess is due to the knots after the end of the old plan, and was 0.085
        assert!(excess < 0.1 && gaps < 1e-6, "{rate} Hz: {excess}, {gaps}");
    }
}

/// Changes the times of contacts: a step that ends earlier or later, a step of the other feet, and no step. Checks the
/// plan after one and two ticks from the warm start, and that a warm start knot by knot costs far more.
#[test]
fn a_warm_start_survives_a_change_of_the_schedule() {
    let change = |k: usize| {
        let mut schedule = trot();
        match k {
            0 => schedule.switch(0.30, 0).unwrap(), // the first step ends 30 ms earlier
            1 => schedule.switch(0.36, 0).unwrap(), // 30 ms later
            2 => schedule.switch(0.1, 2).unwrap(),  // the other pair of feet
            _ => schedule.switch(0.1, 0).unwrap(),  // no step
        }
        match k {
            0 | 1 => schedule.switch(0.375, 2).unwrap(),
            2 => schedule.switch(0.33, 0).unwrap(),
            _ => {}
        }
        schedule
    };
    for k in 0..4 {
        let (old, new) = (trot(), change(k));
        let mut problem = problem(&old, 0.03);
        let mut solver = InteriorPoint::new(&problem);
        let [xs, us] = guess(&mut problem);
        assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap().status, Status::Converged);
        let plain = solver.solution().us.clone();
        let (models, durations) = knots(&new, 0.06, HORIZON);
        assert_eq!(solver.retime(&mut problem, 0.03, &models, &durations), Ok(1));
        let start = solver.solution().clone();
        problem.set_x0(start.x(0)).unwrap();
        let [warm, _] = cost(&mut problem, &start);
        let mut knot_by_knot = start;
        knot_by_knot.us = plain;
        let [unchanged, _] = cost(&mut problem, &knot_by_knot);
        let mut ticking = solver.clone();
        let ticks = [(); 2].map(|()| {
            ticking.tick(&mut problem, 2).unwrap();
            cost(&mut problem, ticking.solution())
        });
        let best = solver.resume(&mut problem).unwrap();
        assert_eq!(best.status, Status::Converged);
        let (iterations, best) = (best.trace.len(), best.cost);
        let [xs, us] = guess(&mut problem);
        let cold = solver.solve(&mut problem, &xs, &us).unwrap().trace.len();
        // measured after one tick: cost + 2 %, or 5.3 times the cost with the other feet, and gap 0.9; after two ticks:
        // cost + 0.06 %, gap 0.03
        let ([[first, first_gap], [second, second_gap]], most) = (ticks, if k == 2 { 7.0 } else { 1.05 });
        assert!(first < most * best && first_gap < 1.5, "change {k}: {ticks:?}, optimum {best}");
        assert!(second < 1.002 * best && second_gap < 0.1, "change {k}: {ticks:?}, optimum {best}");
        assert!(warm < 3.0 * best && unchanged > 100.0 * best, "change {k}: {warm}, {unchanged}, optimum {best}");
        assert!(iterations < cold, "change {k}: {iterations} iterations, {cold} without a warm start");
    }
}

/// Checks a horizon that begins after the end of the old one, as after a long stall.
#[test]
fn a_horizon_may_begin_after_the_old_one() {
    let schedule = trot();
    let mut problem = problem(&schedule, 0.0);
    let mut solver = InteriorPoint::new(&problem);
    let [xs, us] = guess(&mut problem);
    solver.solve(&mut problem, &xs, &us).unwrap();
    let last = solver.solution().x(HORIZON).to_vec();
    let (models, durations) = knots(&schedule, 1.0, HORIZON);
    assert_eq!(solver.retime(&mut problem, 1.0, &models, &durations), Ok(HORIZON - 1));
    assert_eq!(solver.solution().x(0), last);
    problem.set_x0(&xs[..problem.nx()]).unwrap();
    let plan = solver.resume(&mut problem).unwrap();
    assert_eq!(plan.status, Status::Converged);
}

/// Checks that references of single knots move with their knots, and that a knot with a new model has the common costs
/// of this model.
#[test]
fn references_move_with_their_knots() {
    let steady = Schedule::new(SPACING, 0).unwrap();
    let mut problem = problem(&steady, 0.0);
    let mut solver = Fddp::new(&problem);
    let [xs, us] = guess(&mut problem);
    solver.settings.max_iterations = 1;
    solver.solve(&mut problem, &xs, &us).unwrap();
    let common = problem.references("effort").unwrap().0[..12].to_vec();
    let rows: Vec<f64> = (0..=HORIZON).flat_map(|t| [t as f64; 12]).collect();
    problem.set_references("effort", &rows).unwrap();
    let mut models = [0; HORIZON];
    models[3] = 1;
    assert_eq!(solver.retime(&mut problem, 0.045, &models, &[SPACING; HORIZON]), Ok(2));
    let (rows, _) = problem.references("effort").unwrap();
    let row = |t: usize| rows[12 * t];
    assert_eq!([0, 1, 2, 4].map(row), [2.0, 3.0, 4.0, 6.0]);
    assert_eq!([3, HORIZON - 2, HORIZON - 1].map(row), [common[0]; 3]);
    models[3] = 0;
    assert_eq!(solver.retime(&mut problem, 0.0, &models, &[SPACING; HORIZON]), Ok(0));
    let (rows, _) = problem.references("effort").unwrap();
    assert_eq!(rows[36..48], common); // not the old reference
}

/// Checks horizons whose knots differ in their numbers of controls.
#[test]
fn knots_may_change_their_numbers_of_controls() {
    let (model, (x0, stances)) = (Arc::new(robots::quadruped()), stances());
    let models = stances.iter().map(|contacts| {
        let rest = Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic);
        let knot = ContactInverseDynamics::running(model.clone(), contacts, SPACING, vec![rest]).unwrap();
        Box::new(knot) as Box<dyn ActionModel>
    });
    let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
    let mut problem = Problem::new(x0.clone(), models.collect(), vec![0; 4], Box::new(end)).unwrap();
    let [xs, us] = guess(&mut problem);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 2;
    solver.solve(&mut problem, &xs, &us).unwrap();
    solver.retime(&mut problem, 0.01, &[0, 1, 1, 0], &[0.01, 0.02, 0.02, 0.02]).unwrap();
    let solution = solver.solution();
    let sizes = [0, 1, 2, 3].map(|t| (solution.u(t).len(), solution.K[t].nrows()));
    assert_eq!(sizes, [(30, 30), (24, 24), (24, 24), (30, 30)]);
    solver.resume(&mut problem).unwrap();
    assert!(solver.solution().cost.is_finite());
}

/// Compares predictions with the plan itself, with steps of half the duration, and with bounds on controls.
#[test]
fn a_prediction_follows_the_plan() {
    let schedule = trot();
    let mut problem = problem(&schedule, 0.0);
    let mut solver = InteriorPoint::new(&problem);
    let [xs, us] = guess(&mut problem);
    let plan = solver.solve(&mut problem, &xs, &us).unwrap().clone();
    let (nx, mut ahead) = (problem.nx(), vec![0.0; problem.nx()]);
    let mut gap = vec![0.0; problem.ndx()];
    let mut error = |problem: &mut Problem, from: usize, to: usize| {
        let starts = |t: usize| (0..t).map(|t| problem.duration(t).unwrap()).sum::<f64>();
        let (now, then) = (starts(from), starts(to));
        plan.predict(problem, plan.x(from), now, then, &mut ahead).unwrap();
        problem.difference(plan.x(to), &ahead, &mut gap);
        gap.iter().fold(0.0_f64, |most, gap| most.max(gap.abs()))
    };
    assert_eq!(error(&mut problem, 3, 3), 0.0);
    // in stance, the motion is slow, and steps of 2 ms follow the steps of 20 ms
    assert!(error(&mut problem, 0, 3) < 0.02);
    assert!(error(&mut problem, 3, 7) < 1.0); // feet leave the ground: rad/s
    let mut short = vec![0.0; nx];
    assert!(matches!(plan.predict(&mut problem, &xs[1..nx], 0.0, 0.1, &mut short), Err(Error::Length { .. })));
    let late = plan.predict(&mut problem, plan.x(0), 0.0, f64::NAN, &mut short);
    assert!(matches!(late, Err(Error::NotFinite { name: "time", .. })));
}

/// Checks that the copies of the actions for other threads change as well: the results are bit-identical.
#[test]
fn copies_for_threads_have_the_same_knots() {
    let schedule = trot();
    let [one, two] = [1, 2].map(|threads| {
        let mut problem = problem(&schedule, 0.0);
        let mut solver = Fddp::new(&problem);
        (solver.settings.threads, solver.settings.max_iterations) = (threads, 3);
        let [xs, us] = guess(&mut problem);
        solver.solve(&mut problem, &xs, &us).unwrap();
        for tick in 1..12 {
            let (models, durations) = knots(&schedule, 0.013 * f64::from(tick), HORIZON);
            solver.retime(&mut problem, 0.013, &models, &durations).unwrap();
            solver.resume(&mut problem).unwrap();
        }
        solver.solution().clone()
    });
    assert_eq!((one.xs, one.us, one.cost), (two.xs, two.us, two.cost));
}
