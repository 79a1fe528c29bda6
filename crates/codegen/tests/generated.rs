//! Compares generated code with the library's functions.
#![allow(non_snake_case)]

mod common;
#[path = "../../dynamics/tests/common/mod.rs"]
mod trees;

use common::{Program, assert_equal, compile, folder, is_there};
use condyle_codegen::{Error, FUNCTIONS, Function, Language, Settings, functions, generate, record};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, Dense, DenseMatrix, Force, Model, ModelBuilder, ReferenceFrame, aba,
    aba_derivatives, aba_hessian, centroidal_map_rate, constrained_dynamics, constrained_dynamics_derivatives, crba,
    forward_kinematics, forward_velocities, gravity, impulse_dynamics, impulse_dynamics_derivatives, minv,
    nonlinear_effects, random_configuration, rnea, rnea_derivatives, rnea_hessian, robots,
};
use condyle_spatial::{Scalar, Vec3};
use nalgebra::DMatrix;
use num_dual::Dual64;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::process::Command;
use trees::Tree;

/// Tolerance for rounding errors. Recorded code adds in another order than the library, which computes in SIMD lanes.
const ROUNDING: f64 = 1e-12;

/// Coefficient of restitution in impacts.
const RESTITUTION: f64 = 0.3;

/// Tolerance for results that use the inverse inertia matrix M⁻¹ or the inertia Λ of the contacts: their large
/// condition numbers amplify rounding errors.
const THROUGH_INVERSE: f64 = 1e-11;

/// Returns the tolerance for random trees, whose inertia matrix may have a large condition number.
fn bound_of_trees(name: &str) -> f64 {
    if bound(name) == ROUNDING { ROUNDING } else { 1e-9 }
}

fn all_robots() -> [(&'static str, Model, Settings); 3] {
    let with = |model: &Model, names: &[&str]| Settings {
        frames: names.iter().map(|&name| name.to_owned()).collect(),
        constraints: names.iter().map(|name| ContactConstraint::point(model.frame(name).unwrap())).collect(),
        ..Settings::default()
    };
    let (arm, quadruped, humanoid) = (robots::arm7(), robots::quadruped(), robots::humanoid());
    let (a, q) = (with(&arm, &["tool"]), with(&quadruped, &["LF_foot", "RH_foot"]));
    let mut h = with(&humanoid, &["left_sole", "right_sole"]);
    h.constraints = vec![ContactConstraint::rigid(humanoid.frame("left_sole").unwrap())];
    [("arm", arm, a), ("quadruped", quadruped, q), ("humanoid", humanoid, h)]
}

/// Returns four random vectors: positions q, velocities v, numbers that serve as accelerations a or efforts τ, and
/// numbers that serve as weights λ of second derivatives.
fn state(model: &Model, rng: &mut StdRng) -> [Vec<f64>; 4] {
    let mut numbers = |n: usize| (0..n).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f64>>();
    let [v, x, lambda] = [(); 3].map(|()| numbers(model.nv()));
    let q = random_configuration(model, rng);
    [q, v, x, lambda]
}

fn matrix(m: &DenseMatrix<f64, impl Dense<f64>>) -> Vec<f64> {
    m.as_slice().to_vec()
}

/// Computes the results of a function with the library, as reference for the generated code.
fn expected(
    model: &Model,
    settings: &Settings,
    name: &str,
    [q, v, x, lambda]: &[Vec<f64>; 4],
    f: &[Force<f64>],
) -> Vec<Vec<f64>> {
    let data = &mut Data::new(model);
    let mut set = ConstraintSet::new(model, &settings.constraints).unwrap();
    match name {
        "rnea" => vec![rnea(model, data, q, v, x, f).to_vec()],
        "aba" => vec![aba(model, data, q, v, x, f).to_vec()],
        "crba" => vec![matrix(crba(model, data, q))],
        "minv" => vec![matrix(minv(model, data, q))],
        "gravity" => vec![gravity(model, data, q).to_vec()],
        "nonlinear_effects" => vec![nonlinear_effects(model, data, q, v).to_vec()],
        "rnea_derivatives" => {
            let d = rnea_derivatives(model, data, q, v, x, f);
            [d.dtau_dq, d.dtau_dv, d.dtau_da].map(matrix).to_vec()
        }
        "aba_derivatives" => {
            let d = aba_derivatives(model, data, q, v, x, f);
            [&[d.a.to_vec()][..], &[d.da_dq, d.da_dv, d.da_dtau].map(matrix)].concat()
        }
        "rnea_hessian" => {
            let H = rnea_hessian(model, data, q, v, x, f, lambda);
            [H.dqdq, H.dvdq, H.dvdv, H.dadq].map(matrix).to_vec()
        }
        "aba_hessian" => {
            let H = aba_hessian(model, data, q, v, x, f, lambda);
            [H.dqdq, H.dvdq, H.dvdv, H.dtaudq].map(matrix).to_vec()
        }
        "frames" => {
            let k = forward_velocities(model, data, q, v);
            let axes = ReferenceFrame::LocalWorldAligned;
            let of = |name: &String| {
                let frame = model.frame(name).unwrap();
                let [mut J, mut dJ] = [(); 2].map(|()| DMatrix::zeros(6, model.nv()));
                k.frame_jacobian(frame, axes, &mut J);
                k.frame_jacobian_rate(frame, axes, &mut dJ);
                let oXf = k.frame(frame);
                let rotation = oXf.rotation.columns().iter().flat_map(|c| c.to_array()).collect();
                let velocity = k.frame_velocity(frame, axes).to_array().to_vec();
                [rotation, oXf.translation.to_array().to_vec(), velocity, matrix(&J), matrix(&dJ)]
            };
            settings.frames.iter().flat_map(of).collect()
        }
        "centroidal" => {
            let m = centroidal_map_rate(model, data, q, v);
            let vectors = [m.com.to_array().to_vec(), m.com_velocity.to_array().to_vec(), m.hg.to_array().to_vec()];
            [vectors, [m.Jcom, m.Ag, m.dAg].map(matrix)].concat()
        }
        "constrained_dynamics" => {
            let d = constrained_dynamics(model, data, &mut set, q, v, x, f);
            vec![d.a.to_vec(), d.lambda.to_vec()]
        }
        "constrained_dynamics_derivatives" => {
            let d = constrained_dynamics_derivatives(model, data, &mut set, q, v, x, f);
            let matrices = [d.da_dq, d.da_dv, d.da_dtau, d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau].map(matrix);
            [&[d.a.to_vec(), d.lambda.to_vec()][..], &matrices].concat()
        }
        "impulse_dynamics" => {
            let d = impulse_dynamics(model, data, &mut set, q, v, RESTITUTION);
            vec![d.v.to_vec(), d.lambda.to_vec()]
        }
        "impulse_dynamics_derivatives" => {
            let d = impulse_dynamics_derivatives(model, data, &mut set, q, v, RESTITUTION);
            let matrices = [d.dv_dq, d.dv_dv, d.dlambda_dq, d.dlambda_dv].map(matrix);
            [&[d.v.to_vec(), d.lambda.to_vec()][..], &matrices].concat()
        }
        _ => panic!("no such function: {name}"),
    }
}

fn bound(name: &str) -> f64 {
    let through_inverse = name.contains("aba") || name.contains("minv") || name.contains("dynamics");
    if through_inverse { THROUGH_INVERSE } else { ROUNDING }
}

/// Returns the arguments of a function for a state.
fn arguments(function: &Function, state: &[Vec<f64>; 4]) -> Vec<Vec<f64>> {
    match function.name.starts_with("impulse_dynamics") {
        true => vec![state[0].clone(), state[1].clone(), vec![RESTITUTION]],
        false => state[..function.inputs.len()].to_vec(),
    }
}

/// Returns whether the test may run compilers for several minutes. Only `./test full` permits this.
fn is_full() -> bool {
    std::env::var_os("CONDYLE_FULL").is_some()
}

/// Returns the functions to be compiled for a robot: either functions with short code, or nearly all functions.
fn for_compilers(robot: &str) -> Vec<&'static str> {
    let short = ["rnea", "aba", "crba", "gravity", "nonlinear_effects", "frames", "centroidal"];
    match robot {
        "arm" | "quadruped" if is_full() => FUNCTIONS.to_vec(),
        "humanoid" if is_full() => [&short[..], &["minv", "rnea_derivatives", "aba_derivatives"]].concat(),
        "arm" => FUNCTIONS.into_iter().filter(|name| !name.contains("hessian")).collect(),
        "quadruped" => [&short[..], &["minv", "impulse_dynamics"]].concat(),
        _ => short[..4].to_vec(),
    }
}

/// Compares the results of `compute` with the library, for several functions and states.
fn check(
    what: &str,
    names: impl Fn(&str) -> Vec<&'static str>,
    mut compute: impl FnMut(&str, &[Function], &[Vec<Vec<f64>>]) -> Vec<Vec<Vec<f64>>>,
) {
    for (robot, model, settings) in all_robots() {
        let all = functions(&model, &names(robot), &settings).unwrap();
        let mut rng = StdRng::seed_from_u64(7);
        for _ in 0..3 {
            let state = state(&model, &mut rng);
            let inputs: Vec<_> = all.iter().map(|f| arguments(f, &state)).collect();
            let found = compute(robot, &all, &inputs);
            for (function, found) in all.iter().zip(found) {
                let expected = expected(&model, &settings, &function.name, &state, &[]);
                assert_equal(&format!("{what} {robot}"), function, &found, &expected, bound(&function.name));
            }
        }
    }
}

#[test]
fn what_is_recorded_is_what_the_library_computes() {
    check(
        "recorded",
        |_| FUNCTIONS.to_vec(),
        |_, all, inputs| {
            all.iter().zip(inputs).map(|(f, x)| f.evaluate(&x.iter().map(|x| &x[..]).collect::<Vec<_>>())).collect()
        },
    );
}

/// Compares recorded functions with the library for random trees with every type of joint and with mimic joints.
#[test]
fn random_robots() {
    for seed in 0..4 {
        let mut rng = StdRng::seed_from_u64(seed);
        let tree = if seed % 2 == 0 { Tree::random(&mut rng) } else { Tree::random_with_mimics(&mut rng) };
        let model = tree.build();
        let last = format!("f{}", tree.parts.len());
        let settings = Settings {
            constraints: vec![ContactConstraint::point(model.frame(&last).unwrap())],
            frames: vec!["f1".to_owned(), last],
            ..Settings::default()
        };
        let names: Vec<_> = FUNCTIONS.into_iter().filter(|&name| name != "aba_hessian" || seed < 2).collect();
        let all = functions(&model, &names, &settings).unwrap();
        let state = state(&model, &mut rng);
        let inputs: Vec<_> = all.iter().map(|f| arguments(f, &state)).collect();
        let recorded = all.iter().zip(&inputs).map(|(f, x)| f.evaluate(&x.iter().map(|x| &x[..]).collect::<Vec<_>>()));
        for (function, found) in all.iter().zip(recorded) {
            let expected = expected(&model, &settings, &function.name, &state, &[]);
            assert_equal(
                &format!("recorded, tree {seed}"),
                function,
                &found,
                &expected,
                bound_of_trees(&function.name),
            );
        }
        if seed > u64::from(is_full()) || !is_there("cc") {
            continue;
        }
        let short = |f: &&Function| ["rnea", "aba", "crba", "frames", "centroidal"].contains(&&*f.name);
        let some: Vec<_> = all.iter().filter(short).cloned().collect();
        let inputs: Vec<_> = some.iter().map(|f| arguments(f, &state)).collect();
        let flags = ["-O0", "-fsanitize=undefined", "-fno-sanitize-recover"];
        let found = Program::c(&folder(&format!("c_tree_{seed}")), &some, Language::C, &flags).run(&inputs);
        for (function, found) in some.iter().zip(found) {
            let expected = expected(&model, &settings, &function.name, &state, &[]);
            assert_equal(&format!("C, tree {seed}"), function, &found, &expected, bound_of_trees(&function.name));
        }
    }
}

#[test]
fn c_computes_what_the_library_does() {
    if !is_there("cc") {
        return;
    }
    let mut programs = std::collections::HashMap::new();
    check("C", for_compilers, |robot, all, inputs| {
        let program = programs.entry(robot.to_owned()).or_insert_with(|| {
            let flags = ["-O0", "-fsanitize=undefined", "-fno-sanitize-recover"];
            // For long code, the sanitiser takes minutes, because it checks every line.
            let flags = if robot == "humanoid" { &flags[..1] } else { &flags };
            Program::c(&folder(&format!("c_{robot}")), all, Language::C, flags)
        });
        program.run(inputs)
    });
}

#[test]
fn rust_computes_what_the_library_does() {
    if !is_there("rustc") {
        return;
    }
    // rustc takes ten times as long as C compilers, so it compiles short functions only.
    let short = |robot: &str| -> Vec<&'static str> {
        let all = for_compilers(robot);
        all.into_iter().filter(|name| !name.contains("hessian") && (robot == "arm" || !name.contains("_d"))).collect()
    };
    let mut programs = std::collections::HashMap::new();
    check("Rust", short, |robot, all, inputs| {
        let new = || Program::rust(&folder(&format!("rust_{robot}")), all, false);
        programs.entry(robot.to_owned()).or_insert_with(new).run(inputs)
    });
}

/// Checks that each state in a vector of four or eight states gets the same results as in a single call.
#[test]
fn vectors_compute_what_the_library_does() {
    if !is_there("cc") {
        return;
    }
    for (robot, model, settings) in all_robots().into_iter().take(2) {
        let short = ["rnea", "aba", "crba", "constrained_dynamics"];
        let (names, languages): (&[&str], &[_]) = match robot {
            "arm" => (
                &["rnea", "aba", "crba", "frames", "centroidal"],
                &[
                    (Language::CFour, 4, false),
                    (Language::CFloatFour, 4, true),
                    (Language::CEight, 8, false),
                    (Language::CFloatEight, 8, true),
                ][..if is_full() { 4 } else { 2 }],
            ),
            _ => (&short, &[(Language::CFour, 4, false)]),
        };
        let all = functions(&model, names, &settings).unwrap();
        for &(language, lanes, is_float) in languages {
            let program = Program::c(&folder(&format!("{robot}_{language:?}")), &all, language, &["-O0"]);
            let mut rng = StdRng::seed_from_u64(11);
            let states: Vec<_> = (0..lanes).map(|_| state(&model, &mut rng)).collect();
            // Number k of state i is at index [lanes k + i].
            let side_by_side = |f: &Function| -> Vec<Vec<f64>> {
                let each: Vec<_> = states.iter().map(|state| arguments(f, state)).collect();
                let array = |a: usize| {
                    (0..f.inputs[a].len()).flat_map(|k| each.iter().map(|x| x[a][k]).collect::<Vec<_>>()).collect()
                };
                (0..f.inputs.len()).map(array).collect()
            };
            let found = program.run(&all.iter().map(side_by_side).collect::<Vec<_>>());
            for (function, found) in all.iter().zip(found) {
                for (i, state) in states.iter().enumerate() {
                    let own: Vec<Vec<f64>> =
                        found.iter().map(|array| array.chunks(lanes).map(|numbers| numbers[i]).collect()).collect();
                    let expected = expected(&model, &settings, &function.name, state, &[]);
                    let bound = if is_float { SINGLE } else { bound(&function.name) };
                    assert_equal(&format!("{language:?} {robot}"), function, &own, &expected, bound);
                }
            }
        }
    }
}

/// Tolerance of single precision, for results whose rounding errors a large condition number amplifies.
const SINGLE: f64 = 2e-3;

#[test]
fn floats_are_near() {
    let names = ["rnea", "crba", "aba", "rnea_derivatives", "centroidal"];
    for (robot, model, settings) in all_robots() {
        let names = if robot == "arm" || is_full() { &names[..] } else { &names[..2] };
        let all = functions(&model, names, &settings).unwrap();
        let state = state(&model, &mut StdRng::seed_from_u64(3));
        let inputs: Vec<_> = all.iter().map(|f| arguments(f, &state)).collect();
        let mut results = Vec::new();
        if is_there("cc") {
            results.push(Program::c(&folder(&format!("float_{robot}")), &all, Language::CFloat, &["-O0"]).run(&inputs));
        }
        if is_there("rustc") {
            results.push(Program::rust(&folder(&format!("f32_{robot}")), &all, true).run(&inputs));
        }
        for found in results {
            for (function, found) in all.iter().zip(found) {
                let expected = expected(&model, &settings, &function.name, &state, &[]);
                assert_equal(robot, function, &found, &expected, SINGLE);
            }
        }
    }
}

/// Checks that one folder can contain a robot's files of all languages, and that one program can contain all C
/// functions.
#[test]
fn languages_share_a_folder_and_a_program() {
    let arm = robots::arm7();
    let of = |name: &str| Language::named(name).unwrap();
    let in_c = [("c", 1), ("c-float", 1), ("c-4", 4), ("c-8", 8), ("c-float-4", 4), ("c-float-8", 8)];
    let named = in_c.iter().map(|(name, _)| *name).chain(["rust", "rust-float"]).map(of);
    let folder = folder("together");
    let paths: Vec<_> = named
        .flat_map(|language| generate(&arm, &["gravity"], &Settings::default(), language, &folder).unwrap())
        .collect();
    let names: Vec<_> = paths.iter().map(|path| path.file_name().unwrap().to_str().unwrap().to_owned()).collect();
    assert!(names.iter().enumerate().all(|(k, name)| !names[..k].contains(name)), "{names:?}");
    if !is_there("cc") {
        return;
    }
    let with = |end: &'static str| names.iter().filter(move |name| name.ends_with(end));
    let mut main: String = with(".h").map(|header| format!("#include \"{header}\"\n")).collect();
    main += "#include <stdio.h>\nstatic double x[56], y[56];\nstatic float xs[56], ys[56];\nint main(void) {\n";
    main += "    for (int k = 0; k < 56; k++) x[k] = xs[k] = 0.5;\n";
    for (name, lanes) in in_c {
        let (stem, s) = (of(name).stem("arm7"), if name.contains("float") { "s" } else { "" });
        main += &format!("    {stem}_gravity(x{s}, y{s}); printf(\"%.3f\\n\", y{s}[{lanes}]);\n");
    }
    std::fs::write(folder.join("main.c"), main + "    return 0;\n}\n").unwrap();
    let mut cc = Command::new("cc");
    cc.current_dir(&folder).args(["-std=gnu99", "-Wall", "-Wextra", "-Werror", "-O0", "main.c"]).args(with(".c"));
    compile(cc.args(["-o", "main", "-lm"]));
    let said = String::from_utf8(Command::new(folder.join("main")).output().unwrap().stdout).unwrap();
    let second = gravity(&arm, &mut Data::new(&arm), &[0.5; 7])[1];
    assert!(second.abs() > 1.0);
    assert_eq!(said, format!("{second:.3}\n").repeat(6));
}

/// Checks a robot without joints, whose functions have arrays of length 0. Compilers must print no warning.
#[test]
fn robots_without_joints() {
    let stone = ModelBuilder::new("stone").build().unwrap();
    let names = ["rnea", "aba", "crba", "minv", "aba_derivatives", "aba_hessian", "centroidal"];
    let all = functions(&stone, &names, &Settings::default()).unwrap();
    let inputs: Vec<_> = all.iter().map(|f| vec![Vec::new(); f.inputs.len()]).collect();
    let mut found = Vec::new();
    if is_there("cc") {
        found.push(Program::c(&folder("stone_c"), &all, Language::C, &["-O0"]).run(&inputs));
    }
    if is_there("rustc") {
        found.push(Program::rust(&folder("stone_rust"), &all, false).run(&inputs));
    }
    for found in found {
        assert!(found[..6].iter().flatten().all(Vec::is_empty));
        assert_eq!(found[6].concat(), [0.0; 12]); // the centre of mass, its velocity, and the momentum
    }
}

/// Checks that a function name given twice is rejected, because compilers would reject the generated code.
#[test]
fn functions_are_named_once() {
    let error = functions(&robots::arm7(), &["aba", "rnea", "aba"], &Settings::default()).unwrap_err();
    assert!(matches!(&error, Error::Twice { name } if name == "aba"), "{error}");
    assert_eq!(error.to_string(), "aba: named twice");
}

/// Computes a function that a user could write: a cost with selections, angles and square roots. The test computes the
/// cost's Jacobian with dual numbers.
fn own<S: Scalar>(q: &[S], tool: Vec3<S>) -> Vec<S> {
    let reach = (tool.x * tool.x + tool.y * tool.y).sqrt();
    let is_low = tool.z.lt(S::splat(0.4));
    let is_near = reach.lt(S::splat(0.3));
    let penalty = S::select(S::or(is_low, is_near), S::splat(0.4) - tool.z, S::zero());
    let both = S::select(S::and(is_low, is_near), reach, S::splat(2.0));
    vec![penalty * penalty + both, tool.y.atan2(tool.x), q[1].abs() * S::splat(3.0)]
}

/// Checks the loops for adjacent entries of a result. The function has products of a matrix and a vector, sums that
/// begin with another product, and a copy of an entry.
#[test]
fn entries_that_are_alike_are_computed_in_loops() {
    let function = record("alike", "Products with a matrix of squares.", |r| {
        let x = r.input("k", 6, "six numbers");
        let M: Vec<Vec<_>> = (0..6).map(|i| (0..3).map(|j| x[i] * x[i] + x[j]).collect()).collect();
        let product =
            |y: &[_]| -> Vec<_> { M.iter().map(|row| row[0] * y[0] + row[1] * y[1] - row[2] * y[2]).collect() };
        let (one, other) = (product(&x[..3]), product(&x[3..]));
        r.output("one", &one, "a product");
        let sines: Vec<_> = x.iter().map(|x| x.sin_cos().0).collect();
        let value = |(i, y): (usize, _)| sines[i] * x[i] + y;
        let values: Vec<_> = M.iter().enumerate().map(|(i, row)| value((i, row[1] * x[2])) + row[0] * x[4]).collect();
        r.output("other", &[&other[..], &one[2..3]].concat(), "another one, and a number of the first");
        r.output("values", &values, "sums that begin with other products");
    });
    let all = [function];
    let text = &Language::C.text("k", &all)[1].text;
    assert_eq!(text.matches("for (int k_ = 0; k_ < 6; k_++)").count(), 2, "{text}");
    let x: Vec<f64> = (1..=6).map(|x| f64::from(x).sin()).collect();
    let expected = all[0].evaluate(&[&x]);
    let mut programs = Vec::new();
    if is_there("cc") {
        programs.push((Program::c(&folder("alike_c"), &all, Language::C, &["-O3"]), 1));
        programs.push((Program::c(&folder("alike_c8"), &all, Language::CEight, &["-O3"]), 8));
    }
    if is_there("rustc") {
        programs.push((Program::rust(&folder("alike_rust"), &all, false), 1));
    }
    for (program, lanes) in &programs {
        let inputs = x.iter().flat_map(|&x| vec![x; *lanes]).collect();
        let found = &program.run(&[vec![inputs]])[0];
        let found: Vec<Vec<f64>> = found.iter().map(|y| y.iter().copied().step_by(*lanes).collect()).collect();
        assert_equal("compiled", &all[0], &found, &expected, ROUNDING);
    }
}

#[test]
fn functions_of_ones_own_with_their_derivatives() {
    let arm = robots::arm7();
    let tool = arm.frame("tool").unwrap();
    let function = record("own", "A cost, an angle and a magnitude, with their Jacobian.", |r| {
        let q = r.input("q", 7, "position (rad)");
        let mut data = Data::new(&arm);
        let of = |q: &[_]| own(q, forward_kinematics(&arm, &mut data, q).frame(tool).translation);
        let (y, dy) = condyle_codegen::jacobian(&arm, &q, of);
        r.output("y", &y, "values");
        r.matrix("dy", &dy, "Jacobian");
    });
    let all = [function];
    let mut programs = Vec::new();
    if is_there("cc") {
        programs.push((Program::c(&folder("own_c"), &all, Language::C, &["-O1", "-fsanitize=undefined"]), 1));
        programs.push((Program::c(&folder("own_c4"), &all, Language::CFour, &["-O1"]), 4));
    }
    if is_there("rustc") {
        programs.push((Program::rust(&folder("own_rust"), &all, false), 1));
    }
    let mut rng = StdRng::seed_from_u64(5);
    let mut choices = [0, 0];
    for _ in 0..20 {
        let q: Vec<f64> = (0..7).map(|_| rng.random_range(-2.0..2.0)).collect();
        let mut data = Data::new(&arm);
        let of = |q: &[Dual64]| own(q, forward_kinematics(&arm, &mut data, q).frame(tool).translation);
        let (y, dy) = condyle_dynamics::jacobian(&arm, &q, of);
        choices[usize::from(y[0] == 2.0)] += 1;
        let expected = [y.as_slice().to_vec(), matrix(&dy)];
        let recorded = all[0].evaluate(&[&q]);
        assert_equal("recorded", &all[0], &recorded, &expected, ROUNDING);
        for (program, lanes) in &programs {
            let inputs = q.iter().flat_map(|&x| vec![x; *lanes]).collect();
            let found = &program.run(&[vec![inputs]])[0];
            let found: Vec<Vec<f64>> =
                found.iter().map(|array| array.iter().copied().step_by(*lanes).collect()).collect();
            assert_equal("compiled", &all[0], &found, &expected, ROUNDING);
        }
    }
    assert!(choices.iter().all(|&n| n > 0), "both sides of the choices are met: {choices:?}");
}

#[test]
fn the_text_is_the_same_every_time() {
    let quadruped = robots::quadruped();
    let text = || {
        let all = functions(&quadruped, &["aba_derivatives", "rnea"], &Settings::default()).unwrap();
        [Language::C, Language::Rust, Language::CudaFloat].map(|language| language.text("quadruped", &all))
    };
    assert_eq!(text(), text());
}

/// Checks the rows about generated code in the table of `docs/complexity.md`.
#[test]
fn the_book_has_these_figures() {
    let page = include_str!("../../../docs/complexity.md");
    let rows = ["rnea", "nonlinear_effects", "crba", "aba", "minv"].map(|name| {
        let counts = [robots::arm7(), robots::quadruped(), robots::humanoid()].map(|model| {
            let found = functions(&model, &[name], &Settings::default()).expect("the library has this function");
            found[0].operations().flops().to_string()
        });
        format!("| `{name}`, generated | {} |", counts.join(" | "))
    });
    let missing: Vec<&String> = rows.iter().filter(|row| !page.contains(&row[..])).collect();
    assert!(missing.is_empty(), "docs/complexity.md: expected the rows {missing:#?}");
}
