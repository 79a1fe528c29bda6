//! Many problems solved together in lanes: the results equal single solves, whichever problems share the lanes.
#![allow(non_snake_case)] // names follow the literature: K

use condyle_dynamics::{ContactConstraint, Data, Model, Se3, Target, Vec3, forward_kinematics, lie, neutral, robots};
use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FreeDynamics, ImpulseDynamics, Residual};
use condyle_optimal::{BatchFddp, Error, Fddp, ManyProblems, Problem, Settings, Solution, Status, Unicycle};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Result of one problem.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    status: Status,
    iterations: usize,
    cost: f64,
    xs: Vec<f64>,
    us: Vec<f64>,
    gains: Vec<f64>,
}

impl Row {
    fn of(solution: &Solution) -> Self {
        Self {
            status: solution.status,
            iterations: solution.trace.len(),
            cost: solution.cost,
            xs: solution.xs.clone(),
            us: solution.us.clone(),
            gains: solution.K.iter().flat_map(|K| K.iter().copied()).collect(),
        }
    }

    /// Returns the largest difference of the numbers, relative to 1 + their size.
    fn distance(&self, other: &Self) -> f64 {
        let all = |row: &Self| [&row.xs[..], &row.us, &row.gains].concat();
        let far = |(a, b): (&f64, &f64)| (a - b).abs() / (1.0 + a.abs());
        all(self).iter().zip(&all(other)).map(far).fold(0.0, f64::max)
    }
}

/// Problems that `change` makes from a nominal problem, and their results in the order of `indices`.
struct Changed<'a> {
    indices: &'a [usize],
    change: &'a (dyn Fn(usize, &mut Problem) -> Result<(), Error> + Sync),
    rows: Mutex<Vec<Option<Result<Row, Error>>>>,
    asked: AtomicUsize,
    stops: bool,
}

impl ManyProblems for Changed<'_> {
    type Error = Error;

    fn start(&self, i: usize, problem: &mut Problem, xs: &mut [f64], _: &mut [f64]) -> Result<(), Error> {
        (self.change)(self.indices[i], problem)?;
        xs[..problem.nx()].copy_from_slice(problem.x0());
        Ok(())
    }

    fn solved(&self, i: usize, _: &mut Problem, result: Result<&Solution, Error>) {
        self.rows.lock().unwrap()[i] = Some(result.map(Row::of));
    }

    fn go_on(&self) -> ControlFlow<()> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        if self.stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

type Change = dyn Fn(usize, &mut Problem) -> Result<(), Error> + Sync;

fn changed<'a>(indices: &'a [usize], change: &'a Change) -> Changed<'a> {
    let rows = Mutex::new(vec![None; indices.len()]);
    Changed { indices, change, rows, asked: AtomicUsize::new(0), stops: false }
}

fn together(solver: &mut BatchFddp, indices: &[usize], change: &Change) -> Vec<Result<Row, Error>> {
    let problems = changed(indices, change);
    assert_eq!(solver.solve(indices.len(), &problems).unwrap(), indices.len());
    problems.rows.into_inner().unwrap().into_iter().map(|row| row.expect("each problem has a result")).collect()
}

/// Checks that problems 0 … 20 have the results of single solves within `tolerance`, and that the results do not depend
/// on the order of the problems or on the threads.
fn check(mut problem: Problem, settings: Settings, change: &Change, tolerance: f64) {
    let indices: Vec<usize> = (0..21).collect();
    let xs = problem.x0().repeat(problem.horizon() + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let mut solver = BatchFddp::new(&problem, 1).unwrap();
    solver.settings = settings.clone();
    let rows = together(&mut solver, &indices, change);
    let backwards: Vec<usize> = indices.iter().rev().copied().collect();
    let mut again = together(&mut solver, &backwards, change);
    again.reverse();
    assert_eq!(rows, again);
    let mut solver = BatchFddp::new(&problem, 2).unwrap();
    solver.settings = settings.clone();
    assert_eq!(rows, together(&mut solver, &indices, change));
    assert_eq!(rows[..1], together(&mut solver, &[0], change));

    let mut alone = Fddp::new(&problem);
    alone.settings = settings;
    let mut lengths = Vec::new();
    for (&i, row) in indices.iter().zip(&rows) {
        change(i, &mut problem).unwrap();
        let mut start = xs.clone();
        start[..problem.nx()].copy_from_slice(problem.x0());
        let single = Row::of(alone.solve(&mut problem, &start, &us).unwrap());
        lengths.extend(alone.solution().trace.iter().map(|iteration| iteration.step));
        let row = row.as_ref().unwrap();
        assert_eq!((row.status, row.iterations), (single.status, single.iterations), "problem {i}");
        assert!(row.distance(&single) <= tolerance, "problem {i}: {:e}", row.distance(&single));
    }
    assert!(lengths.iter().any(|step| *step < 1.0), "no search needs more than one step length");
}

fn quadratic(name: &str, weight: f64, residual: Residual) -> Cost {
    Cost::new(name, weight, residual, Activation::Quadratic)
}

fn arm(bounded: bool) -> Problem {
    arm_with(Vec::new(), bounded)
}

/// Returns the problem of an arm with additional costs.
fn arm_with(others: Vec<Cost>, bounded: bool) -> Problem {
    let model = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let rest = quadratic("rest", 1e-1, Residual::State { reference: x0.clone() });
    let effort = quadratic("effort", 1e-4, Residual::ControlGravity);
    let target = Vec3::new(0.35, 0.2, 0.6);
    let reach = quadratic("reach", 1e2, Residual::FrameTranslation { frame: "tool".into(), target });
    let mut knot = FreeDynamics::running(model.clone(), 0.02, [vec![rest.clone(), effort], others].concat()).unwrap();
    if bounded {
        knot = knot.with_bounds(vec![-12.0; 7], vec![12.0; 7]);
    }
    let end = FreeDynamics::terminal(model, vec![rest, reach]).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 20], Box::new(end)).unwrap()
}

/// Moves the initial state, the target, a weight and a duration of problem i.
fn vary_arm(i: usize, problem: &mut Problem) -> Result<(), Error> {
    let wave = |k: usize| ((i * 17 + k * 5) as f64).sin();
    let mut x0: Vec<f64> = vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    x0.iter_mut().take(7).enumerate().for_each(|(k, x)| *x += 0.4 * wave(k));
    problem.set_x0(&x0)?;
    let target = [0.35 + 0.2 * wave(7), 0.2 + 0.2 * wave(8), 0.6 + 0.1 * wave(9)];
    problem.set_references("reach", &target.repeat(21))?;
    problem.set_weights("rest", &[0.1 + 0.05 * wave(10); 21])?;
    problem.set_duration(3, 0.02 + 0.005 * wave(11))
}

fn bent(model: &Model) -> Vec<f64> {
    let mut q = neutral(model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4));
    [q, vec![0.0; 18]].concat()
}

/// Six knots on two feet, an impact, and six knots on four feet. If the gain `kp` of the contacts' positions is not 0,
/// the orientation of one foot is also held.
fn gait(kp: f64) -> Problem {
    let model = Arc::new(robots::quadruped());
    let x0 = bent(&model);
    let foot = |name: &str| {
        let frame = model.frame(name).unwrap();
        let rigid = kp > 0.0 && name == "LF_foot";
        let constraint = if rigid { ContactConstraint::rigid(frame) } else { ContactConstraint::point(frame) };
        let target = Target { placement: placement(&model, name), ..Target::identity() };
        ContactConstraint { kp, kd: 20.0, target, ..constraint }
    };
    let contacts = |names: &[&str]| names.iter().map(|name| Contact::new(name, foot(name))).collect::<Vec<_>>();
    let costs = || {
        vec![
            quadratic("state", 1e-1, Residual::State { reference: x0.clone() }),
            quadratic("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }),
            quadratic("com", 1e1, Residual::CenterOfMass { target: Vec3::new(0.05, 0.0, 0.35) }),
        ]
    };
    let four = contacts(&["LF_foot", "RF_foot", "LH_foot", "RH_foot"]);
    let two = ContactDynamics::running(model.clone(), &contacts(&["LF_foot", "RH_foot"]), 0.02, costs()).unwrap();
    let impact = ImpulseDynamics::instant(model.clone(), &four, 0.0, 1e-9, vec![costs().swap_remove(0)]).unwrap();
    let stance = ContactDynamics::running(model.clone(), &four, 0.02, costs()).unwrap();
    let end = FreeDynamics::terminal(model, vec![costs().swap_remove(0), costs().swap_remove(2)]).unwrap();
    let knots = [vec![0; 6], vec![1], vec![2; 6]].concat();
    Problem::new(x0, vec![Box::new(two), Box::new(impact), Box::new(stance)], knots, Box::new(end)).unwrap()
}

/// Returns the placement of a foot in the first state of the gait.
fn placement(model: &Model, name: &str) -> Se3<f64> {
    forward_kinematics(model, &mut Data::new(model), &bent(model)[..19]).frame(model.frame(name).unwrap())
}

/// Changes a problem as `vary_gait` does, and the targets of two contacts.
fn aim_gait(i: usize, problem: &mut Problem) -> Result<(), Error> {
    vary_gait(i, problem)?;
    let wave = |k: usize| ((i * 11 + k * 3) as f64).sin();
    let model = robots::quadruped();
    let turn = Se3::new(lie::exp3(Vec3::new(0.1 * wave(1), 0.1 * wave(2), 0.1 * wave(3))).to_rotation(), Vec3::zero());
    let first = problem.change_contacts("LF_foot", |contact| {
        contact.target.placement = placement(&model, "LF_foot") * turn;
        contact.target.velocity.linear.x = 0.1 * wave(4);
        contact.target.velocity.angular.y = 0.1 * wave(5);
        contact.target.acceleration.linear.z = wave(6);
    })?;
    let second = problem.change_contacts("RH_foot", |contact| {
        contact.target.placement.translation.x = placement(&model, "RH_foot").translation.x + 0.02 * wave(7);
    })?;
    assert!(first && second);
    Ok(())
}

fn vary_gait(i: usize, problem: &mut Problem) -> Result<(), Error> {
    let wave = |k: usize| ((i * 13 + k * 7) as f64).sin();
    let mut x0 = bent(&robots::quadruped());
    (7..19).for_each(|k| x0[k] += 0.1 * wave(k));
    (19..37).for_each(|k| x0[k] = 0.3 * wave(k));
    problem.set_x0(&x0)?;
    problem.set_references("com", &[0.05 + 0.05 * wave(40), 0.02 * wave(41), 0.33].repeat(14)).map(drop)
}

#[test]
fn an_arm() {
    check(arm(false), Settings::default(), &vary_arm, 1e-12);
}

#[test]
fn an_arm_whose_problems_have_other_numbers_of_residual_rows() {
    let excess = Activation::Barrier { lower: vec![-2.0; 7], upper: vec![2.0; 7] };
    let problem = arm_with(vec![Cost::new("excess", 1e-2, Residual::ControlGravity, excess)], false);
    check(problem, Settings::default(), &vary_arm, 1e-11); // the bounds of the barrier amplify rounding
}

#[test]
fn a_sweep_that_diverges_fails_alone() {
    let wild = |i: usize, problem: &mut Problem| {
        vary_arm(i, problem)?;
        let speed = if i == 5 { 1e12 } else { 0.0 };
        let x0 = [&problem.x0()[..7], &[speed; 7]].concat();
        problem.set_x0(&x0)
    };
    let mut nominal = arm(false);
    let mut solver = BatchFddp::new(&nominal, 1).unwrap();
    let rows = together(&mut solver, &[3, 4, 5, 6], &wild);
    assert_eq!(rows[..2], together(&mut solver, &[3, 4], &wild));
    assert_eq!(rows[3..], together(&mut solver, &[6], &wild));
    let mut xs = nominal.x0().repeat(21);
    let us = nominal.quasi_static(&xs).unwrap();
    wild(5, &mut nominal).unwrap();
    xs[..14].copy_from_slice(nominal.x0());
    let single = Row::of(Fddp::new(&nominal).solve(&mut nominal, &xs, &us).unwrap());
    assert_eq!(single.status, Status::NotFinite);
    let row = rows[2].as_ref().unwrap();
    assert_eq!((row.status, row.iterations), (single.status, single.iterations));
}

#[test]
fn an_arm_with_bounds_on_its_efforts() {
    check(arm(true), Settings { max_iterations: 30, ..Settings::default() }, &vary_arm, 0.0);
}

#[test]
fn full_ddp() {
    check(arm(false), Settings { second_order: true, ..Settings::default() }, &vary_arm, 0.0);
}

#[test]
fn a_quadruped_with_an_impact() {
    check(gait(0.0), Settings { max_iterations: 12, ..Settings::default() }, &vary_gait, 1e-9);
}

#[test]
fn a_quadruped_whose_contacts_have_other_targets() {
    check(gait(50.0), Settings { max_iterations: 12, ..Settings::default() }, &aim_gait, 1e-8);
}

#[test]
fn actions_without_a_robot() {
    let x0 = [-1.0, -1.0, 1.0];
    let (knot, end) = (Unicycle::default(), Unicycle::default().terminal());
    let problem = Problem::new(x0.to_vec(), vec![Box::new(knot)], vec![0; 20], Box::new(end)).unwrap();
    let vary = |i: usize, problem: &mut Problem| problem.set_x0(&[-1.0, -1.0 + 0.3 * i as f64, 1.0]);
    check(problem, Settings::default(), &vary, 0.0);
}

#[test]
fn a_problem_with_other_costs_is_solved_alone() {
    let nominal = arm(false);
    let mut solver = BatchFddp::new(&nominal, 1).unwrap();
    let other = |i: usize, problem: &mut Problem| {
        *problem = arm(i % 2 == 1);
        vary_arm(i, problem)
    };
    let rows = together(&mut solver, &[0, 1, 2, 3], &other);
    for (i, row) in rows.into_iter().enumerate() {
        let mut problem = arm(i % 2 == 1);
        let xs = arm(false).x0().repeat(21);
        let us = problem.quasi_static(&xs).unwrap();
        vary_arm(i, &mut problem).unwrap();
        let mut start = xs;
        start[..14].copy_from_slice(problem.x0());
        assert_eq!(row.unwrap(), Row::of(Fddp::new(&problem).solve(&mut problem, &start, &us).unwrap()));
    }
}

#[test]
fn a_wrong_problem_fails_alone() {
    let wrong = |i: usize, problem: &mut Problem| {
        vary_arm(i, problem)?;
        if i == 5 { problem.set_x0(&[f64::NAN; 14]) } else { Ok(()) }
    };
    let mut solver = BatchFddp::new(&arm(false), 1).unwrap();
    let rows = together(&mut solver, &[4, 5, 6], &wrong);
    assert!(matches!(rows[1], Err(Error::NotFinite { name: "x0", .. })), "{:?}", rows[1]);
    assert_eq!(rows[2], together(&mut solver, &[6], &vary_arm)[0]);
}

#[test]
fn a_solve_that_fails_at_once_has_no_gains() {
    let wild = |i: usize, problem: &mut Problem| {
        vary_arm(i, problem)?;
        let speed = if i == 5 { 1e200 } else { 0.0 }; // the cost overflows
        let x0 = [&problem.x0()[..7], &[speed; 7]].concat();
        problem.set_x0(&x0)
    };
    let mut solver = BatchFddp::new(&arm(false), 1).unwrap();
    together(&mut solver, &[4; 8], &wild); // all slots have gains
    let row = together(&mut solver, &[5], &wild).remove(0).unwrap();
    assert_eq!((row.status, row.iterations), (Status::NotFinite, 0));
    assert!(row.gains.iter().all(|gain| *gain == 0.0));
}

#[test]
fn time_and_the_receiver_end_a_call() {
    let indices: Vec<usize> = (0..100).collect();
    let mut solver = BatchFddp::new(&arm(false), 1).unwrap();
    solver.settings = Settings { tolerance: 0.0, max_iterations: 1_000_000, ..Settings::default() };
    solver.settings.time_budget = Some(Duration::from_millis(50));
    let problems = changed(&indices, &vary_arm);
    let count = solver.solve(100, &problems).unwrap();
    let rows = problems.rows.into_inner().unwrap();
    assert!(count < 100 && rows[count..].iter().all(Option::is_none));
    let ended = |row: &Option<Result<Row, Error>>| row.as_ref().unwrap().as_ref().unwrap().status;
    assert!(rows[..count].iter().all(|row| matches!(ended(row), Status::TimeLimit | Status::RegularisationLimit)));

    solver.settings.time_budget = None;
    let problems = Changed { stops: true, ..changed(&indices, &vary_arm) };
    let count = solver.solve(100, &problems).unwrap();
    assert!(count < 100 && problems.asked.into_inner() > 0);
    let rows = problems.rows.into_inner().unwrap();
    assert!(rows[..count].iter().any(|row| ended(row) == Status::Interrupted));
}

#[test]
fn wrong_arguments() {
    let mut solver = BatchFddp::new(&arm(false), 1).unwrap();
    assert!(solver.set_start(&[0.0; 3], &[0.0; 140]).is_err());
    solver.settings.step_lengths = 0;
    assert!(matches!(solver.solve(1, &changed(&[0], &vary_arm)), Err(Error::Setting { .. })));
    assert_eq!(solver.settings.step_lengths, 0);
}
