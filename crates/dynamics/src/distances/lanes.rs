//! Distances and gradients of many pairs, with one pair per lane of a SIMD register.

use super::round::{Round, capsules, spheres};
use condyle_spatial::block::Block;
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

/// Loads a row of numbers for each item of a group, one item per lane. The last item fills the remaining lanes.
#[inline(always)]
fn load<V: Block<Number = f64>>(group: &[Item], side: usize, rounds: &[Row]) -> [V; ROW] {
    let mut rows = [V::zero(); ROW];
    let mut at = 0;
    while at < ROW {
        for k in 0..V::LANES {
            let item = &group[if k < group.len() { k } else { group.len() - 1 }];
            rows[at + k] = V::load(&rounds[item[side] as usize][at..][..V::LANES]);
        }
        V::transpose(&mut rows[at..at + V::LANES]);
        at += V::LANES;
    }
    rows
}

/// Stores the numbers of each lane as the row of an item's result.
#[inline(always)]
fn store<V: Block<Number = f64>>(mut found: [V; ROW], group: &[Item], results: &mut [Row]) {
    let mut at = 0;
    while at < ROW {
        V::transpose(&mut found[at..at + V::LANES]);
        for k in 0..group.len() {
            found[at + k].store(&mut results[group[k][0] as usize][at..][..V::LANES]);
        }
        at += V::LANES;
    }
}

register_kernel! {
    /// Computes the distances of pairs of spheres, or of capsules, in lanes.
    fn pairs_in_lanes<V>(items: &[Item], rounds: &[Row], of_spheres: bool, results: &mut [Row]) {
        let mut at = 0;
        while at < items.len() {
            let end = if at + V::LANES < items.len() { at + V::LANES } else { items.len() };
            let group = &items[at..end];
            let (first, second) = (load::<V>(group, 1, rounds), load::<V>(group, 2, rounds));
            store(result(&first, &second, of_spheres), group, results);
            at = end;
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

/// Numbers of the columns 8 k to 8 k + 7, aligned to a register and to a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Columns(pub [f64; PADDING]);

/// Numbers from which gradients are computed.
pub(crate) struct Slopes<'a> {
    /// Joint columns S: for each of the six components, `blocks` entries.
    pub columns: &'a [Columns],
    /// Number of blocks of columns.
    pub blocks: usize,
    /// Signs, `blocks` entries for each pair of bodies: 1 for a column that moves only the first body, −1 for the
    /// second, 0 for others.
    pub signs: &'a [Columns],
    /// Index of the pair of bodies of each pair of shapes.
    pub sign_of: &'a [u32],
    /// Results of each pair.
    pub results: &'a [Row],
    /// Number of coordinates.
    pub nv: usize,
}

/// Returns the force n at the point p of a result: n, and the moment p × n about the origin.
#[inline(always)]
fn force<V: Block<Number = f64>>(row: &Row) -> [V; 6] {
    let (n, p) = (vector(row, 4), vector(row, 1));
    let m = p.cross(n);
    [V::splat(n.x), V::splat(n.y), V::splat(n.z), V::splat(m.x), V::splat(m.y), V::splat(m.z)]
}

/// Computes the gradients nᵀ (J₁ − J₂) of K pairs from pair k on. A row is written with its padding, which the first
/// block of the next row overwrites. So the last blocks are computed first.
#[inline(always)]
fn some_rows<V: Block<Number = f64>, const K: usize>(s: &Slopes<'_>, k: usize, to: &mut [f64]) {
    let mut f = [[V::zero(); 6]; K];
    for j in 0..K {
        f[j] = force(&s.results[k + j]);
    }
    for j in (0..s.blocks).rev() {
        let mut at = 0;
        while at < PADDING {
            let mut sums = [V::zero(); K];
            for i in 0..6 {
                let column = V::load(&s.columns[i * s.blocks + j].0[at..][..V::LANES]);
                for j in 0..K {
                    sums[j] = column.mul_add(f[j][i], sums[j]); // Sᵀ f
                }
            }
            for i in 0..K {
                let signs = V::load(&s.signs[s.sign_of[k + i] as usize * s.blocks + j].0[at..][..V::LANES]);
                (sums[i] * signs).store(&mut to[(k + i) * s.nv + j * PADDING + at..][..V::LANES]);
            }
            at += V::LANES;
        }
    }
}
/// Number of pairs for which a column is loaded once; chosen because 100 gradients of 29 coordinates take 0.9 µs. They
/// take 1.6 µs with 1, 1.05 µs with 2 and 1.1 µs with 4 pairs.
const AT_ONCE: usize = 3;

/// Computes the gradients of all pairs, row after row.
#[inline(always)]
fn rows<V: Block<Number = f64>>(s: &Slopes<'_>, to: &mut [f64]) {
    let (n, mut k) = (s.results.len(), 0);
    while k + AT_ONCE <= n {
        some_rows::<V, AT_ONCE>(s, k, to);
        k += AT_ONCE;
    }
    while k < n {
        some_rows::<V, 1>(s, k, to);
        k += 1;
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
