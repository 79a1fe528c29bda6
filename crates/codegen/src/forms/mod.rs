//! Algorithms in the forms that have the fewest operations when they are recorded for one robot.
//!
//! Code recorded for one robot has neither loops nor operations with zeros. So ABA and CRBA compute in the bodies'
//! frames, where many operands are constants. If the inertia matrix M is sparse, accelerations and their derivatives
//! are computed from M and its factor. M⁻¹ is computed from the branches of this factor. The generator calls these
//! functions in place of the library's functions of the same names. Functions that users record can also call them.

mod aba;
pub(crate) mod branches;
mod crba;
pub(crate) mod joint_placement;

use branches::Branches;
use condyle_dynamics::selection::{SHORT_CHAIN, inverse_by_factor, is_short_chain};
use condyle_dynamics::{Data, forward_kinematics, rnea, rnea_derivatives, subtract_armature_bias};
use condyle_linalg::gauss_jordan::gauss_jordan;
use condyle_linalg::tree_product::neg_products;
use condyle_linalg::{Ltdl, check};
use condyle_model::Model;
use condyle_model::layout::Single;
use condyle_spatial::{Constant, Force, Matrix, Scalar, Vec3};
use nalgebra::{DMatrix, DVectorView};

/// Acceleration q̈ and its derivatives, as in [`condyle_dynamics::AbaDerivatives`].
#[derive(Clone, Debug)]
pub struct ForwardDerivatives<S> {
    /// Acceleration q̈, nv numbers.
    pub a: Vec<S>,
    /// Derivative ∂q̈/∂q in the tangent space, nv × nv.
    pub da_dq: DMatrix<S>,
    /// Derivative ∂q̈/∂v, nv × nv.
    pub da_dv: DMatrix<S>,
    /// Derivative ∂q̈/∂τ = M⁻¹, the inverse inertia matrix, nv × nv.
    pub da_dtau: DMatrix<S>,
}

/// Computes the inertia matrix M, nv × nv, as [`condyle_dynamics::crba`] does.
///
/// # Panics
/// If `q` does not have nq numbers.
pub fn crba<S: Scalar, R: Constant<S>>(model: &Model<R>, q: &[S]) -> DMatrix<S> {
    check("q", q.len(), model.nq());
    let mut M = zeros(model);
    crba::pass(&Single::<S, R>::new(model), q, M.as_mut_slice());
    M
}

/// Computes q̈, nv numbers, as [`condyle_dynamics::aba`] does.
///
/// # Panics
/// As in [`condyle_dynamics::aba`].
pub fn aba<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> Vec<S> {
    if model.has_mimic() {
        let mut a = free_effort(model, data, q, v, tau, f_ext);
        let mut factor = Ltdl::new(model);
        factor.factorize(&crba(model, q));
        factor.solve(&mut a); // q̈ = M⁻¹ (τ − h)
        return a;
    }
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check("tau", tau.len(), model.nv());
    let (found, bodies) = (f_ext.len(), model.bodies().len());
    assert!(found == 0 || found == bodies, "f_ext: expected no force or {bodies} (one for each body), found {found}");
    model.check_regular();
    let mut a = vec![S::zero(); model.nv()];
    let mut tau = tau.to_vec();
    subtract_armature_bias(model, v, &mut tau);
    aba::pass(&Single::<S, R>::new(model), q, v, &tau, f_ext, &mut a);
    a
}

/// Computes the inverse inertia matrix M⁻¹, nv × nv, as [`condyle_dynamics::minv`] does.
///
/// # Panics
/// As in [`condyle_dynamics::minv`].
pub fn minv<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, q: &[S]) -> DMatrix<S> {
    match Inverse::of(model, || crba(model, q)) {
        Some(inverse) => inverse.Minv,
        None => condyle_dynamics::minv(model, data, q).clone_owned(),
    }
}

/// Computes q̈ and its derivatives, as [`condyle_dynamics::aba_derivatives`] does. The acceleration is computed from
/// the inertia matrix M and its factor, which takes fewer operations than the articulated-body algorithm. The
/// derivatives ∂q̈ are also computed from the factor if this takes fewer operations than M⁻¹.
///
/// # Panics
/// As in [`condyle_dynamics::aba_derivatives`].
pub fn aba_derivatives<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> ForwardDerivatives<S> {
    let mut a = free_effort(model, data, q, v, tau, f_ext);
    let Some(inverse) = Inverse::of(model, || condyle_dynamics::crba(model, data, q).clone_owned()) else {
        let d = condyle_dynamics::aba_derivatives(model, data, q, v, tau, f_ext);
        let [da_dq, da_dv, da_dtau] = [d.da_dq, d.da_dv, d.da_dtau].map(Matrix::clone_owned);
        return ForwardDerivatives { a: d.a.to_vec(), da_dq, da_dv, da_dtau };
    };
    inverse.solve(&mut a); // q̈ = M⁻¹ (τ − h)
    let d = rnea_derivatives(model, data, q, v, &a, f_ext);
    let floating = floating::<S, R>(model);
    let known = |numbers: usize| floating.iter().flat_map(|&(_, first)| first..first + numbers).collect::<Vec<_>>();
    // ∂q̈ = −M⁻¹ ∂τ
    let [mut da_dq, mut da_dv] = inverse.neg_products(model, [(d.dtau_dq, known(6)), (d.dtau_dv, known(3))]);
    for (body, first) in floating {
        let turned = forward_kinematics(model, data, q).body(body).rotation.transpose_mul(model.gravity().lift());
        let omega = Vec3::new(v[first + 3], v[first + 4], v[first + 5]);
        for (da, column, u) in [(&mut da_dq, first + 3, turned), (&mut da_dv, first, -omega)] {
            for (k, x) in u.skew().columns().into_iter().enumerate() {
                da.as_mut_slice()[(column + k) * model.nv() + first..][..3].copy_from_slice(&x.to_array());
            }
        }
    }
    ForwardDerivatives { a, da_dq, da_dv, da_dtau: inverse.Minv }
}

/// Returns (body, first coordinate) of each floating body without armature on its linear coordinates. For such a body,
/// the derivatives of q̈ with respect to its first six positions and its first three velocities are known
/// ([`condyle_dynamics::aba_derivatives`]).
fn floating<S: Scalar, R: Constant<S>>(model: &Model<R>) -> Vec<(usize, usize)> {
    let is_free =
        |&(_, first): &(usize, usize)| model.armature()[first..first + 3].iter().all(|&x| x.lift() == S::zero());
    model.floating().map(|i| (i, model.nodes()[i].idx_v)).filter(is_free).collect()
}

/// Computes the efforts τ − h + Σ Jᵢᵀ f_ext,i, with the bias efforts h, the Jacobians Jᵢ of the bodies and the external
/// forces f_ext.
fn free_effort<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> Vec<S> {
    let h = rnea(model, data, q, v, &vec![S::zero(); model.nv()], f_ext);
    tau.iter().zip(h).map(|(&tau, &h)| tau - h).collect()
}

fn zeros<S: Scalar, R>(model: &Model<R>) -> DMatrix<S> {
    DMatrix::from_element(model.nv(), model.nv(), S::zero())
}

/// Inverse M⁻¹ of the inertia matrix, and the factor of M if the factor was computed.
struct Inverse<S> {
    factor: Option<Ltdl<S>>,
    Minv: DMatrix<S>,
}

impl<S: Scalar> Inverse<S> {
    /// Computes the inverse of the inertia matrix M. Returns `None` if, for this model, the library's algorithm
    /// computes M⁻¹ without M.
    fn of<R>(model: &Model<R>, M: impl FnOnce() -> DMatrix<S>) -> Option<Self> {
        model.check_regular();
        let (mut factor, mut Minv) = (Ltdl::new(model), zeros(model));
        if !inverse_by_factor(model, factor.nonzeros()) {
            return None;
        }
        if is_short_chain(model) {
            gauss_jordan::<S, SHORT_CHAIN>(&M(), &mut Minv);
            return Some(Self { factor: None, Minv });
        }
        factor.factorize(&M());
        Branches::new(&factor).inverse(&mut Minv);
        Some(Self { factor: Some(factor), Minv })
    }

    /// Replaces b by x = M⁻¹ b, with the inertia matrix M.
    fn solve(&self, b: &mut [S]) {
        match &self.factor {
            Some(factor) => factor.solve(b),
            None => {
                let row =
                    |row: DVectorView<'_, S>| row.iter().zip(&*b).fold(S::zero(), |sum, (&m, &b)| m.mul_add(b, sum));
                let x: Vec<S> = self.Minv.column_iter().map(row).collect(); // M⁻¹ is symmetric: rows equal columns
                b.copy_from_slice(&x);
            }
        }
    }

    /// Computes −M⁻¹ B for the inertia matrix M and two matrices B. The known columns of the results are not computed;
    /// they stay zero. The function uses M's factor if twice the number of the factor's entries is less than nv². Then
    /// solving with the factor takes fewer operations than multiplying by M⁻¹.
    fn neg_products<R>(&self, model: &Model<R>, B: [(&Matrix<S>, Vec<usize>); 2]) -> [DMatrix<S>; 2] {
        let n = model.nv();
        let mut all = B.map(|(B, known)| {
            let mut B = B.clone_owned();
            known.into_iter().for_each(|j| B.column_mut(j).fill(S::zero()));
            B
        });
        match &self.factor {
            Some(factor) if 2 * factor.nonzeros() < n * n => {
                let mut branches = Branches::new(factor);
                all.iter_mut().for_each(|X| X.as_mut_slice().chunks_exact_mut(n).for_each(|x| branches.minus_solve(x)));
                all
            }
            _ => {
                let [mut X, mut Y] = [zeros(model), zeros(model)];
                let both = [X.as_mut_slice(), Y.as_mut_slice()];
                neg_products(self.Minv.as_slice(), [0, 1].map(|k| all[k].as_slice()), both, model.nonzero_rows());
                [X, Y]
            }
        }
    }
}
