//! Products −M⁻¹ B without computing M⁻¹. On long chains, this algorithm is faster than a product with M⁻¹.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1, for a robot at rest without gravity. The
//! efforts are the columns of B. The algorithm works in the world's frame with the factors of the articulated-body
//! algorithm. For n bodies, each column of B costs O(n), whereas in a product with M⁻¹ each entry costs O(n). Several
//! columns of B are processed together.

use crate::passes::aba;
use crate::passes::kinematics::World;
use crate::selection::solve_by_tree;
use crate::workspace::filled;
use alloc::vec::Vec;
use condyle_model::tree::Column;
use condyle_spatial::{Array, Scalar, same_layout};

/// Number of columns of B in a product −M⁻¹ B that are processed together.
const SIDE: usize = 16;

/// Number of columns of B in a product −M⁻¹ B that are processed together if the scalar has lanes.
const SIDE_OF_LANES: usize = 2;

/// Path of joint columns in the tree: each column except the last has exactly one child, the next column. The bias
/// force and the acceleration of a path are stored in a slot. The last path that is attached to this path reuses the
/// slot.
#[derive(Clone, Copy, Debug)]
struct Path {
    start: usize,
    /// Index of the path's last column, plus 1.
    end: usize,
    /// Slot of the path to which this path is attached (`from`), and slot of this path (`place`).
    from: usize,
    place: usize,
    /// Whether no other path is attached to this path.
    tip: bool,
}

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// Paths of the tree. The list is empty if the model uses another method for M⁻¹ B. Written by: `new`.
    paths: Vec<Path>,
    /// Joint efforts, which the joint accelerations overwrite. Shape: columns × `SIDE`. Written by: `minus_solve`.
    pub x: Array<S>,
    /// Bias force of each slot. Shape: slots × 6 × `SIDE`. Written by: `minus_solve`.
    pub P: Array<S>,
    /// Spatial acceleration of each slot. Shape: slots × 6 × `SIDE`. Written by: `minus_solve`.
    pub A: Array<S>,
}

same_layout!(Workspace { x, P, A } same { paths });

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(columns: &[Column], nv: usize) -> Self {
        let paths = if solve_by_tree(columns, nv) { paths(columns) } else { Vec::new() };
        let places = paths.iter().map(|path| path.place + 1).max().unwrap_or(0);
        let zeros = |n: usize| filled(S::zero, n * SIDE);
        let x = zeros(if paths.is_empty() { 0 } else { nv });
        Self { x, P: zeros(6 * places), A: zeros(6 * places), paths }
    }
}

fn paths(columns: &[Column]) -> Vec<Path> {
    let n = columns.len();
    let parent = |c: usize| columns[c].parent.unwrap_or(n); // n denotes the world
    let mut children = vec![Vec::new(); n + 1];
    (0..n).for_each(|c| children[parent(c)].push(c));
    let mut places = vec![0; n + 1];
    let mut paths: Vec<Path> = Vec::new();
    for c in 0..n {
        let (from, siblings) = (places[parent(c)], &children[parent(c)]);
        places[c] = if siblings.last() == Some(&c) { from } else { from + 1 };
        let tip = children[c].is_empty();
        match paths.last_mut() {
            Some(path) if siblings.len() == 1 && parent(c) < n => (path.end, path.tip) = (c + 1, tip),
            _ => paths.push(Path { start: c, end: c + 1, from, place: places[c], tip }),
        }
    }
    paths
}

/// Computes X = −M⁻¹ B for two square matrices B. Runs after `aba::factorize`.
#[inline(always)]
pub(crate) fn minus_solve<S: Scalar>(
    w: &World<S>,
    f: &aba::Workspace<S>,
    d: &mut Workspace<S>,
    B: [&[S]; 2],
    X: [&mut [S]; 2],
) {
    if S::LANES == 1 {
        by_sides::<S, SIDE>(w, f, d, B, X);
    } else {
        by_sides::<S, SIDE_OF_LANES>(w, f, d, B, X);
    }
}

#[inline(always)]
fn by_sides<S: Scalar, const N: usize>(
    w: &World<S>,
    f: &aba::Workspace<S>,
    d: &mut Workspace<S>,
    B: [&[S]; 2],
    [X0, X1]: [&mut [S]; 2],
) {
    let Workspace { paths, x, P, A } = d;
    let n = x.len() / SIDE;
    let x = &mut x.as_chunks_mut::<N>().0[..n];
    let mut j = 0;
    while j < 2 * n {
        let many = N.min(2 * n - j);
        for k in 0..many {
            let b = if j + k < n { &B[0][(j + k) * n..][..n] } else { &B[1][(j + k - n) * n..][..n] };
            for c in 0..n {
                x[c][k] = -b[c];
            }
        }
        sweep(paths, w, f, x, P.as_chunks_mut().0, A.as_chunks_mut().0);
        for k in 0..many {
            let y = if j + k < n { &mut X0[(j + k) * n..][..n] } else { &mut X1[(j + k - n) * n..][..n] };
            for c in 0..n {
                y[c] = x[c][k];
            }
        }
        j += N;
    }
}

/// Replaces the joint efforts `x` by the joint accelerations that these efforts cause.
#[inline(always)]
fn sweep<S: Scalar, const N: usize>(
    paths: &[Path],
    w: &World<S>,
    f: &aba::Workspace<S>,
    x: &mut [[S; N]],
    P: &mut [[S; N]],
    A: &mut [[S; N]],
) {
    let (P, A) = (P.as_chunks_mut::<6>().0, A.as_chunks_mut::<6>().0);
    for &Path { start, end, from, place, tip } in paths.iter().rev() {
        let mut p = [[S::zero(); N]; 6]; // bias force P, kept in registers along the path
        if !tip {
            copy(&P[place], &mut p);
        }
        for c in (start..end).rev() {
            let (S, U, D_inv) = (w.S[c].scale(f.D_inv[c]).to_array(), f.U[c].to_array(), f.D_inv[c]);
            let mut u = [S::zero(); N];
            for k in 0..N {
                let linear = p[0][k].mul_add(S[0], p[1][k].mul_add(S[1], p[2][k] * S[2]));
                let angular = p[3][k].mul_add(S[3], p[4][k].mul_add(S[4], p[5][k] * S[5]));
                u[k] = x[c][k] * D_inv - (linear + angular); // u = D⁻¹ (τ − Sᵀ P)
            }
            for r in 0..6 {
                for k in 0..N {
                    p[r][k] = u[k].mul_add(U[r], p[r][k]); // P_λ = P + U u
                }
            }
            x[c] = u;
        }
        if from != place {
            for r in 0..6 {
                for k in 0..N {
                    P[from][r][k] += p[r][k];
                }
            }
        } else {
            copy(&p, &mut P[place]);
        }
    }
    A[0] = [[S::zero(); N]; 6];
    for &Path { start, end, from, place, .. } in paths {
        let mut a = [[S::zero(); N]; 6];
        copy(&A[from], &mut a);
        for c in start..end {
            let (S, U) = (w.S[c].to_array(), f.U[c].scale(f.D_inv[c]).to_array());
            let mut qdd = [S::zero(); N];
            for k in 0..N {
                let linear = a[0][k].mul_add(U[0], a[1][k].mul_add(U[1], a[2][k] * U[2]));
                let angular = a[3][k].mul_add(U[3], a[4][k].mul_add(U[4], a[5][k] * U[5]));
                qdd[k] = x[c][k] - (linear + angular); // q̈ = u − D⁻¹ Uᵀ A_λ
            }
            for r in 0..6 {
                for k in 0..N {
                    a[r][k] = qdd[k].mul_add(S[r], a[r][k]); // A = A_λ + S q̈
                }
            }
            x[c] = qdd;
        }
        copy(&a, &mut A[place]);
    }
}

#[inline(always)]
fn copy<S: Scalar, const N: usize>(from: &[[S; N]; 6], to: &mut [[S; N]; 6]) {
    for r in 0..6 {
        for k in 0..N {
            to[r][k] = from[r][k];
        }
    }
}
