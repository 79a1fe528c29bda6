//! Tests of the physical validity of inertias, and of the log-Cholesky parametrisation, which can describe only valid
//! inertias.

use crate::common;

use common::{normal, random_inertia, rng};
use condyle_dynamics::inertial_parameters::{
    NotPhysical, check, from_inertia, from_log_cholesky, log_cholesky, log_cholesky_jacobian, pseudo_inertia,
    to_inertia,
};
use condyle_dynamics::{Inertia, Sym3, Vec3, robots};
use nalgebra::SMatrix;
use num_dual::Dual64;

/// Tolerance of a few rounding errors, relative to the largest number.
const ROUNDING: f64 = 1e-13;
/// Tolerance after a factorisation of pseudo-inertias, whose condition number is up to 1e5.
const FACTORED: f64 = 1e-9;
const CASES: u64 = 300;

#[test]
fn ten_numbers_there_and_back() {
    for seed in 0..CASES {
        let I = random_inertia(&mut rng(seed));
        assert_eq!(to_inertia(from_inertia(I)), I);
    }
}

/// Checks that the pseudo-inertia J of points with masses m at positions x is Σ m (x, 1)(x, 1)ᵀ.
#[test]
fn pseudo_inertia_is_the_second_moment() {
    for seed in 0..CASES {
        let (mut I, mut J) = (Inertia::zero(), SMatrix::<f64, 4, 4>::zeros());
        for point in normal(&mut rng(seed), 12).chunks(3) {
            let x = nalgebra::Vector4::new(point[0], point[1], point[2], 1.0);
            I += Inertia::from_com(0.7, Vec3::new(x[0], x[1], x[2]), Sym3::zero());
            J += 0.7 * x * x.transpose();
        }
        assert!((pseudo_inertia(I) - J).amax() < ROUNDING * (1.0 + J.amax()));
        assert!(check(I).is_ok()); // four points that are not in a plane are valid
    }
}

/// Checks that the test of physical validity agrees with the eigenvalues of the pseudo-inertia J.
#[test]
fn physical_is_positive_definite() {
    let mut refused = 0;
    for seed in 0..CASES {
        let x = normal(&mut rng(seed), 10);
        let J = Sym3 { xx: x[4], xy: 0.2 * x[5], yy: x[6], xz: 0.2 * x[7], yz: 0.2 * x[8], zz: x[9] }.add_diagonal(2.0);
        let I = Inertia { mass: x[0] + 1.5, mass_com: Vec3::new(x[1], x[2], x[3]).scale(0.3), rotational: J };
        let least = pseudo_inertia(I).symmetric_eigenvalues().min();
        assert_eq!(check(I).is_ok(), least > 0.0, "{least}");
        refused += u64::from(least <= 0.0);
    }
    assert!(refused > CASES / 10 && refused < CASES * 9 / 10, "{refused}");
}

#[test]
fn what_is_wrong_is_said() {
    let I = Inertia::from_com(-1.0, Vec3::zero(), Sym3::diagonal(1.0));
    assert_eq!(check(I), Err(NotPhysical::Mass { mass: -1.0 }));
    let long = Sym3 { zz: 0.5, ..Sym3::diagonal(0.1) };
    let error = check(Inertia::from_com(1.0, Vec3::zero(), long)).unwrap_err();
    assert!(matches!(error, NotPhysical::Spread { moment } if moment < 0.0));
    assert!(error.to_string().contains("kg m²"));
    assert!(check(Inertia::from_com(f64::NAN, Vec3::zero(), Sym3::diagonal(1.0))).is_err());
    assert!(check(Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(f64::NAN))).is_err());
    let rod = Sym3 { xx: 1.0, yy: 1.0, ..Sym3::zero() };
    assert!(check(Inertia::from_com(1.0, Vec3::zero(), rod)).is_err()); // no volume
}

/// Checks that every body of the embedded robots has a physically valid inertia.
#[test]
fn our_robots_are_physical() {
    for model in [robots::arm7(), robots::quadruped(), robots::humanoid()] {
        for body in &model.bodies()[1..] {
            assert_eq!(check(body.inertia), Ok(()), "{}", body.name);
        }
    }
}

/// Checks that the maps between log-Cholesky parameters θ and inertial parameters π are inverses of each other.
#[test]
fn log_cholesky_there_and_back() {
    for seed in 0..CASES {
        let theta: [f64; 10] = normal(&mut rng(seed), 10).try_into().unwrap();
        let I = from_log_cholesky(theta);
        let back = log_cholesky(I).expect("any ten numbers are a body");
        assert!(theta.iter().zip(back).all(|(a, b)| (a - b).abs() < FACTORED), "{theta:?}\n{back:?}");
        let I = random_inertia(&mut rng(seed));
        let (found, expected) = (from_inertia(from_log_cholesky(log_cholesky(I).unwrap())), from_inertia(I));
        let largest = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < ROUNDING * largest));
    }
}

/// Checks that the pseudo-inertia is J = U Uᵀ, with the matrix U of the paper on the log-Cholesky parametrisation.
#[test]
fn log_cholesky_is_the_factor() {
    for seed in 0..CASES {
        let theta: [f64; 10] = normal(&mut rng(seed), 10).try_into().unwrap();
        let [alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] = theta;
        let U = SMatrix::<f64, 4, 4>::new(
            d1.exp(),
            s12,
            s13,
            t1, //
            0.0,
            d2.exp(),
            s23,
            t2, //
            0.0,
            0.0,
            d3.exp(),
            t3, //
            0.0,
            0.0,
            0.0,
            1.0,
        ) * alpha.exp();
        let J = U * U.transpose();
        assert!((pseudo_inertia(from_log_cholesky(theta)) - J).amax() < ROUNDING * J.amax());
    }
}

/// Checks that the Jacobian ∂π/∂θ of the log-Cholesky map equals the derivative by dual numbers.
#[test]
fn log_cholesky_jacobian_is_the_derivative() {
    for seed in 0..CASES {
        let theta: [f64; 10] = normal(&mut rng(seed), 10).try_into().unwrap();
        let J = log_cholesky_jacobian(theta);
        for k in 0..10 {
            let mut dual = theta.map(Dual64::from);
            dual[k].eps = 1.0;
            let column = from_inertia(from_log_cholesky(dual));
            for (row, x) in column.iter().enumerate() {
                assert!((J[(row, k)] - x.eps).abs() < ROUNDING * J.amax(), "({row}, {k})");
            }
        }
        assert!(J.lu().determinant() != 0.0);
    }
}
