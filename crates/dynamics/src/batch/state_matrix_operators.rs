//! Conversions of [`StateMatrix`]; sums, differences, products and comparisons with other [`StateMatrix`] and with
//! matrices of nalgebra.
//!
//! Results own their entries. Entry (i, j) of a product is a sum over increasing indices, as in plain loops.

use super::state_matrix::StateMatrix;
use alloc::vec::Vec;
use condyle_spatial::block::Real;
use core::fmt;
use core::ops::{Add, Mul, Neg, Sub};
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, Dim, Dyn, Matrix, OMatrix, RawStorage, Scalar};

/// Returns Σ M_ik x_k for row i, summed over increasing k.
#[inline]
pub(super) fn dot<T: Real>(M: &StateMatrix<'_, T>, i: usize, x: impl Fn(usize) -> T) -> T {
    let mut terms = M.row(i).into_iter().enumerate().map(|(k, &m)| m * x(k));
    let first = terms.next().unwrap_or(T::zero());
    terms.fold(first, |sum, term| sum + term)
}

/// Returns the product M x.
#[track_caller]
fn product<T: Real, R: Dim, C: Dim, S: RawStorage<T, R, C>>(
    M: &StateMatrix<'_, T>,
    x: &Matrix<T, R, C, S>,
) -> OMatrix<T, Dyn, C>
where
    DefaultAllocator: Allocator<Dyn, C>,
{
    M.check_factor(x.nrows());
    let columns = C::from_usize(x.ncols());
    OMatrix::from_fn_generic(Dyn(M.nrows()), columns, |i, j| dot(M, i, |k| x[(k, j)])) // Σ M_ik x_kj
}

/// Returns the product A M = (Mᵀ Aᵀ)ᵀ.
#[track_caller]
fn product_from_left<T: Real, R: Dim, C: Dim, S: RawStorage<T, R, C>>(
    A: &Matrix<T, R, C, S>,
    M: &StateMatrix<'_, T>,
) -> OMatrix<T, R, Dyn>
where
    DefaultAllocator: Allocator<R, Dyn>,
{
    let (m, n) = A.shape();
    assert!(n == M.nrows(), "expected {n} rows for a product with a matrix of {m} × {n}, found {}", M.nrows());
    let Mt = M.transpose();
    OMatrix::from_fn_generic(R::from_usize(m), Dyn(M.ncols()), |i, j| dot(&Mt, j, |k| A[(i, k)])) // Σ A_ik M_kj
}

/// Returns the product A B of two `StateMatrix` operands.
#[track_caller]
fn product_of_two<T: Real>(A: &StateMatrix<'_, T>, B: &StateMatrix<'_, T>) -> DMatrix<T> {
    A.check_factor(B.nrows());
    DMatrix::from_fn(A.nrows(), B.ncols(), |i, j| dot(A, i, |k| B[(k, j)])) // Σ A_ik B_kj
}

/// Returns the product M x, for a vector x in a slice.
#[track_caller]
fn product_with_slice<T: Real>(M: &StateMatrix<'_, T>, x: &[T]) -> DVector<T> {
    M.check_factor(x.len());
    DVector::from_fn(M.nrows(), |i, _| dot(M, i, |k| x[k])) // Σ M_ik x_k
}

/// Matrix with a shape and entries: a `StateMatrix` or a matrix of nalgebra.
trait Entrywise {
    type Entry;
    fn size(&self) -> (usize, usize);
    fn entry(&self, i: usize, j: usize) -> Self::Entry;
}

impl<T: Copy> Entrywise for StateMatrix<'_, T> {
    type Entry = T;
    fn size(&self) -> (usize, usize) {
        self.shape()
    }
    fn entry(&self, i: usize, j: usize) -> T {
        self[(i, j)]
    }
}

impl<T: Copy, R: Dim, C: Dim, S: RawStorage<T, R, C>> Entrywise for Matrix<T, R, C, S> {
    type Entry = T;
    fn size(&self) -> (usize, usize) {
        self.shape()
    }
    fn entry(&self, i: usize, j: usize) -> T {
        self[(i, j)]
    }
}

/// Reference to a matrix with a shape and entries.
impl<M: Entrywise> Entrywise for &M {
    type Entry = M::Entry;
    fn size(&self) -> (usize, usize) {
        (**self).size()
    }
    fn entry(&self, i: usize, j: usize) -> M::Entry {
        (**self).entry(i, j)
    }
}

/// Combines the entries of two matrices of the same shape.
#[track_caller]
fn combined<T: Real>(
    a: &impl Entrywise<Entry = T>,
    b: &impl Entrywise<Entry = T>,
    f: impl Fn(T, T) -> T,
) -> DMatrix<T> {
    let ((m, n), found) = (a.size(), b.size());
    assert!(found == (m, n), "expected two matrices of {m} × {n}, found one of {} × {}", found.0, found.1);
    DMatrix::from_fn(m, n, |i, j| f(a.entry(i, j), b.entry(i, j)))
}

/// Compares two matrices: their shapes and all entries.
fn equal<T: PartialEq>(a: &impl Entrywise<Entry = T>, b: &impl Entrywise<Entry = T>) -> bool {
    let (m, n) = a.size();
    b.size() == (m, n) && (0..n).all(|j| (0..m).all(|i| a.entry(i, j) == b.entry(i, j)))
}

/// Implements the product for the given pairs of operand types, each by value and by reference.
macro_rules! products {
    ($($Left:ty, $Right:ty, [$($dims:tt)*] $Result:ty = $product:ident;)*) => {$(
        products!(@one $Left, $Right, [$($dims)*] $Result = $product);
        products!(@one &$Left, $Right, [$($dims)*] $Result = $product);
        products!(@one $Left, &$Right, [$($dims)*] $Result = $product);
        products!(@one &$Left, &$Right, [$($dims)*] $Result = $product);
    )*};
    (@one $Left:ty, $Right:ty, [$P:ty, $Q:ty] $Result:ty = $product:ident) => {
        impl<T: Real, R: Dim, C: Dim, S: RawStorage<T, R, C>> Mul<$Right> for $Left
        where
            DefaultAllocator: Allocator<$P, $Q>,
        {
            type Output = $Result;
            #[track_caller]
            fn mul(self, x: $Right) -> $Result {
                $product(&self, &x)
            }
        }
    };
    (@one $Left:ty, $Right:ty, [] $Result:ty = $product:ident) => {
        impl<T: Real> Mul<$Right> for $Left {
            type Output = $Result;
            #[track_caller]
            fn mul(self, x: $Right) -> $Result {
                $product(&self, &x)
            }
        }
    };
}
products! {
    StateMatrix<'_, T>, Matrix<T, R, C, S>, [Dyn, C] OMatrix<T, Dyn, C> = product;
    Matrix<T, R, C, S>, StateMatrix<'_, T>, [R, Dyn] OMatrix<T, R, Dyn> = product_from_left;
    StateMatrix<'_, T>, StateMatrix<'_, T>, [] DMatrix<T> = product_of_two;
}

/// Implements the product with a vector in a slice, an array or a `Vec`.
macro_rules! products_with_slices {
    ($($Left:ty, [$($N:ident)?] $Right:ty;)*) => {$(
        impl<T: Real $(, const $N: usize)?> Mul<$Right> for $Left {
            type Output = DVector<T>;
            #[track_caller]
            fn mul(self, x: $Right) -> DVector<T> {
                product_with_slice(&self, x)
            }
        }
    )*};
}
products_with_slices! {
    StateMatrix<'_, T>, [] &[T];
    &StateMatrix<'_, T>, [] &[T];
    StateMatrix<'_, T>, [] &Vec<T>;
    &StateMatrix<'_, T>, [] &Vec<T>;
    StateMatrix<'_, T>, [N] &[T; N];
    &StateMatrix<'_, T>, [N] &[T; N];
}

/// Implements sums, differences and comparisons for the given pairs of operand types. Operands of sums and differences
/// are taken by value and by reference.
macro_rules! combinations {
    ($([$($generics:tt)*] $Left:ty, $Right:ty;)*) => {$(
        combinations!(@one [$($generics)*] $Left, $Right);
        combinations!(@one [$($generics)*] &$Left, $Right);
        combinations!(@one [$($generics)*] $Left, &$Right);
        combinations!(@one [$($generics)*] &$Left, &$Right);

        impl<T: Real, $($generics)*> PartialEq<$Right> for $Left {
            fn eq(&self, other: &$Right) -> bool {
                equal(self, other)
            }
        }
    )*};
    (@one [$($generics:tt)*] $Left:ty, $Right:ty) => {
        impl<T: Real, $($generics)*> Add<$Right> for $Left {
            type Output = DMatrix<T>;
            #[track_caller]
            fn add(self, other: $Right) -> DMatrix<T> {
                combined(&self, &other, |a, b| a + b)
            }
        }

        impl<T: Real, $($generics)*> Sub<$Right> for $Left {
            type Output = DMatrix<T>;
            #[track_caller]
            fn sub(self, other: $Right) -> DMatrix<T> {
                combined(&self, &other, |a, b| a - b)
            }
        }
    };
}
combinations! {
    [] StateMatrix<'_, T>, StateMatrix<'_, T>;
    [R: Dim, C: Dim, S: RawStorage<T, R, C>] StateMatrix<'_, T>, Matrix<T, R, C, S>;
    [R: Dim, C: Dim, S: RawStorage<T, R, C>] Matrix<T, R, C, S>, StateMatrix<'_, T>;
}

impl<T: Real> Neg for StateMatrix<'_, T> {
    type Output = DMatrix<T>;
    fn neg(self) -> DMatrix<T> {
        -self.to_owned()
    }
}

impl<T: Real> Mul<T> for StateMatrix<'_, T> {
    type Output = DMatrix<T>;
    fn mul(self, factor: T) -> DMatrix<T> {
        self.to_owned().map(|x| x * factor)
    }
}

macro_rules! factors_from_left {
    ($($T:ty),*) => {$(
        impl Mul<StateMatrix<'_, $T>> for $T {
            type Output = DMatrix<$T>;
            fn mul(self, matrix: StateMatrix<'_, $T>) -> DMatrix<$T> {
                matrix * self
            }
        }
    )*};
}
factors_from_left!(f64, f32);

impl<T: Scalar> From<StateMatrix<'_, T>> for DMatrix<T> {
    fn from(matrix: StateMatrix<'_, T>) -> Self {
        matrix.to_owned()
    }
}

impl<T: Scalar> From<&StateMatrix<'_, T>> for DMatrix<T> {
    fn from(matrix: &StateMatrix<'_, T>) -> Self {
        matrix.to_owned()
    }
}

impl<T: Scalar> fmt::Debug for StateMatrix<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_owned().fmt(f)
    }
}

impl<T: Scalar + fmt::Display> fmt::Display for StateMatrix<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_owned().fmt(f)
    }
}
