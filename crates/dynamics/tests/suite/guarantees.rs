//! Tests of guarantees of models and of every function. Functions have no hidden state, and their panics name the
//! argument.

use crate::common;

use common::table::{Input, Output, functions, has_data, in_step};
use common::{all_models, embedded, fixed, rng};
use condyle_dynamics::{
    Data, DifferenceArgument, DivideConquer, Error, Force, Inertia, IntegrateArgument, Joint, Model, ModelBuilder,
    ReferenceFrame, Se3, Sym3, Vec3, WORLD, aba, aba_derivatives, crba, difference, difference_jacobian,
    forward_kinematics, gravity, integrate, integrate_jacobian, minv, neutral, nonlinear_effects, rnea,
    rnea_derivatives, robots,
};
use nalgebra::DMatrix;
use num_dual::Dual64;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Checks that a function gives the same bits after any earlier calls with the same `Data`, even if these calls
/// computed NaN.
#[test]
fn no_hidden_order() {
    for (seed, model) in all_models(3).iter().enumerate() {
        let mut rng = rng(seed as u64);
        let (input, other) = (Input::<f64>::random(model, &mut rng), Input::random(model, &mut rng));
        let broken = other.map(|_| f64::NAN);
        let (mut data, mut output) = (Data::new(model), Output::new(model));
        for (name, function) in functions() {
            let mut fresh = Output::new(model);
            function(model, &mut Data::new(model), &input, &mut fresh);
            assert!(fresh.numbers.iter().all(|x| x.is_finite()), "{name} leaves something unfilled");
            assert!(!in_step(name) || fresh.numbers.last() == Some(&1.0), "{name} takes no step, on\n{model}");
            for before in [&other, &broken] {
                for (earlier, first) in functions() {
                    first(model, &mut data, before, &mut output);
                    output.numbers.clear();
                    function(model, &mut data, &input, &mut output);
                    assert!(output.numbers == fresh.numbers, "{name} after {earlier}, on\n{model}");
                    output.numbers.clear();
                }
            }
        }
    }
}

/// Checks robots with only fixed joints, which have no coordinates. All other results of every function must be finite.
/// The exception is the centre of mass of the moving bodies: without moving bodies, it is NaN, as documented.
#[test]
fn robots_without_coordinates() {
    const CENTRE_OF_MASS: [&str; 6] = [
        "forward_velocities",
        "forward_accelerations",
        "centroidal_map",
        "centroidal_map_rate",
        "compute_all_terms",
        "centroidal_derivatives",
    ];
    let nothing = ModelBuilder::new("nothing").build().unwrap();
    for model in &[fixed(), nothing] {
        let input = Input::<f64>::random(model, &mut rng(0));
        assert!(input.q.is_empty() && input.v.is_empty());
        for (name, function) in functions() {
            let (mut data, mut output) = (Data::new(model), Output::new(model));
            function(model, &mut data, &input, &mut output);
            let has_com = CENTRE_OF_MASS.contains(&name);
            assert!(has_com || output.numbers.iter().all(|x| x.is_finite()), "{name}, on\n{model}");
            assert!(!in_step(name) || output.numbers == [1.0], "{name} takes no step, on\n{model}");
        }
        let mut divided = DivideConquer::<f64>::new(model, 1);
        assert!(divided.aba(model, &[], &[], &[], &input.f_ext).is_empty());
        assert!(neutral(model).is_empty());
        assert!(model.with_inertias(|_, I| I.scale(2.0)).unwrap().total_mass().is_finite());
    }
}

/// Returns the message of a call's panic.
fn message(call: impl FnOnce()) -> String {
    let panic = catch_unwind(AssertUnwindSafe(call)).expect_err("the call panics");
    panic.downcast_ref::<String>().cloned().expect("the message has numbers in it")
}

/// Passes each argument of each function with one number too few or too many. The panic must name the argument.
#[test]
fn wrong_lengths_name_the_argument() {
    let model = &robots::quadruped(); // nq 19, nv 18, 14 bodies including the world
    let data = &mut Data::<f64>::new(model);
    let (q, v, f) = (neutral(model), vec![0.0; 18], vec![Force::zero(); 14]);
    let (short_q, short_v, short_f) = (&q[1..], &v[1..], &f[1..]);
    let (q, v) = (&q[..], &v[..]);
    let expect = |what: &str, found: String| assert_eq!(found, what);
    let (bad_q, bad_v) = ("q: expected 19 numbers, found 18", "v: expected 18 numbers, found 17");
    let (bad_a, bad_tau) = ("a: expected 18 numbers, found 17", "tau: expected 18 numbers, found 17");
    let bad_f = "f_ext: expected no force or 14 (one for each body), found 13";
    let bad_J = "J: expected 18 × 18, found (18, 17)";

    expect(bad_q, message(|| drop(rnea(model, data, short_q, v, v, &f).to_vec())));
    expect(bad_v, message(|| drop(rnea(model, data, q, short_v, v, &f).to_vec())));
    expect(bad_a, message(|| drop(rnea(model, data, q, v, short_v, &f).to_vec())));
    expect(bad_f, message(|| drop(rnea(model, data, q, v, v, short_f).to_vec())));
    expect(bad_q, message(|| drop(nonlinear_effects(model, data, short_q, v).to_vec())));
    expect(bad_v, message(|| drop(nonlinear_effects(model, data, q, short_v).to_vec())));
    expect(bad_q, message(|| drop(gravity(model, data, short_q).to_vec())));
    expect(bad_q, message(|| drop(crba(model, data, short_q).clone())));
    expect(bad_q, message(|| drop(minv(model, data, short_q).clone())));
    expect(bad_q, message(|| drop(aba(model, data, short_q, v, v, &f).to_vec())));
    expect(bad_v, message(|| drop(aba(model, data, q, short_v, v, &f).to_vec())));
    expect(bad_tau, message(|| drop(aba(model, data, q, v, short_v, &f).to_vec())));
    expect(bad_f, message(|| drop(aba(model, data, q, v, v, short_f).to_vec())));
    expect(bad_q, message(|| _ = rnea_derivatives(model, data, short_q, v, v, &f)));
    expect(bad_v, message(|| _ = rnea_derivatives(model, data, q, short_v, v, &f)));
    expect(bad_a, message(|| _ = rnea_derivatives(model, data, q, v, short_v, &f)));
    expect(bad_f, message(|| _ = rnea_derivatives(model, data, q, v, v, short_f)));
    expect(bad_q, message(|| _ = aba_derivatives(model, data, short_q, v, v, &f)));
    expect(bad_v, message(|| _ = aba_derivatives(model, data, q, short_v, v, &f)));
    expect(bad_tau, message(|| _ = aba_derivatives(model, data, q, v, short_v, &f)));
    expect(bad_f, message(|| _ = aba_derivatives(model, data, q, v, v, short_f)));
    expect(bad_q, message(|| _ = forward_kinematics(model, data, short_q)));
    let placements = forward_kinematics(model, data, q);
    let six = &mut DMatrix::zeros(6, 17);
    expect("J: expected 6 × 18, found (6, 17)", message(|| placements.frame_jacobian(0, ReferenceFrame::World, six)));

    let (out_q, out_v) = (&mut [0.0; 19], &mut [0.0; 18]);
    expect(bad_q, message(|| integrate(model, short_q, v, out_q)));
    expect(bad_v, message(|| integrate(model, q, short_v, out_q)));
    expect("out: expected 19 numbers, found 18", message(|| integrate(model, q, v, out_v)));
    expect("q0: expected 19 numbers, found 18", message(|| difference(model, short_q, q, out_v)));
    expect("q1: expected 19 numbers, found 18", message(|| difference(model, q, short_q, out_v)));
    expect("out: expected 18 numbers, found 19", message(|| difference(model, q, q, out_q)));
    let (square, narrow) = (&mut DMatrix::zeros(18, 18), &mut DMatrix::zeros(18, 17));
    for argument in [IntegrateArgument::Position, IntegrateArgument::Velocity] {
        expect(bad_v, message(|| integrate_jacobian(model, short_v, argument, square)));
        expect(bad_J, message(|| integrate_jacobian(model, v, argument, narrow)));
    }
    for argument in [DifferenceArgument::From, DifferenceArgument::To] {
        let bad_d = "d: expected 18 numbers, found 17";
        expect(bad_d, message(|| difference_jacobian(model, short_v, argument, square)));
        expect(bad_J, message(|| difference_jacobian(model, v, argument, narrow)));
    }
    let bad_armature = "armature: expected 18 numbers, found 17";
    expect(bad_armature, message(|| drop(robots::quadruped().with_armature(short_v))));
}

/// Checks that every function that takes a `Data` panics if the `Data` was made for another robot.
#[test]
fn data_of_another_model() {
    let [arm, quadruped, humanoid] = embedded();
    for (model, other) in [(&arm, &quadruped), (&quadruped, &arm), (&humanoid, &quadruped)] {
        let mut data = Data::<f64>::new(other);
        let input = Input::random(model, &mut rng(0));
        for (name, function) in functions() {
            if !has_data(name) {
                continue;
            }
            let found = message(|| function(model, &mut data, &input, &mut Output::new(model)));
            assert!(found.starts_with("data: made for a model of"), "{name}: {found}");
        }
    }
}

/// Checks that a `Data` is also rejected if the robots have different trees but equal numbers of bodies, columns and
/// coordinates.
#[test]
fn data_of_another_tree() {
    let robot = |parents: [usize; 3]| {
        let mut builder = ModelBuilder::new("tree");
        let mut ids = vec![WORLD];
        for (i, parent) in parents.into_iter().enumerate() {
            let inertia = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1));
            let joint = Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) };
            ids.push(builder.body(&format!("b{i}"), ids[parent], joint, Se3::identity(), inertia));
        }
        builder.build().unwrap()
    };
    let (chain, fork) = (robot([0, 1, 2]), robot([0, 1, 1]));
    let found = message(|| drop(minv(&fork, &mut Data::new(&chain), &[0.0; 3]).clone()));
    let sizes = "(4, 3, 3) bodies, joint axes and coordinates, found (4, 3, 3)";
    assert_eq!(found, format!("data: made for a model of {sizes} in another tree"));
    // A `Data` is accepted for the same tree with other constants.
    let heavy = chain.with_inertias(|_, I| I.scale(2.0)).unwrap();
    minv(&heavy, &mut Data::new(&chain), &[0.0; 3]);
    assert_eq!(heavy.total_mass(), 2.0 * chain.total_mass());
}

#[test]
fn models_are_shared_between_threads() {
    fn shared<T: Send + Sync + Clone>() {}
    shared::<Model>();
    shared::<Model<num_dual::Dual64>>();
    shared::<Data<f64>>();
    let model = robots::humanoid();
    let expected = minv(&model, &mut Data::<f64>::new(&model), &neutral(&model)).clone();
    std::thread::scope(|scope| {
        let threads =
            [(); 4].map(|()| scope.spawn(|| minv(&model, &mut Data::<f64>::new(&model), &neutral(&model)).clone()));
        threads.into_iter().for_each(|thread| assert_eq!(thread.join().unwrap(), expected));
    });
}

/// Checks that a robot stored as JSON and read again has the same bits, with and without limits. (JSON has no
/// infinity.)
#[test]
fn serde_round_trip() {
    for (seed, model) in all_models(3).iter().enumerate() {
        let text = serde_json::to_string(model).unwrap();
        let back: Model = serde_json::from_str(&text).unwrap();
        assert_eq!(back.to_string(), model.to_string());
        assert_eq!(back.limits(), model.limits());
        let input = Input::<f64>::random(model, &mut rng(seed as u64));
        for (name, function) in functions() {
            let outputs = [model, &back].map(|model| {
                let mut output = Output::new(model);
                function(model, &mut Data::new(model), &input, &mut output);
                output.numbers
            });
            assert!(outputs[0] == outputs[1], "{name}, on\n{model}");
        }
    }
}

#[test]
fn names() {
    let arm = robots::arm7();
    assert_eq!(arm.joint("joint3").unwrap(), 3);
    assert_eq!(arm.bodies()[3].joint_name, "joint3");
    assert_eq!(arm.joint("jiont3").unwrap_err().to_string(), "unknown joint `jiont3`; nearest is `joint3`");
    let error = arm.frame("toll").unwrap_err();
    assert_eq!(error.to_string(), "unknown frame `toll`; nearest is `tool`");
    assert!(matches!(error, Error::UnknownFrame { .. }));
    let error = arm.frame("gripper").unwrap_err();
    assert_eq!(error.to_string(), "unknown frame `gripper`; no frame has a similar name");
    assert_eq!(arm.frames()[arm.frame("base").unwrap()].body, 0);
}

/// Checks that threads can share models, that a `Data` can move to another thread, and that both types can be cloned.
#[test]
fn types_are_cloned_and_cross_threads() {
    use condyle_dynamics::{Batch, BatchConstraints, ConstraintSet, Data, DivideConquer, Matrices, Model, StateMatrix};
    fn check<T: Clone + Send + Sync>() {}
    check::<Model>();
    check::<Model<Dual64>>();
    check::<Data<f64>>();
    check::<Data<Dual64>>();
    check::<ConstraintSet<f64>>();
    check::<DivideConquer<f64>>();
    check::<Batch>();
    check::<BatchConstraints>();
    check::<Matrices<'_, f64>>();
    check::<StateMatrix<'_, f64>>();
}
