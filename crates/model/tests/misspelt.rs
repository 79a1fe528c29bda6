//! Tests with robots in which one name is misspelt. Each reader reports this name, for every element and attribute.

use condyle_model::{Error, MjcfOptions, Model, SdfOptions, UrdfOptions};
use roxmltree::Document;
use std::ops::Range;

/// URDF with most of the elements and attributes that affect a model.
const URDF: &str = r#"<robot name="r" version="1.0">
  <link name="a"><inertial><origin xyz="0 0 1" rpy="0 0 0.1"/><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="c"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="j" type="revolute"><origin xyz="0 0 1" rpy="0 0 0.1"/><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="3" velocity="2"/><dynamics damping="1" friction="2"/>
    <safety_controller soft_lower_limit="-1" soft_upper_limit="1" k_position="1" k_velocity="1"/><calibration rising="1"/></joint>
  <joint name="k" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/></joint>
</robot>"#;
const SDF: &str = r#"<sdf version="1.9"><model name="m" canonical_link="a"><pose relative_to="world">0 0 1 0 0 0</pose>
  <link name="a"><pose degrees="true">0 0 1 0 0 90</pose><inertial><pose>0 0 0.1 0 0 0</pose><mass>1</mass>
    <inertia><ixx>1</ixx><ixy>0</ixy><ixz>0</ixz><iyy>1</iyy><iyz>0</iyz><izz>1</izz></inertia></inertial></link>
  <link name="b"><pose relative_to="a">0 0 1 0 0 0</pose><inertial><mass>1</mass></inertial><gravity>true</gravity></link>
  <frame name="f" attached_to="b"><pose>0 0 1 0 0 0</pose></frame>
  <joint name="j" type="revolute"><pose>0 0 0.1 0 0 0</pose><parent>a</parent><child>b</child>
    <axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower><upper>1</upper><effort>3</effort><velocity>2</velocity></limit>
    <dynamics><damping>1</damping><friction>2</friction><spring_stiffness>3</spring_stiffness><spring_reference>0.1</spring_reference></dynamics></axis></joint>
</model></sdf>"#;
const MJCF: &str = r#"<mujoco model="m"><compiler angle="radian" autolimits="true"/><option gravity="0 0 -9.81" timestep="0.002"/>
  <default><joint damping="1"/><default class="stiff"><joint stiffness="3"/></default></default>
  <worldbody><body name="b" pos="0 0 1" euler="0 0 1" gravcomp="0.5" childclass="stiff">
    <inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>
    <joint name="j" axis="0 1 0" range="-1 1" armature="0.1" frictionloss="0.2" springref="0.1" actuatorfrcrange="-2 3"/>
    <geom type="box" size="0.1 0.1 0.1" pos="0 0 0.1"/><site name="s" pos="0 0 0.1"/><camera name="eye" pos="0 0 0.1"/>
    <frame name="f" pos="0 0 0.1"><body name="c"><joint name="k" ref="0.1" pos="0 0 0.1"/><geom size="0.1" density="300" pos="0.1 0 0"/></body></frame>
  </body></worldbody>
  <tendon><fixed name="t" range="-1 1"><joint joint="j" coef="2"/></fixed></tendon>
  <equality><connect name="e" body1="b" body2="world" anchor="0 0 0.1"/><joint name="g" joint1="j" joint2="k" polycoef="0 1 0 0 0"/></equality>
  <actuator><motor name="u" joint="j" gear="10" ctrlrange="-1 1"/><position name="w" joint="k" kp="10" kv="1"/></actuator>
  <keyframe><key name="home" qpos="0.1 0.2"/></keyframe>
</mujoco>"#;

/// Returns the messages of a reader: the warnings about a model, or the error.
fn said(read: &dyn Fn(&str) -> Result<Model, Error>, text: &str) -> Vec<String> {
    match read(text) {
        Ok(model) => model.warnings().iter().map(ToString::to_string).collect(),
        Err(error) => vec![error.to_string()],
    }
}

/// Returns the byte ranges of all names in the text. The start tag and end tag of an element are returned together, and
/// each attribute is returned separately.
fn names(text: &str) -> Vec<Vec<Range<usize>>> {
    let document = Document::parse(text).unwrap();
    let mut places = Vec::new();
    for node in document.descendants().filter(|node| node.is_element() && node.parent_element().is_some()) {
        let (whole, tag) = (node.range(), node.tag_name().name());
        let mut tags = Vec::new();
        tags.push(whole.start + 1..whole.start + 1 + tag.len());
        if let Some(end) =
            text[whole.clone()].rfind(&format!("</{tag}>")).filter(|end| end + tag.len() + 3 == whole.len())
        {
            tags.push(whole.start + end + 2..whole.start + end + 2 + tag.len());
        }
        places.push(tags);
        places.extend(node.attributes().map(|a| vec![a.range_qname()]));
    }
    places
}

/// Adds a letter to each name in the text in turn, and checks that the changed name is reported.
fn check(read: &dyn Fn(&str) -> Result<Model, Error>, text: &str) {
    let plain = said(read, text);
    assert!(read(text).is_ok(), "{plain:?}");
    for places in names(text) {
        let mut changed = text.to_owned();
        for place in places.iter().rev() {
            changed.insert(place.end - 1, 'q');
        }
        let first = &places[0];
        let name = format!("{}q{}", &text[first.start..first.end - 1], &text[first.end - 1..first.end]);
        let new = said(read, &changed);
        let fresh: Vec<&String> = new.iter().filter(|what| !plain.contains(what)).collect();
        assert!(
            fresh.iter().any(|what| what.contains(&name)) || read(&changed).is_err(),
            "{name} passes: {fresh:?}\n{changed}"
        );
    }
}

#[test]
fn names_of_a_urdf() {
    check(&|text| Model::from_urdf_str(text, &UrdfOptions::default()), URDF);
}

#[test]
fn names_of_an_sdf() {
    check(&|text| Model::from_sdf_str(text, &SdfOptions::default()), SDF);
}

#[test]
fn names_of_an_mjcf() {
    check(&|text| Model::from_mjcf_str(text, &MjcfOptions::default()), MJCF);
}

/// Checks that a strict reader refuses each unknown name.
#[test]
fn a_strict_reader_refuses() {
    let text = URDF.replace("<dynamics", "<dynamic");
    let strict = UrdfOptions { strict: true, ..UrdfOptions::default() };
    let error = Model::from_urdf_str(&text, &strict).unwrap_err().to_string();
    assert!(error.contains("<string>:6: ") && error.contains("<dynamic>") && error.contains("`dynamics`"), "{error}");
    let allowed = UrdfOptions { allow: vec!["unknown".parse().unwrap()], ..strict };
    assert!(Model::from_urdf_str(&text, &allowed).is_ok());
}
