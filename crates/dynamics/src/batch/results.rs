//! Results of a batch: vectors, matrices and poses of each state, and structs of these types.

use super::places::MOST_RESULTS;
use super::state_matrix::StateMatrix;
use super::{Batch, InLanes};
use condyle_linalg::{check, check_index};
use condyle_spatial::block::Real;
use condyle_spatial::{Mat3, Se3, Vec3};

/// Shape of a result for one state. A number has no sizes, a vector has one, a matrix has two, and several matrices
/// have three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shape {
    sizes: [usize; 3],
    rank: usize,
}

impl Shape {
    /// Returns the shape with the given sizes, at most three.
    pub(super) fn new(given: impl Iterator<Item = usize>) -> Self {
        let (mut sizes, mut rank) = ([1; 3], 0);
        for size in given {
            sizes[rank] = size;
            rank += 1;
        }
        Self { sizes, rank }
    }

    fn sizes(&self) -> &[usize] {
        &self.sizes[..self.rank]
    }

    /// Returns the number of entries.
    pub(super) fn len(self) -> usize {
        self.sizes.iter().product()
    }

    /// Returns the shape as one matrix; several matrices are stacked vertically.
    fn matrix(self) -> [usize; 2] {
        let [a, b, c] = self.sizes;
        if self.rank == 3 { [a * b, c] } else { [a, b] }
    }
}

/// Description of the results of a batch's last call: the number of states, the shape of each result, and the kind of
/// each matrix that stays in lanes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Last {
    pub states: usize,
    pub results: usize,
    pub shapes: [Shape; MOST_RESULTS],
    pub kept: [Option<usize>; MOST_RESULTS],
}

impl Last {
    /// Returns the number of states for which the slices have space. The first result that is not empty determines this
    /// number. If all results are empty, the number is 0.
    pub(super) fn room<T>(&self, places: &[&mut [T]]) -> usize {
        let first = places.iter().zip(&self.shapes).find(|(_, shape)| shape.len() > 0);
        first.map_or(0, |(place, shape)| place.len() / shape.len())
    }

    /// Panics unless there is one slice per result, with the length of the result.
    #[track_caller]
    pub(super) fn check<T>(&self, places: &[&mut [T]]) {
        assert!(
            places.len() == self.results,
            "to: expected a place for each of {} results, found {}",
            self.results,
            places.len()
        );
        for (k, place) in places.iter().enumerate() {
            let expected = self.states * self.shapes[k].len();
            assert!(place.len() == expected, "to[{k}]: expected length {expected}, found {}", place.len());
        }
    }
}

/// Cursor over the results of a batch: each result is taken once, in order.
pub(super) struct Taken<'b, T: Real> {
    pub batch: &'b Batch<T>,
    pub next: usize,
}

/// Result type that can be taken from a batch.
pub(super) trait Take<'b, T: Real> {
    /// Shapes of the results, if the type determines them. Otherwise, the function's entry in `table.rs` gives the
    /// shapes.
    const SHAPES: &'static [&'static [usize]] = &[];

    fn take(from: &mut Taken<'b, T>) -> Self;
}

/// Vectors of all states, stored one state after the other.
impl<'b, T: Real> Take<'b, T> for &'b [T] {
    fn take(from: &mut Taken<'b, T>) -> Self {
        let (k, Batch { slots, last, .. }) = (from.next, from.batch);
        from.next += 1;
        &slots[k][..last.states * last.shapes[k].len()]
    }
}

impl<'b, T: Real> Take<'b, T> for Matrices<'b, T> {
    fn take(from: &mut Taken<'b, T>) -> Self {
        let (k, Batch { lanes, last, .. }) = (from.next, from.batch);
        let (states, shape) = (last.states, last.shapes[k].matrix());
        match last.kept[k] {
            None => Self { of: Stored::ByRows(<&[T]>::take(from)), shape, states },
            Some(kind) => {
                from.next += 1;
                Self { of: Stored::InLanes(lanes, kind), shape, states }
            }
        }
    }
}

impl<'b, T: Real> Take<'b, T> for Poses<'b, T> {
    fn take(from: &mut Taken<'b, T>) -> Self {
        let (shape, states) = (from.batch.last.shapes[from.next], from.batch.last.states);
        Self { numbers: <&[T]>::take(from), each: shape.len() / 16, states }
    }
}

/// Matrices of the states of a batch, one per state.
#[derive(Clone, Copy, Debug)]
pub struct Matrices<'b, T: Real> {
    of: Stored<'b, T>,
    shape: [usize; 2],
    states: usize,
}

#[derive(Clone, Copy, Debug)]
enum Stored<'b, T: Real> {
    /// Matrices of the given kind, in the lanes to which the passes wrote these matrices.
    InLanes(&'b InLanes<T>, usize),
    /// Matrices of all states, one after the other, each by rows.
    ByRows(&'b [T]),
}

impl<'b, T: Real> Matrices<'b, T> {
    /// Returns the matrix of state k. [`to_owned`](StateMatrix::to_owned) copies it to a matrix of nalgebra.
    ///
    /// # Panics
    /// Panics if state k does not exist.
    #[track_caller]
    pub fn at(&self, k: usize) -> StateMatrix<'b, T> {
        check_state(k, self.states);
        let [m, n] = self.shape;
        match self.of {
            Stored::InLanes(lanes, kind) => each!(InLanes, lanes, group => group.matrix(kind, k)),
            Stored::ByRows(rows) => StateMatrix::new(&rows[k * m * n..(k + 1) * m * n], [m, n], [n, 1]),
        }
    }

    /// Writes the matrices of all states one after the other, each by rows.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, robots};
    /// let arm = robots::arm7();
    /// let (mut batch, q) = (Batch::new(&arm, 10, 1), vec![0.3; 70]);
    /// let mut rows = vec![0.0; 10 * 7 * 7];
    /// let M = batch.crba(&arm, &q);
    /// M.write_rows(&mut rows);
    /// assert_eq!(rows[9 * 49 + 7 + 2], M.at(9)[(1, 2)]);
    /// ```
    ///
    /// # Panics
    /// Panics if the length of `to` is not the number of entries of all states.
    #[track_caller]
    pub fn write_rows(&self, to: &mut [T]) {
        let [m, n] = self.shape;
        check("to", to.len(), self.states * m * n);
        match self.of {
            Stored::InLanes(lanes, kind) => each!(InLanes, lanes, group => group.write_rows(kind, to)),
            Stored::ByRows(rows) => to.copy_from_slice(rows),
        }
    }

    /// Returns the number of states.
    pub fn len(&self) -> usize {
        self.states
    }

    /// Returns whether there are no states.
    pub fn is_empty(&self) -> bool {
        self.states == 0
    }

    /// Iterates over the matrices of all states.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = StateMatrix<'b, T>> {
        let this = *self;
        (0..self.states).map(move |k| this.at(k))
    }
}

/// Poses of the states of a batch; each state has the same number of poses.
#[derive(Clone, Copy, Debug)]
pub struct Poses<'b, T> {
    /// Homogeneous matrices of all poses, each by rows.
    numbers: &'b [T],
    each: usize,
    states: usize,
}

impl<T: Real> Poses<'_, T> {
    /// Returns pose i of state k.
    ///
    /// # Panics
    /// Panics if state k or pose i does not exist.
    #[track_caller]
    pub fn at(&self, k: usize, i: usize) -> Se3<T> {
        check_state(k, self.states);
        check_index("i", i, self.each, "poses of a state");
        let x = &self.numbers[16 * (k * self.each + i)..];
        let column = |j: usize| Vec3::new(x[j], x[4 + j], x[8 + j]);
        Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3))
    }
}

#[track_caller]
fn check_state(k: usize, states: usize) {
    check_index("k", k, states, "states");
}

/// Defines structs with the results of a batch. Each struct corresponds to the result struct of the function for a
/// single state. The named fields are written one after the other, to destinations with the shapes in brackets.
macro_rules! results {
    ($(
        $(#[$doc:meta])*
        $Name:ident of $Single:ident {
            $($(#[$member_doc:meta])* $member:ident: $Kind:ty = $([$($size:expr),*]),+;)*
        }
    )*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $Name<'b, T: Real> {
            $($(#[$member_doc])* pub $member: $Kind,)*
        }

        impl<'b, T: Real> Take<'b, T> for $Name<'b, T> {
            const SHAPES: &'static [&'static [usize]] = &[$($(&[$($size),*]),+),*];

            fn take(from: &mut Taken<'b, T>) -> Self {
                Self { $($member: Take::take(from)),* }
            }
        }

        impl<S: condyle_spatial::block::Block> Put<S> for $Single<'_, S> {
            #[inline(always)]
            fn put(self, to: &mut Places<'_, S::Number>) {
                $(Put::<S>::put(self.$member, to);)*
            }
        }
    )*};
}
pub(super) use results;

impl<T: Real> Batch<T> {
    /// Returns the sizes of each result of the last call, for one state.
    #[doc(hidden)]
    pub fn last_shapes(&self) -> impl Iterator<Item = &[usize]> {
        self.last.shapes[..self.last.results].iter().map(Shape::sizes)
    }
}
