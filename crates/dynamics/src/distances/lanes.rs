//! Distances and gradients of many pairs, with one pair per lane of a SIMD register.

use super::round::{Round, capsules, spheres};
use alloc::vec::Vec;
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

/// Number of components of a joint column: its linear and its angular velocity.
pub(crate) const COMPONENTS: usize = 6;

/// Coordinates that change the distances of a pair of bodies.
#[derive(Clone, Debug)]
pub(crate) struct Signs {
    /// Signs of the columns, block by block: 1 for a column that moves only the first body, −1 for the second, 0 for
    /// others.
    pub signs: Vec<Columns>,
    /// Bit j: whether block j has a sign that is not 0. All blocks from 63 on share the last bit.
    pub blocks: u64,
}

impl Signs {
    /// Returns signs that are all 0.
    pub(crate) fn new(blocks: usize) -> Self {
        Self { signs: vec![Columns::default(); blocks], blocks: 0 }
    }

    /// Sets the sign of a coordinate.
    pub(crate) fn set(&mut self, coordinate: usize, sign: f64) {
        let block = coordinate / PADDING;
        self.signs[block].0[coordinate % PADDING] = sign;
        self.blocks |= 1 << block.min(LAST);
    }
}

/// Index of the last bit of [`Signs::blocks`].
const LAST: usize = 63;

/// Numbers from which gradients are computed.
pub(crate) struct Slopes<'a> {
    /// Joint columns S: the six components of the first block, then of the second block, and so on.
    pub columns: &'a [Columns],
    /// Signs of the columns for each pair of bodies.
    pub signs: &'a [Signs],
    /// Index of the pair of bodies of each pair of shapes.
    pub sign_of: &'a [u32],
    /// Results of each pair.
    pub results: &'a [Row],
    /// Number of coordinates.
    pub nv: usize,
}

/// Returns the force n at the point p of a result: n, and the moment p × n about the origin.
#[inline(always)]
fn force<V: Block<Number = f64>>(row: &Row) -> [V; COMPONENTS] {
    let (n, p) = (vector(row, 4), vector(row, 1));
    let m = p.cross(n);
    [V::splat(n.x), V::splat(n.y), V::splat(n.z), V::splat(m.x), V::splat(m.y), V::splat(m.z)]
}

/// Computes the gradients nᵀ (J₁ − J₂) of all pairs, row after row. A row is written with its padding, which the next
/// row overwrites. Blocks without a sign are only filled with zeros: with 38 coordinates, half of the blocks.
#[inline(always)]
fn rows<V: Block<Number = f64>>(s: &Slopes<'_>, to: &mut [f64]) {
    let (columns, _) = s.columns.as_chunks::<COMPONENTS>();
    for (k, (result, &bodies)) in s.results.iter().zip(s.sign_of).enumerate() {
        let f: [V; COMPONENTS] = force(result);
        let Signs { signs, blocks } = &s.signs[bodies as usize];
        let (row, _) = to[k * s.nv..][..columns.len() * PADDING].as_chunks_mut::<PADDING>();
        for (j, ((column, signs), row)) in columns.iter().zip(signs).zip(row).enumerate() {
            let moves = blocks >> j.min(LAST) & 1 == 1;
            let mut at = 0;
            while at < PADDING {
                let mut sum = V::zero();
                if moves {
                    let (mut linear, mut angular) = (V::zero(), V::zero());
                    for i in 0..3 {
                        linear = V::load(&column[i].0[at..][..V::LANES]).mul_add(f[i], linear);
                        angular = V::load(&column[i + 3].0[at..][..V::LANES]).mul_add(f[i + 3], angular);
                    }
                    sum = (linear + angular) * V::load(&signs.0[at..][..V::LANES]); // Sᵀ f
                }
                sum.store(&mut row[at..][..V::LANES]);
                at += V::LANES;
            }
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
