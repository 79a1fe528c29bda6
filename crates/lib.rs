#![doc = include_str!("../README.md")]

mod plan;

pub use condyle_dynamics::*;
pub use condyle_optimal as optimal;
pub use condyle_wholebody as wholebody;
pub use plan::plan_of;
