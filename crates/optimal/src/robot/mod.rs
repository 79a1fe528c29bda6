//! Robots as optimal control problems: the state x = (q, v), costs, and the action of a robot that moves freely.
//!
//! ```
//! use condyle_dynamics::{neutral, robots};
//! use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
//! use condyle_optimal::{Fddp, Problem, Status};
//! use std::sync::Arc;
//!
//! // an arm reaches for a point in 20 knots of 50 ms
//! let arm = Arc::new(robots::arm7());
//! let tool = arm.frame("tool")?;
//! let reach = Residual::FrameTranslation { frame: tool, target: [0.4, 0.2, 0.5].into() };
//! let running = vec![Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic)];
//! let terminal = vec![Cost::new("reach", 1e3, reach, Activation::Quadratic)];
//!
//! let mut action = FreeDynamics::running(arm.clone(), 0.05, running)?;
//! let x0 = [neutral(&arm), vec![0.0; 7]].concat();
//! let us = action.quasi_static(&x0).repeat(20);
//! let end = FreeDynamics::terminal(arm.clone(), terminal)?;
//! let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 20], Box::new(end))?;
//! let mut solver = Fddp::new(&problem);
//! let solution = solver.solve(&mut problem, &x0.repeat(21), &us)?;
//! assert_eq!(solution.status, Status::Converged);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![allow(non_snake_case)] // the names of the literature

mod costs;
mod free;
mod state;

pub use costs::{Activation, Cost, Costs, Residual};
pub use free::FreeDynamics;
