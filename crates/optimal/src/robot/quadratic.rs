//! How a residual's gradient and Gauss–Newton Hessian are added to a node: only where its Jacobian is not zero, and in
//! the lower triangle alone, which is mirrored at the end.

use crate::lq::LqNode;
use core::ops::Range;
use nalgebra::DMatrix;

/// Which part of Q has entries off its diagonal (beside the blocks of groups, which are written whole).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Filled {
    Diagonal,
    /// Of positions with positions.
    Positions,
    /// Any, of R too.
    All,
}

/// q += d and Q += diag(dd) on some entries, for a residual whose Jacobian is the identity there.
#[inline(always)]
pub(super) fn add_diagonal(q: &mut [f64], Q: &mut [f64], entries: Range<usize>, d: &[f64], dd: &[f64]) {
    let n = q.len();
    for i in entries {
        q[i] += d[i];
        Q[i * n + i] += dd[i];
    }
}

/// q += Jᵀ d, Q += Jᵀ diag(dd) J for a Jacobian with respect to q with entries in some columns alone, in order.
#[inline(always)]
pub(super) fn add_positions(node: &mut LqNode, J: &DMatrix<f64>, columns: &[usize], d: &[f64], dd: &[f64]) {
    match d.len() {
        3 => add_block::<3>(node, J, columns, d, dd),
        _ => add_block::<6>(node, J, columns, d, dd),
    }
}

#[inline(always)]
fn add_block<const N: usize>(node: &mut LqNode, J: &DMatrix<f64>, columns: &[usize], d: &[f64], dd: &[f64]) {
    let (rows, n) = (J.nrows(), node.q.len());
    let J = J.as_slice();
    let column = |c: usize| -> &[f64; N] { J[c * rows..].first_chunk().expect("a row for each entry of the residual") };
    for (k, &b) in columns.iter().enumerate() {
        let (J_b, mut weighted, mut slope) = (column(b), [0.0; N], 0.0);
        for i in 0..N {
            weighted[i] = dd[i] * J_b[i];
            slope += d[i] * J_b[i];
        }
        node.q[b] += slope; // Jᵀ a′
        let Q_b = &mut node.Q.as_mut_slice()[b * n..(b + 1) * n];
        for &a in &columns[k..] {
            let (J_a, mut sum) = (column(a), 0.0);
            for i in 0..N {
                sum += weighted[i] * J_a[i];
            }
            Q_b[a] += sum; // Jᵀ a″ J
        }
    }
}

/// q, r += d g and Q, S, R += dd g gᵀ for one row g of a Jacobian with respect to (q, v, u).
#[inline(always)]
pub(super) fn add_row(node: &mut LqNode, g: &[f64], d: f64, dd: f64) {
    let n = node.q.len();
    let (g_x, g_u) = g.split_at(n);
    let add = |out: &mut [f64], c: f64, g: &[f64]| out.iter_mut().zip(g).for_each(|(out, g)| *out += c * g);
    add(node.q.as_mut_slice(), d, g_x);
    add(node.r.as_mut_slice(), d, g_u);
    if dd == 0.0 {
        return;
    }
    for (b, column) in node.Q.as_mut_slice().chunks_exact_mut(n).enumerate().filter(|(b, _)| g_x[*b] != 0.0) {
        add(&mut column[b..], dd * g_x[b], &g_x[b..]);
    }
    let m = g_u.len();
    for b in (0..m).filter(|&b| g_u[b] != 0.0) {
        add(&mut node.S.as_mut_slice()[b * n..(b + 1) * n], dd * g_u[b], g_x);
        add(&mut node.R.as_mut_slice()[b * m + b..(b + 1) * m], dd * g_u[b], &g_u[b..]);
    }
}

/// Copies the lower triangles to the upper ones.
pub(super) fn mirror(node: &mut LqNode, nv: usize, filled: Filled) {
    let n = node.q.len();
    match filled {
        Filled::Diagonal => {}
        Filled::Positions => mirror_square(node.Q.as_mut_slice(), n, nv),
        Filled::All => {
            mirror_square(node.Q.as_mut_slice(), n, n);
            let m = node.r.len();
            mirror_square(node.R.as_mut_slice(), m, m);
        }
    }
}

/// Of the first `size` rows and columns of an n × n matrix.
fn mirror_square(X: &mut [f64], n: usize, size: usize) {
    for b in 0..size {
        for a in b + 1..size {
            X[a * n + b] = X[b * n + a];
        }
    }
}
