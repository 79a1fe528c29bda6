//! Tests of the validity of models. Models from all sources pass the same checks: unusual properties give warnings, and
//! impossible properties are rejected.

use crate::common::panics::assert_panic;
use condyle_dynamics::simulation::{Settings, Simulation, Status};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, DivideConquer, Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD,
    Warning, aba, forward_kinematics, neutral, rnea, robots,
};
use num_dual::Dual64;
use std::panic::catch_unwind;

/// Creates an arm whose last link has no mass. So forward dynamics has no solution.
pub(crate) fn massless_tip() -> Model {
    let mut builder = ModelBuilder::new("tip");
    let hinge = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3::diagonal(0.1));
    let arm = builder.body("arm", WORLD, hinge, Se3::identity(), rod);
    let elbow = Se3 { translation: Vec3::new(0.0, 0.0, -1.0), ..Se3::identity() };
    let tip = builder.body("tip", arm, hinge, elbow, Inertia::zero());
    builder.frame("end", tip, elbow);
    builder.build().unwrap()
}

fn read_again(model: &Model) -> Model {
    serde_json::from_str(&serde_json::to_string(model).unwrap()).unwrap()
}

#[test]
fn other_inertias_are_judged_anew() {
    let ball = Inertia::from_com(0.3, Vec3::zero(), Sym3::diagonal(0.01));
    let sick = massless_tip();
    assert_eq!(sick.singular_joints(), [2]);
    // With a new inertia of the tip, the robot is regular: all functions accept it, and it has no warnings.
    let cured = sick.with_inertias(|body, I| if body == 2 { ball } else { I }).unwrap();
    assert!(cured.singular_joints().is_empty() && cured.warnings().is_empty());
    let a: Vec<f64> = aba(&cured, &mut Data::new(&cured), &[0.1, 0.2], &[0.0; 2], &[0.0; 2], &[]).to_vec();
    assert!(a.iter().all(|a: &f64| a.is_finite()));
    // Without this inertia, the robot is singular again. The robot is then rejected like a robot that was built
    // singular.
    let again = cured.with_inertias(|body, I| if body == 2 { Inertia::<f64>::zero() } else { I }).unwrap();
    assert_eq!((again.singular_joints(), again.warnings()), (sick.singular_joints(), sick.warnings()));
    let refused = catch_unwind(|| aba(&again, &mut Data::new(&again), &[0.0; 2], &[0.0; 2], &[0.0; 2], &[]).to_vec());
    let message = refused.unwrap_err().downcast::<String>().unwrap();
    assert!(message.starts_with("joint `tip` moves nothing"), "{message}");
    // Armature also makes the robot regular.
    assert!(again.clone().with_armature(&[0.0, 0.1]).unwrap().singular_joints().is_empty());
    // A model that is read from a file has the same properties as the stored model.
    for model in [&sick, &cured, &again] {
        let read = read_again(model);
        assert_eq!((read.singular_joints(), read.warnings()), (model.singular_joints(), model.warnings()));
        assert_eq!(read.geometry_hash(), model.geometry_hash());
    }
}

/// Checks that inertias of dual numbers are checked by their real parts, in the same way as inertias of `f64`.
#[test]
fn dual_inertias_are_judged_as_plain_ones() {
    let seeded = |I: Inertia<f64>| Inertia { mass: Dual64::new(I.mass, 1.0), ..I.lift::<Dual64>() };
    let ball = Inertia::from_com(0.3, Vec3::zero(), Sym3::diagonal(0.01));
    let sick = massless_tip();
    let same = sick.with_inertias(|_, I| seeded(I)).unwrap();
    assert_eq!((same.singular_joints(), same.warnings()), (sick.singular_joints(), sick.warnings()));
    let cured = sick.with_inertias(|body, I| seeded(if body == 2 { ball } else { I })).unwrap();
    assert!(cured.singular_joints().is_empty() && cured.warnings().is_empty());
    assert_eq!(cured.total_mass(), 1.3);
    let zero = [Dual64::from(0.0); 2];
    let a = aba(&cured, &mut Data::new(&cured), &zero, &zero, &zero, &[]).to_vec();
    assert!(a.iter().all(|a| a.re.is_finite() && a.eps.is_finite()));
    let healthy = robots::arm7();
    let made_sick = healthy.with_inertias(|body, I| if body == 7 { Inertia::zero() } else { seeded(I) }).unwrap();
    assert_eq!(made_sick.singular_joints(), [7]);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let mass = |body| Dual64::new(if body == 3 { bad } else { 1.0 }, 0.0);
        let error = healthy.with_inertias(|body, I| Inertia { mass: mass(body), ..I.lift() }).unwrap_err().to_string();
        assert!(error.starts_with("body `link3`: mass is "), "{error}");
    }
    let nowhere = Vec3::new(Dual64::from(0.0), Dual64::from(f64::NAN), Dual64::from(0.0));
    assert_eq!(cured.with_gravity(nowhere).unwrap_err().to_string(), "gravity: (0, NaN, 0) m/s² is not finite");
}

/// Checks a robot that is regular, but whose M is singular at one position. Here a slide moves a point mass onto its
/// axis of rotation. At this position, `aba` returns numbers that are not finite, and a simulation reports an error.
#[test]
fn a_position_may_be_singular() {
    let (z, x) = (Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 0.0));
    let mut builder = ModelBuilder::new("sling");
    let rod = builder.body("rod", WORLD, Joint::Revolute { axis: z }, Se3::identity(), Inertia::zero());
    let point = Inertia::from_com(1.0, Vec3::zero(), Sym3::zero());
    builder.body("point", rod, Joint::Prismatic { axis: x }, Se3::identity(), point);
    let sling = builder.build().unwrap();
    assert!(sling.singular_joints().is_empty());
    let mut data = Data::new(&sling);
    let efforts = [1.0, 1.0];
    let drawn_in: Vec<f64> = aba(&sling, &mut data, &[0.0; 2], &[0.0; 2], &efforts, &[]).to_vec();
    assert!(drawn_in.iter().any(|a| !a.is_finite()), "{drawn_in:?}");
    let out: Vec<f64> = aba(&sling, &mut data, &[0.0, 0.5], &[0.0; 2], &efforts, &[]).to_vec();
    assert!((out[0] - 4.0).abs() < 1e-12 && (out[1] - 1.0).abs() < 1e-12, "{out:?}"); // τ / m r²
    let mut simulation = Simulation::new(&sling, Settings::default());
    assert_eq!(simulation.step(&efforts, &[]), Status::NotFinite);
    assert_eq!((simulation.q(), simulation.v()), (&[0.0; 2][..], &[0.0; 2][..])); // the step was not taken
}

#[test]
fn impossible_numbers_are_refused_by_name() {
    let model = robots::arm7();
    let with = |change: fn(Inertia<f64>) -> Inertia<f64>| {
        let result = model.with_inertias(|body, I| if body == 3 { change(I) } else { I });
        result.map(|_| ()).unwrap_err().to_string()
    };
    let finite = "expected a finite number of at least 0";
    assert_eq!(with(|I| Inertia { mass: -1.0, ..I }), format!("body `link3`: mass is -1 kg, {finite}"));
    assert_eq!(with(|I| Inertia { mass: f64::NAN, ..I }), format!("body `link3`: mass is NaN kg, {finite}"));
    let far = |I| Inertia { mass_com: Vec3::new(f64::INFINITY, 0.0, 0.0), ..I };
    assert_eq!(with(far), "body `link3`: inertia is not finite");
    let gravity = model.clone().with_gravity(Vec3::new(0.0, 0.0, f64::NAN)).unwrap_err();
    assert_eq!(gravity.to_string(), "gravity: (0, 0, NaN) m/s² is not finite");
    for (bad, said) in [(-0.1, "-0.1"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let mut armature = [0.0; 7];
        armature[4] = bad;
        let error = model.clone().with_armature(&armature).unwrap_err().to_string();
        assert_eq!(error, format!("joint `joint5`: armature is {said}, {finite}"));
    }
    let mut q = neutral(&model);
    q[2] = f64::NAN;
    let error = model.lock(&[3], &q).unwrap_err().to_string();
    assert_eq!(error, "joint `joint3`: q[2] is NaN, which is not finite");
    let quadruped = robots::quadruped();
    let mut q = neutral(&quadruped);
    q[6] = 0.9;
    let error = quadruped.lock(&[3], &q).unwrap_err().to_string();
    assert_eq!(error, "joint `root_joint`: its rotation, q[3..7], has the length 0.9, expected 1");
}

/// Checks that intended massless bodies give no warnings. Such bodies are between the joints of a chain that replaces
/// one joint. Models that are made from the chain must not have warnings either.
#[test]
fn chains_stay_without_warnings() {
    let mut builder = ModelBuilder::new("chain");
    let ball = Inertia::from_com(1.0, Vec3::new(0.1, 0.0, 0.0), Sym3::diagonal(0.01));
    builder.spherical_zyx("ball", WORLD, Se3::identity(), ball);
    let chain = builder.build().unwrap();
    let mut two = ModelBuilder::new("two");
    two.append(WORLD, Se3::identity(), &chain, "left_");
    let made = [
        chain.with_inertias(|_, I| I.scale(2.0)).unwrap(),
        chain.clone().with_gravity(Vec3::zero()).unwrap(),
        chain.clone().with_armature(&[0.1; 3]).unwrap(),
        read_again(&chain),
        two.build().unwrap(),
    ];
    assert!(made.iter().all(|model| model.warnings().is_empty() && model.singular_joints().is_empty()));
}

/// Checks that warnings about elements that were left out of a file are kept. These warnings must follow the warnings
/// about unusual properties, in the same order for all sources.
#[test]
fn warnings_keep_their_order() {
    let text = r#"<mujoco><worldbody><body name="a"><joint axis="0 1 0"/><geom type="sphere" size="0.1" mass="1"/>
        <body name="b" pos="0 0 1"><joint axis="0 0 1"/><site name="s"/></body></body></worldbody>
        <equality><tendon tendon1="t"/></equality></mujoco>"#;
    let model = Model::from_mjcf_str(text, &condyle_dynamics::MjcfOptions::default()).unwrap();
    let said = model.warnings().to_vec();
    assert!(
        matches!(said[..], [Warning::Massless { .. }, Warning::Singular { .. }, Warning::LeftOut { .. }]),
        "{said:?}"
    );
    assert_eq!(read_again(&model).warnings(), said);
    assert_eq!(model.clone().with_gravity(Vec3::zero()).unwrap().warnings(), said);
    let cured = model.with_armature(&[0.1; 2]).unwrap();
    assert!(matches!(cured.warnings(), [Warning::Massless { .. }, Warning::LeftOut { .. }]));
}

/// Checks that scratch memory prepared for one robot is rejected for another robot with the same tree, if frames or
/// axes of the robots differ.
#[test]
fn plans_know_their_robot() {
    let robot = |length: f64, axis: Vec3<f64>| {
        let mut builder = ModelBuilder::new("arm");
        let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3::diagonal(0.1));
        let mut on = WORLD;
        for k in 0..4 {
            let there = Se3 { translation: Vec3::new(0.0, 0.0, -length), ..Se3::identity() };
            on = builder.body(&format!("b{k}"), on, Joint::Revolute { axis }, there, rod);
        }
        builder.frame("tip", on, Se3::identity());
        builder.build().unwrap()
    };
    let (x, y) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
    let (one, longer, turned) = (robot(1.0, y), robot(2.0, y), robot(1.0, x));
    let accepted = |model: &Model| {
        let model = model.clone();
        let one = one.clone();
        let (q, v) = ([0.3; 4], [0.0; 4]);
        let contact = ContactConstraint::point(one.frame("tip").unwrap());
        let mut set = ConstraintSet::<f64>::new(&one, &[contact]).unwrap();
        let mut divided = DivideConquer::<f64>::new(&one, 1);
        let constrained = {
            let model = model.clone();
            catch_unwind(move || {
                drop(
                    condyle_dynamics::constrained_dynamics(&model, &mut Data::new(&model), &mut set, &q, &v, &v, &[])
                        .a
                        .to_vec(),
                );
            })
        };
        let divided = catch_unwind(move || drop(divided.aba(&model, &q, &v, &v, &[]).to_vec()));
        (constrained.is_ok(), divided.is_ok())
    };
    assert_eq!(accepted(&longer), (false, false));
    assert_eq!(accepted(&turned), (false, false));
    // Scratch memory is accepted for the same robot with other constants, and for the same robot read from a file.
    let heavier = one.with_inertias(|_, I| I.scale(2.0)).unwrap().with_gravity(Vec3::zero()).unwrap();
    assert_eq!(accepted(&heavier), (true, true));
    assert_eq!(accepted(&read_again(&one)), (true, true));
    // Stored placements are accepted only for robots whose joints and frames have the same placements.
    let mut data = Data::<f64>::new(&one);
    forward_kinematics(&one, &mut data, &[0.3; 4]);
    assert!(data.placements(&one).is_some() && data.placements(&heavier).is_some());
    for other in [&longer, &turned] {
        let refused = "data: its placements are those of another robot than `arm`, with the same tree";
        assert_panic("tests/suite/validity.rs", refused, || _ = data.placements(other));
        aba(other, &mut data, &[0.3; 4], &[0.0; 4], &[0.0; 4], &[]);
        assert!(data.placements(other).is_some());
        assert_panic("tests/suite/validity.rs", refused, || _ = data.placements(&one));
        forward_kinematics(&one, &mut data, &[0.3; 4]);
    }
    rnea(&one, &mut data, &[0.3; 4], &[0.0; 4], &[0.0; 4], &[]);
    assert!(data.placements(&longer).is_none(), "there are none that could be those of another robot");
    let seeded = one.with_inertias(|_, I| I.lift::<Dual64>()).unwrap();
    let mut duals = Data::<Dual64>::new(&one);
    forward_kinematics(&seeded, &mut duals, &[0.3.into(); 4]);
    assert!(duals.placements(&one).is_some());
    assert_panic("tests/suite/validity.rs", "another robot", || _ = duals.placements(&longer));
    // Another type of joint gives another tree hash.
    let mut builder = ModelBuilder::new("slides");
    let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3::diagonal(0.1));
    builder.body("b", WORLD, Joint::Prismatic { axis: y }, Se3::identity(), rod);
    let slides = builder.build().unwrap();
    let mut builder = ModelBuilder::new("turns");
    builder.body("b", WORLD, Joint::Revolute { axis: y }, Se3::identity(), rod);
    assert_ne!(slides.tree_hash(), builder.build().unwrap().tree_hash());
}
