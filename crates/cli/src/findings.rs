//! Findings about a robot: the model's own warnings, and what makes its numbers hard to work with.

use crate::lines::{Kind, Lines};
use crate::terminal::{Style, styled};
use condyle::{Inertia, Model, neutral, tree::Body, tree::Warning};
use nalgebra::Matrix3;
use serde::Serialize;

/// A warning of the library, or of this program.
#[derive(Serialize)]
pub(crate) struct Finding {
    /// One of [`KINDS`].
    pub kind: &'static str,
    /// Name of the body or joint, or the element.
    pub name: String,
    /// File, where it is not the robot's own; a robot may include others.
    pub file: Option<String>,
    pub line: Option<u32>,
    pub what: String,
}

/// The kinds of findings, in the order in which they are listed: the library's, then this program's.
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
/// The heading of each of [`KINDS`].
const HEADINGS: [&str; 13] = [
    "unknown, misspelt or misplaced: no effect",
    "left out: a model cannot hold it",
    "assumed: missing in the file",
    "joints that could follow another one and are free",
    "bodies that move and have no mass",
    "negative moments of inertia",
    "moments of inertia that no body has",
    "joints that move nothing with inertia",
    "inertias that cannot be meant",
    "limits with which a joint cannot work",
    "masses far from the parent's",
    "moments of inertia far from the parent's",
    "limits that exclude the neutral position",
];

impl Finding {
    /// A finding about the robot's own file.
    fn own(kind: &'static str, name: &str, line: Option<u32>, what: String) -> Self {
        Self { kind, name: name.to_owned(), file: None, line, what }
    }
}

/// The findings as text, those of each kind under a heading; `source` is the robot's file.
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

/// Masses, or moments of inertia, of a body and its parent so many times apart are suspicious: a wrong unit, or a tip that
/// makes M badly conditioned.
const APART: f64 = 1e3;
/// Beyond a limit by less than this is rounding.
const ROUNDING: f64 = 1e-9;

/// All findings, in the order of the file.
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

/// A warning of the model, with its line.
fn warned(model: &Model, warning: &Warning, lines: &Lines) -> Finding {
    let (kind, subject, mut what) = (warning.kind().name(), warning.subject(), warning.to_string());
    if let Some(place) = warning.place() {
        // ``joint `loop` `` names its element
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

/// Whether a body's mass, or else its greatest moment of inertia, is far from its parent's.
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
            "body `{own}`: its {what}, {x:.3e} {unit}, is {ratio:.1e} times {which} than the {y:.3e} of `{on}`, on which it sits"
        )
    };
    let (m, n) = (b.inertia.mass, parent.inertia.mass);
    if let Some(ratio) = apart(m, n) {
        return Some(("mass_ratio", say(ratio, "mass", m, n, "kg")));
    }
    let (m, n) = (greatest(b), greatest(parent));
    apart(m, n).map(|ratio| ("moment_ratio", say(ratio, "greatest moment of inertia", m, n, "kg m²")))
}

/// Whether the neutral position of a joint with one coordinate is outside of its limits.
fn neutral_outside(model: &Model, b: &Body) -> Option<String> {
    if b.mimic.is_some() || b.joint.nq() != 1 {
        return None;
    }
    let (limits, joint) = (model.limits(), &b.joint_name);
    let (lower, upper, q) = (limits.lower[b.idx_q], limits.upper[b.idx_q], neutral(model)[b.idx_q]);
    let is_outside = lower < upper && (q < lower - ROUNDING || q > upper + ROUNDING);
    is_outside.then(|| format!("joint `{joint}`: the neutral position {q} is outside of its limits [{lower}, {upper}]"))
}

/// The centre of mass (m), and the principal moments of inertia about it, least first (kg m²).
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
