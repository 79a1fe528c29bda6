//! The derivatives of inverse and forward dynamics against dual numbers and against central differences.

use super::identities::{SOLVES, inverted, spectrum};
use super::ledger::Row;
use crate::states::States;
use condyle::{Data, Matrix, Model, aba, aba_derivatives, crba, integrate, rnea, rnea_derivatives};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

/// Both are exact but for rounding.
const ROUNDING: f64 = 1e-10;
/// A central difference of step 1e-6.
const DIFFERENCE: f64 = 1e-5;
/// How much more than what steps of h and 2h differ by a difference may be off: a third of it if the step is too long, some
/// of it if it is too short.
const UNCERTAIN: f64 = 10.0;
const STEP: f64 = 1e-6;

/// The variables.
#[derive(Clone, Copy)]
enum By {
    Position,
    Velocity,
    /// The third argument: accelerations of RNEA, efforts of ABA.
    Input,
}

/// RNEA or ABA.
#[derive(Clone, Copy)]
enum Function {
    Rnea,
    Aba,
}

/// A state with its input.
type State<'a> = [&'a [f64]; 3];

pub(super) fn check(model: &Model, states: usize, seed: u64) -> Vec<Row> {
    let names = |function| match function {
        Function::Rnea => ["∂τ/∂q", "∂τ/∂v", "∂τ/∂a"],
        Function::Aba => ["∂q̈/∂q", "∂q̈/∂v", "∂q̈/∂τ"],
    };
    let make = |function| {
        let exact = match function {
            Function::Rnea => "both exact but for rounding",
            Function::Aba => SOLVES,
        };
        let steps = "a step of 1e-6, or what steps of h and 2h differ by";
        let dual = names(function).map(|name| Row::new(name, "analytical = dual numbers", exact));
        let difference = names(function).map(|name| Row::new(name, "analytical = central differences", steps));
        [dual, difference]
    };
    let (mut data, mut duals) = (Data::new(model), Data::<Dual64>::new(model));
    let all = States::new(model, states, seed);
    let mut rows = Vec::new();
    for function in [Function::Rnea, Function::Aba] {
        let [mut dual, mut difference] = make(function);
        for k in 0..states {
            let [q, v, a, tau] = all.at(model, k);
            let (_, condition) = spectrum(crba(model, &mut data, q));
            let (state, bound) = match function {
                Function::Rnea => ([q, v, a], ROUNDING),
                Function::Aba => ([q, v, tau], inverted(condition)),
            };
            let analytical = analytical(function, model, &mut data, state);
            let parts = match function {
                Function::Rnea => [0.0; 3],
                Function::Aba => parts(model, &mut data, state, &analytical[2]),
            };
            for (i, by) in [By::Position, By::Velocity, By::Input].into_iter().enumerate() {
                let expected = by_duals(function, by, model, &mut duals, state);
                dual[i].compare(analytical[i].as_slice(), expected.as_slice(), parts[i], bound);
                let [expected, longer] =
                    [STEP, 2.0 * STEP].map(|h| by_differences(function, by, model, &mut data, state, h));
                let uncertain = UNCERTAIN * (&longer - &expected).amax() / (1.0 + expected.amax());
                difference[i].compare(analytical[i].as_slice(), expected.as_slice(), 0.0, DIFFERENCE.max(uncertain));
            }
        }
        rows.extend(dual);
        rows.extend(difference);
    }
    rows
}

/// The numbers of which ∂q̈/∂q = −M⁻¹ ∂τ/∂q (at q̈) and ∂q̈/∂v are the sums: |M⁻¹| |∂τ/∂q|, |M⁻¹| |∂τ/∂v|, and |M⁻¹| |M| |q̈|,
/// whose terms cancel in ∂τ/∂q where a whole robot turns; M⁻¹ is ∂q̈/∂τ.
fn parts(model: &Model, data: &mut Data<f64>, [q, v, tau]: State, M_inverse: &DMatrix<f64>) -> [f64; 3] {
    let qdd = aba(model, data, q, v, tau, &[]).to_vec();
    let d = rnea_derivatives(model, data, q, v, &qdd, &[]);
    let [by_q, by_v] = [d.dtau_dq, d.dtau_dv].map(|d| (M_inverse.abs() * d.abs()).amax());
    let M = crba(model, data, q).abs();
    let inertial = (M_inverse.abs() * M * DVector::from_column_slice(&qdd).abs()).amax();
    [by_q.max(inertial), by_v, 0.0]
}

fn analytical(function: Function, model: &Model, data: &mut Data<f64>, [q, v, x]: State) -> [DMatrix<f64>; 3] {
    match function {
        Function::Rnea => {
            let d = rnea_derivatives(model, data, q, v, x, &[]);
            [d.dtau_dq, d.dtau_dv, d.dtau_da].map(Matrix::clone_owned)
        }
        Function::Aba => {
            let d = aba_derivatives(model, data, q, v, x, &[]);
            [d.da_dq, d.da_dv, d.da_dtau].map(Matrix::clone_owned)
        }
    }
}

/// A column for each variable: the ε of f(q ⊕ ε δ, …).
fn by_duals(function: Function, by: By, model: &Model, data: &mut Data<Dual64>, [q, v, x]: State) -> DMatrix<f64> {
    let nv = model.nv();
    let mut J = DMatrix::zeros(nv, nv);
    for k in 0..nv {
        let mut at = [q, v, x].map(|x| x.iter().map(|&x| Dual64::from(x)).collect::<Vec<_>>());
        match by {
            By::Position => {
                let mut way = vec![Dual64::from(0.0); nv];
                way[k].eps = 1.0;
                let from = at[0].clone();
                integrate(model, &from, &way, &mut at[0]);
            }
            By::Velocity => at[1][k].eps = 1.0,
            By::Input => at[2][k].eps = 1.0,
        }
        let result = match function {
            Function::Rnea => rnea(model, data, &at[0], &at[1], &at[2], &[]),
            Function::Aba => aba(model, data, &at[0], &at[1], &at[2], &[]),
        };
        J.column_mut(k).iter_mut().zip(result).for_each(|(J, x)| *J = x.eps);
    }
    J
}

/// A column for each variable: (f(q ⊕ h δ, …) − f(q ⊖ h δ, …)) / 2h.
fn by_differences(
    function: Function,
    by: By,
    model: &Model,
    data: &mut Data<f64>,
    [q, v, x]: State,
    step: f64,
) -> DMatrix<f64> {
    let nv = model.nv();
    let mut J = DMatrix::zeros(nv, nv);
    for k in 0..nv {
        let mut value = |h: f64| {
            let mut at = [q, v, x].map(<[f64]>::to_vec);
            match by {
                By::Position => {
                    let mut way = vec![0.0; nv];
                    way[k] = h;
                    integrate(model, q, &way, &mut at[0]);
                }
                By::Velocity => at[1][k] += h,
                By::Input => at[2][k] += h,
            }
            match function {
                Function::Rnea => rnea(model, data, &at[0], &at[1], &at[2], &[]).to_vec(),
                Function::Aba => aba(model, data, &at[0], &at[1], &at[2], &[]).to_vec(),
            }
        };
        let (more, less) = (value(step), value(-step));
        let slope = more.iter().zip(&less).map(|(x, y)| (x - y) / (2.0 * step));
        J.column_mut(k).iter_mut().zip(slope).for_each(|(J, x)| *J = x);
    }
    J
}
