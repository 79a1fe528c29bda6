//! Checks of the derivatives of inverse and forward dynamics against dual numbers and central differences.
//!
//! RNEA inverts forward dynamics: rnea(q, v, q̈(q, v, τ)) = τ. So the derivatives of forward dynamics follow from the
//! derivatives of RNEA at q̈, and dual numbers are needed only for RNEA.

use super::identities::{SOLVES, inverted, spectrum};
use super::ledger::Row;
use crate::states::States;
use condyle::{Data, Model, aba, aba_derivatives, crba, integrate, rnea, rnea_derivatives, spatial::Matrix};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Bound for the difference of two results that have only rounding errors.
const ROUNDING: f64 = 1e-10;
/// Bound for the error of a central difference with step 1e-6.
const DIFFERENCE: f64 = 1e-5;
/// Allowed error of a central difference, divided by the difference between the results with the steps h and 2h. If h
/// is too long, the error is a third of this difference. If h is too short, the error is less than this difference.
const UNCERTAIN: f64 = 10.0;
const STEP: f64 = 1e-6;

/// Variable with respect to which a function is differentiated.
#[derive(Clone, Copy)]
enum By {
    Position,
    Velocity,
    /// Third argument of the function: accelerations for RNEA, efforts for ABA.
    Input,
}

/// Function under test.
#[derive(Clone, Copy)]
enum Function {
    Rnea,
    Aba,
}

/// State and third argument of the function under test.
type State<'a> = [&'a [f64]; 3];

pub(super) fn check(model: &Model, states: usize, seed: u64) -> Vec<Row> {
    let names = |function| match function {
        Function::Rnea => ["∂τ/∂q", "∂τ/∂v", "∂τ/∂a"],
        Function::Aba => ["∂q̈/∂q", "∂q̈/∂v", "∂q̈/∂τ"],
    };
    let make = |function| {
        let (exact, relations) = match function {
            Function::Rnea => ("both exact except for rounding", ["analytical = dual numbers"; 3]),
            Function::Aba => (
                SOLVES,
                [
                    "M ∂q̈/∂q = −∂τ/∂q by dual numbers",
                    "M ∂q̈/∂v = −∂τ/∂v by dual numbers",
                    "M ∂q̈/∂τ = 1, M by dual numbers",
                ],
            ),
        };
        let steps = "step 1e-6, or the difference between steps h and 2h";
        let names = names(function);
        let dual = core::array::from_fn(|i| Row::new(names[i], relations[i], exact));
        let difference = names.map(|name| Row::new(name, "analytical = central differences", steps));
        [dual, difference]
    };
    let (mut data, mut duals) = (Data::new(model), Data::<Dual64>::new(model));
    let (all, nv) = (States::new(model, states, seed), model.nv());
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
            let a = match function {
                Function::Rnea => a.to_vec(),
                Function::Aba => aba(model, &mut data, q, v, tau, &[]).to_vec(),
            };
            let variables = [By::Position, By::Velocity, By::Input];
            let dtau = variables.map(|by| by_duals(by, model, &mut duals, [q, v, &a]));
            for (i, by) in variables.into_iter().enumerate() {
                match function {
                    Function::Rnea => dual[i].compare(analytical[i].as_slice(), dtau[i].as_slice(), 0.0, bound),
                    Function::Aba => {
                        let M = &dtau[2];
                        let (found, parts) = (M * &analytical[i], (M.abs() * analytical[i].abs()).amax());
                        let expected = if i == 2 { DMatrix::identity(nv, nv) } else { -&dtau[i] };
                        dual[i].compare(found.as_slice(), expected.as_slice(), parts, bound);
                    }
                }
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

/// Returns the derivatives of RNEA by dual numbers. For q, column k is the ε part of rnea(q ⊕ ε δ, v, q̈), where δ is
/// unit vector k. For v and q̈, ε δ is added to v or to q̈ instead.
fn by_duals(by: By, model: &Model, data: &mut Data<Dual64>, [q, v, x]: State) -> DMatrix<f64> {
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
        let result = rnea(model, data, &at[0], &at[1], &at[2], &[]);
        J.column_mut(k).iter_mut().zip(result).for_each(|(J, x)| *J = x.eps);
    }
    J
}

/// Returns the derivatives of a function f by central differences. For q, column k is (f(q ⊕ h δ, v, x) − f(q ⊕ (−h δ),
/// v, x)) / 2h, where h is the step and δ is unit vector k. For v and x, h δ is added to v or to x instead.
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
