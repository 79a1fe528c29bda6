//! Spatial algebra, generic over the scalar.
//!
//! [`Scalar`] is a number: `f64`, `f32`, a dual number of [num-dual](num_dual), several numbers side by side.
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
#![allow(non_snake_case)]

#[doc(hidden)]
pub mod block;
mod dual;
#[doc(hidden)]
pub mod elementary;
#[doc(hidden)]
pub mod finite;
mod fused;
#[doc(hidden)]
pub mod gate;
mod inertia;
#[doc(hidden)]
pub mod lane_dual;
#[doc(hidden)]
pub mod lanes;
pub mod level;
pub mod lie;
mod motion;
mod scalar;
mod se3;
mod sin_cos;
mod vector;

pub use inertia::{ArticulatedInertia, Inertia};
#[doc(hidden)]
pub use lanes::moves;
pub use lie::Quaternion;
pub use motion::{Cross, Force, Motion};
pub use scalar::{Constant, Scalar};
pub use se3::{Act, Se3};
pub use vector::{Mat3, Sym3, Vec3};
