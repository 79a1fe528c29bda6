//! Rows of soft limits, whose bounds give way at a cost.

use super::barrier::{OFF_PATH, Products, StepLimits, clamp};
use crate::problem::Soft;

/// Maximum number of Newton steps to the central path, and the relative step below which they end.
const STEPS: usize = 20;
const CLOSE: f64 = 1e-6;

/// Finite bound of a row, which gives way by e. With σ = ±1 for an upper or a lower bound:
///
/// ```text
/// d = e + σ (bound − s),     z d = μ,     w e = μ,     slope(e) = z + w
/// ```
///
/// The last equation is the gradient of the cost with respect to e, and w is the multiplier of e ≥ 0. If the cost is
/// only quadratic, a negative e costs as much as a positive one, so that e ≥ 0 is not needed and w is 0.
#[derive(Debug, Clone, Copy, Default)]
struct Side {
    sign: f64,
    bound: f64,
    d: f64,
    e: f64,
    z: f64,
    w: f64,
    /// Steps of d, e, z and w.
    step: [f64; 4],
}

/// Newton equations of a bound, with d, e and w eliminated: z⁺ = z⁰ + curvature · σ δs.
struct Reduced {
    curvature: f64,
    z: f64,
    /// Factor c and residual r of δe = c (r + δz).
    c: f64,
    r: f64,
}

impl Side {
    fn new(sign: f64, bound: f64) -> Option<Self> {
        bound.is_finite().then(|| Self { sign, bound, ..Self::default() })
    }

    /// Eliminates d, e and w from the Newton equations:
    ///
    /// ```text
    /// c = 1 / (quadratic + w / e),     r = z + μ / e − slope(e)
    /// curvature = z / (d + c z),       z⁰ = z + curvature (μ / z − d − c r)
    /// ```
    ///
    /// Without w, the term μ / e is absent.
    fn reduce(&self, soft: Soft, mu: f64) -> Reduced {
        let Self { d, e, z, w, .. } = *self;
        let (c, r) = (1.0 / (soft.quadratic + w / e), z + mu_of_yield(soft, mu) / e - soft.slope(e));
        let curvature = z / (d + c * z);
        Reduced { curvature, z: z + curvature * (mu / z - d - c * r), c, r }
    }

    /// Sets d and e to the central path for the slack variable s, and z and w to their values there.
    ///
    /// The smaller of d and e is the root of F = slope(e) − μ / d − μ / e. F rises and is concave, so that Newton steps
    /// from below never pass the root.
    fn center(&mut self, soft: Soft, s: f64, mu: f64) {
        let room = self.sign * (self.bound - s);
        let [beyond, inside] = [(-room).max(0.0), room.max(0.0)];
        let (Soft { linear, quadratic }, of_e) = (soft, mu_of_yield(soft, mu));
        let most = (2.0 * mu / linear).min((2.0 * mu / quadratic).sqrt()); // infinite for a weight of 0
        let mut t = match linear > 0.0 {
            true => mu / soft.slope(beyond + most),
            false => mu / soft.slope(room.abs() + most),
        };
        for _ in 0..STEPS {
            let (e, d) = (beyond + t, inside + t);
            let value = soft.slope(e) - of_e / e - mu / d;
            let step = -value / (quadratic + of_e / (e * e) + mu / (d * d));
            t += step.max(0.0);
            if step.abs() <= CLOSE * t || step.is_nan() {
                break;
            }
        }
        (self.e, self.d) = (beyond + t, inside + t);
        (self.z, self.w) = (mu / self.d, of_e / self.e);
    }
}

/// Returns μ of the products w e: 0 if the cost is only quadratic.
fn mu_of_yield(soft: Soft, mu: f64) -> f64 {
    if soft.linear > 0.0 { mu } else { 0.0 }
}

/// Row of a soft limit. Its slack variable s may have any value.
#[derive(Debug, Clone, Copy)]
struct SoftRow {
    /// Index among all rows.
    index: usize,
    soft: Soft,
    /// Whether a control changes the row. Otherwise it is only reported.
    imposed: bool,
    s: f64,
    ds: f64,
    /// Lower and upper bound.
    sides: [Option<Side>; 2],
}

impl SoftRow {
    fn sides(&self) -> impl Iterator<Item = &Side> {
        self.sides.iter().flatten()
    }

    fn product_count(&self) -> usize {
        self.sides().count() * if self.soft.linear > 0.0 { 2 } else { 1 }
    }

    /// Returns slope and curvature of the row for the value g, and the Newton equations of its bounds.
    fn term(&self, g: f64, mu: f64) -> ([f64; 2], [Option<Reduced>; 2]) {
        let reduced = self.sides.map(|side| side.map(|side| side.reduce(self.soft, mu)));
        let [mut slope, mut curvature] = [0.0; 2];
        for (side, of) in self.sides().zip(reduced.iter().flatten()) {
            slope += side.sign * of.z;
            curvature += of.curvature;
        }
        ([slope + curvature * (g - self.s), curvature], reduced)
    }
}

/// Rows of soft limits with a finite bound.
#[derive(Debug, Clone, Default)]
pub(super) struct SoftRows {
    rows: Vec<SoftRow>,
    pub(super) products: Products,
    /// Derivative of the cost of all e along the step.
    pub(super) cost_slope: f64,
    /// Number of finite bounds of imposed rows.
    pub(super) bounds: usize,
    /// Number of products of imposed rows: two for each finite bound, or one if the cost is only quadratic.
    pub(super) count: usize,
}

impl SoftRows {
    /// Removes all rows.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        (self.bounds, self.count) = (0, 0);
    }

    /// Appends row `index`. A row without a finite bound is not imposed.
    pub(super) fn push(&mut self, index: usize, soft: Soft, [lower, upper]: [f64; 2], imposed: bool) {
        let sides = [Side::new(-1.0, lower), Side::new(1.0, upper)];
        let imposed = imposed && sides.iter().flatten().count() > 0;
        let row = SoftRow { index, soft, imposed, s: 0.0, ds: 0.0, sides };
        if imposed {
            self.bounds += row.sides().count();
            self.count += row.product_count();
        }
        self.rows.push(row);
    }

    /// Marks row `index` as one that no control changes.
    pub(super) fn fix(&mut self, index: usize) {
        if let Ok(at) = self.rows.binary_search_by_key(&index, |row| row.index)
            && std::mem::take(&mut self.rows[at].imposed)
        {
            self.bounds -= self.rows[at].sides().count();
            self.count -= self.rows[at].product_count();
        }
    }

    fn imposed(&self) -> impl Iterator<Item = &SoftRow> {
        self.rows.iter().filter(|row| row.imposed)
    }

    fn imposed_mut(&mut self) -> impl Iterator<Item = &mut SoftRow> {
        self.rows.iter_mut().filter(|row| row.imposed)
    }

    /// Sets s to the values g, and all other variables to the central path. Writes the multipliers y.
    pub(super) fn start(&mut self, g: &[f64], mu: f64, y: &mut [f64]) {
        self.place(g, mu, y, None);
    }

    /// Sets s to the values g and e to the central path. Takes z and w from the multipliers y, at most a factor
    /// `factor` away from the central path. Writes y.
    pub(super) fn resume(&mut self, g: &[f64], mu: f64, y: &mut [f64], factor: f64) {
        self.place(g, mu, y, Some(factor));
    }

    fn place(&mut self, g: &[f64], mu: f64, y: &mut [f64], factor: Option<f64>) {
        for row in self.imposed_mut() {
            let (old, soft) = (y[row.index], row.soft);
            (row.s, row.ds, y[row.index]) = (g[row.index], 0.0, 0.0);
            for side in row.sides.iter_mut().flatten() {
                side.center(soft, row.s, mu);
                let given = side.sign * old;
                if let Some(factor) = factor
                    && given > 0.0
                {
                    side.z = clamp(given, side.z, factor);
                    side.w = clamp(soft.slope(side.e) - side.z, side.w, factor); // 0 remains 0
                }
                y[row.index] += side.sign * side.z;
            }
        }
        self.advance([0.0; 2], None);
    }

    /// Moves s, d and e by the step length α, and z and w by β. Then moves z and w to the neighbourhood of the central
    /// path of μ.
    pub(super) fn advance(&mut self, [alpha, beta]: [f64; 2], mu: Option<f64>) {
        let mut products = Products { least: f64::INFINITY, ..Products::default() };
        for row in self.imposed_mut() {
            row.s += alpha * row.ds;
            row.ds = 0.0;
            for side in row.sides.iter_mut().flatten() {
                let Side { d, e, z, w, step, .. } = side;
                let [dd, de, dz, dw] = std::mem::take(step);
                *d += alpha * dd;
                *e += alpha * de;
                *z += beta * dz;
                *w += beta * dw;
                if let Some(mu) = mu {
                    let exact = row.soft.slope(*e) - *z; // z contains rounding errors of g, times the curvature
                    *w = if exact > 0.5 * *w && exact < 2.0 * *w { exact } else { *w };
                    (*z, *w) = (clamp(*z, mu / *d, OFF_PATH), clamp(*w, mu_of_yield(row.soft, mu) / *e, OFF_PATH));
                }
                let of_e = (row.soft.linear > 0.0).then_some(*w * *e);
                for product in [Some(*z * *d), of_e].into_iter().flatten() {
                    products.sum += product;
                    products.least = if product >= products.least { products.least } else { product };
                    products.largest = if product <= products.largest { products.largest } else { product };
                }
                products.multipliers += *z;
            }
        }
        self.products = products;
    }

    /// Writes slope and curvature of the rows.
    pub(super) fn write_terms(&self, g: &[f64], mu: f64, terms: &mut [[f64; 2]]) {
        for row in self.imposed() {
            (terms[row.index], _) = row.term(g[row.index], mu);
        }
    }

    /// Computes the steps of all variables from the changes of g. Writes the steps of the multipliers y to `dy`.
    pub(super) fn find_step(&mut self, [g, changes, y]: [&[f64]; 3], mu: f64, dy: &mut [f64]) -> StepLimits {
        let (mut limits, mut cost_slope) = (StepLimits::default(), 0.0);
        let larger = |a: f64, b: f64| if a <= b { b } else { a };
        for row in self.imposed_mut() {
            let (i, soft) = (row.index, row.soft);
            let (_, reduced) = row.term(g[i], mu);
            row.ds = changes[i] + g[i] - row.s;
            dy[i] = -y[i];
            for (side, of) in row.sides.iter_mut().zip(reduced) {
                let (Some(side), Some(Reduced { curvature, z: z0, c, r })) = (side, of) else { continue };
                let Side { sign, d, e, z, w, .. } = *side;
                let moved = sign * row.ds;
                let new = z0 + curvature * moved;
                let dz = new - z;
                let dd = mu / z - d - d / z * dz;
                let de = if c * z > d { dd + moved } else { c * (r + dz) }; // the form with fewer rounding errors
                let dw = mu_of_yield(soft, mu) / e - w - w / e * de;
                side.step = [dd, de, dz, dw];
                dy[i] += sign * new;
                limits.decreases[0] = larger(-dd / d, limits.decreases[0]);
                limits.decreases[1] = larger(-dz / z, limits.decreases[1]);
                limits.slope -= dd / d;
                if soft.linear > 0.0 {
                    limits.decreases[0] = larger(-de / e, limits.decreases[0]);
                    limits.decreases[1] = larger(-dw / w, limits.decreases[1]);
                    limits.slope -= de / e;
                }
                cost_slope += soft.slope(e) * de;
            }
        }
        self.cost_slope = cost_slope;
        limits
    }

    /// Returns Σ |g − s|, −Σ log of all d and e, and the cost of all e, for a step of length α.
    pub(super) fn merit(&self, g: &[f64], alpha: f64) -> [f64; 3] {
        let [mut infeasibility, mut logarithms, mut cost] = [0.0; 3];
        for row in self.imposed() {
            infeasibility += (g[row.index] - row.s - alpha * row.ds).abs();
            for Side { d, e, step: [dd, de, ..], .. } in row.sides() {
                let (d, e) = (d + alpha * dd, e + alpha * de);
                let [of_d, of_e] = [d, if row.soft.linear > 0.0 { e } else { 1.0 }];
                logarithms -= if of_d > 0.0 && of_e > 0.0 { of_d.ln() + of_e.ln() } else { f64::NEG_INFINITY };
                cost += row.soft.cost(e);
            }
        }
        [infeasibility, logarithms, cost]
    }

    /// Returns the cost of the values g outside their bounds.
    pub(super) fn cost(&self, g: &[f64]) -> f64 {
        let beyond = |row: &SoftRow, side: &Side| (side.sign * (g[row.index] - side.bound)).max(0.0);
        self.imposed().map(|row| row.sides().map(|side| row.soft.cost(beyond(row, side))).sum::<f64>()).sum()
    }

    /// Returns the largest residual of the gradient with respect to e; NaN if a residual is.
    pub(super) fn stationarity(&self) -> f64 {
        let residuals = self.imposed().flat_map(|row| row.sides().map(|side| (row.soft, side)));
        residuals.fold(0.0, |largest, (soft, Side { e, z, w, .. })| {
            let residual = (soft.slope(*e) - z - w).abs();
            if residual <= largest { largest } else { residual }
        })
    }
}
