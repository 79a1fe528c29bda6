//! Spatial algebra, generic over the scalar.
//!
//! [`Scalar`] is the number type: `f64`, `f32`, a dual number of [num-dual](https://docs.rs/num-dual), or several
//! numbers in SIMD lanes. [`Motion`] and [`Force`] are the two kinds of spatial vector. [`Inertia`] maps motions to
//! forces. A pose [`Se3`] changes the coordinates of motions, forces and inertias. [`lie`] contains exponentials and
//! logarithms of rotations and poses, and their Jacobians.
//!
//! If motions and forces are written as six numbers, the linear part comes first and the angular part second. `aXb` is
//! the pose of frame b in frame a. `aXb.act(x)` maps x from coordinates in b to coordinates in a.
//!
//! ```
//! use condyle_spatial::{Act, Force, Mat3, Motion, Se3, Vec3};
//! let aXb = Se3::new(Mat3::identity(), Vec3::new(0.0, 0.0, 2.0));
//! let spin = Motion::new(Vec3::zero(), Vec3::new(1.0, 0.0, 0.0)); // about the x axis of b
//! assert_eq!(aXb.act(spin).linear, Vec3::new(0.0, 2.0, 0.0)); // the body's point at the origin of a moves
//! let pull = Force::new(Vec3::new(0.0, 3.0, 0.0), Vec3::zero());
//! assert_eq!(aXb.act(spin).dot(aXb.act(pull)), spin.dot(pull)); // power has no frame
//! ```
//!
//! # Features
//! `std` (on by default): SIMD instructions are detected at run time, and num-dual's numbers are scalars. Without
//! `std`, the crate needs `alloc`, and the feature `libm` for floating-point functions.
//!
//! `serde` (on by default): types that are stored in files can be serialized.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(any(feature = "std", test)), no_std)]
#![allow(non_snake_case)]

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("roots and sines are those of `std` or of `libm`: one of these features must be on");

extern crate alloc;

mod algebra;
#[cfg(feature = "serde")]
#[doc(hidden)]
pub mod finite;
mod scalar;
#[doc(hidden)]
pub mod simd;
mod storage;

pub use algebra::inertia::{ArticulatedInertia, Inertia};
pub use algebra::lie;
pub use algebra::motion::{Cross, Force, Motion};
pub use algebra::quaternion::Quaternion;
pub use algebra::se3::{Act, Se3};
pub use algebra::vector::{Mat3, Sym3, Vec3};
pub use scalar::{Constant, Scalar};
#[doc(hidden)]
pub use scalar::{elementary, lane_dual};
pub use simd::level;
#[doc(hidden)]
pub use simd::{gate, lanes::moves, pack as block};
pub use storage::{Array, Dense, DenseMatrix, Matrix, MatrixStorage, matrix};

/// Code block of the README, run as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
