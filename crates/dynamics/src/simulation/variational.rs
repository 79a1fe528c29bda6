//! The variational integrator of the midpoint Lagrangian, on the joints' groups.
//!
//! The motion during a step is taken to be q ⊕ t w, w constant, and its action to be h L(q ⊕ h w/2, w). That the sum of
//! the actions of all steps be stationary under changes of the positions between them (with the virtual work of τ) gives
//! the momentum p after the step from the one before it: with y = h w,
//!
//! ```text
//! M(q_m) w = J(−y)ᵀ p + h/2 J(−y/2)ᵀ f        q_m = q ⊕ y/2,   f = ∂L/∂q(q_m, w) + τ
//! p' = Ad(y)ᵀ p + h Ad(y/2)ᵀ f                q' = q ⊕ y
//! ```
//!
//! J is the group's right Jacobian J_exp and Ad(y) = ∂(q ⊕ −y)/∂q. The first equation is solved for w by Newton's method;
//! its slope is
//!
//! ```text
//! M + h/2 ∂p/∂q J(y/2) − h ∂(J(−y)ᵀ p)/∂y − h²/4 ∂(J(−x)ᵀ f)/∂x − h/2 J(−y/2)ᵀ (h/2 ∂²L/∂q∂q J(y/2) + (∂p/∂q)ᵀ + ∂τ/∂v)
//! ```
//!
//! The map (q, p) → (q', p') is symplectic, its own inverse when h changes sign, and keeps the momentum of whatever
//! moves freely: Ad(y)ᵀ only expresses it in the body's new frame. Source: Marsden and West (2001), section 2.3, for the
//! midpoint rule; Bou-Rabee and Marsden (2009) for momenta on groups. In coordinates v = M(q)⁻¹ p.

use super::{Input, Settings, Status, lagrangian, lu, tangent};
use crate::calls::inertia::crba;
use crate::data::Data;
use crate::passes::kinematics::place;
use crate::passes::passive::{passive_torque, passive_torque_derivative};
use crate::workspace::{filled, workspace};
use condyle_linalg::Ltdl;
use condyle_model::Model;
use condyle_model::integrate;
use condyle_model::joint::GroupJacobian::{Exp, Transport};
use condyle_model::layout::Single;
use condyle_spatial::{Array, Constant, Scalar};

workspace! {
    /// Written by: `step`, where nothing else is said.
    pub(super) struct Workspace<S>(size, model: &Model<R>) {
        /// p, the momentum before the step.
        p: Array<S> = filled(S::zero, size.nv),
        /// w, the velocity during the step.
        w: Array<S> = filled(S::zero, size.nv),
        /// −h w, h w/2 and −h w/2. Written by: `set_ways`.
        minus_y: Array<S> = filled(S::zero, size.nv),
        x: Array<S> = filled(S::zero, size.nv),
        minus_x: Array<S> = filled(S::zero, size.nv),
        /// f = ∂L/∂q + τ. Written by: `evaluate`.
        f: Array<S> = filled(S::zero, size.nv),
        /// The passive efforts of the joints, and their slope. Written by: `evaluate`.
        passive: Array<S> = filled(S::zero, size.nv),
        passive_slope: Array<S> = filled(S::zero, size.nv),
        /// J(−y)ᵀ p and J(−y/2)ᵀ f. Written by: `evaluate`.
        carried: Array<S> = filled(S::zero, size.nv),
        pushed: Array<S> = filled(S::zero, size.nv),
        /// The residual of the equation, then Newton's step.
        residual: Array<S> = filled(S::zero, size.nv),
        /// The slope of the equation, and its factor. Written by: `slope`.
        slope: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Momenta, slopes of L and their derivatives at the midpoint. Written by: `evaluate`.
        lagrangian: lagrangian::Workspace<S> = lagrangian::Workspace::new(size),
        /// The factor of M after the step.
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

/// f at the midpoint, and the terms of the equation.
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
            d.passive_slope.fill(S::zero());
        }
        Some(smoothing) => {
            passive_torque(model, &d.w, smoothing, &mut d.passive);
            passive_torque_derivative(model, &d.w, smoothing, &mut d.passive_slope);
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

/// The slope of the equation in w; what `evaluate` has left of the derivatives is used up.
fn slope<S: Scalar, R: Constant<S>>(model: &Model<R>, d: &mut Workspace<S>, h: S) {
    let nv = model.nv();
    let half = h * S::splat(0.5);
    let lagrangian::Workspace { M, p_q, L_qq, .. } = &mut d.lagrangian;
    let A = &mut d.slope;
    tangent::multiply_right(model, Exp, &d.x, L_qq);
    for j in 0..nv {
        for i in 0..nv {
            A[j * nv + i] = L_qq[j * nv + i].mul_add(half, p_q[i * nv + j]); // h/2 ∂²L/∂q∂q J + (∂p/∂q)ᵀ
        }
        A[j * nv + j] += d.passive_slope[j]; // + ∂τ/∂v
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

/// The momentum (kg m²/s, kg m/s) below which nothing counts as moving.
const STILL: f64 = 1e-30;

/// The whole method.
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
        // The step that follows squares the error, and completes the derivatives of dual numbers.
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

#[cfg(test)]
mod tests {
    use super::{Input, Single, Workspace, evaluate, integrate, place, slope};
    use crate::workspace::Size;
    use crate::{Data, Force, Inertia, Joint, Mimic, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, lie};
    use num_dual::Dual64;
    use rand::{RngExt, SeedableRng, rngs::StdRng};

    /// Sums over all bodies, relative to the largest number.
    const ROUNDING: f64 = 1e-11;
    const H: f64 = 0.1;

    /// Joints of every group under and above each other, and one that follows.
    fn robot(rng: &mut StdRng) -> Model {
        let mut vector = || Vec3::from([(); 3].map(|()| rng.random_range(-1.0..1.0)));
        let mut builder = ModelBuilder::new("robot");
        let axis = Vec3::new(0.6, 0.0, 0.8);
        let kinds = [
            Joint::FreeFlyer,
            Joint::Revolute { axis },
            Joint::Planar,
            Joint::Prismatic { axis },
            Joint::Spherical,
            Joint::Translation,
            Joint::Continuous { axis },
            Joint::Revolute { axis },
        ];
        let mut ids = vec![WORLD];
        for (k, joint) in kinds.into_iter().enumerate() {
            let parent = ids[[0, 1, 1, 3, 4, 5, 4, 7][k]];
            let pose = Se3::new(lie::exp3(vector()).to_rotation(), vector());
            let inertia = Inertia::from_com(1.0, vector(), Sym3::outer(vector()).add_diagonal(0.3));
            ids.push(builder.body(&format!("{k}"), parent, joint, pose, inertia));
        }
        builder.mimic(ids[8], ids[2], Mimic { ratio: 0.7, offset: 0.2 });
        builder.build().expect("it is well-formed")
    }

    /// The slope that Newton's method uses is the derivative of the equation that it solves.
    #[test]
    fn slope_is_the_derivative() {
        let mut rng = StdRng::seed_from_u64(1);
        let model = robot(&mut rng);
        let nv = model.nv();
        let model = model.with_armature(&(0..nv).map(|k| 0.1 * k as f64).collect::<Vec<_>>()).unwrap();
        let q = crate::random_configuration(&model, &mut rng);
        let mut numbers = || (0..nv).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f64>>();
        let (p, w, tau) = (numbers(), numbers(), numbers());
        let force = Force::new(Vec3::new(1.0, -2.0, 0.5), Vec3::new(0.3, 0.1, -0.7));
        let lift = |x: &[f64]| x.iter().map(|&x| Dual64::from(x)).collect::<Vec<_>>();

        let (mut data, mut d) = (Data::new(&model), Workspace::new(Size::new(&model), &model));
        let f_ext = vec![force; model.bodies().len()];
        let mut q_m = q.clone();
        (d.p, d.w) = (p.clone().into(), w.clone().into());
        d.set_ways(H);
        integrate(&model, &q, &d.x, &mut q_m);
        evaluate(&model, &mut data, &mut d, Input { h: H, tau: &tau, f_ext: &f_ext, passive: None }, &q_m);
        slope(&model, &mut d, H);

        let (mut data, mut dual) = (Data::<Dual64>::new(&model), Workspace::new(Size::new(&model), &model));
        let (f_ext, tau) = (vec![force.lift(); model.bodies().len()], lift(&tau));
        dual.p = lift(&p).into();
        for k in 0..nv {
            dual.w = lift(&w).into();
            dual.w[k].eps = 1.0;
            let (h, mut q_m) = (Dual64::from(H), lift(&q));
            dual.set_ways(h);
            integrate(&model, &lift(&q), &dual.x, &mut q_m);
            evaluate(&model, &mut data, &mut dual, Input { h, tau: &tau, f_ext: &f_ext, passive: None }, &q_m);
            for i in 0..nv {
                let outside = dual.carried[i] + dual.pushed[i] * (0.5 * H);
                let expected = (dual.lagrangian.p[i] - outside).eps;
                assert!((d.slope[k * nv + i] - expected).abs() < ROUNDING * 10.0, "{i} {k}");
            }
        }
    }

    /// p = M v, and vᵀ p = 2 T: what `lagrangian` computes is what `crba` does.
    #[test]
    fn momentum_is_that_of_the_inertia_matrix() {
        let mut rng = StdRng::seed_from_u64(2);
        let model = robot(&mut rng);
        let q = crate::random_configuration(&model, &mut rng);
        let v: Vec<f64> = (0..model.nv()).map(|_| rng.random_range(-1.0..1.0)).collect();
        let (mut data, mut d) = (Data::new(&model), Workspace::new(Size::new(&model), &model));
        let l = Single::new(&model);
        place(&l, &mut data.world, &q);
        super::lagrangian::pass(&l, &data.world, &mut d.lagrangian, &v, &[]);
        let M = crate::crba(&model, &mut data, &q);
        let p = M * nalgebra::DVector::from_column_slice(&v);
        assert!(p.iter().zip(&d.lagrangian.p).all(|(a, b)| (a - b).abs() < ROUNDING));
        assert!(M.iter().zip(&d.lagrangian.M).all(|(a, b)| (a - b).abs() < ROUNDING));
    }
}
