//! Tests of trees from URDF: numbering, fixed joints, types of joints, and orientations.
#![allow(non_snake_case)]

use condyle_model::{FrameKind, Inertia, Joint, Model, Se3, Sym3, UrdfOptions, Vec3};
use condyle_spatial::Act;
use rand::{RngExt, SeedableRng};

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

/// Returns the rotation by columns, then the position.
fn flat(X: Se3<f64>) -> Vec<f64> {
    X.rotation.columns().into_iter().chain([X.translation]).flat_map(Vec3::to_array).collect()
}

/// Returns the relative difference max |a − b| / (1 + max |b|).
fn relative(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    difference / (1.0 + b.iter().map(|b| b.abs()).fold(0.0, f64::max))
}

/// Checks that a quaternion gives the same rotation as angles, for joints and for inertias. Small errors of the
/// quaternion's length are corrected.
#[test]
fn quaternions() {
    let robot = |version: &str, turned: &str| {
        let inertial = r#"<mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="2.5"/>"#;
        let arm = format!(r#"<link name="arm"><inertial><origin xyz="0.1 0 0" {turned}/>{inertial}</inertial></link>"#);
        let hinge = joint("j", "revolute", "base", "arm", &format!(r#"<origin xyz="0 0.2 0" {turned}/>"#));
        load(&format!("<robot name='r' {version}><link name='base'/>{arm}{hinge}</robot>"))
    };
    // a roll of half a turn, then a yaw of a quarter turn: the product of (0, 0, √½, √½) and (1, 0, 0, 0)
    let angles = robot("", &format!(r#"rpy="{} 0 {}""#, std::f64::consts::PI, std::f64::consts::FRAC_PI_2));
    for version in ["version='1.1'", "version='1.2'"] {
        let turned = robot(version, r#"quat_xyzw="0.7071 0.7071 0 0""#);
        let (a, b) = (&angles.bodies()[1], &turned.bodies()[1]);
        assert!(relative(&flat(a.placement), &flat(b.placement)) < ROUNDING);
        let moments = |I: Inertia<f64>| [I.rotational.xx, I.rotational.yy, I.rotational.zz, I.mass_com.x, I.mass_com.y];
        assert!(relative(&moments(a.inertia), &moments(b.inertia)) < ROUNDING);
    }
    assert_eq!(robot("version='1.0'", r#"rpy="0 0 0""#).nv(), 1);
}

/// Checks that bodies are numbered depth first, and siblings by the bytes of their joints' names, for any order in the
/// file.
#[test]
fn numbering() {
    let mut elements = vec![link("base")];
    for (name, parent) in [
        ("j10", "base"),
        ("j2", "base"),
        ("_0", "base"),
        ("J3", "base"),
        ("j1", "base"),
        ("b", "l_J3"),
        ("a", "l_J3"),
        ("ä", "l_J3"),
        ("z", "l_j1"),
    ] {
        elements.push(link(&format!("l_{name}")));
        elements.push(joint(name, "revolute", parent, &format!("l_{name}"), ""));
    }
    let mut rng = rand::rngs::StdRng::seed_from_u64(1);
    for _ in 0..20 {
        let model = load(&format!("<robot name='r'>{}</robot>", elements.concat()));
        let names: Vec<&str> = model.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
        assert_eq!(names, ["J3", "a", "b", "ä", "_0", "j1", "z", "j10", "j2"]);
        let parents: Vec<usize> = model.bodies().iter().skip(1).map(|b| b.parent).collect();
        assert_eq!(parents, [0, 1, 1, 1, 0, 0, 6, 0, 0]);
        let starts: Vec<usize> = model.bodies().iter().skip(1).map(|b| b.idx_v).collect();
        assert_eq!(starts, (0..9).collect::<Vec<_>>());
        for i in (1..elements.len()).rev() {
            elements.swap(i, rng.random_range(0..=i));
        }
    }
}

/// Checks the numbering through fixed joints. The joints of a link, including fixed joints, are sorted by name. The
/// joints on the child of a fixed joint get the position of the fixed joint in this order.
#[test]
fn numbering_through_fixed_joints() {
    let links: String = ["base", "plate", "a", "b", "c"].map(link).concat();
    let joints = [
        joint("m", "fixed", "base", "plate", ""),
        joint("c", "revolute", "plate", "c", ""),
        joint("a", "revolute", "plate", "a", ""),
        joint("k", "revolute", "base", "b", ""),
    ];
    let model = load(&format!("<robot name='r'>{links}{}</robot>", joints.concat()));
    let names: Vec<&str> = model.bodies().iter().skip(1).map(|b| b.joint_name.as_str()).collect();
    assert_eq!(names, ["k", "a", "c"]); // k comes before m, and on the child link of m, a comes before c
}

/// Checks that two successive fixed joints with rotations are merged: masses, centre of mass, inertia and frames.
#[test]
fn fixed_joints_are_merged() {
    let text = r#"<robot name="r"><link name="base"/>
      <link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
        <inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
      <link name="bracket"/>
      <link name="tool"><inertial><origin xyz="0 0.2 0" rpy="0 0 0.3"/><mass value="0.5"/>
        <inertia ixx="0.01" ixy="0" ixz="0.002" iyy="0.02" iyz="0" izz="0.03"/></inertial></link>
      <joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
      <joint name="screws" type="fixed"><parent link="arm"/><child link="bracket"/>
        <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/></joint>
      <joint name="glue" type="fixed"><parent link="bracket"/><child link="tool"/>
        <origin xyz="0 0 0.5" rpy="1.5707963267948966 0 0"/></joint></robot>"#;
    let model = load(text);
    assert_eq!((model.bodies().len(), model.nq(), model.nv()), (2, 2, 1));
    let rpy = |r: f64, p: f64, y: f64| {
        let about = |k: usize, angle: f64| {
            let w: Vec3<f64> = core::array::from_fn(|i| if i == k { angle } else { 0.0 }).into();
            condyle_spatial::lie::exp3(w).to_rotation()
        };
        about(2, y) * about(1, p) * about(0, r)
    };
    let bracket = Se3::new(rpy(0.1, 0.2, 0.3), Vec3::new(1.0, 2.0, 3.0));
    let tool = bracket * Se3::new(rpy(core::f64::consts::FRAC_PI_2, 0.0, 0.0), Vec3::new(0.0, 0.0, 0.5));
    for (name, expected) in [
        ("arm", Se3::identity()),
        ("hinge", Se3::identity()),
        ("bracket", bracket),
        ("screws", bracket),
        ("tool", tool),
        ("glue", tool),
    ] {
        let frame = &model.frames()[model.frame(name).unwrap()];
        assert_eq!(frame.body, 1, "{name}");
        assert!(relative(&flat(frame.placement), &flat(expected)) < ROUNDING, "{name}");
        let kind = if ["hinge", "screws", "glue"].contains(&name) { FrameKind::Joint } else { FrameKind::Link };
        assert_eq!(frame.kind, kind, "{name}");
    }
    let sym = |xx, yy, zz, xy, xz| Sym3 { xx, yy, zz, xy, xz, yz: 0.0 };
    let arm = Inertia::from_com(2.0, Vec3::new(0.1, 0.0, 0.0), sym(0.1, 0.2, 0.3, 0.01, 0.0));
    let at = Se3::new(rpy(0.0, 0.0, 0.3), Vec3::new(0.0, 0.2, 0.0));
    let own = at.act(Inertia::from_com(0.5, Vec3::zero(), sym(0.01, 0.02, 0.03, 0.0, 0.002)));
    let expected = arm + tool.act(own);
    let numbers = |I: Inertia<f64>| {
        let (h, r) = (I.mass_com, I.rotational);
        [I.mass, h.x, h.y, h.z, r.xx, r.xy, r.yy, r.xz, r.yz, r.zz]
    };
    assert!(relative(&numbers(model.bodies()[1].inertia), &numbers(expected)) < ROUNDING);
    assert!((model.total_mass() - 2.5).abs() < ROUNDING);
}

/// Checks every type of joint of a URDF, with its axis, limits, damping and friction.
#[test]
fn joint_types() {
    let kinds = ["revolute", "continuous", "prismatic", "floating", "planar", "spherical"];
    let names = ["a", "b", "c", "d", "e", "f"];
    let mut text = format!("<robot name='r'>{}", link("base"));
    for (name, kind) in names.iter().zip(kinds) {
        let inside = r#"<axis xyz="0 3 4"/><dynamics damping="0.5" friction="0.25"/>"#;
        text += &(link(&format!("l{name}")) + &joint(name, kind, "base", &format!("l{name}"), inside));
    }
    let model = load(&(text + "</robot>"));
    let axis = Vec3::new(0.0, 0.6, 0.8);
    let expected = [
        Joint::Revolute { axis },
        Joint::Continuous { axis },
        Joint::Prismatic { axis },
        Joint::FreeFlyer,
        Joint::Planar,
        Joint::Spherical,
    ];
    for (body, expected) in model.bodies().iter().skip(1).zip(expected) {
        match (body.joint.axis(), expected.axis()) {
            (Some(found), Some(axis)) => assert!(relative(&found.to_array(), &axis.to_array()) < ROUNDING),
            (found, axis) => assert_eq!(found, axis),
        }
        assert_eq!((body.joint.nq(), body.joint.nv()), (expected.nq(), expected.nv()));
    }
    assert_eq!((model.nq(), model.nv()), (1 + 2 + 1 + 7 + 4 + 4, 1 + 1 + 1 + 6 + 3 + 3));
    let limits = model.limits();
    assert_eq!((limits.lower[0], limits.upper[3], limits.velocity[0], limits.effort_upper[2]), (-1.0, 1.0, 3.0, 2.0));
    assert!(limits.upper[1].is_infinite() && limits.upper[4..].iter().all(|x| x.is_infinite()));
    assert_eq!((limits.velocity[1], limits.effort_upper[1]), (3.0, 2.0)); // a continuous joint may have these limits
    // damping and friction of a floating and of a planar joint have no defined unit, and are ignored
    for (part, is_held) in [(0..3, 1.0), (3..12, 0.0), (12..15, 1.0)] {
        assert!(model.damping()[part.clone()].iter().all(|&x| x == 0.5 * is_held));
        assert!(model.friction()[part].iter().all(|&x| x == 0.25 * is_held));
    }
    let default =
        load(&format!("<robot name='r'>{}{}{}</robot>", link("x"), link("y"), joint("j", "revolute", "x", "y", "")));
    assert_eq!(default.bodies()[1].joint, Joint::Revolute { axis: Vec3::new(1.0, 0.0, 0.0) }); // the default axis is x
}
