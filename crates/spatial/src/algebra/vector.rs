//! Vectors and matrices in three dimensions, small enough to stay in registers on any scalar.

use crate::scalar::{Constant, Scalar};
use core::ops::Mul;

/// Component-wise `+`, `−`, negation, `+=`, `−=`, product with a scalar, and lifting of constants, for a struct whose
/// fields have them.
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
            /// All components zero.
            #[inline(always)]
            pub fn zero() -> Self {
                Self { $($field: crate::algebra::vector::Zero::zero()),* }
            }
            /// Each component times s.
            #[inline(always)]
            pub fn scale(self, s: S) -> Self {
                Self { $($field: crate::algebra::vector::Scale::scale(self.$field, s)),* }
            }
            /// self · s + o, fused where the instruction set has it.
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

/// The model constants in a struct as scalars of a pass.
macro_rules! impl_lift {
    ($type:ident { $($field:ident),* }) => {
        impl<R: Copy> $type<R> {
            /// The same, with each component a scalar of type `S`.
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

/// Additive neutral element of a component, for the macro above.
pub(crate) trait Zero {
    fn zero() -> Self;
}
impl<S: Scalar> Zero for S {
    #[inline(always)]
    fn zero() -> S {
        S::splat(0.0)
    }
}

/// Product of a component with a scalar, for the macro above.
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

/// A vector in three dimensions.
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
    /// The vector (x, y, z).
    #[inline(always)]
    pub fn new(x: S, y: S, z: S) -> Self {
        Self { x, y, z }
    }
    /// a · b.
    #[inline(always)]
    pub fn dot(self, o: Self) -> S {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z * o.z))
    }
    /// a · b + s.
    #[inline(always)]
    pub fn dot_add(self, o: Self, s: S) -> S {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z.mul_add(o.z, s)))
    }
    /// a × b + c.
    #[inline(always)]
    pub fn cross_add(self, o: Self, c: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, (-self.z).mul_add(o.y, c.x)),
            y: self.z.mul_add(o.x, (-self.x).mul_add(o.z, c.y)),
            z: self.x.mul_add(o.y, (-self.y).mul_add(o.x, c.z)),
        }
    }
    /// a × b.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, -(self.z * o.y)),
            y: self.z.mul_add(o.x, -(self.x * o.z)),
            z: self.x.mul_add(o.y, -(self.y * o.x)),
        }
    }
    /// |a|².
    #[inline(always)]
    pub fn norm_squared(self) -> S {
        self.dot(self)
    }
    /// a×, the matrix with a× b = a × b.
    #[inline(always)]
    pub fn skew(self) -> Mat3<S> {
        let o = S::zero();
        Mat3 { x: Self::new(o, self.z, -self.y), y: Self::new(-self.z, o, self.x), z: Self::new(self.y, -self.x, o) }
    }
    /// The components as an array.
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

/// A 3×3 matrix by its columns. Of a rotation aRb they are the axes of b in a.
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
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (o, i) = (S::zero(), S::one());
        Self { x: Vec3::new(i, o, o), y: Vec3::new(o, i, o), z: Vec3::new(o, o, i) }
    }
    /// A b + c.
    #[inline(always)]
    pub fn mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        self.x.scale_add(b.x, self.y.scale_add(b.y, self.z.scale_add(b.z, c)))
    }
    /// Aᵀ b + c.
    #[inline(always)]
    pub fn transpose_mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        Vec3::new(self.x.dot_add(b, c.x), self.y.dot_add(b, c.y), self.z.dot_add(b, c.z))
    }
    /// Aᵀ b.
    #[inline(always)]
    pub fn transpose_mul(self, b: Vec3<S>) -> Vec3<S> {
        Vec3::new(self.x.dot(b), self.y.dot(b), self.z.dot(b))
    }
    /// Aᵀ.
    #[inline(always)]
    pub fn transpose(self) -> Self {
        let Self { x, y, z } = self;
        Self { x: Vec3::new(x.x, y.x, z.x), y: Vec3::new(x.y, y.y, z.y), z: Vec3::new(x.z, y.z, z.z) }
    }
    /// A + s 1.
    #[inline(always)]
    pub fn add_diagonal(mut self, s: S) -> Self {
        self.x.x += s;
        self.y.y += s;
        self.z.z += s;
        self
    }
    /// The columns.
    #[inline(always)]
    pub fn columns(self) -> [Vec3<S>; 3] {
        [self.x, self.y, self.z]
    }
}

/// The distance from a rotation that a matrix may have (in length, in cosines of right angles): that of a file of seven
/// digits.
const ROTATION_ROUNDING: f64 = 1e-6;

impl Mat3<f64> {
    /// Whether it is a rotation: its columns are unit vectors at right angles, right-handed, all up to 1e-6 (in length, in
    /// cosines of right angles). It is none if a number is not finite.
    ///
    /// ```
    /// use condyle_spatial::{Mat3, Vec3};
    /// let turn = Mat3::<f64>::identity();
    /// assert!(turn.is_rotation() && !Mat3 { z: Vec3::new(0.0, 0.0, -1.0), ..turn }.is_rotation());
    /// ```
    pub fn is_rotation(self) -> bool {
        self.rotation_error() < ROTATION_ROUNDING
    }

    /// The distance from a rotation: the largest of |xᵀx − 1|, |yᵀy − 1|, |xᵀy| and ‖x × y − z‖ of its columns x, y, z. It is
    /// NaN or infinite if a number is not finite.
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

/// A symmetric 3×3 matrix.
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
    /// s 1.
    #[inline(always)]
    pub fn diagonal(s: S) -> Self {
        let o = S::zero();
        Self { xx: s, xy: o, yy: s, xz: o, yz: o, zz: s }
    }
    /// a aᵀ.
    #[inline(always)]
    pub fn outer(a: Vec3<S>) -> Self {
        Self { xx: a.x * a.x, xy: a.x * a.y, yy: a.y * a.y, xz: a.x * a.z, yz: a.y * a.z, zz: a.z * a.z }
    }
    /// A + s a aᵀ.
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
    /// A b + c.
    #[inline(always)]
    pub fn mul_add(self, b: Vec3<S>, c: Vec3<S>) -> Vec3<S> {
        Vec3::new(
            self.xx.mul_add(b.x, self.xy.mul_add(b.y, self.xz.mul_add(b.z, c.x))),
            self.xy.mul_add(b.x, self.yy.mul_add(b.y, self.yz.mul_add(b.z, c.y))),
            self.xz.mul_add(b.x, self.yz.mul_add(b.y, self.zz.mul_add(b.z, c.z))),
        )
    }
    /// a bᵀ + b aᵀ.
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
    /// A + s 1.
    #[inline(always)]
    pub fn add_diagonal(mut self, s: S) -> Self {
        self.xx += s;
        self.yy += s;
        self.zz += s;
        self
    }
    /// R A Rᵀ.
    #[inline(always)]
    pub fn rotate(self, R: Mat3<S>) -> Self {
        let B = (R * self.full()).transpose(); // the columns of B are the rows of R A
        let Rt = R.transpose(); // and those of Rᵀ the rows of R
        Self {
            xx: B.x.dot(Rt.x),
            xy: B.x.dot(Rt.y),
            yy: B.y.dot(Rt.y),
            xz: B.x.dot(Rt.z),
            yz: B.y.dot(Rt.z),
            zz: B.z.dot(Rt.z),
        }
    }
    /// The same as a full matrix.
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
