//! Backward sweep in several segments of the horizon at the same time.
//!
//! To process S segments at a time, the horizon of N knots is cut into S + 1 segments. A step of a conditional value
//! function ([`conditional_value`](super::conditional_value)) takes 1 to 1½ times as long as a step of a sweep. The
//! last segment is therefore one and a half times as long as the others. The time, counted in steps of a sweep, is
//! ```text
//! segment            0      1 … S − 1     S
//! at the same time          conditional   sweep         1½ N / (S + 1½)
//! one by one                link          link          1.3 to 1.9 each, from S to 2: what comes after S − 1, …, 0
//! at the same time   sweep  sweep                       N / (S + 1½)
//! ```
//!
//! The cuts and the operations depend on S, not on the number of threads that share the segments. The results are
//! therefore the same to the last bit for any number of threads.
//!
//! A link loses digits if C and the value function are large, which happens where controls cost next to nothing. At the
//! end, two value functions at each cut are therefore compared: the one from which a segment was swept, and the one
//! that the sweep of the next segment computed. If they differ by more than rounding, or if anything failed before, the
//! whole horizon is swept again as one segment.
#![allow(non_snake_case)] // the names of the literature

use super::conditional_value::{Link, SegmentValue, Value};
use super::feedback::KnotFeedback;
use super::forms::Sizes;
use super::knot::LqKnot;
use super::step::{Step, SweepError, SweepOptions};
use condyle_linalg::{SLACK, max_abs, threads};
use core::ops::Range;

/// Largest accepted difference of two value functions at a cut: the one from which a segment was swept, and the one
/// that the sweep of the next segment computed. The difference is relative to the largest entry. Chosen as the accuracy
/// of a sweep; for robots the differences are a thousandth of it.
const CONSISTENT: f64 = 1e-9;

/// Segments of a horizon.
#[derive(Debug, Clone)]
pub(crate) struct Segments {
    /// All segments, in the order of the horizon; at least three.
    all: Vec<Segment>,
    link: Link,
}

/// Segment, with its workspace.
#[derive(Debug, Clone)]
struct Segment {
    /// Knots of the segment.
    knots: Range<usize>,
    step: Step,
    /// Terms Θ, θ and C of the conditional value function; P and p are in `step`.
    value: SegmentValue,
    /// Value function at the knot after the segment.
    end: Value,
    /// Outcome of the sweep.
    result: Result<(), SweepError>,
    /// Whether the conditional value function was computed.
    good: bool,
}

impl Segments {
    /// Creates the segments for processing `at_once` of them at a time, in a horizon of `horizon` knots with the sizes
    /// `sizes`. Returns `None` if `at_once` is one, or if the horizon is too short for two segments.
    pub(super) fn new(at_once: usize, horizon: usize, sizes: Sizes) -> Option<Self> {
        let at_once = at_once.min(horizon.saturating_sub(2));
        if at_once < 2 {
            return None;
        }
        let cut = |k: usize| if k > at_once { horizon } else { 2 * horizon * k / (2 * at_once + 3) };
        let segment = |k: usize| Segment {
            knots: cut(k)..cut(k + 1),
            step: Step::new(sizes, sizes.n, vec![]),
            value: SegmentValue::zeros(sizes.n),
            end: Value::zeros(sizes.n),
            result: Ok(()),
            good: false,
        };
        Some(Self { all: (0..=at_once).map(segment).collect(), link: Link::new(sizes.n) })
    }

    /// Returns whether a segment may contain a knot. A knot with bounded controls is excluded, since its value function
    /// is not quadratic in a multiplier. A knot with constraint rows is left to the sweep in one segment.
    fn serve(knot: &LqKnot) -> bool {
        !knot.is_bounded() && knot.rows.is_empty()
    }

    /// Sweeps the horizon in segments; returns `None` if it must be swept as one segment.
    pub(crate) fn run(
        &mut self,
        knots: &[LqKnot],
        feedback: &mut [KnotFeedback],
        regularisation: f64,
    ) -> Option<Result<(), SweepError>> {
        if !knots.iter().all(Self::serve) {
            return None;
        }
        let parallel = threads::threads() > 1;
        self.sweep(SegmentTask { pass: Pass::Begin, knots, regularisation, parallel }, feedback)
    }

    fn sweep(&mut self, begin: SegmentTask<'_>, feedback: &mut [KnotFeedback]) -> Option<Result<(), SweepError>> {
        let last = self.all.len() - 1;
        begin.over(&mut self.all[1..], feedback);
        if self.all[last].result.is_err() {
            return Some(self.all[last].result);
        }
        if !self.link() {
            return None;
        }
        SegmentTask { pass: Pass::Finish, ..begin }.over(&mut self.all[..last], feedback);
        let consistent = |pair: &[Segment]| {
            let (end, found) = (&pair[0].end, &feedback[pair[1].knots.start]);
            pair[0].result.is_ok() && end.is_near(found.Vxx.as_slice(), found.Vx.as_slice())
        };
        self.all.windows(2).all(consistent).then_some(Ok(()))
    }

    /// Computes the value function at the end of each segment except the last; returns whether this succeeded.
    fn link(&mut self) -> bool {
        let Self { all, link } = self;
        let last = all.len() - 1;
        if let [.., segment, Segment { step, .. }] = &mut all[..] {
            segment.end.copy_from(&step.work.P, &step.work.p);
        }
        for j in (1..last).rev() {
            let (before, here) = all.split_at_mut(j);
            let (Segment { step, value, end, good, .. }, start) = (&here[0], &mut before[j - 1].end);
            if !(*good && link.run(step, value, end, start)) {
                return false;
            }
        }
        true
    }
}

impl Value {
    /// Returns whether P, p equal Vxx, Vx up to rounding; false for NaN.
    fn is_near(&self, Vxx: &[f64], Vx: &[f64]) -> bool {
        let n = Vx.len();
        let near = |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= CONSISTENT * scale);
        let (matrix, vector) = (max_abs(Vxx), max_abs(Vx));
        let columns = self.P.chunks_exact(n + SLACK).zip(Vxx.chunks_exact(n));
        columns.into_iter().all(|(a, b)| near(a, b, matrix)) && near(&self.p, Vx, vector)
    }
}

/// Pass over the segments.
#[derive(Clone, Copy)]
enum Pass {
    /// Sweep of the last segment, and conditional value function of the others.
    Begin,
    /// Sweep, from the value function at the end of the segment.
    Finish,
}

/// Pass with its inputs, carried out for each segment of a slice.
#[derive(Clone, Copy)]
struct SegmentTask<'a> {
    pass: Pass,
    /// Knots of the whole horizon.
    knots: &'a [LqKnot],
    regularisation: f64,
    /// Whether threads share the segments.
    parallel: bool,
}

impl SegmentTask<'_> {
    /// Does the task for each of `segments`; `feedback` contains the feedback of all knots.
    fn over(self, segments: &mut [Segment], feedback: &mut [KnotFeedback]) {
        self.run(segments, &mut feedback[segments[0].knots.start..]);
    }

    /// Does the task for consecutive segments; `feedback` begins at the first knot of the first segment.
    fn run(self, segments: &mut [Segment], feedback: &mut [KnotFeedback]) {
        if let [segment] = segments {
            return self.run_one(segment, feedback);
        }
        let (some, others) = segments.split_at_mut(segments.len() / 2);
        let (first, second) = feedback.split_at_mut(others[0].knots.start - some[0].knots.start);
        if self.parallel {
            threads::join(|| self.run(some, first), || self.run(others, second));
        } else {
            self.run(some, first);
            self.run(others, second);
        }
    }

    /// Does the task for one segment; `feedback` begins at the first knot of the segment.
    fn run_one(self, segment: &mut Segment, feedback: &mut [KnotFeedback]) {
        let Self { pass, knots, regularisation, .. } = self;
        let Segment { knots: range, step, value, end, result, good } = segment;
        let (first, own) = (range.start, &knots[range.clone()]);
        let options = &mut SweepOptions::linear(regularisation);
        match pass {
            Pass::Begin if range.end + 1 == knots.len() => {
                *result = step.run(first, &knots[first..], feedback, options);
            }
            Pass::Begin => *good = value.run(step, own, regularisation),
            Pass::Finish => {
                step.work.P.copy_from_slice(&end.P);
                step.work.p.copy_from_slice(&end.p);
                *result = step.back(first, own, feedback, options);
            }
        }
    }
}
