//! Tests of `eliminate_sum`, which eliminates columns of a matrix plus a sum of outer products.

use crate::at_each_level;
use condyle_linalg::{SLACK, View, add_product_lower, eliminate, eliminate_sum};

/// Rounding error of sums of 40 numbers near 1.
const TOLERANCE: f64 = 1e-12;

#[test]
fn eliminate_sum_equals_elimination_of_the_sum() {
    at_each_level(|| {
        for (m, n, below, count) in
            [(0, 3, 1, 2), (1, 1, 0, 0), (3, 6, 1, 5), (7, 14, 8, 7), (9, 18, 10, 12), (16, 5, 3, 1)]
        {
            let (size, rows) = (m + n, m + n + below);
            let (stride, ldx, reach) = (rows + SLACK, rows + 4 * SLACK, rows - below / 2);
            let entry = |i: usize, j: usize| ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4;
            let (mut h, mut x) = (vec![0.0; stride * size], vec![0.0; ldx * count]);
            for (i, j) in (0..rows).flat_map(|i| (0..size).map(move |j| (i, j))) {
                h[j * stride + i] = entry(i.max(j), i.min(j)) + if i == j { 30.0 } else { 0.0 };
            }
            for (i, k) in (0..reach).flat_map(|i| (0..count).map(move |k| (i, k))) {
                x[k * ldx + i] = entry(i + 3, k);
            }
            let (mut expected, view, shape) = (h.clone(), View::new(&x, ldx), [rows, size, m]);
            add_product_lower(&mut expected, stride, [rows, size, count], view, view);
            eliminate(&mut expected, stride, shape).unwrap();
            eliminate_sum(&mut h, stride, shape, view, [reach, count]).unwrap();
            for (i, j) in (0..rows).flat_map(|i| (0..size.min(i + 1)).map(move |j| (i, j))) {
                let (found, expected) = (h[j * stride + i], expected[j * stride + i]);
                assert!((found - expected).abs() < TOLERANCE, "entry ({i}, {j}) of {shape:?}: {found}, {expected}");
            }
        }
        let mut h = vec![0.0; 30];
        (h[0], h[11]) = (4.0, -3.0);
        let none = View::new(&[], 1);
        assert_eq!(eliminate_sum(&mut h, 10, [2, 2, 2], none, [2, 0]), Err((1, -3.0)));
    });
}
