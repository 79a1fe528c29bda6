//! Tests of both back ends on the same programs.

mod allocations;
mod closed_forms;
mod kkt;
mod patterns;
mod properties;
mod random;
mod refusals;
mod walk;
mod warm;
