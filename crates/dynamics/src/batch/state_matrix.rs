//! Matrix of one state of a batch: borrowed numbers with a shape and two strides.
//!
//! The type is not a view of nalgebra, because products with such views are unsafe: if the rows are not adjacent in
//! memory, nalgebra reads and writes out of bounds (nalgebra's issue 1616). `StateMatrix` checks every access.

use super::state_matrix_operators::dot;
use condyle_linalg::check;
use condyle_spatial::block::Real;
use core::fmt;
use core::ops::Index;
use nalgebra::{DMatrix, Dim, Matrix, RawStorage, RawStorageMut, Scalar};

/// Matrix of one state of a batch, which borrows its entries from the batch's results.
///
/// Both rows and columns may have gaps between their entries, because the memory also holds the matrices of other
/// states. The matrix supports indexing, iteration by columns, transposition, sums, differences and products, like a
/// matrix of nalgebra. [`to_owned`](Self::to_owned) copies it to a `DMatrix`, for all other operations.
///
/// ```
/// use condyle_dynamics::{Batch, robots};
/// use nalgebra::{DMatrix, DVector};
/// let arm = robots::arm7();
/// let (mut batch, x) = (Batch::new(&arm, 10, 1), DVector::from_element(7, 1.0));
/// let M = batch.crba(&arm, &vec![0.3; 70]).at(9);
/// assert_eq!((M.shape(), M.get((7, 0))), ((7, 7), None));
/// assert_eq!(M[(1, 2)], M.transpose()[(2, 1)]);
/// let copy: DMatrix<f64> = M.to_owned();
/// assert!((M * &x - copy * x).amax() < 1e-14);
/// ```
pub struct StateMatrix<'b, T> {
    /// Numbers that contain the entries; entry (i, j) of the matrix is number i · `strides[0]` + j · `strides[1]`.
    numbers: &'b [T],
    shape: [usize; 2],
    strides: [usize; 2],
}

impl<T> Clone for StateMatrix<'_, T> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for StateMatrix<'_, T> {}

impl<'b, T> StateMatrix<'b, T> {
    /// Returns the matrix with the given shape, whose entry (i, j) is number i · `strides[0]` + j · `strides[1]` of
    /// `numbers`.
    ///
    /// # Panics
    /// Panics if `numbers` is too short.
    #[track_caller]
    pub(super) fn new(numbers: &'b [T], shape: [usize; 2], strides: [usize; 2]) -> Self {
        let strides = strides.map(|stride| stride.max(1)); // 0 is possible for an empty matrix
        if let [Some(i), Some(j)] = shape.map(|size| size.checked_sub(1)) {
            let last = i * strides[0] + j * strides[1];
            assert!(last < numbers.len(), "numbers: expected more than {last}, found {}", numbers.len());
        }
        Self { numbers, shape, strides }
    }

    /// Returns the numbers of rows and columns.
    #[inline]
    pub fn shape(&self) -> (usize, usize) {
        (self.shape[0], self.shape[1])
    }

    /// Returns the number of rows.
    #[inline]
    pub fn nrows(&self) -> usize {
        self.shape[0]
    }

    /// Returns the number of columns.
    #[inline]
    pub fn ncols(&self) -> usize {
        self.shape[1]
    }

    /// Returns the number of entries.
    #[inline]
    pub fn len(&self) -> usize {
        self.shape[0] * self.shape[1]
    }

    /// Returns whether the matrix has no entries.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the entry in row i and column j, or `None` outside of the matrix.
    #[inline]
    pub fn get(&self, (i, j): (usize, usize)) -> Option<&'b T> {
        if i < self.shape[0] && j < self.shape[1] {
            self.numbers.get(i * self.strides[0] + j * self.strides[1])
        } else {
            None
        }
    }

    /// Returns the transpose, which borrows the same numbers.
    #[must_use]
    #[inline]
    pub fn transpose(&self) -> Self {
        let ([m, n], [down, right]) = (self.shape, self.strides);
        Self { numbers: self.numbers, shape: [n, m], strides: [right, down] }
    }

    /// Returns row i, a matrix of one row.
    ///
    /// # Panics
    /// Panics if row i does not exist.
    #[track_caller]
    #[inline]
    pub fn row(&self, i: usize) -> Self {
        self.rows(i, 1)
    }

    /// Returns column j, a matrix of one column.
    ///
    /// # Panics
    /// Panics if column j does not exist.
    #[track_caller]
    #[inline]
    pub fn column(&self, j: usize) -> Self {
        self.columns(j, 1)
    }

    /// Returns `count` rows, starting with row `first`.
    ///
    /// # Panics
    /// Panics if one of these rows does not exist.
    #[track_caller]
    #[inline]
    pub fn rows(&self, first: usize, count: usize) -> Self {
        self.view((first, 0), (count, self.shape[1]))
    }

    /// Returns `count` columns, starting with column `first`.
    ///
    /// # Panics
    /// Panics if one of these columns does not exist.
    #[track_caller]
    #[inline]
    pub fn columns(&self, first: usize, count: usize) -> Self {
        self.view((0, first), (self.shape[0], count))
    }

    /// Returns the block of m × n entries whose first entry is (i, j).
    ///
    /// # Panics
    /// Panics if the block is not inside the matrix.
    #[track_caller]
    pub fn view(&self, (i, j): (usize, usize), (m, n): (usize, usize)) -> Self {
        let fits = |first: usize, count: usize, size: usize| first <= size && count <= size - first;
        let [rows, columns] = self.shape;
        if !(fits(i, m, rows) && fits(j, n, columns)) {
            panic!("the block of {m} × {n} entries at ({i}, {j}) is not inside a matrix of {rows} × {columns}");
        }
        let start = i * self.strides[0] + j * self.strides[1];
        Self { numbers: self.numbers.get(start..).unwrap_or_default(), shape: [m, n], strides: self.strides }
    }

    /// Iterates over the rows.
    pub fn row_iter(&self) -> impl ExactSizeIterator<Item = Self> + Clone {
        let this = *self;
        (0..self.shape[0]).map(move |i| this.row(i))
    }

    /// Iterates over the columns.
    pub fn column_iter(&self) -> impl ExactSizeIterator<Item = Self> + Clone {
        let this = *self;
        (0..self.shape[1]).map(move |j| this.column(j))
    }

    /// Iterates over the entries, by columns.
    #[inline]
    pub fn iter(&self) -> Entries<'b, T> {
        Entries { of: *self, i: 0, j: 0 }
    }

    /// Iterates over the entries of column j, for j below the number of columns.
    #[inline]
    fn entries_of_column(&self, j: usize) -> impl Iterator<Item = &'b T> {
        let column = self.numbers.get(j * self.strides[1]..).unwrap_or_default();
        column.iter().step_by(self.strides[0]).take(self.shape[0])
    }

    /// Panics unless the matrix has the shape `found`.
    #[track_caller]
    fn check_shape(&self, name: &str, found: (usize, usize)) {
        let [m, n] = self.shape;
        assert!(found == (m, n), "{name}: expected {m} × {n}, found {} × {}", found.0, found.1);
    }
}

impl<T: Scalar> StateMatrix<'_, T> {
    /// Copies the matrix to a `DMatrix` of nalgebra.
    pub fn to_owned(&self) -> DMatrix<T> {
        DMatrix::from_iterator(self.shape[0], self.shape[1], self.iter().cloned())
    }

    /// Copies the matrix to a matrix of nalgebra, or to a block of such a matrix. Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, robots};
    /// let (arm, mut all) = (robots::arm7(), nalgebra::DMatrix::zeros(7, 14));
    /// Batch::new(&arm, 1, 1).crba(&arm, &[0.3; 7]).at(0).copy_to(&mut all.columns_mut(7, 7));
    /// assert!(all[(0, 7)] > 0.0 && all[(0, 0)] == 0.0);
    /// ```
    ///
    /// # Panics
    /// Panics if `to` has another shape.
    #[track_caller]
    pub fn copy_to<R: Dim, C: Dim>(&self, to: &mut Matrix<T, R, C, impl RawStorageMut<T, R, C>>) {
        self.check_shape("to", to.shape());
        for (j, mut column) in to.column_iter_mut().enumerate() {
            column.iter_mut().zip(self.entries_of_column(j)).for_each(|(to, x)| to.clone_from(x));
        }
    }

    /// Writes the entries by rows. Allocates nothing.
    ///
    /// # Panics
    /// Panics if the length of `to` is not the number of entries.
    #[track_caller]
    pub fn write_rows(&self, to: &mut [T]) {
        check("to", to.len(), self.len());
        to.iter_mut().zip(&self.transpose()).for_each(|(to, x)| to.clone_from(x));
    }
}

impl<T: Real> StateMatrix<'_, T> {
    /// Writes the product M x of this matrix M and a vector or matrix x to `out`. Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, robots};
    /// let (arm, mut tau) = (robots::arm7(), nalgebra::DVector::zeros(7));
    /// let mut batch = Batch::new(&arm, 2, 1);
    /// let M = batch.crba(&arm, &[0.3; 14]).at(1);
    /// M.mul_to(&nalgebra::dvector![1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], &mut tau);
    /// assert!(tau.iter().eq(&M.column(0)));
    /// ```
    ///
    /// # Panics
    /// Panics if the number of rows of `x` is not the number of columns of M, or `out` does not have the shape of M x.
    #[track_caller]
    pub fn mul_to<R: Dim, C: Dim, P: Dim, Q: Dim>(
        &self,
        x: &Matrix<T, R, C, impl RawStorage<T, R, C>>,
        out: &mut Matrix<T, P, Q, impl RawStorageMut<T, P, Q>>,
    ) {
        self.check_factor(x.nrows());
        let shape = (self.shape[0], x.ncols());
        assert!(out.shape() == shape, "out: expected {} × {}, found {:?}", shape.0, shape.1, out.shape());
        for j in 0..shape.1 {
            for i in 0..shape.0 {
                out[(i, j)] = dot(self, i, |k| x[(k, j)]); // Σ M_ik x_kj
            }
        }
    }

    /// Writes the product M x of this matrix M and a vector x to `out`. `x` has one number per column, `out` one number
    /// per row. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `x` or `out` has the wrong length.
    #[track_caller]
    pub fn mul_vector_to(&self, x: &[T], out: &mut [T]) {
        self.check_factor(x.len());
        check("out", out.len(), self.shape[0]);
        for (i, out) in out.iter_mut().enumerate() {
            *out = dot(self, i, |k| x[k]); // Σ M_ik x_k
        }
    }

    /// Returns the largest absolute value of the entries: 0 for an empty matrix, NaN if an entry is NaN.
    pub fn amax(&self) -> T {
        let mut most = T::zero();
        for x in self {
            let x = x.abs();
            #[allow(clippy::eq_op)] // true for NaN only
            if x != x {
                return x;
            }
            most = T::select(most.lt(x), x, most);
        }
        most
    }

    /// Returns the Frobenius norm, the square root of the sum of the squared entries.
    pub fn norm(&self) -> T {
        self.iter().fold(T::zero(), |sum, &x| sum + x * x).sqrt()
    }

    /// Panics unless a factor on the right has as many rows as the matrix has columns.
    #[track_caller]
    pub(super) fn check_factor(&self, rows: usize) {
        let [m, n] = self.shape;
        assert!(rows == n, "x: expected {n} rows for a product with a matrix of {m} × {n}, found {rows}");
    }
}

impl<T> Index<(usize, usize)> for StateMatrix<'_, T> {
    type Output = T;

    /// Returns the entry in row i and column j.
    ///
    /// # Panics
    /// Panics if the entry does not exist.
    #[track_caller]
    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &T {
        match self.get((i, j)) {
            Some(x) => x,
            None => no_entry((i, j), self.shape), // not in a closure: the panic must name the caller
        }
    }
}

/// Panics because an index is outside of the matrix.
#[cold]
#[inline(never)]
#[track_caller]
fn no_entry((i, j): (usize, usize), [m, n]: [usize; 2]) -> ! {
    panic!("entry ({i}, {j}): expected a row below {m} and a column below {n}");
}

/// Iterator over the entries of a [`StateMatrix`], by columns.
pub struct Entries<'b, T> {
    of: StateMatrix<'b, T>,
    /// Index (i, j) of the next entry.
    i: usize,
    j: usize,
}

impl<T> Clone for Entries<'_, T> {
    fn clone(&self) -> Self {
        Self { ..*self }
    }
}

impl<'b, T> Iterator for Entries<'b, T> {
    type Item = &'b T;

    #[inline]
    fn next(&mut self) -> Option<&'b T> {
        let x = self.of.get((self.i, self.j))?;
        self.i += 1;
        if self.i == self.of.shape[0] {
            (self.i, self.j) = (0, self.j + 1);
        }
        Some(x)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.of.len() - self.of.len().min(self.j * self.of.shape[0] + self.i);
        (left, Some(left))
    }
}

impl<T> ExactSizeIterator for Entries<'_, T> {}

impl<T> core::iter::FusedIterator for Entries<'_, T> {}

impl<T: fmt::Debug> fmt::Debug for Entries<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.clone()).finish()
    }
}

impl<'b, T> IntoIterator for StateMatrix<'b, T> {
    type Item = &'b T;
    type IntoIter = Entries<'b, T>;
    fn into_iter(self) -> Entries<'b, T> {
        self.iter()
    }
}

impl<'b, T> IntoIterator for &StateMatrix<'b, T> {
    type Item = &'b T;
    type IntoIter = Entries<'b, T>;
    fn into_iter(self) -> Entries<'b, T> {
        self.iter()
    }
}
