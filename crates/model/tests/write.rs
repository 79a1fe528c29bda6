//! Tests of robots that are written into a copy of their file. Only differences are edited, all other bytes are kept,
//! and the new file reproduces the model.
#![allow(non_snake_case)] // the variable I is an inertia

use condyle_model::{Inertia, MjcfOptions, Model, Sym3, UrdfOptions, Vec3, robots};
use std::fs;
use std::path::PathBuf;

/// Creates a folder for one test.
fn folder(test: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("condyle_write_{test}_{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

/// Returns the text of the file into which a changed robot was written, or the error. `change` returns the changed
/// robot.
fn written(test: &str, text: &str, change: impl Fn(&Model) -> Model) -> Result<String, String> {
    let is_urdf = text.contains("<robot");
    let read = |path: &PathBuf| match is_urdf {
        true => Model::from_urdf(path, &UrdfOptions::default()),
        false => Model::from_mjcf(path, &MjcfOptions::default()),
    };
    let folder = folder(test);
    let (original, path) = (folder.join("original.xml"), folder.join("new.xml"));
    fs::write(&original, text).expect("a file");
    let model = change(&read(&original).map_err(|e| e.to_string())?);
    let result = match is_urdf {
        true => model.write_urdf(&path, &original),
        false => model.write_mjcf(&path, &original),
    };
    let done = result.map_err(|e| e.to_string()).map(|()| {
        let file = read(&path).expect("the new file is read");
        for (i, (a, b)) in model.bodies().iter().zip(file.bodies()).enumerate() {
            close(a.inertia, b.inertia, &format!("body {i}"));
        }
        for (v, (a, b)) in model.armature().iter().zip(file.armature()).enumerate() {
            assert!((a - b).abs() <= 1e-13 * (1.0 + a.abs()), "armature {v}: {a} and {b}");
        }
        fs::read_to_string(&path).expect("text")
    });
    assert_eq!(fs::read_to_string(&original).expect("text"), text, "the original stays as it is");
    fs::remove_dir_all(folder).expect("the folder of this test");
    done
}

#[track_caller]
fn close(a: Inertia<f64>, b: Inertia<f64>, what: &str) {
    let numbers = |I: Inertia<f64>| condyle_model::inertial_parameters::from_inertia(I);
    let (a, b) = (numbers(a), numbers(b));
    let scale = a.iter().fold(1e-3, |scale: f64, x| scale.max(x.abs()));
    let same = a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * scale);
    assert!(same, "{what}: {a:?} and {b:?}");
}

/// Returns an inertia that is physically possible and different for each i.
fn other(i: usize) -> Inertia<f64> {
    let x = 1.0 + 0.1 * i as f64;
    let about = Sym3 { xx: 0.03 * x, xy: 0.001, yy: 0.04, xz: -0.002, yz: 0.003, zz: 0.05 };
    Inertia::from_com(x, Vec3::new(0.01, -0.02 * x, 0.03), about)
}

fn with_other_inertias(model: &Model) -> Model {
    // bodies that connect joints of a chain have no mass and no element in the file
    let keeps = |i: usize| i == 0 || model.bodies()[i].name.contains('#');
    model.with_inertias(|i, I| if keeps(i) { I } else { other(i) }).expect("a model")
}

const LEG: &str = "<?xml version=\"1.0\"?>
<!-- a leg; every word of this stays -->
<robot  name='leg' xmlns:k=\"about:k\">
\t<link name=\"base\"/>
\t<link name=\"thigh\">
\t\t<visual><geometry><mesh filename=\"thigh.stl\"/></geometry></visual>
\t\t<inertial> <!-- weighed -->
\t\t\t<origin rpy=\"0 0 0.3\" xyz=\"0 0 0\" />
\t\t\t<mass value = \"2.0\"/>
\t\t\t<inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/>
\t\t</inertial>
\t</link>
\t<link name='foot' ><visual/></link>
\t<joint name=\"hip\" type=\"revolute\">
\t\t<parent link=\"base\"/><child link=\"thigh\"/>
\t\t<limit lower=\"-1\" upper=\"1\" effort=\"10\" velocity=\"3\"/>
\t</joint>
\t<joint name=\"ankle\" type=\"continuous\"><parent link=\"thigh\"/><child link=\"foot\"/></joint>
</robot>
";

#[test]
fn an_unchanged_robot_gives_the_same_bytes() {
    assert_eq!(written("same", LEG, Clone::clone).unwrap(), LEG);
    for text in [robots::ARM7, robots::QUADRUPED, robots::HUMANOID] {
        assert_eq!(written("same", text, Clone::clone).unwrap(), text);
    }
}

#[test]
fn only_the_inertial_of_a_link_is_edited() {
    let I = Inertia::from_com(2.5, Vec3::new(0.0, 0.0, -0.25), Sym3::diagonal(0.125));
    let text = written("inertial", LEG, |m| m.with_inertias(|i, old| if i == 1 { I } else { old }).unwrap()).unwrap();
    let expected = LEG
        .replace("<origin rpy=\"0 0 0.3\" xyz=\"0 0 0\" />", "<origin xyz=\"0 0 -0.25\" />")
        .replace("value = \"2.0\"", "value = \"2.5\"")
        .replace("ixx=\"0.1\"", "ixx=\"0.125\"")
        .replace("iyy=\"0.1\"", "iyy=\"0.125\"")
        .replace("izz=\"0.1\"", "izz=\"0.125\"");
    assert_eq!(text, expected);
}

#[test]
fn a_link_without_inertial_gets_one() {
    let I = Inertia::from_com(0.5, Vec3::zero(), Sym3::diagonal(0.25));
    let text = written("insert", LEG, |m| m.with_inertias(|i, old| if i == 2 { I } else { old }).unwrap()).unwrap();
    let inertia = "<inertia ixx=\"0.25\" ixy=\"0\" ixz=\"0\" iyy=\"0.25\" iyz=\"0\" izz=\"0.25\"/>";
    let inertial = format!("<inertial><origin xyz=\"0 0 0\"/><mass value=\"0.5\"/>{inertia}</inertial>");
    assert_eq!(text, LEG.replace("'foot' ><visual/>", &format!("'foot' >{inertial}<visual/>")));
}

#[test]
fn limits_and_losses_are_written_where_they_differ() {
    let change = |m: &Model| {
        let mut limits = m.limits().clone();
        (limits.upper[0], limits.velocity[0]) = (0.5, 4.0);
        (limits.effort_lower[0], limits.effort_upper[0]) = (-20.0, 20.0);
        (limits.effort_lower[1], limits.effort_upper[1], limits.velocity[1]) = (-7.0, 7.0, 9.0);
        m.clone().with_limits(limits).unwrap()
    };
    let text = written("limits", LEG, change).unwrap();
    let expected = LEG
        .replace(
            "lower=\"-1\" upper=\"1\" effort=\"10\" velocity=\"3\"",
            "lower=\"-1\" upper=\"0.5\" effort=\"20\" velocity=\"4\"",
        )
        .replace("<parent link=\"thigh\"/>", "<limit effort=\"7\" velocity=\"9\"/><parent link=\"thigh\"/>");
    assert_eq!(text, expected);
}

#[test]
fn armature_is_written_as_the_inertia_of_a_rotor() {
    let armature = |m: &Model| m.clone().with_armature(&[0.5, 0.125]).unwrap();
    let rotor = |x| format!("<drake:rotor_inertia xmlns:drake=\"http://drake.mit.edu\" value=\"{x}\"/>");
    let of = |joint: &str, x| {
        let kind = "<type>transmission_interface/SimpleTransmission</type>"; // Drake requires this element
        let inside = format!("{kind}<joint name=\"{joint}\"/><actuator name=\"{joint}\">{}</actuator>", rotor(x));
        format!("\n\t<transmission name=\"{joint}\">{inside}</transmission>")
    };
    let begin = "xmlns:k=\"about:k\">";
    let expected = LEG.replace(begin, &format!("{begin}{}{}", of("hip", "0.5"), of("ankle", "0.125")));
    assert_eq!(written("armature", LEG, armature).unwrap(), expected);
    // a rotor is added to an existing transmission without a rotor; an existing rotor changes according to the gear
    // ratio
    let hip =
        "<transmission name='t'><joint name='hip'/><actuator name='m'><mechanicalReduction>5</mechanicalReduction>";
    let ankle = "<transmission name='u'><joint name='ankle'/><actuator name='n'><drake:gear_ratio value='2'/>";
    let end = "</actuator></transmission>\n";
    let inertia = "<drake:rotor_inertia value='7'/>";
    let text = LEG.replace("</robot>", &format!("{hip}{end}{ankle}{inertia}{end}</robot>"));
    let expected = text
        .replace("<mechanicalReduction>", &format!("{}<mechanicalReduction>", rotor("0.5")))
        .replace("value='7'", "value='0.03125'");
    assert_eq!(written("armature", &text, armature).unwrap(), expected);
}

#[test]
fn numbers_that_a_urdf_cannot_represent_are_errors() {
    let limited = |change: fn(&mut condyle_model::Limits)| {
        move |m: &Model| {
            let mut limits = m.limits().clone();
            change(&mut limits);
            m.clone().with_limits(limits).unwrap()
        }
    };
    for (end, change) in [
        (
            "joint `hip`: effort from -2 to 10: a URDF has one limit for both directions",
            Box::new(limited(|l| l.effort_lower[0] = -2.0)) as Box<dyn Fn(&Model) -> Model>,
        ),
        ("joint `hip`: upper inf: a URDF has no infinite limits", Box::new(limited(|l| l.upper[0] = f64::INFINITY))),
        (
            "joint `ankle`: velocity inf: a URDF has no infinite limits",
            Box::new(limited(|l| (l.effort_lower[1], l.effort_upper[1]) = (-1.0, 1.0))),
        ),
        (
            "gravity (m/s²) is [0.0, 0.0, -1.6] in the model and [0.0, 0.0, -9.81] in the file",
            Box::new(|m| m.clone().with_gravity(Vec3::new(0.0, 0.0, -1.6)).unwrap()),
        ),
        (
            "the model has 6 frames and the file 5",
            Box::new(|m| m.with_frame("tip", "foot", condyle_model::Se3::identity()).unwrap()),
        ),
        ("joint `hip` of the file is another one in the model, `joint1`", Box::new(|_| robots::arm7())),
        (
            "link `thigh`: mass 0 and first moment [1.0, 0.0, 0.0] kg m have no centre",
            Box::new(|m| {
                let h = Inertia { mass_com: Vec3::new(1.0, 0.0, 0.0), ..Inertia::zero() };
                m.with_inertias(|i, I| if i == 1 { h } else { I }).unwrap()
            }),
        ),
    ] {
        let said = written("errors", LEG, change).expect_err(end);
        assert!(said.contains(end), "{said}\n{end}");
    }
}

#[test]
fn links_that_fixed_joints_merge_keep_their_inertias() {
    let fixed = |name: &str, on: &str, mass: f64, z: f64| {
        let inertia = "<inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/>";
        let link = format!("<link name='{name}'><inertial><mass value='{mass}'/>{inertia}</inertial></link>");
        let ends = format!("<parent link='{on}'/><child link='{name}'/>");
        format!("{link}\n<joint name='{name}' type='fixed'>{ends}<origin xyz='0 0.1 {z}' rpy='0.2 0 0.1'/></joint>\n")
    };
    let bolts = fixed("bolt", "thigh", 0.25, 0.5) + &fixed("nut", "bolt", 0.125, -0.5);
    let text = LEG.replace("</robot>", &(bolts.clone() + "</robot>"));
    let more = |m: &Model| m.with_inertias(|i, I| if i == 0 { I } else { I + other(i) }).unwrap();
    let new = written("merged", &text, more).unwrap();
    assert!(new.contains(&bolts), "{new}");
    // after subtracting the inertia of the other links, the moving link would have a negative or impossible inertia, so
    // the whole inertia is written to the moving link
    let new = written("merged", &text, with_other_inertias).unwrap();
    assert_eq!(new.matches("<mass value='0'/>").count(), 2, "{new}");
    let small = |m: &Model| m.with_inertias(|i, I| if i == 1 { other(1).scale(0.1) } else { I }).unwrap();
    let new = written("merged", &text, small).unwrap();
    assert!(!new.contains(&bolts) && new.matches("<mass value='0'/>").count() == 2, "{new}");
    // if the moving link has no mass, the difference is written to the heaviest link
    let light = text.replace("value = \"2.0\"", "value = \"0\"");
    let heavier = |m: &Model| m.with_inertias(|i, I| if i == 1 { I.scale(2.0) } else { I }).unwrap();
    let new = written("merged", &light, heavier).unwrap();
    let masses: Vec<&str> = new.split("mass value").skip(1).map(|rest| rest.split('/').next().unwrap()).collect();
    assert_eq!(masses, [" = \"0\"", "='0.625'", "='0.125'"]);
}

#[test]
fn robots_of_the_library_come_back() {
    for text in [robots::ARM7, robots::QUADRUPED, robots::HUMANOID] {
        written("robots", text, with_other_inertias).unwrap();
    }
}

#[test]
fn a_root_joint_is_found_in_the_model() {
    let folder = folder("root");
    let (original, path) = (folder.join("original.urdf"), folder.join("new.urdf"));
    fs::write(&original, robots::QUADRUPED).unwrap();
    let options = UrdfOptions { root_joint: Some(condyle_model::Joint::FreeFlyer), ..UrdfOptions::default() };
    let model = with_other_inertias(&Model::from_urdf(&original, &options).unwrap());
    model.write_urdf(&path, &original).unwrap();
    let file = Model::from_urdf(&path, &options).unwrap();
    for (a, b) in model.bodies().iter().zip(file.bodies()) {
        close(a.inertia, b.inertia, &a.name);
    }
    // the new file may replace the original file
    model.write_urdf(&path, &path).unwrap();
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn files_that_parsers_of_robots_accept_are_edited_too() {
    let text = "<!-- first -->\n<?xml version='1.0'?><!DOCTYPE robot>\n".to_owned() + LEG.split_once('\n').unwrap().1;
    let text = text.replace("</robot>", "<gazebo><sensor:camera a='>'/></gazebo><!-- a -- b --></robot>");
    assert_eq!(written("accepted", &text, Clone::clone).unwrap(), text);
    written("accepted", &text, with_other_inertias).unwrap();
    let folder = folder("latin");
    let (original, path) = (folder.join("original.urdf"), folder.join("new.urdf"));
    let text =
        LEG.replace("version=\"1.0\"", "version=\"1.0\" encoding=\"ISO-8859-1\"").replace("a leg", "ein Fu\u{df}");
    let latin: Vec<u8> = text.chars().map(|c| c as u32 as u8).collect();
    fs::write(&original, latin).unwrap();
    let said = Model::from_urdf(&original, &UrdfOptions::default()).unwrap().write_urdf(&path, &original).unwrap_err();
    assert!(said.to_string().ends_with("is not in UTF-8, so a copy of it cannot keep all else as it is"), "{said}");
    fs::remove_dir_all(folder).unwrap();
}

const HAND: &str = "<mujoco model='hand'>
  <default>
    <joint armature='0.5' damping='2'/>
    <default class='finger'><joint limited='false' range='-9 9' frictionloss='0.25'/></default>
  </default>
  <worldbody>
    <body name='palm'>
      <joint name='wrist' axis='0 1 0' range='-90 90'/>
      <geom type='box' size='0.1 0.1 0.1' mass='1'/>
      <body pos='0.1 0.2 0.3' euler='10 20 30'>
        <inertial pos='0 0 0.1' mass='0.25' diaginertia='0.01 0.02 0.025' euler='0 45 0'/>
        <site name='mark'/>
        <body name='finger' pos='0 0 0.2' childclass='finger'>
          <joint pos='0 0 0.1' ref='30'/><!-- unnamed -->
          <joint name='slide' type='slide' axis='1 0 0'/>
          <inertial pos='0 0 0.1' mass='0.5' fullinertia='0.02 0.02 0.02 0.001 0.002 0.003'/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
";

#[test]
fn an_mjcf_keeps_all_but_the_numbers_that_differ() {
    assert_eq!(written("hand", HAND, Clone::clone).unwrap(), HAND);
    let change = |m: &Model| m.clone().with_armature(&[0.5, 0.75, 0.5]).unwrap();
    assert_eq!(written("hand", HAND, change).unwrap(), HAND.replace("ref='30'", "ref='30' armature=\"0.75\""));
    let change = |m: &Model| {
        let mut limits = m.limits().clone();
        (limits.lower[0], limits.upper[0]) = (-0.5 * std::f64::consts::PI, 0.25 * std::f64::consts::PI);
        (limits.lower[2], limits.upper[2]) = (-0.5, 0.5);
        (limits.effort_lower[0], limits.effort_upper[0]) = (-3.0, 5.0);
        m.clone().with_limits(limits).unwrap()
    };
    let efforts = "actuatorfrclimited=\"true\" actuatorfrcrange=\"-3 5\"";
    let expected = HAND
        .replace("range='-90 90'", &format!("range='-90 45' limited=\"true\" {efforts}"))
        .replace("axis='1 0 0'", "axis='1 0 0' limited=\"true\" range=\"-0.5 0.5\"");
    assert_eq!(written("hand", HAND, change).unwrap(), expected);
}

#[test]
fn inertias_of_an_mjcf_come_back() {
    let more = |m: &Model| {
        let keeps = |i: usize| i == 0 || m.bodies()[i].name.contains('#');
        m.with_inertias(|i, I| if keeps(i) { I } else { I + other(i) }).unwrap()
    };
    let new = written("fingers", HAND, more).unwrap();
    // an inertia from geoms becomes an <inertial>, and the fixed body keeps its <inertial>
    assert!(new.contains("<body name='palm'>\n      <inertial pos=\""), "{new}");
    assert!(new.contains("mass='0.25' diaginertia='0.01 0.02 0.025' euler='0 45 0'"), "{new}");
    let small = |m: &Model| m.with_inertias(|i, I| if i == 1 { other(1).scale(0.1) } else { I }).unwrap();
    let new = written("fingers", HAND, small).unwrap();
    assert!(new.contains("<inertial pos='0 0 0' mass='0' diaginertia='0 0 0'/>"), "{new}");
}

/// Checks that an `<inertial>` inside a `<frame>` is edited inside this frame, along the axes of the frame.
#[test]
fn an_inertial_inside_frames_is_edited() {
    let inertial = "<inertial pos='0.1 0 0' mass='1' diaginertia='0.1 0.2 0.25'/>";
    let frames = format!("<frame euler='0 0 90' pos='0.1 0 0'><frame pos='0 0 1'>{inertial}</frame></frame>");
    let text = format!("<mujoco><worldbody><body name='b'><joint name='j'/>{frames}</body></worldbody></mujoco>");
    let twice = |m: &Model| m.with_inertias(|_, I| I.scale(2.0)).unwrap();
    let new = written("frames", &text, twice).unwrap();
    assert_eq!(new.matches("<inertial").count(), 1, "{new}");
    assert!(new.contains("mass='2' diaginertia='0.2"), "{new}");
    written("frames", &text, with_other_inertias).unwrap();
}

/// Checks that numbers that differ from the file only by rounding are not written.
#[test]
fn rounding_is_no_difference() {
    let rounded = |_: &Model| {
        let pose = HAND.replace("pos='0.1 0.2 0.3'", "pos='0.10000000000000002 0.2 0.3'");
        let text = pose.replace("mass='0.25'", "mass='0.25000000000000006'").replace("-90 90", "-90 90.00000000000001");
        Model::from_mjcf_str(&text, &MjcfOptions::default()).unwrap()
    };
    assert_eq!(written("rounded", HAND, rounded).unwrap(), HAND);
}

#[test]
fn losses_of_an_mjcf_are_written() {
    let change = |m: &Model| {
        let m = m.clone().with_damping(&[3.0, 2.0, 2.0]).unwrap().with_friction(&[0.0, 0.5, 0.25]).unwrap();
        m.with_damping_polynomial(&[[0.0; 2], [0.0; 2], [0.5, 0.75]]).unwrap()
    };
    let expected = HAND
        .replace("range='-90 90'", "range='-90 90' damping=\"3\"")
        .replace("ref='30'", "ref='30' frictionloss=\"0.5\"")
        .replace("axis='1 0 0'", "axis='1 0 0' damping=\"2 0.5 0.75\"");
    assert_eq!(written("losses", HAND, change).unwrap(), expected);
}

/// Checks that each error names the differing quantity, both numbers, and the attribute of the file that causes the
/// difference.
#[test]
fn numbers_that_depend_on_the_inertia_name_their_cause() {
    let text = |joint: &str, rest: &str| {
        let geom = "<geom type='box' size='.1 .2 .3' pos='.1 0 0' euler='10 20 30' mass='1'/><site name='s'/>";
        format!("<mujoco><worldbody><body name='b'>{joint}{geom}</body></worldbody>{rest}</mujoco>")
    };
    let hinge = "<joint name='j' axis='0 1 0'/>";
    let servo = "<actuator><position name='p' joint='j' kp='40' dampratio='1'/></actuator>";
    for (text, what, why) in [
        (
            text("<joint name='j' axis='0 1 0' springdamper='.2 .7'/>", ""),
            "joint `j`: the stiffness of its spring is [",
            "`springdamper` makes stiffness and damping depend on the inertia",
        ),
        (text(hinge, servo), "actuator `p`: kv is ", "`dampratio` makes kv depend on the inertia"),
        (
            text(hinge, "<compiler settotalmass='3'/>"),
            "body `b`: its inertial parameters [",
            "`settotalmass` scales all masses",
        ),
        (
            text("<freejoint align='true'/>", ""),
            "frame `s`: its pose in its body is [",
            "`align` turns the frame of a free body to the principal axes of its inertia",
        ),
    ] {
        let said = written("causes", &text, with_other_inertias).expect_err(what);
        assert!(said.contains(what) && said.ends_with(&format!("({why})")), "{said}");
    }
}

#[test]
fn numbers_that_an_mjcf_cannot_represent_are_errors() {
    let refused = |text: &str, end: &str, change: &dyn Fn(&Model) -> Model| {
        let said = written("refused", text, change).expect_err(end);
        assert!(said.contains(end), "{said}\n{end}");
    };
    let always = HAND.replace("<default>\n    <joint", "<compiler inertiafromgeom='true'/><default>\n    <joint");
    refused(&always, "body `palm`: inertiafromgeom=\"true\" of the compiler", &|m| {
        m.with_inertias(|i, I| if i == 1 { I.scale(2.0) } else { I }).unwrap()
    });
    let total = HAND.replace("<default>\n    <joint", "<compiler settotalmass='5'/><default>\n    <joint");
    refused(&total, "body `palm`: its inertial parameters", &with_other_inertias);
    refused(HAND, "joint `wrist`: its velocity limit 3 cannot be written: an MJCF has none", &|m| {
        let mut limits = m.limits().clone();
        limits.velocity[0] = 3.0;
        m.clone().with_limits(limits).unwrap()
    });
    refused(HAND, "joint `wrist`: range -inf to 1: an MJCF has both limits or none", &|m| {
        let mut limits = m.limits().clone();
        (limits.lower[0], limits.upper[0]) = (f64::NEG_INFINITY, 1.0);
        m.clone().with_limits(limits).unwrap()
    });
    let free = "<mujoco><worldbody><body name='b'><freejoint name='f'/><geom size='1'/></body></worldbody></mujoco>";
    refused(free, "joint `f`: a <freejoint> has neither", &|m| m.clone().with_armature(&[0.1; 6]).unwrap());
    refused(free, "joint `f`: armature [0.1, 0.1, 0.1, 0.2, 0.2, 0.2]: a file has one for a joint", &|m| {
        m.clone().with_armature(&[0.1, 0.1, 0.1, 0.2, 0.2, 0.2]).unwrap()
    });
}

#[test]
fn bodies_of_included_files_are_not_edited() {
    let folder = folder("include");
    let [original, part, path] = ["original.xml", "part.xml", "new.xml"].map(|name| folder.join(name));
    let arm = "<body name='arm'><joint name='elbow'/><geom name='g' size='1'/></body>";
    fs::write(&part, format!("<mujoco>{arm}</mujoco>")).unwrap();
    let arm = arm.replace("arm", "base").replace("elbow", "root").replace("'g'", "'h'");
    let arm = arm.replace("</body>", "<include file='part.xml'/></body>");
    fs::write(&original, format!("<mujoco><worldbody>{arm}</worldbody></mujoco>")).unwrap();
    let model = Model::from_mjcf(&original, &MjcfOptions::default()).unwrap();
    let heavier = |k: usize| model.with_inertias(|i, I| if i == k { I.scale(2.0) } else { I }).unwrap();
    heavier(1).write_mjcf(&path, &original).unwrap();
    let said = heavier(2).write_mjcf(&path, &original).unwrap_err().to_string();
    assert!(said.contains("body `arm` is in an included file"), "{said}");
    fs::remove_dir_all(folder).unwrap();
}
