//! Tests of URDF: every element and attribute that changes the robot is read, or is reported in a warning or error.
#![allow(non_snake_case)]

mod mimics;

use condyle_model::{
    Error, Inertia, Joint, JointOptions, Model, ModelBuilder, SdfOptions, Se3, Sym3, UrdfOptions, Vec3, WORLD, Warning,
    WarningKind,
};

const INERTIAL: &str = "<inertial><origin xyz='0.1 0 0'/><mass value='2'/>
<inertia ixx='0.02' ixy='0' ixz='0' iyy='0.03' iyz='0' izz='0.04'/></inertial>";
const LIMIT: &str = "<limit lower='-1' upper='1' effort='3' velocity='2'/>";

/// Returns a robot with two links and a joint between them, and with additional content.
fn robot(kind: &str, joint: &str, more: &str) -> String {
    let ends = "<parent link='a'/><child link='b'/>";
    let links = format!("<link name='a'/><link name='b'>{INERTIAL}</link>");
    format!("<robot name='r'>{links}\n<joint name='j' type='{kind}'>{ends}{joint}</joint>\n{more}</robot>")
}

fn read(text: &str) -> Result<Model, Error> {
    Model::from_urdf_str(text, &UrdfOptions::default())
}

#[track_caller]
fn model(text: &str) -> Model {
    read(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Returns the warnings about a robot, without the name of the file.
#[track_caller]
fn warnings(text: &str) -> Vec<String> {
    model(text).warnings().iter().map(|w| w.to_string().replace("<string>:", "")).collect()
}

#[track_caller]
fn refused(text: &str, said: &str) {
    assert_eq!(read(text).unwrap_err().to_string(), format!("<string>:{said}"), "{text}");
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?}\n{expected:?}");
}

#[test]
fn plain_robots_have_no_warnings() {
    for (kind, inside) in [("revolute", LIMIT), ("continuous", ""), ("continuous", LIMIT), ("prismatic", LIMIT)] {
        assert!(warnings(&robot(kind, inside, "")).is_empty(), "{kind}");
    }
    for (kind, inside) in [("fixed", ""), ("floating", ""), ("planar", "<axis xyz='0 0 2'/>"), ("spherical", "")] {
        assert!(warnings(&robot(kind, inside, "")).is_empty(), "{kind}");
    }
}

/// Checks joints on a link `world` that the file does not contain: as in Drake 1.51.1, this link is the world. The
/// robot's mass is the mass of the moving link.
#[test]
fn joints_on_the_world() {
    let joint = "<joint name='j' type='revolute'><parent link='world'/><child link='b'/>";
    let text = format!("<robot name='r'><link name='b'>{INERTIAL}</link>\n{joint}{LIMIT}</joint></robot>");
    let said = "3: joint `j`: no link is named `world`: its parent is the world, as Drake reads it";
    assert_eq!(warnings(&text), [said]);
    let found = model(&text);
    let described = model(&text.replace("<link", "<link name='world'/><link"));
    assert_eq!((found.nv(), found.bodies().len(), found.bodies()[0].inertia.mass), (1, 2, 0.0));
    assert_eq!((found.bodies(), found.frames()), (described.bodies(), described.frames()));
    refused(
        &text.replace("<link", "<link name='c'/><link"),
        "1: link `c`: has no parent, and neither has link `world`: a robot has one root",
    );
    refused(&text.replace("world", "globe"), "3: joint `j`: no link is named `globe`");
    let turned = text.replace("'b'/>", "'world'/>").replacen("'world'", "'b'", 1);
    refused(&turned, "3: joint `j`: no link is named `world`");
}

#[test]
fn limits_without_a_number() {
    for kind in ["revolute", "prismatic"] {
        refused(&robot(kind, "\n<limit lower='-1' upper='1' velocity='3'/>", ""), "4: joint `j`: limit has no effort");
        refused(&robot(kind, "\n<limit lower='-1' upper='1' effort='3'/>", ""), "4: joint `j`: limit has no velocity");
        let efort = "\n<limit lower='-1' upper='1' efort='3' velocity='1'/>";
        refused(&robot(kind, efort, ""), "4: joint `j`: limit has no effort; nearest is `efort`");
        refused(&robot(kind, "", ""), "3: joint `j`: is revolute or prismatic and has no <limit>");
    }
    let limits = |limit: &str| {
        let model = model(&robot("continuous", limit, ""));
        (model.limits().velocity[0], model.limits().effort_lower[0], model.limits().effort_upper[0])
    };
    let inf = f64::INFINITY;
    assert_eq!(limits(""), (inf, -inf, inf));
    assert_eq!(limits("<limit/>"), (inf, -inf, inf));
    assert_eq!(limits("<limit velocity='3'/>"), (3.0, -inf, inf));
    assert_eq!(limits("<limit effort='3'/>"), (inf, -3.0, 3.0));
    assert_eq!(limits("<limit lower='-1' upper='1' effort='inf' velocity='3'/>"), (3.0, -inf, inf));
}

/// Checks that implausible limits only cause a warning, because existing robots have such limits and other readers
/// accept them.
#[test]
fn implausible_limits() {
    let said = |limit: &str| warnings(&robot("revolute", limit, ""));
    let odd = said("<limit effort='3' velocity='2'/>");
    assert_eq!(odd, ["joint `j`: both limits of position are 0: it cannot move"]);
    let odd = said("<limit lower='-1' upper='1' effort='0' velocity='0'/>");
    let expected = [
        "joint `j`: its limit of velocity is 0: it cannot move",
        "joint `j`: both limits of effort are 0: it cannot be driven",
    ];
    assert_eq!(odd, expected);
    let reversed = robot("revolute", "\n<limit lower='2' upper='-2' effort='1' velocity='1'/>", "");
    assert_eq!(model(&reversed).limits().upper, [f64::INFINITY]);
    let expected = ["4: joint `j`: lower limit 2 is above upper limit -2: its position has no limits"];
    assert_eq!(warnings(&reversed), expected);
    let negative = robot("revolute", "<limit lower='-1' upper='1' effort='-1' velocity='1'/>", "");
    assert_eq!(model(&negative).limits().effort(), [f64::INFINITY]);
    assert_eq!(warnings(&negative), ["3: joint `j`: limit effort is -1, below 0: it has no limit"]);
    let strict = UrdfOptions { strict: true, ..UrdfOptions::default() };
    assert!(matches!(Model::from_urdf_str(&negative, &strict), Err(Error::Strict { .. })));
}

#[test]
fn limits_warn_in_every_format() {
    let kinds = |model: &Model| model.warnings().iter().map(Warning::kind).collect::<Vec<_>>();
    let inertial = "<inertial><mass>1</mass></inertial>";
    let sdf = format!(
        "<sdf version='1.9'><model name='m'><link name='a'>{inertial}</link><link name='b'>{inertial}</link>
        <joint name='j' type='revolute'><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz>
        <limit><effort>0</effort></limit></axis></joint></model></sdf>"
    );
    let read = Model::from_sdf_str(&sdf, &SdfOptions::default()).unwrap();
    assert_eq!(read.limits().effort_upper, [0.0]);
    assert!(kinds(&read).contains(&WarningKind::Limit));
    let mut builder = ModelBuilder::new("m");
    let options = JointOptions { velocity: Some(0.0), effort: Some((-1.0, 0.0)), ..JointOptions::default() };
    let ball = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0));
    let joint = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
    builder.body_with(("b", "j"), WORLD, joint, Se3::identity(), ball, options);
    let built = builder.build().unwrap();
    assert_eq!(built.warnings()[0].to_string(), "joint `j`: its limit of velocity is 0: it cannot move");
    let mut limits = built.limits().clone();
    limits.velocity[0] = 1.0;
    assert!(built.with_limits(limits).unwrap().warnings().is_empty());
}

/// Checks that the limits of acceleration, deceleration and jerk of version 1.2 cause warnings, because a model cannot
/// represent them.
#[test]
fn limits_of_acceleration() {
    let with = |more: &str| robot("revolute", &LIMIT.replace("/>", &format!(" {more}/>")), "");
    assert!(warnings(&with("acceleration='inf'")).is_empty());
    for name in ["acceleration", "deceleration", "jerk", "drake:acceleration"] {
        assert_eq!(
            warnings(&with(&format!("{name}='4'"))),
            [format!("3: joint `j`: {name}: a model has no such limit")]
        );
    }
    refused(&with("jerk='x'"), "3: joint `j`: limit jerk: `x` is no number");
    let capsule = "<collision><geometry><capsule radius='1' length='2'/></geometry></collision></link>";
    let versioned = robot("revolute", LIMIT, "").replace("'r'", "'r' version='1.2'").replace("</link>", capsule);
    assert!(warnings(&versioned).is_empty());
}

/// Compares the pose of a body on a planar joint with X_WB in Drake 1.51. The body is moved by 1 m and 2 m along the
/// joint's x and y, and rotated by 0.3 about the joint's axis. The origin of the joint is at (1, 2, 3).
#[test]
fn planes_of_planar_joints() {
    let frame = |axis: &str| {
        let more = "<link name='tip'/><joint name='t' type='fixed'><parent link='b'/><child link='tip'/></joint>";
        let model = model(&robot("planar", &format!("<origin xyz='1 2 3' rpy='0.1 0 0'/>{axis}"), more));
        let (body, frame) = (&model.bodies()[1], model.frame("tip").unwrap());
        let jXb = Se3 {
            rotation: condyle_spatial::Quaternion::new(0.0, 0.0, 0.15f64.sin(), 0.15f64.cos()).to_rotation(),
            translation: Vec3::new(1.0, 2.0, 0.0),
        };
        let X = body.placement * jXb * model.frames()[frame].placement;
        [X.translation.to_array(), X.rotation.x.to_array(), X.rotation.z.to_array()].concat()
    };
    for (axis, expected) in PLANAR {
        close(&frame(axis), expected);
    }
    // the link's frame and the inertia in this frame do not change
    let tilted = model(&robot("planar", "<axis xyz='1 0 0'/>", ""));
    let link = &tilted.frames()[tilted.frame("b").unwrap()];
    let back = link.placement.inverse();
    let inertia = condyle_spatial::Act::act(&back, tilted.bodies()[1].inertia);
    close(&[inertia.rotational.xx, inertia.rotational.yy, inertia.rotational.zz], &[0.02, 0.05, 0.06]);
    let said = |axis: &str| warnings(&robot("planar", axis, ""));
    let pinocchio = "plane is normal to the axis (1, 0, 0); Pinocchio's is normal to z";
    assert_eq!(said("<axis xyz='2 0 0'/>"), [format!("3: joint `j`: its {pinocchio}")]);
    assert_eq!(said(""), [format!("3: joint `j`: no axis is given: its {pinocchio}")]);
    let limited =
        said("<axis xyz='0 0 1'/><dynamics damping='1 2 3'/><limit lower='0' upper='0' effort='0' velocity='0'/>");
    let unit = "its numbers have no unit for a joint with several degrees of freedom, and no effect";
    assert_eq!(limited, [format!("3: joint `j`: {unit}")]);
}

/// Expected poses: the axis of the joint, then the translation and the first and third column of the rotation.
const PLANAR: [(&str, &[f64]); 7] = [
    (
        "<axis xyz='1 0 0'/>",
        &[1.0, 4.08984174720288, 2.204662668015631, 1.0, 0.0, 0.0, 0.0, -0.38941834230865, 0.921060994002885],
    ),
    (
        "<axis xyz='0 1 0'/>",
        &[
            2.0,
            2.199666833293656,
            1.009991669443948,
            0.955336489125606,
            0.029502791919178,
            -0.294043836551856,
            0.29552020666134,
            -0.095374505756795,
            0.950563785922063,
        ],
    ),
    (
        "<axis xyz='0 0 1'/>",
        &[
            2.0,
            3.990008330556051,
            3.199666833293656,
            0.955336489125606,
            0.294043836551856,
            0.029502791919178,
            0.0,
            -0.099833416646828,
            0.995004165278026,
        ],
    ),
    (
        "<axis xyz='0 0 -1'/>",
        &[
            2.0,
            0.009991669443948,
            2.800333166706344,
            0.955336489125606,
            -0.294043836551856,
            -0.029502791919178,
            0.0,
            -0.099833416646828,
            0.995004165278026,
        ],
    ),
    (
        "<axis xyz='-0.6 0 0.8'/>",
        &[
            1.8,
            3.930108280567955,
            3.796669332460472,
            0.971415353040388,
            0.237375346468701,
            0.002270851444481,
            -0.021438485219709,
            0.078198093204697,
            0.996707303861386,
        ],
    ),
    (
        "<axis xyz='1 -2 -2'/>",
        &[
            3.000000000000001,
            1.900166583353172,
            3.995004165278026,
            0.960299101444984,
            -0.224582523084229,
            0.16549418747823,
            -0.206938695746314,
            -0.175619576400334,
            0.962462539836113,
        ],
    ),
    ("", &[1.0, 4.08984174720288, 2.204662668015631, 1.0, 0.0, 0.0, 0.0, -0.38941834230865, 0.921060994002885]),
];

#[test]
fn axes_of_fixed_joints() {
    assert_eq!(model(&robot("fixed", "<axis xyz='0 0 0'/>", "")).nv(), 0);
    assert_eq!(model(&robot("floating", "<axis xyz='a'/>", "")).nv(), 6);
    let unknown = "3: <axis>: unknown attribute `xzy`; nearest is `xyz`";
    assert_eq!(warnings(&robot("fixed", "<axis xzy='0 0 1'/>", "")), [unknown]);
    refused(&robot("continuous", "<axis xzy='0 0 1'/>", ""), "3: joint `j`: axis has no xyz; nearest is `xzy`");
    refused(&robot("continuous", "<axis xyz='0 0 0'/>", ""), "3: joint `j`: axis (0, 0, 0) is no direction");
}

#[test]
fn unknown_elements_and_attributes() {
    let said = |joint: &str, more: &str| warnings(&robot("continuous", joint, more));
    let cases = [
        (said("<axiss xyz='0 1 0'/>", ""), "3: <axiss>: unknown element <axiss> in <joint>; nearest is `axis`"),
        (said("<origin xzy='1 2 3'/>", ""), "3: <origin>: unknown attribute `xzy`; nearest is `xyz`"),
        (
            said("<dynamic damping='3'/>", ""),
            "3: <dynamic>: unknown element <dynamic> in <joint>; nearest is `dynamics`",
        ),
        (
            said("<dynamics><damping>3</damping></dynamics>", ""),
            "3: <damping>: misplaced element <damping> in <dynamics>",
        ),
        (said("<dynamics>3</dynamics>", ""), "3: <dynamics>: text `3` has no effect: values are attributes"),
        (said("", "<jont name='k'/>"), "4: jont `k`: unknown element <jont> in <robot>; nearest is `joint`"),
        (said("", "<inertial/>"), "4: <inertial>: misplaced element <inertial> in <robot>; nearest is `material`"),
        (said("<limit efort='3'/>", ""), "3: <limit>: unknown attribute `efort`; nearest is `effort`"),
        (said("<drake:dampng value='3'/>", ""), "3: <drake:dampng>: unknown element <drake:dampng> in <joint>"),
        (
            said("<dark:mimic joint='j'/>", ""),
            "3: <dark:mimic>: unknown element <dark:mimic> in <joint>; nearest is `mimic`",
        ),
        (
            said("<limit drake:aceleration='3'/>", ""),
            "3: <limit>: unknown attribute `drake:aceleration`; nearest is `drake:acceleration`",
        ),
        (
            said("", "<material name='m'>\n<inertial/></material>"),
            "5: <inertial>: misplaced element <inertial> in <material>",
        ),
    ];
    for (found, expected) in cases {
        assert_eq!(found, [expected]);
    }
}

/// Checks that known elements without effect on dynamics, kinematics and limits cause no warnings.
#[test]
fn elements_without_effect() {
    let joint = "<calibration rising='1'/><safety_controller k_velocity='10' k_position='15' soft_lower_limit='-1' \
                 soft_upper_limit='1'/><dynamics damping='0.1' friction='0.2'/>";
    let more = "<material name='m'><color rgba='1 0 0 1'/></material><mujoco><compiler meshdir='m'/></mujoco>
<gazebo reference='b'><kp>1</kp><mu1>1</mu1><material>x</material><gravity>1</gravity><sensor name='s' type='ray'/></gazebo>
<gazebo reference='j'><implicitSpringDamper>1</implicitSpringDamper><provideFeedback>1</provideFeedback></gazebo>
<gazebo><plugin filename='p' name='q'><a b='c'/></plugin><static>false</static></gazebo>
<sensor name='s'><parent link='b'/><camera/></sensor><ros2_control name='c' type='system'><hardware/></ros2_control>
<transmission name='t'><type>transmission_interface/SimpleTransmission</type><joint name='j'><hardwareInterface>
EffortJointInterface</hardwareInterface></joint><actuator name='m'><mechanicalReduction>1</mechanicalReduction></actuator>
</transmission><drake:collision_filter_group name='g'/>";
    let text = robot("continuous", joint, more).replace(
        "</link>",
        "<visual group='g'><geometry><box size='1 1 1'/></geometry></visual><collision name='c'><verbose value='1'/></collision>\
         <self_collision_checking/><contact><lateral_friction value='1'/></contact></link>",
    );
    assert!(warnings(&text).is_empty(), "{:?}", warnings(&text));
    assert_eq!((model(&text).damping()[0], model(&text).friction()[0]), (0.1, 0.2));
}

#[test]
fn entries_of_gazebo_that_change_the_robot() {
    let said = |entry: &str| warnings(&robot("continuous", "", &format!("<gazebo reference='b'>\n{entry}</gazebo>")));
    for (entry, what) in [
        ("<turnGravityOff>true</turnGravityOff>", "<turnGravityOff>: Gazebo's link has no weight, the model's does"),
        ("<gravity>0</gravity>", "<gravity>: Gazebo's link has no weight, the model's does"),
        ("<static>1</static>", "<static>: Gazebo does not move it, in the model it moves"),
        (
            "<springStiffness>5</springStiffness>",
            "<springStiffness>: Gazebo has a spring at the joint, the model does not",
        ),
        ("<inertial/>", "<inertial>: Gazebo adds it to the robot, the model does not have it"),
        ("<joint name='k' type='fixed'/>", "joint `k`: Gazebo adds it to the robot, the model does not have it"),
    ] {
        assert_eq!(said(entry), [format!("5: {what}")]);
    }
    assert!(said("<turnGravityOff>false</turnGravityOff><gravity>true</gravity>").is_empty());
    let link = robot("continuous", "", "").replace("</link>", "<contact><inertia_scaling value='3'/></contact></link>");
    let scaled = "2: <inertia_scaling>: Bullet scales the inertia of the link; it is read as it stands";
    assert_eq!(warnings(&link), [scaled]);
}

#[test]
fn rotors_of_transmissions() {
    let transmission = |inside: &str| format!("<transmission name='t'>\n<joint name='j'/>{inside}</transmission>");
    let armature = |inside: &str| model(&robot("continuous", "", &transmission(inside))).armature()[0];
    let reduction = "<mechanicalReduction>50</mechanicalReduction>";
    let actuator = |inside: &str| format!("<actuator name='m'>{inside}</actuator>");
    for (inside, expected) in [
        (actuator(&format!("{reduction}<rotorInertia>0.001</rotorInertia>")), 2.5),
        (actuator("<motorInertia>0.001</motorInertia>") + "<mechanicalReduction>-10</mechanicalReduction>", 0.1),
        (actuator("<drake:rotor_inertia value='0.01'/><drake:gear_ratio value='20'/>"), 4.0),
        (actuator("<drake:rotor_inertia value='0.01'/>"), 0.01),
        (actuator(""), 0.0),
    ] {
        let text = robot("continuous", "", &transmission(&inside));
        assert!((armature(&inside) - expected).abs() < 1e-12, "{inside}");
        assert!(warnings(&text).is_empty(), "{:?}", warnings(&text));
    }
    let said = |inside: &str| warnings(&robot("continuous", "", &transmission(inside)));
    let none = "4: transmission `t`: has a reduction of 50 and no rotor inertia: M has no inertia of the rotor";
    assert_eq!(said(&actuator(reduction)), [none]);
    let alone = "4: transmission `t`: has a rotor inertia of 0.001 kg m², but no reduction: M does not have it";
    assert_eq!(said(&actuator("<rotorInertia>0.001</rotorInertia>")), [alone]);
    let negative = "4: transmission `t`: has a rotor inertia of -1 kg m², which is below 0: M does not have it";
    assert_eq!(said(&actuator(&format!("{reduction}<rotorInertia>-1</rotorInertia>"))), [negative]);
    // Drake reads its own elements only inside an `<actuator>`
    let drakes = "<drake:rotor_inertia value='1'/>";
    assert_eq!(armature(drakes), 0.0);
    let misplaced = "5: <drake:rotor_inertia>: misplaced element <drake:rotor_inertia> in <transmission>";
    assert!(said(drakes)[0].starts_with(misplaced), "{:?}", said(drakes));
    let near =
        "5: <drake:gear_ratioo>: unknown element <drake:gear_ratioo> in <actuator>; nearest is `drake:gear_ratio`";
    assert_eq!(said(&actuator("<drake:rotor_inertia value='1'/><drake:gear_ratioo value='5'/>")), [near]);
    let coupled = "4: transmission `t`: it couples joints: M has no inertia of its rotors";
    assert_eq!(said(&format!("{}<joint name='k'/>", actuator(reduction))), [coupled]);
    let rotor = "<rotorInertia>1</rotorInertia><mechanicalReduction>2</mechanicalReduction>";
    let single = "its joint `j` has no single degree of freedom";
    for (kind, name, why) in [
        ("fixed", "j", single),
        ("floating", "j", single),
        ("continuous", "x", "no joint is named `x`"),
        ("continuous", "jj", "no joint is named `jj`; nearest is `j`"),
    ] {
        let text = transmission(&actuator(rotor)).replace("'j'", &format!("'{name}'"));
        let none = format!("{why}: M has no inertia of its rotor");
        let read = model(&robot(kind, "", &text));
        assert!(read.warnings().last().unwrap().to_string().ends_with(&none), "{:?}", read.warnings());
        assert!(read.armature().iter().all(|&x| x == 0.0));
    }
    let near = "5: <mechanicalReducton>: unknown element <mechanicalReducton> in <transmission>; nearest is `mechanicalReduction`";
    assert_eq!(said("<mechanicalReducton>50</mechanicalReducton>"), [near]);
}

#[test]
fn names_that_the_library_uses() {
    let free = UrdfOptions { root_joint: Some(Joint::FreeFlyer), ..UrdfOptions::default() };
    let named = robot("continuous", "", "").replace("'j'", "'root_joint'");
    let model = Model::from_urdf_str(&named, &free).unwrap();
    let joints: Vec<_> = model.bodies().iter().map(|b| &*b.joint_name).collect();
    assert_eq!(joints, ["universe", "root_joint_2", "root_joint"]);
    assert!(model.frame("root_joint_2").is_ok());
    let named = robot("continuous", "", "").replace("'j'", "'universe'").replace("'b'", "'universe'");
    for text in [&named, &named.replace("universe", "world")] {
        let model = Model::from_urdf_str(text, &free).unwrap();
        assert_eq!((model.nv(), model.warnings().len()), (7, 1)); // the root link has no mass
    }
    assert_eq!(Model::from_urdf_str(&named, &free).unwrap().bodies()[0].name, "universe_2");
}

#[test]
fn equal_elements_are_one() {
    let axis = "<axis xyz='0 1 0'/>";
    assert_eq!(model(&robot("continuous", &format!("{axis}{axis}"), "")).nv(), 1);
    // if an element occurs several times, the first one counts, as in urdfdom
    let two = robot("continuous", &format!("{axis}\n<axis xyz='1 0 0'/>"), "");
    assert_eq!(model(&two).bodies()[1].joint, Joint::Continuous { axis: Vec3::new(0.0, 1.0, 0.0) });
    assert_eq!(warnings(&two), ["4: joint `j`: a second <axis> is left out"]);
    let two = robot("continuous", "", "").replace("</link>", &format!("{}</link>", INERTIAL.replace("0.1", "0.2")));
    assert_eq!(warnings(&two), ["2: link `b`: a second <inertial> is left out"]);
    assert_eq!(model(&two).total_mass(), 2.0);
}

#[test]
fn inertias_that_are_not_complete() {
    let with = |inertial: &str| robot("continuous", "", "").replace(INERTIAL, inertial);
    let model = model(&with("<inertial><mass value='3'/><inertia ixx='1' iyy='1' izz='1'/></inertial>"));
    assert_eq!((model.bodies()[1].inertia.mass, model.bodies()[1].inertia.rotational), (3.0, Sym3::diagonal(1.0)));
    assert_eq!(model.warnings()[0].to_string(), "<string>:1: link `b`: its <inertial> has no ixy, ixz, iyz: 0");
    let said = warnings(&with("<inertial><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>"));
    let expected =
        ["body `b`: has no mass and a moment of inertia of 1e0 kg m²", "1: link `b`: its <inertial> has no mass: 0"];
    assert_eq!(said, expected);
    let said = warnings(&with("<inertial><mass value='1'/></inertial>"));
    assert_eq!(said[1], "1: link `b`: its <inertial> has no ixx, ixy, iyy, ixz, iyz, izz: 0");
}

#[test]
fn implausible_inertias() {
    let at = |mass: f64, moment: f64, com: Vec3<f64>| {
        let mut builder = ModelBuilder::new("m");
        let inertia = Inertia::from_com(mass, com, Sym3::diagonal(moment));
        let hinge = Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) };
        builder.body("b", WORLD, hinge, Se3::identity(), inertia);
        builder.build().unwrap().warnings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let of = |mass: f64, moment: f64| at(mass, moment, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(of(0.0, 1.0), ["body `b`: has no mass and a moment of inertia of 1e0 kg m²"]);
    let said = "body `b`: 0.5 kg and 1e6 kg m² are a radius of gyration of 1414 m, expected at most 100 m";
    assert_eq!(of(0.5, 1e6), [said]);
    assert!(of(1.0, 9999.0).is_empty());
    assert!(of(1e-6, 1e-6).is_empty());
    let said = "body `b`: 100000000000000000000 kg and 1e-1 kg m² are a radius of gyration of 3.2e-11 m, expected at least 1e-7 m";
    assert_eq!(at(1e20, 0.1, Vec3::zero()), [said]);
    assert!(at(1.0, 1e-12, Vec3::zero()).is_empty());
    assert!(of(1.0, 0.0).is_empty()); // a point mass causes no warning
}

/// Checks that the joints and frames that Drake adds to the format are read.
#[test]
fn extensions_of_drake() {
    let drakes = |kind: &str, inside: &str| {
        robot(kind, inside, "").replace("<joint", "<drake:joint").replace("</joint", "</drake:joint")
    };
    assert_eq!(model(&drakes("ball", "")).bodies()[1].joint, Joint::Spherical);
    assert_eq!(model(&drakes("planar", "<axis xyz='0 0 1'/>")).bodies()[1].joint, Joint::Planar);
    let screw = model(&drakes("screw", "<axis xyz='0 0 1'/><drake:screw_thread_pitch value='6.283185307179586'/>"));
    assert_eq!(screw.bodies()[1].joint, Joint::Helical { axis: Vec3::new(0.0, 0.0, 1.0), pitch: 1.0 });
    let losses = "<dynamics damping='0.5' friction='0.25'/>";
    for kind in ["ball", "universal"] {
        let text = drakes(kind, losses);
        let found = model(&text);
        assert!(found.damping().iter().all(|&x| x == 0.5) && found.friction().iter().all(|&x| x == 0.25), "{kind}");
        assert_eq!(warnings(&text), [""; 0]);
    }
    // Drake's universal joint ignores `<axis>`: it turns about x of the joint's frame, then about the new y
    let universal = model(&drakes("universal", "<origin xyz='1 2 3'/>"));
    let about = |x, y| Joint::Revolute { axis: Vec3::new(x, y, 0.0) };
    let bodies: Vec<_> = universal.bodies()[1..].iter().map(|b| (&*b.name, &*b.joint_name, b.joint)).collect();
    assert_eq!(bodies, [("b#1", "j#1", about(1.0, 0.0)), ("b", "j", about(0.0, 1.0))]);
    assert_eq!(universal.bodies()[1].placement.translation, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(universal.bodies()[2].placement, Se3::identity());
    let axis = "3: drake:joint `j`: it turns about x and y of its frame, as in Drake";
    assert_eq!(warnings(&drakes("universal", "<axis xyz='0 0 1'/>")), [axis]);
    refused(&drakes("univrsal", ""), "3: drake:joint `j`: type `univrsal` is none of ball, planar, screw, universal");
    let frame =
        |link: &str| robot("continuous", "", &format!("<frame name='f' link='{link}' xyz='1 2 3' rpy='0 0 0'/>"));
    let read = model(&frame("b"));
    let found = &read.frames()[read.frame("f").unwrap()];
    assert_eq!((found.body, found.placement.translation), (1, Vec3::new(1.0, 2.0, 3.0)));
    assert!(model(&frame("world")).frame("f").is_ok());
    refused(&frame("bb"), "4: frame `f`: no link is named `bb`; nearest is `b`");
    let loops = warnings(&robot("continuous", "", "<loop_joint name='l'/><drake:linear_bushing_rpy/>"));
    assert!(loops[0].ends_with("the loop is left open") && loops[1].contains("Drake applies its force"), "{loops:?}");
}
