//! Destinations to which the passes of a batch write results, one state after the other.

use super::group::SYMMETRIC;
use condyle_spatial::block::{Block, MOST, Strided, scatter, scatter_matrix};
use condyle_spatial::{Force, Inertia, Matrix, Motion, Scalar, Se3, Vec3};
use core::mem;

/// Maximum number of results of a function.
pub(super) const MOST_RESULTS: usize = 12;

/// Destinations for the results of states. A pass fills one destination after the other, for a few states at a time.
pub(super) struct Places<'a, T> {
    /// Memory for the numbers of all states, one slice per result; slices after the last result are empty.
    to: [&'a mut [T]; MOST_RESULTS],
    /// Number of results.
    results: usize,
    /// Index of the first of the states that a pass currently writes.
    first: usize,
    /// Number of states that a pass currently writes.
    states: usize,
    /// Index of the result that the pass writes next.
    next: usize,
}

impl<'a, T> Places<'a, T> {
    /// Returns the destinations for a given number of results.
    pub(super) fn new(to: [&'a mut [T]; MOST_RESULTS], results: usize, states: usize) -> Self {
        Self { to, results, first: 0, states, next: 0 }
    }

    /// Selects the next states to write: `states` states, starting with state `first`.
    pub(super) fn go_to(&mut self, first: usize, states: usize) {
        (self.first, self.states, self.next) = (first, states, 0);
    }

    /// Splits the destinations for `states` states into destinations for the first `n` states and destinations for the
    /// others.
    pub(super) fn split(mut self, n: usize, states: usize) -> (Self, Self) {
        let mut others = Self::new(Default::default(), self.results, states - n);
        for (first, other) in self.to[..self.results].iter_mut().zip(&mut others.to) {
            let each = first.len() / states;
            (*first, *other) = mem::take(first).split_at_mut(each * n);
        }
        self.states = n;
        (self, others)
    }
}

impl<T> Places<'_, T> {
    /// Writes one vector per state to the next destination.
    #[inline(never)]
    pub(super) fn numbers<S: Block<Number = T>>(&mut self, x: &[S]) {
        scatter(x, self.states, &mut self.to[self.next][self.first * x.len()..][..self.states * x.len()]);
        self.next += 1;
    }

    /// Writes one matrix per state by rows to the next destination. `columns` is the number of columns of each matrix.
    pub(super) fn columns<S: Block<Number = T>>(&mut self, x: &[S], columns: usize) {
        self.part(self.next, [0, 1], x, columns);
        self.next += 1;
    }

    /// Writes one matrix per state by rows to the next destination, for a kind of matrix that could also stay in lanes.
    pub(super) fn kind<S: Block<Number = T>>(&mut self, kind: usize, x: &Matrix<S>) {
        // The columns of a symmetric matrix equal its rows, so the numbers are copied in order.
        let columns = if SYMMETRIC.contains(&kind) { x.len() } else { x.ncols() };
        self.columns(x.as_slice(), columns);
    }

    /// Writes matrix k of n, for a result that consists of n matrices.
    #[inline(never)]
    pub(super) fn part<S: Block<Number = T>>(&mut self, result: usize, [k, n]: [usize; 2], x: &[S], columns: usize) {
        if x.is_empty() {
            return;
        }
        let (size, rows) = (x.len(), x.len() / columns);
        let mut each: [&mut [T]; MOST] = Default::default();
        let all = &mut self.to[result][self.first * n * size..];
        for (place, to) in each.iter_mut().zip(all.chunks_exact_mut(n * size)).take(self.states) {
            *place = &mut to[k * size..(k + 1) * size];
        }
        let matrix = Strided { vectors: x, strides: [1, rows], shape: [rows, columns], negative: false };
        scatter_matrix(&matrix, &mut each[..self.states], columns);
    }

    /// Writes pose k of n as a homogeneous matrix, for a result that consists of n poses.
    #[inline(always)]
    pub(super) fn pose<S: Block<Number = T>>(&mut self, result: usize, k: [usize; 2], X: Se3<S>) {
        let Se3 { rotation: R, translation: p } = X;
        let (o, e) = (S::zero(), S::one());
        let columns = [R.x.x, R.x.y, R.x.z, o, R.y.x, R.y.y, R.y.z, o, R.z.x, R.z.y, R.z.z, o, p.x, p.y, p.z, e];
        self.part(result, k, &columns, 4);
    }
}

/// Result of a function for a single state, which can be written to the next destinations.
pub(super) trait Put<S: Block> {
    fn put(self, to: &mut Places<'_, S::Number>);
}

macro_rules! put {
    ($($Kind:ty: $x:ident => $method:ident($($argument:expr),*);)*) => {$(
        impl<S: Block> Put<S> for $Kind {
            #[inline(always)]
            fn put(self, to: &mut Places<'_, S::Number>) {
                let $x = self;
                to.$method($($argument),*);
            }
        }
    )*};
}
put! {
    S: x => numbers(&[x]);
    &[S]: x => numbers(x);
    Vec3<S>: x => numbers(&x.to_array());
    Motion<S>: x => numbers(&x.to_array());
    Force<S>: x => numbers(&x.to_array());
    &Matrix<S>: x => columns(x.as_slice(), x.ncols());
    Inertia<S>: I => columns(&centroidal_matrix(I), 6);
}

/// Returns the 6 × 6 inertia of a whole robot about its centre of mass, [m 1, 0; 0, Ī], by columns. m is the mass, Ī
/// the rotational inertia.
#[inline(always)]
fn centroidal_matrix<S: Scalar>(I: Inertia<S>) -> [S; 36] {
    let mut columns = [S::zero(); 36];
    let axes = I.rotational.full().columns();
    for k in 0..3 {
        columns[7 * k] = I.mass;
        columns[6 * (3 + k) + 3..6 * (4 + k)].copy_from_slice(&axes[k].to_array());
    }
    columns
}
