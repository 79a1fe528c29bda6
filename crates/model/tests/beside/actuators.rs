//! Tests of MJCF: limits of effort, the list of actuators, classes of actuators, armature and damping.

use super::*;

/// Compares the limits of effort with the minimum and maximum of MuJoCo's `qfrc_actuator` at rest, over all controls.
#[test]
fn actuators_limit_effort() {
    const INF: f64 = f64::INFINITY;
    let limited = "<joint name='j' axis='0 1 0' actuatorfrcrange='-100 12'/>";
    let cases = [
        (HINGE, "<motor joint='j'/>", [-INF, INF]),
        (HINGE, "<motor joint='j' gear='50' forcerange='-3 3'/>", [-150.0, 150.0]),
        (HINGE, "<motor joint='j' gear='50' ctrlrange='-1 2'/>", [-50.0, 100.0]),
        (HINGE, "<motor joint='j' gear='-50' ctrlrange='-1 2'/>", [-100.0, 50.0]),
        (HINGE, "<motor joint='j' ctrlrange='-1 2' forcerange='-0.5 9'/>", [-0.5, 2.0]),
        (HINGE, "<motor jointinparent='j' ctrlrange='-1 2' forcelimited='false' forcerange='-9 9'/>", [-1.0, 2.0]),
        (HINGE, "<motor joint='j' ctrlrange='-1 2' ctrllimited='false'/>", [-INF, INF]),
        (HINGE, "<motor joint='j' ctrlrange='0 0' forcerange='0 0'/>", [-INF, INF]),
        (HINGE, "<motor joint='j' gear='0'/>", [0.0, 0.0]),
        (HINGE, "<general joint='j' gainprm='-4' ctrlrange='-1 2'/>", [-8.0, 4.0]),
        (HINGE, "<general joint='j' gainprm='2' biastype='affine' biasprm='3' ctrlrange='-1 2'/>", [1.0, 7.0]),
        // a servo has only its force limit, because its force depends on the length
        (HINGE, "<position joint='j' kp='100' ctrlrange='-1 1'/>", [-INF, INF]),
        (HINGE, "<position joint='j' kp='100' ctrlrange='-1 1' forcerange='-7 8' gear='2'/>", [-14.0, 16.0]),
        (HINGE, "<velocity joint='j' kv='100' ctrlrange='-1 1' forcerange='-7 8'/>", [-7.0, 8.0]),
        (HINGE, "<damper joint='j' kv='3' ctrlrange='0 1'/>", [-INF, INF]),
        (HINGE, "<cylinder joint='j' area='3' bias='1 0 0' ctrlrange='1 2'/>", [1.0, 7.0]),
        (HINGE, "<dcmotor joint='j' motorconst='0.1 0.4' resistance='2' saturation='0 5'/>", [-1.0, 1.0]),
        (HINGE, "<intvelocity joint='j' kp='7' inheritrange='1' forcerange='-3 4'/>", [-3.0, 4.0]),
        // the forces of several actuators are added, and the joint's range clips the sum
        (
            HINGE,
            "<motor joint='j' gear='-2' forcerange='-1 3'/><motor joint='j' gear='3' ctrlrange='-2 1'/>",
            [-12.0, 5.0],
        ),
        (limited, "<motor joint='j' gear='2' forcerange='-1 30'/>", [-2.0, 12.0]),
        (limited, "<motor joint='j'/>", [-100.0, 12.0]),
        (limited, "<motor joint='j' ctrlrange='-900 -200'/>", [-100.0, -100.0]),
        (limited, "<motor site='s' ctrlrange='-900 -200'/>", [-100.0, 12.0]),
        ("<joint name='j' axis='0 1 0' actuatorfrcrange='0 0'/>", "<motor joint='j'/>", [-INF, INF]),
    ];
    for (joint, actuators, expected) in cases {
        assert_eq!(effort(&driven(joint, actuators)), expected, "{actuators}");
    }
    let none = model("", HINGE, "");
    assert_eq!(effort(&none), [-INF, INF]); // no actuator limits the effort
    let off = model(
        "<option><flag clampctrl='disable'/></option>",
        HINGE,
        "<actuator><motor joint='j' ctrlrange='-1 1'/></actuator>",
    );
    assert_eq!(effort(&off), [-INF, INF]);
}

/// Compares the limits of effort for actuators on tendons with MuJoCo's `qfrc_actuator`. The force of such an actuator
/// is clipped to the tendon's range, then to the actuator's range.
#[test]
fn tendons_limit_effort() {
    let tendon = "<tendon><fixed name='t' actuatorfrcrange='-3 3'><joint joint='j' coef='-2'/></fixed></tendon>";
    let joint = "<joint name='j' axis='0 1 0' actuatorfrcrange='-100 12'/>";
    let motors = "<motor joint='j' gear='2' forcerange='-1 3'/><motor tendon='t' gear='5' forcerange='-4 9'/>";
    let found = model("", joint, &format!("{tendon}<actuator>{motors}</actuator>"));
    assert_eq!(effort(&found), [-32.0, 12.0]);
    let Transmission::Tendon { name, joints } = &found.actuators()[1].transmission else { panic!() };
    assert_eq!((name.as_str(), &joints[..]), ("t", &[(1, -2.0)][..]));
    assert_eq!(found.actuators()[1].force, (-3.0, 3.0)); // range of `actuator_force`, for any gear
    assert!(said(&found).is_empty());
    let shared =
        model("", joint, &format!("{tendon}<actuator>{}</actuator>", "<motor tendon='t' ctrlrange='-9 9'/>".repeat(2)));
    assert_eq!(effort(&shared), [-36.0, 12.0]);
    assert_eq!(shared.actuators()[0].force, (f64::NEG_INFINITY, f64::INFINITY));
    let what = "actuatorfrcrange: it limits neither actuators nor efforts, for several actuators share the tendon";
    assert_eq!(said(&shared), [format!("<string>:1: fixed `t`: {what}")]);
}

/// Checks actuators of ball joints, whose gear is an axis, and of free joints, whose limits of effort are only along
/// the axes of the body.
#[test]
fn balls_and_free_joints() {
    let ball = driven("<joint name='j' type='ball'/>", "<motor joint='j' gear='1 -2 0' ctrlrange='-3 4'/>");
    assert_eq!(ball.limits().effort_lower, [-3.0, -8.0, f64::NEG_INFINITY]);
    assert_eq!(ball.limits().effort_upper, [4.0, 6.0, f64::INFINITY]);
    assert_eq!(ball.actuators()[0].gear, [1.0, -2.0, 0.0, 0.0, 0.0, 0.0]);
    let free = driven("<freejoint name='j'/>", "<motor joint='j' gear='1 0 0 0 2 0' ctrlrange='-3 4'/>");
    assert_eq!(free.limits().effort_upper[..4], [f64::INFINITY; 4]);
    assert_eq!(free.limits().effort_upper[4], 8.0);
    let parent = driven("<joint name='j' type='ball'/>", "<motor name='m' jointinparent='j' ctrlrange='-3 4'/>");
    let what = "it is left out of the table of actuators: its axis is fixed in the parent of a ball or free joint";
    assert_eq!(said(&parent), [format!("<string>:1: motor `m`: {what}")]);
    assert!(parent.actuators().is_empty());
}

/// Compares the force laws of actuators with MuJoCo's `actuator_gainprm` and `actuator_biasprm`.
#[test]
fn laws_of_actuators() {
    let cases = [
        // the expected numbers are gain, bias, kp and kv
        ("<motor joint='j'/>", [1.0, 0.0, 0.0, 0.0]),
        ("<position joint='j'/>", [1.0, 0.0, 1.0, 0.0]),
        ("<position joint='j' kp='100' kv='10'/>", [100.0, 0.0, 100.0, 10.0]),
        ("<position joint='j' kp='7' dampratio='0.5'/>", [7.0, 0.0, 7.0, 0.591607978309961_6]),
        ("<position joint='j' kp='7' dampratio='0.5' gear='3'/>", [7.0, 0.0, 7.0, 0.197202659436653_86]),
        ("<velocity joint='j' kv='3'/>", [3.0, 0.0, 0.0, 3.0]),
        ("<general joint='j' gainprm='5 1' biastype='affine' biasprm='1 -2 -3'/>", [5.0, 1.0, 2.0, 3.0]),
        ("<general joint='j' gainprm='5' biasprm='1 -2 -3'/>", [5.0, 0.0, 0.0, 0.0]),
        ("<pid joint='j' kp='2' kv='3' input='pos'/>", [2.0, 0.0, 2.0, 3.0]),
        ("<dcmotor joint='j' motorconst='0.1' resistance='2'/>", [0.05, 0.0, 0.0, 0.005]),
        ("<dcmotor joint='j' motorconst='0.1 0.4' resistance='2'/>", [0.1, 0.0, 0.0, 0.02]),
        ("<dcmotor joint='j' nominal='24 10 100'/>", [0.24 / 0.576, 0.0, 0.0, 0.24 * 0.24 / 0.576]),
        ("<dcmotor joint='j' nominal='24 10 100' damping='0.01'/>", [0.216 / 0.5184, 0.0, 0.0, 0.09]),
    ];
    for (actuator, expected) in cases {
        let found = driven(HINGE, actuator);
        let a = &found.actuators()[0];
        close(&[a.gain, a.bias, a.kp, a.kv], &expected);
        assert!(said(&found).is_empty(), "{actuator}");
    }
    let found = driven(HINGE, "<position name='servo' joint='j' inheritrange='0.5' forcerange='-2 3'/>");
    let a = &found.actuators()[0];
    assert_eq!((a.name.as_str(), a.force), ("servo", (-2.0, 3.0)));
    close(&[a.control.0, a.control.1], &[-0.1308996938995747, 0.6544984694978735]);
    assert!(matches!(a.transmission, Transmission::Joint { body: 1 }));
    let site = driven(HINGE, "<motor site='s' gear='0 0 1'/>");
    let Transmission::Frame { frame } = site.actuators()[0].transmission else { panic!() };
    assert_eq!(site.frames()[frame].name, "s");
}

/// Compares inherited parameters with MuJoCo's `actuator_gainprm`, `actuator_biasprm`, `actuator_gear` and
/// `actuator_ctrlrange`, for actuators that specify no parameters. An actuator inherits its force law from the
/// innermost class whose last default has the same kind or is `<general>`. All other attributes are inherited from any
/// class.
#[test]
fn classes_of_actuators() {
    let servo = "<position kp='100' kv='10'/>";
    let general = "<general gainprm='100 2' biasprm='6 -100 -5' biastype='affine'/>";
    let inner = |inside: &str| format!("{servo}<default class='x'>{inside}</default>");
    let cases = [
        (servo.to_owned(), "<position joint='j'/>", [100.0, 0.0, 100.0, 10.0]),
        (servo.to_owned(), "<position joint='j' kv='1'/>", [100.0, 0.0, 100.0, 1.0]),
        (servo.to_owned(), "<general joint='j'/>", [100.0, 0.0, 100.0, 10.0]),
        (servo.to_owned(), "<velocity joint='j'/>", [1.0, 0.0, 0.0, 1.0]),
        (format!("{servo}<motor/>"), "<position joint='j'/>", [1.0, 0.0, 1.0, 0.0]),
        (format!("{servo}<general gainprm='7'/>"), "<position joint='j'/>", [7.0, 0.0, 7.0, 10.0]),
        (format!("<motor/>{servo}"), "<position joint='j'/>", [100.0, 0.0, 100.0, 10.0]),
        (general.to_owned(), "<general joint='j'/>", [100.0, 6.0, 100.0, 5.0]),
        (general.to_owned(), "<motor joint='j'/>", [1.0, 0.0, 0.0, 0.0]),
        (general.to_owned(), "<velocity joint='j'/>", [100.0, 0.0, 0.0, 100.0]),
        (general.to_owned(), "<pid joint='j' input='pos'/>", [1.0, 0.0, 1.0, 0.0]),
        (inner("<position kp='5'/>"), "<position joint='j' class='x'/>", [5.0, 0.0, 5.0, 10.0]),
        (inner("<velocity kv='5'/>"), "<position joint='j' class='x'/>", [100.0, 0.0, 100.0, 10.0]),
        (inner("<velocity kv='5'/>"), "<general joint='j' class='x'/>", [5.0, 0.0, 0.0, 5.0]),
        (
            "<dcmotor motorconst='0.1' resistance='2'/>".to_owned(),
            "<dcmotor joint='j' resistance='4'/>",
            [0.025, 0.0, 0.0, 0.0025],
        ),
    ];
    for (class, actuator, expected) in cases {
        let found = model(&format!("<default>{class}</default>"), HINGE, &format!("<actuator>{actuator}</actuator>"));
        let a = &found.actuators()[0];
        close(&[a.gain, a.bias, a.kp, a.kv], &expected);
    }
    // a list of numbers in an element may be shorter than the list in its class
    let shared = "<default><motor gear='5 0 1' ctrlrange='-1 1' armature='0.1'/></default>";
    let found = model(shared, HINGE, "<actuator><position joint='j' gear='2'/></actuator>");
    assert_eq!(found.actuators()[0].gear, [2.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!((found.actuators()[0].control, found.armature()), ((-1.0, 1.0), &[0.4][..]));
    let joints = "<default><joint stiffness='1 2 3' damping='4 5 6'/></default>";
    let found = model(joints, "<joint name='j' axis='0 1 0' stiffness='7' damping='8'/>", "");
    assert_eq!((found.springs()[0].stiffness, found.damping()), ([7.0, 2.0, 3.0], &[8.0][..]));
    assert_eq!(found.damping_polynomial(), [[5.0, 6.0]]);
    // a list in a nested class may be shorter than the list in the outer class, and an empty attribute is treated as
    // missing
    let nested = |outer: &str, inner: &str, own: &str| {
        let class = format!("<default class='y'><joint {inner}/></default>");
        let before = format!("<default><default class='x'><joint {outer}/>{class}</default></default>");
        model(&before, &format!("<joint name='j' class='y' axis='0 1 0' {own}/>"), "")
    };
    let damping = |found: &Model| (found.damping()[0], found.damping_polynomial()[0]);
    assert_eq!(damping(&nested("damping='2 3 4'", "damping='5'", "")), (5.0, [3.0, 4.0]));
    assert_eq!(damping(&nested("damping='2 3 4'", "damping=''", "")), (2.0, [3.0, 4.0]));
    assert_eq!(damping(&nested("damping='2 3 4'", "damping='5 6'", "damping='7'")), (7.0, [6.0, 4.0]));
    assert_eq!(nested("armature='0.3'", "armature=''", "armature=' '").armature(), [0.3]);
    assert_eq!(nested("range='-1 1'", "range=''", "").limits().upper, [1f64.to_radians()]);
    // the square of the gear is infinite, so the actuator adds neither damping nor armature
    let found = driven(HINGE, "<motor joint='j' gear='1e300'/>");
    assert_eq!((found.damping(), found.armature()), (&[0.0][..], &[0.0][..]));
}

/// Compares the inertia matrix M and damping forces with MuJoCo's `mj_fullM` and `qfrc_damper`: armature and damping of
/// an actuator are multiplied by gear².
#[test]
fn armature_and_damping_of_actuators() {
    let found = driven(
        "<joint name='j' axis='0 1 0' armature='0.1' damping='0.5'/>",
        "<motor joint='j' gear='10 2' armature='0.01' damping='1 2 3'/><motor joint='j' gear='-3' armature='0.02' damping='1'/>",
    );
    close(found.armature(), &[0.1 + 1.0 + 0.18]);
    close(found.damping(), &[0.5 + 100.0 + 9.0]);
    close(found.damping_polynomial().as_flattened(), &[200.0, 300.0]);
    let ball =
        driven("<joint name='j' type='ball'/>", "<motor joint='j' gear='4 2 3' armature='0.01' damping='1 2 3'/>");
    close(ball.armature(), &[0.16; 3]);
    close(ball.damping(), &[16.0; 3]);
    let free = driven(
        "<joint name='j' type='free' damping='1 2' frictionloss='2'/>",
        "<motor joint='j' gear='4' damping='0.5'/>",
    );
    close(free.damping(), &[9.0; 6]);
    close(free.friction(), &[2.0; 6]);
    assert_eq!(free.damping_polynomial(), [[2.0, 0.0]; 6]);
    let tendon = "<tendon><fixed name='t' armature='0.5' damping='0.1'><joint joint='j' coef='2'/></fixed></tendon>";
    let motor = "<actuator><motor tendon='t' gear='10' armature='0.01' damping='1 2 3'/></actuator>";
    let found = model("", HINGE, &format!("{tendon}{motor}"));
    close(found.armature(), &[4.0 * (0.5 + 1.0)]);
    close(found.damping(), &[4.0 * (0.1 + 100.0)]);
    close(found.damping_polynomial().as_flattened(), &[8.0 * 200.0, 16.0 * 300.0]);
}

/// Checks that every effect of an actuator that a model cannot represent causes a warning with the element and the
/// effect.
#[test]
fn lost_features_of_actuators_warn() {
    let cases = [
        ("<muscle joint='j' lengthrange='0 1'/>", "muscle", "it is left out of the table of actuators: it is a muscle"),
        (
            "<damper joint='j' kv='1' ctrlrange='0 1'/>",
            "damper",
            "it is left out of the table of actuators: its gain depends on length or velocity",
        ),
        (
            "<adhesion body='b' ctrlrange='0 1'/>",
            "adhesion",
            "it is left out of the table of actuators: it acts on contacts of a body",
        ),
        (
            "<motor site='s' refsite='s'/>",
            "motor",
            "it is left out of the table of actuators: it drives a site against another one",
        ),
        (
            "<motor cranksite='s' slidersite='s' cranklength='1'/>",
            "motor",
            "it is left out of the table of actuators: it drives a slider and a crank",
        ),
        (
            "<position joint='j' timeconst='0.1'/>",
            "position",
            "its activation is not filtered: it follows the control at once",
        ),
        (
            "<intvelocity joint='j'/>",
            "intvelocity",
            "its control is not integrated: the control is the activation itself",
        ),
        ("<pid joint='j'/>", "pid", "its setpoint of velocity and its feedforward are left out"),
        (
            "<pid joint='j' ki='1' input='pos'/>",
            "pid",
            "its integral and the limit of its setpoint's rate are left out",
        ),
        (
            "<plugin joint='j' plugin='p' ctrlrange='-1 1'/>",
            "plugin",
            "it is left out of the table of actuators: it is a plugin",
        ),
        ("<motor joint='j' delay='0.01' nsample='5'/>", "motor", "delay: the control acts at once"),
        ("<dcmotor joint='j' motorconst='1' resistance='1' cogging='1 2 3'/>", "dcmotor", "cogging"),
    ];
    for (actuator, element, what) in cases {
        let found = driven(HINGE, actuator);
        assert_eq!(found.warnings().len(), 1, "{actuator}");
        let Warning::LeftOut { element: of, what: why, .. } = &found.warnings()[0] else { panic!() };
        assert_eq!(of, &format!("<{element}>"));
        assert!(why.starts_with(what), "{why}");
    }
    let yields = model("", "<joint stiffness='1' springyield='2'/>", "");
    assert_eq!(said(&yields), ["<string>:1: <joint>: springyield: the spring does not yield, however far it is moved"]);
}
