//! Tests of models that are made from other models, and of named positions.

use condyle_model::{Error, FrameKind, Joint, Mimic, Model, ModelBuilder, Se3, Vec3, WORLD, robots};
use condyle_model::{Inertia, Sym3};

const SRDF: &str = include_str!("../../dynamics/tests/data/quadruped.srdf");

/// Returns the text of the SRDF, in which `what` is replaced by `by`.
fn with(what: &str, by: &str) -> String {
    assert_eq!(SRDF.matches(what).count(), 1, "{what}");
    SRDF.replace(what, by)
}

#[track_caller]
fn refused(text: &str, strict: bool, message: &str) {
    let said = robots::quadruped().reference_configurations_str(text, strict).unwrap_err().to_string();
    assert_eq!(said, message);
}

/// Checks that models and builders can be cloned and shared between threads.
#[test]
fn models_and_builders_are_values() {
    fn value<T: Clone + Send + Sync + std::fmt::Debug + 'static>(_: &T) {}
    let mut builder = ModelBuilder::new("two");
    builder.append(WORLD, Se3::identity(), &robots::arm7(), "");
    value(&builder);
    let (model, twin) = (builder.clone().build().unwrap(), builder.build().unwrap());
    value(&model);
    assert_eq!(model, twin);
    let shared: std::sync::Arc<Model> = (&model).into();
    assert_eq!(*shared, model);
}

#[test]
fn positions_have_names() {
    let quadruped = robots::quadruped();
    let positions = quadruped.reference_configurations_str(SRDF, true).unwrap();
    let names: Vec<_> = positions.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["standing", "sitting"]); // two states with the name `standing` form one position
    let mut standing = condyle_model::neutral(&quadruped);
    let joints = [("LF_HFE", 0.7), ("LF_KFE", -1.4), ("RF_HFE", 0.7), ("RF_KFE", -1.4)];
    let hind = [("LH_HFE", -0.7), ("LH_KFE", 1.4), ("RH_HFE", -0.7), ("RH_KFE", 1.4)];
    standing[2] = 0.45;
    for (joint, angle) in joints.into_iter().chain(hind) {
        standing[quadruped.bodies()[quadruped.joint(joint).unwrap()].idx_q] = angle;
    }
    assert_eq!(positions[0].1, standing);
}

/// Checks that unknown names in an SRDF have no effect, and that they are errors for a strict reader.
#[test]
fn positions_with_unknown_names() {
    let text = |state: &str| format!("<robot name='r'><disable_collisions link1='a'/>\n{state}</robot>");
    let positions = |text: &str, strict| robots::quadruped().reference_configurations_str(text, strict);
    let odd = text("<group_state nam='x' name='a'><jont name='LF_KFE' value='1'/></group_state>");
    assert_eq!(positions(&odd, false).unwrap().len(), 1);
    let said = "<string>:2: group_state `a`: unknown attribute `nam`; nearest is `name`";
    refused(&odd, true, said);
    let odd = odd.replace(" nam='x'", "");
    refused(&odd, true, "<string>:2: jont `LF_KFE`: unknown element <jont> in <group_state>; nearest is `joint`");
    assert!(positions(&text("<group name='g'><joint nam='x'/></group>"), true).unwrap().is_empty());
}

#[test]
fn positions_of_a_robot_with_fewer_joints() {
    let quadruped = robots::quadruped();
    let knee = quadruped.joint("LF_KFE").unwrap();
    let stiff = quadruped.lock(&[knee], &condyle_model::neutral(&quadruped)).unwrap();
    let positions = stiff.reference_configurations_str(SRDF, false).unwrap();
    assert_eq!((positions.len(), positions[0].1.len()), (2, 18));
    let unknown = "<string>:10: joint `LF_KFE`: unknown joint `LF_KFE`; nearest is `LF_HFE`";
    assert_eq!(stiff.reference_configurations_str(SRDF, true).unwrap_err().to_string(), unknown);
    let coupled = quadruped.with_mimic(knee, knee - 1, Mimic { ratio: -2.0, offset: 0.0 }).unwrap();
    let positions = coupled.reference_configurations_str(SRDF, true).unwrap();
    assert_eq!((positions[0].1.len(), positions[0].1[8]), (18, 0.7));
}

#[test]
fn a_continuous_joint_has_an_angle_or_its_cosine_and_sine() {
    let mut builder = ModelBuilder::new("wheel");
    let joint = Joint::Continuous { axis: Vec3::new(0.0, 0.0, 1.0) };
    builder.body("turn", WORLD, joint, Se3::identity(), Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0)));
    let wheel = builder.build().unwrap();
    let at = |value: &str| {
        let joint = format!(r#"<joint name="turn" value="{value}"/>"#);
        let text = format!(r#"<robot><group_state name="there">{joint}</group_state></robot>"#);
        wheel.reference_configurations_str(&text, true).map(|all| all[0].1.clone()).map_err(|e| e.to_string())
    };
    assert_eq!(at("0.5").unwrap(), [0.5_f64.cos(), 0.5_f64.sin()]);
    assert_eq!(at("0.6 0.8").unwrap(), [0.6, 0.8]);
    let length = "<string>:1: joint `turn`: its rotation, q[0..2], has the length 5, expected 1";
    assert_eq!(at("3 4").unwrap_err(), length);
    assert_eq!(at("1 0 0").unwrap_err(), "<string>:1: joint `turn`: value: expected 2 numbers, found 3");
}

#[test]
fn invalid_positions() {
    let value = r#"name="LF_HFE" value="0.7""#;
    let line = "<string>:9: joint `LF_HFE`";
    refused(&with(value, r#"name="LF_HFE""#), false, &format!("{line}: has no value"));
    refused(&with(value, r#"value="0.7""#), false, "<string>:9: <joint>: has no name");
    let word = with(value, r#"name="LF_HFE" value="much""#);
    refused(&word, false, &format!("{line}: value: `much` is no finite number"));
    let two = with(value, r#"name="LF_HFE" value="0.7 0.7""#);
    refused(&two, false, &format!("{line}: value: expected 1 number, found 2"));
    let short = with("0 0 0.45 0 0 0 1", "0 0 0.45 0 0 0 2");
    let length = "its rotation, q[3..7], has the length 2, expected 1";
    refused(&short, false, &format!("<string>:8: joint `root_joint`: {length}"));
    let state = with(r#"name="sitting" group="legs""#, r#"group="legs""#);
    refused(&state, false, "<string>:14: <group_state>: has no name");
    refused("<mujoco/>", false, "<string>:1: <mujoco>: expected <robot>, the root of an SRDF");
    let many = format!("<robot>{}</robot>", r#"<group_state name="there"/>"#.repeat(5000));
    refused(&many, false, "<string>:1: group_state `there`: more than 4096 positions");
    let missing = robots::arm7().reference_configurations("no/such.srdf", false).unwrap_err();
    assert!(matches!(missing, Error::File { .. }));
    assert_eq!(missing.to_string(), "no/such.srdf: No such file or directory (os error 2)");
}

#[test]
fn an_appended_robot_is_numbered_after_earlier_children() {
    let (quadruped, arm) = (robots::quadruped(), robots::arm7());
    let trunk = &quadruped.frames()[quadruped.frame("trunk").unwrap()];
    let at = Se3 { translation: Vec3::new(0.2, 0.0, 0.1), ..Se3::identity() };
    let both = quadruped.append(trunk.body, trunk.placement * at, &arm, "arm_").unwrap();
    let names: Vec<_> = both.bodies().iter().map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names[1..3], ["root_joint", "LF_HAA"]);
    assert_eq!(names[13..16], ["RH_KFE", "arm_joint1", "arm_joint2"]);
    assert_eq!(both.bodies()[14].parent, 1);
    assert_eq!(both.bodies()[14].placement.translation.x, 0.2);
    assert!((both.total_mass() - quadruped.total_mass() - arm.total_mass()).abs() < 1e-12);
    let limits = both.limits();
    assert_eq!(limits.upper[19..], *arm.limits().upper);
    assert_eq!(limits.upper[7..19], quadruped.limits().upper[7..]);
    let knee = quadruped.joint("LF_KFE").unwrap();
    let on_the_knee = quadruped.append(knee, at, &arm, "arm_").unwrap();
    assert_eq!(on_the_knee.joint("arm_joint1").unwrap(), knee + 1);
    // the frames of the robot that carries the other robot keep their indices
    for (k, frame) in quadruped.frames().iter().enumerate() {
        assert_eq!(both.frames()[k].name, frame.name);
    }
    assert!(both.frame("arm_tool").is_ok());
    let twice = quadruped.append(0, Se3::identity(), &quadruped, "").map(drop).unwrap_err();
    assert!(matches!(twice, Error::Duplicate { .. }), "{twice}");
    let on_the_ground = quadruped.append(0, Se3::identity(), &arm, "arm_").unwrap();
    assert_eq!(on_the_ground.bodies()[14].joint_name, "arm_joint1");
}

#[test]
fn a_joint_that_follows_has_no_coordinate_of_its_own() {
    let arm = robots::arm7();
    let geared = arm.clone().with_armature(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]).unwrap();
    let coupled = geared.with_mimic(4, 2, Mimic { ratio: -2.0, offset: 0.1 }).unwrap();
    assert_eq!((coupled.nv(), coupled.bodies().len(), coupled.has_mimic()), (6, 8, true));
    let expected = [0.1, 0.2 + 4.0 * 0.4, 0.3, 0.5, 0.6, 0.7]; // for the follower, v_joint = −2 v
    assert!(coupled.armature().iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-15), "{:?}", coupled.armature());
    let said = |model: &Model, follower, leader| {
        model.with_mimic(follower, leader, Mimic { ratio: 1.0, offset: 0.0 }).unwrap_err().to_string()
    };
    // a leader may itself follow another joint: q5 = 3 (-2 q2 + 0.1) + 1
    let chained = coupled.with_mimic(5, 4, Mimic { ratio: 3.0, offset: 1.0 }).unwrap();
    let followers: Vec<_> = chained.bodies().iter().filter_map(|b| b.mimic).collect();
    assert_eq!(followers, [Mimic { ratio: -2.0, offset: 0.1 }, Mimic { ratio: -6.0, offset: 3.0 * 0.1 + 1.0 }]);
    let led = coupled.with_mimic(2, 1, Mimic { ratio: 1.0, offset: 0.0 }).unwrap(); // joint4 follows joint2
    assert_eq!(led.bodies()[4].idx_v, led.bodies()[1].idx_v);
    assert_eq!(said(&coupled, 2, 4), "joint `joint2`: mimics itself, alone or by way of others");
    let quadruped = robots::quadruped();
    let one = "mimic works between joints of one degree of freedom only";
    assert_eq!(said(&quadruped, 2, 1), format!("joint `LF_HAA`: {one}"));
}

#[test]
fn frames_of_each_kind() {
    let mut builder = ModelBuilder::new("frames");
    let kinds = [FrameKind::Link, FrameKind::Joint, FrameKind::User];
    kinds.into_iter().for_each(|kind| builder.frame_of_kind("one", kind, WORLD, Se3::identity()));
    let frames = builder.build().unwrap();
    assert_eq!(frames.frames().iter().map(|f| f.kind).collect::<Vec<_>>(), kinds);
}
