//! Actions that are generic over the scalar type: exact first and second derivatives, also on manifolds.
#![allow(non_snake_case)]

use condyle_dynamics::{Data, Model, aba, difference, integrate, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Cost, FreeAcceleration, FreeDynamics, Integrated, Integrator, Residual,
};
use condyle_optimal::{
    ActionModel, AutoDiff, AutoDiffConstraint, Fddp, GenericAction, GenericConstraint, Hessian, LqKnot, NumDiff,
    PathConstraint, Problem, Status,
};
use condyle_spatial::Scalar;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Tolerance of a comparison of two exact methods, each of which factorises M.
const EXACT: f64 = 1e-9;
/// Tolerance of first and second central differences, for functions with values of one to a hundred.
const DIFFERENCES: f64 = 1e-4;
const DT: f64 = 0.05;

/// Generic action of a robot with semi-implicit Euler steps and the cost ½ (‖x ⊖ x₀‖² + ‖u‖²) Δt.
#[derive(Clone)]
struct Steps {
    model: Arc<Model>,
    nu: usize,
    x0: Vec<f64>,
}

impl GenericAction for Steps {
    fn nx(&self) -> usize {
        self.model.nq() + self.model.nv()
    }
    fn ndx(&self) -> usize {
        2 * self.model.nv()
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn calc<S: Scalar>(&mut self, _: usize, x: &[S], u: &[S], next: &mut [S]) -> S {
        let (model, nq, nv) = (&self.model, self.model.nq(), self.model.nv());
        let (q, v) = x.split_at(nq);
        let mut tau = vec![S::zero(); nv];
        tau[nv - self.nu..].copy_from_slice(u);
        let (mut data, dt) = (Data::new(model), S::splat(DT));
        let a = aba(model, &mut data, q, v, &tau, &[]);
        let dq: Vec<S> = (0..nv).map(|k| (v[k] + a[k] * dt) * dt).collect();
        integrate(model, q, &dq, &mut next[..nq]);
        (0..nv).for_each(|k| next[nq + k] = v[k] + a[k] * dt);
        let (mut sum, x0) = (S::zero(), self.x0.iter().map(|&x| S::splat(x)).collect::<Vec<_>>());
        let mut error = vec![S::zero(); 2 * nv];
        self.difference(&x0, x, &mut error);
        error.iter().chain(u).for_each(|&e| sum += e * e);
        sum * S::splat(0.5 * DT)
    }
    fn integrate<S: Scalar>(&self, x: &[S], dx: &[S], out: &mut [S]) {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        integrate(&self.model, &x[..nq], &dx[..nv], &mut out[..nq]);
        (0..nv).for_each(|k| out[nq + k] = x[nq + k] + dx[nv + k]);
    }
    fn difference<S: Scalar>(&self, x0: &[S], x1: &[S], out: &mut [S]) {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        difference(&self.model, &x0[..nq], &x1[..nq], &mut out[..nv]);
        (0..nv).for_each(|k| out[nv + k] = x1[nq + k] - x0[nq + k]);
    }
}

fn random(n: usize, scale: f64, rng: &mut StdRng) -> Vec<f64> {
    (0..n).map(|_| scale * (2.0 * rng.random::<f64>() - 1.0)).collect()
}

fn close(what: &str, a: &DMatrix<f64>, b: &DMatrix<f64>, tolerance: f64) {
    let error = (a - b).amax() / (1.0 + b.amax());
    assert!(error < tolerance, "{what} is off by {error:e}");
}

/// Returns a random state near the neutral state.
fn state(model: &Model, rng: &mut StdRng) -> Vec<f64> {
    let mut q = neutral(model);
    integrate(model, &neutral(model), &random(model.nv(), 0.5, rng), &mut q);
    [q, random(model.nv(), 1.0, rng)].concat()
}

#[test]
fn first_derivatives_are_those_by_hand() {
    let mut rng = StdRng::seed_from_u64(1);
    for model in [robots::arm7(), robots::quadruped()].map(Arc::new) {
        let nu = Actuation::joints(&model).nu();
        let x0 = state(&model, &mut rng);
        let costs = vec![
            Cost::new("x", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic),
            Cost::new("u", 1.0, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic),
        ];
        let free = FreeAcceleration::new(model.clone(), Actuation::joints(&model), costs).unwrap();
        let mut by_hand = Integrated::new(free, Integrator::SemiImplicitEuler, DT).unwrap();
        let mut by_duals = AutoDiff::new(Steps { model: model.clone(), nu, x0 });
        let (x, u) = (state(&model, &mut rng), random(nu, 5.0, &mut rng));
        let mut lq_knots = [(); 2].map(|()| LqKnot::zeros(2 * model.nv(), nu));
        let [a, b] = &mut lq_knots;
        by_duals.calc_diff(0, &x, &u, a);
        by_hand.calc_diff(0, &x, &u, b);
        close("A", &a.A, &b.A, EXACT);
        close("B", &a.B, &b.B, EXACT);
        close(
            "q",
            &DMatrix::from_column_slice(b.q.len(), 1, a.q.as_slice()),
            &DMatrix::from_column_slice(b.q.len(), 1, b.q.as_slice()),
            EXACT,
        );
        close(
            "r",
            &DMatrix::from_column_slice(nu, 1, a.r.as_slice()),
            &DMatrix::from_column_slice(nu, 1, b.r.as_slice()),
            EXACT,
        );
        close("R", &a.R, &b.R, EXACT);
        let mut found = Hessian::zeros(2 * model.nv(), nu);
        let mut expected = found.clone();
        let lambda = random(2 * model.nv(), 1.0, &mut rng);
        assert!(by_duals.dynamics_hessian(0, &x, &u, &lambda, &mut found));
        assert!(by_hand.dynamics_hessian(0, &x, &u, &lambda, &mut expected));
        close("λᵀ∂²φ/∂x²", &found.xx, &expected.xx, EXACT);
        close("λᵀ∂²φ/∂x∂u", &found.xu, &expected.xu, EXACT);
        close("λᵀ∂²φ/∂u²", &found.uu, &expected.uu, EXACT);
    }
}

#[test]
fn hessians_of_costs_are_those_by_differences() {
    let mut rng = StdRng::seed_from_u64(2);
    let model = Arc::new(robots::quadruped());
    let action = Steps { model: model.clone(), nu: 12, x0: state(&model, &mut rng) };
    let (x, u) = (state(&model, &mut rng), random(12, 5.0, &mut rng));
    let (mut exact, mut numeric) = (LqKnot::zeros(36, 12), LqKnot::zeros(36, 12));
    AutoDiff::new(action.clone()).calc_diff(0, &x, &u, &mut exact);
    NumDiff(AutoDiff::new(action)).calc_diff(0, &x, &u, &mut numeric);
    close("Q", &exact.Q, &numeric.Q, DIFFERENCES);
    close("S", &exact.S, &numeric.S, DIFFERENCES);
    close("R", &exact.R, &numeric.R, DIFFERENCES);
}

#[test]
fn an_action_of_any_scalar_is_solved() {
    let model = Arc::new(robots::arm7());
    let x0 = vec![0.1; 14];
    let goal = [vec![0.5; 7], vec![0.0; 7]].concat();
    let action = AutoDiff::new(Steps { model: model.clone(), nu: 7, x0: goal.clone() });
    let end = vec![Cost::new("x", 10.0, Residual::State { reference: goal }, Activation::Quadratic)];
    let end = Box::new(FreeDynamics::terminal(model, end).unwrap());
    let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 10], end).unwrap();
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &x0.repeat(11), &[0.0; 70]).unwrap();
    assert_eq!(solution.status, Status::Converged);
}

/// Path constraint on a unit circle, x = (cos φ, sin φ): the height of the point, and a function of φ and u.
#[derive(Clone)]
struct OnCircle;

impl GenericConstraint for OnCircle {
    fn size(&self) -> usize {
        2
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&[-1.0, 0.0], &[0.5, 0.0])
    }
    fn calc<S: Scalar>(&self, t: usize, x: &[S], u: &[S], g: &mut [S]) {
        g[0] = x[1];
        g[1] = x[0] * u[0] * S::splat(t as f64);
    }
    fn integrate<S: Scalar>(&self, x: &[S], dx: &[S], out: &mut [S]) {
        let (s, c) = dx[0].sin_cos();
        (out[0], out[1]) = (x[0] * c - x[1] * s, x[0] * s + x[1] * c);
    }
}

/// Checks the derivatives along the circle: ∂(sin φ)/∂φ = cos φ and ∂(t u cos φ)/∂(φ, u) = (−t u sin φ, t cos φ). Old
/// entries of the matrices must be overwritten.
#[test]
fn constraints_of_any_scalar_are_differentiated_along_the_manifold() {
    let (x, u) = ([0.8, 0.6], [3.0]);
    let mut constraint = AutoDiffConstraint::new(OnCircle);
    for _ in 0..2 {
        let (mut gx, mut gu) = (DMatrix::from_element(2, 1, 9.0), DMatrix::from_element(2, 1, 9.0));
        assert!(constraint.calc_diff(2, &x, &u, &mut gx, &mut gu));
        assert_eq!((gx.as_slice(), gu.as_slice()), (&[0.8, -6.0 * 0.6][..], &[0.0, 1.6][..]));
    }
    // the terminal knot has no controls
    let (mut gx, mut gu) = (DMatrix::zeros(1, 1), DMatrix::zeros(1, 0));
    #[derive(Clone)]
    struct Top;
    impl GenericConstraint for Top {
        fn size(&self) -> usize {
            1
        }
        fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
            (&[0.0], &[0.0])
        }
        fn calc<S: Scalar>(&self, _: usize, x: &[S], _: &[S], g: &mut [S]) {
            g[0] = x[0];
        }
        fn integrate<S: Scalar>(&self, x: &[S], dx: &[S], out: &mut [S]) {
            OnCircle.integrate(x, dx, out);
        }
    }
    assert!(AutoDiffConstraint::new(Top).calc_diff(0, &x, &[], &mut gx, &mut gu));
    assert_eq!(gx[0], -0.6);
}
