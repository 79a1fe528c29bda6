//! Tests of collision shapes in URDF, MJCF and SDF files, and of the pairs that can collide.
#![allow(clippy::unwrap_used)]

use condyle_model::{
    Collisions, Fit, Geometry, GeometryPair, MjcfOptions, Model, SdfOptions, Shape, UrdfOptions, Vec3, neutral, robots,
};
use std::path::Path;

/// Tolerance of poses: rounding errors of a product of two poses, and of angles with 16 digits.
const ROUNDING: f64 = 1e-14;

/// Returns names and kinds of geometries.
fn kinds(collisions: &Collisions) -> Vec<(&str, &str, &str)> {
    let of = |g: &Geometry| g.shape.kind();
    collisions.geometries.iter().map(|g| (&*g.name, g.frame.as_ref().map_or("", |f| &*f.name), of(g))).collect()
}

/// Returns the names of both geometries of each pair.
fn names(collisions: &Collisions, model: &Model) -> Vec<(String, String)> {
    collisions.pairs(model).unwrap().into_iter().map(|pair| (pair.first.name, pair.second.name)).collect()
}

const ARM: &str = r#"<robot name="arm">
  <link name="base"><collision><geometry><box size="0.2 0.4 0.6"/></geometry></collision></link>
  <link name="upper"><collision name="tube"><origin xyz="0 0 0.5" rpy="0 1.5707963267948966 0"/>
    <geometry><cylinder radius="0.1" length="1"/></geometry></collision></link>
  <link name="elbow"><collision><geometry><sphere radius="0.15"/></geometry></collision></link>
  <link name="lower"><collision><geometry><capsule radius="0.05" length="0.8"/></geometry></collision>
    <collision><geometry><mesh filename="lower.stl"/></geometry></collision>
    <collision><geometry><cone/></geometry></collision>
    <collision><geometry><sphere radius="-1"/></geometry></collision></link>
  <link name="hand"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="j1" type="continuous"><parent link="base"/><child link="upper"/></joint>
  <joint name="weld" type="fixed"><parent link="upper"/><child link="elbow"/><origin xyz="0 0 1"/></joint>
  <joint name="j2" type="continuous"><parent link="elbow"/><child link="lower"/></joint>
  <joint name="j3" type="continuous"><parent link="lower"/><child link="hand"/></joint>
</robot>"#;

#[test]
fn urdf_shapes_and_pairs() {
    let model = Model::from_urdf_str(ARM, &UrdfOptions::default()).unwrap();
    let mut collisions = Collisions::from_urdf_str(ARM, &UrdfOptions::default()).unwrap();
    let expected = [
        ("base_0", "base", "box"),
        ("tube", "upper", "cylinder"),
        ("elbow_0", "elbow", "sphere"),
        ("lower_0", "lower", "capsule"),
        ("hand_0", "hand", "box"),
    ];
    assert_eq!(kinds(&collisions), expected);
    let Shape::Box { half_sizes } = collisions.geometries[0].shape else { panic!() };
    assert_eq!(half_sizes.to_array(), [0.1, 0.2, 0.3]);
    let Shape::Cylinder { radius, half_length } = collisions.geometries[1].shape else { panic!() };
    assert_eq!((radius, half_length), (0.1, 0.5));
    let turned = collisions.geometries[1].placement.rotation.z;
    assert!((turned - Vec3::new(1.0, 0.0, 0.0)).norm_squared() < ROUNDING);
    let warnings: Vec<_> = collisions.warnings().map(ToString::to_string).collect();
    let left_out = "<collision>: its shape on link `lower` is left out: ";
    assert_eq!(
        warnings,
        [
            format!("<string>:8: {left_out}the shape <cone> is not supported"),
            format!("<string>:9: {left_out}the sphere: radius is -1, expected at least 0"),
            format!(
                "<string>:7: {left_out}the mesh `lower.stl`: distances need a sphere, a capsule or a box in its place"
            ),
        ]
    );
    // the elbow belongs to the body of the upper arm, so lower and upper arm are adjacent
    let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    let expected =
        [pair("base_0", "lower_0"), pair("base_0", "hand_0"), pair("tube", "hand_0"), pair("elbow_0", "hand_0")];
    assert_eq!(names(&collisions, &model), expected);
    let srdf = r#"<robot name="arm"><disable_collisions link1="hand" link2="elbow" reason="Never"/>
        <disable_collisions link1="lower" link2="base"/><disable_collisions link1="other" link2="base"/></robot>"#;
    collisions.read_srdf_str(srdf).unwrap();
    assert_eq!(names(&collisions, &model), [pair("base_0", "hand_0"), pair("tube", "hand_0")]);
    let refused = srdf.replace("<disable_collisions link1=\"hand\"", "<disable_default_collisions link=\"a\"/><x ");
    let error = collisions.read_srdf_str(&refused).unwrap_err().to_string();
    assert!(error.contains("is not supported: only <disable_collisions> is"), "{error}");
    let error = Collisions::from_urdf_str(&ARM.replace("0.2 0.4 0.6", "0.2 x"), &UrdfOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with("<string>:2: <collision>: box size: "), "{error}");
}

const LEGS: &str = r#"<mujoco><compiler angle="degree"/>
  <default><geom type="sphere" size="0.1"/><default class="shown"><geom contype="0" conaffinity="0"/></default></default>
  <worldbody><geom name="floor" type="plane" size="0 0 1"/>
    <body name="trunk" pos="0 0 1"><freejoint/>
      <geom name="chest" type="box" size="0.1 0.2 0.3" euler="90 0 0"/><geom class="shown"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <body name="left" pos="0 0.2 0"><joint axis="0 1 0"/>
        <geom name="thigh" type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/>
        <frame pos="0 0 -0.4"><geom name="foot" size="0.04" pos="0.1 0 0"/></frame></body>
      <body name="right" pos="0 -0.2 0"><joint axis="0 1 0"/><geom name="other" contype="2" conaffinity="4"/></body>
      <body name="tail"><joint axis="0 1 0"/><geom name="tip"/></body>
    </body></worldbody>
  <contact><exclude body1="left" body2="tail"/></contact></mujoco>"#;

#[test]
fn mjcf_shapes_masks_and_excludes() {
    let model = Model::from_mjcf_str(LEGS, &MjcfOptions::default()).unwrap();
    let collisions = Collisions::from_mjcf_str(LEGS, &MjcfOptions::default()).unwrap();
    let expected = [
        ("floor", "world", "half-space"),
        ("chest", "trunk", "box"),
        ("trunk_1", "trunk", "ellipsoid"),
        ("thigh", "left", "capsule"),
        ("foot", "left", "sphere"),
        ("other", "right", "sphere"),
        ("tip", "tail", "sphere"),
    ];
    assert_eq!(kinds(&collisions), expected);
    let foot = collisions.geometries[4].placement.translation;
    assert!((foot - Vec3::new(0.1, 0.0, -0.4)).norm_squared() < ROUNDING);
    let Shape::Capsule { ends, radius } = collisions.geometries[3].shape else { panic!() };
    let placement = collisions.geometries[3].placement;
    assert_eq!((ends[1].z, radius, placement.translation.z), (0.2, 0.05, -0.2));
    let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    // the floor touches all bodies; `other` has masks that touch nothing; the tail is excluded from the left leg
    let expected = ["chest", "trunk_1", "thigh", "foot", "tip"].map(|name| pair("floor", name));
    assert_eq!(names(&collisions, &model), expected);
    let without = LEGS.replace("<exclude body1=\"left\" body2=\"tail\"/>", "").replace(" contype=\"2\"", "");
    let collisions = Collisions::from_mjcf_str(&without, &MjcfOptions::default()).unwrap();
    let found = names(&collisions, &model);
    assert_eq!(found.len(), 6 + 4 + 1, "{found:?}");
    assert!(found.contains(&pair("thigh", "tip")) && !found.contains(&pair("chest", "thigh")));
}

#[test]
fn sdf_shapes() {
    let sdf = r#"<sdf version="1.9"><model name="m">
      <frame name="f"><pose>0 0 2 0 0 0</pose></frame>
      <link name="a"><pose>1 0 0 0 0 0</pose>
        <collision name="box"><pose>0 0 1 0 0 0</pose><geometry><box><size>2 4 6</size></box></geometry></collision>
        <collision name="ball"><pose relative_to="f">0 0 1 0 0 0</pose>
          <geometry><sphere><radius>0.5</radius></sphere></geometry></collision>
        <collision name="ground"><geometry><plane><normal>0 0 2</normal></plane></geometry></collision>
        <collision name="shell"><geometry><mesh><uri>a.stl</uri></mesh></geometry></collision>
        <collision name="bullet"><geometry><capsule><radius>0.5</radius><length>2</length></capsule></geometry></collision>
      </link></model></sdf>"#;
    let collisions = Collisions::from_sdf_str(sdf, &SdfOptions::default()).unwrap();
    let expected =
        [("box", "a", "box"), ("ball", "a", "sphere"), ("ground", "a", "half-space"), ("bullet", "a", "capsule")];
    assert_eq!(kinds(&collisions), expected);
    let ball = collisions.geometries[1].placement.translation;
    assert!((ball - Vec3::new(-1.0, 0.0, 3.0)).norm_squared() < ROUNDING, "{ball:?}");
    assert_eq!(collisions.meshes().map(|mesh| &*mesh.file).collect::<Vec<_>>(), ["a.stl"]);
    let model = Model::from_sdf_str(sdf, &SdfOptions::default()).unwrap();
    assert!(collisions.pairs(&model).unwrap().is_empty()); // all are fixed to the world
}

/// Checks that shapes of one name on several links get different names, as masks and obstacles need.
#[test]
fn names_of_shapes_differ() {
    let link = |name: &str, z: f64| {
        let shape = |r: f64| format!("<geometry><sphere><radius>{r}</radius></sphere></geometry></collision>");
        let (first, second) = (shape(0.1), shape(0.2));
        format!(
            "<link name='{name}'><pose>0 0 {z} 0 0 0</pose><collision name='collision'>{first}\
            <collision name='{name}_0'>{second}</link>"
        )
    };
    let joint = |parent: &str, child: &str| {
        format!(
            "<joint name='{child}' type='revolute'><parent>{parent}</parent><child>{child}</child>\
            <axis><xyz>0 1 0</xyz></axis></joint>"
        )
    };
    let [a, b, c] = [("a", 0.0), ("b", 1.0), ("c", 2.0)].map(|(name, z)| link(name, z));
    let joints = [joint("world", "a"), joint("a", "b"), joint("b", "c")].concat();
    let sdf = format!("<sdf version='1.9'><model name='m'>{a}{b}{c}{joints}</model></sdf>");
    let collisions = Collisions::from_sdf_str(&sdf, &SdfOptions::default()).unwrap();
    let found: Vec<_> = kinds(&collisions).into_iter().map(|(name, ..)| name).collect();
    assert_eq!(found, ["collision", "a_0", "b_0", "b_1", "c_0", "c_1"]);
    let model = Model::from_sdf_str(&sdf, &SdfOptions::default()).unwrap();
    assert_eq!(GeometryPair::resolve_all(&model, &collisions.pairs(&model).unwrap()).unwrap().len(), 4);
}

/// Checks that shapes of embedded robots are on bodies of the robots, and that no pair is of one body or of neighbours.
#[test]
fn pairs_of_embedded_robots() {
    let cases = [
        (robots::ARM7, robots::arm7()),
        (robots::QUADRUPED, robots::quadruped()),
        (robots::HUMANOID, robots::humanoid()),
    ];
    for (urdf, model) in cases {
        let collisions = Collisions::from_urdf_str(urdf, &UrdfOptions::default()).unwrap();
        for pair in collisions.pairs(&model).unwrap() {
            let [(a, _), (b, _)] = pair.resolve(&model, 0).unwrap();
            let (up_a, up_b) = (model.bodies()[a].parent, model.bodies()[b].parent);
            assert!(a != b && up_a != b && up_b != a, "{pair:?}");
        }
        assert_eq!(neutral(&model).len(), model.nq());
    }
}

/// Fits a capsule and a sphere to a mesh in a file, and reports a mesh that is missing.
#[test]
fn meshes_are_fitted() {
    let folder = std::env::temp_dir().join(format!("condyle-collisions-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|bit| if bit == 1 { 1.0 } else { -1.0 });
    let text: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {}\n", 3.0 * z)).collect();
    std::fs::write(folder.join("bar.obj"), text + "f 1 2 3\nf 4 5 6\nf 6 7 8\nf 1 4 8\n").unwrap();
    let urdf = r#"<robot name="r"><link name="a">
      <collision name="bar"><origin xyz="0 0 1"/><geometry><mesh filename="bar.obj" scale="0.1 0.1 0.1"/></geometry></collision>
      <collision name="gone"><geometry><mesh filename="gone.stl"/></geometry></collision></link></robot>"#;
    let path = folder.join("r.urdf");
    std::fs::write(&path, urdf).unwrap();
    let read = |path: &Path| Collisions::from_urdf(path, &UrdfOptions::default()).unwrap();
    let mut collisions = read(&path);
    assert_eq!((collisions.fit_meshes(Fit::Capsule, &[]), collisions.geometries.len()), (1, 1));
    let Shape::Capsule { ends, radius } = collisions.geometries[0].shape else { panic!() };
    assert!(radius >= 0.02_f64.sqrt() && radius < 1.01 * 0.02_f64.sqrt(), "{radius}");
    assert!((ends[0].z.abs() - 0.3).abs() < 0.03 && (ends[0] + ends[1]).norm_squared() < 1e-4, "{ends:?}");
    let warning = collisions.warnings().map(ToString::to_string).next().unwrap();
    assert!(warning.contains("`gone.stl`") && warning.contains("No such file"), "{warning}");
    let mut collisions = read(&path);
    collisions.fit_meshes(Fit::Sphere, &[]);
    let Shape::Sphere { radius, .. } = collisions.geometries[0].shape else { panic!() };
    assert!(radius >= 0.11_f64.sqrt() && radius < 1.01 * 0.11_f64.sqrt(), "{radius}");
    std::fs::remove_dir_all(&folder).unwrap();
}
