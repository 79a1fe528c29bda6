//! Batch functions for the derivatives of dynamics at many states.

use super::group::{DA, DTAU, MINV};
use super::places::{Places, Put};
use super::results::{Matrices, Take, Taken, results};
use super::table::{COLUMNS, NV, batched};
use crate::calls::derivatives::{
    AbaDerivatives, CoriolisDerivatives, RneaDerivatives, aba_derivatives, centroidal_derivatives,
    coriolis_derivatives, energy_derivatives, rnea_derivatives, static_torque_derivative,
};
use crate::calls::parameter_derivatives::Input;
use crate::calls::second_derivatives::{AbaHessian, RneaHessian, aba_hessian, each_unit_hessian, rnea_hessian};
use crate::derivatives::centroidal_derivatives::CentroidalDerivatives;
use crate::derivatives::rnea_derivatives::Workspace;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::energy::EnergyDerivatives;
use crate::passes::passive::{PassiveDerivatives, slopes};
use condyle_spatial::block::Real;

results! {
    /// Derivatives of τ = rnea(q, v, a), of many states: see [`RneaDerivatives`](crate::RneaDerivatives).
    BatchRneaDerivatives of RneaDerivatives {
        /// Derivative ∂τ/∂q of the joint efforts in the tangent space.
        dtau_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂τ/∂v of the joint efforts.
        dtau_dv: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂τ/∂a = M(q) of the joint efforts, including armature.
        dtau_da: Matrices<'b, T> = [NV, NV];
    }

    /// q̈ = aba(q, v, τ) and its derivatives, of many states: see [`AbaDerivatives`](crate::AbaDerivatives).
    BatchAbaDerivatives of AbaDerivatives {
        /// Accelerations q̈, nv numbers per state.
        a: &'b [T] = [NV];
        /// Derivative ∂q̈/∂q of the joint accelerations in the tangent space.
        da_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂q̈/∂v of the joint accelerations.
        da_dv: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂q̈/∂τ = M(q)⁻¹ of the joint accelerations.
        da_dtau: Matrices<'b, T> = [NV, NV];
    }

    /// Derivatives of C(q, v) v, of many states: see [`CoriolisDerivatives`](crate::CoriolisDerivatives).
    BatchCoriolisDerivatives of CoriolisDerivatives {
        /// Derivative ∂(C v)/∂q of the Coriolis efforts, nv × nv.
        dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂(C v)/∂v of the Coriolis efforts, nv × nv.
        dv: Matrices<'b, T> = [NV, NV];
    }

    /// Derivatives of passive efforts, of many states: see
    /// [`passive_torque_derivatives`](crate::passive_torque_derivatives()).
    BatchPassiveDerivatives of PassiveDerivatives {
        /// Derivative ∂τ/∂q of the joint efforts in the tangent space, nv × nv.
        dtau_dq: Matrices<'b, T> = [NV, NV];
        /// Derivative ∂τ/∂v of the joint efforts, nv × nv.
        dtau_dv: Matrices<'b, T> = [NV, NV];
    }

    /// Derivatives of the energies, of many states: see [`EnergyDerivatives`](crate::EnergyDerivatives).
    BatchEnergyDerivatives of EnergyDerivatives {
        /// Derivative ∂T/∂q of the kinetic energy, nv numbers per state.
        dT_dq: &'b [T] = [NV];
        /// Derivative ∂T/∂v of the kinetic energy, nv numbers per state.
        dT_dv: &'b [T] = [NV];
        /// Derivative ∂V/∂q of the potential energy, nv numbers per state.
        dV_dq: &'b [T] = [NV];
    }

    /// Second derivatives of φ = λᵀ rnea(q, v, a), of many states: see [`RneaHessian`](crate::RneaHessian).
    BatchRneaHessian of RneaHessian {
        /// Second derivatives ∂²φ/∂q∂q of φ = λᵀ rnea(q, v, a), nv × nv.
        dqdq: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²φ/∂v∂q of φ = λᵀ rnea(q, v, a), nv × nv.
        dvdq: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²φ/∂v∂v of φ = λᵀ rnea(q, v, a), nv × nv.
        dvdv: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²φ/∂a∂q of φ = λᵀ rnea(q, v, a), nv × nv.
        dadq: Matrices<'b, T> = [NV, NV];
    }

    /// Second derivatives of ψ = λᵀ aba(q, v, τ), of many states: see [`AbaHessian`](crate::AbaHessian).
    BatchAbaHessian of AbaHessian {
        /// Second derivatives ∂²ψ/∂q∂q of ψ = λᵀ aba(q, v, τ), nv × nv.
        dqdq: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²ψ/∂v∂q of ψ = λᵀ aba(q, v, τ), nv × nv.
        dvdq: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²ψ/∂v∂v of ψ = λᵀ aba(q, v, τ), nv × nv.
        dvdv: Matrices<'b, T> = [NV, NV];
        /// Second derivatives ∂²ψ/∂τ∂q of ψ = λᵀ aba(q, v, τ), nv × nv.
        dtaudq: Matrices<'b, T> = [NV, NV];
    }

    /// Derivatives of the centroidal momentum, of its rate, and of the centre of mass, of many states: see
    /// [`CentroidalDerivatives`](crate::CentroidalDerivatives).
    BatchCentroidalDerivatives of CentroidalDerivatives {
        /// Derivative ∂hg/∂q of the centroidal momentum, 6 × nv.
        dh_dq: Matrices<'b, T> = [6, NV];
        /// Derivative ∂hg/∂v of the centroidal momentum, 6 × nv.
        dh_dv: Matrices<'b, T> = [6, NV];
        /// Derivative ∂dhg/∂q of the rate dhg of the centroidal momentum, 6 × nv.
        drate_dq: Matrices<'b, T> = [6, NV];
        /// Derivative ∂dhg/∂v of the rate dhg of the centroidal momentum, 6 × nv.
        drate_dv: Matrices<'b, T> = [6, NV];
        /// Derivative ∂dhg/∂a of the rate dhg of the centroidal momentum, 6 × nv.
        drate_da: Matrices<'b, T> = [6, NV];
        /// Derivative ∂c/∂q of the centre of mass, 3 × nv.
        dcom_dq: Matrices<'b, T> = [3, NV];
        /// Derivative ∂ċ/∂q of the velocity of the centre of mass, 3 × nv.
        dvcom_dq: Matrices<'b, T> = [3, NV];
        /// Derivative ∂c̈/∂q of the acceleration of the centre of mass, 3 × nv.
        dacom_dq: Matrices<'b, T> = [3, NV];
        /// Derivative ∂c̈/∂v of the acceleration of the centre of mass, 3 × nv.
        dacom_dv: Matrices<'b, T> = [3, NV];
    }
}

batched! {
    /// Computes [`rnea_derivatives`](crate::rnea_derivatives()) for each state: three matrices nv × nv.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state; f_ext: for each state, one force per body in the body's
    /// frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn rnea_derivatives(model, data => to; q, v, a, f_ext)
    keeps [
        rnea_derivatives.dtau_dq: DTAU[0], rnea_derivatives.dtau_dv: DTAU[1], rnea_derivatives.dtau_da: DTAU[2]
    ] -> BatchRneaDerivatives<'_, T> {
        rnea_derivatives(model, data, q, v, a, f_ext);
    }

    /// Computes [`aba_derivatives`](crate::aba_derivatives()) for each state: nv numbers and three matrices nv × nv.
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`aba`](Self::aba).
    fn aba_derivatives(model, data; q, v, tau, f_ext)
    keeps [aba_derivatives.da_dq: DA[0], aba_derivatives.da_dv: DA[1], minv.Minv: MINV] -> BatchAbaDerivatives<'_, T> {
        aba_derivatives(model, data, q, v, tau, f_ext).a
    }

    /// Computes [`static_torque_derivative`](crate::static_torque_derivative()) for each state: nv × nv.
    ///
    /// q: nq numbers per state; f_ext: for each state, one force per body in the body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn static_torque_derivative(model, data; q, f_ext) -> Matrices<'_, T> [[NV, NV]] {
        static_torque_derivative(model, data, q, f_ext)
    }

    /// Computes [`coriolis_derivatives`](crate::coriolis_derivatives) for each state: two matrices nv × nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn coriolis_derivatives(model, data; q, v) -> BatchCoriolisDerivatives<'_, T> {
        coriolis_derivatives(model, data, q, v)
    }

    /// Computes [`passive_torque_derivatives`](crate::passive_torque_derivatives()) for each state: two matrices nv ×
    /// nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state; smoothing: ε > 0, the same for all states.
    ///
    /// # Panics
    /// Panics in the same cases as [`passive_torque`](Self::passive_torque).
    fn passive_torque_derivatives(model, data; q, v; smoothing: f64) -> BatchPassiveDerivatives<'_, T> {
        let Workspace { dtau_dq, dtau_dv, .. } = &mut data.rnea_derivatives;
        slopes(model, q, v, smoothing, dtau_dq.as_mut_slice(), dtau_dv.as_mut_slice());
        PassiveDerivatives { dtau_dq, dtau_dv }
    }

    /// Computes [`energy_derivatives`](crate::energy_derivatives) for each state: three vectors of nv numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn energy_derivatives(model, data; q, v) -> BatchEnergyDerivatives<'_, T> { energy_derivatives(model, data, q, v) }

    /// Computes [`centroidal_derivatives`](crate::centroidal_derivatives()) for each state: matrices of 6 × nv and 3 ×
    /// nv.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn centroidal_derivatives(model, data; q, v, a) -> BatchCentroidalDerivatives<'_, T> {
        centroidal_derivatives(model, data, q, v, a)
    }

    /// Computes [`rnea_hessian`](crate::rnea_hessian()) for each state: four matrices nv × nv.
    ///
    /// q: nq numbers per state; v, a and lambda: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn rnea_hessian(model, data; q, v, a, f_ext, lambda) -> BatchRneaHessian<'_, T> {
        rnea_hessian(model, data, q, v, a, f_ext, lambda)
    }

    /// Computes [`aba_hessian`](crate::aba_hessian()) for each state: four matrices nv × nv.
    ///
    /// q: nq numbers per state; v, tau and lambda: nv numbers per state; f_ext: for each state, one force per body in
    /// the body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`aba`](Self::aba).
    fn aba_hessian(model, data; q, v, tau, f_ext, lambda) -> BatchAbaHessian<'_, T> {
        aba_hessian(model, data, q, v, tau, f_ext, lambda)
    }

    /// Computes [`rnea_second_derivatives`](crate::rnea_second_derivatives) for each state: the nv × nv matrices of all
    /// τ_i, stacked vertically.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state; f_ext: for each state, one force per body in the body's
    /// frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn rnea_second_derivatives(model, data => to; q, v, a, f_ext)
    with wide -> BatchRneaHessian<'_, T> [[NV, NV, NV], [NV, NV, NV], [NV, NV, NV], [NV, NV, NV]] {
        let nv = model.nv();
        each_unit_hessian(model, data, Arguments { q, v, x: a, f_ext }, &mut wide[..nv], |i, matrices| {
            for (result, matrix) in matrices.into_iter().enumerate() {
                to.part(result, [i, nv], matrix.as_slice(), nv);
            }
        });
    }

    /// Computes [`RneaDerivatives::with_respect_to`](crate::RneaDerivatives::with_respect_to) for each state: nv ×
    /// [`Input::len`].
    ///
    /// q: nq numbers per state; v and a: nv numbers per state; f_ext: for each state, one force per body in the body's
    /// frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the input names a body that does not move, or if the
    /// smoothing of the input is not positive.
    fn rnea_input_derivative(model, data => to; q, v, a, f_ext; input: Input)
    with wide columns (input.len(model)) -> Matrices<'_, T> [[NV, COLUMNS]] {
        let (n, columns) = (model.nv(), input.len(model));
        let out = &mut wide[..n * columns];
        rnea_derivatives(model, data, q, v, a, f_ext).write_input(input, out);
        to.columns(out, columns);
    }

    /// Computes [`AbaDerivatives::with_respect_to`](crate::AbaDerivatives::with_respect_to) for each state: nv ×
    /// [`Input::len`].
    ///
    /// q: nq numbers per state; v and tau: nv numbers per state; f_ext: for each state, one force per body in the
    /// body's frame; empty for no forces.
    ///
    /// # Panics
    /// Panics in the same cases as [`aba`](Self::aba), or if the input names a body that does not move, or if the
    /// smoothing of the input is not positive.
    fn aba_input_derivative(model, data => to; q, v, tau, f_ext; input: Input)
    with wide columns (input.len(model)) -> Matrices<'_, T> [[NV, COLUMNS]] {
        let (n, columns) = (model.nv(), input.len(model));
        let out = &mut wide[..n * columns];
        aba_derivatives(model, data, q, v, tau, f_ext).write_input(input, out);
        to.columns(out, columns);
    }
}
