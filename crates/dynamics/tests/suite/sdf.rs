//! From SDF to a model: the same robot as a URDF, errors, and whatever else a file can contain.

use condyle_dynamics::{
    Data, Error, Joint, Model, SdfOptions, UrdfOptions, Vec3, Warning, crba, forward_kinematics, nonlinear_effects,
};

/// A few products of poses, and sums over seven bodies.
const ROUNDING: f64 = 1e-12;

const LINKAGE: &str = include_str!("../data/linkage.sdf");

/// The same robot, its poses worked out by hand: each link at its joint.
const URDF: &str = r#"<robot name="linkage">
  <link name="base"><inertial><mass value="4"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/></inertial></link>
  <link name="crank"><inertial><origin xyz="0.2 0 0" rpy="0 0 0.3"/><mass value="1"/><inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="between"/>
  <link name="rod"><inertial><mass value="0.5"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial></link>
  <link name="slider"><inertial><mass value="0.2"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <link name="wheel"><inertial><mass value="0.3"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.001"/></inertial></link>
  <link name="ballast"><inertial><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="rim"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="crank"/><origin xyz="0 0.2 0.1" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/><limit lower="-1" upper="2" effort="30" velocity="1"/></joint>
  <joint name="cross#1" type="revolute"><parent link="crank"/><child link="between"/><origin xyz="0.3 0 0" rpy="0 0 1.2870022175865687"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="cross" type="revolute"><parent link="between"/><child link="rod"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="slide" type="prismatic"><parent link="rod"/><child link="slider"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="spin" type="continuous"><parent link="slider"/><child link="wheel"/><origin xyz="0 0.05 0"/><axis xyz="0 1 0"/></joint>
  <joint name="bolt" type="fixed"><parent link="base"/><child link="ballast"/><origin xyz="0 0 -0.1"/></joint>
  <joint name="mark" type="fixed"><parent link="wheel"/><child link="rim"/><origin xyz="0 0 0.05"/></joint>
</robot>"#;

fn load(text: &str, root_joint: Option<Joint>) -> Result<Model, Error> {
    Model::from_sdf_str(text, &SdfOptions { root_joint, ..SdfOptions::default() })
}

fn close(what: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (x, y) in ours.iter().zip(theirs) {
        assert!((x - y).abs() <= ROUNDING * (1.0 + y.abs()), "{what}: {ours:?}\n{theirs:?}");
    }
}

#[test]
fn equals_the_same_robot_as_urdf() {
    let root_joint = Some(Joint::FreeFlyer);
    let sdf = load(LINKAGE, root_joint).unwrap();
    let urdf = Model::from_urdf_str(URDF, &UrdfOptions { root_joint, ..UrdfOptions::default() }).unwrap();
    let urdf = urdf.with_gravity(Vec3::new(0.0, 0.0, -1.62)).unwrap();
    let mut rng = <rand::rngs::StdRng as rand::SeedableRng>::seed_from_u64(1);
    let (mut left, mut right) = (Data::new(&sdf), Data::new(&urdf));
    for _ in 0..5 {
        let q = condyle_dynamics::random_configuration(&urdf, &mut rng);
        let v: Vec<f64> = (0..urdf.nv()).map(|i| (1.3 * i as f64).sin()).collect();
        close("M", crba(&sdf, &mut left, &q).as_slice(), crba(&urdf, &mut right, &q).as_slice());
        close("h", nonlinear_effects(&sdf, &mut left, &q, &v), nonlinear_effects(&urdf, &mut right, &q, &v));
        let (here, there) = (forward_kinematics(&sdf, &mut left, &q), forward_kinematics(&urdf, &mut right, &q));
        for frame in ["base", "rod", "slider", "wheel", "ballast", "rim"] {
            let (a, b) = (here.frame(sdf.frame(frame).unwrap()), there.frame(urdf.frame(frame).unwrap()));
            close(frame, &a.translation.to_array(), &b.translation.to_array());
            close(frame, &a.rotation.x.to_array(), &b.rotation.x.to_array());
            close(frame, &a.rotation.y.to_array(), &b.rotation.y.to_array());
        }
    }
}

/// The tree, its limits, where it stands when fixed, and what was left out.
#[test]
fn tree_and_limits() {
    let model = load(LINKAGE, None).unwrap();
    let names: Vec<&str> = model.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["turn", "cross#1", "cross", "slide", "spin"]);
    assert_eq!((model.nq(), model.nv()), (6, 5));
    assert_eq!((model.limits().lower[0], model.limits().upper[0]), (-1.0, 2.0));
    assert_eq!(model.limits().lower[1], f64::NEG_INFINITY); // −1e16
    assert_eq!((model.limits().effort()[0], model.limits().velocity[0]), (30.0, f64::INFINITY));
    assert_eq!((model.damping()[0], model.friction()[0]), (0.4, 0.3));
    let base = &model.frames()[model.frame("base").unwrap()];
    assert_eq!((base.body, base.placement.translation), (0, Vec3::new(0.1, 0.0, 1.0)));
    let said: Vec<String> = model.warnings().iter().map(ToString::to_string).collect();
    let left_out =
        "joint `loop`: would give link `slider` a second parent beside joint `slide`: it closes a loop, left out";
    assert_eq!(said, [left_out]);
    let strict = Model::from_sdf_str(LINKAGE, &SdfOptions { strict: true, ..SdfOptions::default() });
    assert!(matches!(strict, Err(Error::Strict { warning: Warning::Assumed { .. }, .. })));
}

#[test]
fn errors_name_line_and_element() {
    let model =
        |inside: &str| format!("<sdf version='1.8'><model name='m'>\n<link name='a'/>\n{inside}\n</model></sdf>");
    let joint = |kind: &str, inside: &str| {
        let ends = "<parent>a</parent><child>b</child>";
        model(&format!("<link name='b'/>\n<joint name='j' type='{kind}'>{ends}{inside}</joint>"))
    };
    let cases = [
        (model("<link name='a'/>"), "<string>:3: link `a`: the name is taken by the link on line 2"),
        (model("<link name='b'/>"), "<string>:3: link `b`: has no parent, and neither has link `a`"),
        (model("<link/>"), "<string>:3: <link>: has no name"),
        (model("<model name='n'/>"), "<string>:3: model `n`: models in models are not supported"),
        (model("<joint name='j'><child>a</child></joint>"), "<string>:3: joint `j`: has no parent"),
        (
            model("<joint name='j'><parent>world</parent><child>b</child></joint>"),
            "<string>:3: joint `j`: no link, joint or frame is named `b`",
        ),
        (joint("gearbox", ""), "<string>:4: joint `j`: joints of type `gearbox` are not supported"),
        (joint("screw", "<axis><xyz>0 0 1</xyz></axis>"), "<string>:4: joint `j`: has no finite screw_thread_pitch"),
        (joint("revolute", ""), "<string>:4: joint `j`: has no <axis>"),
        (joint("revolute", "<axis><xyz>0 0</xyz></axis>"), "<string>:4: joint `j`: xyz: expected 3 numbers, found 2"),
        (joint("revolute", "<axis><xyz>0 0 0</xyz></axis>"), "<string>:4: joint `j`: axis: xyz is no direction"),
        (
            joint("revolute", "<axis><xyz expressed_in='c'>0 0 1</xyz></axis>"),
            "<string>:4: joint `j`: axis: expressed in `c`",
        ),
        (
            joint("revolute", "<axis><limit><lower>x</lower></limit></axis>"),
            "<string>:4: joint `j`: lower: `x` is no number",
        ),
        (
            joint("revolute", "<axis><limit><lower>1</lower><upper>0</upper></limit></axis>"),
            "<string>:4: joint `j`: lower limit 1 is above",
        ),
        (joint("fixed", "<pose relative_to='k'/>"), "<string>:4: joint `j`: no link, joint or frame is named `k`"),
        (joint("fixed", "<pose relative_to='j'/>"), "<string>:4: joint `j`: its pose depends on itself"),
        (joint("fixed", "<pose>0 0 1</pose>"), "<string>:4: joint `j`: pose: expected 6 numbers, found 3"),
        (model("<frame name='f' attached_to='f'/>"), "<string>:3: frame `f`: "),
        ("<sdf/>".to_owned(), "<string>:1: <sdf>: has no model"),
        ("<robot/>".to_owned(), "<string>:1: <robot>: the root element of an SDF"),
    ];
    for (text, expected) in cases {
        let said = load(&text, None).expect_err(&text).to_string();
        assert!(said.starts_with(expected), "{said}\n{expected}");
    }
}

/// A screw by either of its pitches, right-handed: 2 mm for each turn.
#[test]
fn screws() {
    for pitch in ["screw_thread_pitch>0.002</screw_thread_pitch", "thread_pitch>-3141.592653589793</thread_pitch"] {
        let text = format!(
            "<sdf version='1.10'><model name='m'><link name='a'/><link name='b'/>
             <joint name='j' type='screw'><parent>a</parent><child>b</child><{pitch}><axis><xyz>1 0 0</xyz></axis></joint>
             </model></sdf>"
        );
        let model = load(&text, None).unwrap();
        assert!(matches!(model.bodies()[1].joint, Joint::Helical { .. }));
        let mut data = Data::new(&model);
        let placements = forward_kinematics(&model, &mut data, &[core::f64::consts::FRAC_PI_2]);
        let X = placements.frame(model.frame("b").unwrap());
        close("screw", &X.translation.to_array(), &[0.0005, 0.0, 0.0]);
        close("screw", &X.rotation.y.to_array(), &[0.0, 0.0, 1.0]);
    }
}

/// An axis follows another one, of a universal joint too: multiplier · (leader − reference) + offset.
#[test]
fn axes_that_follow() {
    let mimic = |inside: &str, ratio: &str| {
        let numbers = format!("<multiplier>{ratio}</multiplier><offset>0.1</offset><reference>0.3</reference>");
        let slide = "<axis><xyz>1 0 0</xyz></axis>";
        let follow = format!("<axis><mimic {inside}>{numbers}</mimic><xyz>1 0 0</xyz></axis>");
        let text = LINKAGE.replace("\n", " ").replace(slide, &follow);
        assert!(text.contains("<mimic"));
        Model::from_sdf_str(&text, &SdfOptions { mimic: true, ..SdfOptions::default() })
    };
    let (free, model) = (load(LINKAGE, None).unwrap(), mimic("joint='cross' axis='axis2'", "-0.5").unwrap());
    assert_eq!((model.nq(), model.nv()), (5, 4));
    let q = [0.2, 0.4, -0.7, 0.6, 0.8]; // turn, cross (two), spin
    let slide = -0.5 * (q[2] - 0.3) + 0.1;
    let (mut ours, mut theirs) = (Data::new(&model), Data::new(&free));
    let here = forward_kinematics(&model, &mut ours, &q);
    let there = forward_kinematics(&free, &mut theirs, &[q[0], q[1], q[2], slide, q[3], q[4]]);
    for frame in ["slider", "wheel"] {
        let (a, b) = (here.frame(model.frame(frame).unwrap()), there.frame(free.frame(frame).unwrap()));
        close(frame, &a.translation.to_array(), &b.translation.to_array());
    }
    let nobody = mimic("joint='bolt'", "1").unwrap_err().to_string();
    assert_eq!(nobody, "<string>:1: joint `slide`: mimic: no joint with an <axis> that moves is named `bolt`");
    let turns = mimic("joint='spin'", "1").unwrap_err().to_string();
    assert!(
        turns.starts_with("<string>:1: joint `slide`: a slide or screw cannot follow a continuous joint"),
        "{turns}"
    );
    let left_free = LINKAGE.replace("<axis2><xyz>0 1 0</xyz>", "<axis2><mimic joint='turn'/><xyz>0 1 0</xyz>");
    let said: Vec<String> = load(&left_free, None).unwrap().warnings().iter().map(ToString::to_string).collect();
    let expected = "joint `cross`: a joint that follows another one is left free unless `mimic` is asked for";
    assert!(said.iter().any(|s| s == expected), "{said:?}");
}
