//! Dense kernels and factorizations for small matrices, and for matrices whose zeros follow a tree. This crate does not
//! depend on robot models.
//!
//! Matrices are column-major: entry (i, j) of a matrix with stride `ld` has index j · ld + i. Kernels read and write
//! whole registers. If a matrix has padding, they may read and write up to [`SLACK`] numbers after its last row. The
//! content of this padding does not matter. No kernel allocates.
//!
//! Each dense kernel is compiled in this crate once for each [SIMD level](condyle_spatial::level). A call runs the
//! version for the level in use. [`at_level`] runs a caller's own vector loops at the level in use.
//!
//! # Features
//! The features `threads` and `std` are on by default. Without `std`, the crate needs `alloc` and the feature `libm`.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(feature = "std"), no_std)]
#![allow(non_snake_case)]

#[cfg_attr(not(feature = "std"), macro_use)]
extern crate alloc;

mod aligned;
#[doc(hidden)]
pub mod axpy;
mod cast;
mod cholesky;
mod compiled;
mod copy;
mod diagonal_block;
#[doc(hidden)]
pub mod elimination_tree;
mod factor;
#[doc(hidden)]
pub mod gauss_jordan;
mod ltdl;
mod outer;
mod product;
mod registers;
mod runs;
mod small_elimination;
#[doc(hidden)]
pub mod small_solve;
#[doc(hidden)]
pub mod sparsity;
#[doc(hidden)]
pub mod threads;
mod tile;
#[doc(hidden)]
pub mod tree_product;
mod vectors;

pub use aligned::{Aligned, padded};
pub use cholesky::Cholesky;
pub use copy::{
    copy_block, copy_lower, copy_matrix, copy_symmetric, copy_symmetric_turned, copy_with_squares, transpose,
    transpose_block, transpose_negated,
};
pub use elimination_tree::ColumnTree;
pub use factor::{backward_solve, eliminate, eliminate_rows, forward_solve, solve_right};
pub use ltdl::Ltdl;
pub use outer::{OuterProducts, SparseRows, block, mask, subtract_rows};
pub use product::{
    add_blocks, add_in_turn, add_matrix, add_product, add_product_lower, add_transposed_product_lower, product,
    product_of_upper_lower, product_with_upper, product_without_slack,
};
pub use registers::{Vector, Vectorized, at_level, at_narrow_level};
pub use runs::Runs;
pub use small_elimination::eliminate_sum;
pub use tile::{SLACK, View};
pub use vectors::{add_product_vector, add_scaled_product, copy, copy_scaled, dot, max_abs, transposed_product_vector};

/// Panics unless an argument has the expected number of entries.
#[doc(hidden)]
#[inline]
#[track_caller]
pub fn check(argument: &str, found: usize, expected: usize) {
    if found != expected {
        wrong_length(argument, found, expected);
    }
}

/// Panics unless an index is below the number of items to which it may refer. Example: `check_index("frame", frame, 12,
/// "frames")`.
#[doc(hidden)]
#[inline(always)]
#[track_caller]
pub fn check_index(argument: &str, found: usize, count: usize, things: &str) {
    if found >= count {
        wrong_index(argument, found, count, things);
    }
}

/// Panics with the message of [`check_index`]. This function is not inlined.
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_index(argument: &str, found: usize, count: usize, things: &str) -> ! {
    panic!("{argument}: expected an index below {count}, the number of {things}, found {found}");
}

/// Panics with the message of [`check`]. This function is not inlined. Hundreds of functions check several arguments
/// each, and inlining would enlarge the code of all these functions.
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_length(argument: &str, found: usize, expected: usize) -> ! {
    panic!("{argument}: expected {expected} numbers, found {found}");
}

/// Code block of the README, run as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
