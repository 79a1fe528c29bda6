//! Whole-body control: computes the joint efforts with which a robot in contact carries out its tasks.
//!
//! At each tick one cone program is solved, with true friction cones instead of pyramids:
//!
//! ```text
//! x = (q̈, f)                   accelerations, and the forces of the contacts along their axes (t₁, t₂, n)
//!
//! minimise     ½ Σ w ‖J q̈ + J̇ v − a*‖²  +  ½ w_a ‖q̈‖²  +  ½ w_f ‖f − f_ref‖²
//! subject to   Sᵤ (M q̈ + h − Jᵀ f) = 0                no motor acts on a free-flyer
//!              J_c q̈ + J̇_c v = k (X_ref ⊖ X) − d v     contacts are held (k = d = 0 unless set)
//!              ‖(f₁, f₂)‖ ≤ μ f_n                      friction, a second-order cone for each force
//!              f_n p ∈ f_n · polygon, |τ_n| ≤ γ f_n     centre of pressure and yaw moment of a sole's wrench
//!              f_min ≤ Σ f_n ≤ f_max                   for each contact, ramped while it fades in or out
//!              −τ̄ ≤ τ ≤ τ̄  with  τ = S (M q̈ + h − Jᵀ f)
//!              bounds on q̈                             from limits of position and velocity: [`JointLimits`]
//!              ∂d/∂q q̈ ≥ …                             for the distance d of each pair of bodies: [`DistanceLimits`]
//! ```
//!
//! The efforts τ are eliminated: their limits become rows in x. [`Task`]s move the centre of mass, frames, joints,
//! angular momentum and forces, with the desired acceleration a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v). Tasks have
//! weights or strict priorities. [`References`] set the targets of each tick and the contacts that touch. A step always
//! returns a [`Command`] that is finite and within the torque limits. The command's [`Status`] tells whether the
//! command is the solution of the program. Invalid states and references are also reported by a status: a quaternion
//! without length 1, a matrix that is not a rotation, a number that is not finite.
//!
//! # Conventions
//! - q, v and τ are defined as in [condyle_dynamics]. Coordinates of free-flyers are not actuated; all others are.
//! - A contact is a point, an edge or a convex polygon in a frame. The contact force acts from the environment on the
//!   robot.
//! - Positions, velocities and accelerations of tasks and contacts are along the world's axes. Accelerations are
//!   classical: the second derivative of the position.
//! - [`WholeBodyController::new`] allocates the memory of all steps.
//! - An invalid description makes `new` return an [`Error`]; an argument of the wrong length causes a panic.
//!
//! # Features
//! On by default: `loaders` (reads robots from files, and has built-in robots) and `threads` (uses rayon). Off by
//! default: `clarabel`, which adds `Backend::Clarabel`, a second solver for comparison, and its dependencies.
//!
//! Sources: Sentis and Khatib (2005) for operational tasks under contact; Herzog et al. (2016) for inverse dynamics as
//! a program in (q̈, f); Lobo et al. (1998) for friction as a second-order cone; Baumgarte (1972) for the correction of
//! drift; Caron, Pham and Nakamura (2015) for the wrench of a sole.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![allow(non_snake_case)]

mod basis;
mod carried;
mod command;
mod condense;
mod cone_program;
mod contact;
mod contact_rows;
mod controller;
mod equations;
mod error;
#[doc(hidden)]
pub mod inspection;
mod kinematics;
mod kkt_residuals;
mod least_squares;
#[cfg(feature = "clarabel")]
mod lifted;
mod limits;
mod numbers;
mod objective;
mod plan;
mod reason;
mod references;
mod safety;
mod separation;
mod settings;
mod task;
mod task_hierarchy;
mod warm_start;

/// The crate of the solver behind [`Backend::Clarabel`], for programs that also call this solver directly.
#[cfg(feature = "clarabel")]
pub use clarabel;
pub use command::{Command, CommandSource};
pub use condyle_dynamics::distances::DistanceLimits;
pub use contact::{FrictionContact, Normal, Shape, SurfaceForces};
pub use controller::WholeBodyController;
pub use error::{Error, InvalidRotation, Status};
pub use kkt_residuals::KktResiduals;
pub use plan::{Plan, PlanData};
pub use references::{ComTarget, ContactTarget, FrameTarget, MomentumTarget, PostureTarget, References};
pub use settings::{Backend, Formulation, Friction, JointLimits, Settings};
pub use task::{Axes, Gains, Task, TaskKind};

/// Runs the code block of the README as a doctest.
#[cfg(all(doctest, feature = "loaders"))]
#[doc = include_str!("../README.md")]
mod readme {}
