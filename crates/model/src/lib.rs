//! Robot models: trees of bodies and joints, their files, and how algorithms walk them.
//!
//! A [`Model`] is made by a [`ModelBuilder`] or by a reader of URDF, MJCF or SDF, checked, and frozen:
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
//! A file is refused, before memory or time is spent on it, if it is no regular file (a folder, a device, a pipe) or is
//! larger than this; the error has the number and the limit.
//!
//! | of | at most |
//! | --- | --- |
//! | bytes in the files of a robot, included ones too | 67 108 864 |
//! | tags in them, ends and comments counted | 1 048 576 |
//! | equals signs in them | 4 194 304 |
//! | levels of elements, those of included files counted where they come to stand | 256 |
//! | attributes of an element | 256 |
//! | included files of an SDF | 16 384 |
//! | bytes in the names of an SDF, those of the models around each included | 67 108 864 |
//! | attributes of all default classes of an MJCF, what they inherit included | 1 048 576 |
//! | named positions (`<group_state>`) of an SRDF | 4096 |
//! | degrees of freedom of a model, however it is made | 4096 |
//! | coordinates of a model whose joints follow others | 1024 |
//!
//! A `package://` address stays in its package, but for links there; the files that an MJCF or SDF includes may be anywhere. The
//! nearest name in an error is looked for by the first 128 characters of names, and among as many as that takes a moment.
//!
//! What the crates of algorithms need beside it is hidden from the documentation: the verbs by which a pass sees a model
//! (`layout`), the tree of its turned frames and columns (`tree`), the schedule of its limbs (`limbs`).
//!
//! # Features
//! All are on by default. `loaders`: files of robots, and [`robots`]. `serde`: models to and from its formats. `threads`: those of
//! rayon. `std`: the standard library, which the first and the last need; without it the crate needs `alloc` and, for the
//! functions of floats, the feature `libm`. Off by default is `urdf-rs`: models from `urdf_rs::Robot`.
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
pub use configuration::{difference_jacobian_groups, integrate_jacobian_groups};
pub use constraint::{ModelConstraint, ModelConstraintKind};
pub use error::Error;
#[cfg(feature = "loaders")]
pub use io::{mjcf::MjcfOptions, sdf::SdfOptions, urdf::UrdfOptions};
pub use joint::{Joint, Mimic};
pub use keyframe::Keyframe;
pub use model::Model;
pub use passive::{GravityCompensation, Spring};
#[doc(hidden)]
pub use position::{PositionFault, ROTATION_ROUNDING, unit_fault};
pub use warning::{Place, Warning, WarningKind};
