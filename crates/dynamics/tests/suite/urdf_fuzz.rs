//! Whatever a file contains, reading it gives a model or an error, soon.

use condyle_dynamics::{Data, Joint, Model, UrdfOptions, crba, neutral, robots};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::time::{Duration, Instant};

/// The robots take a millisecond; a mutation cannot make a file more than some hundred times harder to read.
const SOON: Duration = Duration::from_secs(5);

/// The same cases in every run.
fn config() -> ProptestConfig {
    ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() }
}

/// A change to a file, at a place between 0 and 1.
#[derive(Clone, Debug)]
enum Mutation {
    Flip(f64, u8),
    Delete(f64, usize),
    Swap(f64, f64, usize),
    Repeat(f64, usize),
    Insert(f64, &'static str),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let at = || 0.0..1.0;
    let pieces = prop::sample::select(
        &[
            "<",
            ">",
            "\"",
            "/",
            "&amp;",
            "&#0;",
            "nan",
            "inf",
            "-1",
            "1e999",
            "<link name=\"base\"/>",
            "<joint>",
            "</joint>",
            "<mimic joint=\"joint1\"/>",
            "<!--",
            "-->",
            "<![CDATA[",
            "<?x",
            "é",
            "\u{0}",
            " xmlns:a=\"b\"",
            "a:",
            "<limit/>",
            "<inertial/>",
            "0 0 0",
            "type=\"floating\"",
            "type=\"planar\"",
        ][..],
    );
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(a, x)| Mutation::Flip(a, x)),
        (at(), 1..200_usize).prop_map(|(a, n)| Mutation::Delete(a, n)),
        (at(), at(), 1..200_usize).prop_map(|(a, b, n)| Mutation::Swap(a, b, n)),
        (at(), 1..2000_usize).prop_map(|(a, n)| Mutation::Repeat(a, n)),
        (at(), pieces).prop_map(|(a, s)| Mutation::Insert(a, s)),
    ]
}

fn mutate(bytes: &mut Vec<u8>, mutation: &Mutation) {
    let n = bytes.len();
    let place = |at: f64| ((at * n as f64) as usize).min(n);
    match *mutation {
        _ if n == 0 => {}
        Mutation::Flip(at, x) => bytes[place(at).min(n - 1)] ^= x,
        Mutation::Delete(at, k) => drop(bytes.drain(place(at)..(place(at) + k).min(n))),
        Mutation::Swap(a, b, k) => (0..k).for_each(|i| bytes.swap((place(a) + i) % n, (place(b) + i) % n)),
        Mutation::Repeat(at, k) => {
            let piece = bytes[place(at)..(place(at) + k).min(n)].to_vec();
            bytes.splice(place(at)..place(at), piece);
        }
        Mutation::Insert(at, s) => drop(bytes.splice(place(at)..place(at), s.bytes())),
    }
}

proptest! {
    #![proptest_config(config())]

    /// A model that comes of it can be used.
    #[test]
    fn fuzz(robot in 0..3_usize, mutations in prop::collection::vec(mutation(), 1..6), free in any::<bool>(), mimic in any::<bool>()) {
        let mut bytes = [robots::ARM7, robots::QUADRUPED, robots::HUMANOID][robot].as_bytes().to_vec();
        mutations.iter().for_each(|m| mutate(&mut bytes, m));
        let root_joint = free.then_some(Joint::FreeFlyer);
        let start = Instant::now();
        match Model::from_urdf_str(&String::from_utf8_lossy(&bytes), &UrdfOptions { root_joint, mimic, ..UrdfOptions::default() }) {
            Ok(model) => {
                let mut data = Data::new(&model);
                prop_assert!(crba(&model, &mut data, &neutral(&model)).iter().all(|x| x.is_finite()), "{model}");
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
        prop_assert!(start.elapsed() < SOON);
    }
}
