//! Splits the unknowns x of a program by its equalities. The basic unknowns x_B follow from the other unknowns z as x_B
//! = p − T z, with a vector p and a matrix T. A row of coefficients of x becomes a row of coefficients of z.

use crate::cone_program::ConeProgram;
use crate::numbers::Reader;
use condyle_linalg::{SLACK, Vector, Vectorized, View, add_product_vector, at_level, max_abs, product_without_slack};
use nalgebra::DMatrix;

/// Minimum size of a pivot, relative to the largest entry of the pivot's row before the elimination. A row without such
/// a pivot depends linearly on other rows.
const DEPENDENT: f64 = 1e-8;

/// Minimum size of a pivot of the last tick that is used again, relative to the largest entry of the pivot's row.
const KEEP: f64 = 0.05;

/// Index of an unknown in the list of basic unknowns or in the list of other unknowns.
#[derive(Clone, Copy)]
enum Place {
    Basic(usize),
    Other(usize),
}

/// Basic unknowns, other unknowns (z), and the map from z to x.
pub(crate) struct Basis {
    /// Indices in x of the basic unknowns.
    pub basic: Vec<usize>,
    /// Indices in x of the other unknowns (z).
    pub others: Vec<usize>,
    places: Vec<Place>,
    /// T of the equation x_B = p − T z. Shape: other unknowns × basic unknowns, with padding rows.
    T: DMatrix<f64>,
    /// Vector p of the equation x_B = p − T z.
    pub p: Vec<f64>,
    /// Scratch: the columns of basic unknowns in several rows. Shape: rows × basic unknowns, with padding.
    basic_part: DMatrix<f64>,
}

impl Basis {
    pub(crate) fn new(unknowns: usize, equalities: usize, rows: usize) -> Self {
        Self {
            basic: Vec::with_capacity(equalities),
            others: Vec::with_capacity(unknowns),
            places: vec![Place::Basic(0); unknowns],
            T: DMatrix::zeros(unknowns + SLACK, equalities),
            p: vec![0.0; equalities],
            basic_part: DMatrix::zeros(rows + 4 * SLACK, equalities),
        }
    }

    /// Returns column i of T, where x_B = p − T z. Basic unknown i is pᵢ minus the product of this column and z.
    pub(crate) fn column(&self, i: usize) -> &[f64] {
        &self.T.as_slice()[i * self.T.nrows()..][..self.others.len()]
    }

    /// Maps the first `count` rows of G from x to z, where x_B = p − T z: computes (G_N − G_B T)ᵀ and G_B p. G_B and
    /// G_N are the columns of G for the basic and for the other unknowns. The columns of `from` are the rows of G.
    /// `particular` gets G_B p and needs padding.
    pub(crate) fn map_dense_rows(
        &mut self,
        from: &DMatrix<f64>,
        count: usize,
        to: &mut DMatrix<f64>,
        particular: &mut [f64],
    ) {
        let Self { basic, others, T, basic_part, p, .. } = self;
        let (stride, ldt, ldb, n) = (from.nrows(), to.nrows(), basic_part.nrows(), others.len());
        let (from, to) = (from.as_slice(), to.as_mut_slice());
        for (r, row) in from.chunks_exact(stride.max(1)).take(count).enumerate() {
            for (i, &j) in basic.iter().enumerate() {
                basic_part.as_mut_slice()[i * ldb + r] = row[j];
            }
        }
        let basic_part = View::new(basic_part.as_slice(), ldb);
        particular[..count].fill(0.0);
        add_product_vector(particular, count, basic_part, &p[..basic.len()]);
        product_without_slack(to, ldt, [n, count, basic.len()], View::new(T.as_slice(), T.nrows()), basic_part);
        for r in 0..count {
            let (row, to) = (&from[r * stride..][..stride], &mut to[r * ldt..][..n]);
            for (z, &j) in to.iter_mut().zip(others.iter()) {
                *z = row[j] - *z;
            }
        }
    }

    /// Maps a row of coefficients of x to z, and writes the result as column r of `to`. The row has a 1 for `unknown`
    /// and zeros elsewhere. Returns the value of the row at z = 0.
    pub(crate) fn map_single_row(&self, unknown: usize, to: &mut DMatrix<f64>, r: usize) -> f64 {
        let (n, ldt) = (self.others.len(), to.nrows());
        let to = &mut to.as_mut_slice()[r * ldt..][..n];
        match self.places[unknown] {
            Place::Other(z) => {
                to.fill(0.0);
                to[z] = 1.0;
                0.0
            }
            Place::Basic(i) => {
                for (to, t) in to.iter_mut().zip(self.column(i)) {
                    *to = -t;
                }
                self.p[i]
            }
        }
    }

    /// Maps a row of coefficients of x with few non-zero entries to z, and writes the result as column r of `to`.
    /// Returns the value of the row at z = 0.
    pub(crate) fn map_row(&self, from: &DMatrix<f64>, r: usize, to: &mut DMatrix<f64>) -> f64 {
        let ldt = to.nrows();
        let row = &from.as_slice()[r * from.nrows()..][..self.places.len()];
        let to = &mut to.as_mut_slice()[r * ldt..][..self.others.len()];
        let mut particular = 0.0;
        to.fill(0.0);
        for (&a, place) in row.iter().zip(&self.places).filter(|(a, _)| **a != 0.0) {
            match *place {
                Place::Other(z) => to[z] += a,
                Place::Basic(i) => {
                    particular += a * self.p[i];
                    for (to, t) in to.iter_mut().zip(self.column(i)) {
                        *to -= a * t;
                    }
                }
            }
        }
        particular
    }

    /// Computes x from z.
    pub(crate) fn expand(&self, z: &[f64], x: &mut [f64]) {
        for (&j, &z) in self.others.iter().zip(z) {
            x[j] = z;
        }
        for (i, &j) in self.basic.iter().enumerate() {
            x[j] = self.p[i] - crate::least_squares::dot(self.column(i), z); // x_B = p − T z
        }
    }
}

/// Elimination of the equalities, with memory for the largest program.
pub(crate) struct Elimination {
    /// Scratch: Aᵀ of the equalities A x = b, while it is being eliminated. Shape: unknowns × equalities, with padding
    /// rows.
    W: DMatrix<f64>,
    right: Vec<f64>,
    /// Equality and unknown of each pivot, in elimination order. The next call tries these pivots first.
    pivots: Vec<(usize, usize)>,
    /// (equalities, unknowns) of the last call.
    shape: (usize, usize),
    used: Vec<bool>,
}

impl Elimination {
    pub(crate) fn new(unknowns: usize, equalities: usize) -> Self {
        Self {
            W: DMatrix::zeros(unknowns + SLACK, equalities),
            right: vec![0.0; equalities],
            pivots: Vec::with_capacity(equalities),
            shape: (0, 0),
            used: vec![false; equalities],
        }
    }

    /// Splits the unknowns by A x = b. Uses the pivots of the last call, unless one of these pivots has become too
    /// small.
    pub(crate) fn split(&mut self, program: &ConeProgram, basis: &mut Basis) {
        let (n, equalities) = (program.size.unknowns, program.size.equalities);
        if self.shape != (equalities, n) || !self.eliminate(program, true) {
            self.eliminate(program, false);
            self.shape = (equalities, n);
            self.place(basis);
        }
        let Basis { others, T, p, .. } = basis;
        let (stride, ldt) = (self.W.nrows(), T.nrows());
        for (i, &(row, _)) in self.pivots.iter().enumerate() {
            p[i] = self.right[row];
            let (w, T) = (&self.W.as_slice()[row * stride..][..n], &mut T.as_mut_slice()[i * ldt..][..others.len()]);
            for (t, &j) in T.iter_mut().zip(others.iter()) {
                *t = w[j];
            }
        }
    }

    /// Lists in `basis` the unknowns with a pivot, which are basic, and the other unknowns.
    fn place(&self, basis: &mut Basis) {
        basis.basic.clear();
        basis.basic.extend(self.pivots.iter().map(|pivot| pivot.1));
        basis.others.clear();
        basis.others.extend((0..self.shape.1).filter(|j| !basis.basic.contains(j)));
        basis.others.iter().enumerate().for_each(|(z, &j)| basis.places[j] = Place::Other(z));
        basis.basic.iter().enumerate().for_each(|(i, &j)| basis.places[j] = Place::Basic(i));
    }

    /// Appends the pivots of the last call to `out`. The next call tries these pivots first.
    pub(crate) fn write(&self, out: &mut Vec<f64>) {
        let (rows, unknowns) = self.shape;
        out.extend([rows, unknowns, self.pivots.len()].map(|x| x as f64));
        out.extend(self.pivots.iter().flat_map(|&(row, unknown)| [row as f64, unknown as f64]));
    }

    /// Reads the pivots of an elimination with the same capacity; returns `None` if they are invalid.
    pub(crate) fn read(&mut self, basis: &mut Basis, from: &mut Reader<'_>) -> Option<()> {
        let (most, unknowns) = (self.used.len(), basis.places.len());
        self.shape = (from.index(most + 1)?, from.index(unknowns + 1)?);
        let count = from.index(self.shape.0.min(self.shape.1) + 1)?;
        self.pivots.clear();
        for _ in 0..count {
            let (row, unknown) = (from.index(self.shape.0)?, from.index(self.shape.1)?);
            if self.pivots.iter().any(|&(r, j)| r == row || j == unknown) {
                return None;
            }
            self.pivots.push((row, unknown));
        }
        self.place(basis);
        Some(())
    }

    /// Runs Gauss–Jordan elimination. If `again` is true, it uses the pivots of the last call, and returns false if one
    /// of these pivots has become too small.
    fn eliminate(&mut self, program: &ConeProgram, again: bool) -> bool {
        let Self { W, right, used, pivots, .. } = self;
        let (n, m, stride) = (program.size.unknowns, program.size.equalities, W.nrows());
        let W = W.as_mut_slice();
        for r in 0..m {
            let row = &program.At.as_slice()[r * program.At.nrows()..][..n];
            let largest = max_abs(row);
            let scale = if largest > 0.0 { 1.0 / largest } else { 0.0 };
            let (to, slack) = W[r * stride..][..stride].split_at_mut(n);
            for (w, a) in to.iter_mut().zip(row) {
                *w = scale * a;
            }
            slack.fill(0.0);
            right[r] = scale * program.b[r];
        }
        used[..m].fill(false);
        let steps = if again { pivots.len() } else { m };
        if !again {
            pivots.clear();
        }
        for step in 0..steps {
            let column = |r: usize| &W[r * stride..][..n];
            let (row, j) = if again {
                let (row, j) = pivots[step];
                if column(row)[j].abs() < KEEP * max_abs(column(row)).max(KEEP) {
                    return false;
                }
                (row, j)
            } else {
                let (mut best, mut row) = (DEPENDENT, None);
                for r in (0..m).filter(|&r| !used[r]) {
                    let size = max_abs(column(r));
                    if size > best {
                        (best, row) = (size, Some(r));
                    }
                }
                let Some(row) = row else { break };
                let j = column(row).iter().position(|w| w.abs() >= best).expect("the largest is there");
                pivots.push((row, j));
                (row, j)
            };
            used[row] = true;
            at_level(Pivot { W: &mut W[..m * stride], right, stride, row, j });
        }
        // A row that depended on other rows in the last call may be independent now.
        !again || (0..m).all(|r| used[r] || max_abs(&W[r * stride..][..n]) <= DEPENDENT)
    }
}

/// One step of the elimination. It divides row `row` by the row's coefficient of unknown j. Then it subtracts multiples
/// of this row from the other rows, so that only this row contains unknown j.
struct Pivot<'a> {
    W: &'a mut [f64],
    right: &'a mut [f64],
    stride: usize,
    row: usize,
    j: usize,
}

impl Vectorized for Pivot<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { W, right, stride, row, j } = self;
        let whole = stride / V::N * V::N;
        let (before, rest) = W.split_at_mut(row * stride);
        let (pivot, after) = rest.split_at_mut(stride);
        let inverse = 1.0 / pivot[j];
        for x in pivot.iter_mut() {
            *x *= inverse;
        }
        pivot[j] = 1.0;
        right[row] *= inverse;
        for (part, first) in [(before, 0), (after, row + 1)] {
            for (r, w) in part.chunks_exact_mut(stride).enumerate() {
                let factor = w[j];
                if factor == 0.0 {
                    continue;
                }
                let (w, pivot, minus) = (&mut w[..whole], &pivot[..whole], V::splat(-factor));
                let mut i = 0;
                while i < whole {
                    V::load(&pivot[i..]).mul_add(minus, V::load(&w[i..])).store(&mut w[i..]);
                    i += V::N;
                }
                w[j] = 0.0;
                right[first + r] -= factor * right[row];
            }
        }
    }
}
