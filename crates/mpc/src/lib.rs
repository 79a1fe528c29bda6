//! Model predictive control of walking robots and arms.
//!
//! A controller renews a plan at a fixed rate, from the measured state. A policy follows the latest plan at a higher
//! rate, for example at 1 kHz in another thread.
//!
//! | controller | robots | what it plans |
//! | --- | --- | --- |
//! | [`WholeBodyMpc`] | with legs and a free-flyer | motion of the whole body, and contact forces |
//! | [`ArmMpc`] | with a fixed base | motion along poses of a frame |
//!
//! # Conventions
//! States are x = (q, v), with q and v as in [condyle_dynamics]. Efforts belong to all joints but the free-flyer.
//! Velocities of a [`Command`] are along the heading of the trunk. All units are SI units.
#![cfg_attr(docsrs, feature(doc_cfg))]

mod arm;
mod command;
mod error;
mod foot;
mod gait;
mod guide;
mod knots;
mod landing;
mod planner;
mod policy;
mod references;
mod report;
mod schedule;
mod settings;
mod terrain;
mod whole_body;

pub use arm::{ArmMpc, ArmSettings, ArmWeights};
pub use command::Command;
pub use error::Error;
pub use foot::{Foot, FootShape};
pub use gait::{Gait, Pattern};
pub use policy::{EffortSource, Policy};
pub use report::{Report, TickStatus};
pub use settings::{PlanLimits, Settings, Weights};
pub use terrain::Terrain;
pub use whole_body::WholeBodyMpc;
