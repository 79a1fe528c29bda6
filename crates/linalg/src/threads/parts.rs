//! Parts of a time horizon, each with several phases of computation. A thread that becomes free computes the next phase
//! of a part.
#![allow(unsafe_code)]

use alloc::vec::Vec;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Bit of a part's state, set while a thread works on the part. The state is 2 p before phase p of the computation
/// begins, and 2 p + `AT_WORK` during this phase.
const AT_WORK: u8 = 1;

/// Parts of two slices of equal length, which are split at the same indices. Each part goes through the phases 0, 1, …
/// in turn, and only one thread at a time works on a part.
#[derive(Debug)]
pub struct Parts<'a, A, B> {
    first: *mut A,
    second: *mut B,
    /// Start index of each part, and the end of the last part.
    cuts: &'a [usize],
    states: &'a [AtomicU8],
    /// Whether a thread has panicked while it worked on a part.
    abandoned: AtomicBool,
    marker: PhantomData<(&'a mut [A], &'a mut [B])>,
}

// SAFETY: only one thread at a time accesses a part.
unsafe impl<A: Send, B: Send> Sync for Parts<'_, A, B> {}

impl<'a, A, B> Parts<'a, A, B> {
    /// Splits two slices at the indices `cuts`. All parts wait for phase 0. `states` is scratch memory, which grows if
    /// it is too short.
    ///
    /// # Panics
    /// If the cuts do not ascend from 0 to the length of both slices.
    pub fn new(first: &'a mut [A], second: &'a mut [B], cuts: &'a [usize], states: &'a mut Vec<AtomicU8>) -> Self {
        let covers = cuts.first() == Some(&0) && cuts.last() == Some(&first.len());
        assert!(
            covers && cuts.is_sorted() && first.len() == second.len(),
            "cuts do not ascend from 0 to the length of both slices"
        );
        states.clear();
        states.resize_with(cuts.len() - 1, || AtomicU8::new(0));
        let (first, second) = (first.as_mut_ptr(), second.as_mut_ptr());
        Self { first, second, cuts, states, abandoned: AtomicBool::new(false), marker: PhantomData }
    }

    /// Returns the number of parts.
    pub fn count(&self) -> usize {
        self.states.len()
    }

    /// Executes a phase on a part if the part waits for this phase. Returns whether the phase was executed. The closure
    /// receives the index of the part's first item, and the items of the part in both slices.
    pub fn work(&self, part: usize, phase: u8, work: impl FnOnce(usize, &mut [A], &mut [B])) -> bool {
        let (state, waiting) = (&self.states[part], 2 * phase);
        if state.compare_exchange(waiting, waiting + AT_WORK, Ordering::Acquire, Ordering::Relaxed).is_err() {
            return false;
        }
        let mut at_work = AtWork { abandoned: &self.abandoned, panics: true };
        let (start, end) = (self.cuts[part], self.cuts[part + 1]);
        // SAFETY: the cuts ascend within both slices, so parts do not overlap. No other thread works on this part: of
        // the threads that try to change the part's state, only one succeeds. The part waits for the next phase only
        // after this thread has finished.
        let (first, second) = unsafe {
            let first = core::slice::from_raw_parts_mut(self.first.add(start), end - start);
            (first, core::slice::from_raw_parts_mut(self.second.add(start), end - start))
        };
        work(start, first, second);
        at_work.panics = false;
        state.store(waiting + 2, Ordering::Release);
        true
    }

    /// Returns whether a phase of a part is still to begin: the part waits for this phase, or an earlier phase is not
    /// finished.
    pub fn awaits(&self, part: usize, phase: u8) -> bool {
        self.states[part].load(Ordering::Relaxed) <= 2 * phase
    }

    /// Returns whether a thread has panicked while it worked on a part. This part will then never finish its phase.
    pub fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }
}

/// Guard that sets `abandoned` if the work on a part panics, so that the other threads stop waiting.
struct AtWork<'a> {
    abandoned: &'a AtomicBool,
    panics: bool,
}

impl Drop for AtWork<'_> {
    fn drop(&mut self) {
        if self.panics {
            self.abandoned.store(true, Ordering::Relaxed);
        }
    }
}
