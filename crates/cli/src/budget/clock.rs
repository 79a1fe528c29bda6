//! Measures the time of repeated work.

use serde::Serialize;
use std::time::{Duration, Instant};

/// Median (p50) and 99th percentile (p99) of the measured times (s).
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Times {
    #[serde(rename = "p50_s")]
    pub p50: f64,
    #[serde(rename = "p99_s")]
    pub p99: f64,
    /// Number of measurements. If this number is less than a hundred, p99 is the longest time.
    pub samples: usize,
}

/// Limits of a measurement.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// Maximum number of repetitions.
    pub repetitions: usize,
    /// Duration after which no further repetition begins. The first [`LEAST`] repetitions always run.
    pub time: Duration,
}

/// Minimum number of repetitions. With fewer, an outlier could be the median.
const LEAST: usize = 5;

/// Measures the times of `f`. A first run of `f` is not measured.
pub(crate) fn measure(effort: Effort, mut f: impl FnMut()) -> Times {
    f();
    timed(effort, || {
        let begin = Instant::now();
        f();
        begin.elapsed()
    })
}

/// Calls `f` repeatedly and collects the durations that `f` measures and returns.
pub(crate) fn timed(effort: Effort, mut f: impl FnMut() -> Duration) -> Times {
    let (begin, mut times) = (Instant::now(), Vec::new());
    while times.len() < effort.repetitions && (times.len() < LEAST || begin.elapsed() < effort.time) {
        times.push(f().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    // The quantile is the smallest measured time t such that at least this fraction of all times is t or less.
    let quantile = |part: f64| times[((part * times.len() as f64).ceil() as usize).clamp(1, times.len()) - 1];
    Times { p50: quantile(0.5), p99: quantile(0.99), samples: times.len() }
}
