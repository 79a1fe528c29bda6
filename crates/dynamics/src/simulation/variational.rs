//! Variational integrator of the midpoint Lagrangian, on the joints' Lie groups.
//!
//! During a step of length h, the motion is approximated by q ⊕ t w with constant velocity w. The action of the step is
//! approximated by h L(q ⊕ h w/2, w). The sum of the actions of all steps, plus the virtual work of τ, must be
//! stationary when the positions between the steps change. With y = h w, this condition determines the momentum p'
//! after the step from the momentum p before the step:
//!
//! ```text
//! M(q_m) w = J(−y)ᵀ p + h/2 J(−y/2)ᵀ f        q_m = q ⊕ y/2,   f = ∂L/∂q(q_m, w) + τ
//! p' = Ad(y)ᵀ p + h Ad(y/2)ᵀ f                q' = q ⊕ y
//! ```
//!
//! J is the right Jacobian J_exp of the group, and Ad(y) = ∂(q ⊕ −y)/∂q. Newton's method solves the first equation for
//! w. With x = y/2, the slope of this equation is
//!
//! ```text
//! M + h/2 ∂p/∂q J(y/2) − h ∂(J(−y)ᵀ p)/∂y − h²/4 ∂(J(−x)ᵀ f)/∂x
//!   − h/2 J(−y/2)ᵀ (h/2 ∂²L/∂q∂q J(y/2) + (∂p/∂q)ᵀ + ∂τ/∂v)
//! ```
//!
//! Passive efforts also depend on q, so ∂τ/∂q is added to ∂²L/∂q∂q.
//!
//! The map from the position q and momentum p before a step to q' and p' after the step is symplectic. The map for the
//! step length −h is the inverse of the map for h. The momentum of freely moving bodies is conserved: Ad(y)ᵀ only
//! expresses this momentum in the body's new frame. Source: Marsden and West (2001), section 2.3, for the midpoint
//! rule; Bou-Rabee and Marsden (2009) for momenta on groups. The velocity is v = M(q)⁻¹ p.

use super::{Input, Settings, Status, lagrangian, lu, tangent};
use crate::calls::inertia::crba;
use crate::data::Data;
use crate::passes::kinematics::place;
use crate::passes::passive::{efforts, slopes};
use crate::workspace::{filled, workspace};
use condyle_linalg::Ltdl;
use condyle_model::Model;
use condyle_model::integrate;
use condyle_model::joint::GroupJacobian::{Exp, Transport};
use condyle_model::layout::Single;
use condyle_spatial::{Array, Constant, Scalar};

workspace! {
    /// Scratch of the variational integrator. Fields without "Written by" are written by `step`.
    pub(super) struct Workspace<S>(size, model: &Model<R>) {
        /// Momentum p before the step.
        p: Array<S> = filled(S::zero, size.nv),
        /// Velocity w during the step.
        w: Array<S> = filled(S::zero, size.nv),
        /// Displacements −h w, h w/2 and −h w/2 for the step length h and the velocity w. Written by: `set_ways`.
        minus_y: Array<S> = filled(S::zero, size.nv),
        x: Array<S> = filled(S::zero, size.nv),
        minus_x: Array<S> = filled(S::zero, size.nv),
        /// Force f = ∂L/∂q + τ at the midpoint. Written by: `evaluate`.
        f: Array<S> = filled(S::zero, size.nv),
        /// Passive efforts of the joints, and slopes of these efforts with respect to q and v. Written by: `evaluate`.
        passive: Array<S> = filled(S::zero, size.nv),
        passive_q: Array<S> = filled(S::zero, size.nv * size.nv),
        passive_v: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Products J(−y)ᵀ p and J(−y/2)ᵀ f of the group Jacobian J with the momentum p and the force f. Written by:
        /// `evaluate`.
        carried: Array<S> = filled(S::zero, size.nv),
        pushed: Array<S> = filled(S::zero, size.nv),
        /// Residual of the equation for w, the velocity during the step. The step of Newton's method overwrites this
        /// residual.
        residual: Array<S> = filled(S::zero, size.nv),
        /// Derivative of the equation for w, the velocity during the step. The factor of this matrix overwrites it.
        /// Written by: `slope`.
        slope: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Momentum ∂L/∂v and slope ∂L/∂q of the Lagrangian L at the midpoint, with derivatives. Written by:
        /// `evaluate`.
        lagrangian: lagrangian::Workspace<S> = lagrangian::Workspace::new(size),
        /// Factor of M at the position after the step.
        M: Ltdl<S> = Ltdl::new(model),
    }
}

impl<S: Scalar> Workspace<S> {
    fn set_ways(&mut self, h: S) {
        let half = h * S::splat(0.5);
        for (k, &w) in self.w.iter().enumerate() {
            self.minus_y[k] = -(w * h);
            self.x[k] = w * half;
            self.minus_x[k] = -self.x[k];
        }
    }
}

/// Computes the force f = ∂L/∂q + τ at the midpoint, and the terms of the equation for w, the velocity during the step.
fn evaluate<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    d: &mut Workspace<S>,
    input: Input<S>,
    q_m: &[S],
) {
    let l = Single::new(model);
    place(&l, &mut data.world, q_m);
    lagrangian::pass(&l, &data.world, &mut d.lagrangian, &d.w, input.f_ext);
    match input.passive {
        None => {
            d.passive.fill(S::zero());
            d.passive_q.fill(S::zero());
            d.passive_v.fill(S::zero());
        }
        Some(smoothing) => {
            efforts(model, q_m, &d.w, smoothing, &mut d.passive);
            slopes(model, q_m, &d.w, smoothing, &mut d.passive_q, &mut d.passive_v);
        }
    }
    for k in 0..model.nv() {
        d.f[k] = d.lagrangian.L_q[k] + input.tau[k] + d.passive[k]; // f = ∂L/∂q + τ
    }
    tangent::add_rotors(model, &d.w, &mut d.f);
    d.carried.copy_from_slice(&d.p);
    tangent::multiply_left_transposed(model, Exp, &d.minus_y, &mut d.carried); // J(−y)ᵀ p
    d.pushed.copy_from_slice(&d.f);
    tangent::multiply_left_transposed(model, Exp, &d.minus_x, &mut d.pushed); // J(−y/2)ᵀ f
}

/// Computes the derivative of the equation for w, the velocity during the step. Overwrites derivatives in `d` that
/// `evaluate` has computed.
fn slope<S: Scalar, R: Constant<S>>(model: &Model<R>, d: &mut Workspace<S>, h: S) {
    let nv = model.nv();
    let half = h * S::splat(0.5);
    let lagrangian::Workspace { M, p_q, L_qq, .. } = &mut d.lagrangian;
    let A = &mut d.slope;
    for (L_qq, passive_q) in L_qq.iter_mut().zip(&d.passive_q) {
        *L_qq += *passive_q; // ∂τ/∂q acts like ∂²L/∂q∂q
    }
    tangent::multiply_right(model, Exp, &d.x, L_qq);
    for j in 0..nv {
        for i in 0..nv {
            let k = j * nv + i;
            A[k] = L_qq[k].mul_add(half, p_q[i * nv + j]) + d.passive_v[k]; // h/2 ∂²L/∂q∂q J + (∂p/∂q)ᵀ + ∂τ/∂v
        }
    }
    tangent::add_rotors_slope(model, &d.w, A);
    tangent::multiply_left_transposed(model, Exp, &d.minus_x, A);
    tangent::multiply_right(model, Exp, &d.x, p_q);
    for (k, A) in A.iter_mut().enumerate() {
        *A = (p_q[k] - *A).mul_add(half, M[k]); // M + h/2 (∂p/∂q J − J(−y/2)ᵀ (…))
    }
    for k in 0..nv {
        d.minus_y[k] = -d.minus_y[k];
    }
    tangent::subtract_slope(model, &d.minus_y, &d.p, h, A); // − h ∂(J(−y)ᵀ p)/∂y
    tangent::subtract_slope(model, &d.x, &d.f, half * half, A); // − h²/4 ∂(J(−x)ᵀ f)/∂x
}

/// Smallest scale of momentum (kg m²/s, kg m/s) in the relative error. With this scale, Newton's method also converges
/// for a robot at rest.
const STILL: f64 = 1e-30;

/// Computes one step of the variational integrator.
#[track_caller]
pub(super) fn step<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    d: &mut Workspace<S>,
    settings: &Settings,
    input: Input<S>,
    (q, v): (&[S], &[S]),
    (q_next, v_next): (&mut [S], &mut [S]),
) -> Status {
    let (h, half) = (input.h, input.h * S::splat(0.5));
    let M = crba(model, data, q);
    for (k, row) in d.p.iter_mut().enumerate() {
        *row = S::zero();
        for (j, &v) in v.iter().enumerate() {
            *row = M[(j, k)].mul_add(v, *row); // p = M v
        }
    }
    d.w.copy_from_slice(v);
    let (mut iterations, mut converged) = (0, false);
    loop {
        d.set_ways(h);
        integrate(model, q, &d.x, q_next); // q_m = q ⊕ h w/2
        evaluate(model, data, d, input, q_next);
        if converged {
            break;
        }
        if iterations == settings.max_iterations {
            return Status::NotConverged { iterations };
        }
        iterations += 1;
        let (mut error, mut size) = (S::zero(), S::splat(STILL));
        for k in 0..model.nv() {
            let (inside, outside) = (d.lagrangian.p[k], d.pushed[k].mul_add(half, d.carried[k]));
            d.residual[k] = inside - outside; // M w − J(−y)ᵀ p − h/2 J(−y/2)ᵀ f
            error += d.residual[k].abs();
            size += inside.abs() + d.carried[k].abs() + (d.pushed[k] * half).abs();
        }
        // One more iteration squares the error, and completes the derivatives of dual numbers.
        converged = S::all(error.lt(size * S::splat(settings.tolerance)));
        slope(model, d, h);
        lu::factorize(&mut d.slope, model.nv());
        lu::solve(&d.slope, &mut d.residual);
        for (w, &step) in d.w.iter_mut().zip(&d.residual) {
            *w -= step;
        }
    }
    d.carried.copy_from_slice(&d.p);
    tangent::multiply_left_transposed(model, Transport, &d.minus_y, &mut d.carried);
    d.pushed.copy_from_slice(&d.f);
    tangent::multiply_left_transposed(model, Transport, &d.minus_x, &mut d.pushed);
    for k in 0..model.nv() {
        v_next[k] = d.pushed[k].mul_add(h, d.carried[k]); // p' = Ad(y)ᵀ p + h Ad(y/2)ᵀ f
    }
    for (y, &minus_y) in d.x.iter_mut().zip(&d.minus_y) {
        *y = -minus_y;
    }
    integrate(model, q, &d.x, q_next); // q' = q ⊕ h w
    d.M.factorize(crba(model, data, q_next));
    d.M.solve(v_next); // v' = M⁻¹ p'
    Status::Done
}
