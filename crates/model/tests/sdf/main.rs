//! Tests of SDF: versions, nested models, included files, features that a model cannot represent, and errors.
//!
//! Expected poses and inertias are from Drake 1.51, which reads SDF with the format's own library.
#![allow(non_snake_case)]

use condyle_model::{Error, FrameKind, Joint, Model, ModelConstraintKind, SdfOptions, Se3, Vec3, Warning, WarningKind};
use std::fs;
use std::path::PathBuf;

mod errors;
mod files;
mod tree;
mod values;
mod versions;

/// Relative tolerance for sums and products of a few numbers.
const ROUNDING: f64 = 1e-12;

const INERTIAL: &str = "<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
  <inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz></inertia></inertial>";

fn read(text: &str) -> Result<Model, Error> {
    Model::from_sdf_str(text, &SdfOptions::default())
}

/// Reads an SDF of a given version, given the content of its `<model>`.
fn model(version: &str, inside: &str) -> Model {
    let text = format!("<sdf version='{version}'><model name='m'>{inside}</model></sdf>");
    read(&text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn link(name: &str) -> String {
    format!("<link name='{name}'>{INERTIAL}</link>")
}

/// Returns a `<link>` with a pose.
fn link_at(name: &str, pose: &str) -> String {
    format!("<link name='{name}'><pose>{pose}</pose>{INERTIAL}</link>")
}

fn joint(name: &str, kind: &str, ends: [&str; 2], inside: &str) -> String {
    let [parent, child] = ends;
    format!("<joint name='{name}' type='{kind}'><parent>{parent}</parent><child>{child}</child>{inside}</joint>")
}

fn said(model: &Model) -> Vec<String> {
    model.warnings().iter().map(ToString::to_string).collect()
}

fn frame(model: &Model, name: &str, kind: FrameKind) -> Se3<f64> {
    let found = model.frames().iter().find(|f| f.name == name && f.kind == kind);
    found.unwrap_or_else(|| panic!("no frame {name}")).placement
}

#[track_caller]
fn close(ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len());
    let near = ours.iter().zip(theirs).all(|(x, y)| (x - y).abs() <= ROUNDING * (1.0 + y.abs()));
    assert!(near, "{ours:?}\n{theirs:?}");
}

/// Creates an empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("condyle_sdf_{name}_{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn write(folder: &std::path::Path, name: &str, text: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}
