//! Tests of products of matrices and vectors.

use crate::at_each_level;
use condyle_linalg::{SLACK, View, add_product_vector, add_scaled_product, transposed_product_vector};

/// Rounding error of sums of 20 numbers near 1.
const TOLERANCE: f64 = 1e-12;

#[test]
fn products_with_vectors_match_plain_loops() {
    at_each_level(|| {
        for (rows, columns) in (1..40).flat_map(|rows| [0, 1, 3, 8, 13].map(|columns| (rows, columns))) {
            let ld = rows + SLACK;
            let entry = |i: usize, j: usize| ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4;
            let mut a = vec![0.0; ld * (columns + SLACK)];
            for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                a[j * ld + i] = entry(i, j);
            }
            let x: Vec<f64> = (0..columns).map(|j| entry(7, j)).collect();
            let mut y = vec![1.0; rows];
            add_scaled_product(&mut y, 0.5, View::new(&a, ld), &x);
            for i in 0..rows {
                let expected = 1.0 + 0.5 * (0..columns).map(|j| entry(i, j) * x[j]).sum::<f64>();
                assert!((y[i] - expected).abs() < TOLERANCE);
            }
            let mut y = vec![1.0; rows + 4 * SLACK];
            add_product_vector(&mut y, rows, View::new(&a, ld), &x);
            for i in 0..rows {
                let expected = 1.0 + (0..columns).map(|j| entry(i, j) * x[j]).sum::<f64>();
                assert!((y[i] - expected).abs() < TOLERANCE);
            }
            let mut x = vec![0.0; rows + SLACK];
            (0..rows).for_each(|i| x[i] = entry(i, 3));
            let mut y = vec![f64::NAN; columns];
            transposed_product_vector(&mut y, rows, View::new(&a, ld), &x);
            for j in 0..columns {
                let expected: f64 = (0..rows).map(|i| entry(i, j) * x[i]).sum();
                assert!((y[j] - expected).abs() < TOLERANCE);
            }
        }
    });
}
