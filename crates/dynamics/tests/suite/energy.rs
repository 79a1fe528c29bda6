//! Tests that compare algorithms with derivatives of the energies (Lagrange). The energies are computed only from
//! placements.

use crate::common;

use common::{State, Worst, all_models, dual, eps, lift, moved, rng, unit};
use condyle_dynamics::{
    Data, Model, Motion, Scalar, Vec3, crba, forward_kinematics, gravity, nonlinear_effects, rnea, rnea_derivatives,
};
use nalgebra::DVector;
use num_dual::{Dual, Dual64, DualNum, HyperDual64};

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-11;
const TREES: u64 = 8;

/// Computes the kinetic energy (rotors included) and the potential energy. The velocity of a body is the rate of its
/// placement along q ⊕ t v, computed by an outer dual number in t.
fn energies<T>(model: &Model, data: &mut Data<Dual<T>>, q: &[T], v: &[T]) -> (T, T)
where
    T: Scalar<Mask = bool> + DualNum,
    Dual<T>: Scalar,
{
    let (zero, half) = (T::splat(0.0), T::splat(0.5));
    let at_rest: Vec<Dual<T>> = q.iter().map(|&q| Dual::new(q, zero)).collect();
    let velocity: Vec<Dual<T>> = v.iter().map(|&v| Dual::new(zero, v)).collect();
    let q = moved(model, &at_rest, &velocity);
    let placements = forward_kinematics(model, data, &q);
    let (mut kinetic, mut potential) = (zero, zero);
    for (i, body) in model.bodies().iter().enumerate().skip(1) {
        let X = placements.body(i);
        let re = |x: Vec3<Dual<T>>| Vec3::new(x.x.re, x.y.re, x.z.re);
        let rate = |x: Vec3<Dual<T>>| Vec3::new(x.x.eps, x.y.eps, x.z.eps);
        let (x, y, z, p) = (re(X.rotation.x), re(X.rotation.y), re(X.rotation.z), re(X.translation));
        let (dx, dy, dp) = (rate(X.rotation.x), rate(X.rotation.y), rate(X.translation));
        let dz = rate(X.rotation.z);
        let v = Motion {
            linear: Vec3::new(x.dot(dp), y.dot(dp), z.dot(dp)),
            angular: Vec3::new(z.dot(dy), x.dot(dz), y.dot(dx)), // [ω]ₓ = Rᵀ Ṙ
        };
        let I = body.inertia.lift::<T>();
        kinetic += half * v.dot(I * v);
        let h = I.mass_com;
        let moment = p.scale(I.mass) + x.scale(h.x) + y.scale(h.y) + z.scale(h.z); // m c in the world
        potential -= moment.dot(model.gravity().lift());
    }
    for (&v, &armature) in v.iter().zip(model.armature()) {
        kinetic += half * T::splat(armature) * v * v;
    }
    (kinetic, potential)
}

/// Checks that M is the second derivative of the kinetic energy: M = ∂²T/∂v².
#[test]
fn inertia_matrix_is_the_curvature_of_kinetic_energy() {
    let mut worst = Worst::new("M = ∂²T/∂v²", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let q = State::random(model, &mut rng(seed as u64)).q;
        let M = crba(model, &mut data, &q);
        let q = lift::<HyperDual64>(&q);
        for k in 0..model.nv() {
            let column: Vec<f64> = (0..model.nv())
                .map(|j| {
                    let (ej, ek) = (unit(model.nv(), j), unit(model.nv(), k));
                    let v: Vec<_> = ej.iter().zip(&ek).map(|(&j, &k)| HyperDual64::new(0.0, j, k, 0.0)).collect();
                    energies(model, &mut duals, &q, &v).0.eps1eps2
                })
                .collect();
            worst.see(model, M.column(k).as_slice(), &column);
        }
    }
}

/// Checks that g is the gradient of the potential energy: g = ∂V/∂q.
#[test]
fn gravity_is_the_slope_of_potential_energy() {
    let mut worst = Worst::new("g = ∂V/∂q", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let q = State::random(model, &mut rng(seed as u64)).q;
        let still = lift::<Dual64>(&vec![0.0; model.nv()]);
        let slope: Vec<f64> = (0..model.nv())
            .map(|k| {
                let q = moved(model, &lift(&q), &dual(&vec![0.0; model.nv()], &unit(model.nv(), k)));
                energies(model, &mut duals, &q, &still).1.eps
            })
            .collect();
        worst.see(model, gravity(model, &mut data, &q), &slope);
    }
}

/// Checks that the power of efforts and external forces is the rate of the energy: vᵀ τ + Σ ⟨v_i, f_ext,i⟩ = d(T +
/// V)/dt, for the velocity v and the acceleration a.
#[test]
fn power_balance() {
    let mut worst = Worst::new("vᵀ τ = dE/dt", ROUNDING);
    let mut forced = Worst::new("vᵀ τ + Σ ⟨v_i, f_i⟩ = dE/dt", ROUNDING);
    for (seed, model) in all_models(4 * TREES).iter().enumerate() {
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let State { q, v, a, f_ext, .. } = State::random(model, &mut rng(seed as u64));
        let power = |tau: &[f64]| tau.iter().zip(&v).map(|(tau, v)| tau * v).sum::<f64>();
        let q_moving = moved(model, &lift(&q), &dual(&vec![0.0; model.nv()], &v));
        let (kinetic, potential) = energies(model, &mut duals, &q_moving, &dual(&v, &a));
        let rate = (kinetic + potential).eps;
        worst.see(model, &[power(rnea(model, &mut data, &q, &v, &a, &[]))], &[rate]);
        // Add the power of the external forces. Dual numbers give the velocities of the bodies.
        let mut dual_data = Data::new(model);
        let placements = forward_kinematics(model, &mut dual_data, &q_moving);
        let mut external = 0.0;
        for i in 1..model.bodies().len() {
            let X = placements.body(i);
            let part = |x: Vec3<Dual64>, f: fn(Dual64) -> f64| Vec3::from(x.to_array().map(f));
            let [x, y, z] = X.rotation.columns().map(|c| part(c, |x| x.re));
            let [dx, dy, dz] = X.rotation.columns().map(|c| part(c, |x| x.eps));
            let dp = part(X.translation, |x| x.eps);
            let v = Motion {
                linear: Vec3::new(x.dot(dp), y.dot(dp), z.dot(dp)),
                angular: Vec3::new(z.dot(dy), x.dot(dz), y.dot(dx)),
            };
            external += v.dot(f_ext[i]);
        }
        forced.see(model, &[power(rnea(model, &mut data, &q, &v, &a, &f_ext)) + external], &[rate]);
    }
}

/// Checks that Coriolis forces do no work. C v is quadratic in v, so (∂h/∂v) v = 2 C v. Ṁ − 2C is skew-symmetric, so vᵀ
/// Ṁ v = 2 vᵀ C v.
#[test]
fn coriolis_forces_do_no_work() {
    let mut quadratic = Worst::new("(∂h/∂v) v = 2 (h − g)", ROUNDING);
    let mut skew = Worst::new("vᵀ Ṁ v = 2 vᵀ C v", ROUNDING);
    for (seed, model) in all_models(4 * TREES).iter().enumerate() {
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let still = vec![0.0; model.nv()];
        let h = DVector::from_column_slice(nonlinear_effects(model, &mut data, &q, &v));
        let coriolis = h - DVector::from_column_slice(gravity(model, &mut data, &q));
        let dtau_dv = rnea_derivatives(model, &mut data, &q, &v, &still, &[]).dtau_dv;
        let velocity = DVector::from_column_slice(&v);
        quadratic.see(model, (dtau_dv * &velocity).as_slice(), (2.0 * &coriolis).as_slice());
        let M = crba(model, &mut duals, &moved(model, &lift(&q), &dual(&still, &v)));
        let M_rate = nalgebra::DMatrix::from_column_slice(model.nv(), model.nv(), &eps(M.as_slice()));
        skew.see(model, &[velocity.dot(&(M_rate * &velocity))], &[2.0 * velocity.dot(&coriolis)]);
    }
}
