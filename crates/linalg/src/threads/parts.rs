//! Parts of a horizon that go through stages, each in the hands of whichever thread comes first.
#![allow(unsafe_code)]

use alloc::vec::Vec;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// A part's state while a thread works on it: one more than when it waited for the stage, which is twice the stage's number.
const AT_WORK: u8 = 1;

/// Parts of two slices of equal length, cut in the same places. Each part goes through the stages 0, 1, … in turn, one thread
/// at a time.
#[derive(Debug)]
pub struct Parts<'a, A, B> {
    first: *mut A,
    second: *mut B,
    /// Where each part begins, and the end of the last one.
    cuts: &'a [usize],
    states: &'a [AtomicU8],
    /// Whether a thread has panicked at work.
    abandoned: AtomicBool,
    marker: PhantomData<(&'a mut [A], &'a mut [B])>,
}

// SAFETY: a part is in the hands of one thread at a time.
unsafe impl<A: Send, B: Send> Sync for Parts<'_, A, B> {}

impl<'a, A, B> Parts<'a, A, B> {
    /// The parts of two slices between the `cuts`, at stage 0. `states` is scratch, that grows where there were never so many.
    ///
    /// # Panics
    /// If the cuts do not ascend from 0 to the length of both slices.
    pub fn new(first: &'a mut [A], second: &'a mut [B], cuts: &'a [usize], states: &'a mut Vec<AtomicU8>) -> Self {
        let covers = cuts.first() == Some(&0) && cuts.last() == Some(&first.len());
        assert!(covers && cuts.is_sorted() && first.len() == second.len(), "parts that are not those of the slices");
        states.clear();
        states.resize_with(cuts.len() - 1, || AtomicU8::new(0));
        let (first, second) = (first.as_mut_ptr(), second.as_mut_ptr());
        Self { first, second, cuts, states, abandoned: AtomicBool::new(false), marker: PhantomData }
    }

    /// The number of parts.
    pub fn count(&self) -> usize {
        self.states.len()
    }

    /// Does the work of a stage on a part if it has come to it and nobody does it; says whether it did. What a part of each
    /// slice holds is the closure's, with the number of its first item.
    pub fn work(&self, part: usize, stage: u8, work: impl FnOnce(usize, &mut [A], &mut [B])) -> bool {
        let (state, waiting) = (&self.states[part], 2 * stage);
        if state.compare_exchange(waiting, waiting + AT_WORK, Ordering::Acquire, Ordering::Relaxed).is_err() {
            return false;
        }
        let mut at_work = AtWork { abandoned: &self.abandoned, panics: true };
        let (start, end) = (self.cuts[part], self.cuts[part + 1]);
        // SAFETY: the cuts ascend within both slices, and parts do not overlap. Nobody else has this one: of those that find
        // it waiting one goes on, and it waits again when that thread has let it go.
        let (first, second) = unsafe {
            let first = core::slice::from_raw_parts_mut(self.first.add(start), end - start);
            (first, core::slice::from_raw_parts_mut(self.second.add(start), end - start))
        };
        work(start, first, second);
        at_work.panics = false;
        state.store(waiting + 2, Ordering::Release);
        true
    }

    /// Whether a part has yet to come to a stage, or waits for it.
    pub fn awaits(&self, part: usize, stage: u8) -> bool {
        self.states[part].load(Ordering::Relaxed) <= 2 * stage
    }

    /// Whether a thread has panicked at work, so that its part stays where it is.
    pub fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }
}

/// Tells the other threads if the work panics.
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
