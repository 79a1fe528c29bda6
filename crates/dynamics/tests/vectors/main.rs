//! Several states in a vector register, on every level that this processor has, and several limbs of one state.
#![allow(non_snake_case)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/common/counting.rs"]
mod counting;

mod batch;
mod duals;
mod lanes;
mod limbs;
mod table;

use condyle_dynamics::Model;
use condyle_dynamics::level::{Level, pin};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

/// The level in use is one for all threads: one test goes through all levels, or several use the best.
static LEVEL: RwLock<()> = RwLock::new(());

/// All kinds of robots, computed body by body: with the limbs side by side, a single call adds up in another order.
fn models(trees: u64) -> Vec<Model> {
    common::all_models(trees).into_iter().map(|model| model.with_limbs(false)).collect()
}

/// Runs a test at each level, and says which could not be run.
fn each_level(test: impl Fn(Level)) {
    let _alone = LEVEL.write().unwrap_or_else(PoisonError::into_inner);
    for level in Level::ALL {
        match pin(level) {
            Ok(()) => test(level),
            Err(error) => eprintln!("NOT RUN: {error}"),
        }
    }
}

/// The best level is the one in use, as long as what this returns is kept.
fn best_level() -> RwLockReadGuard<'static, ()> {
    let shared = LEVEL.read().unwrap_or_else(PoisonError::into_inner);
    let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).expect("there is the baseline");
    pin(best).expect("it is supported");
    shared
}
