#![doc = include_str!("../README.md")]

pub use condyle_dynamics::*;
pub use condyle_optimal as optimal;
pub use condyle_wholebody as wholebody;
