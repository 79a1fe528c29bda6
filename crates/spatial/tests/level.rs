//! Tests of the environment variable that selects the SIMD level.

use condyle_spatial::level::{Level, level};
use std::process::Command;

/// Runs code that uses vectors. The test `refused_levels` starts this test as a separate program.
#[test]
fn program() {
    println!("level {}, then {}", level(), level());
}

/// Runs the test `program` as a separate process with a value of the environment variable, and returns its standard
/// output and standard error.
fn run(value: &str) -> [String; 2] {
    let mut program = Command::new(std::env::current_exe().unwrap());
    let output = program.args(["--exact", "program", "--nocapture"]).env("CONDYLE_LEVEL", value).output().unwrap();
    assert!(output.status.success(), "`{value}`: {output:?}");
    [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap())
}

/// Checks that an invalid value of `CONDYLE_LEVEL` is reported once, and that the best level is used.
#[test]
fn refused_levels() {
    let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).unwrap();
    let missing = Level::ALL.into_iter().filter(|level| !level.is_supported()).map(Level::name);
    for value in ["", "avx3", " baseline", "AVX2"].into_iter().chain(missing) {
        let [printed, complaint] = run(value);
        assert!(printed.contains(&format!("level {best}, then {best}")), "`{value}`: {printed}");
        assert_eq!(complaint.matches("CONDYLE_LEVEL: ").count(), 1, "`{value}`: {complaint}");
        assert!(complaint.contains("baseline") && complaint.contains(&format!("using {best}")), "{complaint}");
    }
    for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
        let [printed, complaint] = run(level.name());
        assert!(printed.contains(&format!("level {level}, then {level}")), "{printed}");
        assert!(!complaint.contains("CONDYLE_LEVEL"), "{complaint}");
    }
}
