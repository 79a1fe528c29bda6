//! Spatial algebra, generic over the scalar.
//!
//! [`Scalar`] is a number: `f64`, `f32`, a dual number of [num-dual](https://docs.rs/num-dual), several numbers side by side.
//! [`Motion`] and [`Force`] are the two kinds of spatial vector, [`Inertia`] takes one to the other, and a pose
//! [`Se3`] changes their coordinates. [`lie`] has rotations, exponentials, logarithms and their Jacobians.
//!
//! Flattened to six numbers, motions and forces read linear first, angular second. `aXb` is the pose of frame b in
//! frame a, and `aXb.act(x)` takes x from coordinates in b to coordinates in a.
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
//! `std` (on by default): the processor is asked which vectors it has, and numbers of num-dual are scalars. Without it the crate
//! needs `alloc` and, for the functions of floats, the feature `libm`. `serde` (on by default): all that a file may have.
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
