//! Tests of MJCF: loops, couplings, followers and keyframes.

use super::*;

/// Compares constraints with MuJoCo's `eq_data`: anchors in body1 and body2, and the relative orientation.
#[test]
fn loops_and_couplings() {
    let text = "<mujoco><worldbody><body name='a' pos='1 2 3' quat='1 2 3 4'><joint name='p' axis='0 1 0' ref='15' pos='.1 .2 .3'/>
        <geom size='.1'/><body name='c' pos='.1 .2 .3' quat='4 3 2 1'><joint name='s' type='slide' axis='1 2 3' ref='0.25'/>
        <geom size='.1'/><site name='u' pos='0 .1 0' quat='1 1 0 0'/></body></body>
        <body name='e' pos='0 1 0' quat='1 0 0 1'><freejoint/><geom size='.1'/><site name='v' pos='.3 0 0'/></body></worldbody>
        <equality><connect body1='c' body2='e' anchor='.1 .2 .3'/><weld name='w' body1='c' body2='e' anchor='.1 .2 .3'/>
        <weld body1='a' relpose='.1 .2 .3 1 1 0 0' anchor='.3 .2 .1' torquescale='0'/>
        <joint joint1='p' joint2='s' polycoef='0.1 0.2 0.3 0.4 0.5'/><weld site1='u' site2='v'/><connect body1='c' active='false' anchor='0 0 0'/>
        <joint joint1='s'/></equality></mujoco>";
    let found = read(text).unwrap();
    let names: Vec<&str> = found.constraints().iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["connect1", "w", "weld2", "joint1", "weld3", "joint2"]);
    // returns the poses of the two frames of a constraint, relative to the bodies or sites in `of`
    let placed = |k: usize, of: [&str; 2]| {
        let frames = match found.constraints()[k].kind {
            ModelConstraintKind::Point { frames } | ModelConstraintKind::Rigid { frames } => frames,
            _ => panic!(),
        };
        [0, 1].map(|side| {
            let frame = &found.frames()[frames[side]];
            let at = &found.frames()[found.frame(of[side]).unwrap()];
            assert_eq!((frame.body, frame.kind), (at.body, FrameKind::Constraint));
            assert_eq!(frame.name, format!("{}#{}", names[k], side + 1));
            at.placement.inverse() * frame.placement
        })
    };
    let place = |X: Se3<f64>| X.translation.to_array();
    let [first, second] = placed(0, ["c", "e"]);
    close(&place(first), &[0.1, 0.2, 0.3]);
    close(&place(second), &[1.56, -1.104, 3.328]);
    assert!(matches!(found.constraints()[0].kind, ModelConstraintKind::Point { .. }));
    let [first, second] = placed(1, ["c", "e"]);
    close(&place(first), &[-1.54, -2.964, 0.848]);
    close(&place(second), &[0.1, 0.2, 0.3]);
    // the quaternion (0, −0.7071, −0.4243, −0.5657) maps x, y and z to these columns
    let turned = [first.rotation.x, first.rotation.y, first.rotation.z].map(|axis| axis.to_array());
    close(turned.as_flattened(), &[0.0, 0.6, 0.8, 0.6, -0.64, 0.48, 0.8, 0.48, -0.36]);
    assert!(matches!(found.constraints()[1].kind, ModelConstraintKind::Rigid { .. }));
    let [first, second] = placed(2, ["a", "world"]);
    close(&place(first), &[0.1, 0.2, 0.3]);
    close(&place(second), &[0.3, 0.2, 0.1]);
    // with `torquescale` 0, a weld does not constrain the rotation
    assert!(matches!(found.constraints()[2].kind, ModelConstraintKind::Point { .. }));
    for X in placed(4, ["u", "v"]) {
        close(&place(X), &[0.0; 3]);
    }
    let ModelConstraintKind::Coupling { follower, leader, coefficients: c } = found.constraints()[3].kind else {
        panic!()
    };
    assert_eq!((follower, leader), (1, Some(2)));
    for x in [-0.7, 0.3, 1.1] {
        let d: f64 = x - 0.25;
        let y = 15f64.to_radians() + 0.1 + 0.2 * d + 0.3 * d * d + 0.4 * d.powi(3) + 0.5 * d.powi(4);
        close(&[c.iter().rev().fold(0.0, |sum, c| sum * x + c)], &[y]);
    }
    let ModelConstraintKind::Coupling { leader: None, coefficients, .. } = found.constraints()[5].kind else {
        panic!()
    };
    assert_eq!(coefficients, [0.25, 0.0, 0.0, 0.0, 0.0]);
    let kinds: Vec<_> = found.warnings().iter().map(|warning| warning.kind()).collect();
    assert_eq!(kinds, [WarningKind::Mimic, WarningKind::LeftOut]); // the couplings are not enforced
    // both bodies of the constraint are merged into one body of the model
    let held = model("", &format!("{HINGE}<body name='c'/>"), "<equality><weld body1='b' body2='c'/></equality>");
    assert_eq!(said(&held), ["<string>:1: <weld>: both ends are fixed to one body, which no constraint can move"]);
}

/// Checks that all followers in a chain get the same leader, and that a circle of followers becomes a constraint.
#[test]
fn followers_of_followers() {
    let ball = "<geom size='0.1'/>";
    let bodies: String = ["a", "b", "c"]
        .map(|name| format!("<body><joint name='{name}' damping='1' actuatorfrcrange='-1 2'/>{ball}</body>"))
        .concat();
    let text = |equality: &str| {
        format!(
            "<mujoco><worldbody>{bodies}</worldbody><equality>{equality}</equality><actuator><motor joint='b' ctrlrange='-3 1'/></actuator></mujoco>"
        )
    };
    let chain = "<joint joint1='c' joint2='b' polycoef='0.5 3'/><joint joint1='b' joint2='a' polycoef='0.1 -2'/>";
    let options = MjcfOptions { mimic: true, ..MjcfOptions::default() };
    let found = Model::from_mjcf_str(&text(chain), &options).unwrap();
    let mimic = |i: usize| found.bodies()[i].mimic.map(|mimic| [mimic.ratio, mimic.offset]);
    assert_eq!((found.nv(), mimic(1), mimic(2)), (1, None, Some([-2.0, 0.1])));
    close(&mimic(3).unwrap(), &[-6.0, 0.8]); // position of c: 0.5 + 3 (0.1 − 2 a)
    assert!(said(&found).is_empty() && found.constraints().is_empty());
    // damping and efforts of followers act on the leader, with v_b = −2 v_a and v_c = −6 v_a
    close(found.damping(), &[1.0 + 4.0 + 36.0]);
    close(&effort(&found), &[-1.0 - 2.0 - 12.0, 2.0 + 2.0 + 6.0]);
    let circle = format!("{chain}<joint joint1='a' joint2='c'/>");
    let found = Model::from_mjcf_str(&text(&circle), &options).unwrap();
    assert_eq!((found.nv(), found.constraints().len()), (1, 1));
    let what = "joint1 follows another joint, or joint2 follows joint1: the joint is left free, and nothing enforces the coupling `joint3`";
    assert_eq!(said(&found), [format!("<string>:1: <joint>: {what}")]);
    let free = read(&text(chain)).unwrap();
    assert_eq!((free.nv(), free.constraints().len()), (3, 2));
    assert!(free.warnings().iter().all(|warning| warning.kind() == WarningKind::Mimic));
    let curve = read(&text("<joint name='e' joint1='b' joint2='a' polycoef='0 1 2'/>")).unwrap();
    let what = "polycoef 0 1 2 0 0 is not linear: the joint is left free, and nothing enforces the coupling `e`";
    assert_eq!(said(&curve), [format!("<string>:1: joint `e`: {what}")]);
    let constant = read(&text("<joint name='e' joint1='b'/>")).unwrap();
    let what = "the joint is left free: nothing enforces its constant position";
    assert_eq!(said(&constant), [format!("<string>:1: joint `e`: {what}")]);
}

/// Checks that the range of a follower limits its leader. With x = 2 q + 0.1, the range of x from −20° to 60° is the
/// range of q from −0.2245 to 0.4736.
#[test]
fn ranges_of_followers() {
    let text = "<mujoco><worldbody><body><joint name='a'/><geom size='1'/></body><body><joint name='b' range='-20 60'/>
        <geom size='1'/></body></worldbody><equality><joint joint1='b' joint2='a' polycoef='0.1 2'/></equality></mujoco>";
    let found = Model::from_mjcf_str(text, &MjcfOptions { mimic: true, ..MjcfOptions::default() }).unwrap();
    let ends = [-20f64, 60.0].map(|x| (x.to_radians() - 0.1) / 2.0);
    close(&[found.limits().lower[0], found.limits().upper[0]], &ends);
}

/// Compares the positions of keyframes with MuJoCo's `key_qpos`, and their velocities with `mj_objectVelocity` along
/// the body's axes.
#[test]
fn keyframes() {
    let ball = "<geom size='0.1'/>";
    let text = |keys: &str| {
        format!(
            "<mujoco><worldbody><body pos='1 2 3' quat='1 0 0 1'><freejoint/>{ball}<body><joint name='o' type='ball'/>{ball}
            <body><joint name='p' type='slide' ref='0.25'/>{ball}</body></body></body></worldbody><keyframe>{keys}</keyframe></mujoco>"
        )
    };
    let home = "<key name='home' qpos='1 2 3 2 0 0 2 0 0 0 3 0.5' qvel='1 2 3 4 5 6 7 8 9 10'/><key/>";
    let found = read(&text(home)).unwrap();
    let [home, second] = found.keyframes() else { panic!() };
    assert_eq!((home.name.as_str(), second.name.as_str()), ("home", "key1"));
    let half = 0.5f64.sqrt();
    close(&home.q, &[1.0, 2.0, 3.0, 0.0, 0.0, half, half, 0.0, 0.0, 1.0, 0.0, 0.5]);
    close(&home.v, &[2.0, -1.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    close(&second.q, &[1.0, 2.0, 3.0, 0.0, 0.0, half, half, 0.0, 0.0, 0.0, 1.0, 0.25]);
    assert_eq!(second.v, [0.0; 10]);
    let refused = |keys: &str, expected: &str| assert_eq!(read(&text(keys)).unwrap_err().to_string(), expected);
    refused("<key qpos='1 2'/>", "<string>:2: <key>: qpos: expected 12 numbers, found 2");
    refused("<key name='k' qvel='1'/>", "<string>:2: key `k`: qvel: expected 10 numbers, found 1");
    // as in MuJoCo, a list may be shorter and contain only the coordinates of the first joints
    let short = read(&text("<key name='k' qpos='1 2 3 2 0 0 2' qvel='0 0 0 0 0 1'/>")).unwrap();
    close(&short.keyframes()[0].q, &[1.0, 2.0, 3.0, 0.0, 0.0, half, half, 0.0, 0.0, 0.0, 1.0, 0.25]);
    close(&short.keyframes()[0].v, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let expected = "<string>:2: key `k`: qpos: has 7 of 12 numbers; the other joints are as drawn";
    assert_eq!(short.warnings()[0].to_string(), expected);
    refused("<key name='k'/><key name='k'/>", "<string>:2: key `k`: the name is taken by the key on line 2");
    // coordinates of followers are left out
    let hinges = format!(
        "<mujoco><worldbody><body><joint name='a'/>{ball}</body><body><joint name='b'/>{ball}</body></worldbody>
        <equality><joint joint1='a' joint2='b'/></equality><keyframe><key qpos='1 2' qvel='3 4'/></keyframe></mujoco>"
    );
    let found = Model::from_mjcf_str(&hinges, &MjcfOptions { mimic: true, ..MjcfOptions::default() }).unwrap();
    assert_eq!((&found.keyframes()[0].q[..], &found.keyframes()[0].v[..]), (&[2.0][..], &[4.0][..]));
}

/// Compares the controls of keyframes with MuJoCo's `key_ctrl` and `key_act`. The controls are at `actuator_ctrladr` 0,
/// 1, 2, 4, 5, 6, 8, 9, 12. The activations of integrators are at `actuator_actadr` 0 and 5.
#[test]
fn controls_of_keyframes() {
    let text = |actuators: &str, keys: &str| {
        let joints = format!("<joint name='j'/>{INERTIAL}</body><body><joint name='o' type='ball'/>");
        one("", &joints, &format!("<actuator>{actuators}</actuator><keyframe>{keys}</keyframe>"))
    };
    let all = "<motor joint='j'/><intvelocity joint='j' kp='2' actrange='-1 1'/><pid joint='j' kp='2'/>
        <muscle joint='j' lengthrange='0 1'/><position joint='j' timeconst='0.1'/><pid joint='j' ki='1' slewmax='1'/>
        <general joint='j' dyntype='integrator' actlimited='true' actrange='-1 1'/><orientation joint='o' kp='1'/><motor joint='j'/>";
    let numbers = "ctrl='1 2 3 4 5 6 7 8 9 10 11 12 13' act='0.1 0.2 0.3 0.4 0.5 0.6'";
    let found = read(&text(all, &format!("<key {numbers}/><key ctrl='1 2 3'/><key/>"))).unwrap();
    assert_eq!(found.actuators().len(), 7);
    close(&found.keyframes()[0].control, &[1.0, 0.1, 3.0, 6.0, 7.0, 0.6, 13.0]);
    close(&found.keyframes()[1].control, &[1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
    close(&found.keyframes()[2].control, &[0.0; 7]);
    let refused = |key: &str, expected: &str| assert_eq!(read(&text(all, key)).unwrap_err().to_string(), expected);
    let many = numbers.replace("13'", "13 14'");
    refused(&format!("<key {many}/>"), "<string>:3: <key>: ctrl: expected at most 13 numbers, found 14");
    refused("<key act='1 2 3 4 5 6 7'/>", "<string>:3: <key>: act: expected at most 6 numbers, found 7");
    // a plugin defines its number of activations itself
    let plugin = format!("<plugin joint='j' plugin='p'/>{all}");
    let found = read(&text(&plugin, &format!("<key {}/>", numbers.replace("'1 ", "'0 1 ")))).unwrap();
    close(&found.keyframes()[0].control, &[1.0, 0.0, 3.0, 6.0, 7.0, 0.0, 13.0]);
    let lost = "act: controls of integrators are left out, for the activations of an actuator before are not counted";
    assert!(said(&found).iter().any(|warning| warning.ends_with(lost)), "{:?}", said(&found));
}
