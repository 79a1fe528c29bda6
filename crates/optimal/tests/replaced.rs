//! Replacement of models and durations of single knots between solves. The results equal the results of a new problem,
//! and the next solve does not allocate.

mod common;
#[path = "../../../tests/common/counting.rs"]
mod counting;

use common::{Circle, Unicycle};
use condyle_dynamics::{ContactConstraint, Vec3, neutral, robots};
use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FreeDynamics, Limit, Residual};
use condyle_optimal::{ActionModel, AugmentedLagrangian, Error, Fddp, Problem, Solution};
use counting::allocations;
use std::sync::Arc;

const KNOTS: usize = 9;

fn x0() -> Vec<f64> {
    let mut q = neutral(&robots::quadruped());
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    [q, vec![0.0; 18]].concat()
}

/// Returns the model of knot t with contacts at the given `feet`. Its target differs from knot to knot.
fn model(t: usize, feet: &[&str], dt: f64) -> Box<dyn ActionModel> {
    let robot = Arc::clone(ROBOT.get_or_init(|| Arc::new(robots::quadruped())));
    let contact = |name: &&str| {
        let point = ContactConstraint::point(robot.frame(name).unwrap());
        Contact::new(name, ContactConstraint { kd: 20.0, ..point })
    };
    let contacts: Vec<_> = feet.iter().map(contact).collect();
    let target = Vec3::new(0.01 * t as f64, 0.0, 0.35);
    let costs = vec![
        Cost::new("state", 1e-1, Residual::State { reference: x0() }, Activation::Quadratic),
        Cost::new("com", 1e1, Residual::CenterOfMass { target }, Activation::Quadratic),
        Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic),
    ];
    let effort = Residual::Control { reference: vec![0.0; 12] };
    let limit = Limit::new("effort", effort, vec![-60.0; 12], vec![60.0; 12]);
    Box::new(ContactDynamics::running(robot.clone(), &contacts, dt, costs).unwrap().with_limits(vec![limit]).unwrap())
}

static ROBOT: std::sync::OnceLock<Arc<condyle_dynamics::Model>> = std::sync::OnceLock::new();
const ALL: [&str; 4] = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
const TWO: [&str; 2] = ["LF_foot", "RH_foot"];
const DT: f64 = 0.02;

/// Creates a problem with the model `of(t)` at each knot t.
fn problem(of: impl Fn(usize) -> Box<dyn ActionModel>) -> Problem {
    let robot = Arc::clone(ROBOT.get_or_init(|| Arc::new(robots::quadruped())));
    let end = FreeDynamics::terminal(robot, vec![]).unwrap();
    Problem::new(x0(), (0..KNOTS).map(of).collect(), (0..KNOTS).collect(), Box::new(end)).unwrap()
}

fn feet(t: usize) -> &'static [&'static str] {
    if t < 4 { &TWO } else { &ALL }
}

fn solver(problem: &Problem, threads: usize) -> Fddp {
    let mut solver = Fddp::new(problem);
    (solver.settings.max_iterations, solver.settings.threads) = (4, threads);
    solver
}

fn untimed(solution: &Solution) -> Solution {
    let mut solution = solution.clone();
    solution.timings = Default::default();
    solution
}

#[test]
fn a_replaced_knot_is_that_of_a_new_problem() {
    for threads in [1, 2] {
        let mut changed = problem(|t| model(t, feet(t), DT));
        let (xs, us) = (x0().repeat(KNOTS + 1), changed.quasi_static(&x0().repeat(KNOTS + 1)).unwrap());
        let mut solver_of_changed = solver(&changed, threads);
        solver_of_changed.solve(&mut changed, &xs, &us).unwrap();
        // knot 3 is replaced twice: it gets four feet on the ground and another target; knot 6 gets another target;
        // knot 7 gets another target and only two feet on the ground
        for (t, target, feet) in [(3, 20, &ALL[..]), (6, 9, &ALL), (3, 5, &ALL), (7, 1, &TWO)] {
            changed.set_knot(t, model(target, feet, DT)).unwrap();
        }
        assert!(changed.knot_models().iter().all(|&index| index < KNOTS + 3));
        let same = |t: usize| match t {
            3 => model(5, &ALL, DT),
            6 => model(9, &ALL, DT),
            7 => model(1, &TWO, DT),
            _ => model(t, feet(t), DT),
        };
        let mut fresh = problem(same);
        let expected = untimed(solver(&fresh, threads).solve(&mut fresh, &xs, &us).unwrap());
        assert!(untimed(solver_of_changed.solve(&mut changed, &xs, &us).unwrap()) == expected);
        let mut copy = changed.try_clone().unwrap();
        assert!(untimed(solver(&copy, threads).solve(&mut copy, &xs, &us).unwrap()) == expected);
        let found = AugmentedLagrangian::new(&changed).solve(&mut changed, &xs, &us).unwrap().xs.clone();
        assert!(found == AugmentedLagrangian::new(&fresh).solve(&mut fresh, &xs, &us).unwrap().xs);
    }
}

#[test]
fn a_duration_is_that_of_a_new_problem() {
    let mut changed = problem(|t| model(t, feet(t), DT));
    let (xs, us) = (x0().repeat(KNOTS + 1), changed.quasi_static(&x0().repeat(KNOTS + 1)).unwrap());
    for (t, dt) in [(2, 0.05), (5, 0.01), (2, 0.03)] {
        changed.set_duration(t, dt).unwrap();
    }
    let dt = |t: usize| [DT, DT, 0.03, DT, DT, 0.01, DT, DT, DT][t];
    let mut fresh = problem(|t| model(t, feet(t), dt(t)));
    let expected = untimed(solver(&fresh, 1).solve(&mut fresh, &xs, &us).unwrap());
    assert!(untimed(solver(&changed, 1).solve(&mut changed, &xs, &us).unwrap()) == expected);
    // if the horizon is shifted, durations move with their knots
    changed.shift(8).unwrap();
    let mut fresh = problem(|t| if t < 8 { model(t + 1, feet(t + 1), dt(t + 1)) } else { model(8, &ALL, DT) });
    let us = fresh.quasi_static(&xs).unwrap();
    let expected = untimed(solver(&fresh, 1).solve(&mut fresh, &xs, &us).unwrap());
    assert!(untimed(solver(&changed, 1).solve(&mut changed, &xs, &us).unwrap()) == expected);
}

#[test]
fn the_next_solve_allocates_nothing() {
    let mut problem = problem(|t| model(t, feet(t), DT));
    let (xs, us) = (x0().repeat(KNOTS + 1), problem.quasi_static(&x0().repeat(KNOTS + 1)).unwrap());
    let mut solver = solver(&problem, 1);
    solver.solve(&mut problem, &xs, &us).unwrap();
    for (t, feet) in [(3, &ALL[..]), (4, &TWO), (3, &TWO)] {
        problem.set_knot(t, model(t + 1, feet, DT)).unwrap();
        problem.set_duration(t, 0.01).unwrap();
        let count = allocations(|| {
            solver.solve(&mut problem, &xs, &us).unwrap();
        });
        assert_eq!(count, 0, "knot {t}");
    }
}

/// Checks that models can be added and dropped any number of times.
#[test]
fn memory_stays_bounded() {
    let mut problem = problem(|t| model(t, feet(t), DT));
    for t in (0..KNOTS).cycle().take(5 * KNOTS) {
        problem.set_knot(t, model(t, feet(t), DT)).unwrap();
        problem.shift(problem.knot_models()[0]).unwrap();
    }
    assert!(problem.knot_models().iter().all(|&index| index <= 3 * KNOTS), "{:?}", problem.knot_models());
}

#[test]
fn actions_of_users_are_replaced() {
    let (knot, end) = (Unicycle { nu: 2, lanes: 1 }, Unicycle { nu: 0, lanes: 1 });
    let mut problem = Problem::new(vec![0.1; 3], vec![Box::new(knot)], vec![0; 4], Box::new(end)).unwrap();
    for lanes in [1, 4, 2] {
        problem.set_knot(2, Box::new(Unicycle { nu: 2, lanes })).unwrap();
        assert_eq!(problem.knot_models(), [0, 0, 1, 0]);
        let (xs, us) = ([0.1; 15], [0.2; 8]);
        Fddp::new(&problem).solve(&mut problem, &xs, &us).unwrap();
    }
}

#[test]
fn models_that_do_not_fit_are_refused() {
    let mut problem = problem(|t| model(t, feet(t), DT));
    let dimension = |name, expected, found| Error::Dimension { knot: 1, name, expected, found };
    assert_eq!(problem.set_knot(1, Box::new(Circle { nu: 1 })), Err(dimension("nx", 37, 2)));
    let end = FreeDynamics::terminal(ROBOT.get().unwrap().clone(), vec![]).unwrap();
    assert_eq!(problem.set_knot(1, Box::new(end)), Err(dimension("nu", 12, 0)));
    assert_eq!(problem.set_duration(1, 0.0), Err(Error::TimeStep { dt: 0.0 }));
    let (knot, end) = (Unicycle { nu: 2, lanes: 1 }, Unicycle { nu: 0, lanes: 1 });
    let mut own = Problem::new(vec![0.1; 3], vec![Box::new(knot)], vec![0; 4], Box::new(end)).unwrap();
    assert_eq!(own.set_duration(1, 0.1), Err(Error::NoDuration { knot: 1 }));
}
