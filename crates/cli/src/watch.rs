//! Observer of a solve, which shows the progress and stops the solve on Ctrl-C.

use crate::report;
use crate::terminal::say;
use condyle::optimal::{Iteration, Observer};
use core::ops::ControlFlow;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether Ctrl-C was pressed.
static STOP: AtomicBool = AtomicBool::new(false);

/// Installs a handler for Ctrl-C. The first Ctrl-C makes the solver stop with its best iterate; the second ends the
/// program.
pub(crate) fn catch_interrupts() {
    // Ignore errors. An earlier call may have installed the same handler. If the handler cannot be installed, Ctrl-C
    // ends the program as usual.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
}

/// Number of consecutive iterations that change nothing, after which a solve with limits has settled.
const STILL: usize = 10;
/// Largest gap or violation of such an iteration, and its largest expected decrease of the cost, relative to the cost.
const CLOSED: f64 = 1e-7;
const SETTLED: f64 = 1e-9;

/// Returns whether Ctrl-C was pressed.
pub(crate) fn interrupted() -> bool {
    STOP.load(Ordering::SeqCst)
}

/// Returns a progress bar, which is visible only on a terminal.
pub(crate) fn bar(length: u64, what: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr_with_hz(10));
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed}");
    if let Ok(style) = style {
        bar.set_style(style.progress_chars("█▉ "));
    }
    bar.set_message(what.to_owned());
    bar
}

/// Iterations of one solve, or of several consecutive solves.
pub(crate) struct Watch {
    bar: ProgressBar,
    pub trace: Vec<Iteration>,
}

impl Watch {
    pub(crate) fn new(most: usize) -> Self {
        Self { bar: bar(most as u64, "iterations"), trace: Vec::new() }
    }

    /// Returns an observer of a solve, which prints nothing if `quiet` is set.
    pub(crate) fn quiet(&mut self, quiet: bool) -> Eye<'_> {
        Eye { watch: self, quiet, settles_from: None }
    }

    /// Returns an observer that also ends the solve when it has [settled](settled).
    pub(crate) fn settling(&mut self, quiet: bool) -> Eye<'_> {
        let settles_from = Some(self.trace.len());
        Eye { watch: self, quiet, settles_from }
    }

    /// Removes the progress bar and returns all iterations.
    pub(crate) fn end(self) -> Vec<Iteration> {
        self.bar.finish_and_clear();
        self.trace
    }
}

/// Returns the largest expected decrease of the cost, relative to the cost, if the last iterations of a solve changed
/// nothing and kept the constraints.
///
/// For unstable motions with many knots, rounding errors keep the gradient of the Lagrangian above its tolerance. A
/// solve would then go on until its last iteration, although the motion no longer changes.
pub(crate) fn settled(trace: &[Iteration]) -> Option<f64> {
    let last = trace.last_chunk::<STILL>()?;
    let decreases = last.map(|now| now.d1.abs() / now.cost.abs());
    let closed = last.iter().all(|now| now.gap <= CLOSED);
    (closed && decreases.iter().all(|decrease| *decrease < SETTLED)).then(|| decreases.into_iter().fold(0.0, f64::max))
}

/// Observer of one solve.
pub(crate) struct Eye<'a> {
    watch: &'a mut Watch,
    quiet: bool,
    /// Index of the solve's first iteration in the trace, if the solve ends when it has settled.
    settles_from: Option<usize>,
}

impl Observer for Eye<'_> {
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        let numbered = Iteration { iteration: self.watch.trace.len(), ..*now };
        if !self.quiet {
            self.watch.bar.suspend(|| say(&report::iteration(&numbered)));
        }
        self.watch.bar.inc(1);
        self.watch.trace.push(numbered);
        match self.settles_from {
            Some(first) if settled(&self.watch.trace[first..]).is_some() => ControlFlow::Break(()),
            _ => self.go_on(),
        }
    }

    fn go_on(&mut self) -> ControlFlow<()> {
        if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
