//! The pose into which a joint moves its body, and how it acts on what the body carries.

use super::{Joint, kinematics::point, kinematics::quaternion};
use crate::layout::Layout;
use condyle_spatial::{Act, ArticulatedInertia, Force, Inertia, Mat3, Motion, Scalar, Se3, Sym3, Vec3};

/// X_J(q), the body's frame in the joint's, in the form that costs least to compute with.
#[derive(Clone, Copy, Debug)]
pub enum JointPlacement<S> {
    /// A rotation about z.
    AboutZ {
        /// Of the angle.
        sin: S,
        /// Of the angle.
        cos: S,
    },
    /// Any pose.
    General(Se3<S>),
}

#[doc(hidden)]
impl Joint {
    /// X_J(q) of joint i of a pass, whose sine and cosine are known: λXi = X_T X_J.
    #[inline(always)]
    pub fn own_placement<L: Layout>(l: &L, i: usize, q: &[L::S], sin: L::S, cos: L::S) -> JointPlacement<L::S> {
        let o = L::S::zero();
        let about_z = Mat3 { x: Vec3::new(cos, sin, o), y: Vec3::new(-sin, cos, o), z: Mat3::identity().z };
        JointPlacement::General(match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => return JointPlacement::AboutZ { sin, cos },
            Self::Prismatic { .. } => Se3::new(Mat3::identity(), Vec3::new(o, o, l.position(q, i, 0))),
            Self::Helical { pitch, .. } => Se3::new(about_z, Vec3::new(o, o, l.position(q, i, 0) * L::S::splat(pitch))),
            Self::Spherical => Se3::new(quaternion(l, i, q, 0).to_rotation(), Vec3::zero()),
            Self::Planar => Se3::new(about_z, Vec3::new(l.position(q, i, 0), l.position(q, i, 1), o)),
            Self::Translation => Se3::new(Mat3::identity(), point(l, i, q)),
            Self::FreeFlyer => Se3::new(quaternion(l, i, q, 3).to_rotation(), point(l, i, q)),
        })
    }
}

impl<S: Scalar> JointPlacement<S> {
    /// The body's origin in the joint's frame.
    #[inline(always)]
    pub fn translation(&self) -> Vec3<S> {
        match self {
            Self::AboutZ { .. } => Vec3::zero(),
            Self::General(X) => X.translation,
        }
    }

    /// Rᵀ x: a vector of the joint's frame in the body's.
    #[inline(always)]
    pub fn turn_inv(&self, x: Vec3<S>) -> Vec3<S> {
        match *self {
            Self::AboutZ { sin, cos } => about_z(-sin, cos, x),
            Self::General(X) => X.rotation.transpose_mul(x),
        }
    }

    /// X⁻¹ m: a motion of the joint's frame in the body's.
    #[inline(always)]
    pub fn act_inv(&self, m: Motion<S>) -> Motion<S> {
        match *self {
            Self::AboutZ { sin, cos } => Motion::new(about_z(-sin, cos, m.linear), about_z(-sin, cos, m.angular)),
            Self::General(X) => X.act_inv(m),
        }
    }
}

/// R x.
#[inline(always)]
fn about_z<S: Scalar>(sin: S, cos: S, x: Vec3<S>) -> Vec3<S> {
    Vec3::new(x.x.mul_add(cos, -(x.y * sin)), x.x.mul_add(sin, x.y * cos), x.z)
}

/// R A Rᵀ, of which the upper left part is
///
/// ```text
/// a' = a − s g,   d' = d + s g,   b' = c g − e,   e' = c g − b     with g = s (a − d) + c (b + e)
/// ```
///
/// for the rows (a, b) and (e, d): half of the products that two products of matrices take.
#[inline(always)]
fn matrix_about_z<S: Scalar>(sin: S, cos: S, A: Mat3<S>) -> Mat3<S> {
    let (a, b, e, d) = (A.x.x, A.y.x, A.x.y, A.y.y);
    let g = (a - d).mul_add(sin, (b + e) * cos);
    let (row, column) = (about_z(sin, cos, Vec3::new(A.x.z, A.y.z, A.z.z)), about_z(sin, cos, A.z));
    Mat3 {
        x: Vec3::new(a - g * sin, g.mul_add(cos, -b), row.x),
        y: Vec3::new(g.mul_add(cos, -e), g.mul_add(sin, d), row.y),
        z: column,
    }
}

/// The same of a symmetric matrix.
#[inline(always)]
fn symmetric_about_z<S: Scalar>(sin: S, cos: S, A: Sym3<S>) -> Sym3<S> {
    let g = (A.xx - A.yy).mul_add(sin, (A.xy + A.xy) * cos);
    let z = about_z(sin, cos, Vec3::new(A.xz, A.yz, A.zz));
    Sym3 { xx: A.xx - g * sin, xy: g.mul_add(cos, -A.xy), yy: g.mul_add(sin, A.yy), xz: z.x, yz: z.y, zz: A.zz }
}

/// What a joint carries, which its parent's side sees in the joint's frame.
pub trait Carried<S>: Sized {
    /// X x.
    fn carried_by(self, X: &JointPlacement<S>) -> Self;
}

impl<S: Scalar> Carried<S> for Force<S> {
    #[inline(always)]
    fn carried_by(self, X: &JointPlacement<S>) -> Self {
        match *X {
            JointPlacement::AboutZ { sin, cos } => {
                Self::new(about_z(sin, cos, self.linear), about_z(sin, cos, self.angular))
            }
            JointPlacement::General(X) => X.act(self),
        }
    }
}

impl<S: Scalar> Carried<S> for Inertia<S> {
    #[inline(always)]
    fn carried_by(self, X: &JointPlacement<S>) -> Self {
        match *X {
            JointPlacement::AboutZ { sin, cos } => Self {
                mass: self.mass,
                mass_com: about_z(sin, cos, self.mass_com),
                rotational: symmetric_about_z(sin, cos, self.rotational),
            },
            JointPlacement::General(X) => X.act(self),
        }
    }
}

impl<S: Scalar> Carried<S> for ArticulatedInertia<S> {
    #[inline(always)]
    fn carried_by(self, X: &JointPlacement<S>) -> Self {
        match *X {
            JointPlacement::AboutZ { sin, cos } => Self {
                linear: symmetric_about_z(sin, cos, self.linear),
                coupling: matrix_about_z(sin, cos, self.coupling),
                rotational: symmetric_about_z(sin, cos, self.rotational),
            },
            JointPlacement::General(X) => X.act(self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers about 1.
    const ROUNDING: f64 = 1e-14;

    fn is_equal(a: Force<f64>, b: Force<f64>) -> bool {
        a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < ROUNDING)
    }

    /// What turns about z in few products is what any pose makes of it.
    #[test]
    fn about_z_is_a_pose() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let o = Vec3::zero();
        let rotation = Mat3 { x: Vec3::new(cos, sin, 0.0), y: Vec3::new(-sin, cos, 0.0), ..Mat3::identity() };
        let (short, long) = (JointPlacement::AboutZ { sin, cos }, JointPlacement::General(Se3::new(rotation, o)));
        let f = Force::new(Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.7, 0.1, -0.4));
        let m = Motion::new(Vec3::new(-0.6, 0.8, 0.2), Vec3::new(0.4, 0.9, -0.3));
        let I = Inertia::from_com(
            1.5,
            Vec3::new(0.1, 0.2, -0.3),
            Sym3 { xx: 0.4, xy: 0.03, yy: 0.5, xz: -0.02, yz: 0.05, zz: 0.6 },
        );
        let IA = ArticulatedInertia::from(I).minus_outer(f, 0.2);
        assert!(is_equal(f.carried_by(&short), f.carried_by(&long)));
        assert!(is_equal(I.carried_by(&short) * m, I.carried_by(&long) * m));
        assert!(is_equal(IA.carried_by(&short) * m, IA.carried_by(&long) * m));
        let [a, b] = [short, long].map(|X| Force::from(X.act_inv(m).to_array()));
        assert!(is_equal(a, b));
        let [a, b] = [short, long].map(|X| Force::new(X.turn_inv(m.linear), X.translation()));
        assert!(is_equal(a, b));
    }
}
