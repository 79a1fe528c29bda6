//! Gravity residual: the efforts of a knot minus the efforts that hold the robot still. It is computed for one knot or
//! for several knots in SIMD lanes.

use super::kernel::KnotGroup;
use crate::robot::knot_data::unpack;
use condyle_dynamics::{Data, Model, gravity, rnea, rnea_derivatives, static_torque_derivative};
use condyle_spatial::block::Block;
use condyle_spatial::kernel;
use nalgebra::DMatrix;

/// Gravity residual without τ: M q̈ + h − g at knots with contacts, −g at other knots.
#[derive(Debug)]
pub(crate) struct GravityResidual<S> {
    /// Value of the gravity residual without τ. Shape: nv.
    value: Vec<S>,
    /// Derivative of the gravity residual with respect to q. Shape: nv × nv.
    by_q: DMatrix<S>,
}

impl<S: Block<Number = f64>> GravityResidual<S> {
    /// Allocates the gravity residual and its derivative for nv coordinates.
    pub(crate) fn new(nv: usize) -> Self {
        Self { value: vec![S::zero(); nv], by_q: DMatrix::from_element(nv, nv, S::zero()) }
    }

    /// Computes the gravity residual without τ at (q, v, q̈), and also its derivatives if `slopes` is set.
    pub(crate) fn run(
        &mut self,
        model: &Model,
        data: &mut Data<S>,
        [q, v, a]: [&[S]; 3],
        inertia: bool,
        group: &mut KnotGroup<'_>,
    ) {
        let Self { value, by_q } = self;
        match inertia {
            true => value.copy_from_slice(rnea(model, data, q, v, a, &[])),
            false => value.fill(S::zero()),
        }
        subtract(value, gravity(model, data, q)); // M q̈ + h − g
        unpack(value, group.data, |data| &mut data.residuals.gravity_residual);
        if !group.slopes {
            return;
        }
        by_q.as_mut_slice().fill(S::zero());
        if inertia {
            let d = rnea_derivatives(model, data, q, v, a, &[]);
            by_q.as_mut_slice().copy_from_slice(d.dtau_dq.as_slice());
            unpack(d.dtau_dv.as_slice(), group.data, |data| data.residuals.dsurplus[1].as_mut_slice());
            unpack(d.dtau_da.as_slice(), group.data, |data| data.residuals.dsurplus[2].as_mut_slice());
        }
        let dg = static_torque_derivative(model, data, q, &[]);
        subtract(by_q.as_mut_slice(), dg.as_slice()); // ∂τ/∂q − ∂g/∂q
        unpack(by_q.as_slice(), group.data, |data| data.residuals.dsurplus[0].as_mut_slice());
    }
}

kernel! {
    /// Subtracts y from x.
    fn subtract<S>(x: &mut [S], y: &[S]) {
        for i in 0..x.len().min(y.len()) {
            x[i] -= y[i];
        }
    }
}
