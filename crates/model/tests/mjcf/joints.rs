//! Tests of MJCF: limits of joints, joints in frames, and free joints.

use super::*;
use std::f64::consts::PI;

#[test]
fn ranges_are_limits_if_their_numbers_are_in_order() {
    let limits = |joint: &str, before: &str| {
        let model = model(before, &body(joint, ""), "");
        [model.limits().lower[0], model.limits().upper[0]]
    };
    let none = [f64::NEG_INFINITY, f64::INFINITY];
    for joint in ["", "range='0 0'", "range='10 -10'", "range='5 5'", "range='-9 9' limited='false'"] {
        assert_eq!(limits(joint, ""), none, "{joint}");
    }
    for joint in ["range='-18 36'", "range='-18 36' limited='auto'", "range='-18 36' limited='true'"] {
        near(joint, &limits(joint, ""), &[-PI / 10.0, PI / 5.0], 1e-15);
    }
    let off = "<option><flag limit='disable'/></option>";
    assert_eq!(limits("range='-18 36'", off), none);
    assert_eq!(limits("range='-18 36'", &off.replace("limit", "constraint")), none);
    assert_eq!(limits("range='-1 2'", "<compiler angle='radian'/>"), [-1.0, 2.0]);
    for (joint, before, expected) in [
        ("limited='true'", "", "range: lower limit 0 is not below upper limit 0, though limited is true"),
        ("range='3 3' limited='true'", "", "range: lower limit 3 is not below upper limit 3"),
        ("range='1 2'", "<compiler autolimits='false'/>", "range: without autolimits, limited must say"),
        ("range='1'", "", "range: expected 2 numbers, found 1"),
    ] {
        let error = refused(before, &body(joint, ""), "");
        assert!(error.contains(expected), "{error}");
    }
    let ball = body("type='ball' range='10 60'", "");
    assert!(refused("", &ball, "").contains("range: the lower limit 10 of a ball joint is not 0"));
}

#[test]
fn both_sides_of_the_limit_of_effort() {
    let model = model("", &body("actuatorfrcrange='-2 5'", ""), "");
    assert_eq!((model.limits().effort_lower[0], model.limits().effort_upper[0]), (-2.0, 5.0));
}

#[test]
fn joints_in_frames() {
    let frame = format!(
        "<body name='b'><frame pos='1 2 3' euler='90 0 0' childclass='c'>
           <joint name='j' axis='0 1 0' pos='0 0 0.1'/>{INERTIAL}</frame></body>"
    );
    let class = "<default><default class='c'><joint armature='3'/></default></default>";
    let model = model(class, &frame, "");
    let body = &model.bodies()[1];
    near("anchor", &flat(&body.placement)[..3], &[1.0, 1.9, 3.0], 1e-12);
    near("axis", &body.joint.axis().unwrap().to_array(), &[0.0, 0.0, 1.0], 1e-12);
    // MuJoCo's inertia is in the MJCF body's frame, which differs from the frame of the model's body by the anchor of
    // the joint
    let expected = [2.0, 1.1 - 1.0, 2.0 - 1.9, 3.0 - 3.0, 0.02, 0.04, 0.03, 0.0, 0.0, 0.0];
    near("inertia", &inertia(body), &expected, 1e-12);
    assert_eq!(model.armature(), [3.0]);
    near("frame of the body", &placement(&model, "b")[..3], &[-1.0, -1.9, -3.0], 1e-12);
}

#[test]
fn free_joints() {
    let free = "<body name='f' pos='1 2 3' euler='10 20 30'><freejoint align='true'/>
        <geom type='box' size='0.1 0.2 0.3' pos='0.1 0.2 0.3'/><geom size='0.2' pos='0.3 0 0.1'/><site name='s' pos='1 0 0'/></body>";
    let aligned = |text: &str| model("", text, "");
    let model = aligned(free);
    let moments = [4.803_117_667_668_650_4, 4.113_650_790_345_558, 1.907_800_860_766_134];
    let expected = [&[81.510_321_638_291_15, 0.0, 0.0, 0.0][..], &moments, &[0.0; 3]].concat();
    near("inertia", &inertia(&model.bodies()[1]), &expected, 1e-12);
    let site = [0.601_774_446_315_367_6, -0.190_594_781_415_027_53, -0.575_844_984_086_267_7];
    near("site", &placement(&model, "s")[..3], &site, 1e-12);
    assert_eq!(placement(&model, "f"), flat(&Se3::identity()));
    // the free joint is aligned with the frame of inertia only if `align` is set and the body has no child bodies
    for (from, to) in
        [("<site", "<body><joint/><geom size='0.1'/></body><site"), (" align='true'", ""), ("true", "false")]
    {
        near("site", &placement(&aligned(&free.replace(from, to)), "s")[..3], &[1.0, 0.0, 0.0], 0.0);
    }
    let all = format!("<compiler alignfree='true'/>{}", "");
    let auto = super::model(&all, &free.replace(" align='true'", ""), "");
    near("alignfree", &placement(&auto, "s")[..3], &site, 1e-12);
    let friction = free.replace("<freejoint align='true'/>", "<joint type='free' frictionloss='2'/>");
    assert_eq!(aligned(&friction).friction(), [2.0; 6]);
}

#[test]
fn gravity_and_flags_in_their_order() {
    let gravity = |options: &str| super::model(options, &body("", ""), "").gravity().to_array();
    assert_eq!(gravity("<option gravity='1 2 3'/><option timestep='1'/>"), [1.0, 2.0, 3.0]);
    let off = "<option><flag gravity='disable'/></option>";
    assert_eq!(gravity(&format!("{off}<option gravity='1 2 3'/>")), [0.0; 3]);
    assert_eq!(gravity(&format!("{off}<option gravity='1 2 3'><flag gravity='enable'/></option>")), [1.0, 2.0, 3.0]);
    let passive = |flag: &str| {
        let option = format!("<option><flag {flag}='disable'/></option>");
        let model = super::model(&option, &body("damping='1' frictionloss='2' stiffness='3'", ""), "");
        (model.damping()[0], model.friction()[0], model.springs().len())
    };
    assert_eq!(passive("damper"), (0.0, 2.0, 1));
    assert_eq!(passive("frictionloss"), (1.0, 0.0, 1));
    assert_eq!(passive("constraint"), (1.0, 0.0, 1));
    assert_eq!(passive("spring"), (1.0, 2.0, 0));
    assert_eq!(passive("passive"), (0.0, 2.0, 0));
}
