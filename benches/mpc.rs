//! Times the ticks of records, and the calls of their policies by another thread: `cargo bench -p condyle-benches
//! --bench mpc -- FILE … [TICKS] [--json]`
//!
//! `benches/peers/mpc.py --records FOLDER` writes such files. The ticks are replayed without a pause. Another thread
//! calls the policy at 1 kHz meanwhile. The program prints the median and the 99th percentile of the durations; with
//! `--json`, a line of JSON for each record. Paths begin in the folder `benches`.

use condyle::optimal::PolicyPublisher;
use condyle::optimal::record::{Record, Recorded};
use std::path::Path;
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
    let is_json = std::env::args().any(|argument| argument == "--json");
    let arguments: Vec<_> = std::env::args().filter(|argument| !argument.starts_with("--")).skip(1).collect();
    let (numbers, files): (Vec<_>, Vec<_>) = arguments.iter().partition(|a| a.parse::<usize>().is_ok());
    let most: usize = numbers.first().map_or(Ok(2000), |ticks| ticks.parse())?;
    if files.is_empty() {
        println!("NOT RUN: expected the file of a record, from benches/peers/mpc.py --records FOLDER");
    }
    files.into_iter().try_for_each(|file| measure(Path::new(file), most, is_json))
}

/// Replays a record until `most` ticks are timed, and prints the durations.
fn measure(file: &Path, most: usize, is_json: bool) -> Result<(), Box<dyn std::error::Error>> {
    let record: Record = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    let difference = record.replay()?.map(|difference| difference.to_string());
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
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let counts = [ticks.len(), calls.len()];
    let [tick, call] = [ticks, calls].map(percentiles);
    if is_json {
        let round = |numbers: [f64; 2]| numbers.map(|x| (100.0 * x).round() / 100.0);
        let (tick, call) = (round(tick), round(call));
        println!(
            "{}",
            serde_json::json!({
                "record": name, "difference": difference, "ticks": counts[0], "tick_us": tick,
                "policy_calls": counts[1], "policy_us": call,
            })
        );
        return Ok(());
    }
    println!("{name}: {}", difference.unwrap_or_else(|| "the same bits".to_owned()));
    for (name, count, [median, p99]) in [("tick", counts[0], tick), ("call of the policy", counts[1], call)] {
        println!("{name}: median {median:.1} µs, p99 {p99:.1} µs ({count})");
    }
    Ok(())
}
