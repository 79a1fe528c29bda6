//! Random inputs and comparisons for the tests of this crate.
#![allow(dead_code)] // each test file uses only some of these functions

use condyle_spatial::{Force, Inertia, Mat3, Motion, Quaternion, Se3, Sym3, Vec3, lie};
use core::f64::consts::PI;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Returns the settings of proptest, with a fixed seed, so that every run tests the same cases.
pub(crate) fn config() -> ProptestConfig {
    ProptestConfig { cases: 1024, rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() }
}

/// Draws a vector with components in (−2, 2).
pub(crate) fn vec3() -> impl Strategy<Value = Vec3<f64>> {
    prop::array::uniform3(-2.0..2.0).prop_map(Vec3::from)
}

/// Draws a unit vector, including the coordinate axes.
pub(crate) fn axis() -> impl Strategy<Value = Vec3<f64>> {
    let e = |k: usize| Vec3::from(core::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
    prop_oneof![
        8 => vec3().prop_filter("a direction", |v| v.norm_squared() > 1e-2).prop_map(|v| v.scale(v.norm_squared().sqrt().recip())),
        1 => (0..3_usize).prop_map(e),
        1 => (0..3_usize).prop_map(move |k| -e(k)),
    ]
}

/// Draws an angle in [0, π), with more samples near both ends. π itself is excluded, because rounding would decide the
/// direction of the rotation.
pub(crate) fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => 0.0..PI,
        2 => (-14.0..0.0_f64).prop_map(|e| 10f64.powf(e)),
        2 => (-14.0..0.0_f64).prop_map(|e| PI - 10f64.powf(e)),
        1 => Just(0.0),
    ]
}

/// Draws a rotation vector shorter than π.
pub(crate) fn rotation_vector() -> impl Strategy<Value = Vec3<f64>> {
    (axis(), angle()).prop_map(|(axis, angle)| axis.scale(angle))
}

/// Draws a rotation matrix, including half turns.
pub(crate) fn rotation() -> impl Strategy<Value = Mat3<f64>> {
    let half_turn = axis().prop_map(|n| Quaternion { vector: n, scalar: 0.0 });
    prop_oneof![8 => rotation_vector().prop_map(lie::exp3), 1 => half_turn].prop_map(Quaternion::to_rotation)
}

pub(crate) fn motion() -> impl Strategy<Value = Motion<f64>> {
    (vec3(), vec3()).prop_map(|(linear, angular)| Motion { linear, angular })
}

/// Draws a twist with an angle below π.
pub(crate) fn twist() -> impl Strategy<Value = Motion<f64>> {
    (vec3(), rotation_vector()).prop_map(|(linear, angular)| Motion { linear, angular })
}

pub(crate) fn force() -> impl Strategy<Value = Force<f64>> {
    (vec3(), vec3()).prop_map(|(linear, angular)| Force { linear, angular })
}

pub(crate) fn pose() -> impl Strategy<Value = Se3<f64>> {
    (rotation(), vec3()).prop_map(|(rotation, translation)| Se3 { rotation, translation })
}

/// Draws the inertia of a body that consists of four mass points.
pub(crate) fn inertia() -> impl Strategy<Value = Inertia<f64>> {
    prop::collection::vec((0.1..2.0, vec3()), 4).prop_map(|points| {
        points.into_iter().fold(Inertia::zero(), |I, (m, c)| I + Inertia::from_com(m, c, Sym3::zero()))
    })
}

/// Returns the nine numbers of a 3×3 matrix, column by column.
pub(crate) fn flat(A: Mat3<f64>) -> [f64; 9] {
    let [x, y, z] = A.columns().map(Vec3::to_array);
    [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]]
}

/// Returns max |a − b|; infinity if any difference is NaN.
pub(crate) fn distance(a: impl AsRef<[f64]>, b: impl AsRef<[f64]>) -> f64 {
    let (a, b) = (a.as_ref(), b.as_ref());
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, x| if x.is_nan() { f64::INFINITY } else { m.max(x) })
}
