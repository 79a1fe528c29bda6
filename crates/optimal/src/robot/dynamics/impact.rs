//! Velocity change of a robot at an impact.

use super::batch::DynamicsKind;
use crate::robot::contact::constraint_set;
use crate::robot::knot_data::KnotData;
use crate::robot::residuals::terms::KnotTerms;
use condyle_dynamics::{
    ConstraintSet, Data, Model, centroidal_derivatives, forward_velocities, impulse_dynamics,
    impulse_dynamics_derivatives,
};

/// Impact at a set of contacts, with its workspace.
#[derive(Debug)]
pub(super) struct Impact {
    set: ConstraintSet<f64>,
    restitution: f64,
    /// Vector of zeros. Shape: nv.
    zero: Vec<f64>,
}

impl Impact {
    /// Allocates the workspace of an impact; `None` for all other kinds of dynamics.
    pub(super) fn new(model: &Model, kind: &DynamicsKind) -> Option<Self> {
        let DynamicsKind::Impact { contacts, restitution, damping } = kind else { return None };
        let set = constraint_set(model, contacts, *damping).expect("was checked when it was given");
        Some(Self { set, restitution: *restitution, zero: vec![0.0; model.nv()] })
    }

    /// Computes the velocity change v⁺ − v and the impulses at a state, and the quantities that the terms read. If
    /// `slopes` is set, also computes the derivatives of all these quantities.
    pub(super) fn run(
        &mut self,
        model: &Model,
        data: &mut Data<f64>,
        x: &[f64],
        terms: KnotTerms<'_>,
        slopes: bool,
        to: &mut KnotData,
    ) {
        let (Self { set, restitution, zero }, (q, v)) = (self, x.split_at(model.nq()));
        if slopes {
            let d = impulse_dynamics_derivatives(model, data, set, q, v, *restitution);
            write_change(v, d.v, d.lambda, to);
            let KnotData { da: [by_q, by_v, _], dlambda: [force_by_q, force_by_v, _], .. } = to;
            by_q.copy_from(d.dv_dq);
            by_v.copy_from(d.dv_dv);
            by_v.iter_mut().step_by(v.len() + 1).for_each(|x| *x -= 1.0); // ∂(v⁺ − v)/∂v
            force_by_q.copy_from(d.dlambda_dq);
            force_by_v.copy_from(d.dlambda_dv);
        } else {
            let after = impulse_dynamics(model, data, set, q, v, *restitution);
            write_change(v, after.v, after.lambda, to);
        }
        if terms.layout().requirements.impulse_com {
            write_com_change(model, data, [q, zero], slopes, to);
        }
    }
}

fn write_change(v: &[f64], after: &[f64], lambda: &[f64], to: &mut KnotData) {
    (0..v.len()).for_each(|k| to.a[k] = after[k] - v[k]);
    to.lambda.copy_from_slice(lambda);
}

/// Writes J_c (v⁺ − v), the velocity change of the centre of mass; also writes its derivatives if `slopes` is set.
fn write_com_change(model: &Model, data: &mut Data<f64>, [q, zero]: [&[f64]; 2], slopes: bool, to: &mut KnotData) {
    let KnotData { a: change, residuals, .. } = to;
    residuals.com_change = forward_velocities(model, data, q, change).com_velocity().to_array();
    if slopes {
        let d = centroidal_derivatives(model, data, q, change, zero);
        residuals.dcom_change[0].copy_from(d.dvcom_dq);
        residuals.dcom_change[1].copy_from(d.dcom_dq);
    }
}
