//! Tests of models with several robots. Robots without constraints between them must be computed like models of single
//! robots.

use crate::common::{Worst, normal, random_pose, rng};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, Matrix, Model, ModelBuilder, ProximalSettings, Se3, WORLD,
    constrained_dynamics, constrained_dynamics_derivatives, constrained_dynamics_equations, impulse_dynamics,
    impulse_dynamics_derivatives, random_configuration, robots,
};
use nalgebra::DMatrix;
use std::ops::Range;

/// Tolerance between sums of the same numbers in different orders, times the condition numbers of M and of J M⁻¹ Jᵀ.
const SAME: f64 = 1e-9;

/// Robot with its contact frames. `rigid` tells whether contacts constrain all six directions of these frames.
struct Part {
    model: Model,
    feet: &'static [&'static str],
    rigid: bool,
}

/// Returns an arm with a contact, a quadruped, a falling quadruped, a humanoid on two soles, and another arm.
fn parts() -> Vec<Part> {
    const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
    let part = |model, feet, rigid| Part { model, feet, rigid };
    vec![
        part(robots::arm7(), &["tool"], false),
        part(robots::quadruped(), &FEET, false),
        part(robots::quadruped(), &[], false),
        part(robots::humanoid(), &["left_sole", "right_sole"], true),
        part(robots::arm7(), &["tool"], true),
    ]
}

/// Creates a model with all robots.
fn together(parts: &[Part]) -> Model {
    let (mut builder, mut rng) = (ModelBuilder::new("all"), rng(7));
    for (k, part) in parts.iter().enumerate() {
        builder.append(WORLD, random_pose(&mut rng), &part.model, &format!("{k}_"));
    }
    builder.build().unwrap()
}

/// Creates the model of one robot, at the same placement in the world as in the model with all robots.
fn alone(k: usize, parts: &[Part]) -> Model {
    let (mut builder, mut rng) = (ModelBuilder::new("one"), rng(7));
    let placement = (0..=k).map(|_| random_pose(&mut rng)).last().unwrap();
    builder.append(WORLD, placement, &parts[k].model, &format!("{k}_"));
    builder.build().unwrap()
}

fn contacts(k: usize, part: &Part, model: &Model) -> Vec<ContactConstraint> {
    let contact = |foot: &&str| {
        let frame = model.frame(&format!("{k}_{foot}")).unwrap();
        let of = if part.rigid { ContactConstraint::rigid(frame) } else { ContactConstraint::point(frame) };
        ContactConstraint { kp: 2.0, kd: 3.0, ..of }
    };
    part.feet.iter().map(contact).collect()
}

/// Returns the indices of a robot's coordinates in the whole model, for q and for v.
fn places(one: &Model, whole: &Model) -> [Vec<usize>; 2] {
    let mut all = [Vec::new(), Vec::new()];
    for body in &one.bodies()[1..] {
        let there = &whole.bodies()[whole.joint(&body.joint_name).unwrap()];
        all[0].extend(there.idx_q..there.idx_q + body.joint.nq());
        all[1].extend(there.idx_v..there.idx_v + body.joint.nv());
    }
    all
}

fn pick(of: &[f64], at: &[usize]) -> Vec<f64> {
    at.iter().map(|&k| of[k]).collect()
}

/// Returns the entries of a matrix in the given rows and columns. Checks that all other entries in these rows are zero.
fn block(of: &Matrix<f64>, rows: &[usize], columns: &[usize]) -> Vec<f64> {
    let beside = |column: &usize| !columns.contains(column);
    let zeros = (0..of.ncols()).filter(beside).all(|column| rows.iter().all(|&row| of[(row, column)] == 0.0));
    assert!(zeros, "an entry of two robots");
    columns.iter().flat_map(|&column| rows.iter().map(move |&row| of[(row, column)])).collect()
}

/// Compares each function on the model with all robots with the same function on each single robot. Limbs are computed
/// in parallel lanes, and also body by body. Before the test, the `Data` was used with a constraint set that connects
/// two robots.
#[test]
fn each_robot_is_as_it_is_alone() {
    let (parts, mut worst) = (parts(), Worst::new("robots alone and together", SAME));
    for limbs in [true, false] {
        let whole = together(&parts).with_limbs(limbs);
        let mut rng = rng(1);
        let q = random_configuration(&whole, &mut rng);
        let [v, tau] = [(); 2].map(|()| normal(&mut rng, whole.nv()));
        let all: Vec<_> = parts.iter().enumerate().flat_map(|(k, part)| contacts(k, part, &whole)).collect();
        let (mut data, mut set) = (Data::new(&whole), ConstraintSet::new(&whole, &all).unwrap());
        let tied = [whole.frame("0_tool").unwrap(), whole.frame("4_tool").unwrap()];
        let tie = ContactConstraint { other: Some(tied[1]), ..ContactConstraint::rigid(tied[0]) };
        let mut tied = ConstraintSet::new(&whole, &[tie]).unwrap();
        constrained_dynamics_derivatives(&whole, &mut data, &mut tied, &q, &v, &tau, &[]);
        impulse_dynamics_derivatives(&whole, &mut data, &mut tied, &q, &v, 0.0);

        let d = constrained_dynamics(&whole, &mut data, &mut set, &q, &v, &tau, &[]);
        let (a, lambda) = (d.a.to_vec(), d.lambda.to_vec());
        let d = constrained_dynamics_derivatives(&whole, &mut data, &mut set, &q, &v, &tau, &[]);
        assert_eq!(d.redundant, 0.0);
        let squares = [d.da_dq, d.da_dv, d.da_dtau].map(Clone::clone);
        let wides = [d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau].map(Clone::clone);
        let inertia = d.inertia.clone();
        let d = constrained_dynamics_equations(&whole, &mut data, &mut set, &q, &v, &tau, &[]);
        let equations = [d.M, d.dtau_dq, d.dtau_dv].map(Clone::clone);
        let drifts = [d.dgamma_dq, d.dgamma_dv].map(Clone::clone);
        let after = impulse_dynamics(&whole, &mut data, &mut set, &q, &v, 0.3).v.to_vec();
        let d = impulse_dynamics_derivatives(&whole, &mut data, &mut set, &q, &v, 0.3);
        let jumps = [d.dv_dq, d.dv_dv].map(Clone::clone);
        let impulses = [d.dlambda_dq, d.dlambda_dv].map(Clone::clone);

        let mut row = 0;
        for (k, part) in parts.iter().enumerate() {
            let one = alone(k, &parts).with_limbs(limbs);
            let [at_q, at] = places(&one, &whole);
            let mut set = ConstraintSet::new(&one, &contacts(k, part, &one)).unwrap();
            let rows: Vec<usize> = (row..row + set.rows()).collect();
            row += set.rows();
            let (mut data, q, v, tau) = (Data::new(&one), pick(&q, &at_q), pick(&v, &at), pick(&tau, &at));
            let mut same = |found: &[f64], expected: &[f64]| worst.see(&one, found, expected);
            let d = constrained_dynamics(&one, &mut data, &mut set, &q, &v, &tau, &[]);
            same(&pick(&a, &at), d.a);
            same(&pick(&lambda, &rows), d.lambda);
            let d = constrained_dynamics_derivatives(&one, &mut data, &mut set, &q, &v, &tau, &[]);
            for (found, expected) in squares.iter().zip([d.da_dq, d.da_dv, d.da_dtau]) {
                same(&block(found, &at, &at), expected.as_slice());
            }
            for (found, expected) in wides.iter().zip([d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau]) {
                same(&block(found, &rows, &at), expected.as_slice());
            }
            same(&block(&inertia, &rows, &rows), d.inertia.as_slice());
            let d = constrained_dynamics_equations(&one, &mut data, &mut set, &q, &v, &tau, &[]);
            for (found, expected) in equations.iter().zip([d.M, d.dtau_dq, d.dtau_dv]) {
                same(&block(found, &at, &at), expected.as_slice());
            }
            for (found, expected) in drifts.iter().zip([d.dgamma_dq, d.dgamma_dv]) {
                same(&block(found, &rows, &at), expected.as_slice());
            }
            same(&pick(&after, &at), impulse_dynamics(&one, &mut data, &mut set, &q, &v, 0.3).v);
            let d = impulse_dynamics_derivatives(&one, &mut data, &mut set, &q, &v, 0.3);
            for (found, expected) in jumps.iter().zip([d.dv_dq, d.dv_dv]) {
                same(&block(found, &at, &at), expected.as_slice());
            }
            for (found, expected) in impulses.iter().zip([d.dlambda_dq, d.dlambda_dv]) {
                same(&block(found, &rows, &at), expected.as_slice());
            }
        }
    }
}

/// Checks that other orders of the constraints change only the order of the rows, although islands depend on the order.
/// In this test loops connect robots, with a proximal parameter and several iterations.
#[test]
fn the_order_of_constraints_changes_nothing() {
    let (parts, mut worst) = (parts(), Worst::new("orders of constraints", SAME));
    let whole = together(&parts);
    let mut rng = rng(2);
    let q = random_configuration(&whole, &mut rng);
    let [v, tau] = [(); 2].map(|()| normal(&mut rng, whole.nv()));
    let mut all: Vec<_> = parts.iter().enumerate().flat_map(|(k, part)| contacts(k, part, &whole)).collect();
    let [one, other] = ["1_LF_foot", "3_right_sole"].map(|name| whole.frame(name).unwrap());
    all.insert(5, ContactConstraint { other: Some(other), ..ContactConstraint::point(one) }); // after the quadruped's
    let mut turned = all.clone();
    turned.rotate_left(3);
    let (last, middle) = (turned.len() - 1, turned.len() / 2);
    turned.swap(0, last);
    turned.swap(1, middle);
    let mut found = [all.clone(), turned.clone()].map(|constraints| {
        let (mut data, mut set) = (Data::new(&whole), ConstraintSet::new(&whole, &constraints).unwrap());
        set.proximal = ProximalSettings { mu: 1e-3, iterations: 3 };
        let mut order: Vec<usize> = Vec::new();
        for constraint in &all {
            let k = constraints.iter().position(|other| other == constraint).unwrap();
            order.extend(set.range(k));
        }
        let d = constrained_dynamics_derivatives(&whole, &mut data, &mut set, &q, &v, &tau, &[]);
        let rows = |of: &Matrix<f64>| DMatrix::from_fn(of.nrows(), of.ncols(), |i, j| of[(order[i], j)]);
        let inertia = DMatrix::from_fn(order.len(), order.len(), |i, j| d.inertia[(order[i], order[j])]);
        let numbers: [Vec<f64>; 7] = [
            d.a.to_vec(),
            pick(d.lambda, &order),
            d.da_dq.as_slice().to_vec(),
            d.da_dv.as_slice().to_vec(),
            rows(d.dlambda_dq).as_slice().to_vec(),
            rows(d.dlambda_dtau).as_slice().to_vec(),
            inertia.as_slice().to_vec(),
        ];
        numbers
    });
    let [first, second] = &mut found;
    for (x, y) in second.iter().zip(&*first) {
        worst.see(&whole, x, y);
    }
}

/// Checks that a robot with NaN in its state does not affect the other robots.
#[test]
fn a_robot_that_is_not_a_number_stays_alone() {
    let parts = parts();
    let whole = together(&parts).with_limbs(false);
    let mut rng = rng(3);
    let q = random_configuration(&whole, &mut rng);
    let [v, tau] = [(); 2].map(|()| normal(&mut rng, whole.nv()));
    let all: Vec<_> = parts.iter().enumerate().flat_map(|(k, part)| contacts(k, part, &whole)).collect();
    let (mut data, mut set) = (Data::new(&whole), ConstraintSet::new(&whole, &all).unwrap());
    let clean = constrained_dynamics(&whole, &mut data, &mut set, &q, &v, &tau, &[]).a.to_vec();
    let at = places(&alone(1, &parts), &whole)[1].clone();
    let mut broken = tau.clone();
    broken[at[0]] = f64::NAN;
    let found = constrained_dynamics(&whole, &mut data, &mut set, &q, &v, &broken, &[]).a.to_vec();
    for k in 0..whole.nv() {
        assert!(if at.contains(&k) { found[k].is_nan() } else { found[k] == clean[k] }, "coordinate {k}");
    }
}

/// Creates a model of two arms with seven coordinates each, and two quadrupeds with eighteen coordinates each.
fn four() -> Model {
    let mut builder = ModelBuilder::new("all");
    for (name, robot) in
        [("a", robots::arm7()), ("b", robots::arm7()), ("c", robots::quadruped()), ("d", robots::quadruped())]
    {
        builder.append(WORLD, Se3::identity(), &robot, name);
    }
    builder.build().unwrap()
}

/// Returns the islands for given contacts. Each contact is given by the name of a frame and, if the contact connects
/// two frames, by the name of the second frame.
fn islands(model: &Model, of: &[(&str, Option<&str>)]) -> Vec<(Range<usize>, Range<usize>)> {
    let frame = |name: &str| model.frame(name).unwrap();
    let contact = |(one, other): &(&str, Option<&str>)| ContactConstraint {
        other: other.map(frame),
        ..ContactConstraint::point(frame(one))
    };
    let constraints: Vec<_> = of.iter().map(contact).collect();
    ConstraintSet::<f64>::new(model, &constraints).unwrap().islands().collect()
}

#[test]
fn trees_and_what_ties_them() {
    let model = &four();
    assert_eq!(islands(model, &[]), [(0..7, 0..0), (7..14, 0..0), (14..32, 0..0), (32..50, 0..0)]);
    // Contacts with the world, in any order, keep the robots separate.
    let apart = [("cLF_foot", None), ("cRF_foot", None), ("atool", None), ("dLF_foot", None)];
    assert_eq!(islands(model, &apart), [(0..7, 6..9), (7..14, 0..0), (14..32, 0..6), (32..50, 9..12)]);
    // A constraint connects two robots, which then form one island.
    assert_eq!(islands(model, &[("atool", Some("btool"))])[0], (0..14, 0..3));
    // An island is a range of indices. So it includes robots and rows whose indices are between the indices of
    // connected robots.
    assert_eq!(islands(model, &[("atool", Some("cLF_foot"))]), [(0..32, 0..3), (32..50, 0..0)]);
    let mixed = [("cLF_foot", None), ("dLF_foot", None), ("cRF_foot", None)];
    assert_eq!(islands(model, &mixed), [(0..7, 0..0), (7..14, 0..0), (14..50, 0..9)]);
    // A constraint between two feet of one robot does not connect robots.
    assert_eq!(islands(model, &[("cLF_foot", Some("cRF_foot"))])[2], (14..32, 0..3));
}
