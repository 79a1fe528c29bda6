//! Groups of positions of a robot that are not a vector space, and second derivatives of q ⊕ δ.

use crate::lq::Hessian;
use condyle_dynamics::{DifferenceArgument, IntegrateArgument, Joint, Model, difference_jacobian, integrate_jacobian};
use condyle_spatial::Scalar;
use condyle_spatial::lane_dual::LaneDual;
use core::ops::Range;
use nalgebra::DMatrix;

/// Returns the velocity coordinates of each joint whose positions are not a vector space. For all other joints, the
/// Jacobians of ⊕ and ⊖ are ±1.
pub fn groups(model: &Model) -> Vec<Range<usize>> {
    let group = |joint| matches!(joint, Joint::Spherical | Joint::Planar | Joint::FreeFlyer);
    model.bodies()[1..].iter().filter(|b| group(b.joint)).map(|b| b.idx_v..b.idx_v + b.joint.nv()).collect()
}

/// Workspace for the second derivatives of q ⊕ δ in the groups, which are the joints whose positions are not a vector
/// space. The workspace is empty without groups.
#[derive(Debug)]
pub(super) struct GroupHessian {
    /// Step δ as dual numbers, which differentiate with respect to one coordinate of each group. Shape: nv. Written by:
    /// `run`.
    delta: Vec<LaneDual<f64>>,
    /// Matrix E = J_exp(δ) as dual numbers, with its derivative along the same coordinates as in `delta`. Shape: nv ×
    /// nv. Written by: `run`.
    E: DMatrix<LaneDual<f64>>,
    /// Matrix −J_log(−δ). Shape: nv × nv. Written by: `run`.
    back: DMatrix<f64>,
    /// Matrix M_ik = Σᵣ λᵣ ∂E_ri/∂δ_k. Only the blocks of groups are written. Shape: nv × nv. Written by: `run`.
    M: DMatrix<f64>,
}

impl GroupHessian {
    pub(super) fn new(nv: usize, groups: &[Range<usize>]) -> Self {
        let n = if groups.is_empty() { 0 } else { nv };
        let (zero, square) = (LaneDual::zero(), DMatrix::zeros(n, n));
        Self { delta: vec![zero; n], E: DMatrix::from_element(n, n, zero), back: square.clone(), M: square }
    }

    /// Computes, for each group, the second derivatives of θ(δ₀, ε) = λᵀ((q ⊕ δ₀) ⊕ (δ + ε) ⊖ (q ⊕ δ)) with respect to
    /// δ₀ and ε, at zero.
    ///
    /// Let E(δ) = J_exp(δ) and M_ik = Σᵣ λᵣ ∂E_ri/∂δ_k. In one group, θ = λᵀ log(exp(Tδ₀) exp(η)) with T = Ad exp(−δ)
    /// and dη = J_log(η) E(δ + ε) dε. The expansion of θ to second order, and an identity for ∂E, are
    ///
    /// ```text
    /// θ = λᵀ(T δ₀ + E ε + ½ ∂E[ε] ε + ½ [T δ₀, E ε]) + …      [E e, E ε] = ∂E[ε] e − ∂E[e] ε
    /// ```
    ///
    /// The identity is the equation of Maurer and Cartan, where [·, ·] is the Lie bracket. With e = E⁻¹ T δ₀ =
    /// J_log(−δ) δ₀ the derivatives are ∂²θ/∂δ₀∂δ₀ = 0, ∂²θ/∂δ₀∂ε = ½ J_log(−δ)ᵀ (M − Mᵀ), ∂²θ/∂ε∂ε = ½ (M + Mᵀ).
    pub(super) fn run(
        &mut self,
        model: &Model,
        groups: &[Range<usize>],
        dq: &[f64],
        lambda: &[f64],
        hessian: &mut Hessian,
    ) {
        let Self { delta, E, back, M } = self;
        let largest = groups.iter().map(Range::len).max().unwrap_or(0);
        for k in 0..largest {
            for (delta, &dq) in delta.iter_mut().zip(dq) {
                *delta = LaneDual::splat(dq);
            }
            // E has a separate block for each group: one coordinate of each group can be differentiated in the same
            // call
            for group in groups.iter().filter(|group| k < group.len()) {
                delta[group.start + k].eps = 1.0;
            }
            integrate_jacobian(model, delta, IntegrateArgument::Velocity, E);
            for group in groups.iter().filter(|group| k < group.len()) {
                for i in group.clone() {
                    M[(i, group.start + k)] = group.clone().map(|r| lambda[r] * E[(r, i)].eps).sum();
                }
            }
        }
        difference_jacobian(model, dq, DifferenceArgument::From, back);
        for group in groups {
            for j in group.clone() {
                for i in group.clone() {
                    hessian.xx[(i, j)] = 0.0;
                    hessian.xu[(i, j)] = group.clone().map(|r| 0.5 * back[(r, i)] * (M[(j, r)] - M[(r, j)])).sum();
                    hessian.uu[(i, j)] = 0.5 * (M[(i, j)] + M[(j, i)]);
                }
            }
        }
    }
}
