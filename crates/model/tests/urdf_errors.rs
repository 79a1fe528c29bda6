//! Tests of mistakes in a URDF or in calls of a builder: each mistake has its own message, with line and element.

use condyle_model::{
    Error, Inertia, Joint, JointOptions, Mimic, Model, ModelBuilder, Se3, Sym3, UrdfOptions, Vec3, WORLD,
};

const GOOD: &str = r#"<robot name="r">
  <link name="base"/>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <joint name="j" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>"#;

/// Returns the text of the robot, in which `what` is replaced by `by`.
fn with(what: &str, by: &str) -> String {
    assert_eq!(GOOD.matches(what).count(), 1, "{what}");
    GOOD.replace(what, by)
}

fn load(text: &str, options: &UrdfOptions) -> Result<Model, String> {
    Model::from_urdf_str(text, options).map_err(|e| e.to_string())
}

#[track_caller]
fn expect(text: &str, message: &str) {
    assert_eq!(load(text, &UrdfOptions { mimic: true, ..UrdfOptions::default() }).unwrap_err(), message);
}

#[test]
fn the_robot_is_good() {
    let model = load(GOOD, &UrdfOptions::default()).unwrap();
    assert_eq!((model.nq(), model.nv(), model.total_mass()), (1, 1, 1.0));
}

#[test]
fn files() {
    let error = Model::from_urdf("no/such.urdf", &UrdfOptions::default()).unwrap_err();
    assert!(matches!(error, Error::File { .. }));
    assert_eq!(error.to_string(), "no/such.urdf: No such file or directory (os error 2)");
    let error = Model::from_urdf(GOOD, &UrdfOptions::default()).unwrap_err().to_string();
    let reads = "is the text of a file, where its path is expected: the function whose name ends in `_str` reads it";
    assert!(error.starts_with("`<") && error.ends_with(&format!("…`: {reads}")) && error.len() < 200, "{error}");
    let reads = "this is a path: the function whose name does not end in `_str` reads the file";
    expect("no/such.urdf", &format!("<string>:1: not well-formed XML: {reads}"));
    let path = std::env::temp_dir().join(format!("condyle-{}.urdf", std::process::id()));
    std::fs::write(&path, with(r#"<child link="arm"/>"#, "")).unwrap();
    let error = Model::from_urdf(&path, &UrdfOptions::default()).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(error, format!("{}:6: joint `j`: has no child", path.display()));
}

#[test]
fn documents() {
    expect("", "<string>:1: not well-formed XML: there is no element");
    expect("\nrobot", "<string>:2: not well-formed XML: text outside of the root element");
    expect("\n<robot>\n<link name='a'>\n", "<string>:4: not well-formed XML: <link> of line 3 is never closed");
    expect("<!-- no robot -->\n<sdf/>", "<string>:2: <sdf>: the root element of a URDF is <robot>");
    expect("<robot/>", "<string>:1: <robot>: has no links");
    let nested = format!("<robot>\n<link name='a'>{}{}</link></robot>", "<a>".repeat(1 << 16), "</a>".repeat(1 << 16));
    expect(&nested, "<string>:2: <a>: elements are nested 65538 deep, at most 256 are allowed");
}

/// Checks that unexpanded macros of xacro are an error, because ignoring macros would give another robot.
#[test]
fn xacro() {
    let expand = "expand the file first (`xacro robot.urdf.xacro > robot.urdf`)";
    let open = GOOD.find('>').map(|end| GOOD[..end].to_owned()).unwrap();
    let declared = with(&open, &format!("{open} xmlns:xacro='http://www.ros.org/wiki/xacro'"));
    assert!(load(&declared, &UrdfOptions::default()).is_ok()); // expanded files often declare the namespace of xacro
    let used = declared.replace("</robot>", "<xacro:wheel side='left'/>\n</robot>");
    let error = load(&used, &UrdfOptions::default()).unwrap_err();
    assert!(error.ends_with(&format!(": <xacro:wheel>: belongs to xacro: {expand}")), "{error}");
    let error = load(&with(r#"<mass value="1"/>"#, r#"<mass value="${m}"/>"#), &UrdfOptions::default()).unwrap_err();
    assert!(error.ends_with(&format!("`${{m}}` is an expression of xacro: {expand}")), "{error}");
}

#[test]
fn names() {
    let base = r#"<link name="base"/>"#;
    expect(&with(base, "<link/>"), "<string>:2: <link>: has no name");
    expect(&with(base, "<link name=''/>"), "<string>:2: <link>: has no name");
    expect(&with(r#"<joint name="j""#, "<joint"), "<string>:6: <joint>: has no name");
    expect(&with(base, r#"<link name="arm"/>"#), "<string>:3: link `arm`: the name is taken by the link on line 2");
    let second = r#"<joint name="j" type="fixed"><parent link="base"/><child link="arm"/></joint></robot>"#;
    expect(&with("</robot>", second), "<string>:12: joint `j`: the name is taken by the joint on line 6");
}

#[test]
fn trees() {
    let (parent, child) = (r#"<parent link="base"/>"#, r#"<child link="arm"/>"#);
    expect(
        &with(parent, r#"<parent link="bace"/>"#),
        "<string>:6: joint `j`: no link is named `bace`; nearest is `base`",
    );
    expect(&with(child, r#"<child link="harm"/>"#), "<string>:6: joint `j`: no link is named `harm`; nearest is `arm`");
    expect(&with(child, ""), "<string>:6: joint `j`: has no child");
    expect(&with(parent, ""), "<string>:6: joint `j`: has no parent");
    expect(&with(parent, "<parent/>"), "<string>:7: joint `j`: parent has no link");
    let two = r#"<joint name="k" type="fixed"><parent link="base"/><child link="arm"/></joint></robot>"#;
    expect(&with("</robot>", two), "<string>:12: joint `k`: link `arm` is already the child of joint `j`");
    let cycle = r#"<joint name="k" type="fixed"><parent link="arm"/><child link="base"/></joint></robot>"#;
    expect(&with("</robot>", cycle), "<string>:6: joint `j`: is part of a cycle: every link has a parent");
    let itself = with(parent, r#"<parent link="arm"/>"#);
    expect(&itself, "<string>:6: joint `j`: is part of a cycle that does not reach the root");
    let other = "<string>:12: link `other`: has no parent, and neither has link `base`: a robot has one root";
    expect(&with("</robot>", r#"<link name="other"/></robot>"#), other);
}

#[test]
fn joints() {
    let axis = r#"<axis xyz="0 0 1"/>"#;
    expect(&with(axis, r#"<axis xyz="0 0 0"/>"#), "<string>:6: joint `j`: axis (0, 0, 0) is no direction");
    expect(&with(axis, r#"<axis xyz="0 nan 1"/>"#), "<string>:9: joint `j`: axis xyz: `nan` is no finite number");
    expect(&with(axis, r#"<axis xyz="0 1"/>"#), "<string>:9: joint `j`: axis xyz: expected 3 numbers, found 2");
    expect(&with(axis, r#"<axis xyz="0 x 0 1"/>"#), "<string>:9: joint `j`: axis xyz: `x` is no finite number");
    expect(&with(axis, "<axis/>"), "<string>:9: joint `j`: axis has no xyz");
    let origin = |what: &str, value: &str| format!(r#"<origin {what}="{value}"/>"#);
    let said = "is no finite number";
    expect(&with(axis, &origin("xyz", "0 inf 0")), &format!("<string>:9: joint `j`: origin xyz: `inf` {said}"));
    expect(&with(axis, &origin("rpy", "nan 0 0")), &format!("<string>:9: joint `j`: origin rpy: `nan` {said}"));
    let versioned = |version: &str, value: &str| {
        let version = format!(r#"<robot name="r" version="{version}">"#);
        with(axis, &origin("quat_xyzw", value)).replace(r#"<robot name="r">"#, &version)
    };
    let (at, unit) = ("<string>:9: joint `j`: origin", "1 0 0 0");
    let unknown = format!("{at} has quat_xyzw, which version 1.0 does not know: expected <robot version=\"1.1\">");
    expect(&with(axis, &origin("quat_xyzw", unit)), &unknown);
    expect(&versioned("1.0", unit), &unknown);
    expect(&versioned("1.1", "1 1 0 0"), &format!("{at} quat_xyzw: has the length 1.4142135623730951, expected 1"));
    expect(&versioned("1.1", "0 0 0 0"), &format!("{at} quat_xyzw: has the length 0, expected 1"));
    expect(&versioned("1.2", "1 0 0"), &format!("{at} quat_xyzw: expected 4 numbers, found 3"));
    let both = versioned("1.1", unit).replace("quat_xyzw=", r#"rpy="0 0 0" quat_xyzw="#);
    expect(&both, &format!("{at} has both rpy and quat_xyzw"));
    for version in ["2.0", "1.3", "", "one"] {
        expect(
            &versioned(version, unit),
            &format!("<string>:1: robot `r`: version `{version}` is none of 1.0, 1.1, 1.2"),
        );
    }
    let fixed = with("revolute", "fixed").replace(axis, &origin("rpy", "nan 0 0"));
    expect(&fixed, &format!("<string>:9: joint `j`: origin rpy: `nan` {said}"));
    let kinds = "revolute, continuous, prismatic, fixed, floating, planar, spherical";
    expect(&with("revolute", "rotary"), &format!("<string>:6: joint `j`: type `rotary` is none of {kinds}"));
    expect(&with(r#"type="revolute""#, ""), "<string>:6: joint `j`: joint has no type");
}

#[test]
fn limits() {
    let lower = r#"lower="-1""#;
    for value in ["nan", "one", "", "1 2"] {
        let said = format!("<string>:10: joint `j`: limit lower: `{value}` is no number");
        expect(&with(lower, &format!(r#"lower="{value}""#)), &said);
    }
    let damping = |value: &str| with("<axis", &format!(r#"<dynamics damping="{value}"/><axis"#));
    expect(&damping("nan"), "<string>:9: joint `j`: dynamics damping: `nan` is no finite number");
    expect(&damping("inf"), "<string>:9: joint `j`: dynamics damping: `inf` is no finite number");
}

#[test]
fn inertias() {
    let mass = r#"<mass value="1"/>"#;
    expect(&with(mass, r#"<mass value="-1"/>"#), "<string>:3: link `arm`: mass is -1 kg");
    let said = |what: &str| format!("<string>:4: link `arm`: {what}");
    expect(&with(mass, r#"<mass value="1 kg"/>"#), &said("mass value: `kg` is no finite number"));
    expect(&with(mass, r#"<mass value="1 2"/>"#), &said("mass value: expected 1 number, found 2"));
    expect(&with(mass, r#"<mass value="nan"/>"#), &said("mass value: `nan` is no finite number"));
    expect(&with(r#"ixx="1""#, r#"ixx="inf""#), &said("inertia ixx: `inf` is no finite number"));
    let origin = r#"<mass value="1"/><origin xyz="0 nan 0"/>"#;
    expect(&with(mass, origin), &said("origin xyz: `nan` is no finite number"));
    let far = r#"<mass value="1"/><origin xyz="0 1e200 0"/>"#;
    expect(&with(mass, far), "<string>:3: link `arm`: inertia is not finite");
    let large = "has a mass, inertia, length, ratio or acceleration of 2e40, at most 1e30 is allowed";
    expect(&with(mass, r#"<mass value="2e40"/>"#), &format!("<string>:3: link `arm`: {large}"));
}

/// Checks XML's rules for names in attributes: a line break or tab becomes a space, and a character reference becomes
/// its character.
#[test]
fn names_in_any_spelling() {
    let spaced = GOOD.replace(r#""j""#, "\"a\tj\"").replace(r#""arm""#, "\"an\narm\"");
    let model = load(&spaced, &UrdfOptions::default()).unwrap();
    assert_eq!((model.bodies()[1].joint_name.as_str(), model.bodies()[1].name.as_str()), ("a j", "an arm"));
    // a tab given as a character reference is kept, and a name with character references denotes the same link
    let written = GOOD.replace(r#"link="arm""#, r#"link="&#97;r&#x6d;""#).replace(r#""j""#, r#""j&#9;&lt;&quot;é""#);
    let model = load(&written, &UrdfOptions::default()).unwrap();
    assert_eq!((model.bodies()[1].joint_name.as_str(), model.bodies()[1].name.as_str()), ("j\t<\"é", "arm"));
    let same = with(r#"<link name="base"/>"#, "<link name=\"base\"/><link name=\"a b\"/>\n<link name=\"a\nb\"/>");
    expect(&same, "<string>:3: link `a b`: the name is taken by the link on line 2");
    let unknown = with(r#"<child link="arm"/>"#, "<child link=\"ar\nm\"/>");
    expect(&unknown, "<string>:6: joint `j`: no link is named `ar m`; nearest is `arm`");
}

#[test]
fn mimics() {
    let mimic = |what: &str| with("<axis", &format!("<mimic {what}/><axis"));
    expect(&mimic(r#"joint="nobody""#), "<string>:6: joint `j`: mimics `nobody`: no joint is named `nobody`");
    expect(&mimic(r#"joint="j""#), "<string>:6: joint `j`: mimics itself, alone or by way of others");
    let nan = "<string>:9: joint `j`: mimic multiplier: `nan` is no finite number";
    expect(&mimic(r#"joint="j" multiplier="nan""#), nan);
    expect(&mimic(""), "<string>:9: joint `j`: mimic has no joint");
    assert!(load(&mimic(r#"joint="nobody""#), &UrdfOptions::default()).is_ok()); // the option `mimic` is not set
}

/// Checks the followers of a continuous joint: the ratio must be an integer, and the follower must not be prismatic.
#[test]
fn continuous_leaders() {
    let leader = r#"<link name="wheel"/><joint name="lead" type="continuous"><parent link="base"/><child link="wheel"/></joint></robot>"#;
    let follow = |ratio: &str, kind: &str| {
        let text = with("</robot>", leader).replace("revolute", kind);
        text.replace("<axis", &format!(r#"<mimic joint="lead" multiplier="{ratio}"/><axis"#))
    };
    let turns = "a continuous joint's position is known up to whole turns only";
    let fraction = format!("<string>:6: joint `j`: mimic ratio 0.5 is not a whole number, and {turns}");
    expect(&follow("0.5", "revolute"), &fraction);
    expect(&follow("0.5", "continuous"), &fraction);
    let slide = format!("<string>:6: joint `j`: a slide or screw cannot follow a continuous joint: {turns}");
    expect(&follow("2", "prismatic"), &slide);
    let mimic = UrdfOptions { mimic: true, ..UrdfOptions::default() };
    for (ratio, kind) in [("-3", "revolute"), ("2", "continuous"), ("0", "continuous")] {
        let model = load(&follow(ratio, kind), &mimic).unwrap();
        assert_eq!((model.nq(), model.nv()), (2, 1));
    }
}

/// Checks that faults in ignored elements are ignored.
#[test]
fn shapes_and_strangers_are_ignored() {
    let base = r#"<link name="base"/>"#;
    let same = load(GOOD, &UrdfOptions::default()).unwrap().to_string();
    for inside in [
        "<visual><geometry><mesh/></geometry></visual>",
        "<visual><geometry><dodecahedron/></geometry></visual><collision/>",
        r#"<visual><origin xyz="a b c"/><geometry><mesh filename=""/></geometry></visual>"#,
        r#"<collision><geometry><cylinder radius="nan"/></geometry></collision><visual><geometry/></visual>"#,
        "<sensor/><contact><lateral_friction value='1'/></contact>text",
    ] {
        let text = with(base, &format!(r#"<link name="base">{inside}</link>"#));
        assert_eq!(load(&text, &UrdfOptions::default()).unwrap().to_string(), same, "{inside}");
    }
    let text = with(base, &format!("{base}<gazebo><plugin/></gazebo><transmission/><material/>"));
    assert_eq!(load(&text, &UrdfOptions::default()).unwrap().to_string(), same);
    let prefixed = with("<robot", r#"<robot xmlns:x="http://x.org""#).replace("<axis", "<x:note/><axis");
    let prefixed = prefixed.replace(base, &format!("{base}<x:link name='not a link'/>"));
    assert_eq!(load(&prefixed, &UrdfOptions::default()).unwrap().to_string(), same);
    let default = with("<robot", r#"<robot xmlns="http://x.org""#);
    assert_eq!(load(&default, &UrdfOptions::default()).unwrap().to_string(), same);
}

/// Checks that the builder refuses invalid arguments.
#[test]
fn builders() {
    let z = Vec3::new(0.0, 0.0, 1.0);
    let hinge = Joint::Revolute { axis: z };
    let ball = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0));
    let shifted = |x: f64| Se3 { translation: Vec3::new(x, 0.0, 0.0), ..Se3::identity() };
    let heavy = |mass: f64| Inertia { mass, ..ball };
    let options = |options: JointOptions| (hinge, Se3::identity(), ball, options);
    let plain = JointOptions::default;
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    let negative = |what: &str, x: &str| format!("joint `j`: {what} is {x}, expected a finite number of at least 0");
    let limit = |what: &str, x: &str| format!("joint `j`: limit of {what} is {x}, expected a number of at least 0");
    for ((joint, placement, inertia, options), message) in [
        (
            (Joint::Prismatic { axis: Vec3::zero() }, Se3::identity(), ball, plain()),
            "body `arm`: axis (0, 0, 0) is no direction".to_owned(),
        ),
        ((hinge, shifted(nan), ball, plain()), "body `arm`: placement is not finite".to_owned()),
        (
            (hinge, shifted(0.0), Inertia { rotational: Sym3::diagonal(nan), ..ball }, plain()),
            "body `arm`: inertia is not finite".to_owned(),
        ),
        (
            (hinge, shifted(0.0), heavy(-0.5), plain()),
            "body `arm`: mass is -0.5 kg, expected a finite number of at least 0".to_owned(),
        ),
        (
            (hinge, shifted(0.0), heavy(infinite), plain()),
            "body `arm`: mass is inf kg, expected a finite number of at least 0".to_owned(),
        ),
        (
            options(JointOptions { position: Some((1.0, -1.0)), ..plain() }),
            "joint `j`: lower limit 1 is above upper limit -1".to_owned(),
        ),
        (
            options(JointOptions { position: Some((infinite, infinite)), ..plain() }),
            "joint `j`: lower limit inf is above upper limit inf".to_owned(),
        ),
        (
            options(JointOptions { position: Some((nan, 1.0)), ..plain() }),
            "joint `j`: limits of position NaN and 1: expected numbers".to_owned(),
        ),
        (options(JointOptions { armature: nan, ..plain() }), negative("armature", "NaN")),
        (options(JointOptions { armature: -0.1, ..plain() }), negative("armature", "-0.1")),
        (options(JointOptions { damping: -1.0, ..plain() }), negative("damping", "-1")),
        (options(JointOptions { friction: infinite, ..plain() }), negative("friction", "inf")),
        (
            options(JointOptions { effort: Some((nan, 1.0)), ..plain() }),
            "joint `j`: limits of effort NaN and 1: expected numbers".to_owned(),
        ),
        (options(JointOptions { velocity: Some(-2.0), ..plain() }), limit("velocity", "-2")),
    ] {
        let mut builder = ModelBuilder::new("r");
        builder.body_with(("arm", "j"), WORLD, joint, placement, inertia, options);
        assert_eq!(builder.build().unwrap_err().to_string(), message);
    }
    let mut heavy = ModelBuilder::new("r");
    heavy.gravity(Vec3::new(0.0, nan, 0.0));
    assert_eq!(heavy.build().unwrap_err().to_string(), "gravity: (0, NaN, 0) m/s² is not finite");

    let build = |change: fn(&mut ModelBuilder, condyle_model::BodyId, condyle_model::BodyId)| {
        let mut builder = ModelBuilder::new("r");
        let a = builder.body("a", WORLD, hinge, Se3::identity(), ball);
        let b = builder.body("b", a, Joint::Spherical, Se3::identity(), ball);
        change(&mut builder, a, b);
        builder.build().map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(build(|_, _, _| ()), Ok(()));
    let find = |result: Result<(), String>| result.unwrap_err();
    assert_eq!(
        find(build(|m, a, _| _ = m.body("a", a, Joint::Planar, Se3::identity(), Inertia::zero()))),
        "two bodies are named `a`"
    );
    assert_eq!(
        find(build(|m, a, _| _ =
            m.body_with(("c", "b"), a, Joint::Planar, Se3::identity(), Inertia::zero(), JointOptions::default()))),
        "two joints are named `b`"
    );
    assert_eq!(
        find(build(|m, a, b| (m.frame("f", a, Se3::identity()), m.frame("f", b, Se3::identity())).0)),
        "two frames are named `f`"
    );
    let lost = |m: &mut ModelBuilder, a, _| {
        m.frame("f", a, Se3 { translation: Vec3::new(f64::NAN, 0.0, 0.0), ..Se3::identity() })
    };
    assert_eq!(find(build(lost)), "frame `f`: placement is not finite");
    let follow = |m: &mut ModelBuilder, a, b| m.mimic(b, a, Mimic { ratio: 1.0, offset: 0.0 });
    assert_eq!(find(build(follow)), "joint `b`: mimic works between joints of one degree of freedom only");
    let world = |m: &mut ModelBuilder, a, _| m.mimic(a, WORLD, Mimic { ratio: 1.0, offset: 0.0 });
    assert_eq!(find(build(world)), "joint `a`: mimics a joint without a coordinate of its own");
}
