//! Integrators and control polynomials: exact derivatives, and orders of convergence.

use super::{DT, ROUNDING, check_derivatives, largest_difference, random, random_state};
use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{
    Activation, Actuation, ControlPolynomial, Cost, FreeAcceleration, FreeDynamics, Integrator, Residual,
};
use condyle_optimal::{ActionModel, LqKnot};
use nalgebra::DMatrix;
use rand::{SeedableRng, rngs::StdRng};
use std::sync::Arc;

#[test]
fn derivatives_of_integrators_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(14);
    let polynomials = [ControlPolynomial::Constant, ControlPolynomial::Linear, ControlPolynomial::Quadratic];
    let of = |method: Integrator| polynomials.map(|controls| (method, controls));
    let methods = [Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4];
    let methods = [methods.map(of).concat(), of(Integrator::SemiImplicitEuler).into()].concat();
    for model in [robots::arm7(), robots::quadruped()].map(Arc::new) {
        for &(method, controls) in &methods {
            let drives = Actuation::joints(&model);
            let nu = drives.nu();
            let frame = model.frames().last().unwrap().into();
            let costs = vec![
                Cost::new(
                    "state",
                    0.3,
                    Residual::State { reference: random_state(&model, &mut rng) },
                    Activation::Quadratic,
                ),
                Cost::new("effort", 0.1, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic),
                Cost::new(
                    "place",
                    0.9,
                    Residual::FrameTranslation { frame, target: Vec3::new(0.1, 0.2, 0.3) },
                    Activation::Quadratic,
                ),
                Cost::new("gravity", 1e-2, Residual::ControlGravity, Activation::Quadratic),
            ];
            let inner = FreeAcceleration::new(model.clone(), drives, costs).unwrap();
            let action = FreeDynamics::new(inner, method, DT).unwrap().with_controls(controls);
            let what = format!("{method:?} of {}, {controls:?}", model.name());
            check_derivatives(&what, action, &model, 0.3, &mut rng);
        }
    }
}

/// Checks that a polynomial with equal controls at all nodes gives the same step, cost and derivatives as constant
/// controls.
#[test]
fn equal_controls_of_a_polynomial_are_constant() {
    let mut rng = StdRng::seed_from_u64(23);
    let arm = Arc::new(robots::arm7());
    let costs = || vec![Cost::new("effort", 0.1, Residual::Control { reference: vec![0.5; 7] }, Activation::Quadratic)];
    for method in
        [Integrator::SemiImplicitEuler, Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4]
    {
        let knot = |controls: ControlPolynomial| {
            let inner = FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), costs()).unwrap();
            FreeDynamics::new(inner, method, DT)
                .unwrap()
                .with_bounds(vec![-1.0; 7], vec![1.0; 7])
                .with_controls(controls)
        };
        let (x, u) = (random_state(&arm, &mut rng), random(7, 1.0, &mut rng));
        let (mut constant, mut expected, mut same) =
            (knot(ControlPolynomial::Constant), [0.0; 14], LqKnot::zeros(14, 7));
        let cost = constant.calc(0, &x, &u, &mut expected);
        constant.calc_diff(0, &x, &u, &mut same);
        for controls in [ControlPolynomial::Linear, ControlPolynomial::Quadratic] {
            let (mut action, n) = (knot(controls), controls.nodes());
            let (w, mut next, mut knot) = (u.repeat(n), [0.0; 14], LqKnot::zeros(14, 7 * n));
            let still = |action: &mut dyn ActionModel| action.quasi_static(0, &x);
            assert_eq!((action.nu(), still(&mut action)), (7 * n, still(&mut constant).repeat(n)));
            assert_eq!(action.bounds(0), Some((&vec![-1.0; 7 * n][..], &vec![1.0; 7 * n][..])));
            let same_cost = (action.calc(0, &x, &w, &mut next) - cost).abs() < ROUNDING;
            assert!(same_cost && largest_difference(&next, &expected) < ROUNDING, "{method:?} {controls:?}");
            action.calc_diff(0, &x, &w, &mut knot);
            let by_all: DMatrix<f64> = (0..n).map(|k| knot.B.columns(7 * k, 7).into_owned()).sum(); // ∂w/∂u = [1; 1; 1]
            assert!(largest_difference(by_all.as_slice(), same.B.as_slice()) < ROUNDING, "{method:?} {controls:?}");
            let blocks = (0..n * n).map(|k| knot.R.view((7 * (k % n), 7 * (k / n)), (7, 7)).into_owned());
            let R: DMatrix<f64> = blocks.sum();
            assert!(largest_difference(R.as_slice(), same.R.as_slice()) < ROUNDING, "{method:?} {controls:?}");
        }
    }
}

/// Checks orders of convergence by comparing one step of Δt with many small steps. Halving Δt divides the error by
/// 2^(order + 1).
#[test]
fn runge_kutta_methods_have_their_order() {
    let mut rng = StdRng::seed_from_u64(15);
    let model = Arc::new(robots::arm7());
    let (x, u) = (random_state(&model, &mut rng), random(7, 1.0, &mut rng));
    let end = |method, dt: f64, steps: usize| {
        let inner = FreeAcceleration::new(model.clone(), Actuation::joints(&model), vec![]).unwrap();
        let mut action = FreeDynamics::new(inner, method, dt).unwrap();
        let (mut x, mut next) = (x.clone(), x.clone());
        for _ in 0..steps {
            action.calc(0, &x, &u, &mut next);
            x.copy_from_slice(&next);
        }
        x
    };
    let time = 0.02;
    let exact = end(Integrator::RungeKutta4, time / 256.0, 256);
    for (method, order) in
        [(Integrator::RungeKutta2, 2.0), (Integrator::RungeKutta3, 3.0), (Integrator::RungeKutta4, 4.0)]
    {
        let error = |steps: usize| largest_difference(&end(method, time / steps as f64, steps), &exact);
        let observed = (error(2) / error(4)).log2();
        assert!((observed - order).abs() < 0.3, "{method:?}: order {observed}");
    }
}
