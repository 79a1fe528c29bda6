//! `condyle plan` as a user meets it: what it prints, what it writes, and how it ends.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of the test's own, empty.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn plan(folder: &Path, arguments: &[&str]) -> Output {
    let page = folder.join("plan.html");
    let mut command = Command::new(env!("CARGO_BIN_EXE_condyle"));
    command.arg("plan").arg("--out").arg(page).args(arguments);
    command.output().unwrap()
}

/// What it says when it fails; it must fail, and not by a panic.
fn complaint(test: &str, arguments: &[&str]) -> String {
    let output = plan(&folder(test), arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{:?}: {error}", output.status);
    error
}

#[test]
fn the_arm_that_comes_along_reaches_its_target() {
    let folder = folder("reach");
    let output = plan(&folder, &[]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    for words in ["iteration", "converged after", "from the target", "ABA derivatives", "Riccati sweep", "Rollout"] {
        assert!(said.contains(words), "`{words}` is missing in\n{said}");
    }
    assert!(said.contains("within their limits"), "{said}");
    let page = std::fs::read_to_string(folder.join("plan.html")).unwrap();
    assert!(!page.contains("{{"), "a part of the template was not filled in");
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    let data: serde_json::Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    assert_eq!(data["status"], "converged");
    assert!(data["miss"].as_f64().unwrap() < 0.01);
    assert_eq!(data["q"].as_array().unwrap().len(), 101);
    assert_eq!(data["scene"]["poses"][100].as_array().unwrap().len(), 8);
}

/// A robot of the user's: here, of the one that comes along, without any shapes.
#[test]
fn a_robot_from_a_file_is_drawn_as_bones() {
    let folder = folder("file");
    let urdf = include_str!("../../model/models/arm7.urdf");
    let robot = folder.join("robot.urdf");
    let without_shapes: Vec<&str> = urdf
        .split("<visual")
        .enumerate()
        .map(|(i, part)| if i == 0 { part } else { part.split_once("</visual>").unwrap().1 })
        .collect();
    std::fs::write(&robot, without_shapes.concat()).unwrap();
    let robot = robot.to_str().unwrap();
    let output = plan(&folder, &["--robot", robot, "--frame", "tool", "--target", "0.3,0.4,0.6", "--knots", "120"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(folder.join("plan.html")).unwrap();
    assert!(page.contains("\"segment\""));
}

#[test]
fn a_target_out_of_reach_is_missed_and_said_to_be() {
    let error = complaint("far", &["--target", "3,0,0", "--max-iterations", "3"]);
    assert!(error.contains("more than --tolerance 0.01 m: no posture within the joints' limits"), "{error}");
}

#[test]
fn what_is_wrong_is_named() {
    let folder = folder("wrong");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).unwrap();
        folder.join(name).to_str().unwrap().to_owned()
    };
    let urdf = include_str!("../../model/models/arm7.urdf");
    let malformed = write("malformed.urdf", &urdf.replace("</robot>", ""));
    let unknown = write("unknown.urdf", &urdf.replacen("<child link=\"link1\"/>", "<child link=\"lnik1\"/>", 1));
    for (arguments, words) in [
        (&["--robot", "nowhere.urdf", "--target", "0,0,1"][..], "nowhere.urdf: No such file"),
        (&["--robot", &malformed, "--target", "0,0,1"], "malformed.urdf:"),
        (&["--robot", &unknown, "--target", "0,0,1"], "joint `joint1`: no link is named `lnik1`; nearest is `link1`"),
        (&["--frame", "tol"], "unknown frame `tol`; nearest is `tool`"),
        (&["--target", "0,0"], "--target: expected 3 numbers, found 2"),
        (&["--target", "0,0,x"], "`x` is not a finite number"),
        (&["--q0", "0,1"], "--q0: expected 7 numbers, found 2"),
        (&["--dt", "-1"], "--dt: must be above 0, not -1"),
        (&["--tolerance", "0"], "--tolerance: must be above 0"),
    ] {
        let error = complaint("wrong_option", arguments);
        assert!(error.contains(words), "{arguments:?}: `{words}` is missing in\n{error}");
    }
}

#[test]
fn going_over_the_budget_is_no_error() {
    let output = plan(&folder("budget"), &["--budget-ms", "0.000001"]);
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("OVER the budget"));
}
