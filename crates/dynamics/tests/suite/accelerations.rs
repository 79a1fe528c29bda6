//! Tests of velocities, accelerations and rates of Jacobians. The results are compared with time derivatives by dual
//! numbers.

use crate::common;

use common::{State, Worst, all_models, dual, eps, lift, moved, real, rng};
use condyle_dynamics::{
    Accelerations, Act, Data, Force, Model, Motion, ReferenceFrame, Se3, Vec3, centroidal_map, centroidal_map_rate,
    compute_all_terms, coriolis_matrix, forward_accelerations, forward_kinematics, forward_velocities, neutral, robots,
    static_torque,
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Tolerance of products of about ten matrices, relative to the largest number.
const ROUNDING: f64 = 1e-12;
const TREES: u64 = 10;
const REFERENCES: [ReferenceFrame; 3] =
    [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned];

/// Body or frame of a robot. Bodies and frames have functions of the same kinds.
#[derive(Clone, Copy)]
enum Place {
    Body(usize),
    Frame(usize),
}

fn places(model: &Model) -> impl Iterator<Item = Place> {
    (0..model.bodies().len()).map(Place::Body).chain((0..model.frames().len()).map(Place::Frame))
}

impl Place {
    fn jacobian(self, k: &Accelerations<f64>, r: ReferenceFrame, J: &mut DMatrix<f64>) {
        match self {
            Self::Body(i) => k.body_jacobian(i, r, J),
            Self::Frame(i) => k.frame_jacobian(i, r, J),
        }
    }
    fn jacobian_rate(self, k: &Accelerations<f64>, r: ReferenceFrame, dJ: &mut DMatrix<f64>) {
        match self {
            Self::Body(i) => k.body_jacobian_rate(i, r, dJ),
            Self::Frame(i) => k.frame_jacobian_rate(i, r, dJ),
        }
    }
    fn velocity(self, k: &Accelerations<f64>, r: ReferenceFrame) -> Motion<f64> {
        match self {
            Self::Body(i) => k.body_velocity(i, r),
            Self::Frame(i) => k.frame_velocity(i, r),
        }
    }
    fn acceleration(self, k: &Accelerations<f64>, r: ReferenceFrame) -> Motion<f64> {
        match self {
            Self::Body(i) => k.body_acceleration(i, r),
            Self::Frame(i) => k.frame_acceleration(i, r),
        }
    }
    fn classical_acceleration(self, k: &Accelerations<f64>, r: ReferenceFrame) -> Motion<f64> {
        match self {
            Self::Body(i) => k.body_classical_acceleration(i, r),
            Self::Frame(i) => k.frame_classical_acceleration(i, r),
        }
    }
}

/// Returns the position q ⊕ t v and the velocity v + t a, as dual numbers in t.
fn moving(model: &Model, State { q, v, a, .. }: &State) -> (Vec<Dual64>, Vec<Dual64>) {
    (moved(model, &lift(q), &dual(&vec![0.0; model.nv()], v)), dual(v, a))
}

/// Checks in each reference frame that J v is the velocity, and that dJ v + J a is the time derivative of this
/// velocity.
#[test]
fn velocities_and_their_rates() {
    let mut first = Worst::new("J v = velocity", ROUNDING);
    let mut second = Worst::new("dJ v + J a = d/dt velocity", ROUNDING);
    let mut pose = Worst::new("velocity = d/dt placement", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let (v, a) = (DVector::from_column_slice(&state.v), DVector::from_column_slice(&state.a));
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let k = forward_accelerations(model, &mut data, &state.q, &state.v, &state.a);
        let (q_moving, v_moving) = moving(model, &state);
        let k_moving = forward_velocities(model, &mut duals, &q_moving, &v_moving);
        let mut J = DMatrix::from_element(6, model.nv(), f64::NAN); // NaN, to find entries that are not overwritten
        let mut dJ = J.clone();
        for place in places(model) {
            for r in REFERENCES {
                place.jacobian(&k, r, &mut J);
                place.jacobian_rate(&k, r, &mut dJ);
                let velocity = match place {
                    Place::Body(i) => k_moving.body_velocity(i, r),
                    Place::Frame(i) => k_moving.frame_velocity(i, r),
                }
                .to_array();
                first.see(model, (&J * &v).as_slice(), &real(&velocity));
                first.see(model, &place.velocity(&k, r).to_array(), &real(&velocity));
                second.see(model, (&dJ * &v + &J * &a).as_slice(), &eps(&velocity));
            }
        }
        for f in 0..model.frames().len() {
            let X = k_moving.frame(f);
            let velocity = k.frame_velocity(f, ReferenceFrame::LocalWorldAligned);
            pose.see(model, &velocity.linear.to_array(), &eps(&X.translation.to_array()));
            for axis in X.rotation.columns() {
                let axis_rate = velocity.angular.cross(Vec3::from(axis.to_array().map(|x| x.re)));
                pose.see(model, &axis_rate.to_array(), &eps(&axis.to_array()));
            }
        }
    }
}

/// Checks that the rate dJ of a Jacobian J is the derivative of J along the velocity v, column by column.
#[test]
fn jacobian_rates() {
    let mut worst = Worst::new("dJ = d/dt J", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let k = forward_accelerations(model, &mut data, &q, &v, &a);
        let q_moving = moved(model, &lift(&q), &dual(&vec![0.0; model.nv()], &v));
        let k_moving = forward_kinematics(model, &mut duals, &q_moving);
        let mut dJ = DMatrix::from_element(6, model.nv(), f64::NAN);
        let mut J_moving = DMatrix::from_element(6, model.nv(), Dual64::from(f64::NAN));
        for place in places(model) {
            for r in REFERENCES {
                place.jacobian_rate(&k, r, &mut dJ);
                match place {
                    Place::Body(i) => k_moving.body_jacobian(i, r, &mut J_moving),
                    Place::Frame(i) => k_moving.frame_jacobian(i, r, &mut J_moving),
                }
                worst.see(model, dJ.as_slice(), &eps(J_moving.as_slice()));
            }
        }
    }
}

/// Checks that the efforts of a force on a body are Jᵀ f, added to the given efforts.
#[test]
fn efforts_of_a_force_are_products_with_the_jacobian() {
    let mut worst = Worst::new("τ + Jᵀ f", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, f_ext, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut J) = (Data::new(model), DMatrix::zeros(6, model.nv()));
        let placements = forward_kinematics(model, &mut data, &q);
        for (body, f) in f_ext.iter().enumerate() {
            placements.body_jacobian(body, ReferenceFrame::World, &mut J);
            let expected = DVector::from_column_slice(&v) + J.tr_mul(&DVector::from_row_slice(&f.to_array()));
            let mut tau = v.clone();
            placements.add_body_efforts(body, *f, &mut tau);
            worst.see(model, &tau, expected.as_slice());
        }
    }
}

/// Checks the accelerations in each reference frame. The spatial acceleration is the rate of the spatial velocity, and
/// the classical acceleration is the rate of a point's velocity.
#[test]
fn accelerations() {
    let mut spatial = Worst::new("spatial acceleration", ROUNDING);
    let mut classical = Worst::new("classical acceleration = p̈", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let k = forward_accelerations(model, &mut data, &state.q, &state.v, &state.a);
        let (q_moving, v_moving) = moving(model, &state);
        let k_moving = forward_velocities(model, &mut duals, &q_moving, &v_moving);
        for place in places(model) {
            let rate = |r| match place {
                Place::Body(i) => Motion::from(k_moving.body_velocity(i, r).to_array().map(|x| x.eps)),
                Place::Frame(i) => Motion::from(k_moving.frame_velocity(i, r).to_array().map(|x| x.eps)),
            };
            let pose = match place {
                Place::Body(i) => k.body(i),
                Place::Frame(i) => k.frame(i),
            };
            let [local, world, aligned] = REFERENCES;
            let at_origin = Se3::new(pose.rotation, Vec3::zero()); // rotates Local to LocalWorldAligned
            let a = place.acceleration(&k, local);
            spatial.see(model, &a.to_array(), &rate(local).to_array());
            spatial.see(model, &place.acceleration(&k, world).to_array(), &rate(world).to_array());
            spatial.see(model, &place.acceleration(&k, aligned).to_array(), &at_origin.act(a).to_array());
            let p_rate = rate(aligned); // [p̈; ω̇]
            classical.see(model, &place.classical_acceleration(&k, aligned).to_array(), &p_rate.to_array());
            let turned = at_origin.act_inv(p_rate);
            classical.see(model, &place.classical_acceleration(&k, local).to_array(), &turned.to_array());
            // The reference frame `World` describes the point of the body that is at the world's origin.
            let (v, a) = (place.velocity(&k, world), place.acceleration(&k, world));
            let expected = Motion::new(a.linear + v.angular.cross(v.linear), a.angular);
            classical.see(model, &place.classical_acceleration(&k, world).to_array(), &expected.to_array());
        }
    }
}

/// Checks that results with accelerations also contain velocities and placements, and results with velocities also
/// contain placements. Equal quantities must have the same bits.
#[test]
fn one_hierarchy() {
    for model in all_models(2) {
        let State { q, v, a, .. } = State::random(&model, &mut rng(0));
        let [mut one, mut two, mut three] = [(); 3].map(|()| Data::new(&model));
        let placements = forward_kinematics(&model, &mut one, &q);
        let velocities = forward_velocities(&model, &mut two, &q, &v);
        let accelerations = forward_accelerations(&model, &mut three, &q, &v, &a);
        for f in 0..model.frames().len() {
            assert_eq!(placements.frame(f), velocities.frame(f));
            assert_eq!(placements.frame(f), accelerations.frame(f));
            let r = ReferenceFrame::Local;
            assert_eq!(velocities.frame_velocity(f, r), accelerations.frame_velocity(f, r));
        }
        assert_eq!(velocities.body_velocity(0, ReferenceFrame::World), Motion::zero());
        assert_eq!(accelerations.body_acceleration(0, ReferenceFrame::World), Motion::zero());
    }
}

/// Passes each argument of each function of kinematics, statics and momentum with one number too few. The panic must
/// name the argument.
#[test]
fn wrong_lengths_name_the_argument() {
    let model = &robots::quadruped(); // nq 19, nv 18, 14 bodies including the world
    let data = &mut Data::<f64>::new(model);
    let (q, v) = (&neutral(model)[..], &[0.0; 18][..]);
    let (short_q, short_v, short_f) = (&q[1..], &v[1..], &[Force::zero(); 13]);
    let (bad_q, bad_v) = ("q: expected 19 numbers, found 18", "v: expected 18 numbers, found 17");
    let bad_a = "a: expected 18 numbers, found 17";
    let bad_f = "f_ext: expected no force or 14 (one for each body), found 13";
    let expect = |what: &str, call: &mut dyn FnMut()| {
        let panic = catch_unwind(AssertUnwindSafe(call)).expect_err("the call panics");
        assert_eq!(panic.downcast_ref::<String>().expect("the message has numbers in it"), what);
    };
    expect(bad_q, &mut || _ = forward_velocities(model, data, short_q, v));
    expect(bad_v, &mut || _ = forward_velocities(model, data, q, short_v));
    expect(bad_q, &mut || _ = forward_accelerations(model, data, short_q, v, v));
    expect(bad_v, &mut || _ = forward_accelerations(model, data, q, short_v, v));
    expect(bad_a, &mut || _ = forward_accelerations(model, data, q, v, short_v));
    expect(bad_q, &mut || _ = static_torque(model, data, short_q, &[]));
    expect(bad_f, &mut || _ = static_torque(model, data, q, short_f));
    expect(bad_q, &mut || _ = coriolis_matrix(model, data, short_q, v));
    expect(bad_v, &mut || _ = coriolis_matrix(model, data, q, short_v));
    expect(bad_q, &mut || _ = centroidal_map(model, data, short_q));
    expect(bad_q, &mut || _ = centroidal_map_rate(model, data, short_q, v));
    expect(bad_v, &mut || _ = centroidal_map_rate(model, data, q, short_v));
    expect(bad_q, &mut || _ = compute_all_terms(model, data, short_q, v));
    expect(bad_v, &mut || _ = compute_all_terms(model, data, q, short_v));
    let (velocities, narrow) = (forward_velocities(model, data, q, v), &mut DMatrix::zeros(6, 17));
    let r = ReferenceFrame::World;
    expect("J: expected 6 × 18, found (6, 17)", &mut || velocities.body_jacobian(0, r, narrow));
    expect("dJ: expected 6 × 18, found (6, 17)", &mut || velocities.frame_jacobian_rate(0, r, narrow));
    expect("dJ: expected 6 × 18, found (6, 17)", &mut || velocities.body_jacobian_rate(0, r, narrow));
}
