//! Tests of several states in a vector register, and of several limbs of one state in parallel lanes. The tests run at
//! every SIMD level of this processor.
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

/// Lock of the SIMD level, which is common to all threads. Either one test uses all levels one after the other, or
/// several tests use the best level at the same time.
static LEVEL: RwLock<()> = RwLock::new(());

/// Returns robots of all kinds, for which single calls do not compute limbs in parallel lanes. Sums over parallel limbs
/// have another order.
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

/// Selects the best SIMD level. The level stays selected while the returned guard exists.
fn best_level() -> RwLockReadGuard<'static, ()> {
    let shared = LEVEL.read().unwrap_or_else(PoisonError::into_inner);
    let best = Level::ALL.into_iter().rfind(|level| level.is_supported()).expect("there is the baseline");
    pin(best).expect("it is supported");
    shared
}
