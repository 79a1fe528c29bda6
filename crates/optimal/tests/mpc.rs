//! Model predictive control: moving horizons, solves with little time, and stored solutions.

#[path = "mpc/budgets.rs"]
mod budgets;
mod common;
#[path = "mpc/policies.rs"]
mod policies;
#[path = "mpc/prepared.rs"]
mod prepared;
#[cfg(feature = "serde")]
#[path = "mpc/records.rs"]
mod records;
#[path = "mpc/recovery.rs"]
mod recovery;
#[path = "mpc/retime.rs"]
mod retime;
#[path = "mpc/rollouts.rs"]
mod rollouts;
#[path = "mpc/trot.rs"]
mod trot;

use common::{HANGING, Linear, cartpole, random, random_knot, random_matrix, straight};
use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Limit, Residual};
use condyle_optimal::{ActionModel, Error, Fddp, Iteration, Problem, Settings, Solution, Status};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// Tolerance of solves of the same problem from different warm starts. The solves differ by the regularisation, 1e-9
/// for entries of size one. The difference grows along the horizon.
const SAME: f64 = 1e-5;

/// Creates a problem with three linear-quadratic models, which have 3, 0 and 2 controls. The horizon may begin with any
/// of them.
fn linear(knot_models: &[usize], x0: &[f64]) -> Problem {
    let mut random = random();
    let models = [3, 0, 2].map(|nu| {
        let mut knot = random_knot(&mut random, 4, nu);
        knot.A *= 0.5;
        Box::new(Linear(knot)) as Box<dyn ActionModel>
    });
    let end = Box::new(Linear(random_knot(&mut random, 4, 0)));
    Problem::new(x0.to_vec(), models.into(), knot_models.to_vec(), end).unwrap()
}

#[test]
fn a_shifted_horizon_is_solved_like_a_new_one() {
    let mut knot_models = vec![0, 1, 2, 2, 0, 1, 0, 0];
    let x0 = random_matrix(&mut random(), 4, 1).as_slice().to_vec();
    let mut problem = linear(&knot_models, &x0);
    let mut solver = Fddp::new(&problem);
    let us = vec![0.0; problem.control_range(8).end];
    solver.solve(&mut problem, &x0.repeat(9), &us).unwrap();
    for next in [2, 1, 0, 0, 2] {
        let before = solver.solution().clone();
        problem.shift(next).unwrap();
        solver.shift(&mut problem).unwrap();
        knot_models.rotate_left(1);
        knot_models[7] = next;
        assert_eq!(problem.knot_models(), knot_models);
        let moved = solver.solution();
        assert!((0..7).all(|t| moved.u(t) == before.u(t + 1) && moved.x(t) == before.x(t + 1)));
        assert!((0..7).all(|t| moved.K[t] == before.K[t + 1] && moved.k[t] == before.k[t + 1]));
        assert_eq!(moved.u(7).len(), [3, 0, 2][next]);

        let measured: Vec<f64> = moved.x(0).iter().map(|x| x + 0.1).collect();
        problem.set_x0(&measured).unwrap();
        let ours = solver.resume(&mut problem).unwrap().clone();
        let mut fresh = linear(&knot_models, &measured);
        let us = vec![0.0; fresh.control_range(8).end];
        let mut other = Fddp::new(&fresh);
        let expected = other.solve(&mut fresh, &measured.repeat(9), &us).unwrap();
        assert_eq!((ours.status, ours.us.len()), (Status::Converged, us.len()));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME);
        assert!(close(&ours.xs, &expected.xs) && close(&ours.us, &expected.us));
        assert!(ours.K.iter().zip(&expected.K).all(|(a, b)| close(a.as_slice(), b.as_slice())));
    }
}

/// Checks that a pole which is pushed stays up with one iteration per step. The test in `allocations.rs` shows that
/// such solves allocate nothing.
#[test]
fn a_closed_loop_stands_up_to_pushes() {
    let mut problem = cartpole(&[0.0, 0.2, 0.0, 0.0], 40, 1);
    let mut plant = common::cartpole_action();
    let mut solver = Fddp::new(&problem);
    solver.solve(&mut problem, &[0.0, 0.2, 0.0, 0.0].repeat(41), &[0.0; 40]).unwrap();
    (solver.settings.max_iterations, solver.settings.tolerance) = (1, 0.0);
    let mut x = problem.x0().to_vec();
    for step in 0..150 {
        let (solution, mut u) = (solver.solution(), [0.0]);
        let dx: Vec<f64> = x.iter().zip(solution.x(0)).map(|(x, plan)| x - plan).collect();
        u[0] = solution.u(0)[0] + solution.K[0].row(0).iter().zip(&dx).map(|(k, dx)| k * dx).sum::<f64>();
        let mut next = [0.0; 4];
        plant.calc(0, &x, &u, &mut next);
        next[3] += if step % 50 == 10 { 0.8 } else { 0.0 }; // a push on the pole
        x.copy_from_slice(&next);
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        problem.set_x0(&x).unwrap();
        let solution = solver.resume(&mut problem).unwrap();
        assert_eq!((solution.status, solution.trace.len()), (Status::MaxIterations, 1));
        assert!(x[1].abs() < 0.6, "step {step}: {x:?}");
    }
    assert!(x[1].abs() < 0.05 && x[3].abs() < 0.1, "{x:?}");
}

/// Checks that a solve which ends with the first full step makes the same iterations as any other solve, to the bit.
#[test]
fn a_solve_to_the_first_full_step_makes_the_iterations_of_every_solve() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 0;
    solver.solve(&mut problem, &straight(&HANGING, &[0.0; 4], 50), &[0.0; 50]).unwrap();
    let mut other = solver.clone();
    let mut made = 0;
    let solution = solver
        .resume_to_full_step_with(&mut problem, 40, |iteration: &Iteration| made = iteration.iteration + 1)
        .unwrap()
        .clone();
    assert_eq!((solution.status, solution.trace.len(), solution.gap), (Status::FullStep, made, 0.0));
    assert_eq!(solution.x(0), HANGING);
    let (last, short) = solution.trace.split_last().unwrap();
    assert!(last.step == 1.0 && last.accepted && !short.is_empty());
    assert!(short.iter().all(|iteration| iteration.step < 1.0 || !iteration.accepted));
    // fewer iterations than the full step needs
    let mut few = other.clone();
    let early = few.resume_to_full_step(&mut problem, short.len()).unwrap();
    assert_eq!((early.status, &early.trace[..]), (Status::MaxIterations, short));
    assert!(early.gap > 0.0);
    assert_eq!(few.resume_to_full_step(&mut problem, 0).unwrap().trace.len(), 1); // at least one iteration
    other.settings.max_iterations = made;
    let expected = other.resume(&mut problem).unwrap();
    assert_eq!((expected.status, &expected.trace), (Status::MaxIterations, &solution.trace));
    assert_eq!((&expected.xs, &expected.us, &expected.K), (&solution.xs, &solution.us, &solution.K));
}

#[test]
fn a_solve_without_time_returns_what_it_has() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    solver.settings.time_budget = Some(Duration::ZERO);
    let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    assert_eq!((solution.status, &solution.xs, solution.trace.len()), (Status::TimeLimit, &xs, 0));

    // the time in the observer counts too: the second iteration does not begin
    solver.settings.time_budget = Some(Duration::from_millis(200));
    let mut seen = 0;
    let pause = |_: &Iteration| {
        seen += 1;
        std::thread::sleep(Duration::from_millis(250));
    };
    let solution = solver.solve_with(&mut problem, &xs, &[0.0; 50], pause).unwrap().clone();
    assert_eq!((solution.status, seen, solution.trace.len()), (Status::TimeLimit, 1, 1));
    assert_eq!(solution.cost, solution.trace[0].cost);

    // without any time, no gains are computed; the old gains are shifted by one knot
    problem.shift(0).unwrap();
    solver.shift(&mut problem).unwrap();
    solver.settings.time_budget = Some(Duration::ZERO);
    let moved = solver.resume(&mut problem).unwrap();
    assert!(
        moved.status == Status::TimeLimit && moved.K[..49] == solution.K[1..] && moved.xs[..200] == solution.xs[4..]
    );

    // with enough time, the solve is the same as without a budget
    solver.settings.time_budget = Some(Duration::from_secs(100));
    let mut problem = cartpole(&HANGING, 50, 1);
    let limited = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap().clone();
    solver.settings.time_budget = None;
    let free = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    assert!(limited.status == Status::Converged && limited.trace == free.trace && limited.xs == free.xs);
}

#[test]
fn a_horizon_moves_by_one_knot_at_a_time() {
    let mut problem = linear(&[0, 1, 2, 0], &[0.0; 4]);
    let mut solver = Fddp::new(&problem);
    assert_eq!(problem.shift(3), Err(Error::UnknownModel { knot: 3, index: 3, models: 3 }));
    problem.shift(1).unwrap();
    let us = vec![0.0; problem.control_range(4).end];
    let error = solver.solve(&mut problem, &[0.0; 20], &us).unwrap_err();
    assert_eq!(error, Error::Dimension { knot: 0, name: "nu", expected: 3, found: 0 });
    problem.shift(1).unwrap();
    let error = solver.shift(&mut problem).unwrap_err();
    assert_eq!(error, Error::Dimension { knot: 0, name: "nu", expected: 0, found: 2 });
    assert!(solver.shift(&mut linear(&[0, 1, 2], &[0.0; 4])).is_err());
}

#[test]
fn a_solution_survives_a_file() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    let text = serde_json::to_string(solution).unwrap();
    let read: Solution = serde_json::from_str(&text).unwrap();
    // serde_json reads a decimal number with an error of at most one in the last bit
    let close =
        |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-14 * b.abs());
    assert!(close(&read.xs, &solution.xs) && close(&read.us, &solution.us) && close(read.x(50), solution.x(50)));
    assert!(read.K.iter().zip(&solution.K).all(|(a, b)| close(a.as_slice(), b.as_slice())));
    assert!(read.status == solution.status && read.trace.len() == solution.trace.len());
    assert!(text.contains("\"status\":\"converged\""));
    // files of earlier versions lack the fields `overrun` and `project_warm_start`
    let mut earlier: Value = serde_json::from_str(&text).unwrap();
    assert!(earlier["timings"].as_object_mut().unwrap().remove("overrun").is_some());
    assert_eq!(serde_json::from_value::<Solution>(earlier).unwrap().timings.overrun, Duration::ZERO);
    let settings: Settings = serde_json::from_value(json!({"max_iterations": 7})).unwrap();
    assert!(settings.project_warm_start && settings.max_iterations == 7);
}

/// Checks that a solution from a file is rejected if the lengths of its fields do not fit one horizon. Without this
/// check, later code would read out of range.
#[test]
fn a_solution_from_a_file_is_checked() {
    let mut problem = cartpole(&HANGING, 4, 1);
    let xs = straight(problem.x0(), problem.x0(), 4);
    let mut solver = Fddp::new(&problem);
    let solution = serde_json::to_value(solver.solve(&mut problem, &xs, &[0.0; 4]).unwrap()).unwrap();
    let refused = |at: &str, value: Value| {
        let mut changed = solution.clone();
        *changed.pointer_mut(at).unwrap() = value;
        serde_json::from_value::<Solution>(changed).unwrap_err().to_string()
    };
    assert_eq!(refused("/xs", json!([0.0])), "`xs`: expected length 20, found 1");
    assert_eq!(refused("/us", json!([])), "`us`: expected length 4, found 0");
    assert_eq!(refused("/K", json!([])), "`K`: expected length 4, found 0");
    assert_eq!(refused("/k", json!([])), "`k`: expected length 4, found 0");
    let gains = "knot 2: expected gains of 1 × 4, but K is 4 × 1, k has length 1";
    assert_eq!(refused("/K/2", json!([[0.0, 0.0, 0.0, 0.0], 4, 1])), gains);
    for (rows, columns) in [(1_u64 << 63, 2), (u64::MAX, u64::MAX), (1, 5)] {
        let found = format!("a matrix of {rows} × {columns} with 0 numbers, at most 4096 rows");
        assert_eq!(refused("/K/0", json!([[], rows, columns])), found);
    }
    let offsets = "a horizon of 0 offsets: expected at least two, the first 0";
    assert_eq!(refused("/shape/offsets", json!([])), offsets);
    assert_eq!(refused("/shape/offsets", json!([0, 1, 2, 1, 4])), "knot 2: its controls end at 1, and begin at 2");
    let huge = "knot 3: its controls end at 18446744073709551615, and begin at 3";
    assert_eq!(refused("/shape/offsets/4", json!(u64::MAX)), huge);
    assert_eq!(refused("/shape/nx", json!(u64::MAX)), "a state of 18446744073709551615 numbers: expected 1 to 4096");
    assert!(refused("/shape/ndx", json!(3)).starts_with("knot 0: expected gains of 1 × 3"));
}

/// Checks that costs and limits of single knots move with their knots, also in the copies of other threads. A new last
/// knot has the model's common costs and limits, until separate costs and limits are set for it.
#[test]
fn costs_and_limits_of_a_knot_move_with_it() {
    const HORIZON: usize = 9;
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let cost = |name: &str, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let common = || {
        let effort = Residual::Control { reference: vec![0.0; 7] };
        vec![cost("effort", 1e-3, effort), cost("rest", 1e-1, Residual::State { reference: x0.clone() })]
    };
    // separate costs of a knot; `time` is the index of the knot in the first horizon
    let own = |time: usize| {
        let target = Vec3::new(0.4, 0.01 * time as f64, 0.5);
        let follow = cost("follow", 10.0 + time as f64, Residual::FrameTranslation { frame: "tool".into(), target });
        [common(), vec![follow]].concat()
    };
    let limits = |time: usize| {
        let weak = 5.0 + time as f64;
        let effort = Residual::Control { reference: vec![0.0; 7] };
        if time % 3 == 1 { vec![Limit::new("weak", effort, vec![-weak; 7], vec![weak; 7])] } else { vec![] }
    };
    // most knots have separate costs and limits, the other knots have the common ones
    let problem = |start: usize| {
        let mut knot = FreeDynamics::running(arm.clone(), 0.05, common()).unwrap();
        for t in 0..HORIZON {
            if (start + t) % 4 != 2 {
                knot.set_costs(t, own(start + t)).unwrap();
            }
            knot.set_limits(t, limits(start + t)).unwrap();
        }
        let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
        Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end)).unwrap()
    };
    let mut moving = problem(0);
    let mut solver = Fddp::new(&moving);
    (solver.settings.max_iterations, solver.settings.threads) = (2, 3);
    let us = vec![0.3; 7 * HORIZON];
    solver.solve(&mut moving, &x0.repeat(HORIZON + 1), &us).unwrap();
    for start in 1..3 * HORIZON {
        moving.shift(0).unwrap();
        solver.shift(&mut moving).unwrap();
        let costs = |problem: &mut Problem| {
            let (mut next, mut costs) = (vec![0.0; HORIZON * 14], vec![0.0; HORIZON + 1]);
            problem.calc(&x0.repeat(HORIZON + 1), &us, &mut next, &mut costs);
            costs
        };
        // the last knot has the common costs and limits of its model
        let (mut plain, mut fresh) = (problem(start), problem(start));
        let last: &mut FreeDynamics = plain.model_mut(0).unwrap();
        last.set_costs(HORIZON - 1, common()).unwrap();
        last.set_limits(HORIZON - 1, vec![]).unwrap();
        assert_eq!(costs(&mut moving), costs(&mut plain), "{start}");
        let now = start + HORIZON - 1;
        let last: &mut FreeDynamics = moving.model_mut(0).unwrap();
        if now % 4 != 2 {
            last.set_costs(HORIZON - 1, own(now)).unwrap();
        }
        last.set_limits(HORIZON - 1, limits(now)).unwrap();
        assert_eq!(costs(&mut moving), costs(&mut fresh), "{start}");
        // a solve on several threads, whose copies have moved with the horizon, equals a solve on one thread
        let (xs, warm) = (solver.solution().xs.clone(), solver.solution().us.clone());
        let ours = solver.resume(&mut moving).unwrap();
        let mut other = Fddp::new(&fresh);
        other.settings.max_iterations = 2;
        assert_eq!(other.solve(&mut fresh, &xs, &warm).unwrap().xs, ours.xs, "{start}");
    }
}

/// Checks that copies for other threads are shifted, and not created again, if nothing else has changed.
#[test]
fn copies_move_along() {
    let (arm, x0) = (Arc::new(robots::arm7()), [vec![0.1; 7], vec![0.0; 7]].concat());
    let rest =
        |weight| vec![Cost::new("rest", weight, Residual::State { reference: x0.clone() }, Activation::Quadratic)];
    let solve = |threads: usize| {
        let mut knot = FreeDynamics::running(arm.clone(), 0.05, rest(1.0)).unwrap();
        (0..24).step_by(5).for_each(|t| knot.set_costs(t, rest(t as f64)).unwrap());
        let end = FreeDynamics::terminal(arm.clone(), rest(1.0)).unwrap();
        let mut problem = Problem::new(vec![0.2; 14], vec![Box::new(knot)], vec![0; 24], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        (solver.settings.max_iterations, solver.settings.threads) = (1, threads);
        solver.solve(&mut problem, &x0.repeat(25), &[0.0; 168]).unwrap();
        for _ in 0..7 {
            problem.shift(0).unwrap();
            solver.shift(&mut problem).unwrap();
            solver.resume(&mut problem).unwrap();
        }
        solver.solution().xs.clone()
    };
    assert_eq!(solve(3), solve(1));
}
