//! Dense kernels and factors for small matrices, and those with the zeros of a tree. It knows no robot.
#![allow(non_snake_case)]

#[doc(hidden)]
pub mod axpy;
mod cast;
mod cholesky;
#[doc(hidden)]
pub mod elimination_tree;
mod ltdl;
#[doc(hidden)]
pub mod sparsity;
#[doc(hidden)]
pub mod tree_product;

pub use cholesky::Cholesky;
pub use elimination_tree::ColumnTree;
pub use ltdl::Ltdl;

/// Panics unless an argument has as many numbers as it must have.
#[doc(hidden)]
#[inline]
#[track_caller]
pub fn check(argument: &str, found: usize, expected: usize) {
    assert!(found == expected, "{argument}: expected {expected} numbers, found {found}");
}
