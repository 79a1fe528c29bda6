//! Joint-space inertia matrix M, and the inverse of M.

use super::limbs;
use crate::data::Data;
use crate::passes::kinematics::positions;
use crate::passes::{aba, crba, minv};
use crate::selection::InverseMethod;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Constant, Matrix, Scalar};

/// Computes the joint-space inertia matrix M(q), in O(n · depth). With M, the efforts are τ = M a + h, and the kinetic
/// energy is ½ vᵀ M v.
///
/// q: nq numbers. Returns the full symmetric nv × nv matrix, including armature. Allocates nothing. Source:
/// Featherstone (2008), table 6.2.
///
/// ```
/// use condyle_dynamics::{Data, crba, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let M = crba(&arm, &mut data, &[0.3; 7]);
/// assert_eq!(M[(0, 6)], M[(6, 0)]);
/// assert!(M.clone().cholesky().is_some()); // positive definite
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, or `data` was made for a model of another tree.
#[track_caller]
pub fn crba<'d, S: Scalar, R: Constant<S>>(model: &Model<R>, data: &'d mut Data<S>, q: &[S]) -> &'d Matrix<S> {
    data.check(model);
    check("q", q.len(), model.nq());
    if !limbs::crba(model, data, q) {
        positions(model, &mut data.world, q);
        crba::run(model, &data.world, &mut data.crba);
    }
    &data.crba.M
}

/// Computes M(q)⁻¹ in O(n²). Column k of M⁻¹ contains the accelerations for a unit effort at coordinate k.
///
/// q: nq numbers. Returns the full symmetric nv × nv matrix. Allocates nothing. Source: Carpentier (2018). Some models
/// use other methods. Trees with short branches, and models whose joints share a coordinate (mimic), use the factor of
/// Featherstone (2005), [`Ltdl`](crate::Ltdl). Chains of at most eight coordinates use Gauss–Jordan elimination.
///
/// ```
/// use condyle_dynamics::{Data, crba, minv, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let M = crba(&arm, &mut data, &[0.3; 7]).clone();
/// let identity = M * minv(&arm, &mut data, &[0.3; 7]);
/// assert!((identity - nalgebra::DMatrix::identity(7, 7)).amax() < 1e-12);
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn minv<'d, S: Scalar, R: Constant<S>>(model: &Model<R>, data: &'d mut Data<S>, q: &[S]) -> &'d Matrix<S> {
    data.check(model);
    model.check_regular();
    check("q", q.len(), model.nq());
    let method = data.methods.inverse;
    match method {
        InverseMethod::ArticulatedBodies => {
            positions(model, &mut data.world, q);
            aba::factors(model, &data.world, &mut data.aba);
            minv::from_factors(model.columns(), &data.world, &data.aba, &mut data.minv);
        }
        _ if limbs::minv(model, data, q) => {}
        _ => {
            crba(model, data, q);
            minv::from_matrix(&mut data.minv, &data.crba.M, method);
        }
    }
    &data.minv.Minv
}
