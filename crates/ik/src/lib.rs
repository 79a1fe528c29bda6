//! Inverse kinematics: from targets of frames to joint velocities and postures.
//!
//! [`DifferentialIk`] computes the displacement Δq of one step of duration T, and the velocity v = Δq / T:
//!
//! ```text
//! minimise     ½ Σ w f (J Δq − α e)²  +  ½ μ Σ w f (α e)² ‖Δq‖²  +  ½ ε ‖Δq‖²
//! subject to   limits of positions, velocities and accelerations: bounds on Δq
//!              ∂d/∂q Δq ≥ −min(γ T, 1) (d − d_min)  for the distance d of each pair of bodies
//! ```
//!
//! [`Task`]s have errors e with Jacobians J, weights w with factors f, gains α, damping μ, and strict priorities.
//! [`Targets`] set the targets of each step.
//!
//! # Conventions
//! - q and v are defined as in [condyle_dynamics]. Poses of targets are oXt, in the world, or in the task's root.
//! - Lengths are in m, angles in rad.
//! - The constructors allocate all memory; a step allocates nothing.
//! - An invalid description or argument gives an [`Error`] that names it.
//!
//! Sources: Kanoun, Lamiraux and Wieber, *Kinematic control of redundant manipulators: generalizing the task-priority
//! framework to inequality tasks* (2011); Sugihara, *Solvability-unconcerned inverse kinematics by the
//! Levenberg–Marquardt method* (2011); Faverjon and Tournassoud, *A local based approach for path planning of
//! manipulators with a high number of degrees of freedom* (1987) for limits of distances.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![allow(non_snake_case)]

mod active_set;
mod bounds;
mod descent;
mod differential;
mod error;
mod global;
mod held;
mod manipulability;
mod rows;
mod search;
mod search_settings;
mod separation;
mod settings;
mod task;

pub use condyle_dynamics::distances::DistanceLimits;
pub use differential::{DifferentialIk, Status, Step};
pub use error::Error;
pub use global::{GlobalIk, Outcome, Posture};
pub use held::Held;
pub use rows::Targets;
pub use search_settings::{Rank, SearchSettings};
pub use settings::{JointLimits, Settings};
pub use task::{Task, TaskKind};

/// Runs the code block of the README as a doctest.
#[cfg(all(doctest, feature = "loaders"))]
#[doc = include_str!("../README.md")]
mod readme {}
