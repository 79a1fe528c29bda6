//! Tests of products of matrices.

use crate::at_each_level;
use condyle_linalg::{
    SLACK, Vector, Vectorized, View, add_blocks, add_in_turn, add_matrix, add_product, add_product_lower,
    add_transposed_product_lower, at_level, product, product_of_upper_lower, product_with_upper, product_without_slack,
};
use nalgebra::DMatrix;

/// Rounding error of sums of 30 numbers near 1.
const TOLERANCE: f64 = 1e-12;

fn entry(i: usize, j: usize) -> f64 {
    ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4
}

/// Returns a copy of a matrix with padding rows, and the stride of the copy.
fn padded(a: &DMatrix<f64>) -> (Vec<f64>, usize) {
    let stride = a.nrows() + SLACK;
    let mut out = vec![0.0; stride * a.ncols()];
    for j in 0..a.ncols() {
        out[j * stride..][..a.nrows()].copy_from_slice(a.column(j).as_slice());
    }
    (out, stride)
}

/// Checks every product function of this crate on A and B.
fn check_products(a: &DMatrix<f64>, b: &DMatrix<f64>) {
    let (rows, columns, length) = (a.nrows(), b.nrows(), a.ncols());
    let (shape, expected) = ([rows, columns, length], a * b.transpose());
    let ((a, lda), (b, ldb)) = (padded(a), padded(b));
    let (a, b) = (View::new(&a, lda), View::new(&b, ldb));
    let all = || (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let check = |c: &[f64], ldc: usize, (i, j): (usize, usize), expected: f64| {
        assert!((c[j * ldc + i] - expected).abs() < TOLERANCE, "entry ({i}, {j}) of shape {shape:?}");
    };

    let mut c = vec![0.0; lda * columns];
    product(&mut c, lda, shape, a, b);
    all().for_each(|at| check(&c, lda, at, expected[at]));
    add_product(&mut c, lda, shape, a, b);
    all().for_each(|at| check(&c, lda, at, 2.0 * expected[at]));
    add_matrix(&mut c, lda, a, [rows, columns.min(length)]);
    all().for_each(|(i, j)| {
        let more = if j < length { a.data[j * lda + i] } else { 0.0 };
        check(&c, lda, (i, j), 2.0 * expected[(i, j)] + more);
    });
    let mut c = vec![0.0; rows * columns];
    product_without_slack(&mut c, rows, shape, a, b);
    all().for_each(|at| check(&c, rows, at, expected[at]));

    if columns <= rows {
        let mut c = vec![1.0; lda * columns];
        add_product_lower(&mut c, lda, shape, a, b);
        all().filter(|(i, j)| j <= i).for_each(|at| check(&c, lda, at, expected[at] + 1.0));
    }
    if columns == rows && length == rows {
        let (mut c, mut scratch) = (vec![1.0; lda * columns], vec![0.0; lda * columns]);
        add_transposed_product_lower(&mut c, lda, rows, a, b, &mut scratch, lda);
        all().filter(|(i, j)| j <= i).for_each(|(i, j)| check(&c, lda, (i, j), expected[(j, i)] + 1.0));
    }
}

#[test]
fn products_match_nalgebra_for_every_edge() {
    at_each_level(|| {
        for rows in 1..20 {
            for columns in [1, 2, 3, 4, 5, 7, 8, 9, 12, 17, rows] {
                for length in [0, 1, 6, 13, rows] {
                    let a = DMatrix::from_fn(rows, length, entry);
                    let b = DMatrix::from_fn(columns, length, |i, j| entry(j, i + 3));
                    check_products(&a, &b);
                }
            }
        }
    });
}

/// Test function for a register type: computes sums of matrices, and writes each sum to two offsets.
struct Sums<'a>(&'a mut [f64], usize, [View<'a>; 2], [usize; 2]);

impl Vectorized for Sums<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self(out, ldo, [a, b], shape @ [rows, columns]) = self;
        let places = ([0, ldo * columns], [rows, ldo * columns + rows]);
        add_in_turn::<V, 2, 2>(out, ldo, places, a, b, 0.5, shape);
        add_blocks::<V>(&mut out[2 * ldo * columns..], ldo, a, b, [2 * rows, columns]);
    }
}

#[test]
fn sums_match_nalgebra_for_every_edge() {
    at_each_level(|| {
        for (rows, columns) in (1..12).flat_map(|rows| [1, 2, 5].map(|columns| (rows, columns))) {
            let [a, b] = [0, 3].map(|k| DMatrix::from_fn(2 * rows, columns, |i, j| entry(i + k, j)));
            let mut out = DMatrix::zeros(2 * rows, 3 * columns);
            let views = [&a, &b].map(|x| View::new(x.as_slice(), 2 * rows));
            at_level(Sums(out.as_mut_slice(), 2 * rows, views, [rows, columns]));
            let x = a.rows(0, rows) + b.rows(0, rows) * 0.5;
            let y = a.rows(rows, rows) + (&x + b.rows(rows, rows)) * 0.5;
            for k in 0..2 {
                assert!((out.view((0, k * columns), (rows, columns)) - &x).amax() < TOLERANCE);
                assert!((out.view((rows, k * columns), (rows, columns)) - &y).amax() < TOLERANCE);
            }
            assert!((out.columns(2 * columns, columns) - (a + b)).amax() < TOLERANCE);
        }
    });
}

#[test]
fn products_with_a_triangle_match_nalgebra() {
    at_each_level(|| {
        for n in 1..20 {
            let upper = DMatrix::from_fn(n, n, |i, j| if i <= j { entry(i, j) } else { 0.0 });
            let full = DMatrix::from_fn(n, n, |i, j| entry(j, i));
            let (upper, other) = (&upper, &full);
            let ((u, ldu), (f, ldf)) = (padded(upper), padded(other));
            let (u, f, mut c) = (View::new(&u, ldu), View::new(&f, ldf), vec![0.0; ldu * n]);
            let expected = [other * upper.transpose(), upper * other.transpose()];
            product_with_upper(&mut c, ldu, [n, n], f, u);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert!((c[j * ldu + i] - expected[0][(i, j)]).abs() < TOLERANCE);
            }
            product_of_upper_lower(&mut c, ldu, n, u, f);
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                assert!((c[j * ldu + i] - expected[1][(i, j)]).abs() < TOLERANCE);
            }
        }
    });
}
