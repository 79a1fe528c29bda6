//! Times of something that is repeated.

use serde::Serialize;
use std::time::{Duration, Instant};

/// The half and all but a hundredth of the measured times are below these (s).
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Times {
    #[serde(rename = "p50_s")]
    pub p50: f64,
    #[serde(rename = "p99_s")]
    pub p99: f64,
    /// How often it was measured; of fewer than a hundred times p99 is the longest.
    pub samples: usize,
}

/// How often and how long something is measured.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// The most repetitions.
    pub repetitions: usize,
    /// No repetition begins after this, but for the least number of them.
    pub time: Duration,
}

/// As few as tell a median from an outlier.
const LEAST: usize = 5;

/// Measures `f`, after one run that is not counted.
pub(crate) fn measure(effort: Effort, mut f: impl FnMut()) -> Times {
    f();
    timed(effort, || {
        let begin = Instant::now();
        f();
        begin.elapsed()
    })
}

/// Collects durations that `f` measures itself.
pub(crate) fn timed(effort: Effort, mut f: impl FnMut() -> Duration) -> Times {
    let (begin, mut times) = (Instant::now(), Vec::new());
    while times.len() < effort.repetitions && (times.len() < LEAST || begin.elapsed() < effort.time) {
        times.push(f().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    // the least time that so large a part of all of them does not exceed
    let quantile = |part: f64| times[((part * times.len() as f64).ceil() as usize).clamp(1, times.len()) - 1];
    Times { p50: quantile(0.5), p99: quantile(0.99), samples: times.len() }
}
