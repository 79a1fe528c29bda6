//! Tests the answers, the page and the exit status of `condyle ik`.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Creates an empty folder for a test, and returns its path.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("ik_{test}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn condyle(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_condyle")).arg("ik").args(arguments).current_dir(folder).output().unwrap()
}

/// Runs the command, asserts the exit status, and returns standard output and standard error.
fn said(folder: &Path, arguments: &[&str], status: i32) -> [String; 2] {
    let output = condyle(folder, arguments);
    let texts = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(status), "{arguments:?}\n{texts:?}");
    texts
}

#[test]
fn a_posture_reaches_the_target_and_the_page_shows_it() {
    let folder = folder("reach");
    let target = ["arm7", "--frame", "tool", "--target", "0.45,-0.25,0.35"];
    let [text, _] = said(&folder, &target, 0);
    assert!(text.contains("reached: ") && text.contains("wrote out/ik.html"), "{text}");
    let page = std::fs::read_to_string(folder.join("out/ik.html")).unwrap();
    assert!(page.contains(r#""posture":{"held":[],"reached":true"#));
    let turned = ["arm7", "--frame", "tool", "--target", "0.45,-0.25,0.35,3.1,0,0.2", "--nearest", "--json"];
    let answer: Value = serde_json::from_str(&said(&folder, &turned, 0)[0]).unwrap();
    assert_eq!(answer["reached"], true);
    assert!(answer["position_error"].as_f64().unwrap() < 1e-4 && answer["rotation_error"].as_f64().unwrap() < 1e-3);
    assert_eq!(answer["q"].as_array().unwrap().len(), 7);
    let [x, y] = [0, 1].map(|k| answer["position"][k].as_f64().unwrap());
    assert!((x - 0.45).abs() < 1e-4 && (y + 0.25).abs() < 1e-4);
}

#[test]
fn a_target_out_of_reach_gets_the_nearest_posture() {
    let folder = folder("far");
    let [text, error] = said(&folder, &["arm7", "--target", "2,0,0.5", "--out", "far.html"], 1);
    assert!(text.contains("not reached: "), "{text}");
    assert!(error.contains("from the target"), "{error}");
    assert!(folder.join("far.html").is_file());
}

/// A robot of two links with a sphere each, whose tip cannot reach the sphere of its base.
const FOLDED: &str = r#"<robot name="folded"><link name="base"><collision><geometry><sphere radius="0.3"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<link name="one"/>
<joint name="b" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<link name="two"/>
<joint name="c" type="revolute"><parent link="two"/><child link="tip"/><origin xyz="0 0 0.8"/><axis xyz="1 0 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"#;

#[test]
fn shapes_are_kept_apart_if_asked() {
    let folder = folder("apart");
    std::fs::write(folder.join("folded.urdf"), FOLDED).unwrap();
    let target = ["folded.urdf", "--frame", "tip", "--target", "0.25,0,0"];
    said(&folder, &target, 0);
    let [_, error] = said(&folder, &[&target[..], &["--clearance", "0.01"]].concat(), 1);
    assert!(error.contains("held back by distance of"), "{error}");
    let [_, error] = said(&folder, &["arm7", "--target", "0.4,0,0.4", "--clearance", "nan"], 2);
    assert!(error.contains("minimum_distance") || error.contains("clearance"), "{error}");
}

#[test]
fn wrong_arguments_are_named() {
    let folder = folder("wrong");
    for (arguments, expected) in [
        (&["arm7", "--frame", "tol", "--target", "0,0,1"][..], "tol"),
        (&["arm7", "--target", "0,0"], "--target: expected 3 or 6 numbers, found 2"),
        (&["arm7", "--target", "0,0,x"], "is not a finite number"),
        (&["arm7", "--target", "0,0,nan"], "is not a finite number"),
        (&["arm8", "--target", "0,0,1"], "arm8"),
        (&["arm7", "--target", "0,0,1", "--q0", "1,2"], "--q0: expected 7 numbers, found 2"),
        (&["arm7", "--target", "0,0,1", "--tolerance", "-1"], "--tolerance: must be above 0"),
        (&["arm7", "--target", "0,0,1", "--out", "."], "is a folder"),
        (&["arm7"], "--target"),
    ] {
        let [_, error] = said(&folder, arguments, 2);
        assert!(error.contains(expected), "{error}\nexpected: {expected}");
        assert!(!folder.join("out").exists());
    }
}
