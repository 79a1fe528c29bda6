//! The backward sweep in several segments of the horizon at the same time.
//!
//! To work on S segments at a time, the horizon of N knots is cut into S + 1. A step of a conditional value function
//! ([`conditional_value`](super::conditional_value)) takes 1 to 1½ times as long as a step of a sweep, so the last segment is
//! longer than the others by half. The time, counted in steps of a sweep, is
//!
//! ```text
//! segment            0      1 … S − 1     S
//! at the same time          conditional   sweep         1½ N / (S + 1½)
//! one by one                link          link          1.3 to 1.9 each, from S to 2: what comes after S − 1, …, 0
//! at the same time   sweep  sweep                       N / (S + 1½)
//! ```
//!
//! The cuts and the operations depend on S and not on the number of threads, which share the segments among them: results
//! are the same to the last bit for any number.
//!
//! A link loses digits where C and the value function are large, which is where controls cost next to nothing. So at the end
//! the value function with which a segment was swept is compared with the one that the sweep of the next segment found at
//! the same knot. If they differ by more than rounding, or if anything failed before, the horizon is swept again as one.
#![allow(non_snake_case)] // the names of the literature

use super::conditional_value::{Link, SegmentValue, Value};
use super::node::{Hessian, LqKnot, LqNode};
use super::step::{Sizes, Step, SweepError};
use condyle_linalg::{SLACK, max_abs, threads};
use core::ops::Range;

/// The largest difference, relative to the largest entry, between the value function with which a segment was swept and the
/// one that was found in the next segment: the accuracy of a sweep, and a thousand times what robots show.
const CONSISTENT: f64 = 1e-9;

/// The segments of a horizon.
#[derive(Debug, Clone)]
pub(crate) struct Segments {
    /// All segments, in the order of the horizon; at least three.
    all: Vec<Segment>,
    link: Link,
}

/// A segment, with its workspace.
#[derive(Debug, Clone)]
struct Segment {
    /// The knots of the segment.
    knots: Range<usize>,
    step: Step,
    /// The conditional value function, together with the P and p of the step.
    value: SegmentValue,
    /// The value function at the knot after the segment.
    end: Value,
    /// The outcome of the sweep.
    result: Result<(), SweepError>,
    /// Whether the conditional value function was found.
    good: bool,
}

impl Segments {
    /// The segments for working on `at_once` of them at a time, in a horizon of `horizon` knots of such sizes; `None` if that
    /// is one, or the horizon too short for two.
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

    /// Whether a segment may contain a node: not where controls are bounded, since then the value function is not quadratic
    /// in a multiplier.
    fn serve(node: &LqNode) -> bool {
        !node.is_bounded()
    }

    /// The sweep; `None` if it must be done as one.
    pub(crate) fn run(
        &mut self,
        nodes: &[LqNode],
        knots: &mut [LqKnot],
        regularisation: f64,
    ) -> Option<Result<(), SweepError>> {
        if !nodes.iter().all(Self::serve) {
            return None;
        }
        let parallel = threads::threads() > 1;
        self.sweep(SegmentTask { pass: Pass::Begin, nodes, regularisation, parallel }, knots)
    }

    fn sweep(&mut self, begin: SegmentTask<'_>, knots: &mut [LqKnot]) -> Option<Result<(), SweepError>> {
        let last = self.all.len() - 1;
        begin.over(&mut self.all[1..], knots);
        if self.all[last].result.is_err() {
            return Some(self.all[last].result);
        }
        if !self.link() {
            return None;
        }
        SegmentTask { pass: Pass::Finish, ..begin }.over(&mut self.all[..last], knots);
        let consistent = |pair: &[Segment]| {
            let (end, found) = (&pair[0].end, &knots[pair[1].knots.start]);
            pair[0].result.is_ok() && end.is_near(found.Vxx.as_slice(), found.Vx.as_slice())
        };
        self.all.windows(2).all(consistent).then_some(Ok(()))
    }

    /// Finds the value function at the end of each segment but the last; says whether it did.
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
    /// Whether P, p equal Vxx, Vx but for rounding; false for a NaN.
    fn is_near(&self, Vxx: &[f64], Vx: &[f64]) -> bool {
        let n = Vx.len();
        let near = |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= CONSISTENT * scale);
        let (matrix, vector) = (max_abs(Vxx), max_abs(Vx));
        let columns = self.P.chunks_exact(n + SLACK).zip(Vxx.chunks_exact(n));
        columns.into_iter().all(|(a, b)| near(a, b, matrix)) && near(&self.p, Vx, vector)
    }
}

/// The pass that a task makes over a segment.
#[derive(Clone, Copy)]
enum Pass {
    /// The sweep of the last segment, and the conditional value function of others.
    Begin,
    /// The sweep, from the value function at the end of the segment.
    Finish,
}

/// A task that is done for each of some segments.
#[derive(Clone, Copy)]
struct SegmentTask<'a> {
    pass: Pass,
    /// The nodes of the whole horizon.
    nodes: &'a [LqNode],
    regularisation: f64,
    /// Whether segments are shared among threads.
    parallel: bool,
}

impl SegmentTask<'_> {
    /// Does the task for some of the segments, given all knots.
    fn over(self, segments: &mut [Segment], knots: &mut [LqKnot]) {
        self.run(segments, &mut knots[segments[0].knots.start..]);
    }

    /// Does the task for consecutive segments; `knots` begin with those of the first one.
    fn run(self, segments: &mut [Segment], knots: &mut [LqKnot]) {
        if let [segment] = segments {
            return self.run_one(segment, knots);
        }
        let (some, others) = segments.split_at_mut(segments.len() / 2);
        let (first, second) = knots.split_at_mut(others[0].knots.start - some[0].knots.start);
        if self.parallel {
            threads::join(|| self.run(some, first), || self.run(others, second));
        } else {
            self.run(some, first);
            self.run(others, second);
        }
    }

    /// Does the task for one segment, given its knots.
    fn run_one(self, segment: &mut Segment, knots: &mut [LqKnot]) {
        let Self { pass, nodes, regularisation, .. } = self;
        let Segment { knots: range, step, value, end, result, good } = segment;
        let (first, own) = (range.start, &nodes[range.clone()]);
        let no_curvature = &mut |_: usize, _: &[f64], _: &mut Hessian| false;
        match pass {
            Pass::Begin if range.end + 1 == nodes.len() => {
                *result = step.run(first, &nodes[first..], knots, regularisation, no_curvature);
            }
            Pass::Begin => *good = value.run(step, own, regularisation),
            Pass::Finish => {
                step.work.P.copy_from_slice(&end.P);
                step.work.p.copy_from_slice(&end.p);
                *result = step.back(first, own, knots, regularisation, no_curvature);
            }
        }
    }
}
