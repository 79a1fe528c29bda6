//! SDF: versions, models in models, files that include others, what a model cannot hold, and errors.
//!
//! Poses and inertias were made with Drake 1.51, which reads SDF by the format's own library.
#![allow(non_snake_case)]

use condyle_model::{Error, FrameKind, Joint, Model, ModelConstraintKind, SdfOptions, Se3, Vec3, Warning, WarningKind};
use std::fs;
use std::path::PathBuf;

/// Sums and products of a few numbers.
const ROUNDING: f64 = 1e-12;

const INERTIAL: &str = "<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
  <inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz></inertia></inertial>";

fn read(text: &str) -> Result<Model, Error> {
    Model::from_sdf_str(text, &SdfOptions::default())
}

/// Reads a model of a version, the inside of `<model>`.
fn model(version: &str, inside: &str) -> Model {
    let text = format!("<sdf version='{version}'><model name='m'>{inside}</model></sdf>");
    read(&text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn link(name: &str) -> String {
    format!("<link name='{name}'>{INERTIAL}</link>")
}

/// A link that stands somewhere.
fn link_at(name: &str, pose: &str) -> String {
    format!("<link name='{name}'><pose>{pose}</pose>{INERTIAL}</link>")
}

fn joint(name: &str, kind: &str, ends: [&str; 2], inside: &str) -> String {
    let [parent, child] = ends;
    format!("<joint name='{name}' type='{kind}'><parent>{parent}</parent><child>{child}</child>{inside}</joint>")
}

fn said(model: &Model) -> Vec<String> {
    model.warnings().iter().map(ToString::to_string).collect()
}

fn frame(model: &Model, name: &str, kind: FrameKind) -> Se3<f64> {
    let found = model.frames().iter().find(|f| f.name == name && f.kind == kind);
    found.unwrap_or_else(|| panic!("no frame {name}")).placement
}

#[track_caller]
fn close(ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len());
    let near = ours.iter().zip(theirs).all(|(x, y)| (x - y).abs() <= ROUNDING * (1.0 + y.abs()));
    assert!(near, "{ours:?}\n{theirs:?}");
}

/// A folder for one test, empty.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("condyle_sdf_{name}_{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn write(folder: &std::path::Path, name: &str, text: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

/// The axis 0 0 1 of a joint whose child is turned by a quarter about x: z of the joint, or y of it, which is z of the model.
#[test]
fn the_version_says_in_which_frame_an_axis_is() {
    let axis = |version: &str, inside: &str| {
        let axis = format!("<axis><xyz>0 0 1</xyz>{inside}</axis>");
        let b = link_at("b", "0 0 1 1.5707963267948966 0 0");
        let m = model(version, &format!("{}{b}{}", link("a"), joint("j", "revolute", ["a", "b"], &axis)));
        (m.bodies()[1].joint.axis().unwrap().to_array(), said(&m))
    };
    let flag = |text: &str| format!("<use_parent_model_frame>{text}</use_parent_model_frame>");
    let (of_model, of_joint) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    for version in ["1.2", "1.3", "1.4"] {
        close(&axis(version, "").0, &of_model);
    }
    close(&axis("1.4", &flag("false")).0, &of_joint);
    for version in ["1.5", "1.6"] {
        close(&axis(version, "").0, &of_joint);
        for text in ["1", "true", "True", "TRUE", " true\n"] {
            let (found, warned) = axis(version, &flag(text));
            close(&found, &of_model);
            assert!(warned.is_empty(), "{warned:?}");
        }
        for text in ["0", "false", "False", ""] {
            close(&axis(version, &flag(text)).0, &of_joint);
        }
    }
    for version in ["1.7", "1.8", "1.9", "1.10", "1.11", "1.12"] {
        let (found, warned) = axis(version, &flag("true"));
        close(&found, &of_joint);
        assert!(warned.iter().any(|w| w.contains("unknown element <use_parent_model_frame>")), "{warned:?}");
    }
    // an axis without a direction is z, of the model too
    let bare = |version| axis(version, "").0;
    close(&bare("1.4"), &of_model);
}

/// Up to version 1.6 a pose has a `frame`, later a `relative_to`.
#[test]
fn the_version_says_to_what_a_pose_is_relative() {
    let z = |version: &str, name: &str| {
        let b = format!("<link name='b'><pose {name}='a'>0 0 1 0 0 0</pose>{INERTIAL}</link>");
        let ends = joint("j", "fixed", ["a", "b"], "");
        let m = model(version, &format!("{}{b}{ends}", link_at("a", "0 0 2 0 0 0")));
        (frame(&m, "b", FrameKind::Link).translation.z, said(&m).len())
    };
    assert_eq!(z("1.6", "frame"), (3.0, 0));
    assert_eq!(z("1.7", "relative_to"), (3.0, 0));
    assert_eq!(z("1.7", "frame"), (1.0, 1));
}

/// Version 1.0 writes attributes where later ones write elements.
#[test]
fn the_first_version() {
    let old = "<gazebo version='1.0'><world name='w'><physics type='ode'><gravity xyz='0 0 -2'/></physics>
      <model name='m' static='false'><origin pose='0 0 1 0 0 0'/>
      <link name='a' gravity='true'><inertial mass='2'><origin pose='0.1 0 0 0 0 0'/>
        <inertia ixx='0.02' iyy='0.03' izz='0.04' ixy='0.001' ixz='0' iyz='0'/></inertial></link>
      <link name='b' self_collide='false'><origin pose='0 0 1 1.5707963267948966 0 0'/>
        <inertial mass='3'><inertia ixx='0.2' iyy='0.3' izz='0.4' ixy='0' ixz='0' iyz='0'/></inertial></link>
      <joint name='j' type='revolute'><parent link='a'/><child link='b'/><origin pose='0 0 0.1 0 0 0'/>
        <axis xyz='0 0 1'><limit lower='-1' upper='2' effort='3' velocity='4'/>
          <dynamics damping='0.5' friction='0.1'/></axis></joint></model></world></gazebo>";
    let new = "<sdf version='1.7'><world name='w'><gravity>0 0 -2</gravity>
      <model name='m'><pose>0 0 1 0 0 0</pose>
      <link name='a'><inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
        <inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz><ixy>0.001</ixy></inertia></inertial></link>
      <link name='b'><pose>0 0 1 1.5707963267948966 0 0</pose>
        <inertial><mass>3</mass><inertia><ixx>0.2</ixx><iyy>0.3</iyy><izz>0.4</izz></inertia></inertial></link>
      <joint name='j' type='revolute'><parent>a</parent><child>b</child><pose>0 0 0.1 0 0 0</pose>
        <axis><xyz expressed_in='__model__'>0 0 1</xyz>
          <limit><lower>-1</lower><upper>2</upper><effort>3</effort><velocity>4</velocity></limit>
          <dynamics><damping>0.5</damping><friction>0.1</friction></dynamics></axis></joint></model></world></sdf>";
    let (old, new) = (read(old).unwrap(), read(new).unwrap());
    assert_eq!(said(&old), Vec::<String>::new());
    assert_eq!(old, new);
    // later versions know no such attributes
    let late =
        read("<sdf version='1.2'><model name='m'><link name='a'><inertial mass='2'/></link></model></sdf>").unwrap();
    assert!(said(&late)[0].contains("unknown attribute `mass`"), "{:?}", said(&late));
}

#[test]
fn unknown_versions() {
    let known = "known are 1.0, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 1.10, 1.11, 1.12";
    let root = |attributes: &str| {
        read(&format!("<sdf {attributes}><model name='m'><link name='a'/></model></sdf>")).unwrap_err().to_string()
    };
    assert_eq!(root(""), format!("<string>:1: <sdf>: has no version; {known}"));
    for version in ["1.1", "1.13", "2.0", "1", "1.70", "x", ""] {
        let expected = format!("<string>:1: <sdf>: version `{version}` is unknown; {known}");
        assert_eq!(root(&format!("version='{version}'")), expected);
    }
}

#[test]
fn placement_frames() {
    let z = |attribute: &str, inside: &str| {
        let a = format!("<link name='a'><pose>0 0 1 0 0 0</pose>{INERTIAL}</link>");
        let text =
            format!("<sdf version='1.8'><model name='m' {attribute}><pose>0 0 3 0 0 0</pose>{a}{inside}</model></sdf>");
        read(&text).map(|m| frame(&m, "a", FrameKind::Link).translation.z).map_err(|e| e.to_string())
    };
    assert_eq!(z("", ""), Ok(4.0));
    assert_eq!(z("placement_frame='a'", ""), Ok(3.0));
    assert_eq!(z("placement_frame='f'", "<frame name='f' attached_to='a'><pose>0 0 0.5 0 0 0</pose></frame>"), Ok(2.5));
    let expected = "<string>:1: model `m`: placement_frame: no link, joint or frame is named `b`";
    assert_eq!(z("placement_frame='b'", ""), Err(expected.to_owned()));
}

/// Nothing of a static model moves, nor of the models in it.
#[test]
fn static_models() {
    let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 0 1</xyz></axis>");
    let nested = format!("<model name='n'><pose>0 0 1 0 0 0</pose>{}</model>", link("c"));
    let inside = format!("<static>true</static>{}{}{nested}{}", link("a"), link("b"), turn("j", ["a", "b"]));
    let m = model("1.9", &inside);
    assert_eq!((m.nv(), m.bodies().len(), m.bodies()[0].inertia.mass), (0, 1, 6.0));
    assert_eq!(frame(&m, "n::c", FrameKind::Link).translation.z, 1.0);
    let what = "<string>:3: joint `j`: does not move: its model is static, and all links of it are fixed to the world";
    assert_eq!(said(&m).len(), 1);
    assert!(said(&m)[0].ends_with(what.split_once(": ").unwrap().1), "{:?}", said(&m));
    let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), ..SdfOptions::default() };
    let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
    assert_eq!(Model::from_sdf_str(&text, &free).unwrap().nv(), 0);
    // a robot that stands on a static model
    let robot = format!("<model name='r'>{}</model>", link("base"));
    let ground = format!("<model name='ground'><static>1</static>{}</model>", link("plane"));
    let on = turn("on", ["ground::plane", "r::base"]);
    let text = format!("<sdf version='1.10'><world name='w'>{robot}{ground}{on}</world></sdf>");
    let m = Model::from_sdf_str(&text, &free).unwrap();
    assert_eq!((m.nv(), m.bodies()[1].name.as_str(), m.bodies()[1].parent), (1, "r::base", 0));
}

#[test]
fn several_models() {
    let robot = |name: &str, x: f64| {
        let turn = joint("j", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
        format!("<model name='{name}'><pose>{x} 0 0 0 0 0</pose>{}{}{turn}</model>", link("a"), link("b"))
    };
    let text = format!("<sdf version='1.6'>{}\n<world name='w'>{}</world></sdf>", robot("one", 1.0), robot("two", 2.0));
    let both = read(&text).unwrap();
    assert_eq!(both.name(), "w");
    let names: Vec<&str> = both.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["one::j", "two::j"]);
    assert_eq!(frame(&both, "two::a", FrameKind::Link).translation.x, 2.0);
    assert_eq!(frame(&both, "two", FrameKind::User).translation.x, 2.0);
    let fixed = "link `a`: no joint carries it: it is fixed to the world, unless a root joint is asked for";
    assert_eq!(said(&both).iter().filter(|w| w.ends_with(fixed)).count(), 2, "{:?}", said(&both));
    let named = |name: &str| {
        let options = SdfOptions { model: Some(name.to_owned()), ..SdfOptions::default() };
        Model::from_sdf_str(&text, &options)
    };
    let one = named("two").unwrap();
    assert_eq!((one.name(), one.nv(), said(&one).len()), ("two", 1, 0));
    assert_eq!(frame(&one, "a", FrameKind::Link).translation.x, 2.0);
    let error = named("three").unwrap_err().to_string();
    assert_eq!(error, "<string>:1: <sdf>: no model is named `three`; there are `one`, `two`");
    let twice = text.replace("'two'", "'one'");
    assert!(read(&twice).unwrap_err().to_string().contains("model `one`: the name is taken by the model on line 1"));
    let worlds = text.replace("</sdf>", "<world name='second'/></sdf>");
    let warned = said(&read(&worlds).unwrap());
    assert!(warned.iter().any(|w| w.ends_with("world `second`: is not the first world of the file, and is left out")));
}

/// Links that no joint carries: each is a root.
#[test]
fn several_roots() {
    let turn = joint("j", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let inside = format!("{}{}{turn}{}", link("a"), link("b"), link_at("c", "0 0 5 0 0 0"));
    let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
    let fixed = read(&text).unwrap();
    assert_eq!((fixed.nv(), said(&fixed).len()), (1, 2));
    assert!(said(&fixed).iter().all(|w| w.contains("is fixed to the world, unless a root joint is asked for")));
    assert_eq!(frame(&fixed, "c", FrameKind::Link).translation.z, 5.0);
    let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), strict: true, ..SdfOptions::default() };
    let names = |text: &str| {
        let m = Model::from_sdf_str(text, &free).unwrap();
        m.bodies().iter().skip(1).map(|b| b.joint_name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&text), ["root_joint", "j", "root_joint#2"]);
    assert_eq!(names(&text.replace("'j'", "'root_joint'")), ["root_joint#2", "root_joint", "root_joint#3"]);
    // beside links on the world
    let anchored = text.replace("</model>", &format!("{}</model>", joint("w", "fixed", ["world", "a"], "")));
    assert_eq!(names(&anchored), ["j", "root_joint"]);
    let warned = said(&read(&anchored).unwrap());
    assert_eq!(warned.len(), 1);
    assert!(warned[0].contains("link `c`"), "{warned:?}");
}

/// A joint whose parent is met in no other way carries the parent on its child, about the axis turned around.
#[test]
fn joints_walked_from_their_child() {
    let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 1 0</xyz></axis>");
    let inside = format!("{}{}{}{}{}", link("a"), link("c"), link("b"), turn("ac", ["a", "c"]), turn("bc", ["b", "c"]));
    let m = model("1.9", &inside);
    let found: Vec<_> = m.bodies().iter().skip(1).map(|b| (b.name.as_str(), b.joint_name.as_str(), b.parent)).collect();
    assert_eq!(found, [("c", "ac", 0), ("b", "bc", 1)]);
    close(&m.bodies()[2].joint.axis().unwrap().to_array(), &[0.0, -1.0, 0.0]);
    assert!(said(&m).is_empty());
    let ball = inside.replacen("name='bc' type='revolute'", "name='bc' type='ball'", 1);
    assert!(said(&model("1.9", &ball))[0].contains("its position is that of the parent, seen from the child"));
}

/// A ring of links: the joint that is met last becomes a constraint, whose frames coincide where the file puts the links.
#[test]
fn loops() {
    let ring = |kind: &str, inside: &str| {
        let turn = |name: &str, ends| joint(name, "revolute", ends, "<axis><xyz>0 1 0</xyz></axis>");
        let close = joint("close", kind, ["b", "c"], &format!("<pose>0.2 0 0.1 0 0 0</pose>{inside}"));
        let links = format!("{}{}{}", link("a"), link_at("b", "1 0 0 0 0 0.3"), link_at("c", "0 0 1 0 0.2 0"));
        model("1.9", &format!("{links}{}{}{close}", turn("ab", ["a", "b"]), turn("ac", ["a", "c"])))
    };
    let ends = |m: &Model, k: usize| {
        let (ModelConstraintKind::Point { frames } | ModelConstraintKind::Rigid { frames }) = m.constraints()[k].kind
        else {
            panic!("no frames");
        };
        // at q = 0 each body is where its joint is
        frames.map(|f| {
            let frame = &m.frames()[f];
            (frame.body, m.bodies()[frame.body].placement * frame.placement)
        })
    };
    let axis = "<axis><xyz>0 1 0</xyz></axis>";
    let names = |m: &Model| m.constraints().iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    for (kind, count) in [("fixed", 1), ("ball", 1), ("revolute", 2), ("continuous", 2)] {
        let m = ring(kind, if kind == "fixed" { "" } else { axis });
        assert_eq!((m.nv(), said(&m), names(&m).len()), (2, Vec::new(), count), "{kind}");
        assert_eq!(matches!(m.constraints()[0].kind, ModelConstraintKind::Rigid { .. }), kind == "fixed");
        for k in 0..count {
            let [(first, X), (second, Y)] = ends(&m, k);
            assert_eq!((first, second), (1, 2));
            close(&X.translation.to_array(), &Y.translation.to_array());
            close(&X.rotation.x.to_array(), &Y.rotation.x.to_array());
        }
    }
    let m = ring("revolute", axis);
    assert_eq!(names(&m), ["close", "close#2"]);
    let [X, Y] = [ends(&m, 0)[0].1, ends(&m, 1)[0].1];
    let c = Vec3::new(0.0, 0.0, 1.0); // the origin of c, which is turned about y by 0.2
    close(
        &(X.translation - c).to_array(),
        &[0.2 * 0.2f64.cos() + 0.1 * 0.2f64.sin(), 0.0, 0.1 * 0.2f64.cos() - 0.2 * 0.2f64.sin()],
    );
    close(&(Y.translation - X.translation).to_array(), &[0.0, 1.0, 0.0]);
    let dynamics =
        "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower></limit><dynamics><damping>1</damping></dynamics></axis>";
    let what = "closes a loop: its limits, damping are left out, the constraint has none";
    assert!(said(&ring("revolute", dynamics))[0].ends_with(what));
    let open = ring("prismatic", axis);
    assert!(open.constraints().is_empty());
    assert!(said(&open)[0].contains("joint `close`: closes a loop that no constraint holds"));
    let cross = ring("universal", "<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>");
    assert_eq!(names(&cross), ["close"]);
    assert!(said(&cross)[0].ends_with("only its point is held, and it may turn about all axes"));
}

/// θ₂ = −ratio θ₁, each about its axis and seen from the reference body.
#[test]
fn gearboxes() {
    let geared = |axes: [&str; 2], reference: &str| {
        let turn =
            |name: &str, ends, axis: &str| joint(name, "revolute", ends, &format!("<axis><xyz>{axis}</xyz></axis>"));
        let gearbox = format!(
            "<gearbox_ratio>5</gearbox_ratio>{reference}
             <axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>"
        );
        let links = format!("{}{}{}", link("base"), link("in"), link("out"));
        let joints = turn("i", ["base", "in"], axes[0]) + &turn("o", ["base", "out"], axes[1]);
        model("1.9", &format!("{links}{joints}{}", joint("g", "gearbox", ["in", "out"], &gearbox)))
    };
    let reference = "<gearbox_reference_body>base</gearbox_reference_body>";
    for (axes, factor) in [(["0 0 1", "0 0 1"], -5.0), (["0 0 -1", "0 0 1"], 5.0), (["0 0 -2", "0 0 -1"], -5.0)] {
        let m = geared(axes, reference);
        let expected =
            ModelConstraintKind::Coupling { follower: 2, leader: Some(1), coefficients: [0.0, factor, 0.0, 0.0, 0.0] };
        assert_eq!((&m.constraints()[0].kind, m.constraints()[0].name.as_str()), (&expected, "g"));
        assert!(said(&m).is_empty());
    }
    for (axes, reference) in [(["0 0 1", "0 1 0"], reference), (["0 0 1", "0 0 1"], "")] {
        let m = geared(axes, reference);
        assert!(m.constraints().is_empty());
        assert!(said(&m)[0].contains("joint `g`: the gearbox is left out"), "{:?}", said(&m));
    }
}

#[test]
fn springs_and_links_without_weight() {
    let sprung = |kind: &str, numbers: &str| {
        let dynamics = format!("<axis><xyz>0 1 0</xyz><dynamics>{numbers}</dynamics></axis>");
        let b = format!("<link name='b'><gravity>false</gravity>{INERTIAL}</link>");
        model(
            "1.9",
            &format!(
                "{}{b}{}",
                link("a"),
                joint("j", kind, ["a", "b"], &format!("<pose>0 0 0.5 0 0 0</pose>{dynamics}"))
            ),
        )
    };
    let numbers = "<spring_stiffness>5</spring_stiffness><spring_reference>0.3</spring_reference>";
    for (kind, rest) in
        [("revolute", vec![0.3]), ("prismatic", vec![0.3]), ("continuous", vec![0.3f64.cos(), 0.3f64.sin()])]
    {
        let m = sprung(kind, numbers);
        let spring = &m.springs()[0];
        assert_eq!((spring.body, spring.stiffness, &spring.rest), (1, [5.0, 0.0, 0.0], &rest));
        let carried = m.gravity_compensation()[0];
        assert_eq!((carried.body, carried.mass), (1, 2.0));
        // 2 kg at (0.1, 0, −0.5) from the joint
        close(&carried.mass_com.to_array(), &[0.2, 0.0, -1.0]);
        assert!(said(&m).is_empty());
    }
    assert!(sprung("revolute", "<spring_reference>0.3</spring_reference>").springs().is_empty());
    assert!(said(&sprung("ball", numbers))[0].contains("the spring of a ball is left out"));
    let fixed = model("1.9", &format!("<link name='a'><gravity>0</gravity>{INERTIAL}</link>"));
    assert!(fixed.gravity_compensation().is_empty());
}

/// Mass, mass times centre, and moments about the link: xx yy zz xy xz yz. Drake's numbers.
#[test]
fn inertias_of_shapes() {
    let of = |inertial: &str, collisions: &str| {
        let text = format!(
            "<sdf version='1.11'><model name='m'><frame name='f'><pose>0 0 1 0 0 0</pose></frame><link name='a'>
             <pose>1 0 0 0 0 0.5</pose>{inertial}{collisions}</link></model></sdf>"
        );
        let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), ..SdfOptions::default() };
        Model::from_sdf_str(&text, &free).map(|m| {
            let I = m.bodies()[1].inertia;
            let r = I.rotational;
            let numbers = [I.mass, I.mass_com.x, I.mass_com.y, I.mass_com.z, r.xx, r.yy, r.zz, r.xy, r.xz, r.yz];
            (numbers.to_vec(), said(&m))
        })
    };
    let auto = "<inertial auto='true'/>";
    let collision =
        |inside: &str, shape: &str| format!("<collision name='c'>{inside}<geometry>{shape}</geometry></collision>");
    let placed = "<pose>0.1 0.2 0.3 0.4 0.5 0.6</pose><density>500</density>";
    let cylinder = "<cylinder><radius>0.1</radius><length>0.4</length></cylinder>";
    #[rustfmt::skip]
    let shapes = [
        ("<box><size>0.2 0.3 0.4</size></box>", [12.0, 1.2, 2.4, 3.6, 1.762329301569, 1.411913478072, 0.765757220359, -0.219106986365, -0.410424888811, -0.727800659467]),
        ("<sphere><radius>0.2</radius></sphere>", [16.755160819146, 1.675516081915, 3.351032163829, 5.026548245744, 2.446253479595, 1.943598655021, 1.105840614064, -0.335103216383, -0.502654824574, -1.005309649149]),
        ("<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>", [12.566370614359, 1.256637061436, 2.513274122872, 3.769911184308, 1.881602913175, 1.525825153989, 0.814872459261, -0.218974806926, -0.462526642125, -0.76457414061]),
        (cylinder, [6.28318530718, 0.628318530718, 1.256637061436, 1.884955592154, 0.893056352371, 0.72744878805, 0.369170206853, -0.12279733123, -0.220645448819, -0.373026072392]),
        ("<cone><radius>0.1</radius><length>0.4</length></cone>", [2.094395102393, 0.08705688944, 0.433972469686, 0.45902709453, 0.20301650876, 0.119882318798, 0.103090802624, -0.017641878617, -0.023531720113, -0.094564433128]),
        ("<capsule><radius>0.1</radius><length>0.4</length></capsule>", [8.377580409573, 0.837758040957, 1.675516081915, 2.513274122872, 1.249565249156, 1.059859361584, 0.522197567695, -0.159834444963, -0.337884807374, -0.491979700625]),
    ];
    for (shape, expected) in shapes {
        let (found, warned) = of(auto, &collision(placed, shape)).unwrap();
        assert!(warned.is_empty(), "{warned:?}");
        let worst = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-11, "{shape}: {found:?}");
    }
    // the density of the link for shapes without one, water for those of a link without one; a mass scales all
    let density = |inertial: &str| of(inertial, &collision("", "<box><size>1 1 1</size></box>")).unwrap();
    assert_eq!(density("<inertial auto='1'><density>700</density></inertial>").0[0], 700.0);
    let (found, warned) = density(auto);
    assert_eq!(found[0], 1000.0);
    assert!(warned[0].ends_with("has no density: 1000 kg/m³, as SDF has it"));
    let (found, warned) = density("<inertial auto='true'><mass>6</mass></inertial>");
    close(&found, &[6.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(warned.is_empty());
    // a shape may stand relative to a frame
    let (found, _) =
        of(auto, &collision("<pose relative_to='f'>1 0 0 0 0 0</pose>", "<box><size>1 1 1</size></box>")).unwrap();
    close(&found[1..4], &[0.0, 0.0, 1000.0]);
    let wrong = |inertial: &str, collisions: &str| of(inertial, collisions).unwrap_err().to_string();
    assert!(wrong(auto, "").ends_with("link `a`: inertial: auto=\"true\" needs a collision, and there is none"));
    let mesh = collision("", "<mesh><uri>a.stl</uri></mesh>");
    assert!(wrong(auto, &mesh).ends_with("inertial: auto=\"true\" is not supported for the shape <mesh>"));
    assert!(wrong(auto, &collision("", "<sphere/>")).ends_with("sphere: expected a radius above 0"));
    assert!(
        wrong("<inertial auto='maybe'/>", &mesh).ends_with("inertial: auto: expected true or false, found `maybe`")
    );
}

#[test]
fn missing_inertias() {
    let of = |inside: &str| said(&model("1.9", &format!("<link name='a'>{inside}</link>")));
    let warned = |inside: &str, what: &str| {
        let found = of(inside);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].ends_with(what), "{found:?}");
    };
    warned("", "link `a`: has no <inertial>: 1 kg and 1 kg m², as SDF has it");
    warned("<inertial><mass>0</mass></inertial>", "inertial: has no ixx, iyy, izz: 1 kg m², as SDF has it");
    let moments = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>";
    warned(&format!("<inertial>{moments}</inertial>"), "inertial: has no mass: 1 kg, as SDF has it");
    let some = "<inertial><mass>1</mass><inertia><ixx>1</ixx><izz>1</izz></inertia></inertial>";
    warned(some, "inertial: has no iyy: 1 kg m², as SDF has it");
    let added = format!("<inertial><mass>1</mass>{moments}<fluid_added_mass><xx>1</xx></fluid_added_mass></inertial>");
    warned(&added, "fluid_added_mass is left out: the link moves as in a vacuum");
    let density = format!("<inertial><mass>1</mass><density>3</density>{moments}</inertial>");
    warned(&density, "density is left out: it counts only with auto=\"true\"");
    let frame = format!("<inertial><pose relative_to='a'/><mass>1</mass>{moments}</inertial>");
    warned(&frame, "inertial: the pose is in the link's frame, not relative to `a`");
}

/// What is misspelt, misplaced, or known and not held is a warning; what is only drawn or sensed is none.
#[test]
fn what_a_model_does_not_hold() {
    let turn = |inside: &str| joint("j", "revolute", ["a", "b"], inside);
    let axis = |inside: &str| turn(&format!("<axis><xyz>0 1 0</xyz>{inside}</axis>"));
    let with = |inside: &str| said(&model("1.9", &format!("{}{}{inside}", link("a"), link("b"))));
    let whole =
        "<visual name='v'><geometry/><mteral/></visual><sensor name='s' type='imu'><x/></sensor><light name='l'/>";
    let fine = [
        axis("<limit><stiffness>1e8</stiffness><dissipation>1</dissipation></limit>"),
        turn(
            "<axis/><sensor name='f' type='force_torque'><x/></sensor><physics><ode><cfm_damping>1</cfm_damping><limit><cfm>0</cfm></limit></ode></physics>",
        ),
        format!("{}<plugin name='p' filename='f'><anything/></plugin><self_collide>true</self_collide>", axis("")),
        format!("{}<link name='c'>{INERTIAL}{whole}<collision name='x'><surface/></collision></link>", axis(""))
            + &joint("k", "fixed", ["a", "c"], ""),
    ];
    for inside in &fine {
        assert_eq!(with(inside), Vec::<String>::new());
    }
    let cases = [
        (
            axis("<dynamics><dampng>1</dampng></dynamics>"),
            "unknown element <dampng> in <dynamics>; nearest is `damping`",
        ),
        (
            axis("").replace("<xyz>", "<xyz expresed_in='a'>"),
            "unknown attribute `expresed_in`; nearest is `expressed_in`",
        ),
        (axis("").replace("</axis>", "</axis><damping>1</damping>"), "misplaced element <damping> in <joint>"),
        (axis("<initial_position>1</initial_position>"), "initial_position is left out"),
        (turn("<axis/><physics><ode><max_force>2</max_force></ode></physics>"), "the max_force 2 of its motor in ODE"),
        (
            turn("<axis/><physics><ode><suspension><cfm>1</cfm></suspension></ode></physics>"),
            "the suspension is left out",
        ),
        (axis("") + "<enable_wind>true</enable_wind>", "enable_wind is left out"),
        (
            axis("").replace("revolute", "continuous").replace("</xyz>", "</xyz><limit><lower>0</lower></limit>"),
            "limits 0 and inf are left out: a continuous joint has none",
        ),
    ];
    for (inside, what) in cases {
        let found = with(&inside);
        assert!(found.iter().any(|w| w.contains(what)), "{what}\n{found:?}");
        let text = format!("<sdf version='1.9'><model name='m'>{}{}{inside}</model></sdf>", link("a"), link("b"));
        let strict = SdfOptions { strict: true, ..SdfOptions::default() };
        assert!(matches!(Model::from_sdf_str(&text, &strict), Err(Error::Strict { .. })));
        let allow = vec![WarningKind::LeftOut, WarningKind::Unknown, WarningKind::Assumed];
        assert!(Model::from_sdf_str(&text, &SdfOptions { allow, ..strict }).is_ok());
    }
    for (inside, what) in [
        ("<kinematic>true</kinematic>", "kinematic is left out"),
        ("<velocity_decay><linear>0.1</linear></velocity_decay>", "velocity_decay: linear 0.1 is left out"),
        ("<enable_wind>1</enable_wind>", "enable_wind is left out"),
        ("<inertal/>", "unknown element <inertal> in <link>; nearest is `inertial`"),
    ] {
        let found = said(&model("1.9", &format!("<link name='a'>{INERTIAL}{inside}</link>")));
        assert!(found.iter().any(|w| w.contains(what)), "{what}\n{found:?}");
    }
    for inside in
        ["<kinematic>false</kinematic><velocity_decay/><enable_wind/>", "<must_be_base_link>1</must_be_base_link>"]
    {
        let found = said(&model("1.9", &format!("<link name='a'>{INERTIAL}{inside}</link>")));
        assert_eq!(found, Vec::<String>::new());
    }
    let world = "<sdf version='1.6'><world name='w'><population name='p'/><state world_name='w'/><scene/><gui/>
      <model name='m'><link name='a'/></model></world></sdf>";
    let found = said(&read(world).unwrap());
    assert!(found[0].contains("the models of a population are left out"), "{found:?}");
    assert!(found[1].contains("the positions of a saved state are left out"), "{found:?}");
}

#[test]
fn values_that_are_none() {
    let cases = [
        ("<link name='a'><gravity>no</gravity></link>", "link `a`: gravity: expected true or false, found `no`"),
        ("<static>yes</static><link name='a'/>", "model `m`: static: expected true or false, found `yes`"),
        (
            "<link name='a'><pose degrees='2'>0 0 0 0 0 0</pose></link>",
            "pose: degrees: expected true or false, found `2`",
        ),
        (
            "<link name='a'><pose rotation_format='rpy'>0 0 0 0 0 0</pose></link>",
            "pose: rotation_format `rpy` is unknown; known are euler_rpy and quat_xyzw",
        ),
        (
            "<link name='a'><pose rotation_format='quat_xyzw' degrees='true'>0 0 0 0 0 0 1</pose></link>",
            "pose: a quaternion is not in degrees",
        ),
        ("<link name='a'/><link name='world'/>", "link `world`: the name belongs to SDF"),
        (
            "<link name='a'/><joint name='j' type='hinge'><parent>world</parent><child>a</child></joint>",
            "joints of type `hinge` are not supported; known are fixed, revolute, continuous, prismatic, screw, ball, universal, revolute2 and gearbox",
        ),
        (
            "<link name='a'/><joint name='j' type='fixed'><parent>a</parent><child>world</child></joint>",
            "joint `j`: its child is the world",
        ),
        (
            "<link name='a'/><joint name='j' type='fixed'><parent>a</parent><child>a</child></joint>",
            "joint `j`: its parent and its child are one link, `a`",
        ),
        (
            "<link name='a'/><link name='b'/><joint name='j' type='revolute'><parent>a</parent><child>b</child>
            <axis><dynamics><spring_stiffness>-1</spring_stiffness></dynamics></axis></joint>",
            "spring_stiffness -1 is below 0",
        ),
    ];
    for (inside, what) in cases {
        let text = format!("<sdf version='1.9'><model name='m'>{inside}</model></sdf>");
        let error = read(&text).expect_err(what).to_string();
        assert!(error.contains(what), "{error}\n{what}");
    }
    // empty ones are the default, and a type may have capitals
    let m = model("1.9", "<static/><link name='a'><pose/><gravity/></link><link name='b'/>
      <joint name='j' type='Revolute'><parent>a</parent><child>b</child><axis><xyz/><limit><upper/></limit></axis></joint>");
    assert_eq!((m.nv(), m.limits().upper[0]), (1, f64::INFINITY));
}

const NESTED: &str = "<world name='w'><model name='outer' placement_frame='inner::tip'><pose>1 2 3 0 0 0.5</pose>
  LINK_base<model name='inner'><pose relative_to='base'>0.1 0 0.2 0 0.3 0</pose>LINK_arm
    <frame name='tip' attached_to='arm'><pose>0 0.2 0 0 0 0</pose></frame>
    <joint name='wrist' type='revolute'><parent>arm</parent><child>hand</child><axis><xyz>1 0 0</xyz></axis></joint>
    <link name='hand'><pose relative_to='tip'>0.1 0 0 0.2 0 0</pose></link></model>
  <joint name='shoulder' type='revolute'><parent>base</parent><child>inner::arm</child><axis><xyz>0 1 0</xyz></axis></joint>
  <frame name='knuckle' attached_to='inner'><pose relative_to='inner::wrist'>0 0 0.1 0 0 0</pose></frame>
  </model></world>";

#[test]
fn models_in_models() {
    let text = NESTED.replace("LINK_base", &link("base")).replace("LINK_arm", &link_at("arm", "0 0 0.4 0 0 0"));
    let m = read(&format!("<sdf version='1.9'>{text}</sdf>")).unwrap();
    let names: Vec<_> = m.bodies().iter().skip(1).map(|b| (b.joint_name.as_str(), b.name.as_str())).collect();
    assert_eq!(names, [("shoulder", "inner::arm"), ("inner::wrist", "inner::hand")]);
    // the tip stands where the pose of the model is; the frame of inner is fixed to its first link, the arm
    let base = frame(&m, "base", FrameKind::Link);
    let tip = m.bodies()[1].placement * frame(&m, "inner::tip", FrameKind::User);
    close(&tip.translation.to_array(), &[1.0, 2.0, 3.0]);
    let inner = m.bodies()[1].placement * frame(&m, "inner", FrameKind::User);
    let (c, s) = (0.3f64.cos(), 0.3f64.sin());
    close(&(base.inverse() * inner).translation.to_array(), &[0.1, 0.0, 0.2]);
    close(&(base.inverse() * inner).rotation.x.to_array(), &[c, 0.0, -s]);
    assert_eq!(m.frames().iter().find(|f| f.name == "knuckle").unwrap().body, 1);
    let wrong = text.replace("attached_to='arm'", "attached_to='amr'");
    let error = read(&format!("<sdf version='1.9'>{wrong}</sdf>")).unwrap_err().to_string();
    assert!(error.contains("frame `tip`: no link, joint or frame is named `amr`; nearest is `arm`"), "{error}");
    // names from outside are not known inside
    let wrong = text.replace("<pose relative_to='tip'>", "<pose relative_to='base'>");
    let error = read(&format!("<sdf version='1.9'>{wrong}</sdf>")).unwrap_err().to_string();
    assert!(error.contains("link `hand`: no link, joint or frame is named `base`"), "{error}");
}

/// A frame is fixed to the link that its model's frame is fixed to, not to the world.
#[test]
fn the_frame_of_a_model_moves_with_its_link() {
    let inside =
        format!("{}{}<frame name='f'><pose>0 0 1 0 0 0</pose></frame>", link("a"), link_at("b", "1 0 0 0 0 0"));
    let turn = joint("j", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let read = |attribute: &str| {
        let text = format!("<sdf version='1.9'><model name='m'{attribute}>{inside}{turn}</model></sdf>");
        let free = SdfOptions { root_joint: Some(Joint::FreeFlyer), ..SdfOptions::default() };
        let m = Model::from_sdf_str(&text, &free).unwrap();
        m.frames().iter().find(|f| f.name == "f").map(|f| (f.body, f.placement.translation.to_array())).unwrap()
    };
    assert_eq!(read(""), (1, [0.0, 0.0, 1.0]));
    assert_eq!(read(" canonical_link='b'"), (2, [-1.0, 0.0, 1.0]));
}

/// Old files wrote nested models flat: names and frames with `::`.
#[test]
fn flat_names() {
    let inside = format!(
        "<frame name='in::__model__' attached_to='in::a'><pose relative_to='__model__'>0 0 1 0 0 0</pose></frame>
         <link name='in::a'><pose relative_to='in::__model__'>0 0 1 0 0 0</pose>{INERTIAL}</link>
         <link name='in::b'><pose relative_to='in'>1 0 0 0 0 0</pose>{INERTIAL}</link>{}",
        joint("in::j", "fixed", ["in::a", "in::b"], "")
    );
    let m = model("1.7", &inside);
    assert_eq!(frame(&m, "in::a", FrameKind::Link).translation, Vec3::new(0.0, 0.0, 2.0));
    assert_eq!(frame(&m, "in::b", FrameKind::Link).translation, Vec3::new(1.0, 0.0, 1.0));
}

fn part(version: &str, mass: &str) -> String {
    format!(
        "<sdf version='{version}'><model name='part'><pose>5 5 5 0 0 0</pose><static>0</static>
         <link name='arm'><pose>0 0 0.4 0 0 0</pose><inertial><mass>{mass}</mass></inertial></link>
         <frame name='flange'><pose>0 0.1 0 0 0 0</pose></frame></model></sdf>"
    )
}

#[test]
fn included_files() {
    let folder = folder("included");
    write(&folder, "models/part/model.sdf", &part("1.5", "5"));
    write(&folder, "models/part/new.sdf", &part("1.9", "9"));
    write(&folder, "models/part/future.sdf", &part("1.99", "99"));
    write(
        &folder,
        "models/part/model.config",
        "<?xml version='1.0'?><model><name>part</name><sdf version='1.5'>model.sdf</sdf>
         <sdf version='1.9'>new.sdf</sdf><sdf version='1.99'>future.sdf</sdf></model>",
    );
    write(&folder, "models/plain/model.sdf", &part("1.6", "6"));
    let robot = |include: &str| {
        let text =
            format!("<sdf version='1.9'><model name='m'>{}\n<include>{include}</include></model></sdf>", link("base"));
        write(&folder, "robots/robot.sdf", &text);
        Model::from_sdf(folder.join("robots/robot.sdf"), &SdfOptions::default())
    };
    let mass = |m: &Model| m.bodies()[0].inertia.mass - 2.0;
    let uri = |uri: &str| mass(&robot(&format!("<uri>{uri}</uri>")).unwrap());
    for address in ["model://part", "part", "../models/part", "package://part/new.sdf", "models/part/new.sdf"] {
        assert_eq!(uri(address), 9.0, "{address}");
    }
    assert_eq!(uri("../models/part/model.sdf"), 5.0);
    assert_eq!(uri("model://plain"), 6.0);
    let absolute = folder.join("models/part/new.sdf").display().to_string();
    assert_eq!((uri(&absolute), uri(&format!("file://{absolute}"))), (9.0, 9.0));

    let m = robot("<uri>model://part</uri>").unwrap();
    assert_eq!(frame(&m, "part::arm", FrameKind::Link).translation, Vec3::new(5.0, 5.0, 5.4));
    let m = robot("<uri>model://part</uri><name>tool</name><pose relative_to='base'>0 0 1 0 0 0</pose>").unwrap();
    assert_eq!(frame(&m, "tool::arm", FrameKind::Link).translation, Vec3::new(0.0, 0.0, 1.4));
    let at = "<uri>part</uri><pose>0 0 1 0 0 0</pose><placement_frame>flange</placement_frame><static>true</static>";
    let m = robot(at).unwrap();
    assert_eq!(frame(&m, "part::arm", FrameKind::Link).translation, Vec3::new(0.0, -0.1, 1.4));
    assert_eq!(said(&m).iter().filter(|w| w.contains("no joint carries it")).count(), 0, "{:?}", said(&m));

    // merged: its names are the model's, its frame keeps its place
    write(
        &folder,
        "robots/robot.sdf",
        &format!(
            "<sdf version='1.9'><model name='m'>{}<include merge='true'><uri>part</uri><pose>0 0 1 0 0 0</pose></include>{}</model></sdf>",
            link("base"),
            joint("k", "fixed", ["base", "arm"], "")
        ),
    );
    let m = Model::from_sdf(folder.join("robots/robot.sdf"), &SdfOptions::default()).unwrap();
    close(&frame(&m, "arm", FrameKind::Link).translation.to_array(), &[0.0, 0.0, 1.4]);
    close(&frame(&m, "flange", FrameKind::User).translation.to_array(), &[0.0, 0.1, 1.0]);

    let error = |include: &str| robot(include).unwrap_err().to_string();
    assert!(error("").contains("robot.sdf:3: <include>: has no uri"));
    let missing = error("<uri>model://nowhere</uri>");
    assert!(
        missing.contains("<include>: model://nowhere: no such file in a package `nowhere`; looked for "),
        "{missing}"
    );
    assert!(error("<uri>https://example.org/part</uri>").contains("models of the network are not fetched"));
    assert!(
        error("<uri>part</uri><placement_frame>flange</placement_frame>").contains("has a placement_frame and no pose")
    );
    assert!(error("<uri>robot.sdf</uri>").contains("robot.sdf includes itself"));
    write(&folder, "models/two/model.sdf", "<sdf version='1.5'><model name='a'/><model name='b'/></sdf>");
    assert!(error("<uri>model://two</uri>").contains("found a second: model `b`"));
    write(&folder, "models/empty/model.config", "<model/>");
    assert!(error("<uri>model://empty</uri>").contains("names no <sdf> file"));
    write(&folder, "models/empty/model.config", "<model><sdf>gone.sdf</sdf></model>");
    assert!(error("<uri>model://empty</uri>").contains("there is no file"));
    // errors inside name their file
    write(&folder, "models/bad/model.sdf", "<sdf version='1.5'>\n<model name='a'><link/></model></sdf>");
    assert!(error("<uri>model://bad</uri>").contains("bad/model.sdf:2: <link>: has no name"));
    fs::remove_dir_all(&folder).unwrap();
}

/// A world without its sun is a world; a world of missing models alone is none.
#[test]
fn worlds_that_include_what_is_missing() {
    let world = |inside: &str| {
        read(&format!(
            "<sdf version='1.6'><world name='w'><include><uri>model://no_sun_here</uri></include>{inside}</world></sdf>"
        ))
    };
    let m = world(&format!("<model name='m'>{}</model>", link("a"))).unwrap();
    assert!(
        said(&m)[0].contains("<include>: the included model is left out: model://no_sun_here: no such file"),
        "{:?}",
        said(&m)
    );
    assert!(matches!(m.warnings()[0], Warning::LeftOut { .. }));
    assert!(world("").unwrap_err().to_string().contains("no_sun_here"));
}

/// Files that include each other, deep and long names: an error at once.
#[test]
fn files_that_grow() {
    let folder = folder("grow");
    for k in 0..300 {
        let next = format!("<include><name>{}</name><uri>{}.sdf</uri></include>", "n".repeat(1000), k + 1);
        write(
            &folder,
            &format!("{k}.sdf"),
            &format!("<sdf version='1.9'><model name='m'><link name='a'/>{next}</model></sdf>"),
        );
    }
    write(&folder, "300.sdf", "<sdf version='1.9'><model name='m'><link name='a'/></model></sdf>");
    let read = |name: &str| Model::from_sdf(folder.join(name), &SdfOptions::default()).unwrap_err().to_string();
    assert!(read("0.sdf").ends_with("files included: at most 256 are allowed"), "{}", read("0.sdf"));
    let many = |file: &str, count: usize| {
        let includes: String =
            (0..count).map(|k| format!("<include><name>{k}</name><uri>{file}</uri></include>")).collect();
        format!("<sdf version='1.9'><model name='m'>{includes}</model></sdf>")
    };
    write(&folder, "a.sdf", &many("b.sdf", 1000));
    write(&folder, "b.sdf", &many("c.sdf", 1000));
    write(&folder, "c.sdf", &many("300.sdf", 1000));
    assert!(read("a.sdf").ends_with("16385 files are included, at most 16384 are allowed"), "{}", read("a.sdf"));
    let long = "n".repeat(200_000);
    let links: String = (0..2000).map(|k| format!("<link name='{k}'/>")).collect();
    let text = format!("<sdf version='1.9'><model name='m'><model name='{long}'>{links}</model></model></sdf>");
    let error = fault(&text);
    assert!(error.ends_with("bytes so far, at most 67108864 are allowed"), "{error}");
    fs::remove_dir_all(&folder).unwrap();
}

fn fault(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

/// A follower of a follower follows the first leader.
#[test]
fn chains_of_followers() {
    let turn = |name: &str, ends, inside: &str| {
        joint(name, "revolute", ends, &format!("<axis><xyz>0 0 1</xyz>{inside}</axis>"))
    };
    let mimic = |leader: &str| {
        format!(
            "<mimic joint='{leader}'><multiplier>2</multiplier><offset>0.5</offset><reference>0.1</reference></mimic>"
        )
    };
    let links = ["a", "b", "c", "d"].map(link).concat();
    let chain = |last: &str| {
        let joints =
            turn("j", ["a", "b"], last) + &turn("l", ["c", "d"], &mimic("k")) + &turn("k", ["b", "c"], &mimic("j"));
        let text = format!("<sdf version='1.11'><model name='m'>{links}{joints}</model></sdf>");
        Model::from_sdf_str(&text, &SdfOptions { mimic: true, ..SdfOptions::default() })
    };
    let m = chain("").unwrap();
    assert_eq!(m.nv(), 1);
    let rules: Vec<_> =
        m.bodies().iter().filter_map(|b| b.mimic.map(|r| (b.joint_name.as_str(), r.ratio, r.offset))).collect();
    // 2 (2 (q − 0.1) + 0.5 − 0.1) + 0.5
    assert_eq!(rules.iter().map(|r| (r.0, r.1)).collect::<Vec<_>>(), [("k", 2.0), ("l", 4.0)]);
    close(&[rules[0].2, rules[1].2], &[0.3, 0.9]);
    assert!(chain(&mimic("l")).unwrap_err().to_string().ends_with("mimic: follows itself, through others"));
}

/// Of two links and a joint of one name, as older files have them, references mean the link.
#[test]
fn joints_named_as_links() {
    let turn = joint("b", "revolute", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let m = model("1.6", &format!("{}{turn}{}", link("a"), link_at("b", "0 0 1 0 0 0")));
    assert_eq!((m.nv(), m.bodies()[1].joint_name.as_str(), m.bodies()[1].name.as_str()), (1, "b", "b"));
}

/// A screw without a pitch turns once for each metre.
#[test]
fn a_screw_without_a_pitch() {
    let screw = joint("j", "screw", ["a", "b"], "<axis><xyz>0 0 1</xyz></axis>");
    let m = model("1.9", &format!("{}{}{screw}", link("a"), link("b")));
    let Joint::Helical { pitch, .. } = m.bodies()[1].joint else { panic!("no screw") };
    assert_eq!(pitch, 1.0 / core::f64::consts::TAU);
    assert!(said(&m)[0].ends_with("has no screw_thread_pitch: 1 m for each turn, as SDF has it"));
}
