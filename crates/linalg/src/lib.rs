//! Dense kernels and factors for small matrices, and those with the zeros of a tree. It knows no robot.
#![allow(non_snake_case)]

#[doc(hidden)]
pub mod sparsity;
