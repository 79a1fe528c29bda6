//! What is wrong with a URDF or with what a builder was given: each mistake has its message, with line and element.

use condyle_dynamics::{
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

/// The robot with one thing replaced.
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
    let path = std::env::temp_dir().join(format!("condyle-{}.urdf", std::process::id()));
    std::fs::write(&path, with(r#"<child link="arm"/>"#, "")).unwrap();
    let error = Model::from_urdf(&path, &UrdfOptions::default()).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(error, format!("{}:6: joint `j`: missing field `child`", path.display()));
}

#[test]
fn documents() {
    expect("", "<string>:1: not well-formed XML: the document does not have a root node");
    expect("\nrobot", "<string>:2: not well-formed XML: unknown token at 2:1");
    expect("\n<robot><link name='a'>", "<string>:1: not well-formed XML: the root node was opened but never closed");
    expect("<!-- no robot -->\n<sdf/>", "<string>:2: <sdf>: the root element of a URDF is <robot>");
    expect("<robot/>", "<string>:1: <robot>: has no links");
    let nested = format!("<robot>\n<link name='a'>{}{}</link></robot>", "<a>".repeat(1 << 16), "</a>".repeat(1 << 16));
    expect(&nested, "<string>:2: link `a`: is nested more than 32 levels deep");
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
    let reserved = "joint `root_joint`: the name belongs to the library";
    let floating = UrdfOptions { root_joint: Some(Joint::FreeFlyer), ..UrdfOptions::default() };
    assert_eq!(load(&with(r#""j""#, r#""root_joint""#), &floating).unwrap_err(), format!("<string>:6: {reserved}"));
    let error = load(&with(r#"name="j""#, r#"name="universe""#), &floating).unwrap_err();
    assert_eq!(error, "<string>:6: joint `universe`: the name belongs to the library");
}

#[test]
fn trees() {
    let (parent, child) = (r#"<parent link="base"/>"#, r#"<child link="arm"/>"#);
    expect(
        &with(parent, r#"<parent link="bace"/>"#),
        "<string>:6: joint `j`: no link is named `bace`; nearest is `base`",
    );
    expect(&with(child, r#"<child link="harm"/>"#), "<string>:6: joint `j`: no link is named `harm`; nearest is `arm`");
    expect(&with(child, ""), "<string>:6: joint `j`: missing field `child`");
    expect(&with(parent, ""), "<string>:6: joint `j`: missing field `parent`");
    expect(&with(parent, "<parent/>"), "<string>:6: joint `j`: missing field `link`");
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
    expect(&with(axis, r#"<axis xyz="0 0 0"/>"#), "<string>:6: joint `j`: its axis (0 0 0) is no direction");
    expect(&with(axis, r#"<axis xyz="0 nan 1"/>"#), "<string>:6: joint `j`: its axis (0 NaN 1) is no direction");
    let two = "<string>:6: joint `j`: Wrong vector element count, expected 3 found 2 for [0 1]";
    expect(&with(axis, r#"<axis xyz="0 1"/>"#), two);
    expect(&with(axis, "<axis/>"), "<string>:6: joint `j`: missing field `xyz`");
    expect(&with(axis, r#"<origin xyz="0 inf 0"/>"#), "<string>:6: joint `j`: its origin is not finite");
    expect(&with(axis, r#"<origin rpy="nan 0 0"/>"#), "<string>:6: joint `j`: its origin is not finite");
    let fixed = with("revolute", "fixed").replace(axis, r#"<origin rpy="nan 0 0"/>"#);
    expect(&fixed, "<string>:6: joint `j`: its origin is not finite");
    let kinds = "expected one of `revolute`, `continuous`, `prismatic`, `fixed`, `floating`, `planar`, `spherical`";
    expect(&with("revolute", "rotary"), &format!("<string>:6: joint `j`: unknown variant `rotary`, {kinds}"));
    expect(&with(r#"type="revolute""#, ""), "<string>:6: joint `j`: missing field `type`");
}

#[test]
fn limits() {
    let limit = r#"<limit lower="-1" upper="1" effort="1" velocity="1"/>"#;
    let missing = "<string>:6: joint `j`: is revolute or prismatic and has no <limit>";
    expect(&with(limit, ""), missing);
    expect(&with(limit, "").replace("revolute", "prismatic"), missing);
    assert!(load(&with(limit, "").replace("revolute", "continuous"), &UrdfOptions::default()).is_ok());
    let lower = r#"lower="-1""#;
    expect(&with(lower, r#"lower="2""#), "<string>:6: joint `j`: lower limit 2 is above upper limit 1");
    let not_a_number = "<string>:6: joint `j`: a limit, damping or friction is not a number";
    expect(&with(lower, r#"lower="nan""#), not_a_number);
    expect(&with("<axis", r#"<dynamics damping="nan"/><axis"#), not_a_number);
    expect(&with(lower, r#"lower="one""#), "<string>:6: joint `j`: invalid float literal");
    expect(&with(lower, r#"lower="""#), "<string>:6: joint `j`: cannot parse float from empty string");
}

#[test]
fn inertias() {
    let mass = r#"<mass value="1"/>"#;
    expect(&with(mass, r#"<mass value="-1"/>"#), "<string>:3: link `arm`: mass is -1 kg");
    expect(&with(mass, r#"<mass value="1 kg"/>"#), "<string>:3: link `arm`: invalid float literal");
    expect(&with(mass, ""), "<string>:3: link `arm`: missing field `mass`");
    expect(&with(r#"ixx="1""#, ""), "<string>:3: link `arm`: missing field `ixx`");
    let not_finite = "<string>:3: link `arm`: mass, inertia or its origin is not finite";
    expect(&with(mass, r#"<mass value="nan"/>"#), not_finite);
    expect(&with(r#"ixx="1""#, r#"ixx="inf""#), not_finite);
    expect(&with(mass, r#"<mass value="1"/><origin xyz="0 nan 0"/>"#), not_finite);
}

#[test]
fn mimics() {
    let mimic = |what: &str| with("<axis", &format!("<mimic {what}/><axis"));
    expect(&mimic(r#"joint="nobody""#), "<string>:6: joint `j`: mimics `nobody`, which is no moving joint");
    expect(&mimic(r#"joint="j""#), "<string>:6: joint `j`: mimics a joint without a coordinate of its own");
    let nan = "<string>:6: joint `j`: mimic ratio NaN or offset 0 is not finite";
    expect(&mimic(r#"joint="j" multiplier="nan""#), nan);
    expect(&mimic(""), "<string>:6: joint `j`: missing field `joint`");
    assert!(load(&mimic(r#"joint="nobody""#), &UrdfOptions::default()).is_ok()); // nobody asked for mimics
}

/// A continuous joint leads by whole ratios, and no slide.
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

/// What is not of interest may be as wrong as it likes.
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

/// The builder checks what it is given, too.
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
        (options(JointOptions { effort: Some(nan), ..plain() }), limit("effort", "NaN")),
        (options(JointOptions { velocity: Some(-2.0), ..plain() }), limit("velocity", "-2")),
    ] {
        let mut builder = ModelBuilder::new("r");
        builder.body_with(("arm", "j"), WORLD, joint, placement, inertia, options);
        assert_eq!(builder.build().unwrap_err().to_string(), message);
    }
    let mut heavy = ModelBuilder::new("r");
    heavy.gravity(Vec3::new(0.0, nan, 0.0));
    assert_eq!(heavy.build().unwrap_err().to_string(), "gravity: (0, NaN, 0) m/s² is not finite");

    let build = |change: fn(&mut ModelBuilder, condyle_dynamics::BodyId, condyle_dynamics::BodyId)| {
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
        "two bodys are named `a`"
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
