//! Tests of sums of outer products of rows that contain zeros.

use crate::at_each_level;
use condyle_linalg::{OuterProducts, SLACK, SparseRows, Vector, Vectorized, at_level};

/// Rounding error of sums of 20 numbers near 1.
const TOLERANCE: f64 = 1e-12;

/// Test function for a register type: adds the squares of the first rows, and the product of each later row with the
/// next row.
struct Fill<'a> {
    sum: &'a mut OuterProducts,
    rows: &'a SparseRows,
    stride: usize,
    slopes: &'a [[f64; 2]],
}

impl Vectorized for Fill<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { sum, rows, stride, slopes } = self;
        let row = |k: usize| &rows.numbers[k * stride..][..stride];
        for (k, slopes) in slopes.iter().enumerate() {
            sum.square::<V>(row(k), rows.masks[k], *slopes);
        }
        for k in slopes.len()..rows.masks.len() - 1 {
            let first = sum.count();
            sum.push::<V>(row(k), 2.0);
            sum.push::<V>(row(k + 1), 1.0);
            sum.multiply([first, first + 1], [rows.masks[k], rows.masks[k + 1]]);
        }
    }
}

#[test]
fn sums_of_outer_products_match_plain_loops() {
    at_each_level(|| {
        for size in [1, 4, 7, 8, 20, 33] {
            let (stride, count) = (size + SLACK, 9);
            let mut rows = SparseRows::default();
            rows.resize(count, stride);
            for k in 0..count {
                for i in (0..size).filter(|i| (i / 8 + k) % 3 != 0) {
                    rows.numbers[k * stride + i] = ((i * 31 + k * 17 + 5) % 23) as f64 / 23.0 - 0.4;
                }
            }
            rows.mark(stride);
            let slopes = [[0.5, 2.0], [-1.0, 0.0], [0.3, -0.7], [0.0, 1.0], [0.0, 0.0]];
            let mut sum = OuterProducts::default();
            sum.clear(size, stride);
            at_level(Fill { sum: &mut sum, rows: &rows, stride, slopes: &slopes });
            let ldh = size + 1 + SLACK;
            let mut h = vec![1.0; ldh * size];
            sum.add_to(&mut h, ldh);

            let entry = |k: usize, i: usize| rows.numbers[k * stride + i];
            for j in 0..size {
                for i in j..=size {
                    let squares = slopes.iter().enumerate().map(|(k, [d, dd])| match i == size {
                        true => d * entry(k, j),
                        false => dd * entry(k, i) * entry(k, j),
                    });
                    let products = (slopes.len()..count - 1).map(|k| 2.0 * entry(k, i) * entry(k + 1, j));
                    let products = if i == size { 0.0 } else { products.sum::<f64>() };
                    let expected = 1.0 + squares.sum::<f64>() + products;
                    assert!((h[j * ldh + i] - expected).abs() < TOLERANCE, "size {size}, entry ({i}, {j})");
                }
            }
        }
    });
}
