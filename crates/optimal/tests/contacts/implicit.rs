//! Knots in inverse-dynamics form, which give the same gains and steps as knots given by A and B.

use super::{DT, contact_costs, largest_difference, random, random_state};
use condyle_dynamics::{ContactConstraint, Model, ReferenceFrame, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactAcceleration, Cost, FreeAcceleration, FreeDynamics, Integrated, Integrator,
    Residual,
};
use condyle_optimal::{ActionModel, Fddp, Problem};
use rand::{SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Tolerance of gains, for eleven consecutive knots at random states with very badly conditioned contacts. In most
/// cases the gains agree to 1e-10.
const GAINS: f64 = 1e-6;

/// Number of knots. It exceeds the eight lanes of a SIMD register, so the second group does not fill its register.
const KNOTS: usize = 11;

/// Compares the first sweep with and without inverse-dynamics form, from random states with gaps.
pub(super) fn compare(
    what: &str,
    model: &Arc<Model>,
    action: Box<dyn ActionModel>,
    states: impl Fn(&mut StdRng) -> Vec<f64>,
) {
    let mut rng = StdRng::seed_from_u64(5);
    let (nu, nv) = (action.nu(), model.nv());
    let reference = random_state(model, &mut rng);
    let end = vec![Cost::new("end", 1.0, Residual::State { reference }, Activation::Quadratic)];
    let end = Box::new(FreeDynamics::terminal(model.clone(), end).unwrap());
    let xs: Vec<_> = (0..=KNOTS).flat_map(|_| states(&mut rng)).collect();
    let us = random(KNOTS * nu, 5.0, &mut rng);
    let mut problem = Problem::new(xs[..model.nq() + nv].to_vec(), vec![action], vec![0; KNOTS], end).unwrap();
    let solutions = [true, false].map(|implicit| {
        let mut solver = Fddp::new(&problem);
        solver.settings.inverse_dynamics_form = implicit;
        solver.settings.max_iterations = 1;
        solver.settings.regularisation_start = 1e-3;
        solver.solve(&mut problem, &xs, &us).unwrap();
        solver.solution().clone()
    });
    let [implicit, explicit] = &solutions;
    let (a, b) = (&implicit.trace[0], &explicit.trace[0]);
    assert_eq!((a.step, a.regularisation), (b.step, b.regularisation), "{what}");
    for (name, a, b) in [("d1", a.d1, b.d1), ("d2", a.d2, b.d2), ("cost", a.cost, b.cost)] {
        assert!((a - b).abs() < GAINS * (1.0 + b.abs()), "{what}: {name} is {a}, expected {b}");
    }
    let (mut exact, mut worst) = (0, 0.0_f64);
    for t in 0..KNOTS {
        for (name, a, b) in [
            ("K", implicit.K[t].as_slice(), explicit.K[t].as_slice()),
            ("k", implicit.k[t].as_slice(), explicit.k[t].as_slice()),
        ] {
            let error = largest_difference(a, b);
            assert!(error < GAINS, "{what}, knot {t}: {name} is off by {error:e}");
            exact += usize::from(a == b);
            worst = worst.max(error);
        }
    }
    println!("{what}: gains differ by at most {worst:.1e}");
    // on a processor with SIMD, inverse-dynamics form gives different bits; equal bits would mean that both sweeps used
    // A and B
    assert!(
        exact < 2 * KNOTS || condyle_dynamics::level::level() == condyle_dynamics::level::Level::Baseline,
        "{what}"
    );
}

/// Returns costs of contacts and a cost of the controls. The cost of the controls makes Quu positive definite.
fn costs(model: &Model, contacts: &[Contact], rng: &mut StdRng) -> Vec<Cost> {
    let nu = Actuation::joints(model).nu();
    let (first, last) = (contacts[0].clone(), contacts[contacts.len() - 1].clone());
    let mut costs = contact_costs(model, &[first, last], nu, rng);
    costs.push(Cost::new("u", 1.0, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic));
    costs
}

fn contacts(model: &Model, kind: fn(usize) -> ContactConstraint, names: &[&str]) -> Vec<Contact> {
    let contact = |name: &&str| {
        let reference = ReferenceFrame::LocalWorldAligned;
        let constraint = ContactConstraint { reference, kp: 20.0, kd: 30.0, ..kind(model.frame(name).unwrap()) };
        Contact::new(name, constraint)
    };
    names.iter().map(contact).collect()
}

#[test]
fn implicit_knots_have_the_gains_of_explicit_ones() {
    let mut rng = StdRng::seed_from_u64(3);
    let (quadruped, humanoid) = (Arc::new(robots::quadruped()), Arc::new(robots::humanoid()));
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let stances = [
        (&quadruped, contacts(&quadruped, ContactConstraint::point, &feet)),
        (&quadruped, contacts(&quadruped, ContactConstraint::point, &feet[..3])),
        // two points: no moment is possible about the line through both points
        (&quadruped, contacts(&quadruped, ContactConstraint::point, &[feet[0], feet[3]])),
        (&quadruped, contacts(&quadruped, ContactConstraint::point, &feet[1..2])),
        (&humanoid, contacts(&humanoid, ContactConstraint::rigid, &["left_foot", "right_foot"])),
        (&humanoid, contacts(&humanoid, ContactConstraint::rigid, &["right_foot"])),
        // legs have six joints, but contacts only three rows
        (&humanoid, contacts(&humanoid, ContactConstraint::point, &["left_foot", "right_foot"])),
    ];
    for (model, contacts) in stances {
        for damping in [0.0, 1e-2] {
            let costs = costs(model, &contacts, &mut rng);
            let inner =
                ContactAcceleration::new(model.clone(), Actuation::joints(model), &contacts, damping, costs).unwrap();
            let action = Integrated::new(inner, Integrator::SemiImplicitEuler, DT).unwrap();
            let what = format!("{} on {}, damping {damping}", model.name(), contacts.len());
            compare(&what, model, Box::new(action), |rng| random_state(model, rng));
        }
    }
}

/// Checks knots with straight legs, whose joint accelerations cannot be eliminated. Accelerations of bodies are
/// eliminated instead.
#[test]
fn implicit_knots_stand_on_straight_legs() {
    let mut rng = StdRng::seed_from_u64(4);
    let humanoid = Arc::new(robots::humanoid());
    let contacts = contacts(&humanoid, ContactConstraint::rigid, &["left_foot", "right_foot"]);
    let costs = costs(&humanoid, &contacts, &mut rng);
    let action = Integrated::new(
        ContactAcceleration::new(humanoid.clone(), Actuation::joints(&humanoid), &contacts, 0.0, costs).unwrap(),
        Integrator::SemiImplicitEuler,
        DT,
    );
    let straight = |rng: &mut StdRng| [condyle_dynamics::neutral(&humanoid), random(humanoid.nv(), 0.5, rng)].concat();
    compare("straight legs", &humanoid, Box::new(action.unwrap()), straight);
}

#[test]
fn implicit_knots_that_touch_nothing_have_the_gains_of_explicit_ones() {
    let mut rng = StdRng::seed_from_u64(6);
    for model in [robots::quadruped(), robots::humanoid(), robots::arm7()].map(Arc::new) {
        let nu = Actuation::joints(&model).nu();
        let frame = model.frames().len() - 1;
        let there = Contact::new(&model.frames()[frame].name, ContactConstraint::point(frame));
        let mut costs = contact_costs(&model, &[there.clone(), there], nu, &mut rng);
        costs.retain(|cost| !["force", "cone"].contains(&cost.name.as_str()));
        costs.push(Cost::new("u", 1.0, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic));
        let inner = FreeAcceleration::new(model.clone(), Actuation::joints(&model), costs).unwrap();
        let action = Integrated::new(inner, Integrator::SemiImplicitEuler, DT).unwrap();
        compare(model.name(), &model, Box::new(action), |rng| random_state(&model, rng));
    }
}
