//! Derivatives of solutions, compared with central differences of tightly converged solutions.
#![allow(non_snake_case)] // names follow the literature: M

mod common;
#[path = "sensitivity/constraints.rs"]
mod constraints;
#[path = "sensitivity/faults.rs"]
mod faults;
#[path = "sensitivity/many.rs"]
mod many;
#[path = "sensitivity/robots.rs"]
mod robots_and_bounds;

use common::{Cartpole, HANGING, Limited, cartpole_action, random, straight};
use condyle_dynamics::{
    ContactConstraint, Data, Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, forward_kinematics,
    integrate, neutral, robots,
};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, Integrator, Limit, Residual,
};
use condyle_optimal::{
    ActionModel, Curvature, Fddp, Hessian, LqKnot, Parameter, ParameterJacobian, Problem, Sensitivity,
    SensitivitySettings, Solution, Status,
};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use std::sync::Arc;

/// Tolerance of the comparison with differences, relative to the largest derivative.
const DIFFERENCES: f64 = 1e-6;
/// Step of the differences of solutions. Their truncation error is about its square.
const STEP: f64 = 1e-4;
/// Tolerance of the expected decrease at which a solve ends: near the rounding errors of the cost's gradient.
const TIGHT: f64 = 1e-21;

/// Solves a problem as exactly as rounding errors allow, from states and controls near the solution.
fn solve_tightly(problem: &mut Problem, xs: &[f64], us: &[f64], second_order: bool) -> Solution {
    let mut solver = Fddp::new(problem);
    let settings = &mut solver.settings;
    (settings.tolerance, settings.tolerance_bounded, settings.max_iterations) = (TIGHT, TIGHT, 2000);
    (settings.second_order, settings.regularisation_start, settings.flat) = (second_order, 1e-9, 1e-6);
    let solution = solver.solve(problem, xs, us).unwrap().clone();
    let stop = solution.trace.last().map_or(0.0, |iteration| iteration.stop);
    assert_eq!(solution.status, Status::Converged, "{stop:e} after {} iterations", solution.trace.len());
    solution
}

/// Loss with random gradients ∂L/∂x and ∂L/∂u that is linear in x ⊖ x̄ and u.
struct Loss {
    centre: Vec<f64>,
    by_states: Vec<f64>,
    by_controls: Vec<f64>,
}

impl Loss {
    fn new(problem: &Problem, solution: &Solution) -> Self {
        let mut random = random();
        let mut numbers = |n: usize| (0..n).map(|_| random.random_range(-1.0..1.0)).collect();
        let (by_states, by_controls) = (numbers((problem.horizon() + 1) * problem.ndx()), numbers(solution.us.len()));
        Self { centre: solution.xs.clone(), by_states, by_controls }
    }

    fn value(&self, problem: &Problem, solution: &Solution) -> f64 {
        let (nx, ndx) = (problem.nx(), problem.ndx());
        let mut change = vec![0.0; self.by_states.len()];
        for (t, change) in change.chunks_exact_mut(ndx).enumerate() {
            problem.difference(&self.centre[t * nx..][..nx], solution.x(t), change);
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        dot(&change, &self.by_states) + dot(&solution.us, &self.by_controls)
    }
}

/// Family of problems with a solver, of which `build` returns the problem for a change of `size` parameters.
struct Family<'a> {
    build: &'a dyn Fn(&[f64]) -> Problem,
    solve: &'a dyn Fn(&mut Problem, &Solution) -> Solution,
    /// Size of each parameter, by which the step of its differences is multiplied.
    scales: &'a [f64],
}

impl Family<'_> {
    /// Returns the derivatives of the loss with respect to the parameters, by differences of solutions.
    fn differences(&self, solution: &Solution, loss: &Loss) -> Vec<f64> {
        let side = |j: usize, h: f64| {
            let mut change = vec![0.0; self.scales.len()];
            change[j] = h;
            let mut problem = (self.build)(&change);
            let solution = (self.solve)(&mut problem, solution);
            loss.value(&problem, &solution)
        };
        // fourth order: (8 (L(h) − L(−h)) − (L(2h) − L(−2h))) / 12 h
        let slope = |j: usize, h: f64| (side(j, h) - side(j, -h)) / (2.0 * h);
        let fourth = |j: usize, h: f64| (4.0 * slope(j, h) - slope(j, 2.0 * h)) / 3.0;
        self.scales.iter().enumerate().map(|(j, scale)| fourth(j, STEP * scale)).collect()
    }
}

/// Returns the largest difference of two gradients, relative to the largest entry.
fn error(ours: &[f64], numeric: &[f64]) -> f64 {
    assert_eq!(ours.len(), numeric.len());
    let largest = numeric.iter().fold(1e-12_f64, |largest, x| largest.max(x.abs()));
    ours.iter().zip(numeric).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs())) / largest
}

/// Asserts that gradients of the loss by the adjoint and by the forward method equal differences of solutions.
fn check(sensitivity: &mut Sensitivity, parameter: &ParameterJacobian, loss: &Loss, numeric: &[f64], what: &str) {
    check_within(DIFFERENCES, sensitivity, parameter, loss, numeric, what);
}

/// Asserts as [`check`] does, with another tolerance.
fn check_within(
    tolerance: f64,
    sensitivity: &mut Sensitivity,
    parameter: &ParameterJacobian,
    loss: &Loss,
    numeric: &[f64],
    what: &str,
) {
    let ours = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap().gradient(parameter);
    let worst = error(&ours, numeric);
    println!("{what}: error {worst:.1e}");
    assert!(worst < tolerance, "{what}: {worst:e}\n{ours:?}\n{numeric:?}");
    let adjoint = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap();
    let by_knot = adjoint.gradient_by_knot(parameter);
    let sum: Vec<f64> = (0..ours.len()).map(|j| by_knot.iter().map(|part| part[j]).sum()).collect();
    assert!(error(&sum, &ours) < 1e-12);
    let forward = sensitivity.forward(parameter).unwrap();
    let row = |numbers: &[f64]| DMatrix::from_row_slice(1, numbers.len(), numbers);
    let forward = row(&loss.by_states) * &forward.xs + row(&loss.by_controls) * &forward.us;
    assert!(error(forward.as_slice(), &ours) < 1e-7, "{what}: {forward} {ours:?}"); // same factors, other order
}

/// Action with the second derivatives of its dynamics by differences of its first derivatives, for solves that converge
/// quadratically.
struct Curved<A>(A);

impl<A: ActionModel> ActionModel for Curved<A> {
    fn nx(&self) -> usize {
        self.0.nx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.0.bounds(t)
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.0.calc(t, x, u, next)
    }
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.0.calc_diff(t, x, u, knot);
    }
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (n, m, lambda) = (x.len(), u.len(), DVector::from_column_slice(lambda));
        let mut knot = LqKnot::zeros(n, m);
        let mut gradient = |j: usize, h: f64| {
            let mut z = [x, u].concat();
            z[j] += h;
            self.0.calc_diff(t, &z[..n], &z[n..], &mut knot);
            [knot.A.tr_mul(&lambda).as_slice(), knot.B.tr_mul(&lambda).as_slice()].concat()
        };
        let columns: Vec<f64> = (0..n + m)
            .flat_map(|j| {
                let (above, below) = (gradient(j, 1e-5), gradient(j, -1e-5));
                above.into_iter().zip(below).map(|(a, b)| (a - b) / 2e-5).collect::<Vec<_>>()
            })
            .collect();
        let all = DMatrix::from_vec(n + m, n + m, columns);
        hessian.xx.copy_from(&all.view((0, 0), (n, n)));
        hessian.xu.copy_from(&all.view((0, n), (n, m)));
        hessian.uu.copy_from(&all.view((n, n), (m, m)));
        true
    }
}

/// Checks a swing-up with bounds on the force, several of which are active: derivatives with respect to the initial
/// state and to the bounds.
#[test]
fn a_cartpole_with_bounds() {
    let build = |p: &[f64]| {
        let x0: Vec<f64> = HANGING.iter().zip(p).map(|(x, dx)| x + dx).collect();
        let (lower, upper) = (vec![-12.0 + p[4]], vec![12.0 + p[5]]);
        let knot = Curved(Limited { action: cartpole_action(), lower, upper });
        let end = Cartpole { nu: 0, lanes: 1, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
        Problem::new(x0, vec![Box::new(knot)], vec![0; 50], Box::new(end)).unwrap()
    };
    let solve = |problem: &mut Problem, near: &Solution| solve_tightly(problem, &near.xs, &near.us, true);
    let mut problem = build(&[0.0; 6]);
    let (xs, us) = (straight(&HANGING, &[0.0; 4], 50), vec![0.0; 50]);
    let mut solver = Fddp::new(&problem);
    (solver.settings.max_iterations, solver.settings.tolerance_bounded) = (500, 1e-6);
    let first = solver.solve(&mut problem, &xs, &us).unwrap().clone();
    let solution = solve(&mut problem, &first);
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default()).unwrap();
    let report = sensitivity.report().clone();
    println!("{report:?}");
    assert!(report.strict_complementarity && report.active_controls >= 4, "{report:?}");

    let loss = Loss::new(&problem, &solution);
    let numeric = Family { build: &build, solve: &solve, scales: &[1.0; 6] }.differences(&solution, &loss);
    let own = sensitivity.jacobian_of(&problem, 6, 1e-5, |p| Ok(build(p))).unwrap();
    check(&mut sensitivity, &own, &loss, &numeric, "cart-pole");
    let x0 = sensitivity.jacobian(&mut problem, &Parameter::InitialState).unwrap();
    check(&mut sensitivity, &x0, &loss, &numeric[..4], "cart-pole, x0");
    let adjoint = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap();
    let side = |upper: bool| {
        let of_side = |(bound, u): (&f64, &f64)| if (*u > 0.0) == upper { *bound } else { 0.0 };
        adjoint.control_bounds.iter().zip(&solution.us).map(of_side).sum::<f64>()
    };
    assert!(error(&[side(false), side(true)], &numeric[4..]) < DIFFERENCES);

    // the first control alone
    let K = sensitivity.first_control_by_x0().unwrap();
    let mut by_controls = vec![0.0; 50];
    by_controls[0] = 1.0;
    let first = sensitivity.adjoint(&vec![0.0; 4 * 51], &by_controls).unwrap();
    assert!(error(K.as_slice(), &first.x0) < 1e-9);
}

const ARM: [f64; 7] = [0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2];

/// Creates the problem of an arm that reaches a point. The parameters are changes of the initial state (14), the target
/// (3), the weight of the reach, the first weight of the posture, and the bounds on all efforts.
fn arm(p: &[f64]) -> Problem {
    let model = Arc::new(robots::arm7());
    let x0: Vec<f64> = ARM.into_iter().chain([0.0; 7]).zip(p).map(|(x, dx)| x + dx).collect();
    let rest = [ARM.to_vec(), vec![0.0; 7]].concat();
    let mut weights = [vec![1.0; 7], vec![0.3; 7]].concat();
    weights[0] += p[18];
    let target = Vec3::new(0.3 + p[14], 0.3 + p[15], 0.5 + p[16]);
    let reach = Residual::FrameTranslation { frame: "tool".into(), target };
    let posture = Cost::new("posture", 0.2, Residual::State { reference: rest }, Activation::Weighted(weights));
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let running = vec![
        posture.clone(),
        Cost::new("effort", 1e-3, effort, Activation::Quadratic),
        Cost::new("reach", 20.0 + p[17], reach.clone(), Activation::Quadratic),
    ];
    let knot = FreeDynamics::running(model.clone(), 0.05, running).unwrap();
    let bound = 24.0 + p[19];
    let knot = knot.with_bounds(vec![-bound; 7], vec![bound; 7]);
    let end = vec![posture, Cost::new("reach", 20.0 + p[17], reach, Activation::Quadratic)];
    let end = FreeDynamics::terminal(model, end).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 15], Box::new(end)).unwrap()
}

/// Solves a robot's problem from the controls that hold the initial state still.
fn first_solution(problem: &mut Problem) -> Solution {
    let knots = problem.horizon();
    let xs = problem.x0().repeat(knots + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let mut solver = Fddp::new(problem);
    (solver.settings.max_iterations, solver.settings.tolerance, solver.settings.tolerance_bounded) = (500, 1e-8, 1e-8);
    solver.solve(problem, &xs, &us).unwrap().clone()
}

/// Checks an arm with active bounds on its efforts, for all named parameters, and the errors of approximate curvature.
#[test]
fn an_arm_with_bounds() {
    let solve = |problem: &mut Problem, near: &Solution| solve_tightly(problem, &near.xs, &near.us, true);
    let mut problem = arm(&[0.0; 20]);
    let first = first_solution(&mut problem);
    let solution = solve(&mut problem, &first);
    let loss = Loss::new(&problem, &solution);
    let mut scales = [1.0; 20];
    (scales[17], scales[18]) = (20.0, 2.0);
    let numeric = Family { build: &arm, solve: &solve, scales: &scales }.differences(&solution, &loss);
    let exact = SensitivitySettings::default();
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, exact.clone()).unwrap();
    println!("{:?}", sensitivity.report());
    assert!(sensitivity.report().strict_complementarity && sensitivity.report().active_controls >= 3);
    let parameters =
        [("x0", 0..14), ("target/reach", 14..17), ("weight/reach", 17..18), ("entry_weights/posture", 18..19)];
    for (name, range) in parameters {
        let jacobian = sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap();
        if name == "entry_weights/posture" {
            let all = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap().gradient(&jacobian);
            assert_eq!(all.len(), 14);
            assert!(error(&all[..1], &numeric[range]) < DIFFERENCES);
        } else {
            check(&mut sensitivity, &jacobian, &loss, &numeric[range], name);
        }
    }
    let own = sensitivity.jacobian_of(&problem, 20, 1e-5, |p| Ok(arm(p))).unwrap();
    check(&mut sensitivity, &own, &loss, &numeric, "arm, all");
    // the parameters have their old values again
    let again = problem.cost_mut(0, "reach").unwrap().get().clone();
    assert_eq!((again.weight, again.residual.target()), (20.0, Some(Vec3::new(0.3, 0.3, 0.5).into())));

    let mut gradient = |curvature: Curvature| {
        let settings = SensitivitySettings { curvature, ..exact.clone() };
        let mut other = Sensitivity::new(&mut problem, &solution, None, settings).unwrap();
        other.adjoint(&loss.by_states, &loss.by_controls).unwrap().gradient(&own)
    };
    let approximate =
        [Curvature::Dynamics, Curvature::GaussNewton].map(|curvature| error(&gradient(curvature), &numeric));
    println!("arm: error without exact curvature of costs {:.1e}, Gauss–Newton {:.1e}", approximate[0], approximate[1]);
    // both are approximations, and their errors are visible
    assert!(approximate.iter().all(|error| (1e-5..1.0).contains(error)), "{approximate:?}");
}

/// Creates the problem of a body with four rotors, which tumbles to rest at a placement. The parameters are changes of
/// the initial state (12), of the goal in its tangent space (12), and of the body's mass.
fn quadrotor(p: &[f64]) -> Problem {
    let mass = 1.0 + p[24];
    let body = Inertia::from_com(mass, Vec3::zero(), Sym3::diagonal(0.02));
    let mut robot = ModelBuilder::new("quadrotor");
    robot.body("frame", WORLD, Joint::FreeFlyer, Se3::identity(), body);
    let robot = Arc::new(robot.build().unwrap());
    let moved = |from: &[f64], change: &[f64]| {
        let (q, v) = from.split_at(7);
        let mut x = vec![0.0; 7];
        integrate(&robot, q, &change[..6], &mut x);
        x.extend(v.iter().zip(&change[6..]).map(|(v, dv)| v + dv));
        x
    };
    let still = [neutral(&robot), vec![0.0; 6]].concat();
    let goal = moved(&moved(&still, &[0.1, 0.2, 0.0, 0.2, 0.1, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), &p[12..24]);
    let x0 = moved(&moved(&still, &[0.5, -0.3, 0.2, 0.6, 0.4, -0.5, 0.0, 0.0, 0.0, 1.0, -0.5, 0.3]), &p[..12]);
    let goal = Residual::State { reference: goal };
    let end = vec![Cost::new("goal", 20.0, goal.clone(), Activation::Quadratic)];
    let end = FreeDynamics::terminal(robot.clone(), end).unwrap();
    let arms = [[0.2, 0.0], [0.0, 0.2], [-0.2, 0.0], [0.0, -0.2]];
    let map = DMatrix::from_fn(6, 4, |row, k| match row {
        2 => 1.0,
        3 => arms[k][1],
        4 => -arms[k][0],
        5 => [0.02, -0.02][k % 2],
        _ => 0.0,
    });
    let effort = Residual::Control { reference: vec![9.81 / 4.0; 4] };
    let costs = vec![
        Cost::new("goal", 1.0, goal, Activation::Quadratic),
        Cost::new("effort", 0.1, effort, Activation::Quadratic),
    ];
    let drives = Actuation::matrix(&robot, map).unwrap();
    let knot = FreeAcceleration::new(robot, drives, costs).unwrap();
    let knot = FreeDynamics::new(knot, Integrator::SemiImplicitEuler, 0.05).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 25], Box::new(end)).unwrap()
}

/// Checks a floating base, whose states are no vector space, for its initial state, its goal and its mass.
#[test]
fn a_floating_base() {
    let solve = |problem: &mut Problem, near: &Solution| solve_tightly(problem, &near.xs, &near.us, true);
    let mut problem = quadrotor(&[0.0; 25]);
    let first = first_solution(&mut problem);
    let solution = solve(&mut problem, &first);
    let loss = Loss::new(&problem, &solution);
    let numeric = Family { build: &quadrotor, solve: &solve, scales: &[1.0; 25] }.differences(&solution, &loss);
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default()).unwrap();
    for (name, range) in [("x0", 0..12), ("target/goal", 12..24)] {
        let jacobian = sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap();
        check(&mut sensitivity, &jacobian, &loss, &numeric[range], name);
    }
    let own = sensitivity.jacobian_of(&problem, 25, 1e-5, |p| Ok(quadrotor(p))).unwrap();
    check(&mut sensitivity, &own, &loss, &numeric, "quadrotor, all");
}

/// Creates the problem of a quadruped that stands and leans. The parameters are changes of the initial velocity of the
/// base (6), of the height of one foothold, of the duration of all knots, and of the target's height.
fn quadruped(p: &[f64]) -> Problem {
    quadruped_with(Arc::new(robots::quadruped()), p, vec![])
}

/// Creates the problem of [`quadruped`] with another robot, and with limits.
fn quadruped_with(model: Arc<Model>, p: &[f64], limits: Vec<Limit>) -> Problem {
    let mut q = neutral(&model);
    for leg in 0..4 {
        q[7 + 3 * leg + 1] = 0.6;
        q[7 + 3 * leg + 2] = -1.2;
    }
    let mut data = Data::new(&model);
    let placed = forward_kinematics(&model, &mut data, &q);
    let feet: Vec<Contact> = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
        .into_iter()
        .enumerate()
        .map(|(k, name)| {
            let frame = model.frame(name).unwrap();
            let mut held = ContactConstraint::point(frame);
            held.target.placement.translation = placed.frame(frame).translation;
            if k == 0 {
                held.target.placement.translation.z += p[6];
            }
            (held.kp, held.kd) = (100.0, 20.0);
            Contact::new(name, held)
        })
        .collect();
    let rest = [q.clone(), vec![0.0; 18]].concat();
    let mut x0 = rest.clone();
    for (v, dv) in x0[q.len()..].iter_mut().zip(&p[..6]) {
        *v += dv;
    }
    x0[q.len() + 1] += 0.2;
    let height = Vec3::new(0.02, 0.03, q[2] - 0.03 + p[8]);
    let base = Residual::CenterOfMass { target: height };
    let costs = |scale: f64| {
        let mut weights = vec![1.0; 36];
        weights[..6].fill(0.1);
        vec![
            Cost::new("rest", scale, Residual::State { reference: rest.clone() }, Activation::Weighted(weights)),
            Cost::new("centre", 100.0 * scale, base.clone(), Activation::Quadratic),
        ]
    };
    let mut running = costs(1.0);
    running.push(Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic));
    let knot =
        ContactDynamics::running(model.clone(), &feet, 0.02 + p[7], running).unwrap().with_limits(limits).unwrap();
    let end = FreeDynamics::terminal(model, costs(1.0)).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 8], Box::new(end)).unwrap()
}

/// Checks a quadruped in contact, whose dynamics have no second derivatives of their own.
#[test]
fn a_quadruped_in_contact() {
    let solve = |problem: &mut Problem, near: &Solution| solve_tightly(problem, &near.xs, &near.us, false);
    let mut problem = quadruped(&[0.0; 9]);
    let first = first_solution(&mut problem);
    let solution = solve(&mut problem, &first);
    let loss = Loss::new(&problem, &solution);
    let numeric = Family { build: &quadruped, solve: &solve, scales: &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 1.0] }
        .differences(&solution, &loss);
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default()).unwrap();
    let own = sensitivity.jacobian_of(&problem, 9, 1e-5, |p| Ok(quadruped(p))).unwrap();
    check(&mut sensitivity, &own, &loss, &numeric, "quadruped, all");
    let adjoint = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap().clone();
    let mut named = |name: &str| adjoint.gradient(&sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap());
    let ours = [named("contact/LF_foot")[2], named("duration")[0], named("target/centre")[2]];
    assert!(error(&ours, &numeric[6..]) < DIFFERENCES, "{ours:?} {numeric:?}");
    assert!(error(&adjoint.x0[18..24], &numeric[..6]) < DIFFERENCES);
}
