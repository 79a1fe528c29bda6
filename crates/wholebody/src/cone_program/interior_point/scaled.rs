//! Program in the form that the interior-point method receives: padded, without empty constraints, and scaled to
//! numbers of size one.
//!
//! The scaled unknowns x̂ are defined by x = D x̂. The unit Dⱼ is the size of xⱼ that the cost alone would give: C /
//! √Pⱼⱼ with C = max |cⱼ| / √Pⱼⱼ. Rows with two bounds limit Dⱼ. If xⱼ is the only non-zero unknown, such a row allows
//! |xⱼ| ≤ max(|lᵢ|, |uᵢ|) / |Gᵢⱼ|. Dⱼ is at most [`ROOM`] times this value. Without this limit, an unreachable task
//! would give a force of little weight a unit of millions of newtons. In this unit the force's limits would vanish. The
//! cost is divided by the greatest of |cⱼ| Dⱼ and Pⱼⱼ Dⱼ². So one tolerance serves weights that differ by many orders
//! of magnitude, such as the weights of tasks and of forces. Rows of Ĝ = G D, and the longest row of each cone, have
//! length one.

use crate::cone_program::{ConeProgram, Size, Status};
use condyle_linalg::{SLACK, View, add_product_vector, block, dot, mask, transposed_product_vector};
use std::ops::Range;

/// Threshold below which a diagonal entry of P counts as zero when units are chosen, relative to the greatest diagonal
/// entry.
const NO_CURVATURE: f64 = 1e-14;
/// Maximum ratio of an unknown's unit to the value that the bounds allow if the other unknowns are zero. With a ratio
/// of 1, programs with a singular cost matrix P lose digits; from 1000 on, some programs with unreachable tasks have no
/// solution.
const ROOM: f64 = 30.0;
/// Minimum of an unknown's unit after bounds have reduced the unit, relative to the size that the cost gives. P̂ⱼⱼ is
/// then at least the square of this number, which exceeds rounding errors.
const LEAST_SHARE: f64 = 1e-5;
/// Absolute tolerance for the bounds of a row or cone without coefficients.
const NO_ROW_TOLERANCE: f64 = 1e-9;

/// Origin of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Row of A, with its index.
    Equality(usize),
    /// Row of G, with its index.
    Row(usize),
    /// A row of F, for a cone of one dimension.
    Cone(usize),
}

/// Cone: its first row among the cones' rows of this program, its first row in F, and its dimension.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub at: usize,
    pub source: usize,
    pub dim: usize,
    /// Factor by which the cone's rows of F were multiplied.
    pub scale: f64,
}

/// Adjacent columns of Kᵀ, the rows of G and F, whose non-zero entries are in the same range of rows.
#[derive(Clone, Debug)]
struct Run {
    columns: Range<usize>,
    rows: Range<usize>,
}

/// Returns the range of rows in the blocks that a mask marks.
fn range(mask: u64, n: usize, ld: usize) -> Range<usize> {
    let (block, first) = (block(ld), mask.trailing_zeros() as usize);
    let end = 64 - mask.leading_zeros() as usize;
    if mask == 0 { 0..0 } else { block * first..n.min(block * end) }
}

/// Scaled program: minimise ½ xᵀ P x + cᵀ x subject to E x = e, l ≤ G x ≤ u, h + F x ∈ Q. The matrix K = [G; F]
/// contains the rows of G and of F. E and K are stored transposed.
#[derive(Clone, Debug, Default)]
pub(super) struct Scaled {
    /// Number of unknowns.
    pub n: usize,
    /// Offset from one column of a matrix to the next.
    pub ld: usize,
    /// Cost matrix P, with both triangles.
    pub P: Vec<f64>,
    pub c: Vec<f64>,
    /// Units D of the unknowns.
    pub units: Vec<f64>,
    /// Scratch: inverse of a maximum for each unknown. The maximum is the value that rows with two bounds allow if the
    /// other unknowns are zero.
    inverse_limits: Vec<f64>,
    /// Factor by which the cost P and c was multiplied.
    pub cost: f64,
    /// Eᵀ, with a column for each equality and for each row of G with l = u.
    pub E: Vec<f64>,
    pub e: Vec<f64>,
    pub equality_sources: Vec<Source>,
    pub equality_scales: Vec<f64>,
    /// Kᵀ = [Gᵀ Fᵀ], with a column for each row of G and of F.
    pub K: Vec<f64>,
    /// Mask of the non-zero blocks of each column. The columns of one cone share the union of their masks.
    pub masks: Vec<u64>,
    runs: Vec<Run>,
    /// Bounds l and u of the rows of G; 0 for a missing bound.
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// 1 if the bound exists, otherwise 0.
    pub has_lower: Vec<f64>,
    pub has_upper: Vec<f64>,
    pub sources: Vec<Source>,
    pub scales: Vec<f64>,
    pub h: Vec<f64>,
    pub cones: Vec<Cone>,
    /// Number of bounds and cones, the divisor of sᵀ z in the mean complementarity μ.
    pub degree: f64,
}

impl Scaled {
    pub(super) fn new(capacity: Size) -> Self {
        let Size { unknowns: n, equalities, rows, cone_rows } = capacity;
        let (ld, m, me) = (n + SLACK, rows + cone_rows, equalities + rows);
        let vector = Vec::with_capacity;
        Self {
            n,
            ld,
            P: vec![0.0; ld * n],
            c: vec![0.0; ld],
            units: vec![1.0; n],
            inverse_limits: vec![0.0; n],
            cost: 1.0,
            E: vec![0.0; ld * (me + SLACK)],
            e: vector(me),
            equality_sources: Vec::with_capacity(me),
            equality_scales: vector(me),
            K: vec![0.0; ld * (m + SLACK)],
            masks: Vec::with_capacity(m),
            runs: Vec::with_capacity(m),
            lower: vector(m),
            upper: vector(m),
            has_lower: vector(m),
            has_upper: vector(m),
            sources: Vec::with_capacity(m),
            scales: vector(m),
            h: vector(m),
            cones: Vec::with_capacity(cone_rows),
            degree: 0.0,
        }
    }

    /// Returns the number of rows of G in use.
    pub(super) fn rows(&self) -> usize {
        self.lower.len()
    }

    pub(super) fn equalities(&self) -> usize {
        self.e.len()
    }

    /// Returns the range of rows that contains the non-zero entries of a column. It consists of whole blocks, except
    /// that the last block may be shorter.
    pub(super) fn range(&self, column: usize) -> Range<usize> {
        range(self.masks[column], self.n, self.ld)
    }

    /// Computes y = K x, which is G x and F x. The padding of x must be zero.
    pub(super) fn multiply(&self, x: &[f64], y: &mut [f64]) {
        for Run { columns, rows } in &self.runs {
            let K = View::new(&self.K, self.ld).at(rows.start, columns.start);
            transposed_product_vector(&mut y[columns.clone()], rows.len(), K, &x[rows.start..]);
        }
    }

    /// Computes y += Kᵀ x, which is Gᵀ and Fᵀ times the two parts of x.
    pub(super) fn add_transposed(&self, x: &[f64], y: &mut [f64]) {
        for Run { columns, rows } in &self.runs {
            let K = View::new(&self.K, self.ld).at(rows.start, columns.start);
            add_product_vector(&mut y[rows.start..], rows.len(), K, &x[columns.clone()]);
        }
    }

    /// Returns the number of columns of Kᵀ, which are the rows of G and of F.
    pub(super) fn columns(&self) -> usize {
        self.rows() + self.h.len()
    }

    /// Loads the numbers of a program.
    ///
    /// # Errors
    /// [`Status::Infeasible`] if bounds contradict each other, or if a row without coefficients violates its bounds.
    pub(super) fn load(&mut self, program: &ConeProgram) -> Result<(), Status> {
        let (Size { unknowns: n, equalities, rows, .. }, ld) = (program.size, self.ld);
        let most = program.capacity().unknowns;
        if n != self.n {
            self.n = n;
            self.P.fill(0.0);
            self.c.fill(0.0);
            self.E.fill(0.0);
            self.K.fill(0.0);
        }
        self.choose_units(program);
        let (P, D) = (program.P.as_slice(), &self.units[..n]);
        for j in 0..n {
            let unit = self.cost * D[j];
            for i in j..n {
                let x = unit * D[i] * P[j * most + i];
                self.P[j * ld + i] = x;
                self.P[i * ld + j] = x;
            }
            self.c[j] = unit * program.c[j];
        }

        for list in [&mut self.e, &mut self.equality_scales, &mut self.lower, &mut self.upper, &mut self.h] {
            list.clear();
        }
        for list in [&mut self.has_lower, &mut self.has_upper, &mut self.scales] {
            list.clear();
        }
        self.equality_sources.clear();
        self.sources.clear();
        self.cones.clear();
        let (A, G, F) = (program.At.as_slice(), program.Gt.as_slice(), program.Ft.as_slice());
        for i in 0..equalities {
            self.add_row(&A[i * most..][..n], [program.b[i]; 2], Source::Equality(i))?;
        }
        for i in 0..rows {
            self.add_row(&G[i * most..][..n], [program.lower[i], program.upper[i]], Source::Row(i))?;
        }
        let mut first = 0;
        for &dim in &program.cones {
            if dim == 1 {
                let bounds = [-program.h[first], f64::INFINITY];
                self.add_row(&F[first * most..][..n], bounds, Source::Cone(first))?;
            }
            first += dim;
        }
        first = 0;
        for &dim in &program.cones {
            if dim > 1 {
                self.add_cone(&F[first * most..], most, &program.h[first..][..dim], first)?;
            }
            first += dim;
        }
        self.note_zeros();
        let bounds: f64 = self.has_lower.iter().zip(&self.has_upper).map(|(l, u)| l + u).sum();
        self.degree = bounds + self.cones.len() as f64;
        Ok(())
    }

    /// Computes the masks of the columns of Kᵀ, and the runs of columns with equal ranges.
    fn note_zeros(&mut self) {
        let (m, columns, ld) = (self.rows(), self.columns(), self.ld);
        self.masks.clear();
        self.masks.extend(self.K.chunks_exact(ld).take(columns).map(mask));
        for cone in &self.cones {
            let masks = &mut self.masks[m + cone.at..][..cone.dim];
            let all = masks.iter().fold(0, |all, mask| all | mask);
            masks.fill(all);
        }
        self.runs.clear();
        for k in 0..columns {
            let rows = self.range(k);
            match self.runs.last_mut() {
                Some(run) if run.rows == rows => run.columns.end = k + 1,
                _ => self.runs.push(Run { columns: k..k + 1, rows }),
            }
        }
    }

    /// Chooses the units of the unknowns and of the cost. The module's documentation gives the formulas.
    fn choose_units(&mut self, program: &ConeProgram) {
        let (n, most) = (program.size.unknowns, program.capacity().unknowns);
        let (P, c) = (|j: usize| program.P.as_slice()[j * most + j], &program.c[..n]);
        let greatest = (0..n).map(P).fold(0.0, f64::max);
        let units = &mut self.units[..n];
        let mut size = 0.0_f64;
        for j in 0..n {
            // For an unknown without curvature, the cost gives no size: use the greatest curvature.
            let curvature = match P(j) {
                own if own > NO_CURVATURE * greatest => own,
                _ if greatest > 0.0 => greatest,
                _ => 1.0,
            };
            units[j] = curvature.sqrt().recip();
            size = size.max(units[j] * c[j].abs());
        }
        // Without any curvature, the unit of length is 1.
        let length = if greatest > 0.0 && size > 0.0 { size } else { 1.0 };

        // inverse of the largest value that row i allows: max |Gᵢⱼ| / max(|lᵢ|, |uᵢ|)
        let inverse = &mut self.inverse_limits[..n];
        inverse.fill(0.0);
        for i in 0..program.size.rows {
            let (lower, upper) = (program.lower[i], program.upper[i]);
            let bound = lower.abs().max(upper.abs());
            if lower < upper && bound < f64::INFINITY {
                let weight = bound.recip();
                for (most, g) in inverse.iter_mut().zip(&program.row(i)[..n]) {
                    let share = weight * g.abs();
                    *most = if share > *most { share } else { *most };
                }
            }
        }
        let mut cost = 0.0_f64;
        for j in 0..n {
            let unit = length * units[j];
            units[j] = unit / (unit * inverse[j] / ROOM).clamp(1.0, LEAST_SHARE.recip());
            cost = cost.max(units[j] * c[j].abs()).max(units[j] * units[j] * P(j));
        }
        self.cost = if cost > 0.0 { cost.recip() } else { 1.0 };
    }

    fn add_row(&mut self, row: &[f64], [lower, upper]: [f64; 2], source: Source) -> Result<(), Status> {
        if lower > upper {
            return Err(Status::Infeasible);
        }
        let free = lower == f64::NEG_INFINITY && upper == f64::INFINITY;
        let D = &self.units[..self.n];
        let norm = length(row, D);
        if free || norm == 0.0 {
            let outside = (lower > NO_ROW_TOLERANCE) || (upper < -NO_ROW_TOLERANCE);
            return if outside { Err(Status::Infeasible) } else { Ok(()) };
        }
        let scale = norm.recip();
        let to = if lower == upper {
            let to = self.e.len() * self.ld;
            self.e.push(scale * lower);
            self.equality_sources.push(source);
            self.equality_scales.push(scale);
            &mut self.E[to..]
        } else {
            let to = self.lower.len() * self.ld;
            let bound = |x: f64| if x.is_finite() { [scale * x, 1.0] } else { [0.0; 2] };
            let ([lower, has_lower], [upper, has_upper]) = (bound(lower), bound(upper));
            self.lower.push(lower);
            self.upper.push(upper);
            self.has_lower.push(has_lower);
            self.has_upper.push(has_upper);
            self.sources.push(source);
            self.scales.push(scale);
            &mut self.K[to..]
        };
        for j in 0..row.len() {
            to[j] = scale * D[j] * row[j];
        }
        Ok(())
    }

    fn add_cone(&mut self, F: &[f64], stride: usize, h: &[f64], source: usize) -> Result<(), Status> {
        let (n, dim, at) = (self.n, h.len(), self.h.len());
        let row = |i: usize| &F[i * stride..][..n];
        let D = &self.units[..n];
        let norm = (0..dim).map(|i| length(row(i), D)).fold(0.0, f64::max);
        if norm == 0.0 {
            let radius = dot(&h[1..], &h[1..]).sqrt();
            return if radius > h[0] + NO_ROW_TOLERANCE { Err(Status::Infeasible) } else { Ok(()) };
        }
        let (scale, first) = (norm.recip(), self.rows() + at);
        for i in 0..dim {
            let (to, row) = (&mut self.K[(first + i) * self.ld..][..n], row(i));
            for j in 0..n {
                to[j] = scale * D[j] * row[j];
            }
            self.h.push(scale * h[i]);
        }
        self.cones.push(Cone { at, source, dim, scale });
        Ok(())
    }
}

/// Returns √Σ (xᵢ Dᵢ)², computed with eight independent sums.
fn length(x: &[f64], D: &[f64]) -> f64 {
    let (eights, units) = (x.chunks(8), D.chunks(8));
    let mut sums = [0.0; 8];
    for (x, D) in eights.zip(units) {
        for i in 0..x.len() {
            sums[i] += (x[i] * D[i]) * (x[i] * D[i]);
        }
    }
    sums.iter().sum::<f64>().sqrt()
}
