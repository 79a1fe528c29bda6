//! Times the ticks of a record, and the calls of its policy by another thread: `cargo bench -p condyle-benches --bench
//! mpc -- FILE [TICKS]`
//!
//! `benches/peers/mpc.py --records FOLDER` writes such files. The ticks are replayed without a pause. Another thread
//! calls the policy at 1 kHz meanwhile. The program prints the median and the 99th percentile of the durations.

use condyle::optimal::PolicyPublisher;
use condyle::optimal::record::{Record, Recorded};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Period of the calls of the policy.
const PERIOD: Duration = Duration::from_millis(1);

/// Returns the median and the 99th percentile of durations (µs).
fn percentiles(mut durations: Vec<Duration>) -> [f64; 2] {
    durations.sort_unstable();
    let last = durations.len().saturating_sub(1);
    [50, 99].map(|percent| durations.get(last * percent / 100).map_or(f64::NAN, |d| 1e6 * d.as_secs_f64()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<_> = std::env::args().filter(|argument| !argument.starts_with("--")).skip(1).collect();
    let Some(file) = arguments.first() else {
        println!("NOT RUN: expected the file of a record, from benches/peers/mpc.py --records FOLDER");
        return Ok(());
    };
    let most: usize = arguments.get(1).map_or(Ok(2000), |ticks| ticks.parse())?;
    let record: Record = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    match record.replay()? {
        None => println!("{} ticks, the same bits", record.ticks().len()),
        Some(difference) => println!("{difference}"),
    }
    let (mut ticks, mut calls) = (Vec::new(), Vec::new());
    while ticks.len() < most {
        let (mut problem, mut solver) = record.start()?;
        let mut publisher = PolicyPublisher::new(&problem)?;
        let (mut policy, over, x) = (publisher.policy(), AtomicBool::new(false), problem.x0().to_vec());
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| {
                let (mut durations, mut u, mut due) = (Vec::new(), Vec::new(), Instant::now());
                while !over.load(Ordering::Relaxed) {
                    let begin = Instant::now();
                    if policy.control_into(0.0, &x, &mut u).is_some() {
                        durations.push(begin.elapsed());
                        assert!(u.iter().all(|u| u.is_finite()), "{u:?}");
                    }
                    due += PERIOD;
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                }
                durations
            });
            for (k, tick) in record.ticks().iter().enumerate() {
                let begin = Instant::now();
                for call in &tick.calls {
                    call.make(&mut problem, &mut solver).ok();
                }
                publisher.publish(&problem, solver.solution(), 0.0).expect("the knots have durations");
                if k > 0 {
                    ticks.push(begin.elapsed());
                }
            }
            over.store(true, Ordering::Relaxed);
            calls.extend(reader.join().expect("the reader has not failed"));
        });
    }
    for (name, durations) in [("tick", ticks), ("call of the policy", calls)] {
        let count = durations.len();
        let [median, p99] = percentiles(durations);
        println!("{name}: median {median:.1} µs, p99 {p99:.1} µs ({count})");
    }
    Ok(())
}
