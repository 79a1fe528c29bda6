//! Tests of vectors of numbers: each lane gives the same bits as a single number.

mod packers;

use condyle_spatial::Scalar;
use condyle_spatial::block::{Block, Real, SimdToken};
use condyle_spatial::level::{Level, Unsupported};
use condyle_spatial::moves::{Move, sum};
use condyle_spatial::simd::Kernel;
use core::marker::PhantomData;

/// Token that allows the tests to name vector types.
struct Here;

// SAFETY: each level is checked before its vectors are used.
#[allow(unsafe_code)]
unsafe impl SimdToken for Here {}

type Four = <f64 as Real>::Narrow<Here>;

/// Number type of the lanes, with functions for the tests.
trait Number: Real<Mask = bool> {
    /// Returns self · b + c, rounded once.
    fn fused(self, b: Self, c: Self) -> Self;
    fn bits(self) -> u64;
    /// Returns special values and ordinary values. The number of values is a multiple of every number of lanes.
    fn some() -> Vec<Self>;
}

macro_rules! number {
    ($($float:ident),*) => {$(
        impl Number for $float {
            fn fused(self, b: Self, c: Self) -> Self {
                $float::mul_add(self, b, c)
            }
            /// Returns the bits of the number; every NaN gives the same bits.
            fn bits(self) -> u64 {
                if self.is_nan() { u64::MAX } else { self.to_bits().into() }
            }
            fn some() -> Vec<Self> {
                let special = [0.0, 1.0, $float::MIN_POSITIVE / 8.0, $float::MAX, $float::INFINITY, $float::NAN];
                let special = special.into_iter().flat_map(|x| [x, -x]);
                let others = (0..52).map(|k| (3.7 * k as $float).sin() * (9.0 * (1.3 * k as $float).cos()).exp2());
                special.chain(others).collect()
            }
        }
    )*};
}
number!(f64, f32);

struct Operations<S>(PhantomData<S>);

impl<S: Block<Number: Number>> Kernel for Operations<S> {
    fn run(self) {
        let numbers = S::Number::some();
        assert!(numbers.len().is_multiple_of(S::LANES));
        for a in numbers.chunks_exact(S::LANES) {
            for turn in 0..numbers.len() {
                let mut others = numbers.clone();
                others.rotate_left(turn);
                for (b, c) in others.chunks_exact(S::LANES).zip(others[3..].chunks_exact(S::LANES)) {
                    Self::compare(a, b, c);
                }
            }
        }
    }
}

impl<S: Block<Number: Number>> Operations<S> {
    fn compare(a: &[S::Number], b: &[S::Number], c: &[S::Number]) {
        let (x, y, z) = (S::load(a), S::load(b), S::load(c));
        let is = |name: &str, found: S, expected: &dyn Fn(S::Number, S::Number, S::Number) -> S::Number| {
            let mut lanes = a.to_vec();
            found.store(&mut lanes);
            for k in 0..S::LANES {
                let (a, b, c) = (a[k], b[k], c[k]);
                let (found, expected) = (lanes[k], expected(a, b, c));
                assert!(found.bits() == expected.bits(), "{name} of {a:?}, {b:?}, {c:?}: {found:?}, not {expected:?}");
            }
        };
        is("+", x + y, &|a, b, _| a + b);
        is("-", x - y, &|a, b, _| a - b);
        is("*", x * y, &|a, b, _| a * b);
        is("/", x / y, &|a, b, _| a / b);
        is("mul_add", x.mul_add(y, z), &|a, b, c| a.fused(b, c));
        is("neg", -x, &|a, _, _| -a);
        is("abs", x.abs(), &|a, _, _| a.abs());
        is("sqrt", x.sqrt(), &|a, _, _| a.sqrt());
        is("recip", x.recip(), &|a, _, _| a.recip());
        is("atan2", x.atan2(y), &|a, b, _| a.atan2(b));
        is("splat", S::splat(0.1), &|_, _, _| S::Number::splat(0.1));
        let (less, under) = (x.lt(y), x.lt(z));
        is("lt", S::select(less, y, z), &|a, b, c| if a.lt(b) { b } else { c });
        is("and", S::select(S::and(less, under), y, x), &|a, b, c| if a.lt(b) && a.lt(c) { b } else { a });
        is("or", S::select(S::or(less, under), y, x), &|a, b, c| if a.lt(b) || a.lt(c) { b } else { a });
    }
}

/// Checks sines and cosines of an odd number of vectors with small and large angles. The bits equal the results for
/// each vector alone. Single numbers agree up to rounding.
struct Sines<S>(PhantomData<S>);

impl<S: Block<Number: Number>> Kernel for Sines<S> {
    fn run(self) {
        let numbers = S::Number::some();
        let angles: Vec<S> = numbers.chunks_exact(S::LANES).map(S::load).collect();
        let count = (angles.len() - 1) | 1;
        let (mut sin, mut cos) = (angles[..count].to_vec(), angles[..count].to_vec());
        S::sin_cos_of_all(&mut sin, &mut cos);
        let rounding = S::Number::splat(if size_of::<S::Number>() == 8 { 5e-16 } else { 5e-7 });
        for (k, angles) in numbers.chunks_exact(S::LANES).take(count).enumerate() {
            let (sin_alone, cos_alone) = S::load(angles).sin_cos();
            for (all, alone, is_sin) in [(sin[k], sin_alone, true), (cos[k], cos_alone, false)] {
                let (mut found, mut expected) = (angles.to_vec(), angles.to_vec());
                all.store(&mut found);
                alone.store(&mut expected);
                for (lane, &x) in angles.iter().enumerate() {
                    let (found, expected) = (found[lane], expected[lane]);
                    let single = if is_sin { x.sin_cos().0 } else { x.sin_cos().1 };
                    let is_near = (found - single).abs().lt(rounding) || found.bits() == single.bits();
                    assert!(found.bits() == expected.bits() && is_near, "of {x:?}: {found:?} {expected:?} {single:?}");
                }
            }
        }
    }
}

/// Check of operations between lanes: numbers are moved from each lane to each lane, and all lanes are summed.
struct Moves;

impl Kernel for Moves {
    fn run(self) {
        let x = [1.0, -2.0, 4.5, f64::NAN];
        for to in 0..4 {
            for from in 0..4 {
                let other = (to + 1) % 4;
                let mut expected = [0.0; 4];
                (expected[to], expected[other]) = (x[from], x[3 - from]);
                let found = Move::new(&[(from, to), (3 - from, other)]).apply::<Here>(Four::from_array(x)).to_array();
                assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits));
            }
        }
        let x = [1e16, 3.0, -1e16, 0.1]; // each order of summation gives another sum
        assert_eq!(sum::<Here>(Four::from_array(x)).to_array(), [3.1; 4]);
    }
}

#[test]
fn each_lane_is_a_number() {
    fn operations<S: Block<Number: Number>>() {
        S::enter(Operations::<S>(PhantomData));
        S::enter(Sines::<S>(PhantomData));
    }
    for level in Level::ALL {
        match level {
            _ if !level.is_supported() => eprintln!("NOT RUN: {}", Unsupported(level)),
            Level::Baseline => {}
            Level::Simd128 | Level::Neon | Level::Avx2 => {
                operations::<<f64 as Real>::Narrow<Here>>();
                operations::<<f32 as Real>::Narrow<Here>>();
                Four::enter(Moves);
            }
            Level::Avx512 => {
                operations::<<f64 as Real>::Wide<Here>>();
                operations::<<f32 as Real>::Wide<Here>>();
            }
        }
    }
}
