//! Tests of the dynamics of models from URDF: root joints, mimic joints, and the embedded robots.

use crate::common;

use common::relative;
use condyle_dynamics::{Data, Joint, Model, UrdfOptions, Vec3, crba, forward_kinematics, gravity, neutral, robots};

/// Tolerance of a few products of poses.
const ROUNDING: f64 = 1e-14;

fn load(text: &str) -> Model {
    Model::from_urdf_str(text, &UrdfOptions::default()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn link(name: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}<limit lower="-1" upper="1" effort="2" velocity="3"/></joint>"#
    )
}

/// Checks that links fixed to the world belong to body 0, and that their mass is part of the total mass.
#[test]
fn root_joints() {
    let fixed = robots::arm7();
    assert_eq!(fixed.frames()[fixed.frame("base").unwrap()].body, 0);
    assert!(fixed.bodies()[0].inertia.mass > 0.0);
    for root in [Joint::FreeFlyer, Joint::Planar, Joint::Spherical, Joint::Prismatic { axis: Vec3::new(0.0, 0.0, 2.0) }]
    {
        let options = UrdfOptions { root_joint: Some(root), ..UrdfOptions::default() };
        let model = Model::from_urdf_str(robots::ARM7, &options).unwrap();
        assert_eq!(model.bodies()[1].joint_name, "root_joint");
        assert_eq!((model.nq(), model.nv()), (7 + root.nq(), 7 + root.nv()));
        assert_eq!(model.total_mass(), fixed.total_mass());
        assert_eq!(neutral(&model)[root.nq()..], [0.0; 7]);
        let mut data = Data::new(&model);
        let M = crba(&model, &mut data, &neutral(&model));
        if root.nv() > 3 {
            assert!((M[(0, 0)] - model.total_mass()).abs() < 1e-12);
        }
    }
}

/// Checks both treatments of mimic joints. By default, a mimic joint is an independent joint. With the option `mimic`,
/// it uses the coordinate of its leader, which may be anywhere in the file.
#[test]
fn mimic_joints() {
    let links: String = ["base", "left", "right"].map(link).concat();
    let follow = r#"<mimic joint="right" multiplier="-2" offset="0.5"/>"#;
    let joints = joint("left", "prismatic", "base", "left", follow) + &joint("right", "prismatic", "base", "right", "");
    let text = format!("<robot name='gripper'>{links}{joints}</robot>");
    assert_eq!(load(&text).nv(), 2);
    let model = Model::from_urdf_str(&text, &UrdfOptions { mimic: true, ..UrdfOptions::default() }).unwrap();
    assert_eq!((model.nq(), model.nv(), model.has_mimic()), (1, 1, true));
    let mimic = model.bodies()[model.joint("left").unwrap()].mimic.unwrap();
    assert_eq!((mimic.ratio, mimic.offset), (-2.0, 0.5));
    let mut data = Data::new(&model);
    let left = forward_kinematics(&model, &mut data, &[0.1]).frame(model.frame("left").unwrap());
    assert!(relative(&left.translation.to_array(), &[0.3, 0.0, 0.0]) < ROUNDING);
    assert_eq!(crba(&model, &mut data, &[0.1])[(0, 0)], 5.0); // 1 + 2²
}

/// Checks that the properties of the embedded robots match the documentation of the robots.
#[test]
fn embedded_robots() {
    let [arm, quadruped, humanoid] = [robots::arm7(), robots::quadruped(), robots::humanoid()];
    assert_eq!([&arm, &quadruped, &humanoid].map(|m| (m.nq(), m.nv())), [(7, 7), (19, 18), (39, 38)]);
    for (model, frames) in [
        (&arm, &["tool"][..]),
        (&quadruped, &["LF_foot", "LH_foot", "RF_foot", "RH_foot"]),
        (&humanoid, &["left_sole", "right_sole"]),
    ] {
        frames.iter().for_each(|f| assert!(model.frame(f).is_ok()));
        let mut data = Data::new(model);
        assert!(gravity(model, &mut data, &neutral(model)).iter().all(|x| x.is_finite()));
        for body in model.bodies().iter().skip(1) {
            assert!(body.inertia.mass > 0.0, "{}", body.name);
            assert_eq!(body.placement.rotation.columns().map(|c| (c.norm_squared() - 1.0).abs() < 1e-14), [true; 3]);
        }
        assert_eq!(model.gravity(), &Vec3::new(0.0, 0.0, -9.81));
    }
}
