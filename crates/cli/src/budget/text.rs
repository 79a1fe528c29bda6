//! Writes the report of `condyle budget` as text.

use super::clock::Times;
use super::{Arguments, Report, dynamics, solver};
use crate::terminal::{Style, Table, heading, styled};
use std::fmt::Write;

/// Width of the bar that represents a period, in characters.
const BAR: usize = 40;

/// Formats the p50 and p99 times of a horizon, in µs.
fn pair(times: Option<Times>) -> [String; 2] {
    times.map_or([String::new(), String::new()], |t| [format!("{:.1}", 1e6 * t.p50), format!("{:.1}", 1e6 * t.p99)])
}

/// Formats the p50 and p99 times of a horizon, divided by the number of knots, in µs.
fn per_knot(times: Option<Times>, knots: usize) -> [String; 2] {
    let each = |t: f64| format!("{:.3}", 1e6 * t / knots as f64);
    times.map_or([String::new(), String::new()], |t| [each(t.p50), each(t.p99)])
}

impl Report {
    pub(super) fn text(&self, arguments: &Arguments) -> String {
        let mut text = format!(
            "{}  nv = {}, {} core{}, vectors: {}\n",
            styled(Style::Bold, &self.robot),
            self.nv,
            self.cores,
            if self.cores == 1 { "" } else { "s" },
            self.level
        );
        for joint in &self.armature_added {
            text += &format!("  joint `{joint}` moves nothing with inertia: timed with armature\n");
        }
        text += &heading("A horizon of aba, aba_derivatives and rnea (µs)");
        text += &self.horizons();
        if let Some(row) = self.algorithms.first() {
            text += &heading(&format!("Algorithms, µs per knot (of {} knots)", row.knots));
            text += &per_algorithm(&self.algorithms);
        }
        text += &heading("An iteration of FDDP, from the last solution with a new initial state (µs)");
        if !self.contacts.is_empty() {
            text += &format!("  in contact: {}\n", self.contacts.join(", "));
        }
        text += &iterations(&self.iterations);
        text += &self.verdict(arguments);
        text
    }

    fn horizons(&self) -> String {
        let mut table =
            Table::new(&["knots", "single p50", "p99", "lanes p50", "p99", "threads p50", "p99", "per knot"]);
        for row in &self.horizons {
            let [single, lanes, threads] = [Some(row.single), Some(row.lanes), row.threads].map(pair);
            let best = row.threads.map_or(row.lanes.p50, |t| t.p50.min(row.lanes.p50));
            let each = format!("{:.2}", 1e6 * best / row.knots as f64);
            table.row([vec![row.knots.to_string()], single.into(), lanes.into(), threads.into(), vec![each]].concat());
        }
        table.text()
    }

    /// Returns text with bars that compare the computing time of each horizon with the period.
    fn verdict(&self, arguments: &Arguments) -> String {
        let Some(first) = self.verdicts.first() else { return String::new() };
        let mut text = heading(&match first.period_s {
            Some(period) => format!("Does it fit into {:.3} ms? ({}, p99)", 1e3 * period, first.name),
            None => format!("The highest rate ({}, p99)", first.name),
        });
        let out = &mut text;
        for v in &self.verdicts {
            let time = f64::from(arguments.iterations) * v.iteration_s;
            // Writing to a string cannot fail.
            let _ = match v.period_s {
                None => writeln!(out, "  {:>6} knots  {:9.3} ms  {:9.0} Hz", v.knots, 1e3 * time, v.highest_rate),
                Some(period) => {
                    let share = time / period;
                    let full = ((share * BAR as f64).round() as usize).min(BAR);
                    let bar = "█".repeat(full) + &"·".repeat(BAR - full);
                    let (style, word) = match v.fits {
                        Some(true) => (Style::Good, "fits"),
                        _ => (Style::Bad, "OVER"),
                    };
                    writeln!(
                        out,
                        "  {:>6} knots  {} {:6.1} %  {}  {} iterations per period, up to {:.0} Hz",
                        v.knots,
                        styled(style, &bar),
                        100.0 * share,
                        styled(style, word),
                        v.iterations_per_period.unwrap_or(0),
                        v.highest_rate
                    )
                }
            };
        }
        if let Some(largest) = first.largest_knots {
            let each = match arguments.iterations {
                1 => "an iteration".to_owned(),
                n => format!("{n} iterations"),
            };
            let _ = writeln!(out, "  {each} of about {largest} knots would just fit");
        }
        text
    }
}

fn per_algorithm(rows: &[dynamics::Row]) -> String {
    let mut table = Table::new(&["", "single p50", "p99", "lanes p50", "p99", "threads p50", "p99"]);
    for row in rows {
        let cells = [Some(row.single), Some(row.lanes), row.threads].map(|times| per_knot(times, row.knots));
        table.row([vec![row.name.to_owned()], cells.concat()].concat());
    }
    table.text()
}

fn iterations(rows: &[solver::Row]) -> String {
    let mut table = Table::new(&["", "knots", "one thread p50", "p99", "threads p50", "p99", "per knot", ""]);
    for row in rows {
        let [one, threads] = [Some(row.one), row.threads].map(pair);
        let each = format!("{:.2}", 1e6 * row.best().p50 / row.knots as f64);
        let note = if row.finite { String::new() } else { "not finite: times of failed steps".to_owned() };
        let head = vec![row.name.to_owned(), row.knots.to_string()];
        table.row([head, one.into(), threads.into(), vec![each, note]].concat());
    }
    table.text()
}
