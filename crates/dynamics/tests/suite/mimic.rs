//! Tests of joints that follow other joints: comparisons with Pinocchio, full turns, and rotors of followers.

use crate::common;

use common::{flat, normal, relative, rng};
use condyle_dynamics::{
    Data, Inertia, Joint, JointOptions, Mimic, Model, ModelBuilder, Se3, Sym3, UrdfOptions, Vec3, WORLD, crba,
    forward_kinematics, integrate, neutral, rnea,
};
use serde_json::Value;

/// Tolerance between some hundred products in different orders.
const ROUNDING: f64 = 1e-13;
/// Tolerance after some hundred turns. Each turn adds one more error of the size of `ROUNDING`.
const TURNS_ROUNDING: f64 = 1e-11;

fn floats(value: &Value) -> Vec<f64> {
    let all = value.as_array().unwrap().iter();
    all.flat_map(|x| x.as_f64().map_or_else(|| floats(x), |x| vec![x])).collect()
}

/// Checks that placements, efforts, M and effort limits equal Pinocchio's. The file `mimic.urdf` has every pair of
/// joint types that Pinocchio supports as leader and follower. Here, position limits, velocity limits and losses of a
/// follower act on the leader, but Pinocchio ignores them.
#[test]
fn as_in_pinocchio() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    let text = std::fs::read_to_string(format!("{folder}/mimic_pinocchio.json")).unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    let options = UrdfOptions { mimic: true, ..UrdfOptions::default() };
    let model = Model::from_urdf(format!("{folder}/mimic.urdf"), &options).unwrap();
    assert_eq!((model.nq(), model.nv(), model.bodies().len()), (3, 2, 7));
    let limits = model.limits();
    assert_eq!(limits.effort_upper, floats(&reference["effort"]));
    let [damping, friction] = ["damping", "friction"].map(|name| floats(&reference[name]));
    let expected = [
        ([limits.lower[0], limits.upper[0]], [(0.2 - 0.5) / 1.6, (0.1 - 0.05) / 0.25]),
        ([limits.velocity[0], limits.velocity[1]], [1.0 / 1.6, 2.0 / 3.0]),
        ([model.damping()[0], model.damping()[1]], [damping[0] + 1.6 * 1.6 * 0.7, damping[1] + 9.0 * 0.4]),
        ([model.friction()[0], model.friction()[1]], [friction[0] + 1.6 * 0.6, friction[1] + 3.0 * 0.3]),
    ];
    for (ours, expected) in expected {
        assert!(relative(&ours, &expected) < ROUNDING, "{ours:?} {expected:?}");
    }
    let mut data = Data::new(&model);
    for state in reference["states"].as_array().unwrap() {
        let [q, v, a] = ["q", "v", "a"].map(|x| floats(&state[x]));
        let close = |what: &str, ours: &[f64], theirs: &[f64]| {
            let error = relative(ours, theirs);
            assert!(error < ROUNDING, "{what}: {error:e}");
        };
        close("rnea", rnea(&model, &mut data, &q, &v, &a, &[]), &floats(&state["rnea"]));
        close("M", crba(&model, &mut data, &q).as_slice(), &floats(&state["M"]));
        let placements = forward_kinematics(&model, &mut data, &q);
        for (link, theirs) in state["links"].as_object().unwrap() {
            let X = placements.frame(model.frame(link).unwrap());
            let rows = Se3::new(X.rotation.transpose(), Vec3::zero());
            let ours = [&X.translation.to_array()[..], &flat(rows)[..9]].concat();
            close(link, &ours, &floats(theirs));
        }
    }
}

fn body(mass: f64) -> Inertia<f64> {
    Inertia::from_com(mass, Vec3::new(0.1, 0.2, -0.1), Sym3::diagonal(0.05))
}

/// Creates a leader with an oblique axis, and three followers whose axes have other directions.
fn geared(leader: fn(Vec3<f64>) -> Joint, follower: fn(Vec3<f64>) -> Joint, options: &JointOptions) -> Model {
    let mut builder = ModelBuilder::new("gears");
    let axis = Vec3::new(0.3, -0.5, 0.8);
    let options = || options.clone();
    let at = Se3 { translation: Vec3::new(0.2, 0.1, 0.3), ..Se3::identity() };
    let lead = builder.body_with(("lead", "lead"), WORLD, leader(axis), at, body(1.0), options());
    for (name, parent, ratio) in [("a", lead, -2.0), ("b", WORLD, 7.0), ("c", lead, 0.0)] {
        let axis = Vec3::new(ratio, 1.0, 0.4);
        let id = builder.body_with((name, name), parent, follower(axis), at, body(0.5), options());
        builder.mimic(id, lead, Mimic { ratio, offset: 0.3 * ratio + 0.1 });
    }
    builder.build().unwrap()
}

/// Checks that a continuous leader moves its followers like a revolute leader, even after many turns. The followers are
/// continuous or revolute joints.
#[test]
fn continuous_is_revolute() {
    type Kind = fn(Vec3<f64>) -> Joint;
    let (revolute, continuous): (Kind, Kind) = (|axis| Joint::Revolute { axis }, |axis| Joint::Continuous { axis });
    let plain = geared(revolute, revolute, &JointOptions::default());
    let others = [(continuous, revolute), (continuous, continuous), (revolute, continuous)]
        .map(|(leader, follower)| geared(leader, follower, &JointOptions::default()));
    let mut rng = rng(0);
    for model in &others {
        let (mut data, mut ours) = (Data::new(&plain), Data::new(model));
        let (mut q, mut theta) = (neutral(model), [0.0]);
        for _ in 0..400 {
            let [step, v, a] = [(); 3].map(|()| normal(&mut rng, 1));
            theta[0] += step[0];
            let before = q.clone();
            integrate(model, &before, &step, &mut q);
            let found = rnea(model, &mut ours, &q, &v, &a, &[]);
            assert!(relative(found, rnea(&plain, &mut data, &theta, &v, &a, &[])) < TURNS_ROUNDING);
            let found = crba(model, &mut ours, &q).as_slice();
            assert!(relative(found, crba(&plain, &mut data, &theta).as_slice()) < TURNS_ROUNDING);
        }
    }
}

/// Checks that the armature of a follower is multiplied by the square of the follower's ratio, also after the robot has
/// been added to another robot.
#[test]
fn rotors_of_followers() {
    let revolute = |axis| Joint::Revolute { axis };
    let rotors = JointOptions { armature: 0.1, damping: 0.5, ..JointOptions::default() };
    let model = geared(revolute, revolute, &rotors);
    assert_eq!(model.armature(), [0.1 + 4.0 * 0.1 + 49.0 * 0.1]);
    assert_eq!(model.damping(), [0.5 + 4.0 * 0.5 + 49.0 * 0.5]);
    let mut builder = ModelBuilder::new("two");
    builder.append(WORLD, Se3::identity(), &model, "left_");
    builder.append(WORLD, Se3::identity(), &model, "right_");
    let two = builder.build().unwrap();
    assert_eq!((two.armature(), two.damping()), (&[model.armature()[0]; 2][..], &[model.damping()[0]; 2][..]));
    let back: Model = serde_json::from_str(&serde_json::to_string(&two).unwrap()).unwrap();
    assert_eq!(back.armature(), two.armature());
}
