//! Joints: all that depends on the kind of a joint is here.
//!
//! A joint moves along some of the six unit motions of the body's frame, and these stay the same in that frame whatever
//! its position: its motion subspace is constant in the body. The axis of a revolute or prismatic joint is turned to z
//! when the model is built, so that inside, S is the same for all of them. `q ⊕ δ` is the exponential of the joint's
//! group, with δ in the body's frame.

use crate::layout::Layout;
use condyle_spatial::lie::{self, MotionMap, Quaternion};
use condyle_spatial::{Act, Cross, Force, Mat3, Motion, Scalar, Se3, Vec3};
use serde::{Deserialize, Serialize};

/// The kind of a joint, with what it needs to know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Joint {
    /// One angle about an axis: q = \[θ\], v = \[θ̇\].
    Revolute {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One angle about an axis, without limits: q = [cos θ, sin θ], v = \[θ̇\].
    Continuous {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One length along an axis: q = \[d\], v = \[ḋ\].
    Prismatic {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// A screw: q = \[θ\], v = \[θ̇\], with `pitch` metres along the axis for each radian about it.
    Helical {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
        /// Metres per radian.
        pitch: f64,
    },
    /// A ball: q = quaternion (x, y, z, w), v = angular velocity in the body's frame.
    Spherical,
    /// Motion in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇].
    Planar,
    /// Three lengths: q = [x, y, z], v = q̇.
    Translation,
    /// A free body: q = [position, quaternion (x, y, z, w)], v = [linear, angular] in the body's frame.
    FreeFlyer,
}

/// A joint's velocity S q̇ or acceleration S q̈ in the body's frame, in the form that costs least to compute with.
#[derive(Clone, Copy)]
pub(crate) enum JointMotion<S> {
    /// About z.
    Turn(S),
    /// Along z.
    Slide(S),
    /// Along several axes.
    Any(Motion<S>),
}

impl<S: Scalar> core::ops::Add<JointMotion<S>> for Motion<S> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, vJ: JointMotion<S>) -> Self {
        match vJ {
            JointMotion::Turn(x) => self.angular.z += x,
            JointMotion::Slide(x) => self.linear.z += x,
            JointMotion::Any(m) => self += m,
        }
        self
    }
}

impl<S: Scalar> JointMotion<S> {
    /// v × vJ.
    #[inline(always)]
    pub(crate) fn crossed_by(self, v: Motion<S>) -> Motion<S> {
        let across = |a: Vec3<S>, x: S| Vec3::new(a.y * x, -(a.x * x), S::zero()); // a × x e_z
        match self {
            Self::Turn(x) => Motion { linear: across(v.linear, x), angular: across(v.angular, x) },
            Self::Slide(x) => Motion { linear: across(v.angular, x), angular: Vec3::zero() },
            Self::Any(m) => v.cross(m),
        }
    }
}

impl Joint {
    /// How many numbers the position has.
    pub fn nq(self) -> usize {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } => 1,
            Self::Continuous { .. } => 2,
            Self::Translation => 3,
            Self::Spherical | Self::Planar => 4,
            Self::FreeFlyer => 7,
        }
    }

    /// How many degrees of freedom it has: the numbers of its velocity.
    #[inline]
    pub fn nv(self) -> usize {
        self.axes().len()
    }

    /// Which of the unit motions of the frame (linear x, y, z, angular x, y, z) it moves along: the columns of S. (A
    /// screw moves along z as well, by its pitch.)
    #[inline(always)]
    pub(crate) fn axes(self) -> &'static [usize] {
        match self {
            Self::Revolute { .. } | Self::Continuous { .. } | Self::Helical { .. } => &[5],
            Self::Prismatic { .. } => &[2],
            Self::Spherical => &[3, 4, 5],
            Self::Planar => &[0, 1, 5],
            Self::Translation => &[0, 1, 2],
            Self::FreeFlyer => &[0, 1, 2, 3, 4, 5],
        }
    }

    /// The axis of a joint that has one, as a unit vector in the body's frame.
    pub fn axis(self) -> Option<Vec3<f64>> {
        match self {
            Self::Revolute { axis }
            | Self::Continuous { axis }
            | Self::Prismatic { axis }
            | Self::Helical { axis, .. } => Some(axis),
            _ => None,
        }
    }

    /// The same joint about or along a unit vector, if its axis is neither zero nor infinite.
    pub(crate) fn normalized(self) -> Option<Self> {
        let Some(axis) = self.axis() else { return Some(self) };
        let norm = axis.norm_squared().sqrt();
        let axis = axis.scale(1.0 / norm);
        (norm.is_normal() && norm.is_finite()).then_some(match self {
            Self::Continuous { .. } => Self::Continuous { axis },
            Self::Prismatic { .. } => Self::Prismatic { axis },
            Self::Helical { pitch, .. } => Self::Helical { axis, pitch },
            _ => Self::Revolute { axis },
        })
    }

    /// The rotation bRz whose third column is the joint's axis: from the frame in which algorithms run to the body's.
    ///
    /// A permutation of axes, hence exact, for x, y and z; else the shortest rotation of z, or of −z, to the axis.
    pub(crate) fn reframing(self) -> Mat3<f64> {
        let Some(a) = self.axis() else { return Mat3::identity() };
        let unit = |x, y, z| Vec3::new(x, y, z);
        if a == unit(0.0, 0.0, 1.0) {
            return Mat3::identity();
        }
        if a == unit(1.0, 0.0, 0.0) {
            return Mat3 { x: unit(0.0, 1.0, 0.0), y: unit(0.0, 0.0, 1.0), z: a };
        }
        if a == unit(0.0, 1.0, 0.0) {
            return Mat3 { x: unit(0.0, 0.0, 1.0), y: unit(1.0, 0.0, 0.0), z: a };
        }
        // Duff et al. (2017): a basis with third axis a, without cancellation for any a.
        let sign = 1f64.copysign(a.z);
        let s = -1.0 / (sign + a.z);
        let t = a.x * a.y * s;
        Mat3 {
            x: unit(1.0 + sign * a.x * a.x * s, sign * t, -sign * a.x),
            y: unit(t, sign + a.y * a.y * s, -a.y),
            z: a,
        }
    }

    /// λXi = X_T X_J(q), for joint i of a pass.
    #[inline(always)]
    pub(crate) fn placement<L: Layout>(l: &L, i: usize, q: &[L::S]) -> Se3<L::S> {
        let X_T = l.placement(i);
        match l.joint(i) {
            Self::Revolute { .. } => {
                let (sin, cos) = l.position(q, i, 0).sin_cos();
                turned(X_T, sin, cos)
            }
            Self::Continuous { .. } => turned(X_T, l.position(q, i, 1), l.position(q, i, 0)),
            Self::Prismatic { .. } => {
                let d = l.position(q, i, 0);
                Se3::new(X_T.rotation, X_T.rotation.z.scale_add(d, X_T.translation))
            }
            Self::Helical { pitch, .. } => {
                let angle = l.position(q, i, 0);
                let (sin, cos) = angle.sin_cos();
                let X = turned(X_T, sin, cos);
                Se3::new(X.rotation, X.rotation.z.scale_add(angle * L::S::splat(pitch), X_T.translation))
            }
            Self::Spherical => {
                let R = quaternion(l, i, q, 0).to_rotation();
                Se3::new(X_T.rotation * R, X_T.translation)
            }
            Self::Planar => {
                let p = Vec3::new(l.position(q, i, 0), l.position(q, i, 1), L::S::zero());
                let X = turned(X_T, l.position(q, i, 3), l.position(q, i, 2));
                Se3::new(X.rotation, X_T.act(p))
            }
            Self::Translation => Se3::new(X_T.rotation, X_T.act(point(l, i, q))),
            Self::FreeFlyer => X_T * Se3::new(quaternion(l, i, q, 3).to_rotation(), point(l, i, q)),
        }
    }

    /// S v of joint i in the body's frame, for the velocity or acceleration coordinates v.
    #[inline(always)]
    pub(crate) fn motion<L: Layout>(l: &L, i: usize, v: &[L::S]) -> JointMotion<L::S> {
        match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => JointMotion::Turn(l.load(v, i, 0)),
            Self::Prismatic { .. } => JointMotion::Slide(l.load(v, i, 0)),
            Self::Helical { pitch, .. } => {
                let (o, x) = (L::S::zero(), l.load(v, i, 0));
                JointMotion::Any(Motion::new(Vec3::new(o, o, x * L::S::splat(pitch)), Vec3::new(o, o, x)))
            }
            joint => {
                let mut m = [L::S::zero(); 6];
                for (k, &axis) in joint.axes().iter().enumerate() {
                    m[axis] = l.load(v, i, k);
                }
                JointMotion::Any(m.into())
            }
        }
    }

    /// Sᵀ f of joint i, added to the coordinates τ.
    #[inline(always)]
    pub(crate) fn project<L: Layout>(l: &L, i: usize, f: Force<L::S>, tau: &mut [L::S]) {
        match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => l.add(tau, i, 0, f.angular.z),
            Self::Prismatic { .. } => l.add(tau, i, 0, f.linear.z),
            Self::Helical { pitch, .. } => {
                l.add(tau, i, 0, f.linear.z.mul_add(L::S::splat(pitch), f.angular.z));
            }
            joint => {
                let f = f.to_array();
                for (k, &axis) in joint.axes().iter().enumerate() {
                    l.add(tau, i, k, f[axis]);
                }
            }
        }
    }

    /// Column k of S of a joint whose body is at oX, in the world's frame.
    #[inline(always)]
    pub(crate) fn column<S: Scalar>(self, oX: &Se3<S>, k: usize) -> Motion<S> {
        let (R, p) = (oX.rotation, oX.translation);
        if let Self::Helical { pitch, .. } = self {
            return Motion::new(R.z.scale_add(S::splat(pitch), p.cross(R.z)), R.z);
        }
        match self.axes()[k] {
            0 => Motion::new(R.x, Vec3::zero()),
            1 => Motion::new(R.y, Vec3::zero()),
            2 => Motion::new(R.z, Vec3::zero()),
            3 => Motion::new(p.cross(R.x), R.x),
            4 => Motion::new(p.cross(R.y), R.y),
            _ => Motion::new(p.cross(R.z), R.z),
        }
    }

    /// The position that leaves the body at its joint's frame.
    pub(crate) fn neutral(self, q: &mut [f64]) {
        q.fill(0.0);
        match self {
            Self::Continuous { .. } => q[0] = 1.0,
            Self::Spherical => q[3] = 1.0,
            Self::Planar => q[2] = 1.0,
            Self::FreeFlyer => q[6] = 1.0,
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {}
        }
    }

    /// Which of the joint's coordinates are a vector of length 1.
    pub(crate) fn unit_part(self) -> Option<core::ops::Range<usize>> {
        match self {
            Self::Continuous { .. } => Some(0..2),
            Self::Planar => Some(2..4),
            Self::Spherical => Some(0..4),
            Self::FreeFlyer => Some(3..7),
            _ => None,
        }
    }

    /// A position drawn uniformly: lengths and angles between their limits, rotations over the whole group.
    pub(crate) fn random(self, rng: &mut impl rand::Rng, lower: &[f64], upper: &[f64], q: &mut [f64]) {
        use rand::RngExt;
        for ((q, &lower), &upper) in q.iter_mut().zip(lower).zip(upper) {
            *q = lower + (upper - lower) * rng.random::<f64>();
        }
        let turn = core::f64::consts::TAU * rng.random::<f64>();
        let mut rotate = |q: &mut [f64]| {
            // Shoemake (1992): a quaternion uniform on the sphere
            let (u, a) = (rng.random::<f64>(), core::f64::consts::TAU * rng.random::<f64>());
            let (r, s) = ((1.0 - u).sqrt(), u.sqrt());
            q.copy_from_slice(&[r * turn.sin(), r * turn.cos(), s * a.sin(), s * a.cos()]);
        };
        match self {
            Self::Continuous { .. } => q.copy_from_slice(&[turn.cos(), turn.sin()]),
            Self::Planar => q[2..].copy_from_slice(&[turn.cos(), turn.sin()]),
            Self::Spherical => rotate(q),
            Self::FreeFlyer => rotate(&mut q[3..]),
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {}
        }
    }

    /// q ⊕ v: the position after moving with v for one unit of time.
    pub(crate) fn integrate<S: Scalar>(self, q: &[S], v: &[S], out: &mut [S]) {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {
                for k in 0..q.len() {
                    out[k] = q[k] + v[k];
                }
            }
            Self::Continuous { .. } => {
                let (sin, cos) = v[0].sin_cos();
                let (c, s) = (q[0] * cos - q[1] * sin, q[1] * cos + q[0] * sin);
                let r = (c * c + s * s).sqrt().recip();
                (out[0], out[1]) = (c * r, s * r);
            }
            _ => {
                let (R, p) = self.pose(q);
                let (dR, dp) = lie::exp6(self.twist(v));
                // of the quaternions r and −r, the one nearer to where it was
                let sign = S::select(dR.scalar.lt(S::zero()), -S::one(), S::one());
                let dR = Quaternion { vector: dR.vector.scale(sign), scalar: dR.scalar * sign };
                self.set_pose((R * dR).normalize(), p + R.to_rotation() * dp, out);
            }
        }
    }

    /// q₁ ⊖ q₀: the v with q₀ ⊕ v = q₁.
    pub(crate) fn difference<S: Scalar>(self, q0: &[S], q1: &[S], out: &mut [S]) {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {
                for k in 0..q0.len() {
                    out[k] = q1[k] - q0[k];
                }
            }
            Self::Continuous { .. } => {
                out[0] = (q0[0] * q1[1] - q0[1] * q1[0]).atan2(q0[0] * q1[0] + q0[1] * q1[1]);
            }
            _ => {
                let ((R0, p0), (R1, p1)) = (self.pose(q0), self.pose(q1));
                let relative = R0.to_rotation().transpose_mul(p1 - p0);
                let d = lie::log6((R0.conjugate() * R1).normalize(), relative).to_array();
                for (out, &axis) in out.iter_mut().zip(self.axes()) {
                    *out = d[axis];
                }
            }
        }
    }

    /// Which Jacobian of the joint's group, at tangent vector v, as a map of twists; `None` where it is the identity.
    pub(crate) fn jacobian<S: Scalar>(self, which: GroupJacobian, v: &[S]) -> Option<MotionMap<S>> {
        if !matches!(self, Self::Spherical | Self::Planar | Self::FreeFlyer) {
            return None;
        }
        let twist = self.twist(v);
        Some(match which {
            GroupJacobian::Exp => lie::jexp6(twist),
            GroupJacobian::Log => lie::jlog6(twist),
            GroupJacobian::Transport => {
                let (R, p) = lie::exp6(-twist);
                MotionMap::adjoint(Se3::new(R.to_rotation(), p))
            }
        })
    }

    /// The tangent vector as a twist of the body.
    fn twist<S: Scalar>(self, v: &[S]) -> Motion<S> {
        let mut m = [S::zero(); 6];
        for (k, &axis) in self.axes().iter().enumerate() {
            m[axis] = v[k];
        }
        m.into()
    }

    /// X_J(q) of the joints whose group is not commutative.
    fn pose<S: Scalar>(self, q: &[S]) -> (Quaternion<S>, Vec3<S>) {
        match self {
            Self::Spherical => (Quaternion::new(q[0], q[1], q[2], q[3]), Vec3::zero()),
            Self::Planar => {
                let o = S::zero();
                let R = turned(Se3::identity(), q[3], q[2]).rotation;
                (Quaternion::from_rotation(R), Vec3::new(q[0], q[1], o))
            }
            _ => (Quaternion::new(q[3], q[4], q[5], q[6]), Vec3::new(q[0], q[1], q[2])),
        }
    }

    /// The inverse of `pose`.
    fn set_pose<S: Scalar>(self, R: Quaternion<S>, p: Vec3<S>, q: &mut [S]) {
        let (u, w) = (R.vector, R.scalar);
        let two = S::splat(2.0);
        match self {
            Self::Spherical => q.copy_from_slice(&[u.x, u.y, u.z, w]),
            Self::Planar => q.copy_from_slice(&[p.x, p.y, w * w - u.z * u.z, two * w * u.z]),
            _ => q.copy_from_slice(&[p.x, p.y, p.z, u.x, u.y, u.z, w]),
        }
    }
}

/// The Jacobians of a joint's group that integrating and taking differences need.
#[derive(Clone, Copy)]
pub(crate) enum GroupJacobian {
    /// ∂(q ⊕ v)/∂v.
    Exp,
    /// ∂(q₁ ⊖ q₀)/∂q₁ at q₁ ⊖ q₀ = v.
    Log,
    /// ∂(q ⊕ v)/∂q.
    Transport,
}

/// X_T, then a rotation about z.
#[inline(always)]
fn turned<S: Scalar>(X_T: Se3<S>, sin: S, cos: S) -> Se3<S> {
    let Mat3 { x, y, z } = X_T.rotation;
    let rotation = Mat3 { x: x.scale_add(cos, y.scale(sin)), y: y.scale_add(cos, x.scale(-sin)), z };
    Se3::new(rotation, X_T.translation)
}

#[inline(always)]
fn quaternion<L: Layout>(l: &L, i: usize, q: &[L::S], at: usize) -> Quaternion<L::S> {
    Quaternion::new(l.position(q, i, at), l.position(q, i, at + 1), l.position(q, i, at + 2), l.position(q, i, at + 3))
}

#[inline(always)]
fn point<L: Layout>(l: &L, i: usize, q: &[L::S]) -> Vec3<L::S> {
    Vec3::new(l.position(q, i, 0), l.position(q, i, 1), l.position(q, i, 2))
}
