//! Several states in a vector register, on every level that this processor has.
#![allow(non_snake_case)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/common/counting.rs"]
mod counting;

mod batch;
mod duals;
mod lanes;
mod table;

use condyle_dynamics::Model;
use condyle_dynamics::level::{Level, pin};
use std::sync::{Mutex, PoisonError};

/// The level in use is one for all threads.
static LEVEL: Mutex<()> = Mutex::new(());

/// All kinds of robots, computed body by body: with the limbs side by side, a single call adds up in another order.
fn models(trees: u64) -> Vec<Model> {
    common::all_models(trees).into_iter().map(|model| model.with_limbs(false)).collect()
}

/// Runs a test at each level, and says which could not be run.
fn each_level(test: impl Fn(Level)) {
    let _alone = LEVEL.lock().unwrap_or_else(PoisonError::into_inner);
    for level in Level::ALL {
        match pin(level) {
            Ok(()) => test(level),
            Err(error) => eprintln!("NOT RUN: {error}"),
        }
    }
}
