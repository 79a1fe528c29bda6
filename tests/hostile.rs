//! What comes from outside, mutated: an error or something that can be used, never a panic. A bounded run, the same each time,
//! of what `fuzz/` runs for as long as one likes.

#[path = "../fuzz/src/hostile.rs"]
#[allow(unreachable_pub)] // to the targets it is a module of a library
mod hostile;

use hostile::{Kind, mutated};
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Says which input it was, if there is a panic.
struct Case<'a>(Kind, u64, &'a [u8]);

impl Drop for Case<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{:?} {}:\n{}", self.0, self.1, String::from_utf8_lossy(self.2));
        }
    }
}

/// Seeds are good; of so many mutated ones, in `./test full` of four times as many, some are, and some are not.
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
