//! The Coriolis matrix.
//!
//! Source: Echeandia and Wensing, *Numerical methods to compute the Coriolis matrix and Christoffel symbols for
//! rigid-body systems* (2021), algorithm 1, in the world's frame. With Iᶜ and Bᶜ of all that the joint of column d
//! carries (B of `rnea_derivatives.rs`), and e a column before it or of the same joint,
//!
//! ```text
//! C_de = S_dᵀ (Iᶜ Ṡ_e + Bᶜ S_e)     C_ed = S_eᵀ (Iᶜ Ṡ_d + Bᶜ S_d)
//! ```
//!
//! As B + Bᵀ is the rate of a body's inertia, Ṁ = C + Cᵀ.

use crate::data::{Data, Size, check};
use crate::kinematics::{Moving, World, advance, place};
use crate::layout::{Layout, Single};
use crate::model::Model;
use crate::rnea_derivatives::Coriolis;
use condyle_spatial::{Act, Constant, Inertia, Scalar};
use nalgebra::DMatrix;

/// In the world's frame.
#[derive(Clone, Debug)]
pub(crate) struct Workspace<S> {
    /// Iᶜ. Shape: bodies. Written by: `pass`.
    IC: Vec<Inertia<S>>,
    /// 2Bᶜ. Shape: bodies. Written by: `pass`.
    BC: Vec<Coriolis<S>>,
    /// Shape: nv × nv. Written by: `pass`.
    C: DMatrix<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self {
            IC: vec![Inertia::zero(); size.bodies],
            BC: vec![Coriolis::zero(); size.bodies],
            C: DMatrix::from_element(size.nv, size.nv, S::zero()),
        }
    }
}

/// The whole algorithm, for bodies whose velocities are known.
#[inline(always)]
fn pass<L: Layout>(l: &L, w: &World<L::S>, m: &Moving<L::S>, d: &mut Workspace<L::S>) {
    let (S, dS, half) = (&w.S, &m.dS, L::S::splat(0.5));
    let Workspace { IC, BC, C } = d;
    for i in l.bodies() {
        IC[i] = w.oX[i].act(l.inertia(i));
        BC[i] = Coriolis::of(IC[i], m.v[i]);
    }
    let C = C.as_mut_slice();
    C.fill(L::S::zero());
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let s = l.slot(i) + k;
            let column = own[k];
            let IS = IC[i] * S[s]; // Iᶜ S_d
            let BS = BC[i].apply_transpose(S[s]).scale(half); // Bᵀ S_d
            let F = IC[i] * dS[s] + BC[i].apply(S[s]).scale(half); // Iᶜ Ṡ_d + B S_d
            for &e in before {
                let (S_e, dS_e) = (l.at(S, e), l.at(dS, e));
                l.add_at(C, column, e, dS_e.dot(IS) + S_e.angular.dot(BS)); // C_de
                l.add_at(C, e, column, S_e.dot(F)); // C_ed
            }
            for &e in own {
                let (S_e, dS_e) = (l.at(S, e), l.at(dS, e));
                l.add_at(C, column, e, dS_e.dot(IS) + S_e.angular.dot(BS));
            }
        }
        let (IC_i, BC_i) = (IC[i], BC[i]);
        l.push(IC, i, IC_i);
        l.push(BC, i, BC_i);
    }
}

/// C(q, v), the Coriolis matrix by Christoffel symbols: C v = h − g, Ṁ = C + Cᵀ, so that Ṁ − 2C is skew. In
/// O(n · depth).
///
/// q: nq numbers; v: nv. Returns the full nv × nv matrix (N m s/rad, N s/m). Allocates nothing.
/// Source: Echeandia and Wensing (2021), algorithm 1; see the head of the file.
///
/// ```
/// use condyle_dynamics::{Data, coriolis_matrix, gravity, nonlinear_effects, robots};
/// use nalgebra::DVector;
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v) = ([0.3; 7], [0.1; 7]);
/// let forces = coriolis_matrix(&arm, &mut data, &q, &v) * DVector::from_row_slice(&v);
/// let h = DVector::from_row_slice(nonlinear_effects(&arm, &mut data, &q, &v));
/// let g = DVector::from_row_slice(gravity(&arm, &mut data, &q));
/// assert!((forces - (h - g)).amax() < 1e-13);
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another size.
pub fn coriolis_matrix<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> &'d DMatrix<S> {
    data.check(model);
    check("q", q.len(), model.nq);
    check("v", v.len(), model.nv);
    let l = Single::new(model);
    place(&l, &mut data.world, q);
    advance(&l, &data.world, &mut data.moving, v);
    pass(&l, &data.world, &data.moving, &mut data.coriolis);
    &data.coriolis.C
}
