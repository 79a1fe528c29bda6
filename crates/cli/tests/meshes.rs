//! Tests meshes on the page of `condyle plan`. The program must find the meshes and draw them at their poses. Missing
//! meshes must cause no error.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Returns the folder that contains the robots made of boxes. This folder is also the robots' package.
fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/boxes")
}

/// Plans a motion for a robot. Returns the output of the program and the scene of the page.
fn plan(test: &str, robot: &Path, arguments: &[&str]) -> (Output, Value) {
    let page = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("meshes_{test}.html"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_condyle"));
    command
        .args(["plan", "--target", "0.2,0.1,0.6", "--knots", "5", "--max-iterations", "2"])
        .arg("--robot")
        .arg(robot);
    let output = command.arg("--out").arg(&page).args(arguments).output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(page).unwrap();
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    let data: Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    (output, data["scene"].clone())
}

/// Returns, for each body, the types of its shapes.
fn kinds(scene: &Value) -> Vec<Vec<&str>> {
    let shapes = |body: &'_ Value| body["shapes"].as_array().unwrap().clone();
    let bodies = scene["bodies"].as_array().unwrap();
    let known = ["mesh", "segment", "sphere"];
    let kind = |shape: &Value| known.into_iter().find(|kind| shape["kind"] == *kind).unwrap();
    bodies.iter().map(|body| shapes(body).iter().map(kind).collect()).collect()
}

/// Returns a folder that contains the package `boxes`.
fn package(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("meshes_{test}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("boxes")).unwrap();
    for file in std::fs::read_dir(robots()).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.join("boxes").join(file.file_name())).unwrap();
    }
    folder
}

#[test]
fn meshes_of_a_urdf_are_drawn_and_the_missing_one_is_a_bone() {
    let folder = package("urdf");
    let (output, scene) = plan("urdf", &folder.join("boxes/boxes.urdf"), &[]);
    assert_eq!(kinds(&scene), [vec!["mesh"], vec!["mesh"], vec!["mesh"], vec!["sphere", "segment"]]);
    let notes = String::from_utf8(output.stderr).unwrap();
    assert!(
        notes.lines().any(|line| line.starts_with("note: 1 of 4 meshes are left out: there is no file")),
        "{notes}"
    );
    // The page must use the colour of the mesh file or, if the mesh file has no colour, the colour of the URDF.
    let shape = |body: usize| &scene["bodies"][body]["shapes"][0];
    assert_eq!([0, 1, 2].map(|b| shape(b)["color"].as_str().unwrap()), ["#666673", "#e6991a", "#1a8080"]);
    assert_eq!(
        (&shape(1)["position"], &shape(1)["size"]),
        (&serde_json::json!([0.0, 0.0, 0.2]), &serde_json::json!([0.08, 0.08, -0.4]))
    );
    // A box with side 1 from each of the three file formats has 8 points and 12 triangles, in base64.
    for part in scene["meshes"].as_array().unwrap() {
        let text = |key: &str| part[key].as_str().unwrap().len();
        assert_eq!((text("points"), text("triangles")), (64, 96));
        assert_eq!(
            (&part["low"], &part["side"]),
            (&serde_json::json!([-0.5, -0.5, -0.5]), &serde_json::json!([1.0, 1.0, 1.0]))
        );
    }
}

#[test]
fn packages_are_found_by_flag() {
    let (packages, robot) = (package("elsewhere"), package("alone").join("robot.urdf"));
    std::fs::rename(packages.with_file_name("meshes_alone").join("boxes"), robot.with_file_name("other")).unwrap();
    std::fs::copy(robots().join("boxes.urdf"), &robot).unwrap(); // the new folder has no such package
    std::fs::copy(robots().join("box.obj"), robot.with_file_name("box.obj")).unwrap();
    let (output, scene) = plan("lost", &robot, &[]);
    let notes = String::from_utf8(output.stderr).unwrap();
    assert!(notes.contains("3 of 4 meshes are left out: no `package://boxes/box.stl` is found"), "{notes}");
    assert_eq!(kinds(&scene)[1], ["mesh"]);
    let (_, scene) = plan("flag", &robot, &["--packages", packages.to_str().unwrap()]);
    assert_eq!(scene["meshes"].as_array().unwrap().len(), 3);
}

#[test]
fn meshes_of_an_mjcf() {
    let (output, scene) = plan("mjcf", &robots().join("boxes.xml"), &["--frame", "lower"]);
    assert!(!String::from_utf8(output.stderr).unwrap().contains("note:"));
    assert_eq!(kinds(&scene), [vec![], vec!["mesh"], vec!["mesh"]]);
    assert_eq!(scene["bodies"][1]["shapes"][0]["color"], "#3366cc");
    assert_eq!(scene["bodies"][2]["shapes"][0]["color"], "#e6991a"); // colour of the mesh file
}

#[test]
fn meshes_can_be_left_out() {
    let folder = package("never");
    let (output, scene) = plan("never", &folder.join("boxes/boxes.urdf"), &["--meshes", "never"]);
    assert!(!String::from_utf8(output.stderr).unwrap().contains("note:"));
    assert!(scene["meshes"].as_array().unwrap().is_empty());
    assert!(kinds(&scene).iter().flatten().all(|kind| *kind != "mesh"));
}

#[test]
fn wrong_meshes_do_no_harm() {
    for (number, wrong) in
        [&b""[..], b"solid", b"\xff\xfe", &[0xff; 90], b"<COLLADA/>", b"v 1 2"].into_iter().enumerate()
    {
        let folder = package(&format!("wrong{number}"));
        for file in ["box.stl", "box.obj", "box.dae"] {
            std::fs::write(folder.join("boxes").join(file), wrong).unwrap();
        }
        let (output, scene) = plan("wrong", &folder.join("boxes/boxes.urdf"), &[]);
        let notes = String::from_utf8(output.stderr).unwrap();
        assert!(notes.contains("note: 4 of 4 meshes are left out"), "{notes}");
        assert!(kinds(&scene).iter().skip(1).all(|kinds| !kinds.is_empty() && !kinds.contains(&"mesh")));
    }
}
