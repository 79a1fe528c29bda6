//! Tests of analytical second derivatives. The results are compared with hyper-dual numbers and with each other.

use crate::common;

use common::{State, Worst, all_models, lift, lift_forces, moved, rng};
use condyle_dynamics::{
    Data, Force, Model, RneaSecondDerivatives, aba, aba_derivatives, aba_hessian, rnea, rnea_derivatives, rnea_hessian,
    rnea_second_derivatives,
};
use nalgebra::{DMatrix, DVector};
use num_dual::HyperDual64;

/// Tolerance between two exact methods with some thousand rounding errors each. For forward dynamics, the tolerance
/// includes the condition number of M.
const EXACT: f64 = 1e-11;
const TREES: u64 = 5;

/// Function φ that returns λᵀ times the result of an algorithm at (q, v, x), where x is an acceleration or an effort.
type Phi = fn(&Model, &mut Data<HyperDual64>, [&[HyperDual64]; 3], &[Force<HyperDual64>], &[f64]) -> HyperDual64;

fn dot(x: &[HyperDual64], lambda: &[f64]) -> HyperDual64 {
    x.iter().zip(lambda).map(|(&x, &l)| x * l).sum()
}

/// Computes a block of second derivatives of φ with respect to two arguments, whose indices are `blocks`. Each of the
/// two dual parts of a number carries one direction.
fn by_hyper_duals(
    phi: Phi,
    model: &Model,
    at: [&[f64]; 3],
    f_ext: &[Force<f64>],
    lambda: &[f64],
    blocks: [usize; 2],
) -> DMatrix<f64> {
    let nv = model.nv();
    let mut data = Data::<HyperDual64>::new(model);
    let f_ext = lift_forces(f_ext);
    DMatrix::from_fn(nv, nv, |j, k| {
        let step = |argument: usize| -> Vec<HyperDual64> {
            let part = |side: usize, of: usize, i: usize| f64::from(u8::from(blocks[side] == argument && of == i));
            (0..nv).map(|i| HyperDual64::new(0.0, part(0, j, i), part(1, k, i), 0.0)).collect()
        };
        let shifted = |argument: usize| -> Vec<HyperDual64> {
            at[argument].iter().zip(step(argument)).map(|(&x, d)| d + x).collect()
        };
        let q = moved(model, &lift(at[0]), &step(0));
        phi(model, &mut data, [&q, &shifted(1), &shifted(2)], &f_ext, lambda).eps1eps2
    })
}

#[test]
fn inverse_dynamics() {
    let names = ["λᵀ∂²τ/∂q∂q", "λᵀ∂²τ/∂v∂q", "λᵀ∂²τ/∂v∂v", "λᵀ∂²τ/∂a∂q"];
    let mut worst = names.map(|name| Worst::new(name, EXACT));
    let phi: Phi = |m, d, [q, v, a], f, lambda| dot(rnea(m, d, q, v, a, f), lambda);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, a, tau: lambda, f_ext } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let serial = model.clone().with_limbs(false); // computes the sums in the same order as hyper-dual numbers
        for f in [&[][..], &f_ext] {
            let first = rnea_derivatives(&serial, &mut data, &q, &v, &a, f).dtau_dq.clone();
            let hessian = rnea_hessian(model, &mut data, &q, &v, &a, f, &lambda);
            assert_eq!(hessian.first.dtau_dq, &first);
            let found = [hessian.dqdq, hessian.dvdq, hessian.dvdv, hessian.dadq];
            for (k, blocks) in [[0, 0], [1, 0], [1, 1], [2, 0]].into_iter().enumerate() {
                let expected = by_hyper_duals(phi, model, [&q, &v, &a], f, &lambda, blocks);
                worst[k].see(model, found[k].as_slice(), expected.as_slice());
            }
        }
    }
}

#[test]
fn forward_dynamics() {
    let names = ["λᵀ∂²q̈/∂q∂q", "λᵀ∂²q̈/∂v∂q", "λᵀ∂²q̈/∂v∂v", "λᵀ∂²q̈/∂τ∂q"];
    let mut worst = names.map(|name| Worst::new(name, EXACT));
    let phi: Phi = |m, d, [q, v, tau], f, lambda| dot(aba(m, d, q, v, tau, f), lambda);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, tau, a: lambda, f_ext } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let serial = model.clone().with_limbs(false); // computes the sums in the same order as hyper-dual numbers
        let first = aba_derivatives(&serial, &mut data, &q, &v, &tau, &f_ext).da_dq.clone();
        let hessian = aba_hessian(model, &mut data, &q, &v, &tau, &f_ext, &lambda);
        assert_eq!(hessian.first.da_dq, &first);
        let found = [hessian.dqdq, hessian.dvdq, hessian.dvdv, hessian.dtaudq];
        for (k, blocks) in [[0, 0], [1, 0], [1, 1], [2, 0]].into_iter().enumerate() {
            let expected = by_hyper_duals(phi, model, [&q, &v, &tau], &f_ext, &lambda, blocks);
            worst[k].see(model, found[k].as_slice(), expected.as_slice());
        }
    }
}

/// Checks that the tensors of second derivatives, contracted with λ, equal the Hessian of λᵀ τ.
#[test]
fn tensors() {
    let mut worst = Worst::new("Σ λ_i ∂²τ_i", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let nv = model.nv();
        let State { q, v, a, tau: lambda, f_ext } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let mut tensors = RneaSecondDerivatives::new(model);
        rnea_second_derivatives(model, &mut data, &q, &v, &a, &f_ext, &mut tensors);
        let contract = |tensor: &[DMatrix<f64>]| {
            tensor.iter().zip(&lambda).fold(DMatrix::zeros(nv, nv), |sum, (T, &l)| sum + T * l)
        };
        let found = [&tensors.dqdq, &tensors.dvdq, &tensors.dvdv, &tensors.dadq].map(|t| contract(t));
        let hessian = rnea_hessian(model, &mut data, &q, &v, &a, &f_ext, &lambda);
        let expected = [hessian.dqdq, hessian.dvdq, hessian.dvdv, hessian.dadq];
        for (found, expected) in found.iter().zip(expected) {
            worst.see(model, found.as_slice(), expected.as_slice());
        }
    }
}

/// Checks the Taylor expansion of ψ = λᵀ aba for a step h, ψ(x + h) = ψ + ∇ψ h + ½ hᵀ∇²ψ h + O(h³): the error must fall
/// with the cube of the step.
#[test]
fn expansion() {
    const STEPS: [f64; 2] = [2e-3, 1e-3];
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let (mut rng, nv) = (rng(seed as u64), model.nv());
        let State { q, v, tau, a: lambda, f_ext } = State::random(model, &mut rng);
        let step = State::random(model, &mut rng);
        let [dq, dv, dtau] = [step.v, step.a, step.tau].map(|x| DVector::from(x).normalize());
        let mut data = Data::new(model);
        let lambda = DVector::from(lambda);
        let h = aba_hessian(model, &mut data, &q, &v, &tau, &f_ext, lambda.as_slice());
        let value = lambda.dot(&DVector::from_row_slice(h.first.a));
        let slope = lambda.dot(&(h.first.da_dq * &dq + h.first.da_dv * &dv + h.first.da_dtau * &dtau));
        let by_q = h.dqdq * &dq * 0.5;
        let curvature = dq.dot(&by_q) + dv.dot(&(h.dvdq * &dq + h.dvdv * &dv * 0.5)) + dtau.dot(&(h.dtaudq * &dq));
        let errors = STEPS.map(|s| {
            let q = moved(model, &q, (&dq * s).as_slice());
            let add = |x: &[f64], d: &DVector<f64>| (0..nv).map(|i| x[i] + s * d[i]).collect::<Vec<_>>();
            let a = aba(model, &mut data, &q, &add(&v, &dv), &add(&tau, &dtau), &f_ext);
            let there = lambda.dot(&DVector::from_row_slice(a));
            (there - value - s * slope - s * s * curvature).abs()
        });
        let rounding = 1e-12 * (1.0 + value.abs());
        assert!(errors[1] < errors[0] / 5.0 + rounding, "a cube falls by 8, this by {errors:?} on\n{model}");
    }
}
