//! Tests of MJCF: errors with file, line and element, warnings, and included files.

use super::read;
use condyle_model::{Error, MjcfOptions, Model, Vec3, Warning};
use std::path::PathBuf;

/// Returns the path of a file that the tests of the crate `dynamics` also read.
fn data(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../dynamics/tests/data").join(file)
}

const BALL: &str = "<geom size='0.1'/>";

fn body(inside: &str) -> String {
    format!("<mujoco>\n<worldbody>\n<body name='b'>\n{inside}\n</body></worldbody></mujoco>")
}

fn said(text: &str) -> String {
    read(text).expect_err(text).to_string()
}

#[test]
fn joints_that_cannot_follow() {
    let mimic = |equality: &str| {
        let joints = format!("<joint name='a'/>{BALL}<body><joint name='b'/>{BALL}</body>");
        let text = body(&joints).replace("</mujoco>", &format!("\n<equality>{equality}</equality></mujoco>"));
        let options = MjcfOptions { mimic: true, ..MjcfOptions::default() };
        Model::from_mjcf_str(&text, &options).map(|m| m.warnings().iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    let left_out = [
        ("<joint joint1='a' joint2='b' polycoef='0 1 2'/>", "polycoef 0 1 2 0 0 is not linear", 1),
        (
            "<joint joint1='a' joint2='b'/><joint joint1='a' joint2='b' polycoef='1 2'/>",
            "joint1 follows another joint, or joint2 follows joint1",
            2,
        ),
        (
            "<joint joint1='a' joint2='b'/><joint joint1='b' joint2='a'/>",
            "joint1 follows another joint, or joint2 follows joint1",
            2,
        ),
    ];
    for (equality, why, number) in left_out {
        let held = format!("the joint is left free, and nothing enforces the coupling `joint{number}`");
        assert_eq!(mimic(equality).unwrap(), [format!("<string>:6: <joint>: {why}: {held}")]);
    }
    let constant = "<string>:6: <joint>: the joint is left free: nothing enforces its constant position";
    assert_eq!(mimic("<joint joint1='a'/>").unwrap(), [constant]);
    let said = |equality: &str| mimic(equality).unwrap_err().to_string();
    assert_eq!(said("<joint joint2='b'/>"), "<string>:6: <joint>: has no joint1");
    assert_eq!(said("<joint joint1='c'/>"), "<string>:6: <joint>: joint1: no joint is named `c`");
}

#[test]
fn arm_has_what_its_classes_say() {
    let arm = Model::from_mjcf(data("arm.xml"), &MjcfOptions::default()).unwrap();
    let names: Vec<&str> = arm.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["pan", "lift", "elbow", "body4_joint", "wrist"]);
    assert_eq!(arm.bodies()[1].name, "shoulder#1");
    assert_eq!(arm.limits().effort()[0], 1.0); // the limit of the motor is ±1, of the joint ±40
    assert_eq!(arm.friction(), [0.05; 7]);
    assert_eq!(*arm.gravity(), Vec3::new(0.3, -0.2, -9.7));
    assert_eq!(arm.frames()[arm.frame("bracket").unwrap()].body, 4);
    let [Warning::LeftOut { element, what, .. }] = arm.warnings() else { panic!("{:?}", arm.warnings()) };
    assert!(element == "joint `wrist`" && what.starts_with("range: the limit of 1.39")); // `wrist` is a ball joint
}

#[test]
fn errors_name_file_line_and_element() {
    let cases = [
        ("<joint name='j' axis='0 0 0'/><geom size='1'/>", "<string>:4: joint `j`: axis (0, 0, 0) is no direction"),
        ("<joint axis='0 0'/>", "<string>:4: <joint>: axis: expected 3 numbers, found 2"),
        ("<joint type='hing'/>", "<string>:4: <joint>: type: `hing` is none of hinge, slide, ball and free"),
        ("<joint range='2 1' limited='true'/>", "<string>:4: <joint>: range: lower limit 2 is not below upper limit 1"),
        ("<joint limited='true'/>", "<string>:4: <joint>: range: lower limit 0 is not below upper limit 0"),
        ("<joint class='mian'/>", "<string>:4: <joint>: no default class is named `mian`; nearest is `main`"),
        ("<joint class='wheels'/>", "<string>:4: <joint>: no default class is named `wheels`"),
        ("<joint/><freejoint/>", "<string>:4: <freejoint>: a free joint is the only joint"),
        ("<joint/><geom type='mesh' mesh='m'/>", "<string>:4: <geom>: mesh: no <mesh> of <asset> is named `m`"),
        ("<joint/><geom type='plane' size='1 1 1'/>", "<string>:4: <geom>: a plane is on a body that moves"),
        (
            "<joint/><geom type='box' size='1 1'/>",
            "<string>:4: <geom>: size: a box needs 3 positive numbers, found 1 1",
        ),
        ("<joint/><inertial pos='0 0 0'/>", "<string>:4: <inertial>: has no mass"),
        ("<joint/><inertial pos='0 0 0' mass='-1'/>", "<string>:4: <inertial>: mass is -1 kg"),
        ("<replicate count='x'/>", "<string>:4: <replicate>: count: `x` is no finite number"),
        ("<body name='b'/>", "<string>:4: body `b`: the name is taken by the body on line 3"),
        ("<body euler='0 0 1' zaxis='0 0 1'/>", "<string>:4: <body>: has 2 orientations: zaxis, euler"),
        ("<include file='x.xml'/>", "<string>:4: <include>: a string has no folder to find `x.xml` in"),
    ];
    for (inside, expected) in cases {
        let said = said(&body(inside));
        assert!(said.starts_with(expected), "{said}\n{expected}");
    }
    assert!(said("<robt/>").starts_with("<string>:1: <robt>: the root element of an MJCF"));
    assert_eq!(said("<robot/>"), "<string>:1: <robot>: is a URDF: `from_urdf` reads it");
    assert!(said("<mujoco>").starts_with("<string>:1: not well-formed XML"));
    assert!(said(&"<body>".repeat(300)).starts_with("<string>:"));
    let deep = format!("<mujoco>{}{}</mujoco>", "<worldbody>".repeat(300), "</worldbody>".repeat(300));
    assert!(said(&deep).contains("elements are nested 301 deep, at most 256 are allowed"));
    let missing = Model::from_mjcf(data("nowhere.xml"), &MjcfOptions::default()).unwrap_err();
    assert!(matches!(missing, Error::File { .. }));
}

/// Checks that an error in an included file contains the name of the included file.
#[test]
fn includes() {
    let folder = std::env::temp_dir().join(format!("condyle-mjcf-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    let read_main = || Model::from_mjcf(folder.join("main.xml"), &MjcfOptions::default());
    write("main.xml", "<mujoco><worldbody><include file='a.xml'/></worldbody></mujoco>");
    write("a.xml", &format!("<mujoco>\n<body name='a'><joint/>{BALL}</body></mujoco>"));
    assert_eq!(read_main().unwrap().nv(), 1);
    write("a.xml", "<mujoco>\n<body name='a'><joint axis='x'/></body></mujoco>");
    let Error::Element { file, line, .. } = read_main().unwrap_err() else { panic!() };
    assert!(file.ends_with("a.xml") && line == 2);
    write("a.xml", "<mujoco><include file='main.xml'/></mujoco>");
    assert!(read_main().unwrap_err().to_string().contains("`main.xml` is already part of the model"));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_is_left_out_is_said() {
    let equality = "<equality><flex flex='f'/></equality></mujoco>";
    let text = body(&format!("<joint/>{BALL}")).replace("</mujoco>", equality);
    let model = read(&text).unwrap();
    assert!(matches!(model.warnings(), [Warning::LeftOut { element, .. }] if element == "<flex>"));
    let strict = Model::from_mjcf_str(&text, &MjcfOptions { strict: true, ..MjcfOptions::default() }).unwrap_err();
    assert!(matches!(strict, Error::Strict { .. }));
}

/// Checks a mesh that cannot be read, in a body without an <inertial>: it is an error, or it has no mass if the option
/// `weightless_meshes` is set.
#[test]
fn meshes_weigh_nothing_if_asked() {
    let text = body(&format!("<joint/>{BALL}<geom name='cover' type='mesh' mesh='m'/><geom type='mesh' mass='0'/>"));
    let text = text.replace("<mujoco>", "<mujoco><asset><mesh file='m.stl'/></asset>");
    let why = "a string has no folder to find `m.stl` in";
    assert!(said(&text).starts_with(&format!("<string>:4: geom `cover`: has the mass of mesh `m`: {why}")));
    let light =
        Model::from_mjcf_str(&text, &MjcfOptions { weightless_meshes: true, ..MjcfOptions::default() }).unwrap();
    assert_eq!(light.total_mass(), read(&body(&format!("<joint/>{BALL}"))).unwrap().total_mass());
    let said: Vec<String> = light.warnings().iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [format!("<string>:4: geom `cover`: the mass of a mesh on body `b` is left out: mesh `m`: {why}")]
    );
}
