//! Clock of a solve: the clock of the system. In a browser, where Rust has no clock, the host program provides one.

#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
mod host;

#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
pub(crate) use host::Instant;
#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
pub use host::set_clock;
#[cfg(not(all(target_arch = "wasm32", target_os = "unknown")))]
pub(crate) use std::time::Instant;
