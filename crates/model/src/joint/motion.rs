//! Motion of a joint, and its addition to the motion of a body.

use condyle_spatial::{Mat3, Motion, Scalar, Vec3};

/// Velocity S q̇ or acceleration S q̈ of a joint with the motion subspace S, in the body's frame. Each kind of joint
/// has the form with the fewest numbers.
#[derive(Clone, Copy)]
pub enum JointMotion<S> {
    /// Motion about z.
    Revolute(S),
    /// Motion along z.
    Prismatic(S),
    /// Motion along several axes.
    General(Motion<S>),
}

impl<S: Scalar> core::ops::Add<JointMotion<S>> for Motion<S> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, vJ: JointMotion<S>) -> Self {
        match vJ {
            JointMotion::Revolute(x) => self.angular.z += x,
            JointMotion::Prismatic(x) => self.linear.z += x,
            JointMotion::General(m) => self += m,
        }
        self
    }
}

/// Rotation of a body and acceleration of its origin, in the form that the equations of Newton and Euler need.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct ClassicalMotion<S> {
    /// Angular velocity ω.
    pub w: Vec3<S>,
    /// Angular acceleration ω̇.
    pub dw: Vec3<S>,
    /// Classical acceleration of the body's origin.
    pub a: Vec3<S>,
}

impl<S: Scalar> ClassicalMotion<S> {
    /// Returns K = ω̇× + ω× ω×. With the acceleration a of the origin, a point r of the body has the acceleration a + K
    /// r.
    #[inline(always)]
    pub fn centripetal(&self) -> Mat3<S> {
        let (w, dw, minus) = (self.w, self.dw, -self.w);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        let (xx, yy) = (minus.x * w.x, minus.y * w.y);
        Mat3 {
            x: Vec3::new(minus.z.mul_add(w.z, yy), xy + dw.z, xz - dw.y),
            y: Vec3::new(xy - dw.z, minus.z.mul_add(w.z, xx), yz + dw.x),
            z: Vec3::new(xz + dw.y, yz - dw.x, xx + yy),
        }
    }
}

condyle_spatial::same_layout!(ClassicalMotion { w, dw, a });

impl<S: Scalar> JointMotion<S> {
    /// Returns the motion with all six components.
    #[inline(always)]
    fn motion(self) -> Motion<S> {
        Motion::zero() + self
    }

    /// Returns the motion of a body: ω + ω_J, ω̇ + ω̇_J + ω × ω_J, a + a_J + (2 ω + ω_J) × v_J. `self` is the motion
    /// that the body would have if the joint were fixed. The index J marks the motion of the joint, whose velocity and
    /// acceleration are given.
    #[inline(always)]
    pub fn added_to(
        self,
        aJ: Self,
        ClassicalMotion { mut w, mut dw, mut a }: ClassicalMotion<S>,
    ) -> ClassicalMotion<S> {
        match (self, aJ) {
            (Self::Revolute(x), Self::Revolute(xx)) => {
                dw = Vec3::new(w.y.mul_add(x, dw.x), (-w.x).mul_add(x, dw.y), dw.z + xx);
                w.z += x;
            }
            (Self::Prismatic(x), Self::Prismatic(xx)) => {
                let twice = x + x;
                a = Vec3::new(w.y.mul_add(twice, a.x), (-w.x).mul_add(twice, a.y), a.z + xx);
            }
            (vJ, aJ) => {
                let (vJ, aJ) = (vJ.motion(), aJ.motion());
                dw = w.cross_add(vJ.angular, dw + aJ.angular);
                a = (w + w + vJ.angular).cross_add(vJ.linear, a + aJ.linear);
                w += vJ.angular;
            }
        }
        ClassicalMotion { w, dw, a }
    }
}
