//! Tests that readers return an error or a usable result for a mutated (randomly changed) input, and never panic. The
//! tests run the fuzz targets in `fuzz/` for a fixed number of reproducible inputs.

#[path = "../fuzz/src/hostile/mod.rs"]
#[allow(unreachable_pub)] // the fuzz targets use this module as a module of a library
mod hostile;

use hostile::{Kind, mutated};
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Holder of the current input, which it prints if a panic occurs.
struct Case<'a>(Kind, u64, &'a [u8]);

impl Drop for Case<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{:?} {}:\n{}", self.0, self.1, String::from_utf8_lossy(self.2));
        }
    }
}

/// Checks `count` mutated inputs, or four times as many in `./test full`. All original inputs (seeds) are valid;
/// mutated inputs may be valid or invalid.
fn run(kind: Kind, count: u64) {
    let count = if std::env::var_os("CONDYLE_FULL").is_some() { 4 * count } else { count };
    let seeds = kind.seeds();
    assert!(seeds.iter().all(|seed| kind.check(seed)));
    let mut good = 0;
    for k in 0..count {
        let mut rng = StdRng::seed_from_u64(k);
        let input = mutated(kind, &seeds[k as usize % seeds.len()], &seeds, &mut rng);
        let _case = Case(kind, k, &input);
        good += u64::from(kind.check(&input));
    }
    assert!(good > count / 50 && good < count, "{good} of {count} could be read");
}

#[test]
fn urdf() {
    run(Kind::Urdf, 2_500);
}

#[test]
fn mjcf() {
    run(Kind::Mjcf, 4_000);
}

#[test]
fn sdf() {
    run(Kind::Sdf, 4_000);
}

#[test]
fn srdf() {
    run(Kind::Srdf, 2_500);
}

#[test]
fn stl() {
    run(Kind::Stl, 2_500);
}

#[test]
fn obj() {
    run(Kind::Obj, 2_500);
}

#[test]
fn dae() {
    run(Kind::Dae, 2_500);
}

#[test]
fn models() {
    run(Kind::Model, 2_500);
}

#[test]
fn pickles() {
    run(Kind::Pickle, 10_000);
}

#[test]
fn problems() {
    run(Kind::Problem, 2_000);
}
