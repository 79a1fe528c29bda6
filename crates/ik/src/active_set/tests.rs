//! Solutions satisfy the optimality conditions, which are sufficient for convex programs.

use super::{ActiveSet, Constraint, Unsolved, dot};
use rand::{RngExt, SeedableRng};

/// Maximum residual of the optimality conditions, relative to the size of the program's numbers. The random
/// programs have condition numbers below 1e6.
const OPTIMAL: f64 = 1e-8;

/// Fills a program with random numbers that some point satisfies.
fn random(program: &mut ActiveSet, rng: &mut impl rand::Rng, equalities: usize, rows: usize) -> (Vec<f64>, Vec<f64>) {
    let n = program.n;
    let mut number = || rng.random_range(-1.0..1.0);
    let inside: Vec<f64> = (0..n).map(|_| number()).collect();
    let factor: Vec<f64> = (0..n * n).map(|_| number()).collect();
    for j in 0..n {
        for i in 0..n {
            program.H[j * n + i] = dot(&factor[i * n..][..n], &factor[j * n..][..n]) + if i == j { 1e-3 } else { 0.0 };
        }
        program.c[j] = 3.0 * number();
        program.lower[j] = inside[j] - number().abs();
        program.upper[j] = inside[j] + number().abs();
    }
    program.E.clear();
    program.e.clear();
    program.A.clear();
    program.b.clear();
    for _ in 0..equalities {
        let row: Vec<f64> = (0..n).map(|_| number()).collect();
        program.e.push(dot(&row, &inside));
        program.E.extend(row);
    }
    for _ in 0..rows {
        let row: Vec<f64> = (0..n).map(|_| number()).collect();
        program.b.push(dot(&row, &inside) - 0.1 * number().abs());
        program.A.extend(row);
    }
    (program.H.clone(), program.c.clone())
}

#[test]
fn solutions_satisfy_the_optimality_conditions() {
    let mut rng = rand::rngs::StdRng::seed_from_u64(7);
    let mut active = 0;
    for (n, equalities, rows) in [(1, 0, 0), (4, 0, 3), (7, 2, 0), (9, 3, 20), (35, 6, 50)] {
        let mut program = ActiveSet::new(n, equalities, rows);
        for _ in 0..50 {
            let (H, c) = random(&mut program, &mut rng, equalities, rows);
            program.solve().unwrap();
            // H x + c = Eᵀ y + Aᵀ z + (bounds), with z ≥ 0
            let mut gradient: Vec<f64> = (0..n).map(|i| c[i] + dot(&H[i * n..][..n], &program.x)).collect();
            for &(constraint, u) in program.active() {
                let (row, index): (Option<&[f64]>, usize) = match constraint {
                    Constraint::Equality(i) => (Some(&program.E[i * n..][..n]), i),
                    Constraint::Row(i) => (Some(&program.A[i * n..][..n]), i),
                    Constraint::Lower(i) | Constraint::Upper(i) => (None, i),
                };
                match (row, constraint) {
                    (Some(row), _) => (0..n).for_each(|k| gradient[k] -= u * row[k]),
                    (None, Constraint::Lower(_)) => gradient[index] -= u,
                    (None, _) => gradient[index] += u,
                }
                assert!(u >= -OPTIMAL || matches!(constraint, Constraint::Equality(_)), "{constraint:?}: {u}");
                active += 1;
            }
            assert!(gradient.iter().all(|g| g.abs() < OPTIMAL), "{gradient:?}");
            for i in 0..n {
                assert!(program.lower[i] <= program.x[i] && program.x[i] <= program.upper[i]);
            }
            for i in 0..equalities {
                assert!(program.slack(Constraint::Equality(i)).abs() < OPTIMAL);
            }
            for i in 0..rows {
                assert!(program.slack(Constraint::Row(i)) > -OPTIMAL);
            }
        }
    }
    assert!(active > 1000, "{active}");
}

#[test]
fn contradictions_are_named() {
    let mut program = ActiveSet::new(2, 0, 1);
    program.H = vec![1.0, 0.0, 0.0, 1.0];
    (program.lower, program.upper) = (vec![-1.0; 2], vec![1.0; 2]);
    program.A.extend([1.0, 1.0]);
    program.b.push(3.0); // x₁ + x₂ ≥ 3 is impossible within ±1
    assert!(matches!(program.solve(), Err(Unsolved::Infeasible(_))));
    program.H = vec![1.0, 0.0, 0.0, f64::NAN];
    assert_eq!(program.solve(), Err(Unsolved::Numerical));
}

#[test]
fn repeated_equalities_are_left_out() {
    let mut program = ActiveSet::new(3, 3, 0);
    (0..3).for_each(|i| program.H[4 * i] = 1.0);
    for (row, e) in [([1.0, 1.0, 0.0], 2.0), ([2.0, 2.0, 0.0], 4.0), ([0.0, 0.0, 1.0], 0.5)] {
        program.E.extend(row);
        program.e.push(e);
    }
    program.solve().unwrap();
    assert_eq!(program.redundant, 1);
    assert!(program.x.iter().zip([1.0, 1.0, 0.5]).all(|(x, y)| (x - y).abs() < 1e-12), "{:?}", program.x);
}
