//! Tests of the dynamics of models from SDF. The results are compared with a URDF of the same robot, and with Drake.

use condyle_dynamics::{
    Data, Error, Joint, Model, SdfOptions, UrdfOptions, Vec3, crba, forward_kinematics, nonlinear_effects,
};

/// Tolerance of a few products of poses, and sums over seven bodies.
const ROUNDING: f64 = 1e-12;

const LINKAGE: &str = include_str!("../data/linkage.sdf");

/// URDF of the robot in `linkage.sdf`. Its poses are computed by hand, because in URDF the frame of each link is at the
/// link's joint.
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

/// Checks a right-handed screw with 2 mm per turn. Each of SDF's two elements for the pitch must give the same screw.
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

/// Checks an axis that follows another axis: multiplier · (leader − reference) + offset. Both axes may belong to
/// universal joints.
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
    let q = [0.2, 0.4, -0.7, 0.6, 0.8]; // order: turn, cross (two axes), spin
    let slide = -0.5 * (q[2] - 0.3) + 0.1;
    let (mut ours, mut theirs) = (Data::new(&model), Data::new(&free));
    let here = forward_kinematics(&model, &mut ours, &q);
    let there = forward_kinematics(&free, &mut theirs, &[q[0], q[1], q[2], slide, q[3], q[4]]);
    for frame in ["slider", "wheel"] {
        let (a, b) = (here.frame(model.frame(frame).unwrap()), there.frame(free.frame(frame).unwrap()));
        close(frame, &a.translation.to_array(), &b.translation.to_array());
    }
    let nobody = mimic("joint='bolt'", "1").unwrap_err().to_string();
    assert_eq!(nobody, "<string>:1: joint `slide`: mimic: joint `bolt` has no <axis> that moves");
    let turns = mimic("joint='spin'", "1").unwrap_err().to_string();
    assert!(
        turns.starts_with("<string>:1: joint `slide`: a slide or screw cannot follow a continuous joint"),
        "{turns}"
    );
    let left_free = LINKAGE.replace("<axis2><xyz>0 1 0</xyz>", "<axis2><mimic joint='turn'/><xyz>0 1 0</xyz>");
    let said: Vec<String> = load(&left_free, None).unwrap().warnings().iter().map(ToString::to_string).collect();
    let expected = "joint `cross`: a joint that follows another one is left free unless `mimic` is asked for";
    assert!(said.iter().any(|s| s.ends_with(expected)), "{said:?}");
}

/// Returns the SDF text of a link of 2 kg with the given name and pose.
fn link(name: &str, pose: &str) -> String {
    format!(
        "<link name='{name}'><pose>{pose}</pose><inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
         <inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz></inertia></inertial></link>"
    )
}

/// Compares M, the bias and the position of a frame with numbers from Drake.
fn drake(model: &Model, q: &[f64], v: &[f64], (M, h): (&[f64], &[f64]), (frame, at): (&str, [f64; 3])) {
    let mut data = Data::new(model);
    close("M", crba(model, &mut data, q).as_slice(), M);
    close("h", nonlinear_effects(model, &mut data, q, v), h);
    let placements = forward_kinematics(model, &mut data, q);
    close(frame, &placements.frame(model.frame(frame).unwrap()).translation.to_array(), &at);
}

/// Checks a model that contains another model. Poses are relative to the inner model and to its frames and links. The
/// inner model has a placement frame, and axes are expressed in other frames. The reference numbers come from Drake
/// 1.51: `CalcMassMatrix`, `CalcBiasTerm` − `CalcGravityGeneralizedForces`, with the base welded at its pose.
#[test]
fn a_model_in_a_model_is_drakes() {
    let (base, arm) = (link("base", ""), link("arm", "0 0 0.4 0 0 0"));
    let hand = link("hand", "0.1 0 0 0.2 0 0").replacen("<pose>", "<pose relative_to='tip'>", 1);
    let text = format!(
        "<sdf version='1.9'><world name='w'><model name='outer' placement_frame='inner::tip'><pose>1 2 3 0 0 0.5</pose>{base}
         <model name='inner'><pose relative_to='base'>0.1 0 0.2 0 0.3 0</pose>{arm}
           <frame name='tip' attached_to='arm'><pose>0 0.2 0 0 0 0</pose></frame>{hand}
           <joint name='wrist' type='revolute'><parent>arm</parent><child>hand</child>
             <axis><xyz expressed_in='tip'>1 0 0</xyz></axis></joint></model>
         <joint name='shoulder' type='revolute'><pose relative_to='inner'>0 0 0.1 0 0 0</pose>
           <parent>base</parent><child>inner::arm</child><axis><xyz expressed_in='inner::hand'>0 1 0</xyz></axis></joint>
         </model></world></sdf>"
    );
    let model = load(&text, None).unwrap();
    let M = [0.4641294995666154, 0.0, 0.0, 0.02];
    let h = [-8.629299428720635, 0.0008966951136241837];
    let hand = [1.1458895856773617, 2.08896100035421, 2.9599061319846847];
    drake(&model, &[0.3, -0.4], &[0.5, 0.7], (&M, &h), ("inner::hand", hand));
    let tip = [1.064865667090336, 2.0380073716933698, 2.988869079747236];
    drake(&model, &[0.3, -0.4], &[0.5, 0.7], (&M, &h), ("inner::tip", tip));
}

/// Checks a model that is merged into another model. The merged model keeps its model frame, which is placed by a
/// placement frame inside the model. The reference numbers come from Drake 1.51.
#[test]
fn a_merged_model_is_drakes() {
    let folder = std::env::temp_dir().join(format!("condyle_merged_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let hand = link("hand", "0 0 0.8 0 0 0").replacen("<pose>", "<pose relative_to='__model__'>", 1);
    let part = format!(
        "<sdf version='1.9'><model name='part' placement_frame='flange'><pose>5 5 5 0 0 0</pose>{}{hand}
         <frame name='flange'><pose>0 0.1 0 0 0.2 0</pose></frame>
         <joint name='wrist' type='revolute'><parent>arm</parent><child>hand</child>
           <axis><xyz expressed_in='__model__'>1 0 0</xyz></axis></joint></model></sdf>",
        link("arm", "0 0 0.4 0 0 0")
    );
    std::fs::write(folder.join("part.sdf"), part).unwrap();
    let robot = format!(
        "<sdf version='1.9'><model name='m'>{}<include merge='true'><uri>part.sdf</uri>
         <pose relative_to='base'>0.3 0 0 0 0 0.7</pose></include><joint name='k' type='revolute'><parent>base</parent>
         <child>arm</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>",
        link("base", "")
    );
    std::fs::write(folder.join("robot.sdf"), robot).unwrap();
    let model = Model::from_sdf(folder.join("robot.sdf"), &SdfOptions::default()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let M = [0.42151646645326396, 0.0, 0.0, 0.02];
    let h = [-4.690399744713429, 0.0008966951136259427];
    let (q, v) = ([0.3, -0.4], [0.5, 0.7]);
    drake(&model, &q, &v, (&M, &h), ("hand", [0.33418421802001047, -0.10195295633988781, 0.790028297247707]));
    drake(&model, &q, &v, (&M, &h), ("flange", [0.20867700229444647, -0.07692029983644436, -0.005975034974713755]));
}

/// Checks a joint whose child link is nearer to the root than its parent link: the joint keeps its position. The
/// reference numbers come from Drake 1.51.
#[test]
fn a_reversed_joint_is_drakes() {
    let links =
        link("a", "") + &link("c", "0 0 1 0.3 0 0") + &link("b", "0.5 0 1 0 0.4 0") + &link("d", "0.5 0 2 0 0.4 0");
    let joint = |name: &str, kind: &str, [parent, child]: [&str; 2], axis: &str, pose: &str| {
        format!(
            "<joint name='{name}' type='{kind}'><pose>{pose}</pose><parent>{parent}</parent><child>{child}</child>
             <axis><xyz>{axis}</xyz></axis></joint>"
        )
    };
    let joints = joint("ac", "revolute", ["a", "c"], "0 1 0", "")
        + &joint("bc", "revolute", ["b", "c"], "0 0.6 0.8", "0.1 0 0 0 0 0")
        + &joint("bd", "prismatic", ["b", "d"], "1 0 0", "");
    let text = format!("<sdf version='1.9'><model name='m'>{links}{joints}</model></sdf>");
    let model = load(&text, None).unwrap();
    let names: Vec<&str> = model.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["ac", "bc", "bd"]);
    #[rustfmt::skip]
    let M = [
        3.0689395884344797, -1.158697381309039, 2.0456102022370923, -1.158697381309039, 1.6487891573881748,
        -0.7253208270391709, 2.0456102022370923, -0.7253208270391709, 2.0,
    ];
    let h = [-29.578375172355724, 5.715133141163894, -14.097223569701196];
    let d = [0.9407773228231926, 0.3132147568730044, 1.5918134771375922];
    drake(&model, &[0.3, -0.4, 0.2], &[0.5, 0.7, -0.3], (&M, &h), ("d", d));
}

/// Checks a universal joint whose child link is nearer to the root. The joint is then reversed: the inverse of R_y(q₁)
/// R_x(q₂) is R_x(−q₂) R_y(−q₁).
#[test]
fn a_reversed_universal_joint_moves_the_same() {
    let cross = |[parent, child]: [&str; 2], [first, second]: [&str; 2]| {
        let joint = format!(
            "<joint name='u' type='universal'><parent>{parent}</parent><child>{child}</child>
             <pose relative_to='a'>0.1 0 0.5 0 0 0</pose><axis><xyz>{first}</xyz></axis><axis2><xyz>{second}</xyz></axis2></joint>"
        );
        let on = "<joint name='w' type='fixed'><parent>world</parent><child>a</child></joint>";
        let links = link("a", "") + &link("b", "0.2 0 1 0.3 0 0");
        load(&format!("<sdf version='1.9'><model name='m'>{links}{on}{joint}</model></sdf>"), None).unwrap()
    };
    let backwards = cross(["b", "a"], ["0 1 0", "1 0 0"]);
    let forwards = cross(["a", "b"], ["1 0 0", "0 1 0"]);
    let (mut ours, mut theirs) = (Data::new(&backwards), Data::new(&forwards));
    let here = forward_kinematics(&backwards, &mut ours, &[0.3, -0.7]);
    let there = forward_kinematics(&forwards, &mut theirs, &[-0.3, 0.7]);
    let (a, b) = (here.frame(backwards.frame("b").unwrap()), there.frame(forwards.frame("b").unwrap()));
    close("b", &a.translation.to_array(), &b.translation.to_array());
    close("b", &a.rotation.x.to_array(), &b.rotation.x.to_array());
    close("b", &a.rotation.z.to_array(), &b.rotation.z.to_array());
}
