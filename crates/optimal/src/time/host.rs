//! A clock that the host gives.

use core::ops::Add;
use std::sync::OnceLock;
use std::time::Duration;

static CLOCK: OnceLock<fn() -> Duration> = OnceLock::new();

/// Gives solves a clock, a time that never goes back: in a browser `performance.now()`. Only the first call counts.
///
/// Until then time stands still: all [`Timings`](crate::Timings) are 0, a [`time_budget`](crate::Settings::time_budget) is
/// never used up, and an [`Observer`](crate::Observer) is asked after iterations only.
pub fn set_clock(now: fn() -> Duration) {
    let _ = CLOCK.set(now);
}

/// A time of the host's clock.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Instant(Duration);

impl Instant {
    pub(crate) fn now() -> Self {
        Self(CLOCK.get().map_or(Duration::ZERO, |now| now()))
    }
    pub(crate) fn elapsed(self) -> Duration {
        Self::now().duration_since(self)
    }
    pub(crate) fn duration_since(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
    pub(crate) fn checked_add(self, duration: Duration) -> Option<Self> {
        self.0.checked_add(duration).map(Self)
    }
}

impl Add<Duration> for Instant {
    type Output = Self;
    fn add(self, duration: Duration) -> Self {
        Self(self.0 + duration)
    }
}
