//! Unit quaternions: rotations as four numbers.

use crate::algebra::vector::{Mat3, Vec3};
use crate::scalar::Scalar;

/// Unit quaternion, stored as x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Quaternion<S> {
    /// Vector part: sin(θ/2) times the axis, for a rotation by the angle θ.
    pub vector: Vec3<S>,
    /// Scalar part: cos(θ/2).
    pub scalar: S,
}

impl<S: Scalar> Quaternion<S> {
    /// Creates a quaternion from x, y, z, w.
    #[inline(always)]
    pub fn new(x: S, y: S, z: S, w: S) -> Self {
        Self { vector: Vec3::new(x, y, z), scalar: w }
    }
    /// Returns the identity: no rotation.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { vector: Vec3::zero(), scalar: S::one() }
    }
    /// Returns the inverse rotation.
    #[inline(always)]
    pub fn conjugate(self) -> Self {
        Self { vector: -self.vector, scalar: self.scalar }
    }
    /// Returns the quaternion divided by its length.
    #[inline(always)]
    pub fn normalize(self) -> Self {
        let r = self.scalar.mul_add(self.scalar, self.vector.norm_squared()).sqrt().recip();
        Self { vector: self.vector.scale(r), scalar: self.scalar * r }
    }
    /// Returns the rotation matrix.
    #[inline(always)]
    pub fn to_rotation(self) -> Mat3<S> {
        let (v, w) = (self.vector, self.scalar);
        let d = v + v;
        let (xx, yy, zz) = (v.x * d.x, v.y * d.y, v.z * d.z);
        let (xy, xz, yz) = (v.x * d.y, v.x * d.z, v.y * d.z);
        let (wx, wy, wz) = (w * d.x, w * d.y, w * d.z);
        let one = S::one();
        Mat3 {
            x: Vec3::new(one - yy - zz, xy + wz, xz - wy),
            y: Vec3::new(xy - wz, one - xx - zz, yz + wx),
            z: Vec3::new(xz + wy, yz - wx, one - xx - yy),
        }
    }
    /// Returns the quaternion of a rotation matrix. The largest component of the quaternion is computed first (Shepperd
    /// 1978).
    #[inline(always)]
    pub fn from_rotation(R: Mat3<S>) -> Self {
        let (a, b, c) = (R.x.x, R.y.y, R.z.z);
        let one = S::one();
        // Four times the products of components: `w` is 4w², `xy` is 4xy, and so on. For each component, its products
        // with all four components are a multiple of the quaternion.
        let (w, x, y, z) = (one + a + b + c, one + a - b - c, one - a + b - c, one - a - b + c);
        let (wx, wy, wz) = (R.y.z - R.z.y, R.z.x - R.x.z, R.x.y - R.y.x);
        let (xy, xz, yz) = (R.x.y + R.y.x, R.x.z + R.z.x, R.y.z + R.z.y);
        let xs = choose(y.lt(x), [x, xy, xz, wx], [xy, y, yz, wy]);
        let ws = choose(z.lt(w), [wx, wy, wz, w], [xz, yz, z, wz]);
        let (largest_x, largest_w) = (S::select(y.lt(x), x, y), S::select(z.lt(w), w, z));
        let m = largest_w.lt(largest_x);
        let p = choose(m, xs, ws);
        let r = (S::select(m, largest_x, largest_w).sqrt() * S::splat(2.0)).recip();
        Self::new(p[0] * r, p[1] * r, p[2] * r, p[3] * r)
    }
}

impl<S: Scalar> core::ops::Mul for Quaternion<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self {
            vector: self.vector.cross(o.vector) + o.vector.scale(self.scalar) + self.vector.scale(o.scalar),
            scalar: self.scalar.mul_add(o.scalar, -self.vector.dot(o.vector)),
        }
    }
}

/// Returns p in lanes in which the mask holds, and q in other lanes.
#[inline(always)]
fn choose<S: Scalar>(m: S::Mask, p: [S; 4], q: [S; 4]) -> [S; 4] {
    [S::select(m, p[0], q[0]), S::select(m, p[1], q[1]), S::select(m, p[2], q[2]), S::select(m, p[3], q[3])]
}
