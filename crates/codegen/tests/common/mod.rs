//! Compiles generated code with a compiler of the system, and runs it.
#![allow(dead_code)]

use condyle_codegen::{Function, Language};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Creates an empty folder for a test.
pub(crate) fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("codegen_{test}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Returns whether the compiler exists; if not, prints that the test is skipped.
pub(crate) fn is_there(compiler: &str) -> bool {
    let found = Command::new(compiler).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !found {
        println!("NOT RUN: there is no compiler `{compiler}`");
    }
    found
}

/// Runs a compiler, which must print nothing.
pub(crate) fn compile(command: &mut Command) {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{command:?}\n{said}");
}

/// Returns a C program that reads the arguments of each function and prints the function's results.
fn main_in_c(name: &str, functions: &[Function], real: &str, lanes: usize) -> String {
    let mut text = format!("#include \"{name}.h\"\n#include <stdio.h>\nint main(void) {{\n");
    for function in functions {
        text += "    {\n";
        for array in function.inputs.iter().chain(&function.outputs) {
            text += &format!("        static {real} {}[{}];\n", array.name, (lanes * array.len()).max(1));
        }
        for array in &function.inputs {
            let (name, n) = (&array.name, lanes * array.len());
            text += &format!("        if (fread({name}, sizeof *{name}, {n}, stdin) != {n}) return 1;\n");
        }
        let names = function.inputs.iter().chain(&function.outputs).map(|a| &*a.name);
        text += &format!("        {name}_{}({});\n", function.name, names.collect::<Vec<_>>().join(", "));
        for array in &function.outputs {
            text += &format!("        fwrite({0}, sizeof *{0}, {1}, stdout);\n", array.name, lanes * array.len());
        }
        text += "    }\n";
    }
    text + "    return 0;\n}\n"
}

/// Returns a Rust program that reads the arguments of each function and prints the function's results.
fn main_in_rust(functions: &[Function], real: &str) -> String {
    let mut text = "#![allow(non_snake_case)]\nuse std::io::{Read, Write};\nfn main() {\n    let (mut from, mut to) = (std::io::stdin(), std::io::stdout());\n".to_owned();
    for function in functions {
        text += "    {\n";
        for array in function.inputs.iter().chain(&function.outputs) {
            text += &format!("        let mut {} = [0.0 as {real}; {}];\n", array.name, array.len());
        }
        for array in &function.inputs {
            text += &format!(
                "        for x in &mut {} {{ let mut b = x.to_le_bytes(); from.read_exact(&mut b).unwrap(); *x = {real}::from_le_bytes(b); }}\n",
                array.name
            );
        }
        let arguments = function.inputs.iter().map(|a| format!("&{}", a.name));
        let arguments = arguments.chain(function.outputs.iter().map(|a| format!("&mut {}", a.name)));
        text += &format!("        robot::robot::{}({});\n", function.name, arguments.collect::<Vec<_>>().join(", "));
        for array in &function.outputs {
            text += &format!("        for x in {} {{ to.write_all(&x.to_le_bytes()).unwrap(); }}\n", array.name);
        }
        text += "    }\n";
    }
    text + "}\n"
}

/// Compiled program that computes several functions, for one state or for several states in vectors.
pub(crate) struct Program {
    path: PathBuf,
    functions: Vec<Function>,
    is_float: bool,
    lanes: usize,
}

impl Program {
    /// Compiles C code with `cc`. A warning is an error.
    pub(crate) fn c(folder: &Path, functions: &[Function], language: Language, flags: &[&str]) -> Self {
        let (is_float, lanes) = match language {
            Language::C => (false, 1),
            Language::CFloat => (true, 1),
            Language::CFour => (false, 4),
            Language::CEight => (false, 8),
            Language::CFloatFour => (true, 4),
            Language::CFloatEight => (true, 8),
            other => panic!("{other:?} is not run by these tests"),
        };
        let name = language.stem("robot");
        for file in language.text("robot", functions) {
            std::fs::write(folder.join(file.name), file.text).unwrap();
        }
        let real = if is_float { "float" } else { "double" };
        std::fs::write(folder.join("main.c"), main_in_c(&name, functions, real, lanes)).unwrap();
        let source = format!("{name}.c");
        let standard: &[&str] = if lanes > 1 { &["-std=gnu99"] } else { &["-std=c99", "-pedantic"] };
        let warnings = ["-Wall", "-Wextra", "-Werror"];
        let mut cc = Command::new("cc");
        cc.current_dir(folder).args(standard).args(warnings).args(flags);
        compile(cc.args([&source, "main.c", "-o", "main", "-lm"]));
        Self { path: folder.join("main"), functions: functions.to_vec(), is_float, lanes }
    }

    /// Compiles Rust code with `rustc` as a library without `std`. A warning is an error. Also compiles the code as an
    /// unused private module, with lints that are off by default.
    pub(crate) fn rust(folder: &Path, functions: &[Function], is_float: bool) -> Self {
        let (language, real) = if is_float { (Language::RustFloat, "f32") } else { (Language::Rust, "f64") };
        for file in language.text("robot", functions) {
            std::fs::write(folder.join(file.name), file.text).unwrap();
        }
        let file = language.stem("robot");
        let library = format!("#![no_std]\n#![deny(warnings)]\n#[path = \"{file}.rs\"]\npub mod robot;\n");
        std::fs::write(folder.join("library.rs"), library).unwrap();
        let lints = "warnings, unused, nonstandard_style, rust_2018_idioms, unreachable_pub, unused_qualifications";
        let unused = format!("#![no_std]\n#![deny({lints})]\n#[path = \"{file}.rs\"]\nmod robot;\n");
        std::fs::write(folder.join("unused.rs"), unused).unwrap();
        std::fs::write(folder.join("main.rs"), main_in_rust(functions, real)).unwrap();
        let rustc = || {
            let mut command = Command::new("rustc");
            command.current_dir(folder).args(["--edition", "2021", "-C", "opt-level=0", "-C", "debuginfo=0"]);
            command
        };
        compile(rustc().args(["--crate-type", "lib", "--emit", "metadata", "unused.rs"]));
        compile(rustc().args(["--crate-type", "lib", "--crate-name", "robot", "library.rs"]));
        compile(rustc().args(["--extern", "robot=librobot.rlib", "main.rs"]));
        Self { path: folder.join("main"), functions: functions.to_vec(), is_float, lanes: 1 }
    }

    /// Returns the results of all functions for these arguments.
    pub(crate) fn run(&self, inputs: &[Vec<Vec<f64>>]) -> Vec<Vec<Vec<f64>>> {
        let mut child = Command::new(&self.path)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let numbers = inputs.iter().flatten().flatten();
        let bytes: Vec<u8> = match self.is_float {
            true => numbers.flat_map(|&x| (x as f32).to_le_bytes()).collect(),
            false => numbers.flat_map(|x| x.to_le_bytes()).collect(),
        };
        let mut stdin = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || stdin.write_all(&bytes).unwrap());
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        assert!(output.status.success(), "{}", self.path.display());
        let read: Vec<f64> = match self.is_float {
            true => output.stdout.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b).into()).collect(),
            false => output.stdout.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect(),
        };
        let mut read = read.into_iter();
        let arrays = |f: &Function| f.outputs.iter().map(|a| self.lanes * a.len()).collect::<Vec<_>>();
        let mut take = |n: usize| read.by_ref().take(n).collect::<Vec<_>>();
        let results: Vec<Vec<Vec<f64>>> =
            self.functions.iter().map(|f| arrays(f).into_iter().map(&mut take).collect()).collect();
        assert!(read.next().is_none());
        results
    }
}

/// Panics if results differ by more than a bound. The bound is relative to the largest number of each array, or to 1 if
/// all numbers are smaller than 1.
pub(crate) fn assert_equal(what: &str, function: &Function, found: &[Vec<f64>], expected: &[Vec<f64>], bound: f64) {
    for ((array, found), expected) in function.outputs.iter().zip(found).zip(expected) {
        assert_eq!(
            (found.len(), array.len()),
            (expected.len(), expected.len()),
            "{what} {} {}",
            function.name,
            array.name
        );
        let scale = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        for (k, (a, b)) in found.iter().zip(expected).enumerate() {
            let error = (a - b).abs();
            assert!(error <= bound * scale, "{what} {} {}[{k}]: {a}, expected {b}", function.name, array.name);
        }
    }
}
