//! The semi-implicit (symplectic) Euler method.

use super::{Input, Status, acceleration};
use crate::data::Data;
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::integrate;
use condyle_spatial::{Array, Constant, Scalar};

workspace! {
    pub(super) struct Workspace<S>(size) {
        /// Efforts, the passive ones included. Written by: `step`.
        effort: Array<S> = filled(S::zero, size.nv),
        /// h v'. Written by: `step`.
        way: Array<S> = filled(S::zero, size.nv),
    }
}

/// The whole method.
pub(super) fn step<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    w: &mut Workspace<S>,
    input: Input<S>,
    (q, v): (&[S], &[S]),
    (q_next, v_next): (&mut [S], &mut [S]),
) -> Status {
    let a = acceleration(model, data, input, (q, v), &mut w.effort);
    for k in 0..v.len() {
        v_next[k] = a[k].mul_add(input.h, v[k]); // v' = v + h a
        w.way[k] = v_next[k] * input.h;
    }
    integrate(model, q, &w.way, q_next); // q' = q ⊕ h v'
    Status::Done
}
