//! Backward sweep in several segments of the horizon at the same time.
//!
//! To process S segments at the same time, the horizon of N knots is cut into S + 1 segments. A step of a conditional
//! value function ([`conditional_value`](super::conditional_value)) takes 1 to 1½ times as long as a step of a sweep.
//! The last segment, which needs only a sweep, is therefore 1½ times as long as the others. The times below are counted
//! in steps of a sweep:
//! ```text
//! segment          0      1 … S − 1         S       time
//! in parallel             conditional V     sweep   1½ N / (S + 1½)
//! in sequence             link                      1.3 to 1.9 for each link, from segment S − 1 to segment 1
//! in parallel      sweep  sweep                     N / (S + 1½)
//! ```
//! The cuts and the operations depend on S, but not on the number of threads that process the segments. The results are
//! therefore the same to the last bit for any number of threads.
//!
//! A link computes the value function at a cut from the value function at the next cut. It loses digits if C and the
//! value function are large, which happens if controls cost almost nothing. After the sweep, two value functions are
//! therefore compared at each cut: the result of the link, and the result of the sweep of the segment after the cut. If
//! they differ by more than rounding errors, or if any step failed before, the whole horizon is swept again as one
//! segment.
#![allow(non_snake_case)] // names follow the literature

use super::conditional_value::{Link, SegmentValue, Value};
use super::feedback::KnotFeedback;
use super::forms::Sizes;
use super::knot::LqKnot;
use super::step::{Step, SweepError, SweepOptions};
use condyle_linalg::{max_abs, padded, threads};
use core::ops::Range;

/// Largest accepted difference of two value functions at a cut, relative to the largest entry. The sweep of the segment
/// before the cut started from the first; the sweep of the segment after the cut computed the second. The bound is the
/// accuracy of a sweep. For robots, the differences are a thousandth of the bound.
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
    /// Index range of the segment's knots.
    knots: Range<usize>,
    step: Step,
    /// Terms Θ, θ and C of the conditional value function; P and p are in `step`.
    value: SegmentValue,
    /// Value function at the knot after the segment.
    end: Value,
    /// Outcome of the sweep of this segment.
    result: Result<(), SweepError>,
    /// Whether the conditional value function of this segment was computed.
    good: bool,
}

impl Segments {
    /// Creates the segments of a horizon of `horizon` knots with the sizes `sizes`; `at_once` segments are processed at
    /// the same time. Returns `None` if `at_once` is one, or if the horizon is too short for two segments.
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

    /// Returns whether a sweep in segments supports a knot. Knots with bounded controls are not supported, because
    /// their value function is not quadratic in a multiplier. Knots with constraint rows are not supported; the sweep
    /// in one segment reports them.
    fn serve(knot: &LqKnot) -> bool {
        !knot.is_bounded() && knot.rows.is_empty()
    }

    /// Sweeps the horizon in segments. Returns `None` if the horizon must be swept as one segment.
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

    /// Computes the value function at the end of each segment except the last one. Returns whether this succeeded.
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
    /// Returns whether P, p equal Vxx, Vx within the tolerance; false for NaN.
    fn is_near(&self, Vxx: &[f64], Vx: &[f64]) -> bool {
        let n = Vx.len();
        let near = |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= CONSISTENT * scale);
        let (matrix, vector) = (max_abs(Vxx), max_abs(Vx));
        let columns = self.P.chunks_exact(padded(n)).zip(Vxx.chunks_exact(n));
        columns.into_iter().all(|(a, b)| near(a, b, matrix)) && near(&self.p, Vx, vector)
    }
}

/// Pass over the segments of a horizon.
#[derive(Clone, Copy)]
enum Pass {
    /// First pass: a sweep of the last segment, and conditional value functions of the other segments.
    Begin,
    /// Second pass: a sweep of each segment, from the value function at its end.
    Finish,
}

/// Pass and its inputs, which are the same for all segments.
#[derive(Clone, Copy)]
struct SegmentTask<'a> {
    pass: Pass,
    /// Knots of the whole horizon.
    knots: &'a [LqKnot],
    regularisation: f64,
    /// Whether several threads process the segments.
    parallel: bool,
}

impl SegmentTask<'_> {
    /// Carries out the pass for each of `segments`; `feedback` contains the feedback of all knots.
    fn over(self, segments: &mut [Segment], feedback: &mut [KnotFeedback]) {
        self.run(segments, &mut feedback[segments[0].knots.start..]);
    }

    /// Carries out the pass for consecutive segments; `feedback` begins at the first knot of the first segment.
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

    /// Carries out the pass for one segment; `feedback` begins at the first knot of the segment.
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
