//! Panics for mistakes of a caller. A panic occurs at the caller's line, and its message has the argument, the expected
//! number and the number found. Other tests check printed names, and sharing between threads.

use super::*;
use condyle_optimal::robot::{OwnResidual, RobotProblem};
use condyle_optimal::{AugmentedLagrangian, DdpMethod, GroupModel, Hessian, Lqr, Settings, Solution};

#[path = "../../../../tests/common/panics.rs"]
mod panics;

/// Returns the panic message of `call`. The panic must occur at the given line of this file.
fn said(what: &str, line: u32, call: impl FnOnce()) -> String {
    let panic = panics::panic_of(call).expect(what);
    assert!(panic.file.ends_with("callers.rs") && panic.line == line, "{what}, line {line}: {panic:?}");
    panic.message
}

/// Checks that an expression panics at its own line with the given message.
macro_rules! panics {
    ($message:expr, $body:expr) => {
        assert_eq!(said(stringify!($body), line!(), || drop($body)), $message)
    };
}

#[test]
#[rustfmt::skip] // each check must stay on one line, because its panic's line is compared
#[allow(clippy::drop_non_drop, dropping_copy_types, clippy::unit_arg)]
fn a_panic_is_at_the_callers_line() {
    let arm = Arc::new(robots::arm7());
    let x0 = [0.1; 14];
    let (xs, us, mut problem) = (x0.repeat(4), [0.0; 21], arm_problem(&arm));
    let solution = Fddp::new(&problem).solve(&mut problem, &xs, &us).unwrap().clone();
    let (mut next, mut costs, mut lq_knots) = ([0.0; 42], [0.0; 4], problem.lq_knots());
    panics!("`t` is 5, expected at most the horizon 3", problem.nu(5));
    panics!("`t` is 4, expected at most the horizon 3", problem.control_range(4));
    panics!("`xs` has length 55, expected 56", problem.calc(&xs[1..], &us, &mut next, &mut costs));
    panics!("`costs` has length 3, expected 4", problem.calc(&xs, &us, &mut next, &mut costs[1..]));
    panics!("`us` has length 20, expected 21", problem.calc_diff(&xs, &us[1..], &mut lq_knots));
    panics!("`lq_knots` has length 3, expected 4", problem.calc_diff(&xs, &us, &mut lq_knots[1..]));
    panics!("`x1` has length 13, expected 14", problem.difference(&x0, &x0[1..], &mut next[..14]));
    panics!("`u` has length 3, expected 7", problem.outputs(0, &x0, &us[..3], &mut |_, _| ()));
    panics!("`t` is 4, expected at most the horizon 3", problem.cost_at_mut(4, "rest").map(|_| ()));
    panics!("`t` is 4, expected at most the horizon 3", problem.motion(&solution, 4));
    panics!("`x` has length 2, expected 14", problem.motion_at(0, &[0.0; 2], &[0.0; 7]));
    panics!("`t` is 4, expected at most 3", solution.x(4).len());
    panics!("`t` is 3, expected less than 3: knot 3 has no controls", solution.u(3).len());
    let mut knot = FreeDynamics::running(arm.clone(), DT, vec![]).unwrap();
    panics!("`x` has length 13, expected 14", knot.calc(0, &x0[1..], &us[..7], &mut next[..14]));
    panics!("`u` has length 8, expected 7", knot.calc(0, &x0, &us[..8], &mut next[..14]));
    panics!("`next` has length 42, expected 14", knot.calc(0, &x0, &us[..7], &mut next));
    panics!("`u` has length 0, expected 7", knot.calc_diff(0, &x0, &[], &mut lq_knots[0]));
    panics!("`xs` has length 14, expected 28", knot.calc_group(&[0, 1], &x0, &us[..14], &mut next[..28], &mut costs[..2]));
    panics!("`lq_knots` has length 4, expected 1", knot.calc_diff_group(&[0], &x0, &us[..7], &mut lq_knots));
    panics!("`dx` has length 3, expected 14", knot.integrate(&x0, &[0.0; 3], &mut next[..14]));
    panics!("`x` has length 3, expected 14", knot.quasi_static(&x0[..3]));
    panics!("`upper` has length 6, expected 7", knot.clone().with_bounds(vec![0.0; 7], vec![0.0; 6]));
    let free = || FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), vec![]).unwrap();
    panics!("`model` has 7 controls, expected 0 at the end", Integrated::without_time(free()));
    let mut impact = ImpulseDynamics::instant(arm.clone(), &[], 0.0, 0.0, vec![]).unwrap();
    panics!("`x` has length 3, expected 14", impact.calc(0, &[0.0; 3], &[], &mut next[..14]));
    panics!("`next` has length 1, expected 14", impact.calc(0, &x0, &[], &mut next[..1]));
    let weighted = Activation::Weighted(vec![1.0; 2]);
    let message = "`r` has length 3, expected at most 2: the activation has weights or bounds for these";
    panics!(message, weighted.value(&[0.0; 3]));
    panics!("expected at most 4096 states and controls, found 5000 and 1", LqKnot::zeros(5000, 1));
    panics!("`knots` is empty, expected at least the terminal knot", Sweep::new(&[]));
    let (short, mut wide) = (vec![LqKnot::zeros(2, 1), LqKnot::zeros(2, 0)], LqKnot::zeros(2, 1));
    wide.B = DMatrix::zeros(2, 3);
    let mut sweep = Sweep::new(&short);
    panics!("`knots` has length 1, expected 2", sweep.run(&short[..1], 0.0));
    panics!("`segments` is 0, expected at least 1", sweep.set_segments(0));
    panics!("`B` has shape (2, 3), expected (2, 1)", Sweep::new(&[wide.clone(), LqKnot::zeros(2, 0)]));
    panics!("`B` has shape (2, 3), expected (2, 1)", Lqr::new(wide));
    let cone = FrictionCone { facets: 0, ..FrictionCone::new(0.5) };
    panics!("`facets` is 0, expected from 4 to 1000", cone.rows());
    panics!("`facets` is 0, expected from 4 to 1000", WrenchCone { friction: cone, size: [0.1; 2] }.bounds());
}

fn arm_problem(arm: &Arc<Model>) -> Problem {
    let rest = Cost::new("rest", 1.0, Residual::State { reference: vec![0.1; 14] }, Activation::Quadratic);
    let knot = FreeDynamics::running(arm.clone(), DT, vec![rest]).unwrap();
    let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
    Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 3], Box::new(end)).unwrap()
}

#[test]
fn statuses_and_methods_are_printed() {
    assert_eq!(format!("it {}", Status::Converged), "it converged");
    assert_eq!(format!("it {}", Status::TimeLimit), "it ran out of time");
    assert_eq!(format!("[{:>10}]", Status::Converged), "[ converged]");
    assert_eq!((DdpMethod::Fddp.to_string(), DdpMethod::Ddp.to_string()), ("FDDP".to_owned(), "DDP".to_owned()));
    assert_eq!(Integrator::RungeKutta4.to_string(), "Runge–Kutta 4");
    // the printed names equal the names in files
    for status in [
        Status::Converged,
        Status::MaxIterations,
        Status::TimeLimit,
        Status::Interrupted,
        Status::RegularisationLimit,
        Status::ConstraintsViolated,
        Status::Infeasible,
        Status::NotFinite,
    ] {
        assert_eq!(serde_json::to_value(status).unwrap(), status.name());
        assert!(!status.to_string().contains('_'));
    }
    for method in [DdpMethod::Fddp, DdpMethod::Ddp] {
        assert_eq!(serde_json::to_value(method).unwrap(), method.name());
    }
    for integrator in
        [Integrator::SemiImplicitEuler, Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4]
    {
        assert_eq!(serde_json::to_value(integrator).unwrap(), integrator.name());
    }
}

fn shared<T: Send + Sync + 'static>() {}

/// Checks that problems and solvers are `Send` and `Sync`: the test does not compile otherwise.
#[test]
fn problems_and_solvers_are_shared_by_threads() {
    shared::<Problem>();
    shared::<Fddp>();
    shared::<AugmentedLagrangian>();
    shared::<Solution>();
    shared::<Settings>();
    shared::<Sweep>();
    shared::<RobotProblem>();
    shared::<OwnResidual>();
    shared::<Residual>();
    shared::<Box<dyn ActionModel>>();
    shared::<Hessian>();
    // several threads copy the same problem at the same time
    let problem = arm_problem(&Arc::new(robots::arm7()));
    let solve = || {
        let mut own = problem.try_clone().unwrap();
        let (xs, us) = ([0.2; 14].repeat(4), [0.0; 21]);
        Fddp::new(&own).solve(&mut own, &xs, &us).unwrap().cost
    };
    let costs = std::thread::scope(|scope| [scope.spawn(solve), scope.spawn(solve)].map(|one| one.join().unwrap()));
    assert_eq!(costs[0], costs[1]);
}
