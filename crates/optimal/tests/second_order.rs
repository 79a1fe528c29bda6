//! Full DDP: the curvature of the dynamics in the sweep.
#![allow(non_snake_case)]

mod common;

use common::{Circle, HANGING, cartpole_action, random, random_matrix, straight};
use condyle_dynamics::{neutral, robots};
use condyle_optimal::robot::{Actuation, Free, FreeDynamics, Integrator};
use condyle_optimal::{ActionModel, Fddp, Hessian, LqNode, NumDiff, Problem, Status, Sweep};
use nalgebra::DVector;
use std::sync::Arc;

/// Second central differences of functions of size one to ten.
const DIFFERENCES: f64 = 1e-5;

/// First central differences with this step are good to 1e-8 or so.
const STEP: f64 = 6e-6;
const SLOPES: f64 = 1e-7;
/// What the condition of the arm's inertia matrix, 1e4, leaves of the bits of its inverse.
const ROUNDING: f64 = 1e-12;

/// ψ(x, u) = ℓ(x, u) + ½ ‖φ(x, u)‖²: two knots as one that ends there.
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
    fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], _: &mut LqNode) {
        unreachable!("only differentiated numerically")
    }
}

/// With it, the quadratic model of a horizon of one knot is the exact one: that of ℓ(x, u) + V(φ(x, u)).
#[test]
fn the_quadratic_model_is_exact() {
    let (x, u) = ([0.3, 0.7, -0.4, 1.3], [2.0]);
    let mut node = LqNode::zeros(4, 1);
    let mut action = NumDiff(cartpole_action());
    action.calc_diff(0, &x, &u, &mut node);
    let mut end = LqNode::zeros(4, 0);
    let mut next = [0.0; 4];
    action.calc(0, &x, &u, &mut next);
    end.Q.fill_with_identity();
    end.q.copy_from_slice(&next);

    let nodes = [node, end];
    let mut sweep = Sweep::new(&nodes);
    let curvature = |t, lambda: &[f64], hessian: &mut Hessian| action.dynamics_hessian(t, &x, &u, lambda, hessian);
    sweep.run_with(&nodes, 0.0, curvature).unwrap();
    let knot = &sweep.knots()[0];

    let mut exact = LqNode::zeros(4, 1);
    NumDiff(Chained(cartpole_action())).calc_diff(0, &x, &u, &mut exact);
    let K = -exact.R.clone().try_inverse().unwrap() * exact.S.transpose();
    let Vxx = &exact.Q + &exact.S * &K;
    assert!((&knot.Quu - &exact.R).amax() < DIFFERENCES, "{} {}", knot.Quu, exact.R);
    assert!((&knot.K - &K).amax() < DIFFERENCES * 10.0, "{} {K}", knot.K);
    assert!((&knot.Vxx - &Vxx).amax() < DIFFERENCES * 10.0, "{} {Vxx}", knot.Vxx);
    // Without it, it is not.
    sweep.run(&nodes, 0.0).unwrap();
    assert!((&sweep.knots()[0].Vxx - &Vxx).amax() > 100.0 * DIFFERENCES);
}

/// From near the optimum the error of a second-order step is the square of the one before; Gauss–Newton's is a fraction.
#[test]
fn convergence_is_quadratic() {
    let solve = |second_order: bool| {
        let models: Vec<Box<dyn ActionModel>> = vec![Box::new(NumDiff(cartpole_action()))];
        let end = common::Cartpole { nu: 0, lanes: 1, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
        let mut problem = Problem::new(HANGING.to_vec(), models, vec![0; 50], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        // Near the optimum of Gauss–Newton first, so that both go to the same one.
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

/// The second derivatives of a robot's dynamics are the differences of its first ones, Aᵀλ and Bᵀλ.
#[test]
fn robots_give_theirs_exactly() {
    let mut random = random();
    let arm = Arc::new(robots::arm7());
    let map = Actuation::matrix(&arm, random_matrix(&mut random, 7, 3)).unwrap();
    let few = Free::new(arm.clone(), map, vec![]).unwrap();
    let few = FreeDynamics::new(few, Integrator::SemiImplicitEuler, 0.05).unwrap();
    for mut action in [FreeDynamics::running(arm.clone(), 0.05, vec![]).unwrap(), few] {
        let nu = action.nu();
        let mut node = LqNode::zeros(14, nu);
        for _ in 0..3 {
            let numbers = random_matrix(&mut random, 28 + nu, 1);
            let (z, lambda) = numbers.as_slice().split_at(14 + nu);
            let mut ours = Hessian::zeros(14, nu);
            assert!(action.dynamics_hessian(0, &z[..14], &z[14..], lambda, &mut ours));
            let lambda = DVector::from_column_slice(lambda);
            let mut gradient = |z: &[f64]| {
                action.calc_diff(0, &z[..14], &z[14..], &mut node);
                (node.A.transpose() * &lambda, node.B.transpose() * &lambda)
            };
            let largest = 1.0 + ours.xx.amax();
            for j in 0..14 + nu {
                let mut moved = z.to_vec();
                moved[j] = z[j] + STEP;
                let above = gradient(&moved);
                moved[j] = z[j] - STEP;
                let below = gradient(&moved);
                // Both slopes are differences of numbers that carry a rounding of a few bits.
                let rounding = ROUNDING * (above.0.amax() + above.1.amax()) / STEP;
                let (x, u) = ((above.0 - below.0) / (2.0 * STEP), (above.1 - below.1) / (2.0 * STEP));
                let (ours_x, ours_u) = match j < 14 {
                    true => (ours.xx.column(j).into_owned(), ours.xu.row(j).transpose()),
                    false => (ours.xu.column(j - 14).into_owned(), ours.uu.column(j - 14).into_owned()),
                };
                assert!((&ours_x - &x).amax() < SLOPES * largest + rounding, "{j}: {ours_x} {x}");
                assert!((&ours_u - &u).amax() < SLOPES * largest + rounding, "{j}: {ours_u} {u}");
            }
        }
    }
    // On a group there is more to it; so it says.
    let quadruped = Arc::new(robots::quadruped());
    let x = [neutral(&quadruped), vec![0.0; 18]].concat();
    let mut action = FreeDynamics::running(quadruped, 0.05, vec![]).unwrap();
    assert!(!action.dynamics_hessian(0, &x, &[0.0; 12], &[1.0; 36], &mut Hessian::zeros(36, 12)));
}

/// Steps on a circle are linear in the angle: nothing curves.
#[test]
fn numbers_on_a_manifold() {
    let mut hessian = Hessian::zeros(1, 1);
    assert!(NumDiff(Circle { nu: 1 }).dynamics_hessian(0, &[0.6, 0.8], &[0.4], &[1.0], &mut hessian));
    assert!(hessian.xx.amax() < DIFFERENCES && hessian.xu.amax() < DIFFERENCES && hessian.uu.amax() < DIFFERENCES);
}
