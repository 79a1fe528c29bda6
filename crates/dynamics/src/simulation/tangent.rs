//! Products with the Jacobians of the joints' Lie groups. The Jacobians are block-diagonal, with one block per joint.

use condyle_model::Model;
use condyle_model::joint::{GroupJacobian, Joint};
use condyle_spatial::{Constant, Cross, Force, Motion, Scalar};
use core::ops::Range;

/// Maximum size of a block. A free joint has this size.
const SIX: usize = 6;
/// Number of terms of a power series in ad_y, the adjoint matrix of the tangent vector y. The series has full precision
/// if a joint turns by at most 1 rad in a step, and ten correct digits up to 2.5 rad.
const TERMS: i32 = 18;

/// Returns each joint that has its own coordinates, with the offset of these coordinates in v.
fn joints<R>(model: &Model<R>) -> impl Iterator<Item = (Joint, usize)> + '_ {
    model.nodes().iter().skip(1).filter(|n| n.mimic.is_none()).map(|n| (n.joint, n.idx_v))
}

/// Returns the block of a joint at the tangent vector y, stored by columns, or `None` if the block is the identity.
fn block<S: Scalar>(joint: Joint, which: GroupJacobian, y: &[S]) -> Option<[[S; SIX]; SIX]> {
    let columns = joint.jacobian(which, y)?.columns();
    let mut block = [[S::zero(); SIX]; SIX];
    for (block, &column) in block.iter_mut().zip(joint.axes()) {
        let column = columns[column].to_array();
        for (entry, &row) in block.iter_mut().zip(joint.axes()) {
            *entry = column[row];
        }
    }
    Some(block)
}

fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    let mut sum = S::zero();
    for (&a, &b) in a.iter().zip(b) {
        sum = a.mul_add(b, sum);
    }
    sum
}

/// Returns the blocks at y that differ from the identity, each with the range of coordinates of its joint.
fn blocks<'a, S: Scalar, R>(
    model: &'a Model<R>,
    which: GroupJacobian,
    y: &'a [S],
) -> impl Iterator<Item = (Range<usize>, [[S; SIX]; SIX])> + 'a {
    let own = |(joint, at): (Joint, usize)| (joint, at..at + joint.nv());
    joints(model).map(own).filter_map(move |(joint, own)| block(joint, which, &y[own.clone()]).map(|J| (own, J)))
}

/// Computes out = J(y) x, with the Jacobian `which` of the joints' groups.
pub(super) fn multiply<S: Scalar, R>(model: &Model<R>, which: GroupJacobian, y: &[S], x: &[S], out: &mut [S]) {
    out.copy_from_slice(x);
    for (own, J) in blocks(model, which, y) {
        let out = &mut out[own.clone()];
        out.fill(S::zero());
        for (J, &x) in J.iter().zip(&x[own]) {
            for (out, &J) in out.iter_mut().zip(J) {
                *out = J.mul_add(x, *out);
            }
        }
    }
}

/// Replaces A by A J(y), with the Jacobian `which` of the joints' groups. A is a square matrix stored by columns.
pub(super) fn multiply_right<S: Scalar, R>(model: &Model<R>, which: GroupJacobian, y: &[S], A: &mut [S]) {
    let nv = model.nv();
    for (own, J) in blocks(model, which, y) {
        for i in 0..nv {
            let mut row = [S::zero(); SIX];
            for (x, j) in row.iter_mut().zip(own.clone()) {
                *x = A[j * nv + i];
            }
            for (J, j) in J.iter().zip(own.clone()) {
                A[j * nv + i] = dot(&row, J);
            }
        }
    }
}

/// Replaces A by J(y)ᵀ A, with the Jacobian `which` of the joints' groups. A is a vector or a matrix stored by columns.
pub(super) fn multiply_left_transposed<S: Scalar, R>(model: &Model<R>, which: GroupJacobian, y: &[S], A: &mut [S]) {
    for (own, J) in blocks(model, which, y) {
        for column in A.chunks_exact_mut(model.nv()) {
            let mut old = [S::zero(); SIX];
            old[..own.len()].copy_from_slice(&column[own.clone()]);
            for (x, J) in column[own.clone()].iter_mut().zip(&J) {
                *x = dot(&old, J);
            }
        }
    }
}

/// Returns two items for each joint whose group is not commutative: the indices of the joint's unit twists, and the
/// offset of the joint's coordinates in v.
fn twists<R>(model: &Model<R>) -> impl Iterator<Item = (&'static [usize], usize)> + '_ {
    joints(model).filter(|(joint, _)| !joint.commutes()).map(|(joint, at)| (joint.axes(), at))
}

/// Returns the armature of coordinate k of a joint. For the linear coordinates of a free joint, returns 0
/// (`free_armature.rs`).
fn rotor<S: Scalar, R: Constant<S>>(model: &Model<R>, axes: &[usize], at: usize, k: usize) -> S {
    if axes.len() == SIX && k < 3 { S::zero() } else { model.armature()[at + k].lift() }
}

/// Returns the coordinates of a joint as the six numbers of a twist.
fn embed<S: Scalar>(axes: &[usize], x: impl Fn(usize) -> S) -> [S; SIX] {
    let mut six = [S::zero(); SIX];
    for (k, &axis) in axes.iter().enumerate() {
        six[axis] = x(k);
    }
    six
}

/// Computes f += w ×* (D w) for each joint whose group is not commutative. D is the diagonal matrix of the armature,
/// and w is the velocity.
///
/// Every algorithm treats armature as D q̈, with the diagonal matrix D of the armature, except along the linear
/// coordinates of free joints (`free_armature.rs`). For the velocity w, a Lagrangian with the term ½ wᵀ D w would turn
/// the momentum D w with the body if the group of the joint is not commutative. The force w ×* (D w) cancels this
/// effect and does no work.
pub(super) fn add_rotors<S: Scalar, R: Constant<S>>(model: &Model<R>, w: &[S], f: &mut [S]) {
    for (axes, at) in twists(model) {
        let twist = Motion::from(embed(axes, |k| w[at + k]));
        let momentum = Force::from(embed(axes, |k| w[at + k] * rotor(model, axes, at, k)));
        let force = twist.cross(momentum).to_array();
        for (k, &axis) in axes.iter().enumerate() {
            f[at + k] += force[axis];
        }
    }
}

/// Adds the derivative, with respect to w, of the force that [`add_rotors`] computes to A. A is a square matrix stored
/// by columns.
pub(super) fn add_rotors_slope<S: Scalar, R: Constant<S>>(model: &Model<R>, w: &[S], A: &mut [S]) {
    for (axes, at) in twists(model) {
        let twist = Motion::from(embed(axes, |k| w[at + k]));
        let momentum = Force::from(embed(axes, |k| w[at + k] * rotor(model, axes, at, k)));
        for j in 0..axes.len() {
            let unit = embed(axes, |k| if k == j { S::one() } else { S::zero() });
            let turned = Force::from(unit).scale(rotor(model, axes, at, j));
            let column = (Motion::from(unit).cross(momentum) + twist.cross(turned)).to_array();
            for (i, &axis) in axes.iter().enumerate() {
                A[(at + j) * model.nv() + at + i] += column[axis];
            }
        }
    }
}

/// Computes A −= s ∂(J_exp(−y)ᵀ p)/∂y at constant p. A is a square matrix stored by columns.
///
/// J_exp(−y) is Σ ad_yᵏ/(k+1)!. With pₖ = (ad_yᵀ)ᵏ p and ad_yᵀ p = −y ×* p, the derivative in the direction δ is Σ
/// Dₖ/(k+1)!, with D₀ = 0 and Dₖ₊₁ = ad_δᵀ pₖ + ad_yᵀ Dₖ.
pub(super) fn subtract_slope<S: Scalar, R>(model: &Model<R>, y: &[S], p: &[S], s: S, A: &mut [S]) {
    for (axes, at) in twists(model) {
        let y6 = Motion::from(embed(axes, |k| y[at + k]));
        let p6 = Force::from(embed(axes, |k| p[at + k]));
        for j in 0..axes.len() {
            let unit = Motion::from(embed(axes, |k| if k == j { S::one() } else { S::zero() }));
            let (mut pk, mut Dk, mut sum) = (p6, Force::zero(), Force::zero());
            let mut inverse_factorial = 1.0;
            for k in 1..=TERMS {
                Dk = -(unit.cross(pk) + y6.cross(Dk)); // Dₖ = ad_δᵀ pₖ₋₁ + ad_yᵀ Dₖ₋₁
                pk = -y6.cross(pk); // pₖ = ad_yᵀ pₖ₋₁
                inverse_factorial /= f64::from(k + 1);
                sum = Dk.scale_add(S::splat(inverse_factorial), sum);
            }
            let sum = sum.to_array();
            for (i, &axis) in axes.iter().enumerate() {
                A[(at + j) * model.nv() + at + i] -= sum[axis] * s;
            }
        }
    }
}
