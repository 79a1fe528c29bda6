//! Clock of a WebAssembly module, which its host provides, for example a browser.

use core::ops::Add;
use std::sync::OnceLock;
use std::time::Duration;

static CLOCK: OnceLock<fn() -> Duration> = OnceLock::new();

/// Sets the clock of all solves. The time of this clock must never decrease; in a browser it is `performance.now()`.
/// Only the first call has an effect.
///
/// Before the first call, the time is always zero. All [`Timings`](crate::Timings) are then 0, a
/// [`time_budget`](crate::Settings::time_budget) never ends a solve, and an [`Observer`](crate::Observer) is called
/// only after iterations.
pub fn set_clock(now: fn() -> Duration) {
    let _ = CLOCK.set(now);
}

/// Point in time of the host's clock.
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
