//! Costs and limits of the change of the controls from knot to knot: against a dense quadratic program, against
//! differences, and with a robot in contact.
#![allow(non_snake_case)] // names follow the literature

use condyle_dynamics::{ContactConstraint, Model, ReferenceFrame, robots};
use condyle_optimal::robot::{
    Activation, Contact, ContactDynamics, ControlBounds, ControlChange, Cost, Dynamics, FreeDynamics, FrictionCone,
    Integrator, Knot, Limit, Residual, RobotProblem,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, ControlRate, Error, Fddp, InteriorPoint, LqKnot, Lqr, NumDiff, Problem, Status,
};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Tolerance of the solution of a quadratic program: rounding, times a condition number of about 1e4.
const OPTIMUM: f64 = 1e-9;
/// Tolerance of central differences of a function of order one.
const DIFFERENCES: f64 = 1e-6;
/// Tolerance of solvers that approach active limits.
const ACTIVE: f64 = 1e-5;
const KNOTS: usize = 12;
const DT: f64 = 0.02;

fn random(rows: usize, columns: usize, rng: &mut StdRng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
}

/// Returns M Mᵀ + 1, which is positive definite.
fn positive(n: usize, rng: &mut StdRng) -> DMatrix<f64> {
    let M = random(n, n, rng);
    &M * M.transpose() + DMatrix::identity(n, n)
}

fn random_knot(n: usize, m: usize, rng: &mut StdRng) -> LqKnot {
    let mut knot = LqKnot::zeros(n, m);
    (knot.A, knot.B) = (0.5 * random(n, n, rng), random(n, m, rng));
    (knot.Q, knot.R, knot.S) = (positive(n, rng), positive(m, rng), 0.1 * random(n, m, rng));
    knot.f = random(n, 1, rng).column(0).into();
    knot.q = random(n, 1, rng).column(0).into();
    knot.r = DVector::from_fn(m, |_, _| rng.random_range(-1.0..1.0));
    knot
}

/// Returns the controls that minimise the cost of all knots and of all changes of the controls. The states are
/// eliminated: x = X₀ + X u for each knot, with the controls u of all knots.
fn dense_optimum(knot: &LqKnot, end: &LqKnot, x0: &[f64], p0: &[f64], weights: &[f64]) -> DVector<f64> {
    let (n, m) = (knot.ndx(), knot.nu());
    let all = m * KNOTS;
    let (mut x, mut X) = (DVector::from_column_slice(x0), DMatrix::zeros(n, all));
    let (mut H, mut g) = (DMatrix::zeros(all, all), DVector::zeros(all));
    let W = DMatrix::from_diagonal(&DVector::from_column_slice(weights));
    for t in 0..KNOTS {
        let mut U = DMatrix::zeros(m, all);
        U.view_mut((0, m * t), (m, m)).fill_with_identity();
        H += X.transpose() * &knot.Q * &X + U.transpose() * &knot.R * &U;
        H += X.transpose() * &knot.S * &U + U.transpose() * knot.S.transpose() * &X;
        g += X.transpose() * (&knot.Q * &x + &knot.q) + U.transpose() * (&knot.r + knot.S.transpose() * &x);
        let (mut D, mut d) = (U.clone(), DVector::zeros(m));
        match t {
            0 => d = -DVector::from_column_slice(p0),
            _ => D.view_mut((0, m * (t - 1)), (m, m)).copy_from(&-DMatrix::<f64>::identity(m, m)),
        }
        H += D.transpose() * &W * &D;
        g += D.transpose() * &W * d;
        X = &knot.A * X + &knot.B * U;
        x = &knot.A * x + &knot.f;
    }
    H += X.transpose() * &end.Q * &X;
    g += X.transpose() * (&end.Q * &x + &end.q);
    H.cholesky().expect("the problem is strictly convex").solve(&-g)
}

#[test]
fn a_quadratic_program_has_the_solution_of_its_dense_form() {
    let mut rng = StdRng::seed_from_u64(52);
    let (n, m) = (4, 2);
    for weights in [[0.0, 0.0], [1.0, 1.0], [300.0, 0.1]] {
        let (knot, end) = (random_knot(n, m, &mut rng), random_knot(n, 0, &mut rng));
        let [x0, p0] = [n, m].map(|size| random(size, 1, &mut rng).as_slice().to_vec());
        let expected = dense_optimum(&knot, &end, &x0, &p0, &weights);
        let [knot, end] = [knot, end].map(|knot| ControlRate::new(Box::new(Lqr::new(knot)), &weights).unwrap());
        let start = [x0, p0].concat();
        let mut problem = Problem::new(start.clone(), vec![Box::new(knot)], vec![0; KNOTS], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        let (xs, us) = (start.repeat(KNOTS + 1), vec![0.0; m * KNOTS]);
        let solution = solver.solve(&mut problem, &xs, &us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        let error = solution.us.iter().zip(&expected).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(error < OPTIMUM * (1.0 + expected.amax()), "{error}");
        assert!((1..=KNOTS).all(|t| solution.x(t)[n..] == *solution.u(t - 1))); // the state contains the last control
    }
}

/// A point that should be far ahead increases its control as fast as the limit allows.
#[test]
fn a_limit_of_the_change_is_kept() {
    let mut knot = LqKnot::zeros(2, 1);
    knot.A.copy_from_slice(&[1.0, 0.0, 0.1, 1.0]);
    knot.B.copy_from_slice(&[0.0, 0.1]);
    let mut end = LqKnot::zeros(2, 0);
    (end.Q[(0, 0)], end.q[0], knot.R[0]) = (1.0, -100.0, 1e-6);
    let limit = 0.25;
    let problem = || {
        let wrapped = |knot: &LqKnot| ControlRate::new(Box::new(Lqr::new(knot.clone())), &[0.0]).unwrap();
        let first = wrapped(&knot).limited(&[-limit], &[limit]).unwrap();
        Problem::new(vec![0.0, 0.0, 0.5], vec![Box::new(first)], vec![0; KNOTS], Box::new(wrapped(&end))).unwrap()
    };
    let (xs, us) = (vec![0.0; 3 * (KNOTS + 1)], vec![0.0; KNOTS]);
    let mut solved = problem();
    let inside = InteriorPoint::new(&solved).solve(&mut solved, &xs, &us).unwrap().clone();
    let mut solved = problem();
    let outside = AugmentedLagrangian::new(&solved).solve(&mut solved, &xs, &us).unwrap().clone();
    for solution in [inside, outside] {
        assert_eq!(solution.status, Status::Converged);
        let fastest = |t: usize| 0.5 + limit * (t + 1) as f64;
        // the last control does not change the last position
        assert!((0..KNOTS - 1).all(|t| (solution.u(t)[0] - fastest(t)).abs() < ACTIVE), "{:?}", solution.us);
    }
}

/// Standing quadruped whose efforts change at a cost: the knot, the terminal knot, and the states (q, v) and efforts at
/// rest.
struct Stand {
    knot: ControlRate,
    end: ControlRate,
    x: Vec<f64>,
    still: Vec<f64>,
}

/// Parts of the standing quadruped: the robot, the state at rest, contacts, costs, and limits.
struct Parts {
    model: Arc<Model>,
    x: Vec<f64>,
    contacts: Vec<Contact>,
    state: Cost,
    effort: Cost,
    limits: Vec<Limit>,
}

fn parts() -> Parts {
    let model = Arc::new(robots::quadruped());
    let mut x = vec![0.0; model.nq() + model.nv()];
    x[..7].copy_from_slice(&[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0]);
    for leg in 0..4 {
        let sign = if leg % 2 == 0 { 1.0 } else { -1.0 };
        x[7 + 3 * leg..10 + 3 * leg].copy_from_slice(&[0.0, 0.7 * sign, -1.4 * sign]);
    }
    let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
    let contacts = feet.map(|foot| {
        let point = ContactConstraint::point(model.frame(foot).unwrap());
        Contact::new(foot, ContactConstraint { kd: 50.0, reference: ReferenceFrame::LocalWorldAligned, ..point })
    });
    let state = Cost::new("state", 1.0, Residual::State { reference: x.clone() }, Activation::Quadratic);
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic);
    let cone = FrictionCone::new(0.5);
    let (lower, upper) = cone.bounds();
    let grip = |foot: &str| {
        let residual = Residual::FrictionCone { contact: foot.to_owned(), cone: cone.clone() };
        Limit::new(foot, residual, lower.clone(), upper.clone())
    };
    Parts { limits: feet.map(grip).to_vec(), contacts: contacts.to_vec(), model, x, state, effort }
}

fn stand(weight: f64) -> Stand {
    let Parts { model, x, contacts, state, effort, limits } = parts();
    let robot = ContactDynamics::running(model.clone(), &contacts, DT, vec![state.clone(), effort]).unwrap();
    let mut robot = robot.with_limits(limits).unwrap();
    let still = robot.quasi_static(&x);
    let end = FreeDynamics::terminal(model, vec![state]).unwrap();
    let knot = ControlRate::new(Box::new(robot), &[weight; 12]).unwrap();
    let end = ControlRate::new(Box::new(end), &[weight; 12]).unwrap();
    Stand { knot, end, x, still }
}

/// A problem with changes of the controls is written to JSON and read again. It has the bits of the problem that is
/// made from actions, also with limits of the changes.
#[test]
fn a_problem_in_a_file_is_the_same_problem() {
    let (count, weights, upper) = (6, vec![1e-3; 12], vec![4.0; 12]);
    let Stand { knot, end, x, still } = stand(1e-3);
    let mut x0 = [x, still.clone()].concat();
    x0[20] = 0.6; // m/s
    let Parts { model, contacts, state, effort, limits, .. } = parts();
    let (integrator, lower) = (Integrator::SemiImplicitEuler, vec![-4.0; 12]);
    let dynamics = Dynamics::Contact { contacts, damping: 0.0, actuation: None, integrator, dt: DT };
    let bounds = Some(ControlBounds { lower: lower.clone(), upper: upper.clone() });
    let change = Some(ControlChange { weights, bounds });
    let data = RobotProblem {
        model: (*model).clone(),
        x0: x0.clone(),
        knots: vec![Knot { limits, change: change.clone(), ..Knot::new(dynamics, vec![state.clone(), effort]) }],
        knot_models: vec![0; count],
        terminal: Knot { change, ..Knot::new(Dynamics::Terminal, vec![state]) },
    };
    let text = serde_json::to_string(&data).unwrap();
    let read: RobotProblem = serde_json::from_str(&text).unwrap();
    assert_eq!(read, data);
    let limited = Box::new(knot.limited(&lower, &upper).unwrap());
    let made = Problem::new(x0.clone(), vec![limited], vec![0; count], Box::new(end)).unwrap();
    let [one, other] = [made, read.build().unwrap()].map(|mut problem| {
        let mut solver = InteriorPoint::new(&problem);
        solver.solve(&mut problem, &x0.repeat(count + 1), &still.repeat(count)).unwrap().clone()
    });
    assert_eq!((&one.xs, &one.us, one.status), (&other.xs, &other.us, Status::Converged));
    let first = one.us[..12].iter().zip(&still).map(|(u, p)| (u - p).abs()).fold(0.0, f64::max);
    assert!((3.9..4.0 + ACTIVE).contains(&first), "{first}"); // the limits act
    let wrong = text.replace("\"change\":{\"weights\"", "\"change\":{\"waits\"");
    assert!(serde_json::from_str::<RobotProblem>(&wrong).unwrap_err().to_string().contains("unknown field `waits`"));
}

/// Compares the derivatives of a robot's knots, which are computed in groups, with central differences.
#[test]
fn derivatives_of_a_robot_are_those_of_differences() {
    let mut rng = StdRng::seed_from_u64(7);
    let (Stand { knot, end, x, still }, count) = (stand(0.3), 11);
    let (rest, ndx) = ([x, still.clone()].concat(), knot.ndx());
    let (mut xs, mut us, mut moved) = (Vec::new(), Vec::new(), rest.clone());
    for _ in 0..=count {
        let change = random(ndx, 1, &mut rng) * 0.1;
        knot.integrate(&rest, change.as_slice(), &mut moved);
        xs.extend_from_slice(&moved);
        us.extend(still.iter().map(|u| u + rng.random_range(-1.0..1.0)));
    }
    us.truncate(12 * count);
    let mut problem = Problem::new(rest, vec![Box::new(knot)], vec![0; count], Box::new(end)).unwrap();
    let mut knots = problem.lq_knots();
    problem.calc_diff(&xs, &us, &mut knots);
    let mut differences = NumDiff(stand(0.3).knot);
    for t in [0, 4, count - 1] {
        let (x, u) = (&xs[problem.nx() * t..][..problem.nx()], &us[12 * t..][..12]);
        let mut expected = LqKnot::zeros(ndx, 12);
        differences.calc_diff(t, x, u, &mut expected);
        let near = |name: &str, found: DMatrix<f64>, expected: DMatrix<f64>, scale: f64| {
            let error = (found - &expected).amax();
            assert!(error < scale * DIFFERENCES * (1.0 + expected.amax()), "{name}: {error}");
        };
        let (found, column) = (&knots[t], |v: &DVector<f64>| DMatrix::from_column_slice(v.len(), 1, v.as_slice()));
        near("A", found.A.clone(), expected.A, 1.0);
        near("B", found.B.clone(), expected.B, 1.0);
        near("q", column(&found.q), column(&expected.q), 1.0);
        near("r", column(&found.r), column(&expected.r), 1.0);
        // second differences have a larger error; the Hessian with respect to the robot's state is Gauss and Newton's
        near("R", found.R.clone(), expected.R, 10.0);
        near("S", found.S.rows(36, 12).into(), expected.S.rows(36, 12).into(), 10.0);
        near("Q", found.Q.view((36, 36), (12, 12)).into(), expected.Q.view((36, 36), (12, 12)).into(), 10.0);
    }
}

/// A pushed quadruped stands again. With the cost, its efforts change less from knot to knot, also with active friction
/// cones. Without weights, it has the cost of the robot alone.
#[test]
fn efforts_of_a_pushed_robot_change_less() {
    let count = 15;
    let solved = |weight: f64| {
        let Stand { knot, end, mut x, still } = stand(weight);
        (x[20], x[19]) = (0.6, 0.3); // m/s
        let start = [x, still.clone()].concat();
        let mut problem = Problem::new(start.clone(), vec![Box::new(knot)], vec![0; count], Box::new(end)).unwrap();
        let mut solver = InteriorPoint::new(&problem);
        let solution = solver.solve(&mut problem, &start.repeat(count + 1), &still.repeat(count)).unwrap().clone();
        assert_eq!(solution.status, Status::Converged);
        let forces = problem.motion(&solution, 2).unwrap().contacts.len();
        assert_eq!(forces, 4);
        let all = [&still[..], &solution.us[..]].concat();
        let changes = all.chunks_exact(12).zip(all.chunks_exact(12).skip(1));
        let change = changes.map(|(p, u)| p.iter().zip(u).map(|(p, u)| (u - p).powi(2)).sum::<f64>()).sum::<f64>();
        (change, solution.cost)
    };
    let changes = [0.0, 1e-3, 1e-1].map(|weight| solved(weight).0);
    assert!(changes[1] < 0.8 * changes[0] && changes[2] < 0.5 * changes[1], "{changes:?}");

    let Stand { mut knot, mut end, mut x, still } = stand(0.0);
    (x[20], x[19]) = (0.6, 0.3);
    let robot = knot.action_mut::<ContactDynamics>().unwrap().clone();
    let terminal = end.action_mut::<FreeDynamics>().unwrap().clone();
    let mut alone = Problem::new(x.clone(), vec![Box::new(robot)], vec![0; count], Box::new(terminal)).unwrap();
    let mut solver = InteriorPoint::new(&alone);
    let expected = solver.solve(&mut alone, &x.repeat(count + 1), &still.repeat(count)).unwrap();
    let error = (solved(0.0).1 - expected.cost).abs();
    assert!(error < ACTIVE * expected.cost, "{error}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let knot = || Box::new(Lqr::new(LqKnot::zeros(2, 1)));
    let said = |error: Error| error.to_string();
    assert_eq!(said(ControlRate::new(knot(), &[1.0; 2]).err().unwrap()), "`weights`: expected length 1, found 2");
    let negative = said(ControlRate::new(knot(), &[-1.0]).err().unwrap());
    assert_eq!(negative, "setting `weights` is -1, but it must be at least 0");
    let wide = ControlRate::new(knot(), &[1.0]).unwrap();
    assert_eq!(said(wide.limited(&[0.0], &[0.0; 2]).err().unwrap()), "`upper`: expected length 1, found 2");
    let bare = Box::new(Lqr::new(LqKnot::zeros(2, 0)));
    let mixed = Problem::new(vec![0.0; 3], vec![Box::new(ControlRate::new(knot(), &[1.0]).unwrap())], vec![0], bare);
    assert!(mixed.is_err()); // the terminal knot does not keep the last control
}
