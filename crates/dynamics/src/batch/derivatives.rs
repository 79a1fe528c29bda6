//! Derivatives in many states.

use super::group::{DA, DTAU, MINV};
use super::results::{Matrices, Take, Taken, results};
use super::table::{COLUMNS, NV, batched};
use crate::calls::derivatives::{
    aba_derivatives, centroidal_derivatives, coriolis_derivatives, energy_derivatives, rnea_derivatives,
    static_torque_derivative,
};
use crate::calls::parameter_derivatives::Input;
use crate::calls::second_derivatives::{aba_hessian, each_unit_hessian, rnea_hessian};
use condyle_spatial::block::Real;

results! {
    /// The derivatives of τ = rnea(q, v, a) in many states: see [`RneaDerivatives`](crate::RneaDerivatives).
    BatchRneaDerivatives {
        /// ∂τ/∂q in the tangent space.
        dtau_dq: Matrices<'b, T>,
        /// ∂τ/∂v.
        dtau_dv: Matrices<'b, T>,
        /// ∂τ/∂a = M(q), armature included.
        dtau_da: Matrices<'b, T>,
    }

    /// q̈ = aba(q, v, τ) and its derivatives in many states: see [`AbaDerivatives`](crate::AbaDerivatives).
    BatchAbaDerivatives {
        /// q̈ itself, nv numbers for each state.
        a: &'b [T],
        /// ∂q̈/∂q in the tangent space.
        da_dq: Matrices<'b, T>,
        /// ∂q̈/∂v.
        da_dv: Matrices<'b, T>,
        /// ∂q̈/∂τ = M(q)⁻¹.
        da_dtau: Matrices<'b, T>,
    }

    /// The derivatives of C(q, v) v in many states: see [`CoriolisDerivatives`](crate::CoriolisDerivatives).
    BatchCoriolisDerivatives {
        /// ∂(C v)/∂q, nv × nv.
        dq: Matrices<'b, T>,
        /// ∂(C v)/∂v, nv × nv.
        dv: Matrices<'b, T>,
    }

    /// The derivatives of the energies in many states: see [`EnergyDerivatives`](crate::EnergyDerivatives).
    BatchEnergyDerivatives {
        /// ∂T/∂q, nv numbers for each state.
        dT_dq: &'b [T],
        /// ∂T/∂v, nv numbers for each state.
        dT_dv: &'b [T],
        /// ∂V/∂q, nv numbers for each state.
        dV_dq: &'b [T],
    }

    /// The second derivatives of λᵀ rnea(q, v, a) in many states: see [`RneaHessian`](crate::RneaHessian).
    BatchRneaHessian {
        /// ∂²φ/∂q∂q, nv × nv.
        dqdq: Matrices<'b, T>,
        /// ∂²φ/∂v∂q, nv × nv.
        dvdq: Matrices<'b, T>,
        /// ∂²φ/∂v∂v, nv × nv.
        dvdv: Matrices<'b, T>,
        /// ∂²φ/∂a∂q, nv × nv.
        dadq: Matrices<'b, T>,
    }

    /// The second derivatives of λᵀ aba(q, v, τ) in many states: see [`AbaHessian`](crate::AbaHessian).
    BatchAbaHessian {
        /// ∂²ψ/∂q∂q, nv × nv.
        dqdq: Matrices<'b, T>,
        /// ∂²ψ/∂v∂q, nv × nv.
        dvdq: Matrices<'b, T>,
        /// ∂²ψ/∂v∂v, nv × nv.
        dvdv: Matrices<'b, T>,
        /// ∂²ψ/∂τ∂q, nv × nv.
        dtaudq: Matrices<'b, T>,
    }

    /// The derivatives of centroidal momentum, its rate and the centre of mass in many states: see
    /// [`CentroidalDerivatives`](crate::CentroidalDerivatives).
    BatchCentroidalDerivatives {
        /// ∂hg/∂q, 6 × nv.
        dh_dq: Matrices<'b, T>,
        /// ∂hg/∂v, 6 × nv.
        dh_dv: Matrices<'b, T>,
        /// ∂dhg/∂q, 6 × nv.
        drate_dq: Matrices<'b, T>,
        /// ∂dhg/∂v, 6 × nv.
        drate_dv: Matrices<'b, T>,
        /// ∂dhg/∂a, 6 × nv.
        drate_da: Matrices<'b, T>,
        /// ∂c/∂q, 3 × nv.
        dcom_dq: Matrices<'b, T>,
        /// ∂ċ/∂q, 3 × nv.
        dvcom_dq: Matrices<'b, T>,
        /// ∂c̈/∂q, 3 × nv.
        dacom_dq: Matrices<'b, T>,
        /// ∂c̈/∂v, 3 × nv.
        dacom_dv: Matrices<'b, T>,
    }
}

batched! {
    /// [`rnea_derivatives`](crate::rnea_derivatives()) of each state, three matrices nv × nv.
    ///
    /// q: nq numbers a state; v, a: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn rnea_derivatives(model, data, to; q, v, a, f_ext) -> BatchRneaDerivatives<'_, T> [[NV, NV], [NV, NV], [NV, NV]]
    keeps [
        rnea_derivatives.dtau_dq: DTAU[0], rnea_derivatives.dtau_dv: DTAU[1], rnea_derivatives.dtau_da: DTAU[2]
    ] {
        rnea_derivatives(model, data, q, v, a, f_ext);
    }

    /// [`aba_derivatives`](crate::aba_derivatives()) of each state, nv numbers and three matrices nv × nv.
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`aba`](Self::aba).
    fn aba_derivatives(model, data, to; q, v, tau, f_ext) -> BatchAbaDerivatives<'_, T>
    [[NV], [NV, NV], [NV, NV], [NV, NV]]
    keeps [aba_derivatives.da_dq: DA[0], aba_derivatives.da_dv: DA[1], minv.Minv: MINV] {
        to.numbers(aba_derivatives(model, data, q, v, tau, f_ext).a);
    }

    /// [`static_torque_derivative`](crate::static_torque_derivative()) of each state, nv × nv.
    ///
    /// q: nq numbers a state; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn static_torque_derivative(model, data, to; q, f_ext) -> Matrices<'_, T> [[NV, NV]] {
        to.matrix(static_torque_derivative(model, data, q, f_ext));
    }

    /// [`coriolis_derivatives`](crate::coriolis_derivatives) of each state, two matrices nv × nv.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn coriolis_derivatives(model, data, to; q, v) -> BatchCoriolisDerivatives<'_, T> [[NV, NV], [NV, NV]] {
        let d = coriolis_derivatives(model, data, q, v);
        to.matrix(d.dq);
        to.matrix(d.dv);
    }

    /// [`energy_derivatives`](crate::energy_derivatives) of each state, nv numbers each.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn energy_derivatives(model, data, to; q, v) -> BatchEnergyDerivatives<'_, T> [[NV], [NV], [NV]] {
        let d = energy_derivatives(model, data, q, v);
        to.numbers(d.dT_dq);
        to.numbers(d.dT_dv);
        to.numbers(d.dV_dq);
    }

    /// [`centroidal_derivatives`](crate::centroidal_derivatives()) of each state, 6 × nv and 3 × nv.
    ///
    /// q: nq numbers a state; v, a: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_derivatives(model, data, to; q, v, a) -> BatchCentroidalDerivatives<'_, T>
    [[6, NV], [6, NV], [6, NV], [6, NV], [6, NV], [3, NV], [3, NV], [3, NV], [3, NV]] {
        let d = centroidal_derivatives(model, data, q, v, a);
        to.matrix(d.dh_dq);
        to.matrix(d.dh_dv);
        to.matrix(d.drate_dq);
        to.matrix(d.drate_dv);
        to.matrix(d.drate_da);
        to.matrix(d.dcom_dq);
        to.matrix(d.dvcom_dq);
        to.matrix(d.dacom_dq);
        to.matrix(d.dacom_dv);
    }

    /// [`rnea_hessian`](crate::rnea_hessian()) of each state, four matrices nv × nv.
    ///
    /// q: nq numbers a state; v, a, lambda: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn rnea_hessian(model, data, to; q, v, a, f_ext, lambda) -> BatchRneaHessian<'_, T>
    [[NV, NV], [NV, NV], [NV, NV], [NV, NV]] {
        let h = rnea_hessian(model, data, q, v, a, f_ext, lambda);
        to.matrix(h.dqdq);
        to.matrix(h.dvdq);
        to.matrix(h.dvdv);
        to.matrix(h.dadq);
    }

    /// [`aba_hessian`](crate::aba_hessian()) of each state, four matrices nv × nv.
    ///
    /// q: nq numbers a state; v, tau, lambda: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`aba`](Self::aba).
    fn aba_hessian(model, data, to; q, v, tau, f_ext, lambda) -> BatchAbaHessian<'_, T>
    [[NV, NV], [NV, NV], [NV, NV], [NV, NV]] {
        let h = aba_hessian(model, data, q, v, tau, f_ext, lambda);
        to.matrix(h.dqdq);
        to.matrix(h.dvdq);
        to.matrix(h.dvdv);
        to.matrix(h.dtaudq);
    }

    /// [`rnea_second_derivatives`](crate::rnea_second_derivatives) of each state: the matrices of all τ_i, nv × nv each, one
    /// below the other.
    ///
    /// q: nq numbers a state; v, a: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn rnea_second_derivatives(model, data, to; q, v, a, f_ext) -> BatchRneaHessian<'_, T>
    [[NV, NV, NV], [NV, NV, NV], [NV, NV, NV], [NV, NV, NV]] with wide {
        let nv = model.nv();
        each_unit_hessian(model, data, [q, v, a], f_ext, &mut wide[..nv], |i, matrices| {
            for (result, matrix) in matrices.into_iter().enumerate() {
                to.part(result, [i, nv], matrix.as_slice(), nv);
            }
        });
    }

    /// [`RneaDerivatives::with_respect_to`](crate::RneaDerivatives::with_respect_to) of each state, nv × [`Input::len`].
    ///
    /// q: nq numbers a state; v, a: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea), or if the input names no moving body or a smoothing that is not positive.
    fn rnea_input_derivative(model, data, to; q, v, a, f_ext; input: Input) -> Matrices<'_, T> [[NV, COLUMNS]]
    with wide columns (input.len(model)) {
        let (n, columns) = (model.nv(), input.len(model));
        let out = &mut wide[..n * columns];
        rnea_derivatives(model, data, q, v, a, f_ext).write_input(input, out);
        to.columns(out, columns);
    }

    /// [`AbaDerivatives::with_respect_to`](crate::AbaDerivatives::with_respect_to) of each state, nv × [`Input::len`].
    ///
    /// q: nq numbers a state; v, tau: nv; f_ext: a force on each body in its frame, or empty for none.
    ///
    /// # Panics
    /// As [`aba`](Self::aba), or if the input names no moving body or a smoothing that is not positive.
    fn aba_input_derivative(model, data, to; q, v, tau, f_ext; input: Input) -> Matrices<'_, T> [[NV, COLUMNS]]
    with wide columns (input.len(model)) {
        let (n, columns) = (model.nv(), input.len(model));
        let out = &mut wide[..n * columns];
        aba_derivatives(model, data, q, v, tau, f_ext).write_input(input, out);
        to.columns(out, columns);
    }
}
