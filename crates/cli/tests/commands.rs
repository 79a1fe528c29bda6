//! Tests the output and exit status of `condyle inspect`, `budget`, `check` and of the command-line options. No test
//! asserts a computing time.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const EMBEDDED: [(&str, usize, usize); 3] = [("arm7", 7, 7), ("quadruped", 19, 18), ("humanoid", 39, 38)];

/// Creates an empty folder for a test, and returns its path.
fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("commands_{test}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn condyle(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_condyle")).args(arguments).output().unwrap()
}

/// Runs the program, asserts the exit status, and returns the standard output.
fn said(arguments: &[&str], status: i32) -> String {
    let output = condyle(arguments);
    let (out, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(status), "{arguments:?}\n{out}\n{error}");
    out
}

fn json(arguments: &[&str], status: i32) -> Value {
    serde_json::from_str(&said(arguments, status)).unwrap()
}

/// Returns a URDF of a chain: a base, and links one after another with the given masses (kg).
fn chain(masses: &[f64]) -> String {
    let mut urdf = "<robot name=\"chain\">\n<link name=\"base\"/>\n".to_owned();
    for (k, m) in masses.iter().enumerate() {
        let parent = if k == 0 { "base".to_owned() } else { format!("link{}", k - 1) };
        let i = 0.01 * m;
        urdf += &format!(
            "<link name=\"link{k}\"><inertial><origin xyz=\"0 0 0.1\"/><mass value=\"{m}\"/><inertia ixx=\"{i}\" ixy=\"0\" \
             ixz=\"0\" iyy=\"{i}\" iyz=\"0\" izz=\"{i}\"/></inertial></link>\n\
             <joint name=\"joint{k}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"link{k}\"/>\
             <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" velocity=\"2\" effort=\"3\"/></joint>\n"
        );
    }
    urdf + "</robot>\n"
}

#[test]
fn inspect_describes_the_model() {
    for (robot, nq, nv) in EMBEDDED {
        let report = json(&["inspect", robot, "--json"], 0);
        assert_eq!((report["nq"].as_u64(), report["nv"].as_u64()), (Some(nq as u64), Some(nv as u64)), "{robot}");
        let bodies = report["bodies"].as_array().unwrap();
        let sum: f64 = bodies.iter().map(|b| b["mass"].as_f64().unwrap()).sum();
        assert!((sum - report["mass"].as_f64().unwrap()).abs() < 1e-9);
        assert!(bodies.iter().all(|b| b["line"].as_u64().is_some() || b["joint"] == "root_joint"));
        let text = said(&["inspect", robot], 0);
        for body in bodies {
            assert!(text.contains(body["name"].as_str().unwrap()), "{robot}");
        }
        assert!(!text.contains('\x1b'), "no colours but on a terminal");
    }
    let report = json(&["inspect", "quadruped", "--json"], 0);
    assert_eq!(report["limbs"]["steps"], 4);
    assert!(report["bodies"][3]["merged"].as_array().unwrap().iter().any(|link| link == "LF_foot"));
    let fixed = json(&["inspect", "quadruped", "--root", "fixed", "--json"], 0);
    assert_eq!(fixed["nv"], 12);
}

/// Checks that the collision shapes are listed, with the nearest pair and with shapes that are left out.
#[test]
fn inspect_lists_collision_shapes() {
    let folder = folder("shapes");
    let ball = |x: f64| {
        format!("<collision><origin xyz=\"{x} 0 0\"/><geometry><sphere radius=\"0.1\"/></geometry></collision>")
    };
    let mut urdf = chain(&[1.0, 1.0, 1.0]);
    for (link, x) in [("link0", 0.0), ("link2", 0.5)] {
        urdf = urdf.replace(&format!("<link name=\"{link}\">"), &format!("<link name=\"{link}\">{}", ball(x)));
    }
    let mesh = "<link name=\"base\"><collision><geometry><mesh filename=\"a.stl\"/></geometry></collision></link>";
    std::fs::write(folder.join("robot.urdf"), urdf.replace("<link name=\"base\"/>", mesh)).unwrap();
    let path = folder.join("robot.urdf");
    let report = json(&["inspect", path.to_str().unwrap(), "--json"], 0);
    let shapes = &report["collisions"];
    assert_eq!(shapes["shapes"].as_array().unwrap().len(), 2);
    assert_eq!((shapes["shapes"][1]["link"].as_str(), shapes["pairs"].as_u64()), (Some("link2"), Some(1)));
    assert!((shapes["nearest"]["distance"].as_f64().unwrap() - 0.3).abs() < 1e-12, "{shapes}");
    assert!(shapes["left_out"][0].as_str().unwrap().contains("the mesh `a.stl`"));
    let text = said(&["inspect", path.to_str().unwrap()], 0);
    assert!(text.contains("1 pair can collide; the nearest at the neutral position: link0_0 and link2_0, 0.3000 m"));
}

/// Checks that the shapes of an MJCF and an SDF are listed like the shapes of a URDF.
#[test]
fn inspect_lists_collision_shapes_of_all_formats() {
    let folder = folder("shapes-of-formats");
    let mjcf = "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1' pos='0 0 -2'/><body name='a'>
        <joint axis='0 1 0'/><geom name='first' size='0.1'/><body name='b'><joint axis='0 1 0'/>
        <inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><body name='c'><joint axis='0 1 0'/>
        <geom name='last' type='box' size='0.1 0.1 0.1' pos='0.5 0 0'/></body></body></body></worldbody></mujoco>";
    let link = |name: &str, shapes: &str| format!("<link name='{name}'>{shapes}</link>");
    let joint = |parent: &str, child: &str| {
        format!(
            "<joint name='to_{child}' type='revolute'><parent>{parent}</parent><child>{child}</child>
            <axis><xyz>0 1 0</xyz></axis></joint>"
        )
    };
    let shape = |name: &str, x: f64, geometry: &str| {
        format!("<collision name='{name}'><pose>{x} 0 0 0 0 0</pose><geometry>{geometry}</geometry></collision>")
    };
    let first = shape("first", 0.0, "<sphere><radius>0.1</radius></sphere>");
    let last = shape("last", 0.5, "<box><size>0.2 0.2 0.2</size></box>")
        + &shape("shell", 0.0, "<mesh><uri>a.stl</uri></mesh>");
    let links = [link("a", &first), link("b", ""), link("c", &last)].concat();
    let joints = [joint("world", "a"), joint("a", "b"), joint("b", "c")].concat();
    let sdf = format!("<sdf version='1.9'><model name='m'>{links}{joints}</model></sdf>");
    let names = |shapes: &Value| {
        let all = shapes["shapes"].as_array().unwrap().iter();
        all.map(|s| ["name", "link", "kind"].map(|key| s[key].as_str().unwrap().to_owned()).join(" "))
            .collect::<Vec<_>>()
    };
    for (file, text, floor) in [("robot.xml", mjcf, true), ("robot.sdf", &*sdf, false)] {
        let path = folder.join(file);
        std::fs::write(&path, text).unwrap();
        let report = json(&["inspect", path.to_str().unwrap(), "--json"], 0);
        let shapes = &report["collisions"];
        let expected = ["floor world half-space", "first a sphere", "last c box"];
        assert_eq!(names(shapes), expected[usize::from(!floor)..], "{file}");
        // the floor can touch both shapes
        assert_eq!(shapes["pairs"].as_u64(), Some(if floor { 3 } else { 1 }), "{file}");
        let nearest = &shapes["nearest"];
        assert_eq!([&nearest["first"], &nearest["second"]], ["first", "last"], "{file}");
        assert!((nearest["distance"].as_f64().unwrap() - 0.3).abs() < 1e-12, "{file}: {shapes}");
        let left_out = shapes["left_out"].as_array().unwrap();
        assert_eq!(left_out.len(), usize::from(!floor), "{file}: {left_out:?}");
    }
}

#[test]
fn inspect_warns_with_line_numbers() {
    let folder = folder("odd");
    let file = folder.join("chain.urdf");
    let urdf = chain(&[1.0, 1e-4, 0.0]).replacen("upper=\"1\"", "upper=\"-1\"", 1);
    std::fs::write(&file, &urdf).unwrap();
    let path = file.to_str().unwrap();
    let report = json(&["inspect", path, "--json"], 0);
    let line = |text: &str| urdf.lines().position(|line| line.contains(text)).unwrap() as u64 + 1;
    let find = |kind: &str, name: &str| {
        let found = report["warnings"].as_array().unwrap().iter();
        found.filter(|w| w["kind"] == kind && w["name"] == name).map(|w| w["line"].as_u64()).next()
    };
    assert_eq!(find("mass_ratio", "link1"), Some(Some(line("<link name=\"link1\""))));
    assert_eq!(find("massless", "link2"), Some(Some(line("<link name=\"link2\""))));
    assert_eq!(find("singular", "joint2"), Some(Some(line("<joint name=\"joint2\""))));
    assert_eq!(find("limit", "joint0"), Some(Some(line("<joint name=\"joint0\""))));
    let text = said(&["inspect", path, "--strict"], 1);
    assert!(text.contains(&format!("{path}:{}:", line("<link name=\"link1\""))), "{text}");
    assert!(text.contains("at the tip of its limb"), "{text}");
}

#[test]
fn inspect_lists_warnings_by_kind_and_strict_allows_some() {
    let folder = folder("kinds_of_warnings");
    let file = folder.join("light.urdf");
    std::fs::write(&file, chain(&[1.0, 1e-4, 0.0])).unwrap();
    let path = file.to_str().unwrap();
    let text = said(&["inspect", path], 0);
    let at = |line: &str| text.find(line).unwrap_or_else(|| panic!("{line}\n{text}"));
    assert!(at("massless (1): bodies that move and have no mass") < at("mass_ratio (1): masses far from the parent's"));
    said(&["inspect", path, "--strict", "--allow", "massless"], 1);
    let all = "massless,singular,mass_ratio,moment_ratio";
    said(&["inspect", path, "--strict", "--allow", all], 0);
    let wrong = condyle(&["inspect", path, "--strict", "--allow", "masless"]);
    assert_eq!(wrong.status.code(), Some(2));
    let wrong = String::from_utf8(wrong.stderr).unwrap();
    assert!(wrong.contains("masless") && wrong.contains("massless"), "{wrong}");
}

#[test]
fn inspect_finds_lines_beside_comments() {
    let folder = folder("comments");
    let file = folder.join("old.urdf");
    let urdf = chain(&[1.0, 0.0]);
    let (head, rest) = urdf.split_once("<link name=\"link1\"").unwrap();
    let text = format!("{head}<!-- before 2020:\n<link name=\"link1\"/> -->\n<link\n  name = 'link1'{rest}");
    std::fs::write(&file, &text).unwrap();
    let report = json(&["inspect", file.to_str().unwrap(), "--json"], 0);
    let massless = report["warnings"].as_array().unwrap().iter().find(|w| w["kind"] == "massless").unwrap();
    let line = text.lines().position(|line| line == "<link").unwrap() as u64 + 1;
    assert_eq!((massless["name"].as_str(), massless["line"].as_u64()), (Some("link1"), Some(line)));
}

#[test]
fn inspect_shows_both_sides_of_an_effort_limit() {
    let folder = folder("efforts");
    let file = folder.join("arm.xml");
    let joint = "<joint name=\"j\" axis=\"0 1 0\" actuatorfrcrange=\"-2 5\"/>";
    let body = format!("<body name=\"b\">{joint}<geom size=\"0.1\"/></body>");
    std::fs::write(&file, format!("<mujoco><worldbody>{body}</worldbody></mujoco>")).unwrap();
    let path = file.to_str().unwrap();
    let report = json(&["inspect", path, "--json"], 0);
    let [effort, lower, upper] =
        ["effort", "effort_lower", "effort_upper"].map(|side| report["bodies"][0][side][0].as_f64());
    assert_eq!((effort, lower, upper), (Some(5.0), Some(-2.0), Some(5.0)));
    assert!(said(&["inspect", path], 0).contains("-2 to 5"));
    assert_eq!(report["actuators"].as_array().map(Vec::len), Some(0));
}

#[test]
fn inspect_reads_every_kind_of_file() {
    let folder = folder("kinds");
    let mjcf = "<!-- a <robot> in words -->\n<mujoco model=\"m\"><worldbody><body name=\"b\"><joint name=\"j\" axis=\"0 0 1\"/>\
        <geom size=\"0.1\"/></body></worldbody></mujoco>";
    let sdf = "<?xml version=\"1.0\"?>\n<sdf version=\"1.6\"><model name=\"m\"><link name=\"a\"/><link name=\"b\"/>\
        <joint name=\"j\" type=\"revolute\"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>";
    for (name, text, format) in [("m.xml", mjcf, "MJCF"), ("m.sdf", sdf, "SDF"), ("m.txt", &*chain(&[1.0]), "URDF")] {
        let file = folder.join(name);
        std::fs::write(&file, text).unwrap();
        let report = json(&["inspect", file.to_str().unwrap(), "--json"], 0);
        assert_eq!((report["format"].as_str(), report["nv"].as_u64()), (Some(format), Some(1)));
        assert_eq!(report["bodies"][0]["line"], 2 + 2 * u64::from(format == "URDF"));
    }
}

#[test]
fn inspect_names_joints_that_follow() {
    let folder = folder("mimic");
    let file = folder.join("m.urdf");
    let urdf = chain(&[1.0, 1.0]);
    let (head, tail) = urdf.rsplit_once("</joint>").unwrap();
    let mimic = "<mimic joint=\"joint0\" multiplier=\"-2\" offset=\"0.5\"/></joint>";
    std::fs::write(&file, format!("{head}{mimic}{tail}")).unwrap();
    let path = file.to_str().unwrap();
    for (flags, nv) in [(&[][..], 2), (&["--mimic"], 1)] {
        let report = json(&[&["inspect", path, "--json"], flags].concat(), 0);
        assert_eq!(report["nv"], nv);
        let follower = &report["mimics"][0];
        assert_eq!((follower["joint"].as_str(), follower["leader"].as_str()), (Some("joint1"), Some("joint0")));
        assert_eq!((follower["ratio"].as_f64(), follower["offset"].as_f64()), (Some(-2.0), Some(0.5)));
        assert_eq!(follower["follows"], nv == 1);
    }
}

#[test]
fn all_checks_pass() {
    for (robot, ..) in EMBEDDED {
        let report = json(&["check", robot, "--states", "50", "--json"], 0);
        assert_eq!(report["pass"], true);
        let rows = report["rows"].as_array().unwrap();
        assert!(rows.len() >= 34, "{robot}: {}", rows.len());
        for row in rows {
            assert!(row["cases"].as_u64().unwrap() > 0 && row["error"].as_f64().is_some(), "{row}");
        }
        for equation in ["rnea(q, v, aba(q, v, τ)) = τ", "Ṁ = C + Cᵀ, Ṁ by dual numbers", "Y π + armature a = τ"]
        {
            assert!(rows.iter().any(|row| row["equation"] == equation), "{equation}");
        }
    }
    assert!(said(&["check", "arm7", "--states", "5"], 0).contains("34 of 34 checks pass"));
}

/// Checks that a tip without inertia gets armature, and that the report states this. Without armature, the tip would
/// have no forward dynamics.
#[test]
fn massless_tips_are_given_armature() {
    let file = folder("tip").join("chain.urdf");
    std::fs::write(&file, chain(&[1.0, 0.5, 0.0])).unwrap();
    let path = file.to_str().unwrap();
    let report = json(&["check", path, "--states", "20", "--json"], 0);
    assert_eq!(report["armature_added"], serde_json::json!(["joint2"]));
    let report = json(&["budget", path, "--knots", "4", "--repetitions", "1", "--json"], 0);
    assert_eq!(report["armature_added"], serde_json::json!(["joint2"]));
}

#[test]
fn budget_measures_everything() {
    let flags = ["--knots", "4,9", "--repetitions", "2", "--cores", "2", "--json"];
    for (robot, contacts) in [
        ("arm7", &["--contacts", "tool"][..]),
        ("quadruped", &["--contacts", "LF_foot,RF_foot,LH_foot,RH_foot"]),
        ("humanoid", &["--rigid-contacts", "left_sole,right_sole"]),
    ] {
        let report = json(&[&["budget", robot], &flags[..], contacts].concat(), 0);
        let rows = |name: &str| report[name].as_array().unwrap().clone();
        assert_eq!(rows("horizons").len(), 2);
        assert_eq!(rows("algorithms").len(), 6);
        let kinds: Vec<_> = rows("iterations").iter().map(|row| row["name"].as_str().unwrap().to_owned()).collect();
        assert_eq!(kinds, ["free", "free", "in contact", "in contact"]);
        for row in rows("horizons").iter().chain(&rows("algorithms")) {
            for way in ["single", "lanes", "threads"] {
                let [p50, p99] = ["p50_s", "p99_s"].map(|p| row[way][p].as_f64().unwrap());
                assert!(0.0 < p50 && p50 <= p99, "{row}");
            }
        }
        assert!(rows("iterations").iter().all(|row| row["finite"] == true), "{robot}");
        assert!(rows("verdicts").iter().all(|v| v["name"] == "in contact" && v["fits"].is_null()));
    }
}

/// Checks that every horizon fits into a period of 100 s, and that no horizon fits into a nanosecond.
#[test]
fn budget_ends_with_the_verdict() {
    let folder = folder("budget");
    let plot = folder.join("plot.svg");
    let flags = ["budget", "arm7", "--knots", "6", "--repetitions", "2", "--rate"];
    let report = json(&[&flags[..], &["0.01", "--json", "--plot", plot.to_str().unwrap()]].concat(), 0);
    let verdict = &report["verdicts"][0];
    assert_eq!((verdict["fits"].as_bool(), verdict["period_s"].as_f64()), (Some(true), Some(100.0)));
    assert!(verdict["largest_knots"].as_u64().unwrap() > 6 && verdict["iterations_per_period"].as_u64().unwrap() > 1);
    let svg = std::fs::read_to_string(plot).unwrap();
    assert!(roxmltree::Document::parse(&svg).is_ok() && svg.contains("period") && !svg.contains("NaN"));
    let report = json(&[&flags[..], &["1e9", "--json"]].concat(), 1);
    assert_eq!(report["verdicts"][0]["fits"], false);
    assert!(said(&[&flags[..], &["1e9"]].concat(), 1).contains("OVER"));
}

#[test]
fn errors_are_one_line() {
    let folder = folder("wrong");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).unwrap();
        folder.join(name).to_str().unwrap().to_owned()
    };
    let (html, empty) = (write("page.urdf", "<html/>"), write("empty.urdf", ""));
    let near = folder.join("pge.urdf").to_str().unwrap().to_owned();
    let negative = write("negative.urdf", &chain(&[1.0, -1.0]));
    let mjcf =
        write("m.xml", "<mujoco><worldbody><body name=\"b\"><joint/><geom size=\"1\"/></body></worldbody></mujoco>");
    for (arguments, words) in [
        (&["inspect", "quadrupde"][..], "no robot `quadrupde`; nearest is `quadruped`"),
        (&["inspect", &near], "page.urdf`"),
        (&["inspect", &html], "page.urdf: begins with <html>, expected <robot> (URDF)"),
        (&["check", &empty], "empty.urdf: has no XML element"),
        (&["budget", &negative], "negative.urdf:"),
        (&["inspect", folder.to_str().unwrap()], "expected a file, found a folder"),
        (&["inspect", &mjcf, "--root", "free"], "--root: not for an MJCF"),
        (&["inspect", "arm7", "--root", "fre"], "'free'"),
        (&["budget", "quadruped", "--contacts", "LF_fot"], "unknown frame `LF_fot`; nearest is `LF_foot`"),
        (&["budget", "arm7", "--rate", "-5"], "--rate: must be above 0, not -5"),
        (&["budget", "arm7", "--rate", "x"], "invalid value 'x' for '--rate <HZ>'"),
        (&["budget", "arm7", "--knots", "0"], "0 is not in 1..=100000"),
        (
            &["check", "arm7", "--state", "5"],
            "unexpected argument '--state' found; a similar argument exists: '--states'",
        ),
        (&["chek", "arm7"], "unrecognized subcommand 'chek'; a similar subcommand exists: 'check'"),
        (&["inspect"], "<ROBOT>"),
    ] {
        let output = condyle(arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(words) && error.lines().count() == 1, "{arguments:?}: `{words}` is missing in\n{error}");
        assert!(output.stdout.is_empty());
    }
}

/// Checks that a program built without the feature `generate` names this feature in its error message, for all
/// arguments.
#[cfg(not(feature = "generate"))]
#[test]
fn generate_is_a_feature() {
    for flags in [&["generate", "--help"][..], &["generate", "arm7", "--functions", "rnea", "--out", "."]] {
        let output = condyle(flags);
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && error.contains("--features generate"), "{error}");
        assert!(error.lines().count() == 1 && output.stdout.is_empty(), "{error}");
    }
}

/// Checks that `generate` writes the same code as the library, and that an error message names a wrong argument.
#[cfg(feature = "generate")]
#[test]
fn generate_writes_code() {
    let out = folder("generate");
    let out = out.to_str().unwrap();
    let flags =
        ["generate", "quadruped", "--functions", "rnea,constrained_dynamics", "--contacts", "LF_foot", "--out", out];
    let text = said(&flags, 0);
    let paths: Vec<&str> = text.lines().collect();
    assert_eq!(paths.len(), 2);
    let header = std::fs::read_to_string(paths[0]).unwrap();
    assert!(header.contains("void quadruped_rnea(const double *restrict q, ") && header.contains("lambda: forces"));
    let rust =
        said(&["generate", "arm7", "--functions", "aba", "--language", "rust", "--inputs", "gravity", "--out", out], 0);
    let rust = std::fs::read_to_string(rust.trim()).unwrap();
    assert!(rust.contains("pub fn aba(q: &[f64; 7], gravity_vector: &[f64; 3], v: &[f64; 7], "), "{rust}");
    let split =
        ["generate", "quadruped", "--functions", "rnea", "--language", "cuda", "--partitions", "3", "--out", out];
    let cuda = std::fs::read_to_string(said(&split, 0).trim()).unwrap();
    assert!(cuda.contains("// Partitions: 3, of "), "{cuda}");
    let refused = condyle(&["generate", "arm7", "--functions", "aba", "--partitions", "3", "--out", out]);
    let error = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && error.contains("--partitions: only cuda and cuda-float"), "{error}");
    for (flags, words) in [
        (["--functions", "abba"], "--functions: `abba` is none of"),
        (["--functions", "frames"], "--functions: frames: needs frames"),
        (["--functions", "aba,rnea,aba"], "--functions: aba: named twice"),
        (["--functions", "aba,rnea,crba_"], "nearest is `crba`"),
    ] {
        let output = condyle(&[&["generate", "arm7", "--out", out], &flags[..]].concat());
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && error.contains(words) && error.lines().count() == 1, "{error}");
    }
}

#[test]
fn help_and_completions() {
    for command in ["inspect", "budget", "check", "plan", "walk"] {
        let help = said(&[command, "--help"], 0);
        assert!(help.contains(&format!("Examples:\n  condyle {command}")), "{help}");
    }
    assert!(said(&["--help"], 0).contains("Exit status:"));
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(said(&["completions", shell], 0).contains("budget"));
    }
}
