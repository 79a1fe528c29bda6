//! Conversions between types of nalgebra and the types of this crate.
//!
//! ```
//! use condyle_spatial::{Mat3, Motion, Quaternion, Se3, Vec3};
//! use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3, Vector6};
//! let p = Vec3::from(Vector3::new(1.0, 2.0, 3.0));
//! assert_eq!(Vector3::from(p), Vector3::new(1.0, 2.0, 3.0));
//! let v = Motion::from(Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)); // linear first
//! assert_eq!((v.linear, v.angular[0]), (p, 4.0));
//! let turn = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
//! let R = Mat3::from(*turn.to_rotation_matrix().matrix());
//! assert!((Matrix3::from(Quaternion::from(turn).to_rotation()) - Matrix3::from(R)).norm() < 1e-15);
//! let pose = Se3::new(R, p);
//! assert!((Isometry3::from(pose).rotation.angle_to(&turn)) < 1e-7);
//! ```

use crate::algebra::motion::{Force, Motion};
use crate::algebra::quaternion::Quaternion;
use crate::algebra::se3::Se3;
use crate::algebra::vector::{Mat3, Vec3};
use crate::scalar::{Constant, Scalar};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3, Vector6};

impl<S: Scalar> From<Vector3<S>> for Vec3<S> {
    fn from(v: Vector3<S>) -> Self {
        Self::new(v[0], v[1], v[2])
    }
}

impl<S: Scalar> From<Vec3<S>> for Vector3<S> {
    fn from(v: Vec3<S>) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl<S: Scalar> From<Matrix3<S>> for Mat3<S> {
    fn from(A: Matrix3<S>) -> Self {
        let column = |j: usize| Vec3::new(A[(0, j)], A[(1, j)], A[(2, j)]);
        Self { x: column(0), y: column(1), z: column(2) }
    }
}

impl<S: Scalar> From<Mat3<S>> for Matrix3<S> {
    fn from(A: Mat3<S>) -> Self {
        Self::from_columns(&A.columns().map(Vector3::from))
    }
}

macro_rules! impl_six {
    ($type:ident) => {
        impl<S: Scalar> From<Vector6<S>> for $type<S> {
            /// Converts from a vector of six components, the linear part first.
            fn from(x: Vector6<S>) -> Self {
                Self::from([x[0], x[1], x[2], x[3], x[4], x[5]])
            }
        }
        impl<S: Scalar> From<$type<S>> for Vector6<S> {
            /// Converts to a vector of six components, the linear part first.
            fn from(x: $type<S>) -> Self {
                Self::from_column_slice(&x.to_array())
            }
        }
    };
}
impl_six!(Motion);
impl_six!(Force);

impl From<UnitQuaternion<f64>> for Quaternion<f64> {
    fn from(q: UnitQuaternion<f64>) -> Self {
        Self::new(q.i, q.j, q.k, q.w)
    }
}

impl From<Quaternion<f64>> for UnitQuaternion<f64> {
    /// Normalizes the quaternion and returns the rotation.
    fn from(q: Quaternion<f64>) -> Self {
        Self::new_normalize(nalgebra::Quaternion::new(q.scalar, q.vector.x, q.vector.y, q.vector.z))
    }
}

impl<R: Constant<f64>> From<Se3<R>> for Isometry3<f64> {
    fn from(X: Se3<R>) -> Self {
        let X = X.lift::<f64>();
        // `UnitQuaternion::from_matrix` is not used, because its iteration does not leave the start value for half
        // turns.
        let rotation = UnitQuaternion::from(Quaternion::from_rotation(X.rotation));
        Self::from_parts(Vector3::from(X.translation).into(), rotation)
    }
}

impl From<Isometry3<f64>> for Se3<f64> {
    fn from(X: Isometry3<f64>) -> Self {
        Self::new((*X.rotation.to_rotation_matrix().matrix()).into(), X.translation.vector.into())
    }
}
