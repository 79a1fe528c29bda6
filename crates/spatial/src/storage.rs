//! Storage of workspaces: arrays and matrices whose memory layout is the same for `f64` and for `FusedF64`.
//!
//! The standard library and nalgebra do not guarantee that `Vec<f64>` and `Vec<FusedF64>` have the same layout. A
//! workspace with such fields could not be reinterpreted ([`SameLayout`](crate::simd::same_layout::SameLayout)). The
//! types in this module are `repr(C)`.
#![allow(unsafe_code)]

use crate::same_layout;
use crate::simd::FusedF64;
use crate::simd::same_layout::{Rename, SameLayout};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::marker::PhantomData;
use core::mem::{ManuallyDrop, offset_of};
use core::ops::{Deref, DerefMut};
use core::ptr::NonNull;
use nalgebra::{Dyn, IsContiguous, Owned, RawStorage, RawStorageMut, Storage, U1, VecStorage};

/// Array of fixed length on the heap. The array is a boxed slice, stored as pointer and length, in this order for every
/// `T`.
#[repr(C)]
pub struct Array<T> {
    start: NonNull<T>,
    len: usize,
    owned: PhantomData<T>,
}

// SAFETY: an array owns its entries, as a boxed slice does.
unsafe impl<T: Send> Send for Array<T> {}
// SAFETY: an array owns its entries, as a boxed slice does.
unsafe impl<T: Sync> Sync for Array<T> {}

impl<T> Array<T> {
    /// Converts the array back into the boxed slice from which it was created.
    #[inline]
    fn into_boxed_slice(self) -> Box<[T]> {
        let this = ManuallyDrop::new(self);
        // SAFETY: pointer and length come from a boxed slice (`From<Vec<T>>`), and `this` is not dropped.
        unsafe { Box::from_raw(core::ptr::slice_from_raw_parts_mut(this.start.as_ptr(), this.len)) }
    }
}

impl<T> Drop for Array<T> {
    #[inline]
    fn drop(&mut self) {
        // SAFETY: pointer and length come from a boxed slice, which is dropped only here.
        drop(unsafe { Box::from_raw(core::ptr::slice_from_raw_parts_mut(self.start.as_ptr(), self.len)) });
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];
    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: pointer and length describe a slice that `self` owns.
        unsafe { core::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Array<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: pointer and length describe a slice that `self` owns, and `self` is borrowed exclusively.
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
    /// Returns the empty array.
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

// SAFETY: the struct is `repr(C)` and consists of a thin pointer, a number and a zero-sized field. If an array of A is
// dropped as an array of B, its entries are valid values of B, and the freed memory has the same layout.
#[doc(hidden)]
unsafe impl<A: SameLayout<B>, B> SameLayout<Array<B>> for Array<A> {}

#[doc(hidden)]
impl<A: SameLayout<B>, B> Rename<Array<B>> for Array<A> {
    #[inline(always)]
    fn renamed(self) -> Array<B> {
        let this = ManuallyDrop::new(self);
        Array { start: this.start.cast(), len: this.len, owned: PhantomData }
    }
}

/// Matrix in a workspace or in a result: nalgebra's matrix type, column-major, over an [`Array`].
///
/// A matrix of this type has the indices, products, comparisons and views of a `DMatrix`. `clone_owned` copies it into
/// a `DMatrix`.
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

/// Matrix whose entries are stored column by column without gaps: a [`Matrix`] or nalgebra's `DMatrix`.
///
/// A view does not qualify, because there may be gaps between its rows or columns. Code that passes a view does not
/// compile:
///
/// ```compile_fail,E0277
/// use condyle_spatial::{Dense, DenseMatrix};
/// fn clear(J: &mut DenseMatrix<f64, impl Dense<f64>>) {
///     J.as_mut_slice().fill(0.0);
/// }
/// let mut J = nalgebra::DMatrix::<f64>::zeros(6, 6);
/// clear(&mut J);
/// clear(&mut J.view_with_steps_mut((0, 0), (3, 6), (1, 0))); // every second row
/// ```
pub type DenseMatrix<T, Storage> = nalgebra::Matrix<T, Dyn, Dyn, Storage>;

/// Storage of a [`DenseMatrix`].
pub trait Dense<T>: RawStorageMut<T, Dyn, Dyn> + IsContiguous {}
impl<T, Storage: RawStorageMut<T, Dyn, Dyn> + IsContiguous> Dense<T> for Storage {}

/// Makes a matrix whose entries are all equal.
///
/// # Panics
/// If rows · columns is above the largest `usize`.
#[inline]
#[track_caller]
pub fn matrix<T: nalgebra::Scalar>(rows: usize, columns: usize, entry: T) -> Matrix<T> {
    let size = rows.checked_mul(columns).expect("a matrix of a size that a machine can count");
    let numbers = alloc::vec![entry; size].into();
    Matrix::from_data(MatrixStorage { numbers, rows: Dyn(rows), columns: Dyn(columns) })
}

/// Storage of a [`Matrix`].
#[derive(Clone, Debug)]
#[repr(C)]
pub struct MatrixStorage<T> {
    /// Entries, column by column. The length is rows · columns and never changes.
    numbers: Array<T>,
    rows: Dyn,
    columns: Dyn,
}

same_layout!(MatrixStorage { numbers } same { rows, columns });

// SAFETY: nalgebra's matrix is `repr(C)` and contains only its storage, as the assertions below check.
#[doc(hidden)]
unsafe impl SameLayout<Matrix<FusedF64>> for Matrix<f64> {}

#[doc(hidden)]
impl Rename<Matrix<FusedF64>> for Matrix<f64> {
    #[inline(always)]
    fn renamed(self) -> Matrix<FusedF64> {
        Matrix::from_data(self.data.renamed())
    }
}

const _: () = {
    assert!(offset_of!(Matrix<f64>, data) == 0 && offset_of!(Matrix<FusedF64>, data) == 0);
    assert!(size_of::<Matrix<f64>>() == size_of::<MatrixStorage<f64>>());
    assert!(size_of::<Matrix<FusedF64>>() == size_of::<MatrixStorage<FusedF64>>());
};

// SAFETY: there are rows · columns numbers, stored column by column, and the number of entries cannot change.
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

// SAFETY: there are rows · columns numbers, stored column by column, and `self` owns the numbers to which the pointer
// refers.
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

// SAFETY: all numbers are initialised, and a copy has the same length.
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
        // SAFETY: length 0 requires no initialised entries.
        unsafe { numbers.set_len(0) };
    }
}

// SAFETY: entries are stored column by column, without gaps.
unsafe impl<T> IsContiguous for MatrixStorage<T> {}
