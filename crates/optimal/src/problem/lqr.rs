//! Action with linear dynamics and a quadratic cost.
#![allow(non_snake_case)] // names follow the literature

use super::action::ActionModel;
use crate::lq::LqKnot;

/// Action x⁺ = A x + B u + f with the cost ℓ = ½ xᵀQx + xᵀSu + ½ uᵀRu + qᵀx + rᵀu and the bounds lower ≤ u ≤ upper.
/// These matrices and vectors are fields of an [`LqKnot`].
///
/// An `Lqr` without controls is a terminal action. Crocoddyl's equivalent is `ActionModelLQR`.
///
/// ```
/// use condyle_optimal::{Fddp, LqKnot, Lqr, Problem};
///
/// // x⁺ = x + u, ℓ = ½ (x² + u²): one step solves it.
/// let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
/// (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0, 1.0);
/// let mut problem = Problem::new(vec![1.0], vec![Box::new(Lqr::new(knot))], vec![0; 30], Box::new(Lqr::new(end)))?;
/// let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 31], &[0.0; 30])?.clone();
/// assert!((solution.u(0)[0] + 0.618_034).abs() < 1e-6);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Lqr(LqKnot);

impl Lqr {
    /// Creates the action with the matrices of `knot`.
    ///
    /// # Panics
    /// If the shapes of the knot's matrices do not fit each other, or the knot has constraint rows.
    #[track_caller]
    pub fn new(knot: LqKnot) -> Self {
        assert!(knot.rows.is_empty(), "`rows` is not empty, but an action has no constraint rows: see `Constrained`");
        let (n, m) = (knot.ndx(), knot.nu());
        for (name, found, expected) in [
            ("A", knot.A.shape(), (n, n)),
            ("B", knot.B.shape(), (n, m)),
            ("Q", knot.Q.shape(), (n, n)),
            ("S", knot.S.shape(), (n, m)),
            ("R", knot.R.shape(), (m, m)),
            ("f", knot.f.shape(), (n, 1)),
            ("lower", knot.lower.shape(), (m, 1)),
            ("upper", knot.upper.shape(), (m, 1)),
        ] {
            assert!(found == expected, "`{name}` has shape {found:?}, expected {expected:?}");
        }
        Self(knot)
    }

    /// Returns the knot with the matrices of the action.
    pub fn knot(&self) -> &LqKnot {
        &self.0
    }
}

/// Computes y += X z. X has as many columns as z has entries.
fn add_product(y: &mut [f64], X: &[f64], z: &[f64]) {
    for (column, z) in X.chunks_exact(y.len()).zip(z) {
        y.iter_mut().zip(column).for_each(|(y, x)| *y += x * z);
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Returns the product xᵀ X z.
fn product(x: &[f64], X: &[f64], z: &[f64]) -> f64 {
    X.chunks_exact(x.len().max(1)).zip(z).map(|(column, z)| dot(x, column) * z).sum()
}

impl ActionModel for Lqr {
    fn nx(&self) -> usize {
        self.0.ndx()
    }

    fn nu(&self) -> usize {
        self.0.nu()
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        Some((self.0.lower.as_slice(), self.0.upper.as_slice()))
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(self.clone()))
    }

    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let LqKnot { A, B, f, Q, S, R, q, r, .. } = &self.0;
        next.copy_from_slice(f.as_slice());
        add_product(next, A.as_slice(), x); // A x + B u + f
        add_product(next, B.as_slice(), u);
        let quadratic = 0.5 * product(x, Q.as_slice(), x) + 0.5 * product(u, R.as_slice(), u);
        quadratic + product(x, S.as_slice(), u) + dot(q.as_slice(), x) + dot(r.as_slice(), u)
    }

    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let own = &self.0;
        for (to, from) in [
            (&mut knot.A, &own.A),
            (&mut knot.B, &own.B),
            (&mut knot.Q, &own.Q),
            (&mut knot.S, &own.S),
            (&mut knot.R, &own.R),
        ] {
            to.copy_from(from);
        }
        knot.q.copy_from(&own.q);
        knot.r.copy_from(&own.r);
        add_product(knot.q.as_mut_slice(), own.Q.as_slice(), x); // q + Q x + S u
        add_product(knot.q.as_mut_slice(), own.S.as_slice(), u);
        if !u.is_empty() {
            add_product(knot.r.as_mut_slice(), own.R.as_slice(), u); // r + R u + Sᵀ x
            for (r, column) in knot.r.iter_mut().zip(own.S.as_slice().chunks_exact(x.len())) {
                *r += dot(column, x);
            }
        }
    }
}
