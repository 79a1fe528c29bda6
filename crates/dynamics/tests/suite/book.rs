//! Inverse dynamics as in Featherstone's book, compared with the formulation of the library.

use crate::common;

use common::{State, Worst, all_models, armature_torque, rng};
use condyle_dynamics::ReferenceFrame::Local;
use condyle_dynamics::{Act, Cross, Data, Force, Model, Motion, Se3, Vec3, forward_kinematics, rnea};
use nalgebra::{DMatrix, DVector};

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-11;
const TREES: u64 = 20;

/// Computes τ by Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 5.1, in body coordinates. For a joint
/// that follows another one, the columns of S refer to the coordinate of its leader.
fn book(model: &Model, State { q, v, a, f_ext, .. }: &State) -> Vec<f64> {
    let (bodies, nv) = (model.bodies().len(), model.nv());
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let motion = |x: DVector<f64>| Motion::from([x[0], x[1], x[2], x[3], x[4], x[5]]);
    let (qd, qdd) = (DVector::from_column_slice(v), DVector::from_column_slice(a));
    let mut S = vec![DMatrix::zeros(6, nv); bodies];
    let mut X = vec![Se3::identity(); bodies];
    let (mut vel, mut acc) = (vec![Motion::zero(); bodies], vec![Motion::zero(); bodies]);
    let mut f = vec![Force::zero(); bodies];
    acc[0] = Motion::new(-*model.gravity(), Vec3::zero()); // a₀ = −g
    for i in 1..bodies {
        let parent = model.bodies()[i].parent;
        X[i] = placements.body(parent).inverse() * placements.body(i); // λXi
        let mut J = [DMatrix::zeros(6, nv), DMatrix::zeros(6, nv)];
        placements.body_jacobian(i, Local, &mut J[0]);
        placements.body_jacobian(parent, Local, &mut J[1]);
        for k in 0..nv {
            let before = X[i].act_inv(motion(J[1].column(k).into_owned()));
            let own = (motion(J[0].column(k).into_owned()) - before).to_array();
            S[i].column_mut(k).copy_from_slice(&own); // S_i = J_i − iXλ J_λ
        }
        let vJ = motion(&S[i] * &qd); // v_J = S q̇
        vel[i] = X[i].act_inv(vel[parent]) + vJ; // v_i = iXλ v_λ + v_J
        acc[i] = X[i].act_inv(acc[parent]) + motion(&S[i] * &qdd) + vel[i].cross(vJ); // a_i = iXλ a_λ + S q̈ + v_i × v_J
        let I = model.bodies()[i].inertia;
        f[i] = I * acc[i] + vel[i].cross(I * vel[i]); // f_i = I a_i + v_i ×* I v_i − f_x
        if let Some(external) = f_ext.get(i) {
            f[i] -= *external;
        }
    }
    let mut tau = DVector::from(armature_torque(model, qd.as_slice(), qdd.as_slice()));
    for i in (1..bodies).rev() {
        tau += S[i].transpose() * DVector::from_column_slice(&f[i].to_array()); // τ_i = S_iᵀ f_i
        let (up, parent) = (X[i].act(f[i]), model.bodies()[i].parent);
        f[parent] += up; // f_λ += λX*_i f_i
    }
    tau.as_slice().to_vec()
}

#[test]
fn the_book_gives_the_same() {
    let mut worst = Worst::new("rnea = table 5.1", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let expected = book(model, &state);
        worst.see(model, rnea(model, &mut Data::new(model), &state.q, &state.v, &state.a, &state.f_ext), &expected);
    }
}
