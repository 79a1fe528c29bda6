//! The derivatives of forward dynamics, by hand.
//!
//! M(q) q̈ + h(q, v) = τ holds for every q and v, so with the derivatives of inverse dynamics at that q̈ (Carpentier and
//! Mansard, *Analytical derivatives of rigid body dynamics algorithms*, 2018, equation 18)
//!
//! ```text
//! ∂q̈/∂q = −M⁻¹ ∂τ/∂q,   ∂q̈/∂v = −M⁻¹ ∂τ/∂v,   ∂q̈/∂τ = M⁻¹
//! ```

use crate::aba::{self, check_arguments, one_by_one};
use crate::articulated_solve::{self, minus_solve};
use crate::data::Data;
use crate::dispatch::kernel;
use crate::inputs::State;
use crate::kinematics::World;
use crate::limbs;
use crate::ltdl::axpy;
use crate::minv;
use crate::product;
use crate::rnea_derivatives;
use crate::workspace::{Size, filled, zero_matrix};
use condyle_linalg::sparsity::NonzeroRows;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Scalar};
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// The acceleration. Shape: nv. Written by: `aba_derivatives`.
    a: Vec<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `aba_derivatives`.
    pub da_dv: DMatrix<S>,
    solve: articulated_solve::Workspace<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new<R>(size: Size, model: &Model<R>) -> Self {
        let square = zero_matrix(size.nv, size.nv);
        let solve = articulated_solve::Workspace::new(model.columns(), size.nv);
        Self { a: filled(S::zero(), size.nv), da_dq: square.clone(), da_dv: square, solve }
    }
}

/// C = −A B, of square matrices, where column j of B has zeros but in the rows of `nonzero_rows[j]`.
///
/// Four columns with the same rows, as those of one limb have, go together: as many entries of each as there are registers
/// for stay there while their sums grow. Other columns take four columns of A at a time, so that they are loaded and stored
/// a quarter as often.
#[inline(always)]
pub(crate) fn minus_product<S: Scalar>(A: &[S], B: &[S], C: &mut [S], nonzero_rows: &[NonzeroRows]) {
    let (n, mut j) = (nonzero_rows.len(), 0);
    while j < n {
        let NonzeroRows { rows, same_pattern } = &nonzero_rows[j];
        let many = if *same_pattern >= 4 { 4 } else { 1 };
        let (b, c) = (&B[j * n..(j + many) * n], &mut C[j * n..(j + many) * n]);
        match (many, size_of::<S>()) {
            (4, 64..) => four_columns::<S, 4>(A, b, c, rows, n),
            (4, 16..) => four_columns::<S, 2>(A, b, c, rows, n),
            (4, _) => four_columns::<S, 8>(A, b, c, rows, n),
            _ => {
                c.fill(S::zero());
                subtract_column(A, b, c, rows);
            }
        }
        j += many;
    }
}

/// Twice `minus_product` with one A that is symmetric, in lanes, where matrices are too large for the nearest cache.
#[inline(always)]
fn minus_products<S: Scalar>(A: &[S], B: [&[S]; 2], [C0, C1]: [&mut [S]; 2], nonzero_rows: &[NonzeroRows]) {
    let (n, mut j) = (nonzero_rows.len(), 0);
    while j < n {
        let NonzeroRows { rows, same_pattern } = &nonzero_rows[j];
        let many = (*same_pattern).min(4);
        let columns = j * n..(j + many) * n;
        let B = [&B[0][columns.clone()], &B[1][columns.clone()]];
        let C = [&mut C0[columns.clone()], &mut C1[columns]];
        match many {
            4 => twice::<S, 4, 2>(A, B, C, rows, n),
            3 => twice::<S, 3, 2>(A, B, C, rows, n),
            2 => twice::<S, 2, 4>(A, B, C, rows, n),
            _ => twice::<S, 1, 4>(A, B, C, rows, n),
        }
        j += many;
    }
}

/// The sums of `subtract_column` for N rows of M columns at a time: of A, N columns are read from end to end.
#[inline(always)]
fn twice<S: Scalar, const M: usize, const N: usize>(A: &[S], B: [&[S]; 2], C: [&mut [S]; 2], rows: &[usize], n: usize) {
    let ([B0, B1], [C0, C1]) = (B, C);
    let mut i = 0;
    while i < n {
        let mut a = [&A[..n]; N];
        for y in 0..N {
            a[y] = &A[(i + y).min(n - 1) * n..][..n];
        }
        let mut c = [[[S::zero(); 2]; M]; N];
        for &k in rows {
            for x in 0..M {
                let (b0, b1) = (-B0[x * n + k], -B1[x * n + k]);
                for y in 0..N {
                    c[y][x][0] = a[y][k].mul_add(b0, c[y][x][0]);
                    c[y][x][1] = a[y][k].mul_add(b1, c[y][x][1]);
                }
            }
        }
        for y in 0..N.min(n - i) {
            for x in 0..M {
                C0[x * n + i + y] = c[y][x][0];
                C1[x * n + i + y] = c[y][x][1];
            }
        }
        i += N;
    }
}

/// c −= A b, where b has zeros but in these rows.
#[inline(always)]
pub(crate) fn subtract_column<S: Scalar>(A: &[S], b: &[S], c: &mut [S], rows: &[usize]) {
    let n = c.len();
    let (fours, rest) = rows.as_chunks::<4>();
    for &[k0, k1, k2, k3] in fours {
        let (a0, a1) = (&A[k0 * n..(k0 + 1) * n], &A[k1 * n..(k1 + 1) * n]);
        let (a2, a3) = (&A[k2 * n..(k2 + 1) * n], &A[k3 * n..(k3 + 1) * n]);
        let (b0, b1, b2, b3) = (-b[k0], -b[k1], -b[k2], -b[k3]);
        for i in 0..n {
            c[i] = a3[i].mul_add(b3, a2[i].mul_add(b2, a1[i].mul_add(b1, a0[i].mul_add(b0, c[i]))));
        }
    }
    for &k in rest {
        axpy(-b[k], &A[k * n..(k + 1) * n], c);
    }
}

/// The sums of `subtract_column`, in the same order, so that the bits are the same.
#[inline(always)]
fn four_columns<S: Scalar, const N: usize>(A: &[S], B: &[S], C: &mut [S], rows: &[usize], n: usize) {
    let (b0, b1, b2, b3) = (&B[..n], &B[n..2 * n], &B[2 * n..3 * n], &B[3 * n..4 * n]);
    let mut i = 0;
    while i + N <= n {
        let mut c = [[S::zero(); N]; 4];
        for &k in rows {
            let a = &A[k * n + i..k * n + i + N];
            let b = [-b0[k], -b1[k], -b2[k], -b3[k]];
            for y in 0..4 {
                for x in 0..N {
                    c[y][x] = a[x].mul_add(b[y], c[y][x]);
                }
            }
        }
        for y in 0..4 {
            C[y * n + i..y * n + i + N].copy_from_slice(&c[y]);
        }
        i += N;
    }
    while i < n {
        let mut c = [S::zero(); 4];
        for &k in rows {
            let a = A[k * n + i];
            let b = [-b0[k], -b1[k], -b2[k], -b3[k]];
            for y in 0..4 {
                c[y] = a.mul_add(b[y], c[y]);
            }
        }
        for y in 0..4 {
            C[y * n + i] = c[y];
        }
        i += 1;
    }
}

/// q̈ = aba(q, v, τ) and its derivatives: three full nv × nv matrices, and [all others](Self::with_respect_to) when asked.
#[derive(Clone, Copy, Debug)]
pub struct AbaDerivatives<'d, S, R = f64> {
    /// q̈ itself, nv numbers.
    pub a: &'d [S],
    /// ∂q̈/∂q in the tangent space: the change of q̈ when q moves to q ⊕ δ, per δ.
    pub da_dq: &'d DMatrix<S>,
    /// ∂q̈/∂v.
    pub da_dv: &'d DMatrix<S>,
    /// ∂q̈/∂τ = M(q)⁻¹.
    pub da_dtau: &'d DMatrix<S>,
    pub(crate) state: State<'d, S, R>,
}

kernel! {
    /// ∂q̈ = −M⁻¹ ∂τ by products.
    fn products<S>(Minv: &[S], dtau: [&[S]; 2], da: [&mut [S]; 2], coupled: &[NonzeroRows]) {
        if S::LANES > 1 {
            minus_products(Minv, dtau, da, coupled);
        } else {
            dtau.into_iter().zip(da).for_each(|(dtau, da)| minus_product(Minv, dtau, da, coupled));
        }
    }
}

kernel! {
    /// ∂q̈ = −M⁻¹ ∂τ by the factors of the articulated bodies.
    fn solves<S>(world: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>, dtau: [&[S]; 2]) {
        let Workspace { da_dq, da_dv, solve, .. } = d;
        minus_solve(world, f, solve, dtau, [da_dq.as_mut_slice(), da_dv.as_mut_slice()]);
    }
}

/// [`aba`](crate::aba) and its derivatives with respect to q, v and τ, exact.
///
/// q: nq numbers; v, tau: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for none.
/// Returns q̈ and three nv × nv matrices, in O(n · depth) for what goes into them and O(n³) for the products with M⁻¹.
/// Allocates nothing. Source: Carpentier and Mansard (2018), equation 18.
///
/// ```
/// use condyle_dynamics::{Data, aba_derivatives, minv, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let da_dtau = aba_derivatives(&arm, &mut data, &q, &v, &tau, &[]).da_dtau.clone();
/// assert_eq!(&da_dtau, minv(&arm, &mut data, &q));
/// ```
///
/// # Panics
/// If an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
pub fn aba_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> AbaDerivatives<'d, S, R> {
    check_arguments(model, data, q, v, tau, f_ext);
    if data.minv.by_factor()
        && !data.aba_derivatives.solve.pays()
        && limbs::run(limbs::Task::AbaDerivatives, model, data, q, v, tau, f_ext)
    {
        data.aba_derivatives.a.copy_from_slice(&data.aba.qdd);
        data.rnea_derivatives.qd.copy_from_slice(v);
        data.rnea_derivatives.qdd.copy_from_slice(&data.aba.qdd);
        multiply(model, data);
    } else {
        in_turn(model, data, q, v, tau, f_ext);
    }
    let state = rnea_derivatives::view(model, data).state;
    data.aba_derivatives.view(data.minv.matrix(), state)
}

/// Body by body, for arguments that fit; leaves what second derivatives are made of.
pub(crate) fn in_turn<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) {
    one_by_one(model, data, q, v, tau, f_ext);
    let mut a_kept = core::mem::take(&mut data.aba_derivatives.a);
    a_kept.copy_from_slice(&data.aba.qdd);
    rnea_derivatives::run(model, &data.world, &mut data.rnea_derivatives, v, &a_kept, f_ext, &[]);
    data.aba_derivatives.a = a_kept;
    if data.minv.by_factor() {
        minv::from_matrix(&mut data.minv, &data.rnea_derivatives.dtau_da);
    } else {
        minv::from_factors(model.columns(), &data.world, &data.aba, &mut data.minv); // those of `aba`
    }
    if data.aba_derivatives.solve.pays() {
        let dtau = [data.rnea_derivatives.dtau_dq.as_slice(), data.rnea_derivatives.dtau_dv.as_slice()];
        solves(&data.world, &data.aba, &mut data.aba_derivatives, dtau);
    } else {
        multiply(model, data);
    }
}

/// ∂q̈ = −M⁻¹ ∂τ, after `rnea_derivatives` and `minv`.
fn multiply<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let (d, out) = (&data.rnea_derivatives, &mut data.aba_derivatives);
    let dtau = [d.dtau_dq.as_slice(), d.dtau_dv.as_slice()];
    let da = [out.da_dq.as_mut_slice(), out.da_dv.as_mut_slice()];
    let Minv = data.minv.matrix().as_slice();
    if S::LANES > 1 || !product::minus_products(Minv, dtau, da, model.nonzero_rows()) {
        let (d, out) = (&data.rnea_derivatives, &mut data.aba_derivatives);
        let dtau = [d.dtau_dq.as_slice(), d.dtau_dv.as_slice()];
        products(Minv, dtau, [out.da_dq.as_mut_slice(), out.da_dv.as_mut_slice()], model.nonzero_rows());
    }
}

impl<S> Workspace<S> {
    pub(crate) fn a(&self) -> &[S] {
        &self.a
    }

    /// What `aba_derivatives` has left.
    pub(crate) fn view<'d, R>(&'d self, Minv: &'d DMatrix<S>, state: State<'d, S, R>) -> AbaDerivatives<'d, S, R> {
        AbaDerivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_dtau: Minv, state }
    }
}
