//! Slack variables and multipliers of the inequalities, in arrays that are traversed in lanes.

use condyle_linalg::{Vector, Vectorized, at_level};
use core::array;

/// Largest factor between a multiplier and its value μ / distance on the central path.
pub(super) const OFF_PATH: f64 = 1e10;

/// Eight numbers of consecutive rows.
type Eight = [f64; 8];

/// Slack variables s and multipliers z of the rows. A row that is no inequality has infinite bounds, s = 0 and z = 0,
/// so that all its terms vanish. The arrays are padded to a multiple of eight by such rows.
#[derive(Debug, Clone, Default)]
pub(super) struct Barrier {
    /// Bounds on s: lower and upper.
    pub(super) bounds: [Vec<f64>; 2],
    pub(super) s: Vec<f64>,
    /// Multipliers of the lower bounds, and of the upper bounds.
    pub(super) z: [Vec<f64>; 2],
    /// Changes of g at first; [`find_step`](Self::find_step) replaces them by the steps δs.
    pub(super) ds: Vec<f64>,
    dz: [Vec<f64>; 2],
    /// Inverse distances 1 / (s − lower) and 1 / (upper − s); zero where the bound is infinite.
    inverse: [Vec<f64>; 2],
    pub(super) products: Products,
    /// Number of finite bounds.
    pub(super) count: usize,
}

/// Sums over the products z (s − lower) and z (upper − s) of all finite bounds.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Products {
    pub(super) sum: f64,
    pub(super) least: f64,
    pub(super) largest: f64,
    /// Sum of the multipliers.
    pub(super) multipliers: f64,
}

impl Products {
    /// Returns the sums for these and other rows together.
    pub(super) fn and(self, other: Self) -> Self {
        let is_above = |a: f64, b: f64| a > b || a.is_nan();
        Self {
            sum: self.sum + other.sum,
            least: if is_above(self.least, other.least) { other.least } else { self.least },
            largest: if is_above(self.largest, other.largest) { self.largest } else { other.largest },
            multipliers: self.multipliers + other.multipliers,
        }
    }
}

/// Largest step lengths of s and z, and the derivative of −Σ log of all distances along the step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepLimits {
    /// Largest relative decrease of a distance, and of a multiplier, in a step of length 1.
    pub(super) decreases: [f64; 2],
    pub(super) slope: f64,
}

impl StepLimits {
    /// Returns the limits for these and other rows together.
    pub(super) fn and(self, other: Self) -> Self {
        let larger = |k: usize| {
            let (a, b) = (self.decreases[k], other.decreases[k]);
            if a <= b || b.is_nan() { b } else { a }
        };
        Self { decreases: [larger(0), larger(1)], slope: self.slope + other.slope }
    }

    /// Returns the largest step lengths of s and of z, at most 1, with which each distance and each multiplier keeps at
    /// least the fraction 1 − τ of its value.
    pub(super) fn lengths(&self, tau: f64) -> [f64; 2] {
        self.decreases.map(|most| if most > tau { tau / most } else { 1.0 })
    }
}

impl Barrier {
    /// Removes all rows.
    pub(super) fn clear(&mut self) {
        self.bounds.iter_mut().for_each(Vec::clear);
        self.count = 0;
    }

    /// Appends a row with the given bounds.
    pub(super) fn push(&mut self, bounds: [f64; 2]) {
        self.count += bounds.into_iter().filter(|bound| bound.is_finite()).count();
        self.bounds.iter_mut().zip(bounds).for_each(|(all, bound)| all.push(bound));
    }

    /// Allocates the arrays of all rows that were pushed. Allocates only if there were never as many rows.
    pub(super) fn complete(&mut self) {
        let padded = padded(self.bounds[0].len());
        let Self { bounds: [lower, upper], s, z: [zl, zu], ds, dz: [dzl, dzu], inverse: [il, iu], .. } = self;
        lower.resize(padded, f64::NEG_INFINITY);
        upper.resize(padded, f64::INFINITY);
        for numbers in [&mut *s, &mut *zl, &mut *zu, ds, dzl, dzu, il, iu] {
            numbers.resize(padded, 0.0);
        }
        for i in (0..padded).filter(|&i| lower[i] == f64::NEG_INFINITY && upper[i] == f64::INFINITY) {
            (s[i], zl[i], zu[i]) = (0.0, 0.0, 0.0);
        }
    }

    /// Replaces row i by a row without bounds.
    pub(super) fn free(&mut self, i: usize) {
        let finite = |bound: &f64| usize::from(bound.is_finite());
        self.count -= self.bounds.iter().map(|all| finite(&all[i])).sum::<usize>();
        (self.bounds[0][i], self.bounds[1][i]) = (f64::NEG_INFINITY, f64::INFINITY);
        (self.s[i], self.z[0][i], self.z[1][i], self.ds[i]) = (0.0, 0.0, 0.0, 0.0);
        (self.inverse[0][i], self.inverse[1][i], self.dz[0][i], self.dz[1][i]) = (0.0, 0.0, 0.0, 0.0);
    }

    /// Returns the distances of s from both bounds of row i; infinite where a bound is.
    pub(super) fn distances(&self, i: usize) -> [f64; 2] {
        [self.s[i] - self.bounds[0][i], self.bounds[1][i] - self.s[i]]
    }

    /// Moves the multipliers of row i to the neighbourhood of the central path. Multipliers of 0 and NaN move to the
    /// path.
    pub(super) fn center(&mut self, i: usize, mu: f64, factor: f64) {
        let distances = self.distances(i);
        for (z, distance) in self.z.iter_mut().zip(distances) {
            let path = mu / distance;
            z[i] = if z[i] == 0.0 || z[i].is_nan() { path } else { clamp(z[i], path, factor) };
        }
    }

    /// Computes the inverse distances and the products after s and z have changed.
    pub(super) fn renew(&mut self) {
        self.advance([0.0; 2], None);
    }

    /// Moves s by the step length α and z by β. Then moves z to the neighbourhood of the central path of μ.
    pub(super) fn advance(&mut self, lengths: [f64; 2], mu: Option<f64>) {
        at_level(Advance { barrier: self, lengths, mu });
    }

    /// Computes slope and curvature of all rows for the values g:
    ///
    /// ```text
    /// Σ = z_l / (s − lower) + z_u / (upper − s),     d = Σ (g − s) + μ / (upper − s) − μ / (s − lower)
    /// ```
    pub(super) fn write_terms(&self, g: &[f64], mu: f64, terms: &mut [[f64; 2]]) {
        at_level(Terms { barrier: self, g, mu, terms });
    }

    /// Computes the steps of s and z from the changes of g in `ds`. Also computes the steps of the multipliers y of the
    /// inequalities, dy = d + Σ δg − y; `dy` of other rows is kept.
    pub(super) fn find_step(&mut self, g: &[f64], mu: f64, y: &[f64], dy: &mut [f64]) -> StepLimits {
        let mut limits = StepLimits::default();
        at_level(Find { barrier: self, g, mu, y, dy, limits: &mut limits });
        limits
    }

    /// Returns Σ |g − s| and −Σ log of all distances, for a step of s of length α.
    pub(super) fn merit(&self, g: &[f64], alpha: f64) -> [f64; 2] {
        let mut merit = [0.0; 2];
        at_level(Merit { barrier: self, g, alpha, merit: &mut merit });
        merit
    }
}

/// Returns the number of rows with padding.
pub(super) fn padded(rows: usize) -> usize {
    rows.next_multiple_of(8)
}

/// Returns z, moved to the interval [path / factor, path · factor].
#[inline(always)]
pub(super) fn clamp(z: f64, path: f64, factor: f64) -> f64 {
    let (low, high) = (path / factor, path * factor);
    match z {
        z if z < low => low,
        z if z > high => high,
        z => z,
    }
}

/// Returns eight numbers of x, from a multiple of eight.
#[inline(always)]
fn load(x: &[f64], at: usize) -> Eight {
    x.as_chunks::<8>().0[at]
}

#[inline(always)]
fn store(x: &mut [f64], at: usize, numbers: Eight) {
    x.as_chunks_mut::<8>().0[at] = numbers;
}

/// Maximum of numbers that are not negative, in eight lanes; NaN if one of them is NaN. Such numbers have the same
/// order as their bits, and NaN is the largest. Negative numbers are ignored.
#[derive(Clone, Copy, Default)]
struct Largest([i64; 8]);

impl Largest {
    #[inline(always)]
    fn add(&mut self, x: Eight) {
        self.0 = array::from_fn(|k| self.0[k].max(x[k].to_bits() as i64));
    }

    fn value(self) -> f64 {
        f64::from_bits(self.0.into_iter().fold(0, i64::max) as u64)
    }
}

/// Minimum of numbers that are not negative, in eight lanes; not positive if one of them is not.
#[derive(Clone, Copy)]
struct Least([i64; 8]);

impl Least {
    #[inline(always)]
    fn add(&mut self, x: Eight) {
        self.0 = array::from_fn(|k| self.0[k].min(x[k].to_bits() as i64));
    }

    fn value(self) -> f64 {
        f64::from_bits(self.0.into_iter().fold(i64::MAX, i64::min) as u64)
    }
}

impl Default for Least {
    fn default() -> Self {
        Self([f64::INFINITY.to_bits() as i64; 8])
    }
}

/// Sum in eight lanes.
#[derive(Clone, Copy, Default)]
struct Sum(Eight);

impl Sum {
    #[inline(always)]
    fn add(&mut self, x: Eight) {
        self.0 = array::from_fn(|k| self.0[k] + x[k]);
    }

    fn value(self) -> f64 {
        self.0.into_iter().sum()
    }
}

/// Sum of logarithms of positive numbers in eight lanes: a product with a mantissa in [1, 2), and its exponent.
#[derive(Clone, Copy)]
struct Logarithms {
    mantissas: Eight,
    exponents: [i64; 8],
}

impl Default for Logarithms {
    fn default() -> Self {
        Self { mantissas: [1.0; 8], exponents: [0; 8] }
    }
}

impl Logarithms {
    #[inline(always)]
    fn add(&mut self, x: Eight) {
        const MANTISSA: u64 = (1 << 52) - 1;
        for k in 0..8 {
            let bits = (self.mantissas[k] * x[k]).to_bits();
            self.exponents[k] += (bits >> 52) as i64 - 1023;
            self.mantissas[k] = f64::from_bits(bits & MANTISSA | 1.0_f64.to_bits());
        }
    }

    fn value(self) -> f64 {
        let exponent = self.exponents.into_iter().sum::<i64>() as f64;
        exponent * core::f64::consts::LN_2 + self.mantissas.into_iter().map(f64::ln).sum::<f64>()
    }
}

struct Advance<'a> {
    barrier: &'a mut Barrier,
    lengths: [f64; 2],
    mu: Option<f64>,
}

impl Vectorized for Advance<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { barrier: Barrier { bounds, s, z, ds, dz, inverse, products, .. }, lengths: [alpha, beta], mu } =
            self;
        let (mut sum, mut multipliers, mut least, mut largest) =
            (Sum::default(), Sum::default(), Least::default(), Largest::default());
        for at in 0..s.len() / 8 {
            let step = load(ds, at);
            let moved: Eight = array::from_fn(|k| load(s, at)[k] + alpha * step[k]);
            store(s, at, moved);
            for side in 0..2 {
                let bound = load(&bounds[side], at);
                let distance: Eight =
                    array::from_fn(|k| if side == 0 { moved[k] - bound[k] } else { bound[k] - moved[k] });
                let inverses: Eight = distance.map(|distance| 1.0 / distance);
                store(&mut inverse[side], at, inverses);
                let (old, dz) = (load(&z[side], at), load(&dz[side], at));
                let mut new: Eight = array::from_fn(|k| old[k] + beta * dz[k]);
                if let Some(mu) = mu {
                    new = array::from_fn(|k| clamp(new[k], mu * inverses[k], OFF_PATH));
                }
                store(&mut z[side], at, new);
                multipliers.add(new);
                let is_finite = |k: usize| inverses[k] != 0.0;
                let product: Eight = array::from_fn(|k| new[k] * if is_finite(k) { distance[k] } else { 0.0 });
                sum.add(product);
                largest.add(product);
                least.add(array::from_fn(|k| if is_finite(k) { product[k] } else { f64::INFINITY }));
            }
        }
        *products = Products {
            sum: sum.value(),
            least: least.value(),
            largest: largest.value(),
            multipliers: multipliers.value(),
        };
    }
}

struct Terms<'a> {
    barrier: &'a Barrier,
    g: &'a [f64],
    mu: f64,
    terms: &'a mut [[f64; 2]],
}

/// Returns slope and curvature of eight rows; zero without bounds.
#[inline(always)]
fn term(z: [Eight; 2], inverse: [Eight; 2], excess: Eight, mu: f64) -> [Eight; 2] {
    let curvature: Eight = array::from_fn(|k| z[0][k] * inverse[0][k] + z[1][k] * inverse[1][k]);
    let slope = |k: usize| curvature[k] * excess[k] + mu * (inverse[1][k] - inverse[0][k]);
    [array::from_fn(|k| if curvature[k] == 0.0 { 0.0 } else { slope(k) }), curvature]
}

impl Vectorized for Terms<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { barrier: Barrier { s, z, inverse, .. }, g, mu, terms } = self;
        for (at, terms) in terms.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let both = |x: &[Vec<f64>; 2]| [load(&x[0], at), load(&x[1], at)];
            let (g, s) = (load(g, at), load(s, at));
            let [slope, curvature] = term(both(z), both(inverse), array::from_fn(|k| g[k] - s[k]), mu);
            *terms = array::from_fn(|k| [slope[k], curvature[k]]);
        }
    }
}

struct Find<'a> {
    barrier: &'a mut Barrier,
    g: &'a [f64],
    mu: f64,
    y: &'a [f64],
    dy: &'a mut [f64],
    limits: &'a mut StepLimits,
}

impl Vectorized for Find<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { barrier: Barrier { s, z, ds, dz, inverse, .. }, g, mu, y, dy, limits } = self;
        let (mut slope, mut primal, mut dual) = (Sum::default(), Largest::default(), Largest::default());
        for at in 0..s.len() / 8 {
            let both = |x: &[Vec<f64>; 2]| [load(&x[0], at), load(&x[1], at)];
            let (z, inverse) = (both(z), both(inverse));
            let (g, s, y, change) = (load(g, at), load(s, at), load(y, at), load(ds, at));
            let excess: Eight = array::from_fn(|k| g[k] - s[k]);
            let [d, curvature] = term(z, inverse, excess, mu);
            let kept = load(dy, at);
            let new = |k: usize| d[k] + curvature[k] * change[k] - y[k];
            store(dy, at, array::from_fn(|k| if curvature[k] == 0.0 { kept[k] } else { new(k) }));
            let step: Eight = array::from_fn(|k| if curvature[k] == 0.0 { 0.0 } else { change[k] + excess[k] });
            store(ds, at, step);
            primal.add(array::from_fn(|k| -step[k] * inverse[0][k]));
            primal.add(array::from_fn(|k| step[k] * inverse[1][k]));
            slope.add(array::from_fn(|k| step[k] * (inverse[1][k] - inverse[0][k])));
            for (side, toward) in [-1.0, 1.0].into_iter().enumerate() {
                let (z, inverse) = (z[side], inverse[side]);
                let change: Eight = array::from_fn(|k| (mu + toward * z[k] * step[k]) * inverse[k] - z[k]);
                store(&mut dz[side], at, change);
                dual.add(array::from_fn(|k| -change[k] / (z[k] + f64::MIN_POSITIVE)));
            }
        }
        *limits = StepLimits { decreases: [primal.value(), dual.value()], slope: slope.value() };
    }
}

struct Merit<'a> {
    barrier: &'a Barrier,
    g: &'a [f64],
    alpha: f64,
    merit: &'a mut [f64; 2],
}

impl Vectorized for Merit<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { barrier: Barrier { bounds, s, ds, inverse, .. }, g, alpha, merit } = self;
        let (mut infeasibility, mut least) = (Sum::default(), Least::default());
        let mut logarithms = [Logarithms::default(); 2];
        for at in 0..s.len() / 8 {
            let (s, ds, g) = (load(s, at), load(ds, at), load(g, at));
            let moved: Eight = array::from_fn(|k| s[k] + alpha * ds[k]);
            let bounded = |k: usize| load(&inverse[0], at)[k] + load(&inverse[1], at)[k] != 0.0;
            infeasibility.add(array::from_fn(|k| if bounded(k) { (g[k] - moved[k]).abs() } else { 0.0 }));
            for side in 0..2 {
                let bound = load(&bounds[side], at);
                let distance: Eight =
                    array::from_fn(|k| if side == 0 { moved[k] - bound[k] } else { bound[k] - moved[k] });
                let distance = distance.map(|distance| if distance == f64::INFINITY { 1.0 } else { distance });
                least.add(distance);
                logarithms[side].add(distance);
            }
        }
        let logarithms = logarithms.into_iter().map(Logarithms::value).sum::<f64>();
        *merit = [infeasibility.value(), if least.value() > 0.0 { -logarithms } else { f64::INFINITY }];
    }
}
