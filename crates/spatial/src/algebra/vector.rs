//! Vectors and matrices in three dimensions. They are small enough to stay in registers for any scalar.

use crate::scalar::{Constant, Scalar};
use core::ops::Mul;

/// Implements operations for each component: `+`, `−`, negation, `+=`, `−=`, the product with a scalar, and the
/// conversion of constants to a scalar. The fields of the struct must have these operations.
macro_rules! impl_linear {
    ($type:ident { $($field:ident),* }) => {
        impl<S: Scalar> core::ops::Add for $type<S> {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                Self { $($field: self.$field + o.$field),* }
            }
        }
        impl<S: Scalar> core::ops::Sub for $type<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                Self { $($field: self.$field - o.$field),* }
            }
        }
        impl<S: Scalar> core::ops::Neg for $type<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { $($field: -self.$field),* }
            }
        }
        impl<S: Scalar> core::ops::AddAssign for $type<S> {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                $(self.$field += o.$field;)*
            }
        }
        impl<S: Scalar> core::ops::SubAssign for $type<S> {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                $(self.$field -= o.$field;)*
            }
        }
        impl<S: Scalar> $type<S> {
            /// Returns the value with all components zero.
            #[inline(always)]
            pub fn zero() -> Self {
                Self { $($field: crate::algebra::vector::Zero::zero()),* }
            }
            /// Multiplies each component by s.
            #[inline(always)]
            pub fn scale(self, s: S) -> Self {
                Self { $($field: crate::algebra::vector::Scale::scale(self.$field, s)),* }
            }
            /// Returns self · s + o. The result is rounded once if the instruction set has fused products.
            #[inline(always)]
            pub fn scale_add(self, s: S, o: Self) -> Self {
                Self { $($field: crate::algebra::vector::Scale::scale_add(self.$field, s, o.$field)),* }
            }
        }
        impl<S: Scalar> crate::algebra::vector::Zero for $type<S> {
            #[inline(always)]
            fn zero() -> Self {
                Self::zero()
            }
        }
        impl<S: Scalar> crate::algebra::vector::Scale<S> for $type<S> {
            #[inline(always)]
            fn scale(self, s: S) -> Self {
                self.scale(s)
            }
            #[inline(always)]
            fn scale_add(self, s: S, o: Self) -> Self {
                self.scale_add(s, o)
            }
        }
        crate::algebra::vector::impl_lift!($type { $($field),* });
    };
}
pub(crate) use impl_linear;

/// Implements `lift`, the conversion to another scalar, for a struct of model constants.
macro_rules! impl_lift {
    ($type:ident { $($field:ident),* }) => {
        impl<R: Copy> $type<R> {
            /// Converts each component to a scalar of type `S`.
            #[inline(always)]
            pub fn lift<S: Scalar>(self) -> $type<S>
            where
                R: Constant<S>,
            {
                $type { $($field: self.$field.lift()),* }
            }
        }
    };
}
pub(crate) use impl_lift;

/// Zero of a component type; used by `impl_linear`.
pub(crate) trait Zero {
    fn zero() -> Self;
}
impl<S: Scalar> Zero for S {
    #[inline(always)]
    fn zero() -> S {
        S::splat(0.0)
    }
}

/// Product of a component with a scalar; used by `impl_linear`.
pub(crate) trait Scale<S> {
    fn scale(self, s: S) -> Self;
    fn scale_add(self, s: S, o: Self) -> Self;
}
impl<S: Scalar> Scale<S> for S {
    #[inline(always)]
    fn scale(self, s: S) -> S {
        self * s
    }
    #[inline(always)]
    fn scale_add(self, s: S, o: S) -> S {
        self.mul_add(s, o)
    }
}

/// Vector in three dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs)]
#[repr(C)]
pub struct Vec3<S> {
    pub x: S,
    pub y: S,
    pub z: S,
}
impl_linear!(Vec3 { x, y, z });

impl<S: Scalar> Vec3<S> {
    /// Creates the vector (x, y, z).
    #[inline(always)]
    pub fn new(x: S, y: S, z: S) -> Self {
        Self { x, y, z }
    }
    /// Returns the dot product of two vectors.
    #[inline(always)]
    pub fn dot(self, o: Self) -> S {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z * o.z))
    }
    /// Returns the dot product of two vectors, plus s.
    #[inline(always)]
    pub fn dot_add(self, o: Self, s: S) -> S {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z.mul_add(o.z, s)))
    }
    /// Returns the cross product of two vectors, plus c.
    #[inline(always)]
    pub fn cross_add(self, o: Self, c: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, (-self.z).mul_add(o.y, c.x)),
            y: self.z.mul_add(o.x, (-self.x).mul_add(o.z, c.y)),
            z: self.x.mul_add(o.y, (-self.y).mul_add(o.x, c.z)),
        }
    }
    /// Returns the cross product of two vectors.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, -(self.z * o.y)),
            y: self.z.mul_add(o.x, -(self.x * o.z)),
            z: self.x.mul_add(o.y, -(self.y * o.x)),
        }
    }
    /// Returns |a|².
    #[inline(always)]
    pub fn norm_squared(self) -> S {
        self.dot(self)
    }
    /// Returns the matrix `[a]ₓ` with `[a]ₓ b = a × b`.
    #[inline(always)]
    pub fn skew(self) -> Mat3<S> {
        let o = S::zero();
        Mat3 { x: Self::new(o, self.z, -self.y), y: Self::new(-self.z, o, self.x), z: Self::new(self.y, -self.x, o) }
    }
    /// Returns the components as an array.
    #[inline(always)]
    pub fn to_array(self) -> [S; 3] {
        [self.x, self.y, self.z]
    }
}

impl<S> From<[S; 3]> for Vec3<S> {
    #[inline(always)]
    fn from([x, y, z]: [S; 3]) -> Self {
        Self { x, y, z }
    }
}

/// 3×3 matrix, stored by columns. If it is a rotation aRb, the columns are the axes of b in coordinates of a.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs)]
#[repr(C)]
pub struct Mat3<S> {
    pub x: Vec3<S>,
    pub y: Vec3<S>,
    pub z: Vec3<S>,
}
impl_linear!(Mat3 { x, y, z });

impl<S: Scalar> Mat3<S> {
    /// Returns the identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (o, i) = (S::zero(), S::one());
        Self { x: Vec3::new(i, o, o), y: Vec3::new(o, i, o), z: Vec3::new(o, o, i) }
    }
    /// Returns A b + c, where A is this matrix.
    #[inline(always)]
    pub fn mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        self.x.scale_add(b.x, self.y.scale_add(b.y, self.z.scale_add(b.z, c)))
    }
    /// Returns Aᵀ b + c, where A is this matrix.
    #[inline(always)]
    pub fn transpose_mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        Vec3::new(self.x.dot_add(b, c.x), self.y.dot_add(b, c.y), self.z.dot_add(b, c.z))
    }
    /// Returns Aᵀ b, where A is this matrix.
    #[inline(always)]
    pub fn transpose_mul(self, b: Vec3<S>) -> Vec3<S> {
        Vec3::new(self.x.dot(b), self.y.dot(b), self.z.dot(b))
    }
    /// Returns the transpose of this matrix.
    #[inline(always)]
    pub fn transpose(self) -> Self {
        let Self { x, y, z } = self;
        Self { x: Vec3::new(x.x, y.x, z.x), y: Vec3::new(x.y, y.y, z.y), z: Vec3::new(x.z, y.z, z.z) }
    }
    /// Returns this matrix with s added to each diagonal entry.
    #[inline(always)]
    pub fn add_diagonal(mut self, s: S) -> Self {
        self.x.x += s;
        self.y.y += s;
        self.z.z += s;
        self
    }
    /// Returns the columns.
    #[inline(always)]
    pub fn columns(self) -> [Vec3<S>; 3] {
        [self.x, self.y, self.z]
    }
}

/// Maximum `rotation_error` of a matrix that counts as a rotation. A matrix in a file with seven digits has this
/// rounding error.
const ROTATION_ROUNDING: f64 = 1e-6;

impl Mat3<f64> {
    /// Returns whether the matrix is a rotation: its columns are orthogonal unit vectors and right-handed, up to errors
    /// of 1e-6 (see [`rotation_error`](Self::rotation_error)). Returns `false` if a number is not finite.
    ///
    /// ```
    /// use condyle_spatial::{Mat3, Vec3};
    /// let turn = Mat3::<f64>::identity();
    /// assert!(turn.is_rotation() && !Mat3 { z: Vec3::new(0.0, 0.0, -1.0), ..turn }.is_rotation());
    /// ```
    pub fn is_rotation(self) -> bool {
        self.rotation_error() < ROTATION_ROUNDING
    }

    /// Returns the distance from a rotation: the largest of |xᵀx − 1|, |yᵀy − 1|, |xᵀy| and ‖x × y − z‖, where x, y, z
    /// are the columns. Returns NaN or infinity if a number is not finite.
    ///
    /// ```
    /// use condyle_spatial::Mat3;
    /// let turn = Mat3::<f64>::identity();
    /// assert_eq!((turn.rotation_error(), turn.scale(2.0).rotation_error()), (0.0, 3.0));
    /// ```
    pub fn rotation_error(self) -> f64 {
        let Self { x, y, z } = self;
        let off = [x.norm_squared() - 1.0, y.norm_squared() - 1.0, x.dot(y), (x.cross(y) - z).norm_squared().sqrt()];
        off.iter().fold(0.0, |most: f64, e| if e.abs() <= most || most.is_nan() { most } else { e.abs() })
    }
}

impl<S: Scalar> Mul<Vec3<S>> for Mat3<S> {
    type Output = Vec3<S>;
    #[inline(always)]
    fn mul(self, b: Vec3<S>) -> Vec3<S> {
        self.x.scale_add(b.x, self.y.scale_add(b.y, self.z.scale(b.z)))
    }
}

impl<S: Scalar> Mul for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { x: self * b.x, y: self * b.y, z: self * b.z }
    }
}

/// Symmetric 3×3 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs)]
#[repr(C)]
pub struct Sym3<S> {
    pub xx: S,
    pub xy: S,
    pub yy: S,
    pub xz: S,
    pub yz: S,
    pub zz: S,
}
impl_linear!(Sym3 { xx, xy, yy, xz, yz, zz });

impl<S: Scalar> Sym3<S> {
    /// Returns s times the identity matrix.
    #[inline(always)]
    pub fn diagonal(s: S) -> Self {
        let o = S::zero();
        Self { xx: s, xy: o, yy: s, xz: o, yz: o, zz: s }
    }
    /// Returns the outer product a aᵀ.
    #[inline(always)]
    pub fn outer(a: Vec3<S>) -> Self {
        Self { xx: a.x * a.x, xy: a.x * a.y, yy: a.y * a.y, xz: a.x * a.z, yz: a.y * a.z, zz: a.z * a.z }
    }
    /// Returns A + s a aᵀ, where A is this matrix.
    #[inline(always)]
    pub fn add_outer(self, s: S, a: Vec3<S>) -> Self {
        let b = a.scale(s);
        Self {
            xx: b.x.mul_add(a.x, self.xx),
            xy: b.x.mul_add(a.y, self.xy),
            yy: b.y.mul_add(a.y, self.yy),
            xz: b.x.mul_add(a.z, self.xz),
            yz: b.y.mul_add(a.z, self.yz),
            zz: b.z.mul_add(a.z, self.zz),
        }
    }
    /// Returns A b + c, where A is this matrix.
    #[inline(always)]
    pub fn mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        Vec3::new(
            self.xx.mul_add(b.x, self.xy.mul_add(b.y, self.xz.mul_add(b.z, c.x))),
            self.xy.mul_add(b.x, self.yy.mul_add(b.y, self.yz.mul_add(b.z, c.y))),
            self.xz.mul_add(b.x, self.yz.mul_add(b.y, self.zz.mul_add(b.z, c.z))),
        )
    }
    /// Returns the sum a bᵀ + b aᵀ of two outer products.
    #[inline(always)]
    pub fn outer_sum(a: Vec3<S>, b: Vec3<S>) -> Self {
        let two = S::splat(2.0);
        Self {
            xx: two * a.x * b.x,
            xy: a.x.mul_add(b.y, a.y * b.x),
            yy: two * a.y * b.y,
            xz: a.x.mul_add(b.z, a.z * b.x),
            yz: a.y.mul_add(b.z, a.z * b.y),
            zz: two * a.z * b.z,
        }
    }
    /// Returns this matrix with s added to each diagonal entry.
    #[inline(always)]
    pub fn add_diagonal(mut self, s: S) -> Self {
        self.xx += s;
        self.yy += s;
        self.zz += s;
        self
    }
    /// Returns R A Rᵀ, where A is this matrix.
    #[inline(always)]
    pub fn rotate(self, R: Mat3<S>) -> Self {
        let B = (R * self.full()).transpose(); // the columns of B are the rows of R A
        let Rt = R.transpose(); // the columns of Rᵀ are the rows of R
        Self {
            xx: B.x.dot(Rt.x),
            xy: B.x.dot(Rt.y),
            yy: B.y.dot(Rt.y),
            xz: B.x.dot(Rt.z),
            yz: B.y.dot(Rt.z),
            zz: B.z.dot(Rt.z),
        }
    }
    /// Returns the matrix as a [`Mat3`], with all nine entries.
    #[inline(always)]
    pub fn full(self) -> Mat3<S> {
        Mat3 {
            x: Vec3::new(self.xx, self.xy, self.xz),
            y: Vec3::new(self.xy, self.yy, self.yz),
            z: Vec3::new(self.xz, self.yz, self.zz),
        }
    }
}

impl<S: Scalar> Mul<Vec3<S>> for Sym3<S> {
    type Output = Vec3<S>;
    #[inline(always)]
    fn mul(self, b: Vec3<S>) -> Vec3<S> {
        Vec3::new(
            self.xx.mul_add(b.x, self.xy.mul_add(b.y, self.xz * b.z)),
            self.xy.mul_add(b.x, self.yy.mul_add(b.y, self.yz * b.z)),
            self.xz.mul_add(b.x, self.yz.mul_add(b.y, self.zz * b.z)),
        )
    }
}
