//! Tests of MJCF: unknown and misplaced names, and attributes that contradict each other.

use super::*;

#[test]
fn unknown_names_warn_with_the_nearest_one() {
    for (before, inside, after, expected) in [
        ("", body("armatrue='3'", ""), "", "joint `j`: unknown attribute `armatrue`; nearest is `armature`"),
        ("", body("", "<gom size='1'/>"), "", "<gom>: unknown element <gom> in <body>; nearest is `geom`"),
        ("<compiler angel='radian'/>", body("", ""), "", "<compiler>: unknown attribute `angel`; nearest is `angle`"),
        ("<option><flag gravty='disable'/></option>", body("", ""), "", "<flag>: unknown attribute `gravty`"),
        ("<default><joint axs='1 0 0'/></default>", body("", ""), "", "<joint>: unknown attribute `axs`"),
        ("<default><joint name='x'/></default>", body("", ""), "", "joint `x`: unknown attribute `name`"),
        ("<asset><mesh naem='m' vertex='0 0 0'/></asset>", body("", ""), "", "<mesh>: unknown attribute `naem`"),
        ("", body("", ""), "<actuatr/>", "<actuatr>: unknown element <actuatr> in <mujoco>; nearest is `actuator`"),
        ("", body("", ""), "<actuator><motr joint='j'/></actuator>", "<motr>: unknown element <motr> in <actuator>"),
        ("", body("", ""), "<actuator><motor joint='j' gaer='2'/></actuator>", "unknown attribute `gaer`"),
        ("", body("", "<joint2/>"), "", "<joint2>: unknown element <joint2>"),
        ("", body("", "<body/><actuator/>"), "", "<actuator>: misplaced element <actuator> in <body>"),
        ("<joint/>", body("", ""), "", "<joint>: misplaced element <joint> in <mujoco>"),
    ] {
        let text = robot(before, &inside, after);
        let unknown = said(&read(&text).unwrap(), WarningKind::Unknown).join("\n");
        assert!(unknown.starts_with("<string>:1: ") && unknown.contains(expected), "{unknown}\n{expected}");
        let strict = MjcfOptions { strict: true, ..Default::default() };
        assert!(Model::from_mjcf_str(&text, &strict).is_err());
        let allowed = MjcfOptions { allow: vec![WarningKind::Unknown, WarningKind::Massless], ..strict };
        assert!(Model::from_mjcf_str(&text, &allowed).is_ok());
    }
}

/// Checks that elements of a robot cause a warning inside elements that do not change the robot, because they have no
/// effect there.
#[test]
fn misplaced_elements() {
    for (before, after, expected) in [
        ("", "<contact><body name='x'><joint/></body></contact>", "body `x`: misplaced element <body> in <contact>"),
        ("<size><option gravity='0 0 0'/></size>", "", "<option>: misplaced element <option> in <size>"),
        ("<visual><global><option/></global></visual>", "", "<option>: misplaced element <option> in <global>"),
        ("<custom><worldbody/></custom>", "", "<worldbody>: misplaced element <worldbody> in <custom>"),
        ("", "<sensor><motor joint='j'/></sensor>", "<motor>: misplaced element <motor> in <sensor>"),
        ("<drake:x/>", "", "<drake:x>: unknown element <drake:x> in <mujoco>"),
    ] {
        let unknown = said(&model(before, &body("", ""), after), WarningKind::Unknown);
        assert_eq!(unknown, [format!("<string>:1: {expected}")]);
    }
}

/// Checks that the reader refuses the keywords that MuJoCo 4.0 refuses.
#[test]
fn keywords() {
    for (before, inside, after, expected) in [
        (
            "",
            "",
            "<actuator><general joint='j' dyntype='filtr'/></actuator>",
            "<general>: dyntype: `filtr` is none of none, integrator, filter, filterexact, muscle, dcmotor, pid and user",
        ),
        ("", "", "<actuator><general joint='j' gaintype='none'/></actuator>", "<general>: gaintype: `none` is none of"),
        ("", "", "<actuator><general joint='j' biastype='afine'/></actuator>", "<general>: biastype: `afine` is none"),
        ("", "", "<actuator><motor joint='j' interp='cubc'/></actuator>", "<motor>: interp: `cubc` is none of zoh"),
        ("", "", "<actuator><pid joint='j' input='pos vell'/></actuator>", "<pid>: input: `vell` is none of none"),
        ("<option integrator='rk4'/>", "", "", "<option>: integrator: `rk4` is none of Euler, RK4"),
        ("<default><geom type='spher'/></default>", "", "", "<geom>: type: `spher` is none of plane"),
        ("<asset><mesh name='m' inertia='x'/></asset>", "", "", "mesh `m`: inertia: `x` is none of convex"),
        ("", "<geom type='' mass='0'/>", "", "<geom>: type: `` is none of plane"),
        ("", "<site type='bx'/>", "", "<site>: type: `bx` is none of plane"),
        ("", "<camera mode='fixd'/>", "", "<camera>: mode: `fixd` is none of fixed"),
    ] {
        let error = refused(before, &body("", inside), after);
        assert!(error.starts_with(&format!("<string>:1: {expected}")), "{error}\n{expected}");
    }
}

#[test]
fn repeated_names() {
    let geoms = |last: &str| body("", &format!("<geom name='g' size='1' mass='0'/>\n{last}"));
    let taken =
        |lines: [u8; 2]| format!("<string>:{}: geom `g`: the name is taken by the geom on line {}", lines[0], lines[1]);
    assert_eq!(refused("", &geoms("<geom name='g' size='1'/>"), ""), taken([2, 1]));
    // the geoms of the world are read first, so the geom on line 1 has the taken name
    assert_eq!(refused("", &(geoms("") + "<geom name='g' size='1'/>"), ""), taken([1, 2]));
    let twice = |section: &str, one: &str, two: &str| {
        let after = format!("<{section}>\n{one}\n{two}</{section}>");
        refused("", &body("", ""), &after)
    };
    let said = twice("keyframe", "<key name='a'/>", "<key name='a'/>");
    assert_eq!(said, "<string>:3: key `a`: the name is taken by the key on line 2");
    let said = twice("equality", "<joint name='a' joint1='j'/>", "<weld name='a' body1='b'/>");
    assert_eq!(said, "<string>:3: weld `a`: the name is taken by the joint on line 2");
    let said = twice("actuator", "<motor name='a' joint='j'/>", "<position name='a' joint='j'/>");
    assert_eq!(said, "<string>:3: position `a`: the name is taken by the motor on line 2");
    let said = twice("asset", "<mesh name='a' vertex='0'/>", "<mesh name='a' vertex='0'/>");
    assert_eq!(said, "<string>:3: mesh `a`: the name is taken by the mesh on line 2");
}

#[test]
fn names_without_effect_are_known() {
    let before = "<compiler autolimits='true' usethread='false'><lengthrange mode='none'/></compiler><size memory='1M'/>
        <option timestep='0.01' integrator='implicit' magnetic='1 0 0'><flag contact='disable' energy='enable'/></option>
        <statistic extent='3'/><visual><global fovy='30'/></visual><custom><numeric name='n' data='1'/></custom>
        <default><geom friction='1'/><material rgba='1 0 0 1'/><light diffuse='1 1 1'/><pair condim='1'/></default>
        <asset><texture name='t' builtin='flat' width='8' height='8'/><material name='q' texture='t'/></asset>";
    let inside = "<light pos='0 0 3'/><geom type='plane' size='1 1 1' material='q' contype='0'/>".to_owned()
        + &body(
            "group='1' margin='0.01' solreflimit='0.02 1'",
            "<site/><camera/><geom size='0.1' mass='0' rgba='1 1 1 1'/>",
        );
    let after = "<contact><exclude body1='b' body2='b'/></contact><sensor><gyro site='s'/></sensor>";
    assert_eq!(model(before, &inside, after).warnings(), []);
}

#[test]
fn contradictions_are_errors() {
    for (inside, expected) in [
        ("<body quat='1 0 0 0' euler='0 0 90'/>", "<body>: has 2 orientations: quat, euler"),
        ("<body axisangle='1 0 0 9' zaxis='0 0 1'/>", "has 2 orientations: axisangle, zaxis"),
        ("<body><geom type='capsule' size='1' fromto='0 0 0 1 0 0' pos='1 0 0'/></body>", "has both pos and fromto"),
        ("<body><geom size='1' fromto='0 0 0 1 0 0'/></body>", "a sphere has no fromto"),
        ("<body><site name='s' fromto='0 0 0 1 0 0'/></body>", "site `s`: a sphere has no fromto"),
        ("<body><inertial pos='0 0 0' mass='1' quat='1 0 0 0' fullinertia='1 1 1 0 0 0'/></body>", "fullinertia goes"),
        (
            "<body><inertial pos='0 0 0' mass='1' diaginertia='1 1 1' fullinertia='1 1 1 0 0 0'/></body>",
            "fullinertia goes",
        ),
        (
            "<body mocap='true'><joint/><geom size='1'/></body>",
            "<body>: mocap: the body is no fixed child of the world",
        ),
        ("<body><joint/><geom type='plane' size='1 1 1'/></body>", "<geom>: a plane is on a body that moves"),
        ("<body><composite type='cable'/></body>", "<composite>: is not supported"),
        ("<body><flexcomp name='f'/></body>", "flexcomp `f`: is not supported"),
        ("<body><plugin plugin='p'/></body>", "<plugin>: is not supported"),
    ] {
        let error = refused("", inside, "");
        assert!(error.contains(expected), "{error}\n{expected}");
    }
    assert!(refused("", "", "<deformable><flex name='f'/></deformable>").contains("flex `f`: is not supported"));
    assert!(refused("<option><flag spring='off'/></option>", "", "").contains("spring: `off` is neither enable nor"));
    // the last orientation in a class replaces the others, and a pos of 0 0 0 does not contradict fromto
    let before = "<default><geom euler='90 0 0'/><default class='c'><geom quat='0 1 0 0'/></default></default>";
    let inside = "<body><joint/><geom class='c' type='box' size='0.1 0.2 0.3' pos='1 0 0' mass='1'/></body>";
    near("class", &inertia(&model(before, inside, "").bodies()[1])[4..7], &[0.13 / 3.0, 0.1 / 3.0, 0.05 / 3.0], 1e-12);
}

#[test]
fn unsupported_features_warn() {
    for (before, inside, expected) in [
        ("<option density='1000'/>", body("", ""), "<option>: density 1000: forces of the medium"),
        ("<option viscosity='0.1'/>", body("", ""), "<option>: viscosity 0.1: forces of the medium"),
        ("", "<body name='t' mocap='true'/>".to_owned() + &body("", ""), "body `t`: mocap: the body is fixed"),
        ("", body("", "").replace("axis='0 1 0'", "type='ball' range='0 60'"), "joint `j`: range: the limit of 1.047"),
    ] {
        let left_out = said(&model(before, &inside, ""), WarningKind::LeftOut).join("\n");
        assert!(left_out.contains(expected), "{left_out}\n{expected}");
    }
    for quiet in ["<option density='0' wind='1 0 0'/>", "<option density='5'/><option density='0'/>"] {
        assert_eq!(model(quiet, &body("", ""), "").warnings(), []);
    }
}
