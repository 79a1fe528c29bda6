//! Times dense products in registers, compared with the processor's peak: `cargo bench -p condyle-benches --bench
//! tiles`.
//!
//! The peak is the rate of independent multiplications and additions. The peak is measured before and after each
//! product, because the processor's clock and the load by other virtual machines change. The program prints the best of
//! many short rounds.

use condyle::level::level;
use condyle_linalg::{SLACK, Vector, Vectorized, View, at_level, product};
use std::hint::black_box;
use std::time::Instant;

/// Number of independent sums. It is large enough to hide the latency of an operation, and smaller than the number of
/// registers.
const SUMS: usize = 12;
const TERMS: usize = 4096;
const ROUNDS: usize = 400;

/// Function that computes independent sums and returns its number of operations on single numbers.
struct Independent<'a> {
    operations: &'a mut usize,
}

impl Vectorized for Independent<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let (factor, term) = (V::splat(black_box(0.5)), V::splat(black_box(1.0)));
        let mut sums = [term; SUMS];
        for _ in 0..TERMS {
            for k in 0..SUMS {
                sums[k] = sums[k].mul_add(factor, term);
            }
        }
        let mut numbers = [0.0; SLACK];
        for sum in sums {
            sum.store(&mut numbers);
            black_box(&numbers);
        }
        *self.operations = 2 * SUMS * TERMS * V::N;
    }
}

/// Returns the largest rate (operations per nanosecond) of several rounds. In each round, `round` runs and returns its
/// number of operations.
fn fastest(mut round: impl FnMut() -> usize) -> f64 {
    let rate = |()| {
        let start = Instant::now();
        let operations = round();
        operations as f64 / start.elapsed().as_nanos() as f64
    };
    [(); ROUNDS].map(rate).into_iter().fold(0.0, f64::max)
}

fn peak() -> f64 {
    fastest(|| {
        let mut operations = 0;
        at_level(Independent { operations: &mut operations });
        operations
    })
}

fn main() {
    println!("level {}", level());
    for n in [14, 36, 76, 100] {
        let ld = n + SLACK;
        let numbers: Vec<f64> = (0..ld * ld).map(|k| (k % 17) as f64 / 17.0).collect();
        let (a, mut c) = (View::new(&numbers, ld), vec![0.0; ld * ld]);
        let before = peak();
        let found = fastest(|| {
            const TIMES: usize = 10;
            for _ in 0..TIMES {
                product(black_box(&mut c), ld, [n, n, n], a, a);
            }
            2 * n * n * n * TIMES
        });
        let peak = before.max(peak());
        println!("{n:3} x {n:3}: {found:5.1} of {peak:5.1} GFLOP/s, {:.0} %", 100.0 * found / peak);
    }
}
