//! Generated C beside the library: operations, size, time to generate and to compile, and a call.
//!
//! `cargo bench -p condyle-codegen --bench generated -- panda.urdf anymal.urdf:free` ; without files the robots that come along.
//! `CC` names the compiler, `CFLAGS` its flags.

use condyle_codegen::{Language, Settings, functions};
use condyle_dynamics::{
    Data, Joint, Model, UrdfOptions, aba, aba_derivatives, crba, minv, neutral, rnea, rnea_derivatives, robots,
};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const NAMES: [&str; 6] = ["rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives"];

/// The shortest of some measurements is what a call takes: the rest is what else the machine does.
const MEASUREMENTS: usize = 20;

/// Nanoseconds of a call.
fn time(mut call: impl FnMut()) -> f64 {
    let mut calls = 1_u32;
    loop {
        let start = Instant::now();
        (0..calls).for_each(|_| call());
        if start.elapsed().as_secs_f64() > 2e-3 {
            break;
        }
        calls *= 2;
    }
    let one = || {
        let start = Instant::now();
        (0..calls).for_each(|_| call());
        start.elapsed().as_secs_f64() * 1e9 / f64::from(calls)
    };
    std::iter::repeat_with(one).take(MEASUREMENTS).fold(f64::INFINITY, f64::min)
}

/// The library's call.
fn library(model: &Model, name: &str) -> f64 {
    let (data, q, v) = (&mut Data::new(model), neutral(model), vec![0.1; model.nv()]);
    let (q, v) = (std::hint::black_box(q), std::hint::black_box(v));
    match name {
        "rnea" => time(|| {
            std::hint::black_box(rnea(model, data, &q, &v, &v, &[]));
        }),
        "aba" => time(|| {
            std::hint::black_box(aba(model, data, &q, &v, &v, &[]));
        }),
        "crba" => time(|| {
            std::hint::black_box(crba(model, data, &q).as_slice());
        }),
        "minv" => time(|| {
            std::hint::black_box(minv(model, data, &q).as_slice());
        }),
        "rnea_derivatives" => time(|| {
            std::hint::black_box(rnea_derivatives(model, data, &q, &v, &v, &[]).dtau_dq);
        }),
        _ => time(|| {
            std::hint::black_box(aba_derivatives(model, data, &q, &v, &v, &[]).da_dq);
        }),
    }
}

/// A program that prints the nanoseconds of a call.
const TIMER: &str = r#"
#include <stdio.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return 1e9 * t.tv_sec + t.tv_nsec; }
int main(void) {
    long calls = 1;
    for (double took = 0; took < 2e6; calls *= 2) { double t = now(); for (long k = 0; k < calls; k++) CALL; took = now() - t; }
    double best = 1e300;
    for (int m = 0; m < 20; m++) {
        double t = now();
        for (long k = 0; k < calls; k++) CALL;
        t = (now() - t) / calls;
        if (t < best) best = t;
    }
    printf("%f\n", best);
}
"#;

fn measure(model: &Model, folder: &Path) {
    println!("{}: nq = {}, nv = {}", model.name(), model.nq(), model.nv());
    println!(
        "| function | operations | generate ms | parts and text KB | compile s | code KB | library ns | in turn ns | generated ns | ratio |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let cc = std::env::var("CC").unwrap_or("cc".to_owned());
    let flags = std::env::var("CFLAGS").unwrap_or("-O3 -march=native -ffp-contract=fast".to_owned());
    let flags: Vec<&str> = flags.split_whitespace().collect();
    for name in NAMES {
        let start = Instant::now();
        let Ok(all) = functions(model, &[name], &Settings::default()) else { continue };
        let files = Language::C.text("robot", &all);
        let generated = start.elapsed().as_secs_f64() * 1e3;
        for file in &files {
            std::fs::write(folder.join(&file.name), &file.text).unwrap();
        }
        let f = &all[0];
        let mut main = "#include \"robot.h\"\n".to_owned();
        let mut arrays = Vec::new();
        for (k, array) in f.inputs.iter().chain(&f.outputs).enumerate() {
            let (k, n) = (["q", "v", "x"].get(k).filter(|_| k < f.inputs.len()), array.len());
            let numbers = match k {
                Some(&"q") => neutral(model),
                Some(_) => vec![0.1; n],
                None => vec![0.0; n],
            };
            let numbers: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
            main += &format!("static double {}[] = {{{}}};\n", array.name, numbers.join(", "));
            arrays.push(array.name.clone());
        }
        main += &TIMER.replace("CALL", &format!("robot_{name}({})", arrays.join(", ")));
        std::fs::write(folder.join("main.c"), main).unwrap();
        let run = |program: &str, arguments: &[&str]| {
            Command::new(program).current_dir(folder).args(arguments).output().unwrap()
        };
        let start = Instant::now();
        let output = run(&cc, &[&flags[..], &["-c", "robot.c"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let compiled = start.elapsed().as_secs_f64();
        run(&cc, &["-O1", "main.c", "robot.o", "-o", "main", "-lm"]);
        let ns: f64 = String::from_utf8(run("./main", &[]).stdout).unwrap().trim().parse().unwrap();
        let code = std::fs::metadata(folder.join("robot.o")).unwrap().len() / 1024;
        let (own, in_turn) = (library(model, name), library(&model.clone().with_limbs(false), name));
        let (total, text) = (f.operations().total(), files[1].text.len() / 1024);
        println!(
            "| {name} | {total} | {generated:.0} | {text} | {compiled:.1} | {code} | {own:.0} | {in_turn:.0} | {ns:.0} | {:.2} |",
            ns / in_turn
        );
    }
}

fn main() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench_generated");
    std::fs::create_dir_all(&folder).unwrap();
    let files: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    if files.is_empty() {
        [robots::arm7(), robots::quadruped(), robots::humanoid()].iter().for_each(|model| measure(model, &folder));
    }
    for file in &files {
        let (path, root_joint) = match file.strip_suffix(":free") {
            Some(path) => (path, Some(Joint::FreeFlyer)),
            None => (&file[..], None),
        };
        let model = Model::from_urdf(path, &UrdfOptions { root_joint, ..UrdfOptions::default() }).unwrap();
        measure(&model, &folder);
    }
}
