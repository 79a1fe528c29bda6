//! CasADi's C interface to functions of a robot, by numbered slots.
//!
//! `casadi.external` finds a function by its name among the symbols of a library, and its derivatives by names that follow
//! from it. A robot is known only when the program runs, so the library has the symbols of [`SLOTS`] functions, which do
//! what was bound to their slot. CasADi counts its uses of a slot; it is free again when the last one ends.
//!
//! Of slot n the library has `condyle_n`, the function; `jac_condyle_n`, its Jacobian; `adj1_condyle_n`, Jᵀλ; and
//! `jac_adj1_condyle_n`, whose blocks are the Hessian of λᵀf and Jᵀ.
#![allow(unsafe_code)]

use super::chart::{Chart, Position};
use super::function::{DualScratch, Kind, Pattern, Scratch};
use condyle::{Error, Model};
use core::ffi::{c_char, c_int};
use core::ptr::null;
use core::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use nalgebra::DMatrix;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How many functions there may be at a time.
pub(super) const SLOTS: usize = 64;

/// How long a function may take from its making to its first question, before it counts as loaded.
const DESCRIPTION_TIME: Duration = Duration::from_millis(50);

/// The functions of a slot, by their numbers.
const VALUE: usize = 0;
const JACOBIAN: usize = 1;
const REVERSE: usize = 2;
const HESSIAN: usize = 3;

/// An argument or a result, as CasADi describes it.
struct Port {
    name: CString,
    /// Rows, columns, the first entry of each column, the row of each entry.
    sparsity: Vec<i64>,
}

impl Port {
    /// A matrix whose entries are where `present` says, and their places when all entries stand column by column.
    fn new(name: &str, rows: usize, columns: usize, present: impl Fn(usize, usize) -> bool) -> (Self, Vec<usize>) {
        let number = |n: usize| i64::try_from(n).expect("robots are smaller");
        let (mut starts, mut entries, mut places) = (vec![0], Vec::new(), Vec::new());
        for j in 0..columns {
            for i in (0..rows).filter(|&i| present(i, j)) {
                entries.push(number(i));
                places.push(j * rows + i);
            }
            starts.push(number(entries.len()));
        }
        let sparsity = [number(rows), number(columns)].into_iter().chain(starts).chain(entries).collect();
        (Self { name: CString::new(name).expect("names have no zeros"), sparsity }, places)
    }

    fn full(name: &str, rows: usize, columns: usize) -> Self {
        Self::new(name, rows, columns, |_, _| true).0
    }

    fn empty(name: &str, rows: usize, columns: usize) -> Self {
        Self::new(name, rows, columns, |_, _| false).0
    }
}

/// Where a result's numbers come from: entry (i, j) of a matrix of so many rows.
#[derive(Clone, Copy)]
enum Source {
    Value,
    Jacobian,
    Gradient,
    Hessian,
    TransposedJacobian,
    Nothing,
}

struct Output {
    port: Port,
    source: Source,
    /// For each entry, its number in the source.
    from: Vec<usize>,
}

/// One of the functions of a slot.
#[derive(Default)]
struct Description {
    inputs: Vec<Port>,
    outputs: Vec<Output>,
}

/// A function of a robot that is bound to a slot.
struct Bound {
    model: Model,
    kind: Kind,
    key: Vec<u8>,
    chart: Chart,
    /// How many numbers the results have.
    ny: usize,
    /// The results' sizes and places: where each begins among all, and where its entries stand from there.
    results: Vec<(usize, Vec<usize>)>,
    descriptions: [Description; 4],
    /// What calls compute in; each takes one, and there are as many as calls at the same time.
    free: Mutex<Vec<Box<Work>>>,
}

/// What a call computes in.
struct Work {
    scratch: Scratch<f64>,
    dual: Option<Box<DualScratch>>,
    position: Position,
    x: Vec<Vec<f64>>,
    lambda: Vec<f64>,
    y: Vec<f64>,
    /// By tangent coordinates: J, Jᵀλ and the Hessian of λᵀf.
    J: DMatrix<f64>,
    g: Vec<f64>,
    H: DMatrix<f64>,
    /// By the coordinates that CasADi has: J, Jᵀλ, and the Hessian.
    Jx: DMatrix<f64>,
    gx: Vec<f64>,
    Hx: DMatrix<f64>,
    /// H T and its transpose.
    half: DMatrix<f64>,
    turned: DMatrix<f64>,
}

impl Bound {
    fn new(model: &Model, kind: Kind, key: Vec<u8>) -> Result<Self, Error> {
        let (nq, nv) = (model.nq(), model.nv());
        let chart = Chart::new(model);
        let rows = match &kind {
            Kind::ConstrainedDynamics { constraints } => condyle::ConstraintSet::<f64>::new(model, constraints)?.rows(),
            _ => 0,
        };
        let (arguments, outputs) = (kind.arguments(), kind.outputs(nv, rows));
        let size = |argument: usize| if argument == 0 { nq } else { nv };
        let x_start = |argument: usize| if argument == 0 { 0 } else { nq + (argument - 1) * nv };
        let nx = x_start(arguments.len());
        let y_start: Vec<usize> = outputs
            .iter()
            .scan(0, |sum, o| {
                *sum += o.rows * o.columns;
                Some(*sum - o.rows * o.columns)
            })
            .collect();
        let ny = outputs.iter().map(|o| o.rows * o.columns).sum::<usize>();

        let mut relation = vec![false; nv * nv];
        for (j, rows) in model.nonzero_rows().iter().enumerate() {
            rows.rows.iter().for_each(|&i| (relation[i * nv + j], relation[j * nv + i]) = (true, true));
        }
        let related = |i: usize, j: usize| relation[i * nv + j];
        let tangent = |argument: usize, k: usize| if argument == 0 { chart.moved_by(k) } else { k..k + 1 };
        let depends =
            |y: usize, argument: usize, k: usize| tangent(argument, k).any(|j| kind.depends(y, j, nv, related));
        // an entry of the result is there if it may differ from zero, as the entries of M
        let in_result = |o: usize, i: usize, j: usize| match kind {
            Kind::Crba => related(i, j),
            _ => o < outputs.len(),
        };
        let second = |(a, i): (usize, usize), (b, j): (usize, usize)| match kind.second_derivatives(a, b) {
            Pattern::Zero => false,
            Pattern::Full => true,
            Pattern::Related => tangent(a, i).any(|i| tangent(b, j).any(|j| related(i, j))),
        };

        let inputs = || arguments.iter().enumerate().map(|(k, name)| Port::full(name, size(k), 1));
        let unread = || outputs.iter().map(|o| Port::empty(&format!("out_{}", o.name), o.rows, o.columns));
        let seeds = || {
            let seed = |(k, o): (usize, &super::function::Output)| {
                Port::new(&format!("adj_{}", o.name), o.rows, o.columns, |i, j| in_result(k, i, j)).0
            };
            outputs.iter().enumerate().map(seed)
        };

        let mut value = Description { inputs: inputs().collect(), ..Description::default() };
        let mut results = Vec::new();
        for (k, o) in outputs.iter().enumerate() {
            let (port, places) = Port::new(o.name, o.rows, o.columns, |i, j| in_result(k, i, j));
            let from = places.iter().map(|place| y_start[k] + place).collect();
            value.outputs.push(Output { port, source: Source::Value, from });
            results.push((y_start[k], places));
        }

        let mut jacobian = Description { inputs: inputs().chain(unread()).collect(), ..Description::default() };
        for (k, o) in outputs.iter().enumerate() {
            for (a, argument) in arguments.iter().enumerate() {
                let count = o.rows * o.columns;
                let present =
                    |i: usize, j: usize| in_result(k, i % o.rows, i / o.rows) && depends(y_start[k] + i, a, j);
                let (port, places) = Port::new(&format!("jac_{}_{argument}", o.name), count, size(a), present);
                let number = |place: usize| (x_start(a) + place / count) * ny + y_start[k] + place % count;
                let from = places.into_iter().map(number).collect();
                jacobian.outputs.push(Output { port, source: Source::Jacobian, from });
            }
        }

        let mut reverse =
            Description { inputs: inputs().chain(unread()).chain(seeds()).collect(), ..Description::default() };
        for (a, argument) in arguments.iter().enumerate() {
            let port = Port::full(&format!("adj_{argument}"), size(a), 1);
            let from = (x_start(a)..x_start(a) + size(a)).collect();
            reverse.outputs.push(Output { port, source: Source::Gradient, from });
        }

        let unread_gradient =
            arguments.iter().enumerate().map(|(a, name)| Port::empty(&format!("out_adj_{name}"), size(a), 1));
        let inputs_of_hessian = inputs().chain(unread()).chain(seeds()).chain(unread_gradient);
        let mut hessian = Description { inputs: inputs_of_hessian.collect(), ..Description::default() };
        for (a, argument) in arguments.iter().enumerate() {
            for (b, by) in arguments.iter().enumerate() {
                let present = |i: usize, j: usize| second((a, i), (b, j));
                let (port, places) = Port::new(&format!("jac_adj_{argument}_{by}"), size(a), size(b), present);
                let number = |place: usize| (x_start(b) + place / size(a)) * nx + x_start(a) + place % size(a);
                let from = places.into_iter().map(number).collect();
                hessian.outputs.push(Output { port, source: Source::Hessian, from });
            }
            for o in &outputs {
                let port = Port::empty(&format!("jac_adj_{argument}_out_{}", o.name), size(a), o.rows * o.columns);
                hessian.outputs.push(Output { port, source: Source::Nothing, from: Vec::new() });
            }
            for (k, o) in outputs.iter().enumerate() {
                let name = format!("jac_adj_{argument}_adj_{}", o.name);
                let present =
                    |j: usize, i: usize| in_result(k, i % o.rows, i / o.rows) && depends(y_start[k] + i, a, j);
                let (port, places) = Port::new(&name, size(a), o.rows * o.columns, present);
                let number = |place: usize| (x_start(a) + place % size(a)) * ny + y_start[k] + place / size(a);
                let from = places.into_iter().map(number).collect();
                hessian.outputs.push(Output { port, source: Source::TransposedJacobian, from });
            }
        }
        let descriptions = [value, jacobian, reverse, hessian];
        let bound =
            Self { model: model.clone(), kind, key, chart, ny, results, descriptions, free: Mutex::new(Vec::new()) };
        let work = bound.work()?;
        bound.give_back(work);
        Ok(bound)
    }

    fn work(&self) -> Result<Box<Work>, Error> {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        if let Some(work) = free {
            return Ok(work);
        }
        let (nq, nv, arguments) = (self.model.nq(), self.model.nv(), self.kind.arguments().len());
        let (tangents, nx) = (arguments * nv, nq + (arguments - 1) * nv);
        let ny = self.ny;
        Ok(Box::new(Work {
            scratch: self.kind.scratch(&self.model)?,
            dual: None,
            position: self.chart.position(),
            x: (0..arguments).map(|k| vec![0.0; if k == 0 { nq } else { nv }]).collect(),
            lambda: vec![0.0; ny],
            y: vec![0.0; ny],
            J: DMatrix::zeros(ny, tangents),
            g: vec![0.0; tangents],
            H: DMatrix::zeros(tangents, tangents),
            Jx: DMatrix::zeros(ny, nx),
            gx: vec![0.0; nx],
            Hx: DMatrix::zeros(nx, nx),
            half: DMatrix::zeros(tangents, nx),
            turned: DMatrix::zeros(nx, tangents),
        }))
    }

    fn give_back(&self, work: Box<Work>) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).push(work);
    }

    /// Evaluates a function of the slot.
    ///
    /// # Safety
    /// `arg` and `res` have a pointer, to as many numbers as it has entries or null, for each input and each output.
    unsafe fn evaluate(&self, function: usize, arg: *const *const f64, res: *const *mut f64) -> Result<(), Error> {
        let mut work = self.work()?;
        let w = &mut *work;
        // SAFETY: by the caller.
        let input = |k: usize, count: usize| unsafe {
            let given = *arg.add(k);
            (!given.is_null()).then(|| core::slice::from_raw_parts(given, count))
        };
        for (k, x) in w.x.iter_mut().enumerate() {
            match input(k, x.len()) {
                Some(given) => x.copy_from_slice(given),
                None => x.fill(0.0),
            }
        }
        let x = &mut w.x;
        self.chart.update(&x[0], &mut w.position);
        x[0].copy_from_slice(&w.position.q);
        let (arguments, nv) = (x.len(), self.model.nv());
        if function >= REVERSE {
            w.lambda.fill(0.0);
            for (k, (start, places)) in self.results.iter().enumerate() {
                if let Some(seed) = input(arguments + self.results.len() + k, places.len()) {
                    places.iter().zip(seed).for_each(|(place, &seed)| w.lambda[start + place] = seed);
                }
            }
        }
        match function {
            VALUE => self.kind.value(&self.model, &mut w.scratch, x, &mut w.y),
            HESSIAN => {
                let closed = self.kind.closed_hessian(&self.model, &mut w.scratch, x, &w.lambda, &mut w.J, &mut w.H);
                if !closed {
                    self.kind.jacobian(&self.model, &mut w.scratch, x, &mut w.J);
                    if w.dual.is_none() {
                        w.dual = Some(Box::new(self.kind.dual_scratch(&self.model, w.y.len())?));
                    }
                    let dual = w.dual.as_mut().expect("was just made");
                    self.kind.hessian(&self.model, dual, x, &w.lambda, &mut w.H);
                }
            }
            _ => self.kind.jacobian(&self.model, &mut w.scratch, x, &mut w.J),
        }
        if function != VALUE {
            self.by_coordinates(&w.position, &w.J, &mut w.Jx);
        }
        if function >= REVERSE {
            for (g, column) in w.g.iter_mut().zip(w.J.column_iter()) {
                *g = column.iter().zip(&w.lambda).map(|(x, l)| x * l).sum(); // Jᵀλ
            }
            for (g, column) in w.gx.iter_mut().zip(w.Jx.column_iter()) {
                *g = column.iter().zip(&w.lambda).map(|(x, l)| x * l).sum();
            }
        }
        if function == HESSIAN {
            self.by_coordinates(&w.position, &w.H, &mut w.half);
            w.half.transpose_to(&mut w.turned); // (H T)ᵀ
            self.by_coordinates(&w.position, &w.turned, &mut w.Hx); // Tᵀ H T, which is symmetric
            self.chart.add_curvature(&w.position, &w.g[..nv], &mut w.Hx, 0);
        }
        for (k, output) in self.descriptions[function].outputs.iter().enumerate() {
            // SAFETY: by the caller.
            let to = unsafe {
                let to = *res.add(k);
                if to.is_null() {
                    continue;
                }
                core::slice::from_raw_parts_mut(to, output.from.len())
            };
            let source = match output.source {
                Source::Value => &w.y[..],
                Source::Jacobian | Source::TransposedJacobian => w.Jx.as_slice(),
                Source::Gradient => &w.gx,
                Source::Hessian => w.Hx.as_slice(),
                Source::Nothing => &[],
            };
            to.iter_mut().zip(&output.from).for_each(|(to, &from)| *to = source[from]);
        }
        self.give_back(work);
        Ok(())
    }

    /// A matrix with a column for each tangent coordinate, as one with a column for each of CasADi's.
    fn by_coordinates(&self, at: &Position, from: &DMatrix<f64>, to: &mut DMatrix<f64>) {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        self.chart.multiply(at, from, 0, to, 0);
        let rest = from.ncols() - nv;
        to.columns_mut(nq, rest).copy_from(&from.columns(nv, rest));
    }
}

/// A slot: what is bound to it, and by how many it is used.
struct Slot {
    bound: AtomicPtr<Bound>,
    users: Mutex<Users>,
    /// Of each function, how many CasADi has that never asked for their description: those that it has loaded.
    loaded: [AtomicUsize; 4],
}

/// How many functions of CasADi use a slot, by the slot's functions, and how many holds there are.
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
    /// What is bound to the slot.
    fn get(&self) -> Option<&Bound> {
        // SAFETY: what is bound stays until the last user leaves, and who asks is one.
        unsafe { self.bound.load(Ordering::Acquire).as_ref() }
    }

    fn users(&self) -> MutexGuard<'_, Users> {
        self.users.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// CasADi has one more of a function. One that is made asks for its inputs next; one that is loaded knows them.
    fn enter(&self, function: usize) {
        self.users().functions[function] += 1;
        self.loaded[function].fetch_add(1, Ordering::AcqRel);
    }

    /// A function asks for its description, so it was not loaded.
    fn describe(&self, function: usize) {
        let less = |n: usize| n.checked_sub(1);
        let _ = self.loaded[function].fetch_update(Ordering::AcqRel, Ordering::Acquire, less);
    }

    /// CasADi has one less of a function, or a hold ends.
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
                // SAFETY: it was a box, and nobody uses it any more.
                drop(unsafe { Box::from_raw(bound) });
            }
        }
    }

    /// Whether a function may be one that was loaded, whose slot may be another robot's by now. One that is being made by
    /// another thread is waited for.
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

/// Holds a slot that computes a function of a robot: one that does so already, or a free one. There is none if all are taken.
pub(super) fn hold(model: &Model, kind: Kind) -> Result<Option<String>, Error> {
    let mut key = format!("{kind:?}").into_bytes();
    key.extend(postcard::to_allocvec(model).unwrap_or_default());
    let name = |k: usize| Some(format!("condyle_{k}"));
    for (k, slot) in SLOT.iter().enumerate() {
        let mut users = slot.users();
        if slot.get().is_some_and(|bound| bound.key == key) {
            users.holds += 1;
            return Ok(name(k));
        }
    }
    let bound = Box::new(Bound::new(model, kind, key)?);
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

/// Ends a hold.
pub(super) fn release(name: &str) {
    let slot = name.strip_prefix("condyle_").and_then(|k| k.parse::<usize>().ok()).and_then(|k| SLOT.get(k));
    if let Some(slot) = slot {
        slot.leave(None);
    }
}

/// The description of one of a slot's functions.
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

/// Evaluates; 0 if it went well.
///
/// # Safety
/// As for `Bound::evaluate`.
unsafe fn evaluate(slot: usize, function: usize, arg: *const *const f64, res: *const *mut f64) -> c_int {
    let bound = match SLOT[slot].get() {
        Some(bound) if !SLOT[slot].was_loaded(function) => bound,
        _ => {
            // CasADi takes no message from here
            eprintln!("condyle_{slot}: a function of condyle.casadi cannot be loaded or unpickled: make it anew");
            return 1;
        }
    };
    // SAFETY: by the caller.
    let outcome = catch_unwind(AssertUnwindSafe(|| unsafe { bound.evaluate(function, arg, res) }));
    c_int::from(!matches!(outcome, Ok(Ok(()))))
}

/// The symbols of one function of a slot.
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
                // SAFETY: CasADi keeps to the sparsities below.
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

/// The symbols of all functions of some slots.
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
