//! Conversions to and from the conventions of other libraries. They change the order of components and the frame of
//! vectors.
//!
//! In Rust, the linear and angular parts of motions and forces have names. Only plain arrays of six numbers, and the
//! position and velocity of a free body, need conversion.
//!
//! Condyle and Pinocchio both use q = [x, y, z, qx, qy, qz, qw] and v = [linear, angular] along the body's axes. The
//! book's page `docs/conversions.md` has tables of the conventions. In Python, `condyle.conventions` converts the
//! states of whole robots.
#![allow(non_snake_case)] // R, as in the formulas

use condyle_dynamics::{Mat3, Quaternion, Vec3};

/// Returns the spatial vector with its angular part first, as Featherstone, RBDL, Drake and MuJoCo's `cvel` store it.
pub fn angular_first([a, b, c, d, e, f]: [f64; 6]) -> [f64; 6] {
    [d, e, f, a, b, c]
}

/// Returns the spatial vector with its linear part first, as Condyle stores it. `x` has its angular part first.
pub fn from_angular_first(x: [f64; 6]) -> [f64; 6] {
    angular_first(x)
}

/// Converts a quaternion from the order x, y, z, w to the order w, x, y, z.
pub fn wxyz([x, y, z, w]: [f64; 4]) -> [f64; 4] {
    [w, x, y, z]
}

/// Converts a quaternion from the order w, x, y, z to the order x, y, z, w.
pub fn xyzw([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [x, y, z, w]
}

/// Returns the rotation matrix R of the quaternion in q. R maps coordinates in the body to coordinates in the world.
fn rotation(q: &[f64; 7]) -> Mat3<f64> {
    Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation()
}

fn vec3(x: &[f64]) -> Vec3<f64> {
    Vec3::new(x[0], x[1], x[2])
}

fn joined(a: Vec3<f64>, b: Vec3<f64>) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

/// Free body in MuJoCo: qpos = [position, w, x, y, z], qvel = [linear along the world's axes, angular along the body's
/// axes].
///
/// ```
/// use condyle::conventions::MuJoCo;
/// let (q, v) = ([1.0, 2.0, 3.0, 0.6, 0.0, 0.0, 0.8], [1.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
/// let (qpos, qvel) = (MuJoCo::position(&q), MuJoCo::velocity(&q, &v));
/// assert_eq!(qpos, [1.0, 2.0, 3.0, 0.8, 0.6, 0.0, 0.0]);
/// assert_eq!(MuJoCo::position_from(&qpos), q);
/// assert!(MuJoCo::velocity_from(&qpos, &qvel).iter().zip(v).all(|(a, b)| (a - b).abs() < 1e-12));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct MuJoCo;

impl MuJoCo {
    /// Converts Condyle's q to MuJoCo's qpos.
    pub fn position([x, y, z, qx, qy, qz, qw]: &[f64; 7]) -> [f64; 7] {
        [*x, *y, *z, *qw, *qx, *qy, *qz]
    }

    /// Converts MuJoCo's qpos to Condyle's q.
    pub fn position_from([x, y, z, qw, qx, qy, qz]: &[f64; 7]) -> [f64; 7] {
        [*x, *y, *z, *qx, *qy, *qz, *qw]
    }

    /// Converts Condyle's q and v to MuJoCo's qvel: the origin's velocity, rotated to the world's axes, then the
    /// angular velocity along the body's axes.
    pub fn velocity(q: &[f64; 7], v: &[f64; 6]) -> [f64; 6] {
        joined(rotation(q) * vec3(&v[..3]), vec3(&v[3..]))
    }

    /// Converts MuJoCo's qpos and qvel to Condyle's v: the origin's velocity, rotated to the body's axes, then the
    /// angular velocity.
    pub fn velocity_from(qpos: &[f64; 7], qvel: &[f64; 6]) -> [f64; 6] {
        let R = rotation(&Self::position_from(qpos));
        joined(R.transpose() * vec3(&qvel[..3]), vec3(&qvel[3..]))
    }
}

/// Free body in Drake: q = [w, x, y, z, position], v = [angular, linear], both along the world's axes.
///
/// ```
/// use condyle::conventions::Drake;
/// let (q, v) = ([1.0, 2.0, 3.0, 0.6, 0.0, 0.0, 0.8], [1.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
/// let (there, rate) = (Drake::position(&q), Drake::velocity(&q, &v));
/// assert_eq!(there, [0.8, 0.6, 0.0, 0.0, 1.0, 2.0, 3.0]);
/// assert_eq!(Drake::position_from(&there), q);
/// assert!(Drake::velocity_from(&there, &rate).iter().zip(v).all(|(a, b)| (a - b).abs() < 1e-12));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Drake;

impl Drake {
    /// Converts Condyle's q to Drake's q.
    pub fn position([x, y, z, qx, qy, qz, qw]: &[f64; 7]) -> [f64; 7] {
        [*qw, *qx, *qy, *qz, *x, *y, *z]
    }

    /// Converts Drake's q to Condyle's q.
    pub fn position_from([qw, qx, qy, qz, x, y, z]: &[f64; 7]) -> [f64; 7] {
        [*x, *y, *z, *qx, *qy, *qz, *qw]
    }

    /// Converts Condyle's q and v to Drake's v: the angular velocity, then the origin's velocity, both rotated to the
    /// world's axes.
    pub fn velocity(q: &[f64; 7], v: &[f64; 6]) -> [f64; 6] {
        let R = rotation(q);
        joined(R * vec3(&v[3..]), R * vec3(&v[..3]))
    }

    /// Converts Drake's q and v to Condyle's v: the origin's velocity, then the angular velocity, both rotated to the
    /// body's axes.
    pub fn velocity_from(q: &[f64; 7], v: &[f64; 6]) -> [f64; 6] {
        let R = rotation(&Self::position_from(q)).transpose();
        joined(R * vec3(&v[3..]), R * vec3(&v[..3]))
    }
}
