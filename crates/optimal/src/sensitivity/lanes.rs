//! Adjoint passes of several solutions at once, one solution in each lane of the SIMD registers.
//!
//! The passes of [`System`](super::system::System) multiply matrices by vectors, so their time is the time in which the
//! processor reads the matrices. Entry (i, j) of a matrix is stored for all solutions of a group side by side. A
//! register then holds one entry of all solutions, and products need no sums across lanes. Dynamics with the structure
//! of semi-implicit Euler store only the rows of A and B for velocities, and triangular matrices only one half.
#![allow(non_snake_case)] // names follow the literature: A, B, K, L, P, T, E

use super::system::KnotFactor;
use crate::lq::DynamicsStructure;
use crate::problem::Shape;
use condyle_linalg::Aligned;
use condyle_spatial::block::{Block, MOST};
use condyle_spatial::gate::{Level, level};
use condyle_spatial::register_kernel;
use core::ops::Range;

/// Number of columns that are multiplied at once, so that sums of one column do not wait for each other.
const AT_ONCE: usize = 4;

/// Returns the number of solutions in a group: the number of lanes of the SIMD level.
fn width() -> usize {
    match level() {
        Level::Baseline => 1,
        Level::Avx512 => 8,
        _ => 4,
    }
}

/// Layout of a knot's factors: sizes, and offsets in the numbers of a group, as a number of registers.
#[derive(Debug, Clone, PartialEq)]
struct KnotLayout {
    ndx: usize,
    nu: usize,
    /// Number of rows of A and B that are stored: ndx, or nv with blocks.
    rows: usize,
    /// Blocks of T and E with the structure of semi-implicit Euler, and `None` for dense matrices.
    blocks: Option<Vec<Range<usize>>>,
    /// Offset of Δt, of each block of T and then of E, of A, B, K, L and P.
    start: usize,
}

impl KnotLayout {
    fn new(start: usize, factor: &KnotFactor, structure: &DynamicsStructure) -> Self {
        let (ndx, nu) = (factor.P.nrows(), factor.K.nrows());
        let blocks = structure.euler().map(|(_, blocks)| blocks.iter().map(|block| block.range()).collect());
        let rows = if blocks.is_some() { ndx / 2 } else { ndx };
        Self { ndx, nu, rows, blocks, start }
    }

    /// Returns the offsets of A, B, K, L and P, and the end.
    fn offsets(&self) -> [usize; 6] {
        let Self { ndx, nu, rows, blocks, start } = self;
        let blocks: usize = blocks.iter().flatten().map(|block| 2 * block.len() * block.len()).sum();
        let A = start + 1 + blocks;
        let B = A + rows * ndx;
        let K = B + rows * nu;
        let L = K + nu * ndx;
        let P = L + nu * (nu + 1) / 2;
        [A, B, K, L, P, P + ndx * (ndx + 1) / 2]
    }

    /// Appends the factors of one solution, in the order of the layout.
    fn append(&self, factor: &KnotFactor, structure: &DynamicsStructure, to: &mut Vec<f64>) {
        let KnotFactor { A, B, K, L, P, .. } = factor;
        let euler = structure.euler();
        to.push(euler.map_or(0.0, |(dt, _)| dt));
        for block in euler.iter().flat_map(|(_, blocks)| *blocks) {
            to.extend(block.T.iter().chain(&block.E));
        }
        let top = self.ndx - self.rows;
        to.extend(A.rows(top, self.rows).iter().chain(&B.rows(top, self.rows)));
        to.extend_from_slice(K.as_slice());
        for j in 0..self.nu {
            let column = &L.as_slice()[j * self.nu..][j..self.nu];
            to.push(1.0 / column[0]);
            to.extend_from_slice(&column[1..]);
        }
        for j in 0..self.ndx {
            to.extend_from_slice(&P.as_slice()[j * self.ndx..][j..self.ndx]);
        }
    }
}

/// Factors of several solutions with the same layout, and the vectors of a pass.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Indices of the solutions, one for each lane in use. The factors of other lanes are zeros.
    pub(super) members: Vec<usize>,
    lanes: usize,
    layout: Vec<KnotLayout>,
    /// Factors of each solution, until they are packed.
    rows: Vec<Vec<f64>>,
    /// Factors of all solutions, side by side, and whether they are up to date.
    numbers: Aligned,
    is_packed: bool,
    vectors: LaneVectors,
}

/// Vectors of a pass, with the numbers of all solutions side by side.
#[derive(Debug, Clone)]
struct LaneVectors {
    /// Gradients g_x, then p, then η: (N + 1) · ndx.
    x_duals: Aligned,
    /// Gradients g_u, then k, then υ, as the controls.
    controls: Aligned,
    /// States ξ, (N + 1) · ndx.
    states: Aligned,
    /// Costate in the form in which A and B are stored, and the next velocity: ndx.
    scratch: Aligned,
}

impl Group {
    /// Creates a group without solutions, with the layout of the given factors.
    pub(super) fn new(factors: &[KnotFactor], structures: &[&DynamicsStructure], shape: &Shape) -> Self {
        let (lanes, mut start) = (width(), 0);
        let layout = factors.iter().zip(structures).map(|(factor, structure)| {
            let knot = KnotLayout::new(start, factor, structure);
            start = knot.offsets()[5];
            knot
        });
        let layout: Vec<KnotLayout> = layout.collect();
        let zeros = |length: usize| Aligned::zeros(length * lanes);
        let states = (shape.horizon() + 1) * shape.ndx;
        let vectors = LaneVectors {
            x_duals: zeros(states),
            controls: zeros(shape.offsets[shape.horizon()]),
            states: zeros(states),
            scratch: zeros(shape.ndx),
        };
        let (members, rows, numbers) = (Vec::with_capacity(lanes), Vec::with_capacity(lanes), zeros(start));
        Self { members, lanes, layout, rows, numbers, is_packed: false, vectors }
    }

    /// Adds solution `index`. Returns whether the group has a free lane and the layout of the factors.
    pub(super) fn add(&mut self, index: usize, factors: &[KnotFactor], structures: &[&DynamicsStructure]) -> bool {
        let pairs = || factors.iter().zip(structures);
        let fits = |(own, (factor, structure)): (&KnotLayout, (&KnotFactor, &&DynamicsStructure))| {
            *own == KnotLayout::new(own.start, factor, structure)
        };
        if self.members.len() == self.lanes || !self.layout.iter().zip(pairs()).all(fits) {
            return false;
        }
        let mut row = Vec::with_capacity(self.numbers.len() / self.lanes);
        for (knot, (factor, structure)) in self.layout.iter().zip(pairs()) {
            knot.append(factor, structure, &mut row);
        }
        self.rows.push(row);
        self.is_packed = false;
        self.members.push(index);
        true
    }

    /// Solves the adjoint problems of all solutions for their right-hand sides g_x and g_u. The gradients with respect
    /// to the controls in `held`, a lane and an index each, count as zero.
    pub(super) fn solve(
        &mut self,
        by_states: &[&[f64]],
        by_controls: &[&[f64]],
        held: impl Iterator<Item = (usize, usize)>,
    ) {
        self.pack();
        let Self { lanes, layout, numbers, vectors, .. } = self;
        let LaneVectors { x_duals, controls, .. } = vectors;
        in_lanes(*lanes, Task::Gather(by_states, x_duals));
        in_lanes(*lanes, Task::Gather(by_controls, controls));
        for (lane, i) in held {
            controls[i * *lanes + lane] = 0.0;
        }
        in_lanes(*lanes, Task::Pass(layout, numbers, vectors));
    }

    /// Writes the factors of all solutions side by side, unless this is done already. A full group keeps no copies.
    fn pack(&mut self) {
        if self.is_packed {
            return;
        }
        let rows: Vec<&[f64]> = self.rows.iter().map(Vec::as_slice).collect();
        in_lanes(self.lanes, Task::Gather(&rows, &mut self.numbers));
        self.is_packed = true;
        if self.members.len() == self.lanes {
            self.rows = Vec::new();
        }
    }

    /// Writes ξ, υ and η of each solution: numbers for all states, controls and states.
    pub(super) fn write(&self, [states, controls, costates]: [&mut [&mut [f64]]; 3]) {
        let LaneVectors { x_duals, controls: us, states: xs, .. } = &self.vectors;
        in_lanes(self.lanes, Task::Scatter(xs, states));
        in_lanes(self.lanes, Task::Scatter(us, controls));
        in_lanes(self.lanes, Task::Scatter(x_duals, costates));
    }
}

/// Task that is compiled for each SIMD level.
enum Task<'a, 'b> {
    Gather(&'a [&'b [f64]], &'a mut [f64]),
    Pass(&'a [KnotLayout], &'a [f64], &'a mut LaneVectors),
    Scatter(&'a [f64], &'a mut [&'b mut [f64]]),
}

/// Does the task with the registers of the SIMD level.
fn in_lanes(lanes: usize, task: Task<'_, '_>) {
    if level() > Level::Baseline { in_registers(lanes, task) } else { run::<f64>(lanes, task) }
}

register_kernel! {
    /// Does the task with registers.
    fn in_registers<V>(lanes: usize, task: Task<'_, '_>) {
        run::<V>(lanes, task);
    }
}

#[inline(always)]
fn run<V: Block<Number = f64>>(lanes: usize, task: Task<'_, '_>) {
    assert!(lanes == V::LANES, "the SIMD level has changed since the sensitivities were created");
    match task {
        Task::Gather(from, to) => gather::<V>(from, to),
        Task::Pass(layout, numbers, vectors) => {
            backward::<V>(layout, numbers, vectors);
            forward::<V>(layout, numbers, vectors);
        }
        Task::Scatter(from, to) => scatter::<V>(from, to),
    }
}

/// Returns register k of numbers.
#[inline(always)]
fn get<V: Block<Number = f64>>(from: &[f64], k: usize) -> V {
    V::load(&from[k * V::LANES..][..V::LANES])
}

/// Writes register k of numbers.
#[inline(always)]
fn set<V: Block<Number = f64>>(to: &mut [f64], k: usize, x: V) {
    x.store(&mut to[k * V::LANES..][..V::LANES]);
}

/// Writes row k of numbers to lane k. Lanes without a row are zero.
#[inline(always)]
fn gather<V: Block<Number = f64>>(from: &[&[f64]], to: &mut [f64]) {
    let (n, mut i) = (from[0].len(), 0);
    while i < n {
        let (mut tile, count) = ([V::zero(); MOST], (n - i).min(V::LANES));
        for k in 0..from.len().min(V::LANES) {
            tile[k] = V::load_first(&from[k][i..i + count]);
        }
        V::transpose(&mut tile[..V::LANES]);
        for k in 0..count {
            set(to, i + k, tile[k]);
        }
        i += V::LANES;
    }
}

/// Writes lane k to row k of numbers.
#[inline(always)]
fn scatter<V: Block<Number = f64>>(from: &[f64], to: &mut [&mut [f64]]) {
    let (n, mut i) = (to[0].len(), 0);
    while i < n {
        let (mut tile, count) = ([V::zero(); MOST], (n - i).min(V::LANES));
        for k in 0..count {
            tile[k] = get(from, i + k);
        }
        V::transpose(&mut tile[..V::LANES]);
        for k in 0..to.len().min(V::LANES) {
            tile[k].store_first(&mut to[k][i..i + count]);
        }
        i += V::LANES;
    }
}

/// Adds Mᵀ x to y; M has the given number of rows and columns.
#[inline(always)]
fn add_transposed<V: Block<Number = f64>>(y: &mut [f64], M: &[f64], x: &[f64], rows: usize, columns: usize) {
    let mut j = 0;
    while j + AT_ONCE <= columns {
        let mut sums = [V::zero(); AT_ONCE];
        for i in 0..rows {
            let x: V = get(x, i);
            for c in 0..AT_ONCE {
                sums[c] = get::<V>(M, (j + c) * rows + i).mul_add(x, sums[c]);
            }
        }
        for c in 0..AT_ONCE {
            let sum = get::<V>(y, j + c) + sums[c];
            set(y, j + c, sum);
        }
        j += AT_ONCE;
    }
    while j < columns {
        let mut sum: V = get(y, j);
        for i in 0..rows {
            sum = get::<V>(M, j * rows + i).mul_add(get(x, i), sum);
        }
        set(y, j, sum);
        j += 1;
    }
}

/// Adds M x to y; M has the given number of rows and columns.
#[inline(always)]
fn add_product<V: Block<Number = f64>>(y: &mut [f64], M: &[f64], x: &[f64], rows: usize, columns: usize) {
    let mut j = 0;
    while j + AT_ONCE <= columns {
        let mut factors = [V::zero(); AT_ONCE];
        for c in 0..AT_ONCE {
            factors[c] = get(x, j + c);
        }
        for i in 0..rows {
            let mut sum: V = get(y, i);
            for c in 0..AT_ONCE {
                sum = get::<V>(M, (j + c) * rows + i).mul_add(factors[c], sum);
            }
            set(y, i, sum);
        }
        j += AT_ONCE;
    }
    while j < columns {
        let factor: V = get(x, j);
        for i in 0..rows {
            let sum = get::<V>(M, j * rows + i).mul_add(factor, get(y, i));
            set(y, i, sum);
        }
        j += 1;
    }
}

/// Adds a block of T and a block of E to products with A and B: q ← Tᵀq and v ← v + Δt Eᵀq if `TRANSPOSED` is set,
/// otherwise q ← Tq + Δt E v. Outside the blocks, T and E are the identity.
#[inline(always)]
fn euler<V: Block<Number = f64>, const TRANSPOSED: bool>(
    knot: &KnotLayout,
    numbers: &[f64],
    from: &[f64],
    [q, v]: [&mut [f64]; 2],
) {
    let dt: V = get(numbers, knot.start);
    for i in 0..knot.rows {
        let x: V = get(from, i);
        match TRANSPOSED {
            true => {
                let (by_q, by_v) = (get::<V>(q, i) + x, dt.mul_add(x, get(v, i)));
                set(q, i, by_q);
                set(v, i, by_v);
            }
            false => set(q, i, dt.mul_add(get(v, i), x)),
        }
    }
    let mut at = knot.start + 1;
    let Some(blocks) = &knot.blocks else { return };
    for k in 0..blocks.len() {
        let (first, n) = (blocks[k].start, blocks[k].end - blocks[k].start);
        let (T, E) = (at, at + n * n);
        at += 2 * n * n;
        for i in 0..n {
            let (mut by_T, mut by_E) = (V::zero(), V::zero());
            for j in 0..n {
                let entry = if TRANSPOSED { i * n + j } else { j * n + i };
                let x: V = get(from, first + j);
                by_T = get::<V>(numbers, T + entry).mul_add(x, by_T);
                let x = if TRANSPOSED { x } else { get(v, first + j) };
                by_E = get::<V>(numbers, E + entry).mul_add(x, by_E);
            }
            let own: V = get(from, first + i);
            match TRANSPOSED {
                true => {
                    let by_q = get::<V>(q, first + i) + (by_T - own);
                    let by_v = dt.mul_add(by_E - own, get(v, first + i));
                    set(q, first + i, by_q);
                    set(v, first + i, by_v);
                }
                false => set(q, first + i, dt.mul_add(by_E, by_T)),
            }
        }
    }
}

/// Computes p and k of all knots, from the last one to the first.
#[inline(always)]
fn backward<V: Block<Number = f64>>(layout: &[KnotLayout], numbers: &[f64], vectors: &mut LaneVectors) {
    let LaneVectors { x_duals, controls, scratch, .. } = vectors;
    let (ndx, horizon) = (layout[0].ndx, layout.len() - 1);
    for i in 0..(horizon + 1) * ndx {
        let g_x: V = get(x_duals, i);
        set(x_duals, i, -g_x); // p = −g_x
    }
    let mut end = controls_of(layout, horizon);
    for t in (0..horizon).rev() {
        let knot = &layout[t];
        let (nu, rows) = (knot.nu, knot.rows);
        let [A, B, K, L, ..] = knot.offsets();
        let of = |first: usize| &numbers[first * V::LANES..];
        let (own, after) = x_duals.split_at_mut((t + 1) * ndx * V::LANES);
        let p = &mut own[t * ndx * V::LANES..];
        let ahead = &mut scratch[..rows * V::LANES];
        ahead.copy_from_slice(&after[(ndx - rows) * V::LANES..][..rows * V::LANES]);
        if knot.blocks.is_some() {
            euler::<V, true>(knot, numbers, after, [&mut *p, &mut *ahead]);
        }
        let k = &mut controls[(end - nu) * V::LANES..end * V::LANES];
        end -= nu;
        for i in 0..nu {
            let g_u: V = get(k, i);
            set(k, i, -g_u);
        }
        add_transposed::<V>(k, of(B), ahead, rows, nu); // Qu = Bᵀp⁺ − g_u
        add_transposed::<V>(p, of(A), ahead, rows, ndx);
        add_transposed::<V>(p, of(K), k, nu, ndx); // p = Aᵀp⁺ + KᵀQu − g_x
        solve::<V>(k, of(L), nu);
    }
}

/// Replaces k by −(L Lᵀ)⁻¹ k. The columns of L are stored from the diagonal on, with the inverse of its entries.
#[inline(always)]
fn solve<V: Block<Number = f64>>(k: &mut [f64], L: &[f64], n: usize) {
    let mut at = 0;
    for j in 0..n {
        let x = get::<V>(k, j) * get(L, at);
        set(k, j, x);
        for i in 1..n - j {
            let rest = get::<V>(k, j + i) - get::<V>(L, at + i) * x;
            set(k, j + i, rest);
        }
        at += n - j;
    }
    for j in (0..n).rev() {
        at -= n - j;
        let mut x: V = get(k, j);
        for i in 1..n - j {
            x += get::<V>(L, at + i) * get(k, j + i); // the entries below are negative already
        }
        set(k, j, -(x * get(L, at)));
    }
}

/// Computes ξ, υ and η of all knots, from the first one to the last.
#[inline(always)]
fn forward<V: Block<Number = f64>>(layout: &[KnotLayout], numbers: &[f64], vectors: &mut LaneVectors) {
    let LaneVectors { x_duals, controls, states, scratch } = vectors;
    let (ndx, mut start) = (layout[0].ndx, 0);
    states[..ndx * V::LANES].fill(0.0);
    for t in 0..layout.len() {
        let knot = &layout[t];
        let (nu, rows) = (knot.nu, knot.rows);
        let [A, B, K, _, P, _] = knot.offsets();
        let of = |first: usize| &numbers[first * V::LANES..];
        let (now, after) = states.split_at_mut((t + 1) * ndx * V::LANES);
        let x = &now[t * ndx * V::LANES..];
        add_symmetric::<V>(&mut x_duals[t * ndx * V::LANES..], of(P), x, ndx); // η = p + P ξ
        if after.len() < ndx * V::LANES {
            return;
        }
        let u = &mut controls[start * V::LANES..(start + nu) * V::LANES];
        start += nu;
        add_product::<V>(u, of(K), x, nu, ndx); // υ = k + K ξ
        let next = &mut scratch[..rows * V::LANES];
        next.fill(0.0);
        add_product::<V>(next, of(A), x, rows, ndx);
        add_product::<V>(next, of(B), u, rows, nu); // ξ⁺ = A ξ + B υ
        after[(ndx - rows) * V::LANES..][..rows * V::LANES].copy_from_slice(next);
        if knot.blocks.is_some() {
            euler::<V, false>(knot, numbers, x, [after, next]);
        }
    }
}

/// Adds P x to y. P is symmetric, and the columns of its lower triangle are stored one after the other.
#[inline(always)]
fn add_symmetric<V: Block<Number = f64>>(y: &mut [f64], P: &[f64], x: &[f64], n: usize) {
    let mut at = 0;
    for j in 0..n {
        let own: V = get(x, j);
        let mut sum = get::<V>(P, at).mul_add(own, get(y, j));
        for i in 1..n - j {
            let entry: V = get(P, at + i);
            sum = entry.mul_add(get(x, j + i), sum);
            let rest = entry.mul_add(own, get(y, j + i));
            set(y, j + i, rest);
        }
        set(y, j, sum);
        at += n - j;
    }
}

/// Returns the number of controls of all knots before knot t.
#[inline(always)]
fn controls_of(layout: &[KnotLayout], t: usize) -> usize {
    let mut sum = 0;
    for k in 0..t {
        sum += layout[k].nu;
    }
    sum
}
