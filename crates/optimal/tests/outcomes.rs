//! Outcomes of solves: a solve reports what is wrong, and its result does not depend on how knots and trials are
//! grouped.

#![allow(non_snake_case)] // names follow the literature

mod common;

use common::{
    Cartpole, Circle, HANGING, Unicycle, cartpole, cartpole_action, limited_cartpole, limited_unicycle, straight,
    unicycle,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, Error, Fddp, GroupModel, Iteration, LqKnot, NumDiff, Observer, Problem, Settings,
    Status,
};
use core::ops::ControlFlow;
use std::time::Duration;

/// Accuracy of [`NumDiff`]'s first derivatives for costs and states of size 100; the next constant is for second
/// derivatives.
const FIRST: f64 = 1e-6;
const SECOND: f64 = 1e-3;

fn compare_with_numdiff<A: ActionModel>(mut action: A, x: &[f64], u: &[f64]) {
    let mut ours = LqKnot::zeros(action.ndx(), action.nu());
    let mut expected = ours.clone();
    action.calc_diff(0, x, u, &mut ours);
    let terminal = action.nu() == 0;
    NumDiff(action).calc_diff(0, x, u, &mut expected);
    if !terminal {
        assert!((&ours.A - &expected.A).amax() < FIRST, "{} {}", ours.A, expected.A);
        assert!((&ours.B - &expected.B).amax() < FIRST, "{} {}", ours.B, expected.B);
        assert!((&ours.r - &expected.r).amax() < FIRST, "{} {}", ours.r, expected.r);
        assert!((&ours.S - &expected.S).amax() < SECOND, "{} {}", ours.S, expected.S);
        assert!((&ours.R - &expected.R).amax() < SECOND, "{} {}", ours.R, expected.R);
    }
    assert!((&ours.q - &expected.q).amax() < FIRST, "{} {}", ours.q, expected.q);
    assert!((&ours.Q - &expected.Q).amax() < SECOND, "{} {}", ours.Q, expected.Q);
}

#[test]
fn written_derivatives_agree_with_finite_differences() {
    let weights = [1.0, 0.1, 0.2, 0.3, 0.4];
    compare_with_numdiff(Unicycle { nu: 2, lanes: 1 }, &[0.3, -0.2, 0.7], &[0.5, -1.5]);
    compare_with_numdiff(Unicycle { nu: 0, lanes: 1 }, &[0.3, -0.2, 0.7], &[]);
    compare_with_numdiff(Cartpole { nu: 1, lanes: 1, weights }, &[0.3, -0.2, 0.7, 1.3], &[2.0]);
    compare_with_numdiff(Cartpole { nu: 0, lanes: 1, weights }, &[0.3, -0.2, 0.7, 1.3], &[]);
    compare_with_numdiff(Circle { nu: 1 }, &[0.6, 0.8], &[0.4]);
}

/// Checks a solve with states on a circle, where the problem is linear in the angle. One full step solves the problem,
/// even from a warm start that has gaps and winds around the circle.
#[test]
fn a_state_may_live_on_a_manifold() {
    let circle = |angle: f64| [angle.cos(), angle.sin()];
    let mut problem =
        Problem::new(circle(2.5).to_vec(), vec![Box::new(Circle { nu: 1 })], vec![0; 8], Box::new(Circle { nu: 0 }))
            .unwrap();
    let xs: Vec<f64> = (0..9).flat_map(|t| circle(2.0 - 0.3 * t as f64)).collect();
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &xs, &[0.0; 8]).unwrap();
    assert_eq!(solution.status, Status::Converged);
    assert!(solution.trace[0].step == 1.0 && solution.trace.len() <= 3);
    assert!(solution.x(8)[1].abs() < 1e-3 && solution.gap < 1e-15);
    assert_eq!((solution.K[0].shape(), solution.xs.len()), ((1, 1), 18));
}

#[test]
fn the_pendulum_on_a_cart_stands_up() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let us = [0.0; 50];
    let xs = problem.rollout(&us).unwrap();
    let mut solver = Fddp::new(&problem);
    let mut seen = 0;
    let solution = solver.solve_with(&mut problem, &xs, &us, |_: &Iteration| seen += 1).unwrap();
    assert_eq!(solution.status, Status::Converged);
    assert_eq!(seen, solution.trace.len());
    assert!(solution.x(50).iter().all(|x| x.abs() < 0.1), "{:?}", solution.x(50));
    let xs = solution.xs.clone();
    let us = solution.us.clone();
    assert_eq!(problem.rollout(&us).unwrap(), xs);
    // a solve that starts from the solution does not leave it
    let again = solver.solve(&mut problem, &xs, &us).unwrap();
    assert!(again.status == Status::Converged && again.trace.len() <= 2);
}

#[test]
fn a_solve_is_the_same_with_trials_side_by_side() {
    let solve = |lanes| {
        let mut problem = cartpole(&HANGING, 50, lanes);
        let xs = straight(problem.x0(), &[2.0, -6.0, 0.0, 40.0], 50);
        let mut solver = Fddp::new(&problem);
        solver.settings.max_iterations = 40;
        let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        (solution.xs.clone(), solution.us.clone(), solution.trace.clone())
    };
    let one = solve(1);
    for lanes in [2, 3, 4, 8, 16] {
        assert!(solve(lanes) == one, "{lanes} lanes");
    }
}

#[test]
fn an_early_stop_returns_the_iterate_it_reached() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 12;
    let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap().clone();
    assert_eq!((solution.status, solution.trace.len()), (Status::MaxIterations, 12));
    assert_eq!(solution.cost, solution.trace[11].cost);
    let (mut next, mut costs) = (vec![0.0; 200], vec![0.0; 51]);
    problem.calc(&solution.xs, &solution.us, &mut next, &mut costs);
    assert!((costs.iter().sum::<f64>() - solution.cost).abs() < 1e-12 * solution.cost);
    assert_eq!(next, solution.xs[4..]);

    solver.settings.max_iterations = 0;
    let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    assert_eq!((solution.status, &solution.xs), (Status::MaxIterations, &xs));
}

/// Action x⁺ = x + u, ℓ = −½ c u², whose cost is unbounded below.
struct Concave {
    nu: usize,
    curvature: f64,
}

impl ActionModel for Concave {
    fn nx(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        next[0] = x[0] + u.iter().sum::<f64>();
        -0.5 * self.curvature * u.iter().map(|u| u * u).sum::<f64>()
    }
    fn calc_diff(&mut self, _: usize, _: &[f64], u: &[f64], knot: &mut LqKnot) {
        knot.A[0] = 1.0;
        knot.B.fill(1.0);
        knot.R.fill(-self.curvature);
        knot.r.copy_from_slice(u);
        knot.r *= -self.curvature;
    }
}

#[test]
fn a_problem_without_a_minimum_ends_at_the_largest_regularisation() {
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(Concave { nu: 1, curvature: 1e10 })];
    let mut problem = Problem::new(vec![0.0], models, vec![0; 3], Box::new(Concave { nu: 0, curvature: 0.0 })).unwrap();
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &[0.0; 4], &[1.0; 3]).unwrap();
    assert_eq!((solution.status, solution.regularisation), (Status::RegularisationLimit, 1e9));
    assert_eq!((solution.us.as_slice(), solution.trace.len()), (&[1.0; 3][..], 0));
}

/// Action whose values are finite only while |x| < `limit`. If `broken`, its derivatives are NaN.
struct Bounded {
    nu: usize,
    lanes: usize,
    limit: f64,
    broken: bool,
}

impl GroupModel for Bounded {
    fn lanes(&self) -> usize {
        self.lanes
    }
}

impl ActionModel for Bounded {
    fn nx(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        assert!(x[0].is_finite(), "asked for a state that is not finite");
        next[0] = if x[0].abs() < self.limit { x[0] + u.iter().sum::<f64>() } else { f64::NAN };
        0.5 * ((x[0] - 3.0).powi(2) + u.iter().map(|u| u * u).sum::<f64>())
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        (knot.A[0], knot.Q[0], knot.q[0]) = (if self.broken { f64::NAN } else { 1.0 }, 1.0, x[0] - 3.0);
        knot.B.fill(1.0);
        knot.S.fill(0.0);
        knot.R.fill(1.0);
        knot.r.copy_from_slice(u);
    }
}

#[test]
fn what_is_not_finite_never_enters_a_solution() {
    let solve = |limit: f64, broken: bool, lanes: usize, x: f64| {
        let model = Bounded { nu: 1, lanes, limit, broken };
        let mut problem = Problem::new(
            vec![0.0],
            vec![Box::new(model)],
            vec![0; 6],
            Box::new(Bounded { nu: 0, lanes, limit, broken }),
        )
        .unwrap();
        let mut solver = Fddp::new(&problem);
        let solution = solver.solve(&mut problem, &[x; 7], &[0.0; 6]).unwrap().clone();
        assert!(solution.xs.iter().chain(&solution.us).all(|x| x.is_finite()));
        assert!(!solution.cost.is_nan() && !solution.gap.is_nan());
        solution
    };
    assert_eq!(solve(1.0, false, 1, 2.0).status, Status::NotFinite); // the warm start is not finite
    assert_eq!(solve(9.0, true, 1, 0.0).status, Status::NotFinite); // the derivatives are not finite
    assert_eq!(solve(9.0, false, 1, 0.0).status, Status::Converged);
    for lanes in [1, 4] {
        let cut = solve(2.0, false, lanes, 0.0); // a full step exceeds `limit`, a shorter step does not
        assert!(cut.trace[0].step < 1.0 && cut.trace[0].accepted, "{:?}", cut.trace);
        assert!(cut.cost < 0.5 * 9.0 * 7.0);
    }
}

#[test]
fn errors_name_the_thing_and_the_numbers() {
    let model = || -> Vec<Box<dyn ActionModel>> { vec![Box::new(Unicycle { nu: 2, lanes: 1 })] };
    let end = || Box::new(Unicycle { nu: 0, lanes: 1 });
    let error = |result: Result<Problem, Error>| result.unwrap_err();
    assert_eq!(error(Problem::new(vec![0.0; 3], model(), vec![], end())), Error::EmptyHorizon);
    let e = error(Problem::new(vec![0.0; 3], model(), vec![0, 2], end()));
    assert_eq!(e, Error::UnknownModel { knot: 1, index: 2, models: 1 });
    let e = error(Problem::new(vec![0.0; 2], model(), vec![0], end()));
    assert_eq!(e, Error::Length { name: "x0", expected: 3, found: 2 });
    let e = error(Problem::new(vec![0.0; 3], model(), vec![0, 0], Box::new(Unicycle { nu: 2, lanes: 1 })));
    assert_eq!(
        e.to_string(),
        "terminal: expected an action without controls (a robot's has no duration), found one of nu = 2"
    );
    let e = error(Problem::new(vec![0.0; 3], vec![Box::new(Circle { nu: 1 })], vec![0], end()));
    assert_eq!(e.to_string(), "knot 0: expected nx = 3, found 2");

    let mut problem = unicycle(&[0.0; 3], 5, 1);
    let mut solver = Fddp::new(&problem);
    let e = solver.solve(&mut problem, &[0.0; 17], &[0.0; 10]).unwrap_err();
    assert_eq!(e.to_string(), "`xs`: expected length 18, found 17");
    let e = solver.solve(&mut problem, &[0.0; 18], &[f64::INFINITY; 10]).unwrap_err();
    assert_eq!(e.to_string(), "`us[0]` is inf, which is not finite");
    let e = solver.solve(&mut unicycle(&[0.0; 3], 6, 1), &[0.0; 21], &[0.0; 12]).unwrap_err();
    assert_eq!(e, Error::Length { name: "knot_models", expected: 5, found: 6 });
    let e = solver.solve(&mut cartpole(&[0.0; 4], 5, 1), &[0.0; 24], &[0.0; 5]).unwrap_err();
    assert_eq!(e, Error::Dimension { knot: 0, name: "nx", expected: 3, found: 4 });
    solver.settings = Settings { regularisation_factor: 1.0, ..Settings::default() };
    let e = solver.solve(&mut problem, &[0.0; 18], &[0.0; 10]).unwrap_err();
    assert_eq!(e.to_string(), "setting `regularisation_factor` is 1, but it must be above 1");
}

#[test]
#[should_panic(expected = "`costs` has length 1, expected 2")]
fn a_wrong_shape_panics_with_its_name() {
    let mut next = [0.0; 6];
    Unicycle { nu: 2, lanes: 1 }.calc_group(&[0, 1], &[0.0; 6], &[0.0; 4], &mut next, &mut [0.0]);
}

#[test]
fn a_model_can_be_changed_between_solves() {
    let mut problem = unicycle(&[1.0, 0.0, 0.0], 5, 1);
    problem.set_x0(&[0.5, 0.0, 0.0]).unwrap();
    assert_eq!(problem.x0(), [0.5, 0.0, 0.0]);
    assert!(problem.set_x0(&[f64::NAN; 3]).is_err() && problem.x0()[0] == 0.5);
    assert!(problem.model_mut::<Cartpole>(0).is_none() && problem.model_mut::<Unicycle>(1).is_none());
    problem.model_mut::<Unicycle>(0).unwrap().lanes = 4;
    assert_eq!(problem.terminal_mut::<Unicycle>().unwrap().nu, 0);
}

#[test]
fn bounds_that_leave_no_control_are_refused_by_knot_and_number() {
    let solve = |lower: &[f64], upper: &[f64]| {
        let mut problem = limited_unicycle(&[1.0, 0.0, 0.0], 5, 1, Some([lower.to_vec(), upper.to_vec()]));
        let mut solver = Fddp::new(&problem);
        solver.solve(&mut problem, &[0.0; 18], &[0.0; 10]).map(|solution| solution.status)
    };
    let error = |lower: &[f64], upper: &[f64]| solve(lower, upper).unwrap_err().to_string();
    assert_eq!(error(&[0.0, 2.0], &[1.0, 1.0]), "knot 0: control 1 must be at least 2 and at most 1");
    assert_eq!(error(&[f64::NAN, 0.0], &[1.0, 1.0]), "knot 0: control 0 must be at least NaN and at most 1");
    let infinite = f64::INFINITY;
    assert_eq!(error(&[infinite, 0.0], &[infinite, 1.0]), "knot 0: control 0 must be at least inf and at most inf");
    assert_eq!(error(&[0.0], &[1.0, 1.0]), "knot 0: expected lower bounds = 2, found 1");
    assert_eq!(error(&[0.0, 0.0], &[1.0; 3]), "knot 0: expected upper bounds = 2, found 3");
    assert_eq!(solve(&[0.25, -0.5], &[0.25, 0.5]), Ok(Status::Converged)); // equal bounds are valid
}

/// Checks that infinite bounds do not change a solve, and that a bound on only one side can be active.
#[test]
fn a_bound_may_be_on_one_side() {
    let infinite = f64::INFINITY;
    let solve = |bounds: Option<[Vec<f64>; 2]>| {
        let mut problem = limited_cartpole(&HANGING, 50, 1, bounds);
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        solver.settings.max_iterations = 300;
        solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap().clone()
    };
    let free = solve(None);
    let same = solve(Some([vec![-infinite], vec![infinite]]));
    assert!(free.xs == same.xs && free.trace == same.trace);
    let least = free.us.iter().fold(infinite, |least, u| least.min(*u));
    let bounded = solve(Some([vec![0.8 * least], vec![infinite]]));
    assert_eq!(bounded.status, Status::Converged);
    assert!(bounded.us.iter().all(|u| *u >= 0.8 * least) && bounded.us.contains(&(0.8 * least)));
    assert!(bounded.cost > free.cost);
    // the feedback is zero for a control at its bound
    let t = bounded.us.iter().position(|u| *u == 0.8 * least).unwrap();
    assert!(bounded.K[t].amax() == 0.0);
}

/// Checks the multipliers of a bounded optimum without the solver. The adjoint recursion λ = q + Aᵀλ⁺ gives the
/// gradient ∂J/∂u along the trajectory. The gradient is zero for a free control. For a control at its bound, its
/// negative points outside the bound.
#[test]
fn a_bounded_optimum_satisfies_the_conditions_of_optimality() {
    let bounds = [vec![-8.0], vec![6.0]];
    let mut problem = limited_cartpole(&HANGING, 50, 1, Some(bounds));
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    (solver.settings.max_iterations, solver.settings.tolerance_bounded) = (300, 1e-12);
    let solution = solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap().clone();
    let mut lq_knots = problem.lq_knots();
    problem.calc_diff(&solution.xs, &solution.us, &mut lq_knots);
    let mut adjoint = lq_knots[50].q.clone();
    let mut at_bounds = 0;
    for t in (0..50).rev() {
        let slope = lq_knots[t].r[0] + lq_knots[t].B.column(0).dot(&adjoint);
        adjoint = &lq_knots[t].q + lq_knots[t].A.transpose() * &adjoint;
        let u = solution.u(t)[0];
        at_bounds += usize::from(u == -8.0 || u == 6.0);
        let projected = u - (u - slope).clamp(-8.0, 6.0);
        assert!(projected.abs() < 1e-4, "knot {t}: u = {u}, ∂J/∂u = {slope:e}");
    }
    assert!(at_bounds > 3, "{at_bounds}");
}

/// Action that records how many trials each call at the first knot evaluates.
struct Noting {
    action: Cartpole,
    groups: Vec<usize>,
}

impl GroupModel for Noting {
    fn lanes(&self) -> usize {
        self.action.lanes
    }
    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        if knots.iter().all(|t| *t == 0) {
            self.groups.push(knots.len());
        }
        self.action.calc_group(knots, xs, us, next, costs);
    }
}

impl ActionModel for Noting {
    fn nx(&self) -> usize {
        4
    }
    fn nu(&self) -> usize {
        1
    }
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.action.calc(t, x, u, next)
    }
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.action.calc_diff(t, x, u, knot);
    }
}

/// Checks the sizes of the groups of trials. The first step length is tried alone. The second length is also tried
/// alone if the last search accepted 1 or ½. Then the next four lengths form one group, and then the remaining lengths.
/// The number of lanes limits the size of each group.
#[test]
fn a_refused_step_is_followed_by_the_others_at_once() {
    let alone = |lanes| if lanes == 1 { vec![1; 9] } else { vec![1, 4, 4] };
    for (lanes, after) in [(1, vec![1; 9]), (4, vec![4, 4, 1]), (8, vec![4, 5]), (16, vec![4, 5])] {
        let action = Cartpole { lanes, ..cartpole_action() };
        let noting = Noting { action, groups: vec![] };
        let end = Cartpole { nu: 0, lanes, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
        let mut problem = Problem::new(HANGING.to_vec(), vec![Box::new(noting)], vec![0; 50], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        let solution = solver.solve(&mut problem, &straight(&HANGING, &HANGING, 50), &[0.0; 50]).unwrap();
        // each line search first tries one step length; if that step is rejected, it tries further groups until a step
        // is accepted
        let (mut expected, mut last) = (vec![], 0.0);
        for iteration in &solution.trace {
            expected.push(1);
            let (mut tried, needed) = (1, 1 + (-iteration.step.log2()) as usize);
            for group in if last < 0.5 { after.clone() } else { alone(lanes) } {
                if tried < needed {
                    expected.push(group);
                    tried += group;
                }
            }
            last = iteration.step;
        }
        assert!(expected.len() > solution.trace.len());
        assert_eq!(problem.model_mut::<Noting>(0).unwrap().groups, expected, "{lanes} lanes");
    }
}

/// Slow action with the given number of controls: x⁺ = x + u, ℓ = ½ (x² + u²) + x⁴.
struct Slow(usize);

impl ActionModel for Slow {
    fn nx(&self) -> usize {
        1
    }

    fn nu(&self) -> usize {
        self.0
    }

    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        std::thread::sleep(Duration::from_millis(3));
        let u: f64 = u.iter().sum();
        next[0] = x[0] + u;
        0.5 * (x[0] * x[0] + u * u) + x[0].powi(4)
    }

    fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], _: &mut LqKnot) {
        unreachable!("is differentiated by differences")
    }
}

/// Observer that ends a solve after a given number of calls of `go_on` or of iterations.
struct Impatient {
    questions: usize,
    iterations: usize,
}

impl Observer for Impatient {
    fn iteration(&mut self, _: &Iteration) -> ControlFlow<()> {
        self.iterations -= 1;
        if self.iterations == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn go_on(&mut self) -> ControlFlow<()> {
        self.questions -= 1;
        if self.questions == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Checks that an observer can end a solve after an iteration or within a long one. `resume` then continues from the
/// iterate and finds the same solution.
#[test]
fn observers_end_solves() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let us = [0.0; 50];
    let xs = problem.rollout(&us).unwrap();
    let mut solver = Fddp::new(&problem);
    let end = solver.solve(&mut problem, &xs, &us).unwrap().clone();

    let solution = solver.solve_with(&mut problem, &xs, &us, |now: &Iteration| match now.iteration {
        3 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    });
    let solution = solution.unwrap();
    assert_eq!((solution.status, solution.trace.len()), (Status::Interrupted, 4));
    assert_eq!(solution.cost, end.trace[3].cost);
    let resumed = solver.resume(&mut problem).unwrap();
    assert!(resumed.status == Status::Converged && (resumed.cost - end.cost).abs() < 1e-6 * end.cost);

    // with a slow model, the observer ends the solve before an iteration has ended
    let mut problem =
        Problem::new(vec![1.0], vec![Box::new(NumDiff(Slow(1)))], vec![0; 5], Box::new(NumDiff(Slow(0)))).unwrap();
    let mut solver = Fddp::new(&problem);
    for questions in [1, 2] {
        let observer = Impatient { questions, iterations: 9 };
        let solution = solver.solve_with(&mut problem, &[1.0; 6], &[0.0; 5], observer).unwrap();
        assert_eq!((solution.status, solution.trace.len()), (Status::Interrupted, 0));
    }

    // an observer ends a solve by the augmented Lagrangian in the same way
    let mut solver = AugmentedLagrangian::new(&problem);
    let observer = Impatient { questions: 9, iterations: 1 };
    let solution = solver.solve_with(&mut problem, &[1.0; 6], &[0.0; 5], observer).unwrap();
    assert_eq!((solution.status, solution.trace.len()), (Status::Interrupted, 1));
    assert_eq!(solver.outcome().solves, 1);
    let solution = solver.resume_with(&mut problem, |_: &Iteration| ControlFlow::Break(())).unwrap();
    assert_eq!(solution.status, Status::Interrupted);
}

/// Checks that settings which determine the use of memory have maximum values. A setting that only ends the solve may
/// have any value.
#[test]
fn settings_that_count_are_limited() {
    let mut problem = cartpole(&HANGING, 5, 1);
    let mut solver = Fddp::new(&problem);
    for settings in [
        Settings { threads: 10_000_000, ..Settings::default() },
        Settings { segments: 10_000_000, ..Settings::default() },
    ] {
        solver.settings = settings;
        let error = solver.solve(&mut problem, &[0.0; 24], &[0.0; 5]).unwrap_err().to_string();
        assert!(error.ends_with("is 10000000, but it must be at least 1 and at most 1024"), "{error}");
    }
    solver.settings = Settings { max_iterations: usize::MAX, time_budget: Some(Duration::MAX), ..Settings::default() };
    assert_eq!(solver.solve(&mut problem, &[0.0; 24], &[0.0; 5]).unwrap().status, Status::Converged);
}

/// Checks that the residuals of the augmented Lagrangian are infinite, not NaN, if cost and constraints are not finite.
#[test]
fn what_is_nowhere_finite_is_infinitely_far() {
    let model = |nu| Bounded { nu, lanes: 1, limit: 1.0, broken: false };
    let mut problem = Problem::new(vec![0.0], vec![Box::new(model(1))], vec![0; 6], Box::new(model(0))).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let status = solver.solve(&mut problem, &[2.0; 7], &[0.0; 6]).unwrap().status;
    let outcome = solver.outcome();
    assert_eq!((status, outcome.primal), (Status::NotFinite, f64::INFINITY));
    assert!(!outcome.dual.is_nan() && !outcome.cost.is_nan());
}
