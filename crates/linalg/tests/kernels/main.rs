//! Dense kernels, on every level that this processor has.
#![allow(non_snake_case)]

mod copy;
mod factor;
mod outer;
mod product;
mod small_elimination;
mod vectors;

use condyle_spatial::level::{Level, level, pin};
use std::sync::Mutex;

/// The level belongs to the whole process.
static PINNED: Mutex<()> = Mutex::new(());

/// Runs `f` at every level of this processor.
fn at_each_level(f: impl Fn()) {
    let _guard = PINNED.lock();
    let before = level();
    for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
        pin(level).unwrap();
        f();
    }
    pin(before).unwrap();
}
