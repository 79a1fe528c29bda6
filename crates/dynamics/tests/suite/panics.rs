//! Tests of panics for mistakes of the caller. Each panic must name the mistake and report a line of the caller's file.

use crate::common::panics::{Panic, assert_panic, panic_of};
use crate::common::rng;
use crate::common::table::{Input, Output, functions};
use condyle_dynamics::ReferenceFrame::World;
use condyle_dynamics::{
    Batch, Cholesky, ConstraintSet, ContactConstraint, Data, DivideConquer, Force, Ltdl, Mimic, ModelBuilder,
    ProximalSettings, Scalar, Se3, Target, aba, aba_derivatives, body_jacobian, compute_all_terms,
    constrained_dynamics, forward_accelerations, forward_kinematics, frame_jacobian, jacobian, rnea, rnea_derivatives,
    robots,
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::fs;
use std::path::{Path, PathBuf};

/// Last components of this file's path, as a panic reports it.
const HERE: &str = "tests/suite/panics.rs";

/// Functions that have no argument with a variable length.
const WITHOUT_LENGTHS: &[&str] = &["log-Cholesky parameters"];

/// Arguments (function, name) that `common/table.rs` copies to a matrix of nalgebra. If such an argument has a wrong
/// length, nalgebra panics during the copy.
const COPIED: &[(&str, &str)] = &[("transport", "x")];

/// Calls every function of `common/table.rs` with one number too few in each argument.
fn wrong_lengths<S: Scalar>() {
    for model in [robots::arm7(), robots::quadruped()] {
        let right = Input::<S>::random(&model, &mut rng(1));
        for (name, function) in functions::<S>() {
            let mut panics = 0;
            for argument in ["q", "q1", "v", "x", "f_ext"] {
                if COPIED.contains(&(name, argument)) {
                    continue;
                }
                let mut input = right.clone();
                match argument {
                    "q" => drop(input.q.pop()),
                    "q1" => drop(input.q1.pop()),
                    "v" => drop(input.v.pop()),
                    "x" => drop(input.x.pop()),
                    _ => drop(input.f_ext.pop()),
                }
                let (mut data, mut output) = (Data::new(&model), Output::new(&model));
                if let Some(Panic { file, message, .. }) = panic_of(|| function(&model, &mut data, &input, &mut output))
                {
                    let called = file.ends_with("common/table.rs");
                    assert!(called, "{name}, {argument} too short: {message:?} is reported in {file}");
                    panics += 1;
                }
            }
            assert!(panics > 0 || WITHOUT_LENGTHS.contains(&name), "{name} accepts every length");
        }
    }
}

#[test]
fn wrong_lengths_are_reported_at_the_call() {
    wrong_lengths::<f64>();
}

#[test]
fn wrong_lengths_of_dual_numbers_are_reported_at_the_call() {
    wrong_lengths::<Dual64>();
}

/// Checks that a panic for a missing body or frame names its index.
#[test]
fn missing_bodies_and_frames_are_named() {
    let arm = robots::arm7();
    let (q, v, data) = ([0.3; 7], [0.1; 7], &mut Data::<f64>::new(&arm));
    let (bodies, frames) = (arm.bodies().len(), arm.frames().len());
    let body = format!("body: expected an index below {bodies}, the number of bodies, found 1000");
    let frame = format!("frame: expected an index below {frames}, the number of frames, found 1000");
    let (J, other) = (&mut DMatrix::zeros(6, 7), &mut DMatrix::zeros(6, 7));
    let n = 1000;
    assert_panic(HERE, &frame, || frame_jacobian(&arm, &q, n, World, J));
    assert_panic(HERE, &body, || body_jacobian(&arm, &q, n, World, J));
    let drift = compute_all_terms(&arm, data, &q, &v);
    assert_panic(HERE, &frame, || _ = drift.frame_drift(n));
    let placed = forward_kinematics(&arm, data, &q);
    assert_panic(HERE, &body, || _ = placed.body(n));
    assert_panic(HERE, &frame, || _ = placed.frame(n));
    assert_panic(HERE, &frame, || {
        _ = forward_kinematics(&arm, &mut Data::<Dual64>::new(&arm), &[0.3.into(); 7]).frame(n)
    });
    assert_panic(HERE, &body, || placed.body_jacobian(n, World, J));
    assert_panic(HERE, &frame, || placed.frame_jacobian(n, World, J));
    assert_panic(HERE, &body, || placed.add_body_efforts(n, Force::zero(), &mut [0.0; 7]));
    assert_panic(HERE, "tau: expected 7 numbers, found 6", || {
        placed.add_body_efforts(0, Force::zero(), &mut [0.0; 6]);
    });
    let moving = forward_accelerations(&arm, data, &q, &v, &v);
    assert_panic(HERE, &frame, || _ = moving.frame(n));
    assert_panic(HERE, &body, || _ = moving.body_velocity(n, World));
    assert_panic(HERE, &frame, || _ = moving.frame_velocity(n, World));
    assert_panic(HERE, &body, || _ = moving.body_acceleration(n, World));
    assert_panic(HERE, &frame, || _ = moving.frame_acceleration(n, World));
    assert_panic(HERE, &body, || _ = moving.body_classical_acceleration(n, World));
    assert_panic(HERE, &frame, || _ = moving.frame_classical_acceleration(n, World));
    assert_panic(HERE, &body, || moving.body_jacobian_rate(n, World, J));
    assert_panic(HERE, &frame, || moving.frame_jacobian_rate(n, World, J));
    assert_panic(HERE, &body, || moving.body_velocity_derivative(n, World, J));
    assert_panic(HERE, &frame, || moving.frame_velocity_derivative(n, World, J));
    assert_panic(HERE, &body, || moving.body_acceleration_derivatives(n, World, J, other));
    assert_panic(HERE, &frame, || moving.frame_acceleration_derivatives(n, World, J, other));
    assert_panic(HERE, &frame, || moving.frame_classical_acceleration_derivatives(n, World, J, other));
    let (point, three) = (condyle_dynamics::Vec3::zero(), &mut DMatrix::zeros(3, 7));
    assert_panic(HERE, &body, || moving.body_point_jacobian(n, point, three));
    assert_panic(HERE, &frame, || moving.frame_point_jacobian(n, point, three));
    assert_panic(HERE, &body, || _ = moving.body_point_velocity(n, point));
    assert_panic(HERE, &frame, || _ = moving.frame_point_velocity(n, point));
    assert_panic(HERE, &body, || _ = moving.force_on_body(n, point, point));
    let small = &mut DMatrix::zeros(5, 7);
    assert_panic(HERE, "da_dv: expected 6 × 7", || moving.frame_acceleration_derivatives(1, World, J, small));
    assert_panic(HERE, "dJ: expected 6 × 7", || moving.frame_jacobian_rate(1, World, small));
}

/// Checks that other invalid arguments of functions are reported at the line of the call.
#[test]
fn other_mistakes_are_reported_at_the_call() {
    let (arm, quadruped) = (robots::arm7(), robots::quadruped());
    let (q, v, data) = ([0.3; 7], [0.1; 7], &mut Data::<f64>::new(&arm));
    assert_panic(HERE, "data: made for a model of", || _ = rnea(&arm, &mut Data::new(&quadruped), &q, &v, &v, &[]));
    let contact = ContactConstraint::point(1);
    let mut set = ConstraintSet::<f64>::new(&arm, &[contact]).unwrap();
    let mut of_another = ConstraintSet::<f64>::new(&quadruped, &[contact]).unwrap();
    assert_panic(HERE, "constraints: made for another model", || {
        _ = constrained_dynamics(&arm, data, &mut of_another, &q, &v, &v, &[]);
    });
    let one = "k: expected an index below 1, the number of constraints, found 1";
    assert_panic(HERE, one, || _ = set.range(1));
    assert_panic(HERE, one, || _ = set.force(1));
    assert_panic(HERE, one, || _ = set.target(1));
    assert_panic(HERE, one, || _ = set.set_target(1, Target::identity()));
    assert_panic(HERE, "J: expected 3 × 7", || set.jacobian(&mut DMatrix::zeros(2, 7)));

    let d = rnea_derivatives(&arm, data, &q, &v, &v, &[]);
    let input = "input: expected an index below 8, the number of bodies, found 8";
    let (six, ten) = (&mut DMatrix::zeros(7, 6), &mut DMatrix::zeros(7, 10));
    assert_panic(HERE, input, || d.with_respect_to(condyle_dynamics::Input::Force(8), six));
    assert_panic(HERE, input, || d.with_respect_to(condyle_dynamics::Input::Inertia(8), ten));
    assert_panic(HERE, "the world has no inertia", || d.with_respect_to(condyle_dynamics::Input::Inertia(0), ten));
    let d = aba_derivatives(&arm, data, &q, &v, &v, &[]);
    assert_panic(HERE, input, || d.with_respect_to(condyle_dynamics::Input::Force(8), six));

    let (mut sparse, mut dense) = (Ltdl::<f64>::new(&arm), Cholesky::<f64>::new(7));
    assert_panic(HERE, "M: expected 7 × 7", || sparse.factorize(six));
    assert_panic(HERE, "M: expected 7 × 7", || dense.factorize(six));
    assert_panic(HERE, "b: expected 7 numbers", || sparse.solve(&mut [0.0; 6]));
    assert_panic(HERE, "b: expected 7 numbers", || dense.solve(&mut [0.0; 6]));
    assert_panic(HERE, "X: expected 7 × 7", || sparse.inverse(six));
    assert_panic(HERE, "X: expected 7 × 7", || dense.inverse(six));
    assert_panic(HERE, "k: expected an index below 7, the number of rows, found 7", || _ = sparse.row(7).count());

    let mut divided = DivideConquer::<f64>::new(&arm, 1);
    assert_panic(HERE, "tau: expected 7 numbers", || _ = divided.aba(&arm, &q, &v, &[0.0; 6], &[]));
    assert_panic(HERE, "model: planned for", || _ = divided.aba(&quadruped, &q, &v, &v, &[]));
    assert_panic(HERE, "x: expected at least 7 numbers", || _ = jacobian(&arm, &[0.0; 6], <[Dual64]>::to_vec));

    let here = Se3::identity();
    assert_panic(HERE, "bodies: expected an index below 8", || _ = arm.lock(&[8], &q));
    assert_panic(HERE, "the world, body 0, has no joint", || _ = arm.lock(&[0], &q));
    assert_panic(HERE, "body: expected an index below 8", || _ = arm.append(8, here, &quadruped, ""));
    let mimic = Mimic { ratio: 1.0, offset: 0.0 };
    assert_panic(HERE, "leader: expected an index below 8", || _ = arm.with_mimic(1, 8, mimic));
    assert_panic(HERE, "q: expected 7 numbers", || _ = arm.check_position(&[0.0; 8]));
    assert_panic(HERE, "armature: expected 7 numbers", || _ = arm.clone().with_armature(&[0.0; 8]));
    assert_panic(HERE, "joints: expected at least one", || {
        ModelBuilder::new("r").chain("c", condyle_dynamics::WORLD, &[], condyle_dynamics::Inertia::zero());
    });
}

/// Checks that invalid arguments of the functions of a batch, and of functions of its results, are reported at the line
/// of the call.
#[test]
fn mistakes_with_batches_are_reported_at_the_call() {
    let arm = robots::arm7();
    let (q, v) = ([0.3; 14], [0.1; 14]);
    assert_panic(HERE, "threads: expected at least 1", || _ = Batch::<f64>::new(&arm, 2, 0));
    let mut batch = Batch::<f64>::new(&arm, 2, 1);
    let n = 1000;
    let body = "body: expected an index below 8, the number of bodies, found 1000";
    let frame = format!("frame: expected an index below {}, the number of frames, found 1000", arm.frames().len());
    assert_panic(HERE, &frame, || _ = batch.frame_placement(&arm, &q, n));
    assert_panic(HERE, &frame, || _ = batch.frame_jacobian(&arm, &q, n, World));
    assert_panic(HERE, body, || _ = batch.body_jacobian(&arm, &q, n, World));
    assert_panic(HERE, body, || _ = batch.body_velocity(&arm, &q, &v, n, World));
    assert_panic(HERE, &frame, || _ = batch.frame_acceleration_derivatives(&arm, &q, &v, &v, n, World));
    assert_panic(HERE, "input: expected an index below 8", || {
        _ = batch.rnea_input_derivative(&arm, &q, &v, &v, &[], condyle_dynamics::Input::Force(8));
    });
    assert_panic(HERE, "smoothing: expected a positive speed", || _ = batch.passive_torque(&arm, &q, &v, 0.0));
    assert_panic(HERE, "tau: expected 14 numbers", || _ = batch.aba(&arm, &q, &v, &[0.0; 13], &[]));
    assert_panic(HERE, "to[0]: expected length 98", || batch.writer(&mut [&mut [0.0; 97]]).crba(&arm, &q));

    let mut constraints = batch.constraints(&arm, &[ContactConstraint::point(1)], ProximalSettings::default()).unwrap();
    let one = "k: expected an index below 1, the number of constraints, found 1";
    assert_panic(HERE, one, || _ = constraints.range(1));
    assert_panic(HERE, one, || _ = constraints.set_target(1, Target::identity()));

    let poses = batch.forward_kinematics(&arm, &q);
    assert_panic(HERE, "k: expected an index below 2, the number of states, found 2", || _ = poses.at(2, 0));
    assert_panic(HERE, "i: expected an index below 8, the number of poses of a state, found 8", || _ = poses.at(0, 8));
    let all = batch.crba(&arm, &q);
    assert_panic(HERE, "k: expected an index below 2, the number of states, found 2", || _ = all.at(2));
    assert_panic(HERE, "to: expected 98 numbers", || all.write_rows(&mut [0.0; 97]));
    let M = all.at(1);
    assert_panic(HERE, "entry (7, 0): expected a row below 7 and a column below 7", || _ = M[(7, 0)]);
    assert_panic(HERE, "the block of 1 × 7 entries at (7, 0)", || _ = M.row(7));
    assert_panic(HERE, "the block of 7 × 1 entries at (0, 7)", || _ = M.column(7));
    assert_panic(HERE, "the block of 2 × 7 entries at (6, 0)", || _ = M.rows(6, 2));
    let six = DVector::<f64>::zeros(6);
    let product = "x: expected 7 rows for a product with a matrix of 7 × 7, found 6";
    assert_panic(HERE, product, || _ = M * &six);
    assert_panic(HERE, product, || _ = M * [0.0; 6].as_slice());
    assert_panic(HERE, product, || _ = M * M.rows(0, 6));
    assert_panic(HERE, product, || M.mul_to(&six, &mut DVector::zeros(7)));
    assert_panic(HERE, "out: expected 7 × 1", || M.mul_to(&DVector::zeros(7), &mut six.clone()));
    assert_panic(HERE, product, || M.mul_vector_to(&[0.0; 6], &mut [0.0; 7]));
    assert_panic(HERE, "found 7", || _ = DMatrix::<f64>::zeros(3, 6) * M);
    assert_panic(HERE, "found one of 6 × 7", || _ = M - DMatrix::zeros(6, 7));
    assert_panic(HERE, "to: expected 7 × 7, found 6 × 7", || M.copy_to(&mut DMatrix::zeros(6, 7)));
    assert_panic(HERE, "to: expected 49 numbers", || M.write_rows(&mut [0.0; 48]));
}

/// Checks that a robot with a singular inertia matrix is reported at the line of the call, also by a batch.
#[test]
fn singular_robots_are_reported_at_the_call() {
    use condyle_dynamics::{Inertia, Joint, WORLD};
    let mut builder = ModelBuilder::new("light");
    builder.body("tip", WORLD, Joint::Prismatic { axis: [0.0, 0.0, 1.0].into() }, Se3::identity(), Inertia::zero());
    let light = builder.build().unwrap();
    let nothing = "joint `tip` moves nothing";
    assert_panic(HERE, nothing, || _ = aba(&light, &mut Data::<f64>::new(&light), &[0.0], &[0.0], &[0.0], &[]));
    let mut batch = Batch::<f64>::new(&light, 2, 1);
    assert_panic(HERE, nothing, || _ = batch.aba(&light, &[0.0; 2], &[0.0; 2], &[0.0; 2], &[]));
    assert_panic(HERE, nothing, || _ = batch.minv(&light, &[0.0; 2]));
    assert_panic(HERE, nothing, || _ = batch.aba_derivatives(&light, &[0.0; 2], &[0.0; 2], &[0.0; 2], &[]));
    _ = batch.crba(&light, &[0.0; 2]);
}

/// Folders and files with internal functions. Their callers have already checked the arguments.
const KERNELS: [&str; 4] =
    ["spatial/src/simd/", "linalg/src/outer.rs", "linalg/src/runs.rs", "linalg/src/threads/parts.rs"];

/// Checks that every public function with documented panics has `#[track_caller]`. A panic then reports the caller's
/// line.
#[test]
fn functions_that_panic_track_their_callers() {
    let mut without = Vec::new();
    for name in ["spatial", "linalg", "model", "dynamics"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src");
        for file in sources(&folder) {
            let path = file.display().to_string().replace('\\', "/");
            if KERNELS.iter().any(|kernel| path.contains(kernel)) {
                continue;
            }
            let text = fs::read_to_string(&file).unwrap();
            let lines: Vec<&str> = text.lines().map(str::trim).collect();
            for (k, line) in lines.iter().enumerate().filter(|(_, line)| line.starts_with("pub fn ")) {
                let above = |line: &&&str| line.starts_with("///") || line.starts_with("#[");
                let above: Vec<_> = lines[..k].iter().rev().take_while(above).collect();
                if above.contains(&&"/// # Panics") && !above.contains(&&"#[track_caller]") {
                    without.push(format!("{path}:{}: {line}", k + 1));
                }
            }
        }
    }
    assert!(without.is_empty(), "without #[track_caller]:\n{}", without.join("\n"));
}

/// Returns the Rust files of a folder and of all its subfolders.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let files = files.into_iter().filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    files.chain(folders.iter().flat_map(|folder| sources(folder))).collect()
}

#[test]
fn mistakes_with_simulations_and_scratch_are_reported_at_the_call() {
    use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
    let arm = robots::arm7();
    for integrator in [Integrator::SemiImplicitEuler, Integrator::RungeKutta4, Integrator::Variational] {
        let settings = Settings { integrator, passive: Some(0.0), ..Settings::default() };
        assert_panic(HERE, "settings.passive: expected a smoothing above 0, found Some(0.0)", || {
            let _ = Simulation::new(&arm, settings).step(&[0.0; 7], &[]);
        });
    }
    let mut short = [0.0; 3];
    assert_panic(HERE, "tangent: expected 7 numbers, found 3", || {
        condyle_dynamics::interpolate(&arm, &[0.0; 7], &[0.0; 7], 0.5, &mut short, &mut [0.0; 7]);
    });
    assert_panic(HERE, "tangent: expected 7 numbers, found 3", || {
        condyle_dynamics::distance(&arm, &[0.0; 7], &[0.0; 7], &mut [0.0; 3]);
    });
    // A joint that moves no mass makes M singular.
    let massless = crate::validity::massless_tip();
    assert_panic(HERE, "singular", || {
        let _ = Simulation::new(&massless, Settings::default()).step(&vec![0.0; massless.nv()], &[]);
    });
}
