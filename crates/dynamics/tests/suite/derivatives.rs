//! Tests of analytical derivatives. The results are compared with dual numbers and with finite differences.

use crate::common;

use common::{State, Worst, all_models, dual, eps, lift, lift_forces, moved, rng, unit};
use condyle_dynamics::{Data, Force, Inertia, Model, Scalar, aba, aba_derivatives, crba, minv, rnea, rnea_derivatives};
use nalgebra::DMatrix;
use num_dual::{Dual, Dual64};

/// Tolerance between two exact methods with some thousand rounding errors each. For forward dynamics, the tolerance
/// includes the condition number of M.
const EXACT: f64 = 1e-11;
/// Tolerance for long chains. The condition number of M grows with the cube of a chain's length: it is 1e7 for 90
/// links. Since the error is relative to the largest entries, most of this growth cancels.
const LONG: f64 = 1e-9;
/// Tolerance of central differences. The error of a difference is a rounding error of 1e-16 / step, plus step² times a
/// third derivative.
const DIFFERENCES: f64 = 1e-6;
const STEP: f64 = 1e-5;
const TREES: u64 = 15;

/// Algorithm as a function of position, velocity and a third vector (acceleration or effort). It is called with and
/// without external forces.
trait Algorithm {
    fn run<S: Scalar>(&self, model: &Model, data: &mut Data<S>, q: &[S], v: &[S], x: &[S], f: &[Force<S>]) -> Vec<S>;
}

struct Rnea;

impl Algorithm for Rnea {
    fn run<S: Scalar>(&self, model: &Model, data: &mut Data<S>, q: &[S], v: &[S], x: &[S], f: &[Force<S>]) -> Vec<S> {
        rnea(model, data, q, v, x, f).to_vec()
    }
}

struct Aba;

impl Algorithm for Aba {
    fn run<S: Scalar>(&self, model: &Model, data: &mut Data<S>, q: &[S], v: &[S], x: &[S], f: &[Force<S>]) -> Vec<S> {
        aba(model, data, q, v, x, f).to_vec()
    }
}

/// Computes the derivatives with respect to q, v and x by dual numbers.
fn by_duals(
    algorithm: &impl Algorithm,
    model: &Model,
    s: &State,
    x: &[f64],
    f_ext: &[Force<f64>],
) -> [DMatrix<f64>; 3] {
    let nv = model.nv();
    let mut data = Data::<Dual64>::new(model);
    let f = lift_forces(f_ext);
    let mut out = [(); 3].map(|()| DMatrix::zeros(nv, nv));
    for k in 0..nv {
        let e = unit(nv, k);
        let q = moved(model, &lift(&s.q), &dual(&vec![0.0; nv], &e));
        out[0].column_mut(k).copy_from_slice(&eps(&algorithm.run(model, &mut data, &q, &lift(&s.v), &lift(x), &f)));
        let q = lift(&s.q);
        out[1].column_mut(k).copy_from_slice(&eps(&algorithm.run(model, &mut data, &q, &dual(&s.v, &e), &lift(x), &f)));
        out[2].column_mut(k).copy_from_slice(&eps(&algorithm.run(model, &mut data, &q, &lift(&s.v), &dual(x, &e), &f)));
    }
    out
}

/// Computes the derivatives with respect to q, v and x by central differences.
fn by_differences(
    algorithm: &impl Algorithm,
    model: &Model,
    s: &State,
    x: &[f64],
    f_ext: &[Force<f64>],
) -> [DMatrix<f64>; 3] {
    let nv = model.nv();
    let mut data = Data::<f64>::new(model);
    let mut out = [(); 3].map(|()| DMatrix::zeros(nv, nv));
    for k in 0..nv {
        let mut run = |which: usize, h: f64| {
            let d: Vec<f64> = unit(nv, k).iter().map(|e| e * h).collect();
            let add =
                |y: &[f64], on: bool| y.iter().zip(&d).map(|(y, d)| if on { y + d } else { *y }).collect::<Vec<_>>();
            let q = if which == 0 { moved(model, &s.q, &d) } else { s.q.clone() };
            algorithm.run(model, &mut data, &q, &add(&s.v, which == 1), &add(x, which == 2), f_ext)
        };
        for which in 0..3 {
            let (plus, minus) = (run(which, STEP), run(which, -STEP));
            for i in 0..nv {
                out[which][(i, k)] = (plus[i] - minus[i]) / (2.0 * STEP);
            }
        }
    }
    out
}

#[test]
fn inverse_dynamics() {
    let names = ["∂τ/∂q", "∂τ/∂v", "∂τ/∂a"];
    let mut exact = names.map(|name| Worst::new(name, EXACT));
    let mut near = names.map(|name| Worst::new(name, DIFFERENCES));
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        for f_ext in [&[][..], &state.f_ext] {
            let d = rnea_derivatives(model, &mut data, &state.q, &state.v, &state.a, f_ext);
            let found = [d.dtau_dq, d.dtau_dv, d.dtau_da];
            let duals = by_duals(&Rnea, model, &state, &state.a, f_ext);
            let differences = by_differences(&Rnea, model, &state, &state.a, f_ext);
            for k in 0..3 {
                exact[k].see(model, found[k].as_slice(), duals[k].as_slice());
                near[k].see(model, found[k].as_slice(), differences[k].as_slice());
            }
            let M = found[2].clone();
            exact[2].see(model, M.as_slice(), crba(model, &mut data, &state.q).as_slice());
        }
    }
}

/// Checks derivatives on long branches. There the library computes several columns at the same time, and M⁻¹ ∂τ without
/// a matrix product.
#[test]
fn long_branches() {
    let mut exact = Worst::new("∂τ of long branches", EXACT);
    let mut solved = Worst::new("∂q̈ of long branches", LONG);
    for (seed, model) in common::long_branches().iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let d = rnea_derivatives(model, &mut data, &s.q, &s.v, &s.a, &s.f_ext);
        for (found, expected) in
            [d.dtau_dq, d.dtau_dv, d.dtau_da].into_iter().zip(by_duals(&Rnea, model, &s, &s.a, &s.f_ext))
        {
            exact.see(model, found.as_slice(), expected.as_slice());
        }
        let d = aba_derivatives(model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext);
        for (found, expected) in
            [d.da_dq, d.da_dv, d.da_dtau].into_iter().zip(by_duals(&Aba, model, &s, &s.tau, &s.f_ext))
        {
            solved.see(model, found.as_slice(), expected.as_slice());
        }
    }
}

#[test]
fn forward_dynamics() {
    let names = ["∂q̈/∂q", "∂q̈/∂v", "∂q̈/∂τ"];
    let mut exact = names.map(|name| Worst::new(name, EXACT));
    let mut near = names.map(|name| Worst::new(name, DIFFERENCES));
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        for f_ext in [&[][..], &state.f_ext] {
            let qdd = aba(model, &mut data, &state.q, &state.v, &state.tau, f_ext).to_vec();
            let d = aba_derivatives(model, &mut data, &state.q, &state.v, &state.tau, f_ext);
            assert_eq!(d.a, qdd);
            let found = [d.da_dq, d.da_dv, d.da_dtau];
            let duals = by_duals(&Aba, model, &state, &state.tau, f_ext);
            let differences = by_differences(&Aba, model, &state, &state.tau, f_ext);
            for k in 0..3 {
                exact[k].see(model, found[k].as_slice(), duals[k].as_slice());
                near[k].see(model, found[k].as_slice(), differences[k].as_slice());
            }
            let M_inverse = found[2].clone();
            assert_eq!(&M_inverse, minv(model, &mut data, &state.q));
        }
    }
}

/// Checks ∂²τ/∂q∂q by nested dual numbers, and by the analytical derivatives on dual numbers.
#[test]
fn second_derivatives() {
    let mut worst = Worst::new("∂²τ/∂q²", EXACT);
    for (seed, model) in all_models(4).iter().enumerate() {
        let nv = model.nv();
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let (j, k) = (seed % nv, (3 * seed + 1) % nv);
        let still = vec![0.0; nv];
        // Move first along j with the inner dual numbers, and then from there along k with the outer dual numbers.
        let inner = moved(model, &lift(&q), &dual(&still, &unit(nv, j)));
        let mut data = Data::<Dual64>::new(model);
        let derivative = rnea_derivatives(model, &mut data, &inner, &lift(&v), &lift(&a), &[]).dtau_dq;
        let by_hand = eps(derivative.column(k).as_slice());
        let q: Vec<Dual<Dual64>> = inner.iter().map(|&q| Dual::new(q, Dual64::splat(0.0))).collect();
        let step: Vec<Dual<Dual64>> = unit(nv, k).iter().map(|&e| Dual::new(0.0.into(), Dual64::splat(e))).collect();
        let mut data = Data::<Dual<Dual64>>::new(model);
        let tau = rnea(model, &mut data, &moved(model, &q, &step), &lift(&v), &lift(&a), &[]);
        let nested: Vec<f64> = tau.iter().map(|tau| tau.eps.eps).collect();
        worst.see(model, &by_hand, &nested);
    }
}

/// Checks derivatives with respect to a mass. τ is linear in the inertial parameters, so a difference quotient with a
/// step of 1 kg is exact.
#[test]
fn with_respect_to_a_mass() {
    let mut efforts = Worst::new("∂τ/∂m", EXACT);
    let mut accelerations = Worst::new("∂q̈/∂m = −M⁻¹ ∂τ/∂m", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, tau, f_ext, .. } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let a = aba(model, &mut data, &q, &v, &tau, &f_ext).to_vec();
        let before = rnea(model, &mut data, &q, &v, &a, &f_ext).to_vec();
        let M_inverse = minv(model, &mut data, &q).clone();
        for heavy in 1..model.bodies().len() {
            let add = |i: usize, I: Inertia<f64>| Inertia { mass: I.mass + f64::from(u8::from(i == heavy)), ..I };
            let heavier = model.with_inertias(add).unwrap();
            let after = rnea(&heavier, &mut data, &q, &v, &a, &f_ext).to_vec();
            let quotient: Vec<f64> = after.iter().zip(&before).map(|(after, before)| after - before).collect();
            let seeded = model
                .with_inertias(|i, I| Inertia {
                    mass: Dual64::new(I.mass, f64::from(u8::from(i == heavy))),
                    ..I.lift::<Dual64>()
                })
                .unwrap();
            let (q, v, f) = (lift(&q), lift(&v), lift_forces(&f_ext));
            let mut data = Data::new(&seeded);
            let derivative = eps(rnea(&seeded, &mut data, &q, &v, &lift(&a), &f));
            efforts.see(model, &derivative, &quotient);
            let expected = -&M_inverse * nalgebra::DVector::from_column_slice(&derivative);
            let found = eps(aba(&seeded, &mut data, &q, &v, &lift(&tau), &f));
            accelerations.see(model, &found, expected.as_slice());
        }
    }
}
