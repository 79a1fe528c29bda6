//! Tests of several states in a vector register, and of several branches of one state, at every SIMD level of this
//! processor.
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

/// Lock of the SIMD level, which all threads share. Either one test uses all levels in turn, or several tests use the
/// best level.
static LEVEL: RwLock<()> = RwLock::new(());

/// Returns all kinds of robots without limbs, because single calls with branches in parallel lanes add in another
/// order.
fn models(trees: u64) -> Vec<Model> {
    common::all_models(trees).into_iter().map(|model| model.with_limbs(false)).collect()
}

/// Runs a test at each SIMD level, and prints the levels that this processor does not support.
fn each_level(test: impl Fn(Level)) {
    let _alone = LEVEL.write().unwrap_or_else(PoisonError::into_inner);
    for level in Level::ALL {
        match pin(level) {
            Ok(()) => test(level),
            Err(error) => eprintln!("NOT RUN: {error}"),
        }
    }
}

/// Keeps the best SIMD level in use while the returned guard exists.
fn best_level() -> RwLockReadGuard<'static, ()> {
    let shared = LEVEL.read().unwrap_or_else(PoisonError::into_inner);
    let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).expect("there is the baseline");
    pin(best).expect("it is supported");
    shared
}
