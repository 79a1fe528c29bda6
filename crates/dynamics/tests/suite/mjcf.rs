//! Tests of the dynamics of models from MJCF. The results are compared with MuJoCo (`data/make_mujoco.py`).

use condyle_dynamics::{Data, FrameKind, Joint, MjcfOptions, Model, Vec3, crba, forward_kinematics, rnea};
use serde_json::Value;
use std::path::PathBuf;

/// Relative tolerance. Both libraries sum some hundred products. MuJoCo uses principal axes of inertia, which it
/// computes by iteration.
const AGREES: f64 = 1e-10;

fn data(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

fn text(file: &str) -> String {
    std::fs::read_to_string(data(file)).unwrap()
}

fn floats(value: &Value) -> Vec<f64> {
    let all = value.as_array().unwrap().iter();
    all.flat_map(|x| x.as_f64().map_or_else(|| floats(x), |x| vec![x])).collect()
}

fn close(what: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let scale = theirs.iter().fold(1.0, |a: f64, x| a.max(x.abs()));
    let error = ours.iter().zip(theirs).fold(0.0, |a: f64, (x, y)| a.max((x - y).abs())) / scale;
    assert!(error <= AGREES, "{what}: {error:e}");
}

/// Returns the translation, and then the rotation matrix by rows.
fn flat(X: &condyle_dynamics::Se3<f64>) -> Vec<f64> {
    let (p, R) = (X.translation, X.rotation.transpose());
    [p, R.x, R.y, R.z].iter().flat_map(|v| v.to_array()).collect()
}

/// Compares placements, M and nonlinear effects with MuJoCo's results, after conversion of MuJoCo's quaternions and
/// free joints.
fn against_mujoco(name: &str) {
    let model = Model::from_mjcf(data(&format!("{name}.xml")), &MjcfOptions::default()).unwrap();
    let reference: Value = serde_json::from_str(&text(&format!("{name}_mujoco.json"))).unwrap();
    assert_eq!(
        (model.nq() as u64, model.nv() as u64),
        (reference["nq"].as_u64().unwrap(), reference["nv"].as_u64().unwrap())
    );
    close("armature", model.armature(), &floats(&reference["armature"]));
    close("damping", model.damping(), &floats(&reference["damping"]));
    for (body, range) in model.bodies().iter().skip(1).zip(reference["range"].as_array().unwrap()) {
        let ours = [model.limits().lower[body.idx_q], model.limits().upper[body.idx_q]];
        match body.joint {
            Joint::Revolute { .. } | Joint::Prismatic { .. } if !range.is_null() => {
                close(&body.joint_name, &ours, &floats(range));
            }
            _ => assert_eq!(ours, [f64::NEG_INFINITY, f64::INFINITY], "{}", body.joint_name),
        }
    }
    let free = model.bodies()[1].joint == Joint::FreeFlyer;
    let mut work = Data::new(&model);
    for state in reference["states"].as_array().unwrap() {
        let (mut q, mut v) = (floats(&state["q"]), floats(&state["v"]));
        for body in &model.bodies()[1..] {
            match body.joint {
                Joint::FreeFlyer => q[body.idx_q + 3..body.idx_q + 7].rotate_left(1),
                Joint::Spherical => q[body.idx_q..body.idx_q + 4].rotate_left(1),
                _ => {}
            }
        }
        let placements = forward_kinematics(&model, &mut work, &q);
        for (kind, frame_kind) in [("bodies", FrameKind::Link), ("sites", FrameKind::User)] {
            for (name, there) in state[kind].as_object().unwrap() {
                let i = model.frames().iter().position(|f| &f.name == name && f.kind == frame_kind).unwrap();
                let theirs = [floats(&there["p"]), floats(&there["R"])].concat();
                close(name, &flat(&placements.frame(i)), &theirs);
            }
        }
        // MuJoCo's velocity v_mujoco corresponds to v = T v_mujoco here, with T = Rᵀ for the free joint's linear part.
        // So a = T a_mujoco + Ṫ v_mujoco and τ_mujoco = Tᵀ τ.
        let R = placements.body(1).rotation;
        let mut a = vec![0.0; model.nv()];
        let linear = |x: &[f64]| Vec3::new(x[0], x[1], x[2]);
        if free {
            let w = linear(&v[3..6]);
            let body = R.transpose_mul(linear(&v));
            v[..3].copy_from_slice(&body.to_array());
            a[..3].copy_from_slice(&(-w.cross(body)).to_array());
        }
        let to_mujoco = |x: &mut [f64]| {
            if free {
                let world = R * linear(x);
                x[..3].copy_from_slice(&world.to_array());
            }
        };
        let mut bias = rnea(&model, &mut work, &q, &v, &a, &[]).to_vec();
        to_mujoco(&mut bias);
        close("bias", &bias, &floats(&state["bias"]));
        let mut M = crba(&model, &mut work, &q).clone_owned();
        for _ in 0..2 {
            M.column_iter_mut().for_each(|mut c| to_mujoco(c.as_mut_slice()));
            M = M.transpose();
        }
        close("M", M.as_slice(), &floats(&state["M"]));
    }
    // Condyle merges bodies without joints into their parents, so compare the sums of masses.
    let masses: f64 = reference["bodies"].as_object().unwrap().values().filter_map(Value::as_f64).sum();
    if free {
        close("mass", &[model.total_mass()], &[masses]);
    }
}

#[test]
fn arm_equals_mujoco() {
    against_mujoco("arm");
}

#[test]
fn quadruped_equals_mujoco() {
    against_mujoco("quadruped");
}

/// Checks a gripper with followers from equality constraints, rotors of followers, and inertias that MuJoCo's compiler
/// corrects.
#[test]
fn gripper_equals_mujoco() {
    let options = MjcfOptions { mimic: true, strict: true, ..MjcfOptions::default() };
    let model = Model::from_mjcf(data("gripper.xml"), &options).unwrap();
    let reference: Value = serde_json::from_str(&text("gripper_mujoco.json")).unwrap();
    assert_eq!((model.nq(), model.nv(), model.bodies().len()), (2, 2, 6));
    close("armature", model.armature(), &floats(&reference["armature"]));
    let mut work = Data::new(&model);
    for state in reference["states"].as_array().unwrap() {
        let (q, v) = (floats(&state["q"]), floats(&state["v"]));
        close("M", crba(&model, &mut work, &q).as_slice(), &floats(&state["M"]));
        close("bias", rnea(&model, &mut work, &q, &v, &[0.0; 2], &[]), &floats(&state["bias"]));
        let placements = forward_kinematics(&model, &mut work, &q);
        for body in ["pad", "left_tip"] {
            let found = placements.frame(model.frame(body).unwrap()).translation.to_array();
            close(body, &found, &floats(&state[body]));
        }
    }
    let free = Model::from_mjcf(data("gripper.xml"), &MjcfOptions::default()).unwrap();
    assert_eq!((free.nv(), free.warnings().len()), (5, 3)); // a warning for each active equality
}
