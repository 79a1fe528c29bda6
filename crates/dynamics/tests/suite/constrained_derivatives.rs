//! Tests of the analytical derivatives of constrained dynamics and of impacts. The results are compared with dual
//! numbers and with finite differences.

use crate::common;

use common::contacts::cases;
use common::{State, Worst, dual, eps, lift, lift_forces, moved, unit};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, Dense, DenseMatrix, Force, Matrix, Model, Scalar, constrained_dynamics,
    constrained_dynamics_derivatives, constrained_dynamics_equations, constrained_equations_at,
    constrained_inverse_dynamics, constrained_inverse_dynamics_derivatives, crba, impulse_dynamics,
    impulse_dynamics_derivatives,
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

/// Tolerance between two exact methods with some thousand rounding errors each.
const EXACT: f64 = 1e-11;
/// Tolerance after a product with the inertia matrix M, with M⁻¹, or with the constraint inertia Λ = (J M⁻¹ Jᵀ)⁻¹. The
/// condition numbers of M and Λ are up to 1e4.
const CONDITIONED: f64 = 1e-9;
/// Tolerance of central differences. The error of a difference is a rounding error of 1e-16 / step, plus step² times a
/// third derivative.
const DIFFERENCES: f64 = 1e-6;
const STEP: f64 = 1e-5;
const TREES: u64 = 15;

/// Algorithm whose results are functions of q, v and τ: the acceleration q̈ and forces λ of constrained dynamics, or
/// the velocity v⁺ and impulses Λ of an impact.
trait Algorithm {
    fn run<S: Scalar>(
        model: &Model,
        data: &mut Data<S>,
        set: &mut ConstraintSet<S>,
        x: [&[S]; 3],
        f: &[Force<S>],
    ) -> Vec<S>;
}

struct Dynamics;

impl Algorithm for Dynamics {
    fn run<S: Scalar>(
        model: &Model,
        data: &mut Data<S>,
        set: &mut ConstraintSet<S>,
        [q, v, tau]: [&[S]; 3],
        f: &[Force<S>],
    ) -> Vec<S> {
        let d = constrained_dynamics(model, data, set, q, v, tau, f);
        [d.a, d.lambda].concat()
    }
}

/// Constrained inverse dynamics: τ and J q̈ + γ as functions of q, v and q̈. The constraint forces are arbitrary.
struct Inverse;

impl Algorithm for Inverse {
    fn run<S: Scalar>(
        model: &Model,
        data: &mut Data<S>,
        set: &mut ConstraintSet<S>,
        [q, v, a]: [&[S]; 3],
        f: &[Force<S>],
    ) -> Vec<S> {
        let lambda: Vec<_> = some_forces(set.rows()).into_iter().map(S::splat).collect();
        let d = constrained_inverse_dynamics(model, data, set, q, v, a, &lambda, f);
        [d.tau, d.acceleration].concat()
    }
}

fn some_forces(rows: usize) -> Vec<f64> {
    (0..rows).map(|k| 3.0 * (1.0 + k as f64).sin()).collect()
}

const RESTITUTION: f64 = 0.3;

struct Impact;

impl Algorithm for Impact {
    fn run<S: Scalar>(
        model: &Model,
        data: &mut Data<S>,
        set: &mut ConstraintSet<S>,
        [q, v, _]: [&[S]; 3],
        _: &[Force<S>],
    ) -> Vec<S> {
        let d = impulse_dynamics(model, data, set, q, v, S::splat(RESTITUTION));
        [d.v, d.lambda].concat()
    }
}

/// Computes the derivatives with respect to q, v and τ by dual numbers.
fn by_duals<A: Algorithm>(
    model: &Model,
    s: &State,
    constraints: &[ContactConstraint],
    f_ext: &[Force<f64>],
) -> [DMatrix<f64>; 3] {
    let nv = model.nv();
    let mut data = Data::new(model);
    let mut set = ConstraintSet::<Dual64>::new(model, constraints).unwrap();
    let f = lift_forces(f_ext);
    let mut out = [(); 3].map(|()| DMatrix::zeros(nv + set.rows(), nv));
    for k in 0..nv {
        let e = unit(nv, k);
        let (q, v, tau) = (lift(&s.q), lift(&s.v), lift(&s.tau));
        let q_later = moved(model, &q, &dual(&vec![0.0; nv], &e));
        let (v_later, tau_later) = (dual(&s.v, &e), dual(&s.tau, &e));
        let inputs = [[&q_later[..], &v, &tau], [&q, &v_later, &tau], [&q, &v, &tau_later]];
        for (which, x) in inputs.into_iter().enumerate() {
            out[which].column_mut(k).copy_from_slice(&eps(&A::run(model, &mut data, &mut set, x, &f)));
        }
    }
    out
}

/// Computes the derivatives with respect to q, v and τ by central differences.
fn by_differences<A: Algorithm>(
    model: &Model,
    s: &State,
    constraints: &[ContactConstraint],
    f_ext: &[Force<f64>],
) -> [DMatrix<f64>; 3] {
    let nv = model.nv();
    let mut data = Data::new(model);
    let mut set = ConstraintSet::<f64>::new(model, constraints).unwrap();
    let mut out = [(); 3].map(|()| DMatrix::zeros(nv + set.rows(), nv));
    for k in 0..nv {
        let mut run = |which: usize, h: f64| {
            let d: Vec<f64> = unit(nv, k).iter().map(|e| e * h).collect();
            let add = |y: &[f64]| y.iter().zip(&d).map(|(y, d)| y + d).collect::<Vec<_>>();
            let (q, v, tau) = (moved(model, &s.q, &d), add(&s.v), add(&s.tau));
            let x = [[&q[..], &s.v, &s.tau], [&s.q, &v, &s.tau], [&s.q, &s.v, &tau]][which];
            DVector::from_vec(A::run(model, &mut data, &mut set, x, f_ext))
        };
        for (which, out) in out.iter_mut().enumerate() {
            out.set_column(k, &((run(which, STEP) - run(which, -STEP)) / (2.0 * STEP)));
        }
    }
    out
}

fn stack(above: &Matrix<f64>, below: &DenseMatrix<f64, impl Dense<f64>>) -> DMatrix<f64> {
    let mut out = above.clone().resize_vertically(above.nrows() + below.nrows(), 0.0);
    out.rows_mut(above.nrows(), below.nrows()).copy_from(below);
    out
}

#[test]
fn derivatives_of_constrained_dynamics() {
    let names = ["∂(q̈, λ)/∂q", "∂(q̈, λ)/∂v", "∂(q̈, λ)/∂τ"];
    let mut exact = names.map(|name| Worst::new(name, EXACT));
    let mut near = names.map(|name| Worst::new(name, DIFFERENCES));
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let serial = model.clone().with_limbs(false);
        for f_ext in [&[][..], &s.f_ext] {
            let value = constrained_dynamics(&serial, &mut data, &mut set, &s.q, &s.v, &s.tau, f_ext);
            let value = [value.a, value.lambda].concat();
            let d = constrained_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, f_ext);
            assert_eq!([d.a, d.lambda].concat(), value);
            let found = [stack(d.da_dq, d.dlambda_dq), stack(d.da_dv, d.dlambda_dv), stack(d.da_dtau, d.dlambda_dtau)];
            let duals = by_duals::<Dynamics>(&model, &s, &constraints, f_ext);
            let differences = by_differences::<Dynamics>(&model, &s, &constraints, f_ext);
            for k in 0..3 {
                exact[k].see(&model, found[k].as_slice(), duals[k].as_slice());
                near[k].see(&model, found[k].as_slice(), differences[k].as_slice());
            }
        }
    }
}

/// Checks the matrices M, J, r and c of the linearised equations: the derivatives by dual numbers must satisfy M δq̈ −
/// Jᵀ δλ + r = δτ and J δq̈ + c = 0.
#[test]
fn equations_of_constrained_dynamics() {
    let names = ["r, c for q", "r, c for v", "for τ"];
    let mut worst = names.map(|name| Worst::new(name, CONDITIONED));
    let mut known = Worst::new("where the motion is known", EXACT);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        for f_ext in [&[][..], &s.f_ext] {
            let (nv, rows) = (model.nv(), set.rows());
            let duals = by_duals::<Dynamics>(&model, &s, &constraints, f_ext);
            let d = constrained_dynamics_equations(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, f_ext);
            let motion = (d.a.to_vec(), d.lambda.to_vec());
            let nothing = DMatrix::zeros(nv + rows, nv);
            let blocks = [stack(d.dtau_dq, d.dgamma_dq), stack(d.dtau_dv, d.dgamma_dv), nothing];
            let matrices = [d.M, d.dtau_dq, d.dtau_dv, d.dgamma_dq, d.dgamma_dv].map(Matrix::clone);
            let mut K = DMatrix::zeros(nv + rows, nv + rows);
            K.view_mut((0, 0), (nv, nv)).copy_from(d.M);
            let mut J = DMatrix::zeros(rows, nv);
            set.jacobian(&mut J);
            K.view_mut((nv, 0), (rows, nv)).copy_from(&J);
            K.view_mut((0, nv), (nv, rows)).copy_from(&-J.transpose());
            let mut efforts = DMatrix::zeros(nv + rows, nv);
            efforts.fill_diagonal(1.0);
            for k in 0..3 {
                let expected = if k < 2 { -(&K * &duals[k]) } else { efforts.clone() - &K * &duals[k] };
                worst[k].see(&model, blocks[k].as_slice(), expected.as_slice());
            }
            if f_ext.is_empty() {
                let (other, s) = (&mut Data::new(&model), &s);
                let d = constrained_equations_at(&model, other, &mut set, &s.q, &s.v, &motion.0, &motion.1);
                let at = [d.M, d.dtau_dq, d.dtau_dv, d.dgamma_dq, d.dgamma_dv];
                at.into_iter()
                    .zip(&matrices)
                    .for_each(|(at, there)| known.see(&model, at.as_slice(), there.as_slice()));
                let mut again = DMatrix::zeros(rows, nv);
                set.jacobian(&mut again);
                known.see(&model, again.as_slice(), J.as_slice());
            }
        }
    }
}

/// Checks that derivatives of constrained inverse dynamics are exact for any accelerations and forces. The values are M
/// q̈ + h − Jᵀ λ and J q̈ + γ.
#[test]
fn derivatives_of_constrained_inverse_dynamics() {
    let names = ["∂(τ, J q̈ + γ)/∂q", "∂(τ, J q̈ + γ)/∂v", "∂(τ, J q̈ + γ)/∂q̈"];
    let mut exact = names.map(|name| Worst::new(name, EXACT));
    let mut near = names.map(|name| Worst::new(name, DIFFERENCES));
    let mut back = Worst::new("τ of q̈ and λ that follow from τ", CONDITIONED);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let lambda = some_forces(set.rows());
        for f_ext in [&[][..], &s.f_ext] {
            let value = constrained_inverse_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &lambda, f_ext);
            let value = [value.tau, value.acceleration].concat();
            let d = constrained_inverse_dynamics_derivatives(
                &model, &mut data, &mut set, &s.q, &s.v, &s.tau, &lambda, f_ext,
            );
            exact[2].see(&model, &[d.tau, d.acceleration].concat(), &value);
            let (by_q, by_v) = (stack(d.dtau_dq, d.dacceleration_dq), stack(d.dtau_dv, d.dacceleration_dv));
            let (M, mut J) = (d.M.clone(), DMatrix::zeros(lambda.len(), model.nv()));
            set.jacobian(&mut J);
            let found = [by_q, by_v, stack(&M, &J)];
            let duals = by_duals::<Inverse>(&model, &s, &constraints, f_ext);
            let differences = by_differences::<Inverse>(&model, &s, &constraints, f_ext);
            for k in 0..3 {
                exact[k].see(&model, found[k].as_slice(), duals[k].as_slice());
                near[k].see(&model, found[k].as_slice(), differences[k].as_slice());
            }
            let d = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, f_ext);
            let (a, lambda) = (d.a.to_vec(), d.lambda.to_vec());
            let d = constrained_inverse_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &a, &lambda, f_ext);
            let expected = [&s.tau[..], &vec![0.0; lambda.len()]].concat();
            back.see(&model, &[d.tau, d.acceleration].concat(), &expected);
        }
    }
}

#[test]
fn derivatives_of_impulse_dynamics() {
    let names = ["∂(v⁺, Λ)/∂q", "∂(v⁺, Λ)/∂v"];
    let mut exact = names.map(|name| Worst::new(name, EXACT));
    let mut near = names.map(|name| Worst::new(name, DIFFERENCES));
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let d = impulse_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, RESTITUTION);
        let found = [stack(d.dv_dq, d.dlambda_dq), stack(d.dv_dv, d.dlambda_dv)];
        let duals = by_duals::<Impact>(&model, &s, &constraints, &[]);
        let differences = by_differences::<Impact>(&model, &s, &constraints, &[]);
        for k in 0..2 {
            exact[k].see(&model, found[k].as_slice(), duals[k].as_slice());
            near[k].see(&model, found[k].as_slice(), differences[k].as_slice());
        }
    }
}

/// Checks that the returned blocks form K⁻¹, the inverse of the whole matrix K of constrained dynamics: K K⁻¹ = 1.
#[test]
fn inverse_of_the_whole_matrix() {
    let mut worst = Worst::new("K K⁻¹ − 1", CONDITIONED);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let d = constrained_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]);
        let (P, inertia, dlambda_dtau) = (d.da_dtau.clone(), d.inertia.clone(), d.dlambda_dtau.clone());
        let (nv, rows) = (model.nv(), set.rows());
        let (mut K, mut inverse) = (DMatrix::zeros(nv + rows, nv + rows), DMatrix::zeros(nv + rows, nv + rows));
        let mut J = DMatrix::zeros(rows, nv);
        set.jacobian(&mut J);
        K.view_mut((0, 0), (nv, nv)).copy_from(crba(&model, &mut data, &s.q));
        K.view_mut((nv, 0), (rows, nv)).copy_from(&J);
        K.view_mut((0, nv), (nv, rows)).copy_from(&J.transpose());
        inverse.view_mut((0, 0), (nv, nv)).copy_from(&P);
        inverse.view_mut((nv, 0), (rows, nv)).copy_from(&-&dlambda_dtau);
        inverse.view_mut((0, nv), (nv, rows)).copy_from(&-dlambda_dtau.transpose());
        inverse.view_mut((nv, nv), (rows, rows)).copy_from(&-inertia);
        worst.see(&model, (K * inverse).as_slice(), DMatrix::identity(nv + rows, nv + rows).as_slice());
    }
}

/// Checks that all derivatives are exact with redundant rows. The forces of redundant rows are zero also at
/// neighbouring states.
#[test]
fn redundant_constraints() {
    let mut exact = Worst::new("redundant constraints", EXACT);
    for (model, s, constraints) in cases(TREES) {
        let Some(&first) = constraints.first() else { continue };
        let body = |frame: usize| model.frames()[frame].body;
        let twin = (0..model.frames().len()).find(|&f| f != first.frame && body(f) == body(first.frame));
        let Some(frame) = twin else { continue };
        let twice: Vec<_> = constraints.into_iter().chain([ContactConstraint { frame, ..first }]).collect();
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &twice).unwrap();
        let d = constrained_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]);
        let found = [stack(d.da_dq, d.dlambda_dq), stack(d.da_dv, d.dlambda_dv), stack(d.da_dtau, d.dlambda_dtau)];
        let duals = by_duals::<Dynamics>(&model, &s, &twice, &[]);
        for k in 0..3 {
            exact.see(&model, found[k].as_slice(), duals[k].as_slice());
        }
    }
}
