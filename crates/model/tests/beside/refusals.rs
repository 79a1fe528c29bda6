//! Tests of MJCF: errors, limits of files, and models that are changed.

use super::*;

#[test]
fn errors() {
    let actuator = |text: &str| one("", HINGE, &format!("<actuator>{text}</actuator>"));
    let equality = |text: &str| one("", HINGE, &format!("<equality>{text}</equality>"));
    let tendon = |text: &str| one("", HINGE, &format!("<tendon>{text}</tendon>"));
    let cases = [
        (actuator("<motor joint='k'/>"), "<motor>: joint: no joint is named `k`"),
        (actuator("<motor/>"), "<motor>: has no joint, tendon or site that it drives"),
        (actuator("<motor joint='j' site='s'/>"), "<motor>: has both joint and site: expected one of them"),
        (actuator("<motor site='z'/>"), "<motor>: site: no site is named `z`"),
        (actuator("<motor tendon='z'/>"), "<motor>: tendon: no tendon is named `z`"),
        (actuator("<motor joint='j' class='x'/>"), "<motor>: no default class is named `x`"),
        (actuator("<motor joint='j' gear='1 2 3 4 5 6 7'/>"), "<motor>: gear: expected at most 6 numbers, found 7"),
        (
            actuator("<motor joint='j' ctrllimited='true' ctrlrange='1 -1'/>"),
            "<motor>: ctrlrange: 1 is not less than -1",
        ),
        (
            actuator("<position joint='j' kv='1' dampratio='1'/>"),
            "<position>: has kv and dampratio, which contradict each other",
        ),
        (actuator("<position joint='j' kv='-1'/>"), "<position>: kv or dampratio -1 is negative"),
        (
            actuator("<motor joint='j' gear='1e300' armature='1'/>"),
            "<motor>: gear 1e300: gear² times armature or damping is not finite",
        ),
        (actuator("<dcmotor joint='j'/>"), "<dcmotor>: motor constant 0 or resistance 0 is not positive"),
        (
            actuator("<dcmotor joint='j' motorconst='1e200' resistance='1e-200'/>"),
            "<dcmotor>: its gain, bias or gear is inf, which is not finite",
        ),
        (
            actuator("<motor name='m' joint='j'/><motor name='m' joint='j'/>"),
            "motor `m`: the name is taken by the motor on line 1",
        ),
        (
            one("", "<joint name='j'/>", "<actuator><position joint='j' inheritrange='1'/></actuator>"),
            "<position>: inheritrange: what it drives has no range",
        ),
        (
            one(
                "<compiler autolimits='false'/>",
                "<joint name='j'/>",
                "<actuator><motor joint='j' forcerange='-1 1'/></actuator>",
            ),
            "<motor>: forcerange: without autolimits, forcelimited must say whether it limits",
        ),
        (one("", "<joint name='j' springdamper='1 0'/>", ""), "joint `j`: springdamper: 1 and 0 must both be positive"),
        (
            one("", "<joint name='j' stiffness='1 2 3 4'/>", ""),
            "joint `j`: stiffness: expected at most 3 numbers, found 4",
        ),
        (
            one("", "<joint name='j' damping='-1'/>", ""),
            "joint `j`: damping is -1, expected a finite number of at least 0",
        ),
        (tendon("<fixed name='t'/>"), "fixed `t`: has no joint"),
        (
            tendon("<fixed name='t'><joint joint='j' coef='1'/><joint joint='j' coef='1'/></fixed>"),
            "fixed `t`: has a joint twice",
        ),
        (tendon("<fixed name='t'><joint joint='j'/></fixed>"), "<joint>: has no coef"),
        (tendon("<fixed armature='-1'><joint joint='j' coef='1'/></fixed>"), "<fixed>: armature -1 is negative"),
        (equality("<weld body1='x'/>"), "<weld>: body1: no body is named `x`"),
        (equality("<weld site1='s' site2='x'/>"), "<weld>: site2: no site is named `x`"),
        (equality("<weld/>"), "<weld>: has neither body1 nor site1 and site2"),
        (equality("<weld body1='b' site1='s'/>"), "<weld>: has both bodies and sites: expected one of them"),
        (equality("<connect body1='b'/>"), "<connect>: has no anchor"),
        (equality("<weld body1='b' relpose='1 2 3'/>"), "<weld>: relpose: expected 7 numbers, found 3"),
        (equality("<joint joint1='j' joint2='j'/>"), "<joint>: joint1 and joint2 are the same"),
    ];
    for (text, expected) in cases {
        assert_eq!(read(&text).unwrap_err().to_string(), format!("<string>:1: {expected}"), "{text}");
    }
}

/// Checks that a file is refused at once if its parts refer to each other so often that their product exceeds a limit.
#[test]
fn limits_of_multiplied_content() {
    let keys = format!("<keyframe>{}</keyframe>", "<key/>".repeat(300_000));
    let text = one("", "<freejoint/>", &keys);
    let bodies = "<body><joint/><geom size='0.1'/></body>".repeat(100);
    let said = read(&text.replace("</worldbody>", &format!("{bodies}</worldbody>"))).unwrap_err().to_string();
    assert_eq!(said, "<string>:1: <mujoco>: 300000 keyframes of 213 numbers: at most 4194304 are allowed");
    let bodies: String = (0..2000).map(|i| format!("<body><joint name='{i}'/><geom size='0.1'/></body>")).collect();
    let joints: String = (0..2000).map(|i| format!("<joint joint='{i}' coef='1'/>")).collect();
    let motors = "<motor tendon='t'/>".repeat(1000);
    let text = format!(
        "<mujoco><worldbody>{bodies}</worldbody><tendon><fixed name='t'>{joints}</fixed></tendon><actuator>{motors}</actuator></mujoco>"
    );
    let said = read(&text).unwrap_err().to_string();
    let what = "1050000 joints of tendons that actuators drive so far: at most 1048576 are allowed";
    assert_eq!(said, format!("<string>:1: <motor>: {what}"));
}

/// Checks that springs, actuators, constraints and keyframes stay with their bodies and joints when a robot is changed.
#[test]
fn models_that_are_changed() {
    let ball = "<geom size='0.1'/>";
    let text = format!(
        "<mujoco><worldbody><body name='a'><joint name='a' stiffness='1'/>{ball}<body name='b' pos='1 0 0' gravcomp='1'>
        <joint name='b' stiffness='2' actuatorfrcrange='-1 2'/>{ball}<site name='tip' pos='1 0 0'/></body></body></worldbody>
        <actuator><motor name='m' joint='a'/><position name='n' joint='b'/></actuator>
        <equality><connect name='loop' body1='b' anchor='1 0 0'/></equality><keyframe><key name='up' qpos='0.1 0.2' ctrl='3 4'/></keyframe></mujoco>"
    );
    let found = read(&text).unwrap();
    let locked = found.lock(&[1], &neutral(&found)).unwrap();
    assert_eq!((locked.springs().len(), locked.springs()[0].stiffness[0], locked.springs()[0].body), (1, 2.0, 1));
    assert_eq!((locked.actuators().len(), locked.actuators()[0].name.as_str()), (1, "n"));
    assert_eq!((locked.limits().effort_lower[0], locked.keyframes()[0].q[0]), (-1.0, 0.2));
    assert_eq!((&locked.keyframes()[0].control[..], &found.keyframes()[0].control[..]), (&[4.0][..], &[3.0, 4.0][..]));
    assert_eq!((locked.constraints().len(), locked.gravity_compensation()[0].body), (1, 1));
    let mut two = ModelBuilder::new("two");
    two.append(WORLD, Se3::identity(), &found, "left_");
    two.append(WORLD, Se3::identity(), &found, "right_");
    let two = two.build().unwrap();
    assert_eq!((two.springs().len(), two.actuators().len(), two.constraints().len()), (4, 4, 2));
    assert_eq!(two.actuators()[3].name, "right_n");
    let controls: Vec<&[f64]> = two.keyframes().iter().map(|keyframe| &keyframe.control[..]).collect();
    assert_eq!(controls, [[3.0, 4.0, 0.0, 0.0], [0.0, 0.0, 3.0, 4.0]]);
    assert!(matches!(two.actuators()[3].transmission, Transmission::Joint { body: 4 }));
    let carried = |model: &Model, k: usize| {
        let compensation = model.gravity_compensation()[k];
        compensation.carried(model.bodies()[compensation.body].inertia)
    };
    assert_eq!(carried(&two, 1), carried(&found, 0));
}

/// Compares the force on a tendon over a locked joint with MuJoCo's `qfrc_actuator`, at the positions 0.3 and 0.4 and
/// the control 0.9. The locked joint still contributes to the tendon's length 1.0.
#[test]
fn a_locked_joint_of_a_tendon() {
    let text =
        "<mujoco><worldbody><body><joint name='a' axis='0 1 0'/><geom size='.1' pos='.2 0 0'/><body pos='.5 0 0'>
        <joint name='b' axis='0 1 0'/><geom size='.1' pos='.2 0 0'/></body></body></worldbody>
        <tendon><fixed name='t'><joint joint='a' coef='2'/><joint joint='b' coef='1'/></fixed></tendon>
        <actuator><position tendon='t' kp='10' gear='GEAR'/></actuator></mujoco>";
    for (gear, expected) in [("1", -2.0), ("2", -44.0)] {
        let found = read(&text.replace("GEAR", gear)).unwrap();
        let locked = found.lock(&[2], &[0.0, 0.4]).unwrap();
        let servo = &locked.actuators()[0];
        let Transmission::Tendon { joints, .. } = &servo.transmission else { panic!() };
        let [(1, coefficient)] = joints[..] else { panic!() };
        let moment = servo.gear[0] * coefficient;
        close(&[moment * (servo.gain * 0.9 + servo.bias - servo.kp * moment * 0.3)], &[expected]);
    }
}

/// Checks that a locked follower fixes its leader if the polynomial is linear, and that other polynomials cause a
/// warning. All other warnings are kept.
#[test]
fn a_locked_joint_of_a_coupling() {
    let text = |equality: &str| {
        let ball = "<geom size='0.1'/>";
        format!(
            "<mujoco><worldbody><body><joint name='a' dampng='1'/>{ball}<body><joint name='b' axis='0 1 0'/>{ball}</body></body>
            </worldbody><equality>{equality}</equality></mujoco>"
        )
    };
    let lock = |equality: &str, joint: usize| read(&text(equality)).unwrap().lock(&[joint], &[0.5, 2.1]).unwrap();
    let coupled = "<joint name='e' joint1='b' joint2='a' polycoef='0.1 2'/>";
    for (joint, held) in [(1, 1.1), (2, 1.0)] {
        let locked = lock(coupled, joint); // b = 0.1 + 2 a, locked at a = 0.5 or at b = 2.1
        let ModelConstraintKind::Coupling { follower: 1, leader: None, coefficients } = locked.constraints()[0].kind
        else {
            panic!()
        };
        close(&coefficients, &[held, 0.0, 0.0, 0.0, 0.0]);
        let kinds: Vec<_> = locked.warnings().iter().map(Warning::kind).collect();
        assert_eq!(kinds, [WarningKind::Unknown, WarningKind::Mimic]);
    }
    let curve = lock("<joint name='e' joint1='b' joint2='a' polycoef='0 1 2'/>", 2);
    assert!(curve.constraints().is_empty());
    let what = "joint `b` is locked, and its polynomial is not linear: joint `a`, which it follows, is left free";
    assert_eq!(said(&curve).last().unwrap(), &format!("constraint `e`: {what}"));
    let found = read(&text(coupled)).unwrap();
    let both = found.append(1, Se3::identity(), &found, "x_").unwrap();
    assert_eq!(both.warnings().len(), 4);
}

/// Checks that errors and warnings about the text of a compiled model have no line number, because the user does not
/// know this text.
#[test]
fn a_text_without_lines() {
    let text = one("", "<joint name='j' dampng='1'/>", "");
    let found = Model::from_compiled_mjcf(&text, &MjcfOptions::default()).unwrap();
    assert_eq!(said(&found), ["joint `j`: unknown attribute `dampng`; nearest is `damping`"]);
    assert_eq!(found.warnings()[0].place(), None);
    let text = one("", "<joint name='j' damping='x'/>", "");
    let said = Model::from_compiled_mjcf(&text, &MjcfOptions::default()).unwrap_err().to_string();
    assert_eq!(said, "<MjModel>: joint `j`: damping: `x` is no finite number");
}
