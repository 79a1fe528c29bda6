//! Inertias of rigid bodies and of articulated bodies.

use crate::algebra::motion::{Force, Motion};
use crate::algebra::se3::{Act, Se3};
use crate::algebra::vector::{Mat3, Sym3, Vec3, impl_linear};
use crate::scalar::{Constant, Scalar};
use core::ops::Mul;

/// Inertia of a rigid body: ten parameters. The body's equations of motion are linear in these parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Inertia<S> {
    /// Mass m (kg).
    pub mass: S,
    /// Mass times centre of mass, h = m c, in the frame of the inertia (kg m).
    pub mass_com: Vec3<S>,
    /// Rotational inertia Ī about the origin of the frame (kg m²).
    pub rotational: Sym3<S>,
}
impl_linear!(Inertia { mass, mass_com, rotational });

impl<S: Scalar> Inertia<S> {
    /// Creates an inertia from mass, centre of mass and rotational inertia about the centre of mass: Ī = I_c − m c× c×.
    ///
    /// ```
    /// use condyle_spatial::{Inertia, Motion, Sym3, Vec3};
    /// let I = Inertia::from_com(2.0, Vec3::new(0.0, 0.0, 0.5), Sym3::diagonal(0.1));
    /// assert_eq!(I.rotational.xx, 0.1 + 2.0 * 0.25); // the parallel-axis theorem
    /// ```
    pub fn from_com(mass: S, com: Vec3<S>, rotational: Sym3<S>) -> Self {
        let shift = Sym3::diagonal(com.norm_squared()) - Sym3::outer(com);
        Self { mass, mass_com: com.scale(mass), rotational: rotational + shift.scale(mass) }
    }
}

impl<S: Scalar> Mul<Motion<S>> for Inertia<S> {
    type Output = Force<S>;
    /// Returns I [v; ω] = [m v − h × ω; Ī ω + h × v] for the inertia I = (m, h, Ī).
    #[inline(always)]
    fn mul(self, v: Motion<S>) -> Force<S> {
        Force {
            linear: v.linear.scale_add(self.mass, v.angular.cross(self.mass_com)),
            angular: self.rotational.mul_add(v.angular, self.mass_com.cross(v.linear)),
        }
    }
}

impl<S: Scalar> Act<Inertia<S>> for Se3<S> {
    /// Rotates the inertia (m, h, Ī) by R, then shifts its origin by p: h' = R h + m p, Ī' = R Ī Rᵀ − p× Rh× − Rh× p× −
    /// m p× p×.
    #[inline(always)]
    fn act(&self, I: Inertia<S>) -> Inertia<S> {
        let p = self.translation;
        let h = self.rotation * I.mass_com;
        // With w = h + m p / 2, the three products −[p]ₓ[h]ₓ − [h]ₓ[p]ₓ − m [p]ₓ[p]ₓ become two: −[p]ₓ[w]ₓ − [w]ₓ[p]ₓ.
        let w = p.scale_add(I.mass * S::splat(0.5), h);
        let shift = -Sym3::outer_sum(p, w).add_diagonal(-(S::splat(2.0) * p.dot(w)));
        Inertia {
            mass: I.mass,
            mass_com: p.scale_add(I.mass, h),
            rotational: I.rotational.rotate(self.rotation) + shift,
        }
    }
    fn act_inv(&self, I: Inertia<S>) -> Inertia<S> {
        self.inverse().act(I)
    }
}

/// Inertia of an articulated body, seen from its handle: the body to which a force is applied. The inertia is a
/// symmetric 6×6 matrix with the blocks [[linear, coupling], [couplingᵀ, rotational]].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ArticulatedInertia<S> {
    /// Force per linear acceleration (kg).
    pub linear: Sym3<S>,
    /// Force per angular acceleration (kg m).
    pub coupling: Mat3<S>,
    /// Moment per angular acceleration (kg m²).
    pub rotational: Sym3<S>,
}
impl_linear!(ArticulatedInertia { linear, coupling, rotational });

impl<S: Scalar> From<Inertia<S>> for ArticulatedInertia<S> {
    #[inline(always)]
    fn from(I: Inertia<S>) -> Self {
        Self { linear: Sym3::diagonal(I.mass), coupling: (-I.mass_com).skew(), rotational: I.rotational }
    }
}

impl<S: Scalar> Mul<Motion<S>> for ArticulatedInertia<S> {
    type Output = Force<S>;
    #[inline(always)]
    fn mul(self, v: Motion<S>) -> Force<S> {
        Force {
            linear: self.linear.mul_add(v.linear, self.coupling * v.angular),
            angular: self.coupling.transpose_mul_add(v.linear, self.rotational * v.angular),
        }
    }
}

impl<S: Scalar> ArticulatedInertia<S> {
    /// Returns the force I v for the motion v that has the linear part `linear` and no angular part.
    #[inline(always)]
    pub fn act_linear(self, linear: Vec3<S>) -> Force<S> {
        Force { linear: self.linear * linear, angular: self.coupling.transpose_mul(linear) }
    }

    /// Returns I − s U Uᵀ, where I is this inertia.
    #[inline(always)]
    pub fn minus_outer(self, U: Force<S>, s: S) -> Self {
        let (s, Mat3 { x, y, z }) = (-s, self.coupling);
        let a = U.angular.scale(s);
        Self {
            linear: self.linear.add_outer(s, U.linear),
            coupling: Mat3 {
                x: U.linear.scale_add(a.x, x),
                y: U.linear.scale_add(a.y, y),
                z: U.linear.scale_add(a.z, z),
            },
            rotational: self.rotational.add_outer(s, U.angular),
        }
    }
}

impl<S: Scalar> Act<ArticulatedInertia<S>> for Se3<S> {
    /// Rotates the inertia, then shifts its origin. The body's origin at p moves with the linear motion of the frame's
    /// origin plus ω × p. A force f at p has the moment p × f about the frame's origin. With M, B, C the rotated
    /// linear, coupling and rotational blocks:
    ///
    /// ```text
    /// M' = M,   B' = B − M [p]ₓ,   C' = C + [p]ₓ B' + ([p]ₓ B)ᵀ
    /// ```
    #[inline(always)]
    fn act(&self, I: ArticulatedInertia<S>) -> ArticulatedInertia<S> {
        let (R, p) = (self.rotation, self.translation);
        let (linear, rotational) = (I.linear.rotate(R), I.rotational.rotate(R));
        let B = R * I.coupling * R.transpose();
        let Mat3 { x, y, z } = linear.full();
        // Computes M [p]ₓ column by column, for the linear block M and the translation p. The columns of [p]ₓ are (0,
        // p_z, −p_y), (−p_z, 0, p_x), (p_y, −p_x, 0).
        let Mp = Mat3 {
            x: y.scale_add(p.z, -z.scale(p.y)),
            y: z.scale_add(p.x, -x.scale(p.z)),
            z: x.scale_add(p.y, -y.scale(p.x)),
        };
        let coupling = B - Mp;
        let (K, k) = (coupling.columns().map(|b| p.cross(b)), B.columns().map(|b| p.cross(b)));
        let shift = Sym3 {
            xx: K[0].x + k[0].x,
            xy: K[1].x + k[0].y,
            yy: K[1].y + k[1].y,
            xz: K[2].x + k[0].z,
            yz: K[2].y + k[1].z,
            zz: K[2].z + k[2].z,
        };
        ArticulatedInertia { linear, coupling, rotational: rotational + shift }
    }
    fn act_inv(&self, I: ArticulatedInertia<S>) -> ArticulatedInertia<S> {
        self.inverse().act(I)
    }
}
