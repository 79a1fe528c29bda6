//! Tests `condyle plan` as a user sees it: output, files and exit status.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Creates an empty folder for a test, and returns its path.
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

/// Runs the program, asserts that it fails without a panic, and returns the error message.
fn complaint(test: &str, arguments: &[&str]) -> String {
    let output = plan(&folder(test), arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{:?}: {error}", output.status);
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

#[test]
fn the_built_in_arm_reaches_its_target() {
    let folder = folder("reach");
    let output = plan(&folder, &[]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    for words in ["iteration", "converged after", "from the target", "ABA derivatives", "Riccati sweep", "Rollout"] {
        assert!(said.contains(words), "`{words}` is missing in\n{said}");
    }
    let limits = "arm7 limits 7 of 7 positions, 7 of 7 velocities, 7 of 7 efforts: all 21 hold at all knots";
    assert!(said.contains(limits), "{said}");
    let page = std::fs::read_to_string(folder.join("plan.html")).unwrap();
    assert!(!page.contains("{{"), "a part of the template was not filled in");
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    let data: serde_json::Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    assert_eq!(data["status"], "converged");
    assert!(data["miss"].as_f64().unwrap() < 0.01);
    assert_eq!(data["q"].as_array().unwrap().len(), 101);
    assert_eq!(data["scene"]["poses"][100].as_array().unwrap().len(), 8);
}

/// Checks that a robot from a file without shapes is drawn as bones. The file contains the built-in arm.
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

/// Writes a URDF of a planar chain with two links and the given joints.
fn chain(folder: &Path, joints: [&str; 2]) -> String {
    let mut urdf = "<robot name=\"chain\"><link name=\"base\"/>".to_owned();
    for (k, joint) in joints.iter().enumerate() {
        let parent = if k == 0 { "base".to_owned() } else { format!("link{}", k - 1) };
        let place = if k == 0 { "" } else { "<origin xyz=\"0 0 0.5\"/>" };
        urdf += &format!(
            "<link name=\"link{k}\"><inertial><origin xyz=\"0 0 0.25\"/><mass value=\"1\"/><inertia ixx=\"0.02\" ixy=\"0\" \
             ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.01\"/></inertial></link>\
             <joint name=\"joint{k}\" {joint}{place}<parent link=\"{parent}\"/><child link=\"link{k}\"/>\
             <axis xyz=\"0 1 0\"/></joint>"
        );
    }
    urdf += "<link name=\"tip\"/><joint name=\"fixed\" type=\"fixed\"><origin xyz=\"0 0 0.5\"/><parent link=\"link1\"/>\
             <child link=\"tip\"/></joint></robot>";
    let file = folder.join("chain.urdf");
    std::fs::write(&file, urdf).unwrap();
    file.to_str().unwrap().to_owned()
}

/// Checks that the report, the page and `inspect` state the number and the source of the limits. For a robot without
/// limits, these texts must not claim that limits hold.
#[test]
fn limits_are_counted() {
    let all = "type=\"revolute\"><limit lower=\"-2\" upper=\"2\" velocity=\"9\" effort=\"90\"/>";
    let (none, speed) = ("type=\"continuous\">", "type=\"continuous\"><limit velocity=\"9\" effort=\"0\"/>");
    for (test, joints, [positions, velocities, efforts]) in [
        ("none", [none, none], [0, 0, 0]),
        ("one", [none, speed], [0, 1, 0]),
        ("some", [all, speed], [1, 2, 1]),
        ("all", [all, all], [2, 2, 2]),
    ] {
        let folder = folder(&format!("limits_{test}"));
        let robot = chain(&folder, joints);
        let arguments = ["--robot", &robot, "--frame", "tip", "--target", "0.5,0,0.8", "--q0"];
        let q0 = joints.map(|joint| if joint.contains("revolute") { "0.1" } else { "1,0" }).join(",");
        let arguments = [&arguments[..], &[&q0]].concat();
        let said = |arguments: &[&str]| {
            let output = plan(&folder, arguments);
            let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
            assert!(output.status.success(), "{test}: {said}{error}");
            said
        };
        let text = said(&arguments);
        let counts =
            format!("{robot} limits {positions} of 2 positions, {velocities} of 2 velocities, {efforts} of 2 efforts");
        let total = positions + velocities + efforts;
        let sentence = match total {
            0 => format!("{robot} limits no position, velocity or effort: nothing to check"),
            1 => format!("{counts}: the limit holds at all knots"),
            _ => format!("{counts}: all {total} hold at all knots"),
        };
        assert!(text.contains(&sentence), "{test}: `{sentence}` is missing in\n{text}");
        assert!(total > 0 || !text.contains("hold"), "{text}");
        let expected = serde_json::json!({"source": robot, "positions": positions, "velocities": velocities,
            "efforts": efforts, "of": 2});
        let summary: Value = serde_json::from_str(&said(&[&arguments[..], &["--json"]].concat())).unwrap();
        assert_eq!(summary["limits"], expected);
        let page = std::fs::read_to_string(folder.join("plan.html")).unwrap();
        let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
        let data: Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
        assert_eq!(data["limits"], expected);
        let inspect = Command::new(env!("CARGO_BIN_EXE_condyle")).args(["inspect", &robot]).output().unwrap();
        let inspect = String::from_utf8(inspect.stdout).unwrap();
        assert!(inspect.contains(sentence.split(": ").next().unwrap()), "{inspect}");
    }
}

/// Checks the report on a joint that is too weak to stay within its position limits. The report must state the number
/// of exceeded limits and the number of all limits.
#[test]
fn limits_that_are_exceeded_are_counted() {
    let weak = "type=\"revolute\"><limit lower=\"1.19\" upper=\"1.21\" velocity=\"9\" effort=\"0.5\"/>";
    let folder = folder("limits_exceeded");
    let robot = chain(&folder, [weak, "type=\"continuous\">"]);
    let flags = ["--frame", "tip", "--target", "0.9,0,0.2", "--q0", "1.2,1,0", "--max-iterations", "20"];
    let output = plan(&folder, &[&["--robot", &robot][..], &flags].concat());
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let counts = format!("{robot} limits 1 of 2 positions, 1 of 2 velocities, 1 of 2 efforts");
    assert!(said.contains(&format!("{counts}; ")) && said.contains("of these 3"), "{said}");
    assert!(said.contains("of these 3 are exceeded:") || said.contains("of these 3 is exceeded:"), "{said}");
    assert!(!said.contains("hold at all knots"), "{said}");
}

/// Returns the data in the page of a plan.
fn page_data(page: &Path) -> Value {
    let page = std::fs::read_to_string(page).unwrap();
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    serde_json::from_str(data.split("</script>").next().unwrap()).unwrap()
}

/// Checks the reached bounds of a fast reach: where and when the values are at the bounds, that multipliers have the
/// signs of their bounds, and that they are zero elsewhere.
#[test]
fn reached_bounds_are_listed_with_their_multipliers() {
    let folder = folder("reached");
    let record = folder.join("motion.json");
    let arguments = ["--target", "0.5,0.3,0.4", "--knots", "70", "--record", record.to_str().unwrap()];
    let output = plan(&folder, &[&arguments[..], &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&summary["status"], &summary["worst"]), (&"converged".into(), &Value::Null));
    let data = page_data(&folder.join("plan.html"));
    let motion: Value = serde_json::from_str(&std::fs::read_to_string(&record).unwrap()).unwrap();
    let met = summary["limits_met"].as_array().unwrap();
    assert!(!met.is_empty());
    for met in met {
        let quantity = match met["what"].as_str().unwrap() {
            "position" => "q",
            "velocity" => "v",
            _ => "tau",
        };
        let number = |value: &Value| value.as_f64().unwrap();
        let joint = data["joints"].as_array().unwrap().iter().position(|j| j["name"] == met["joint"]).unwrap();
        let (limit, multiplier) = (number(&met["limit"]), number(&met["multiplier"]));
        let is_at = |t: usize| (number(&motion[quantity][t][joint]) - limit).abs() < 1e-2 * limit.abs();
        let intervals: Vec<[usize; 2]> = serde_json::from_value(met["knots"].clone()).unwrap();
        assert!(intervals.iter().flat_map(|[first, last]| *first..=*last).all(is_at), "{met}");
        let upper = met["bound"] == "upper";
        assert!(upper == (limit > 0.0) && upper == (multiplier > 0.0), "{met}");
        let curve: Vec<f64> =
            data["multipliers"][quantity].as_array().unwrap().iter().map(|row| number(&row[joint])).collect();
        assert_eq!(curve.len(), if quantity == "tau" { 70 } else { 71 });
        let at_knot = met["at_knot"].as_u64().unwrap() as usize;
        assert!((curve[at_knot] - multiplier).abs() <= 1e-5 * multiplier.abs(), "{met}");
        for (t, y) in curve.iter().enumerate() {
            let inside = intervals.iter().any(|[first, last]| (*first..=*last).contains(&t));
            assert!(inside || y.abs() < 1e-2 * multiplier.abs(), "{met} {t} {y}");
        }
    }
    let said = String::from_utf8(plan(&folder, &arguments).stdout).unwrap();
    assert!(said.contains("reached:") && said.contains("at its upper limit") && said.contains("multiplier"), "{said}");
}

/// Checks a reach with too few iterations: the report names the row that is violated most, and does not claim that the
/// motion is one of the robot.
#[test]
fn an_unsolved_plan_names_its_largest_violation() {
    let folder = folder("unsolved");
    let arguments = ["--target", "0.5,0.3,0.4", "--knots", "40", "--max-iterations", "25"];
    let output = plan(&folder, &arguments);
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(1), "{said}{error}");
    assert!(said.contains("iteration limit after") && said.contains("\nat knot "), "{said}");
    assert!(!said.contains("hold at all knots\n"), "{said}");
    let data = page_data(&folder.join("plan.html"));
    assert_eq!(data["status"], "iteration limit");
    assert!(data["worst"]["text"].as_str().unwrap().starts_with("at knot "), "{}", data["worst"]);
    let summary = plan(&folder, &[&arguments[..], &["--json"]].concat());
    let summary: Value = serde_json::from_slice(&summary.stdout).unwrap();
    let worst = &summary["worst"];
    let time = 0.01 * worst["knot"].as_u64().unwrap() as f64;
    assert!(
        (worst["time"].as_f64().unwrap() - time).abs() < 1e-9 && worst["amount"].as_f64().unwrap() > 5e-6,
        "{worst}"
    );
    assert!(["position", "velocity", "torque", "gap"].contains(&worst["what"].as_str().unwrap()), "{worst}");
    assert!(worst["joint"].as_str().unwrap().starts_with("joint"), "{worst}");
}

#[test]
fn a_target_out_of_reach_is_reported_as_missed() {
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
    write("trot.toml", &example("trot"));
    let misspelt = folder.join("trott.toml").to_str().unwrap().to_owned();
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
        (&["--q0", "9,0,0,0,0,0,0"], "--q0: joint `joint1` is at 9, outside of its limits [-2.9, 2.9]"),
        (&["--robot", "amr7", "--target", "0,0,1"], "no robot `amr7`; nearest is `arm7`"),
        (&["--record", "x.cvs"], "--record: `x.cvs` does not end in .csv, .npz or .json; nearest is `csv`"),
        (&["--example", "trto"], "--example"),
        (&["nowhere.toml"], "nowhere.toml: No such file"),
        (&[&misspelt], "trott.toml: No such file; nearest is `"),
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

/// Solves a task that is given as text. Returns the summary, the path of the record, the exit status and the error
/// text.
fn solve_task(test: &str, text: &str, record: &str) -> (Value, PathBuf, Option<i32>, String) {
    let folder = folder(test);
    let (task, record) = (folder.join("task.toml"), folder.join(record));
    std::fs::write(&task, text).unwrap();
    let output = plan(&folder, &[task.to_str().unwrap(), "--record", record.to_str().unwrap(), "--json"]);
    let summary = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (summary, record, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn example(name: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_condyle")).args(["plan", "--example", name]).output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap()
}

/// Checks that each example task produces the motion of its description, and that all values stay within the robot's
/// limits.
#[test]
fn the_examples_hold_their_limits() {
    for (name, robot, ahead) in [
        ("reach", "arm7", None),
        ("trot", "quadruped", Some(0.16)),
        ("jump", "quadruped", Some(0.2)),
        ("stand-up", "quadruped", Some(0.0)),
        ("walk", "humanoid", Some(0.3)),
    ] {
        let (summary, record, status, error) = solve_task(&format!("example_{name}"), &example(name), "motion.json");
        let done = summary["status"] == "converged" || summary["settled"].is_number();
        assert!(status == Some(0) && done, "{name}: {status:?}, {}: {error}", summary["status"]);
        assert_eq!(summary["violations"], serde_json::json!([]));
        let motion: Value = serde_json::from_str(&std::fs::read_to_string(&record).unwrap()).unwrap();
        let rows = |key: &str| -> Vec<Vec<f64>> { serde_json::from_value(motion[key].clone()).unwrap() };
        let (q, v, tau) = (rows("q"), rows("v"), rows("tau"));
        assert_eq!((q.len(), v.len(), tau.len()), (tau.len() + 1, tau.len() + 1, tau.len()));
        let model = match robot {
            "arm7" => condyle::robots::arm7(),
            "quadruped" => condyle::robots::quadruped(),
            _ => condyle::robots::humanoid(),
        };
        let (limits, room) = (model.limits(), 1e-4);
        let within = |x: &[f64], lower: &dyn Fn(usize) -> f64, upper: &dyn Fn(usize) -> f64| {
            x.iter().enumerate().all(|(k, x)| lower(k) - room <= *x && *x <= upper(k) + room)
        };
        assert!(q.iter().all(|q| within(q, &|k| limits.lower[k], &|k| limits.upper[k])), "{name}: positions");
        assert!(v.iter().all(|v| within(v, &|k| -limits.velocity[k], &|k| limits.velocity[k])), "{name}: speeds");
        assert!(
            tau.iter().all(|t| within(t, &|k| limits.effort_lower[k], &|k| limits.effort_upper[k])),
            "{name}: efforts"
        );
        if let Some(ahead) = ahead {
            let went = q[q.len() - 1][0] - q[0][0];
            assert!((went - ahead).abs() < 0.03, "{name}: {went}");
        }
        if name == "stand-up" {
            assert!(q[q.len() - 1][2] - q[0][2] > 0.1, "it rises");
        }
        if name == "jump" {
            let airborne = motion["touches"]
                .as_array()
                .unwrap()
                .iter()
                .filter(|t| t.as_array().unwrap().iter().all(|t| t == false));
            assert_eq!(airborne.count(), 28);
            let highest = q.iter().map(|q| q[2]).fold(0.0, f64::max);
            assert!(highest > q[0][2] + 0.05, "it leaves the ground");
        }
    }
}

/// Checks the contact forces on the page. The gait begins and ends at rest, so the mean of the total force must equal
/// the weight.
#[test]
fn contact_forces_carry_the_robot() {
    let (_, record, ..) = solve_task("forces", &example("trot"), "motion.json");
    let page = std::fs::read_to_string(record.with_file_name("plan.html")).unwrap();
    let data = page.split("application/json").nth(1).and_then(|rest| rest.split_once('>')).unwrap().1;
    let data: Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    let forces = data["contacts"]["forces"].as_array().unwrap();
    let weight = data["contacts"]["weight"].as_f64().unwrap();
    let of = |f: &Value| f.as_array().map_or(0.0, |f| f[2].as_f64().unwrap());
    let sums: Vec<f64> = forces.iter().map(|feet| feet.as_array().unwrap().iter().map(of).sum()).collect();
    let mean = sums.iter().sum::<f64>() / sums.len() as f64;
    assert!((mean - weight).abs() < 0.15 * weight, "{mean} N of {weight} N; impacts carry the rest");
    let last = sums[sums.len() - 1];
    assert!((last - weight).abs() < 0.05 * weight, "{last} N at rest");
    let (touches, times) = (data["contacts"]["touches"].as_array().unwrap(), data["times"].as_array().unwrap());
    assert_eq!((touches.len(), forces.len()), (times.len() - 1, times.len() - 1));
    for (touches, forces) in touches.iter().zip(forces) {
        for (touches, force) in touches.as_array().unwrap().iter().zip(forces.as_array().unwrap()) {
            assert_eq!(touches.as_bool().unwrap(), force.is_array());
        }
    }
}

#[test]
fn the_record_is_named_after_the_joints() {
    let (_, record, ..) = solve_task("csv", &example("trot"), "motion.csv");
    let text = std::fs::read_to_string(record).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    for name in ["time", "q:root_joint.qw", "q:LF_HAA", "v:root_joint.wz", "tau:RH_KFE", "touches:LF_foot"] {
        assert!(head.contains(&name), "{name}");
    }
    let rows: Vec<_> = lines.collect();
    assert!(rows.len() == 85 && rows.iter().all(|row| row.len() == head.len()));
    assert!(rows[..84].iter().flatten().all(|x| x.parse::<f64>().unwrap().is_finite()));
    let (_, record, ..) = solve_task("npz", &example("reach"), "motion.npz");
    let bytes = std::fs::read(record).unwrap();
    assert!(
        bytes.starts_with(b"PK")
            && bytes.windows(6).any(|w| w == b"\x93NUMPY")
            && bytes.windows(5).any(|w| w == b"q.npy")
    );
}

/// Checks that a joint that starts at its limit stays within the limit, although exceeding the limit would reduce the
/// cost.
#[test]
fn a_joint_that_starts_on_its_limit_stays_within() {
    let urdf = include_str!("../../model/models/arm7.urdf").replace(
        "</robot>",
        "<link name=\"finger\"><inertial><origin xyz=\"0 0 0.02\"/><mass value=\"0.1\"/><inertia ixx=\"1e-4\" ixy=\"0\" \
         ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial></link><joint name=\"grip\" type=\"prismatic\">\
         <parent link=\"link7\"/><child link=\"finger\"/><axis xyz=\"0 1 0\"/>\
         <limit lower=\"0\" upper=\"0.04\" velocity=\"0.2\" effort=\"20\"/></joint></robot>",
    );
    let folder = folder("finger");
    let robot = folder.join("robot.urdf");
    std::fs::write(&robot, urdf).unwrap();
    let record = folder.join("motion.json");
    let flags =
        ["--robot", robot.to_str().unwrap(), "--frame", "tool", "--target", "0.45,-0.25,0.35", "--json", "--record"];
    let output = plan(&folder, &[&flags[..], &[record.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let motion: Value = serde_json::from_str(&std::fs::read_to_string(record).unwrap()).unwrap();
    let column = motion["q_names"].as_array().unwrap().iter().position(|name| name == "grip").unwrap();
    for q in motion["q"].as_array().unwrap() {
        let x = q[column].as_f64().unwrap();
        assert!((-1e-5..0.04 + 1e-5).contains(&x), "{x}");
    }
}

#[test]
fn errors_in_a_task_have_a_line_number() {
    let trot = example("trot");
    let line = |text: &str, part: &str| text.lines().position(|line| line.contains(part)).unwrap() + 1;
    for (from, to, words) in [
        ("friction = 0.7", "frction = 0.7", "unknown field `frction`"),
        ("friction = 0.7", "frction = 0.7", "nearest is `friction`"),
        ("dt = 0.01", "dt = -0.01", "dt must be above 0, not -0.01"),
        ("dt = 0.01", "dt = \"fast\"", "invalid type"),
        ("dt = 0.01", "dt = = 1", "task.toml:"),
        ("root = \"free\"", "root = \"fre\"", "no root joint is called `fre`; nearest is `free`"),
        ("robot = \"quadruped\"", "robot = \"arm7\"", "unknown frame `LF_foot`"),
        ("LF_KFE = -1.4", "LF_KFE = -9", "joint `LF_KFE` is at -9, outside of its limits [-2.7, 2.7]"),
        ("LF_KFE = -1.4", "LF_KEF = -1.4", "unknown joint `LF_KEF`; nearest is `LF_KFE`"),
        (
            "kind = \"stand\"            # on all feet",
            "kind = \"stan\"",
            "no phase is called `stan`; nearest is `stand`",
        ),
        ("feet = [\"RF_foot\", \"LH_foot\"]", "feet = [\"RF_fot\"]", "[feet] has no `RF_fot`; nearest is `RF_foot`"),
        ("knots = 5\n", "knots = 0\n", "knots must be from 1 to 100000, not 0"),
    ] {
        let text = trot.replacen(from, to, 1);
        assert_ne!(text, trot, "{from}");
        let (_, record, status, error) = solve_task("wrong_task", &text, "motion.csv");
        assert_eq!(status, Some(2), "{to}: {error}");
        assert!(error.contains(words) && error.lines().count() == 1, "{to}: `{words}` is missing in\n{error}");
        let at = if to.contains("arm7") {
            "task.toml:".to_owned()
        } else {
            format!("task.toml:{}: ", line(&text, to.trim()))
        };
        assert!(error.contains(&at), "{to}: `{at}` is missing in\n{error}");
        assert!(!record.exists() && !record.with_file_name("plan.html").exists(), "{to}: something was written");
    }
}

/// Checks that Ctrl-C stops the solver, and that the program writes the best result so far.
#[test]
#[cfg(unix)]
fn interrupted_it_leaves_the_best_iterate() {
    use std::io::{BufRead, BufReader};
    let folder = folder("interrupt");
    let (page, record) = (folder.join("plan.html"), folder.join("motion.json"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_condyle"))
        .args(["plan", "--target", "0.4,0.4,0.4", "--knots", "20000", "--dt", "0.005", "--out", page.to_str().unwrap()])
        .args(["--record", record.to_str().unwrap()])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    lines.find(|line| line.as_ref().unwrap().starts_with("iteration ")).unwrap().unwrap(); // the solver has started
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(rest.iter().any(|line| line.starts_with("interrupted after")), "{rest:?}");
    let motion: Value = serde_json::from_str(&std::fs::read_to_string(record).unwrap()).unwrap();
    assert_eq!((motion["status"].as_str(), motion["q"].as_array().unwrap().len()), (Some("interrupted"), 20001));
    assert!(page.exists());
}
