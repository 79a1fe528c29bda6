//! Tests of several knots in a vector register. Each lane must have the same bits as a single call at the same SIMD
//! level.

use crate::common::table::{Input, Output, kernels};
use crate::common::{long_branches, rng};
use crate::{each_level, models};
use condyle_dynamics::level::Level;
use condyle_dynamics::{Data, Force, Model, Scalar};
use condyle_spatial::block::{Block, Real, SimdToken};

/// Vector of numbers, with the operations that the tests need.
trait Vector: Scalar {
    fn pack(x: &[f64]) -> Self;
    fn unpack(self) -> Vec<f64>;
}

impl<S: Block<Number = f64>> Vector for S {
    fn pack(x: &[f64]) -> Self {
        Self::load(x)
    }
    fn unpack(self) -> Vec<f64> {
        let mut numbers = vec![0.0; S::LANES];
        self.store(&mut numbers);
        numbers
    }
}

/// Token that gives this test access to the vector types of all SIMD levels.
struct Here;

// SAFETY: `each_level` only runs SIMD levels that this processor supports.
#[allow(unsafe_code)]
unsafe impl SimdToken for Here {}

fn side_by_side<S: Vector>(knots: &[Input<f64>]) -> Input<S> {
    let pack = |part: fn(&Input<f64>) -> &[f64]| -> Vec<S> {
        let n = part(&knots[0]).len();
        (0..n).map(|i| S::pack(&knots.iter().map(|k| part(k)[i]).collect::<Vec<_>>())).collect()
    };
    let force = |b: usize| {
        let six: [Vec<f64>; 6] =
            core::array::from_fn(|r| knots.iter().map(|k| k.f_ext[b].to_array()[r]).collect::<Vec<_>>());
        Force::from(six.map(|x| S::pack(&x)))
    };
    Input {
        q: pack(|k| &k.q),
        q1: pack(|k| &k.q1),
        v: pack(|k| &k.v),
        x: pack(|k| &k.x),
        f_ext: (0..knots[0].f_ext.len()).map(force).collect(),
    }
}

fn knots_are_single_calls<S: Vector>(models: &[Model]) {
    for (seed, model) in models.iter().enumerate() {
        let mut rng = rng(seed as u64);
        let knots: Vec<Input<f64>> = (0..S::LANES).map(|_| Input::random(model, &mut rng)).collect();
        let (mut data, mut lanes) = (Data::<f64>::new(model), Data::<S>::new(model));
        for ((name, one), (_, many)) in kernels().into_iter().zip(kernels()) {
            let mut found = Output::new(model);
            many(model, &mut lanes, &side_by_side::<S>(&knots), &mut found);
            for (k, knot) in knots.iter().enumerate() {
                let mut expected = Output::new(model);
                one(model, &mut data, knot, &mut expected);
                let found: Vec<f64> = found.numbers.iter().map(|x| x.unpack()[k]).collect();
                assert!(found == expected.numbers, "{name} has other bits in lane {k} of {}, on\n{model}", S::LANES);
            }
            // A lane with NaN must not affect the other lanes.
            let mut broken = knots.clone();
            broken[1] = broken[1].map(|_| f64::NAN);
            let mut beside = Output::new(model);
            many(model, &mut lanes, &side_by_side::<S>(&broken), &mut beside);
            let lane = |of: &Output<S>, k: usize| of.numbers.iter().map(|x| x.unpack()[k]).collect::<Vec<_>>();
            (0..S::LANES).filter(|&k| k != 1).for_each(|k| assert!(lane(&beside, k) == lane(&found, k), "{name}"));
        }
    }
}

#[test]
fn every_lane_is_a_single_call() {
    let long = long_branches().into_iter().map(|model| model.with_limbs(false));
    let all: Vec<Model> = models(4).into_iter().chain(long).collect();
    each_level(|level| match level {
        Level::Baseline => {}
        Level::Simd128 | Level::Neon | Level::Avx2 => knots_are_single_calls::<<f64 as Real>::Narrow<Here>>(&all),
        Level::Avx512 => knots_are_single_calls::<<f64 as Real>::Wide<Here>>(&all),
    });
}
