//! Tests of xacro files: the programs that are called, their arguments, and their limits. In these tests, the programs
//! are scripts in a separate folder. A second process of the test has this folder as its PATH.
#![cfg(unix)]

use condyle_model::{Model, UrdfOptions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROBOT: &str = "<robot name='$*'><link name='$ROS_PACKAGE_PATH'/></robot>";

/// Environment variable that contains the arguments for the second process.
const ARGUMENTS: &str = "CONDYLE_TEST_XACRO_ARGUMENTS";

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("condyle-xacro-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Reads `robot.xacro` in a process that finds only the given programs. Returns the name of the robot and of its link,
/// or the error.
fn read(name: &str, programs: &[(&str, &str)], arguments: &str) -> String {
    let folder = folder(name);
    for (name, script) in programs {
        let path = folder.join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    std::fs::write(folder.join("robot.xacro"), "<robot/>").unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", "in_a_process", "--nocapture"]).env("PATH", &folder).env(ARGUMENTS, arguments);
    child.env("ROS_PACKAGE_PATH", "/ros").current_dir(&folder);
    let said = String::from_utf8(child.output().unwrap().stdout).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    said.split_once('[').unwrap().1.rsplit_once(']').unwrap().0.to_owned()
}

/// Reads the file in the process that [`read`] starts. A separate process is needed because programs are searched in
/// the PATH of the process.
#[test]
fn in_a_process() {
    let Ok(arguments) = std::env::var(ARGUMENTS) else {
        let echo = format!("echo \"{ROBOT}\"");
        assert_eq!(read("process", &[("xacro", &echo)], "a=b"), "./robot.xacro a:=b|/one:/two:/ros");
        return;
    };
    let pairs = arguments.split_whitespace().map(|pair| pair.split_once('=').unwrap());
    let arguments = pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
    let options = UrdfOptions { arguments, packages: vec!["/one".into(), "/two".into()], ..UrdfOptions::default() };
    match Model::from_urdf(Path::new("robot.xacro"), &options) {
        Ok(model) => println!("[{}|{}]", model.name(), model.frames()[0].name),
        Err(error) => println!("[{error}]"),
    }
}

#[test]
fn programs() {
    let (echo, fail) = (format!("echo \"{ROBOT}\""), "echo 'no such macro' >&2; exit 2");
    let said = read("first", &[("xacro", &echo), ("xacrodoc", "exit 1")], "side=left width=3.5");
    assert_eq!(said, "./robot.xacro side:=left width:=3.5|/one:/two:/ros");
    let said = read("second", &[("xacrodoc", &echo)], "");
    assert_eq!(said, "./robot.xacro --pkg-dir /one --pkg-dir /two|/one:/two:/ros");
    let said = read("either", &[("xacro", fail), ("xacrodoc", &echo)], "");
    assert!(said.starts_with("./robot.xacro --pkg-dir"), "{said}");
    let said = read("failing", &[("xacro", fail)], "");
    assert_eq!(said, "robot.xacro: cannot be expanded: xacro: no such macro");
    for missing in ["No module named 'ament_index_python'", "package not found: $(find arm)"] {
        let said = read("packages", &[("xacro", &format!("echo \"{}\" >&2; exit 2", missing.replace('$', "\\$")))], "");
        assert!(said.contains(missing) && said.contains("`pip install xacrodoc` installs a program"), "{said}");
    }
    let said = read("silent", &[("xacro", "exit 3")], "");
    assert_eq!(said, "robot.xacro: cannot be expanded: xacro: exit status: 3");
    let said = read("none", &[], "");
    let how = "install one of them (`pip install xacrodoc`), or expand the file first";
    let missing = "is of xacro, and the programs `xacro` and `xacrodoc` are not found";
    assert_eq!(said, format!("robot.xacro: {missing}: {how}"));
    let said = read("line", &[("xacro", "echo; echo '<robot><link/></robot>'")], "");
    assert_eq!(said, "robot.xacro (expanded):2: <link>: has no name");
    // the output may be as long as the limit for the files of a robot
    let large = "read() { echo \"<!-- $1$1 -->\"; }; echo \"<robot name='r'><link name='a'/>\"; \
                 i=0; while [ $i -lt 20000 ]; do read 0123456789012345678901234567890123456789; i=$((i+1)); done; echo '</robot>'";
    assert_eq!(read("large", &[("xacro", large)], ""), "r|a");
}

#[test]
fn arguments() {
    let echo = format!("echo \"{ROBOT}\"");
    for name in ["-o", "", "a b", "a:b", "$x"] {
        let path = folder("arguments").join("robot.xacro");
        std::fs::write(&path, "<robot/>").unwrap();
        let options = UrdfOptions { arguments: vec![(name.to_owned(), "x".to_owned())], ..UrdfOptions::default() };
        let said = Model::from_urdf(&path, &options).unwrap_err().to_string();
        assert!(said.ends_with(&format!("`{name}` is no name of an argument of xacro")), "{said}");
    }
    let said = read("values", &[("xacro", &echo)], "a=$(touch${IFS}x);-o=b");
    assert_eq!(said, "./robot.xacro a:=$(touch${IFS}x);-o=b|/one:/two:/ros");
    let options = UrdfOptions { arguments: vec![("a".to_owned(), "b".to_owned())], ..UrdfOptions::default() };
    let said = Model::from_urdf_str("<robot><link name='a'/></robot>", &options).unwrap_err().to_string();
    assert_eq!(said, "<string>: has arguments of xacro, but its name does not end in `.xacro`");
    let missing = Model::from_urdf("no/such.xacro", &options).unwrap_err().to_string();
    assert_eq!(missing, "no/such.xacro: No such file or directory (os error 2)");
}
