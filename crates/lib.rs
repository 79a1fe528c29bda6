#![doc = include_str!("../README.md")]
#![cfg_attr(all(feature = "optimal", feature = "wholebody"), doc = include_str!("guide.md"))]

pub mod conventions;
mod error;
#[cfg(all(feature = "optimal", feature = "wholebody"))]
mod plan;

pub use condyle_dynamics::Error as ModelError;
pub use condyle_dynamics::*;
#[cfg(feature = "optimal")]
pub use condyle_optimal as optimal;
#[cfg(feature = "wholebody")]
pub use condyle_wholebody as wholebody;
pub use error::Error; // in place of that of dynamics
#[cfg(all(feature = "optimal", feature = "wholebody"))]
pub use plan::plan_of;

/// The Rust blocks of the book, as doctests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../docs/lanes.md")]
    mod lanes {}
    #[doc = include_str!("../docs/derivatives.md")]
    mod derivatives {}
    #[doc = include_str!("../docs/conversions.md")]
    mod conversions {}
}
