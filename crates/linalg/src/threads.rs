//! Threads that share work, if the feature `threads` has them.

#[cfg(not(feature = "threads"))]
mod alone;
#[cfg(feature = "threads")]
mod shared;

#[cfg(not(feature = "threads"))]
pub use alone::{join, threads};
#[cfg(feature = "threads")]
pub use shared::{join, threads};
