//! Exports functions to CasADi through its C interface. Each function is bound to a numbered slot.
//!
//! `casadi.external` finds a function by its name among the symbols of a library, and its derivatives by names that
//! contain the function's name. A robot is known only at run time, so the library exports the symbols of [`SLOTS`]
//! functions. Each symbol computes the function that is bound to its slot. CasADi reports when a use of a slot begins
//! and ends; the slot becomes free when the last use ends.
//!
//! For slot n the library exports `condyle_n`, the function; `jac_condyle_n`, its Jacobian; `adj1_condyle_n`, Jᵀλ; and
//! `jac_adj1_condyle_n`, whose blocks are the Hessian of λᵀf and Jᵀ.
#![allow(unsafe_code)]

use super::bound::{Bound, Description, HESSIAN, JACOBIAN, Port, REVERSE, VALUE};
use super::computation::Computation;
use condyle::ModelError as Error;
use core::ffi::{c_char, c_int};
use core::ptr::null;
use core::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of functions that exist at the same time.
pub(super) const SLOTS: usize = 64;

/// Maximum time between the creation of a function in CasADi and CasADi's query of the function's inputs. After this
/// time the function counts as loaded from a file.
const DESCRIPTION_TIME: Duration = Duration::from_millis(50);

/// A slot: the bound function, and the number of the slot's users.
struct Slot {
    bound: AtomicPtr<Bound>,
    users: Mutex<Users>,
    /// For each function of the slot, the number of CasADi's objects that have not queried the function's description.
    /// CasADi loaded these objects from a file.
    loaded: [AtomicUsize; 4],
}

/// Users of a slot: for each of the slot's functions, the number of CasADi's objects that use the function; and the
/// number of holds by Python objects.
#[derive(Clone, Copy)]
struct Users {
    functions: [usize; 4],
    holds: usize,
}

impl Users {
    fn any(&self) -> bool {
        self.holds > 0 || self.functions != [0; 4]
    }
}

static SLOT: [Slot; SLOTS] = [const {
    Slot {
        bound: AtomicPtr::new(core::ptr::null_mut()),
        users: Mutex::new(Users { functions: [0; 4], holds: 0 }),
        loaded: [const { AtomicUsize::new(0) }; 4],
    }
}; SLOTS];

impl Slot {
    /// Returns the function bound to the slot.
    fn get(&self) -> Option<&Bound> {
        // SAFETY: the bound function is freed only after the last user has left, and the caller is a user.
        unsafe { self.bound.load(Ordering::Acquire).as_ref() }
    }

    fn users(&self) -> MutexGuard<'_, Users> {
        self.users.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds one to the number of CasADi's objects that use the function. A newly created object queries its inputs
    /// next; an object loaded from a file does not.
    fn enter(&self, function: usize) {
        self.users().functions[function] += 1;
        self.loaded[function].fetch_add(1, Ordering::AcqRel);
    }

    /// Records that an object of CasADi queried its description. Such an object was not loaded from a file.
    fn describe(&self, function: usize) {
        let less = |n: usize| n.checked_sub(1);
        let _ = self.loaded[function].fetch_update(Ordering::AcqRel, Ordering::Acquire, less);
    }

    /// Subtracts one from the number of CasADi's objects that use the function. If `function` is `None`, subtracts one
    /// from the number of holds.
    fn leave(&self, function: Option<usize>) {
        let mut users = self.users();
        match function {
            Some(function) => {
                let left = &mut users.functions[function];
                *left = left.saturating_sub(1);
                if *left == 0 {
                    self.loaded[function].store(0, Ordering::Release);
                }
            }
            None => users.holds = users.holds.saturating_sub(1),
        }
        if !users.any() {
            let bound = self.bound.swap(core::ptr::null_mut(), Ordering::AcqRel);
            if !bound.is_null() {
                // SAFETY: the pointer comes from a box, and the slot has no users any more.
                drop(unsafe { Box::from_raw(bound) });
            }
        }
    }

    /// Returns whether an object of CasADi may have been loaded from a file. In this case the slot may now belong to
    /// another robot. Waits for objects that another thread is creating.
    fn was_loaded(&self, function: usize) -> bool {
        let begin = Instant::now();
        while self.loaded[function].load(Ordering::Acquire) > 0 {
            if begin.elapsed() > DESCRIPTION_TIME {
                return true;
            }
            std::thread::yield_now();
        }
        false
    }
}

/// Holds a slot that computes the function with this key, for this number of states at a time. If no slot computes this
/// function yet, binds the result of `make` to a free slot. Returns `None` if all slots are taken.
pub(super) fn hold(
    key: Vec<u8>,
    states: usize,
    make: impl FnOnce() -> Result<Box<dyn Computation>, Error>,
) -> Result<Option<String>, Error> {
    let name = |k: usize| Some(format!("condyle_{k}"));
    for (k, slot) in SLOT.iter().enumerate() {
        let mut users = slot.users();
        if slot.get().is_some_and(|bound| bound.key == key) {
            users.holds += 1;
            return Ok(name(k));
        }
    }
    let bound = Box::new(Bound::new(make()?, states, key)?);
    for (k, slot) in SLOT.iter().enumerate() {
        let mut users = slot.users();
        if !users.any() {
            users.holds = 1;
            slot.bound.store(Box::into_raw(bound), Ordering::Release);
            return Ok(name(k));
        }
    }
    Ok(None)
}

/// Ends a hold of the slot with this name.
pub(super) fn release(name: &str) {
    let slot = name.strip_prefix("condyle_").and_then(|k| k.parse::<usize>().ok()).and_then(|k| SLOT.get(k));
    if let Some(slot) = slot {
        slot.leave(None);
    }
}

/// Returns the description of one of a slot's functions.
fn description(slot: usize, function: usize) -> Option<&'static Description> {
    SLOT[slot].get().map(|bound| &bound.descriptions[function])
}

fn count(ports: Option<usize>) -> i64 {
    ports.and_then(|n| i64::try_from(n).ok()).unwrap_or(1)
}

fn input(slot: usize, function: usize, k: i64) -> Option<&'static Port> {
    description(slot, function)?.inputs.get(usize::try_from(k).ok()?)
}

fn output(slot: usize, function: usize, k: i64) -> Option<&'static Port> {
    Some(&description(slot, function)?.outputs.get(usize::try_from(k).ok()?)?.port)
}

fn name_of(port: Option<&Port>) -> *const c_char {
    port.map_or(null(), |port| port.name.as_ptr())
}

fn sparsity_of(port: Option<&Port>) -> *const i64 {
    port.map_or(null(), |port| port.sparsity.as_ptr())
}

/// Evaluates a function; returns 0 on success.
///
/// # Safety
/// `arg` and `res` must satisfy the conditions of `Bound::evaluate`.
unsafe fn evaluate(slot: usize, function: usize, arg: *const *const f64, res: *const *mut f64) -> c_int {
    let bound = match SLOT[slot].get() {
        Some(bound) if !SLOT[slot].was_loaded(function) => bound,
        _ => {
            // the error is printed, because CasADi's interface cannot pass an error message
            eprintln!(
                "condyle_{slot}: a function of condyle.casadi cannot be loaded or unpickled: make it anew, without the copy"
            );
            return 1;
        }
    };
    // SAFETY: the caller promises valid pointers in `arg` and `res`.
    let outcome = catch_unwind(AssertUnwindSafe(|| unsafe { bound.evaluate(function, arg, res) }));
    c_int::from(!matches!(outcome, Ok(Ok(()))))
}

/// Exports the symbols of one function of a slot.
macro_rules! symbols_of {
    ($slot:literal, $function:expr, $name:expr) => {
        const _: () = {
            #[unsafe(export_name = $name)]
            unsafe extern "C" fn call(
                arg: *const *const f64,
                res: *const *mut f64,
                _: *mut i64,
                _: *mut f64,
                _: c_int,
            ) -> c_int {
                // SAFETY: CasADi passes arrays with the sparsities that it queried.
                unsafe { evaluate($slot, $function, arg, res) }
            }
            #[unsafe(export_name = concat!($name, "_incref"))]
            extern "C" fn incref() {
                SLOT[$slot].enter($function);
            }
            #[unsafe(export_name = concat!($name, "_decref"))]
            extern "C" fn decref() {
                SLOT[$slot].leave(Some($function));
            }
            #[unsafe(export_name = concat!($name, "_n_in"))]
            extern "C" fn n_in() -> i64 {
                SLOT[$slot].describe($function);
                count(description($slot, $function).map(|d| d.inputs.len()))
            }
            #[unsafe(export_name = concat!($name, "_n_out"))]
            extern "C" fn n_out() -> i64 {
                count(description($slot, $function).map(|d| d.outputs.len()))
            }
            #[unsafe(export_name = concat!($name, "_name_in"))]
            extern "C" fn name_in(k: i64) -> *const c_char {
                name_of(input($slot, $function, k))
            }
            #[unsafe(export_name = concat!($name, "_name_out"))]
            extern "C" fn name_out(k: i64) -> *const c_char {
                name_of(output($slot, $function, k))
            }
            #[unsafe(export_name = concat!($name, "_sparsity_in"))]
            extern "C" fn sparsity_in(k: i64) -> *const i64 {
                sparsity_of(input($slot, $function, k))
            }
            #[unsafe(export_name = concat!($name, "_sparsity_out"))]
            extern "C" fn sparsity_out(k: i64) -> *const i64 {
                sparsity_of(output($slot, $function, k))
            }
        };
    };
}

/// Exports the symbols of all functions of the listed slots.
macro_rules! symbols {
    ($($slot:literal)*) => {$(
        symbols_of!($slot, VALUE, concat!("condyle_", $slot));
        symbols_of!($slot, JACOBIAN, concat!("jac_condyle_", $slot));
        symbols_of!($slot, REVERSE, concat!("adj1_condyle_", $slot));
        symbols_of!($slot, HESSIAN, concat!("jac_adj1_condyle_", $slot));
    )*};
}
symbols!(
    0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31
    32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63
);
