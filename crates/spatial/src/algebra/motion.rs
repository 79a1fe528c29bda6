//! Spatial vectors: motions (velocities, accelerations) and forces.

use crate::algebra::vector::{Vec3, impl_linear};
use crate::scalar::{Constant, Scalar};

/// Cross product of spatial algebra: v × m for two motions, and v ×* f for a motion and a force. The type of the second
/// operand selects the product.
pub trait Cross<T> {
    /// Returns v × x: the rate of change of x if x is fixed in a body that moves with v.
    fn cross(self, x: T) -> T;
}

/// Spatial velocity or acceleration, [linear; angular]: motion of the body's point at the frame's origin, and rotation
/// of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Motion<S> {
    /// Motion of the body's point at the origin of the frame (m/s or m/s²).
    pub linear: Vec3<S>,
    /// Rotation of the body (rad/s or rad/s²).
    pub angular: Vec3<S>,
}
impl_linear!(Motion { linear, angular });

/// Spatial force or momentum, [linear; angular]: sum of the forces, and their moment about the frame's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Force<S> {
    /// Force (N) or momentum (kg m/s).
    pub linear: Vec3<S>,
    /// Moment about the origin of the frame (N m), or angular momentum (kg m²/s).
    pub angular: Vec3<S>,
}
impl_linear!(Force { linear, angular });

macro_rules! impl_six {
    ($type:ident) => {
        impl<S: Scalar> $type<S> {
            /// Creates a vector from its linear and angular parts.
            #[inline(always)]
            pub fn new(linear: Vec3<S>, angular: Vec3<S>) -> Self {
                Self { linear, angular }
            }
            /// Returns the six components as an array, the linear part first.
            #[inline(always)]
            pub fn to_array(self) -> [S; 6] {
                let (l, a) = (self.linear, self.angular);
                [l.x, l.y, l.z, a.x, a.y, a.z]
            }
        }
        impl<S> From<[S; 6]> for $type<S> {
            #[inline(always)]
            fn from([a, b, c, d, e, f]: [S; 6]) -> Self {
                Self { linear: [a, b, c].into(), angular: [d, e, f].into() }
            }
        }
    };
}
impl_six!(Motion);
impl_six!(Force);

impl<S: Scalar> Force<S> {
    /// Returns [f; p × f]: a force f (N) that acts at the point p (m), and its moment about the frame's origin.
    ///
    /// ```
    /// use condyle_spatial::{Act, Force, Mat3, Se3, Vec3};
    /// // a force of the world at a point of the world, in the frame of a body and about its origin
    /// let oXb = Se3::new(Mat3::identity(), Vec3::new(0.0, 0.0, 1.0));
    /// let push = oXb.act_inv(Force::at_point(Vec3::new(0.0, 0.0, 3.0), Vec3::new(5.0, 0.0, 0.0)));
    /// assert_eq!(push.to_array(), [5.0, 0.0, 0.0, 0.0, 10.0, 0.0]);
    /// ```
    #[inline(always)]
    pub fn at_point(point: Vec3<S>, force: Vec3<S>) -> Self {
        Self { linear: force, angular: point.cross(force) }
    }
}

impl<S: Scalar> Motion<S> {
    /// Returns v + ω × p for the motion [v; ω]: the velocity (m/s) of the body's point at p (m), in coordinates of the
    /// frame.
    #[inline(always)]
    pub fn velocity_at(self, point: Vec3<S>) -> Vec3<S> {
        self.angular.cross_add(point, self.linear)
    }

    /// Returns ⟨m, f⟩ = m · f: the power of force f on motion m (W).
    #[inline(always)]
    pub fn dot(self, f: Force<S>) -> S {
        self.linear.dot_add(f.linear, self.angular.dot(f.angular))
    }
}

impl<S: Scalar> Cross<Motion<S>> for Motion<S> {
    /// Returns [v; ω] × m = [ω × mᵥ + v × m_ω; ω × m_ω] for the motion m = [mᵥ; m_ω].
    #[inline(always)]
    fn cross(self, m: Motion<S>) -> Motion<S> {
        Motion {
            linear: self.angular.cross_add(m.linear, self.linear.cross(m.angular)),
            angular: self.angular.cross(m.angular),
        }
    }
}

impl<S: Scalar> Cross<Force<S>> for Motion<S> {
    /// Returns [v; ω] ×* [f; n] = [ω × f; ω × n + v × f] for a force f with the moment n.
    #[inline(always)]
    fn cross(self, f: Force<S>) -> Force<S> {
        Force {
            linear: self.angular.cross(f.linear),
            angular: self.angular.cross_add(f.angular, self.linear.cross(f.linear)),
        }
    }
}
