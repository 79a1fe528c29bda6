//! Derivatives of recorded functions, computed with dual numbers whose components are expressions.

use crate::expression::Expression;
use condyle_model::{Model, integrate};
use condyle_spatial::Scalar;
use condyle_spatial::lane_dual::LaneDual;
use nalgebra::DMatrix;

/// Dual number of expressions: a value, and the value's derivative in one direction.
pub type DualExpression = LaneDual<Expression>;

/// Records f(x) and its Jacobian ∂f(x ⊕ δ)/∂δ, inside of [`record`](crate::record).
///
/// x begins with a position of nq numbers. All other numbers of x form a vector space, as in
/// [`condyle_dynamics::jacobian`]. f must be generic code that accepts dual numbers. A value that several columns of
/// the Jacobian need is computed once.
///
/// ```
/// use condyle_codegen::{jacobian, record};
/// use condyle_dynamics::{Data, forward_kinematics, robots};
/// let arm = robots::arm7();
/// let tool = arm.frame("tool")?;
/// let height = record("height", "The height of the tool and its gradient.", |r| {
///     let q = r.input("q", 7, "position (rad)");
///     let mut data = Data::new(&arm);
///     let (z, dz) = jacobian(&arm, &q, |q| vec![forward_kinematics(&arm, &mut data, q).frame(tool).translation.z]);
///     r.output("z", &z, "height (m)");
///     r.matrix("dz_dq", &dz, "its gradient (m/rad)");
/// });
/// assert_eq!(height.outputs[1].columns, 7);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If x has fewer than nq numbers, if the number of results of f differs between directions, or if no recording is in
/// progress.
pub fn jacobian<R>(
    model: &Model<R>,
    x: &[Expression],
    mut f: impl FnMut(&[DualExpression]) -> Vec<DualExpression>,
) -> (Vec<Expression>, DMatrix<Expression>) {
    assert!(x.len() >= model.nq(), "x: expected at least {} numbers, found {}", model.nq(), x.len());
    let directions = x.len() - model.nq() + model.nv();
    let mut columns = Vec::with_capacity(directions);
    let mut value = Vec::new();
    for k in 0..directions.max(1) {
        let unit = |j: usize| if j == k { Expression::one() } else { Expression::zero() };
        let delta: Vec<_> = (0..directions).map(|j| LaneDual { re: Expression::zero(), eps: unit(j) }).collect();
        let mut moved: Vec<_> = x.iter().map(|&re| LaneDual { re, eps: Expression::zero() }).collect();
        let (q, rest) = moved.split_at_mut(model.nq());
        let here = q.to_vec();
        integrate(model, &here, &delta[..model.nv()], q);
        rest.iter_mut().zip(&delta[model.nv()..]).for_each(|(x, &d)| *x += d);
        let along = f(&moved);
        assert!(k == 0 || along.len() == value.len(), "f: gave {} results, then {}", value.len(), along.len());
        value = along.iter().map(|y| y.re).collect();
        columns.push(along);
    }
    let J = DMatrix::from_fn(value.len(), directions, |i, k| columns[k][i].eps);
    (value, J)
}
