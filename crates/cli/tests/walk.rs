//! Tests `condyle walk` as a user sees it: output, page and exit status.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Creates an empty folder for a test, and returns its path.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("walk_{test}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn walk(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_condyle"));
    command.arg("walk").arg("--out").arg(folder.join("walk.html")).args(arguments);
    command.output().unwrap()
}

/// Runs the program with `--json`, and returns its summary and the data of its page.
fn summary(test: &str, arguments: &[&str], status: i32) -> [Value; 2] {
    let folder = folder(test);
    let output = walk(&folder, &[arguments, &["--json"]].concat());
    let said = String::from_utf8(output.stdout).unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{said}{error}");
    let page = std::fs::read_to_string(folder.join("walk.html")).unwrap();
    assert!(!page.contains("{{"), "a part of the template was not filled in");
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    let data = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    [serde_json::from_str(&said).unwrap(), data]
}

/// Runs the program, asserts that it refuses its arguments, and returns the error message.
fn complaint(test: &str, arguments: &[&str]) -> String {
    let output = walk(&folder(test), arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Checks that the quadruped trots at the commanded speed with defaults, and that the page shows what happened.
#[test]
fn the_quadruped_trots() {
    let [summary, page] =
        summary("quadruped", &["quadruped", "--command", "0.4,0,0", "--seconds", "3", "--rate", "50"], 0);
    let speed = numbers(&summary["mean_velocity"]);
    assert!((speed[0] - 0.4).abs() < 0.02 && speed[1].abs() < 0.02, "{speed:?}");
    let feet: Vec<&str> =
        summary["feet"].as_array().unwrap().iter().map(|foot| foot["frame"].as_str().unwrap()).collect();
    assert_eq!(feet, ["LF_foot_centre", "LH_foot_centre", "RF_foot_centre", "RH_foot_centre"]);
    assert!(summary["gait"].as_str().unwrap().starts_with("trot"));
    assert!(summary["posture_source"].as_str().unwrap().starts_with("legs bent"));
    assert!(summary["largest_tilt_rad"].as_f64().unwrap() < 0.15);
    assert_eq!(summary["ticks"]["count"], 149);
    // 3 s in intervals of 20 ms; the forces of the ground carry the weight
    assert_eq!(page["times"].as_array().unwrap().len(), 151);
    assert_eq!(page["contacts"]["forces"].as_array().unwrap().len(), 150);
    let weight = page["contacts"]["weight"].as_f64().unwrap();
    let lifted = |forces: &Value| -> f64 {
        forces.as_array().unwrap().iter().filter_map(|force| force.get(2)).map(|z| z.as_f64().unwrap()).sum()
    };
    let forces = &page["contacts"]["forces"].as_array().unwrap()[50..];
    let mean = forces.iter().map(lifted).sum::<f64>() / forces.len() as f64;
    assert!((mean / weight - 1.0).abs() < 0.05, "{mean} of {weight} N");
    assert_eq!(page["walk"]["ticks"]["ms"].as_array().unwrap().len(), 149);
    assert_eq!(page["walk"]["fall"], Value::Null);
}

/// Checks that the humanoid gets two soles from its collision shapes or frames, and steps.
#[test]
fn the_humanoid_steps() {
    let [summary, _] =
        summary("humanoid", &["humanoid", "--command", "0.1,0,0", "--seconds", "1.5", "--rate", "50"], 0);
    let feet = summary["feet"].as_array().unwrap();
    assert_eq!(feet.len(), 2);
    assert!(feet.iter().all(|foot| numbers(&foot["sole"]).iter().all(|side| *side > 0.05)), "{feet:?}");
    assert!(summary["gait"].as_str().unwrap().starts_with("step"));
}

/// Writes an MJCF of a robot with spheres as feet, which have no body of their own, and a keyframe. `hips` are the
/// names and places of the legs, and `neck` is the text of further bodies with `joints` joints.
fn mjcf(folder: &Path, hips: &[(&str, f64, f64)], neck: &str, joints: usize) -> String {
    let leg = |&(name, x, y): &(&str, f64, f64)| {
        format!(
            r#"<body name="{name}_hip" pos="{x} {y} 0"><joint name="{name}_roll" axis="1 0 0" range="-1 1"/>
            <inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>
            <body name="{name}_thigh"><joint name="{name}_pitch" axis="0 1 0" range="-2 2"/>
            <inertial pos="0 0 -0.12" mass="0.8" diaginertia="5e-3 5e-3 1e-3"/>
            <body name="{name}_shank" pos="0 0 -0.25"><joint name="{name}_knee" axis="0 1 0" range="-2.5 -0.1"/>
            <inertial pos="0 0 -0.12" mass="0.3" diaginertia="2e-3 2e-3 5e-4"/>
            <geom class="foot" pos="0 0 -0.25"/></body></body></body>"#
        )
    };
    let legs: String = hips.iter().map(leg).collect();
    let stand = "0 0.7 -1.4 ".repeat(hips.len()) + &"0 ".repeat(joints);
    let text = format!(
        r#"<mujoco model="q"><compiler angle="radian"/>
        <default><joint actuatorfrcrange="-60 60"/>
        <default class="foot"><geom type="sphere" size="0.02"/></default></default>
        <worldbody><geom type="plane" size="1 1 1"/><body name="trunk" pos="0 0 0.5"><freejoint/>
        <inertial pos="0 0 0" mass="10" diaginertia="0.1 0.4 0.4"/>{legs}{neck}</body></worldbody>
        <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0 {stand}"/></keyframe></mujoco>"#
    );
    let file = folder.join("robot.xml");
    std::fs::write(&file, text).unwrap();
    file.to_str().unwrap().to_owned()
}

const FOUR: [(&str, f64, f64); 4] = [("LF", 0.3, 0.15), ("RF", 0.3, -0.15), ("LH", -0.3, 0.15), ("RH", -0.3, -0.15)];

/// Checks that joints of nearly no inertia get an armature: the link between two joints about one axis has no mass.
#[test]
fn a_link_without_mass_is_no_obstacle() {
    let neck = r#"<body name="neck" pos="0.3 0 0.1"><joint name="neck_a" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-12 1e-12 1e-12"/>
        <body name="head"><joint name="neck_b" axis="0 0 1"/>
        <inertial pos="0.05 0 0.05" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/></body></body>"#;
    let robot = mjcf(&folder("neck_file"), &FOUR, neck, 2);
    let arguments = [&*robot, "--command", "0.3,0,0", "--seconds", "2", "--rate", "50"];
    let [summary, _] = summary("neck", &arguments, 0);
    assert_eq!(summary["armature_added"], serde_json::json!(["neck_a", "neck_b"]));
}

/// Checks that a robot with two balls as feet walks, though it cannot stand on them.
#[test]
fn two_balls_are_enough_to_walk() {
    let robot = mjcf(&folder("balls_file"), &[("L", 0.0, 0.1), ("R", 0.0, -0.1)], "", 0);
    let arguments = [&*robot, "--command", "0.2,0,0", "--seconds", "6", "--rate", "100"];
    let [summary, _] = summary("balls", &arguments, 0);
    assert_eq!(summary["gait"], "step, 0.2 s in the air, 0.02 s between swings");
    let speed = numbers(&summary["mean_velocity"])[0];
    assert!((speed - 0.2).abs() < 0.05, "{speed} m/s");
}

/// Checks that feet of an MJCF are found from its shapes, and its stand from a keyframe.
#[test]
fn an_mjcf_walks_from_its_keyframe() {
    let robot = mjcf(&folder("mjcf_file"), &FOUR, "", 0);
    let arguments = [&*robot, "--command", "0,0,0.4", "--seconds", "2", "--rate", "50"];
    let [summary, _] = summary("mjcf", &arguments, 0);
    assert_eq!(summary["posture_source"], "keyframe `home`");
    assert_eq!(summary["feet"][0]["radius"], 0.02);
    let turning = numbers(&summary["mean_velocity"])[2];
    assert!((turning - 0.4).abs() < 0.05, "{turning} rad/s");
}

/// Checks that a hard push makes the robot fall, with exit status 1, and that the page contains the walk until then.
#[test]
fn a_fall_is_reported() {
    let arguments = ["quadruped", "--seconds", "3", "--rate", "50", "--push", "400,90,0.5"];
    let [summary, page] = summary("fall", &arguments, 1);
    let time = summary["fall"]["time_s"].as_f64().unwrap();
    assert!(time > 0.5 && time < 2.0, "{time}");
    assert!((page["walk"]["fall"]["time"].as_f64().unwrap() - time).abs() < 1e-6); // rounded for the page
    assert!((summary["duration_s"].as_f64().unwrap() - time).abs() < 2e-3);
}

/// Checks that feet, gait and posture can be given, and that the robot stands if it is told so.
#[test]
fn feet_and_posture_can_be_given() {
    let posture = "LF_HFE=0.8,LF_KFE=-1.6,LH_HFE=-0.8,LH_KFE=1.6,RF_HFE=0.8,RF_KFE=-1.6,RH_HFE=-0.8,RH_KFE=1.6";
    let feet = "LF_foot,RF_foot,LH_foot,RH_foot";
    let arguments =
        ["quadruped", "--feet", feet, "--radius", "0.03", "--posture", posture, "--gait", "stand", "--seconds", "0.4"];
    let [summary, page] = summary("given", &[&arguments[..], &["--command", "0,0,0"]].concat(), 0);
    assert_eq!(summary["posture"], posture.replace("0.8", "0.800").replace("1.6", "1.600"));
    assert_eq!(summary["feet"][1]["radius"], 0.03);
    let touches = page["contacts"]["touches"].as_array().unwrap();
    assert!(touches.iter().all(|feet| feet.as_array().unwrap().iter().all(|touches| *touches == true)));
}

#[test]
fn wrong_arguments_are_refused() {
    for (test, arguments, words) in [
        ("fixed", &["quadruped", "--root", "fixed"][..], "needs a free-flyer at its root: --root free"),
        (
            "arm",
            &["arm7"],
            "--feet: missing, because only one limb ends at the height of the ground; ends of limbs, relative to the trunk: `",
        ),
        ("foot", &["quadruped", "--feet", "LF_fot"], "nearest is `LF_foot`"),
        ("trunk", &["quadruped", "--feet", "trunk,LF_foot"], "`trunk` belongs to the trunk"),
        ("gait", &["humanoid", "--gait", "trot"], "Trot needs four feet"),
        ("command", &["quadruped", "--command", "0.5,nan,0"], "`nan` is not a finite number"),
        ("three", &["quadruped", "--command", "0.5"], "expected 3 numbers, found 1"),
        ("posture", &["quadruped", "--posture", "home"], "no keyframe `home`, because the robot has none"),
        ("joint", &["quadruped", "--posture", "LF_HFF=1"], "nearest is `LF_HFE`"),
        ("rate", &["quadruped", "--rate", "2000"], "--rate: must be at most 1000 Hz"),
        ("friction", &["quadruped", "--friction", "0"], "--friction: must be above 0"),
        ("ground", &["quadruped", "--ground-friction=-1"], "friction is -1"),
        ("sole", &["quadruped", "--sole", "0.1"], "expected 2 numbers, found 1"),
    ] {
        let error = complaint(test, arguments);
        assert!(error.contains(words), "{test}: {error}");
    }
}
