//! Several contacts on one body: refused if their rows depend on each other in every state, and only then.

use super::DT;
use condyle_dynamics::{ContactConstraint, Mat3, ReferenceFrame, Vec3, neutral, robots};
use condyle_optimal::robot::{
    Actuation, Contact, ContactAcceleration, Dynamics, ImpulseDynamics, Integrator, Knot, RobotProblem,
};
use std::sync::Arc;

const X: Vec3<f64> = Vec3 { x: 1.0, y: 0.0, z: 0.0 };
const Y: Vec3<f64> = Vec3 { x: 0.0, y: 1.0, z: 0.0 };
const Z: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };
/// Damping with which contacts share forces (1/kg).
const DAMPING: f64 = 1e-6;

/// Makes knots of all kinds with contacts `a`, `b` and `c` on a leg of a quadruped. Returns the common error message.
fn refused(constraints: &[ContactConstraint], damping: f64) -> Option<String> {
    let model = Arc::new(robots::quadruped());
    let named = |(c, name): (&ContactConstraint, &&str)| Contact::new(name, *c);
    let contacts: Vec<Contact> = constraints.iter().zip(&["a", "b", "c"]).map(named).collect();
    let actuation = Actuation::joints(&model);
    let x0 = [neutral(&model), vec![0.0; model.nv()]].concat();
    let dynamics = Dynamics::Contact {
        contacts: contacts.clone(),
        damping,
        actuation: None,
        integrator: Integrator::SemiImplicitEuler,
        dt: DT,
    };
    let data = RobotProblem {
        model: robots::quadruped(),
        x0,
        knots: vec![Knot::new(dynamics, vec![])],
        knot_models: vec![0],
        terminal: Knot::new(Dynamics::Terminal, vec![]),
    };
    let read: RobotProblem = serde_json::from_str(&serde_json::to_string(&data).unwrap()).unwrap();
    let said = [
        ContactAcceleration::new(model.clone(), actuation, &contacts, damping, vec![]).map(|_| ()),
        ImpulseDynamics::instant(model.clone(), &contacts, 0.0, damping, vec![]).map(|_| ()),
        read.build().map(|_| ()),
    ];
    let [contact, impulse, file] = said.map(|built| built.err().map(|error| error.to_string()));
    assert_eq!(contact, impulse);
    assert_eq!(file.is_some(), contact.is_some());
    assert!(file.is_none_or(|message| message.ends_with(contact.as_ref().unwrap())));
    contact
}

fn on(frame: &str, kind: fn(usize) -> ContactConstraint) -> ContactConstraint {
    kind(robots::quadruped().frame(frame).unwrap())
}

/// Returns a line on a frame, along a direction z of the frame. x is any direction across z.
fn line(frame: &str, x: Vec3<f64>, z: Vec3<f64>) -> ContactConstraint {
    ContactConstraint { axes: Mat3 { x, y: z.cross(x), z }, ..on(frame, ContactConstraint::line) }
}

fn along_world(c: ContactConstraint) -> ContactConstraint {
    ContactConstraint { reference: ReferenceFrame::LocalWorldAligned, ..c }
}

/// The shank's origin is above the foot, along the shank's z axis.
#[test]
fn rows_that_depend_on_each_other_are_refused_by_name() {
    let [foot, shank] = ["LF_foot", "LF_shank"];
    let singular = |others: &str| {
        Some(format!(
            "contact `{}`: it is on body `LF_shank`, as {others}: together they are singular without damping",
            if others.contains("contacts") { "c" } else { "b" }
        ))
    };
    let pairs = [
        [on(foot, ContactConstraint::point), on(shank, ContactConstraint::point)],
        [on(foot, ContactConstraint::rigid), on(shank, ContactConstraint::line)],
        [on(foot, ContactConstraint::point), line(shank, X, Z)],
        [line(foot, Y, Z), line(shank, X, Z)],
        [on(shank, ContactConstraint::plane), on(foot, ContactConstraint::plane)],
    ];
    for pair in pairs {
        assert_eq!(refused(&pair, 0.0), singular("contact `a`"));
        assert_eq!(refused(&pair, DAMPING), None); // the contacts share the force
    }
    let half = 0.5f64.sqrt();
    let oblique = line(foot, Z, Vec3 { x: half, y: half, z: 0.0 });
    for turned in [|c| c, along_world] {
        let lines = [line(foot, Y, X), line(foot, Z, Y), oblique].map(turned);
        assert_eq!(refused(&lines, 0.0), singular("contacts `a`, `b`"));
    }
    let pair = [on(foot, ContactConstraint::line), on(foot, ContactConstraint::plane)];
    assert_eq!(refused(&pair, 0.0), singular("contact `a`"));
    assert_eq!(refused(&pair.map(along_world), 0.0), singular("contact `a`"));
    let said = "contact `b`: it holds frame `LF_foot` as contact `a` does already";
    for damping in [0.0, DAMPING] {
        for same in [on(foot, ContactConstraint::point), on(foot, ContactConstraint::line), oblique] {
            assert_eq!(refused(&[same; 2], damping).unwrap(), said);
        }
    }
}

#[test]
fn rows_that_are_independent_are_accepted() {
    let [foot, shank] = ["LF_foot", "LF_shank"];
    let sets = [
        vec![line(foot, Y, X), line(foot, Z, Y), line(foot, X, Z)],
        vec![on(foot, ContactConstraint::point), line(shank, Y, X), line(shank, Z, Y)],
        vec![along_world(on(foot, ContactConstraint::plane)), along_world(on(shank, ContactConstraint::plane))],
        vec![along_world(on(foot, ContactConstraint::line)), on(foot, ContactConstraint::line)],
        vec![on(foot, ContactConstraint::point), on("RF_foot", ContactConstraint::point)],
    ];
    for set in sets {
        assert_eq!(refused(&set, 0.0), None);
    }
}

#[test]
fn axes_gains_and_damping_are_checked() {
    let foot = "LF_foot";
    let said = |c| refused(&[c], 0.0).unwrap();
    assert_eq!(
        said(ContactConstraint { axes: Mat3 { z: -Z, ..Mat3::identity() }, ..on(foot, ContactConstraint::line) }),
        "contact `a`: its axes are left-handed: expected e₁ × e₂ = e₃, found −e₃"
    );
    let skew = Mat3 { y: Vec3 { x: 0.5, y: 1.0, z: 0.0 }, ..Mat3::identity() };
    assert_eq!(
        said(ContactConstraint { axes: skew, ..on(foot, ContactConstraint::plane) }),
        "contact `a`: its axes are no unit vectors at right angles: the largest deviation is 5.0e-1"
    );
    assert_eq!(
        refused(&[on(foot, ContactConstraint::point)], -1.0).unwrap(),
        "setting `damping` is -1, but it must be at least 0"
    );
    let model = robots::arm7();
    let base = Contact::new("base", ContactConstraint::point(0));
    let actuation = Actuation::joints(&model);
    let error = ContactAcceleration::new(Arc::new(model), actuation, &[base], 0.0, vec![]).err().unwrap();
    assert!(error.to_string().ends_with("and `world` do not move relative to each other"), "{error}");
}
