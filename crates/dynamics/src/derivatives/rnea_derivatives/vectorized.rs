//! Derivatives of inverse dynamics for robots with long branches. Four columns are computed at a time.
//!
//! Source: the equations for a pair of columns (d, e) in `rnea_derivatives`. The columns d of all joints that the joint
//! of column e carries are contiguous. The values of the columns d are stored component by component, so a vector can
//! load one component of four columns. Four entries of a matrix column are thus computed at once. The operations, and
//! all bits of the results, are the same as without vectors.

use crate::derivatives::rnea_derivatives::{Bodies, Workspace};
use crate::passes::kinematics::World;
use crate::workspace::filled;
use condyle_model::Model;
use condyle_spatial::gate::FusedF64;
use condyle_spatial::{Array, Force, Scalar, Vec3, same_layout};
use core::any::Any;

/// Number of columns that are processed together.
const SIDE: usize = 4;

/// Number of values that are stored for a column: Iᶜ S (6), 2Bᵀ S (3), `by_q` (6) and `by_v` (6).
const NUMBERS: usize = 6 + 3 + 6 + 6;

/// Values of each column that are used in the pairs of the column with all earlier columns. Shape: ⌈columns / `SIDE`⌉
/// blocks of `NUMBERS` × `SIDE`.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Rows<S> {
    sides: Array<[[S; SIDE]; NUMBERS]>,
}

same_layout!(Rows { sides });

impl<S: Scalar> Rows<S> {
    pub(crate) fn new(columns: usize) -> Self {
        Self { sides: filled(|| [[S::zero(); SIDE]; NUMBERS], columns.div_ceil(SIDE)) }
    }

    /// Stores the values of one column.
    #[inline(always)]
    pub(crate) fn keep(&mut self, column: usize, IS: Force<S>, BS: Vec3<S>, by_q: Force<S>, by_v: Force<S>) {
        let (side, at) = (&mut self.sides[column / SIDE], column % SIDE);
        let (IS, BS, by_q, by_v) = (IS.to_array(), BS.to_array(), by_q.to_array(), by_v.to_array());
        for k in 0..6 {
            (side[k][at], side[9 + k][at], side[15 + k][at]) = (IS[k], by_q[k], by_v[k]);
        }
        for k in 0..3 {
            side[6 + k][at] = BS[k];
        }
    }
}

/// Computes the entries of the derivatives for all pairs of columns of different joints, from the values stored in
/// `Rows`.
#[inline(always)]
pub(crate) fn pairs<S: Scalar, R>(model: &Model<R>, w: &World<S>, d: &mut Workspace<S>) {
    let w = (w as &dyn Any).downcast_ref::<World<FusedF64>>();
    let d = (d as &mut dyn Any).downcast_mut::<Workspace<FusedF64>>();
    if let (Some(w), Some(d)) = (w, d) {
        vectors::pairs(model, w, d);
    }
}

mod vectors {
    use super::*;
    use crate::workspace::Narrow as Four;
    use condyle_spatial::Motion;

    const _: () = assert!(Four::LANES == SIDE);

    #[inline(always)]
    pub(super) fn pairs<R>(model: &Model<R>, w: &World<FusedF64>, d: &mut Workspace<FusedF64>) {
        let n = model.nv();
        let (Bodies { rows, Psid, Psidd, PsidSd, .. }, [dq, dv, da]) = d.parts();
        for node in &model.nodes()[1..] {
            let nv = node.joint.nv();
            let (first, end) = (node.column + nv, model.columns()[node.column].end);
            for e in node.column..node.column + nv {
                let (S_e, Psid_e, Psidd_e, PsidSd_e) = (all(w.S[e]), all(Psid[e]), all(Psidd[e]), all(PsidSd[e]));
                for c in first / SIDE..end.div_ceil(SIDE) {
                    let side = &rows.sides[c];
                    let (IS, BS) = (force(side, 0), vector(side, 6));
                    let dq_de = Psid_e.angular.dot_add(BS, Psidd_e.dot(IS)).to_fused(); // ∂τ_d/∂q_e
                    let dv_de = S_e.angular.dot_add(BS, PsidSd_e.dot(IS)).to_fused(); // ∂τ_d/∂q̇_e
                    let dq_ed = S_e.dot(force(side, 9)).to_fused(); // ∂τ_e/∂q_d
                    let dv_ed = S_e.dot(force(side, 15)).to_fused(); // ∂τ_e/∂q̇_d
                    let M_de = S_e.dot(IS).to_fused();
                    let below = e * n + c * SIDE;
                    if first <= c * SIDE && c * SIDE + SIDE <= end {
                        dq[below..below + SIDE].copy_from_slice(&dq_de);
                        dv[below..below + SIDE].copy_from_slice(&dv_de);
                        da[below..below + SIDE].copy_from_slice(&M_de);
                        for k in 0..SIDE {
                            let right = (c * SIDE + k) * n + e;
                            (dq[right], dv[right], da[right]) = (dq_ed[k], dv_ed[k], M_de[k]);
                        }
                    } else {
                        for d in first.max(c * SIDE)..end.min(c * SIDE + SIDE) {
                            let (k, below, right) = (d % SIDE, e * n + d, d * n + e);
                            (dq[below], dv[below], da[below]) = (dq_de[k], dv_de[k], M_de[k]);
                            (dq[right], dv[right], da[right]) = (dq_ed[k], dv_ed[k], M_de[k]);
                        }
                    }
                }
            }
        }
    }

    /// Returns the three-dimensional vectors of four columns, one column per lane. `side[k]` has the x components.
    #[inline(always)]
    fn vector(side: &[[FusedF64; SIDE]; NUMBERS], k: usize) -> Vec3<Four> {
        Vec3::new(Four::from_fused(&side[k]), Four::from_fused(&side[k + 1]), Four::from_fused(&side[k + 2]))
    }

    /// Returns the spatial forces of four columns, one column per lane. `side[k]` has the first components.
    #[inline(always)]
    fn force(side: &[[FusedF64; SIDE]; NUMBERS], k: usize) -> Force<Four> {
        Force::new(vector(side, k), vector(side, k + 3))
    }

    /// Copies a vector to all lanes.
    #[inline(always)]
    fn all3(v: Vec3<FusedF64>) -> Vec3<Four> {
        Vec3::new(Four::splat(v.x.0), Four::splat(v.y.0), Four::splat(v.z.0))
    }

    /// Copies a motion to all lanes.
    #[inline(always)]
    fn all(m: Motion<FusedF64>) -> Motion<Four> {
        Motion::new(all3(m.linear), all3(m.angular))
    }
}
