//! Tests of copies and transposes of matrices.

use crate::at_each_level;
use condyle_linalg::{
    SLACK, View, copy_lower, copy_matrix, copy_symmetric, copy_symmetric_turned, copy_with_squares, transpose,
    transpose_negated,
};
use nalgebra::DMatrix;

#[test]
fn copies_are_exact_for_every_edge() {
    at_each_level(|| {
        for n in 1..19 {
            let ld = n + SLACK;
            let a = DMatrix::from_fn(n, n, |i, j| ((i * 31 + j * 34 + 5) % 23) as f64 / 23.0 - 0.4);
            let view = View::new(a.as_slice(), n);
            let mut out = vec![0.0; ld * n];
            copy_symmetric(&mut out, ld, view, n);
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                assert!(out[j * ld + i] == a[(i, j)] && out[i * ld + j] == a[(i, j)]);
            }
            for turn in 0..=n {
                let (mut lower, mut out) = (vec![f64::NAN; ld * n], vec![0.0; ld * n]);
                copy_lower(&mut lower, ld, view, n);
                copy_symmetric_turned(&mut out, ld, View::new(&lower, ld), n, turn);
                for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                    let (row, column) = ((i + turn) % n, (j + turn) % n);
                    assert!(out[column * ld + row] == a[(i, j)] && out[row * ld + column] == a[(i, j)]);
                }
            }
            for m in 1..=n {
                let squares: f64 = a.rows(0, m).iter().map(|x| x * x).sum();
                let mut out = vec![0.0; n * n];
                let found = [&mut [], out.as_mut_slice()].map(|out| copy_with_squares(out, n, view, [m, n]));
                assert!(found[0] == found[1] && (0.999 * squares..8.001 * squares).contains(&found[0]));
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    assert_eq!(out[j * n + i], if i < m { a[(i, j)] } else { 0.0 });
                }
                let mut out = vec![0.0; ld * n];
                let from_second_row = View { data: &view.data[1..], ..view };
                transpose(&mut out[2..], ld, from_second_row, [n - 1, m]);
                for (i, j) in (1..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
                    assert_eq!(out[(i - 1) * ld + 2 + j], a[(i, j)]);
                }
                transpose_negated(&mut out, ld, view, [m, n]);
                for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    assert_eq!(out[i * ld + j], -a[(i, j)]);
                }
                let mut out = vec![0.0; ld * n];
                copy_matrix(&mut out, ld, view, [m, n]);
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    assert_eq!(out[j * ld + i], if i < m { a[(i, j)] } else { 0.0 });
                }
            }
            let mut out = vec![0.0; ld * n];
            copy_lower(&mut out, ld, view, n);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert_eq!(out[j * ld + i], if i >= j { a[(i, j)] } else { 0.0 });
            }
        }
    });
}
