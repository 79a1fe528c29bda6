//! Clock of a solve: the system's, or in a browser, where Rust lacks one, a clock given by the host.

#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
mod host;

#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
pub(crate) use host::Instant;
#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
pub use host::set_clock;
#[cfg(not(all(target_arch = "wasm32", target_os = "unknown")))]
pub(crate) use std::time::Instant;
