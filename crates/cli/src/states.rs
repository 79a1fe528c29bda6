//! Random states of a robot. Positions are within the limits; all other quantities are normally distributed.

use condyle::{Model, random_configuration};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Returns a random number generator with this seed.
pub(crate) fn source(seed: u64) -> StdRng {
    StdRng::seed_from_u64(seed)
}

/// Returns n normally distributed random numbers with mean 0 and variance 1 (Box and Muller, 1958).
pub(crate) fn normal(random: &mut StdRng, n: usize) -> Vec<f64> {
    let mut one = || {
        let (a, b): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - a).ln()).sqrt() * (core::f64::consts::TAU * b).cos()
    };
    (0..n).map(|_| one()).collect()
}

/// Random states, stored one after another in the layout of a batch.
pub(crate) struct States {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub tau: Vec<f64>,
}

impl States {
    pub(crate) fn new(model: &Model, count: usize, seed: u64) -> Self {
        let mut random = source(seed);
        let q = (0..count).flat_map(|_| random_configuration(model, &mut random)).collect();
        let mut vectors = || normal(&mut random, count * model.nv());
        Self { q, v: vectors(), a: vectors(), tau: vectors() }
    }

    /// Returns q, v, a and τ of state k.
    pub(crate) fn at(&self, model: &Model, k: usize) -> [&[f64]; 4] {
        let (q, v) = (k * model.nq()..(k + 1) * model.nq(), k * model.nv()..(k + 1) * model.nv());
        [&self.q[q], &self.v[v.clone()], &self.a[v.clone()], &self.tau[v]]
    }
}
