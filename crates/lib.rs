#![doc = include_str!("../README.md")]
#![doc = include_str!("guide.md")]

pub mod conventions;
mod plan;

pub use condyle_dynamics::*;
pub use condyle_optimal as optimal;
pub use condyle_wholebody as wholebody;
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
