//! Controls that hold a state still, computed by Newton steps.
#![allow(non_snake_case)] // names follow the literature: B

use super::ActionModel;
use crate::lq::LqKnot;
use nalgebra::DVector;

/// Maximum number of Newton steps; the next constant is the largest change of a state that counts as still.
const MOST: usize = 100;
const STILL: f64 = 1e-9;

/// Computes the controls of [`quasi_static`](ActionModel::quasi_static) for any action, by Newton steps.
pub(crate) fn newton<A: ActionModel + ?Sized>(action: &mut A, t: usize, x: &[f64]) -> Vec<f64> {
    let (ndx, nu) = (action.ndx(), action.nu());
    let (mut u, mut next, mut change) = (vec![0.0; nu], x.to_vec(), DVector::zeros(ndx));
    let mut knot = LqKnot::zeros(ndx, nu);
    for _ in 0..if nu == 0 || action.is_terminal() { 0 } else { MOST } {
        action.calc(t, x, &u, &mut next);
        action.difference(x, &next, change.as_mut_slice());
        action.calc_diff(t, x, &u, &mut knot);
        // stops here, because the singular value decomposition of a matrix that is not finite would not terminate
        if !(knot.B.iter().chain(&change).all(|x| x.is_finite())) {
            break;
        }
        let singular = knot.B.clone().svd(true, true);
        let least = f64::EPSILON * ndx.max(nu) as f64 * singular.singular_values.max();
        let step = singular.solve(&change, least).expect("both factors were asked for");
        u.iter_mut().zip(&step).for_each(|(u, step)| *u -= step);
        if step.norm() < STILL {
            break;
        }
    }
    u
}
