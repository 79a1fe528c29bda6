//! Generated straight-line code for robots. The algorithms of the library run once, on numbers that record how they are
//! computed.
//!
//! ```
//! use condyle_codegen::{Language, Settings, functions};
//! use condyle_dynamics::robots;
//! let arm = robots::arm7();
//! let functions = functions(&arm, &["rnea", "aba"], &Settings::default())?;
//! let [header, source] = &Language::C.text("arm7", &functions)[..] else { unreachable!() };
//! assert!(header.text.contains("void arm7_aba(const double *restrict q, "));
//! assert!(source.text.contains("arm7_sin_cos"));
//! # Ok::<(), condyle_codegen::Error>(())
//! ```
//!
//! [`record`] runs any closure that is generic over the scalar on [`Expression`]s. The operations on these expressions
//! form a graph, in which constants are folded, zeros are removed, and each value is computed once. [`functions`]
//! records the algorithms for a robot, [`Language`] writes the graph as C, Rust or CUDA, and [`generate`] writes files.
//! Values that depend only on constants of the robot are computed during the recording, not at run time. The code has
//! no branches and allocates no memory. It has loops only for entries of a result with the same structure.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![allow(non_snake_case)]

#[cfg(feature = "cuda")]
pub mod cuda;
mod derivative;
mod entries;
mod error;
mod expression;
mod forms;
mod function;
mod generate;
mod graph;
mod identifiers;
mod order;
mod partitions;
mod program;
mod robot;
mod step;
mod steps;
mod sums;
mod text;

pub use derivative::{DualExpression, jacobian};
pub use error::Error;
pub use expression::{Expression, Mask};
pub use forms::{ForwardDerivatives, aba, aba_derivatives, crba, minv};
#[doc(hidden)]
pub use forms::{branches::Branches, joint_placement::Carried, joint_placement::JointPlacement};
pub use function::{Array, Function, Operations, Recorder, record};
pub use generate::generate;
pub use identifiers::identifier;
pub use robot::{FUNCTIONS, Settings, functions};
pub use text::{Language, SourceFile};

/// Code block of the README, run as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
