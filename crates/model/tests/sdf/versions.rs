//! Tests of the versions of SDF: frames of axes and poses, attributes of the first version, and flat names.

use super::*;

/// Checks the axis 0 0 1 of a joint whose child is rotated by 90° about x. Depending on the version, this axis is the z
/// axis of the joint, or the z axis of the model. The z axis of the model is the y axis of the joint.
#[test]
fn the_version_determines_the_frame_of_an_axis() {
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
    // an axis without a direction is z, also if the axis is given in the model's frame
    let bare = |version| axis(version, "").0;
    close(&bare("1.4"), &of_model);
}

/// Checks the attribute of a pose: `frame` up to version 1.6, and `relative_to` in later versions.
#[test]
fn the_version_determines_the_attribute_of_a_pose() {
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

/// Checks files of version 1.0, in which some values are attributes. In later versions, these values are elements.
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
    // in later versions, the attributes of version 1.0 are unknown
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

/// Checks old files, in which nested models have a flat form: the names of their links, joints and frames contain `::`.
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
