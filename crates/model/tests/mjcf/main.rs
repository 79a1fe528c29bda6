//! Tests of the structure of MJCF: names, frames, copies, files, geoms and meshes. Expected numbers are from MuJoCo
//! 4.0: from the fields of its compiled model, or from `mj_forward`.

#![allow(non_snake_case)]

use condyle_model::{Body, Error, MjcfOptions, Model, Se3, WarningKind};
use std::path::PathBuf;

mod copies;
mod errors;
mod frames;
mod inertias;
mod joints;
mod names;

const INERTIAL: &str = "<inertial pos='0.1 0 0' mass='2' diaginertia='0.02 0.03 0.04'/>";

fn read(text: &str) -> Result<Model, Error> {
    Model::from_mjcf_str(text, &MjcfOptions::default())
}

/// Returns an MJCF with given texts before its tree, inside the tree, and after the tree.
fn robot(before: &str, inside: &str, after: &str) -> String {
    format!("<mujoco>{before}<worldbody>{inside}</worldbody>{after}</mujoco>")
}

#[track_caller]
fn model(before: &str, inside: &str, after: &str) -> Model {
    read(&robot(before, inside, after)).unwrap()
}

/// Returns the error of an invalid robot.
#[track_caller]
fn refused(before: &str, inside: &str, after: &str) -> String {
    read(&robot(before, inside, after)).expect_err(inside).to_string()
}

/// Returns the texts of a model's warnings of one kind.
fn said(model: &Model, kind: WarningKind) -> Vec<String> {
    model.warnings().iter().filter(|w| w.kind() == kind).map(ToString::to_string).collect()
}

/// Returns a body on a hinge that turns about y.
fn body(joint: &str, inside: &str) -> String {
    format!("<body name='b' pos='0 0 1'><joint name='j' axis='0 1 0' {joint}/>{INERTIAL}{inside}</body>")
}

#[track_caller]
fn near(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().filter(|x| x.is_finite()).fold(1.0, |a: f64, x| a.max(x.abs()));
    for (x, y) in found.iter().zip(expected) {
        assert!(x == y || (x - y).abs() <= tolerance * scale, "{what}: {found:?}\n{expected:?}");
    }
}

/// Returns the placement of a frame in its body: the position, then the rotation, row by row.
#[track_caller]
fn placement(model: &Model, name: &str) -> Vec<f64> {
    flat(&model.frames()[model.frame(name).unwrap()].placement)
}

fn flat(X: &Se3<f64>) -> Vec<f64> {
    let R = X.rotation.transpose();
    [X.translation, R.x, R.y, R.z].iter().flat_map(|v| v.to_array()).collect()
}

/// Returns the mass, the centre of mass, and the inertia about the centre of mass (xx, yy, zz, xy, xz, yz).
fn inertia(body: &Body) -> Vec<f64> {
    let (m, com, I) =
        (body.inertia.mass, body.inertia.mass_com.scale(1.0 / body.inertia.mass), body.inertia.rotational);
    let [x, y, z] = com.to_array();
    let about = [I.xx - m * (y * y + z * z), I.yy - m * (x * x + z * z), I.zz - m * (x * x + y * y)];
    let mixed = [I.xy + m * x * y, I.xz + m * x * z, I.yz + m * y * z];
    [&[m, x, y, z][..], &about, &mixed].concat()
}

/// Folder of files, which is removed when the value is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &[u8])]) -> Self {
        let folder = std::env::temp_dir().join(format!("condyle-mjcf-{name}-{}", std::process::id()));
        for (file, text) in files {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Self(folder)
    }

    fn read(&self, file: &str) -> Result<Model, Error> {
        Model::from_mjcf(self.0.join(file), &MjcfOptions::default())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
