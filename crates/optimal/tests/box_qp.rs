//! Quadratic programs with bounds. This test compiles the library's module directly, without the rest of the library.
#![allow(non_snake_case)] // names follow the literature

#[allow(dead_code)] // only the sweep uses all items of the module
#[path = "../src/lq/box_qp.rs"]
mod box_qp;

use box_qp::BoxQp;
use nalgebra::DMatrix;

/// Tolerance of the optimality conditions. Entries have size one, and the last Newton step is exact for its free
/// variables.
const KKT: f64 = 1e-10;

fn solve(H: &DMatrix<f64>, q: &[f64], lower: &[f64], upper: &[f64]) -> Result<BoxQp, (usize, f64)> {
    let mut qp = BoxQp::new(q.len());
    qp.solve(H, q, lower, upper, std::iter::repeat_n(0.0, q.len()))?;
    Ok(qp)
}

/// Checks the optimality conditions: the gradient is zero for free variables, and its negative points outside the
/// bounds for all other variables.
#[test]
fn solutions_satisfy_the_conditions_of_optimality() {
    for size in 1..13 {
        for case in 0..50_usize {
            let entry = |i: usize, j: usize| ((i * 37 + j * 19 + case * 11 + 3) % 29) as f64 / 29.0 - 0.5;
            let root = DMatrix::from_fn(size, size, entry);
            let H = &root * root.transpose() + DMatrix::identity(size, size) * 0.1;
            let q: Vec<f64> = (0..size).map(|i| entry(i, 7)).collect();
            let lower: Vec<f64> =
                (0..size).map(|i| if i % 3 == 0 { f64::NEG_INFINITY } else { -0.1 - 0.1 * entry(i, 2) }).collect();
            let upper: Vec<f64> = (0..size).map(|i| 0.05 + 0.05 * entry(i, 5)).collect();
            let qp = solve(&H, &q, &lower, &upper).unwrap();
            for i in 0..size {
                let gradient = q[i] + (0..size).map(|j| H[(i, j)] * qp.x[j]).sum::<f64>();
                // an optimal x equals x − ∇ projected on the bounds
                let error = (qp.x[i] - (qp.x[i] - gradient).min(upper[i]).max(lower[i])).abs();
                assert!(error < KKT, "size {size}, case {case}, variable {i}: {error:e}");
                assert!(lower[i] <= qp.x[i] && qp.x[i] <= upper[i]);
            }
        }
    }
}

#[test]
fn without_bounds_it_is_a_newton_step() {
    let H = nalgebra::dmatrix![2.0, 1.0; 1.0, 3.0];
    let infinite = [f64::INFINITY; 2];
    let qp = solve(&H, &[1.0, -1.0], &infinite.map(|x| -x), &infinite).unwrap();
    assert!((qp.x[0] + 0.8).abs() < KKT && (qp.x[1] - 0.6).abs() < KKT && qp.free == [0, 1]);
}

#[test]
fn a_variable_without_curvature_is_named() {
    let H = DMatrix::from_diagonal(&nalgebra::dvector![1.0, -1.0]);
    assert_eq!(solve(&H, &[0.0, 0.0], &[-1.0; 2], &[1.0; 2]).unwrap_err(), (1, -1.0));
}

#[test]
fn a_box_of_one_point_is_its_solution() {
    let H = DMatrix::identity(2, 2);
    let qp = solve(&H, &[5.0, -5.0], &[1.0, 1.0], &[1.0, 1.0]).unwrap();
    assert_eq!(qp.x, [1.0, 1.0]);
}
