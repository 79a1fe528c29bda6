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
    /// Number of measurements. With fewer than a hundred, p99 is the longest time.
    pub samples: usize,
}

/// Limits of a measurement.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// Maximum number of repetitions.
    pub repetitions: usize,
    /// Time after which no repetition begins; the first [`LEAST`] repetitions always run.
    pub time: Duration,
}

/// Minimum number of repetitions: enough to tell the median from an outlier.
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

/// Collects durations; `f` itself measures and returns each of them.
pub(crate) fn timed(effort: Effort, mut f: impl FnMut() -> Duration) -> Times {
    let (begin, mut times) = (Instant::now(), Vec::new());
    while times.len() < effort.repetitions && (times.len() < LEAST || begin.elapsed() < effort.time) {
        times.push(f().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    // The quantile is the smallest time that at least this share of all times does not exceed.
    let quantile = |part: f64| times[((part * times.len() as f64).ceil() as usize).clamp(1, times.len()) - 1];
    Times { p50: quantile(0.5), p99: quantile(0.99), samples: times.len() }
}
