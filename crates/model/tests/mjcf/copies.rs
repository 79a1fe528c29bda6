//! Tests of MJCF: included and attached files, and copies of parts of a tree.

use super::*;

fn names(model: &Model) -> Vec<&str> {
    model.bodies()[1..].iter().map(|b| b.name.as_str()).collect()
}

const LINK: &str = "<body name='b'><joint name='j'/><geom size='0.1'/></body>";

#[test]
fn replicas_turn_and_move_on() {
    let replicate = |attributes: &str, inside: &str| format!("<replicate {attributes}>{inside}</replicate>");
    let three = model("", &replicate("count='3' offset='1 0.5 0' euler='0 0 30' sep='-'", LINK), "");
    assert_eq!(names(&three), ["b-0", "b-1", "b-2"]);
    let (c, s) = (3f64.sqrt() / 2.0, 0.5);
    for (body, expected) in three.bodies()[1..].iter().zip([
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        [1.0, 0.5, 0.0, c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0],
        [1.6160254037844388, 1.4330127018922192, 0.0, s, -c, 0.0, c, s, 0.0, 0.0, 0.0, 1.0],
    ]) {
        near(&body.name, &flat(&body.placement), &expected, 1e-12);
    }
    // the suffix of an inner copy comes first, and a suffix has the same number of digits as the count
    let nested = replicate("count='2'", &replicate("count='10' sep='_'", LINK));
    assert_eq!(names(&model("", &nested, ""))[..2], ["b_000", "b_010"]);
    assert_eq!(names(&model("", &nested, ""))[19], "b_091");
    assert_eq!(names(&model("", &replicate("count='0'", LINK), "")), [""; 0]);
    // copies of elements without a name have no name
    let class = "<default><default class='c'><joint armature='3'/></default></default>";
    let unnamed = model(class, &replicate("count='2' childclass='c'", "<body><joint/><geom size='0.1'/></body>"), "");
    assert_eq!((names(&unnamed), unnamed.armature()), (vec!["body1", "body2"], &[3.0, 3.0][..]));
}

#[test]
fn elements_that_refer_to_a_replica_are_copied() {
    let other = LINK.replace("'b'", "'o'").replace("'j'", "'k'");
    let tree = format!("<replicate count='2'>{LINK}</replicate>{other}");
    let after =
        "<tendon><fixed name='t'><joint joint='j' coef='1'/></fixed></tendon><actuator><motor name='m' joint='j'/>
        <motor name='n' joint='k'/><motor name='o' tendon='t'/></actuator>";
    let actuators = model("", &tree, after);
    let actuators: Vec<_> = actuators.actuators().iter().map(|a| a.name.as_str()).collect();
    assert_eq!(actuators, ["n", "m0", "o0", "m1", "o1"]); // the same order as in MuJoCo
    let mixed = "<equality><joint joint1='j' joint2='k'/></equality>";
    assert!(refused("", &tree, mixed).contains("joint1: no joint is named `j`"));
}

#[test]
fn replicas_that_cannot_be() {
    for (text, expected) in [
        ("<replicate><geom/></replicate>", "<replicate>: has no count"),
        ("<replicate count='2.5'><geom/></replicate>", "count: 2.5 is no whole number"),
        ("<body><replicate count='2'><joint/></replicate></body>", "<joint>: cannot be in a <replicate>"),
        ("<replicate count='1000000000'><body/></replicate>", "2000000007 tags, at most 1048576 are allowed"),
        ("<replicate count='1e300'><body/></replicate>", "tags, at most 1048576 are allowed"),
        ("<replicate count='2'><body name='b'/></replicate><body name='b0'/>", "the name is taken by the body"),
    ] {
        let error = refused("", text, "");
        assert!(error.contains(expected), "{error}");
    }
    let mut deep = LINK.to_owned();
    for _ in 0..20 {
        deep = format!("<replicate count='10'>{deep}</replicate>");
    }
    assert!(refused("", &deep, "").contains("at most 1048576 are allowed"));
}

#[test]
fn parts_of_the_same_file_attached_again() {
    let tree = format!("{LINK}<frame pos='1 2 3' euler='0 0 90'><attach body='b' prefix='p-'/></frame>");
    let twice = model("", &tree, "<actuator><motor name='m' joint='j'/></actuator>");
    assert_eq!(names(&twice), ["b", "p-b"]);
    near("place", &flat(&twice.bodies()[2].placement)[..3], &[1.0, 2.0, 3.0], 1e-12);
    assert_eq!(twice.actuators().iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["m", "p-m"]);
    // frames around the attached part are not copied, but the class of these frames is kept
    let framed =
        "<frame pos='5 0 0' childclass='c'><frame name='f' pos='0 1 0'><body name='x'><joint/><geom size='0.1'/></body>
        </frame></frame><frame pos='0 0 7'><attach frame='f' prefix='p-'/></frame>";
    let framed = model("<default><default class='c'><joint armature='2'/></default></default>", framed, "");
    near("place", &flat(&framed.bodies()[2].placement)[..3], &[0.0, 1.0, 7.0], 1e-12);
    assert_eq!(framed.armature(), [2.0, 2.0]);
    for (attach, expected) in [
        ("<attach body='z' prefix='p'/>", "<attach>: body: no body before this element is named `z`"),
        ("<attach body='b'/>", "<attach>: has no prefix"),
        ("<attach prefix='p'/>", "<attach>: has neither model, body nor frame"),
        ("<attach body='b' frame='f' prefix='p'/>", "<attach>: has both body and frame"),
        ("<attach body='b' prefix=''/>", "the name is taken by the body"),
        ("<attach model='m' body='b' prefix='p'/>", "model: no <model> of <asset> is named `m`"),
    ] {
        let error = refused("", &format!("{LINK}{attach}"), "");
        assert!(error.contains(expected), "{error}");
    }
    let many = format!("{LINK}{}", (0..300).map(|k| format!("<attach body='b' prefix='{k}'/>")).collect::<String>());
    assert!(refused("", &many, "").contains("more than 256 <attach> elements"));
}

#[test]
fn attached_files_keep_their_own_settings() {
    let child = "<mujoco model='c'><compiler angle='radian' autolimits='false' boundmass='0.5'/><option gravity='0 0 -1'/>
        <default><joint damping='0.5'/><default class='q'><joint armature='2'/></default></default>
        <worldbody><site name='ws' pos='0 0 3'/><frame pos='1 0 0'><body name='d' pos='0 1 0' euler='0 0 1.5707963267948966'>
          <joint name='k' limited='true' range='-1 1'/><geom size='0.1' mass='0.1'/>
          <body name='e' childclass='q'><joint name='l'/><geom size='0.1' mass='1'/></body></body></frame></worldbody>
        <actuator><motor name='m' joint='k'/></actuator><keyframe><key qpos='0 0'/></keyframe></mujoco>";
    let main = |attach: &str| {
        let before = "<compiler angle='degree'/><default><joint armature='9'/></default>
            <asset><model name='c' file='parts/child.xml'/></asset>";
        robot(before, &format!("<body name='b'><joint name='j'/>{INERTIAL}{attach}</body>"), "")
    };
    let attached = |attach: &str| {
        let files = [("parts/child.xml", child.as_bytes()), ("main.xml", &main(attach).into_bytes()[..])];
        let folder = Folder::new("attach", &files);
        folder.read("main.xml")
    };
    let model = attached("<attach model='c' body='d' prefix='x-'/>").unwrap();
    assert_eq!(names(&model), ["b", "x-d", "x-e"]);
    let masses: Vec<_> = model.bodies()[1..].iter().map(|b| b.inertia.mass).collect();
    assert_eq!(masses, [2.0, 0.5, 1.0]); // limited by the settings of the attached file
    assert_eq!((model.limits().lower[1], model.limits().upper[1]), (-1.0, 1.0));
    assert_eq!((model.damping(), model.armature()), (&[0.0, 0.5, 0.5][..], &[9.0, 0.0, 2.0][..]));
    near("place", &flat(&model.bodies()[2].placement)[..4], &[0.0, 1.0, 0.0, 0.0], 1e-12);
    assert_eq!(model.gravity().to_array(), [0.0, 0.0, -9.81]);
    assert_eq!(model.actuators()[0].name, "x-m");
    let left_out = said(&model, WarningKind::LeftOut).join("\n");
    assert!(left_out.contains("the keyframes of the model `c`") && left_out.contains("gravity, medium and flags"));
    let inner = attached("<attach model='c' body='e' prefix=''/>").unwrap();
    assert_eq!((names(&inner), inner.armature()), (vec!["b", "e"], &[9.0, 2.0][..]));
    let whole = attached("<attach model='c' prefix='x-'/>").unwrap();
    near("site", &placement(&whole, "x-ws")[..3], &[0.0, 0.0, 3.0], 0.0);
    near("place", &flat(&whole.bodies()[2].placement)[..3], &[1.0, 1.0, 0.0], 1e-12);
    let error = attached("<attach model='c' body='z' prefix='x-'/>").unwrap_err().to_string();
    assert!(error.contains("body: no body of the model `c` is named `z`"), "{error}");
    let nobody = robot("<asset><model name='c' file='child.xml'/></asset>", "<attach model='c' prefix='p'/>", "");
    assert!(read(&nobody).unwrap_err().to_string().contains("a string has no folder to find `child.xml` in"));
}

#[test]
fn a_file_inside_of_itself() {
    let itself = robot("<asset><model name='c' file='main.xml'/></asset>", "<attach model='c' prefix='p'/>", "");
    let error = Folder::new("itself", &[("main.xml", itself.as_bytes())]).read("main.xml").unwrap_err().to_string();
    assert!(error.contains("is attached inside of itself"), "{error}");
}

#[test]
fn includes_next_to_the_including_file() {
    let files: [(&str, &[u8]); 4] = [
        ("top.xml", b"<mujoco><worldbody><include file='in/mid.xml'/></worldbody></mujoco>"),
        ("in/mid.xml", b"<x><body name='a'><joint/><geom size='0.1'/><include file='deep/part.xml'/></body></x>"),
        ("in/deep/part.xml", b"<mujocoinclude><site name='s' pos='0 0 2'/></mujocoinclude>"),
        ("deep/part.xml", b"<mujocoinclude><site name='s' pos='0 0 5'/></mujocoinclude>"),
    ];
    // the folder of the main file has priority
    near("site", &placement(&Folder::new("first", &files).read("top.xml").unwrap(), "s")[..3], &[0.0, 0.0, 5.0], 0.0);
    let beside = Folder::new("beside", &files[..3]).read("top.xml").unwrap();
    near("site", &placement(&beside, "s")[..3], &[0.0, 0.0, 2.0], 0.0);
}
