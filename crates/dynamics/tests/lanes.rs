//! Test of generic code on scalars with several lanes, which compute several knots of a horizon at the same time.
#![allow(non_snake_case)]

mod common;

use common::table::{Input, Output, functions, in_step};
use common::{all_models, rng};
use condyle_dynamics::level::{Level, pin};
use condyle_dynamics::{Data, Force, Scalar};
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Scalar with two lanes, for two numbers that are computed at the same time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lanes2([f64; 2]);

impl Lanes2 {
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self(self.0.map(f))
    }
    fn zip(self, o: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self([f(self.0[0], o.0[0]), f(self.0[1], o.0[1])])
    }
}

macro_rules! operators {
    ($($trait:ident $name:ident),*) => {$(
        impl $trait for Lanes2 {
            type Output = Self;
            fn $name(self, o: Self) -> Self {
                self.zip(o, f64::$name)
            }
        }
    )*};
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Lanes2 {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(f64::neg)
    }
}
impl AddAssign for Lanes2 {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl SubAssign for Lanes2 {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl Scalar for Lanes2 {
    type Mask = [bool; 2];
    const LANES: usize = 2;

    fn splat(x: f64) -> Self {
        Self([x; 2])
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self([0, 1].map(|i| Scalar::mul_add(self.0[i], b.0[i], c.0[i])))
    }
    fn recip(self) -> Self {
        self.map(Scalar::recip)
    }
    fn sqrt(self) -> Self {
        self.map(Scalar::sqrt)
    }
    fn sin_cos(self) -> (Self, Self) {
        let [(s0, c0), (s1, c1)] = self.0.map(Scalar::sin_cos);
        (Self([s0, s1]), Self([c0, c1]))
    }
    fn atan2(self, x: Self) -> Self {
        self.zip(x, Scalar::atan2)
    }
    fn abs(self) -> Self {
        self.map(Scalar::abs)
    }
    fn lt(self, other: Self) -> [bool; 2] {
        [0, 1].map(|i| self.0[i] < other.0[i])
    }
    fn select(mask: [bool; 2], a: Self, b: Self) -> Self {
        Self([0, 1].map(|i| if mask[i] { a.0[i] } else { b.0[i] }))
    }
    fn and(a: [bool; 2], b: [bool; 2]) -> [bool; 2] {
        [0, 1].map(|i| a[i] && b[i])
    }
    fn or(a: [bool; 2], b: [bool; 2]) -> [bool; 2] {
        [0, 1].map(|i| a[i] || b[i])
    }
}

fn side_by_side(a: &Input<f64>, b: &Input<f64>) -> Input<Lanes2> {
    let both = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(&a, &b)| Lanes2([a, b])).collect();
    let force = |(a, b): (&Force<f64>, &Force<f64>)| {
        let (a, b) = (a.to_array(), b.to_array());
        Force::from(core::array::from_fn(|k| Lanes2([a[k], b[k]])))
    };
    Input {
        q: both(&a.q, &b.q),
        q1: both(&a.q1, &b.q1),
        v: both(&a.v, &b.v),
        x: both(&a.x, &b.x),
        f_ext: a.f_ext.iter().zip(&b.f_ext).map(force).collect(),
    }
}

fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| x.to_bits()).collect()
}

/// Tolerance of Newton's method. With this small tolerance, one more iteration after convergence changes the result
/// only by rounding errors.
const CONVERGED: f64 = 1e-12;

/// Checks on every joint type that each lane has the same bits as a single call, even if the other lane contains NaN.
/// Functions that couple the lanes (`in_step`) must give the same numbers up to rounding.
#[test]
fn lanes_are_single_calls() {
    pin(Level::Baseline).unwrap(); // a SIMD level without fused operations, like `Lanes2`
    for (seed, model) in all_models(15).iter().enumerate() {
        let mut rng = rng(seed as u64);
        let knots = [Input::<f64>::random(model, &mut rng), Input::random(model, &mut rng)];
        let broken = knots[1].map(|_| f64::NAN);
        let (mut data, mut lanes) = (Data::<f64>::new(model), Data::<Lanes2>::new(model));
        for ((name, one), (_, two)) in functions().into_iter().zip(functions()) {
            let single = [0, 1].map(|k| {
                let mut output = Output::new(model);
                one(model, &mut data, &knots[k], &mut output);
                output.numbers
            });
            let mut run = |a: &Input<f64>, b: &Input<f64>| {
                let mut output = Output::new(model);
                two(model, &mut lanes, &side_by_side(a, b), &mut output);
                [0, 1].map(|k| bits(&output.numbers.iter().map(|x| x.0[k]).collect::<Vec<_>>()))
            };
            let expected = [0, 1].map(|k| bits(&single[k]));
            assert!(!expected[0].is_empty());
            let both = run(&knots[0], &knots[1]);
            if in_step(name) {
                let close = |k: usize| {
                    let theirs = both[k].iter().map(|&x| f64::from_bits(x)).collect::<Vec<_>>();
                    common::relative(&theirs, &single[k]) < CONVERGED
                };
                let same = if name.contains("variational") { close(0) && close(1) } else { both == expected };
                assert!(same, "{name} differs in lanes, on\n{model}");
                continue;
            }
            assert!(both == expected, "{name} differs in lanes, on\n{model}");
            assert!(run(&knots[0], &broken)[0] == expected[0], "NaN leaks into lane 0 of {name}, on\n{model}");
            assert!(run(&broken, &knots[1])[1] == expected[1], "NaN leaks into lane 1 of {name}, on\n{model}");
        }
    }
}
