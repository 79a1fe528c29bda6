//! Relative motion of the two frames of a constraint: the Jacobian J, the acceleration γ for q̈ = 0, and the
//! derivatives of both.
//!
//! Body 1 carries frame 1, whose pose in the world is ₀X₁. Body 2 carries frame 2, the target, whose pose in the world
//! is ₀X₂. v₁, v₂, a₁ and a₂ are the velocities and spatial accelerations of the two bodies. v* and a* are the target's
//! velocity and acceleration, and kp and kd are the gains. With Δv = v₁ − v₂, the following acceleration must vanish:
//!
//! ```text
//! rigid   ₀X₁⁻¹ (a₁ − a₂ + Δv × v₂ + kd Δv) + kp log(₂X₁) − (a* + kd v*)     (no Δv × v₂ along the world's axes)
//! point   R₁ᵀ (α₁ − α₂ + kd (u₁ − u₂) + kp (p₁ − p₂)) − (a* + kd v*)          u, α: velocity, acceleration of points
//! ```
//!
//! If the gains kp differ along the axes, kp (…) is multiplied with them along the axes of the rows.
//!
//! p, u and α are the position, velocity and acceleration of a frame's origin, and R₁ is the rotation of frame 1. For a
//! line or a plane, the rows are components of the point's row above: e₃ᵀ (…) for a line, [e₁ e₃]ᵀ (…) for a plane.
//!
//! When coordinate e moves a body, the derivatives ∂v and ∂a of the body's motion are the same as in
//! `rnea_derivatives`. A point p of the body has the velocity u and the acceleration α. s = S_e is the joint column of
//! e. With the motions Ψ̇ and Ψ̈ of `rnea_derivatives`, evaluated at p,
//!
//! ```text
//! ∂u/∂q_e = s_ω × u + Ψ̇     ∂α/∂q_e = s_ω × α + Ψ̈ + 2 Ψ̇_ω × u     ∂α/∂q̇_e = Ψ̇ + Ṡ + 2 s_ω × u
//! ```
//!
//! Let m be a motion in the world's frame; expressed in frame 1, the motion is ₀X₁⁻¹ m. If coordinate e with joint
//! column S_e moves frame 1, the derivative of ₀X₁⁻¹ m is ₀X₁⁻¹ (∂m − S_e × m). Gravity is included as an acceleration
//! −g of the world, and it cancels in all differences of accelerations.

use crate::constraints::constraint::{ConstraintKind, Target};
use crate::constraints::plan::Plan;
use crate::passes::kinematics::World;
use condyle_spatial::lie::{Quaternion, jlog6, log6};
use condyle_spatial::{Act, Cross, Mat3, Matrix, Motion, Scalar, Se3, Vec3};

/// Poses of the two frames of a constraint, and velocities and accelerations of the bodies that carry these frames, in
/// the world's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramePair<S> {
    /// Pose ₀X₁ of frame 1, the constraint's frame.
    pub x1: Se3<S>,
    /// Pose ₀X₂ of frame 2: the other frame's pose times the target's placement.
    pub x2: Se3<S>,
    pub v: [Motion<S>; 2],
    pub a: [Motion<S>; 2],
}

/// Columns S, Ψ̇, Ψ̈ and Ψ̇ + Ṡ of all joints, in the world's frame, as in `rnea_derivatives`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns<'w, S> {
    pub S: &'w [Motion<S>],
    pub Psid: &'w [Motion<S>],
    pub Psidd: &'w [Motion<S>],
    pub PsidSd: &'w [Motion<S>],
}

/// Returns v + ω × p, the velocity of the point p of a body with the motion (v, ω).
#[inline(always)]
fn at<S: Scalar>(m: Motion<S>, p: Vec3<S>) -> Vec3<S> {
    m.linear + m.angular.cross(p)
}

/// Returns x − y. If `first` is false, x is replaced by zero; if `second` is false, y is replaced by zero.
#[inline(always)]
fn minus<S: Scalar>(first: bool, x: Motion<S>, second: bool, y: Motion<S>) -> Motion<S> {
    match (first, second) {
        (true, true) => x - y,
        (true, false) => x,
        (false, true) => -y,
        (false, false) => Motion::zero(),
    }
}

/// Returns the product of gain and error along each axis.
#[inline(always)]
fn scaled<S: Scalar>(gains: &[f64; 6], error: Motion<S>) -> Motion<S> {
    let mut product = error.to_array();
    for k in 0..6 {
        product[k] = product[k] * S::splat(gains[k]);
    }
    product.into()
}

/// Returns the motion (ω × m_v, ω × m_ω), for the linear part m_v and the angular part m_ω of m.
#[inline(always)]
fn turn<S: Scalar>(w: Vec3<S>, m: Motion<S>) -> Motion<S> {
    Motion::new(w.cross(m.linear), w.cross(m.angular))
}

impl<S: Scalar> FramePair<S> {
    /// Returns the frame pair of two bodies at rest with the given poses.
    #[inline(always)]
    pub(crate) fn between(plan: &Plan, target: &Target<S>, [one, other]: [Se3<S>; 2]) -> Self {
        let x1 = one * plan.turned[0].lift();
        let x2 = other * plan.turned[1].lift() * target.placement;
        Self { x1, x2, v: [Motion::zero(); 2], a: [Motion::zero(); 2] }
    }

    /// Returns the frame pair of two bodies at rest, with the placements in `World`.
    #[inline(always)]
    pub(crate) fn at_rest(plan: &Plan, target: &Target<S>, World { oX, .. }: &World<S>) -> Self {
        let [i, j] = plan.bodies;
        Self::between(plan, target, [oX[i], oX[j]])
    }

    /// Returns the frame pair of two bodies with velocities v and accelerations a.
    #[inline(always)]
    pub(crate) fn new(plan: &Plan, target: &Target<S>, w: &World<S>, v: &[Motion<S>], a: &[Motion<S>]) -> Self {
        let [i, j] = plan.bodies;
        Self { v: [v[i], v[j]], a: [a[i], a[j]], ..Self::at_rest(plan, target, w) }
    }

    /// Converts a motion from the world's frame to the axes of the constraint's rows.
    #[inline(always)]
    fn express(&self, plan: &Plan, m: Motion<S>) -> Motion<S> {
        if plan.aligned() { Motion::new(at(m, self.x1.translation), m.angular) } else { self.x1.act_inv(m) }
    }

    /// Converts a vector from the world's axes to the axes of the constraint's rows.
    #[inline(always)]
    fn along(&self, plan: &Plan, x: Vec3<S>) -> Vec3<S> {
        if plan.aligned() { x } else { self.x1.rotation.transpose_mul(x) }
    }

    /// Converts a vector from the world's axes to the axes of `reference`, times the gain of each axis.
    #[inline(always)]
    fn along_axes(&self, plan: &Plan, gains: &[f64; 6], x: Vec3<S>) -> Vec3<S> {
        scaled(gains, Motion::new(self.along(plan, x), Vec3::zero())).linear
    }

    /// Returns the rows of a point, line or plane constraint from the vector x of all three rows of the point. For a
    /// line or a plane, these are the components of x along the held axes.
    #[inline(always)]
    fn held(plan: &Plan, x: Vec3<S>) -> Motion<S> {
        let axes: Mat3<S> = plan.axes.lift();
        let linear = match plan.kind {
            ConstraintKind::Line => Vec3::new(axes.z.dot(x), S::zero(), S::zero()),
            ConstraintKind::Plane => Vec3::new(axes.x.dot(x), axes.z.dot(x), S::zero()),
            _ => x,
        };
        Motion::new(linear, Vec3::zero())
    }

    /// Returns a column of the Jacobian of p₁ − p₂ along the axes of `reference`, for the joint column s. `first` and
    /// `second` tell whether the joint carries frame 1 and frame 2.
    #[inline(always)]
    pub(crate) fn point_column(&self, plan: &Plan, s: Motion<S>, first: bool, second: bool) -> Vec3<S> {
        let (s1, s2) = (at(s, self.x1.translation), at(s, self.x2.translation));
        let linear = match (first, second) {
            (true, true) => s1 - s2,
            (true, false) => s1,
            (false, _) => -s2,
        };
        self.along(plan, linear)
    }

    /// Converts a motion from the axes of frame 1 to the axes of the constraint's rows.
    #[inline(always)]
    pub(crate) fn outward(&self, plan: &Plan, m: Motion<S>) -> Motion<S> {
        let R = self.x1.rotation;
        if plan.aligned() { Motion::new(R * m.linear, R * m.angular) } else { m }
    }

    /// Returns log(₂X₁), the pose of frame 1 in frame 2 as a twist.
    #[inline(always)]
    fn error(&self) -> Motion<S> {
        let x = self.x2.inverse() * self.x1;
        log6(Quaternion::from_rotation(x.rotation), x.translation)
    }

    /// Returns a column of J: the relative velocity when the joint moves with the column s. `first` and `second` tell
    /// whether the joint carries frame 1 and frame 2.
    #[inline(always)]
    fn column(&self, plan: &Plan, s: Motion<S>, first: bool, second: bool) -> Motion<S> {
        match plan.kind {
            ConstraintKind::Rigid if first == second => Motion::zero(),
            ConstraintKind::Rigid => self.express(plan, if first { s } else { -s }),
            _ => Self::held(plan, self.point_column(plan, s, first, second)),
        }
    }

    /// Computes the constraint's rows of the Jacobian J, in the slots of the constraint.
    #[inline(always)]
    pub(crate) fn jacobian(&self, plan: &Plan, columns: &[Motion<S>], J: &mut [S]) {
        let (rows, n) = (plan.rows(), plan.places.len());
        let J = &mut J[plan.start..plan.start + rows * n];
        J.fill(S::zero());
        for touch in &plan.touches {
            let s = self.column(plan, columns[touch.column], touch.first, touch.second);
            let s = s.scale(S::splat(touch.ratio)).to_array();
            for r in 0..rows {
                J[r * n + touch.at] += s[r];
            }
        }
    }

    /// Returns the acceleration that must vanish, including the corrections by kp and kd, from the motions of the
    /// bodies.
    #[inline(always)]
    pub(crate) fn acceleration(&self, plan: &Plan, target: &Target<S>) -> Motion<S> {
        let (kp, kd) = (S::splat(plan.kp), S::splat(plan.kd));
        let wanted = target.velocity.scale_add(kd, target.acceleration);
        match plan.kind {
            ConstraintKind::Rigid => {
                let m = self.express(plan, self.rigid(plan, kd));
                // If kp is 0, the logarithm is not needed. It is skipped because it is not smooth at half turns.
                let m = if plan.kp > 0.0 { m + self.outward(plan, self.error().scale(kp)) } else { m };
                let m = match &plan.kp_axes {
                    Some(gains) => m + scaled(gains, self.outward(plan, self.error())),
                    None => m,
                };
                m - wanted
            }
            _ => {
                let x = self.along(plan, self.point(kp, kd));
                let x = match &plan.kp_axes {
                    Some(gains) => x + self.along_axes(plan, gains, self.x1.translation - self.x2.translation),
                    None => x,
                };
                Self::held(plan, x - wanted.linear)
            }
        }
    }

    /// Returns a₁ − a₂ + Δv × v₂ + kd Δv, with the accelerations a₁, a₂ and velocities v₁, v₂ of the two bodies, and Δv
    /// = v₁ − v₂. The term Δv × v₂ is left out if the rows are along the world's axes.
    #[inline(always)]
    fn rigid(&self, plan: &Plan, kd: S) -> Motion<S> {
        let [v1, v2] = self.v;
        let m = (v1 - v2).scale_add(kd, self.a[0] - self.a[1]);
        if plan.aligned() { m } else { m + (v1 - v2).cross(v2) }
    }

    /// Returns the velocity u and the classical acceleration α = a + ω × u of the origins of both frames.
    #[inline(always)]
    fn points(&self) -> [[Vec3<S>; 2]; 2] {
        let (p1, p2) = (self.x1.translation, self.x2.translation);
        let (u1, u2) = (at(self.v[0], p1), at(self.v[1], p2));
        let alpha1 = at(self.a[0], p1) + self.v[0].angular.cross(u1);
        let alpha2 = at(self.a[1], p2) + self.v[1].angular.cross(u2);
        [[u1, alpha1], [u2, alpha2]]
    }

    /// Returns α₁ − α₂ + kd (u₁ − u₂) + kp (p₁ − p₂), with the classical accelerations α, velocities u and positions p
    /// of the origins of the two frames.
    #[inline(always)]
    fn point(&self, kp: S, kd: S) -> Vec3<S> {
        let [[u1, alpha1], [u2, alpha2]] = self.points();
        let velocity = (u1 - u2).scale_add(kd, alpha1 - alpha2);
        (self.x1.translation - self.x2.translation).scale_add(kp, velocity)
    }

    /// Adds the derivatives of `acceleration` with respect to q and v, at fixed q̈, to the constraint's rows of dq and
    /// dv. `error` is the value of `acceleration`.
    #[inline(always)]
    pub(crate) fn acceleration_derivatives(
        &self,
        plan: &Plan,
        target: &Target<S>,
        w: Columns<'_, S>,
        error: &[S],
        dq: &mut Matrix<S>,
        dv: &mut Matrix<S>,
    ) {
        match plan.kind {
            ConstraintKind::Rigid => self.rigid_derivatives(plan, target, w, error, dq, dv),
            _ => self.point_derivatives(plan, w, dq, dv),
        }
    }

    #[inline(always)]
    fn rigid_derivatives(
        &self,
        plan: &Plan,
        target: &Target<S>,
        w: Columns<'_, S>,
        error: &[S],
        dq: &mut Matrix<S>,
        dv: &mut Matrix<S>,
    ) {
        let (kp, kd) = (S::splat(plan.kp), S::splat(plan.kd));
        let [v1, v2] = self.v;
        let [a1, a2] = self.a;
        let m = self.rigid(plan, kd);
        let Jlog = if plan.kp > 0.0 || plan.kp_axes.is_some() { Some(jlog6(self.error())) } else { None };
        let error: [S; 6] = core::array::from_fn(|r| error[r]);
        let turned = Motion::from(error) + target.velocity.scale_add(kd, target.acceleration);
        // the position error, if its axes have different gains, and the part of `turned` without it
        let apart = if plan.kp_axes.is_some() { self.outward(plan, self.error()) } else { Motion::zero() };
        let turned = match &plan.kp_axes {
            Some(gains) => turned - scaled(gains, apart),
            None => turned,
        };
        for touch in &plan.touches {
            let (first, second) = (touch.first, touch.second);
            let (s, Psid) = (w.S[touch.column], w.Psid[touch.column]);
            let (Psidd, PsidSd) = (w.Psidd[touch.column], w.PsidSd[touch.column]);
            let (dv1, dv2) = (s.cross(v1) + Psid, s.cross(v2) + Psid); // ∂v = S × v + Ψ̇
            let da1 = s.cross(a1) + Psidd + Psid.cross(v1); // ∂a = S × a + Ψ̈ + Ψ̇ × v
            let da2 = s.cross(a2) + Psidd + Psid.cross(v2);
            let (change, rate) = (minus(first, dv1, second, dv2), minus(first, s, second, s));
            let mut by_q = change.scale_add(kd, minus(first, da1, second, da2));
            let mut by_v = rate.scale_add(kd, minus(first, PsidSd + s.cross(v1), second, PsidSd + s.cross(v2)));
            if !plan.aligned() {
                by_q += change.cross(v2); // ∂(Δv × v₂)
                by_v += rate.cross(v2);
                if second {
                    by_q += (v1 - v2).cross(dv2);
                    by_v += (v1 - v2).cross(s);
                }
            }
            if first {
                by_q -= s.cross(m);
            }
            let mut by_q = self.express(plan, by_q);
            if let Some(Jlog) = Jlog.filter(|_| first != second) {
                let change = Jlog * self.x1.act_inv(rate); // ∂ log X = Jlog ₀X₁⁻¹ S
                by_q += match &plan.kp_axes {
                    Some(gains) => scaled(gains, self.outward(plan, change)),
                    None => self.outward(plan, change.scale(kp)),
                };
            }
            if plan.aligned() && first {
                by_q += turn(s.angular, turned); // along the world's axes, it turns with frame 1
                if let Some(gains) = &plan.kp_axes {
                    by_q += scaled(gains, turn(s.angular, apart));
                }
            }
            let (row, column, ratio) = (plan.row, touch.coordinate, S::splat(touch.ratio));
            let (by_q, by_v) = (by_q.to_array(), self.express(plan, by_v).to_array());
            for r in 0..6 {
                dq[(row + r, column)] += by_q[r] * ratio;
                dv[(row + r, column)] += by_v[r] * ratio;
            }
        }
    }

    #[inline(always)]
    fn point_derivatives(&self, plan: &Plan, w: Columns<'_, S>, dq: &mut Matrix<S>, dv: &mut Matrix<S>) {
        let (kp, kd, two) = (S::splat(plan.kp), S::splat(plan.kd), S::splat(2.0));
        let points = self.points();
        let (held, apart) = (self.point(kp, kd), self.x1.translation - self.x2.translation);
        for touch in &plan.touches {
            let (s, Psid) = (w.S[touch.column], w.Psid[touch.column]);
            let (Psidd, PsidSd) = (w.Psidd[touch.column], w.PsidSd[touch.column]);
            let (mut by_q, mut by_v) = (Vec3::zero(), Vec3::zero());
            for end in 0..2 {
                let (p, [u, alpha]) = ([self.x1, self.x2][end].translation, points[end]);
                // ∂(α + kd u + kp p)/∂q_e = s_ω × (α + kd u) + Ψ̈ + 2 Ψ̇_ω × u + kd Ψ̇ + kp s
                let turned = s.angular.cross(u.scale_add(kd, alpha)) + Psid.angular.cross(u).scale(two);
                let moved = at(s, p).scale_add(kp, at(Psid, p).scale_add(kd, at(Psidd, p)));
                // ∂(α + kd u)/∂q̇_e = Ψ̇ + Ṡ + 2 s_ω × u + kd s
                let faster = at(s, p).scale_add(kd, at(PsidSd, p)) + s.angular.cross(u).scale(two);
                if end == 0 && touch.first {
                    by_q += turned + moved;
                    by_v += faster;
                } else if end == 1 && touch.second {
                    by_q -= turned + moved;
                    by_v -= faster;
                }
            }
            if !plan.aligned() && touch.first {
                by_q -= s.angular.cross(held);
            }
            let (row, column, ratio) = (plan.row, touch.coordinate, S::splat(touch.ratio));
            let mut by_q = self.along(plan, by_q);
            if let Some(gains) = &plan.kp_axes {
                // ∂(p₁ − p₂)/∂q_e, and the rotation of the axes with frame 1
                let zero = Vec3::zero();
                let mut moved = if touch.first { at(s, self.x1.translation) } else { zero };
                moved -= if touch.second { at(s, self.x2.translation) } else { zero };
                moved -= if touch.first && !plan.aligned() { s.angular.cross(apart) } else { zero };
                by_q += self.along_axes(plan, gains, moved);
            }
            let by_q = Self::held(plan, by_q).to_array();
            let by_v = Self::held(plan, self.along(plan, by_v)).to_array();
            for r in 0..plan.rows() {
                dq[(row + r, column)] += by_q[r] * ratio;
                dv[(row + r, column)] += by_v[r] * ratio;
            }
        }
    }

    /// Adds the derivative of the relative velocity J w with respect to q, for a fixed joint velocity w, to the
    /// constraint's rows of dq. The velocities in this pair, and the motions Ψ̇ (`Psid`), must be computed for w.
    /// `value` is J w.
    #[inline(always)]
    pub(crate) fn velocity_derivative(
        &self,
        plan: &Plan,
        S: &[Motion<S>],
        Psid: &[Motion<S>],
        value: &[S],
        dq: &mut Matrix<S>,
    ) {
        let [v1, v2] = self.v;
        let (p1, p2) = (self.x1.translation, self.x2.translation);
        for touch in &plan.touches {
            let (first, second) = (touch.first, touch.second);
            let (s, Psid) = (S[touch.column], Psid[touch.column]);
            let change = match plan.kind {
                ConstraintKind::Rigid => {
                    let mut m = minus(first, s.cross(v1) + Psid, second, s.cross(v2) + Psid); // ∂v = S × v + Ψ̇
                    if first {
                        m -= s.cross(v1 - v2);
                    }
                    let mut m = self.express(plan, m);
                    if plan.aligned() && first {
                        let value: [S; 6] = core::array::from_fn(|r| value[r]);
                        m += turn(s.angular, value.into());
                    }
                    m
                }
                _ => {
                    let (u1, u2) = (at(v1, p1), at(v2, p2));
                    let mut u = Vec3::zero();
                    if first {
                        u += s.angular.cross(u1) + at(Psid, p1); // ∂u = s_ω × u + Ψ̇
                    }
                    if second {
                        u -= s.angular.cross(u2) + at(Psid, p2);
                    }
                    if first && !plan.aligned() {
                        u -= s.angular.cross(u1 - u2);
                    }
                    Self::held(plan, self.along(plan, u))
                }
            };
            let change = change.scale(S::splat(touch.ratio)).to_array();
            for r in 0..plan.rows() {
                dq[(plan.row + r, touch.coordinate)] += change[r];
            }
        }
    }
}
