//! Step of the semi-implicit (symplectic) Euler method.

use super::{Input, acceleration};
use crate::data::Data;
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::integrate;
use condyle_spatial::{Array, Constant, Scalar};

workspace! {
    pub(super) struct Workspace<S>(size) {
        /// Efforts, including passive efforts. Written by: `velocity`.
        effort: Array<S> = filled(S::zero, size.nv),
        /// Displacement h v' of a step with length h and velocity v'. Written by: `position`.
        way: Array<S> = filled(S::zero, size.nv),
    }
}

/// Computes v' = v + h a, the velocity after a step of length h without contacts.
#[track_caller]
pub(super) fn velocity<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    w: &mut Workspace<S>,
    input: Input<S>,
    (q, v): (&[S], &[S]),
    v_next: &mut [S],
) {
    let a = acceleration(model, data, input, (q, v), &mut w.effort);
    for k in 0..v.len() {
        v_next[k] = a[k].mul_add(input.h, v[k]); // v' = v + h a
    }
}

/// Computes q' = q ⊕ h (v' + w), the position after a step of length h. w corrects penetration of the ground; it has nv
/// numbers, or is empty.
pub(super) fn position<S: Scalar, R>(
    model: &Model<R>,
    d: &mut Workspace<S>,
    h: S,
    (q, v_next, w): (&[S], &[S], &[f64]),
    q_next: &mut [S],
) {
    for (k, &v) in v_next.iter().enumerate() {
        d.way[k] = v * h;
    }
    for (way, &w) in d.way.iter_mut().zip(w) {
        *way += S::splat(w) * h;
    }
    integrate(model, q, &d.way, q_next); // q' = q ⊕ h v'
}
