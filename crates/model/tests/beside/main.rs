//! Tests of actuators, springs, tendons, constraints and keyframes of MJCF. Expected numbers are from MuJoCo 4.0:
//! fields of its compiled model, or results of `mj_forward`, as the comments state.

#![allow(non_snake_case)]

use condyle_model::{
    Error, FrameKind, Inertia, MjcfOptions, Model, ModelBuilder, ModelConstraintKind, Se3, Spring, Sym3, Transmission,
    Vec3, WORLD, Warning, WarningKind, neutral,
};

mod actuators;
mod constraints;
mod refusals;
mod springs;

const INERTIAL: &str = "<inertial pos='0.1 0 0' mass='2' diaginertia='0.02 0.03 0.04'/>"; // M about y is 0.05 kg m²
const HINGE: &str = "<joint name='j' axis='0 1 0' range='-30 60'/>";

fn read(text: &str) -> Result<Model, Error> {
    Model::from_mjcf_str(text, &MjcfOptions::default())
}

/// Returns an MJCF with one body on a joint, and with sections before and after the tree.
fn one(before: &str, joint: &str, after: &str) -> String {
    format!(
        "<mujoco>{before}<worldbody><body name='b'>{joint}{INERTIAL}<site name='s'/></body></worldbody>{after}</mujoco>"
    )
}

fn model(before: &str, joint: &str, after: &str) -> Model {
    read(&one(before, joint, after)).unwrap()
}

fn driven(joint: &str, actuators: &str) -> Model {
    model("", joint, &format!("<actuator>{actuators}</actuator>"))
}

fn said(model: &Model) -> Vec<String> {
    model.warnings().iter().map(ToString::to_string).collect()
}

#[track_caller]
fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    for (x, y) in found.iter().zip(expected) {
        let near = x == y || (x - y).abs() <= 1e-12 * (1.0 + y.abs());
        assert!(near, "{found:?}\n{expected:?}");
    }
}

fn effort(model: &Model) -> [f64; 2] {
    [model.limits().effort_lower[0], model.limits().effort_upper[0]]
}
