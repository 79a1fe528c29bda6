//! Whole-body control: which joint efforts make a robot in contact do what it is told.
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
//! ```
//!
//! The efforts τ are eliminated: their limits are rows in x. [`Task`]s move the centre of mass, frames, joints, angular
//! momentum and forces, with a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v), by weights or in a strict order of priorities;
//! [`References`] say where to, tick by tick, and which contacts touch. A step always gives a [`Command`] that is finite and
//! within the torque limits; its [`Status`] says whether it is the solution. An invalid state or reference (a quaternion that does
//! not have length 1, a matrix that is no rotation, a number that is not finite) is a status too.
//!
//! # Conventions
//! - q, v, τ as in [condyle_dynamics]; the actuated coordinates are all but those of free-flyers.
//! - A contact is a point, an edge or a convex polygon in a frame. Its force is what the environment does to the robot.
//! - Positions, velocities and accelerations of tasks and contacts are along the world's axes, accelerations classical:
//!   the second derivative of the position.
//! - Memory is fixed by [`WholeBodyController::new`].
//! - A wrong description is an [`Error`] of `new`; a wrong length panics.
//!
//! # Features
//! On by default: `loaders` (files of robots, and embedded ones) and `threads` (those of rayon). Off by default: `clarabel`, a second
//! solver for comparison, with its dependencies: `Backend::Clarabel` exists with it.
//!
//! Sources: Sentis and Khatib (2005), operational tasks under contact; Herzog et al. (2016), inverse dynamics as a
//! program in (q̈, f); Lobo et al. (1998), friction as a second-order cone; Baumgarte (1972), drift; Caron, Pham and
//! Nakamura (2015), the wrench of a sole.
#![allow(non_snake_case)]

mod basis;
mod carried;
mod command;
mod condense;
mod cone_program;
mod contact;
mod contact_numbers;
mod controller;
mod equations;
mod error;
#[doc(hidden)]
pub mod inspection;
mod kinematics;
mod least_squares;
mod levels;
#[cfg(feature = "clarabel")]
mod lifted;
mod limits;
mod memory;
mod numbers;
mod objective;
mod optimality;
mod plan;
mod reason;
mod references;
mod safety;
mod settings;
mod task;

pub use command::{Command, CommandSource};
pub use contact::{FrictionContact, Normal, Shape, SurfaceForces};
pub use controller::WholeBodyController;
pub use error::{Error, InvalidRotation, Status};
pub use optimality::Optimality;
pub use plan::{Plan, PlanData};
pub use references::{ComTarget, ContactTarget, FrameTarget, MomentumTarget, PostureTarget, References};
pub use settings::{Backend, Form, Friction, JointLimits, Settings};
pub use task::{Axes, Gains, Task, TaskKind};
