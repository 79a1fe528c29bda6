//! Tests of elimination and of solutions with the factor.

use crate::at_each_level;
use condyle_linalg::{SLACK, View, backward_solve, eliminate, eliminate_rows, forward_solve, solve_right};
use nalgebra::DMatrix;

/// Rounding error of sums of 30 numbers near 1.
const TOLERANCE: f64 = 1e-12;

fn entry(i: usize, j: usize) -> f64 {
    ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4
}

#[test]
fn elimination_and_solves_match_nalgebra_for_every_edge() {
    at_each_level(|| {
        for m in 0..19 {
            for n in 1..19 {
                let (size, rows) = (m + n, m + n + 1); // one row is a right-hand side
                let root = DMatrix::from_fn(rows, size, entry);
                let full = &root * root.transpose() + DMatrix::identity(rows, rows) * 2.0;
                let stride = rows + SLACK;
                let mut h = vec![0.0; stride * size];
                for j in 0..size {
                    h[j * stride..][..rows].copy_from_slice(full.column(j).as_slice());
                }
                eliminate(&mut h, stride, [rows, size, m]).unwrap();

                let (mut y, factor) = (vec![0.0; m + SLACK], View::new(&h, stride));
                (0..m).for_each(|i| y[i] = entry(i, 3));
                let inverse: Vec<f64> = (0..m).map(|i| h[i * stride + i].recip()).collect();
                forward_solve(factor, &inverse, &mut y);
                backward_solve(factor, &inverse, &mut y);
                for i in 0..m {
                    let b: f64 = (0..m).map(|j| full[(i, j)] * y[j]).sum();
                    assert!((b - entry(i, 3)).abs() < TOLERANCE * size as f64);
                }

                let (mut gains, mut upper) = (h.clone(), vec![0.0; (m + SLACK) * m]);
                solve_right(&mut gains, stride, [m, rows, m], &mut upper);
                let uu = full.view((0, 0), (m, m)).into_owned();
                let xu = full.view((m, 0), (n + 1, m)).into_owned();
                let gain = &xu * uu.clone().try_inverse().unwrap();
                let schur = full.view((m, m), (n + 1, n + 1)) - &gain * xu.transpose();
                for (i, j) in (0..n + 1).flat_map(|i| (0..n.min(i + 1)).map(move |j| (i, j))) {
                    assert!((h[(m + j) * stride + m + i] - schur[(i, j)]).abs() < TOLERANCE * size as f64);
                }
                for (i, j) in (0..n + 1).flat_map(|i| (0..m).map(move |j| (i, j))) {
                    assert!((gains[j * stride + m + i] - gain[(i, j)]).abs() < TOLERANCE * size as f64);
                }
            }
        }
    });
}

/// Checks that `eliminate_rows` gives the same result as an elimination with these rows stored below the matrix.
#[test]
fn rows_apart_are_rows_below() {
    at_each_level(|| {
        for (m, n, more) in (0..14).flat_map(|m| (1..10).map(move |n| (m, n, 1 + (m + n) % 7))) {
            let (size, rows) = (m + n, m + n + 1 + more);
            let root = DMatrix::from_fn(rows, size, entry);
            let full = &root * root.transpose() + DMatrix::identity(rows, rows) * 2.0;
            let (stride, ldg) = (rows + SLACK, more + SLACK);
            let (mut h, mut g) = (vec![0.0; stride * size], vec![0.0; ldg * size]);
            for j in 0..size {
                h[j * stride..][..rows].copy_from_slice(full.column(j).as_slice());
                g[j * ldg..][..more].copy_from_slice(&full.column(j).as_slice()[size + 1..]);
            }
            eliminate(&mut h, stride, [rows, size, m]).unwrap();
            eliminate_rows(&mut g, ldg, [more, size, m], View::new(&h, stride));
            for (i, j) in (0..more).flat_map(|i| (0..size).map(move |j| (i, j))) {
                let (found, expected) = (g[j * ldg + i], h[j * stride + size + 1 + i]);
                assert!((found - expected).abs() < TOLERANCE, "entry ({i}, {j}) for {m}, {n}: {found}, {expected}");
            }
        }
    });
}

#[test]
fn elimination_names_the_pivot_that_is_not_positive() {
    let stride = 5 + SLACK;
    let mut h = vec![0.0; stride * 4];
    for (j, x) in [1.0, 2.0, -3.0, 4.0].into_iter().enumerate() {
        h[j * stride + j] = x;
    }
    assert_eq!(eliminate(&mut h, stride, [5, 4, 3]), Err((2, -3.0)));
}
