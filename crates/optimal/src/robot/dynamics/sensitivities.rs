//! Derivatives of the outputs of a knot with respect to its state and its controls.
#![allow(non_snake_case)] // names follow the literature: J

use crate::robot::actuation::Actuation;
use crate::robot::knot_data::{KnotData, Sensitivities, add_matrix_row};
use crate::robot::outputs::Output;
use crate::robot::residuals::rows::Row;

/// Derivatives of the outputs of a knot, read from the derivatives in the knot's data.
pub(crate) struct DynamicsSensitivities<'a> {
    /// Output that equals S u. If this output is the acceleration, it equals the first nv controls, and the other
    /// controls are contact forces.
    pub given: Output,
    pub data: &'a KnotData,
    pub actuation: &'a Actuation,
}

impl Sensitivities for DynamicsSensitivities<'_> {
    fn add_row(&self, output: Output, row: usize, c: f64, g: &mut Row<'_>) {
        let Self { given, data, actuation } = self;
        let inverse = *given == Output::Acceleration;
        let [by_q, by_v, by_given] = match output {
            output if output == *given => return actuation.add_row(row, c, g.u),
            Output::Force if inverse => return g.u[actuation.nu() + row] += c,
            Output::Acceleration => &data.da,
            Output::Effort => &data.dtau,
            Output::Force => &data.dlambda,
            Output::ContactAcceleration => &data.dcontact_acceleration,
        };
        add_matrix_row(by_q, row, c, g.q);
        add_matrix_row(by_v, row, c, g.v);
        actuation.add_product_row(by_given, row, c, g.u);
        if inverse && output == Output::Effort {
            let [.., J] = &data.dcontact_acceleration;
            for (g, J) in g.u[actuation.nu()..].iter_mut().zip(J.column(row).iter()) {
                *g -= c * J; // ∂τ/∂λ = −Jᵀ
            }
        }
    }

    fn add_control(&self, k: usize, c: f64, g: &mut Row<'_>) {
        g.u[k] += c;
    }
}
