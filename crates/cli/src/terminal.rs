//! Writes text and tables to standard output, with colours if standard output is a terminal.

use std::io::{IsTerminal, Write};

/// Writes a text to standard output. A closed pipe, as after `| head`, is not an error.
pub(crate) fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    if out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_err() {
        std::process::exit(0);
    }
}

/// Writes a value to standard output as JSON.
pub(crate) fn say_json(value: &impl serde::Serialize) {
    // Serialization cannot fail here: numbers that are not finite become `null`.
    say(&(serde_json::to_string_pretty(value).unwrap_or_default() + "\n"));
}

/// Returns whether to print colours. They are printed if standard output is a terminal and `NO_COLOR` is not set
/// (no-color.org).
fn colours() -> bool {
    std::io::stdout().is_terminal()
        && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
        && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Style of a word.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Style {
    Bold,
    Faint,
    Good,
    Warn,
    Bad,
}

/// Returns the text with the terminal codes of a style. Without colours, returns the text unchanged.
pub(crate) fn styled(style: Style, text: &str) -> String {
    if !colours() {
        return text.to_owned();
    }
    let code = match style {
        Style::Bold => "1",
        Style::Faint => "2",
        Style::Good => "32",
        Style::Warn => "33",
        Style::Bad => "1;31",
    };
    format!("\x1b[{code}m{text}\x1b[0m")
}

/// Returns the text of a heading, with its style.
pub(crate) fn heading(text: &str) -> String {
    format!("\n{}\n", styled(Style::Bold, text))
}

/// Formats a number with at most five significant digits. A very small or very large number is written with three
/// digits and an exponent.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&x.abs()) {
        return format!("{x:.2e}");
    }
    let digits = (4 - x.abs().log10().floor() as i32).clamp(0, 8) as usize;
    let text = format!("{x:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Table with aligned columns. Columns of numbers are right-aligned, and all other columns left-aligned.
pub(crate) struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(head: &[&str]) -> Self {
        Self { head: head.iter().map(|&text| text.to_owned()).collect(), rows: Vec::new() }
    }

    pub(crate) fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// Returns the table as text. A column is right-aligned if most of its cells begin with a digit or a sign. The last
    /// column is not padded.
    pub(crate) fn text(&self) -> String {
        let columns = self.head.len();
        let lines = || std::iter::once(&self.head).chain(&self.rows);
        let cell = |line: &'_ Vec<String>, c: usize| line.get(c).cloned().unwrap_or_default();
        let widths: Vec<usize> = (0..columns).map(|c| lines().map(|l| width(&cell(l, c))).max().unwrap_or(0)).collect();
        let numeric = |c: usize| {
            let full: Vec<String> = self.rows.iter().map(|row| cell(row, c)).filter(|text| !text.is_empty()).collect();
            let number = |text: &&String| {
                text.starts_with(|x: char| x.is_ascii_digit() || "-+−<∞".contains(x)) && text.split(' ').count() <= 2
            };
            let numbers = full.iter().filter(number);
            2 * numbers.count() > full.len()
        };
        let right: Vec<bool> = (0..columns).map(numeric).collect();
        let mut text = String::new();
        for (number, line) in lines().enumerate() {
            let mut out = String::from(" ");
            for c in 0..columns {
                let (cell, room) = (cell(line, c), widths[c]);
                let fill = " ".repeat(room - width(&cell));
                out += " ";
                out += &if right[c] { fill + &cell } else { cell + &fill };
                out += " ";
            }
            let out = out.trim_end();
            text += &if number == 0 { styled(Style::Faint, out) } else { out.to_owned() };
            text += "\n";
        }
        text
    }
}

/// Returns the width of a text in characters, without colour codes.
fn width(text: &str) -> usize {
    let mut parts = text.split('\x1b');
    let first = parts.next().unwrap_or_default().chars().count();
    first + parts.map(|part| part.split_once('m').map_or(0, |(_, rest)| rest.chars().count())).sum::<usize>()
}
