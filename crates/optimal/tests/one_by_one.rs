//! Many problems solved one by one on each thread: the results are the results of new solvers, to the bit.

use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Limit, Residual};
use condyle_optimal::{
    AugmentedLagrangian, Error, Fddp, InteriorPoint, ManyProblems, OneByOne, Problem, SingleSolver, Solution, Status,
};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Status, number of iterations, and the numbers of a solution as bits.
type Row = (Status, usize, Vec<u64>);

fn row(solution: &Solution) -> Row {
    let gains = solution.K.iter().flat_map(|gain| gain.iter()).chain(solution.k.iter().flat_map(|k| k.iter()));
    let numbers = [solution.cost, solution.gap].into_iter().chain(solution.xs.iter().chain(&solution.us).copied());
    (solution.status, solution.trace.len(), numbers.chain(gains.copied()).map(f64::to_bits).collect())
}

/// Arm with limited efforts. The limits of one arm are wider than the limits of the other.
fn arm(wide: bool) -> Problem {
    let model = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let quadratic = |name, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let rest = quadratic("rest", 1e-1, Residual::State { reference: x0.clone() });
    let effort = quadratic("effort", 1e-4, Residual::ControlGravity);
    let target = Vec3::new(0.35, 0.2, 0.6);
    let reach = quadratic("reach", 1e2, Residual::FrameTranslation { frame: "tool".into(), target });
    let most = if wide { 40.0 } else { 25.0 };
    let control = Residual::Control { reference: vec![0.0; 7] };
    let weak = Limit::new("weak", control, vec![-most; 7], vec![most; 7]);
    let knot = FreeDynamics::running(model.clone(), 0.02, vec![rest.clone(), effort]).unwrap();
    let knot = knot.with_limits(vec![weak]).unwrap();
    let end = FreeDynamics::terminal(model, vec![rest, reach]).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 12], Box::new(end)).unwrap()
}

/// Changes the initial state and the target of problem i. Problem 2 has an invalid state, problem 4 an initial state at
/// which the cost overflows, and problem 6 other limits and one more cost.
fn change(i: usize, problem: &mut Problem) -> Result<(), Error> {
    let wave = |k: usize| ((i * 17 + k * 5) as f64).sin();
    *problem = arm(i == 6);
    let mut x0: Vec<f64> = problem.x0().to_vec();
    x0.iter_mut().take(7).enumerate().for_each(|(k, x)| *x += 0.3 * wave(k));
    match i {
        2 => x0[3] = f64::NAN,
        4 => x0[9] = 1e200,
        _ => {}
    }
    problem.set_x0(&x0)?;
    let target = [0.35 + 0.1 * wave(7), 0.2 + 0.1 * wave(8), 0.6 + 0.1 * wave(9)];
    problem.set_references("reach", &target.repeat(13)).map(drop)
}

struct Changed {
    rows: Mutex<Vec<Option<Result<Row, Error>>>>,
    stops: bool,
}

impl Changed {
    fn new(count: usize) -> Self {
        Self { rows: Mutex::new(vec![None; count]), stops: false }
    }
}

impl ManyProblems for Changed {
    type Error = Error;

    fn start(&self, i: usize, problem: &mut Problem, xs: &mut [f64], _: &mut [f64]) -> Result<(), Error> {
        change(i, problem)?;
        xs[..problem.nx()].copy_from_slice(problem.x0());
        Ok(())
    }

    fn solved(&self, i: usize, _: &mut Problem, result: Result<&Solution, Error>) {
        self.rows.lock().unwrap()[i] = Some(result.map(row));
    }

    fn go_on(&self) -> ControlFlow<()> {
        if self.stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

const COUNT: usize = 9;

/// Checks that a solver of many problems finds the results of new solvers, on one thread and on three.
fn check<S: SingleSolver>(
    set: impl Fn(&mut S),
    new: impl Fn(&Problem) -> S,
    solve: impl Fn(&mut S, &mut Problem, [&[f64]; 2]) -> Result<Row, Error>,
) {
    let nominal = arm(false);
    let mut still = arm(false);
    let xs = nominal.x0().repeat(13);
    let us = still.quasi_static(&xs).unwrap();
    let mut wanted = Vec::new();
    for i in 0..COUNT {
        let mut problem = nominal.try_clone().unwrap();
        wanted.push(change(i, &mut problem).and_then(|()| {
            let mut start = xs.clone();
            start[..14].copy_from_slice(problem.x0());
            let mut solver = new(&problem);
            set(&mut solver);
            solve(&mut solver, &mut problem, [&start, &us])
        }));
    }
    assert!(matches!(wanted[2], Err(Error::NotFinite { name: "x0", .. })));
    assert_eq!(wanted[4].as_ref().unwrap().0, Status::NotFinite);
    assert!(wanted.iter().flatten().filter(|row| row.0 == Status::Converged).count() >= 6, "{wanted:?}");
    for threads in [1, 3] {
        let mut many = OneByOne::<S>::new(&nominal, threads).unwrap();
        set(&mut many.solver);
        for _ in 0..2 {
            let problems = Changed::new(COUNT);
            assert_eq!(many.solve(COUNT, &problems).unwrap(), COUNT);
            for (i, (found, wanted)) in problems.rows.into_inner().unwrap().iter().zip(&wanted).enumerate() {
                let found = found.as_ref().expect("each problem has a result");
                match (found, wanted) {
                    (Err(found), Err(wanted)) => assert_eq!(found.to_string(), wanted.to_string(), "problem {i}"),
                    _ => assert_eq!(found, wanted, "problem {i}, {threads} threads"),
                }
            }
        }
    }
}

#[test]
fn interior_points() {
    check(
        |solver: &mut InteriorPoint| solver.settings.max_iterations = 60,
        InteriorPoint::new,
        |solver, problem, [xs, us]| solver.solve(problem, xs, us).map(row),
    );
}

#[test]
fn augmented_lagrangians() {
    check(
        |solver: &mut AugmentedLagrangian| {
            solver.settings.tolerance = 1e-5;
            solver.inner.max_iterations = 60;
        },
        AugmentedLagrangian::new,
        |solver, problem, [xs, us]| solver.solve(problem, xs, us).map(row),
    );
}

#[test]
fn fddp_with_segments() {
    check(
        |solver: &mut Fddp| solver.settings.segments = 2,
        Fddp::new,
        |solver, problem, [xs, us]| solver.solve(problem, xs, us).map(row),
    );
}

#[test]
fn time_and_the_receiver_end_a_call() {
    let mut many = OneByOne::<InteriorPoint>::new(&arm(false), 1).unwrap();
    many.solver.settings.tolerance = 0.0;
    many.time_budget = Some(Duration::from_millis(5));
    let problems = Changed::new(2000);
    let count = many.solve(2000, &problems).unwrap();
    assert!(0 < count && count < 2000);
    assert!(problems.rows.into_inner().unwrap()[count..].iter().all(Option::is_none));

    (many.time_budget, many.solver.settings.time_budget) = (None, Some(Duration::ZERO));
    let problems = Changed::new(4);
    assert_eq!(many.solve(4, &problems).unwrap(), 4); // the solver's own budget applies to each problem
    let rows = problems.rows.into_inner().unwrap();
    assert_eq!(rows[3].as_ref().unwrap().as_ref().unwrap().0, Status::TimeLimit);

    many.solver.settings.time_budget = None;
    let problems = Changed { stops: true, ..Changed::new(2000) };
    assert!(many.solve(2000, &problems).unwrap() < 2000);
}

#[test]
fn wrong_arguments() {
    let mut many = OneByOne::<AugmentedLagrangian>::new(&arm(false), 1).unwrap();
    assert!(many.set_start(&[0.0; 3], &[0.0; 84]).is_err());
    many.solver.inner.step_lengths = 0;
    assert!(matches!(many.solve(1, &Changed::new(1)), Err(Error::Setting { .. })));
}
