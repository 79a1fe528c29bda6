//! Distances and gradients of many pairs, with one pair per lane of a SIMD register.

use super::round::{Round, capsules, spheres};
use condyle_spatial::block::{Block, MOST, gather_rows, scatter_rows};
use condyle_spatial::gate::{Level, level};
use condyle_spatial::{Scalar, Vec3, register_kernel};

/// Number of entries of a sphere or capsule (middle, half vector, radius, 0), and of a result (distance, point on the
/// first shape, normal, 0). With eight entries, a row is one register.
pub(crate) const ROW: usize = 8;
/// Row of numbers of a sphere, a capsule or a result.
pub(crate) type Row = [f64; ROW];

/// Multiple of which the padded number of columns is; chosen because no register has more numbers.
pub(crate) const PADDING: usize = 8;

/// Returns a vector from three entries of a row.
#[inline(always)]
fn vector<S: Scalar>(row: &[S; ROW], k: usize) -> Vec3<S> {
    Vec3::new(row[k], row[k + 1], row[k + 2])
}

/// Returns the sphere or capsule with the numbers of a row.
#[inline(always)]
fn round<S: Scalar>(row: &[S; ROW]) -> Round<S> {
    Round { center: vector(row, 0), half: vector(row, 3), radius: row[6] }
}

/// Returns the row of a sphere or capsule.
pub(crate) fn row(round: &Round<f64>) -> Row {
    let (c, h) = (round.center, round.half);
    [c.x, c.y, c.z, h.x, h.y, h.z, round.radius, 0.0]
}

/// Computes the distance of two rows of spheres, or of capsules.
#[inline(always)]
fn result<S: Scalar>(first: &[S; ROW], second: &[S; ROW], of_spheres: bool) -> [S; ROW] {
    let (a, b) = (round(first), round(second));
    let w = if of_spheres { spheres(&a, &b) } else { capsules(&a, &b) };
    let (p, n) = (w.points[0], w.normal);
    [w.distance, p.x, p.y, p.z, n.x, n.y, n.z, S::zero()]
}

/// Pair whose distance is computed: index of the result, and indices of both shapes.
pub(crate) type Item = [u32; 3];

register_kernel! {
    /// Computes the distances of pairs of spheres, or of capsules, in lanes.
    fn pairs_in_lanes<V>(items: &[Item], rounds: &[Row], of_spheres: bool, results: &mut [Row]) {
        for group in items.chunks(V::LANES) {
            let (mut first, mut second) = ([V::zero(); ROW], [V::zero(); ROW]);
            for (side, to) in [(1, &mut first), (2, &mut second)] {
                let mut rows: [&[f64]; MOST] = [&[]; MOST];
                for k in 0..group.len() {
                    rows[k] = &rounds[group[k][side] as usize];
                }
                gather_rows(&rows[..group.len()], to);
            }
            let found = result(&first, &second, of_spheres);
            let mut numbers = [[0.0; ROW]; MOST];
            let mut rows: [&mut [f64]; MOST] = Default::default();
            for (row, numbers) in rows.iter_mut().zip(&mut numbers) {
                *row = numbers;
            }
            scatter_rows(&found, &mut rows[..group.len()]);
            for k in 0..group.len() {
                results[group[k][0] as usize] = numbers[k];
            }
        }
    }
}

/// Computes the distances of pairs of spheres, or of capsules.
pub(crate) fn compute(items: &[Item], rounds: &[Row], of_spheres: bool, results: &mut [Row]) {
    if level() > Level::Baseline {
        return pairs_in_lanes(items, rounds, of_spheres, results);
    }
    for &[k, a, b] in items {
        results[k as usize] = result(&rounds[a as usize], &rounds[b as usize], of_spheres);
    }
}

/// Numbers from which gradients are computed.
pub(crate) struct Slopes<'a> {
    /// Joint columns S, one row for each of the six components, with `stride` entries.
    pub columns: &'a [f64],
    /// Padded number of columns.
    pub stride: usize,
    /// Rows of signs: 1 for a column that moves only the first body, −1 for the second, 0 for others.
    pub signs: &'a [f64],
    /// Row of signs of each pair.
    pub sign_of: &'a [u32],
    /// Results of each pair.
    pub results: &'a [Row],
    /// Number of coordinates.
    pub nv: usize,
}

/// Computes the gradients nᵀ (J₁ − J₂) of all pairs, row after row. A row is written with its padding, which the next
/// row overwrites.
#[inline(always)]
fn rows<V: Block<Number = f64>>(s: &Slopes<'_>, to: &mut [f64]) {
    for (k, row) in s.results.iter().enumerate() {
        let (n, p) = (vector(row, 4), vector(row, 1));
        let m = p.cross(n);
        let f = [n.x, n.y, n.z, m.x, m.y, m.z].map(V::splat);
        let signs = &s.signs[s.sign_of[k] as usize * s.stride..][..s.stride];
        let to = &mut to[k * s.nv..][..s.stride];
        let mut at = 0;
        while at < s.stride {
            let mut sum = V::load(&s.columns[at..][..V::LANES]) * f[0];
            for i in 1..6 {
                sum = V::load(&s.columns[i * s.stride + at..][..V::LANES]).mul_add(f[i], sum); // Sᵀ f
            }
            (sum * V::load(&signs[at..][..V::LANES])).store(&mut to[at..][..V::LANES]);
            at += V::LANES;
        }
    }
}

register_kernel! {
    /// Computes gradients in lanes of columns.
    fn rows_in_lanes<V>(s: &Slopes<'_>, to: &mut [f64]) {
        rows::<V>(s, to);
    }
}

/// Computes the gradients of all pairs.
pub(crate) fn gradients(s: &Slopes<'_>, to: &mut [f64]) {
    if level() > Level::Baseline { rows_in_lanes(s, to) } else { rows::<f64>(s, to) }
}
