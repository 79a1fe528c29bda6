//! Lower or upper bounds of all rows G x of a program, with slack variables s = ±(G x − bound) ≥ 0 and multipliers z ≥
//! 0. All operations are element by element and vectorised.

use condyle_linalg::{Vector, Vectorized};

/// Lower or upper bounds of all rows. A row without this bound has s = z = 1, and its s and z never change.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// 1 for lower bounds, −1 for upper bounds.
    pub sign: f64,
    pub s: Vec<f64>,
    pub z: Vec<f64>,
    /// Reciprocals 1 / s of the slack variables. The field `inverse_z` has the reciprocals 1 / z of the multipliers.
    pub inverse_s: Vec<f64>,
    pub inverse_z: Vec<f64>,
    /// Quotients z / s of the multipliers and the slack variables.
    pub d: Vec<f64>,
    /// Residual ±(G x − bound) − s of each row.
    pub r: Vec<f64>,
    pub ds: Vec<f64>,
    pub dz: Vec<f64>,
}

impl Side {
    /// Sets the last direction to zero, because it may not be finite.
    pub(super) fn clear(&mut self) {
        self.ds.fill(0.0);
        self.dz.fill(0.0);
    }

    pub(super) fn new(rows: usize, sign: f64) -> Self {
        let vector = || vec![0.0; rows];
        let (s, z, inverse_s, inverse_z) = (vector(), vector(), vector(), vector());
        Self { sign, s, z, inverse_s, inverse_z, d: vector(), r: vector(), ds: vector(), dz: vector() }
    }
}

/// Computes the residual r = ±(G x − bound) − s and the quotient d = z / s of multiplier and slack variable. Adds ±z to
/// `multipliers`, and updates `sums`.
pub(super) struct Residuals<'a> {
    pub side: &'a mut Side,
    pub has: &'a [f64],
    pub bound: &'a [f64],
    pub Gx: &'a [f64],
    pub multipliers: &'a mut [f64],
    /// Maximum of |r| / max(1, s), sum of s z, and sum of ±bound z, with the residual r, the slack variable s and the
    /// multiplier z of each row.
    pub sums: &'a mut [f64; 3],
}

impl Vectorized for Residuals<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { side, has, bound, Gx, multipliers, sums } = self;
        let (m, sign) = (has.len(), side.sign);
        let (s, z, r, d) = (&side.s[..m], &side.z[..m], &mut side.r[..m], &mut side.d[..m]);
        let (bound, Gx, multipliers) = (&bound[..m], &Gx[..m], &mut multipliers[..m]);
        let mut partial = [[0.0_f64; 8]; 3];
        let (inverse_s, inverse_z) = (&mut side.inverse_s[..m], &mut side.inverse_z[..m]);
        for i in 0..m {
            r[i] = has[i] * (sign * (Gx[i] - bound[i]) - s[i]);
            (inverse_s[i], inverse_z[i]) = (1.0 / s[i], 1.0 / z[i]);
            d[i] = has[i] * (z[i] * inverse_s[i]);
            multipliers[i] += sign * has[i] * z[i];
        }
        for (k, block) in r.chunks(8).enumerate() {
            for j in 0..block.len() {
                let i = 8 * k + j;
                let share = if inverse_s[i] < 1.0 { inverse_s[i] } else { 1.0 };
                let excess = share * r[i].abs();
                partial[0][j] = if excess > partial[0][j] { excess } else { partial[0][j] };
                partial[1][j] += has[i] * s[i] * z[i];
                partial[2][j] += has[i] * bound[i] * z[i];
            }
        }
        sums[0] = partial[0].iter().fold(sums[0], |a, b| a.max(*b));
        sums[1] += partial[1].iter().sum::<f64>();
        sums[2] += sign * partial[2].iter().sum::<f64>();
    }
}

/// Adds ±t to `target`, with t = ξ / s − d r and ξ = σμ − s z − ds dz. Here s is a slack variable, z its multiplier, d
/// = z / s, and r the residual of s. ds and dz are the last directions, and σμ is the aim of the step
/// for the product s z. The term ds dz is only used if `second_order` is true.
pub(super) struct Target<'a> {
    pub side: &'a Side,
    pub has: &'a [f64],
    pub centre: f64,
    pub second_order: bool,
    pub target: &'a mut [f64],
}

impl Vectorized for Target<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { side, has, centre, second_order, target } = self;
        let (m, sign, b) = (has.len(), side.sign, if second_order { 1.0 } else { 0.0 });
        let inverse_s = &side.inverse_s[..m];
        let (z, r, d) = (&side.z[..m], &side.r[..m], &side.d[..m]);
        let (ds, dz, target) = (&side.ds[..m], &side.dz[..m], &mut target[..m]);
        for i in 0..m {
            target[i] += sign * has[i] * ((centre - b * ds[i] * dz[i]) * inverse_s[i] - z[i] - d[i] * r[i]);
        }
    }
}

/// Computes the directions of the slack variables s and of their multipliers z: ds = ±G dx + r and dz = (ξ − z ds) / s,
/// with ξ and r as in [`Target`]. Also raises `inverse_step` to the greatest of −ds/s and −dz/z.
pub(super) struct Direction<'a> {
    pub side: &'a mut Side,
    pub has: &'a [f64],
    pub centre: f64,
    pub second_order: bool,
    pub Gdx: &'a [f64],
    pub inverse_step: &'a mut f64,
}

impl Vectorized for Direction<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { side, has, centre, second_order, Gdx, inverse_step } = self;
        let (m, sign, b) = (has.len(), side.sign, if second_order { 1.0 } else { 0.0 });
        let (inverse_s, inverse_z) = (&side.inverse_s[..m], &side.inverse_z[..m]);
        let (z, r, d) = (&side.z[..m], &side.r[..m], &side.d[..m]);
        let (ds, dz, Gdx) = (&mut side.ds[..m], &mut side.dz[..m], &Gdx[..m]);
        for i in 0..m {
            let step = has[i] * (sign * Gdx[i] + r[i]);
            dz[i] = has[i] * ((centre - b * ds[i] * dz[i]) * inverse_s[i] - z[i] - d[i] * step);
            ds[i] = step;
        }
        let mut most = [0.0_f64; 8];
        for (k, block) in inverse_s.chunks(8).enumerate() {
            for j in 0..block.len() {
                let i = 8 * k + j;
                let (a, b) = (-ds[i] * inverse_s[i], -dz[i] * inverse_z[i]);
                let a = if a > b { a } else { b };
                most[j] = if a > most[j] { a } else { most[j] };
            }
        }
        *inverse_step = most.iter().fold(*inverse_step, |a, b| a.max(*b));
    }
}
