//! Tests of the Jacobians of frames and of the configuration space. The results are compared with dual numbers.

use crate::common;

use common::{State, Worst, all_models, dual, eps, lift, moved, real, relative, rng, unit};
use condyle_dynamics::{
    Act, Data, DifferenceArgument, Force, IntegrateArgument, Model, Motion, ReferenceFrame, Se3, Vec3, difference,
    difference_jacobian, forward_kinematics, frame_jacobian, integrate_jacobian, neutral, random_configuration, rnea,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance of products of about ten matrices, relative to the largest number.
const ROUNDING: f64 = 1e-12;
const TREES: u64 = 10;

/// Returns the value of a moving pose, and the velocity of the pose in its own frame.
fn velocity(X: Se3<Dual64>) -> (Se3<f64>, Motion<f64>) {
    let re = |x: Vec3<Dual64>| Vec3::from(x.to_array().map(|x| x.re));
    let rate = |x: Vec3<Dual64>| Vec3::from(x.to_array().map(|x| x.eps));
    let R = condyle_dynamics::Mat3 { x: re(X.rotation.x), y: re(X.rotation.y), z: re(X.rotation.z) };
    let angular = Vec3::new(R.z.dot(rate(X.rotation.y)), R.x.dot(rate(X.rotation.z)), R.y.dot(rate(X.rotation.x)));
    (Se3::new(R, re(X.translation)), Motion::new(R.transpose_mul(rate(X.translation)), angular))
}

fn times(J: &DMatrix<f64>, v: &[f64]) -> Vec<f64> {
    (J * nalgebra::DVector::from_column_slice(v)).as_slice().to_vec()
}

/// Checks in each reference frame that J v is the frame's velocity.
#[test]
fn frame_jacobians() {
    let mut worst = Worst::new("J v = velocity of the frame", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let q_moving = moved(model, &lift(&q), &dual(&vec![0.0; model.nv()], &v));
        let moving = forward_kinematics(model, &mut duals, &q_moving);
        let placements = forward_kinematics(model, &mut data, &q);
        let mut J = DMatrix::from_element(6, model.nv(), f64::NAN); // NaN, to find entries that are not overwritten
        for f in 0..model.frames().len() {
            let (oXf, local) = velocity(moving.frame(f));
            let at_origin = Se3::new(oXf.rotation, Vec3::zero());
            for (reference, expected) in [
                (ReferenceFrame::Local, local),
                (ReferenceFrame::World, oXf.act(local)),
                (ReferenceFrame::LocalWorldAligned, at_origin.act(local)),
            ] {
                placements.frame_jacobian(f, reference, &mut J);
                worst.see(model, &times(&J, &v), &expected.to_array());
                J.fill(f64::NAN);
                frame_jacobian(model, &q, f, reference, &mut J); // uses only the joints between the frame and the root
                worst.see(model, &times(&J, &v), &expected.to_array());
            }
        }
    }
}

/// Checks that forces f at frames are equivalent to the efforts Σ Jᵀ f at the joints.
#[test]
fn external_forces() {
    let mut worst = Worst::new("rnea(f_ext) = rnea − Σ Jᵀ f", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let mut rng = rng(seed as u64);
        let State { q, v, a, f_ext, .. } = State::random(model, &mut rng);
        let mut data = Data::new(model);
        let mut expected = rnea(model, &mut data, &q, &v, &a, &[]).to_vec();
        let mut on_bodies = vec![Force::zero(); model.bodies().len()];
        let mut J = DMatrix::zeros(6, model.nv());
        let placements = forward_kinematics(model, &mut data, &q);
        for (f, frame) in model.frames().iter().enumerate() {
            let force = f_ext[frame.body]; // expressed in the frame
            on_bodies[frame.body] += frame.placement.act(force);
            placements.frame_jacobian(f, ReferenceFrame::Local, &mut J);
            for (tau, x) in expected.iter_mut().zip(times(&J.transpose(), &force.to_array())) {
                *tau -= x;
            }
        }
        worst.see(model, rnea(model, &mut data, &q, &v, &a, &on_bodies), &expected);
    }
}

/// Checks for positions q and q₁ and a tangent vector v that q ⊕ (q₁ ⊖ q) = q₁, that (q ⊕ v) ⊖ q = v for rotations of
/// less than π, and that q ⊕ 0 = q.
#[test]
fn integrate_and_difference() {
    let mut there = Worst::new("q ⊕ (q₁ ⊖ q) = q₁", ROUNDING);
    let mut back = Worst::new("(q ⊕ v) ⊖ q = v", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let mut rng = rng(seed as u64);
        for _ in 0..20 {
            let (q, q1) = (random_configuration(model, &mut rng), random_configuration(model, &mut rng));
            let mut d = vec![0.0; model.nv()];
            difference(model, &q, &q1, &mut d);
            let arrived = moved(model, &q, &d);
            // A quaternion and its negative describe the same rotation, so compare placements instead.
            let (mut one, mut two) = (Data::new(model), Data::new(model));
            let (one, two) = (forward_kinematics(model, &mut one, &arrived), forward_kinematics(model, &mut two, &q1));
            for i in 0..model.bodies().len() {
                there.see(model, &common::flat(one.body(i)), &common::flat(two.body(i)));
            }
            let v: Vec<f64> = common::normal(&mut rng, model.nv()).iter().map(|x| 0.5 * x.clamp(-3.0, 3.0)).collect();
            difference(model, &q, &moved(model, &q, &v), &mut d);
            back.see(model, &d, &v);
            assert!(relative(&moved(model, &q, &vec![0.0; model.nv()]), &q) < 1e-15);
        }
        let q = neutral(model);
        let mut d = vec![f64::NAN; model.nv()];
        difference(model, &q, &q, &mut d);
        assert!(d.iter().all(|&d| d == 0.0));
    }
}

/// Returns the rate of a moving position, given in dual numbers, as a tangent vector.
fn rate(model: &Model, moving: &[Dual64]) -> Vec<f64> {
    let still = lift(&real(moving));
    let mut d = lift::<Dual64>(&vec![0.0; model.nv()]);
    difference(model, &still, moving, &mut d);
    eps(&d)
}

#[test]
fn jacobians_of_integrate() {
    let mut worst = Worst::new("∂(q ⊕ v)", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let nv = model.nv();
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        for v in [v, vec![0.0; nv]] {
            let mut J = DMatrix::from_element(nv, nv, f64::NAN);
            for k in 0..nv {
                let q_moving = moved(model, &lift(&q), &dual(&vec![0.0; nv], &unit(nv, k)));
                integrate_jacobian(model, &v, IntegrateArgument::Position, &mut J);
                worst.see(model, J.column(k).as_slice(), &rate(model, &moved(model, &q_moving, &lift(&v))));
                integrate_jacobian(model, &v, IntegrateArgument::Velocity, &mut J);
                worst.see(
                    model,
                    J.column(k).as_slice(),
                    &rate(model, &moved(model, &lift(&q), &dual(&v, &unit(nv, k)))),
                );
            }
        }
    }
}

#[test]
fn jacobians_of_difference() {
    let mut worst = Worst::new("∂(q₁ ⊖ q₀)", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let nv = model.nv();
        let mut rng = rng(seed as u64);
        let (q0, q1) = (random_configuration(model, &mut rng), random_configuration(model, &mut rng));
        for q1 in [q1, q0.clone()] {
            let mut J = DMatrix::from_element(nv, nv, f64::NAN);
            let mut d = vec![0.0; nv];
            difference(model, &q0, &q1, &mut d);
            for k in 0..nv {
                let step = dual(&vec![0.0; nv], &unit(nv, k));
                let mut moving = lift(&d);
                difference(model, &moved(model, &lift(&q0), &step), &lift(&q1), &mut moving);
                difference_jacobian(model, &d, DifferenceArgument::From, &mut J);
                worst.see(model, J.column(k).as_slice(), &eps(&moving));
                difference(model, &lift(&q0), &moved(model, &lift(&q1), &step), &mut moving);
                difference_jacobian(model, &d, DifferenceArgument::To, &mut J);
                worst.see(model, J.column(k).as_slice(), &eps(&moving));
            }
        }
    }
}

/// Checks that random positions are within the limits and have unit length where required. Generators with the same
/// seed must give the same positions.
#[test]
fn random_configurations() {
    for model in all_models(TREES) {
        let (q, again) = (random_configuration(&model, &mut rng(7)), random_configuration(&model, &mut rng(7)));
        assert_eq!(q, again);
        for (k, &q) in q.iter().enumerate() {
            let bound = |limit: f64, otherwise: f64| if limit.is_finite() { limit } else { otherwise };
            let (lower, upper) = (bound(model.limits().lower[k], -3.0), bound(model.limits().upper[k], 3.0));
            assert!(lower <= q && q <= upper, "{k}: {q} on\n{model}");
        }
        // Positions are on the manifold, so a step of zero may change them only by rounding errors.
        assert!(relative(&moved(&model, &q, &vec![0.0; model.nv()]), &q) < 1e-15);
    }
}
