//! Knots in implicit form: accelerations and forces take the place of the controls.
//!
//! Inverse dynamics is cheap, and sparse where forward dynamics is full. In place of δu take as many unknowns w out of
//! the changes of accelerations and contact forces, so that all others follow from w and δx by the equations that hold
//! no control (contacts stay, nothing drives the base). With the step of velocities ŷ = v⁺ = v + Δt a as the unknown,
//!
//! ```text
//! δu = U (w, δv, δq),     y_c = δv_c + w_k  (a coordinate that is an unknown),     y_d = δv_d + D_d (w, δv, δq)  (one that is not)
//! δq⁺ = T δq + Δt E y,    δv⁺ = y:        ½ δx⁺ᵀ P δx⁺ = ½ yᵀ Π y + yᵀ N δq + ½ δqᵀ Tᵀ P₁₁ T δq
//! ```
//!
//! with Π and N of [`riccati`](crate::riccati), so that the quadratic form of the knot is copies of Π and N and few outer
//! products, U's with the cost of controls, and D's with Z = (Π y + N δq)_d − ½ Π_dd D:
//!
//! ```text
//! H = [Π and N on w, δv, δq] + Uᵀ (R + ϱ 1) U + DᵀZ + ZᵀD + Gᵀ a″ G
//! ```
//!
//! where the rows G are those of residuals that look at more than δq. All rows have zeros where the tree of the robot
//! has none, which are left out in blocks. What follows is the elimination of w. P, p, K = U_x + U_w K_w and k = U_w k_w are
//! those of the explicit form, since for any δx the map from w to δu is invertible.
#![allow(non_snake_case)] // the names of the literature, and N, Π, D, U, Z

use crate::dense::{SLACK, Store, View, column_block, copy, copy_scaled, transpose};
use crate::factor::solve_transposed;
use crate::lq::{LqKnot, LqNode};
use crate::riccati::Work;
use crate::structure::EulerBlock;
use crate::vector::Vector;
use condyle_linalg::{SparseRows, block};

/// A knot's rows; see the head of the file. `r`, `q` and the part of `Q` for δq are those of the node; of its `A`, `B`, `S`
/// and `R` nothing is used.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Implicit {
    /// Whether the solver can use this form.
    pub(crate) wanted: bool,
    /// Whether the action wrote it.
    pub(crate) active: bool,
    /// Of all rows.
    pub(crate) stride: usize,
    /// Runs of coordinates that are unknowns: the first coordinate, the first unknown, how many.
    pub(crate) own: Vec<[usize; 3]>,
    /// The other coordinates.
    pub(crate) dependent: Vec<usize>,
    /// U.
    pub(crate) efforts: SparseRows,
    /// D, a row for each dependent coordinate.
    pub(crate) steps: SparseRows,
    /// G, and a′ and a″.
    pub(crate) costs: SparseRows,
    pub(crate) slopes: Vec<[f64; 2]>,
    /// The diagonals of Q for δv and of R, one after the other.
    pub(crate) diagonal: Vec<f64>,
}

impl Implicit {
    /// Room for a node of nv coordinates and nu controls with at most so many dependent coordinates and rows of costs.
    pub(crate) fn reserve(&mut self, nv: usize, nu: usize, [dependent, costs]: [usize; 2]) {
        self.stride = nu + 2 * nv + SLACK;
        self.own.reserve(nv);
        self.dependent.reserve(dependent);
        self.slopes.reserve(costs);
        self.diagonal.resize(nv + nu, 0.0);
        for (rows, most) in [(&mut self.efforts, nu), (&mut self.steps, dependent), (&mut self.costs, costs)] {
            rows.resize(most, self.stride);
        }
    }

    /// U and D, for as long as G is written.
    pub(crate) fn lend(&mut self) -> Self {
        let Self { wanted, active, stride, .. } = *self;
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        core::mem::replace(self, Self { wanted, active, stride, costs, slopes, diagonal, ..Self::default() })
    }

    /// Ends what `lend` began.
    pub(crate) fn take_back(&mut self, lent: Self) {
        let (costs, slopes) = (core::mem::take(&mut self.costs), core::mem::take(&mut self.slopes));
        let diagonal = core::mem::take(&mut self.diagonal);
        *self = Self { costs, slopes, diagonal, ..lent };
    }

    /// Takes over G.
    pub(crate) fn set_costs(&mut self, rows: &[f64], slopes: &[[f64; 2]]) {
        self.costs.resize(slopes.len(), self.stride);
        for (to, from) in self.costs.numbers.chunks_exact_mut(self.stride).zip(rows.chunks_exact(self.stride)) {
            to[..self.stride - SLACK].copy_from_slice(&from[..self.stride - SLACK]);
        }
        self.slopes.clear();
        self.slopes.extend_from_slice(slopes);
        self.costs.mark(self.stride);
    }
}

/// An outer product of some rows with as many others, with the same blocks of zeros.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// The first row on the left and on the right.
    rows: [usize; 2],
    masks: [u64; 2],
    count: usize,
}

/// Scratch of the form.
#[derive(Debug, Clone)]
pub(crate) struct Form {
    /// The factors of the outer products, with the factor of the gradient behind (w, δv, δq). Shape: rows of one stride.
    rows: Vec<f64>,
    count: usize,
    parts: Vec<Part>,
    /// ½ Π_dd. Shape: dependent × dependent, with slack rows.
    half: Vec<f64>,
    /// U_w. Shape: nu × nu, with slack rows.
    U: Vec<f64>,
    /// [K k], the states in the order (v, q). Shape: nu × n + 1, with slack rows.
    gains: Vec<f64>,
    /// Columns of dependent coordinates. Shape: n × dependent, with slack rows.
    below: Vec<f64>,
}

impl Form {
    /// What the rows of some nodes need at most, whichever are active: numbers in `rows`, parts, dependent coordinates.
    pub(crate) fn room(nodes: &[LqNode]) -> [usize; 3] {
        let rooms = nodes.iter().map(|LqNode { implicit, .. }| {
            let [efforts, steps, costs] =
                [&implicit.efforts, &implicit.steps, &implicit.costs].map(|rows| rows.masks.capacity());
            [2 * (efforts + steps + costs) * implicit.stride, efforts + 2 * steps + costs, steps]
        });
        rooms.fold([0; 3], |a, b| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])])
    }

    /// For n states and at most m controls, with such room.
    pub(crate) fn new([rows, parts, dependent]: [usize; 3], n: usize, m: usize) -> Self {
        Self {
            rows: vec![0.0; rows],
            count: 0,
            parts: Vec::with_capacity(parts),
            half: Vec::with_capacity((dependent + SLACK) * dependent),
            U: vec![0.0; (m + SLACK) * m],
            gains: vec![0.0; (m + SLACK) * (n + 1)],
            below: Vec::with_capacity((n + SLACK) * dependent),
        }
    }

    /// So many more rows; the first of them.
    #[inline(always)]
    fn take(&mut self, count: usize, size: usize) -> usize {
        let first = self.count;
        self.count += count;
        if self.rows.len() < self.count * size {
            self.rows.resize(self.count * size, 0.0);
        }
        first
    }

    /// A row for a factor, `a` times x.
    #[inline(always)]
    fn push<V: Vector>(&mut self, x: &[f64], a: f64) -> &mut [f64] {
        let at = self.take(1, x.len()) * x.len();
        let row = &mut self.rows[at..at + x.len()];
        copy_scaled::<V>(row, x, a);
        row
    }

    /// Of a row on the left with one on the right.
    #[inline(always)]
    fn multiply(&mut self, rows: [usize; 2], masks: [u64; 2]) {
        match self.parts.last_mut() {
            Some(last) if last.masks == masks && last.rows.map(|row| row + last.count) == rows => last.count += 1,
            _ => self.parts.push(Part { rows, masks, count: 1 }),
        }
    }

    /// H += a″ x xᵀ and a gradient of a′ x.
    #[inline(always)]
    fn square<V: Vector>(&mut self, x: &[f64], mask: u64, [d, dd]: [f64; 2], size: usize) {
        let (k, gradient) = (self.count, 1 << (size / block(x.len())));
        if dd > 0.0 {
            let root = dd.sqrt();
            self.push::<V>(x, root)[size] = d / root;
            self.multiply([k, k], [mask | gradient, mask]);
        } else if d != 0.0 || dd != 0.0 {
            self.push::<V>(x, dd)[size] = d;
            self.push::<V>(x, 1.0);
            self.multiply([k, k + 1], [mask | gradient, mask]);
        }
    }
}

impl Work {
    /// H of the knot, with ϱ in it, in the order (w, δv, δq).
    #[inline(always)]
    pub(crate) fn add_implicit<V: Vector, const NR: usize>(&mut self, node: &LqNode, regularisation: f64) {
        let (n, m) = (node.ndx(), node.nu());
        let (nv, ld, all) = (n / 2, self.stride(m), m + n);
        let (ldn, imp) = (nv + SLACK, &node.implicit);
        let (dt, blocks) = node.structure.euler().expect("an implicit node is one of Euler steps");
        self.step_curvature::<V, NR>(dt, blocks);
        let Self { H, euler, form, .. } = self;
        let (N, Pi, py) = (&euler.N, &euler.Pi, &euler.py);

        // Π and N on the unknowns and δv
        let forces = imp.own.last().map_or(0, |own| own[1] + own[2]);
        for &[c, k, length] in &imp.own {
            for j in 0..length {
                let column = &mut H[(k + j) * ld..][..ld];
                let (Pi, N) = (&Pi[(c + j) * ldn..][..nv], &N[(c + j) * ldn..][..nv]);
                for &[cc, kk, length] in &imp.own {
                    if kk >= k {
                        copy::<V>(&mut column[kk..], &Pi[cc..cc + length]);
                    }
                }
                for k in forces..m {
                    column[k] = 0.0;
                }
                copy::<V>(&mut column[m..], Pi);
                copy::<V>(&mut column[m + nv..], N);
                column[all] = py[c + j];
            }
        }
        for k in forces..m {
            H[k * ld + k..][..=all - k].fill(0.0);
        }
        for j in 0..nv {
            let column = &mut H[(m + j) * ld..][..ld];
            copy::<V>(&mut column[m + j..], &Pi[j * ldn + j..][..nv - j]);
            copy::<V>(&mut column[m + nv..], &N[j * ldn..][..nv]);
            column[m + j] += imp.diagonal[j];
            column[all] = py[j] + node.q[nv + j];
            let column = &mut H[(m + nv + j) * ld..][..ld];
            copy::<V>(&mut column[m + nv + j..], &node.Q.as_slice()[j * n + j..][..nv - j]);
            column[all] = node.q[j];
        }

        // Uᵀ (R + ϱ 1) U and Gᵀ a″ G
        let size = imp.stride;
        form.count = 0;
        form.parts.clear();
        for (k, (row, &mask)) in imp.efforts.numbers.chunks_exact(size).zip(&imp.efforts.masks).enumerate() {
            form.square::<V>(row, mask, [node.r[k], imp.diagonal[nv + k] + regularisation], all);
        }
        for ((row, &mask), &slopes) in imp.costs.numbers.chunks_exact(size).zip(&imp.costs.masks).zip(&imp.slopes) {
            form.square::<V>(row, mask, slopes, all);
        }
        // ZᵀD + DᵀZ
        let (D, count) = (form.count, imp.dependent.len());
        for row in imp.steps.numbers.chunks_exact(size) {
            form.push::<V>(row, 1.0);
        }
        let Z = form.take(count, size);
        let ldh = count + SLACK;
        form.half.resize(ldh * count, 0.0);
        for (j, &d) in imp.dependent.iter().enumerate() {
            let (Pi, N, row) = (&Pi[d * ldn..][..nv], &N[d * ldn..][..nv], &mut form.rows[(Z + j) * size..][..size]);
            for &[c, k, length] in &imp.own {
                copy::<V>(&mut row[k..], &Pi[c..c + length]);
            }
            row[forces..m].fill(0.0);
            copy::<V>(&mut row[m..], Pi);
            copy::<V>(&mut row[m + nv..], N);
            row[all] = py[d];
            for (i, &d) in imp.dependent.iter().enumerate() {
                form.half[j * ldh + i] = 0.5 * Pi[d]; // symmetric
            }
        }
        if count > 0 {
            let (D, Z) = form.rows[D * size..].split_at_mut(count * size);
            let (D, half) = (View { data: D, stride: size }, View { data: &form.half, stride: ldh });
            let mut j = 0;
            while j < count {
                column_block::<V, NR>(Z, size, 0..all, j, NR.min(count - j), D, half, count, Store::Add);
                j += NR;
            }
        }
        for (k, &mask) in imp.steps.masks.iter().enumerate() {
            form.multiply([Z + k, D + k], [u64::MAX, mask]);
        }
        for (k, &mask) in imp.steps.masks.iter().enumerate() {
            form.multiply([D + k, Z + k], [mask, u64::MAX]);
        }
        add_outer::<V, NR>(H, ld, all, form, size);
        self.position_curvature::<V, NR>(m, blocks);
    }

    /// Rows below H: Θ times the map from (w, δv, δq) to δx⁺, for a Θ of n rows (stride n + SLACK),
    ///
    /// ```text
    /// Ψ y + Θ_q T δq,   Ψ = Δt Θ_q E + Θ_v
    /// ```
    #[inline(always)]
    pub(crate) fn add_implicit_below<V: Vector, const NR: usize>(
        &mut self,
        Theta: &[f64],
        node: &LqNode,
        dt: f64,
        blocks: &[EulerBlock],
    ) {
        let (n, m) = (node.ndx(), node.nu());
        let (nv, ld, ldt, at, imp) = (n / 2, self.stride(m), n + SLACK, m + n + 1, &node.implicit);
        self.velocity_below::<V, NR>(Theta, dt, blocks);
        let Self { W: Psi, H, form: Form { below, .. }, .. } = self;
        for k in 0..m {
            H[k * ld + at..][..n].fill(0.0);
        }
        for &[c, k, length] in &imp.own {
            for j in 0..length {
                copy::<V>(&mut H[(k + j) * ld + at..], &Psi[(c + j) * ldt..][..n]);
            }
        }
        for j in 0..nv {
            copy::<V>(&mut H[(m + j) * ld + at..], &Psi[j * ldt..][..n]);
            H[(m + nv + j) * ld + at..][..n].fill(0.0);
        }
        let count = imp.dependent.len();
        below.resize(count * ldt, 0.0);
        for (to, &d) in below.chunks_exact_mut(ldt).zip(&imp.dependent) {
            copy::<V>(to, &Psi[d * ldt..][..n]);
        }
        let (a, D) = (View { data: below, stride: ldt }, View { data: &imp.steps.numbers, stride: imp.stride });
        let mut j = 0;
        while j < m + n && count > 0 {
            column_block::<V, NR>(&mut H[at..], ld, 0..n, j, NR.min(m + n - j), a, D, count, Store::Add);
            j += NR;
        }
        self.position_below::<V, NR>(Theta, m, blocks);
    }

    /// From H after the elimination of w, [L ·; X ·; yᵀ ·]:
    ///
    /// K = U_x − U_w L⁻ᵀ Xᵀ,   k = −U_w L⁻ᵀ y,   Quᵀk = −yᵀy = −kᵀQuu k
    #[inline(always)]
    pub(crate) fn gains_of_efforts<V: Vector, const NR: usize>(&mut self, node: &LqNode, knot: &mut LqKnot) {
        let (n, m) = (node.ndx(), node.nu());
        let (nv, ld, ldu) = (n / 2, self.stride(m), m + SLACK);
        let Self { H, form: Form { U, gains, .. }, .. } = self;
        let (efforts, size) = (&node.implicit.efforts.numbers, node.implicit.stride);
        transpose::<V>(U, ldu, 0, efforts, size, 0..m, 0..m);
        solve_transposed::<V, NR>(U, ldu, m, H, ld, m);
        transpose::<V>(gains, ldu, 0, efforts, size, m..m + n, 0..m);
        gains[n * ldu..][..m].fill(0.0);
        let (a, b) = (View { data: U, stride: ldu }, View { data: &H[m..], stride: ld });
        let mut j = 0;
        while j <= n {
            column_block::<V, NR>(gains, ldu, 0..m, j, NR.min(n + 1 - j), a, b, m, Store::Subtract);
            j += NR;
        }
        let K = knot.K.as_mut_slice();
        for j in 0..nv {
            copy::<V>(&mut K[j * m..], &gains[(nv + j) * ldu..][..m]);
            copy::<V>(&mut K[(nv + j) * m..], &gains[j * ldu..][..m]);
        }
        copy::<V>(knot.k.as_mut_slice(), &gains[n * ldu..][..m]);
        let mut square = 0.0;
        for j in 0..m {
            square += H[j * ld + m + n] * H[j * ld + m + n];
        }
        knot.expected = [-square, square];
    }
}

/// The lower triangle (with some of the upper one) of H += Σ left rightᵀ, and the row of the gradient below it, without
/// the blocks that are zero.
#[inline(always)]
fn add_outer<V: Vector, const NR: usize>(H: &mut [f64], ld: usize, size: usize, form: &Form, stride: usize) {
    let wide = block(stride);
    let bits = |from: usize, length: usize| {
        let (first, last) = (from / wide, (from + length - 1) / wide);
        (2_u64 << (last - first)).wrapping_sub(1) << first
    };
    let mut j = 0;
    while j < size {
        let columns = bits(j, NR.min(size - j));
        let mut i = j;
        while i <= size {
            let strip = if size - i >= V::N { 2 } else { 1 };
            let upper = bits(i, V::N);
            let lower = if strip == 2 { bits(i + V::N, V::N) } else { 0 };
            let mut tile = [[V::splat(0.0); 2]; NR];
            for part in &form.parts {
                if part.masks[1] & columns == 0 {
                    continue;
                }
                match [part.masks[0] & upper != 0, part.masks[0] & lower != 0] {
                    [true, true] => add_part::<V, 0, 2, NR>(&mut tile, &form.rows, stride, part, [i, j]),
                    [true, false] => add_part::<V, 0, 1, NR>(&mut tile, &form.rows, stride, part, [i, j]),
                    [false, true] => add_part::<V, 1, 2, NR>(&mut tile, &form.rows, stride, part, [i, j]),
                    [false, false] => (),
                }
            }
            for jj in 0..NR {
                if jj < size - j {
                    let column = &mut H[(j + jj) * ld + i..][..strip * V::N];
                    for s in 0..2 {
                        if s < strip {
                            let place = &mut column[s * V::N..];
                            V::load(place).add(tile[jj][s]).store(place);
                        }
                    }
                }
            }
            i += strip * V::N;
        }
        j += NR;
    }
}

/// The registers FROM..TO of rows of a tile at [i, j] += those of a part.
#[inline(always)]
fn add_part<V: Vector, const FROM: usize, const TO: usize, const NR: usize>(
    tile: &mut [[V; 2]; NR],
    rows: &[f64],
    stride: usize,
    part: &Part,
    [i, j]: [usize; 2],
) {
    for p in 0..part.count {
        let [left, right] = part.rows;
        let (left, right) = (&rows[(left + p) * stride + i..][..TO * V::N], &rows[(right + p) * stride + j..][..NR]);
        let mut registers = [V::splat(0.0); 2];
        for s in FROM..TO {
            registers[s] = V::load(&left[s * V::N..]);
        }
        for jj in 0..NR {
            let x = V::splat(right[jj]);
            for s in FROM..TO {
                tile[jj][s] = registers[s].mul_add(x, tile[jj][s]);
            }
        }
    }
}
