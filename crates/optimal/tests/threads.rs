//! Solves on several threads, which give the same result as on one thread, to the last bit.
#![allow(non_snake_case)]

mod common;

use common::{random, random_knot, random_matrix};
use condyle_dynamics::{ContactConstraint, Vec3, integrate, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, ImpulseDynamics, Integrator,
    Residual,
};
use condyle_optimal::{ActionModel, Error, Fddp, LqKnot, Lqr, NumDiff, Problem, Solution, Status, Unicycle};
use rand::RngExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

/// Creates a gait of a quadruped with every kind of knot: stance, an impact, an impact with finite differences, and
/// flight by Runge–Kutta and by Euler. The impact with finite differences cannot be copied. The lengths of the runs of
/// knots are not multiples of the number of lanes.
fn gait() -> (Problem, Vec<f64>, Vec<f64>) {
    gait_of(|impact| Box::new(NumDiff(impact)))
}

/// Creates the gait of [`gait`]. The function `impact_again` creates the impacts of the second kind.
fn gait_of(impact_again: fn(ImpulseDynamics) -> Box<dyn ActionModel>) -> (Problem, Vec<f64>, Vec<f64>) {
    let model = Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let foot = |name: &str| ContactConstraint::point(model.frame(name).unwrap());
    let contacts = ["LF_foot", "RH_foot"].map(|name| Contact::new(name, ContactConstraint { kd: 20.0, ..foot(name) }));
    let quadratic = |name: &str, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let standing = || {
        let com = Residual::CenterOfMass { target: Vec3::new(0.0, 0.0, 0.4) };
        vec![quadratic("state", 1e-1, Residual::State { reference: x0.clone() }), quadratic("com", 1e1, com)]
    };
    let driven = || {
        let effort = quadratic("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] });
        [standing(), vec![effort]].concat()
    };
    let mut stance = ContactDynamics::running(model.clone(), &contacts, 0.01, driven()).unwrap();
    let us = stance.quasi_static(&x0);
    let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, standing()).unwrap();
    let flight = FreeAcceleration::new(model.clone(), Actuation::joints(&model), driven()).unwrap();
    let flight = FreeDynamics::new(flight, Integrator::RungeKutta4, 0.01).unwrap();
    let flying = FreeDynamics::running(model.clone(), 0.01, driven()).unwrap();
    let end = FreeDynamics::terminal(model.clone(), standing()).unwrap();
    let models: Vec<Box<dyn ActionModel>> =
        vec![Box::new(stance), Box::new(impact.clone()), impact_again(impact), Box::new(flight), Box::new(flying)];
    let knot_models =
        [vec![2], vec![0; 19], vec![1], vec![3; 5], vec![4; 11], vec![2], vec![0; 9], vec![1, 1]].concat();
    let nus = knot_models.iter().map(|stage| if [1, 2].contains(stage) { 0 } else { 12 });
    let us = nus.flat_map(|nu| us[..nu].to_vec()).collect();
    let mut random = random();
    let mut state = || {
        let step: Vec<f64> = (0..18).map(|_| random.random_range(-0.1..0.1)).collect();
        let mut q = x0[..19].to_vec();
        integrate(&model, &x0[..19], &step, &mut q);
        [q, (0..18).map(|_| random.random_range(-0.1..0.1)).collect()].concat()
    };
    let xs = (0..=knot_models.len()).flat_map(|_| state()).collect();
    (Problem::new(x0.clone(), models, knot_models, Box::new(end)).unwrap(), xs, us)
}

fn solve(problem: &mut Problem, xs: &[f64], us: &[f64], threads: usize) -> Solution {
    let mut solver = Fddp::new(problem);
    solver.settings.max_iterations = 4;
    solver.settings.threads = threads;
    let mut solution = solver.solve(problem, xs, us).unwrap().clone();
    solution.timings = Default::default();
    solution
}

#[test]
fn any_number_of_threads_finds_the_same_bits() {
    let (mut problem, xs, us) = gait();
    let expected = solve(&mut problem, &xs, &us, 1);
    assert!(expected.trace.iter().any(|iteration| iteration.accepted), "{:?}", expected.trace);
    for threads in [2, 3, 4, 7, 100] {
        for pool in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(pool).build().unwrap();
            assert!(pool.install(|| solve(&mut problem, &xs, &us, threads)) == expected, "{threads} threads");
        }
    }
    assert!(solve(&mut problem, &xs, &us, 1) == expected);
}

/// Checks the concurrent trial of two step lengths. After a step shorter than 1, copies of the models evaluate the next
/// step length concurrently with the first. All models can be copied here. The first length is accepted in one case,
/// and rejected in the other.
#[test]
fn trials_beside_each_other_find_the_same_bits() {
    let (mut problem, xs, us) = gait_of(|impact| Box::new(impact));
    let mut solve = |threads: usize| {
        let mut solver = Fddp::new(&problem);
        (solver.settings.max_iterations, solver.settings.threads) = (10, threads);
        let mut solution = solver.solve(&mut problem, &xs, &us).unwrap().clone();
        solution.timings = Default::default();
        solution
    };
    let expected = solve(1);
    let after_short: Vec<_> = expected.trace.windows(2).filter(|pair| pair[0].step < 1.0).map(|pair| pair[1]).collect();
    assert!(after_short.iter().any(|next| next.step == 1.0) && after_short.iter().any(|next| next.step < 1.0));
    for (threads, size) in [(2, 1), (2, 2), (3, 3), (7, 2)] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(size).build().unwrap();
        assert!(pool.install(|| solve(threads)) == expected, "{threads} threads");
    }
    assert!(solve(2) == expected, "the global pool");
}

/// Checks that a solver can switch to another problem of the same dimensions, even from a problem without a robot to a
/// problem with knots in inverse-dynamics form.
#[test]
fn a_solver_turns_to_another_problem() {
    let (arm, x0) = (Arc::new(robots::arm7()), [0.1; 14]);
    let quadratic = |name: &str, residual| Cost::new(name, 1.0, residual, Activation::Quadratic);
    let state = || quadratic("state", Residual::State { reference: vec![0.0; 14] });
    let costs = vec![state(), quadratic("effort", Residual::Control { reference: vec![0.0; 7] })];
    let knot = FreeDynamics::running(arm.clone(), 0.01, costs).unwrap();
    let end = FreeDynamics::terminal(arm, vec![state()]).unwrap();
    let mut robot = Problem::new(x0.to_vec(), vec![Box::new(knot)], vec![0; 9], Box::new(end)).unwrap();
    let mut random = random();
    let [knot, end] = [7, 0].map(|nu| Box::new(Lqr::new(random_knot(&mut random, 14, nu))));
    let other = Problem::new(x0.to_vec(), vec![knot], vec![0; 9], end).unwrap();
    let mut solve = |made_for: Option<&Problem>, threads: usize| {
        let mut solver = Fddp::new(made_for.unwrap_or(&robot));
        solver.settings.threads = threads;
        let mut solution = solver.solve(&mut robot, &x0.repeat(10), &[0.0; 63]).unwrap().clone();
        solution.timings = Default::default();
        solution
    };
    let expected = solve(None, 1);
    assert_eq!(expected.status, Status::Converged);
    assert!(solve(Some(&other), 1) == expected && solve(Some(&other), 2) == expected);
}

/// Checks that a changed model is copied again.
#[test]
fn copies_follow_their_models() {
    let (mut problem, xs, us) = gait();
    let before = solve(&mut problem, &xs, &us, 3);
    let change = |problem: &mut Problem| {
        assert!(problem.model_mut::<ContactDynamics>(0).unwrap().set_weight("com", 50.0).unwrap());
        assert!(problem.model_mut::<ImpulseDynamics>(1).unwrap().set_weight("state", 0.3).unwrap());
        assert!(problem.terminal_mut::<FreeDynamics>().unwrap().set_weight("com", 5.0).unwrap());
    };
    change(&mut problem);
    let after = solve(&mut problem, &xs, &us, 3);
    let (mut fresh, ..) = gait();
    change(&mut fresh);
    assert!(after == solve(&mut fresh, &xs, &us, 1));
    assert!(after.cost != before.cost);
}

/// Checks a moving horizon whose models have different numbers of controls.
#[test]
fn a_horizon_may_move() {
    let mut random = random();
    let models = [3, 1, 2].map(|nu| random_knot(&mut random, 4, nu));
    let end = random_knot(&mut random, 4, 0);
    let build = || {
        let models = models.iter().map(|knot| Box::new(Lqr::new(knot.clone())) as Box<dyn ActionModel>).collect();
        Problem::new(vec![0.5; 4], models, vec![0, 0, 1, 2, 2, 2], Box::new(Lqr::new(end.clone()))).unwrap()
    };
    let (mut one, mut several) = (build(), build());
    for last in [1, 0, 2, 2] {
        let us = random_matrix(&mut random, one.control_range(6).end, 1);
        let xs = random_matrix(&mut random, 4 * 7, 1);
        let expected = solve(&mut one, xs.as_slice(), us.as_slice(), 1);
        assert!(solve(&mut several, xs.as_slice(), us.as_slice(), 4) == expected);
        one.shift(last).unwrap();
        several.shift(last).unwrap();
    }
}

/// Checks that a failed first sweep is repeated with a larger regularisation.
#[test]
fn a_sweep_that_fails_is_repeated() {
    let mut random = random();
    let mut knot = random_knot(&mut random, 4, 2);
    knot.R.fill_diagonal(-1.0);
    let end = random_knot(&mut random, 4, 0);
    let (xs, us) = (random_matrix(&mut random, 4 * 21, 1), random_matrix(&mut random, 2 * 20, 1));
    let solve = |threads: usize| {
        let model = Box::new(Lqr::new(knot.clone()));
        let mut problem =
            Problem::new(vec![0.5; 4], vec![model], vec![0; 20], Box::new(Lqr::new(end.clone()))).unwrap();
        let mut solver = Fddp::new(&problem);
        (solver.settings.max_iterations, solver.settings.threads) = (3, threads);
        let mut solution = solver.solve(&mut problem, xs.as_slice(), us.as_slice()).unwrap().clone();
        solution.timings = Default::default();
        solution
    };
    let expected = solve(1);
    assert!(expected.trace[0].regularisation > 1e-3, "{:?}", expected.trace);
    assert!(solve(2) == expected && solve(4) == expected);
}

/// Checks a solve without time for any phase, on any number of threads. It ends after the first iteration, which always
/// runs.
#[test]
fn a_budget_holds_on_several_threads() {
    let (mut problem, xs, us) = gait();
    let mut solver = Fddp::new(&problem);
    (solver.settings.threads, solver.settings.max_iterations) = (3, 2);
    let free = solver.solve(&mut problem, &xs, &us).unwrap().clone(); // phases have durations after this solve
    solver.settings.time_budget = Some(Duration::from_nanos(1));
    let solution = solver.solve(&mut problem, &xs, &us).unwrap();
    assert!(solution.status == Status::TimeLimit && solution.trace == free.trace[..1]);
    assert!(solution.timings.overrun > Duration::ZERO);
}

/// Unicycle whose derivatives panic at one knot, on any thread that computes them.
struct Fragile(Unicycle, usize);

impl ActionModel for Fragile {
    fn nx(&self) -> usize {
        self.0.nx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.0.calc(t, x, u, next)
    }
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        assert_ne!(t, self.1, "on purpose");
        self.0.calc_diff(t, x, u, knot);
    }
    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(Self(self.0.clone(), self.1)))
    }
}

/// Checks that a panic on one thread ends the solve, and that no thread waits for ever.
#[test]
fn a_panic_reaches_the_caller() {
    for fragile in [0, 17, 39] {
        let model = Box::new(Fragile(Unicycle::default(), fragile));
        let end = Box::new(Unicycle::default().terminal());
        let mut problem = Problem::new(vec![1.0, 0.0, 0.0], vec![model], vec![0; 40], end).unwrap();
        let mut solver = Fddp::new(&problem);
        solver.settings.threads = 4;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let (xs, us) = ([1.0, 0.0, 0.0].repeat(41), vec![0.0; 80]);
        let solve = || drop(pool.install(|| solver.solve(&mut problem, &xs, &us).map(|_| ())));
        let message = catch_unwind(AssertUnwindSafe(solve)).unwrap_err();
        assert!(message.downcast::<String>().unwrap().contains("on purpose"));
    }
}

#[test]
fn no_thread_at_all_is_refused() {
    let (mut problem, xs, us) = gait();
    let mut solver = Fddp::new(&problem);
    solver.settings.threads = 0;
    let expected = Error::Setting { name: "threads", value: 0.0, allowed: "at least 1 and at most 1024" };
    assert_eq!(solver.solve(&mut problem, &xs, &us).unwrap_err(), expected);
}
