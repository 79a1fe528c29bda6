//! Tests of derivatives by dual numbers in lanes, one direction per lane. The results are compared with the analytical
//! derivatives.

use crate::common::table::Input;
use crate::common::{Worst, rng};
use crate::{each_level, models};
use condyle_dynamics::{
    Data, Force, LaneJacobian, Matrix, Model, Scalar, StateFunction, aba, aba_derivatives, rnea, rnea_derivatives,
};

/// Tolerance between two exact methods with some thousand rounding errors each. For forward dynamics, the tolerance
/// includes the condition number of M.
const EXACT: f64 = 1e-11;
const TREES: u64 = 5;

/// Function `rnea` or `aba` of the concatenated arguments (q, v, x).
struct Dynamics<'m> {
    model: &'m Model,
    f_ext: &'m [Force<f64>],
    forward: bool,
}

impl StateFunction for Dynamics<'_> {
    fn len(&self) -> usize {
        self.model.nv()
    }
    fn call<S: Scalar>(&mut self, data: &mut Data<S>, x: &[S], y: &mut [S]) {
        let (q, rest) = x.split_at(self.model.nq());
        let (v, x) = rest.split_at(self.model.nv());
        let lift = |f: &Force<f64>| Force::from(f.to_array().map(S::splat));
        let f_ext: Vec<_> = self.f_ext.iter().map(lift).collect();
        let of =
            if self.forward { aba(self.model, data, q, v, x, &f_ext) } else { rnea(self.model, data, q, v, x, &f_ext) };
        y.copy_from_slice(of);
    }
}

fn beside<'m>(matrices: impl IntoIterator<Item = &'m Matrix<f64>>) -> Vec<f64> {
    matrices.into_iter().flat_map(|matrix| matrix.iter().copied()).collect()
}

#[test]
fn of_dynamics() {
    let models = models(TREES);
    each_level(|level| {
        let mut inverse = Worst::new("∂τ by duals in lanes", EXACT);
        let mut forward = Worst::new("∂q̈ by duals in lanes", EXACT);
        let mut values = Worst::new("values by duals in lanes", EXACT);
        for (seed, model) in models.iter().enumerate() {
            let Input { q, v, x, f_ext, .. } = Input::random(model, &mut rng(seed as u64));
            let (state, mut data) = ([&q[..], &v, &x].concat(), Data::new(model));
            let mut jacobian = LaneJacobian::new(model, state.len(), model.nv());
            let mut f = Dynamics { model, f_ext: &f_ext, forward: false };
            let (tau, J) = jacobian.of(model, &state, &mut f);
            values.see(model, tau.as_slice(), rnea(model, &mut data, &q, &v, &x, &f_ext));
            let d = rnea_derivatives(model, &mut data, &q, &v, &x, &f_ext);
            inverse.see(model, J.as_slice(), &beside([d.dtau_dq, d.dtau_dv, d.dtau_da]));
            f.forward = true;
            let (qdd, J) = jacobian.of(model, &state, &mut f);
            values.see(model, qdd.as_slice(), aba(model, &mut data, &q, &v, &x, &f_ext));
            let d = aba_derivatives(model, &mut data, &q, &v, &x, &f_ext);
            forward.see(model, J.as_slice(), &beside([d.da_dq, d.da_dv, d.da_dtau]));
        }
        println!("{level:?}");
    });
}

/// Checks that selected columns equal the columns of the whole Jacobian, in any requested order. The other columns must
/// be zero.
#[test]
fn along_some_directions() {
    let models = models(TREES);
    each_level(|level| {
        for (seed, model) in models.iter().enumerate() {
            let Input { q, v, x, f_ext, .. } = Input::random(model, &mut rng(seed as u64));
            let state = [&q[..], &v, &x].concat();
            let new = || LaneJacobian::new(model, state.len(), model.nv());
            let (mut whole, mut some) = (new(), new());
            let mut f = Dynamics { model, f_ext: &f_ext, forward: false };
            let (tau, J) = whole.of(model, &state, &mut f);
            let chosen: Vec<_> = (0..J.ncols()).rev().filter(|k| k % 3 != 1).collect();
            for directions in [&[][..], &chosen] {
                let (value, columns) = some.along(model, &state, &mut f, directions);
                assert_eq!(value, tau, "{level:?}");
                for k in 0..J.ncols() {
                    let expected = if directions.contains(&k) { J.column(k).amax() } else { 0.0 };
                    assert_eq!(columns.column(k).amax(), expected, "{level:?}: column {k}");
                    assert!(!directions.contains(&k) || columns.column(k) == J.column(k), "{level:?}: column {k}");
                }
            }
        }
    });
}

#[test]
#[should_panic(expected = "directions: found 14, expected less than 14")]
fn directions_that_do_not_exist_are_refused() {
    let arm = condyle_dynamics::robots::arm7();
    let mut f = Dynamics { model: &arm, f_ext: &[], forward: false };
    LaneJacobian::new(&arm, 14, 7).along(&arm, &[0.0; 14], &mut f, &[3, 14]);
}
