//! Pose of a joint, and transforms of the body's quantities by this pose.

use condyle_model::joint::Joint;
use condyle_model::layout::Layout;
use condyle_spatial::{Act, ArticulatedInertia, Force, Inertia, Mat3, Motion, Scalar, Se3, Sym3, Vec3};

/// Joint pose X_J(q): pose of the body's frame in the joint's frame, in the form with the fewest operations.
#[derive(Clone, Copy, Debug)]
pub enum JointPlacement<S> {
    /// A rotation about z.
    AboutZ {
        /// Sine of the angle.
        sin: S,
        /// Cosine of the angle.
        cos: S,
    },
    /// Any pose.
    General(Se3<S>),
}

impl<S: Scalar> JointPlacement<S> {
    /// Returns the pose X_J of joint i, given the sine and cosine of the joint's angle. With the constant placement
    /// X_T, the pose of body i in its parent's frame is λXi = X_T X_J.
    pub(crate) fn of<L: Layout<S = S>>(l: &L, i: usize, q: &[S], sin: S, cos: S) -> Self {
        if l.joint(i).turns_about_z() {
            return Self::AboutZ { sin, cos };
        }
        Self::General(Joint::placement_on(l, i, Se3::identity(), q, sin, cos))
    }

    /// Returns the body's origin in the joint's frame.
    pub fn translation(&self) -> Vec3<S> {
        match self {
            Self::AboutZ { .. } => Vec3::zero(),
            Self::General(X) => X.translation,
        }
    }

    /// Returns Rᵀ x: transforms a vector from the joint's frame to the body's frame.
    pub fn turn_inv(&self, x: Vec3<S>) -> Vec3<S> {
        match *self {
            Self::AboutZ { sin, cos } => about_z(-sin, cos, x),
            Self::General(X) => X.rotation.transpose_mul(x),
        }
    }

    /// Returns X⁻¹ m: transforms a motion from the joint's frame to the body's frame.
    pub fn act_inv(&self, m: Motion<S>) -> Motion<S> {
        match *self {
            Self::AboutZ { sin, cos } => Motion::new(about_z(-sin, cos, m.linear), about_z(-sin, cos, m.angular)),
            Self::General(X) => X.act_inv(m),
        }
    }
}

/// Returns R x, for the rotation R about z with this sine and cosine.
fn about_z<S: Scalar>(sin: S, cos: S, x: Vec3<S>) -> Vec3<S> {
    Vec3::new(x.x.mul_add(cos, -(x.y * sin)), x.x.mul_add(sin, x.y * cos), x.z)
}

/// Returns R A Rᵀ, for the rotation R about z with sine s and cosine c. The upper left block of A, with the rows (a, b)
/// and (e, d), becomes
///
/// ```text
/// a' = a − s g,   d' = d + s g,   b' = c g − e,   e' = c g − b     with g = s (a − d) + c (b + e)
/// ```
///
/// These formulas need half as many multiplications as two matrix products.
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

/// Returns R A Rᵀ for a symmetric matrix A and the rotation R about z.
fn symmetric_about_z<S: Scalar>(sin: S, cos: S, A: Sym3<S>) -> Sym3<S> {
    let g = (A.xx - A.yy).mul_add(sin, (A.xy + A.xy) * cos);
    let z = about_z(sin, cos, Vec3::new(A.xz, A.yz, A.zz));
    Sym3 { xx: A.xx - g * sin, xy: g.mul_add(cos, -A.xy), yy: g.mul_add(sin, A.yy), xz: z.x, yz: z.y, zz: A.zz }
}

/// Quantity of a body that a joint pose transforms from the body's frame to the joint's frame.
pub trait Carried<S>: Sized {
    /// Returns the quantity after the transform X.
    fn carried_by(self, X: &JointPlacement<S>) -> Self;
}

impl<S: Scalar> Carried<S> for Force<S> {
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
