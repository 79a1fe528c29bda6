//! Tests of SDF: nested models and included files.

use super::*;

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
    // the tip is at the pose of the inner model, whose frame is fixed to its first link, the arm
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
    // inside a model, names from outside the model are unknown
    let wrong = text.replace("<pose relative_to='tip'>", "<pose relative_to='base'>");
    let error = read(&format!("<sdf version='1.9'>{wrong}</sdf>")).unwrap_err().to_string();
    assert!(error.contains("link `hand`: no link, joint or frame is named `base`"), "{error}");
}

/// Checks that a frame without `attached_to` is fixed to the same link as the frame of its model, not to the world.
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
    let wrong = format!("<sdf version='1.9'><model name='m' canonical_link='c'>{}</model></sdf>", link("a"));
    assert!(fault(&wrong).contains("model `m`: canonical_link: no link is named `c`"));
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

    // with `merge`, the names are in the outer model, and the frame of the inner model keeps its pose
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
    // errors in an included file name this file
    write(&folder, "models/bad/model.sdf", "<sdf version='1.5'>\n<model name='a'><link/></model></sdf>");
    assert!(error("<uri>model://bad</uri>").contains("bad/model.sdf:2: <link>: has no name"));
    fs::remove_dir_all(&folder).unwrap();
}

/// Checks that some models of a world may be missing, such as the sun, but not all models.
#[test]
fn worlds_with_missing_models() {
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

/// Checks that files that include each other, deeply nested models and long names are refused at once.
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
