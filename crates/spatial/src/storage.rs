//! What workspaces keep their numbers in: arrays and matrices whose layout does not depend on the name of the scalar.
//!
//! The standard library and nalgebra do not promise that a `Vec<f64>` and a `Vec<Fused>` have their words in one order, so a
//! workspace that held some could not be read under the other name ([`Alike`](crate::simd::alike::Alike)). These are `repr(C)`.
#![allow(unsafe_code)]

use crate::alike;
use crate::simd::Fused;
use crate::simd::alike::{Alike, Rename};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::marker::PhantomData;
use core::mem::{ManuallyDrop, offset_of};
use core::ops::{Deref, DerefMut};
use core::ptr::NonNull;
use nalgebra::{Dyn, IsContiguous, Owned, RawStorage, RawStorageMut, Storage, U1, VecStorage};

/// An array of a fixed length on the heap: a boxed slice whose layout is that of two words, pointer and length, whatever it
/// holds.
#[repr(C)]
pub struct Array<T> {
    start: NonNull<T>,
    len: usize,
    owned: PhantomData<T>,
}

// SAFETY: an array owns its entries, as a boxed slice does.
unsafe impl<T: Send> Send for Array<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Array<T> {}

impl<T> Array<T> {
    /// The boxed slice that this is made of.
    #[inline]
    fn into_boxed_slice(self) -> Box<[T]> {
        let this = ManuallyDrop::new(self);
        // SAFETY: pointer and length are those of a boxed slice (`From<Vec<T>>`), which `this` will not drop.
        unsafe { Box::from_raw(core::ptr::slice_from_raw_parts_mut(this.start.as_ptr(), this.len)) }
    }
}

impl<T> Drop for Array<T> {
    #[inline]
    fn drop(&mut self) {
        // SAFETY: pointer and length are those of a boxed slice, which is dropped here alone.
        drop(unsafe { Box::from_raw(core::ptr::slice_from_raw_parts_mut(self.start.as_ptr(), self.len)) });
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];
    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: pointer and length are those of a slice that `self` owns.
        unsafe { core::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Array<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as for `deref`, and `self` is borrowed alone.
        unsafe { core::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl<T> From<Vec<T>> for Array<T> {
    #[inline]
    fn from(entries: Vec<T>) -> Self {
        let entries = Box::leak(entries.into_boxed_slice());
        Self { len: entries.len(), start: NonNull::from(entries).cast(), owned: PhantomData }
    }
}

impl<T> From<Array<T>> for Vec<T> {
    #[inline]
    fn from(array: Array<T>) -> Self {
        array.into_boxed_slice().into()
    }
}

impl<T> FromIterator<T> for Array<T> {
    #[inline]
    fn from_iter<I: IntoIterator<Item = T>>(entries: I) -> Self {
        Vec::from_iter(entries).into()
    }
}

impl<T> Default for Array<T> {
    /// The empty array.
    #[inline]
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: Clone> Clone for Array<T> {
    #[inline]
    fn clone(&self) -> Self {
        self.to_vec().into()
    }
}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(f)
    }
}

impl<T: PartialEq> PartialEq for Array<T> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self[..] == other[..]
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = core::slice::Iter<'a, T>;
    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut Array<T> {
    type Item = &'a mut T;
    type IntoIter = core::slice::IterMut<'a, T>;
    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

// SAFETY: it is `repr(C)`, of a thin pointer, a number and nothing. Who drops it as an array of B drops entries that are alike,
// from memory of the same layout.
unsafe impl<A: Alike<B>, B> Alike<Array<B>> for Array<A> {}

impl<A: Alike<B>, B> Rename<Array<B>> for Array<A> {
    #[inline(always)]
    fn renamed(self) -> Array<B> {
        let this = ManuallyDrop::new(self);
        Array { start: this.start.cast(), len: this.len, owned: PhantomData }
    }
}

/// A matrix that a workspace keeps, and that calls give out: one of nalgebra's, by columns, over an [`Array`].
///
/// It indexes, multiplies, compares and is viewed as a `DMatrix` is; `clone_owned` copies it into one.
///
/// ```
/// use condyle_spatial::{Matrix, matrix};
/// let mut M: Matrix<f64> = matrix(2, 3, 1.0);
/// M[(1, 2)] = 4.0;
/// let sums: nalgebra::DVector<f64> = &M * nalgebra::dvector![1.0, 1.0, 1.0];
/// assert_eq!(sums, nalgebra::dvector![3.0, 6.0]);
/// let copy: nalgebra::DMatrix<f64> = M.clone_owned();
/// assert_eq!(copy, M);
/// ```
pub type Matrix<T> = nalgebra::Matrix<T, Dyn, Dyn, MatrixStorage<T>>;

/// Any matrix whose numbers stand by columns without gaps: a [`Matrix`] or one of nalgebra's own, a `DMatrix`.
pub type DenseMatrix<T, Storage> = nalgebra::Matrix<T, Dyn, Dyn, Storage>;

/// The storage of a [`DenseMatrix`].
pub trait Dense<T>: RawStorageMut<T, Dyn, Dyn> + IsContiguous {}
impl<T, Storage: RawStorageMut<T, Dyn, Dyn> + IsContiguous> Dense<T> for Storage {}

/// A matrix whose entries are all equal.
#[inline]
pub fn matrix<T: nalgebra::Scalar>(rows: usize, columns: usize, entry: T) -> Matrix<T> {
    let size = rows.checked_mul(columns).expect("a matrix of a size that a machine can count");
    let numbers = alloc::vec![entry; size].into();
    Matrix::from_data(MatrixStorage { numbers, rows: Dyn(rows), columns: Dyn(columns) })
}

/// What a [`Matrix`] keeps its numbers in.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct MatrixStorage<T> {
    /// By columns. Shape: rows · columns, which nothing changes.
    numbers: Array<T>,
    rows: Dyn,
    columns: Dyn,
}

alike!(MatrixStorage { numbers } same { rows, columns });

// SAFETY: nalgebra's matrix is `repr(C)`, of a storage and nothing else, as is looked at below.
unsafe impl Alike<Matrix<Fused>> for Matrix<f64> {}

impl Rename<Matrix<Fused>> for Matrix<f64> {
    #[inline(always)]
    fn renamed(self) -> Matrix<Fused> {
        Matrix::from_data(self.data.renamed())
    }
}

const _: () = {
    assert!(offset_of!(Matrix<f64>, data) == 0 && offset_of!(Matrix<Fused>, data) == 0);
    assert!(size_of::<Matrix<f64>>() == size_of::<MatrixStorage<f64>>());
    assert!(size_of::<Matrix<Fused>>() == size_of::<MatrixStorage<Fused>>());
};

// SAFETY: there are rows · columns numbers, by columns, and no way to change how many.
unsafe impl<T> RawStorage<T, Dyn, Dyn> for MatrixStorage<T> {
    type RStride = U1;
    type CStride = Dyn;

    #[inline(always)]
    fn ptr(&self) -> *const T {
        self.numbers.start.as_ptr()
    }
    #[inline(always)]
    fn shape(&self) -> (Dyn, Dyn) {
        (self.rows, self.columns)
    }
    #[inline(always)]
    fn strides(&self) -> (U1, Dyn) {
        (U1, self.rows)
    }
    #[inline(always)]
    fn is_contiguous(&self) -> bool {
        true
    }
    #[inline(always)]
    unsafe fn as_slice_unchecked(&self) -> &[T] {
        &self.numbers
    }
}

// SAFETY: as above; the pointer is that of numbers which `self` owns.
unsafe impl<T> RawStorageMut<T, Dyn, Dyn> for MatrixStorage<T> {
    #[inline(always)]
    fn ptr_mut(&mut self) -> *mut T {
        self.numbers.start.as_ptr()
    }
    #[inline(always)]
    unsafe fn as_mut_slice_unchecked(&mut self) -> &mut [T] {
        &mut self.numbers
    }
}

// SAFETY: all numbers are initialised, and copies have as many.
unsafe impl<T: nalgebra::Scalar> Storage<T, Dyn, Dyn> for MatrixStorage<T> {
    #[inline]
    fn into_owned(self) -> Owned<T, Dyn, Dyn> {
        VecStorage::new(self.rows, self.columns, self.numbers.into())
    }
    #[inline]
    fn clone_owned(&self) -> Owned<T, Dyn, Dyn> {
        VecStorage::new(self.rows, self.columns, self.numbers.to_vec())
    }
    #[inline]
    fn forget_elements(self) {
        let mut numbers = Vec::from(self.numbers);
        // SAFETY: an empty vector has no entries that would have to be there.
        unsafe { numbers.set_len(0) };
    }
}

// SAFETY: entries are numbered by columns, without gaps.
unsafe impl<T> IsContiguous for MatrixStorage<T> {}

#[cfg(test)]
mod tests {
    use super::{Array, Matrix, matrix};
    use crate::Motion;
    use crate::simd::alike::Rename;
    use crate::simd::fused::Fused;
    use crate::simd::gate::Witness;
    use alloc::rc::Rc;
    use alloc::vec;
    use alloc::vec::Vec;
    use nalgebra::{DMatrix, RawStorage, Storage, dmatrix};

    /// The entries have another owner each, so that it shows who has been dropped.
    #[test]
    fn arrays_drop_and_clone_each_entry_once() {
        let owners: Vec<Rc<usize>> = (0..5).map(Rc::new).collect();
        let array: Array<_> = owners.iter().cloned().collect();
        let copy = array.clone();
        assert_eq!(array, copy);
        assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 3));
        drop(array);
        assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 2));
        let back = Vec::from(copy);
        assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 2));
        assert_eq!(back, owners);
        drop(back);
        assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 1));
    }

    /// A vector with more room than entries gives back the rest.
    #[test]
    fn arrays_take_vectors_with_room() {
        let mut entries = Vec::with_capacity(10);
        entries.extend([1.0, 2.0, 3.0]);
        let mut array = Array::from(entries);
        array[1] = 5.0;
        for x in &mut array {
            *x += 1.0;
        }
        assert_eq!(array[..], [2.0, 6.0, 4.0]);
        assert_eq!((&array).into_iter().sum::<f64>(), 12.0);
        assert_eq!(alloc::format!("{array:?}"), "[2.0, 6.0, 4.0]");
    }

    #[test]
    fn arrays_may_be_empty() {
        let empty = Array::<f64>::default();
        assert!(empty.is_empty() && empty.clone().is_empty() && Vec::from(empty).is_empty());
        let none: Array<Rc<usize>> = Vec::with_capacity(3).into();
        assert_eq!(none.len(), 0);
    }

    #[test]
    fn arrays_hold_entries_without_size() {
        let units: Array<()> = vec![(); 7].into();
        assert_eq!((units.len(), units.clone().len(), Vec::from(units).len()), (7, 7, 7));
    }

    /// Vectors of eight numbers stand at multiples of 64 bytes.
    #[test]
    fn arrays_align_their_entries() {
        #[derive(Clone, Debug, PartialEq)]
        #[repr(align(64))]
        struct Wide([f64; 8]);
        let array: Array<Wide> = (0..3).map(|k| Wide([f64::from(k); 8])).collect();
        let copy = array.clone();
        assert!(array.as_ptr().addr().is_multiple_of(64) && copy.as_ptr().addr().is_multiple_of(64));
        assert_eq!((array[2].0[7], copy), (2.0, array.clone()));

        struct Gate;
        // SAFETY: numbers are filled in, nothing is computed.
        unsafe impl Witness for Gate {}
        type Long = crate::simd::gate::Long<Gate>;
        let lanes: Array<Long> = vec![crate::Scalar::splat(1.5); 3].into();
        assert!(lanes.as_ptr().addr().is_multiple_of(align_of::<Long>()));
    }

    #[test]
    fn arrays_cross_threads() {
        fn crosses<T: Send + Sync>() {}
        crosses::<Array<f64>>();
        crosses::<Matrix<f64>>();
    }

    #[test]
    fn what_is_alike_is_read_and_written_under_both_names() {
        let mut M: Matrix<f64> = matrix(2, 2, 3.0);
        let same: &mut Matrix<Fused> = Rename::renamed(&mut M);
        same[(1, 0)] = Fused(5.0);
        assert_eq!(M, dmatrix![3.0, 3.0; 5.0, 3.0]);
        let same: Matrix<Fused> = M.renamed();
        assert_eq!((same.shape(), same[1]), ((2, 2), Fused(5.0)));

        let mut array: Array<Motion<f64>> = vec![Motion::zero(); 3].into();
        let same: &mut Array<Motion<Fused>> = Rename::renamed(&mut array);
        same[2].angular.y = Fused(7.0);
        let same: &[Motion<Fused>] = Rename::renamed(&array[1..]);
        assert_eq!((same.len(), same[1].angular.y), (2, Fused(7.0)));
        let [same, none]: [Option<&[Fused]>; 2] = Rename::renamed([Some(&[1.0, 2.0][..]), None]);
        assert_eq!((same, none), (Some(&[Fused(1.0), Fused(2.0)][..]), None));
        let array: Array<Motion<Fused>> = array.renamed();
        assert_eq!(array[2].angular.y, Fused(7.0));
    }

    #[test]
    fn matrices_are_matrices_of_nalgebra() {
        let mut M: Matrix<f64> = matrix(2, 3, 0.0);
        let numbers = dmatrix![1.0, 2.0, 3.0; 4.0, 5.0, 6.0];
        M.copy_from(&numbers);
        assert_eq!(M, numbers);
        assert_eq!(M.as_slice(), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        assert_eq!((M[(1, 2)], M[3], M.shape()), (6.0, 5.0, (2, 3)));
        assert_eq!(M.column(1).as_slice(), [2.0, 5.0]);
        assert_eq!(M.row(1).iter().sum::<f64>(), 15.0);
        assert_eq!(M.view((0, 1), (2, 2)), dmatrix![2.0, 3.0; 5.0, 6.0]);
        assert_eq!(&M * M.transpose(), &numbers * numbers.transpose());
        assert_eq!(&M + &numbers, 2.0 * &numbers);
        M.swap_columns(0, 2);
        M.swap_rows(0, 1);
        M.as_mut_slice()[0] = 7.0;
        M.column_mut(1).fill(8.0);
        assert_eq!(M, dmatrix![7.0, 8.0, 4.0; 3.0, 8.0, 1.0]);
        let copy = M.clone();
        M.fill(0.0);
        assert_eq!(copy.into_owned(), dmatrix![7.0, 8.0, 4.0; 3.0, 8.0, 1.0]);
    }

    #[test]
    fn matrices_may_be_empty() {
        for (rows, columns) in [(0, 0), (0, 3), (3, 0)] {
            let M: Matrix<f64> = matrix(rows, columns, 1.0);
            assert_eq!((M.shape(), M.len(), M.clone_owned()), ((rows, columns), 0, DMatrix::zeros(rows, columns)));
        }
    }

    /// Those of nalgebra's that take entries out one by one leave them to be dropped by whoever has taken them.
    #[test]
    fn matrices_forget_their_elements() {
        let owner = Rc::new(0);
        let M = matrix(2, 2, owner.clone());
        let taken: Vec<Rc<i32>> = M.iter().map(|x| unsafe { core::ptr::read(x) }).collect();
        M.data.forget_elements();
        assert_eq!(Rc::strong_count(&owner), 5);
        drop(taken);
        assert_eq!(Rc::strong_count(&owner), 1);
        assert!(matrix(1, 1, 0.0).data.is_contiguous());
    }
}
