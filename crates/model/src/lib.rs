//! Robot models: trees of bodies and joints, readers and writers of robot files, and the interface between models and
//! algorithms.
//!
//! A [`Model`] is created by a [`ModelBuilder`], or by a reader of URDF, MJCF or SDF. A model is checked and then
//! immutable:
//!
//! ```
//! use condyle_model::{integrate, neutral, robots};
//! let quadruped = robots::quadruped();
//! let (q, mut moved) = (neutral(&quadruped), vec![0.0; 19]);
//! integrate(&quadruped, &q, &[0.1; 18], &mut moved);
//! assert!(moved[0] > 0.0); // the base has moved forwards
//! ```
//!
//! # Limits of files
//!
//! A file is refused if it is not a regular file (for example a folder, a device or a pipe), or if it exceeds a limit.
//! The check comes before the file takes much memory or time. The error contains the number and the limit. These
//! maximum numbers are allowed:
//!
//! - 67 108 864 bytes in all files of a robot, including the files that these files include;
//! - 1 048 576 tags in these files, including end tags and comments;
//! - 4 194 304 equals signs in these files;
//! - a depth of 256 nested elements, counted across included files;
//! - 256 attributes of an element;
//! - 16 384 included files of an SDF;
//! - 67 108 864 bytes in the full names of an SDF; a full name contains the names of all models around an item;
//! - 1 048 576 tags and 4 194 304 equals signs in an MJCF, including the copies of `<replicate>` and `<attach>`;
//! - 256 `<attach>` elements in an MJCF and in the files that it attaches;
//! - 536 870 912 bytes in the mesh files from which masses of an MJCF are computed;
//! - 1 048 576 attributes in all default classes of an MJCF, including inherited ones;
//! - 4096 named positions (`<group_state>`) of an SRDF;
//! - 4 194 304 numbers in the keyframes of an MJCF;
//! - 1 048 576 joints in the tendons that the actuators of an MJCF drive;
//! - 4096 actuators of an MJCF with `dampratio`;
//! - 4096 degrees of freedom in any model;
//! - 1024 coordinates in a model whose joints follow others.
//!
//! A `package://` address cannot leave its package, except through links in the package. The files that an MJCF or SDF
//! includes may be anywhere. For an error about an unknown name, the nearest name is searched. This search compares
//! only the first 128 characters of names, and it stops early if there are many names.
//!
//! Some public modules are only for Condyle's crates with algorithms, and are hidden from the documentation. They are
//! `layout` (the interface of passes to a model), `tree` (the tree of turned frames and columns) and `limbs` (the
//! schedule of limbs).
//!
//! # Features
//! All features except `urdf-rs` are on by default. `loaders` is for robot files and for the module [`robots`].
//! `meshes` is for masses and inertias of meshes in MJCF. `serde` is for serialization of models. `threads` uses the
//! threads of rayon. `std` uses the standard library; all other features except `serde` need it. Without `std`, the
//! crate needs `alloc` and, for floating-point functions, the feature `libm`. `urdf-rs` is for models from
//! `urdf_rs::Robot`.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(any(feature = "std", test)), no_std)]
#![allow(non_snake_case)]

#[cfg_attr(not(any(feature = "std", test)), macro_use)]
extern crate alloc;

mod actuator;
mod additions;
mod body;
mod builder;
mod compose;
mod configuration;
mod constraint;
mod equality;
mod error;
pub mod inertial_parameters;
mod io;
#[doc(hidden)]
pub mod joint;
mod keyframe;
#[doc(hidden)]
pub mod layout;
#[doc(hidden)]
pub mod limbs;
mod magnitude;
mod model;
mod names;
mod passive;
mod position;
mod real;
#[cfg(feature = "loaders")]
pub mod robots;
#[doc(hidden)]
pub mod tree;
mod validate;
mod variants;
mod warning;
mod with_frame;

pub use actuator::{Actuator, Transmission};
pub use body::{Body, Frame, FrameKind, FrameParent, JointOptions, Limits};
pub use builder::{BodyId, ModelBuilder, WORLD};
pub use condyle_spatial::{Inertia, Mat3, Scalar, Se3, Sym3, Vec3};
pub use configuration::{
    DifferenceArgument, IntegrateArgument, difference, difference_jacobian, distance, integrate, integrate_jacobian,
    interpolate, neutral, normalize, random_configuration, transport,
};
#[doc(hidden)]
pub use configuration::{commuting_difference, difference_jacobian_groups, integrate_jacobian_groups};
pub use constraint::{ModelConstraint, ModelConstraintKind};
pub use error::Error;
#[cfg(feature = "loaders")]
pub use io::{mjcf::MjcfOptions, sdf::SdfOptions, urdf::UrdfOptions};
#[doc(hidden)]
pub use joint::GroupJacobian;
pub use joint::{Joint, Mimic};
pub use keyframe::Keyframe;
pub use model::Model;
pub use passive::{GravityCompensation, Spring};
#[doc(hidden)]
pub use position::{PositionFault, ROTATION_ROUNDING, unit_fault};
pub use warning::{Place, Warning, WarningKind};

/// Code block of the README, run as a doctest.
#[cfg(all(doctest, feature = "loaders"))]
#[doc = include_str!("../README.md")]
mod readme {}
