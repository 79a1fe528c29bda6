//! Findings about a robot: warnings of the library, and values that cause numerical difficulties.

use crate::lines::{Kind, Lines};
use crate::terminal::{Style, styled};
use condyle::{Inertia, Model, neutral, tree::Body, tree::Warning};
use nalgebra::Matrix3;
use serde::Serialize;

/// Warning of the library or of this program.
#[derive(Serialize)]
pub(crate) struct Finding {
    /// Category of the finding, one of [`KINDS`].
    pub kind: &'static str,
    /// Name of the body, joint or element that the finding is about.
    pub name: String,
    /// File that contains the element, if this is an included file; `None` for the robot's own file.
    pub file: Option<String>,
    pub line: Option<u32>,
    pub what: String,
}

/// Kinds of findings, in the order of the report: first the kinds of the library, then the kinds of this program.
pub(crate) const KINDS: [&str; 13] = [
    "unknown",
    "left_out",
    "assumed",
    "mimic",
    "massless",
    "negative",
    "triangle",
    "singular",
    "unlikely",
    "limit",
    "mass_ratio",
    "moment_ratio",
    "neutral",
];
/// Heading of each kind in [`KINDS`].
const HEADINGS: [&str; 13] = [
    "unknown, misspelt or misplaced: no effect",
    "left out: a model cannot hold it",
    "assumed: missing in the file",
    "joints that could follow another joint, but move freely",
    "bodies that move and have no mass",
    "negative moments of inertia",
    "moments of inertia that no body can have",
    "joints that move nothing with inertia",
    "implausible inertias",
    "limits with which a joint cannot work",
    "masses far from the parent's",
    "moments of inertia far from the parent's",
    "limits that exclude the neutral position",
];

impl Finding {
    /// Creates a finding about an element of the robot's own file.
    fn own(kind: &'static str, name: &str, line: Option<u32>, what: String) -> Self {
        Self { kind, name: name.to_owned(), file: None, line, what }
    }
}

/// Formats the findings, grouped by kind under headings. `source` is the path of the robot's file.
pub(crate) fn text(findings: &[Finding], source: &str) -> String {
    let mut text = String::new();
    for (kind, heading) in KINDS.into_iter().zip(HEADINGS) {
        let of_kind: Vec<&Finding> = findings.iter().filter(|finding| finding.kind == kind).collect();
        if of_kind.is_empty() {
            continue;
        }
        text += &format!("  {kind} ({}): {heading}\n", of_kind.len());
        for finding in of_kind {
            let file = finding.file.as_deref().unwrap_or(source);
            let place = finding.line.map_or(String::new(), |line| format!("{file}:{line}: "));
            text += &format!("    {}{}\n", styled(Style::Warn, &place), finding.what);
        }
    }
    text
}

/// Minimum ratio between the masses, or moments of inertia, of a body and its parent. A larger ratio is reported. Its
/// cause can be a wrong unit, or a light tip, which makes the inertia matrix ill-conditioned.
const APART: f64 = 1e3;
/// Excess over a limit that counts as a rounding error.
const ROUNDING: f64 = 1e-9;

/// Returns all findings, in the order of their line numbers.
pub(crate) fn of(model: &Model, lines: &Lines) -> Vec<Finding> {
    let mut found: Vec<Finding> = model.warnings().iter().map(|warning| warned(model, warning, lines)).collect();
    for (i, b) in model.bodies().iter().enumerate().skip(1) {
        let line = lines.of(Kind::Body, &b.name);
        found.extend(neighbours(model, i).map(|(kind, what)| Finding::own(kind, &b.name, line, what)));
        let line = lines.of(Kind::Joint, &b.joint_name);
        found.extend(
            neutral_outside(model, b).map(|what| Finding::own("neutral", &b.joint_name, line, what)), //
        );
    }
    found.sort_by_key(|finding| finding.line.unwrap_or(u32::MAX));
    found
}

/// Converts a warning of the model to a finding with the line number of the element.
fn warned(model: &Model, warning: &Warning, lines: &Lines) -> Finding {
    let (kind, subject, mut what) = (warning.kind().name(), warning.subject(), warning.to_string());
    if let Some(place) = warning.place() {
        // Take the name between the backquotes: from ``joint `loop` ``, take `loop`.
        let name = subject.split('`').nth(1).unwrap_or(subject).to_owned();
        what.drain(..format!("{place}: ").len());
        return Finding { kind, name, file: Some(place.file.clone()), line: Some(place.line), what };
    }
    if let Warning::Massless { body } = warning {
        let number = model.bodies().iter().position(|b| b.name == *body);
        if number.is_some_and(|i| model.bodies().iter().all(|b| b.parent != i)) {
            what += ", at the tip of its limb";
        }
    }
    let line = lines.of(Kind::Body, subject).or_else(|| lines.of(Kind::Joint, subject));
    let line = if kind == "singular" || kind == "limit" { lines.of(Kind::Joint, subject).or(line) } else { line };
    Finding::own(kind, subject, line, what)
}

/// Returns a finding if the mass of a body differs from its parent's mass by a large factor. Otherwise compares the
/// largest moments of inertia in the same way.
fn neighbours(model: &Model, i: usize) -> Option<(&'static str, String)> {
    let (b, parent) = (&model.bodies()[i], &model.bodies()[model.bodies()[i].parent]);
    if b.parent == 0 {
        return None;
    }
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0).then(|| (x / y).max(y / x)).filter(|&ratio| ratio >= APART);
    let greatest = |b: &Body| moments(b.inertia).1[2];
    let say = |ratio: f64, what: &str, x: f64, y: f64, unit: &str| {
        let which = if x < y { "less" } else { "more" };
        let (own, on) = (&b.name, &parent.name);
        format!(
            "body `{own}`: its {what}, {x:.3e} {unit}, is {ratio:.1e} times {which} than the {y:.3e} of `{on}`, which carries it"
        )
    };
    let (m, n) = (b.inertia.mass, parent.inertia.mass);
    if let Some(ratio) = apart(m, n) {
        return Some(("mass_ratio", say(ratio, "mass", m, n, "kg")));
    }
    let (m, n) = (greatest(b), greatest(parent));
    apart(m, n).map(|ratio| ("moment_ratio", say(ratio, "greatest moment of inertia", m, n, "kg m²")))
}

/// Returns the text of a finding if a joint with one coordinate has limits that exclude its neutral position.
fn neutral_outside(model: &Model, b: &Body) -> Option<String> {
    if b.mimic.is_some() || b.joint.nq() != 1 {
        return None;
    }
    let (limits, joint) = (model.limits(), &b.joint_name);
    let (lower, upper, q) = (limits.lower[b.idx_q], limits.upper[b.idx_q], neutral(model)[b.idx_q]);
    let is_outside = lower < upper && (q < lower - ROUNDING || q > upper + ROUNDING);
    is_outside.then(|| format!("joint `{joint}`: the neutral position {q} is outside of its limits [{lower}, {upper}]"))
}

/// Returns the centre of mass (m), and the principal moments of inertia about the centre of mass (kg m²), smallest
/// first.
pub(crate) fn moments(I: Inertia<f64>) -> ([f64; 3], [f64; 3]) {
    if I.mass <= 0.0 {
        return ([0.0; 3], [0.0; 3]);
    }
    let com = I.mass_com.scale(1.0 / I.mass);
    let shift = Inertia::from_com(I.mass, com, condyle::Sym3::zero()).rotational; // I = I_c + m c×ᵀ c×
    let c = I.rotational - shift;
    let values = Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).symmetric_eigenvalues();
    let mut moments = [values[0], values[1], values[2]];
    moments.sort_by(f64::total_cmp);
    (com.to_array(), moments)
}
