//! Actions without a robot, for all tests of this crate.
#![allow(dead_code)] // each test file uses only some of the items
#![allow(non_snake_case)] // names follow the literature: A, B, T, E

use condyle_optimal::{ActionModel, GroupModel, LqKnot, Problem};
use nalgebra::DMatrix;
use rand::{Rng, RngExt, SeedableRng, rngs::StdRng};
use std::ops::Range;

pub(crate) fn random() -> StdRng {
    StdRng::seed_from_u64(7)
}

/// Returns an m×n matrix with random entries in (−1, 1).
pub(crate) fn random_matrix(random: &mut impl Rng, m: usize, n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(m, n, |_, _| random.random_range(-1.0..1.0))
}

/// Returns an LQ knot with random entries and a cost that is strictly convex in (δx, δu).
pub(crate) fn random_knot(random: &mut impl Rng, ndx: usize, nu: usize) -> LqKnot {
    let mut knot = LqKnot::zeros(ndx, nu);
    let root = random_matrix(random, ndx + nu, ndx + nu);
    let hessian = &root * root.transpose() + DMatrix::identity(ndx + nu, ndx + nu);
    knot.A = random_matrix(random, ndx, ndx);
    knot.B = random_matrix(random, ndx, nu);
    knot.f = random_matrix(random, ndx, 1).column(0).into_owned();
    knot.Q.copy_from(&hessian.view((0, 0), (ndx, ndx)));
    knot.S.copy_from(&hessian.view((0, ndx), (ndx, nu)));
    knot.R.copy_from(&hessian.view((ndx, ndx), (nu, nu)));
    knot.q = random_matrix(random, ndx, 1).column(0).into_owned();
    knot.r = random_matrix(random, nu, 1).column(0).into_owned();
    knot
}

/// Returns a knot like [`random_knot`], but with the matrices A and B of a semi-implicit Euler step. q and v have nv
/// entries each. T and E are the identity, except for random blocks at `blocks`.
pub(crate) fn random_euler_knot(random: &mut impl Rng, nv: usize, nu: usize, blocks: &[Range<usize>]) -> LqKnot {
    let (mut knot, dt) = (random_knot(random, 2 * nv, nu), 0.05);
    let (mut T, mut E) = (DMatrix::identity(nv, nv), DMatrix::identity(nv, nv));
    for (block, range) in knot.structure.set_euler(dt, blocks).iter_mut().zip(blocks) {
        block.T = random_matrix(random, range.len(), range.len());
        block.E = random_matrix(random, range.len(), range.len());
        T.view_mut((range.start, range.start), block.T.shape()).copy_from(&block.T);
        E.view_mut((range.start, range.start), block.E.shape()).copy_from(&block.E);
    }
    let mut upper = &E * knot.A.rows(nv, nv) * dt;
    upper += T.resize_horizontally(2 * nv, 0.0);
    knot.A.rows_mut(0, nv).copy_from(&upper);
    let upper = &E * knot.B.rows(nv, nv) * dt;
    knot.B.rows_mut(0, nv).copy_from(&upper);
    knot
}

/// Action with the fields of an LQ knot: x⁺ = A x + B u + f with a quadratic cost.
pub(crate) struct Linear(pub(crate) LqKnot);

impl ActionModel for Linear {
    fn nx(&self) -> usize {
        self.0.ndx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let knot = &self.0;
        let (x, u) = (nalgebra::DVectorView::from_slice(x, x.len()), nalgebra::DVectorView::from_slice(u, u.len()));
        next.copy_from_slice((&knot.A * x + &knot.B * u + &knot.f).as_slice());
        (&knot.Q * x).dot(&x) / 2.0
            + (&knot.S * u).dot(&x)
            + (&knot.R * u).dot(&u) / 2.0
            + knot.q.dot(&x)
            + knot.r.dot(&u)
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], out: &mut LqKnot) {
        let (x, u) = (nalgebra::DVectorView::from_slice(x, x.len()), nalgebra::DVectorView::from_slice(u, u.len()));
        let f = std::mem::replace(&mut out.f, nalgebra::DVector::zeros(0));
        *out = self.0.clone();
        out.q = &self.0.q + &self.0.Q * x + &self.0.S * u;
        out.r = &self.0.r + &self.0.R * u + self.0.S.transpose() * x;
        out.f = f;
    }
}

/// Unicycle with the state x = (x, y, θ) and the control u = (v, ω): x⁺ = x + Δt (v cos θ, v sin θ, ω), ℓ = ½ (‖10 x‖²
/// + ‖u‖²). The terminal knot has no u.
pub(crate) struct Unicycle {
    pub(crate) nu: usize,
    pub(crate) lanes: usize,
}

impl GroupModel for Unicycle {
    fn lanes(&self) -> usize {
        self.lanes
    }
}

const UNICYCLE_STEP: f64 = 0.1;
const UNICYCLE_WEIGHT: f64 = 100.0;

impl ActionModel for Unicycle {
    fn nx(&self) -> usize {
        3
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        if let [v, w] = u {
            next[0] = x[0] + UNICYCLE_STEP * v * x[2].cos();
            next[1] = x[1] + UNICYCLE_STEP * v * x[2].sin();
            next[2] = x[2] + UNICYCLE_STEP * w;
        }
        let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        0.5 * (UNICYCLE_WEIGHT * square(x) + square(u))
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let (s, c) = x[2].sin_cos();
        knot.Q.fill_with_identity();
        knot.Q *= UNICYCLE_WEIGHT;
        for (q, x) in knot.q.iter_mut().zip(x) {
            *q = UNICYCLE_WEIGHT * x;
        }
        if let [v, _] = u {
            let h = UNICYCLE_STEP;
            knot.A.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -h * v * s, h * v * c, 1.0]);
            knot.B.copy_from_slice(&[h * c, h * s, 0.0, 0.0, 0.0, h]);
            knot.S.fill(0.0);
            knot.R.fill_with_identity();
            knot.r.copy_from_slice(u);
        }
    }
}

/// Action that adds the same control bounds to another action at every knot.
pub(crate) struct Limited<A> {
    pub(crate) action: A,
    pub(crate) lower: Vec<f64>,
    pub(crate) upper: Vec<f64>,
}

impl<A: GroupModel> GroupModel for Limited<A> {
    fn lanes(&self) -> usize {
        self.action.lanes()
    }
}

impl<A: GroupModel> ActionModel for Limited<A> {
    fn nx(&self) -> usize {
        self.action.nx()
    }
    fn nu(&self) -> usize {
        self.action.nu()
    }
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }
    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        Some((&self.lower, &self.upper))
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.action.calc(t, x, u, next)
    }
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.action.calc_diff(t, x, u, knot);
    }
}

/// Creates a problem whose knots all have the same action.
fn horizon_of<A: GroupModel>(
    x0: &[f64],
    horizon: usize,
    action: A,
    bounds: Option<[Vec<f64>; 2]>,
    terminal: A,
) -> Problem {
    let running: Box<dyn ActionModel> = match bounds {
        Some([lower, upper]) => Box::new(Limited { action, lower, upper }),
        None => Box::new(action),
    };
    Problem::new(x0.to_vec(), vec![running], vec![0; horizon], Box::new(terminal)).unwrap()
}

pub(crate) fn limited_unicycle(x0: &[f64], horizon: usize, lanes: usize, bounds: Option<[Vec<f64>; 2]>) -> Problem {
    horizon_of(x0, horizon, Unicycle { nu: 2, lanes }, bounds, Unicycle { nu: 0, lanes })
}

pub(crate) fn unicycle(x0: &[f64], horizon: usize, lanes: usize) -> Problem {
    limited_unicycle(x0, horizon, lanes, None)
}

/// Cart-pole, with the angle θ = 0 at the upright pole, the state x = (y, θ, ẏ, θ̇) and the force u = (f) on the cart.
/// It makes semi-implicit Euler steps of Δt = 0.03 s:
///
/// ```text
/// μ = m₁ + m₂ sin²θ
/// ÿ = (f + m₂ g cos θ sin θ − m₂ l sin θ θ̇²) / μ
/// θ̈ = (cos θ f / l + (m₁ + m₂) g sin θ / l − m₂ cos θ sin θ θ̇²) / μ
/// x⁺ = x + Δt (ẏ + Δt ÿ, θ̇ + Δt θ̈, ÿ, θ̈)
/// ```
///
/// The cost is ℓ = ½ Σ wᵢ² (θ, y, ẏ, θ̇, f)ᵢ², times Δt except at the terminal knot.
pub(crate) struct Cartpole {
    pub(crate) nu: usize,
    pub(crate) lanes: usize,
    pub(crate) weights: [f64; 5],
}

impl GroupModel for Cartpole {
    fn lanes(&self) -> usize {
        self.lanes
    }
}

const CART: f64 = 1.0;
const POLE: f64 = 0.1;
const LENGTH: f64 = 0.5;
const GRAVITY: f64 = 9.81;
const CARTPOLE_STEP: f64 = 0.03;

impl Cartpole {
    /// Returns the weights of y, θ, ẏ, θ̇, f in the cost.
    fn cost_weights(&self) -> [f64; 5] {
        let scale = if self.nu == 0 { 1.0 } else { CARTPOLE_STEP };
        let [angle, position, velocity, rate, force] = self.weights.map(|w| scale * w * w);
        [position, angle, velocity, rate, force]
    }
}

impl ActionModel for Cartpole {
    fn nx(&self) -> usize {
        4
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        if let [f] = u {
            let ((s, c), rate, h) = (x[1].sin_cos(), x[3], CARTPOLE_STEP);
            let mu = CART + POLE * s * s;
            let cart = (f + POLE * c * s * GRAVITY - POLE * LENGTH * s * rate * rate) / mu;
            let pole = (c * f / LENGTH + (CART + POLE) * GRAVITY * s / LENGTH - POLE * c * s * rate * rate) / mu;
            next[0] = x[0] + h * (x[2] + h * cart);
            next[1] = x[1] + h * (x[3] + h * pole);
            next[2] = x[2] + h * cart;
            next[3] = x[3] + h * pole;
        }
        let weights = self.cost_weights();
        0.5 * x.iter().chain(u).zip(weights).map(|(z, w)| w * z * z).sum::<f64>()
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let weights = self.cost_weights();
        knot.Q.fill(0.0);
        for i in 0..4 {
            knot.Q[(i, i)] = weights[i];
            knot.q[i] = weights[i] * x[i];
        }
        if let [f] = u {
            let ((s, c), rate, h) = (x[1].sin_cos(), x[3], CARTPOLE_STEP);
            let (double, mu) = (c * c - s * s, CART + POLE * s * s);
            let cart = (f + POLE * c * s * GRAVITY - POLE * LENGTH * s * rate * rate) / mu;
            let pole = (c * f / LENGTH + (CART + POLE) * GRAVITY * s / LENGTH - POLE * c * s * rate * rate) / mu;
            let d_mu = 2.0 * POLE * s * c;
            // derivatives ∂ÿ/∂θ, ∂θ̈/∂θ, ∂ÿ/∂θ̇, ∂θ̈/∂θ̇, ∂ÿ/∂f, ∂θ̈/∂f, in this order
            let cart_angle = (POLE * GRAVITY * double - POLE * LENGTH * c * rate * rate - cart * d_mu) / mu;
            let pole_angle =
                (-s * f / LENGTH + (CART + POLE) * GRAVITY * c / LENGTH - POLE * double * rate * rate - pole * d_mu)
                    / mu;
            let (cart_rate, pole_rate) = (-2.0 * POLE * LENGTH * s * rate / mu, -2.0 * POLE * c * s * rate / mu);
            let (cart_force, pole_force) = (1.0 / mu, c / (LENGTH * mu));
            knot.A.fill_with_identity();
            for (column, cart, pole) in [(1, cart_angle, pole_angle), (3, cart_rate, pole_rate)] {
                knot.A[(0, column)] += h * h * cart;
                knot.A[(1, column)] += h * h * pole;
                knot.A[(2, column)] += h * cart;
                knot.A[(3, column)] += h * pole;
            }
            knot.A[(0, 2)] += h;
            knot.A[(1, 3)] += h;
            knot.B.copy_from_slice(&[h * h * cart_force, h * h * pole_force, h * cart_force, h * pole_force]);
            knot.S.fill(0.0);
            knot.R[0] = weights[4];
            knot.r[0] = weights[4] * f;
        }
    }
}

/// Initial state of the pole's swing-up in Crocoddyl's examples.
#[allow(clippy::approx_constant)] // the pole hangs nearly straight down; 3.14 is not meant to be π
pub(crate) const HANGING: [f64; 4] = [0.0, 3.14, 0.0, 0.0];

pub(crate) fn cartpole(x0: &[f64], horizon: usize, lanes: usize) -> Problem {
    limited_cartpole(x0, horizon, lanes, None)
}

/// Returns the action of the knots in the pole's swing-up.
pub(crate) fn cartpole_action() -> Cartpole {
    Cartpole { nu: 1, lanes: 1, weights: [1.0, 0.1, 0.1, 0.1, 0.3] }
}

pub(crate) fn limited_cartpole(x0: &[f64], horizon: usize, lanes: usize, bounds: Option<[Vec<f64>; 2]>) -> Problem {
    let running = Cartpole { lanes, ..cartpole_action() };
    let terminal = Cartpole { nu: 0, lanes, weights: [100.0, 10.0, 10.0, 10.0, 0.0] };
    horizon_of(x0, horizon, running, bounds, terminal)
}

/// Returns `horizon` + 1 states on the straight line from `first` to `last`, in one flat list.
pub(crate) fn straight(first: &[f64], last: &[f64], horizon: usize) -> Vec<f64> {
    let at = |t: usize| {
        let s = t as f64 / horizon as f64;
        first.iter().zip(last).map(move |(first, last)| first + (last - first) * s)
    };
    (0..=horizon).flat_map(at).collect()
}

/// Action with states on a unit circle: x = (cos φ, sin φ), nx = 2, ndx = 1. The control u turns the state, and the
/// cost is ℓ = ½ (φ² + 0.1 u²).
pub(crate) struct Circle {
    pub(crate) nu: usize,
}

impl ActionModel for Circle {
    fn nx(&self) -> usize {
        2
    }
    fn ndx(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.integrate(x, &[u.iter().sum()], next);
        let angle = x[1].atan2(x[0]);
        0.5 * (angle * angle + 0.1 * u.iter().map(|u| u * u).sum::<f64>())
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        (knot.A[0], knot.Q[0], knot.q[0]) = (1.0, 1.0, x[1].atan2(x[0]));
        knot.B.fill(1.0);
        knot.S.fill(0.0);
        knot.R.fill(0.1);
        for (r, u) in knot.r.iter_mut().zip(u) {
            *r = 0.1 * u;
        }
    }
    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        let (s, c) = dx[0].sin_cos();
        (out[0], out[1]) = (x[0] * c - x[1] * s, x[0] * s + x[1] * c);
    }
    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        out[0] = (x0[0] * x1[1] - x0[1] * x1[0]).atan2(x0[0] * x1[0] + x0[1] * x1[1]);
    }
}
