//! Hostile input: seeds, mutations of seeds, and a property that must hold for every input.
//!
//! The property: a reader either rejects an input with an error, or returns a robot, problem or mesh that can be used.
//! Neither reading nor computing panics or hangs, and accepted input gives finite numbers.

mod mutations;

pub use mutations::mutated;

use condyle::optimal::robot::{
    Activation, Contact, ControlBounds, Cost, Dynamics, Integrator, Knot, Limit, Residual, RobotProblem,
};
use condyle::{
    ContactConstraint, Data, Joint, MjcfOptions, Model, SdfOptions, Se3, UrdfOptions, aba, crba, neutral,
    random_configuration, rnea, robots,
};
use condyle_meshes::{Format, Meshes};
use rand::SeedableRng;
use rand::rngs::StdRng;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Format of an input file, which contains a robot, a problem or a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Robot in URDF.
    Urdf,
    /// Robot in MJCF.
    Mjcf,
    /// Robot in SDF.
    Sdf,
    /// Model in JSON.
    Model,
    /// Optimal control problem in JSON.
    Problem,
    /// Model in the binary format that Python's pickles use.
    Pickle,
    /// Named positions in SRDF.
    Srdf,
    /// Mesh in STL.
    Stl,
    /// Mesh in OBJ.
    Obj,
    /// Mesh in DAE (COLLADA).
    Dae,
}

macro_rules! file {
    ($name:literal) => {
        include_str!(concat!("../../../crates/dynamics/tests/data/", $name))
    };
}

macro_rules! mesh {
    ($name:literal) => {
        include_str!(concat!("../../../crates/cli/tests/boxes/", $name))
    };
}

/// MJCF text with elements that copy subtrees, and with meshes that have mass.
const COPIES: &str = r#"<mujoco><compiler fitaabb="true"/><default><default class="c"><joint damping="1"/></default></default>
<asset><mesh name="m" inertia="exact" scale="1 -2 3" vertex="0 0 0 1 0 0 0 2 0 0 0 3" face="0 2 1 0 1 3 0 3 2 1 2 3"/>
<mesh name="s" builtin="supersphere" params="5 0.5 1.5"/></asset><worldbody><replicate count="3" offset="1 0 0" euler="0 0 30" sep="-">
<body name="b" childclass="c"><joint name="j" range="-9 9"/><geom type="mesh" mesh="m"/><frame name="f" pos="0 0 1"><camera name="v"/>
<site name="p" type="capsule" size="0.1" fromto="0 0 0 1 1 1"/></frame></body></replicate><body name="o"><freejoint align="true"/>
<geom type="box" mesh="s"/></body><attach body="b-1" prefix="x"/></worldbody><actuator><motor joint="j" gear="2"/>
<intvelocity joint="j" kp="3" actrange="-1 1"/><pid joint="j" kp="1" ki="2"/></actuator><keyframe>
<key name="k" ctrl="1 2 3" act="0.5"/></keyframe></mujoco>"#;

/// MJCF text that consists of several files; [`FILES`] contains the other files.
const INCLUDES: &str = r#"<mujoco><asset><model name="m" file="child.xml"/><mesh name="o" file="face.obj"/></asset><worldbody>
<body name="b"><joint name="i"/><geom type="mesh" mesh="o"/><include file="part.xml"/><frame pos="0 0 1"><attach model="m" body="c" prefix="x-"/>
</frame></body></worldbody></mujoco></mujoco>"#;

/// SDF text that consists of several files; [`FILES`] contains the other files.
const MODELS: &str = r#"<sdf version="1.9"><world name="w"><include><uri>part.sdf</uri><name>a</name><pose>1 0 0 0 0 0</pose></include>
<include merge="true"><uri>part.sdf</uri><name>b</name></include><joint name="j" type="ball"><parent>world</parent><child>a::l</child></joint>
</world></sdf>"#;

/// Names and contents of the files that are in the same folder as the input.
const FILES: [(&str, &str); 4] = [
    ("part.xml", "<mujocoinclude><body name='p'><joint name='s' type='slide'/><geom size='1'/></body></mujocoinclude>"),
    (
        "child.xml",
        "<mujoco><compiler angle='radian'/><worldbody><body name='c'><joint name='q' range='-1 1'/><geom size='1'/></body></worldbody>
        <actuator><motor name='a' joint='q'/></actuator></mujoco>",
    ),
    ("part.sdf", "<sdf version='1.7'><model name='m'><link name='l'/><frame name='f'/></model></sdf>"),
    ("face.obj", POLYGONS),
];

/// OBJ text whose faces have many corners, are concave, and do not lie in a plane.
const POLYGONS: &str = "v 3 1 0\nv 5 1 0.5\nv 6 3 0\nv 4 5 1\nv 2 3 -0.5\nv 4 2 -5\nf 1 2 3 4 5\nf 6 2 1\nf 6 3 2\nf 6 4 3\nf 6 5 4\n\
f 6 1 5\nf 5 4 6 3 2 1\n";

impl Kind {
    /// Returns the seeds of this format, which are all valid.
    pub fn seeds(self) -> Vec<Vec<u8>> {
        static SEEDS: [OnceLock<Vec<Vec<u8>>>; 10] = [const { OnceLock::new() }; 10];
        SEEDS[self as usize].get_or_init(|| self.new_seeds()).clone()
    }

    fn new_seeds(self) -> Vec<Vec<u8>> {
        let texts = match self {
            Self::Urdf => {
                let version = "<robot version=\"1.1\" name=\"arm7\">";
                let quaternions = robots::ARM7.replacen("<robot name=\"arm7\">", version, 1);
                let quaternions = quaternions.replace("rpy=\"1.5707963267948966 0 0\"", "quat_xyzw=\"0.6 0 0 0.8\"");
                let others = [robots::ARM7, robots::QUADRUPED, robots::HUMANOID, file!("mimic.urdf")];
                others.map(str::to_owned).into_iter().chain([quaternions, URDF.to_owned()]).collect()
            }
            Self::Mjcf => {
                let defaults = file!("arm_defaults.xml").replace("<mujoco>", "").replace("</mujoco>", "");
                let arm = file!("arm.xml").replace("<include file=\"arm_defaults.xml\"/>", &defaults);
                let others = [file!("quadruped.xml"), file!("gripper.xml"), mesh!("boxes.xml")];
                [arm, COPIES.to_owned(), INCLUDES.to_owned()].into_iter().chain(others.map(str::to_owned)).collect()
            }
            Self::Sdf => vec![file!("linkage.sdf").to_owned(), MODELS.to_owned()],
            Self::Srdf => vec![file!("quadruped.srdf").to_owned()],
            Self::Model => {
                models().iter().map(|m| serde_json::to_string(m).expect("is made of numbers and words")).collect()
            }
            Self::Problem => {
                problems().iter().map(|p| serde_json::to_string(p).expect("is made of numbers and words")).collect()
            }
            Self::Stl => return vec![mesh!("box.stl").into(), binary_stl()],
            Self::Obj => vec![mesh!("box.obj").to_owned(), POLYGONS.to_owned()],
            Self::Dae => vec![mesh!("box.dae").to_owned()],
            Self::Pickle => return models().iter().map(|m| postcard::to_allocvec(m).expect("has room")).collect(),
        };
        texts.into_iter().map(String::into_bytes).collect()
    }

    /// Reads an input, and uses the result if reading succeeds. Returns whether reading succeeded.
    ///
    /// # Panics
    /// If an input was accepted, but cannot be used.
    pub fn check(self, input: &[u8]) -> bool {
        let text = match self {
            // Take the input as the text of a file, in any encoding.
            Self::Urdf | Self::Mjcf | Self::Sdf | Self::Srdf => Model::decoded(input.to_vec()).into(),
            _ => String::from_utf8_lossy(input),
        };
        // Select the reader's options by the length of the input. Mutations change the length, so all options are
        // tested.
        let (some, other) = (input.len().is_multiple_of(2), input.len().is_multiple_of(3));
        let root_joint = some.then_some(Joint::FreeFlyer);
        let said = match self {
            Self::Urdf => {
                if let Ok(plain) = Model::well_formed(&text) {
                    assert_eq!(Model::well_formed(&plain).as_ref(), Ok(&plain), "a text for other parsers");
                }
                let options = UrdfOptions { root_joint, mimic: other, ..UrdfOptions::default() };
                let model = Model::from_urdf_str(&text, &options);
                if let (Ok(model), true) = (&model, input.len().is_multiple_of(5)) {
                    write(self, model, &text, |model, new, original| model.write_urdf(new, original));
                }
                model.map(|model| use_model(&model)).map_err(|e| e.to_string())
            }
            Self::Mjcf => {
                let poses = condyle_meshes::mjcf::visuals(&text).into_iter().map(|visual| visual.pose.to_homogeneous());
                assert!(poses.flat_map(|pose| pose.as_slice().to_vec()).all(f64::is_finite), "a mesh is nowhere");
                let options = MjcfOptions { mimic: some, weightless_meshes: other, ..MjcfOptions::default() };
                let model = match text.contains("file=") {
                    true => Model::from_mjcf(in_folder(self, &text), &options),
                    false => Model::from_mjcf_str(&text, &options),
                };
                if let (Ok(model), true) = (&model, input.len().is_multiple_of(5)) {
                    write(self, model, &text, |model, new, original| model.write_mjcf(new, original));
                }
                model.map(|model| use_model(&model)).map_err(|e| e.to_string())
            }
            Self::Sdf => {
                let options = SdfOptions { root_joint, mimic: other, ..SdfOptions::default() };
                let model = match text.contains("uri>") {
                    true => Model::from_sdf(in_folder(self, &text), &options),
                    false => Model::from_sdf_str(&text, &options),
                };
                model.map(|model| use_model(&model)).map_err(|e| e.to_string())
            }
            Self::Srdf => {
                let positions = robots::quadruped().reference_configurations_str(&text, some);
                positions.map(|all| use_positions(&all)).map_err(|e| e.to_string())
            }
            Self::Stl => use_mesh(Format::Stl, input),
            Self::Obj => use_mesh(Format::Obj, input),
            Self::Dae => use_mesh(Format::Dae, input),
            Self::Model => serde_json::from_str(&text).map(|model: Model| use_model(&model)).map_err(|e| e.to_string()),
            Self::Pickle => {
                postcard::from_bytes(input).map(|model: Model| use_model(&model)).map_err(|e| e.to_string())
            }
            Self::Problem => serde_json::from_str(&text).map_err(|e| e.to_string()).and_then(|p| use_problem(&p)),
        };
        if let Err(said) = &said {
            assert!(!said.is_empty() && !said.contains("Some(") && !said.contains("{ "), "{said}");
        }
        said.is_ok()
    }
}

/// Robot with features of URDF besides links and joints, and with elements that other programs add.
const URDF: &str = r#"<!------ a robot ------>
<?xml version="1.0" encoding="windows-1252"?>
<!DOCTYPE robot [<!ELEMENT robot (link)>]>
<robot name="r" version="1.2" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="a"><inertial><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.03" izz="0.04"/></inertial></link>
  <link name="c"><inertial><mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial></link>
  <link name="d"><inertial><mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial></link>
  <joint name="root_joint" type="planar"><parent link="world"/><child link="a"/><axis xyz="1 -2 0.5"/></joint>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="3" velocity="2" acceleration="4" drake:acceleration="5"/>
    <safety_controller k_velocity="1"/><calibration rising="0"/><dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="k" type="continuous"><parent link="b"/><child link="c"/><mimic joint="j" multiplier="2"/></joint>
  <drake:joint name="s" type="screw"><parent link="c"/><child link="d"/><axis xyz="0 0 1"/>
    <drake:screw_thread_pitch value="0.01"/><mimic joint="k" offset="0.5"/></drake:joint>
  <frame name="f" link="d" xyz="1 2 3" rpy="0 0.1 0"/>
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j"/>
    <actuator name="m"><mechanicalReduction>50</mechanicalReduction><rotorInertia>0.001</rotorInertia></actuator></transmission>
  <gazebo reference="b"><turnGravityOff>true</turnGravityOff><sensor:camera name="x"/></gazebo>
</robot>"#;

/// Returns robots with every feature that a model file can contain.
fn models() -> Vec<Model> {
    let mimic = UrdfOptions { mimic: true, ..UrdfOptions::default() };
    let mimic = Model::from_urdf_str(file!("mimic.urdf"), &mimic).expect("is a good robot");
    let linkage = Model::from_sdf_str(file!("linkage.sdf"), &SdfOptions::default()).expect("is a good robot");
    vec![robots::arm7(), robots::quadruped(), mimic, linkage]
}

/// Returns problems with every type of dynamics, and with every cost and constraint that a problem file can contain.
fn problems() -> Vec<RobotProblem> {
    let (arm, quadruped) = (robots::arm7(), robots::quadruped());
    let state = |model: &Model| [neutral(model), vec![0.0; model.nv()]].concat();
    let rest = |model: &Model| Residual::State { reference: state(model) };
    let effort = |n: usize| Residual::Control { reference: vec![0.0; n] };
    let integrator = Integrator::SemiImplicitEuler;
    let frame = arm.frames().last().expect("has frames").into();
    let tool = Residual::FramePlacement { frame, target: Se3::identity() };
    let mut reach = Knot::new(
        Dynamics::Free { actuation: None, integrator, dt: 0.05 },
        vec![
            Cost::new("rest", 1e-2, rest(&arm), Activation::Quadratic),
            Cost::new("tool", 1.0, tool, Activation::Quadratic),
            Cost::new("effort", 1e-3, effort(7), Activation::Weighted(vec![1.0; 7])),
            Cost::new(
                "centre",
                1.0,
                Residual::CenterOfMass { target: [0.1, 0.0, 0.4].into() },
                Activation::Smooth1 { epsilon: 1.0 },
            ),
        ],
    );
    reach.limits = vec![Limit::new("effort", effort(7), vec![-30.0; 7], vec![f64::INFINITY; 7])];
    reach.costs_at.insert(1, reach.costs.clone());
    reach.bounds = Some(ControlBounds { lower: vec![f64::NEG_INFINITY; 7], upper: vec![40.0; 7] });
    let end = Knot::new(Dynamics::Terminal, vec![Cost::new("rest", 1.0, rest(&arm), Activation::Quadratic)]);
    let inverse = Knot::new(Dynamics::Inverse { integrator, dt: 0.02 }, reach.costs[..1].to_vec());
    let foot = |name: &str| Contact::new(name, ContactConstraint::point(quadruped.frame(name).expect("has feet")));
    let contacts = vec![foot("LF_foot"), foot("RH_foot")];
    let stand = Knot::new(
        Dynamics::Contact { contacts: contacts.clone(), damping: 1e-8, actuation: None, integrator, dt: 0.02 },
        vec![Cost::new("rest", 1.0, rest(&quadruped), Activation::Quadratic)],
    );
    let land = Knot::new(Dynamics::Impulse { contacts, restitution: 0.0, damping: 1e-8 }, stand.costs.clone());
    let still = Knot::new(Dynamics::Terminal, stand.costs.clone());
    vec![
        RobotProblem {
            x0: state(&arm),
            model: arm,
            knots: vec![reach, inverse],
            knot_models: vec![0, 0, 1],
            terminal: end,
        },
        RobotProblem {
            x0: state(&quadruped),
            model: quadruped,
            knots: vec![stand, land],
            knot_models: vec![0, 1, 0],
            terminal: still,
        },
    ]
}

/// Writes a text into a folder that also contains [`FILES`], and returns the text's path.
fn in_folder(kind: Kind, text: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("condyle-hostile-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for files");
        for (name, text) in FILES {
            std::fs::write(folder.join(name), text).expect("a file");
        }
        folder
    });
    let path = folder.join(format!("{kind:?}.txt"));
    std::fs::write(&path, text).expect("a file");
    path
}

/// Writes the robot into a copy of its file, then writes the robot with another armature into another copy. Each write
/// must succeed, or return an error with a message.
fn write<E: ToString>(kind: Kind, model: &Model, text: &str, write: impl Fn(&Model, &Path, &Path) -> Result<(), E>) {
    let original = in_folder(kind, text);
    let new = original.with_extension("new");
    let more: Vec<f64> = model.armature().iter().map(|armature| armature + 0.25).collect();
    let Ok(other) = model.clone().with_armature(&more) else { return };
    for model in [model, &other] {
        if let Err(said) = write(model, &new, &original).map_err(|e| e.to_string()) {
            assert!(!said.is_empty() && !said.contains("Some("), "{said}");
        }
    }
}

/// Checks that inverse dynamics and the inertia matrix are finite at the neutral position. If the inertia matrix is not
/// singular, also checks forward dynamics at a random position. (At the neutral position, axes may coincide.)
fn use_model(model: &Model) {
    let (mut data, mut q) = (Data::new(model), neutral(model));
    let zeros = vec![0.0; model.nv()];
    let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
    assert!(finite(rnea(model, &mut data, &q, &zeros, &zeros, &[])), "rnea: {model}");
    assert!(finite(crba(model, &mut data, &q).as_slice()), "crba: {model}");
    q = random_configuration(model, &mut StdRng::seed_from_u64(1));
    assert!(finite(&q), "random_configuration: {model}");
    if model.singular_joints().is_empty() {
        assert!(finite(aba(model, &mut data, &q, &zeros, &zeros, &[])), "aba: {model}");
    }
}

/// Checks that named positions are finite, and have as many numbers as the quadruped has coordinates.
fn use_positions(all: &[(String, Vec<f64>)]) {
    assert!(all.iter().all(|(_, q)| q.len() == 19 && q.iter().all(|x| x.is_finite())), "{all:?}");
}

/// Builds a problem and checks its rollout, which must give finite numbers or an error.
fn use_problem(data: &RobotProblem) -> Result<(), String> {
    let mut problem = data.build().map_err(|e| e.to_string())?;
    let us = vec![0.0; (0..problem.horizon()).map(|t| problem.nu(t)).sum()];
    let xs = problem.rollout(&us).map_err(|e| e.to_string())?;
    assert!(xs.iter().all(|x| x.is_finite()), "rollout: {xs:?}");
    Ok(())
}

/// Checks a mesh that a page would draw: triangles have valid vertex indices, and bounding boxes are finite.
fn use_mesh(format: Format, bytes: &[u8]) -> Result<(), String> {
    if let Ok((points, triangles)) = condyle_meshes::triangles(format, bytes) {
        assert!(
            triangles.iter().flatten().all(|&corner| (corner as usize) < points.len()),
            "a corner that is not there"
        );
    }
    let mut meshes = Meshes::default();
    let drawn = meshes.add(format, bytes, &|_| Some(mesh!("box.mtl").to_owned()))?;
    assert!(drawn.iter().flat_map(|part| part.color).flatten().all(f64::is_finite));
    let parts = meshes.written();
    assert!(!parts.is_empty() && parts.len() == drawn.len());
    for part in parts {
        let numbers = |key: &str| part[key].as_array().into_iter().flatten().filter_map(Value::as_f64).count();
        assert!([numbers("low"), numbers("side")] == [3, 3], "a box that is not finite");
        let [points, corners] = ["points", "triangles"].map(|key| from_base64(part[key].as_str().expect("is a text")));
        assert!(!corners.is_empty() && [corners.len() % 3, points.len() % 3] == [0, 0], "parts of a triangle");
        assert!(corners.iter().all(|&corner| usize::from(corner) < points.len() / 3), "a corner that is not there");
    }
    Ok(())
}

/// Decodes numbers of 16 bits from base64, with the lower byte of each number first.
fn from_base64(text: &str) -> Vec<u16> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let letters: Vec<u32> = text.trim_end_matches('=').bytes().map(|letter| value(letter).into()).collect();
    let bytes = letters.chunks(4).flat_map(|four| {
        let bits = four.iter().zip([18, 12, 6, 0]).map(|(value, place)| value << place).sum::<u32>();
        bits.to_be_bytes()[1..four.len()].to_vec()
    });
    bytes.collect::<Vec<u8>>().chunks(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect()
}

/// Returns a binary STL with two triangles.
fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2_u32.to_le_bytes());
    for corners in
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]
    {
        bytes.extend([0; 12]);
        bytes.extend(corners.iter().flatten().flat_map(|x: &f32| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}
