//! Whole-body control: which joint efforts make a robot in contact do what it is told.
//!
//! At each tick one cone program is solved, on [clarabel], with true friction cones instead of pyramids:
//!
//! ```text
//! x = (q̈, f₁ … f_k)          accelerations, and a force at each contact point (N, world's frame)
//!
//! minimise     ½ Σ w (J q̈ + J̇ v − a*)²  +  ½ w_a ‖q̈‖²  +  ½ w_f Σ ‖f − f_ref‖²
//! subject to   Sᵤ (M q̈ + h − Jᵀ f) = 0              no motor acts on a free-flyer
//!              J_c q̈ + J̇_c v = k (p_ref − p) − d ṗ   contacts are held (k = d = 0 unless set)
//!              ‖(t₁ᵀ f, t₂ᵀ f)‖ ≤ μ nᵀ f             friction, a second-order cone for each contact
//!              f_min ≤ nᵀ f ≤ f_max
//!              −τ̄ ≤ τ ≤ τ̄  with  τ = S (M q̈ + h − Jᵀ f)
//! ```
//!
//! The efforts τ are eliminated: their limits are rows in x. [`Tasks`] move the centre of mass, frames and joints, with
//! a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v); [`References`] say where to, tick by tick.
//!
//! # Conventions
//! - q, v, τ as in [condyle_dynamics]; the actuated coordinates are all but those of free-flyers.
//! - A contact is a point: the origin of a frame. f is what the environment does to the robot.
//! - Positions, velocities and accelerations of tasks and contacts are along the world's axes, accelerations classical:
//!   the second derivative of the position. J̇ v is exact, from numbers that carry two time derivatives through
//!   `forward_kinematics`.
//! - Sparsity and memory are fixed by [`WholeBodyController::new`]; a step allocates once, inside clarabel.
//! - A wrong description is an [`Error`] of `new`, a step without a command returns a [`Status`], a wrong length panics.
//!
//! Sources: Sentis and Khatib (2005), operational tasks under contact; Herzog et al. (2016), inverse dynamics as a
//! program in (q̈, f); Lobo et al. (1998), friction as a second-order cone; Baumgarte (1972), drift.
#![allow(non_snake_case)]

mod cone_program;
mod controller;
mod equations;
mod error;
mod kinematics;
mod program;
mod rows;
mod settings;
mod task;

pub use controller::{Command, WholeBodyController};
pub use error::{Error, Status};
pub use settings::Settings;
pub use task::{
    ComTarget, ComTask, ContactTarget, FrameTarget, FrameTask, FrictionContact, Gains, PostureTarget, PostureTask,
    References, Tasks,
};
