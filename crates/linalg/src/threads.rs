//! Threads that share work, if the feature `threads` is on.

#[cfg(not(feature = "threads"))]
mod alone;
mod parts;
#[cfg(feature = "threads")]
mod shared;

#[cfg(not(feature = "threads"))]
pub use alone::{join, pause, threads};
pub use parts::Parts;
#[cfg(feature = "threads")]
pub use shared::{join, pause, threads};
