//! Full DDP, in which the sweep includes the curvature of the dynamics.
#![allow(non_snake_case)]

mod common;

use common::{Circle, HANGING, cartpole_action, random, random_matrix, straight};
use condyle_dynamics::{
    DifferenceArgument, Inertia, IntegrateArgument, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD,
    difference_jacobian, integrate_jacobian, neutral, random_configuration, robots,
};
use condyle_optimal::robot::{
    Activation, Actuation, Cost, FreeAcceleration, FreeDynamics, FreeInverseDynamics, Integrator, Residual,
};
use condyle_optimal::{ActionModel, Fddp, Hessian, LqKnot, NumDiff, Problem, Status, Sweep};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Tolerance of second central differences, for functions with values of one to ten.
const DIFFERENCES: f64 = 1e-5;

/// Step of first central differences; the next constant is their tolerance. These differences are accurate to about
/// 1e-8.
const STEP: f64 = 6e-6;
const SLOPES: f64 = 1e-7;
/// Tolerance of second central differences for a robot. Their rounding errors grow with the condition number of the
/// robot's inertia matrix, and their truncation errors with the squares of sines.
const VALUES: f64 = 1e-4;
/// Tolerance of symmetry. Both triangles are sums of the same results of a factorisation, added in different orders.
const SYMMETRY: f64 = 1e-12;
/// Relative accuracy of the arm's inverse inertia matrix, whose condition number is 1e4.
const ROUNDING: f64 = 1e-12;

/// Action whose cost is ψ(x, u) = ℓ(x, u) + ½ ‖φ(x, u)‖²: the cost of a knot plus a cost of its next state.
struct Chained<A>(A);

impl<A: ActionModel> ActionModel for Chained<A> {
    fn nx(&self) -> usize {
        self.0.nx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let cost = self.0.calc(t, x, u, next);
        cost + 0.5 * next.iter().map(|x| x * x).sum::<f64>()
    }
}

/// Checks the quadratic model of a horizon of one knot. With the curvature of the dynamics, it equals the quadratic
/// model of ℓ(x, u) + V(φ(x, u)).
#[test]
fn the_quadratic_model_is_exact() {
    let (x, u) = ([0.3, 0.7, -0.4, 1.3], [2.0]);
    let mut knot = LqKnot::zeros(4, 1);
    let mut action = NumDiff(cartpole_action());
    action.calc_diff(0, &x, &u, &mut knot);
    let mut end = LqKnot::zeros(4, 0);
    let mut next = [0.0; 4];
    action.calc(0, &x, &u, &mut next);
    end.Q.fill_with_identity();
    end.q.copy_from_slice(&next);

    let lq_knots = [knot, end];
    let mut sweep = Sweep::new(&lq_knots);
    let curvature = |t, lambda: &[f64], hessian: &mut Hessian| action.dynamics_hessian(t, &x, &u, lambda, hessian);
    sweep.run_with(&lq_knots, 0.0, curvature).unwrap();
    let knot = &sweep.feedback()[0];

    let mut exact = LqKnot::zeros(4, 1);
    NumDiff(Chained(cartpole_action())).calc_diff(0, &x, &u, &mut exact);
    let K = -exact.R.clone().try_inverse().unwrap() * exact.S.transpose();
    let Vxx = &exact.Q + &exact.S * &K;
    assert!((&knot.Quu - &exact.R).amax() < DIFFERENCES, "{} {}", knot.Quu, exact.R);
    assert!((&knot.K - &K).amax() < DIFFERENCES * 10.0, "{} {K}", knot.K);
    assert!((&knot.Vxx - &Vxx).amax() < DIFFERENCES * 10.0, "{} {Vxx}", knot.Vxx);
    // without the curvature, the quadratic model differs
    sweep.run(&lq_knots, 0.0).unwrap();
    assert!((&sweep.feedback()[0].Vxx - &Vxx).amax() > 100.0 * DIFFERENCES);
}

/// Checks the rate of convergence near the optimum. The error after a second-order step is about the square of the
/// error before the step. The error after a Gauss–Newton step is a fraction of the error before the step.
#[test]
fn convergence_is_quadratic() {
    let solve = |second_order: bool| {
        let models: Vec<Box<dyn ActionModel>> = vec![Box::new(NumDiff(cartpole_action()))];
        let end = common::Cartpole { nu: 0, lanes: 1, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
        let mut problem = Problem::new(HANGING.to_vec(), models, vec![0; 50], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        // both methods start where a Gauss–Newton solve ended, near the optimum, so that both converge to the same
        // optimum
        (solver.settings.tolerance, solver.settings.max_iterations) = (1e-4, 300);
        let near = solver.solve(&mut problem, &straight(&HANGING, &HANGING, 50), &[0.0; 50]).unwrap().clone();
        assert_eq!(near.status, Status::Converged);
        (solver.settings.tolerance, solver.settings.second_order) = (1e-9, second_order);
        let solution = solver.solve(&mut problem, &near.xs, &near.us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        (solution.trace.len(), solution.cost)
    };
    let (newton, gauss_newton) = (solve(true), solve(false));
    assert!((newton.1 - gauss_newton.1).abs() < 1e-8);
    assert!(newton.0 <= 4 && gauss_newton.0 >= 10, "{newton:?} {gauss_newton:?}");
}

/// Creates a model with a knee and with each type of joint whose positions are not a vector space.
fn groups() -> Model {
    let limb = Inertia::from_com(1.3, Vec3::new(0.1, -0.05, -0.3), Sym3::diagonal(0.07));
    let at = |x: f64| Se3 { translation: Vec3::new(x, 0.2, -0.4), ..Se3::identity() };
    let (y, z) = (Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.6, 0.8));
    let mut robot = ModelBuilder::new("groups");
    let sledge = robot.body("sledge", WORLD, Joint::Planar, at(0.0), limb);
    let shoulder = robot.body("shoulder", sledge, Joint::Spherical, at(0.3), limb);
    let wheel = robot.body("wheel", shoulder, Joint::Continuous { axis: z }, at(-0.1), limb);
    robot.body("knee", wheel, Joint::Revolute { axis: y }, at(0.2), limb);
    robot.body("loose", sledge, Joint::FreeFlyer, at(0.5), limb);
    robot.build().unwrap()
}

/// Compares second derivatives of the dynamics with differences of first derivatives and of values, at random states.
fn check<A: ActionModel + Clone>(model: &Model, mut action: A) {
    let mut random = random();
    let (nv, ndx, nu) = (model.nv(), action.ndx(), action.nu());
    let mut knot = LqKnot::zeros(ndx, nu);
    for _ in 0..3 {
        let numbers = random_matrix(&mut random, nv + nu + ndx, 1);
        let (v, numbers) = numbers.as_slice().split_at(nv);
        let (u, lambda) = numbers.split_at(nu);
        let x = [&random_configuration(model, &mut random), v].concat();
        let mut ours = Hessian::zeros(ndx, nu);
        assert!(action.dynamics_hessian(0, &x, u, lambda, &mut ours));
        let largest = 1.0 + ours.xx.amax().max(ours.xu.amax()).max(ours.uu.amax());

        // with ψ(z) = λᵀ(φ(x ⊕ δx, u + δu) ⊖ φ(x, u)): ∂ψ/∂x = E(δx)ᵀ Aᵀ L(φ(…) ⊖ φ)ᵀ λ, ∂ψ/∂u = Bᵀ Lᵀ λ
        let (mut centre, mut next, mut moved) = (x.clone(), x.clone(), x.clone());
        action.calc(0, &x, u, &mut centre);
        let mut change = vec![0.0; ndx];
        let (mut E, mut L) = (DMatrix::zeros(nv, nv), DMatrix::zeros(nv, nv));
        let mut gradient = |z: &[f64]| {
            action.integrate(&x, &z[..ndx], &mut moved);
            let u: Vec<f64> = u.iter().zip(&z[ndx..]).map(|(u, du)| u + du).collect();
            action.calc(0, &moved, &u, &mut next);
            action.calc_diff(0, &moved, &u, &mut knot);
            action.difference(&centre, &next, &mut change);
            integrate_jacobian(model, &z[..nv], IntegrateArgument::Velocity, &mut E);
            difference_jacobian(model, &change[..nv], DifferenceArgument::To, &mut L);
            let mut lambda = DVector::from_column_slice(lambda);
            let upper = L.tr_mul(&lambda.rows(0, nv));
            lambda.rows_mut(0, nv).copy_from(&upper);
            let (mut by_x, by_u) = (knot.A.tr_mul(&lambda), knot.B.tr_mul(&lambda));
            let upper = E.tr_mul(&by_x.rows(0, nv));
            by_x.rows_mut(0, nv).copy_from(&upper);
            (by_x, by_u)
        };
        for j in 0..ndx + nu {
            let mut z = vec![0.0; ndx + nu];
            z[j] = STEP;
            let above = gradient(&z);
            z[j] = -STEP;
            let below = gradient(&z);
            // both gradients are differences of results with rounding errors in their last bits
            let rounding = ROUNDING * (above.0.amax() + above.1.amax()) / STEP;
            let (x, u) = ((above.0 - below.0) / (2.0 * STEP), (above.1 - below.1) / (2.0 * STEP));
            let (ours_x, ours_u) = match j < ndx {
                true => (ours.xx.column(j).into_owned(), ours.xu.row(j).transpose()),
                false => (ours.xu.column(j - ndx).into_owned(), ours.uu.column(j - ndx).into_owned()),
            };
            assert!((&ours_x - &x).amax() < SLOPES * largest + rounding, "{j}: {ours_x} {x}");
            assert!((&ours_u - &u).amax() < SLOPES * largest + rounding, "{j}: {ours_u} {u}");
        }

        // if some positions are not a vector space, also compares with differences of ψ itself, which need no Jacobians
        // of ⊕
        if model.nq() > nv {
            let mut numeric = Hessian::zeros(ndx, nu);
            NumDiff(action.clone()).dynamics_hessian(0, &x, u, lambda, &mut numeric);
            let worst = [(&ours.xx, &numeric.xx), (&ours.xu, &numeric.xu), (&ours.uu, &numeric.uu)]
                .map(|(ours, numeric)| (ours - numeric).amax());
            assert!(worst.iter().all(|&worst| worst < VALUES * largest), "{worst:?} of {largest}");
        }
        assert!((&ours.xx - ours.xx.transpose()).amax() <= SYMMETRY * largest);
        assert!((&ours.uu - ours.uu.transpose()).amax() <= SYMMETRY * largest);
    }
}

/// Checks that the second derivatives of a robot's dynamics equal differences of its first derivatives.
#[test]
fn robots_give_theirs_exactly() {
    let arm = Arc::new(robots::arm7());
    let map = Actuation::matrix(&arm, random_matrix(&mut random(), 7, 3)).unwrap();
    let few = FreeAcceleration::new(arm.clone(), map, vec![]).unwrap();
    check(&arm, FreeDynamics::new(few, Integrator::SemiImplicitEuler, 0.05).unwrap());
    for model in [arm, Arc::new(robots::quadruped()), Arc::new(groups())] {
        for dt in [0.05, 0.5] {
            check(&model, FreeDynamics::running(model.clone(), dt, vec![]).unwrap());
            check(&model, FreeInverseDynamics::running(model.clone(), dt, vec![]).unwrap());
        }
    }
}

/// Creates a knot, or the terminal action, of a body with four rotors. Each rotor exerts a force and a moment on the
/// body.
fn quadrotor(running: bool) -> FreeDynamics {
    let frame = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.02));
    let mut robot = ModelBuilder::new("quadrotor");
    robot.body("frame", WORLD, Joint::FreeFlyer, Se3::identity(), frame);
    let robot = Arc::new(robot.build().unwrap());
    let still = [neutral(&robot), vec![0.0; 6]].concat();
    let state = Residual::State { reference: still };
    if !running {
        return FreeDynamics::terminal(robot, vec![Cost::new("goal", 100.0, state, Activation::Quadratic)]).unwrap();
    }
    let arms = [[0.2, 0.0], [0.0, 0.2], [-0.2, 0.0], [0.0, -0.2]];
    let map = DMatrix::from_fn(6, 4, |row, k| match row {
        2 => 1.0,                  // thrust
        3 => arms[k][1],           // y f
        4 => -arms[k][0],          // −x f
        5 => [0.02, -0.02][k % 2], // drag
        _ => 0.0,
    });
    let drives = Actuation::matrix(&robot, map).unwrap();
    let effort = Residual::Control { reference: vec![9.81 / 4.0; 4] };
    let costs = vec![
        Cost::new("state", 1.0, state, Activation::Quadratic),
        Cost::new("effort", 0.1, effort, Activation::Quadratic),
    ];
    FreeDynamics::new(FreeAcceleration::new(robot, drives, costs).unwrap(), Integrator::SemiImplicitEuler, 0.05)
        .unwrap()
}

/// Action with exact Hessians. The Hessian of the cost is computed by differences, the Hessian of the dynamics by the
/// robot.
struct ExactCosts(NumDiff<FreeDynamics>);

impl ActionModel for ExactCosts {
    fn nx(&self) -> usize {
        self.0.nx()
    }
    fn ndx(&self) -> usize {
        self.0.ndx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.0.calc(t, x, u, next)
    }
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.0.calc_diff(t, x, u, knot);
    }
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        self.0.0.dynamics_hessian(t, x, u, lambda, hessian)
    }
    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.0.integrate(x, dx, out);
    }
    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.0.difference(x0, x1, out);
    }
}

/// Checks a solve in which a tumbling quadrotor comes to rest. The thrust turns with the body, and rotations do not
/// commute.
#[test]
fn convergence_is_quadratic_on_a_group() {
    const KNOTS: usize = 30;
    let still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let away = [1.0, -0.5, 0.3, 1.0, 0.7, -0.5, 0.0, 0.0, 0.0, 2.0, -1.0, 1.0];
    let mut x0 = [0.0; 13];
    quadrotor(true).integrate(&still, &away, &mut x0);
    let solve = |exact: bool, second_order: bool| {
        let model = |running: bool| -> Box<dyn ActionModel> {
            match exact {
                true => Box::new(ExactCosts(NumDiff(quadrotor(running)))),
                false => Box::new(quadrotor(running)),
            }
        };
        let mut problem = Problem::new(x0.to_vec(), vec![model(true)], vec![0; KNOTS], model(false)).unwrap();
        let mut solver = Fddp::new(&problem);
        // both methods start where a Gauss–Newton solve ended, near the optimum, so that both converge to the same
        // optimum
        (solver.settings.tolerance, solver.settings.max_iterations) = (1e-2, 300);
        let near = solver.solve(&mut problem, &x0.repeat(KNOTS + 1), &[9.81 / 4.0; 4 * KNOTS]).unwrap().clone();
        assert_eq!(near.status, Status::Converged);
        (solver.settings.tolerance, solver.settings.second_order) = (1e-9, second_order);
        let solution = solver.solve(&mut problem, &near.xs, &near.us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        let stops: Vec<f64> = solution.trace.iter().map(|iteration| iteration.stop).collect();
        (solution.cost, stops)
    };
    for exact in [false, true] {
        let ((newton, few), (gauss_newton, many)) = (solve(exact, true), solve(exact, false));
        assert!((newton - gauss_newton).abs() < 1e-8);
        assert!(2 * few.len() <= many.len(), "{few:?} {many:?}");
        // with exact Hessians, convergence is quadratic: each expected decrease is a multiple of the square of the one
        // before
        assert!(!exact || few.windows(2).all(|stops| stops[1] < 10.0 * stops[0] * stops[0]), "{few:?}");
    }
}

/// Checks that steps on a circle have no curvature, because they are linear in the angle.
#[test]
fn numbers_on_a_manifold() {
    let mut hessian = Hessian::zeros(1, 1);
    assert!(NumDiff(Circle { nu: 1 }).dynamics_hessian(0, &[0.6, 0.8], &[0.4], &[1.0], &mut hessian));
    assert!(hessian.xx.amax() < DIFFERENCES && hessian.xu.amax() < DIFFERENCES && hessian.uu.amax() < DIFFERENCES);
}
