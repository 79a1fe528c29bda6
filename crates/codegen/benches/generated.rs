//! Compares generated C with the library: operations, size, time to generate and to compile, and time of a call. Also
//! compares the time per state of two variants: generated code for vectors of eight states, and a batch of the library.
//!
//! `cargo bench -p condyle-codegen --bench generated -- panda.urdf anymal.urdf:free` reads these files. Without files,
//! the benchmark uses the built-in robots. The environment variable `CC` names the compiler, and `CFLAGS` contains the
//! compiler's flags.

use condyle_codegen::{Function, Language, Settings, functions};
use condyle_dynamics::{
    Batch, Data, Joint, Model, UrdfOptions, aba, aba_derivatives, crba, minv, neutral, rnea, rnea_derivatives, robots,
};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const NAMES: [&str; 6] = ["rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives"];

/// Number of measurements of a call's time. The result is the shortest time, because other programs on the machine can
/// only lengthen a call.
const MEASUREMENTS: usize = 20;

/// Measures the time of a call (ns).
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

/// Measures the time of a call of the library (ns).
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

/// Measures the time per state of a batch in the library, on one core (ns).
fn batch(model: &Model, name: &str) -> f64 {
    let n = 8 * STATES;
    let (b, q, v) = (&mut Batch::new(model, n, 1), neutral(model).repeat(n), vec![0.1; n * model.nv()]);
    let (q, v) = (std::hint::black_box(q), std::hint::black_box(v));
    let all = match name {
        "rnea" => time(|| _ = std::hint::black_box(b.rnea(model, &q, &v, &v, &[]))),
        "aba" => time(|| _ = std::hint::black_box(b.aba(model, &q, &v, &v, &[]))),
        "crba" => time(|| _ = std::hint::black_box(b.crba(model, &q))),
        "minv" => time(|| _ = std::hint::black_box(b.minv(model, &q))),
        "rnea_derivatives" => time(|| _ = std::hint::black_box(b.rnea_derivatives(model, &q, &v, &v, &[]))),
        _ => time(|| _ = std::hint::black_box(b.aba_derivatives(model, &q, &v, &v, &[]))),
    };
    all / n as f64
}

/// Number of states of a batch, divided by eight.
const STATES: usize = 8;

/// C program that prints the time of a call (ns).
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

/// Size of a compiled function, and the time of a call.
struct Compiled {
    text_kb: usize,
    seconds: f64,
    object_kb: u64,
    /// Time of a call (ns).
    ns: f64,
}

/// Writes a function's code to a folder, compiles it, and times it on arrays in which each number occurs `lanes` times.
fn compiled(model: &Model, f: &Function, language: Language, lanes: usize, folder: &Path) -> Compiled {
    let files = language.text("robot", std::slice::from_ref(f));
    for file in &files {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
    }
    let (header, source) = (&files[0].name, &files[1].name);
    let (mut main, mut arrays) = (format!("#include \"{header}\"\n"), Vec::new());
    for (k, array) in f.inputs.iter().chain(&f.outputs).enumerate() {
        let numbers = match ["q", "v", "x"].get(k).filter(|_| k < f.inputs.len()) {
            Some(&"q") => neutral(model),
            Some(_) => vec![0.1; array.len()],
            None => vec![0.0; array.len()],
        };
        let numbers: Vec<String> = numbers.iter().flat_map(|x| vec![format!("{x:?}"); lanes]).collect();
        main += &format!("static double {}[] __attribute__((aligned(64))) = {{{}}};\n", array.name, numbers.join(", "));
        arrays.push(array.name.clone());
    }
    let stem = header.trim_end_matches(".h");
    main += &TIMER.replace("CALL", &format!("{stem}_{}({})", f.name, arrays.join(", ")));
    std::fs::write(folder.join("main.c"), main).unwrap();
    let cc = std::env::var("CC").unwrap_or("cc".to_owned());
    let flags = std::env::var("CFLAGS").unwrap_or("-O3 -march=native -ffp-contract=fast".to_owned());
    let flags: Vec<&str> = flags.split_whitespace().collect();
    let run =
        |program: &str, arguments: &[&str]| Command::new(program).current_dir(folder).args(arguments).output().unwrap();
    let start = Instant::now();
    let output = run(&cc, &[&flags[..], &["-c", source, "-o", "robot.o"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seconds = start.elapsed().as_secs_f64();
    run(&cc, &["-O1", "main.c", "robot.o", "-o", "main", "-lm"]);
    Compiled {
        text_kb: files[1].text.len() / 1024,
        seconds,
        object_kb: std::fs::metadata(folder.join("robot.o")).unwrap().len() / 1024,
        ns: String::from_utf8(run("./main", &[]).stdout).unwrap().trim().parse().unwrap(),
    }
}

fn measure(model: &Model, folder: &Path) {
    println!("{}: nq = {}, nv = {}", model.name(), model.nq(), model.nv());
    println!(
        "| function | operations | generate ms | text KB | compile s | code KB | library ns | in turn ns | generated ns | ratio \
         | batch ns | vectors ns | ratio |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for name in NAMES {
        let start = Instant::now();
        let Ok(all) = functions(model, &[name], &Settings::default()) else { continue };
        Language::C.text("robot", &all);
        let generated = start.elapsed().as_secs_f64() * 1e3;
        let f = &all[0];
        let Compiled { text_kb, seconds, object_kb, ns } = compiled(model, f, Language::C, 1, folder);
        let (own, serial) = (library(model, name), library(&model.clone().with_limbs(false), name));
        let vectors = compiled(model, f, Language::CEight, 8, folder).ns / 8.0;
        let batch = batch(model, name);
        println!(
            "| {name} | {} | {generated:.0} | {text_kb} | {seconds:.1} | {object_kb} | {own:.0} | {serial:.0} | {ns:.0} | {:.2} \
             | {batch:.0} | {vectors:.0} | {:.2} |",
            f.operations().total(),
            ns / serial,
            vectors / batch
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
