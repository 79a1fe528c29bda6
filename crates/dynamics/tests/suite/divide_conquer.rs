//! Tests of forward dynamics by divide and conquer. This algorithm gives the accelerations of `aba` in O(log n) steps,
//! on any number of threads.

use crate::common;
use crate::counted::{Counted, counted};

use common::{State, Worst, all_models, lift, lift_forces, random_inertia, random_pose, rng, tree};
use condyle_dynamics::{
    BodyId, Data, DivideConquer, Inertia, Joint, JointOptions, Mat3, Mimic, Model, ModelBuilder, Se3, Sym3, Vec3,
    WORLD, aba, robots,
};
use num_dual::Dual64;

/// Tolerance of some hundred rounding errors times the condition number of M. The condition number is 1e2 to 1e5 for
/// the robots. For a chain, the condition number grows with the cube of the length: it is 1e8 for 300 links, and `aba`
/// itself loses as many digits. The error is relative to the largest accelerations, which are the accelerations of the
/// light tips and grow in the same way.
const INVERTED: f64 = 1e-10;
const TREES: u64 = 30;

fn chain(n: usize) -> Model {
    tree(n, false, |i| i - 1)
}

fn shapes(n: usize, floating: bool) -> [Model; 4] {
    [
        tree(n, floating, |i| i - 1),                                                // chain
        tree(n, floating, |i| i / 2),                                                // binary tree
        tree(n, floating, |i| usize::from(i > 1)),                                   // star
        tree(n, floating, |i| if i % 3 == 1 { i.saturating_sub(3) } else { i - 1 }), // caterpillar
    ]
}

fn check(worst: &mut Worst, model: &Model, seed: u64) {
    let State { q, v, tau, f_ext, .. } = State::random(model, &mut rng(seed));
    let mut data = Data::new(model);
    let n = model.bodies().len() - 1;
    for grain in [1, 2, 5, n.div_ceil(2), n] {
        let mut divided = DivideConquer::new(model, grain);
        for f_ext in [&f_ext[..], &[]] {
            let expected = aba(model, &mut data, &q, &v, &tau, f_ext);
            worst.see(model, divided.aba(model, &q, &v, &tau, f_ext), expected);
        }
    }
}

#[test]
fn every_joint_type() {
    let mut worst = Worst::new("divide and conquer on robots and random trees", INVERTED);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        check(&mut worst, model, seed as u64);
    }
}

#[test]
fn chains() {
    let mut worst = Worst::new("divide and conquer on chains", INVERTED);
    for n in (1..=20).chain([31, 32, 33, 64, 100, 127, 200, 300]) {
        check(&mut worst, &chain(n), n as u64);
    }
}

#[test]
fn branches_and_floating_bases() {
    let mut worst = Worst::new("divide and conquer on other shapes", INVERTED);
    for floating in [false, true] {
        for n in [1, 2, 3, 7, 20, 63, 150] {
            for model in shapes(n, floating) {
                check(&mut worst, &model, n as u64);
            }
        }
    }
}

/// Checks a model that consists of several robots fixed to the world.
#[test]
fn a_forest() {
    let mut worst = Worst::new("divide and conquer on forests", INVERTED);
    for n in [2, 9, 40] {
        check(&mut worst, &tree(n, false, |i| if i % 4 == 1 { 0 } else { i - 1 }), n as u64);
    }
}

/// Checks bodies without mass, or with a point mass on the axis of their hinge. Such a body is valid if it carries a
/// body with mass.
#[test]
fn bodies_without_mass() {
    let mut worst = Worst::new("divide and conquer with massless bodies", INVERTED);
    for n in [4, 11, 30, 60] {
        let rng = &mut rng(n);
        let mut builder = ModelBuilder::new("chain");
        let mut last = WORLD;
        for i in 1..=n {
            let axis = Vec3::new(0.0, 1.0, 0.0);
            let inertia = match i % 5 {
                _ if i == n => random_inertia(rng),
                1 => Inertia::zero(),
                2 => Inertia::from_com(1.0, axis.scale(0.3), Sym3::zero()),
                _ => random_inertia(rng),
            };
            last = builder.body(&format!("b{i}"), last, Joint::Revolute { axis }, random_pose(rng), inertia);
        }
        let model = builder.build().expect("a chain is well-formed");
        check(&mut worst, &model, n);
        let size = DivideConquer::<f64>::new(&model, 1).size();
        assert_eq!(size.longest_run, 3, "a massless body, a point mass, and the one below");
    }
}

/// Creates a floating palm with four fingers of four hinges each. The last three hinges of a finger are parallel, and
/// the tips are light. The inertia of a joint's rotor grows from the palm to the tip.
fn hand(rotor: f64) -> Model {
    let inertia = |mass: f64| Inertia::from_com(mass, Vec3::new(0.0, 0.0, 0.02), Sym3::diagonal(1e-4 * mass));
    let at = |y: f64, z: f64| Se3::new(Mat3::identity(), Vec3::new(0.0, y, z));
    let mut builder = ModelBuilder::new("hand");
    let palm = builder.body("palm", WORLD, Joint::FreeFlyer, at(0.0, 0.0), inertia(0.5));
    for finger in 0..4 {
        let mut last = palm;
        for k in 0..4 {
            let axis = if k == 0 { Vec3::new(0.0, 0.0, 1.0) } else { Vec3::new(0.0, 1.0, 0.0) };
            let placement = if k == 0 { at(0.03 * f64::from(finger), 0.1) } else { at(0.0, 0.04) };
            let mass = if k == 3 { 1e-3 } else { 0.05 };
            let options = JointOptions { armature: rotor * f64::from(1 + k), ..JointOptions::default() };
            let name = format!("finger {finger}, joint {k}");
            let joint = Joint::Revolute { axis };
            last = builder.body_with((&name, &name), last, joint, placement, inertia(mass), options);
        }
    }
    builder.build().expect("a hand is well-formed")
}

/// Checks fingers with parallel hinges. The joints between the handles of a piece then have fewer than six degrees of
/// freedom, so the compliance Y of the piece is singular.
#[test]
fn fingers() {
    let mut worst = Worst::new("divide and conquer on hands", INVERTED);
    for rotor in [0.0, 1e-3, 0.1, 0.3] {
        let model = hand(rotor);
        for seed in 0..20 {
            check(&mut worst, &model, seed);
        }
    }
}

/// Creates a chain of n hinges. Every third hinge follows one of two leaders. Bodies selected by `massless` have no
/// inertia.
fn chain_with_followers(n: usize, massless: impl Fn(usize) -> bool) -> Model {
    let rng = &mut rng(n as u64);
    let mut builder = ModelBuilder::new("chain");
    let mut ids: Vec<BodyId> = vec![WORLD];
    for i in 1..=n {
        let axis = Vec3::from(core::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
        let inertia = if massless(i) { Inertia::zero() } else { random_inertia(rng) };
        ids.push(builder.body(&format!("b{i}"), ids[i - 1], Joint::Revolute { axis }, random_pose(rng), inertia));
    }
    for i in (3..=n).step_by(3) {
        builder.mimic(ids[i], ids[1 + i % 2], Mimic { ratio: 0.5 + 0.1 * i as f64, offset: 0.2 });
    }
    builder.build().expect("a chain is well-formed")
}

#[test]
fn chains_with_followers() {
    let mut worst = Worst::new("divide and conquer on chains with followers", INVERTED);
    for n in [3, 4, 7, 20, 50, 100] {
        check(&mut worst, &chain_with_followers(n, |_| false), n as u64);
        check(&mut worst, &chain_with_followers(n, |i| i % 3 == 0), n as u64); // the followers have no mass
        check(&mut worst, &chain_with_followers(n, |i| i < 3), n as u64); // the leaders have no mass
    }
}

/// Checks joints that get inertia only from couplings: massless followers at the tip, and a wheel on a massless arm.
/// Without the gear to the leader, the arm could turn without moving any mass.
#[test]
fn followers_without_inertia() {
    let axis = Vec3::new(0.0, 0.0, 1.0);
    let hinge = Joint::Revolute { axis };
    let ball = Inertia::from_com(1.0, Vec3::new(0.3, 0.0, 0.0), Sym3::diagonal(0.1));
    let wheel = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1));
    let at = |x: f64| Se3::new(Mat3::identity(), Vec3::new(x, 0.0, 0.0));
    let mut worst = Worst::new("divide and conquer with followers without inertia", INVERTED);
    for ratio in [-2.0, 0.01, 1.0, 50.0] {
        let mut builder = ModelBuilder::new("differential");
        let leader = builder.body("leader", WORLD, hinge, at(0.0), ball);
        let tip = builder.body("tip", leader, hinge, at(1.0), Inertia::zero());
        let slide = builder.body("slide", tip, Joint::Prismatic { axis }, at(0.1), Inertia::zero());
        let arm = builder.body("arm", WORLD, hinge, at(0.0), Inertia::zero());
        let geared = builder.body("geared", arm, hinge, at(0.0), wheel);
        for follower in [tip, slide, geared] {
            builder.mimic(follower, leader, Mimic { ratio, offset: 0.1 });
        }
        let model = builder.build().expect("a differential is well-formed");
        assert!(model.singular_joints().is_empty());
        for seed in 0..20 {
            check(&mut worst, &model, seed);
        }
    }
}

/// Checks that the generic code also runs on dual numbers, which give derivatives.
#[test]
fn on_dual_numbers() {
    let mut worst = Worst::new("derivatives by divide and conquer", INVERTED);
    for (seed, model) in all_models(4).iter().enumerate() {
        let State { q, v, a, tau, f_ext } = State::random(model, &mut rng(seed as u64));
        let q = common::moved(model, &lift(&q), &common::dual(&vec![0.0; a.len()], &a));
        let (v, tau, f_ext): (Vec<Dual64>, Vec<Dual64>, _) = (lift(&v), lift(&tau), lift_forces(&f_ext));
        let expected = common::eps(aba(model, &mut Data::new(model), &q, &v, &tau, &f_ext));
        for grain in [1, 4] {
            let mut divided = DivideConquer::new(model, grain);
            worst.see(model, &common::eps(divided.aba(model, &q, &v, &tau, &f_ext)), &expected);
        }
    }
}

/// Checks that the bits of a result do not depend on the number of threads, because the order of every sum is fixed.
#[test]
fn same_bits_for_any_number_of_threads() {
    let pools: Vec<_> = [1, 2, 3]
        .into_iter()
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started"))
        .collect();
    let models =
        all_models(4).into_iter().chain(shapes(90, true)).chain([chain(300), chain_with_followers(60, |i| i % 3 == 0)]);
    for (seed, model) in models.enumerate() {
        let State { q, v, tau, f_ext, .. } = State::random(&model, &mut rng(seed as u64));
        for grain in [1, 7] {
            let mut divided = DivideConquer::new(&model, grain);
            let expected = pools[0].install(|| divided.aba(&model, &q, &v, &tau, &f_ext).to_vec());
            for pool in &pools {
                for _ in 0..5 {
                    let found = pool.install(|| divided.aba(&model, &q, &v, &tau, &f_ext).to_vec());
                    assert_eq!(found, expected, "{} threads on\n{model}", pool.current_num_threads());
                }
            }
            assert_eq!(divided.aba(&model, &q, &v, &tau, &f_ext), expected);
        }
    }
}

/// Checks the depth to which joins are nested. For a chain of n bodies, the depth is ⌈log₂ n⌉. Other trees are cut into
/// heavy paths, and their depth is at most about twice as large.
#[test]
fn depth() {
    let log2 = |n: usize| n.next_power_of_two().ilog2() as usize;
    for n in [1, 2, 3, 4, 5, 8, 31, 32, 33, 300, 1000] {
        let size = DivideConquer::<f64>::new(&chain(n), 1).size();
        assert_eq!((size.depth, size.joins, size.runs, size.longest_run), (1 + log2(n), n - 1, n, 1));
        for model in shapes(n, false) {
            let size = DivideConquer::<f64>::new(&model, 1).size();
            assert!(size.depth <= 3 + 2 * log2(n), "{size:?} on {n} bodies");
            assert_eq!(size.bodies, n);
            for grain in [4, 30] {
                let size = DivideConquer::<f64>::new(&model, grain).size();
                assert!(size.longest_run <= grain, "{size:?}");
            }
            let size = DivideConquer::<f64>::new(&model, n).size();
            assert_eq!((size.depth, size.runs, size.longest_run), (1, 1, n));
        }
    }
}

/// Counts the sequential steps of divide and conquer. If a chain is twice as long, the number of steps must grow by a
/// constant, while the number of steps of the articulated-body algorithm doubles. The total work must be a constant
/// multiple of the work of the articulated-body algorithm.
#[test]
fn steps_grow_with_the_logarithm() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    println!("{:>5} {:>12} {:>7} {:>12} {:>7}", "links", "aba: work", "steps", "here: work", "steps");
    let mut rows = Vec::new();
    for n in [8, 16, 32, 64, 128, 256] {
        let model = chain(n);
        let State { q, v, tau, .. } = State::random(&model, &mut rng(0));
        let [q, v, tau]: [Vec<Counted>; 3] = [&q, &v, &tau].map(|x| lift(x));
        let mut data = Data::new(&model);
        let recursive = counted(|| aba(&model, &mut data, &q, &v, &tau, &[]));
        let mut divided = DivideConquer::new(&model, 1);
        let divided = pool.install(|| counted(|| divided.aba(&model, &q, &v, &tau, &[])));
        let [recursive, divided] = [recursive, divided].map(|(work, steps)| (work.all(), steps));
        println!("{n:5} {:12} {:7} {:12} {:7}", recursive.0, recursive.1, divided.0, divided.1);
        rows.push((recursive, divided));
    }
    let added: Vec<u32> = rows.windows(2).map(|w| w[1].1.1 - w[0].1.1).collect();
    let (least, most) = (added.iter().min(), added.iter().max());
    assert!(most.unwrap() - least.unwrap() <= most.unwrap() / 4, "steps that a doubling adds: {added:?}");
    for w in rows.windows(2) {
        let ratio = f64::from(w[1].0.1) / f64::from(w[0].0.1);
        assert!((1.8..2.1).contains(&ratio), "the articulated-body algorithm's steps grow by {ratio}");
    }
    let (recursive, divided) = rows[rows.len() - 1];
    assert!(divided.1 * 4 < recursive.1, "{divided:?} against {recursive:?}");
    assert!(divided.0 < 8 * recursive.0, "{divided:?} against {recursive:?}");
}

#[test]
fn a_robot_of_nothing() {
    let model = ModelBuilder::new("nothing").build().expect("nothing is well-formed");
    assert!(DivideConquer::<f64>::new(&model, 1).aba(&model, &[], &[], &[], &[]).is_empty());
}

#[test]
#[should_panic(expected = "v: expected 7 numbers, found 0")]
fn wrong_velocity() {
    let arm = robots::arm7();
    DivideConquer::new(&arm, 1).aba(&arm, &[0.0; 7], &[], &[0.0; 7], &[]);
}

#[test]
#[should_panic(expected = "model: planned for 8 bodies, found 14")]
fn wrong_model() {
    let quadruped = robots::quadruped();
    let mut divided = DivideConquer::new(&robots::arm7(), 1);
    divided.aba(&quadruped, &condyle_dynamics::neutral(&quadruped), &[0.0; 18], &[0.0; 18], &[]);
}
