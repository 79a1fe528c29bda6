//! Tests of the dense kernels, at every SIMD level that this processor has.
#![allow(non_snake_case)]

mod aligned;
mod copy;
mod factor;
mod outer;
mod product;
mod small_elimination;
mod vectors;

use condyle_spatial::level::{Level, level, pin};
use std::sync::Mutex;

/// Lock for the SIMD level, which is global to the process.
static PINNED: Mutex<()> = Mutex::new(());

/// Runs `f` at every SIMD level of this processor.
fn at_each_level(f: impl Fn()) {
    let _guard = PINNED.lock();
    let before = level();
    for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
        pin(level).unwrap();
        f();
    }
    pin(before).unwrap();
}
