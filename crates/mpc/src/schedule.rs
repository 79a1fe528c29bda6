//! Schedule of the feet: their swings in time, and the stances between them.

use crate::gait::Cycle;
use condyle_optimal::Schedule as KnotSchedule;

/// Difference below which two times are equal (s).
const EQUAL: f64 = 1e-6;

/// Time for which swings that have ended are kept (s), because a late foot continues its swing.
const KEPT: f64 = 0.2;

/// Number of swings for which memory is allocated.
const MOST_SWINGS: usize = 256;

/// Swing of a foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Swing {
    /// Index of the foot.
    pub foot: usize,
    /// Time at which the foot leaves the ground (s).
    pub start: f64,
    /// Time at which the foot lands (s).
    pub end: f64,
}

impl Swing {
    /// Returns the fraction of the swing that has elapsed at the time t.
    pub(crate) fn fraction(&self, t: f64) -> f64 {
        ((t - self.start) / (self.end - self.start)).clamp(0.0, 1.0)
    }
}

/// Swings of all feet from the present to the end of the horizon.
#[derive(Clone, Debug)]
pub(crate) struct FootSchedule {
    feet: usize,
    swings: Vec<Swing>,
    cycle: Cycle,
    /// Time at which the next period of the cycle begins (s).
    next: f64,
}

impl FootSchedule {
    /// Creates a schedule whose first period begins at the time `start` (s).
    pub(crate) fn new(cycle: Cycle, feet: usize, start: f64) -> Self {
        Self { feet, swings: Vec::with_capacity(MOST_SWINGS), cycle, next: start }
    }

    /// Creates the schedule of one period of a cycle, which begins at the time 0.
    pub(crate) fn of_cycle(cycle: Cycle, feet: usize) -> Self {
        let swings = cycle.swings.iter().map(|&(foot, start, end)| Swing { foot, start, end }).collect();
        Self { feet, swings, cycle, next: f64::INFINITY }
    }

    /// Returns the times at which swings begin or end (s), and the time 0.
    pub(crate) fn events(&self) -> impl Iterator<Item = f64> {
        core::iter::once(0.0).chain(self.swings.iter().flat_map(|swing| [swing.start, swing.end]))
    }

    /// Adds swings until the time `until` (s), and removes swings that ended long before the time `now`. Writes the
    /// switches of new swings to the schedule of the knots, where `index` gives the model of a stance.
    pub(crate) fn extend(&mut self, now: f64, until: f64, knots: &mut KnotSchedule, index: impl Fn(u32) -> usize) {
        self.swings.retain(|swing| swing.end > now - KEPT);
        knots.forget(now);
        while self.next < until && !self.cycle.swings.is_empty() {
            let (begin, end) = (self.next, self.next + self.cycle.period);
            let swings = self.cycle.swings.iter();
            let swings = swings.map(|&(foot, from, to)| Swing { foot, start: begin + from, end: begin + to });
            self.swings.extend(swings);
            self.next = end;
            self.write_switches(begin, end, knots, &index);
        }
    }

    /// Writes the changes of stance from one time to another (s).
    fn write_switches(&self, from: f64, to: f64, knots: &mut KnotSchedule, index: impl Fn(u32) -> usize) {
        let mut t = from;
        loop {
            let model = index(self.stance(t + EQUAL));
            if knots.model(t) != model {
                knots.switch(t, model).expect("a swing's times are finite");
            }
            match self.events().filter(|&event| event > t + EQUAL && event < to + EQUAL).min_by(f64::total_cmp) {
                Some(event) => t = event,
                None => break,
            }
        }
    }

    /// Replaces the gait. Feet in the air at the time `now` land as planned, and no other foot leaves the ground before
    /// they have landed.
    pub(crate) fn change(&mut self, cycle: Cycle, now: f64, knots: &mut KnotSchedule, index: impl Fn(u32) -> usize) {
        self.swings.retain(|swing| swing.start < now + EQUAL);
        self.next = self.swings.iter().fold(now, |time, swing| time.max(swing.end));
        self.cycle = cycle;
        let model = index(self.stance(now + EQUAL));
        knots.switch(now + 2.0 * EQUAL, model).expect("the time is finite"); // removes all later switches
        self.write_switches(now + 2.0 * EQUAL, self.next, knots, index);
    }

    /// Ends the swing of a foot at another time `end` (s), now or later. Later swings stay. Returns whether a swing was
    /// changed: the last one that began before `now`, unless the next swing of the foot begins before `end`.
    pub(crate) fn end_swing(&mut self, foot: usize, now: f64, end: f64) -> bool {
        let is_later = |swing: &Swing| swing.foot == foot && swing.start > now + EQUAL;
        if self.swings.iter().any(|swing| is_later(swing) && swing.start < end + EQUAL) {
            return false;
        }
        let begun = self.swings.iter_mut().filter(|swing| swing.foot == foot && swing.start <= now + EQUAL);
        let last = begun.max_by(|a, b| a.start.total_cmp(&b.start));
        last.map(|swing| swing.end = end).is_some()
    }

    /// Writes all changes of stance from the time `now` on to the schedule of the knots.
    pub(crate) fn rewrite(&self, now: f64, knots: &mut KnotSchedule, index: impl Fn(u32) -> usize) {
        knots.switch(now, index(self.stance(now))).expect("the time is finite"); // removes all later switches
        self.write_switches(now, self.next, knots, index);
    }

    /// Returns the swings of a foot, in the sequence of their times.
    pub(crate) fn swings_of(&self, foot: usize) -> impl Iterator<Item = Swing> {
        self.swings.iter().copied().filter(move |swing| swing.foot == foot)
    }

    /// Returns the swing of a foot that contains the time t.
    pub(crate) fn swing_at(&self, foot: usize, t: f64) -> Option<Swing> {
        self.swings_of(foot).find(|swing| swing.start <= t + EQUAL && t + EQUAL < swing.end)
    }

    /// Returns the feet on the ground at the time t, one bit for each foot.
    pub(crate) fn stance(&self, t: f64) -> u32 {
        (0..self.feet).filter(|&foot| self.swing_at(foot, t).is_none()).fold(0, |stance, foot| stance | 1 << foot)
    }
}
